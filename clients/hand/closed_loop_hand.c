#include "clients/hand/closed_loop_hand.h"
#include <math.h>
#include <string.h>

static const double period_s = 1e-3; // sampling period, s, as in haptic_loop.c
static const double lean_n = 1.0;    // constant downward load on a device that nobody holds, N
// Largest number of reversals of the force per second in a loop that does not buzz; 20 reversals per second are an
// oscillation at 10 Hz.
static const int buzz_turns = 20;

// Reset the monitoring of the closed loop at the start of an attempt to play the path.
static void judge_afresh(kn_closed_loop_hand *g)
{
    const kn_device_def *d = &g->def.render.device;
    double coupling_n_m = g->def.render.coupling_n_m;
    double k = coupling_n_m > 0.0 ? coupling_n_m * d->force_scale : d->hand.stiffness_n_m;
    double resolution_n = kn_held_device_resolution_n(&g->arm, &(kn_coupling){k, d->hand.damping_n_s_m});
    kn_haptic_render_init(&g->render, &g->def.render);
    kn_buzz_init(&g->buzz, period_s, 0.0);
    g->turns = (kn_turns){.hysteresis = kn_turns_hysteresis_n(resolution_n)};
    g->second_ms = 0;
    g->busy = false;
    g->news = (kn_closed_loop_hand_news){0};
}

void kn_closed_loop_hand_init(kn_closed_loop_hand *g, const kn_closed_loop_hand_def *def, kn_hand_player *player)
{
    memset(g, 0, sizeof *g);
    g->def = *def;
    g->def.render.device.round_trip_s = period_s * (1 + def->delay_ms);
    g->player = player;
    player->gripped = true;
    // Use a fixed seed for the random numbers, so that every run loses the same messages.
    g->dice = 88172645463325252u;
}

// Return true if the simulated link loses this message. The random numbers come from Marsaglia's xorshift generator.
static bool lost(kn_closed_loop_hand *g)
{
    g->dice ^= g->dice << 13;
    g->dice ^= g->dice >> 7;
    g->dice ^= g->dice << 17;
    return (double)(g->dice >> 11) * 0x1p-53 < g->def.loss;
}

// Put the force of this millisecond into the simulated link. Return the force that leaves the link in this millisecond,
// or NULL.
static const kn_hand_force *carry(kn_closed_loop_hand *g, const kn_hand_force *force)
{
    // The ring buffer uses delay_ms + 1 entries: one is written and the next one, which is the oldest, is read.
    int in = (int)(g->ms % (g->def.delay_ms + 1)), out = (int)((g->ms + 1) % (g->def.delay_ms + 1));
    g->came[in] = force && !lost(g);
    if (g->came[in]) g->way[in] = *force;
    g->ms++;
    return g->came[out] ? &g->way[out] : NULL;
}

// Evaluate the force of a full second. The loop buzzes only after two consecutive seconds with too many reversals of
// the force, because too many reversals in one second may be a knock whose oscillation decays.
static void close_second(kn_closed_loop_hand *g)
{
    g->news.loudest_n = fmax(g->news.loudest_n, kn_buzz_rms(&g->buzz));
    if (g->turns.count > g->news.turns) g->news.turns = g->turns.count;
    g->news.buzzes |= g->turns.count > buzz_turns && g->busy;
    g->busy = g->turns.count > buzz_turns;
    kn_buzz_reset(&g->buzz);
    g->turns.count = 0;
    g->second_ms = 0;
}

// Add the force of this millisecond to the monitoring of the loop.
static void judge(kn_closed_loop_hand *g)
{
    double size = 0.0;
    for (int k = 0; k < 3; k++) size += g->arm.force_n[k] * g->arm.force_n[k];
    kn_buzz_add(&g->buzz, sqrt(size));
    kn_turns_add(&g->turns, sqrt(size));
    if (++g->second_ms == 1000) close_second(g);
    g->news.given_j = g->render.passivity.given_j;
    g->news.drives |= g->news.given_j > KN_CLOSED_LOOP_HAND_GIVEN_J;
    g->news.acted = g->render.passivity.acted;
}

// Let the hand grip the simulated device at the point where the path begins.
static void take_up(kn_closed_loop_hand *g, const kn_tool_path_point *point)
{
    kn_held_device_def arm = kn_held_device_of(&g->def.render.device);
    arm.axes = g->def.axes;
    arm.grip = g->def.grip;
    if (arm.grip == KN_GRIP_NONE) arm.axes = 1; // a device that nobody holds would move away sideways
    // A device that nobody holds cannot reach the object. So even with grip NONE, a normal grip holds the device until
    // the tool first touches the object (function let_go).
    if (arm.grip == KN_GRIP_NONE) arm.grip = KN_GRIP_NORMAL;
    kn_held_device_init(&g->arm, &arm, point->position_m);
    judge_afresh(g);
    g->holding = true;
}

// With grip NONE, a hand with a normal grip moves the device to the object. When the tool first touches the object, the
// hand releases the device, and a load of 1 N acts on the device. When the path has risen above the height at which the
// hand released the device, the hand grips the device again and moves it away.
static void let_go(kn_closed_loop_hand *g, const kn_tool_path_point *intended)
{
    const kn_hand *h = &g->player->hand;
    bool playing = h->mode == KN_HAND_PLAY, touches = playing && h->force.contacts > 0;
    // Before the hand grips again, move the hand to the device, so that the grip carries no force at first.
    if (g->alone ? !playing || intended->position_m[2] > g->left_z_m : !touches) {
        if (g->alone) {
            memcpy(g->arm.hand_m, g->arm.x_m, sizeof g->arm.hand_m);
            memcpy(g->arm.hand_m_s, g->arm.v_m_s, sizeof g->arm.hand_m_s);
        }
        g->alone = false;
    } else if (!g->alone && intended->position_m[2] <= g->arm.x_m[2]) {
        g->alone = true;
        g->left_z_m = g->arm.x_m[2];
    }
    g->arm.def.grip = g->alone ? KN_GRIP_NONE : KN_GRIP_NORMAL;
    g->arm.def.bias_n[2] = g->alone ? -lean_n : 0.0;
    if (g->alone) memset(g->arm.hand_m_s, 0, sizeof g->arm.hand_m_s);
}

// Run the output stage for one millisecond: pass on the force message that has arrived, and compute the force of the
// motors for this pose. The device sends one pose per millisecond, so the round trip in ms is the number of the newest
// pose minus the number of the pose that the force answers. If several forces answer one pose, only the first of
// them is used to measure the round trip.
static void render(kn_closed_loop_hand *g, const kn_hand_force *force, const kn_hand_out *out)
{
    kn_haptic_render *r = &g->render;
    kn_hand *h = &g->player->hand;
    // When a new session starts, discard the forces of the old session.
    if (r->session != out->session) {
        kn_haptic_render_begin(r, out->session);
        g->answered = 0;
        g->tick = -1;
    }
    kn_haptic_render_turn(r, out->point.orientation_wxyz);
    kn_haptic_render_pose(r, out->seq, g->arm.position_m, g->arm.velocity_m_s);
    // Use a force message only if it belongs to this session and its tick is newer than that of the last one.
    if (force && force->session == out->session && force->tick > g->tick) {
        g->tick = force->tick;
        bool first = force->seq > g->answered;
        if (first) g->answered = force->seq;
        kn_haptic_render_force(r, force->force_n, first ? period_s * (double)(out->seq - force->seq) : -1.0);
    }
    // Pass on the contact models that arrived with the force message, if kneadd sends contact models.
    for (int c = 0; force && c < force->units; c++)
        if (force->unit[c].session == out->session) kn_haptic_render_contact(r, &force->unit[c]);
    kn_haptic_render_give(r, period_s, g->arm.position_m, g->arm.velocity_m_s, h->watchdog.factor);
    if (r->stop) kn_hand_refuse(h, kn_haptic_render_why(r->stop), r->stop == KN_HAPTIC_RENDER_REFLEX);
}

kn_hand_out kn_closed_loop_hand_tick(void *self, const kn_hand_force *force, int elapsed_ms)
{
    kn_closed_loop_hand *g = self;
    // Pass the force through the simulated link, then play one millisecond of the hand. The hand decides whether a pose
    // is sent.
    force = carry(g, force);
    kn_hand_out out = kn_hand_player_tick(g->player, force, elapsed_ms);
    if (!out.send) {
        static const double none_n[3] = {0};
        kn_motor_record_add(&g->player->motors, &g->player->hand, g->arm.position_m, none_n, elapsed_ms);
        // The next attempt begins at a different place, so the hand must grip the device anew.
        g->holding &= g->player->hand.mode != KN_HAND_SILENT;
        return out;
    }
    // The path gives the motion that the hand intends. Send the position of the simulated device as the pose, not the
    // point of the path.
    kn_tool_path_point intended = out.point;
    if (!g->holding) take_up(g, &intended);
    if (g->def.grip == KN_GRIP_NONE) let_go(g, &intended);
    memcpy(out.point.position_m, g->arm.position_m, sizeof g->arm.position_m);
    memcpy(out.point.velocity_m_s, g->arm.velocity_m_s, sizeof g->arm.velocity_m_s);
    render(g, force, &out);
    kn_motor_record_add(&g->player->motors, &g->player->hand, g->arm.position_m, g->render.given_n, elapsed_ms);
    kn_held_device_tick(&g->arm, g->render.given_n, intended.position_m, intended.velocity_m_s);
    // Monitor the force only while the path is played, not while the hand engages or retreats.
    if (g->player->hand.mode == KN_HAND_PLAY) judge(g);
    out.send = !lost(g);
    return out;
}
