#ifndef KN_SERVER_HEALTH_REPORT_H
#define KN_SERVER_HEALTH_REPORT_H
// Reports of the health of the server, gathered from the counters of its modules. The messages status_t and health_t
// are published on KNEAD_STATUS and KNEAD_HEALTH, and `knead ctl status` prints them. Other reports are the lines of
// kneadd on stdout and stderr. Not real-time safe. Only kn_health_report_end may block: it waits for a circuit to catch
// up.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/exchange.h"
#include "server/keeper.h"
#include "server/rt.h"
#include "server/served_object.h"

typedef struct kn_health { // health of the server at one moment
    knead_status_t status;
    knead_health_t more;
    int32_t error_bits;            // ERROR_* bits of the last published status, and bits set since
    kn_force force[KN_PROBES_MAX]; // answer of the latest tick to each probe
} kn_health;

typedef struct kn_health_check {
    kn_served_object *served; // served object; borrowed, as are all modules below
    kn_loop *loop;
    const kn_exchange *exchange;
    const kn_keeper *keeper;
    const kn_rt *rt;
    const kn_bus *bus, *mesh_bus;
    int fd;           // socket of the bus; the kernel counts the datagrams that it drops
    bool estopped;    // true: an emergency stop is in force from the first tick on
    bool has_control; // true: kneadd has a control socket
    int64_t rest_ns;  // duration of a tick while nothing touches the object, ns
    int64_t start_ns;
    // The fields up to refusals_told are used by the main thread only.
    uint32_t drops_seen; // last value of the kernel's counter of dropped datagrams, which wraps at 2^32
    int64_t kernel_drops;
    int32_t service_errors; // ERROR_* bits of the disk and the circuit since the last fault
    int64_t faults_seen, saves_failed_told, circuit_failed_told, invalid_told;
    int32_t errors_told;
    // for each probe, its pose of a second ago: session, number, utime and arrival; and the errors that were told
    struct {
        int64_t session, accepted, utime, at_ns;
        int32_t told;
    } link[KN_PROBES_MAX];
    unsigned refusals_told; // reasons of rejection that have been reported, one bit per kn_pose_verdict
    // The fields below hold the values that were reported last. Only the mesh thread uses these fields. tick_told
    // begins at -1, quality_told at the scene's quality.
    int64_t tick_told, unpublished_told, missed_told, created_told;
    kn_quality quality_told;
    bool exhausted_told, lost_told;
} kn_health_check;

// Fill in all fields of `health` but `force`. The main thread calls kn_health_now, kn_health_publication and
// kn_health_report_refusals.
void kn_health_now(kn_health_check *c, kn_health *health);
// Fill in all fields of `health` but `force`, for the published messages. status.current_errors holds the errors since
// the last call of this function, so that each error is published once.
void kn_health_publication(kn_health_check *c, kn_health *health);
// Report rejected messages with a reason that usually concerns all messages of a sender: peer, mac, replayed, clock,
// type. Each reason is reported once.
void kn_health_report_refusals(kn_health_check *c);

// Print what is being served, and everything that prevents real-time operation, accuracy or authentication.
void kn_health_report_start(kn_health_check *c);
// Print what the servo and the sentinel have counted, and report to the systemd watchdog of kneadd.service. The mesh
// thread calls this function once a second.
void kn_health_report_second(kn_health_check *c);
// Print the totals of the run, when all threads have ended.
void kn_health_report_end(kn_health_check *c);

#endif
