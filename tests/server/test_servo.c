#include "server/operator_orders.h"
#include "proto/knead_contact_force_t.h"
#include "tests/server/servo_rig.h"

OWNS(kn_scene_change, kn_scene_change_destroy)

static rig *rig_make(const char *set) { return rig_make_of("dough-small.yaml", set); }

// Run a tick with a new pose of probe p, moved by the velocity.
static void move(rig *r, int p, double vz_m_s)
{
    kn_pose *pose = &r->pose[p];
    pose->seq++;
    pose->position_m[2] += 1e-3 * vz_m_s;
    pose->velocity_m_s[2] = vz_m_s;
    r->in.pose[p] = pose;
    r->in.fresh[p] = true;
    tick(r);
}

static void hover(rig *r, int p, int ms)
{
    for (int i = 0; i < ms; i++) move(r, p, 0.0);
}

static void hover_at(rig *r, int p, double z_m, int ms)
{
    r->pose[p].position_m[2] = z_m;
    hover(r, p, ms);
}

// Move the plate from air to `depth` below the top: rest on the surface, 0 -> 1 cm/s in 50 ms, as in the paper. Ends
// in motion.
static void press(rig *r, double depth_m)
{
    hover_at(r, 0, 0.031, 401);
    hover_at(r, 0, 0.03, 300); // the model's plate follows within 20 ms and must not arrive with any speed
    double v = 0.0;
    while (r->pose[0].position_m[2] > 0.03 - depth_m) {
        v = v > -0.0098 ? v - 0.0002 : -0.01;
        move(r, 0, v);
    }
}

// Press in, slow down within 50 ms, and hold.
static void press_and_hold(rig *r, double depth_m, int ms)
{
    press(r, depth_m);
    for (double v = -0.01; v < 0; v += 0.0002) move(r, 0, v);
    hover(r, 0, ms);
}

static double pushed(const rig *r) { return r->out.force[0].contact_force_n[2]; }
static double given(const rig *r) { return r->out.force[0].force_n[2]; }
static bool flag(const rig *r, int p, int32_t of) { return r->out.force[p].flags & of; }
static double slope(const rig *r) { return kn_safety_slope(&r->servo.safety[0].limits) + 1e-9; }

// Return the largest change of probe p's force in one ms, while the tool moves on for so many ms. least_n: the smallest
// force.
static double steepest(rig *r, int p, double vz_m_s, int ms, double *least_n)
{
    double most = 0, last = r->out.force[p].force_n[2];
    *least_n = INFINITY;
    for (int i = 0; i < ms; i++) {
        move(r, p, vz_m_s);
        most = fmax(most, fabs(r->out.force[p].force_n[2] - last));
        last = r->out.force[p].force_n[2];
        *least_n = fmin(*least_n, fabs(last));
    }
    return most;
}

TEST(
    "a press at 1 cm/s is felt in full, and dropping three poses in every 50 changes its peak force by at most 5 % and "
    "its variation by at most 10 %")
{
    double peak[2] = {0}, turned[2] = {0};
    for (int lossy = 0; lossy < 2; lossy++) {
        OWN(rig) *r = rig_make(NULL);
        press(r, 0.0);
        double last = 0.0;
        for (int i = 0; i < 1000; i++) {
            double v = i < 50 ? -0.0002 * i : -0.01;
            if (lossy && i % 50 >= 47) { // three in a row, every 50
                r->pose[0].position_m[2] += 1e-3 * v;
                tick(r);
            } else {
                move(r, 0, v);
            }
            peak[lossy] = fmax(peak[lossy], pushed(r));
            turned[lossy] += fabs(pushed(r) - last);
            last = pushed(r);
            if (!lossy) CHECK(given(r) == pushed(r)); // equal at gain 1
        }
        CHECK(lossy || (r->servo.safety[0].guards == 0 && r->servo.safety[0].faults == 0));
    }
    CHECK(peak[0] > 5.0 && peak[0] < 40.0);
    CHECK_NEAR(peak[1] / peak[0], 1.0, 0.05);
    CHECK_NEAR(turned[1] / turned[0], 1.0, 0.10);
}

// Rest the hand 1 cm below the touch of the finger, with poses at a rate, each early or late by up to `jitter` of a
// period. Return the smallest gain of the last half second; *most: the largest one; *force_n: the last force; *turn_n:
// the largest change of the force in a tick.
static double least_gain(const char *rate_hz, double jitter, double *most, double *force_n, double *turn_n)
{
    char set[64];
    snprintf(set, sizeof set, "device.rate=%s Hz", rate_hz);
    OWN(rig) *r = rig_make_of("jelly.yaml", set);
    const double each_ms = 1e3 / atof(rate_hz);
    double next_ms = 0, least = INFINITY;
    uint64_t random = 1;
    r->in.pose[1] = &r->pose[1];
    *most = *force_n = *turn_n = 0;
    for (int i = 0, n = 0; i < 4500; i++) {
        while (next_ms <= i) {
            r->in.fresh[1] = true;
            r->pose[1].seq++;
            r->pose[1].position_m[2] = 0.1 - fmin(2e-5 * i, 0.035); // the finger touches at 0.075
            random = random * 6364136223846793005 + 1442695040888963407;
            next_ms = ++n * each_ms + jitter * each_ms * ((double)(random >> 40) / (1 << 23) - 1);
        }
        tick(r);
        const double now_n = r->out.force[1].force_n[2], gain = r->out.force[1].gain;
        if (i >= 4000) {
            least = fmin(least, gain);
            *most = fmax(*most, gain);
            *turn_n = fmax(*turn_n, fabs(now_n - *force_n));
        }
        *force_n = now_n;
    }
    return least;
}

TEST("a device that states its rate feels the whole force of a resting finger, also if poses are up to half a period "
     "early or late, from 125 Hz on")
{
    static const struct {
        const char *rate_hz;
        double force_n;
    } all[] = {{"66.7", 0.50}, {"100", 0.58}, {"125", 0.61}, {"200", 0.68}, {"250", 0.71},
               {"333", 0.74},  {"500", 0.77}, {"1000", 0.8}, {"4000", 0.8}};
    for (int i = 0; i < 9; i++) {
        double most, force_n, turn_n;
        CHECK(least_gain(all[i].rate_hz, 0, &most, &force_n, &turn_n) == 1 && turn_n < 1e-3);
        CHECK_NEAR(force_n, all[i].force_n, 0.01);
        const double least = least_gain(all[i].rate_hz, 0.5, &most, &force_n, &turn_n);
        CHECK(i < 2 ? least == 0 && most < 0.2 : least == 1 && turn_n < 1e-3);
        CHECK(i < 2 || fabs(force_n - all[i].force_n) < 0.01);
    }
}

TEST("the local contact models of tools with a session change no bit of the forces")
{
    OWN(rig) *told = rig_make(NULL), *plain = rig_make(NULL);
    CHECK(kn_backend_cpu_identify(&told->backend, (kn_coupling){800, 2}));
    press(told, 0.002);
    press(plain, 0.002);
    CHECK(told->out.local && !plain->out.local);
    CHECK(memcmp(&told->out.force, &plain->out.force, sizeof told->out.force) == 0);
    const kn_contact_unit *unit = told->out.contact[0];
    CHECK(unit->session == told->pose[0].session && unit->pose_seq == told->pose[0].seq);
    CHECK(unit->flags == told->out.force[0].flags && unit->contact_count == 0); // no iteration of the mobility yet
    for (int i = 0; i < 40; i++) {
        told->backend.afterwards(told->backend.self);
        move(told, 0, -0.01);
    }
    CHECK(unit->contact_count == 1 && unit->a_n_s_per_m > 0);
    CHECK_NEAR(unit->force_n, pushed(told), 1e-9);
    told->in.reset = true;
    hover(told, 0, 1);
    CHECK(unit->generation == 1 && unit->contact_count == 0);
}

TEST("without poses the force stays for 3 ms and is zero by 20 ms. After a hand's last pose the session then ends; "
     "otherwise the silence is a fault, which clears by lifting")
{
    for (int leaving = 0; leaving < 2; leaving++) {
        OWN(rig) *r = rig_make(NULL);
        press(r, 0.005);
        r->pose[0].buttons = leaving ? KN_BUTTON_LEAVING : 0;
        if (leaving) move(r, 0, -0.01);
        double held = given(r), last = held;
        CHECK(held > 1.0);
        for (int ms = 1; ms <= 20; ms++) {
            CHECK(!r->out.force[0].left);
            tick(r);
            CHECK((ms > 3 || given(r) == held) && (ms < 20 || given(r) == 0.0) && last - given(r) <= slope(r));
            last = given(r);
            CHECK(r->out.force[0].seq == r->pose[0].seq && (leaving || flag(r, 0, KN_FLAG_STALE)));
            CHECK(!leaving || !flag(r, 0, KN_FLAG_LATCHED));
        }
        CHECK(r->out.force[0].fault == (leaving ? KN_FAULT_NONE : KN_FAULT_POSE_SILENCE));
        CHECK(r->kinds[KNEAD_EVENT_T_KIND_FAULT] == !leaving && r->servo.safety[0].faults == !leaving);
        CHECK(r->kinds[KNEAD_EVENT_T_KIND_ATTACH] == 1 && r->kinds[KNEAD_EVENT_T_KIND_DETACH] == 1);
        CHECK(r->out.force[0].left == leaving);
        if (leaving) {
            r->in.pose[0] = NULL;
            tick(r);
            CHECK(!r->out.force[0].live && !r->out.force[0].left);
            r->pose[0].session++, r->pose[0].buttons = 0;
        } else {
            hover(r, 0, 300);
            CHECK(r->out.force[0].fault == KN_FAULT_POSE_SILENCE);
        }
        hover_at(r, 0, 0.05, leaving ? 450 : 201);
        CHECK(r->out.force[0].fault == KN_FAULT_NONE && flag(r, 0, KN_FLAG_ENGAGED));
    }
}

TEST("a probe without a session has no contact and no force, and a new session number is a new hand that must engage")
{
    OWN(rig) *r = rig_make(NULL);
    press(r, 0.003);
    CHECK(r->out.probes == 2 && r->out.force[0].live && !r->out.force[1].live);
    CHECK(r->out.force[1].contact_force_n[2] == 0.0);
    r->pose[0].session = 7;
    move(r, 0, 0.0);
    CHECK(!r->servo.safety[0].attached);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_SESSION_END] == 1 && r->kinds[KNEAD_EVENT_T_KIND_SESSION_OPEN] == 2);
    hover(r, 0, 20);
    CHECK(given(r) == 0.0);
    r->in.pose[0] = NULL; // the daemon ends a session after 1 s of silence
    tick(r);
    CHECK(!r->out.force[0].live && r->kinds[KNEAD_EVENT_T_KIND_SESSION_END] == 2);
}

// Move the finger, radius 15 mm, down into the dough in 0.4 s.
static void finger_in(rig *r, double depth_m)
{
    hover_at(r, 1, 0.048, 450);
    for (int i = 0; i < 400; i++) move(r, 1, -(depth_m + 0.003) / 0.4);
}

// Lift the finger in 0.4 s and end its session; the tool leaves the model.
static void finger_out(rig *r, double depth_m)
{
    for (int i = 0; i < 400; i++) move(r, 1, (depth_m + 0.003) / 0.4);
    r->in.pose[1] = NULL;
    for (int i = 0; i < 30; i++) tick(r);
    r->pose[1].session++;
}

static void undo(rig *r)
{
    r->in.undo = true;
    tick(r);
}

TEST("undo reverts one press after the other and a reset, too; a press in air adds no undo point")
{
    OWN(rig) *r = rig_make(NULL);
    AT_END(kn_undo_free) kn_undo points = {0};
    CHECK(kn_undo_init(&points, r->model));
    r->servo.undo = &points;
    undo(r);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_RESTORE] == 0 && !r->out.replaced && r->out.restored_hash == 0);
    uint64_t untouched = object_hash(r), undone[3];
    finger_in(r, 0.006), finger_out(r, 0.006);
    hover_at(r, 1, 0.06, 450); // in air: the tool enters the model and leaves it
    finger_out(r, 0);
    finger_in(r, 0.009), finger_out(r, 0.009);
    CHECK(points.count == 2);
    r->in.reset = true;
    tick(r);
    for (int i = 0; i < 3; i++) {
        undo(r);
        const kn_event *e = &r->out.event[0];
        CHECK(e->kind == KNEAD_EVENT_T_KIND_RESTORE && e->arg[0] == 0 && e->state_hash == r->out.restored_hash);
        undone[i] = e->state_hash;
    }
    CHECK(undone[0] != undone[1] && undone[1] != untouched && undone[0] != untouched && undone[2] == untouched);
    undo(r);
    CHECK(!r->out.replaced && r->out.restored_hash == 0);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_RESTORE] == 3 && r->servo.generation == 4);
}

TEST("sixteen undo points are kept, and the oldest are dropped")
{
    OWN(rig) *r = rig_make(NULL);
    AT_END(kn_undo_free) kn_undo points = {0};
    CHECK(kn_undo_init(&points, r->model) && points.room == KN_UNDO_POINTS);
    CHECK(kn_undo_bytes(r->model) == KN_UNDO_POINTS * kn_state_size(r->model));
    OWN(kn_state) *state = kn_state_create(r->model);
    for (int i = 1; i <= 20; i++) {
        ((float *)state->displacement)[0] = 1e-3f * (float)i;
        kn_undo_keep(&points, state);
        kn_undo_keep(&points, state); // the object is unchanged since the last point
        kn_undo_touched(&points);
    }
    for (int i = 20; i >= 5; i--) {
        const kn_state *was = kn_undo_take(&points);
        CHECK(was && ((const float *)was->displacement)[0] == 1e-3f * (float)i);
    }
    CHECK(!kn_undo_take(&points));
}

TEST("an object restored under a tool releases it through zero force and has exactly the saved state")
{
    OWN(rig) *r = rig_make(NULL);
    finger_in(r, 0.008);
    OWN(kn_state) *then = kn_state_create(r->model);
    kn_state_copy(r->model, then, object(r));
    hover(r, 1, 50);
    CHECK(r->out.force[1].force_n[2] > 0.2);
    r->in.restore = then;
    r->in.restored_generation = 7, r->in.restored_tick = 1234;
    double least, most = steepest(r, 1, 0, 1, &least);
    const kn_event *e = &r->out.event[0];
    CHECK(e->kind == KNEAD_EVENT_T_KIND_RESTORE && e->state_hash == kn_state_hash(r->model, then));
    CHECK(e->arg[0] == 7 && e->arg[1] == 1234 && r->out.replaced && !r->servo.safety[1].attached);
    CHECK(fmax(most, steepest(r, 1, 0, 300, &least)) <= slope(r) && r->out.force[1].force_n[2] == 0);
    CHECK(flag(r, 1, KN_FLAG_REENGAGE_LIFT)); // the tool is inside the object
}

#define POINTS                                                                                                         \
    "fast: {iterations: 2, iterations_max: 5}, balanced: {iterations: 3, iterations_max: 9}, "                         \
    "accurate: {iterations: 12, passes: 2}"
#define OVER_NS 900000 // the budget is 0.8 ms

// Hold the tool still in the dough for n ticks, each after a tick that took so long.
static void hold(rig *r, int n, int64_t execution_ns)
{
    for (int i = 0; i < n; i++) {
        r->in.execution_ns = execution_ns;
        move(r, 0, 0.0);
    }
}

static int told(const rig *r) { return r->kinds[KNEAD_EVENT_T_KIND_QUALITY]; }
static bool reduced(const rig *r) { return flag(r, 0, KNEAD_CONTACT_FORCE_T_FLAG_REDUCED); }

TEST("ten consecutive ticks over the budget switch to the next lower quality point through zero force, with a flag and "
     "an event")
{
    OWN(rig) *r = rig_make("quality={chosen: accurate, " POINTS "}");
    press_and_hold(r, 0.003, 0);
    hold(r, 200, 700000);
    for (int i = 0; i < 20; i++) hold(r, 9, OVER_NS), hold(r, 1, 700000); // never ten in a row
    CHECK(told(r) == 0 && r->servo.quality == KN_QUALITY_ACCURATE);
    double before = given(r), lowest = before, last = before, most = 0;
    CHECK(before > 0.3 && !reduced(r));
    hold(r, 9, OVER_NS);
    CHECK(told(r) == 0);
    hold(r, 1, OVER_NS);
    const kn_event *e = &r->out.event[0];
    CHECK(told(r) == 1 && e->kind == KNEAD_EVENT_T_KIND_QUALITY && e->tick == r->in.tick && e->probe == -1);
    CHECK(e->arg[0] == KN_QUALITY_ACCURATE && e->arg[1] == KN_QUALITY_BALANCED && e->arg[2] == 0 && e->state_hash);
    for (int ms = 1; ms <= 217; ms++) {
        most = fmax(most, fabs(given(r) - last));
        last = given(r);
        lowest = fmin(lowest, last);
        CHECK(reduced(r) && flag(r, 0, KN_FLAG_RAMPING) == (ms < 217));
        if (ms < 217) hold(r, 1, 700000);
    }
    CHECK(lowest == 0 && most <= slope(r) && last == pushed(r) && last > 0.5 * before);
    hold(r, 2000, 700000);
    CHECK(told(r) == 1 && r->servo.quality == KN_QUALITY_BALANCED && r->kinds[KNEAD_EVENT_T_KIND_DETACH] == 0);
}

TEST("quality falls point by point, reports the lowest point once, and rises only by command")
{
    OWN(rig) *r = rig_make("quality={chosen: accurate, " POINTS "}");
    press_and_hold(r, 0.003, 0);
    hold(r, 20, OVER_NS);
    CHECK(told(r) == 2 && r->servo.quality == KN_QUALITY_FAST);
    hold(r, 10, OVER_NS);
    CHECK(told(r) == 3 && r->out.event[0].arg[0] == KN_QUALITY_FAST && r->out.event[0].arg[1] == KN_QUALITY_FAST);
    hold(r, 100, OVER_NS);
    CHECK(told(r) == 3 && reduced(r));

    r->in.take = KN_QUALITY_CAUSE_COMMAND;
    r->in.quality = KN_QUALITY_OWN;
    hold(r, 1, OVER_NS);
    CHECK(told(r) == 4 && r->out.event[0].arg[1] == KN_QUALITY_OWN && r->out.event[0].arg[2] == 1);
    CHECK(!reduced(r) && flag(r, 0, KN_FLAG_RAMPING));
    hold(r, 9, OVER_NS);
    CHECK(told(r) == 4);
    hold(r, 1, OVER_NS);
    CHECK(told(r) == 5 && r->servo.quality == KN_QUALITY_BALANCED); // 4 iterations: accurate would cost more
    r->in.stop = true;
    hold(r, 100, OVER_NS);
    CHECK(told(r) == 5);
}

TEST("quality points of another lattice or precision are skipped, and a scene without points reports nothing")
{
    static const char *const sets[] = {NULL, "quality={accurate: {iterations: 9}, balanced: {spacing: 5 mm, "
                                             "iterations: 2}, fast: {iterations: 2, precision: f64}}"};
    for (int points = 0; points < 2; points++) {
        OWN(rig) *r = rig_make(sets[points]);
        press_and_hold(r, 0.003, 0);
        hold(r, 50, OVER_NS);
        CHECK(told(r) == points && r->servo.quality == KN_QUALITY_OWN && !reduced(r));
    }
}

TEST("a quality point taken during a run gives the bits of a servo that started with it")
{
    static const char *const names[] = {"fast", "balanced", "accurate"};
    OWN(rig) *own = rig_make(NULL);
    press(own, 0.004);
    for (int q = 0; q < KN_QUALITY_OWN; q++) {
        char chosen[256];
        snprintf(chosen, sizeof chosen, "quality={chosen: %s, " POINTS "}", names[q]);
        OWN(rig) *began = rig_make(chosen), *took = rig_make("quality={" POINTS "}");
        took->in.take = KN_QUALITY_CAUSE_COMMAND;
        took->in.quality = (kn_quality)q;
        press(took, 0.004);
        press(began, 0.004);
        CHECK(pushed(began) == pushed(took) && pushed(own) != pushed(took));
        CHECK(object_hash(began) == object_hash(took));
    }
}

// Order a change to this setting of the scene with the next tick.
static kn_scene_change *change_to(rig *r, const char *set)
{
    char error[256] = "";
    kn_scene *scene = load_scene("dough-small.yaml", &set, set ? 1 : 0);
    r->in.change = kn_scene_change_create(scene, r->servo.scene, r->servo.model, false, error, sizeof error);
    if (!r->in.change) printf("%s\n", error), exit(1);
    return r->in.change;
}

TEST("under a hand the material changes through zero force, and the tool stays in the object; changed back, the force "
     "is "
     "within 2 % of the unchanged one, apart from creep")
{
    static const char *const sets[] = {NULL,
                                       "material.k1=940 gf/cm^3",
                                       "material.c1=250 gf*s/cm^3",
                                       "material.variant=plastic",
                                       "density=3000 kg/m^3",
                                       "gravity=9.81 m/s^2",
                                       "solver.passes=4"};
    double unchanged = 0;
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        OWN(rig) *r = rig_make(NULL);
        press_and_hold(r, 0.004, 300);
        double before = given(r), least;
        OWN(kn_scene_change) *c = change_to(r, sets[i]);
        double most = steepest(r, 0, 0, 300, &least);
        CHECK(before > 0.5 && r->kinds[KNEAD_EVENT_T_KIND_SET] == 1 && r->kinds[KNEAD_EVENT_T_KIND_DETACH] == 0);
        CHECK(r->servo.model == c->model && r->servo.scene == c->scene && r->servo.backend == &c->backend);
        CHECK(most <= slope(r) && least == 0);
        CHECK(r->servo.safety[0].gain == 1 && r->servo.safety[0].faults == 0 && r->servo.safety[0].guards == 0);
        if (i > 1) continue;
        OWN(kn_scene_change) *back = change_to(r, NULL);
        hover(r, 0, 300);
        if (i == 0) unchanged = given(r);
        CHECK_NEAR(given(r) / unchanged, 1, 0.02);
    }
}

TEST("a lower clamp applies when the force returns, and the force falls under the old clamp")
{
    OWN(rig) *r = rig_make(NULL);
    double least;
    press_and_hold(r, 0.004, 300);
    OWN(kn_scene_change) *c = change_to(r, "device={profile: bench, clamp: 0.5 N}");
    CHECK(!kn_safety_raised(&c->scene->limits, &r->scene->limits) &&
          kn_safety_raised(&r->scene->limits, &c->scene->limits));
    hover(r, 0, 1);
    CHECK(given(r) > 0.7 && r->servo.safety[0].relimiting);
    CHECK(steepest(r, 0, 0, 300, &least) <= 40.0 / 17 + 1e-9 && least == 0);
    CHECK_NEAR(given(r), 0.5, 1e-9);
    CHECK(!r->servo.safety[0].relimiting && r->servo.safety[0].limits.clamp_n == 0.5);
}

TEST("a change is made once without a hand, together with a reset, and for a diverged object")
{
    OWN(rig) *r = rig_make(NULL);
    double least;
    OWN(kn_scene_change) *first = change_to(r, "material.k1=500 gf/cm^3");
    tick(r);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_SET] == 1 && r->servo.model == first->model && !r->servo.safety[0].relimiting);
    press_and_hold(r, 0.002, 0);
    OWN(kn_scene_change) *second = change_to(r, NULL);
    r->in.reset = true;
    CHECK(steepest(r, 0, 0, 30, &least) < 2.4 && least == 0);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_SET] == 2 && r->kinds[KNEAD_EVENT_T_KIND_RESET] == 1 && object_hash(r) != 0);
    ((kn_state *)(uintptr_t)object(r))->bad = 1;
    OWN(kn_scene_change) *third = change_to(r, "material.k1=500 gf/cm^3");
    hover(r, 0, 1);
    CHECK(r->servo.diverged > 0 && r->out.force[0].fault == KN_FAULT_NONFINITE);
    r->in.reset = true;
    hover(r, 0, 1);
    CHECK(!object(r)->bad);
}

// A backend that diverges on demand, in front of the real one.
static kn_backend real_backend;
static bool diverge;
static kn_backend_status bad_wait(void *self, int64_t deadline_ns, kn_output *output)
{
    kn_backend_status status = real_backend.wait(self, deadline_ns, output);
    if (!diverge) return status;
    output->probe[0].force_n[2] = (double)NAN;
    return KN_BACKEND_DIVERGED;
}

TEST("when the physics diverges, every probe latches, only finite forces go out, and only a reset helps")
{
    OWN(rig) *r = rig_make(NULL);
    real_backend = r->backend;
    r->backend.wait = bad_wait;
    press(r, 0.005);
    double held = given(r);
    diverge = true;
    move(r, 0, -0.01);
    CHECK(r->out.force[0].fault == KN_FAULT_NONFINITE && r->kinds[KNEAD_EVENT_T_KIND_FAULT] == 2);
    CHECK(pushed(r) == 0.0 && given(r) == held);
    hover(r, 0, 17);
    CHECK(given(r) == 0.0 && r->kinds[KNEAD_EVENT_T_KIND_FAULT] == 2 && r->servo.diverged == 18);
    diverge = false;
    hover_at(r, 0, 0.05, 300);
    CHECK(r->out.force[0].fault == KN_FAULT_NONFINITE);
    r->in.reset = true;
    hover(r, 0, 300);
    CHECK(r->out.force[0].fault == KN_FAULT_NONE && r->servo.safety[0].attached);
}

// A backend that is late on demand: it computes the tick, and gives the output of an earlier one.
static int late;
static kn_backend_status late_wait(void *self, int64_t deadline_ns, kn_output *output)
{
    static kn_output old;
    kn_backend_status status = real_backend.wait(self, deadline_ns, output);
    if (late-- > 0) *output = old, status = KN_BACKEND_LATE;
    old = *output;
    return status;
}

TEST("the force of a late backend is held, and the change of several ticks that follows is no impulse")
{
    OWN(rig) *r = rig_make(NULL);
    real_backend = r->backend;
    r->backend.wait = late_wait;
    press(r, 0.002);
    kn_safety *s = &r->servo.safety[0];
    double before = given(r);
    move(r, 0, -0.01);
    s->guard.most_n_per_ms = 1.1 * fabs(given(r) - before); // a change of three ms would be a fault
    before = given(r);
    for (late = 2; late > 0;) {
        move(r, 0, -0.01);
        CHECK(flag(r, 0, KNEAD_CONTACT_FORCE_T_FLAG_HELD) && given(r) == before);
    }
    move(r, 0, -0.01);
    CHECK(!flag(r, 0, KNEAD_CONTACT_FORCE_T_FLAG_HELD) && fabs(given(r) - before) > 2 * s->guard.most_n_per_ms);
    move(r, 0, -0.01);
    CHECK(s->attached && r->out.force[0].fault == KN_FAULT_NONE && s->guards == 0 && r->servo.late == 2);
}

TEST("a checkpoint comes every 1000 ticks, and when cycles are missed that no force record reports")
{
    OWN(rig) *r = rig_make(NULL);
    for (int i = 0; i < 2500; i++) tick(r);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_CHECKPOINT] == 3 && r->kinds[KNEAD_EVENT_T_KIND_START] == 1);
    r->in.missed = 4;
    tick(r);
    CHECK(r->out.event_count == 1 && r->out.event[0].arg[0] == 4.0);
    hover(r, 0, 1);
    r->in.missed = 4;
    tick(r);
    CHECK(r->out.event_count == 0 && r->out.missed == 4);
    r->in.missed = 800; // across a multiple of a thousand ticks
    tick(r);
    CHECK(r->out.event_count >= 1 && r->out.event[0].kind == KNEAD_EVENT_T_KIND_CHECKPOINT &&
          r->out.event[0].arg[0] == 0.0);
}

TEST("a time step shorter than a tick runs as often as it fits, and a time step that does not fit is refused")
{
    CHECK(kn_backend_steps(1e-3) == 1 && kn_backend_steps(1e-3 / 16) == 16 && kn_backend_steps(1e-3 / 3) == 3);
    CHECK(kn_backend_steps(0.7e-3) == 0 && kn_backend_steps(2e-3) == 0 && kn_backend_steps(0.0) == 0);
    double force[2];
    const char *sets[] = {NULL, "solver.dt=0.25 ms"};
    for (int i = 0; i < 2; i++) {
        OWN(rig) *r = rig_make(sets[i]);
        press(r, 0.005);
        CHECK(object(r)->tick == r->servo.ticks * (i ? 4 : 1));
        force[i] = pushed(r);
    }
    CHECK_NEAR(force[1] / force[0], 1.0, 0.05);
}

TEST("with the clutch held the force fades to 0 and the tool keeps pressing in place; then the force ramps in again")
{
    OWN(rig) *r = rig_make("material=jelly");
    press_and_hold(r, 0.003, 50);
    double held_n = pushed(r), least, z = r->servo.tool[0].position_m[2];
    CHECK(held_n > 0.5 && given(r) == held_n);
    r->pose[0].buttons = KN_BUTTON_CLUTCH;
    hover(r, 0, 1);
    for (int ms = 1; ms <= 300; ms++) {
        CHECK(steepest(r, 0, 0.1, 1, &least) <= slope(r)); // the hand lifts its device by 3 cm
        CHECK(ms < 18 || given(r) == 0);
        CHECK(r->servo.tool[0].position_m[2] == z);
    }
    CHECK(r->servo.safety[0].attached && pushed(r) > 0.5 * held_n); // the tool keeps pressing, and the force relaxes
    r->pose[0].buttons = 0;
    CHECK(steepest(r, 0, 0, 250, &least) <= slope(r));
    CHECK_NEAR(r->servo.tool[0].position_m[2], z, 1e-15);
    CHECK(given(r) == pushed(r) && given(r) > 0 && r->servo.safety[0].faults == 0);
}

TEST("a deadline is reported when it changes and in every checkpoint, and each step keeps it")
{
    OWN(rig) *r = rig_make(NULL);
    r->in.deadline = 100000;
    hover_at(r, 1, 0.047, 1);
    const kn_event *e = &r->out.event[1];
    CHECK(e->kind == KNEAD_EVENT_T_KIND_DEADLINE && e->arg[0] == 100000 && e->arg[1] == 0 && e->state_hash);
    hover(r, 1, 450);
    int capped = 0;
    for (int i = 0; i < 200; i++) {
        move(r, 1, i < 100 ? -0.05 : 0.05);
        capped += flag(r, 1, KNEAD_CONTACT_FORCE_T_FLAG_CAPPED);
        CHECK(r->out.units > 0 && r->out.units <= 100000);
    }
    CHECK(capped > 20 && r->kinds[KNEAD_EVENT_T_KIND_DEADLINE] == 1 && r->servo.safety[1].faults == 0);
    while (r->kinds[KNEAD_EVENT_T_KIND_CHECKPOINT] < 2) hover(r, 1, 1);
    CHECK(r->out.event[0].kind == KNEAD_EVENT_T_KIND_CHECKPOINT && r->out.event[0].arg[5] == 100000);
}

TEST("ticks of 9 ms for 0.1 s are an overload fault: the force fades, the fault is reported, and it clears by lifting")
{
    OWN(rig) *r = rig_make(NULL), *log = rig_make(NULL);
    press_and_hold(r, 0.003, 0);
    press_and_hold(log, 0.003, 0);
    for (int i = 0; i < 40; i++) {
        hold(r, 1, 9000000);
        log->in.overload = r->kinds[KNEAD_EVENT_T_KIND_OVERLOAD] > log->kinds[KNEAD_EVENT_T_KIND_OVERLOAD];
        move(log, 0, 0.0); // from the event alone, without a clock
        CHECK(r->out.force[0].fault == (i < 11 ? KN_FAULT_NONE : KN_FAULT_OVERLOAD));
        CHECK(memcmp(&r->out.force, &log->out.force, sizeof r->out.force) == 0);
    }
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_OVERLOAD] == 1 && given(r) == 0 && !r->servo.safety[0].attached);
    CHECK(object_hash(r) == object_hash(log));
    static const struct {
        double z_m;
        int64_t execution_ns;
        int32_t fault;
        int overloads;
    } then[] = {{0.05, 9000000, KN_FAULT_OVERLOAD, 1}, // lifted, but still too slow
                {0.026, 500000, KN_FAULT_OVERLOAD, 2}, // fast again, but not lifted
                {0.05, 500000, KN_FAULT_NONE, 2}};
    for (int i = 0; i < 3; i++) {
        r->pose[0].position_m[2] = then[i].z_m;
        hold(r, 300, then[i].execution_ns);
        CHECK(r->out.force[0].fault == then[i].fault && r->kinds[KNEAD_EVENT_T_KIND_OVERLOAD] == then[i].overloads);
    }
    CHECK(r->servo.safety[0].faults == 1 && flag(r, 0, KN_FLAG_ENGAGED));
}

TEST("nine slow ticks, or slow ticks that end within 0.1 s, are no overload")
{
    OWN(rig) *r = rig_make(NULL);
    press_and_hold(r, 0.003, 0);
    hold(r, 9, 60000000), hold(r, 1, 500000);
    hold(r, 50, 1900000), hold(r, 1, 500000);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_OVERLOAD] == 0 && r->out.force[0].fault == KN_FAULT_NONE);
    hold(r, 53, 1900000);
    CHECK(r->kinds[KNEAD_EVENT_T_KIND_OVERLOAD] == 1);
}

TESTS_MAIN
