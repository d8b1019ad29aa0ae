#ifndef KN_CLIENTS_HAPLY_JSON_H
#define KN_CLIENTS_HAPLY_JSON_H
// What is said on the simulation channel of Haply's Inverse Service, version 3.5 (docs.haply.co, "WebSocket Protocol",
// "Control Commands", "Device Configuration"). Pure, but for jansson's memory.
//
//     service: {"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":..},"cursor_velocity":{..}, ..},
//               "status":{"calibrated":true, ..}}], "wireless_verse_grip":[{"state":{"orientation":{"w":..},
//               "buttons":{"a":..}}}], ..}
//     we:      {"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":{"vector":{"x":..,"y":..,"z":..}}}}]}
//
// Metres, m/s, newtons; right-handed, x to the right, y forward, z up: the scene's. The tool's orientation and buttons
// are those of a grip when there is one; body_orientation is how the arm's base stands on the desk, and not the tool's.
// 3.1 said "values" for "vector", which 3.5 still takes; a service of 3.1 does not know "vector".
#include "clients/tactile/bridge.h"

#define KN_HAPLY_ID 32       // bytes of a device id, its NUL included; [A-Za-z0-9_-]
#define KN_HAPLY_MESSAGE 512 // bytes of one of ours, at most

typedef struct kn_haply_state {
    char device_id[KN_HAPLY_ID];
    bool idle;       // control_mode: it gives no force
    bool calibrated; // else its position means nothing yet
    bool grip;       // pose has a grip's orientation and buttons
    kn_tactile_pose pose;
} kn_haply_state;

typedef enum kn_haply_heard {
    KN_HAPLY_STATE,
    KN_HAPLY_ABSENT,   // well formed, but without that device
    KN_HAPLY_MALFORMED // one line in error
} kn_haply_heard;

// device_id: which arm, "" for the first.
kn_haply_heard kn_haply_read(const char *text, size_t size, const char *device_id, kn_haply_state *state, char *error,
                             size_t error_size);
bool kn_haply_id_known(const char *device_id); // whether such an id can be

// Length of what is written, < KN_HAPLY_MESSAGE. The greeting names the session, fixes axes and preset, asks for 0 N.
int kn_haply_greet(char text[KN_HAPLY_MESSAGE], const char *device_id, const char *preset);
int kn_haply_push(char text[KN_HAPLY_MESSAGE], const char *device_id, const double force_n[3]);
int kn_haply_ask(char text[KN_HAPLY_MESSAGE]); // for the whole inventory again

#endif
