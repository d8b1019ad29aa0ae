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
    taken_apart took;
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
    m->target_us = target_of(l, def);
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
    }
    for (int p = 0; p < 2; p++) kn_state_destroy(start[p]);
    run_press(m, count, PRESS_TICKS, large || quick ? 2 : 3);
    return count;
}

static void print_apart(const measured *m)
{
    const double edge_us = m->took.edge_us, us = m->took.iteration_us;
    const char *kernel = kernel_name(&m->def);
    printf("| %5d | %-10s |%6.1f |%6.1f |%6.1f |%6.2f |%5.2f |%5.2f |%6.3f |\n", m->nodes, kernel, edge_us,
           edge_us * 1e3 / m->nodes, edge_us * 1e3 / m->lanes, us, us * 1e3 / m->nodes, us * 1e3 / m->lanes,
           us * 1e3 / m->edges);
    note("lattices", m->object, kernel, "edge_us", edge_us);
    note("lattices", m->object, kernel, "iteration_us", us);
    note("lattices", m->object, kernel, "iteration_ns_per_edge", us * 1e3 / m->edges);
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

void table_lattices(const throughput_options *o)
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
    puts("\nParts of a step: the edge pass with all other work done once per step, and one iteration. Times in ns per\n"
         "node, per lane (with padding) and per edge.\n");
    puts("| nodes | kernel     |edge us|ns/node|ns/lane|iter us|/node |/lane | /edge |");
    puts("|------:|------------|------:|------:|------:|------:|-----:|-----:|------:|");
    for (int l = 0; l < lattice_count; l++)
        for (int i = 0; i < count[l]; i++) print_apart(&m[l][i]);
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
