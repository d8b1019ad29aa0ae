#ifndef KN_SERVER_EXCHANGE_H
#define KN_SERVER_EXCHANGE_H
// The exchange between the bus and the servo loop: the work of the main thread in every millisecond.
//
//     datagrams --> receiver --> mailboxes --> servo loop
//     bus <-------- publisher <------ records, touches <--'
//
// The daemon calls the exchange when a socket has datagrams and when the loop has ticked; tests/rig.h does so in
// virtual time. The exchange neither blocks nor sleeps.
#include "server/loop.h"
#include "server/publisher.h"
#include "server/receiver.h"
#include "server/sentinel.h"
#include "server/trace.h"

typedef struct kn_exchange {
    kn_receiver receiver; // the caller initialises the receiver and opens the publisher
    kn_publisher publisher;
    kn_loop *loop;         // servo loop; borrowed, as are `trace` and `sentinel`
    kn_trace *trace;       // trace file of the run; NULL: no trace
    kn_sentinel *sentinel; // sentinel thread; NULL: none
    // Change whose scene is published; NULL: the scene of the server's start is published.
    kn_scene_change *told;
    kn_force force[KN_PROBES_MAX]; // answer of the latest tick to each probe
} kn_exchange;

// Judge the datagrams, and post accepted poses to the loop.
void kn_exchange_hear(kn_exchange *exchange, const kn_batch *batch);

// Call after one tick or more. Publish the records and touches that wait, and end the sessions that fell silent. Return
// true when the loop has ended and its last record has been published.
bool kn_exchange_ticked(kn_exchange *exchange);

#endif
