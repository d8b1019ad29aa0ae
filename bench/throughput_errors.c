// Table of the errors of the default settings. The reference is an f64 run of this program with the same time step, the
// secant linearisation, five linearisations per step, and conjugate gradients to 1e-8.
#include "bench/throughput.h"
#include "tests/physics/press.h"

static const press path = {.depth_m = 0.01, .hold_s = 0.5};
#define SECONDS (PRESS_TICKS * 1e-3)

static void print_error(const char *object, const char *kernel, const run *fast, const run *reference)
{
    double force = 100 * force_error(fast, reference), shape = 100 * shape_error(fast, reference);
    printf("| %-9s | %-9s | %8.3f | %8.3f | %5.2f | %5.1f | %6ld |\n", object, kernel, force, shape, variation(fast),
           fast->mean_iterations, fast->secant_steps);
}

// Print the errors of one object in f32 and, if it contains no gas, in f64.
static void measure_errors(const kn_model_def *def)
{
    char object[32];
    const bool gas = def->pressure != KN_PRESSURE_NONE;
    snprintf(object, sizeof object, "%d%s", def->nodes[0] * def->nodes[1] * def->nodes[2], gas ? " gas" : "");
    fprintf(stderr, "computing the reference of %s nodes ...\n", object);
    kn_model_def exact = converged(*def), fast = *def;
    run reference = press_run(&exact, &path, SECONDS, 1e-3);
    for (int p = 0; p < (gas ? 1 : 2); p++) {
        fast.solver.precision = (kn_precision)p;
        run r = press_run(&fast, &path, SECONDS, 1e-3);
        print_error(object, p ? "f64" : "f32", &r, &reference);
        run_free(&r);
    }
    printf("| %-9s | reference | peak %9.3f N    | %5.2f | %5.1f |      - |\n", object, peak_n(&reference),
           variation(&reference), reference.mean_iterations);
    fflush(stdout);
    run_free(&reference);
}

// Print the error that the time step causes: the difference between two converged runs, one with steps of 1 ms and one
// with steps of 1/16 ms.
static void print_time_step_error(void)
{
    kn_model_def def = converged(press_def(1));
    run coarse = press_run(&def, &path, SECONDS, 1e-3);
    def.solver.dt_s = 1e-3 / 16;
    run fine = press_run(&def, &path, SECONDS, 1e-3);
    double force = 100 * force_error(&coarse, &fine), shape = 100 * shape_error(&coarse, &fine);
    printf("\nError of a time step of 1 ms (144 nodes, compared with 1/16 ms): force %.3f %%, shape %.3f %%.\n", force,
           shape);
    run_free(&coarse);
    run_free(&fine);
}

void table_errors(const throughput_options *o)
{
    puts("\nErrors of the default settings over the press, relative L2 against a converged f64 run; TV/pk: total\n"
         "variation of the force, divided by the largest force.\n");
    puts("| nodes     | precision |  force % |  shape % | TV/pk | its   | secant |");
    puts("|----------:|-----------|---------:|---------:|------:|------:|-------:|");
    for (int per_cm = 1; per_cm <= 4; per_cm++) {
        kn_model_def def = press_def(per_cm);
        if (def.nodes[0] * def.nodes[1] * def.nodes[2] > o->nodes_max) break;
        measure_errors(&def);
        def.pressure = KN_PRESSURE_CELLS;
        if (per_cm == 2) measure_errors(&def);
    }
    print_time_step_error();
}
