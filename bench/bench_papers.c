// One experiment of the papers. The first probe of a scene presses the object; in an experiment without a press, the
// object sags under its own weight. bench/papers runs this program for each figure of the papers. The program writes
// pictures and curves to files whose names begin with --prefix, and prints the measured values as one line of JSON.
#include "clients/picture/object_still.h"
#include "clients/viewer/image.h"
#include "core/scene/scene.h"
#include "core/surface.h"
#include "tests/physics/press.h"
#include <getopt.h>

#define PICTURE_WIDTH 800
#define PICTURE_HEIGHT 560
#define CELLS_EVERY 20 // number of steps between two checks of the cells' volumes
// Number of steps over which the median of the force is taken. The median removes the jump of the force in the single
// step in which the plate catches a node.
#define CATCH 3

typedef struct options {
    const char *scene, *prefix, *sets[32];
    int set_count;
    press path;
    double rest_s, lean;
    kn_view_scene look;
    bool pictures;
} options;

typedef struct measures {
    // peak_n: largest force. dip_n: largest decrease of the force while the tool goes down. end_n: force at the end of
    // the hold.
    double peak_n, dip_n, end_n;
    // Values at the end of the hold. bulge_m: outward motion of the sides along x and y. volume_share: change of the
    // volume, divided by the volume at rest.
    double bulge_m[2], volume_share;
    double least_cell;        // smallest volume of a cell at any time, relative to the cell's volume at rest
    double pressed_m, left_m; // depth of the dent at the end of the hold, and at the end of the experiment
    // Displacement of all nodes (root of the sum of squares) at the end of the experiment, divided by the displacement
    // at the end of the hold.
    double left_share;
    double sag;        // mean descent of the top at the end, relative to the object's height
    double iterations; // mean number of solver iterations per step
    int capped;        // number of steps that ended with a residual above the solver's tolerance
    double fallen_s;   // time at which the top had come down by half the object's height; < 0: never
    kn_status status;
} measures;

typedef struct experiment {
    const options *opt;
    kn_scene *scene;
    kn_model *model;
    kn_state *state;
    kn_scratch *scratch;
    kn_surface *surface;
    double top_m, low_m[3], high_m[3]; // height of the top, and corners of the box around the object, at rest
    kn_cell *cell;                     // [cell_count] cells of a block; NULL for a mesh
    int cell_count;                    // number of cells of a block, or of elements of a mesh
    double (*held)[3];                 // [nodes] displacement of each node at the end of the hold
    double recent_n[CATCH];            // forces of the last CATCH steps, in a ring buffer
    FILE *curve;
    measures m;
} experiment;

static void fail(const char *what)
{
    fprintf(stderr, "bench_papers: %s\n", what);
    exit(2);
}

// ---- measures

static double determinant(const double e[3][3])
{
    return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
           e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

static void place_of(const experiment *x, int node, bool now, double p[3])
{
    if (now) kn_state_position(x->model, x->state, node, p);
    else memcpy(p, x->model->rest_m[node], 3 * sizeof *p);
}

// Return the volume of a block's cell or of a mesh's element, now or at rest. For a flat mesh, return the area.
static double cell_volume(const experiment *x, int i, bool now)
{
    const kn_simplices *s = x->model->def.mesh;
    const int *corner = s ? s->element[i] : x->cell[i].corner;
    double p[8][3], gradient_m2[8][3], e[3][3] = {{0}, {0}, {0, -1, 0}};
    for (int c = 0; c < (s ? s->dimension + 1 : 8) && corner[c] >= 0; c++) place_of(x, corner[c], now, p[c]);
    if (!s) return kn_cell_volume(&x->model->grid, (const double(*)[3])p, gradient_m2);
    for (int c = 0; c < s->dimension; c++)
        for (int k = 0; k < 3; k++) e[c][k] = p[c + 1][k] - p[0][k];
    return determinant((const double(*)[3])e) / (s->dimension == 3 ? 6 : 2);
}

static double volume_of(const experiment *x, bool now)
{
    double sum = 0;
    for (int i = 0; i < x->cell_count; i++) sum += cell_volume(x, i, now);
    return sum;
}

static double least_cell(const experiment *x)
{
    double least = INFINITY;
    for (int i = 0; i < x->cell_count; i++) least = fmin(least, cell_volume(x, i, true) / cell_volume(x, i, false));
    return least;
}

static double mean_top(const experiment *x)
{
    double sum = 0, at[3];
    for (int t = 0; t < x->model->top_count; t++) {
        kn_state_position(x->model, x->state, x->model->top[t], at);
        sum += x->model->top_share[t] * (x->model->rest_m[x->model->top[t]][2] - at[2]);
    }
    return sum / (x->high_m[2] - x->low_m[2]);
}

// Return the depth of the dent: how far the deepest node of the top is below its place at rest, m.
static double dent(const experiment *x)
{
    double deepest = 0, u[3];
    for (int t = 0; t < x->model->top_count; t++) {
        displacement(x->model, x->state, x->model->top[t], u);
        deepest = fmax(deepest, -u[2]);
    }
    return deepest;
}

// Write the profile of the object's side that faces +x, on the middle plane of the block: height and outward
// displacement of each node.
static void write_profile(const experiment *x)
{
    char path[600];
    snprintf(path, sizeof path, "%s-profile.csv", x->opt->prefix);
    FILE *f = fopen(path, "w");
    if (!f) fail("cannot write the profile to PATH-profile.csv");
    fprintf(f, "height_m,outwards_m\n");
    const kn_model *m = x->model;
    const kn_grid *g = &m->grid;
    for (int iz = 0; !m->def.mesh && iz < g->n[2]; iz++) {
        double sum[2] = {0}, at[3];
        // If no row of nodes lies on the middle plane, take the mean of the two rows next to the plane.
        int first = (g->n[1] - 1) / 2, last = g->n[1] / 2;
        for (int iy = first; iy <= last; iy++) {
            int node = kn_grid_node(g, g->n[0] - 1, iy, iz);
            kn_state_position(m, x->state, node, at);
            sum[0] += at[2] / (last - first + 1);
            sum[1] += (at[0] - m->rest_m[node][0]) / (last - first + 1);
        }
        fprintf(f, "%.6g,%.6g\n", sum[0], sum[1]);
    }
    fclose(f);
}

static void measure_held(experiment *x)
{
    measures *m = &x->m;
    for (int k = 0; k < 2; k++) m->bulge_m[k] = 0;
    for (int i = 0; i < x->surface->vertex_count; i++) {
        double at[3];
        kn_state_position(x->model, x->state, x->surface->node[i], at);
        for (int k = 0; k < 2; k++)
            m->bulge_m[k] = fmax(m->bulge_m[k], fmax(at[k] - x->high_m[k], x->low_m[k] - at[k]));
    }
    m->volume_share = volume_of(x, true) / volume_of(x, false) - 1;
    m->pressed_m = dent(x);
    for (int i = 0; i < x->model->node_count; i++) displacement(x->model, x->state, i, x->held[i]);
    if (x->opt->prefix) write_profile(x);
}

static void measure_end(experiment *x)
{
    double left = 0, held = 0, u[3];
    for (int i = 0; i < x->model->node_count; i++) {
        displacement(x->model, x->state, i, u);
        for (int k = 0; k < 3; k++) left += u[k] * u[k], held += x->held[i][k] * x->held[i][k];
    }
    x->m.left_m = dent(x);
    x->m.left_share = held > 0 ? sqrt(left / held) : 0;
    x->m.sag = mean_top(x);
}

// ---- pictures

static void draw(const experiment *x, const char *moment, const kn_input *in)
{
    if (!x->opt->pictures) return;
    char error[300], path[600];
    kn_object_still still = {.view = x->opt->look};
    kn_renderer *r = kn_renderer_open(PICTURE_WIDTH, PICTURE_HEIGHT, 4, error, sizeof error);
    uint8_t *rgba = malloc((size_t)PICTURE_WIDTH * PICTURE_HEIGHT * 4);
    if (!r) fail(error);
    if (!rgba || !kn_object_still_state(&still, x->model, x->state)) fail("out of memory");
    if (in && in->probe[0].attached)
        kn_object_still_probe(&still, &x->model->def.probe[0], x->state->probe[0].position_m, (double[4]){1},
                              (double[3]){0}, 1);
    still.view.xyz = (const float(*)[3])still.now;
    if (!kn_renderer_mesh(r, still.vertex_count, (const float(*)[3])still.rest, still.triangle_count,
                          (const int(*)[3])still.triangle))
        fail("the object cannot be drawn");
    kn_renderer_draw(r, &still.view, rgba);
    snprintf(path, sizeof path, "%s-%s.png", x->opt->prefix, moment);
    if (!kn_image_write_png(path, PICTURE_WIDTH, PICTURE_HEIGHT, rgba, error, sizeof error)) fail(error);
    free(rgba);
    kn_renderer_close(r);
    kn_object_still_free(&still);
}

// ---- the experiment

// Shear the object sideways: each node moves along x by `share` of its height. A lattice without diagonals does not
// resist shear, but without this displacement it would stay upright.
static void lean(experiment *x, double share)
{
    bool wide = x->model->def.solver.precision == KN_PRECISION_F64;
    for (int node = 0; node < x->model->node_count; node++) {
        double u = share * x->model->rest_m[node][2];
        if (wide) ((double *)x->state->displacement)[x->model->offset[node]] = u;
        else ((float *)x->state->displacement)[x->model->offset[node]] = (float)u;
    }
}

static experiment open_experiment(const options *o)
{
    char error[600];
    experiment x = {.opt = o, .m = {.least_cell = INFINITY, .fallen_s = -1}};
    x.scene = kn_scene_load(o->scene, o->sets, o->set_count, error, sizeof error);
    if (x.scene) x.model = kn_model_build(&x.scene->model, error, sizeof error);
    if (!x.model) fail(error);
    x.state = kn_state_create(x.model);
    x.scratch = kn_scratch_create(x.model);
    x.surface = kn_surface_create(x.model);
    x.held = calloc((size_t)x.model->node_count, sizeof *x.held);
    const kn_simplices *mesh = x.model->def.mesh;
    x.cell_count = mesh ? mesh->element_count : kn_grid_cells(&x.model->grid, NULL);
    if (!mesh) x.cell = malloc((size_t)x.cell_count * sizeof *x.cell);
    if (!x.state || !x.scratch || !x.surface || !x.held || (!mesh && !x.cell)) fail("out of memory");
    for (int k = 0; k < 3; k++) x.low_m[k] = INFINITY, x.high_m[k] = -INFINITY;
    for (int i = 0; i < x.model->node_count; i++)
        for (int k = 0; k < 3; k++) {
            x.low_m[k] = fmin(x.low_m[k], x.model->rest_m[i][k]);
            x.high_m[k] = fmax(x.high_m[k], x.model->rest_m[i][k]);
        }
    if (x.cell) kn_grid_cells(&x.model->grid, x.cell);
    x.top_m = x.high_m[2];
    if (o->lean != 0) lean(&x, o->lean);
    return x;
}

static void close_experiment(experiment *x)
{
    free(x->cell);
    free(x->held);
    kn_surface_destroy(x->surface);
    kn_state_destroy(x->state);
    kn_scratch_destroy(x->scratch);
    kn_model_destroy(x->model);
    kn_scene_destroy(x->scene);
}

// Return the input of the step that ends at time t: the plate's position at the beginning of the step, and its mean
// velocity during the step. The function press_input of tests/physics/press.h is similar, but assumes that the first
// node of the top is the highest one.
static kn_input input_at(const experiment *x, double t)
{
    kn_input in = {0};
    const press *p = &x->opt->path;
    double dt = x->model->def.solver.dt_s, before = press_depth(p, t - dt);
    if (p->depth_m == 0 || before < -0.005) return in; // no press, or the plate is more than 5 mm above the object
    in.probe[0].attached = true;
    in.probe[0].position_m[2] = x->top_m - before;
    in.probe[0].velocity_m_s[2] = (before - press_depth(p, t)) / dt;
    return in;
}

static double median(const double ring[CATCH])
{
    double sorted[CATCH];
    for (int i = 0; i < CATCH; i++) {
        int k = i;
        for (; k > 0 && sorted[k - 1] > ring[i]; k--) sorted[k] = sorted[k - 1];
        sorted[k] = ring[i];
    }
    return sorted[CATCH / 2];
}

static void watch(experiment *x, double t, int step, const kn_output *out, double *highest)
{
    measures *m = &x->m;
    x->recent_n[step % CATCH] = out->probe[0].force_n[2];
    double force = median(x->recent_n);
    m->peak_n = fmax(m->peak_n, force);
    // Look for a dip only while the plate goes down at full speed. When the plate slows down, the force falls in
    // every case, so such a fall is not counted.
    if (t <= press_down_s(&x->opt->path) - PRESS_RAMP) {
        *highest = fmax(*highest, force);
        m->dip_n = fmax(m->dip_n, *highest - force);
    }
    if (m->fallen_s < 0 && mean_top(x) > 0.5) m->fallen_s = t;
    m->capped += out->capped;
    m->iterations += out->iterations;
}

static void run_experiment(experiment *x)
{
    const options *o = x->opt;
    double dt = x->model->def.solver.dt_s, highest = 0;
    bool pressed = o->path.depth_m > 0;
    double up_s = pressed ? press_up_s(&o->path) : o->path.hold_s;
    int held = (int)lround(up_s / dt), steps = held + (int)lround(o->rest_s / dt);
    draw(x, "initial", NULL);
    for (int i = 1; i <= steps; i++) {
        kn_output out;
        kn_input in = input_at(x, i * dt);
        x->m.status = kn_step(x->model, x->state, x->scratch, &in, &out);
        if (x->m.status != KN_OK) return;
        watch(x, i * dt, i, &out, &highest);
        if (i % CELLS_EVERY == 0) x->m.least_cell = fmin(x->m.least_cell, least_cell(x));
        if (x->curve && i % (int)fmax(1, 0.01 / dt + 0.5) == 0)
            fprintf(x->curve, "%.4f,%.6g,%.6g,%.6g\n", i * dt, pressed ? press_depth(&o->path, i * dt) : 0,
                    out.probe[0].force_n[2], mean_top(x));
        // Stop 1 s after the object has fallen. A fallen object is a heap of folded cells; its further motion has no
        // meaning, and in the end the solver diverges.
        bool heap = x->m.fallen_s >= 0 && i * dt > x->m.fallen_s + 1;
        if (i == held || (heap && i < held)) {
            x->m.end_n = out.probe[0].force_n[2];
            measure_held(x);
            draw(x, "deformed", &in);
        }
        if (heap) steps = i;
    }
    x->m.iterations /= steps;
    measure_end(x);
    if (o->rest_s > 0) draw(x, "stationary", NULL);
}

static void print(const experiment *x)
{
    const measures *m = &x->m;
    printf("{\"nodes\": %d, \"elements\": %d, \"spacing_m\": %.6g, \"dt_s\": %g, \"height_m\": %.6g, \"peak_n\": %.6g, "
           "\"dip_n\": %.6g, \"end_n\": %.6g, \"bulge_x_m\": %.6g, \"bulge_y_m\": %.6g, \"volume\": %.6g, "
           "\"least_cell\": %.4g, \"pressed_m\": %.6g, \"left_m\": %.6g, \"left_share\": %.6g, \"sag\": %.6g, "
           "\"fallen_s\": %.4g, \"iterations\": %.1f, \"capped\": %d, \"ok\": %s}\n",
           x->model->node_count, x->cell_count, x->model->def.spacing_m, x->model->def.solver.dt_s,
           x->high_m[2] - x->low_m[2], m->peak_n, m->dip_n, m->end_n, m->bulge_m[0], m->bulge_m[1], m->volume_share,
           isfinite(m->least_cell) ? m->least_cell : 1, m->pressed_m, m->left_m, m->left_share, m->sag, m->fallen_s,
           m->iterations, m->capped, m->status == KN_OK ? "true" : "false");
}

static const char usage[] =
    "usage: bench_papers SCENE [OPTION]...      run one experiment of bench/papers\n"
    "  --set KEY=VALUE   set a key of the scene\n"
    "  --depth M         press the first probe M metres deep, at 1 cm/s (default: 0, no press)\n"
    "  --hold S          hold the probe at this depth for S seconds; without --depth: let the object sag\n"
    "  --rest S          after --hold, withdraw the probe and go on for S seconds\n"
    "  --lean SHARE      let the object lean to the side at the start, by SHARE of its height\n"
    "  --prefix PATH     write PATH.csv and PATH-profile.csv\n"
    "  --pictures AZIMUTH,ELEVATION   also draw PATH-initial.png, PATH-deformed.png and PATH-stationary.png\n";

static options parse(int argc, char **argv)
{
    static const struct option longs[] = {{"set", 1, 0, 's'},      {"depth", 1, 0, 'd'}, {"hold", 1, 0, 'o'},
                                          {"rest", 1, 0, 'r'},     {"lean", 1, 0, 'l'},  {"prefix", 1, 0, 'p'},
                                          {"pictures", 1, 0, 'i'}, {"help", 0, 0, 'h'},  {0, 0, 0, 0}};
    options o = {.look = kn_view_scene_default()};
    for (int c; (c = getopt_long(argc, argv, "", longs, NULL)) != -1;) switch (c) {
        case 's':
            if (o.set_count == sizeof o.sets / sizeof *o.sets) fail("--set: too many");
            o.sets[o.set_count++] = optarg;
            break;
        case 'd': o.path.depth_m = atof(optarg); break;
        case 'o': o.path.hold_s = atof(optarg); break;
        case 'r': o.rest_s = atof(optarg); break;
        case 'l': o.lean = atof(optarg); break;
        case 'p': o.prefix = optarg; break;
        case 'i':
            o.pictures = true;
            if (sscanf(optarg, "%lf,%lf", &o.look.azimuth_deg, &o.look.elevation_deg) != 2)
                fail("--pictures: expected AZIMUTH,ELEVATION");
            break;
        default: fputs(usage, stdout); exit(c == 'h' ? 0 : 2);
        }
    if (optind + 1 != argc) fail("expected one SCENE; bench_papers --help lists the options");
    if (o.pictures && !o.prefix) fail("--pictures: expected --prefix");
    o.scene = argv[optind];
    return o;
}

int main(int argc, char **argv)
{
    options o = parse(argc, argv);
    experiment x = open_experiment(&o);
    if (o.path.depth_m > 0 && x.model->def.probe_count == 0) fail("the scene has no probe to press with");
    char path[600];
    snprintf(path, sizeof path, "%s.csv", o.prefix ? o.prefix : "");
    if (o.prefix && !(x.curve = fopen(path, "w"))) fail("cannot write the curve to PATH.csv");
    if (x.curve) fprintf(x.curve, "time_s,depth_m,force_n,sag\n");
    run_experiment(&x);
    if (x.curve) fclose(x.curve);
    print(&x);
    close_experiment(&x);
    if (x.m.status != KN_OK) fprintf(stderr, "bench_papers: %s diverged\n", o.scene);
    return x.m.status == KN_OK ? 0 : 1;
}
