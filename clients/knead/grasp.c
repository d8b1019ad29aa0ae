#include "clients/knead/grasp.h"
#include <math.h>
#include <string.h>

static const double period_s = 1e-3, unheard_n = 2e-3; // as rig.c
static const double lean_n = 1.0;                      // of nobody
static const int buzz_turns = 20;                      // of the force in a second: 10 Hz

static void judge_afresh(kn_grasp *g)
{
    const kn_device_def *d = &g->def.render.device;
    double coupling_n_m = g->def.render.coupling_n_m;
    double k = coupling_n_m > 0.0 ? coupling_n_m * d->force_scale : d->hand.stiffness_n_m;
    double share = -expm1(-6.283185307179586 * g->arm.def.velocity_hz * period_s);
    double resolution_n = d->encoder_m * (k + d->hand.damping_n_s_m * share / period_s);
    kn_render_init(&g->render, &g->def.render);
    kn_buzz_init(&g->buzz, period_s, 0.0);
    g->turns = (kn_turns){.hysteresis = 2.0 * (1.5 * resolution_n + unheard_n)};
    g->second_ms = 0;
    g->busy = false;
    g->news = (kn_grasp_news){0};
}

void kn_grasp_init(kn_grasp *g, const kn_grasp_def *def, kn_player *player)
{
    memset(g, 0, sizeof *g);
    g->def = *def;
    g->def.render.device.round_trip_s = period_s * (1 + def->delay_ms);
    g->player = player;
    player->gripped = true;
    g->dice = 88172645463325252u; // the same losses every time
}

static bool lost(kn_grasp *g) // Marsaglia's xorshift
{
    g->dice ^= g->dice << 13;
    g->dice ^= g->dice >> 7;
    g->dice ^= g->dice << 17;
    return (double)(g->dice >> 11) * 0x1p-53 < g->def.loss;
}

// The force that comes out of the link in this millisecond, for the one that goes in.
static const kn_hand_force *carry(kn_grasp *g, const kn_hand_force *force)
{
    int in = (int)(g->ms % (g->def.delay_ms + 1)), out = (int)((g->ms + 1) % (g->def.delay_ms + 1));
    g->came[in] = force && !lost(g);
    if (g->came[in]) g->way[in] = *force;
    g->ms++;
    return g->came[out] ? &g->way[out] : NULL;
}

static void close_second(kn_grasp *g)
{
    g->news.loudest_n = fmax(g->news.loudest_n, kn_buzz_rms(&g->buzz));
    if (g->turns.count > g->news.turns) g->news.turns = g->turns.count;
    g->news.buzzes |= g->turns.count > buzz_turns && g->busy;
    g->busy = g->turns.count > buzz_turns;
    kn_buzz_reset(&g->buzz);
    g->turns.count = 0;
    g->second_ms = 0;
}

static void judge(kn_grasp *g)
{
    double size = 0.0;
    for (int k = 0; k < 3; k++) size += g->arm.force_n[k] * g->arm.force_n[k];
    kn_buzz_add(&g->buzz, sqrt(size));
    kn_turns_add(&g->turns, sqrt(size));
    if (++g->second_ms == 1000) close_second(g);
    g->news.given_j = g->render.passivity.given_j;
    g->news.drives |= g->news.given_j > KN_GRASP_GIVEN_J;
    g->news.acted = g->render.passivity.acted;
}

// The device is gripped where the path begins.
static void take_up(kn_grasp *g, const kn_path_point *point)
{
    kn_arm_def arm = kn_arm_of(&g->def.render.device);
    arm.axes = g->def.axes;
    arm.grip = g->def.grip;
    if (arm.grip == KN_GRIP_NONE) arm.axes = 1;              // else it would roll off
    if (arm.grip == KN_GRIP_NONE) arm.grip = KN_GRIP_NORMAL; // until it touches, see let_go
    kn_arm_init(&g->arm, &arm, point->position_m);
    judge_afresh(g);
    g->holding = true;
}

// Nobody's hand: from the first touch until the path is above that place again the device is left to itself, with 1 N
// on it. Somebody has to bring it there and take it away.
static void let_go(kn_grasp *g, const kn_path_point *intended)
{
    const kn_hand *h = &g->player->hand;
    bool playing = h->mode == KN_HAND_PLAY, touches = playing && h->force.contacts > 0;
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

// What has come, and what of it and of this pose the device gives. A millisecond is a pose: the newest less the one that
// a force is the first to answer is the round trip.
static void render(kn_grasp *g, const kn_hand_force *force, const kn_hand_out *out)
{
    kn_render *r = &g->render;
    kn_hand *h = &g->player->hand;
    if (r->session != out->session) {
        kn_render_begin(r, out->session);
        g->answered = 0;
        g->tick = -1;
    }
    kn_render_turn(r, out->point.orientation_wxyz);
    kn_render_pose(r, out->seq, g->arm.position_m, g->arm.velocity_m_s);
    if (force && force->session == out->session && force->tick > g->tick) {
        g->tick = force->tick;
        bool first = force->seq > g->answered;
        if (first) g->answered = force->seq;
        kn_render_force(r, force->force_n, first ? period_s * (double)(out->seq - force->seq) : -1.0);
    }
    for (int c = 0; force && c < force->units; c++)
        if (force->unit[c].session == out->session) kn_render_contact(r, &force->unit[c]);
    kn_render_give(r, period_s, g->arm.position_m, g->arm.velocity_m_s, h->watchdog.factor);
    if (r->stop) kn_hand_refuse(h, kn_render_why(r->stop), r->stop == KN_RENDER_REFLEX);
}

kn_hand_out kn_grasp_tick(void *self, const kn_hand_force *force, int elapsed_ms)
{
    kn_grasp *g = self;
    force = carry(g, force);
    kn_hand_out out = kn_player_tick(g->player, force, elapsed_ms);
    if (!out.send) {
        static const double none_n[3] = {0};
        kn_motors_add(&g->player->motors, &g->player->hand, g->arm.position_m, none_n, elapsed_ms);
        g->holding &= g->player->hand.mode != KN_HAND_SILENT; // the next try begins elsewhere
        return out;
    }
    kn_path_point intended = out.point;
    if (!g->holding) take_up(g, &intended);
    if (g->def.grip == KN_GRIP_NONE) let_go(g, &intended);
    memcpy(out.point.position_m, g->arm.position_m, sizeof g->arm.position_m);
    memcpy(out.point.velocity_m_s, g->arm.velocity_m_s, sizeof g->arm.velocity_m_s);
    render(g, force, &out);
    kn_motors_add(&g->player->motors, &g->player->hand, g->arm.position_m, g->render.given_n, elapsed_ms);
    kn_arm_tick(&g->arm, g->render.given_n, intended.position_m, intended.velocity_m_s);
    if (g->player->hand.mode == KN_HAND_PLAY) judge(g);
    out.send = !lost(g);
    return out;
}
