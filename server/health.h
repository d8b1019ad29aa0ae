#ifndef KN_SERVER_HEALTH_H
#define KN_SERVER_HEALTH_H
// The health of the server, gathered from the counters of its modules: status_t and health_t, as published on
// KNEAD_STATUS and KNEAD_HEALTH and as printed by `knead ctl status`. Used by the main thread only. Not real-time safe;
// no call blocks.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/keeper.h"
#include "server/loop.h"
#include "server/exchange.h"
#include "server/rt.h"
#include "server/sentinel.h"
#include "server/served.h"

typedef struct kn_health { // health of the server at one moment
    knead_status_t status;
    knead_health_t more;
    int32_t error_bits;            // ERROR_* bits of the last published status, and bits set since
    kn_force force[KN_PROBES_MAX]; // answer of the latest tick to each probe
} kn_health;

typedef struct kn_checkup {
    const kn_served *served; // served object; borrowed, as are all modules below
    kn_loop *loop;
    const kn_receiver *receiver;
    const kn_publisher *publisher;
    const kn_keeper *keeper;
    kn_sentinel *sentinel;
    const kn_rt *rt;
    int fd; // socket of the bus; the kernel counts the datagrams that it drops
    int64_t start_ns;
    // Private.
    uint32_t drops_seen; // last value of the kernel's counter of dropped datagrams, which wraps at 2^32
    int64_t kernel_drops;
    int32_t service_errors; // ERROR_* bits of the disk and the circuit since the last fault
    int64_t faults_seen, saves_failed_told, circuit_failed_told, invalid_told;
    int32_t errors_told;
} kn_checkup;

// Fill in everything but force.
void kn_checkup_now(kn_checkup *c, kn_health *health);
// Fill in everything but force, for publication. current_errors are the errors since the last call of this function, so
// that each error is published once.
void kn_checkup_tell(kn_checkup *c, kn_health *health);

// Return the number of datagrams that the kernel has dropped since the start.
int64_t kn_checkup_drops(kn_checkup *c);

#endif
