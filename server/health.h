#ifndef KN_SERVER_HEALTH_H
#define KN_SERVER_HEALTH_H
// How the server is, gathered from whoever counts: status_t and health_t, as KNEAD_STATUS and KNEAD_HEALTH have them
// and as `knead ctl status` tells them. Of the main thread alone: not real-time safe, no call blocks.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/keeper.h"
#include "server/loop.h"
#include "server/publisher.h"
#include "server/receiver.h"
#include "server/rt.h"
#include "server/sentinel.h"
#include "server/served.h"

typedef struct kn_health { // as of one moment
    knead_status_t status;
    knead_health_t more;
    int32_t error_bits;            // of status.current_errors, whether they were told on LCM or not
    kn_force force[KN_PROBES_MAX]; // of the latest tick
} kn_health;

typedef struct kn_checkup {
    const kn_served *served; // borrowed, as all that counts
    kn_loop *loop;
    const kn_receiver *receiver;
    const kn_publisher *publisher;
    const kn_keeper *keeper;
    kn_sentinel *sentinel;
    const kn_rt *rt;
    int fd; // of the bus, whose drops the kernel counts
    int64_t start_ns;
    // private
    uint32_t drops_seen; // the kernel's counter, which wraps
    int64_t kernel_drops;
    int32_t service_errors; // since the last fault: of disk and circuit
    int64_t faults_seen, saves_failed_told, circuit_failed_told, invalid_told;
    int32_t errors_told;
} kn_checkup;

// All but force.
void kn_checkup_now(kn_checkup *c, kn_health *health);
// The same with the errors since the last such call, which each tells once.
void kn_checkup_tell(kn_checkup *c, kn_health *health);

int64_t kn_checkup_drops(kn_checkup *c); // of the kernel, since the start

#endif
