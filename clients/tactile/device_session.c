#include "clients/tactile/device_session.h"
#include <math.h>
#include <string.h>

static const int silence_ms = 1200; // duration of the mode SILENT; kneadd ends a session after 1 s without poses

void kn_device_session_init(kn_device_session *t, int64_t session, const kn_haptic_render_def *render)
{
    *t = (kn_device_session){.session = session, .tick = -1};
    kn_haptic_render_init(&t->render, render);
    kn_haptic_render_begin(&t->render, session);
    // The local model gives a force without new messages, and this force decays by itself. So with the local model, the
    // watchdog over kneadd's forces waits longer.
    kn_watchdog_init(&t->forces, render->local ? KN_HAPTIC_RENDER_LOCAL_HOLD_MS : 0,
                     render->local ? KN_HAPTIC_RENDER_LOCAL_ZERO_MS : 0);
    kn_watchdog_init(&t->poses, 0, 0);
}

static bool sane(const double v[3]) { return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]); }

// The session allows a force if three conditions hold: the mode is HELD, forces arrive, and the output stage has not
// faded the force to zero after a stop.
bool kn_device_session_live(const kn_device_session *t)
{
    bool stopped = t->render.stop && t->render.gain == 0.0;
    return t->mode == KN_SESSION_HELD && t->forces.armed && !t->forces.tripped && !stopped;
}

void kn_device_session_give(kn_device_session *t, double now_s)
{
    // Both watchdogs scale the force, so the force fades if either the device or kneadd is silent.
    double share = kn_device_session_live(t) ? t->forces.factor * t->poses.factor : 0.0;
    kn_haptic_render_give(&t->render, now_s - t->given_s, t->position_m, t->velocity_m_s, share);
    t->given_s = now_s;
    t->given = true;
}

bool kn_device_session_pose(kn_device_session *t, const double position_m[3], const double velocity_m_s[3])
{
    if (!sane(position_m) || !sane(velocity_m_s)) {
        t->refused++;
        return false;
    }
    t->fresh_pose = true;
    memcpy(t->position_m, position_m, sizeof t->position_m);
    memcpy(t->velocity_m_s, velocity_m_s, sizeof t->velocity_m_s);
    // While the mode is SILENT, the pose is kept but not sent, so that kneadd ends the session.
    if (t->mode == KN_SESSION_SILENT) return false;
    t->seq++;
    t->sent++;
    kn_haptic_render_pose(&t->render, t->seq, position_m, velocity_m_s);
    return true;
}

bool kn_device_session_take(kn_device_session *t, const knead_contact_force_t *force, double age_s)
{
    if (force->session != t->session || t->mode == KN_SESSION_SILENT) {
        t->foreign += force->session != t->session;
        return false;
    }
    // a recorded or repeated message
    if (force->tick <= t->tick) {
        t->late++;
        return false;
    }
    // Measure the round trip only with the first answer to each pose. Further answers to the pose come in later ticks,
    // so their age is more than the round trip.
    bool first = force->seq > t->answered && force->seq <= t->seq;
    if (!kn_haptic_render_force(&t->render, force->force_n, first ? age_s : -1.0)) {
        t->refused++;
        return false;
    }
    if (first) t->answered = force->seq;
    t->tick = force->tick;
    t->flags = force->flags;
    t->fault = force->fault;
    t->heard++;
    t->fresh_force = true;
    return true;
}

static void begin_anew(kn_device_session *t)
{
    t->mode = KN_SESSION_HELD;
    t->session++;
    t->seq = t->answered = 0;
    t->tick = -1;
    kn_haptic_render_begin(&t->render, t->session);
    kn_watchdog_rearm(&t->forces);
    kn_watchdog_rearm(&t->poses);
}

// Return true if the session must end, so that a new one can begin.
static bool wants_anew(kn_device_session *t)
{
    const kn_haptic_render *r = &t->render;
    // Lifting the tool does not clear a trip of kneadd's impulse guard; only a new session does.
    bool fault = t->fault == KN_FAULT_IMPULSE && (t->flags & KN_FLAG_LATCHED);
    bool near = r->stop == KN_HAPTIC_RENDER_FAR && r->round_trip_s < KN_HAPTIC_RENDER_NEAR_S;
    t->faults += fault;
    return fault || near || (r->stop == KN_HAPTIC_RENDER_REFLEX && r->gain == 0.0);
}

void kn_device_session_tick(kn_device_session *t, double now_s, int elapsed_ms)
{
    bool pose = t->fresh_pose, force = t->fresh_force, silent = false;
    t->fresh_pose = t->fresh_force = false;
    if (t->mode == KN_SESSION_HELD) {
        kn_watchdog_tick(&t->poses, pose, elapsed_ms);
        kn_watchdog_tick(&t->forces, force, elapsed_ms);
        silent = wants_anew(t) || t->poses.tripped || t->forces.tripped;
        if (silent) {
            t->mode = KN_SESSION_SILENT;
            t->silent_ms = silence_ms;
            t->stalled_ms = elapsed_ms;
            t->flags = t->fault = 0;
        }
    } else {
        // Wait until the silence has ended. The new session then begins with the next pose of the device.
        t->silent_ms = t->silent_ms > elapsed_ms ? t->silent_ms - elapsed_ms : 0;
        if (t->silent_ms == 0 && pose) begin_anew(t);
    }
    if (!t->given || silent || !t->render.def.local) kn_device_session_give(t, now_s);
    t->given = false;
}
