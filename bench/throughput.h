#ifndef KN_BENCH_THROUGHPUT_H
#define KN_BENCH_THROUGHPUT_H
// Tables of bench_throughput, and the measurements from which the tables are made.
#include "core/state.h"
#include "core/step.h"
#include <stdbool.h>
#include <stddef.h>

// ---- turns.c
//
// Comparison of the times of steps on a machine that also runs other programs.
//
// A runner repeats its ticks in every round, from identical states, so a tick does the same work in every round.
// Runners take turns every 20 ticks, so that all of them meet the same load from other programs. Times are processor
// times of the thread. The cost of a tick is its smallest time in all rounds, because other programs can only make a
// tick slower. The first tick of a turn is slower, too, because the previous runner has filled the caches with its own
// data. So each round begins its turns at different ticks, and no tick is the first one of a turn in every round.

typedef kn_input hand_fn(const kn_model *model, double t_s); // returns the input of the step that ends at the time t_s

typedef struct runner {
    void *self;
    void (*rewind)(void *self);
    double (*step)(void *self, int tick, int *iterations); // returns us
    double *us;                                            // [ticks] smallest time of each tick in all rounds, us
    int *iterations;                                       // [ticks] solver iterations of each tick
} runner;

typedef struct summary { // statistics of one runner over all its ticks
    double median_us, mean_us, p90_us, mean_iterations;
    int median_iterations;
} summary;

// Run all runners in turns, and fill in the arrays `us` and `iterations` of each. turns_free frees these arrays.
void turns_run(runner *runners, int count, int ticks, int rounds);
summary turns_summary(const runner *r, int ticks);
void turns_free(runner *runners, int count);

// Return a runner of knead's step. Each round starts at the tick `from` of the hand's motion. The object starts in a
// copy of the state `start`, or at rest if `start` is NULL. `start` may come from a model with another instruction set
// or number of iterations, but lattice, law and precision must be those of `def`.
runner turns_knead(const kn_model_def *def, hand_fn *hand, const kn_state *start, int from);
const kn_model *turns_model(const runner *r);
void turns_team(runner *r, kn_team *team); // let a team do the steps of a runner made by turns_knead
void turns_destroy(runner *r);             // frees a runner made by turns_knead

// Return the state after the first `ticks` ticks of the hand's motion. turns_knead can start from this state.
kn_state *turns_warm(const kn_model_def *def, hand_fn *hand, int ticks);

// Return `def`, changed so that every step makes this number of solver iterations, whatever the residual is.
kn_model_def turns_fixed(kn_model_def def, int iterations);

// ---- tables: each function prints a table as markdown

typedef struct throughput_options {
    bool quick;    // true: fewer ticks and rounds, less accurate times
    int nodes_max; // largest number of nodes; lattices and nets with more nodes are left out
} throughput_options;

void table_lattices(const throughput_options *o);
void table_threads(const throughput_options *o);
void table_nets(const throughput_options *o);
void table_features(const throughput_options *o);
void table_composite(const throughput_options *o);
void table_integers(const throughput_options *o);
void table_peer(const throughput_options *o); // without another engine at the build: prints one line
void table_errors(const throughput_options *o);

// ---- shared by the tables

// Write to `out` one copy of `def` for each kernel that this processor can run, in the order avx512 f32, avx512 f64,
// avx2 f32, avx2 f64. Return the number of copies.
enum { KERNELS = 4 };
int kernels_of(kn_model_def def, kn_model_def out[KERNELS]);
const char *kernel_name(const kn_model_def *def); // returns for example "avx512 f32"

// Return the input of one step of a press (tests/physics/press.h): down at 1 cm/s to a depth of 1 cm, hold for half a
// second, withdraw. Together with the rest afterwards, the press takes PRESS_TICKS ticks of 1 ms.
kn_input press_hand(const kn_model *model, double t_s);
enum { PRESS_TICKS = 2100, PRESS_MIDDLE = 400 };
kn_state *warm_state(kn_model_def def); // returns the state at tick PRESS_MIDDLE, while the plate goes down steadily

// Times of the two parts of a step. edge_us: the edge pass and all other work that is done once per step. iteration_us:
// one iteration.
typedef struct taken_apart {
    double edge_us, iteration_us;
} taken_apart;
// Compute the times of the parts from steps of 4 and of 20 iterations, which run in turns after tick PRESS_MIDDLE. def,
// out: arrays of `count` kernels. start: state at PRESS_MIDDLE in f32 and in f64.
void take_apart(const kn_model_def *def, int count, kn_state *const start[2], int ticks, int rounds, taken_apart *out);

#endif
