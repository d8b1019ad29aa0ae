// hand.c: connect your haptic device to a running kneadd, in 80 lines. Needs stock LCM only. Replace the three places
// marked (1) (2) (3). From the top of the source tree:
//
//     mkdir -p build/hand/proto
//     lcm-gen -c --c-cpath build/hand/proto --c-hpath build/hand/proto proto/probe_pose_t.lcm proto/contact_force_t.lcm
//     cc -O2 -Ibuild/hand -o build/hand/hand clients/examples/hand.c build/hand/proto/*.c -llcm -lm
//     build/hand/hand [PROBE]          the tool's name in the scene, default finger; Ctrl-C ends the program
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include <math.h>
#include <stdio.h>
#include <time.h>

enum { HOLD_MS = 3, ZERO_MS = 20, SILENCE_MS = 1200 }; // times of this program's watchdog, see below

static knead_contact_force_t force; // newest force message
static int force_age_ms;            // age of the newest force, ms

static void on_force(const lcm_recv_buf_t *buf, const char *channel, const knead_contact_force_t *msg, void *session)
{
    (void)buf, (void)channel;
    int again = msg->session == force.session && msg->tick <= force.tick; // a repeated force does not reset the age
    if (msg->session != *(int64_t *)session || again) return;             // another session: a force for another client
    force = *msg;
    force_age_ms = 0;
}

static int64_t now_ns(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

int main(int argc, char **argv)
{
    char pose_channel[64], force_channel[64];
    snprintf(pose_channel, sizeof pose_channel, "KNEAD_POSE_%s", argc > 1 ? argv[1] : "finger");
    snprintf(force_channel, sizeof force_channel, "KNEAD_FORCE_%s", argc > 1 ? argv[1] : "finger");
    lcm_t *lcm = lcm_create(NULL);
    if (!lcm) return fprintf(stderr, "hand: no LCM; is there a multicast route? README.md says how\n"), 3;
    int64_t session = now_ns(CLOCK_REALTIME), tick_ns = now_ns(CLOCK_MONOTONIC), wall_ns = session - tick_ns;
    knead_contact_force_t_subscription_set_queue_capacity( // a full queue drops the newest message, so keep it short
        knead_contact_force_t_subscribe(lcm, force_channel, on_force, &session), 2);
    // (1) open your device here and enable its force output
    knead_probe_pose_t pose = {.session = session, .orientation_wxyz = {1, 0, 0, 0}};
    for (int64_t n = 0, silent_ms = 0, tripped = 0;; n++) {
        tick_ns += 1000000; // absolute 1 kHz grid: no drift
        struct timespec t = {tick_ns / 1000000000, tick_ns % 1000000000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
        if (now_ns(CLOCK_MONOTONIC) - tick_ns > 1000000) tick_ns = now_ns(CLOCK_MONOTONIC); // if late, do not catch up

        // (2) read your device here: m and m/s, z up, origin under the object's centre. Example: z swings 60 to 37 mm
        double w = 2 * M_PI / 4, phase = w * 1e-3 * (double)n;
        pose.position_m[2] = 0.0485 + 0.0115 * cos(phase);
        pose.velocity_m_s[2] = -0.0115 * w * sin(phase);

        if (silent_ms == 0) {
            pose.session = session, pose.seq = n + 1;
            pose.sent_ns = now_ns(CLOCK_MONOTONIC);
            pose.utime = (wall_ns + pose.sent_ns) / 1000; // from the monotonic clock, which is never set back
            knead_probe_pose_t_publish(lcm, pose_channel, &pose);
        }
        force_age_ms++;
        while (lcm_handle_timeout(lcm, 0) > 0) continue; // read all waiting messages; the newest stays
        // Watchdog: hold the force for 3 ms, fade it to 0 N by 20 ms, then send no poses for 1.2 s: the session ends
        if (silent_ms > 0 && --silent_ms == 0) tripped = 0, session = now_ns(CLOCK_REALTIME);
        if (force_age_ms >= ZERO_MS && !tripped && force.session == session) tripped = 1, silent_ms = SILENCE_MS;
        double factor = tripped ? 0 : fmin(1, fmax(0, (double)(ZERO_MS - force_age_ms) / (ZERO_MS - HOLD_MS)));

        // (3) give the force to your device here: N, in the scene's frame
        double given_n = factor * force.force_n[2];

        if (n % 500) continue;
        const char *why = force.flags & KNEAD_CONTACT_FORCE_T_FLAG_LATCHED ? "   latched: lift the tool" : "";
        if (tripped || force_age_ms >= ZERO_MS) why = "   no force from kneadd: is it running?";
        printf("z %5.1f mm   force %6.2f N%s\n", pose.position_m[2] * 1e3, given_n, why);
        fflush(stdout);
    }
}
