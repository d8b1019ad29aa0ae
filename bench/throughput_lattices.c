// Tables of blocks of dough in several sizes, with every kernel.
#include "bench/throughput.h"
#include "tests/physics/press.h"

typedef struct lattice {
    int nodes[3];
    double spacing_m;
} lattice;

static const lattice lattices[] = {{{6, 6, 4}, 0.01},
                                   {{11, 11, 7}, 0.005},
                                   {{16, 16, 10}, 0.01 / 3},
                                   {{21, 21, 13}, 0.0025},
                                   {{29, 29, 20}, 0.05 / 28}};
enum { LATTICES = sizeof lattices / sizeof *lattices };

typedef struct measured { // results of one lattice with one kernel
    kn_model_def def;
    int nodes, edges, lanes; // lanes: nodes and the padding of the vectors
    taken_apart took;
    summary pressed; // times of the steps of the whole press, with the default settings
} measured;

static void describe(measured *m, const kn_model_def *def)
{
    kn_model *model = build(def);
    *m = (measured){.def = *def, .nodes = model->node_count, .edges = kn_grid_edges(&model->grid, NULL)};
    m->lanes = model->grid.rows * model->grid.vectors * KN_LANES;
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
        describe(&m[i], &each[i]);
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
}

static void print_pressed(const measured *m)
{
    const summary *s = &m->pressed;
    printf("| %5d | %-10s | %5.1f | %3d | %8.1f | %8.1f | %8.1f | %6.1f |\n", m->nodes, kernel_name(&m->def),
           s->mean_iterations, s->median_iterations, s->median_us, s->mean_us, s->p90_us,
           s->median_us * 1e3 / m->nodes);
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
    puts("| nodes | kernel     | its   | med |   median |     mean |      p90 | ns/node |");
    puts("|------:|------------|------:|----:|---------:|---------:|---------:|--------:|");
    for (int l = 0; l < lattice_count; l++)
        for (int i = 0; i < count[l]; i++) print_pressed(&m[l][i]);
}
