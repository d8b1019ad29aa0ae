#ifndef KN_BENCH_CEILINGS_H
#define KN_BENCH_CEILINGS_H
// The measured limits of one core of this machine: fused multiply-adds in registers, and reading.
//
// Twelve independent chains keep both pipes of any x86 full (2 pipes x 4 cycles). Reading adds up eight streams. Each
// number is the best of 8 rounds of some milliseconds of the thread's own time.
#include <stdbool.h>
#include <stddef.h>

enum { CEILING_256, CEILING_512, CEILING_WIDTHS }; // width of a vector in bits
enum { CEILING_L1, CEILING_L2, CEILING_L3, CEILING_MEMORY, CEILING_LEVELS };

typedef struct ceilings {
    double gflop_s[CEILING_WIDTHS][2]; // [.][f32, f64], a fused operation counts two; 0: not on this processor
    struct {
        size_t bytes; // read repeatedly
        double gb_s[CEILING_WIDTHS];
    } level[CEILING_LEVELS];
    size_t l1_bytes, l2_bytes, l3_bytes; // as the processor reports
} ceilings;

extern const char *const ceiling_level[CEILING_LEVELS]; // "L1", ...

ceilings ceilings_measure(void);

// Return the smallest level that holds so many bytes.
int ceiling_of(const ceilings *c, size_t bytes);

#endif
