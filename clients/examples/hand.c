// hand.c: connect your haptic device to a running kneadd, in 40 lines. Replace the three places marked (1) (2) (3). From
// the top of the source tree:
//
//     cc -O2 -Iclients -o build/my_hand clients/examples/hand.c -lm
//     build/my_hand [PROBE]          the tool's name in the scene, default finger; Ctrl-C ends the program
#include "knead_hand.h"
#include <math.h>
#include <signal.h>

static volatile sig_atomic_t ends;
static void end(int signal) { ends = signal; }

int main(int argc, char **argv)
{
    kn_hand hand; // has the watchdog: holds a force for 3 ms, fades it to 0 N by 20 ms
    if (!kn_hand_open(&hand, argc > 1 ? argv[1] : "finger"))
        return perror("hand: no multicast; is there a route? README.md says how"), 3;
    signal(SIGINT, end), signal(SIGTERM, end);
    // (1) open your device here and enable its force output
    for (int64_t ms = 0; !ends; ms++) {
        // (2) read your device here: m and m/s, z up, origin under the object's centre. Example: z swings 60 to 37 mm
        const double w = 2 * M_PI / 4, phase = w * 1e-3 * (double)ms;
        const double position_m[3] = {0, 0, 0.0485 + 0.0115 * cos(phase)};
        const double velocity_m_s[3] = {0, 0, -0.0115 * w * sin(phase)};

        double force_n[3];
        kn_hand_move(&hand, position_m, velocity_m_s, force_n); // waits for the next millisecond

        // (3) give force_n to your device here: N, in the scene's frame

        if (ms % 500) continue;
        printf("z %5.1f mm   force %6.2f N%s%s\n", position_m[2] * 1e3, force_n[2], *hand.trouble ? "   " : "",
               hand.trouble);
        fflush(stdout);
    }
    kn_hand_close(&hand); // leaves: the force fades, and the tool is free at once
    return 0;
}
