#ifndef KN_TESTS_DICE_H
#define KN_TESTS_DICE_H
// Random numbers that are the same on every machine: a linear congruential generator. seed: state kept by the caller,
// any number to start with.
#include <math.h>
#include <stdint.h>

static inline double kn_dice(uint64_t *seed) // uniform in [0, 1)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) * 0x1p-53;
}

static inline double kn_dice_in(uint64_t *seed, double low, double high) { return low + (high - low) * kn_dice(seed); }

static inline double kn_dice_normal(uint64_t *seed) // normal: mean 0, deviation 1
{
    double size = sqrt(-2 * log(kn_dice(seed) + 0x1p-54));
    return size * cos(2 * acos(-1.0) * kn_dice(seed));
}

#endif
