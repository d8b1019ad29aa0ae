// kneader PROBE: a hand that ignores all forces. It sends 1000 poses a second, and goes down into 3 cm of dough with
// a ball of 15 mm and out again, once in 1.4 s and each time in another place, for any server. A signal ends the
// program.
#include "proto/knead_probe_pose_t.h"
#include <lcm/lcm.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

int main(int argc, char **argv)
{
    lcm_t *lcm = argc == 2 ? lcm_create("udpm://239.255.76.67:7667?ttl=0") : NULL;
    char channel[64];
    struct timespec t;
    if (!lcm) return 3;
    snprintf(channel, sizeof channel, "KNEAD_POSE_%.40s", argv[1]);
    clock_gettime(CLOCK_MONOTONIC, &t);
    double last_m = 0.05;
    for (int64_t n = 1;; n++) {
        double s = fmod(1e-3 * (double)n, 1.4), round = floor(1e-3 * (double)n / 1.4);
        double down = s < 0.4 ? 0 : s < 1.0 ? (s - 0.4) / 0.6 : fmax(0, 1 - (s - 1.0) / 0.3), z_m = 0.05 - 0.013 * down;
        knead_probe_pose_t m = {.utime = t.tv_sec * INT64_C(1000000) + t.tv_nsec / 1000,
                                .session = 4711,
                                .seq = n,
                                .sent_ns = t.tv_sec * INT64_C(1000000000) + t.tv_nsec,
                                .position_m = {0.015 * sin(2.4 * round), 0.015 * cos(2.4 * round), z_m},
                                .velocity_m_s = {0, 0, 1e3 * (z_m - last_m)},
                                .orientation_wxyz = {1}};
        last_m = z_m;
        knead_probe_pose_t_publish(lcm, channel, &m);
        t.tv_nsec += 1000000;
        if (t.tv_nsec >= 1000000000) t.tv_sec++, t.tv_nsec -= 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
    }
}
