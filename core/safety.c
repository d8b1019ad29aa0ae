#include "core/safety.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <string.h>

static const int guard_window = 20; // number of ticks within which three hits of the impulse guard are a fault
// braking begins above brake_m_s and ends below brake_release * brake_m_s, so that noise does not switch it on and off
static const double brake_release = 0.9;
static const double ramp_up_ms = 200.0; // time in which the device's watchdog raises its factor from 0 to 1

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }
static void zero(double v[3]) { v[0] = v[1] = v[2] = 0.0; }
static bool finite3(const double v[3]) { return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]); }

// Shorten v to at most `limit`. Return whether v was longer. A computed norm is rounded, so v is shortened further
// until |v| <= limit holds exactly.
static bool shorten(double v[3], double limit)
{
    if (norm(v) <= limit) return false;
    // scale by the largest component first: the square of a wild value may overflow
    double m = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    for (int i = 0; i < 3; i++) v[i] /= m;
    double n = norm(v);
    for (int i = 0; i < 3; i++) v[i] *= limit / n;
    while (norm(v) > limit)
        for (int i = 0; i < 3; i++) v[i] *= 1.0 - 1e-15;
    return true;
}

// Move v towards target by at most `step`. Return whether v has arrived.
static bool approach(double v[3], const double target[3], double step)
{
    double d[3] = {target[0] - v[0], target[1] - v[1], target[2] - v[2]};
    if (!shorten(d, step)) {
        memcpy(v, target, sizeof d);
        return true;
    }
    for (int i = 0; i < 3; i++) v[i] += d[i];
    return false;
}

const char *kn_fault_name(kn_fault fault)
{
    static const char *const names[] = {"none",           "pose silence", "impulse",        "non-finite",
                                        "emergency stop", "stopping",     "kneadd too slow"};
    return (unsigned)fault < sizeof names / sizeof *names ? names[fault] : "unknown fault";
}

const char *kn_fault_remedy(kn_fault fault)
{
    static const char *const remedies[] = {
        "nothing to do",
        "lift the tool clear of the object while poses flow",
        "start a new session or send recover, then lift the tool clear of the object",
        "reset the object, then lift the tool clear of it",
        "send recover, then lift the tool clear of the object",
        "restart the server",
        "lift the tool clear of the object while poses flow; if the fault returns, take a lower quality or fewer nodes",
    };
    return (unsigned)fault < sizeof remedies / sizeof *remedies ? remedies[fault] : "restart the server";
}

static double positive_or(double value, double otherwise) { return value > 0.0 ? value : otherwise; }

void kn_guard_init(kn_guard *g, double most_n_per_ms)
{
    *g = (kn_guard){.most_n_per_ms = positive_or(most_n_per_ms, 4.0), .age = {guard_window, guard_window}};
}

void kn_guard_age(kn_guard *g, int ticks)
{
    for (int i = 0; i < 2; i++) g->age[i] = ticks < guard_window - g->age[i] ? g->age[i] + ticks : guard_window;
}

kn_guard_result kn_guard_pass(kn_guard *g, const double asked_n[3], double allowed_n, double force_n[3])
{
    double step[3];
    for (int i = 0; i < 3; i++) step[i] = asked_n[i] - force_n[i];
    double asked = norm(step);
    if (asked <= allowed_n) {
        memcpy(force_n, asked_n, 3 * sizeof *force_n);
        return KN_GUARD_FREE;
    }
    // trip on a second hit in the opposite direction or on a third hit in the window, because the force then chatters;
    // trip on a change above twice the limit, because such a change has no physical cause
    bool alternates = g->age[0] < guard_window && kn_dot(step, g->step_n) < 0.0, again = g->age[0] == 0;
    bool wild = !(asked <= 2.0 * fmax(allowed_n, g->most_n_per_ms)); // also true if `asked` is NaN
    if (wild || alternates || (!again && g->age[1] < guard_window)) return KN_GUARD_TRIPPED;
    // cut the change to the allowed change; a second cut within one ms is no new hit
    approach(force_n, asked_n, allowed_n);
    if (again) return KN_GUARD_GOES_ON;
    memcpy(g->step_n, step, sizeof step);
    g->age[1] = g->age[0];
    g->age[0] = 0;
    return KN_GUARD_LIMITED;
}

static kn_safety_limits with_defaults(const kn_safety_limits *limits)
{
    kn_safety_limits l = *limits;
    l.clamp_n = positive_or(l.clamp_n, 3.3);
    // the default torque is that of a force of clamp_n at an arm of 5 cm: a hand holds a stylus about 5 cm from its tip
    l.torque_clamp_n_m = positive_or(l.torque_clamp_n_m, l.clamp_n * 0.05);
    l.guard_n_per_ms = positive_or(l.guard_n_per_ms, 4.0);
    l.brake_m_s = positive_or(l.brake_m_s, 1.2);
    l.brake_n_s_per_m = positive_or(l.brake_n_s_per_m, 1.5);
    l.force_scale = positive_or(l.force_scale, 1.0);
    if (l.hold_ms <= 0) l.hold_ms = 3;
    if (l.zero_ms <= l.hold_ms) l.zero_ms = l.hold_ms + 17;
    if (l.ramp_up_ms < 200) l.ramp_up_ms = 200;
    if (l.flow_ms <= 0) l.flow_ms = 200;
    return l;
}

void kn_safety_init(kn_safety *s, const kn_safety_limits *limits)
{
    memset(s, 0, sizeof *s);
    s->limits = with_defaults(limits);
    kn_guard_init(&s->guard, s->limits.guard_n_per_ms);
}

void kn_safety_relimit(kn_safety *s, const kn_safety_limits *limits)
{
    s->next = with_defaults(limits);
    s->relimiting = true;
}

static double ramp_down_ms(const kn_safety_limits *l) { return (double)(l->zero_ms - l->hold_ms); }

double kn_safety_slope(const kn_safety_limits *limits) { return fmax(0.5, limits->clamp_n / ramp_down_ms(limits)); }

const char *kn_safety_raised(const kn_safety_limits *limits, const kn_safety_limits *than)
{
    kn_safety_limits a = with_defaults(limits), b = with_defaults(than);
    if (a.clamp_n > b.clamp_n) return "device.clamp";
    if (a.torque_clamp_n_m > b.torque_clamp_n_m) return "device.torque_clamp";
    if (a.guard_n_per_ms > b.guard_n_per_ms) return "device.guard";
    if (ramp_down_ms(&a) < ramp_down_ms(&b)) return "device.zero"; // a shorter fade means a steeper force
    if (a.brake_m_s > b.brake_m_s) return "device.brake_speed";
    if (a.brake_n_s_per_m > b.brake_n_s_per_m) return "device.brake_damping";
    if (a.force_scale > b.force_scale) return "device.force_scale";
    if (a.hold_ms > b.hold_ms) return "device.hold";
    if (a.zero_ms > b.zero_ms) return "device.zero";
    if (a.ramp_up_ms < b.ramp_up_ms) return "device.ramp";
    return a.flow_ms < b.flow_ms ? "device.flow" : NULL;
}

// Return whether lifting the tool clears a fault.
static bool lifting_clears(kn_fault fault) { return fault == KN_FAULT_POSE_SILENCE || fault == KN_FAULT_OVERLOAD; }

// Return true if a fault replaces the present one. OVERLOAD replaces none, and any other fault replaces OVERLOAD.
static bool outranks(kn_fault fault, kn_fault stands)
{
    return fault != KN_FAULT_OVERLOAD && (stands < fault || stands == KN_FAULT_OVERLOAD);
}

void kn_safety_trip(kn_safety *s, kn_fault fault)
{
    // the first NONFINITE is counted even while an ESTOP hides it
    bool news = fault == KN_FAULT_NONFINITE && !s->nonfinite;
    s->nonfinite |= news;
    if (!s->latched || outranks(fault, s->fault)) {
        s->fault = fault;
        s->latched = true;
        news = true;
    }
    // count every fault once, when it appears; stopping the server does not count as a fault
    if (!news || fault == KN_FAULT_STOPPING) return;
    s->faults++;
    s->tripped[fault]++;
}

static void clear_fault(kn_safety *s)
{
    s->fault = KN_FAULT_NONE;
    s->latched = false;
}

// Begin a new session. It clears the faults POSE_SILENCE, OVERLOAD and IMPULSE of the last session. A force that is
// fading continues to fade.
static void open_session(kn_safety *s)
{
    if (lifting_clears(s->fault) || s->fault == KN_FAULT_IMPULSE) clear_fault(s);
    s->attached = false;
    s->silent_ms = s->flowing_ms = 0;
}

// Count the time without poses and the time with poses. Return for how many of the elapsed ms the gain must fade
// because poses are missing.
static int listen(kn_safety *s, bool fresh, bool leaving, int ms)
{
    const kn_safety_limits *l = &s->limits;
    int before = s->silent_ms < l->zero_ms ? s->silent_ms : l->zero_ms;
    int silent = before + ms - fresh; // a fresh pose has arrived within the last ms, even if this tick is late
    int faded_from = before > l->hold_ms ? before : l->hold_ms;
    s->silent_ms = fresh ? 0 : silent;

    if (silent >= l->zero_ms) { // the force must be zero by now, even if a ramp has not ended
        if (leaving) s->attached = false;
        else if (s->attached) kn_safety_trip(s, fresh ? KN_FAULT_OVERLOAD : KN_FAULT_POSE_SILENCE);
        s->gain = 0.0;
        zero(s->brake_n);
        s->flowing_ms = 0;
    }
    // count the time with poses from the first pose after a silence
    if (s->flowing_ms > 0) s->flowing_ms += ms;
    else if (fresh) s->flowing_ms = 1;
    if (s->flowing_ms > l->flow_ms) s->flowing_ms = l->flow_ms;
    return silent > faded_from ? silent - faded_from : 0;
}

// Apply the commands that a session, an operator or the server has given for this tick.
static void take_commands(kn_safety *s, const kn_safety_in *in)
{
    // a reset clears a non-finite fault, because the object starts anew
    if (in->reset) {
        s->attached = false;
        s->nonfinite = false;
        if (s->fault == KN_FAULT_NONFINITE) clear_fault(s);
    }
    // recover clears every fault except NONFINITE and STOPPING
    if (in->recover && s->latched && s->fault != KN_FAULT_NONFINITE && s->fault != KN_FAULT_STOPPING) {
        clear_fault(s);
        // if an ESTOP hid a NONFINITE, latch the NONFINITE again
        if (s->nonfinite) {
            s->fault = KN_FAULT_NONFINITE;
            s->latched = true;
        }
        // the probe leaves the model even while its force still fades, because the tool must engage again in air
        s->attached = false;
    }
    if (in->overload && (s->attached || in->live)) kn_safety_trip(s, KN_FAULT_OVERLOAD);
    if (in->estop) kn_safety_trip(s, KN_FAULT_ESTOP);
    if (in->stop) kn_safety_trip(s, KN_FAULT_STOPPING);
    // a change of the physics, or a held clutch, makes the force fade to zero
    if (in->change || in->clutch) s->yielding = s->gain > 0.0 || in->clutch;
}

static bool braked(const kn_safety *s) { return s->brake_n[0] != 0.0 || s->brake_n[1] != 0.0 || s->brake_n[2] != 0.0; }

// Return whether the hand feels live contact in this tick. If not, the last contact force is held or fades.
static bool rendering(const kn_safety *s)
{
    return s->attached && !s->latched && !s->braking && !s->yielding && !braked(s) && s->silent_ms == 0;
}

// Ramp the gain down or up. When the gain reaches 0, a change of the physics ends, and new limits come into use.
static void move_gain(kn_safety *s, bool clutch, int silence_ms, int ms)
{
    const kn_safety_limits *l = &s->limits;
    int fade_ms = s->latched || s->braking || s->yielding || !s->attached ? ms : silence_ms;
    double before = s->gain;
    // fade by the elapsed time; afterwards the force approaches the contact force slowly (rejoining)
    if (fade_ms > 0) {
        s->gain -= fade_ms / ramp_down_ms(l);
        s->rejoining = true;
    } else if (rendering(s)) {
        s->gain += 1.0 / l->ramp_up_ms; // a skipped tick does not count, because the hand did not feel it
    }
    // sums of 1/17 or 1/200 do not reach exactly 0 or 1, so round the gain there
    if (s->gain < 1e-9) s->gain = 0.0;
    if (s->gain > 1.0 - 1e-9) s->gain = 1.0;
    s->gain_drop = fmax(0.0, before - s->gain);
    if (s->gain == 0.0) s->yielding = clutch;
    // new limits wait until the hand feels no force
    if (s->relimiting && s->gain == 0.0 && !braked(s)) {
        s->limits = s->next;
        s->guard.most_n_per_ms = s->limits.guard_n_per_ms;
        s->relimiting = false;
    }
}

// Return whether the probe may enter the model: it is clear of the object, poses flow, and the hand feels no force.
static bool may_engage(const kn_safety *s, const kn_safety_in *in)
{
    bool way_back = !s->latched || lifting_clears(s->fault);
    bool settled = s->gain == 0.0 && s->gain_drop == 0.0 && !braked(s) && !s->braking;
    return way_back && settled && !in->overload && in->live && in->fresh && in->clear && !in->leaving &&
           s->flowing_ms >= s->limits.flow_ms;
}

// Attach the probe, starting from zero force.
static void engage(kn_safety *s)
{
    clear_fault(s);
    s->attached = true;
    s->rejoining = false;
    s->gap_ms = 0;
    kn_guard_init(&s->guard, s->limits.guard_n_per_ms);
    zero(s->force_n);
    zero(s->torque_n_m);
}

bool kn_safety_watch(kn_safety *s, const kn_safety_in *in)
{
    const kn_safety_limits *l = &s->limits;
    // count at most zero_ms + 1: after zero_ms without a tick the force is zero, and more time changes nothing
    int ms = in->elapsed_ms < 1 ? 1 : in->elapsed_ms < l->zero_ms + 1 ? in->elapsed_ms : l->zero_ms + 1;
    bool fresh = in->live && in->fresh;
    kn_guard_age(&s->guard, 1);
    s->gap_ms = s->gap_ms < l->zero_ms ? s->gap_ms + ms : l->zero_ms;

    if (in->opened) open_session(s);
    // watch the poses, then take the commands
    int silence_ms = listen(s, fresh, in->leaving, ms);
    take_commands(s, in);
    // while a pose silence fades the force, report POSE_SILENCE; if poses come back in time, this fault ends and is not
    // latched
    bool silent = s->attached && s->silent_ms > l->hold_ms && !in->leaving;
    if (!s->latched) s->fault = silent ? KN_FAULT_POSE_SILENCE : KN_FAULT_NONE;
    // brake a tool that is too fast
    double brake_above = l->brake_m_s * (s->braking ? brake_release : 1.0);
    s->braking = !s->latched && in->live && s->flowing_ms >= l->flow_ms && norm(in->velocity_m_s) > brake_above;

    // ramp the gain; detach the probe when a latched fault or braking has faded its force to 0; attach it when it may
    // engage
    move_gain(s, in->clutch, silence_ms, ms);
    if (s->gain == 0.0 && (s->latched || s->braking)) s->attached = false;
    if (!s->attached && may_engage(s, in)) engage(s);
    return s->attached;
}

// Pass the contact force through the impulse guard, and latch a fault if the guard trips. Return KN_FLAG_GUARD if the
// guard acted.
static int guard(kn_safety *s, const double force_n[3])
{
    // the allowed change grows with the time since the last live contact, gap_ms, for at most hold_ms and at most 3 ms
    const int most = s->limits.hold_ms < 3 ? s->limits.hold_ms : 3;
    int ms = s->gap_ms < 1 ? 1 : s->gap_ms < most ? s->gap_ms : most;
    kn_guard_result result = kn_guard_pass(&s->guard, force_n, s->guard.most_n_per_ms * ms, s->force_n);
    if (result == KN_GUARD_FREE) return 0;
    s->guards++;
    if (result == KN_GUARD_TRIPPED) kn_safety_trip(s, KN_FAULT_IMPULSE);
    return KN_FLAG_GUARD;
}

// Set the force and torque of the safety stage to those of the contact, as far as the guard allows. Return
// KN_FLAG_GUARD if the guard acted.
static int render(kn_safety *s, const double force_n[3], const double torque_n_m[3])
{
    int flags = 0;
    // rejoining: approach the contact force so slowly that the output changes by at most kn_safety_slope per ms,
    // although the gain also rises
    if (s->rejoining)
        s->rejoining =
            !approach(s->force_n, force_n, kn_safety_slope(&s->limits) - s->limits.clamp_n / s->limits.ramp_up_ms);
    else flags = guard(s, force_n);
    if (flags == 0) memcpy(s->torque_n_m, torque_n_m, sizeof s->torque_n_m);
    s->gap_ms = 0;
    return flags;
}

// Move the damping force of a fast hand towards its target. Damping force and fading contact force together change by
// at most kn_safety_slope per tick. Return true if this limit acted.
static bool brake(kn_safety *s, const kn_safety_in *in, double contact_n)
{
    double target[3] = {0};
    if (s->braking && s->silent_ms <= s->limits.hold_ms)
        for (int i = 0; i < 3; i++) target[i] = -s->limits.brake_n_s_per_m * in->velocity_m_s[i];
    shorten(target, s->limits.clamp_n);
    return !approach(s->brake_n, target, fmax(0.0, kn_safety_slope(&s->limits) - s->gain_drop * contact_n));
}

static int flags_of(const kn_safety *s, const kn_safety_in *in)
{
    int flags = 0;
    bool lifting_helps = !s->latched || lifting_clears(s->fault);
    if (s->attached && s->gain == 1.0 && !s->latched) flags |= KN_FLAG_ENGAGED;
    if (s->gain > 0.0 ? s->gain < 1.0 || s->latched : s->attached) flags |= KN_FLAG_RAMPING;
    if (s->latched) flags |= KN_FLAG_LATCHED;
    if (s->braking) flags |= KN_FLAG_BRAKE;
    if (!in->fresh) flags |= KN_FLAG_STALE;
    if (in->live && !s->attached && s->flowing_ms > 0 && !in->clear && lifting_helps) flags |= KN_FLAG_REENGAGE_LIFT;
    return flags;
}

int kn_safety_filter(kn_safety *s, const kn_safety_in *in, const double force_n[3], const double torque_n_m[3],
                     double out_force_n[3], double out_torque_n_m[3])
{
    int acted = 0;
    // finite: scale the contact to the hand; a non-finite number latches a fault, and the last good force fades
    double force[3], torque[3];
    for (int i = 0; i < 3; i++) {
        force[i] = s->limits.force_scale * force_n[i];
        torque[i] = s->limits.force_scale * torque_n_m[i];
    }
    if (!finite3(force) || !finite3(torque)) kn_safety_trip(s, KN_FAULT_NONFINITE);
    else if (rendering(s)) acted = render(s, force, torque);

    // clamp: shorten force and torque to their limits
    memcpy(force, s->force_n, sizeof force);
    memcpy(torque, s->torque_n_m, sizeof torque);
    bool clamped = shorten(force, s->limits.clamp_n);
    clamped |= shorten(torque, s->limits.torque_clamp_n_m);
    if (clamped && s->gain > 0.0) {
        s->clamps++;
        acted |= KN_FLAG_CLAMPED;
    }
    // count the ticks in which a ramp or braking acts, and move the damping force
    bool slewed = s->gain > 0.0 && (s->rejoining || s->gain < 1.0) && norm(force) > 0.0;
    if (s->braking || braked(s)) slewed |= brake(s, in, norm(force));
    s->slewed += slewed;
    s->brakes += s->braking;

    // gain: the output is the faded contact plus the brake, and never above the clamp
    for (int i = 0; i < 3; i++) {
        out_force_n[i] = s->gain * force[i] + s->brake_n[i];
        out_torque_n_m[i] = s->gain * torque[i];
    }
    shorten(out_force_n, s->limits.clamp_n);
    return acted | flags_of(s, in);
}

void kn_watchdog_init(kn_watchdog *w, int hold_ms, int zero_ms)
{
    memset(w, 0, sizeof *w);
    w->hold_ms = hold_ms > 0 ? hold_ms : 3;
    w->zero_ms = zero_ms > w->hold_ms ? zero_ms : w->hold_ms + 17;
}

void kn_watchdog_rearm(kn_watchdog *w)
{
    w->tripped = w->armed = false;
    w->silent_ms = 0;
    w->factor = 0.0;
}

double kn_watchdog_tick(kn_watchdog *w, bool fresh, int elapsed_ms)
{
    if (w->tripped) return 0.0;
    // not armed: the first message arms the watchdog
    if (!w->armed) {
        w->armed = fresh;
        w->silent_ms = 0;
        return w->factor = fresh ? 1.0 : 0.0; // the server's own ramp starts at zero force
    }
    int ms = elapsed_ms < 1 ? 1 : elapsed_ms < w->zero_ms + 1 ? elapsed_ms : w->zero_ms + 1;
    int silent = w->silent_ms + ms - fresh;
    int faded_from = w->silent_ms > w->hold_ms ? w->silent_ms : w->hold_ms;
    w->silent_ms = fresh ? 0 : silent;
    // fade after hold_ms without a message, and trip at zero_ms; if messages come back in between, ramp the factor up
    if (silent >= w->zero_ms) {
        w->tripped = true;
        w->trips++;
        return w->factor = 0.0;
    }
    if (silent > faded_from) w->factor -= (silent - faded_from) / (double)(w->zero_ms - w->hold_ms);
    else if (fresh) w->factor += 1.0 / ramp_up_ms;
    return w->factor = fmin(fmax(w->factor, 0.0), 1.0);
}
