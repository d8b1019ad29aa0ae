// Touch the dough of a running kneadd (kneadd dough-small), in C or C++; touch.py and touch.js do
// the same. For a haptic device of your own, replace the places (1) (2) (3). From the top of the source tree:
//     cc -I clients -o build/touch clients/examples/touch.c -lm && build/touch
#include "knead_hand.h"
#include <math.h>

int main(void)
{
    kn_hand hand;
    if (!kn_hand_open(&hand, "finger")) return perror("touch: no LCM; is there a multicast route?"), 3;
    // (1) open your device here and enable its force output
    for (int ms = 0; ms < 4000; ms++) {
        // (2) read your device here: m and m/s, z up, origin under the object's centre. Here: down and up, 60 to 37 mm
        const double phase = 2 * 3.14159265358979 * ms / 4000, up[3] = {0, 0, 0.0485 + 0.0115 * cos(phase)};
        const double speed[3] = {0, 0, -0.0115 * 2 * 3.14159265358979 / 4 * sin(phase)};
        double force_n[3];
        kn_hand_move(&hand, up, speed, force_n); // waits for the next millisecond
        // (3) give force_n to your device here: N, in the scene's frame
        if (ms % 250 == 0) printf("z %5.1f mm   force %6.2f N   %s\n", 1e3 * up[2], force_n[2], hand.trouble);
    }
    kn_hand_close(&hand); // leaves: the force fades, and the tool is free at once
    return 0;
}
