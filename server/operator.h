#ifndef KN_SERVER_OPERATOR_H
#define KN_SERVER_OPERATOR_H
// What an operator's requests mean, and what is answered: the JSON of the control socket (control.h), on its threads:
// what waits for the disk or builds a model (snapshot, restore, undo, set, load) on its worker's, all others on its
// own.
//
//     {"command": "status"}                        how the server is
//     {"command": "reset"}                         the object is as new; what a hand felt fades, lift the tool
//     {"command": "quality", "name": "balanced"}   another of the scene's points; forces fade and come back
//     {"command": "recover"}                       latched faults are forgotten; lift the tool
//     {"command": "estop"}                         every force fades within 20 ms and stays 0 until recover: over load,
//                                                  too, and with --state-dir over every restart. No tick in the
//                                                  answer: it came at the end, and stands from the next start on
//     {"command": "snapshot"}                      the object as it is, on disk when this is answered
//     {"command": "restore", "generation": 12}     the object as in that snapshot, or in the newest
//     {"command": "undo"}                          the object as before it was kneaded last, reset or restored
//     {"command": "set", "values": ["material.c1=3 kPa*s"]}
//                                                  keys of the scene, as --set; what they make of it is built aside,
//                                                  and the object goes on in it. Limits of the device only ever go down
//     {"command": "load", "scene": "/a/file.yaml"} checked; then an orderly end, and a start with that scene,
//                                                  or with the same one as its file is now
//     {"command": "stop"}                          as SIGTERM
//
// Every other field than those is refused, so that no typing error does half of what was meant. A change is answered
// when a tick has made it, with that tick; KNEAD_EVENT tells the same to a log.
#include "server/control.h"
#include "server/health.h"
#include "server/keeper.h"
#include "server/loop.h"
#include "server/receiver.h"
#include "server/served.h"

// What it works on, of the daemon.
typedef struct kn_operated {
    kn_served *served; // at the start, of
    const kn_served_def *def;
    const kn_safety_limits *limits; // which no load may raise
    kn_loop *loop;
    kn_keeper *keeper;
    const kn_skin *skin;        // whose mesh thread runs
    void (*ask)(void *arg);     // makes the main thread post its health; thread-safe, as the next
    bool (*goes_on)(void *arg); // with another start, when the loop is done
    void (*stop)(void *arg);
    void (*load)(void *arg, const char *path, const kn_scene *scene); // ends, to start with that one, as it is
    void (*built)(void *arg);                                         // memory has been taken that ticks will use
    void *arg;
} kn_operated;

typedef struct kn_operator {
    kn_operated on;
    kn_change *now, *before;   // that were taken, or are about to be; NULL: none. The worker's
    int64_t ordered;           // that takes now
    _Atomic(kn_change *) told; // whose scene the main thread tells
    int64_t served_ns;         // of a tick of it
    kn_sets sets;              // over served->base
    pthread_mutex_t setting;   // of them
    kn_mailbox health;         // from the main thread
    kn_health health_slots[3];
} kn_operator;

void kn_operator_init(kn_operator *o, const kn_operated *on);
void kn_operator_free(kn_operator *o);              // after every thread; one that is all 0 is fine
kn_control_def kn_operator_control(kn_operator *o); // borrows it

#endif
