// weight.c: put a weight on the object of a running kneadd, and print the height of the plate under it. The plate is
// moved by force control, as a rheometer does under a constant load. Needs stock LCM only, as hand.c does. From the top
// of the source tree:
//
//     mkdir -p build/hand/proto
//     lcm-gen -c --c-cpath build/hand/proto --c-hpath build/hand/proto proto/probe_pose_t.lcm proto/contact_force_t.lcm
//     cc -O2 -Ibuild/hand -o build/hand/weight clients/examples/weight.c build/hand/proto/*.c -llcm -lm
//     build/hand/weight PROBE TOP_M WEIGHT_N SECONDS   TOP_M: height of the object's top;
//                                                      plate 0.01 0.49 60: 50 gf on a cube of 1 cm, for a minute
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define HOVER_M 1e-2 // kneadd takes up a tool only above the object
#define NEAR_M 2e-4  // the plate comes down fast to this height above the object, and then slowly
#define LOWER_M_S 1e-4
// The plate's speed grows by the factor exp(RATE dt (1 - force/weight)). An object resists like a damper whose viscosity
// changes by decades, so the speed is changed in proportion. A faster controller oscillates: forces are some ms old.
#define RATE 100.0 // 1/s

static void on_force(const lcm_recv_buf_t *buf, const char *channel, const knead_contact_force_t *msg, void *force)
{
    (void)buf, (void)channel;
    *(knead_contact_force_t *)force = *msg;
}

static int64_t now_ns(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

int main(int argc, char **argv)
{
    if (argc != 5) return fputs("usage: weight PROBE TOP_M WEIGHT_N SECONDS\n", stderr), 2;
    const double top_m = atof(argv[2]), weight_n = atof(argv[3]), seconds = atof(argv[4]);
    if (!(top_m > 0 && weight_n > 0 && seconds > 0))
        return fputs("weight: TOP_M, WEIGHT_N, SECONDS: expected numbers above 0\n", stderr), 2;
    char pose_channel[64], force_channel[64];
    snprintf(pose_channel, sizeof pose_channel, "KNEAD_POSE_%s", argv[1]);
    snprintf(force_channel, sizeof force_channel, "KNEAD_FORCE_%s", argv[1]);
    lcm_t *lcm = lcm_create(NULL);
    if (!lcm) return fprintf(stderr, "weight: no LCM; is there a multicast route? README.md says how\n"), 3;
    knead_contact_force_t force = {0};
    knead_contact_force_t_subscription_set_queue_capacity(
        knead_contact_force_t_subscribe(lcm, force_channel, on_force, &force), 2);
    knead_probe_pose_t pose = {.session = now_ns(CLOCK_REALTIME), .orientation_wxyz = {1, 0, 0, 0}};
    int64_t tick_ns = now_ns(CLOCK_MONOTONIC), began_ns = 0;
    double z_m = top_m + HOVER_M, down_m_s = 0;
    for (int64_t n = 1;; n++) {
        const int64_t last_ns = tick_ns;
        tick_ns += 1000000;
        struct timespec t = {tick_ns / 1000000000, tick_ns % 1000000000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
        if (now_ns(CLOCK_MONOTONIC) - tick_ns > 1000000) tick_ns = now_ns(CLOCK_MONOTONIC); // if late, do not catch up
        while (lcm_handle_timeout(lcm, 0) > 0) continue;
        const double force_n = force.contact_force_n[2], dt_s = 1e-9 * (double)(tick_ns - last_ns);
        // hover until kneadd has taken up the tool, then lower the plate, then hold the weight
        const int engaged = force.flags & KNEAD_CONTACT_FORCE_T_FLAG_ENGAGED;
        if (began_ns == 0) down_m_s = !engaged ? 0 : z_m > top_m + NEAR_M ? 100 * LOWER_M_S : LOWER_M_S;
        if (began_ns == 0 && force_n > 0) began_ns = tick_ns;
        if (began_ns != 0) down_m_s *= exp(RATE * dt_s * (1 - fmin(force_n / weight_n, 2)));
        z_m -= down_m_s * dt_s;
        pose.position_m[2] = z_m;
        pose.velocity_m_s[2] = -down_m_s;
        pose.seq = n, pose.sent_ns = now_ns(CLOCK_MONOTONIC);
        pose.utime = pose.session / 1000 + n * 1000;
        knead_probe_pose_t_publish(lcm, pose_channel, &pose);
        if (force.flags & KNEAD_CONTACT_FORCE_T_FLAG_LATCHED)
            return fputs("weight: kneadd has latched the force; start again\n", stderr), 1;
        const double since_s = 1e-9 * (double)(tick_ns - began_ns);
        if (began_ns == 0 || (n % 1000 && since_s < seconds)) continue;
        printf("%6.2f s   %8.5f m   %7.4f N\n", since_s, z_m, force_n);
        fflush(stdout);
        if (since_s >= seconds) return 0;
    }
}
