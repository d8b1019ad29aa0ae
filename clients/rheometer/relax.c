// knead relax: a specimen is compressed and held, and the fall of its stress is recorded.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include "clients/rheometer/rheometer.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char help[] =
    "usage: knead relax MATERIAL|EXPR [OPTION]...\n\n"
    "Virtual rheometer: compress a specimen by a share of its height, hold it there, and print how the stress\n"
    "relaxes.\n\n"
    "  --strain S        share of the height, 10% or 0.1 (default: 10 %)\n"
    "  --ramp RATE       strain per second, 10%/s, or a speed, '1 mm/s' (default: a step of strain). A step is\n"
    "                    impossible for a lattice, and for an element that responds as a damper at first, such as\n"
    "                    dough\n"
    "  --hold TIME       time at that strain (default: 100 s)\n" KN_RHEOMETER_LATTICE_HELP
    "  --csv FILE        write time_s,held_s,strain,stress_pa,modulus_pa,force_n; held_s < 0 during the ramp\n"
    "  --png FILE        draw the curves (needs gnuplot)\n"
    "  --json            print the results as JSON\n" KN_RHEOMETER_HELP KN_RHEOMETER_AREA_HELP "\n"
    "Examples:\n"
    "    knead relax dough --strain 30% --ramp 2%/s --csv relax.csv --png relax.png\n"
    "    knead relax zener --param s1='46 kPa' --param d1='245 kPa*s' --param s2='20 kPa' --strain 10%\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";

static const char *const columns[] = {"time_s", "held_s", "strain", "stress_pa", "modulus_pa", "force_n", NULL};

// RAMP_SAMPLES: number of samples during the ramp. SAMPLES_PER_DECADE, DECADES: samples during the hold, evenly spaced
// in the logarithm of time.
enum { RAMP_SAMPLES = 100, SAMPLES_PER_DECADE = 40, DECADES = 5 };

// Append the present time, strain and stress of the specimen to the table.
static void add(kn_table *t, const kn_rheometer *b, double begin_s)
{
    kn_table_add(t, (double[]){b->time_s, b->time_s - begin_s, b->strain, b->stress_pa,
                               b->strain > 0 ? b->stress_pa / b->strain : 0, b->force_n});
}

// Bring the specimen to its strain, by a ramp or a step. *begin_s: time at which the hold begins.
static int press(kn_rheometer *b, kn_table *t, double *begin_s)
{
    const kn_rheometer_options *opt = b->opt;
    *begin_s = opt->ramp_per_s > 0 ? opt->strain / opt->ramp_per_s : 0;
    if (*begin_s == 0) return kn_rheometer_strain(b, opt->strain, 0);
    int code = kn_rheometer_strain(b, 0, opt->ramp_per_s);
    for (int i = 1; i <= RAMP_SAMPLES && code == KN_EXIT_OK; i++) {
        code = kn_rheometer_advance(b, *begin_s * i / RAMP_SAMPLES);
        add(t, b, *begin_s);
    }
    return code;
}

// Results of one run: peak stress at the end of the ramp, stress at the beginning and at the end of the hold, and the
// times when the stress has fallen to 1/2, 1/e and 1/10 of its value at the beginning of the hold.
typedef struct reading {
    double peak_pa, begin_pa, end_pa, fallen_s[3];
} reading;

static const double share[3] = {0.5, 0.36787944117144233, 0.1};

// Record the times at which the stress falls through one of the three levels between two samples.
static void fall(reading *r, double from_s, double from_pa, double to_s, double to_pa)
{
    for (int i = 0; i < 3; i++) {
        double level = share[i] * r->begin_pa;
        // Interpolate exponentially between the samples.
        if (from_pa > level && to_pa <= level && to_pa > 0)
            r->fallen_s[i] = from_s + (to_s - from_s) * log(from_pa / level) / log(from_pa / to_pa);
    }
}

// Run one specimen: press, hold, and sample the stress.
static int relax(kn_rheometer *b, kn_table *t, reading *r)
{
    const kn_rheometer_options *opt = b->opt;
    double begin_s;
    kn_rheometer_fresh(b);
    kn_table_series(t, b->lattice_runs ? "lattice" : "element");
    int code = press(b, t, &begin_s);
    *r = (reading){.peak_pa = b->stress_pa, .fallen_s = {NAN, NAN, NAN}};
    if (code == KN_EXIT_OK) code = kn_rheometer_strain(b, opt->strain, 0);
    // When the plate stops, the mass of the block swings for a few steps. So wait for ten steps before the first
    // reading of the hold.
    if (b->lattice_runs && code == KN_EXIT_OK)
        code = kn_rheometer_advance(b, b->time_s + 10 * b->model->def.solver.dt_s);
    r->begin_pa = b->stress_pa;
    add(t, b, begin_s);
    for (int i = 0; i <= SAMPLES_PER_DECADE * DECADES && code == KN_EXIT_OK; i++) {
        double from_s = b->time_s, from_pa = b->stress_pa;
        double held = opt->hold_s * pow(10, (double)i / SAMPLES_PER_DECADE - DECADES);
        // Skip the sampling times that have already passed during the wait of ten steps.
        if (begin_s + held <= from_s) continue;
        code = kn_rheometer_advance(b, begin_s + held);
        if (b->time_s <= from_s) continue; // the interval is shorter than a step of the lattice
        fall(r, from_s - begin_s, from_pa, b->time_s - begin_s, b->stress_pa);
        add(t, b, begin_s);
    }
    r->end_pa = b->stress_pa;
    return code;
}

static void print_row(const char *name, const reading *r)
{
    static const char *const fallen[] = {"half_s", "e_s", "tenth_s"};
    json_t *row = kn_result_add("runs");
    kn_result_text(row, "of", name);
    kn_result_number(row, "peak_pa", r->peak_pa);
    kn_result_number(row, "held_pa", r->begin_pa);
    kn_result_number(row, "end_pa", r->end_pa);
    for (int i = 0; i < 3; i++) kn_result_number(row, fallen[i], r->fallen_s[i]);
    printf("%-8s %11.5g %11.5g %11.5g", name, r->peak_pa, r->begin_pa, r->end_pa);
    for (int i = 0; i < 3; i++)
        if (isnan(r->fallen_s[i])) printf(" %9s", "-");
        else printf(" %9.4g", r->fallen_s[i]);
    printf("\n");
}

// Run the element and then, with --lattice, the lattice.
static int run(kn_rheometer *b, kn_table *t)
{
    const kn_rheometer_options *opt = b->opt;
    const double ramp_s = opt->ramp_per_s > 0 ? opt->strain / opt->ramp_per_s : 0;
    if (b->model && ramp_s == 0)
        return kn_complain(opt->subcommand, KN_EXIT_USAGE,
                           "--lattice: a plate cannot jump, expected --ramp RATE, e.g. --ramp 10%%/s");
    int code = kn_rheometer_time_step(b, ramp_s, 200);
    if (code != KN_EXIT_OK) return code;
    t->pairs = b->model;
    kn_rheometer_print(b);
    if (opt->ramp_per_s > 0)
        printf("test      to %g %% at %g %%/s, held %g s\n", 100 * opt->strain, 100 * opt->ramp_per_s, opt->hold_s);
    else printf("test      a step to %g %%, held %g s\n", 100 * opt->strain, opt->hold_s);
    printf("\n%8s %35s   s until the stress has fallen to\n%-8s %11s %11s %11s %9s %9s %9s\n", "", "stress, Pa", "",
           "at the end", "held", "at last", "1/2", "1/e", "1/10");
    for (int lattice = 0; lattice <= (b->model != NULL); lattice++) {
        reading r;
        kn_rheometer_choose(b, lattice);
        kn_rheometer_bar(b, opt->hold_s + (opt->ramp_per_s > 0 ? opt->strain / opt->ramp_per_s : 0));
        code = relax(b, t, &r);
        kn_rheometer_bar_end(b);
        if (code != KN_EXIT_OK) return code;
        print_row(lattice ? "lattice" : "element", &r);
    }
    printf("\nheld: just after the ramp has ended%s; the viscous stress of a dashpot has vanished by then\n",
           b->model ? " (lattice: ten steps)" : "");
    return KN_EXIT_OK;
}

static const kn_axes axes[] = {
    {.x_label = "time, s", .y_label = "stress, kPa", .x = 0, .y = 3, .x_scale = 1, .y_scale = 1e-3},
    {.x_label = "time held, s",
     .y_label = "stress, Pa",
     .x = 1,
     .y = 3,
     .x_scale = 1,
     .y_scale = 1,
     .log_x = true,
     .log_y = true}};

static void title(const kn_rheometer *b, char *text, size_t size)
{
    const kn_rheometer_options *opt = b->opt;
    snprintf(text, size, "relaxation of %s, held at %g %%", b->title, 100 * opt->strain);
}

int kn_relax_main(int argc, char **argv)
{
    static const kn_experiment experiment = {"relax", help, columns, run, axes, title};
    return kn_rheometer_main(&experiment, (kn_rheometer_options){.strain = 0.1, .hold_s = 100}, argc, argv);
}
