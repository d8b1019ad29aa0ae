// Table of a block with two resolutions (dough-fine.yaml), compared with a block that is fine everywhere. In most rows,
// a tool of the scene presses the block at a place that the tool can reach. In the last row, the tool is a plate across
// the whole block, which needs more fine nodes than a spatula.
#include "bench/throughput.h"
#include "core/lattice/lattice.h"
#include "core/scene/scene.h"
#include "tests/physics/press.h"

typedef struct place {
    const char *name;
    int probe;
    double at_m[2], depth_m;
} place;

static const place *now; // place and depth of the press that is being measured

static kn_input hand(const kn_model *model, double t_s)
{
    const kn_probe_def *probe = &model->def.probe[now->probe];
    const press p = {.depth_m = now->depth_m, .hold_s = 0.3};
    double dt = model->def.solver.dt_s, depth = press_depth(&p, t_s - dt);
    kn_input in = {0};
    kn_probe_input *tool = &in.probe[now->probe];
    tool->attached = true;
    for (int k = 0; k < 2; k++) tool->position_m[k] = now->at_m[k];
    tool->position_m[2] = model->rest_m[model->top[0]][2] + probe->radius_m - depth;
    tool->velocity_m_s[2] = (depth - press_depth(&p, t_s)) / dt;
    return in;
}

typedef struct felt {
    double (*force_n)[3], (*shape_m)[3];
} felt;

static felt feel(const kn_model_def *def, int ticks)
{
    kn_model *m = build(def);
    kn_state *state = kn_state_create(m);
    kn_scratch *scratch = kn_scratch_create(m);
    felt f = {calloc((size_t)ticks, sizeof *f.force_n), calloc((size_t)m->grid.nodes, sizeof *f.shape_m)};
    kn_output out;
    if (!state || !scratch || !f.force_n || !f.shape_m) abort();
    for (int i = 0; i < ticks; i++) {
        kn_input in = hand(m, (i + 1) * def->solver.dt_s);
        kn_step(m, state, scratch, &in, &out);
        memcpy(f.force_n[i], out.probe[now->probe].force_n, sizeof *f.force_n);
    }
    for (int i = 0; i < m->grid.nodes; i++) {
        int at[3];
        kn_grid_coords(&m->grid, i, at);
        kn_composite_displacement(m, state, at, f.shape_m[i]);
    }
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
    kn_model_destroy(m);
    return f;
}

static void row(const place *p, const kn_model_def *composite, const throughput_options *o)
{
    enum { TICKS = 1200 };
    kn_model_def def[2] = {*composite, *composite};
    felt f[2];
    summary s[2];
    now = p;
    memset(def[1].fine, 0, sizeof def[1].fine);
    runner r[2] = {turns_knead(&def[0], hand, NULL, 0), turns_knead(&def[1], hand, NULL, 0)};
    const kn_model *m = turns_model(&r[0]);
    turns_run(r, 2, TICKS, o->quick ? 1 : 3);
    for (int i = 0; i < 2; i++) s[i] = turns_summary(&r[i], TICKS), f[i] = feel(&def[i], TICKS);
    double force = relative_error((const double(*)[3])f[0].force_n, (const double(*)[3])f[1].force_n, TICKS);
    double shape = relative_error((const double(*)[3])f[0].shape_m, (const double(*)[3])f[1].shape_m, m->grid.nodes);
    printf("| %-26s | %5d | %5d | %5.1f | %5.1f | %6.0f | %6.0f | %5.2f | %6.2f | %6.2f |\n", p->name,
           m->node_count - kn_composite_tied(m), m->grid.nodes, s[0].mean_iterations, s[1].mean_iterations,
           s[0].mean_us, s[1].mean_us, s[0].mean_us / s[1].mean_us, 100 * force, 100 * shape);
    turns_free(r, 2);
    for (int i = 0; i < 2; i++) {
        turns_destroy(&r[i]);
        free(f[i].force_n);
        free(f[i].shape_m);
    }
}

// Return the scene's model with a single plate, 1 cm wide, across the whole block. The box of fine cells follows the
// scene's rule: the box extends beyond the plate by 0.7 of the plate's width, and down by 1.05 widths.
static kn_model_def strip_of(kn_model_def def)
{
    double length = def.spacing_m * (def.nodes[1] - 1), top = def.spacing_m * (def.nodes[2] - 1);
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "strip", .shape = KN_PROBE_PLATE, .size_m = {0.01, length}};
    kn_composite_box(&def, (double[3]){-0.005, -length, top - 0.0035}, (double[3]){0.005, length, top}, 0.007,
                     def.fine);
    return def;
}

void table_composite(const throughput_options *o)
{
    static const place places[] = {{"spatula in the middle", 0, {0, 0}, 0.004},
                                   {"spatula, corner of reach", 0, {0.003, -0.003}, 0.004},
                                   {"spatula between the nodes", 0, {-0.0017, 0.0011}, 0.004},
                                   {"fingertip, corner of reach", 1, {0.003, 0.003}, 0.003}};
    static const place strip = {"strip, 1 cm x 4.5 cm", 0, {0, 0}, 0.006};
    char error[256];
    kn_scene *scene = kn_scene_load(KN_SOURCE_DIR "/core/scenes/dough-fine.yaml", NULL, 0, error, sizeof error);
    printf("\n## composite: coarse away from the tools\n\n");
    if (!scene || scene->model.nodes[0] * scene->model.nodes[1] * scene->model.nodes[2] > o->nodes_max) {
        printf("Left out: %s.\n", scene ? "larger than --nodes" : error);
        kn_scene_destroy(scene);
        return;
    }
    printf(
        "dough-fine.yaml compared with a block that is fine everywhere. A column `of` has the fine block's value of\n"
        "the column before it. Times are means over the press. Errors are relative L2 errors: `force` over all ticks,\n"
        "`shape` over all nodes of the fine block at the end. The box of fine cells follows the scene's rule for all\n"
        "presses.\n\n"
        "| press                      | nodes | of    | its   | of    | us     | of     | ratio | force%% | shape%% |\n"
        "|----------------------------|------:|------:|------:|------:|-------:|-------:|------:|-------:|-------:|\n");
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) row(&places[i], &scene->model, o);
    kn_model_def def = strip_of(scene->model);
    row(&strip, &def, o);
    kn_scene_destroy(scene);
}
