// A section of the page of `knead identify creep`: the check of the identified material (kn_creep_validation in
// identify.h).
#include "clients/identify/identify.h"
#include "clients/shape/press_protocol.h"
#include "clients/rheometer/rheometer.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/picture/object_still.h"
#include "clients/viewer/image.h"
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- the creep of the identified material

// number of cells along each side of a block; the block creeps uniformly, so more cells give the same strain to four
// digits
enum { CELLS = 2 };

// ways to compute the creep: as one element, as a lattice with diagonals alone, or as a lattice with diagonals and gas
enum { ELEMENT, DIAGONALS, GAS, WAYS };

typedef struct simulated_creep {
    double *strain[WAYS]; // computed strain at the curve's readings, in one block of memory
    // from_data, from_element: root mean square difference of the computed strain from the measured strain, and from
    // the strain of the element; both are shares of the largest measured strain
    double from_data[WAYS], from_element[WAYS];
} simulated_creep;

// Apply the loads of the curve to the specimen of the virtual rheometer, and record its strain at the readings of the
// curve.
static int follow(kn_rheometer *b, const kn_curve *c, double *strain)
{
    int next = 0, code = KN_EXIT_OK;
    kn_rheometer_fresh(b);
    kn_rheometer_bar(b, c->time_s[c->count - 1]);
    for (int i = 0; i < c->count && code == KN_EXIT_OK; i++) {
        // Apply all changes of load before this reading, each at its own time.
        for (; next < c->steps && c->step[next].time_s < c->time_s[i] && code == KN_EXIT_OK; next++) {
            if (c->step[next].time_s > b->time_s) code = kn_rheometer_advance(b, c->step[next].time_s);
            if (code == KN_EXIT_OK) code = kn_rheometer_load(b, c->step[next].stress_pa * KN_RHEOMETER_AREA_M2);
        }
        if (code == KN_EXIT_OK && c->time_s[i] > b->time_s) code = kn_rheometer_advance(b, c->time_s[i]);
        strain[i] = b->flat ? 1 : b->strain;
    }
    kn_rheometer_bar_end(b);
    return code;
}

// Return the root mean square difference of two series of strains, as a share of the largest measured strain.
static double apart(const double *a, const double *b, const kn_curve *c)
{
    double sum = 0;
    for (int i = 0; i < c->count; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / c->count) / kn_curve_largest(c);
}

// Compute the creep of the material of a scene file in one of the ways: as one element, as a lattice with diagonals
// alone, or as a lattice with diagonals and gas.
static int creep_again(simulated_creep *back, int way, const char *subcommand, const char *scene, const kn_curve *c)
{
    static const char *gas[] = {"object.pressure=cells"};
    // The virtual rheometer treats a lattice of 0 cells as one element.
    const int n = way == ELEMENT ? 0 : CELLS;
    kn_rheometer_options opt = {.subcommand = subcommand,
                                .specimen = scene,
                                .constant_area = c->constant_area,
                                .sets = gas,
                                .set_count = way == GAS,
                                .lattice = {n, n, n}};
    kn_rheometer b;
    int code = kn_rheometer_open(&b, &opt);
    kn_rheometer_choose(&b, way != ELEMENT);
    if (code == KN_EXIT_OK) code = follow(&b, c, back->strain[way]);
    kn_rheometer_close(&b);
    back->from_data[way] = apart(c->value, back->strain[way], c);
    back->from_element[way] = apart(back->strain[ELEMENT], back->strain[way], c);
    return code;
}

// Compute the creep of the material in all three ways. The caller frees back->strain[0].
static int creep_in_all_ways(simulated_creep *back, const char *subcommand, const char *scene, const kn_curve *c)
{
    int code = KN_EXIT_OK;
    back->strain[0] = calloc(WAYS * (size_t)c->count, sizeof(double));
    if (!back->strain[0]) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    for (int way = 1; way < WAYS; way++) back->strain[way] = back->strain[way - 1] + c->count;
    for (int way = 0; way < WAYS && code == KN_EXIT_OK; way++) code = creep_again(back, way, subcommand, scene, c);
    return code;
}

// Write a scene file with the first paper's block of this material. The lattices and kneadd load this file.
static int write_scene(const kn_document *d, const char *subcommand, char path[PATH_MAX])
{
    FILE *f = fopen(kn_document_file(d, "scene.yaml", path), "w");
    if (!f) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
    fprintf(f, "# The first paper's block, 5 x 5 x 3 cm, of the identified material, under its plate.\n"
               "version: 1\n"
               "object: {size: [5 cm, 5 cm, 3 cm], spacing: 1 cm, structure: diagonals}\n"
               "material: material.yaml\n"
               "gravity: 0 m/s^2\n"
               "support: bonded\n"
               "device: bench\n"
               "probes:\n"
               "  - {name: plate, shape: plate, size: [1 cm, 6 cm]}\n"
               "  - {name: finger, shape: sphere, radius: 1.5 cm}\n");
    return fclose(f) == 0 ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s: cannot be written", path);
}

// Add one curve to both panels: the measured strain, and the strain of the element or of the lattices.
static void lay_over(kn_figure_panel *panel, const kn_curve *c, const simulated_creep *l, int hue)
{
    const double *element = l->strain[ELEMENT];
    for (int p = 0; p < 2; p++)
        kn_identify_plot(&panel[p], p ? NULL : c->name, c->count, c->time_s, c->value, 1, KN_FIGURE_POINTS, hue);
    kn_identify_plot(&panel[0], NULL, c->count, c->time_s, element, 1, KN_FIGURE_LINE, hue);
    for (int way = DIAGONALS; way < WAYS; way++)
        kn_identify_plot(&panel[1], NULL, c->count, c->time_s, l->strain[way], 1,
                         way == GAS ? KN_FIGURE_LINE : KN_FIGURE_DASHES, hue);
}

// State on the page how far the lattices differ from the element.
static void judge_lattices(kn_document *d, const double worst[WAYS])
{
    const double diagonals = worst[DIAGONALS], gas = worst[GAS];
    // Treat the lattices as equal to the element if they differ from the element by less than 5 %.
    const bool near = fmax(diagonals, gas) < 0.05;
    kn_document_verdict(
        d, near ? KN_DOCUMENT_HOLDS : KN_DOCUMENT_BEWARE,
        near ? "Lattices of this material creep as its element does. "
               "They differ by %.2g %% with diagonals and by %.2g %% with gas."
             : "These are the parameters of one element. "
               "Under these loads, the strain of a lattice of this material differs from the strain of the element: "
               "by up to %.2g %% of the largest strain with diagonals alone, and by %.2g %% with gas. "
               "Run knead creep scene.yaml --lattice 2x2x2 to see the creep of a lattice.",
        100 * diagonals, 100 * gas);
}

// Compute the creep of the material under every curve's loads, and report and plot the differences from the
// measurement and from the element.
static int compare_creep(kn_document *d, const kn_identification *w, const char *scene)
{
    char path[PATH_MAX];
    static kn_figure_panel panel[2]; // the panels are too large for the stack
    simulated_creep back[KN_CURVES_MAX] = {{{NULL}, {0}, {0}}};
    double worst[WAYS] = {0}; // largest difference from the element, over all curves
    int code = KN_EXIT_OK;
    for (int p = 0; p < 2; p++)
        panel[p] =
            (kn_figure_panel){.title = p ? "dashed: lattice with diagonals; solid: with gas" : "lines: the element",
                              .x_label = "time, s",
                              .y_label = "strain"};
    kn_document_table(d, "Root mean square differences, % of the largest strain", "lrrrrrr",
                      "curve\tlargest strain\telement from data\tdiagonals from data\twith gas from data\t"
                      "diagonals from element\twith gas from element");
    for (int k = 0; k < w->curves && code == KN_EXIT_OK; k++) {
        code = creep_in_all_ways(&back[k], w->opt.subcommand, scene, &w->curve[k]);
        // Add a row for the curve to the table: differences from the data and from the element.
        const double *data = back[k].from_data, *element = back[k].from_element;
        kn_document_row(d, "%s\t%.3g\t%.3g\t%.3g\t%.3g\t%.3g\t%.3g", w->curve[k].name, kn_curve_largest(&w->curve[k]),
                        100 * data[ELEMENT], 100 * data[DIAGONALS], 100 * data[GAS], 100 * element[DIAGONALS],
                        100 * element[GAS]);
        for (int way = 0; way < WAYS; way++) worst[way] = fmax(worst[way], element[way]);
        lay_over(panel, &w->curve[k], &back[k], k + 1);
    }
    if (code == KN_EXIT_OK) judge_lattices(d, worst);
    if (code == KN_EXIT_OK)
        code = kn_figure_draw(w->opt.subcommand, kn_document_file(d, "back.png", path), "measured and simulated creep",
                              panel, 2, 2);
    if (code == KN_EXIT_OK)
        kn_document_picture(d, "back.png", "Measured strain, and the strain of the element and of the lattices",
                            "Points: measured. Left: the element. Right: lattices.");
    for (int k = 0; k < w->curves; k++) free(back[k].strain[0]);
    return code;
}

// ---- the press of a block

enum { WIDE = 560, HIGH = 400 }; // width and height of a picture [pixels]

typedef struct bar {
    kn_progress progress;
    int64_t done;
} bar;

static void told(void *of, int64_t ticks)
{
    bar *b = of;
    kn_progress_step(&b->progress, (double)(b->done += ticks));
}

// Return the depth of the dent: the distance from the top at rest down to the lowest of the vertices that formed this
// top.
static double dent(const kn_model *model, const kn_surface *s, const float (*now)[3])
{
    double top = -INFINITY, deepest = 0, rest[3];
    for (int v = 0; v < s->vertex_count; v++) {
        kn_surface_rest(s, model, v, rest);
        top = fmax(top, rest[2]);
    }
    for (int v = 0; v < s->vertex_count; v++) {
        kn_surface_rest(s, model, v, rest);
        if (rest[2] > top - 1e-9) deepest = fmax(deepest, top - now[v][2]);
    }
    return deepest;
}

// Draw the block at one moment. The tool is drawn only at the end of the hold.
static int draw(const char *subcommand, const kn_model *model, const kn_state *rest, const kn_press *press,
                const kn_pressed *done, int moment, const char *png)
{
    char error[200] = "out of memory";
    uint8_t *rgba = malloc((size_t)4 * WIDE * HIGH);
    kn_object_still still = {.view = kn_view_scene_default()};
    kn_object_picture *shot = rgba ? kn_object_picture_open(WIDE, HIGH, 4, error, sizeof error) : NULL;
    bool ok = shot && kn_object_still_state(&still, model, rest) && still.vertex_count == done->vertex_count;
    if (ok) memcpy(still.now, done->shape_m[moment], (size_t)still.vertex_count * sizeof *still.now);
    if (ok && moment == 0) {
        const int64_t tick = kn_press_tick(press, press->hold_end_s);
        const kn_probe_input *in = &press->input[tick * press->probes + press->probe];
        kn_object_still_probe(&still, &model->def.probe[press->probe], in->position_m, in->orientation_wxyz,
                              (const double[3]){0, 0, done->force_n[tick]}, 1);
    }
    ok = ok && kn_object_picture_take(shot, &still, NULL, KN_OBJECT_PICTURE_PLAIN, rgba, error, sizeof error) &&
         kn_image_write_png(png, WIDE, HIGH, rgba, error, sizeof error);
    kn_object_still_free(&still);
    kn_object_picture_close(shot);
    free(rgba);
    return ok ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s", png, error);
}

// Report the force over time and the dents.
static int report_press(kn_document *d, const char *subcommand, const kn_press *press, const kn_pressed *done,
                        const double dent_m[2])
{
    char path[PATH_MAX];
    double peak_n = 0, held_n = 0; // largest force, and force at the end of the hold
    kn_figure_panel panel = {.x_label = "time, s", .y_label = "force, N"};
    for (int64_t t = 0; t < done->ticks; t++) {
        peak_n = fmax(peak_n, done->force_n[t]);
        if (press->time_s[t] <= press->hold_end_s) held_n = done->force_n[t];
    }
    kn_identify_plot(&panel, "plate", (int)done->ticks, press->time_s, done->force_n, 1, KN_FIGURE_LINE, 1);
    int code = kn_figure_draw(subcommand, kn_document_file(d, "press.png", path), "the paper's press", &panel, 1, 1);
    if (code != KN_EXIT_OK) return code;
    kn_document_text(d,
                     "A block of this material, 5 x 5 x 3 cm, is pressed by the first paper's plate: "
                     "1 cm deep at 1 cm/s, held for 30 s. "
                     "The force is %.3g N at most and %.3g N at the end of the hold. "
                     "The dent is %.3g mm deep at the end of the hold and %.3g mm after the plate has left.",
                     peak_n, held_n, 1e3 * dent_m[0], 1e3 * dent_m[1]);
    kn_document_picture(d, "press.png", "Force of the plate over time", "The force on the plate.");
    kn_document_picture(d, "held.png", "The block under the plate", "At the end of the hold.");
    kn_document_picture(d, "left.png", "The block with its dent", "After the plate has left.");
    return KN_EXIT_OK;
}

// Press the block, draw it at the end of the hold and after the tool has left, and report force and dents.
static int press_block(kn_document *d, const char *subcommand, const kn_scene *scene, const kn_model *model)
{
    static const char *const png[2] = {"held.png", "left.png"};
    char error[300], path[PATH_MAX];
    double dent_m[2];
    kn_press press = {0};
    kn_pressed done = {0};
    kn_surface *surface = kn_surface_create(model);
    kn_state *rest = kn_state_create(model);
    int code = KN_EXIT_OK;
    if (!surface || !rest || !kn_press_path(&press, scene, &(kn_press_def){0}, error, sizeof error))
        code = kn_complain(subcommand, KN_EXIT_USAGE, "%s", surface && rest ? error : "out of memory");
    if (code == KN_EXIT_OK) {
        bar b = {.progress = kn_progress_open("press", (double)press.ticks)};
        const double moment[2] = {press.hold_end_s, press.end_s};
        const kn_press_play how = {model, surface, 2, moment, press.end_s, told, &b};
        bool ok = kn_press_run(&press, &how, &done);
        kn_progress_close(&b.progress);
        if (!ok) code = kn_complain(subcommand, KN_EXIT_FAILED, "the block of this material came apart under a plate");
    }
    for (int m = 0; m < 2 && code == KN_EXIT_OK; m++) {
        code = draw(subcommand, model, rest, &press, &done, m, kn_document_file(d, png[m], path));
        dent_m[m] = dent(model, surface, (const float(*)[3])done.shape_m[m]);
    }
    if (code == KN_EXIT_OK) code = report_press(d, subcommand, &press, &done, dent_m);
    kn_pressed_free(&done);
    kn_press_free(&press);
    kn_state_destroy(rest);
    kn_surface_destroy(surface);
    return code;
}

// Press the block of a scene file with the first paper's press.
static int press_scene(kn_document *d, const char *subcommand, const char *path)
{
    char error[512];
    kn_scene *scene = kn_scene_load(path, NULL, 0, error, sizeof error);
    kn_model *model = scene ? kn_model_build(&scene->model, error, sizeof error) : NULL;
    int code = model ? press_block(d, subcommand, scene, model) : kn_complain(subcommand, KN_EXIT_USAGE, "%s", error);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return code;
}

int kn_creep_validation(kn_document *d, const kn_identification *w)
{
    char scene[PATH_MAX];
    kn_document_section(d, "Simulated creep");
    kn_document_text(d,
                     "The fitted material creeps again under the same loads: "
                     "as one element, computed to a given accuracy by separate code, "
                     "and as blocks of %d x %d x %d cells in the solver of kneadd. "
                     "The edges of a lattice turn as the block gives way; the edges of a single element do not. "
                     "So the block and the element differ more as the strain grows. "
                     "With diagonals alone a block gives way more than the element; "
                     "with gas in its cells as well, it gives way less.",
                     CELLS, CELLS, CELLS);
    int code = write_scene(d, w->opt.subcommand, scene);
    if (code == KN_EXIT_OK) code = compare_creep(d, w, scene);
    return code == KN_EXIT_OK ? press_scene(d, w->opt.subcommand, scene) : code;
}
