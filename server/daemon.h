#ifndef KN_SERVER_DAEMON_H
#define KN_SERVER_DAEMON_H
// The daemon creates the threads of kneadd and connects its modules: main (receives poses and publishes forces, on
// libev), servo, sentinel, mesh, control, worker (slow control requests) and keeper (snapshots). The daemon owns
// everything from the start to the end of the last thread, and each module borrows from the daemon.
#include "server/auth.h"
#include "server/receiver.h"
#include "server/rt.h"
#include "server/served_object.h"

#define KN_LCM_URL "udpm://239.255.76.67:7667?ttl=0" // LCM's default multicast group and port
// Bus of the meshes; it needs a port of its own, because stock liblcm receives every group on its port.
#define KN_MESH_URL "udpm://239.255.76.67:7668?ttl=0"
#define KN_LCM_LAN_URL "udpm://239.255.76.67:7667?ttl=1"
#define KN_MESH_LAN_URL "udpm://239.255.76.67:7668?ttl=1"

typedef struct kn_daemon_def {
    // Safety limits that a scene loaded later must not exceed; NULL: the limits of the first scene.
    const kn_safety_limits *limits;
    kn_served_object_def object;
    // LCM URL of the bus for poses and forces. NULL: use the environment variable LCM_DEFAULT_URL. If the variable is
    // not set either, use KN_LCM_URL without `lan`, and KN_LCM_LAN_URL with `lan`.
    const char *lcm_url;
    const char *mesh_url; // LCM URL of the bus for meshes; NULL: KN_MESH_URL without `lan`, KN_MESH_LAN_URL with `lan`
    const char *control;  // path of the control socket (control.h); NULL: none
    const char *lan;      // network interface of both buses; NULL: lo
    struct in_addr peer[KN_PEERS_MAX]; // addresses that poses are accepted from
    int peers;                         // number of entries in `peer`; 0: poses are accepted from any address
    const char *key;                   // path of the key file (auth.h); NULL: no key
    kn_rt_mode realtime;
    const char *trace; // path of the trace file (exchange.h); NULL: none
    // True: an emergency stop of the previous life (run) of kneadd is in force from the first tick on.
    bool estopped;
    bool later; // true: this is not the first scene of the process, so rows are appended to the trace file
    bool free;  // true: the servo's tick grid does not follow the poses (tick_timing.h)
    bool touch; // true: publish touch patches (KNEAD_TOUCH)
} kn_daemon_def;

// Serve until SIGINT, SIGTERM or SIGHUP. Then the forces ramp to zero, the threads end and a summary is printed. A
// second signal, more than 0.3 s later, ends the process at once. Return the exit code: 0; 2 for bad input; 3 if the
// machine refuses something that kneadd needs, for example a socket, a thread or memory. An error is reported in one
// line.
int kn_daemon_run(const kn_daemon_def *def);

#endif
