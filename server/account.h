#ifndef KN_SERVER_ACCOUNT_H
#define KN_SERVER_ACCOUNT_H
// What the servo did, in numbers: written by the servo thread in its tick, readable from any thread at any time.
// Plain stores of one writer through relaxed atomics: a reader may see one counter a tick ahead of another, never
// half a number. Fields are those of status_t and health_t, where their meaning stands.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/clock.h"
#include "server/servo.h"
#include <stdatomic.h>

#define KN_HISTOGRAM 32      // bucket n: < 2^n us; the last one holds all that is later
#define KN_RECENT_TICKS 100  // that success_rate speaks of
#define KN_WINDOW_TICKS 1000 // that rates and times of a window are of
#define KN_TRIPS 16          // places of health_t

typedef struct kn_spread { // of a value over a window
    int64_t count;
    double mean, square, min, max; // square: sum of squares about the mean
} kn_spread;

typedef struct kn_account {
    _Atomic int64_t tick, ticks, missed, overruns, unpublished, clamps, guards, faults, capped, created;
    _Atomic int64_t wakeup[KN_HISTOGRAM], execution[KN_HISTOGRAM];
    _Atomic int64_t late_loop_ns; // how long the latest loop that missed cycles took
    _Atomic double force_max_n, force_step_max_n, success_rate;
    _Atomic double budget_s;                           // of a tick; the loop tells it
    _Atomic double periodicity_hz[4], execution_us[4]; // mean, std, min, max of the last window
    _Atomic int64_t overrun_us;                        // since 1970, when the latest one began; 0: none
    _Atomic double probe_success[KN_PROBES_MAX];
    _Atomic int64_t trips[KN_TRIPS], audited;
    _Atomic double balance_j;
    _Atomic int32_t fault[KN_PROBES_MAX];
    _Atomic int32_t mode;
    _Atomic int32_t quality, asked; // kn_quality: in force; asked for
    atomic_bool exhausted;          // over its budget at the lowest point
    _Atomic int32_t errors;         // ERROR_* bits since they were last taken
    _Atomic int32_t last_errors;
    double last_force_n[KN_PROBES_MAX][3]; // the servo's own, as all below
    uint8_t good[KN_RECENT_TICKS];         // a bit per probe
    int good_count, probe_good[KN_PROBES_MAX], next;
    int64_t began_ns; // of the last tick; 0: there was none
    kn_spread period_s, busy_us;
    bool windowed; // a whole window has been
} kn_account;

void kn_account_init(kn_account *a);

// After a tick: published says whether its record was queued, execution_ns how long all of it took. Real-time safe.
void kn_account_tick(kn_account *a, const kn_servo *servo, const kn_tick_in *in, const kn_tick_out *out,
                     const kn_wake *wake, int64_t execution_ns, bool published);

// Fills the servo's fields.
void kn_account_status(const kn_account *a, knead_status_t *status);
void kn_account_health(const kn_account *a, knead_health_t *health);

// The errors since the last such call, so that each is told once.
int32_t kn_account_take_errors(kn_account *a);

#endif
