// knead zwidth: finds, in simulation, the stiffest wall that a device can render without a buzz, for several delays and
// frictions.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "clients/hand/haptic_loop.h"
#include "server/option_table.h"
#include "server/scene_name.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead zwidth [OPTION]...\n\n"
    "Simulate a haptic device in contact, and find the stiffest virtual coupling that does not buzz, for several\n"
    "round trips of the forces and several frictions of the device. Colgate's bound and the bound of a delayed\n"
    "spring are in the same row. All values are SIMULATED. On a real device, motors and structure lower them to\n"
    "about 0.7 times these values.\n\n"
    "  --device CLASS    touch, falcon, omega, unknown, bench, or a FILE.yaml with a device section (default: touch)\n"
    "  --set KEY=VALUE   set a key of the device, e.g. device.mass='120 g'\n"
    "  --hand HAND       none, light, normal or firm; none: no arm, a force of 1 N pushes the device (default: none)\n"
    "  --material M      wall, dough, clay, jelly or stiff-jelly: object under a 1 cm probe (default: wall).\n"
    "                    Without a hand only the wall is possible\n"
    "  --scene SCENE     use the lattice of a scene instead, with a tool pressed onto its middle; takes minutes\n"
    "  --probe NAME      tool of that scene (default: the first that can be coupled)\n"
    "  --quick           fewer delays, frictions and couplings: a second or two\n"
    "  --csv FILE        write the table\n"
    "  --png FILE        draw the curves and the bounds (needs gnuplot)\n"
    "  --json            print the table as JSON\n\n"
    "The device holds each force for 1 ms. Its encoder reads the position in steps. The velocity is filtered at 100\n"
    "Hz. A device buzzes if, after 3 s, force or position oscillate above 10 Hz by more than the encoder's steps\n"
    "explain.\n\n"
    "columns of the table:\n"
    "  round trip        time from a pose to its force; 0: at once, 1 ms: in the next period, as with a server\n"
    "  k at b_vc 0, ..   stiffest coupling that does not buzz with the damping b_vc, N/m; found to 1.5 %\n"
    "  Colgate           bound 2 (b - b_vc)/T at b_vc 0; a coupling below it is passive in any motion, without delay.\n"
    "                    b: friction of the device, T: 1 ms\n"
    "  delayed           bound (b + b_vc)/(T/2 + round trip) of a delayed spring, at the class's b_vc\n"
    "  default           coupling that a scene with this device gets (core/coupling.h); calm: it did not buzz\n\n"
    "Examples:\n"
    "    knead zwidth --device falcon --png zwidth.png\n"
    "    knead zwidth --device touch --hand light --material dough --quick\n\n"
    "Exit codes: 0 ok, 1 a default coupling buzzes, 2 bad input, 3 a file cannot be written.\n";

// TRIPS, FRICTIONS, DAMPINGS: numbers of simulated round trips, frictions and dampings. SETS: largest number of --set
// options.
enum { TRIPS = 6, FRICTIONS = 5, DAMPINGS = 4, SETS = 32 };
static const int trip_ms[TRIPS] = {0, 1, 2, 5, 10, 20};
// Simulated frictions, as fractions of the device's friction. --quick simulates the second one only.
static const double friction_share[FRICTIONS] = {0.5, 1.0, 2.0, 5.0, 10.0};
// Simulated dampings, as fractions of the default b_vc of the device's class.
static const double damping_share[DAMPINGS] = {1.0, 0.0, 0.5, 2.0};
// Range of the coupling stiffnesses that are tried [N/m], and the factor between two successive ones.
static const double least_n_m = 10.0, most_n_m = 20000.0, ladder = 1.25;
// Number of bisection steps after the rising series of couplings. Successive couplings of the series differ by a factor
// of 1.25. Four steps narrow this to 1.4 %.
enum { HALVINGS = 4 };

static const char *const columns[] = {
    "round_trip_ms", "friction_n_s_m", "largest_n_m", "largest_undamped_n_m", "largest_half_n_m", "largest_double_n_m",
    "colgate_n_m",   "delayed_n_m",    "default_n_m", "default_n_s_m",        "default_buzzes",   NULL};

// The command line and the state of a survey.
typedef struct zwidth {
    const char *device, *csv, *png;
    const char *sets[SETS];
    int set_count;
    kn_grip grip;
    const kn_lumped_object_def *material;
    const char *scene_path, *tool;
    kn_scene *scene; // scene of the object; NULL: the object is the lumped object `material`
    bool quick;
    kn_device_def profile;
    kn_coupling most; // default coupling of the device's class at a round trip of 1 ms
    kn_table table;
    bool sound; // true: no default coupling has buzzed so far
    kn_progress bar;
    int searched; // number of searches for a largest coupling so far, for the progress bar
} zwidth;

// Run the loop on the lattice of the scene. A lattice that diverges counts as a buzz.
static kn_haptic_loop_result on_lattice(const zwidth *z, const kn_haptic_loop_def *def)
{
    kn_lattice_object slab;
    char error[300];
    // A failure to open the lattice counts as a buzz. Such a failure is not expected, because load_scene has already
    // opened this lattice with another coupling.
    if (!kn_lattice_object_open(&slab, z->scene, z->tool, &def->coupling, error, sizeof error))
        return (kn_haptic_loop_result){.buzzes = true};
    kn_haptic_loop_result result = kn_haptic_loop_run(def, kn_lattice_object_touch, &slab);
    result.buzzes |= slab.diverged;
    kn_lattice_object_close(&slab);
    return result;
}

// Run the loop with one coupling. Return true if the loop buzzes.
static bool buzzes(const zwidth *z, double friction_n_s_m, int trip, kn_coupling coupling)
{
    kn_lumped_object_contact c = {.coupling = coupling};
    kn_haptic_loop_def def = {.arm = kn_held_device_of(&z->profile),
                              .coupling = coupling,
                              .trip_ms = trip,
                              .motion = z->grip == KN_GRIP_NONE ? KN_HAPTIC_LOOP_LEAN : KN_HAPTIC_LOOP_PRESS};
    def.arm.damping_n_s_m = friction_n_s_m;
    def.arm.grip = z->grip;
    def.arm.axes = 1;
    if (z->scene) return on_lattice(z, &def).buzzes;
    kn_lumped_object_init(&c.pad, z->material);
    return kn_haptic_loop_run(&def, kn_lumped_object_touch, &c).buzzes;
}

// Find the largest coupling without a buzz by searching upwards until the first buzz. Larger couplings may be calm
// again, but they are not searched, because they cannot be reached without a buzz.
static double largest(const zwidth *z, double friction_n_s_m, int trip, double damping_n_s_m)
{
    double calm = 0.0, loud = least_n_m;
    // Increase the coupling by the same factor until the loop buzzes, then bisect on a logarithmic scale.
    while (loud < most_n_m && !buzzes(z, friction_n_s_m, trip, (kn_coupling){loud, damping_n_s_m}))
        calm = loud, loud *= ladder;
    if (loud >= most_n_m || calm == 0.0) return calm;
    for (int i = 0; i < HALVINGS; i++) {
        double mid = sqrt(calm * loud);
        if (buzzes(z, friction_n_s_m, trip, (kn_coupling){mid, damping_n_s_m})) loud = mid;
        else calm = mid;
    }
    return calm;
}

// Measure one row of the table: largest couplings for all dampings, the bounds, and the default coupling.
static void measure(zwidth *z, double friction_n_s_m, int trip)
{
    double k[DAMPINGS], trip_s = 1e-3 * trip;
    for (int i = 0; i < DAMPINGS; i++) {
        bool skip = z->quick && i > 1;
        if (!skip) kn_progress_step(&z->bar, z->searched++);
        k[i] = skip ? NAN : largest(z, friction_n_s_m, trip, damping_share[i] * z->most.damping_n_s_m);
    }
    kn_coupling chosen = kn_coupling_default(z->profile.mass_kg, friction_n_s_m, 1e-3, trip_s, z->most);
    bool loud = buzzes(z, friction_n_s_m, trip, chosen);
    z->sound &= !loud;
    double colgate = kn_coupling_colgate(friction_n_s_m, 1e-3, 0.0);
    double delayed = kn_coupling_delayed(friction_n_s_m, 1e-3, trip_s, z->most.damping_n_s_m);
    kn_table_add(&z->table, (double[]){trip, friction_n_s_m, k[0], k[1], k[2], k[3], colgate, delayed,
                                       chosen.stiffness_n_m, chosen.damping_n_s_m, loud});
    kn_progress_close(&z->bar); // clear the progress bar, because the row is printed on its line
    // The columns are printed in the order of the coupling's damping b_vc.
    printf("%4d ms %9.3g", trip, friction_n_s_m);
    for (int i = 0; i < DAMPINGS; i++) {
        static const int order[DAMPINGS] = {1, 2, 0, 3};
        if (!isnan(k[order[i]])) printf(" %9.0f", k[order[i]]);
    }
    printf(" %9.0f %9.0f %9.0f %s\n", colgate, delayed, chosen.stiffness_n_m, loud ? "buzzes" : "calm");
    fflush(stdout);
}

// Print the head of the table and measure all rows. Each series of the table has one friction.
static void survey(zwidth *z)
{
    const kn_device_def *d = &z->profile;
    double b = z->most.damping_n_s_m;
    printf("%s: %.3g g, friction %.3g N s/m, encoder %.3g um; hand %s on %s\n", d->name, 1e3 * d->mass_kg,
           d->damping_n_s_m, 1e6 * d->encoder_m, kn_grip_name(z->grip), z->scene ? z->scene->name : z->material->name);
    printf("round  friction  stiffest coupling that is calm, N/m\n  trip     N s/m");
    printf("    b_vc 0");
    if (!z->quick) printf("  b_vc %-4.3g", 0.5 * b);
    printf("  b_vc %-4.3g", b);
    if (!z->quick) printf("  b_vc %-4.3g", 2.0 * b);
    printf("  Colgate   delayed   default\n");
    z->sound = true;
    z->bar = kn_progress_open("zwidth", z->quick ? (TRIPS - 1) * 2 : FRICTIONS * TRIPS * DAMPINGS);
    for (int f = z->quick; f < (z->quick ? 2 : FRICTIONS); f++) {
        char label[40];
        snprintf(label, sizeof label, "friction %.3g N·s/m", friction_share[f] * d->damping_n_s_m);
        kn_table_series(&z->table, label);
        for (int t = 0; t < TRIPS; t++)
            if (!z->quick || trip_ms[t] != 10) measure(z, friction_share[f] * d->damping_n_s_m, trip_ms[t]);
    }
}

// Draw the largest couplings beside the bounds.
static int draw(const zwidth *z)
{
    enum { TRIP = 0, LARGEST = 2, UNDAMPED = 3, COLGATE = 6, DELAYED = 7 };
    char title[200], damped[60];
    snprintf(title, sizeof title, "%s: stiffest calm coupling, simulated; hand %s on %s", z->profile.name,
             kn_grip_name(z->grip), z->scene ? z->scene->name : z->material->name);
    snprintf(damped, sizeof damped, "k_vc, N/m, at b_vc %.3g N s/m", z->most.damping_n_s_m);
    kn_axes axes[2] = {{.x_label = "round trip, ms",
                        .y_label = damped,
                        .x = TRIP,
                        .y = LARGEST,
                        .y2 = DELAYED,
                        .y_name = "measured",
                        .y2_name = "delayed bound",
                        .x_scale = 1,
                        .y_scale = 1,
                        .log_y = true,
                        .points = true},
                       {.x_label = "round trip, ms",
                        .y_label = "k_vc, N/m, at b_vc 0",
                        .x = TRIP,
                        .y = UNDAMPED,
                        .y2 = COLGATE,
                        .y_name = "measured",
                        .y2_name = "Colgate",
                        .x_scale = 1,
                        .y_scale = 1,
                        .log_y = true,
                        .points = true}};
    return kn_table_draw(&z->table, "zwidth", z->png, title, axes, 2);
}

static const char *take_material(void *material, const char *name)
{
    for (int i = 0; i < KN_LUMPED_OBJECTS; i++)
        if (!strcmp(kn_lumped_objects[i].name, name))
            return *(const kn_lumped_object_def **)material = &kn_lumped_objects[i], NULL;
    return "wall, dough, clay, jelly or stiff-jelly";
}

static const char *take_set(void *survey, const char *set)
{
    zwidth *z = survey;
    if (strncmp(set, "device.", 7) != 0) return "a key of the device, device.KEY=VALUE";
    if (z->set_count < SETS) return z->sets[z->set_count++] = set, NULL;
    kn_complain("zwidth", KN_EXIT_USAGE, "--set: expected at most %d of these options", SETS);
    return KN_OPTION_TOLD;
}

static const char *take_grip(void *grip, const char *name) { return kn_grip_find(name, grip) ? NULL : kn_grip_names; }

static int parse(zwidth *z, int argc, char **argv)
{
#define AT(member) .offset = offsetof(zwidth, member)
    static const kn_option rows[] = {
        KN_OPTION("device", TEXT, AT(device)),
        KN_OPTION("set", SPECIAL, .take = take_set),
        KN_OPTION("hand", SPECIAL, AT(grip), .take = take_grip),
        KN_OPTION("material", SPECIAL, AT(material), .take = take_material),
        KN_OPTION("quick", FLAG, AT(quick)),
        KN_OPTION("csv", TEXT, AT(csv)),
        KN_OPTION("png", TEXT, AT(png)),
        KN_OPTION("plot", RENAMED, .expected = "--png FILE"),
        KN_OPTION("json", CALL, .call = kn_result_open),
        KN_OPTION("scene", SPECIAL, AT(scene_path), .take = kn_scene_take),
        KN_OPTION("probe", TEXT, AT(tool)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    const int code = kn_options_read(&table, z, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc)
        return kn_complain("zwidth", KN_EXIT_USAGE, "%s: expected options only; --help lists them", argv[optind]);
    // Without a hand a constant force of 1 N pushes the device, and only a wall can hold it.
    if (z->grip == KN_GRIP_NONE && (z->scene_path || z->material != &kn_lumped_objects[0]))
        return kn_complain("zwidth", KN_EXIT_USAGE,
                           "%s: without a hand the device only sinks in, expected --hand "
                           "light, normal or firm",
                           z->scene_path ? z->scene_path : z->material->name);
    return code;
}

// Measure all rows, print the table and write the results. Return the exit code.
static int report(zwidth *z)
{
    int code = KN_EXIT_OK;
    z->most = z->profile.hand;
    kn_table_init(&z->table, columns);
    survey(z);
    kn_result_text(kn_result(), "device", z->profile.name);
    kn_result_text(kn_result(), "hand", kn_grip_name(z->grip));
    kn_result_text(kn_result(), "on", z->scene ? z->scene->name : z->material->name);
    kn_result_bool(kn_result(), "default_calm", z->sound);
    kn_result_table("couplings", &z->table);
    if (z->csv) code = kn_table_write(&z->table, "zwidth", z->csv);
    if (code == KN_EXIT_OK && z->png) code = draw(z);
    kn_table_free(&z->table);
    return code == KN_EXIT_OK && !z->sound ? KN_EXIT_FAILED : code;
}

// Load the scene, and open its lattice once with any coupling. This checks before the long computation that the scene
// has the tool.
static int load_scene(zwidth *z)
{
    kn_lattice_object slab;
    char error[512];
    z->scene = kn_scene_load(z->scene_path, NULL, 0, error, sizeof error);
    if (!z->scene) return kn_complain("zwidth", KN_EXIT_USAGE, "%s", error);
    if (!kn_lattice_object_open(&slab, z->scene, z->tool, &(kn_coupling){100.0, 1.0}, error, sizeof error))
        return kn_complain("zwidth", KN_EXIT_USAGE, "%s", error);
    kn_lattice_object_close(&slab);
    return KN_EXIT_OK;
}

int kn_zwidth_main(int argc, char **argv)
{
    zwidth z = {.device = "touch", .material = &kn_lumped_objects[0]};
    int code = parse(&z, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    code = kn_device_profile_load(&z.profile, "zwidth", z.device, z.sets, z.set_count);
    if (code == KN_EXIT_OK && z.scene_path) code = load_scene(&z);
    if (code == KN_EXIT_OK && z.csv) code = kn_output_try("zwidth", z.csv);
    if (code == KN_EXIT_OK && z.png) code = kn_plot_try("zwidth", z.png);
    if (code == KN_EXIT_OK) code = report(&z);
    kn_scene_destroy(z.scene);
    return code;
}
