#ifndef KN_SERVER_EXCHANGE_H
#define KN_SERVER_EXCHANGE_H
// The exchange between the bus and the servo loop: the main thread's part of every millisecond.
//
//     datagrams --> receiver --> mailboxes --> servo loop
//     bus <-------- publisher <------ records, touches <--'
//
// The daemon calls it when a socket has datagrams and when the loop has ticked; tests/rig.h does so in virtual time.
// It neither blocks nor sleeps.
#include "server/loop.h"
#include "server/publisher.h"
#include "server/receiver.h"
#include "server/sentinel.h"
#include "server/trace.h"

typedef struct kn_exchange {
    kn_receiver receiver; // the caller's to init, as the publisher is to open
    kn_publisher publisher;
    kn_loop *loop;                 // borrowed, as the next two
    kn_trace *trace;               // NULL: nobody traces
    kn_sentinel *sentinel;         // NULL: there is none
    kn_change *told;               // whose scene is told, NULL: that of the start
    kn_force force[KN_PROBES_MAX]; // of the latest tick
} kn_exchange;

// Judge what came, and post what is accepted to the loop.
void kn_exchange_hear(kn_exchange *exchange, const kn_batch *batch);

// After one tick or more: publish the records and touches that wait, and end the sessions that fell silent. Returns
// whether the loop has ended, its last record published.
bool kn_exchange_ticked(kn_exchange *exchange);

#endif
