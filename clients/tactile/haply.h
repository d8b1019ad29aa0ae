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
// service drops a force that is not renewed, so the driver also sends zero forces. The driver has not been tested with
// hardware or with the real service. tests/tactile/tool_haply.c imitates the service according to Haply's
// documentation.
#include "clients/tactile/haply_json.h"

struct lws_context;
struct lws;

#define KN_HAPLY_URL "ws://localhost:10001"
#define KN_HAPLY_PRESET "arm_front_centered" // arm in front of the user, zero at the centre of its reach
// Size of a host name with its NUL, bytes.
#define KN_HAPLY_HOST 64

typedef struct kn_haply {
    kn_tactile base;
    char host[KN_HAPLY_HOST];
    int port;
    char wanted[KN_HAPLY_ID]; // id of the wanted arm; "": the first arm
    const char *preset;
    // private
    kn_bridge *bridge;
    struct lws_context *context; // libwebsockets context, created when the device is first opened and kept afterwards
    struct lws *wsi;
    char device_id[KN_HAPLY_ID]; // id of the selected arm; "": not known yet
    char *message;               // the part of the present message that has been received, `length` bytes
    size_t length;
    bool connected, greeted;
    // in_flight: the service has not answered the last message yet; wanted_force: a force waits to be sent.
    bool in_flight, wanted_force;
    // unwatched: --no-watchdog was given. asked: the last message sent was the state request of the watchdog test.
    bool unwatched, asked;
    // greeted_ns: time of the greeting, 0 before the greeting. sent_ns: time of the last message sent.
    int64_t greeted_ns, sent_ns;
    int silent_ms; // time since the last answer of the service
    double force_n[3];
} kn_haply;

// Split ws://HOST:PORT. Return false for any other form.
bool kn_haply_url(const char *url, char host[KN_HAPLY_HOST], int *port);
// Prepare the driver without connecting. preset: the text must outlive the driver. device_id: "" for the first arm.
// unwatched: give force without first testing that the service drops a force that is not renewed.
void kn_haply_init(kn_haply *haply, const char *host, int port, const char *device_id, const char *preset,
                   bool unwatched);

// Return true if host:port accepts a connection within 300 ms per address. Otherwise return false and one line in
// `error`.
bool kn_haply_reach(const char *host, int port, char *error, size_t error_size);

#endif
