// presser PROBE SECONDS [local] [x=0.01] [profile=touch]: a device without hardware, in a hand that does not yield, on
// the bridge of `knead hand`: presses a block of 3 cm, with a ball of 15 mm as probe, again and again, lifts the tool
// when it is not let in, and writes down what its motors are given in each millisecond of its own:
//
//     tick     of the device's 1 ms timer, missed ones counted
//     session  of its poses
//     heard    forces of that session since the tick before: what the watchdog of this one knows
//     fx fy fz what the motors give from this tick to the next
//     live     whether they are on
//     flags    of the newest force
//     z        where the tool is
//     came     forces until the next tick, of which the last is what the motors give then
//
// local: renders KNEAD_CONTACT, not KNEAD_FORCE. LCM_DEFAULT_URL, KNEAD_KEY: as all clients.
#include "clients/knead/join.h"
#include "clients/knead/profile.h"
#include "clients/tactile/bridge.h"
#include "server/clock.h"
#include "server/ring.h"
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const double top_m = 0.053, bottom_m = 0.0385, swing_m = 1.5e-3;
static const double fastest_m_s = 0.15, pull_hz = 30.0, most_m_s2 = 3.0; // of a hand that goes where it is wanted
static const int period_ms = 2000, lift_ms = 1500; // pressing until then

typedef struct row {
    int64_t tick, session, heard, came;
    double given_n[3], z_m;
    int32_t flags;
    bool live;
} row;

typedef struct presser {
    kn_tactile base;
    kn_bridge *bridge;
    kn_ring rows;
    row row; // of the tick that is not over yet
    int64_t heard, lost;
    kn_tactile_pose pose;
    int engaged_ms, away_ms;
} presser;

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static bool open_it(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    (void)error, (void)error_size;
    ((presser *)device)->bridge = bridge;
    return true;
}

static void close_it(kn_tactile *device) { (void)device; }

static double wanted_m(const presser *p)
{
    int ms = p->engaged_ms % period_ms;
    if (p->engaged_ms == 0 || ms >= lift_ms) return top_m;
    return bottom_m + swing_m * sin(6.283185307179586 * 2e-3 * ms);
}

static double clamp(double x, double limit) { return fmax(-limit, fmin(limit, x)); }

static void tick(kn_tactile *device, int elapsed_ms)
{
    presser *p = (presser *)device;
    const kn_tether *t = &p->bridge->now.tether;
    p->row.came = t->heard - p->heard;
    if (p->row.tick > 0) p->lost += !kn_ring_push(&p->rows, &p->row);
    p->row.tick += elapsed_ms;
    p->row.session = t->session;
    p->row.heard = p->row.came;
    p->row.flags = t->flags;
    p->heard = t->heard;

    bool in = t->mode == KN_TETHER_HELD && (t->flags & (KN_FLAG_ENGAGED | KN_FLAG_RAMPING)) &&
              !(t->flags & KN_FLAG_LATCHED);
    p->away_ms = in ? 0 : p->away_ms + 1;
    if (in) p->engaged_ms++;
    if (p->away_ms > 50) p->engaged_ms = 0; // up and out, or nobody lets it in again
    double *z_m = &p->pose.position_m[2], *v_m_s = &p->pose.velocity_m_s[2];
    double a_m_s2 = pull_hz * (pull_hz * (wanted_m(p) - *z_m) - 2.0 * *v_m_s);
    *v_m_s = clamp(*v_m_s + 1e-3 * clamp(a_m_s2, most_m_s2), fastest_m_s);
    *z_m += 1e-3 * *v_m_s;
    p->row.z_m = p->pose.position_m[2];
    kn_bridge_moved(p->bridge, &p->pose);
}

static void give(kn_tactile *device, const double force_n[3], bool live)
{
    presser *p = (presser *)device;
    for (int i = 0; i < 3; i++) p->row.given_n[i] = live ? force_n[i] : 0.0;
    p->row.live = live;
}

static void drain(presser *p)
{
    for (const row *r; (r = kn_ring_front(&p->rows)); kn_ring_pop(&p->rows))
        printf("%lld,%lld,%lld,%.9f,%.9f,%.9f,%d,%d,%.6f,%lld\n", (long long)r->tick, (long long)r->session,
               (long long)r->heard, r->given_n[0], r->given_n[1], r->given_n[2], r->live, (int)r->flags, r->z_m,
               (long long)r->came);
}

int main(int argc, char **argv)
{
    static presser p = {.base = {.name = "presser", .open = open_it, .close = close_it, .tick = tick, .give = give},
                        .pose = {.position_m = {0, 0, top_m}, .orientation_wxyz = {1}}};
    static kn_bridge bridge;
    char error[256] = "usage: presser PROBE SECONDS [local] [x=M] [profile=NAME]";
    const char *profile = "touch";
    kn_bridge_def def = {.session = kn_wall_us(), .render.radius_m = 0.015};
    if (argc < 3) return fprintf(stderr, "%s\n", error), 2;
    for (int i = 3; i < argc; i++) {
        if (!strcmp(argv[i], "local")) def.render.local = true;
        else if (!strncmp(argv[i], "x=", 2)) p.pose.position_m[0] = atof(argv[i] + 2);
        else if (!strncmp(argv[i], "profile=", 8)) profile = argv[i] + 8;
        else return fprintf(stderr, "%s\n", error), 2;
    }
    def.probe = argv[1];
    if (kn_profile_load(&def.render.device, "presser", profile, NULL, 0) != 0) return 2;
    signal(SIGTERM, on_signal);
    signal(SIGINT, on_signal);
    if (!kn_ring_init(&p.rows, 1 << 15, sizeof(row)) || !kn_bridge_start(&bridge, &def, &p.base, error, sizeof error))
        return fprintf(stderr, "presser: %s\n", error), 3;
    kn_join_priority(1); // a log with gaps is none
    for (int64_t end_ns = kn_now_ns() + (int64_t)(1e9 * atof(argv[2])); kn_now_ns() < end_ns && !interrupted;) {
        nanosleep(&(struct timespec){.tv_nsec = 50000000}, NULL);
        drain(&p);
    }
    kn_bridge_stop(&bridge);
    drain(&p);
    if (p.lost) fprintf(stderr, "presser: %lld rows lost\n", (long long)p.lost);
    return p.lost > 0;
}
