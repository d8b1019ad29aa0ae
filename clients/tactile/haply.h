#ifndef KN_CLIENTS_HAPLY_H
#define KN_CLIENTS_HAPLY_H
// An Inverse3 or Minverse of Haply Robotics through their Inverse Service 3.5, which runs on this machine: three
// degrees of freedom with force, the orientation and buttons of a grip.
//
//     service                        this driver
//        --- inventory ------------->   which arm
//        <-- greeting, 0 N ----------
//        --- state ----------------->   pose to kneadd
//        <-- force ------------------   as soon as kneadd has one, at the latest after 1 ms
//        --- state ----------------->   ...
//
// The service answers every message with exactly one state, and forgets a force that is not renewed: one message is
// under way at a time, and zero force is sent, not silence. Untested on hardware and on the real service:
// tests/tactile/tool_haply.c is one made from their documentation.
#include "clients/tactile/haply_json.h"

struct lws_context;
struct lws;

#define KN_HAPLY_URL "ws://localhost:10001"
#define KN_HAPLY_PRESET "arm_front_centered" // the arm in front, its zero at the centre of its reach
#define KN_HAPLY_HOST 64

typedef struct kn_haply {
    kn_tactile base;
    char host[KN_HAPLY_HOST];
    int port;
    char wanted[KN_HAPLY_ID]; // "": the first arm
    const char *preset;
    // private
    kn_bridge *bridge;
    struct lws_context *context; // kept from the first opening on
    struct lws *wsi;
    char device_id[KN_HAPLY_ID]; // "": not known yet
    char *message;               // what has come of it
    size_t length;
    bool connected, greeted;
    bool in_flight, wanted_force; // a message has not been answered; there is a force to send
    bool unwatched, asked;
    int64_t greeted_ns, sent_ns; // 0: not yet; the last message
    int silent_ms;
    double force_n[3];
} kn_haply;

// ws://HOST:PORT. False for anything else.
bool kn_haply_url(const char *url, char host[KN_HAPLY_HOST], int *port);
// preset: borrowed. device_id: "" for the first arm. unwatched: give force without that proof.
void kn_haply_init(kn_haply *haply, const char *host, int port, const char *device_id, const char *preset,
                   bool unwatched);

// Whether somebody listens there, asked for 300 ms at most. False and one line in error.
bool kn_haply_reach(const char *host, int port, char *error, size_t error_size);

#endif
