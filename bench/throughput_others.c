// Table of nets (meshes of tetrahedra or triangles), and table of the cost of each feature of a scene.
#include "bench/throughput.h"
#include "core/scene/mesh_file.h"
#include "tests/physics/bcc.h"
#include "tests/physics/press.h"

// --- nets -----------------------------------------------------------------------------------------------------------

typedef struct net {
    const char *name;
    kn_simplices *mesh;
    int edges;
    double edge_m;
} net;

static kn_simplices *shipped(const char *name)
{
    char path[512], error[400];
    snprintf(path, sizeof path, KN_SOURCE_DIR "/core/scenes/meshes/%s", name);
    kn_simplices *mesh = kn_msh_load(path, 1000, NULL, error, sizeof error);
    if (!mesh) {
        fprintf(stderr, "bench_throughput: %s\n", error);
        exit(3);
    }
    kn_simplices_place(mesh);
    return mesh;
}

static net net_of(const char *name, kn_simplices *mesh)
{
    kn_simplices_measures m;
    if (!kn_simplices_measure(mesh, &m)) abort();
    return (net){name, mesh, m.edges, m.edge_mean_m};
}

static kn_model_def net_def(const net *n)
{
    kn_model_def def = press_def(1);
    def.mesh = n->mesh;
    def.spacing_m = n->edge_m;
    def.thickness_m = n->mesh->dimension == 2 ? 0.05 : 0;
    return def;
}

static void print_net(const net *n, const kn_model_def *def, const taken_apart *took, const summary *s)
{
    double nodes = n->mesh->node_count, edges = n->edges;
    printf("| %-9s | %5d | %5d | %-10s | %6.1f | %5.1f | %5.2f | %6.2f | %5.2f | %5.2f | %5.1f | %8.1f |\n", n->name,
           n->mesh->node_count, n->edges, kernel_name(def), took->edge_us, took->edge_us * 1e3 / nodes,
           took->edge_us * 1e3 / edges, took->iteration_us, took->iteration_us * 1e3 / nodes,
           took->iteration_us * 1e3 / edges, s->mean_iterations, s->median_us);
}

static void measure_net(const net *n, int rounds)
{
    kn_model_def def = net_def(n), each[KERNELS];
    taken_apart took[KERNELS];
    runner r[KERNELS];
    kn_state *start[2];
    int count = kernels_of(def, each), ticks = PRESS_TICKS / 3;
    for (int p = 0; p < 2; p++) {
        def.solver.precision = (kn_precision)p;
        start[p] = warm_state(def);
    }
    take_apart(each, count, start, 60, rounds, took);
    for (int i = 0; i < count; i++) r[i] = turns_knead(&each[i], press_hand, NULL, 0);
    turns_run(r, count, ticks, 2);
    for (int i = 0; i < count; i++) {
        summary s = turns_summary(&r[i], ticks);
        print_net(n, &each[i], &took[i], &s);
    }
    turns_free(r, count);
    for (int i = 0; i < count; i++) turns_destroy(&r[i]);
    for (int p = 0; p < 2; p++) kn_state_destroy(start[p]);
}

void table_nets(const throughput_options *o)
{
    net nets[] = {net_of("block.msh", shipped("block.msh")), net_of("bun.msh", shipped("bun.msh")),
                  net_of("disc.msh", shipped("disc.msh")),
                  net_of("bcc 5 mm", bcc_block((const int[3]){10, 10, 6}, 0.005)),
                  net_of("bcc 2.5mm", bcc_block((const int[3]){20, 20, 12}, 0.0025))};
    puts("\nNets of tetrahedra (disc.msh: of triangles), pressed like the blocks. Times of the edge pass, of an\n"
         "iteration, and of a step with the default settings in the first 0.7 s of the press.\n");
    puts("| net       | nodes | edges | kernel     | "
         "edge us| /node | /edge | iter us| /node | /edge | its   | median us|");
    puts("|-----------|------:|------:|------------|"
         "-------:|------:|------:|-------:|------:|------:|------:|---------:|");
    for (size_t i = 0; i < sizeof nets / sizeof *nets; i++) {
        if (nets[i].mesh->node_count <= o->nodes_max) measure_net(&nets[i], o->quick ? 3 : 8);
        kn_simplices_destroy(nets[i].mesh);
    }
}

// --- features -------------------------------------------------------------------------------------------------------

// Return the input of a press. During the press, a load on the top rises and falls, so that all parts of the object
// move. All probes get the input of the first one.
static kn_input feature_hand(const kn_model *model, double t_s)
{
    kn_input in = press_hand(model, t_s);
    in.top_load_n = 2 + sin(20 * M_PI * t_s);
    in.probe[0].attached = model->def.probe_count > 0;
    for (int p = 1; p < model->def.probe_count; p++) in.probe[p] = in.probe[0];
    return in;
}

typedef struct feature {
    const char *name;
    int over; // index of the feature to which this feature is added
    kn_model_def def;
} feature;

enum { VOIGT, CONSTANT, EXPONENTIAL, STROKE, GRAVITY, WEAKER, GAS_CELLS, GAS_OBJECT, PLATE, SPHERE, PROBES, FEATURES };

static kn_probe_def ball_at(const char *name)
{
    kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = 0.01};
    snprintf(ball.name, sizeof ball.name, "%s", name);
    return ball;
}

static void list_features(feature f[FEATURES])
{
    kn_model_def plain = turns_fixed(press_def(2), 8);
    const kn_probe_def plate = plain.probe[0];
    plain.probe_count = 0;
    plain.material.damper = KN_DAMPER_NONE;
    for (int i = 0; i < FEATURES; i++) f[i] = (feature){.over = VOIGT, .def = plain};

    f[VOIGT].name = "Voigt part alone, no probe";
    f[CONSTANT].name = "+ damper, c2 constant";
    f[CONSTANT].def.material.damper = KN_DAMPER_CONSTANT;
    f[CONSTANT].def.material.c2_pa_s = plain.material.alpha_pa_s;
    f[EXPONENTIAL].name = "+ damper, c2 exponential";
    f[EXPONENTIAL].def.material = dough;
    f[STROKE] = f[EXPONENTIAL];
    f[STROKE].name = "  + stops of this damper";
    f[STROKE].over = EXPONENTIAL;
    f[STROKE].def.material.ratio = 0.5;
    f[STROKE].def.material.stroke[0] = 0.4, f[STROKE].def.material.stroke[1] = 0.6;
    f[GRAVITY].name = "+ gravity";
    f[GRAVITY].def.gravity_m_s2 = 9.81;
    f[WEAKER].name = "+ diagonals half as stiff";
    f[WEAKER].def.diagonal_stiffness = 0.5;
    f[GAS_CELLS].name = "+ gas in each cell";
    f[GAS_CELLS].def.pressure = KN_PRESSURE_CELLS;
    f[GAS_OBJECT].name = "+ gas in the whole object";
    f[GAS_OBJECT].def.pressure = KN_PRESSURE_OBJECT;
    f[PLATE].name = "+ one plate, 33 nodes held";
    f[PLATE].def.probe_count = 1;
    f[PLATE].def.probe[0] = plate;
    f[SPHERE].name = "+ one sphere";
    f[SPHERE].def.probe_count = 1;
    f[SPHERE].def.probe[0] = ball_at("ball");
    f[PROBES].name = "+ two spheres";
    f[PROBES].def.probe_count = 2;
    f[PROBES].def.probe[0] = ball_at("ball");
    f[PROBES].def.probe[1] = ball_at("other");
}

void table_features(const throughput_options *o)
{
    enum { TICKS = 100 };
    feature f[FEATURES];
    runner r[FEATURES];
    summary s[FEATURES];
    list_features(f);
    for (int i = 0; i < FEATURES; i++) {
        kn_state *start = turns_warm(&f[i].def, feature_hand, PRESS_MIDDLE);
        r[i] = turns_knead(&f[i].def, feature_hand, start, PRESS_MIDDLE);
        kn_state_destroy(start);
    }
    turns_run(r, FEATURES, TICKS, o->quick ? 5 : 20);
    puts("\nCost of each feature of a scene, added alone: 847 nodes, the fastest kernel in f32, 8 iterations, under a\n"
         "load that rises and falls. The features are measured in turns.\n");
    puts("| feature                            | us     | more   | state KiB |");
    puts("|------------------------------------|-------:|-------:|----------:|");
    for (int i = 0; i < FEATURES; i++) {
        s[i] = turns_summary(&r[i], TICKS);
        double kib = (double)(kn_state_size(turns_model(&r[i])) + kn_scratch_size(turns_model(&r[i]))) / 1024;
        printf("| %-34s | %6.1f | ", f[i].name, s[i].median_us);
        if (i == VOIGT) printf("       |");
        else printf("%+6.1f |", s[i].median_us - s[f[i].over].median_us);
        printf(" %9.0f |\n", kib);
    }
    turns_free(r, FEATURES);
    for (int i = 0; i < FEATURES; i++) turns_destroy(&r[i]);
}
