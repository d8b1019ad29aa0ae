// The cost and the error of a learner's steps of 10 ms (bench/FIGURES.md).
//
//     bench_learner [--fine | --batch] [--states N]
//
// A ball of 3 cm goes into dough at 1.5 cm/s for 0.8 s, strokes it with a new random velocity every 20 ms, and goes up
// at 2 cm/s. Errors are those of the force vector at the end of each 20 ms, in per cent of the largest force, against
// f64 with steps of 0.1 ms solved to 1e-6. --fine also compares 847 nodes, whose reference takes some minutes. --batch
// prints the table of batches alone.
#include "bench/bench.h"
#include "core/ensemble.h"
#include "core/hash.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ACTIONS = 50, DOWN = 40 };
#define ACTION_S 0.02

typedef struct course {
    double force_n[ACTIONS][3];
    double us, lines; // thread's time of a step, number of lines of a step
} course;

static double draw(uint64_t *seed) // uniform in -1 .. 1
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / (double)(1ull << 52) - 1;
}

static kn_model *block(bool fine, double dt_s, int passes, bool exact, kn_isa isa)
{
    char error[200];
    kn_model_def def = kn_model_def_default();
    if (fine) memcpy(def.nodes, (int[]){11, 11, 7}, sizeof def.nodes), def.spacing_m = 0.005;
    def.solver.dt_s = dt_s;
    def.solver.passes = passes;
    def.solver.isa = isa;
    if (exact)
        def.solver = (kn_solver_def){.precision = KN_PRECISION_F64,
                                     .dt_s = dt_s,
                                     .iterations = 4,
                                     .iterations_max = 60,
                                     .tolerance = 1e-6,
                                     .passes = 4,
                                     .mass_scale = 1};
    kn_model *model = kn_model_build(&def, error, sizeof error);
    if (!model) fprintf(stderr, "bench_learner: %s\n", error), exit(1);
    return model;
}

// Set the velocity of the ball for an action.
static void choose(kn_probe_input *ball, int action, uint64_t *seed)
{
    if (action == 0) ball->attached = true, ball->position_m[2] = 0.046;
    ball->velocity_m_s[0] = 0.01 * draw(seed);
    ball->velocity_m_s[1] = 0.01 * draw(seed);
    ball->velocity_m_s[2] = action < DOWN ? -0.015 : 0.02;
}

static course play(kn_model *model)
{
    course c = {0};
    kn_state *state = kn_state_create(model);
    kn_scratch *scratch = kn_scratch_create(model);
    kn_input in = {0};
    kn_output out;
    uint64_t seed = 1;
    const double dt_s = model->def.solver.dt_s;
    const int steps = (int)lround(ACTION_S / dt_s);
    if (!state || !scratch) abort();
    const double begin_us = thread_us();
    for (int a = 0; a < ACTIONS; a++) {
        choose(&in.probe[0], a, &seed);
        for (int s = 0; s < steps; s++) {
            if (kn_step(model, state, scratch, &in, &out) != KN_OK) exit(1);
            for (int k = 0; k < 3; k++) in.probe[0].position_m[k] += dt_s * in.probe[0].velocity_m_s[k];
            c.lines += out.passes;
        }
        memcpy(c.force_n[a], out.probe[0].force_n, sizeof c.force_n[a]);
    }
    c.us = (thread_us() - begin_us) / (ACTIONS * steps);
    c.lines /= ACTIONS * steps;
    kn_scratch_destroy(scratch);
    kn_state_destroy(state);
    kn_model_destroy(model);
    return c;
}

// Return the largest and, in *rms, the root mean square error of a course, in per cent of the largest force.
static double error_of(const course *c, const course *exact, double *rms)
{
    double most = 0, sum = 0, peak = 0;
    for (int a = 0; a < ACTIONS; a++) {
        double off = 0, size = 0;
        for (int k = 0; k < 3; k++) {
            off += pow(c->force_n[a][k] - exact->force_n[a][k], 2);
            size += pow(exact->force_n[a][k], 2);
        }
        most = fmax(most, off), sum += off, peak = fmax(peak, size);
    }
    *rms = 100 * sqrt(sum / ACTIONS / peak);
    return 100 * sqrt(most / peak);
}

static void table_errors(bool fine)
{
    static const struct row {
        const char *what;
        double dt_s;
        int passes;
    } rows[] = {{"1 ms", 1e-3, 1},
                {"5 ms", 5e-3, 1},
                {"10 ms, on demand", 0.01, 1},
                {"10 ms, 2 lines", 0.01, 2},
                {"10 ms, 3 lines", 0.01, 3},
                {"10 ms, 4 lines", 0.01, 4},
                {"10 ms, 6 lines", 0.01, 6},
                {"10 ms, 12 lines", 0.01, 12}};
    enum { ROWS = sizeof rows / sizeof *rows };
    const course exact = play(block(fine, 1e-4, 4, true, KN_ISA_AUTO));
    printf("\n| %s nodes         | lines | us a step | of 1 ms | real time | error | rms   |\n", fine ? "847" : "144");
    puts("|-------------------|------:|----------:|--------:|----------:|------:|------:|");
    double first = 0;
    for (int r = 0; r < ROWS; r++) {
        course best = play(block(fine, rows[r].dt_s, rows[r].passes, false, KN_ISA_AUTO));
        for (int again = 0; again < 4; again++)
            best.us = fmin(best.us, play(block(fine, rows[r].dt_s, rows[r].passes, false, KN_ISA_AUTO)).us);
        double rms, most = error_of(&best, &exact, &rms);
        if (r == 0) first = best.us;
        printf("| %-17s | %5.1f | %9.0f | %7.2f | %7.1f x | %4.1f%% | %4.1f%% |\n", rows[r].what, best.lines, best.us,
               best.us / first, 1e6 * rows[r].dt_s / best.us, most, rms);
    }
}

// Play the course on `states` states, each with its own random numbers. Return the hash of all states; *real_time is
// the simulated time per time of the wall.
static uint64_t batch(bool fine, double dt_s, int states, int threads, kn_isa isa, double *real_time)
{
    kn_model *model = block(fine, dt_s, 1, false, isa);
    kn_ensemble *e = kn_ensemble_create(model, states, threads);
    kn_input *in = calloc((size_t)states, sizeof *in);
    kn_output *out = calloc((size_t)states, sizeof *out);
    uint64_t *seed = calloc((size_t)states, sizeof *seed), hash = KN_HASH_SEED;
    const int steps = (int)lround(ACTION_S / dt_s);
    if (!e || !in || !out || !seed) abort();
    for (int i = 0; i < states; i++) seed[i] = (uint64_t)i + 1;
    const double begin_us = clock_us(CLOCK_MONOTONIC);
    for (int a = 0; a < ACTIONS; a++) {
        for (int i = 0; i < states; i++) choose(&in[i].probe[0], a, &seed[i]);
        if (kn_ensemble_step(e, steps, in, out, NULL) != KN_OK) exit(1);
        for (int i = 0; i < states; i++)
            for (int k = 0; k < 3; k++) in[i].probe[0].position_m[k] += ACTION_S * in[i].probe[0].velocity_m_s[k];
    }
    *real_time = 1e6 * states * ACTIONS * ACTION_S / (clock_us(CLOCK_MONOTONIC) - begin_us);
    for (int i = 0; i < states; i++) {
        const uint64_t one = kn_state_hash(model, kn_ensemble_state(e, i));
        hash = kn_hash_bytes(hash, &one, sizeof one);
    }
    free(seed), free(out), free(in);
    kn_ensemble_destroy(e);
    kn_model_destroy(model);
    return hash;
}

static void table_batches(int states)
{
    static const char *const name[] = {"", "base", "AVX2", "AVX-512"};
    printf("\n%d states at once, steps of 10 ms\n\n", states);
    puts("| nodes | threads | kernels | real time a thread | hash             | 1 000 states |");
    puts("|------:|--------:|---------|-------------------:|------------------|-------------:|");
    for (int fine = 0; fine < 2; fine++)
        for (int isa = KN_ISA_AVX512; isa >= KN_ISA_BASE; isa--)
            for (int threads = 1; threads <= 2; threads++) {
                if (!kn_isa_supported((kn_isa)isa)) continue;
                if (isa == KN_ISA_BASE && (threads == 2 || fine)) continue; // slow: without fused multiply-add
                double rate = 0, best = 0;
                uint64_t hash = 0;
                for (int again = 0; again < (isa == KN_ISA_BASE ? 1 : 3); again++) {
                    hash = batch(fine, 0.01, states, threads, (kn_isa)isa, &rate);
                    best = fmax(best, rate);
                }
                kn_model *model = block(fine, 0.01, 1, false, KN_ISA_AUTO);
                const double mb =
                    1e-6 * (1000.0 * (double)kn_state_size(model) + threads * (double)kn_scratch_size(model));
                printf("| %5d | %7d | %-7s | %16.1f x | %016llx | %9.1f MB |\n", model->node_count, threads, name[isa],
                       best / threads, (unsigned long long)hash, mb);
                kn_model_destroy(model);
            }
}

int main(int argc, char **argv)
{
    bool fine = false, alone = false;
    int states = 64;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--fine") == 0) fine = true;
        else if (strcmp(argv[i], "--batch") == 0) alone = true;
        else if (strcmp(argv[i], "--states") == 0 && i + 1 < argc && atoi(argv[i + 1]) > 0) states = atoi(argv[++i]);
        else return fprintf(stderr, "usage: bench_learner [--fine | --batch] [--states N]\n"), 2;
    }
    print_machine();
    if (!alone) table_errors(false);
    if (fine) table_errors(true);
    table_batches(states);
    return 0;
}
