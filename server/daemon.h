#ifndef KN_SERVER_DAEMON_H
#define KN_SERVER_DAEMON_H
// The threads of kneadd put together: main (poses in, forces out, on libev), servo, sentinel, mesh, control. From
// start to the end of the last thread; every other module is told here what it is
// lent.
#include "server/auth.h"
#include "server/receiver.h"
#include "server/rt.h"
#include "server/served.h"

#define KN_LCM_URL "udpm://239.255.76.67:7667?ttl=0"  // LCM's own group
#define KN_MESH_URL "udpm://239.255.76.67:7668?ttl=0" // by port: stock liblcm hears every group of its port
#define KN_LCM_LAN_URL "udpm://239.255.76.67:7667?ttl=1"
#define KN_MESH_LAN_URL "udpm://239.255.76.67:7668?ttl=1"

typedef struct kn_daemon_def {
    const kn_safety_limits *limits; // that no scene which is loaded may raise, NULL: those of the first
    kn_served_def object;
    const char *lcm_url;               // NULL: LCM_DEFAULT_URL of the environment, else KN_LCM_URL or KN_LCM_LAN_URL
    const char *mesh_url;              // NULL: KN_MESH_URL or KN_MESH_LAN_URL
    const char *control;               // path of the control socket (control.h), NULL: none
    const char *lan;                   // network interface of both buses, NULL: lo
    struct in_addr peer[KN_PEERS_MAX]; // whom poses are taken from
    int peers;                         // 0: anybody
    const char *key;                   // file of auth.h, NULL: none
    kn_rt_mode realtime;
    const char *trace; // a file for trace.h's rows, NULL: none
    bool estopped;     // an emergency stop of the life before stands from the first tick on
    bool later;        // not the first scene that it serves: rows go behind those of the one before
    bool free;         // the servo's grid does not follow the poses
    bool touch;        // publish KNEAD_TOUCH
} kn_daemon_def;

// Serves until SIGINT or SIGTERM: forces ramp to zero, threads end, a summary is printed. A second signal, 0.3 s
// later or more, ends the process at once. Returns the exit code: 0, 2 bad input, 3 the machine refuses (said in one
// line).
int kn_daemon_run(const kn_daemon_def *def);

#endif
