#ifndef KN_CLIENTS_HAPLY_H
#define KN_CLIENTS_HAPLY_H
// Driver of an Inverse3 or Minverse of Haply Robotics through their Inverse Service 3.5, which runs on this machine:
// three degrees of freedom with force, plus the orientation and buttons of a grip.
//
//     service                        this driver
//        --- inventory ------------->   selects the arm
//        <-- greeting, 0 N ----------
//        --- state ----------------->   sends the pose to kneadd
//        <-- force ------------------   sent as soon as kneadd gives a force, at the latest after 1 ms
//        --- state ----------------->   ...
//
// The service answers every message with exactly one state, so the driver has at most one message under way. The
// service drops a force that is not renewed, so the driver also sends zero forces. tests/tactile/tool_haply.c imitates
// the service according to Haply's documentation.
#include "clients/tactile/bridge.h"

// ---- messages on the simulation channel (docs.haply.co); pure functions, except that jansson allocates memory
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

// Read one message of the service. device_id: id of the wanted arm; "": the first arm.
kn_haply_heard kn_haply_read(const char *text, size_t size, const char *device_id, kn_haply_state *state, char *error,
                             size_t error_size);
bool kn_haply_id_known(const char *device_id); // returns true if the text has the form of a device id

// Write a message of the client and return its length, < KN_HAPLY_MESSAGE. kn_haply_greet writes the greeting, which
// names the session, selects axes and preset, and sets a force of 0 N. kn_haply_push writes a message that sets the
// force `force_n`.
int kn_haply_greet(char text[KN_HAPLY_MESSAGE], const char *device_id, const char *preset);
int kn_haply_push(char text[KN_HAPLY_MESSAGE], const char *device_id, const double force_n[3]);
int kn_haply_ask(char text[KN_HAPLY_MESSAGE]); // writes a request for the whole inventory

// ---- driver

struct lws_context;
struct lws;

#define KN_HAPLY_URL "ws://localhost:10001"
#define KN_HAPLY_PRESET "arm_front_centered" // arm in front of the user, zero at the centre of its reach
#define KN_HAPLY_HOST 64                     // size of a host name with its NUL, bytes

typedef struct kn_haply {
    kn_tactile base;
    char host[KN_HAPLY_HOST];
    int port;
    char wanted[KN_HAPLY_ID]; // id of the wanted arm; "": the first arm
    const char *preset;
    // The fields below are used by haply.c only.
    kn_bridge *bridge;
    struct lws_context *context; // libwebsockets context, created when the device is first opened and kept afterwards
    struct lws *wsi;
    char device_id[KN_HAPLY_ID]; // id of the selected arm; "": not known yet
    char *message;               // received part of the present message; `length` bytes
    size_t length;
    bool connected, greeted;
    // in_flight: the service has not answered the last message yet; wanted_force: a force waits to be sent.
    bool in_flight, wanted_force;
    int silent_ms; // time since the last answer of the service
    double force_n[3];
} kn_haply;

// Split ws://HOST:PORT. Return false for any other form.
bool kn_haply_url(const char *url, char host[KN_HAPLY_HOST], int *port);
// Prepare the driver without connecting. preset: the text must outlive the driver. device_id: "" for the first arm.
void kn_haply_init(kn_haply *haply, const char *host, int port, const char *device_id, const char *preset);

// Return true if host:port accepts a connection within 300 ms per address. Otherwise return false and one line in
// `error`.
bool kn_haply_reach(const char *host, int port, char *error, size_t error_size);

#endif
