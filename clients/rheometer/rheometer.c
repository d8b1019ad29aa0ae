#include "clients/rheometer/rheometer.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include "core/scene/units.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- the scene of a specimen

// Beginning of the error that kn_element_parse reports for an unknown name.
static const char missing[] = "EXPR:1:1: unknown element";

// Load a scene with the specimen's material. On failure return NULL with one line in error. `*other` becomes true if
// the specimen is neither the file of a scene nor the name of a material.
static kn_scene *load_scene(const kn_rheometer_options *opt, bool *other, char error[512])
{
    const char *dot = strrchr(opt->specimen, '.');
    int variant;
    char text[300];
    bool file = strchr(opt->specimen, '/') || (dot && (!strcmp(dot, ".yaml") || !strcmp(dot, ".yml")));
    *other = !file && !kn_library_find(opt->specimen, &variant);
    if (*other) return NULL;
    if (file) return kn_scene_load(opt->specimen, opt->sets, opt->set_count, error, 512);
    // For a named material, write the text of a minimal scene that uses it.
    int size = snprintf(text, sizeof text,
                        "version: 1\nobject: {size: [1 cm, 1 cm, 1 cm], spacing: 1 cm}\nmaterial: %.60s\n"
                        "support: frictionless\ndevice: bench\n",
                        opt->specimen);
    return kn_scene_parse(opt->specimen, text, (size_t)size, opt->sets, opt->set_count, error, 512);
}

// ---- parameters of an expression

// Read a quantity in the given unit. If `height` is true, the value may also be per length of the specimen (one power
// of metre less in the unit). A value per length is multiplied by the specimen's height.
static bool read_part(const char *text, const char *unit_text, bool height, double *value, char why[160])
{
    kn_unit unit;
    kn_quantity q;
    if (!kn_unit_parse(&unit, unit_text, why, 160) || !kn_quantity_parse(&q, text, why, 160)) return false;
    kn_unit per_height = unit;
    per_height.m--;
    bool per = height && !q.bare && kn_unit_same_dimension(&q.unit, &per_height);
    if (q.bare || !(per || kn_unit_same_dimension(&q.unit, &unit))) {
        snprintf(why, 160, q.bare ? "'%.40s' has no unit" : "'%.40s' has another dimension", text);
        return false;
    }
    *value = per ? kn_quantity_in(&q, &per_height) * KN_RHEOMETER_HEIGHT_M : kn_quantity_in(&q, &unit);
    return true;
}

// Read the damper "exp(alpha, beta, p0, p1)".
static bool read_exponential(const char *text, kn_part *part, char why[160])
{
    char field[4][64];
    int used = 0;
    if (sscanf(text, "exp ( %63[^,)] , %63[^,)] , %63[^,)] , %63[^,)] ) %n", field[0], field[1], field[2], field[3],
               &used) != 4 ||
        used == 0 || text[used]) {
        snprintf(why, 160, "'%.40s' is not exp(alpha, beta, p0, p1)", text);
        return false;
    }
    return read_part(field[0], "Pa*s", true, &part->modulus, why) &&
           read_part(field[1], "1/Pa", false, &part->beta_per_pa, why) &&
           read_part(field[2], "Pa", false, &part->p0_pa, why) && read_part(field[3], "Pa", false, &part->p1_pa, why);
}

// Example values for error messages: example[0] for a damper, example[1] for a spring.
static const char *const example[2] = {"245 kPa*s", "46 kPa"};

// Apply one option --param PART=VALUE to the spring or damper that has the name PART.
static int read_param(kn_rheometer *b, const char *text, bool *given)
{
    const char *subcommand = b->opt->subcommand, *equals = strchr(text, '=');
    char name[8], why[160];
    for (int i = 0; equals && kn_element_leaf_name(&b->net.element, i, name); i++) {
        if (strlen(name) != (size_t)(equals - text) || strncmp(name, text, strlen(name)) != 0) continue;
        bool spring = name[0] == 's', exponential = !spring && !strncmp(equals + 1, "exp", 3), good;
        if (exponential) good = read_exponential(equals + 1, &b->net.part[i], why);
        else good = read_part(equals + 1, spring ? "Pa" : "Pa*s", true, &b->net.part[i].modulus, why);
        given[i] = true;
        if (good) return KN_EXIT_OK;
        return kn_complain(subcommand, KN_EXIT_USAGE, "--param %s: %s, expected something like %s='%s'", text, why,
                           name, exponential ? "exp(8e6 Pa*s, 8.3e-4 1/Pa, 883 Pa, 7845 Pa)" : example[spring]);
    }
    char parts[KN_ELEMENT_TEXT];
    kn_element_print(&b->net.element, b->net.element.root, true, parts);
    return kn_complain(subcommand, KN_EXIT_USAGE, "--param %s: expected PART=VALUE with a part of %s", text, parts);
}

// Build the specimen from an expression and its parameters.
static int take_expression(kn_rheometer *b)
{
    const kn_rheometer_options *opt = b->opt;
    char error[200], parts[KN_ELEMENT_TEXT], name[8], names[KN_LINE_MAX];
    bool given[KN_ELEMENT_MAX] = {false};
    int leaf;
    if (opt->set_count > 0)
        return kn_complain(opt->subcommand, KN_EXIT_USAGE,
                           "--set %s: %s is an expression, expected --param, or a scene", opt->sets[0], opt->specimen);
    if (!kn_element_parse(&b->net.element, opt->specimen, error, sizeof error)) {
        // An unknown name may be a misspelt material, so the error message also lists the materials.
        bool unknown = strncmp(error, missing, sizeof missing - 1) == 0;
        return kn_complain(opt->subcommand, KN_EXIT_USAGE, "%s%s%s%s", error, unknown ? "; or a material: " : "",
                           unknown ? kn_library_names(names) : "", unknown ? "; or a scene" : "");
    }
    kn_element_print(&b->net.element, b->net.element.root, true, parts);
    for (int i = 0; i < opt->param_count; i++) {
        int code = read_param(b, opt->params[i], given);
        if (code != KN_EXIT_OK) return code;
    }
    // Every spring and damper of an expression needs a value, because there is no default.
    for (int i = 0; kn_element_leaf_name(&b->net.element, i, name); i++)
        if (!given[i])
            return kn_complain(opt->subcommand, KN_EXIT_USAGE, "%s: %s has no value, expected --param %s='%s'", parts,
                               name, name, example[name[0] == 's']);
    const char *wrong = kn_network_check(&b->net, &leaf);
    if (wrong && kn_element_leaf_name(&b->net.element, leaf, name))
        return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--param %s: %s %s", name, name, wrong);
    snprintf(b->title, sizeof b->title, "%s", parts);
    return KN_EXIT_OK;
}

// ---- the lattice: N x N x N cells of the cube with the scene's law

static int make_states(kn_rheometer *b)
{
    b->lattice = kn_state_create(b->model);
    b->trial = kn_state_create(b->model);
    b->scratch = kn_scratch_create(b->model);
    return b->lattice && b->trial && b->scratch ? KN_EXIT_OK
                                                : kn_complain(b->opt->subcommand, KN_EXIT_DEVICE, "out of memory");
}

static int build_lattice(kn_rheometer *b, const kn_model_def *scene)
{
    const kn_rheometer_options *opt = b->opt;
    kn_model_def def = scene ? *scene : kn_model_def_default();
    char error[256], text[KN_ELEMENT_TEXT];
    // A lattice edge can only be s|d, s-d, d or (s|d)-d, where s is a spring and d a damper. Refuse all other
    // expressions.
    if (!scene && !kn_network_material(&b->net, &def.material)) {
        kn_element normal = b->net.element;
        kn_element_normalize(&normal);
        kn_element_print(&normal, normal.root, false, text);
        const char *name = kn_element_name(&normal);
        return kn_complain(opt->subcommand, KN_EXIT_USAGE,
                           "--lattice: an edge cannot be %s%s%s%s, expected s|d, s-d, d or (s|d)-d, "
                           "a force-dependent d only in series; without --lattice any element runs",
                           text, name ? " (" : "", name ? name : "", name ? ")" : "");
    }
    // If the scene's object is a mesh, use only the material of the scene, not the mesh.
    if (def.mesh) {
        def.mesh = NULL;
        def.diagonal_stiffness = 1;
        def.thickness_m = 0;
    }
    // Replace the scene's object by a block as high as the cube, with the number of cells that --lattice gives.
    def.spacing_m = KN_RHEOMETER_HEIGHT_M / opt->lattice[2];
    for (int k = 0; k < 3; k++) def.nodes[k] = opt->lattice[k] + 1;
    if (def.thickness_m > 0) { // a flat object is one node deep along y
        def.nodes[1] = 1;
        def.thickness_m = def.spacing_m * opt->lattice[1];
    }
    // Set the conditions of the rheometer: no gravity, and one plate above the whole specimen, even when it has spread
    // to a hundredth of its height.
    def.gravity_m_s2 = 0;
    memset(def.fine, 0, sizeof def.fine);
    def.density_kg_m3 = 1; // almost no inertia, as the element has none
    def.support = opt->table_sticks ? KN_SUPPORT_BONDED : KN_SUPPORT_FRICTIONLESS;
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .adhesion_pa = opt->adhesion_pa};
    def.probe[0].surface = opt->plate_slides ? KN_PLATE_SLIDES : KN_PLATE_STICKS;
    for (int k = 0; k < 2; k++) def.probe[0].size_m[k] = 10 * def.spacing_m * opt->lattice[k];
    // Use accurate solver settings, because the rheometer is an experiment and not a real-time loop.
    def.solver.kind = KN_SOLVER_IMPLICIT;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.linearization = KN_LINEARIZATION_BLEND;
    def.solver.dt_s = KN_RHEOMETER_STEP_S;
    def.solver.passes = 12;
    def.solver.iterations_max = 1000;
    def.solver.tolerance = 1e-6;
    if (!(b->model = kn_model_build(&def, error, sizeof error)))
        return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--lattice: %s", error);
    return make_states(b);
}

// Return the undeformed section S0 [m^2]. With --lattice it is the section of the block, which is as high as the cube;
// otherwise it is the section of the cube.
static double area_m2(const kn_rheometer *b)
{
    const int *n = b->opt->lattice;
    return n[0] ? KN_RHEOMETER_AREA_M2 * n[0] * n[1] / (n[2] * n[2]) : KN_RHEOMETER_AREA_M2;
}

// Return the compression of the lattice from the height of its top face. The height is the mean over the nodes,
// weighted by their share of the face.
static double lattice_strain(const kn_rheometer *b)
{
    double sum = 0, x[3];
    for (int t = 0; t < b->model->top_count; t++) {
        kn_state_position(b->model, b->lattice, b->model->top[t], x);
        sum += b->model->top_share[t] * x[2];
    }
    return 1 - sum / KN_RHEOMETER_HEIGHT_M;
}

int kn_rheometer_open(kn_rheometer *b, const kn_rheometer_options *opt)
{
    memset(b, 0, sizeof *b);
    b->opt = opt;
    char error[512];
    int code = KN_EXIT_OK;
    bool other;
    // A specimen that is neither a scene file nor a material is read as an expression of springs and dampers.
    kn_scene *scene = load_scene(opt, &other, error);
    if (other) {
        code = take_expression(b);
        if (code == KN_EXIT_OK && opt->lattice[0]) code = build_lattice(b, NULL);
    } else if (!scene) {
        return kn_complain(opt->subcommand, KN_EXIT_USAGE, "%s", error);
    } else if (opt->param_count > 0) {
        code =
            kn_complain(opt->subcommand, KN_EXIT_USAGE, "--param %s: %s is not an expression, expected --set KEY=VALUE",
                        opt->params[0], opt->specimen);
    } else {
        b->net = kn_network_of(&scene->model.material);
        char parts[KN_ELEMENT_TEXT];
        kn_element_print(&b->net.element, b->net.element.root, true, parts);
        snprintf(b->title, sizeof b->title, "%s: %s", scene->name, parts);
        if (opt->lattice[0]) code = build_lattice(b, &scene->model);
    }
    kn_scene_destroy(scene);
    return code;
}

void kn_rheometer_close(kn_rheometer *b)
{
    kn_state_destroy(b->lattice);
    kn_state_destroy(b->trial);
    kn_scratch_destroy(b->scratch);
    kn_model_destroy(b->model);
}

void kn_rheometer_choose(kn_rheometer *b, bool lattice) { b->lattice_runs = lattice && b->model; }

int kn_rheometer_time_step(kn_rheometer *b, double span_s, int steps)
{
    const double most = ceil(span_s / KN_RHEOMETER_SHORT_S), least = ceil(span_s / KN_RHEOMETER_STEP_S);
    const double dt_s = span_s / fmax(1, fmax(fmin(steps, most), least));
    if (!b->model || b->model->def.solver.dt_s == dt_s) return KN_EXIT_OK;
    char error[256];
    kn_model_def def = b->model->def;
    def.solver.dt_s = dt_s;
    kn_rheometer_close(b);
    b->lattice = b->trial = NULL;
    b->scratch = NULL;
    if (!(b->model = kn_model_build(&def, error, sizeof error)))
        return kn_complain(b->opt->subcommand, KN_EXIT_USAGE, "--lattice: %s", error);
    return make_states(b);
}

void kn_rheometer_fresh(kn_rheometer *b)
{
    b->now = (kn_network_state){0};
    b->time_s = b->strain = b->stress_pa = b->force_n = 0;
    b->step = 0;
    b->flat = false;
    if (b->model) kn_state_reset(b->model, b->lattice);
    b->plate = (kn_level_plate){0};
}

// ---- running an experiment

// Ratio S0/S of the undeformed section to the present section.
static double grown(const kn_rheometer *b) { return b->opt->constant_area ? 1 : 1 - b->strain; }

// Copy time, strain, stress and force of the one-dimensional element into the readings.
static void read_element(kn_rheometer *b)
{
    b->time_s = b->now.time_s;
    b->strain = b->now.strain;
    b->stress_pa = b->now.stress_pa;
    b->force_n = b->stress_pa * area_m2(b) / grown(b);
}

// Start a new drive (a prescribed load or strain) at the present time. Print an error if the drive needs an infinite
// stress.
static int take_drive(kn_rheometer *b, kn_drive drive)
{
    drive.start_s = b->time_s;
    b->drive = drive;
    // With a lattice, the drive acts from the next step on. A weight comes down on a plate that touches the specimen.
    if (b->lattice_runs && drive.kind != KN_DRIVE_STRAIN) kn_level_plate_lower(&b->plate, b->model, b->lattice);
    if (b->lattice_runs) return KN_EXIT_OK;
    if (!kn_network_jump(&b->net, &b->now, &drive))
        return kn_complain(b->opt->subcommand, KN_EXIT_USAGE,
                           "%s: responds as a dashpot at first, so a step of strain needs an infinite stress, "
                           "expected --ramp RATE, e.g. --ramp 10%%/s",
                           b->title);
    read_element(b);
    return KN_EXIT_OK;
}

int kn_rheometer_load(kn_rheometer *b, double load_n)
{
    kn_drive_kind kind = b->opt->constant_area ? KN_DRIVE_STRESS : KN_DRIVE_LOAD;
    return take_drive(b, (kn_drive){.kind = kind, .value = load_n / area_m2(b)});
}

int kn_rheometer_strain(kn_rheometer *b, double from, double rate_per_s)
{
    return take_drive(b, (kn_drive){.kind = KN_DRIVE_STRAIN, .value = from, .rate_per_s = rate_per_s});
}

int kn_rheometer_swing(kn_rheometer *b, double amplitude, double omega)
{
    return take_drive(b, (kn_drive){.kind = KN_DRIVE_STRAIN, .amplitude = amplitude, .omega = omega});
}

// Return the strain that the drive prescribes at time t.
static double drive_strain(const kn_drive *d, double t_s)
{
    const double since_s = t_s - d->start_s;
    return d->value + d->rate_per_s * since_s + d->amplitude * sin(d->omega * since_s);
}

// Advance the lattice by one time step under a plate of prescribed height or force, and update the readings.
static int step_lattice(kn_rheometer *b)
{
    if (b->flat) return KN_EXIT_OK;
    const kn_drive *d = &b->drive;
    const double dt_s = b->model->def.solver.dt_s, load_n = d->value * area_m2(b);
    kn_input in = {0};
    kn_output out;
    bool good;
    if (d->kind != KN_DRIVE_STRAIN && load_n > 0) {
        const kn_plate_status status =
            kn_level_plate_step(&b->plate, b->model, b->lattice, b->trial, b->scratch, load_n, &in, &out);
        b->flat = status == KN_PLATE_FLAT;
        if (b->flat) return KN_EXIT_OK;
        good = status == KN_PLATE_CARRIED;
    } else {
        if (d->kind == KN_DRIVE_STRAIN) {
            const double now = drive_strain(d, b->time_s), next = drive_strain(d, b->time_s + dt_s);
            in.probe[0].attached = true;
            in.probe[0].position_m[2] = KN_RHEOMETER_HEIGHT_M * (1 - now);
            in.probe[0].velocity_m_s[2] = KN_RHEOMETER_HEIGHT_M * (now - next) / dt_s;
        }
        good = kn_step(b->model, b->lattice, b->scratch, &in, &out) == KN_OK;
    }
    b->step++;
    b->time_s = (double)b->step * dt_s;
    b->strain = lattice_strain(b);
    if (!good)
        return kn_complain(b->opt->subcommand, KN_EXIT_USAGE,
                           "--lattice: the block came apart at %.3g s, expected a smaller load or a slower plate",
                           b->time_s);
    // a plate that goes down keeps its contact, unless the cells below it turn inside out
    if (d->kind == KN_DRIVE_STRAIN && d->rate_per_s > 0 && b->force_n > 0 && out.probe[0].contacts == 0)
        return kn_complain(b->opt->subcommand, KN_EXIT_USAGE,
                           "--lattice: its cells turn inside out at a strain of %.3g, expected a smaller strain or "
                           "gas (--set object.pressure=cells)",
                           b->strain);
    b->force_n = out.probe[0].force_n[2];
    b->stress_pa = b->force_n / area_m2(b) * grown(b);
    return KN_EXIT_OK;
}

int kn_rheometer_advance(kn_rheometer *b, double until_s)
{
    int code = KN_EXIT_OK;
    if (b->lattice_runs) {
        // Stop at the time step nearest to until_s. A margin of half a step absorbs rounding errors.
        while (code == KN_EXIT_OK && !b->flat && b->time_s < until_s - 0.5 * b->model->def.solver.dt_s) {
            code = step_lattice(b);
            kn_progress_step(&b->bar, (double)b->stepped++);
        }
        return code;
    }
    if (!kn_network_advance(&b->net, &b->now, &b->drive, until_s, KN_RHEOMETER_TOLERANCE))
        return kn_complain(b->opt->subcommand, KN_EXIT_USAGE,
                           "%s: no step converges at %.6g s, expected realistic parameters", b->title, b->now.time_s);
    read_element(b);
    return KN_EXIT_OK;
}

void kn_rheometer_bar(kn_rheometer *b, double seconds)
{
    if (b->lattice_runs) b->bar = kn_progress_open(b->opt->subcommand, fmax(1, seconds / b->model->def.solver.dt_s));
    b->stepped = 0;
}

void kn_rheometer_bar_end(kn_rheometer *b) { kn_progress_close(&b->bar); }

void kn_rheometer_print(const kn_rheometer *b)
{
    const int *n = b->opt->lattice;
    kn_result_text(kn_result(), "specimen", b->title);
    printf("specimen  %s, ", b->title);
    if (n[0] != n[2] || n[1] != n[2]) printf("%.3g x %.3g x 1 cm", (double)n[0] / n[2], (double)n[1] / n[2]);
    else printf("1 cm cube");
    printf("%s\n", b->opt->constant_area ? ", constant area" : "; the section grows as the height falls");
    printf("parts    ");
    char name[8];
    for (int i = 0; kn_element_leaf_name(&b->net.element, i, name); i++) {
        const kn_part *p = &b->net.part[i];
        printf("%s %s %.4g %s", i ? "," : "", name, p->modulus, name[0] == 's' ? "Pa" : "Pa s");
        // Print two properties of a part, if the part has them: the stress range of a stress-dependent damper, and the
        // stroke of a damper with stops.
        if (kn_part_thins(p))
            printf(" at zero stress (%.4g to %.4g Pa s)", kn_part_modulus(&b->net, i, 0),
                   kn_part_modulus(&b->net, i, p->p1_pa));
        if (p->stroke) printf(", stopped at a strain of %.3g and %.3g", p->stop[0], p->stop[1]);
    }
    if (b->model)
        printf("\nbench     lattice of %d x %d x %d cells, which %s the table and %s the plate; step %g s, f64\n",
               b->opt->lattice[0], b->opt->lattice[1], b->opt->lattice[2],
               b->opt->table_sticks ? "sticks to" : "slides on", b->opt->plate_slides ? "slides on" : "sticks to",
               b->model->def.solver.dt_s);
    else
        printf("\nbench     one element in one dimension, integrated to a tolerance of %g of its strain per step\n",
               KN_RHEOMETER_TOLERANCE);
}

// Write the table of an experiment and draw its curves, if --csv and --png are given.
static int write_files(const kn_experiment *x, const kn_rheometer *b, const kn_table *t)
{
    char title[500];
    x->title(b, title, sizeof title);
    int code = b->opt->csv ? kn_table_write(t, x->name, b->opt->csv) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && b->opt->png) code = kn_table_draw(t, x->name, b->opt->png, title, x->axes, 2);
    return code;
}

int kn_rheometer_main(const kn_experiment *x, kn_rheometer_options opt, int argc, char **argv)
{
    kn_rheometer b = {0};
    kn_table t;
    kn_table_init(&t, x->columns);
    int code = kn_rheometer_options_parse(&opt, x->name, x->help, argc, argv);
    if (code == KN_OPTIONS_READ) {
        code = kn_rheometer_open(&b, &opt);
        if (code == KN_EXIT_OK) code = x->run(&b, &t);
        if (code == KN_EXIT_OK) code = write_files(x, &b, &t);
        kn_rheometer_close(&b);
    }
    kn_table_free(&t);
    kn_rheometer_options_free(&opt);
    return code;
}
