// Table that compares other engines with knead on one block: those that were there when this program was built.
#include "bench/throughput.h"

#include <stdio.h>

#if KN_PEER_BULLET || KN_PEER_VEGA
#include "bench/bench.h"
#include "bench/peer.h"
#include "tests/physics/press.h"

#define VISCOSITY_PA_S (2500 * GF_CM2) // the dough's c1
enum { PEER_TICKS = 300, PEERS = 6 };

// Return the block of dough without its damper, because the others can model only the remaining Voigt part.
static kn_model_def voigt_def(void)
{
    kn_model_def def = press_def(2);
    def.material.damper = KN_DAMPER_NONE;
    return def;
}

typedef struct rival {
    const kn_model *model; // knead's model of the block, from which nodes, links and the press are taken
    const peer_engine *engine;
    peer_block block;
    double (*x_m)[3];
    int (*link)[2];
    bool *held, *plate; // [nodes] held: the table or the plate holds the node; plate: the plate holds the node
    int substeps;
    peer *peer;
    double force_n, peak_n;
} rival;

static void copy_lattice(rival *r, const kn_model *m)
{
    int links = kn_grid_edges(&m->grid, NULL), nodes = m->node_count;
    kn_edge *edges = malloc((size_t)links * sizeof *edges);
    r->x_m = malloc((size_t)nodes * sizeof *r->x_m);
    r->link = malloc((size_t)links * sizeof *r->link);
    r->held = calloc((size_t)nodes, sizeof *r->held);
    r->plate = calloc((size_t)nodes, sizeof *r->plate);
    if (!edges || !r->x_m || !r->link || !r->held || !r->plate) abort();
    kn_grid_edges(&m->grid, edges);
    double weight = 0;
    for (int i = 0; i < links; i++) {
        r->link[i][0] = edges[i].i, r->link[i][1] = edges[i].j;
        weight += edges[i].weight / links;
    }
    memcpy(r->x_m, m->rest_m, (size_t)nodes * sizeof *r->x_m);
    for (int i = 0; i < nodes; i++) r->held[i] = m->support[i] != 0;
    double half_m = 0.5 * m->def.probe[0].size_m[0] + 1e-9;
    for (int t = 0; t < m->top_count; t++)
        r->held[m->top[t]] = r->plate[m->top[t]] = fabs(m->rest_m[m->top[t]][0]) <= half_m;
    free(edges);
    // All links get the mean stiffness of knead's edges, so that the sum of all stiffnesses is that of knead.
    r->block = (peer_block){.node_count = nodes,
                            .link_count = links,
                            .x_m = (const double(*)[3])r->x_m,
                            .link = (const int(*)[2])r->link,
                            .held = r->held,
                            .mass_kg = kn_model_mass(m) / nodes,
                            .stiffness_n_m = m->def.material.k1_pa * m->kappa_m * weight};
}

static void rival_rewind(void *self)
{
    rival *r = self;
    if (r->peer) r->engine->destroy(r->peer);
    r->peer = r->engine->create(&r->block);
    r->peak_n = 0;
}

// Return the sum of the vertical forces that the links exert on the plate's nodes, N.
static double plate_force(const rival *r)
{
    double sum = 0;
    for (int l = 0; l < r->block.link_count; l++) {
        const int *end = r->link[l];
        if (r->plate[end[0]] == r->plate[end[1]]) continue;
        double a[3], b[3], u[3], v[3], length = 0, rest = 0, rate = 0;
        r->engine->read(r->peer, end[0], a, u), r->engine->read(r->peer, end[1], b, v);
        for (int k = 0; k < 3; k++) {
            length += (b[k] - a[k]) * (b[k] - a[k]);
            rest += (r->x_m[end[1]][k] - r->x_m[end[0]][k]) * (r->x_m[end[1]][k] - r->x_m[end[0]][k]);
            rate += (b[k] - a[k]) * (v[k] - u[k]);
        }
        length = sqrt(length), rest = sqrt(rest), rate /= length;
        double pull = r->block.stiffness_n_m * (length - rest) / length, up = (b[2] - a[2]) * pull;
        up += r->block.damping_n_s_m * (r->block.axial ? rate * (b[2] - a[2]) / length : v[2] - u[2]);
        sum += r->plate[end[0]] ? up : -up; // force on the end that the plate holds
    }
    return sum;
}

static double rival_step(void *self, int tick, int *iterations)
{
    rival *r = self;
    double us = 0;
    for (int s = 1; s <= r->substeps; s++) {
        double t = tick * 1e-3 + s * r->block.dt_s;
        kn_input in = press_hand(r->model, t), before = press_hand(r->model, t - r->block.dt_s);
        double depth = r->model->rest_m[r->model->top[0]][2] - in.probe[0].position_m[2];
        const double v[3] = {0, 0, (in.probe[0].position_m[2] - before.probe[0].position_m[2]) / r->block.dt_s};
        for (int i = 0; i < r->block.node_count; i++) {
            const double x[3] = {r->x_m[i][0], r->x_m[i][1], r->x_m[i][2] - depth};
            if (r->plate[i]) r->engine->hold(r->peer, i, x, v);
        }
        double start = thread_us();
        r->engine->step(r->peer);
        us += thread_us() - start;
    }
    r->force_n = plate_force(r);
    r->peak_n = fmax(r->peak_n, fabs(r->force_n));
    *iterations = r->substeps;
    return us;
}

static runner rival_runner(rival *r, const peer_engine *engine, const kn_model *model, double viscosity_s, bool axial,
                           int substeps)
{
    *r = (rival){.engine = engine, .model = model, .substeps = substeps};
    copy_lattice(r, model);
    r->block.damping_n_s_m = r->block.stiffness_n_m * viscosity_s;
    r->block.axial = axial;
    r->block.dt_s = 1e-3 / substeps;
    return (runner){.self = r, .rewind = rival_rewind, .step = rival_step};
}

static void rival_free(rival *r)
{
    if (r->peer) r->engine->destroy(r->peer);
    free(r->x_m);
    free(r->link);
    free(r->held);
    free(r->plate);
}

static double our_peak(const kn_model_def *def)
{
    const press path = {.depth_m = 0.01, .hold_s = 0.5};
    run r = press_run(def, &path, PEER_TICKS * 1e-3, 1e-3);
    double peak = peak_n(&r);
    run_free(&r);
    return peak;
}

void table_peer(const throughput_options *o)
{
    const char *name[PEERS] = {"knead, whole material law", "knead, Voigt part alone"};
    kn_model_def dough_def = press_def(2), voigt = voigt_def();
    kn_model *model = build(&voigt);
    const double tau_s = VISCOSITY_PA_S / voigt.material.k1_pa, peaks[2] = {our_peak(&dough_def), our_peak(&voigt)};
    rival rivals[PEERS];
    runner r[PEERS] = {turns_knead(&dough_def, press_hand, NULL, 0), turns_knead(&voigt, press_hand, NULL, 0)};
    int count = 2;
#if KN_PEER_BULLET
    printf("\n%s: deformable body.", peer_bullet.name);
    name[count] = "Bullet, elastic, 2 x 0.5 ms";
    r[count] = rival_runner(&rivals[count], &peer_bullet, model, 0, true, 2), count++;
    name[count] = "Bullet, damped in 3 directions";
    r[count] = rival_runner(&rivals[count], &peer_bullet, model, tau_s, false, 1), count++;
    name[count] = "Bullet, damped along the links";
    r[count] = rival_runner(&rivals[count], &peer_bullet, model, tau_s, true, 1), count++;
#endif
#if KN_PEER_VEGA
    printf("\n%s: mass-spring system, implicit backward Euler.", peer_vega.name);
    name[count] = "Vega FEM, damped along the links";
    r[count] = rival_runner(&rivals[count], &peer_vega, model, tau_s, true, 1), count++;
#endif
    turns_run(r, count, PEER_TICKS, o->quick ? 1 : 3);
    const peer_block *b = &rivals[2].block;
    printf(
        "\n\nThe block has %d nodes and %d links. Each link has a stiffness of %.1f N/m and a damping of %.2f s times\n"
        "this stiffness. The first 0.3 s of the press, in ticks of 1 ms. knead has its default settings. peak: "
        "largest\n"
        "force.\n\n",
        b->node_count, b->link_count, b->stiffness_n_m, tau_s);
    puts("|                                  | us      | of knead's law | peak N  |\n"
         "|----------------------------------|--------:|---------------:|--------:|");
    double ours = 0;
    for (int i = 0; i < count; i++) {
        const summary s = turns_summary(&r[i], PEER_TICKS);
        const double peak = i < 2 ? peaks[i] : rivals[i].peak_n;
        if (i == 0) ours = s.median_us;
        printf("| %-32s | %7.1f | %13.1fx | %7.2f |\n", name[i], s.median_us, s.median_us / ours, peak);
    }
    turns_free(r, count);
    for (int i = 0; i < 2; i++) turns_destroy(&r[i]);
    for (int i = 2; i < count; i++) rival_free(&rivals[i]);
    kn_model_destroy(model);
}
#else
void table_peer(const throughput_options *o)
{
    (void)o;
    puts("\nNo comparison with other engines: there was none when this program was built, see bench/peers --help.");
}
#endif
