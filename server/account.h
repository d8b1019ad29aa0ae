#ifndef KN_SERVER_ACCOUNT_H
#define KN_SERVER_ACCOUNT_H
// Counters and rates of the servo loop. Only the servo thread writes them, in its tick and with relaxed atomic stores.
// Any thread may read them at any time. A reader may see one counter a tick ahead of another, but it never sees a
// half-written number. The fields mirror those of the messages status_t and health_t; see proto/ for their meaning.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/clock.h"
#include "server/servo.h"
#include <stdatomic.h>

#define KN_HISTOGRAM 32      // number of buckets; bucket n counts times < 2^n us, the last bucket also longer ones
#define KN_RECENT_TICKS 100  // number of latest ticks over which success_rate is computed
#define KN_WINDOW_TICKS 1000 // number of ticks over which periodicity_hz and execution_us are computed
#define KN_TRIPS 16          // length of the array trips[] in the message health_t

typedef struct kn_spread { // statistics of one quantity over a window of ticks
    int64_t count;
    double mean, square, min, max; // `square`: sum of the squared deviations from the mean
} kn_spread;

typedef struct kn_account {
    _Atomic int64_t tick, ticks, missed, overruns, unpublished, clamps, guards, faults, capped, created;
    _Atomic int64_t wakeup[KN_HISTOGRAM], execution[KN_HISTOGRAM];
    _Atomic int64_t late_loop_ns; // duration of the latest turn of the servo loop that missed cycles, ns
    _Atomic double force_max_n, force_step_max_n, success_rate;
    _Atomic double budget_s; // time budget of a tick (the scene's solver.budget), s; set by the loop
    // Rate and duration of ticks: mean, standard deviation, minimum and maximum over the last KN_WINDOW_TICKS ticks.
    _Atomic double periodicity_hz[4], execution_us[4];
    _Atomic int64_t overrun_us; // start of the latest overrun, us since 1970; 0: none
    _Atomic double probe_success[KN_PROBES_MAX];
    _Atomic int64_t trips[KN_TRIPS];
    _Atomic int64_t audited; // number of seconds that the energy audit has checked
    _Atomic double balance_j;
    _Atomic int32_t fault[KN_PROBES_MAX];
    _Atomic int32_t mode;
    _Atomic int32_t quality, asked; // quality: kn_quality in use; asked: kn_quality that was requested
    atomic_bool exhausted;          // true: ticks exceed budget_s although the lowest quality is in use
    _Atomic int32_t errors;         // ERROR_* bits since the last call of kn_account_take_errors
    _Atomic int32_t last_errors;
    double last_force_n[KN_PROBES_MAX][3]; // this field and all below: used by the servo thread only
    // Ring of the last KN_RECENT_TICKS ticks. Bit p is set if the tick was on time and probe p either had a fresh pose
    // or had no session.
    uint8_t good[KN_RECENT_TICKS];
    int good_count, probe_good[KN_PROBES_MAX], next;
    int64_t began_ns; // start of the last tick; 0: no tick yet
    kn_spread period_s, busy_us;
    bool windowed; // true if at least one whole window of KN_WINDOW_TICKS ticks has been completed
} kn_account;

void kn_account_init(kn_account *a);

// Update the counters and rates after a tick. `execution_ns`: time that the whole tick took. `published`: true if the
// tick's record was queued for the publisher. Real-time safe.
void kn_account_tick(kn_account *a, const kn_servo *servo, const kn_tick_in *in, const kn_tick_out *out,
                     const kn_wake *wake, int64_t execution_ns, bool published);

// Fill in the message fields whose values kn_account keeps, and leave all other fields alone.
void kn_account_status(const kn_account *a, knead_status_t *status);
void kn_account_health(const kn_account *a, knead_health_t *health);

// Return the ERROR_* bits since the last call and clear them, so that each error is reported once.
int32_t kn_account_take_errors(kn_account *a);

#endif
