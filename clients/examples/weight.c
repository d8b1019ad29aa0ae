// weight.c: put a weight on the object of a running kneadd, and print the height of the plate under it. The plate is
// moved by force control, as a rheometer does under a constant load. From the top of the source tree:
//
//     cc -O2 -Iclients -o build/weight clients/examples/weight.c -lm
//     build/weight PROBE TOP_M WEIGHT_N SECONDS   TOP_M: height of the object's top;
//                                                 plate 0.01 0.49 60: 50 gf on a cube of 1 cm, for a minute
#include "knead_hand.h"
#include <math.h>

#define HOVER_M 1e-2 // kneadd takes up a tool only above the object
#define NEAR_M 2e-4  // the plate comes down fast to this height above the object, and then slowly
#define LOWER_M_S 1e-4
// The plate's speed grows by the factor exp(RATE dt (1 - force/weight)). An object resists like a damper whose viscosity
// changes by decades, so the speed is changed in proportion. A faster controller oscillates: forces are some ms old.
#define RATE 100.0 // 1/s

int main(int argc, char **argv)
{
    if (argc != 5) return fputs("usage: weight PROBE TOP_M WEIGHT_N SECONDS\n", stderr), 2;
    const double top_m = atof(argv[2]), weight_n = atof(argv[3]), seconds = atof(argv[4]);
    if (!(top_m > 0 && weight_n > 0 && seconds > 0))
        return fputs("weight: TOP_M, WEIGHT_N, SECONDS: expected numbers above 0\n", stderr), 2;
    kn_hand hand;
    if (!kn_hand_open(&hand, argv[1])) return perror("weight: no multicast; is there a route? README.md says how"), 3;
    double position_m[3] = {0, 0, top_m + HOVER_M}, velocity_m_s[3] = {0}, force_n[3], down_m_s = 0, since_s = 0;
    for (int64_t n = 1, last_ns = hand.next_ns; since_s < seconds; n++) {
        kn_hand_move(&hand, position_m, velocity_m_s, force_n); // waits for the next millisecond
        const double felt_n = hand.contact_n[2], dt_s = 1e-9 * (double)(hand.next_ns - last_ns);
        last_ns = hand.next_ns;
        if ((hand.flags & KN_HAND_LATCHED) || (*hand.trouble && since_s > 0))
            return fprintf(stderr, "weight: %s; start again\n", hand.trouble), 1;
        // hover until kneadd has taken up the tool, then lower the plate, then hold the weight
        if (since_s > 0) down_m_s *= exp(RATE * dt_s * (1 - fmin(felt_n / weight_n, 2)));
        else
            down_m_s = !(hand.flags & KN_HAND_ENGAGED)  ? 0
                       : position_m[2] > top_m + NEAR_M ? 100 * LOWER_M_S
                                                        : LOWER_M_S;
        if (since_s > 0 || felt_n > 0) since_s += dt_s;
        position_m[2] -= down_m_s * dt_s;
        velocity_m_s[2] = -down_m_s;
        if (since_s == 0 || (n % 1000 && since_s < seconds)) continue;
        printf("%6.2f s   %8.5f m   %7.4f N\n", since_s, position_m[2], felt_n);
        fflush(stdout);
    }
    kn_hand_close(&hand);
    return 0;
}
