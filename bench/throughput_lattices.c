// Tables of blocks of dough in several sizes, with every kernel.
#include "bench/throughput.h"
#include "tests/physics/press.h"

typedef struct lattice {
    int nodes[3];
    double spacing_m, target_us; // target_us: largest wanted median time of a step in f32 with AVX-512; 0: no target
} lattice;

static const lattice lattices[] = {{{6, 6, 4}, 0.01, 0},
                                   {{11, 11, 7}, 0.005, 80},
                                   {{16, 16, 10}, 0.01 / 3, 200},
                                   {{21, 21, 13}, 0.0025, 500},
                                   {{29, 29, 20}, 0.05 / 28, 0}};
enum { LATTICES = sizeof lattices / sizeof *lattices };
#define AVX2_LONGER 1.6 // largest wanted ratio of a time with AVX2 to the time with AVX-512
#define F64_LONGER 2.2  // largest wanted ratio of a time in f64 to the time in f32

typedef struct measured { // results of one lattice with one kernel
    char object[16];
    kn_model_def def;
    int nodes, edges, lanes; // lanes: nodes and the padding of the vectors
    size_t state_bytes;      // memory of state and scratch
    taken_apart took;
    counted edge, iteration;
    summary pressed; // times of the steps of the whole press, with the default settings
    double target_us;
} measured;

static double target_of(const lattice *l, const kn_model_def *def)
{
    if (def->solver.precision == KN_PRECISION_F64) return 0;
    return def->solver.isa == KN_ISA_AVX512 ? l->target_us : AVX2_LONGER * l->target_us;
}

static void describe(measured *m, const lattice *l, const kn_model_def *def)
{
    kn_model *model = build(def);
    *m = (measured){.def = *def, .nodes = model->node_count, .edges = kn_grid_edges(&model->grid, NULL)};
    snprintf(m->object, sizeof m->object, "%d", m->nodes);
    m->lanes = model->grid.rows * model->grid.vectors * KN_LANES;
    m->state_bytes = kn_state_size(model) + kn_scratch_size(model);
    m->target_us = target_of(l, def);
    kn_model_destroy(model);
}

static void count_work(measured *m, const kn_state *start)
{
    kn_model_def def = turns_fixed(m->def, 2);
    def.solver.isa = KN_ISA_BASE;
    kn_model *model = build(&def);
    kn_state *state = kn_state_create(model);
    kn_scratch *scratch = kn_scratch_create(model);
    if (!state || !scratch) abort();
    kn_state_copy(model, state, start);
    kn_input in = press_hand(model, (PRESS_MIDDLE + 1) * def.solver.dt_s);
    if (def.solver.precision == KN_PRECISION_F32) counted_step_f32(model, state, scratch, &in, &m->edge, &m->iteration);
    else counted_step_f64(model, state, scratch, &in, &m->edge, &m->iteration);
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
    kn_model_destroy(model);
}

// Measure the steps of the whole press with the default settings.
static void run_press(measured *m, int count, int ticks, int rounds)
{
    runner r[KERNELS];
    for (int i = 0; i < count; i++) r[i] = turns_knead(&m[i].def, press_hand, NULL, 0);
    turns_run(r, count, ticks, rounds);
    for (int i = 0; i < count; i++) m[i].pressed = turns_summary(&r[i], ticks);
    turns_free(r, count);
    for (int i = 0; i < count; i++) turns_destroy(&r[i]);
}

static int measure(const lattice *l, bool quick, measured *m)
{
    kn_model_def def = press_def(1), each[KERNELS];
    taken_apart took[KERNELS];
    kn_state *start[2];
    memcpy(def.nodes, l->nodes, sizeof def.nodes);
    def.spacing_m = l->spacing_m;
    int count = kernels_of(def, each);
    for (int p = 0; p < 2; p++) {
        def.solver.precision = (kn_precision)p;
        start[p] = warm_state(def);
    }
    bool large = l->nodes[0] > 20;
    take_apart(each, count, start, large ? 40 : 100, quick ? 3 : large ? 5 : 10, took);
    for (int i = 0; i < count; i++) {
        describe(&m[i], l, &each[i]);
        m[i].took = took[i];
        count_work(&m[i], start[each[i].solver.precision]);
    }
    for (int p = 0; p < 2; p++) kn_state_destroy(start[p]);
    run_press(m, count, PRESS_TICKS, large || quick ? 2 : 3);
    return count;
}

static int width_of(const measured *m) { return m->def.solver.isa == KN_ISA_AVX512 ? CEILING_512 : CEILING_256; }

// Return the counted operations of `work`, in per cent of the operations that the arithmetic pipes can do in the time
// `us`.
static double pipe_share(const ceilings *c, const measured *m, const counted *work, double us)
{
    return 100 * work->operations / us * 1e-3 / (c->gflop_s[width_of(m)][m->def.solver.precision] / 2);
}

static void print_apart(const ceilings *c, const measured *m)
{
    const double edge_us = m->took.edge_us, us = m->took.iteration_us;
    const int level = ceiling_of(c, m->state_bytes);
    const double gb_s = m->iteration.bytes / us * 1e-3, most = c->level[level].gb_s[width_of(m)];
    printf("| %5d | %-10s |%6.1f |%6.1f |%6.1f |%4.0f |", m->nodes, kernel_name(&m->def), edge_us,
           edge_us * 1e3 / m->nodes, edge_us * 1e3 / m->lanes, pipe_share(c, m, &m->edge, edge_us));
    printf("%6.2f |%5.2f |%5.2f |%6.3f |%4.0f |%5.0f |%5.1f | %-6s %3.0f |\n", us, us * 1e3 / m->nodes,
           us * 1e3 / m->lanes, us * 1e3 / m->edges, pipe_share(c, m, &m->iteration, us),
           m->iteration.flops / us * 1e-3, gb_s, ceiling_level[level], 100 * gb_s / most);
    const char *kernel = kernel_name(&m->def);
    note("lattices", m->object, kernel, "edge_us", edge_us);
    note("lattices", m->object, kernel, "edge_pipe_percent", pipe_share(c, m, &m->edge, edge_us));
    note("lattices", m->object, kernel, "iteration_us", us);
    note("lattices", m->object, kernel, "iteration_ns_per_edge", us * 1e3 / m->edges);
    note("lattices", m->object, kernel, "iteration_pipe_percent", pipe_share(c, m, &m->iteration, us));
    note("lattices", m->object, kernel, "iteration_gflop_s", m->iteration.flops / us * 1e-3);
    note("lattices", m->object, kernel, "iteration_gb_s", gb_s);
    note("lattices", m->object, kernel, "iteration_bandwidth_percent", 100 * gb_s / most);
}

// Print the counted work of the largest lattice. Smaller lattices give other numbers, because a larger share of their
// nodes lies at the surface, where nodes have fewer edges.
static void print_work(const measured *m, int count)
{
    printf("\nOperations, flops and bytes per lane, with %d nodes:", m->nodes);
    for (int i = 0; i < count && i < 2; i++) // one part of the line for f32, one for f64
        printf(" %s edge pass %.0f, %.0f, %.0f, iteration %.0f, %.0f, %.0f%s",
               m[i].def.solver.precision ? "f64" : "f32", m[i].edge.operations / m[i].lanes,
               m[i].edge.flops / m[i].lanes, m[i].edge.bytes / m[i].lanes, m[i].iteration.operations / m[i].lanes,
               m[i].iteration.flops / m[i].lanes, m[i].iteration.bytes / m[i].lanes, i ? ".\n" : ";");
}

static void print_pressed(const measured *m)
{
    const summary *s = &m->pressed;
    printf("| %5d | %-10s | %5.1f | %3d | %8.1f | %8.1f | %8.1f | %6.1f |", m->nodes, kernel_name(&m->def),
           s->mean_iterations, s->median_iterations, s->median_us, s->mean_us, s->p90_us,
           s->median_us * 1e3 / m->nodes);
    if (m->target_us > 0) printf(" %4.0f %-6s |\n", m->target_us, s->median_us <= m->target_us ? "met" : "MISSED");
    else printf("          - |\n");
    const char *kernel = kernel_name(&m->def);
    note("press", m->object, kernel, "iterations_mean", s->mean_iterations);
    note("press", m->object, kernel, "iterations_median", s->median_iterations);
    note("press", m->object, kernel, "median_us", s->median_us);
    note("press", m->object, kernel, "mean_us", s->mean_us);
    note("press", m->object, kernel, "p90_us", s->p90_us);
    note("press", m->object, kernel, "target_us", m->target_us);
}

static const measured *find(const measured *m, int count, kn_isa isa, kn_precision p)
{
    for (int i = 0; i < count; i++)
        if (m[i].def.solver.isa == isa && m[i].def.solver.precision == p) return &m[i];
    return NULL;
}

static void print_ratio(const measured *a, const measured *b, const char *name, double aim)
{
    if (!a || !b) {
        printf("       -      |");
        return;
    }
    double ratio = a->pressed.median_us / b->pressed.median_us;
    printf(" %4.2f %-7s |", ratio, ratio <= aim ? "met" : "MISSED");
    note("ratios", a->object, "", name, ratio);
}

static void print_ratios(const measured *m, int count)
{
    const measured *w32 = find(m, count, KN_ISA_AVX512, KN_PRECISION_F32);
    const measured *w64 = find(m, count, KN_ISA_AVX512, KN_PRECISION_F64);
    const measured *n32 = find(m, count, KN_ISA_AVX2, KN_PRECISION_F32);
    const measured *n64 = find(m, count, KN_ISA_AVX2, KN_PRECISION_F64);
    printf("| %5d |", m->nodes);
    print_ratio(n32, w32, "avx2_over_avx512_f32", AVX2_LONGER);
    print_ratio(n64, w64, "avx2_over_avx512_f64", AVX2_LONGER);
    print_ratio(w64, w32, "f64_over_f32_avx512", F64_LONGER);
    print_ratio(n64, n32, "f64_over_f32_avx2", F64_LONGER);
    puts("");
}

void table_lattices(const ceilings *c, const throughput_options *o)
{
    measured m[LATTICES][KERNELS];
    int count[LATTICES], lattice_count = 0;
    for (int l = 0; l < LATTICES; l++) {
        const int *n = lattices[l].nodes;
        if (n[0] * n[1] * n[2] > o->nodes_max) break;
        fprintf(stderr, "%d nodes ...\n", n[0] * n[1] * n[2]);
        count[l] = measure(&lattices[l], o->quick, m[l]);
        lattice_count++;
    }
    if (lattice_count == 0 || count[0] == 0) {
        puts("\nNo lattice was measured: this processor has no AVX2, or --nodes excludes every lattice.");
        return;
    }
    puts(
        "\nParts of a step: the edge pass with all other work done once per step, and one iteration. Times in ns per\n"
        "node, per lane (with padding) and per edge. pipe%: rate of arithmetic operations, in % of the ceiling. GB/s:\n"
        "rate at which the loops touch the state; each loop counts a byte once.\n");
    puts("| nodes | kernel     |edge us|ns/node|ns/lane|pipe%|"
         "iter us|/node |/lane | /edge |pipe%|Gfl/s | GB/s | of       % |");
    puts("|------:|------------|------:|------:|------:|----:|"
         "------:|-----:|-----:|------:|----:|-----:|-----:|-----------:|");
    for (int l = 0; l < lattice_count; l++)
        for (int i = 0; i < count[l]; i++) print_apart(c, &m[l][i]);
    print_work(m[lattice_count - 1], count[lattice_count - 1]);
    puts("\nThe whole press with the default settings, us per step:\n");
    puts("| nodes | kernel     | its   | med |   median |     mean |      p90 | ns/node | target     |");
    puts("|------:|------------|------:|----:|---------:|---------:|---------:|--------:|-----------:|");
    for (int l = 0; l < lattice_count; l++)
        for (int i = 0; i < count[l]; i++) print_pressed(&m[l][i]);
    puts("\nRatios of the medians, and their targets:\n");
    puts("| nodes | AVX2/AVX-512 f32 <= 1.6 | f64 <= 1.6 | f64/f32 AVX-512 <= 2.2 | AVX2 <= 2.2 |");
    puts("|------:|------:|------:|------:|------:|");
    for (int l = 0; l < lattice_count; l++) print_ratios(m[l], count[l]);
}
