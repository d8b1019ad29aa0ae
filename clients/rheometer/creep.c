// knead creep: puts a weight on a specimen for a time, takes the weight off, and records height and recovery. This is
// the experiment of the first paper, section 4.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "clients/rheometer/rheometer.h"
#include <math.h>
#include <stdio.h>

static const char help[] =
    "usage: knead creep MATERIAL|EXPR [OPTION]...\n\n"
    "Virtual rheometer: load a specimen with a weight, unload it, and print the height under the weight and the\n"
    "recovery after it. The default is the first paper's test: 50 gf for 60 s, then 70 s of rest. The stress of a\n"
    "load W is W h/(S0 h0). It falls with the height h while the specimen creeps.\n\n"
    "  --load W[,W]...   weights, each on a fresh specimen (default: 50gf)\n"
    "  --hold TIME       time under the weight (default: 60 s)\n"
    "  --rest TIME       time after unloading (default: 70 s)\n" KN_RHEOMETER_LATTICE_HELP
    "  --csv FILE        write load_n,time_s,strain,height_m,stress_pa\n"
    "  --png FILE        draw the curves (needs gnuplot)\n"
    "  --json            print the results as JSON\n" KN_RHEOMETER_HELP KN_RHEOMETER_AREA_HELP "\n"
    "Examples:\n"
    "    knead creep dough\n"
    "    knead creep dough --load 10gf,30gf,50gf --csv creep.csv --png creep.png\n"
    "    knead creep burgers --param s1='50 kPa' --param d1='4 MPa*s' --param s2='46 kPa' --param d2='245 kPa*s'\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";

static const char *const columns[] = {"load_n", "time_s", "strain", "height_m", "stress_pa", NULL};

typedef struct reading {
    // stress_pa, strain: values just before the weight is taken off; residual: strain at the end.
    double stress_pa, strain, residual;
    double flat_s; // lattice: time at which it was flat; NAN: it was never flat
} reading;

static void add(kn_table *t, const kn_rheometer *b, double load_n)
{
    kn_table_add(t, (double[]){load_n, b->time_s, b->strain, KN_RHEOMETER_HEIGHT_M * (1 - b->strain), b->stress_pa});
}

// Advance the specimen to the time until_s. Add SAMPLES rows to the table, equally spaced in time.
static int watch(kn_rheometer *b, kn_table *t, double load_n, double until_s)
{
    enum { SAMPLES = 300 };
    double from = b->time_s;
    int code = KN_EXIT_OK;
    for (int i = 1; i <= SAMPLES && code == KN_EXIT_OK && !b->flat; i++) {
        code = kn_rheometer_advance(b, i == SAMPLES ? until_s : from + (until_s - from) * i / SAMPLES);
        add(t, b, load_n);
    }
    return code;
}

// Run the creep experiment with one load: apply the load, hold it, take it off and rest.
static int creep(kn_rheometer *b, kn_table *t, double load_n, reading *r)
{
    const kn_rheometer_options *opt = b->opt;
    char label[40];
    snprintf(label, sizeof label, "%g gf%s", load_n / KN_GF_N, b->lattice_runs ? ", lattice" : "");
    kn_rheometer_fresh(b);
    // Add two rows at time 0: one before the elastic jump of the strain and one after it.
    kn_table_series(t, label);
    add(t, b, load_n);
    int code = kn_rheometer_load(b, load_n);
    if (code == KN_EXIT_OK) add(t, b, load_n);
    if (code == KN_EXIT_OK) code = watch(b, t, load_n, opt->hold_s);
    // Store stress and strain just before the weight is taken off.
    r->stress_pa = b->stress_pa;
    r->strain = b->strain;
    r->flat_s = b->flat ? b->time_s : NAN;
    // Take the weight off and watch the recovery.
    if (code == KN_EXIT_OK) code = kn_rheometer_load(b, 0);
    if (code == KN_EXIT_OK && opt->rest_s > 0) code = watch(b, t, load_n, opt->hold_s + opt->rest_s);
    r->residual = b->strain;
    return code;
}

// Print the result of one load and add the result to the JSON list `loads`.
static void print_row(const char *name, double load_n, const reading *r)
{
    json_t *row = kn_result_add("loads");
    kn_result_text(row, "of", name);
    kn_result_number(row, "load_n", load_n);
    if (!isnan(r->flat_s)) {
        kn_result_number(row, "flat_s", r->flat_s);
        printf("%8.4g %-8s flat after %.3g s\n", load_n / KN_GF_N, name, r->flat_s);
        return;
    }
    kn_result_number(row, "stress_pa", r->stress_pa);
    kn_result_number(row, "height_m", KN_RHEOMETER_HEIGHT_M * (1 - r->strain));
    kn_result_number(row, "strain", r->strain);
    kn_result_number(row, "recovered_strain", r->strain - r->residual);
    kn_result_number(row, "residual_strain", r->residual);
    printf("%8.4g %-8s %9.4g %9.2f %9.4f %9.4f %9.4f %9.4f\n", load_n / KN_GF_N, name, r->stress_pa / 1e3,
           r->stress_pa / KN_GF_CM2_PA, 1e2 * KN_RHEOMETER_HEIGHT_M * (1 - r->strain), r->strain,
           r->strain - r->residual, r->residual);
}

static int run(kn_rheometer *b, kn_table *t)
{
    const kn_rheometer_options *opt = b->opt;
    int code = kn_rheometer_time_step(b, opt->hold_s, 200);
    if (code != KN_EXIT_OK) return code;
    t->pairs = b->model;
    kn_rheometer_print(b);
    printf("\n%44s %-19s   after %g s of rest\n%8s %8s %9s %9s %9s %9s %9s %9s\n", "", "at release", opt->rest_s,
           "load gf", "", "kPa", "gf/cm^2", "height cm", "strain", "recovered", "residual");
    // Run each load on the one-dimensional element and, with --lattice, also on the lattice.
    for (int i = 0; i < opt->loads; i++) {
        reading r;
        for (int lattice = 0; lattice <= (b->model != NULL); lattice++) {
            kn_rheometer_choose(b, lattice);
            kn_rheometer_bar(b, opt->hold_s + opt->rest_s);
            code = creep(b, t, opt->load_n[i], &r);
            kn_rheometer_bar_end(b);
            if (code != KN_EXIT_OK) return code;
            print_row(lattice ? "lattice" : "element", opt->load_n[i], &r);
        }
    }
    printf("\nrecovered and residual are shares of the height, 1 cm\n");
    return KN_EXIT_OK;
}

static const kn_axes axes[] = {
    {.x_label = "time, s", .y_label = "displacement, cm", .x = 1, .y = 2, .x_scale = 1, .y_scale = 1},
    {.x_label = "time, s", .y_label = "stress, gf/cm²", .x = 1, .y = 4, .x_scale = 1, .y_scale = 1 / KN_GF_CM2_PA}};

static void title(const kn_rheometer *b, char *text, size_t size)
{
    const kn_rheometer_options *opt = b->opt;
    snprintf(text, size, "creep of %s: %g s under load, %g s of rest", b->title, opt->hold_s, opt->rest_s);
}

int kn_creep_main(int argc, char **argv)
{
    static const kn_experiment experiment = {"creep", help, columns, run, axes, title};
    return kn_rheometer_main(&experiment,
                             (kn_rheometer_options){.load_n = {50 * KN_GF_N}, .loads = 1, .hold_s = 60, .rest_s = 70},
                             argc, argv);
}
