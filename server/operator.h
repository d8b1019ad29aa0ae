#ifndef KN_SERVER_OPERATOR_H
#define KN_SERVER_OPERATOR_H
// What an operator's requests mean, and what is answered: the JSON of the control socket (control.h), on its threads:
// snapshot, restore and undo, which wait for the disk, on its worker's, all others on its own.
//
//     {"command": "status"}                        how the server is
//     {"command": "reset"}                         the object is as new; what a hand felt fades, lift the tool
//     {"command": "quality", "name": "balanced"}   another of the scene's points; forces fade and come back
//     {"command": "recover"}                       latched faults are forgotten; lift the tool
//     {"command": "estop"}                         every force fades within 20 ms and stays 0 until recover
//     {"command": "snapshot"}                      the object as it is, on disk when this is answered
//     {"command": "restore", "generation": 12}     the object as in that snapshot, or in the newest
//     {"command": "undo"}                          the object as before it was kneaded last, reset or restored
//     {"command": "stop"}                          as SIGTERM
//
// Every other field than those is refused, so that no typing error does half of what was meant. A change is answered
// when a tick has made it, with that tick; KNEAD_EVENT tells the same to a log.
#include "proto/knead_status_t.h"
#include "server/control.h"
#include "server/keeper.h"
#include "server/loop.h"
#include "server/receiver.h"

typedef struct kn_health { // what the main thread knows, as of one moment
    knead_status_t status;
    int32_t error_bits;            // of status.current_errors, whether they were told on LCM or not
    kn_force force[KN_PROBES_MAX]; // of the latest tick
} kn_health;

typedef struct kn_operator {
    const kn_scene *scene;
    kn_loop *loop;
    kn_keeper *keeper;
    kn_mailbox health; // from the main thread
    kn_health health_slots[3];
    void (*ask)(void *arg); // makes the main thread post one; thread-safe
    void (*stop)(void *arg);
    void *arg;
} kn_operator;

void kn_operator_init(kn_operator *o, const kn_scene *scene, kn_loop *loop, kn_keeper *keeper);
kn_control_def kn_operator_control(kn_operator *o); // borrows it

#endif
