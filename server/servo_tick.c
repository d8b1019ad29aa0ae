#include "server/servo.h"
#include "core/algebra/algebra.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "server/clock.h"
#include "server/operator_orders.h"
#include <math.h>
#include <stddef.h>
#include <string.h>

// Distance from the object above which a tool counts as lifted, m, if forces are held for 3 ms; for a longer hold_ms it
// is longer in proportion. When poses stop, the servo moves the tool on for hold_ms, and the object stays where the tool
// pushed it. When poses come back, a small gap is left between the object and the tool, although the hand never moved
// the tool. This gap must not count as lifting.
#define LIFTED_M 5e-4

// Read the pose and session of a probe, and fill the input of its safety watch.
static void read_probe(kn_tick *t, int p)
{
    kn_pose *last = &t->servo->last[p];
    const kn_pose *pose = t->in->pose[p];
    kn_safety_in *w = &t->watch[p];
    bool same = pose && pose->session == last->session;
    // end the old session before a new one opens
    if (last->session && !same) {
        kn_tick_event(t, KNEAD_EVENT_T_KIND_SESSION_END, p);
        // clear the session but keep the position, because the tool may still act on the object while its force fades
        last->session = 0;
    }
    // fill in the input of the safety watch (core/safety.h)
    w->live = pose != NULL;
    w->opened = pose && !same;
    w->fresh = pose && (t->in->fresh[p] || w->opened);
    w->stop = t->in->stop;
    w->reset = t->out->replaced;
    w->recover = t->in->recover;
    w->estop = t->in->estop;
    w->overload = t->servo->overloaded;
    w->change = t->change;
    w->elapsed_ms = t->in->missed < 1000 ? 1 + t->in->missed : 1000;
    // take the new pose, and move the tool to it if the clutch is not held
    if (w->opened) kn_clutch_open(&t->servo->clutch[p]);
    if (w->fresh) {
        *last = *pose;
        kn_clutch_move(&t->servo->clutch[p], last, &t->servo->tool[p]);
    }
    w->leaving = w->live && last->buttons & KN_BUTTON_LEAVING;
    w->clutch = w->live && t->servo->clutch[p].held;
    if (w->opened) kn_tick_event(t, KNEAD_EVENT_T_KIND_SESSION_OPEN, p);
    memcpy(w->velocity_m_s, t->servo->tool[p].velocity_m_s, sizeof w->velocity_m_s);
}

// Return the next lower quality point that takes less work and keeps lattice and precision. Return the present quality
// point if there is no such point.
static kn_quality next_lower(const kn_servo *servo)
{
    const kn_point *point = servo->scene->point;
    for (int q = (int)servo->quality - 1; q >= 0; q--)
        if (point[q].live && kn_servo_cheaper(&point[q].effort, &point[servo->quality].effort)) return (kn_quality)q;
    return servo->quality;
}

static bool has_points(const kn_scene *scene)
{
    return scene->point[KN_QUALITY_FAST].defined || scene->point[KN_QUALITY_BALANCED].defined ||
           scene->point[KN_QUALITY_ACCURATE].defined;
}

// Change to the quality point that an operator or the log requests. Otherwise change to a lower quality point after
// KN_OVER_TICKS ticks above the time budget.
static void judge_time(kn_tick *t)
{
    kn_servo *servo = t->servo;
    // count the consecutive ticks above the time budget
    bool over = (double)t->in->execution_ns > 1e9 * servo->scene->budget_s;
    if (!over) servo->over = 0;
    else if (servo->over < KN_OVER_TICKS) servo->over++;
    if (t->in->take != KN_QUALITY_CAUSE_NONE) {
        kn_orders_take_quality(t, t->in->quality, t->in->take == KN_QUALITY_CAUSE_COMMAND);
    } else if (servo->over == KN_OVER_TICKS && !t->in->stop && has_points(servo->scene)) {
        // if no lower quality point exists, next_lower() returns the present point; record this only once
        kn_quality to = next_lower(servo);
        if (to != servo->quality || !servo->exhausted) kn_orders_take_quality(t, to, false);
    }
}

// Begin an overload after KN_OVER_TICKS or more slow ticks in a row that together took KN_OVERLOAD_NS. End the overload
// with the first tick that is not slow. During an overload no tool acts on the object, so ticks are slow only if the
// object alone takes too long.
static void judge_overload(kn_tick *t)
{
    kn_servo *servo = t->servo;
    // sum up and count the consecutive slow ticks
    const bool slow = t->in->execution_ns > KN_PERIOD_NS;
    servo->slow_ns = slow ? servo->slow_ns + t->in->execution_ns : 0;
    servo->slow = !slow ? 0 : servo->slow < KN_OVER_TICKS ? servo->slow + 1 : KN_OVER_TICKS;
    const bool lasts = servo->slow == KN_OVER_TICKS && servo->slow_ns >= KN_OVERLOAD_NS;
    // in a replay there is no clock (execution_ns is 0), so only an event of the log ends an overload
    bool now = servo->overloaded ? t->in->execution_ns == 0 || slow : lasts;
    if (t->in->overload != 0) now = t->in->overload > 0;
    if (now == servo->overloaded) return;
    kn_event *e = kn_tick_event(t, KNEAD_EVENT_T_KIND_OVERLOAD, -1);
    e->arg[0] = now;
    e->arg[1] = 1e-9 * (double)t->in->execution_ns;
    servo->overloaded = now;
}

// Take a new deadline for the steps, in units of work, and record it as an event.
static void take_deadline(kn_tick *t)
{
    const int64_t to = t->in->deadline;
    if (to <= 0 || to == t->servo->deadline) return;
    kn_event *e = kn_tick_event(t, KNEAD_EVENT_T_KIND_DEADLINE, -1);
    e->arg[0] = (double)to;
    e->arg[1] = (double)t->servo->deadline;
    t->servo->deadline = to;
}

// Record a checkpoint with the energy audit and the servo's settings, so that a replay can start at this tick.
// `untold`: true if cycles were missed and no force record tells how many, because no probe has a session. The
// checkpoint then tells how many, because a log must account for every tick.
static void tell_checkpoint(kn_tick *t, bool untold)
{
    const kn_audit_news *audit = t->servo->audit;
    kn_event *e = kn_tick_event(t, KNEAD_EVENT_T_KIND_CHECKPOINT, -1);
    e->arg[0] = untold ? t->in->missed : 0;
    // record the present settings; the values in arg[7] begin at 1, because 0 means not recorded
    e->arg[5] = (double)t->servo->deadline;
    e->arg[6] = t->servo->overloaded;
    e->arg[7] = 1 + (int)t->servo->quality + KN_QUALITIES * (int)t->servo->asked;
    if (!audit) return;
    e->arg[1] = kn_energy_sum(&audit->stored);
    e->arg[2] = audit->work_j;
    e->arg[3] = audit->lost_j;
    e->arg[4] = (double)audit->created;
}

// Read all input of the tick: first commands, then the times of the last ticks, then poses.
static void read_all(kn_tick *t)
{
    kn_servo *servo = t->servo;
    int64_t before = t->in->tick - 1 - t->in->missed; // number of the previous tick
    if (servo->ticks == 0) kn_tick_event(t, KNEAD_EVENT_T_KIND_START, -1);
    kn_orders_apply(t);
    servo->still = servo->backend->still && servo->backend->still(servo->backend->self);
    if (t->in->stop && !servo->stopping) kn_tick_event(t, KNEAD_EVENT_T_KIND_STOP, -1);
    servo->stopping = t->in->stop;
    // quality, overload and deadline must be settled before the probes are watched and the lattice is stepped
    judge_time(t);
    judge_overload(t);
    take_deadline(t);

    bool any = false;
    for (int p = 0; p < t->out->probes; p++) {
        read_probe(t, p);
        any |= t->watch[p].live;
    }
    // record a checkpoint each second, at tick 0, and when no other record would tell that cycles were missed
    bool untold = t->in->missed > 0 && !any;
    if (t->in->tick / 1000 != before / 1000 || t->in->tick == 0 || untold) tell_checkpoint(t, untold);
}

static bool any_attached(const kn_tick *t)
{
    bool any = false;
    for (int p = 0; p < t->out->probes; p++) any |= t->servo->safety[p].attached;
    return any;
}

static kn_fault latched(const kn_safety *s) { return s->latched ? s->fault : KN_FAULT_NONE; }

// Decide whether a probe's tool acts on the object in this tick, and fill in the probe's input of the step.
static void watch_probe(kn_tick *t, int p)
{
    kn_servo *servo = t->servo;
    kn_safety *s = &servo->safety[p];
    const kn_pose *tool = &servo->tool[p];
    bool was_attached = s->attached;
    kn_fault before = latched(s);
    // compute the distance from tool to object only for a probe that may engage
    if (t->watch[p].live && !s->attached)
        t->watch[p].clear =
            !servo->still && kn_clearance(servo->model, kn_backend_shape(servo->backend), p, tool->position_m,
                                          tool->orientation_wxyz) > LIFTED_M * fmax(1, s->limits.hold_ms / 3.0);

    kn_probe_input *input = &t->input.probe[p];
    input->attached = kn_safety_watch(s, &t->watch[p]);
    // If there is no new pose, extrapolate the tool's position for hold_ms, the time for which the last force is held.
    // After hold_ms the tool stays at the position reached.
    bool held = s->silent_ms <= s->limits.hold_ms;
    double ahead_s = 1e-3 * (held ? s->silent_ms : s->limits.hold_ms);
    for (int i = 0; i < 3; i++) {
        input->position_m[i] = tool->position_m[i] + ahead_s * tool->velocity_m_s[i];
        input->velocity_m_s[i] = held ? tool->velocity_m_s[i] : 0.0;
    }
    input->grip = t->watch[p].live && tool->buttons & KN_BUTTON_GRIP;
    memcpy(input->orientation_wxyz, tool->orientation_wxyz, sizeof input->orientation_wxyz);

    // record the safety watch's decision as an event
    if (was_attached && !s->attached) kn_tick_event(t, KNEAD_EVENT_T_KIND_DETACH, p);
    if (!was_attached && s->attached) kn_tick_event(t, KNEAD_EVENT_T_KIND_ATTACH, p);
    t->fault[p] = latched(s);
    if (t->fault[p] && t->fault[p] != before) kn_tick_event(t, KNEAD_EVENT_T_KIND_FAULT, p)->arg[0] = t->fault[p];
}

// Step the lattice by one tick, and count the ticks that were late, capped or diverged.
static void step(kn_tick *t)
{
    kn_backend *b = t->servo->backend;
    const kn_scene *scene = t->servo->scene;
    // pass a solver effort only if the quality differs from the scene's own, with which the model was built
    if (t->servo->quality != scene->quality) t->input.effort = scene->point[t->servo->quality].effort;
    t->input.deadline = t->servo->deadline;
    if (t->servo->helper) kn_helper_join(t->servo->helper, b, t->servo->model);
    b->submit(b->self, &t->input);
    t->stepped = true;
    // wait() returns by the deadline in every case
    const kn_backend_status status = b->wait(b->self, t->in->deadline_ns, &t->output);
    kn_helper_rest(t->servo->helper);
    t->servo->lost = status == KN_BACKEND_LOST;
    switch (status) {
    case KN_BACKEND_OK: break;
    case KN_BACKEND_SHADOWED: t->shadowed = true; break;
    case KN_BACKEND_LATE:
    case KN_BACKEND_LOST:
        t->held = true;
        t->servo->late++;
        break;
    case KN_BACKEND_STILL: t->held = true; break;
    case KN_BACKEND_DIVERGED:
        t->servo->diverged++;
        t->diverged = true;
        for (int p = 0; p < t->out->probes; p++) kn_safety_trip(&t->servo->safety[p], KN_FAULT_NONFINITE);
        break;
    }
    t->out->capped = t->output.capped;
    t->out->units = t->output.units;
    t->servo->capped += t->output.capped;
}

static bool at_rest(const kn_safety *s)
{
    return s->gain == 0.0 && s->brake_n[0] == 0.0 && s->brake_n[1] == 0.0 && s->brake_n[2] == 0.0;
}

static bool finite3(const double v[3]) { return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]); }

// Filter a probe's contact force through the output stage, and fill in the answer to the probe.
static void guard_probe(kn_tick *t, int p)
{
    static const double none[3] = {0};
    kn_safety *s = &t->servo->safety[p];
    const kn_probe_output *contact = &t->output.probe[p];
    const kn_pose *last = &t->servo->last[p], *tool = &t->servo->tool[p];
    kn_force *f = &t->out->force[p];
    // The output stage gets the force unchanged, because the stage must notice a NaN. The message gets finite numbers
    // only.
    bool sane = !t->diverged && finite3(contact->force_n) && finite3(contact->torque_n_m) &&
                finite3(contact->position_m) && finite3(contact->orientation_wxyz) && isfinite(contact->work_j);
    // A held force is that of an earlier tick. The time since the last live contact goes on, so the impulse guard allows
    // the change of several ticks when the circuit answers again.
    const int gap_ms = s->gap_ms;
    double *force = t->servo->force_n[p], *torque = t->servo->torque_n_m[p];
    if (!t->held) memcpy(force, t->diverged ? none : contact->force_n, sizeof t->servo->force_n[p]);
    if (!t->held) memcpy(torque, t->diverged ? none : contact->torque_n_m, sizeof t->servo->torque_n_m[p]);
    f->flags = kn_safety_filter(s, &t->watch[p], force, torque, f->force_n, f->torque_n_m);
    if (t->held) s->gap_ms = gap_ms;
    // lifting the tool does not help while the object stands still
    if (t->servo->still) f->flags &= ~KN_FLAG_REENGAGE_LIFT;
    if (latched(s) && latched(s) != t->fault[p]) kn_tick_event(t, KNEAD_EVENT_T_KIND_FAULT, p)->arg[0] = s->fault;
    // Echo session and number of the pose that the tick used. A session that left may end once its force is 0.
    f->live = t->watch[p].live;
    f->left = t->watch[p].leaving && !s->attached && at_rest(s);
    f->session = last->session;
    f->seq = last->seq;
    f->sent_ns = last->sent_ns;
    f->gain = s->gain;
    f->fault = (int32_t)s->fault;
    // a detached probe has no proxy, so report the tool's position instead
    memcpy(f->proxy_position_m, tool->position_m, sizeof f->proxy_position_m);
    kn_turn_unit(tool->orientation_wxyz, f->proxy_orientation_wxyz);
    if (s->attached && sane) {
        memcpy(f->contact_force_n, contact->force_n, sizeof f->contact_force_n);
        memcpy(f->contact_torque_n_m, contact->torque_n_m, sizeof f->contact_torque_n_m);
        memcpy(f->proxy_position_m, contact->position_m, sizeof f->proxy_position_m);
        memcpy(f->proxy_orientation_wxyz, contact->orientation_wxyz, sizeof f->proxy_orientation_wxyz);
        f->energy_j = contact->work_j;
        f->contacts = contact->contacts;
    }
    f->residual = isfinite(t->output.residual) ? t->output.residual : 0.0;
    if (f->contacts > 0 && t->servo->undo) kn_undo_touched(t->servo->undo);
    // add the flags of the solver and the server to the safety flags
    if (t->output.secant) f->flags |= KNEAD_CONTACT_FORCE_T_FLAG_SECANT;
    if (t->output.capped) f->flags |= KNEAD_CONTACT_FORCE_T_FLAG_CAPPED;
    if (t->servo->quality != t->servo->asked) f->flags |= KNEAD_CONTACT_FORCE_T_FLAG_REDUCED;
    if (t->shadowed) f->flags |= KNEAD_CONTACT_FORCE_T_FLAG_SHADOWED;
    if (t->held) f->flags |= KNEAD_CONTACT_FORCE_T_FLAG_HELD;
    if (t->in->stop) f->flags |= KNEAD_CONTACT_FORCE_T_FLAG_STOPPING;
}

// Fill the local contact model of a probe. The backend gives the physics; the servo adds session, pose and flags.
static void tell_contact(kn_tick *t, int p)
{
    kn_backend *b = t->servo->backend;
    kn_contact_unit *unit = t->out->contact[p];
    const kn_force *f = &t->out->force[p];
    // send one empty contact unit, with session and flags, for a probe that touches nothing
    unit[0] = (kn_contact_unit){0};
    if (t->servo->safety[p].attached && !t->diverged) b->contact(b->self, p, unit);
    for (int c = 0; c == 0 || c < unit[0].contact_count; c++) {
        unit[c].session = f->session;
        unit[c].pose_seq = f->seq;
        unit[c].generation = t->servo->generation;
        unit[c].flags = f->flags;
    }
}

void kn_servo_tick(kn_servo *servo, const kn_tick_in *in, kn_tick_out *out)
{
    memset(out, 0, offsetof(kn_tick_out, contact)); // contacts are large, so tell_contact() sets only those in use
    out->tick = in->tick;
    out->missed = in->missed;
    out->probes = servo->model->def.probe_count;
    out->local = servo->backend->contact != NULL;
    kn_tick t = {.servo = servo, .in = in, .out = out, .held = in->held};

    kn_helper_wake(servo->helper); // it wakes while this thread reads the poses
    read_all(&t);
    bool pressed = any_attached(&t);
    for (int p = 0; p < out->probes; p++) watch_probe(&t, p);
    // save an undo point in the tick in which the first tool begins to act on the object
    if (servo->undo && !pressed && any_attached(&t))
        kn_undo_keep(servo->undo, servo->backend->state(servo->backend->self));
    servo->untouched = servo->untouched && !any_attached(&t);
    if (servo->untouched) kn_helper_rest(servo->helper);
    else step(&t);
    if (in->now_ns) out->stepped_ns = in->now_ns();
    out->stopped = in->stop;
    for (int p = 0; p < out->probes; p++) {
        guard_probe(&t, p);
        if (out->local) tell_contact(&t, p);
        out->stopped &= at_rest(&servo->safety[p]);
    }
    servo->ticks++;
}
