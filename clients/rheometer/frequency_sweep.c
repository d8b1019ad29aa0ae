// knead sweep: strains a specimen sinusoidally at several frequencies and measures storage and loss modulus.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "clients/rheometer/rheometer.h"
#include "core/oneport.h"
#include <math.h>
#include <stdio.h>

static const char help[] =
    "usage: knead sweep MATERIAL|EXPR [OPTION]...\n\n"
    "Virtual rheometer: compress a specimen sinusoidally and print two moduli (stress over strain) at each\n"
    "frequency. G' is the storage modulus, from the stress in phase with the strain. G'' is the loss modulus, from\n"
    "the stress a quarter period ahead of the strain. The moduli refer to the initial section S0. Without\n"
    "--amplitude the oscillation is infinitesimal, and every damper has its viscosity at rest. This holds up to the\n"
    "amplitude linear_strain, at which the first stress-dependent damper reaches its stress p0.\n\n"
    "  --frequency L:H[:N]\n"
    "                    N frequencies from L to H, Hz, evenly spaced on a logarithmic scale (default: 0.001:100:26)\n"
    "  --amplitude A     oscillate with the strain amplitude A, 1% or 0.01, until the stress is periodic, as an\n"
    "                    instrument does. The moduli are those of the fundamental; harmonics is the share of the\n"
    "                    stress outside it\n" KN_RHEOMETER_LATTICE_HELP
    "  --csv FILE        write frequency_hz,storage_pa,loss_pa,loss_tangent,linear_strain,harmonics\n"
    "  --png FILE        draw the curves (needs gnuplot)\n"
    "  --json            print the results as JSON\n" KN_RHEOMETER_HELP "\n"
    "Examples:\n"
    "    knead sweep dough --frequency 0.001:10 --csv sweep.csv --png sweep.png\n"
    "    knead sweep dough --frequency 0.01:1:5 --amplitude 1%\n"
    "    knead sweep maxwell --param s1='10 kPa' --param d1='2 kPa*s'\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";

static const char *const columns[] = {"frequency_hz",  "storage_pa", "loss_pa", "loss_tangent",
                                      "linear_strain", "harmonics",  NULL};

// Return the largest strain of the whole specimen at which every damper keeps its viscosity at rest. A stress-dependent
// damper keeps this viscosity until its stress exceeds p0. The strain of the specimen is then p0 divided by the
// damper's stress per unit strain. Return the least of these strains, or infinity if no damper depends on the stress.
// `stress`: amplitude of the stress in this part per unit strain of the whole specimen.
static double linear_strain(const kn_network *net, const double *moduli, double omega, int node, double stress)
{
    const kn_element *e = &net->element;
    const kn_element_node *n = &e->node[node];
    double least = INFINITY, whole[2];
    if (n->kind < KN_ELEMENT_SERIES)
        return kn_part_thins(&net->part[n->leaf]) ? net->part[n->leaf].p0_pa / stress : INFINITY;
    kn_oneport_modulus(e, node, moduli, omega, &whole[0], &whole[1]);
    // Parts in series carry the whole stress. Parts in parallel share the stress.
    for (int i = 0; i < n->count; i++) {
        double part[2], share = stress;
        kn_oneport_modulus(e, n->child[i], moduli, omega, &part[0], &part[1]);
        if (n->kind == KN_ELEMENT_PARALLEL)
            // Parts in parallel carry stress in proportion to their stiffness.
            share *= hypot(part[0], part[1]) / hypot(whole[0], whole[1]);
        least = fmin(least, linear_strain(net, moduli, omega, n->child[i], share));
    }
    return least;
}

// Compute the moduli for a vanishing amplitude, at which every damper has its viscosity at rest.
static void linear(const kn_rheometer *b, double hz, double row[6])
{
    double moduli[KN_ELEMENT_MAX], omega = 2 * acos(-1.0) * hz;
    const kn_element *e = &b->net.element;
    for (int i = 0; i < e->leaves; i++) moduli[i] = kn_part_modulus(&b->net, i, 0);
    kn_oneport_modulus(e, e->root, moduli, omega, &row[1], &row[2]);
    row[4] = linear_strain(&b->net, moduli, omega, e->root, hypot(row[1], row[2]));
    row[5] = 0;
}

// Number of samples of the stress in a period, and of steps of a lattice. A lattice steps by the implicit Euler method,
// whose moduli are wrong by about pi/LATTICE_STEPS, 0.6 %.
enum { SAMPLES = 64, LATTICE_STEPS = 8 * SAMPLES };

// Strain the specimen for one period of the sine, and compute the Fourier sums of the stress. row[1]: storage modulus,
// from the stress in phase with the strain. row[2]: loss modulus, from the stress a quarter period ahead of the strain.
// row[5]: share of the stress (rms, without the mean) outside the fundamental.
static int swing_once(kn_rheometer *b, double hz, int period, double row[6])
{
    double sine = 0, cosine = 0, mean = 0, square = 0;
    for (int i = 1; i <= SAMPLES; i++) {
        int code = kn_rheometer_advance(b, (period + (double)i / SAMPLES) / hz);
        if (code != KN_EXIT_OK) return code;
        double phase = 2 * acos(-1.0) * i / SAMPLES;
        sine += 2 * b->stress_pa * sin(phase) / SAMPLES;
        cosine += 2 * b->stress_pa * cos(phase) / SAMPLES;
        mean += b->stress_pa / SAMPLES;
        square += b->stress_pa * b->stress_pa / SAMPLES;
    }
    // Compute the mean square of the stress without its mean, and the mean square of the fundamental of the stress.
    double all = square - mean * mean, fundamental = (sine * sine + cosine * cosine) / 2;
    row[1] = sine / b->opt->amplitude;
    row[2] = cosine / b->opt->amplitude;
    row[5] = all > fundamental ? sqrt(1 - fundamental / all) : 0;
    return KN_EXIT_OK;
}

// Strain the specimen until the fundamental of the stress repeats within 1e-5, for at most 500 periods. Set *repeats to
// true if the fundamental has repeated.
static int measured(kn_rheometer *b, double hz, double row[6], bool *repeats)
{
    enum { PERIODS = 500 };
    double before[2] = {0, 0}, size = 0;
    int code = b->lattice_runs ? kn_rheometer_time_step(b, 1 / (SAMPLES * hz), LATTICE_STEPS / SAMPLES) : KN_EXIT_OK;
    if (code != KN_EXIT_OK) return code;
    kn_rheometer_fresh(b);
    code = kn_rheometer_swing(b, b->opt->amplitude, 2 * acos(-1.0) * hz);
    *repeats = false;
    for (int i = 0; i < PERIODS && code == KN_EXIT_OK && !*repeats; i++) {
        code = swing_once(b, hz, i, row);
        size = hypot(row[1], row[2]);
        *repeats = i > 0 && hypot(row[1] - before[0], row[2] - before[1]) <= 1e-5 * size;
        before[0] = row[1];
        before[1] = row[2];
    }
    return code;
}

// Measure and print the moduli of one specimen at frequencies that are evenly spaced on a logarithmic scale. Set
// *nonlinear if a damper of the specimen depends on the stress.
static int sweep(kn_rheometer *b, kn_table *t, bool *nonlinear)
{
    const kn_rheometer_options *opt = b->opt;
    printf("\n%12s %12s %12s %9s %s\n", "frequency Hz", "G' Pa", "G'' Pa", "G''/G'",
           opt->amplitude > 0 ? "harmonics" : "linear up to a strain of");
    for (int i = 0; i < opt->frequencies; i++) {
        double row[6] = {opt->low_hz * pow(opt->high_hz / opt->low_hz, i / (opt->frequencies - 1.0))};
        bool repeats = true;
        linear(b, row[0], row);
        *nonlinear |= isfinite(row[4]);
        int code = opt->amplitude > 0 ? measured(b, row[0], row, &repeats) : KN_EXIT_OK;
        if (code != KN_EXIT_OK) return code;
        row[3] = row[2] / row[1];
        kn_table_add(t, row);
        printf("%12.5g %12.5g %12.5g %9.4g ", row[0], row[1], row[2], row[3]);
        if (opt->amplitude > 0) printf("%.2g%s\n", row[5], repeats ? "" : "  not yet periodic after 500 swings");
        else if (isfinite(row[4])) printf("%.3g\n", row[4]);
        else printf("any\n");
    }
    return KN_EXIT_OK;
}

// Sweep the element and then, with --lattice, the lattice, which the plate pulls in every second half of a period.
static int run(kn_rheometer *b, kn_table *t)
{
    const kn_rheometer_options *opt = b->opt;
    bool nonlinear = false;
    if (b->model && !(opt->amplitude > 0))
        return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--lattice: expected --amplitude, e.g. --amplitude 0.1%%");
    kn_rheometer_print(b);
    if (opt->amplitude > 0)
        printf("test      oscillations of %g %%, until the fundamental repeats within 1e-5\n", 100 * opt->amplitude);
    else printf("test      infinitesimal oscillations: every damper has its viscosity at rest\n");
    t->pairs = b->model;
    for (int lattice = 0; lattice <= (b->model != NULL); lattice++) {
        kn_rheometer_choose(b, lattice);
        kn_table_series(t, lattice ? "lattice" : b->model ? "element" : "G");
        if (b->model) printf("\n%s", lattice ? "lattice" : "element");
        int code = sweep(b, t, &nonlinear);
        if (code != KN_EXIT_OK) return code;
    }
    kn_result_table("frequencies", t);
    if (nonlinear && opt->amplitude == 0)
        printf("\na damper depends on the stress: the specimen is softer under larger oscillations, see --amplitude\n");
    return KN_EXIT_OK;
}

static const kn_axes axes[] = {{.x_label = "frequency, Hz",
                                .y_label = "modulus, Pa",
                                .x = 0,
                                .y = 1,
                                .y2 = 2,
                                .y_name = "G'",
                                .y2_name = "G''",
                                .x_scale = 1,
                                .y_scale = 1,
                                .log_x = true,
                                .log_y = true,
                                .points = true},
                               {.x_label = "frequency, Hz",
                                .y_label = "loss tangent",
                                .x = 0,
                                .y = 3,
                                .y_name = "G''/G'",
                                .x_scale = 1,
                                .y_scale = 1,
                                .log_x = true,
                                .log_y = true,
                                .points = true}};

static void title(const kn_rheometer *b, char *text, size_t size)
{
    const kn_rheometer_options *opt = b->opt;
    char how[40] = "linear";
    if (opt->amplitude > 0) snprintf(how, sizeof how, "oscillations of %g %%", 100 * opt->amplitude);
    snprintf(text, size, "sweep of %s, %s", b->title, how);
}

int kn_sweep_main(int argc, char **argv)
{
    static const kn_experiment experiment = {"sweep", help, columns, run, axes, title};
    return kn_rheometer_main(
        &experiment,
        (kn_rheometer_options){
            .low_hz = 1e-3, .high_hz = 100, .frequencies = 26, .constant_area = true, .adhesion_pa = KN_BONDED_PA},
        argc, argv);
}
