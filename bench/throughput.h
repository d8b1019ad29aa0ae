#ifndef KN_BENCH_THROUGHPUT_H
#define KN_BENCH_THROUGHPUT_H
// The tables of bench_throughput. Each prints itself as markdown and records its numbers for --csv and --json.
#include "bench/ceilings.h"
#include "bench/turns.h"

typedef struct throughput_options {
    bool quick;    // fewer ticks and rounds
    int nodes_max; // larger lattices are left out
} throughput_options;

void table_ceilings(const ceilings *c);
void table_lattices(const ceilings *c, const throughput_options *o);
void table_nets(const throughput_options *o);
void table_features(const throughput_options *o);
void table_composite(const throughput_options *o);
void table_integers(const throughput_options *o);
void table_peer(const throughput_options *o); // says so if this build has no peer
void table_errors(const throughput_options *o);

// Record one number for --csv and --json: its table, its object (a lattice, a feature), its kernel ("" if none), and
// its name with the unit.
void note(const char *table, const char *object, const char *kernel, const char *name, double value);

// --- shared by the tables
// -------------------------------------------------------------------------------------------

// Return def with each kernel of this processor, in this order: avx512 f32, avx512 f64, avx2 f32, avx2 f64.
enum { KERNELS = 4 };
int kernels_of(kn_model_def def, kn_model_def out[KERNELS]);
const char *kernel_name(const kn_model_def *def); // "avx512 f32"

// The press of press.h: 1 cm/s to 1 cm, half a second held, withdrawn: 2100 ticks with the rest afterwards.
kn_input press_hand(const kn_model *model, double t_s);
enum { PRESS_TICKS = 2100, PRESS_MIDDLE = 400 };
kn_state *warm_state(kn_model_def def); // at tick PRESS_MIDDLE, where the plate goes down steadily

// The parts of a step: one edge pass with all other work done once per step, and the iterations. The times come from
// steps of 4 and of 20 iterations, in turns, after PRESS_MIDDLE. start: one state per precision.
typedef struct taken_apart {
    double edge_us, iteration_us;
} taken_apart;
void take_apart(const kn_model_def *def, int count, kn_state *const start[2], int ticks, int rounds, taken_apart *out);

#endif
