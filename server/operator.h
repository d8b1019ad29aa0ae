#ifndef KN_SERVER_OPERATOR_H
#define KN_SERVER_OPERATOR_H
// The operator's commands: JSON requests of the control socket (control.h) and their answers. Requests that wait for
// the disk or build a model (snapshot, copy, restore, undo, set, load) run on the control socket's worker thread. All
// other requests run on the control socket's own thread.
//
//     {"command": "status"}                        report mode, counters, times and every probe
//     {"command": "reset"}                         restore the initial object; forces fade, lift the tool to engage
//     {"command": "quality", "name": "balanced"}   use this quality of the scene; forces fade and come back
//     {"command": "recover"}                       clear latched faults; lift the tool to engage again
//     {"command": "estop"}                         fade every force within 20 ms and keep it 0 until recover. The stop
//                                                  stays in force after load, and with --state-dir after every restart.
//                                                  If the answer has no tick, the server was ending, and the stop is in
//                                                  force from the next start on
//     {"command": "snapshot"}                      save the object; the answer comes when the file is on disk
//     {"command": "copy"}                          answer with the descriptor (SCM_RIGHTS) of a file in memory, which
//                                                  holds the object as a snapshot file; `scene`: hash of its text
//     {"command": "restore", "generation": 12}     return to that snapshot; without "generation", to the newest
//     {"command": "undo"}                          return to the object before the last press, reset or restore
//     {"command": "set", "values": ["material.c1=3 kPa*s"]}
//                                                  change keys of the scene, as --set does. A new model is built
//                                                  by the worker, then the object continues in it. Device limits can
//                                                  only be lowered
//     {"command": "load", "scene": "/a/file.yaml"} check a scene, shut down, start with this scene; without "scene",
//                                                  start again with the present file
//     {"command": "stop"}                          shut down cleanly, as SIGTERM does
//
// A request with any other field is refused, so that a typing error cannot carry out half a request. The answer to a
// change comes when a tick has made the change, and gives the number of that tick. An event on KNEAD_EVENT records the
// tick as well.
#include "server/control.h"
#include "server/health_report.h"
#include "server/keeper.h"
#include "server/loop.h"
#include "server/receiver.h"
#include "server/served_object.h"

// The parts of the daemon that commands act on. Every callback gets `arg` as its first argument. `ask` and `goes_on`
// are thread-safe.
typedef struct kn_operator_def {
    kn_served_object *served;        // object and scene at the start
    const kn_served_object_def *def; // options that `served` was loaded with
    const kn_safety_limits *limits;  // safety limits that a later `load` must not raise
    kn_loop *loop;
    kn_keeper *keeper;
    const kn_rt *rt;            // locks new memory that ticks will use, so that it is not swapped out
    const kn_skin *skin;        // skin (surface mesh) that the mesh thread publishes
    void (*ask)(void *arg);     // make the main thread post a health report
    bool (*goes_on)(void *arg); // return whether kneadd starts again when the loop has ended
    void (*stop)(void *arg);    // shut the server down cleanly
    void (*load)(void *arg, const char *path, const kn_scene *scene); // shut down, then start with this checked scene
    void *arg;
} kn_operator_def;

typedef struct kn_operator {
    kn_operator_def on;
    // `now`: latest change that was ordered; `before`: the change before `now`; NULL: none; used by the worker thread
    // only.
    kn_scene_change *now, *before;
    int64_t ordered;                 // number of the order (kn_orders_give) with which a tick applies `now`
    _Atomic(kn_scene_change *) told; // latest change whose scene the main thread has published; NULL: none
    int64_t served_ns;               // measured time of a tick of the served object, ns
    kn_settings settings;            // settings that override those of the scene served->base
    pthread_mutex_t setting;         // guards `settings`
    kn_mailbox health;               // health reports from the main thread
    kn_health health_slots[3];
} kn_operator;

void kn_operator_init(kn_operator *o, const kn_operator_def *on);
// Free the operator's memory, when all threads have ended; a zeroed operator is allowed.
void kn_operator_free(kn_operator *o);
kn_control_def kn_operator_control(kn_operator *o); // return the handlers of the control socket; borrows `o`

#endif
