// Time and error of one step of the dough block under the first paper's press, against a converged f64 run of the same
// program. Says machine, compiler and instruction sets first; every number of a table comes from the same run.
#include "tests/physics/press.h"
#include <getopt.h>
#include <time.h>

static const press path = {.depth_m = 0.01, .hold_s = 0.5}; // 1 cm/s to 1 cm, hold, withdraw, and 0.4 s of rest
#define SECONDS 2.1

typedef struct options {
    bool quick; // without 2 560 nodes, whose reference takes minutes
    const char *csv, *json;
} options;

// us: time a thread spends on a step; the machine's other work is not counted.
typedef struct row {
    char name[32];
    int nodes;
    double median_us, p90_us, target_us; // 0: no target
    double force, shape, variation;      // relative L2 against the reference; negative: not run to the end
    double iterations;
    long secant_steps;
} row;

static double thread_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The press again, step by step with a clock around each; the first `steps` of them.
static void time_steps(const kn_model_def *def, int steps, row *r)
{
    kn_model *model = build(def);
    kn_state *state = kn_state_create(model);
    double *us = malloc((size_t)steps * sizeof *us);
    if (!state || !us) abort();
    for (int i = 0; i < steps; i++) {
        kn_input in = press_input(model, &path, (i + 1) * def->solver.dt_s);
        kn_output out;
        double before = thread_us();
        kn_step(model, state, &in, &out);
        us[i] = thread_us() - before;
    }
    qsort(us, (size_t)steps, sizeof *us, ascending);
    r->median_us = us[steps / 2];
    r->p90_us = us[steps * 9 / 10];
    free(us);
    kn_state_destroy(state);
    kn_model_destroy(model);
}

static bool available(const kn_model_def *def)
{
    char error[256];
    kn_model *model = kn_model_build(def, error, sizeof error);
    bool got = model && model->isa == def->solver.isa;
    kn_model_destroy(model);
    return got;
}

static void print_row(const row *r)
{
    printf("| %5d | %-11s | %8.1f | %8.1f | %6.0f |", r->nodes, r->name, r->median_us, r->p90_us,
           r->median_us * 1e3 / r->nodes);
    if (r->force >= 0)
        printf(" %8.3f | %8.3f | %5.2f | %5.1f | %6ld |", 100 * r->force, 100 * r->shape, r->variation, r->iterations,
               r->secant_steps);
    else
        printf("        - |        - |     - |     - |      - |");
    if (r->target_us > 0)
        printf(" %5.0f %s |\n", r->target_us, r->median_us <= r->target_us ? "met" : "MISSED");
    else
        printf("     - |\n");
    fflush(stdout);
}

static kn_model_def block_def(int per_cm, kn_pressure pressure)
{
    kn_model_def def = press_def(per_cm);
    def.pressure = pressure;
    return def;
}

// One block in every instruction set and precision, with gas in its cells only in f32; rows are appended at *count.
static void bench_block(int per_cm, kn_pressure pressure, double target_us, row *rows, int *count)
{
    static const char *isas[] = {"", "base", "avx2", "avx512"};
    const bool gas = pressure != KN_PRESSURE_NONE;
    kn_model_def def = converged(block_def(per_cm, pressure));
    fprintf(stderr, "reference for %d nodes%s (f64, secant, 5 passes, CG to 1e-8) ...\n",
            def.nodes[0] * def.nodes[1] * def.nodes[2], gas ? " with gas" : "");
    run reference = press_run(&def, &path, SECONDS, 1e-3);
    for (int isa = KN_ISA_AVX512; isa >= KN_ISA_BASE; isa--)
        for (int p = KN_PRECISION_F32; p <= (gas ? KN_PRECISION_F32 : KN_PRECISION_F64); p++) {
            def = block_def(per_cm, pressure);
            def.solver.isa = (kn_isa)isa;
            def.solver.precision = (kn_precision)p;
            if (!available(&def)) continue;
            row *r = &rows[(*count)++];
            *r = (row){.nodes = reference.nodes, .force = -1};
            snprintf(r->name, sizeof r->name, "%s %s", isas[isa], gas ? "gas" : p ? "f64" : "f32");
            if (p == KN_PRECISION_F32 && isa == KN_ISA_AVX512) r->target_us = target_us;
            if (p == KN_PRECISION_F32 && isa == KN_ISA_AVX2) r->target_us = 1.6 * target_us;
            // without FMA: the same bits as the others, but so slow that its first 300 ticks must do
            time_steps(&def, isa == KN_ISA_BASE ? 300 : (int)(SECONDS * 1000), r);
            if (isa != KN_ISA_BASE) {
                run fast = press_run(&def, &path, SECONDS, 1e-3);
                r->force = force_error(&fast, &reference);
                r->shape = shape_error(&fast, &reference);
                r->variation = variation(&fast);
                r->iterations = fast.mean_iterations;
                r->secant_steps = fast.secant_steps;
                run_free(&fast);
            }
            print_row(r);
        }
    printf("|       | reference   |          |          |        | peak %11.3f N  | %5.2f | %5.1f |      - |     - |\n",
           peak_n(&reference), variation(&reference), reference.mean_iterations);
    run_free(&reference);
}

// What the step length itself costs: the converged run at 1 ms against one at 1/16 ms.
static void print_time_step_error(void)
{
    kn_model_def def = converged(press_def(1));
    run coarse = press_run(&def, &path, SECONDS, 1e-3);
    def.solver.dt_s = 1e-3 / 16;
    run fine = press_run(&def, &path, SECONDS, 1e-3);
    printf("\nerror of the 1 ms step itself (144 nodes, against 1/16 ms): force %.3f %%, shape %.3f %%\n",
           100 * force_error(&coarse, &fine), 100 * shape_error(&coarse, &fine));
    run_free(&coarse);
    run_free(&fine);
}

static void print_machine(void)
{
    char line[256], model[200] = "unknown processor";
    FILE *f = fopen("/proc/cpuinfo", "r");
    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, "model name : %199[^\n]", model) == 1) break;
    if (f) fclose(f);
#ifdef __clang__
    const char *compiler = "clang " __clang_version__;
#else
    const char *compiler = "gcc " __VERSION__;
#endif
#ifdef __OPTIMIZE__
    const char *level = "optimised";
#else
    const char *level = "NOT optimised";
#endif
    printf("machine   %s\ncompiler  %s, %s\n", model, compiler, level);
    printf("block     5 x 5 x 3 cm of dough, 1 cm x 5 cm plate, 1 cm/s to 1 cm, held %g s, withdrawn; 1 ms steps, "
           "one core\n\n",
           path.hold_s);
}

static void print_csv(FILE *f, const row *rows, int count)
{
    fprintf(f, "nodes,kernel,median_us,p90_us,target_us,force_error,shape_error,variation,iterations,secant_steps\n");
    for (int i = 0; i < count; i++)
        fprintf(f, "%d,%s,%.2f,%.2f,%.0f,%.6f,%.6f,%.3f,%.2f,%ld\n", rows[i].nodes, rows[i].name, rows[i].median_us,
                rows[i].p90_us, rows[i].target_us, rows[i].force, rows[i].shape, rows[i].variation, rows[i].iterations,
                rows[i].secant_steps);
}

static void print_json(FILE *f, const row *rows, int count)
{
    fprintf(f, "[\n");
    for (int i = 0; i < count; i++)
        fprintf(f,
                "  {\"nodes\": %d, \"kernel\": \"%s\", \"median_us\": %.2f, \"p90_us\": %.2f, \"target_us\": %.0f, "
                "\"force_error\": %.6f, \"shape_error\": %.6f, \"variation\": %.3f, \"iterations\": %.2f, "
                "\"secant_steps\": %ld}%s\n",
                rows[i].nodes, rows[i].name, rows[i].median_us, rows[i].p90_us, rows[i].target_us, rows[i].force,
                rows[i].shape, rows[i].variation, rows[i].iterations, rows[i].secant_steps, i + 1 < count ? "," : "");
    fprintf(f, "]\n");
}

static int write_file(const char *path_name, void (*print)(FILE *, const row *, int), const row *rows, int count)
{
    FILE *f = fopen(path_name, "w");
    if (!f) {
        perror(path_name);
        return 3;
    }
    print(f, rows, count);
    return fclose(f) ? 3 : 0;
}

static options parse(int argc, char **argv)
{
    static const struct option longs[] = {{"quick", no_argument, 0, 'q'},
                                          {"csv", required_argument, 0, 'c'},
                                          {"json", required_argument, 0, 'j'},
                                          {"help", no_argument, 0, 'h'},
                                          {0, 0, 0, 0}};
    options o = {0};
    for (int c; (c = getopt_long(argc, argv, "", longs, NULL)) != -1;) switch (c) {
        case 'q':
            o.quick = true;
            break;
        case 'c':
            o.csv = optarg;
            break;
        case 'j':
            o.json = optarg;
            break;
        default:
            printf("usage: bench_step [--quick] [--csv FILE] [--json FILE]\n"
                   "  --quick  144 and 847 nodes only; 2 560 and their reference take some minutes\n");
            exit(c == 'h' ? 0 : 2);
        }
    return o;
}

int main(int argc, char **argv)
{
    static const struct {
        int per_cm;
        kn_pressure pressure;
        double target_us;
    } blocks[4] = {{1, KN_PRESSURE_NONE, 30}, {2, KN_PRESSURE_NONE, 150}, {2, KN_PRESSURE_CELLS, 0},
                   {3, KN_PRESSURE_NONE, 450}};
    options o = parse(argc, argv);
    row rows[21];
    int count = 0;
    print_machine();
    puts("| nodes | kernel      | us median |   us p90 | ns/node |  force % |  shape % | TV/pk | its   | secant "
         "| target |");
    puts("|------:|-------------|----------:|---------:|-------:|---------:|---------:|------:|------:|-------:"
         "|-------:|");
    for (int b = 0; b < (o.quick ? 3 : 4); b++)
        bench_block(blocks[b].per_cm, blocks[b].pressure, blocks[b].target_us, rows, &count);
    print_time_step_error();
    int failed = 0;
    if (o.csv) failed |= write_file(o.csv, print_csv, rows, count);
    if (o.json) failed |= write_file(o.json, print_json, rows, count);
    return failed;
}
