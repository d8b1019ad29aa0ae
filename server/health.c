#include "server/health.h"
#include "server/backend/fpga.h"
#include "server/bus.h"
#include <string.h>

// The reasons for the loss of a circuit have the same numbers in the code and in the messages.
#define SAME_LOSS(name, word, what)                                                                                    \
    _Static_assert((int)KN_LOSS_##name == KNEAD_HEALTH_T_LOSS_##name, "reasons of a circuit's loss on the wire");
KN_LOSSES(SAME_LOSS)

int64_t kn_checkup_drops(kn_checkup *c)
{
    // The kernel's counter wraps at 2^32, so add up the differences modulo 2^32.
    uint32_t now = kn_bus_drops(c->fd);
    c->kernel_drops += (uint32_t)(now - c->drops_seen);
    c->drops_seen = now;
    return c->kernel_drops;
}

// Return the errors of disk and circuit since the last published status; the servo does not see these errors. They are
// kept in service_errors until the next fault.
static int32_t service_errors(kn_checkup *c, const kn_fpga_counts *circuit)
{
    int32_t errors = 0;
    if (atomic_load(&c->keeper->errors) > c->saves_failed_told) errors |= KNEAD_STATUS_T_ERROR_SNAPSHOT;
    if (circuit->reasons > c->circuit_failed_told) errors |= KNEAD_STATUS_T_ERROR_OFFLOAD_FAULT;
    c->service_errors |= errors;
    return errors;
}

static knead_status_t status_of(kn_checkup *c, const kn_fpga_counts *circuit)
{
    const kn_receiver *r = c->receiver;
    const kn_model *model = c->served->model;
    knead_status_t status = {.utime = kn_stamp_us(), .uptime_ms = (kn_now_ns() - c->start_ns) / 1000000};
    // Collect the counters of servo, sentinel, receiver, publisher and keeper.
    kn_account_status(&c->loop->account, &status);
    status.missed_explained = kn_sentinel_judge(c->sentinel, kn_now_ns());
    status.received = r->received;
    status.accepted = r->accepted;
    memcpy(status.rejected, r->rejected, sizeof r->rejected);
    status.kernel_drops = kn_checkup_drops(c);
    status.published = c->publisher->published;
    status.snapshot_age_ms = kn_keeper_age_ms(c->keeper);
    status.snapshot_errors = (int32_t)atomic_load(&c->keeper->errors);
    status.probes = model->def.probe_count;
    status.backend = circuit->there ? KNEAD_STATUS_T_BACKEND_FPGA
                     : model->fixed ? KNEAD_STATUS_T_BACKEND_FIXED
                                    : KNEAD_STATUS_T_BACKEND_CPU;
    // Set the DEGRADED_* bits for everything that keeps the server from its full quality.
    if (!c->rt->fifo) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_FIFO;
    if (!c->rt->locked) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_MLOCK;
    if (model->isa == KN_ISA_BASE) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_FMA;
    if (circuit->there && !circuit->in_step) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_FPGA;
    // After a new fault, keep only the errors since that fault.
    if (status.faults > c->faults_seen) c->service_errors = 0;
    c->faults_seen = status.faults;
    status.current_errors |= service_errors(c, circuit);
    status.last_errors |= c->service_errors;
    return status;
}

// Copy the counters of the circuit. circuit_last is -1 if there is no circuit or the circuit was never lost.
static void tell_circuit(const kn_fpga_counts *n, knead_health_t *health)
{
    health->circuit_last = -1;
    if (!n->there) return;
    health->circuit = n->in_step  ? KNEAD_HEALTH_T_CIRCUIT_IN_STEP
                      : n->behind ? KNEAD_HEALTH_T_CIRCUIT_BEHIND
                                  : KNEAD_HEALTH_T_CIRCUIT_LOST;
    health->circuit_ok = n->on_circuit;
    health->circuit_timeouts = n->timeouts;
    health->circuit_crc = n->crc;
    health->circuit_fallbacks = n->shadowed;
    health->circuit_losses = n->losses;
    health->circuit_different = n->different;
    health->circuit_loads = n->loads;
    for (int i = 0; i < KN_LOSS_COUNT; i++) health->circuit_because[i] = n->because[i];
    if (n->last != KN_LOSS_COUNT) health->circuit_last = (int32_t)n->last;
    health->circuit_rtt_us[0] = 1e-3 * (double)n->p50_ns;
    health->circuit_rtt_us[1] = 1e-3 * (double)n->p99_ns;
    health->circuit_rtt_us[2] = 1e-3 * (double)n->max_ns;
}

static knead_health_t health_of(const kn_checkup *c, const kn_fpga_counts *circuit, int64_t utime)
{
    knead_health_t health = {.utime = utime, .monotonic_us = kn_now_ns() / 1000};
    kn_account_health(&c->loop->account, &health);
    // Copy the link counters of each probe.
    for (int p = 0; p < c->receiver->probes; p++) {
        const kn_source *source = &c->receiver->source[p];
        const kn_packets *n = &source->packets;
        health.session[p] = source->last.session;
        health.accepted[p] = n->accepted;
        health.lost[p] = n->lost;
        health.late[p] = n->late;
        health.duplicate[p] = n->duplicate;
        health.reordered[p] = n->reordered;
        health.lost_in_a_row_max[p] = n->lost_in_a_row_max;
    }
    for (int p = c->receiver->probes; p < KN_PROBES_MAX; p++) health.success_rate[p] = 0;
    health.snapshots = atomic_load(&c->keeper->saves);
    health.snapshot_gen = atomic_load(&c->keeper->generation);
    health.snapshot_ms_last = 1e-3 * (double)atomic_load(&c->keeper->last_us);
    health.snapshot_ms_max = 1e-3 * (double)atomic_load(&c->keeper->most_us);
    tell_circuit(circuit, &health);
    return health;
}

// Fill in both messages from one reading of the circuit's counters, so that the messages agree.
static void look(kn_checkup *c, kn_health *health, kn_fpga_counts *circuit)
{
    kn_backend_fpga_counts(&c->served->backend, circuit);
    health->status = status_of(c, circuit);
    health->more = health_of(c, circuit, health->status.utime);
}

void kn_checkup_now(kn_checkup *c, kn_health *health)
{
    kn_fpga_counts circuit;
    look(c, health, &circuit);
    health->error_bits = c->errors_told | health->status.current_errors;
}

void kn_checkup_tell(kn_checkup *c, kn_health *health)
{
    kn_fpga_counts circuit;
    look(c, health, &circuit);
    // Add the errors that no tick sees: poses that were refused because of their values, and errors of disk and
    // circuit.
    const int64_t *rejected = c->receiver->rejected;
    int64_t invalid = rejected[KN_REJECT_NONFINITE] + rejected[KN_REJECT_QUATERNION] + rejected[KN_REJECT_WORKSPACE] +
                      rejected[KN_REJECT_JUMP];
    int32_t errors = kn_account_take_errors(&c->loop->account) | service_errors(c, &circuit);
    if (invalid > c->invalid_told) errors |= KNEAD_STATUS_T_ERROR_POSE_INVALID;
    // Remember the counts that have been reported, so that each error is reported once.
    c->invalid_told = invalid;
    c->saves_failed_told = atomic_load(&c->keeper->errors);
    c->circuit_failed_told = circuit.reasons;
    health->status.current_errors = health->error_bits = c->errors_told = errors;
}
