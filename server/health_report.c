#include "server/health_report.h"
#include "core/lattice/lattice.h"
#include "core/solver_fixed.h"
#include "server/backend/fpga.h"
#include "server/console.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

// longest acceptable tick of an untouched object, ns: half a period, because a tick with contact takes about twice as
// long
#define REST_TICK_NS 500000

// The reasons for the loss of a circuit have the same numbers in loss.h and in the message health_t.
#define SAME_LOSS(name, word, what)                                                                                    \
    _Static_assert((int)KN_LOSS_##name == KNEAD_HEALTH_T_LOSS_##name,                                                  \
                   "loss.h and health_t give each reason the same number");
KN_LOSSES(SAME_LOSS)

// Return the number of datagrams that the kernel has dropped since the start.
static int64_t kernel_drops(kn_health_check *c)
{
    // The kernel's counter wraps at 2^32, so add up the differences modulo 2^32.
    uint32_t now = kn_bus_drops(c->fd);
    c->kernel_drops += (uint32_t)(now - c->drops_seen);
    c->drops_seen = now;
    return c->kernel_drops;
}

// Return the ERROR_* bits of disk and circuit that occurred since the last published status. Add them to
// c->service_errors, which holds them until the next fault. The servo does not see these errors.
static int32_t service_errors(kn_health_check *c, const kn_fpga_counts *circuit)
{
    int32_t errors = 0;
    if (atomic_load(&c->keeper->errors) > c->saves_failed_told) errors |= KNEAD_STATUS_T_ERROR_SNAPSHOT;
    if (circuit->reasons > c->circuit_failed_told) errors |= KNEAD_STATUS_T_ERROR_OFFLOAD_FAULT;
    c->service_errors |= errors;
    return errors;
}

static knead_status_t status_of(kn_health_check *c, const kn_fpga_counts *circuit)
{
    const kn_receiver *r = &c->exchange->receiver;
    const kn_model *model = c->served->model;
    knead_status_t status = {.utime = kn_stamp_us(), .uptime_ms = (kn_now_ns() - c->start_ns) / 1000000};
    // Collect the counters of servo, sentinel, receiver, publisher and keeper.
    kn_account_status(&c->loop->account, &status);
    status.missed_explained = kn_sentinel_judge(c->exchange->sentinel, kn_now_ns());
    status.received = r->received;
    status.accepted = r->accepted;
    memcpy(status.rejected, r->rejected, sizeof r->rejected);
    status.kernel_drops = kernel_drops(c);
    status.published = c->exchange->publisher.published;
    status.snapshot_age_ms = kn_keeper_age_ms(c->keeper);
    status.snapshot_errors = (int32_t)atomic_load(&c->keeper->errors);
    status.probes = model->def.probe_count;
    status.backend = circuit->there ? KNEAD_STATUS_T_BACKEND_FPGA
                     : model->fixed ? KNEAD_STATUS_T_BACKEND_FIXED
                                    : KNEAD_STATUS_T_BACKEND_CPU;
    // Set the DEGRADED_* bits for everything that the server lacks: real-time priority, locked memory, fast
    // multiply-add, a circuit in step.
    if (!c->rt->fifo) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_FIFO;
    if (!c->rt->locked) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_MLOCK;
    if (model->isa == KN_ISA_BASE) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_FMA;
    if (circuit->there && !circuit->in_step) status.degraded |= KNEAD_STATUS_T_DEGRADED_NO_FPGA;
    // After a new fault, keep only the disk and circuit errors since that fault.
    if (status.faults > c->faults_seen) c->service_errors = 0;
    c->faults_seen = status.faults;
    status.current_errors |= service_errors(c, circuit);
    status.last_errors |= c->service_errors;
    return status;
}

// Copy the counters of the circuit. circuit_last is -1 if there is no circuit or the circuit was never lost.
static void copy_circuit(const kn_fpga_counts *n, knead_health_t *health)
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

static knead_health_t health_of(const kn_health_check *c, const kn_fpga_counts *circuit, int64_t utime)
{
    knead_health_t health = {.utime = utime, .monotonic_us = kn_now_ns() / 1000};
    kn_account_health(&c->loop->account, &health);
    // Copy the link counters of each probe.
    for (int p = 0; p < c->exchange->receiver.probes; p++) {
        const kn_pose_sender *source = &c->exchange->receiver.source[p];
        const kn_packets *n = &source->packets;
        health.session[p] = source->last.session;
        health.accepted[p] = n->accepted;
        health.lost[p] = n->lost;
        health.late[p] = n->late;
        health.duplicate[p] = n->duplicate;
        health.reordered[p] = n->reordered;
        health.lost_in_a_row_max[p] = n->lost_in_a_row_max;
    }
    for (int p = c->exchange->receiver.probes; p < KN_PROBES_MAX; p++) health.success_rate[p] = 0;
    health.snapshots = atomic_load(&c->keeper->saves);
    health.snapshot_gen = atomic_load(&c->keeper->generation);
    health.snapshot_ms_last = 1e-3 * (double)atomic_load(&c->keeper->last_us);
    health.snapshot_ms_max = 1e-3 * (double)atomic_load(&c->keeper->most_us);
    copy_circuit(circuit, &health);
    return health;
}

// Fill in status_t and health_t from one reading of the circuit's counters, so that the two messages agree.
static void look(kn_health_check *c, kn_health *health, kn_fpga_counts *circuit)
{
    kn_backend_fpga_counts(&c->served->backend, circuit);
    health->status = status_of(c, circuit);
    health->more = health_of(c, circuit, health->status.utime);
}

void kn_health_now(kn_health_check *c, kn_health *health)
{
    kn_fpga_counts circuit;
    look(c, health, &circuit);
    health->error_bits = c->errors_told | health->status.current_errors;
}

// Say what is wrong with the clock that stamped the poses, by its progress in a second; NULL: nothing.
static const char *clock_fault(double progress, int64_t utime)
{
    if (utime == 0) return "is 0";
    if (progress == 0) return "stands still";
    if (progress < 1e-4) return "is in seconds";
    if (progress < 0.1) return "is in milliseconds";
    if (progress > 10) return "is in nanoseconds";
    return fabs(1e-6 * (double)(kn_stamp_us() - utime)) > 86400 ? "is of another epoch, or the poses are a day old"
                                                                : NULL;
}

// Once a second, look at the poses of each session: whether they come often enough for the hold, and whether their
// utime is one. Tell each fault of a session once, and return the ERROR_* bits of the present ones.
static int32_t link_errors(kn_health_check *c)
{
    const kn_scene *scene = c->served->scene;
    int32_t all = 0;
    for (int p = 0; p < c->exchange->receiver.probes; p++) {
        const kn_pose_sender *source = &c->exchange->receiver.source[p];
        const char *name = c->served->model->def.probe[p].name;
        const int64_t session = source->last.session, count = source->packets.accepted - c->link[p].accepted;
        // by the time of the last pose: a hand that stops is no slow one
        const double took_ms = 1e-6 * (double)(source->heard_ns - c->link[p].at_ns), each_ms = took_ms / (double)count;
        if (session == c->link[p].session && took_ms < 900) continue;
        int32_t errors = 0;
        if (session != 0 && session == c->link[p].session && count > 1) {
            const char *clock =
                clock_fault(1e-3 * (double)(source->last.utime - c->link[p].utime) / took_ms, source->last.utime);
            if (each_ms > scene->limits.hold_ms + 0.5) errors |= KNEAD_STATUS_T_ERROR_POSE_RATE;
            if (clock) errors |= KNEAD_STATUS_T_ERROR_POSE_CLOCK;
            if (errors & ~c->link[p].told & KNEAD_STATUS_T_ERROR_POSE_RATE)
                kn_console_err("kneadd: %s: poses every %.3g ms, but the force is held for %d ms and fades: %s", name,
                               each_ms, scene->limits.hold_ms,
                               each_ms <= 15 ? "state device.rate in the scene" : "the least rate is 66.7 Hz");
            if (errors & ~c->link[p].told & KNEAD_STATUS_T_ERROR_POSE_CLOCK)
                kn_console_err("kneadd: %s: utime of the poses %s, expected microseconds since 1970", name, clock);
        }
        c->link[p].told = session == c->link[p].session ? c->link[p].told | errors : 0;
        c->link[p].session = session;
        c->link[p].accepted = source->packets.accepted;
        c->link[p].utime = source->last.utime;
        c->link[p].at_ns = source->heard_ns;
        all |= errors;
    }
    return all;
}

void kn_health_publication(kn_health_check *c, kn_health *health)
{
    kn_fpga_counts circuit;
    look(c, health, &circuit);
    // Add the errors that no tick sees: poses that were refused because of their values, and errors of disk and
    // circuit.
    const int64_t *rejected = c->exchange->receiver.rejected;
    int64_t invalid = rejected[KN_REJECT_NONFINITE] + rejected[KN_REJECT_QUATERNION] + rejected[KN_REJECT_WORKSPACE] +
                      rejected[KN_REJECT_JUMP];
    int32_t errors = kn_account_take_errors(&c->loop->account) | service_errors(c, &circuit) | link_errors(c);
    if (invalid > c->invalid_told) errors |= KNEAD_STATUS_T_ERROR_POSE_INVALID;
    // Remember the counts that have been reported, so that each error is reported once.
    c->invalid_told = invalid;
    c->saves_failed_told = atomic_load(&c->keeper->errors);
    c->circuit_failed_told = circuit.reasons;
    health->status.current_errors = health->error_bits = c->errors_told = errors;
}

// --- lines on stdout and stderr ---

void kn_health_report_refusals(kn_health_check *c)
{
    static const kn_pose_verdict told[] = {KN_REJECT_PEER, KN_REJECT_MAC, KN_REJECT_REPLAYED, KN_REJECT_CLOCK,
                                           KN_REJECT_TYPE};
    for (size_t i = 0; i < sizeof told / sizeof *told; i++) {
        if (c->exchange->receiver.rejected[told[i]] == 0 || c->refusals_told >> told[i] & 1) continue;
        c->refusals_told |= 1u << told[i];
        kn_console_err("kneadd: rejected a message, reason %s: %s; 'knead ctl status' shows the counts",
                       kn_pose_verdict_name(told[i]), kn_pose_verdict_meaning(told[i]));
    }
}

// Report missed cycles with the wording of ros2_control, which operators and their scripts know. Print at most one line
// a second, with the number of misses since the last line.
static void tell_overruns(kn_health_check *c)
{
    int64_t missed = atomic_load_explicit(&c->loop->account.missed, memory_order_relaxed);
    if (missed == c->missed_told) return;
    double loop_ms = 1e-6 * (double)atomic_load_explicit(&c->loop->account.late_loop_ns, memory_order_relaxed);
    kn_console_err("Overrun detected! The servo loop missed its desired rate of 1000 Hz. The loop took %.3f ms "
                   "(missed cycles : %" PRId64 ").",
                   loop_ms, missed - c->missed_told);
    c->missed_told = missed;
}

// Report that the object created energy. The simulation is then wrong. The hand does not feel the energy, because the
// passivity controller of each client keeps the force on the hand passive.
static void tell_audit(kn_health_check *c)
{
    int64_t created = atomic_load_explicit(&c->loop->account.created, memory_order_relaxed);
    if (created != c->created_told)
        kn_console_err(
            "kneadd: the object created energy in %" PRId64
            " audited seconds: it gave off more than it had stored or received, by more than %g %% of the work",
            created - c->created_told, 100 * KN_AUDIT_SHARE);
    c->created_told = created;
}

// Report to the systemd watchdog of kneadd.service once a second, if the servo ticks and the main thread takes the
// servo's records.
static void tell_alive(kn_health_check *c)
{
    const kn_account *a = &c->loop->account;
    int64_t now = atomic_load_explicit(&a->tick, memory_order_relaxed);
    int64_t lost = atomic_load_explicit(&a->unpublished, memory_order_relaxed);
    if (now > c->tick_told && lost == c->unpublished_told) sd_notify(0, "WATCHDOG=1");
    c->tick_told = now;
    c->unpublished_told = lost;
}

// Report that the quality has changed, or that no lower quality is left. A log has the same information from
// KNEAD_EVENT.
static void tell_quality(kn_health_check *c)
{
    kn_account *a = &c->loop->account;
    kn_quality now = (kn_quality)atomic_load_explicit(&a->quality, memory_order_relaxed),
               asked = (kn_quality)atomic_load_explicit(&a->asked, memory_order_relaxed);
    bool exhausted = atomic_load_explicit(&a->exhausted, memory_order_relaxed);
    double budget_ms = 1e3 * atomic_load_explicit(&a->budget_s, memory_order_relaxed);
    const char *before = kn_quality_name(c->quality_told), *name = kn_quality_name(now);
    if (now != c->quality_told && now == asked) kn_console_err("kneadd: quality %s -> %s, as commanded", before, name);
    else if (now != c->quality_told)
        kn_console_err(
            "kneadd: quality %s -> %s: %d consecutive ticks took more than %g ms; 'knead ctl quality %s' switches back",
            before, name, KN_OVER_TICKS, budget_ms, kn_quality_name(asked));
    if (exhausted && !c->exhausted_told)
        kn_console_err("kneadd: %d consecutive ticks took more than %g ms; the scene has no quality point below %s",
                       KN_OVER_TICKS, budget_ms, name);
    c->quality_told = now;
    c->exhausted_told = exhausted;
}

// Report that the circuit was lost or is in step again. This function is called once a second. If the circuit was lost
// and came back within this second, one line reports both, with the number of losses.
static void tell_losses(kn_health_check *c)
{
    char line[KN_FPGA_LINE];
    kn_fpga_counts n;
    if (!kn_backend_fpga_counts(&c->served->backend, &n)) return;
    bool lost = kn_backend_fpga_news(&c->served->backend, line);
    if (lost)
        kn_console_err("kneadd: circuit lost, %lld times so far: %s%s", (long long)n.reasons, line,
                       n.in_step ? "; it is in step again" : "");
    else if (c->lost_told && n.in_step)
        kn_console_err("kneadd: circuit in step again; its state was loaded %lld times so far", (long long)n.loads);
    c->lost_told = (lost || c->lost_told) && !n.in_step;
}

void kn_health_report_second(kn_health_check *c)
{
    tell_alive(c);
    tell_losses(c);
    tell_overruns(c);
    tell_audit(c);
    tell_quality(c);
}

// Print the settings that were restored from the last run.
static void tell_settings(FILE *out, const kn_settings *settings)
{
    char room[KN_SETTINGS_BYTES];
    const char *list[KN_SETTINGS_MAX];
    int count = kn_settings_list(settings, room, list);
    for (int i = 0; i < count; i++) fprintf(out, "%s%s", i == 0 ? "kneadd: settings restored: " : ", ", list[i]);
    if (count > 0) fputc('\n', out);
}

// Print what is being served, and everything that prevents real-time operation, accuracy or authentication.
static void tell_ready(kn_health_check *c, FILE *out)
{
    fprintf(out, "kneadd: serving %s, %d nodes", c->served->scene->name,
            c->served->model->node_count - kn_composite_tied(c->served->model));
    for (int p = 0; p < c->served->model->def.probe_count; p++)
        fprintf(out, ", probe %s", c->served->model->def.probe[p].name);
    fprintf(out, ", on %s, meshes on %s; %s, %s\n", c->bus->url, c->mesh_bus->url,
            c->rt->fifo ? "SCHED_FIFO" : "normal priority", c->rt->locked ? "memory locked" : "memory not locked");
    tell_settings(out, &c->served->settings);
    if (c->estopped)
        fprintf(out, "kneadd: an emergency stop is in force: every force stays 0 until %sknead ctl recover\n",
                c->has_control ? "" : "a start with --control and ");
    if (*c->rt->missing) fprintf(out, "kneadd: not real time: %s\n", c->rt->missing);
    if (c->exchange->receiver.auth)
        fprintf(out, "kneadd: poses must be signed with the key; forces are signed with the key\n");
    else if (c->exchange->receiver.peers > 0)
        fprintf(
            out,
            "kneadd: poses are accepted from %d addresses; this is no authentication, since an address can be forged\n",
            c->exchange->receiver.peers);
    if (c->served->model->isa == KN_ISA_BASE)
        fprintf(out, "kneadd: not real time: this processor has no fused multiply-add, so software computes it\n");
    if (c->served->helper) fprintf(out, "kneadd: two threads step the object\n");
    if (*c->served->alone) fprintf(out, "kneadd: one thread steps the object, not two: %s\n", c->served->alone);
    // The servo is already running and may lower the deadline, so print the deadline of the start.
    if (c->loop->measured_deadline > 0)
        fprintf(out, "kneadd: a step ends by its deadline of %" PRId64 " units of work\n", c->loop->measured_deadline);
    const kn_fixed_model *fixed = c->served->model->fixed;
    if (fixed && fixed->error > KN_FIXED_ERROR)
        fprintf(out,
                "kneadd: not accurate: %d passes of %d iterations leave %.2g %% of the force of a press unsolved, "
                "expected %g %% at most\n",
                c->served->model->def.solver.passes, c->served->model->def.solver.iterations, 100 * fixed->error,
                100 * KN_FIXED_ERROR);
    kn_fpga_counts circuit;
    if (kn_backend_fpga_counts(&c->served->backend, &circuit)) {
        fprintf(out,
                "kneadd: on a circuit: a tick without contact takes %.2g ms until its result arrives, loading a "
                "state takes %.2g s; the queue holds %lld ticks\n",
                1e-6 * (double)c->rest_ns, 1e-9 * (double)circuit.load_ns, (long long)circuit.queue);
        if (circuit.notice) fprintf(out, "kneadd: %s\n", circuit.notice);
        if (c->rest_ns > REST_TICK_NS)
            fprintf(
                out,
                "kneadd: expected at most %g ms per tick: the circuit will fall behind; then its twin on the processor "
                "gives the forces, or without a twin the last force is held\n",
                1e-6 * REST_TICK_NS);
    } else if (c->rest_ns > REST_TICK_NS)
        fprintf(
            out,
            "kneadd: not real time: a tick takes %.2g ms here without contact, expected %g ms at most; ticks will be "
            "missed and counted\n",
            1e-6 * (double)c->rest_ns, 1e-6 * REST_TICK_NS);
}

// Print the counters of the circuit. The circuit's final state is compared with its twin's.
static void tell_circuit(kn_health_check *c)
{
    kn_fpga_counts n;
    kn_device_stats link;
    char why[KN_LINK_WHY];
    if (!kn_backend_fpga_counts(&c->served->backend, &n)) return;
    bool agrees = kn_backend_fpga_agrees(&c->served->backend, why, &link);
    kn_console_err("kneadd: %lld ticks on the circuit, %lld by the twin alone; circuit lost %lld times, results "
                   "different %lld, states loaded %lld; at the end %s%s",
                   (long long)n.on_circuit, (long long)n.shadowed, (long long)n.losses, (long long)n.different,
                   (long long)n.loads, agrees ? "its state equals the twin's" : "", agrees ? "" : why);
    if (agrees)
        kn_console_err(
            "kneadd: the circuit's answers took %.0f us (p50), %.0f us (p99); %lld requests sent again, %lld frames "
            "damaged",
            1e-3 * (double)link.p50_ns, 1e-3 * (double)link.p99_ns, (long long)link.retries,
            (long long)(link.link.crc + link.link.coding));
}

// Print the totals of the run.
static void tell_summary(kn_health_check *c, FILE *out)
{
    kn_account *a = &c->loop->account;
    const kn_receiver *r = &c->exchange->receiver;
    fprintf(out,
            "kneadd: stopped after %" PRId64 " ticks, %" PRId64 " missed (%" PRId64
            " explained by the machine), %" PRId64 " overruns; %" PRId64 " published messages, %" PRId64
            " records not queued\n",
            a->ticks, a->missed, kn_sentinel_judge(c->exchange->sentinel, INT64_MAX), a->overruns,
            c->exchange->publisher.published, a->unpublished);
    const kn_sentinel *s = c->exchange->sentinel;
    fprintf(out,
            "kneadd: woken 1 ms late or more %" PRId64 " times (stalls explain %" PRId64
            "), 0.5 ms late or more %" PRId64 " times (%" PRId64 "); the sentinel was that late in %" PRId64
            " and %" PRId64 " of %" PRId64 " wakes\n",
            s->whole.count, s->whole.explained, s->half.count, s->half.explained, s->later, s->late, s->wakes);
    fprintf(out, "kneadd: %" PRId64 " datagrams: %" PRId64 " accepted", r->received, r->accepted);
    for (int i = 0; i < KN_REJECT_COUNT; i++)
        if (r->rejected[i]) fprintf(out, ", %" PRId64 " %s", r->rejected[i], kn_pose_verdict_name((kn_pose_verdict)i));
    fprintf(out, "; %" PRId64 " dropped by the kernel\n", kernel_drops(c));
    const kn_audit_news *audit = c->loop->audit ? kn_audit_read(c->loop->audit) : NULL;
    if (audit && audit->windows)
        fprintf(out,
                "kneadd: energy audited for %" PRId64 " s; energy created in %" PRId64
                " of them, %.3g mJ at most; at the end "
                "%.3g mJ stored of %.3g mJ of work\n",
                audit->windows, audit->created, 1e3 * audit->most_j, 1e3 * kn_energy_sum(&audit->stored),
                1e3 * audit->work_j);
    const kn_keeper *k = c->keeper;
    if (k->store.dir >= 0)
        fprintf(out,
                "kneadd: %" PRId64 " snapshots saved, the last with generation %" PRId64
                ", each in %.1f ms at most; %" PRId64 " saves failed\n",
                k->saves, k->store.generation, 1e-3 * (double)k->most_us, k->errors);
    if (c->exchange->trace->lost)
        fprintf(out, "kneadd: %" PRId64 " rows of the trace lost\n", c->exchange->trace->lost);
    if (c->loop->phase.driven)
        fprintf(out,
                "kneadd: phase lock: %" PRId64 " ticks with a tool to follow, %" PRId64
                " of them in step with the tool's poses, %" PRId64 " held back for a late pose\n",
                c->loop->phase.driven, c->loop->phase.followed, c->loop->phase.held);
    if (c->served->helper)
        fprintf(out, "kneadd: the second thread was in time for %.0f %% of its work\n",
                100 * kn_helper_share(c->served->helper));
}

// Print a text in whole lines, even if tell() writes a line in several pieces.
static void say_all(kn_health_check *c, void (*tell)(kn_health_check *, FILE *))
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    if (!out) return;
    tell(c, out);
    fclose(out);
    kn_console_lines(STDOUT_FILENO, text ? text : "");
    free(text);
}

void kn_health_report_start(kn_health_check *c) { say_all(c, tell_ready); }

void kn_health_report_end(kn_health_check *c)
{
    tell_circuit(c);
    say_all(c, tell_summary);
}
