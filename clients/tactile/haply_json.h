#ifndef KN_CLIENTS_HAPLY_JSON_H
#define KN_CLIENTS_HAPLY_JSON_H
// Reader and writer of the messages on the simulation channel of Haply's Inverse Service, version 3.5 (docs.haply.co,
// "WebSocket Protocol", "Control Commands", "Device Configuration"). The functions are pure, except that jansson
// allocates memory.
//
//     service: {"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":..},"cursor_velocity":{..}, ..},
//               "status":{"calibrated":true, ..}}], "wireless_verse_grip":[{"state":{"orientation":{"w":..},
//               "buttons":{"a":..}}}], ..}
//     client:  {"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":{"vector":{"x":..,"y":..,"z":..}}}}]}
//
// Units are m, m/s and N. The axes are right-handed like the scene's: x to the right, y forward, z up. A grip, if there
// is one (a wireless one before a wired one), gives the tool's orientation and buttons. body_orientation is the pose of
// the arm's base on the desk, not of the tool, and is ignored. Version 3.1 names the force "values" instead of
// "vector". Version 3.5 still accepts "values", but version 3.1 does not know "vector".
#include "clients/tactile/bridge.h"

#define KN_HAPLY_ID 32       // bytes of a device id, including NUL; [A-Za-z0-9_-]
#define KN_HAPLY_MESSAGE 512 // largest message of the client, bytes

typedef struct kn_haply_state {
    char device_id[KN_HAPLY_ID];
    bool idle;       // true: the arm's control_mode is "idle", so the arm gives no force
    bool calibrated; // false: the arm is not calibrated, so its position has no meaning yet
    bool grip;       // true: the fields of `pose` for orientation and buttons come from a grip
    kn_tactile_pose pose;
} kn_haply_state;

typedef enum kn_haply_heard {
    KN_HAPLY_STATE,
    KN_HAPLY_ABSENT,   // the message is well formed, but does not contain the wanted arm
    KN_HAPLY_MALFORMED // the message is malformed; `error` has one line
} kn_haply_heard;

// Read one message of the service. device_id: the wanted arm, or "" for the first arm.
kn_haply_heard kn_haply_read(const char *text, size_t size, const char *device_id, kn_haply_state *state, char *error,
                             size_t error_size);
bool kn_haply_id_known(const char *device_id); // returns true if the text has the form of a device id

// Write a message of the client and return its length, < KN_HAPLY_MESSAGE. kn_haply_greet writes the greeting: it names
// the session, selects axes and preset, and sets a force of 0 N. kn_haply_push writes a message that sets the force
// `force_n`.
int kn_haply_greet(char text[KN_HAPLY_MESSAGE], const char *device_id, const char *preset);
int kn_haply_push(char text[KN_HAPLY_MESSAGE], const char *device_id, const double force_n[3]);
int kn_haply_ask(char text[KN_HAPLY_MESSAGE]); // writes a request for the whole inventory

#endif
