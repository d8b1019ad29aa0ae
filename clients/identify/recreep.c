#include "clients/identify/recreep.h"
#include "clients/identify/creep_fit.h"
#include "clients/knead/bench.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdlib.h>

// Apply the loads of the curve to the test bench, and record its strain at the readings of the curve.
static int follow(kn_bench *b, const kn_curve *c, double *strain)
{
    int next = 0, code = KN_EXIT_OK;
    kn_bench_fresh(b);
    kn_bench_bar(b, c->time_s[c->count - 1]);
    for (int i = 0; i < c->count && code == KN_EXIT_OK; i++) {
        // Apply all changes of load before this reading, each at its own time.
        for (; next < c->steps && c->step[next].time_s < c->time_s[i] && code == KN_EXIT_OK; next++) {
            if (c->step[next].time_s > b->time_s) code = kn_bench_advance(b, c->step[next].time_s);
            if (code == KN_EXIT_OK) code = kn_bench_load(b, c->step[next].stress_pa * KN_BENCH_AREA_M2);
        }
        if (code == KN_EXIT_OK && c->time_s[i] > b->time_s) code = kn_bench_advance(b, c->time_s[i]);
        strain[i] = b->strain;
    }
    kn_bench_bar_end(b);
    return code;
}

double kn_recreep_largest(const kn_curve *c)
{
    double most = 0;
    for (int i = 0; i < c->count; i++) most = fmax(most, c->value[i]);
    return most;
}

// Return the root mean square difference of two strains, as a share of the largest measured strain.
static double apart(const double *a, const double *b, const kn_curve *c)
{
    double sum = 0;
    for (int i = 0; i < c->count; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / c->count) / kn_recreep_largest(c);
}

static int run(kn_recreep *back, kn_recreep_way way, const char *subcommand, const char *scene, const kn_curve *c)
{
    static const char *gas[] = {"object.pressure=cells"};
    // The test bench treats a lattice of 0 cells as one element.
    const int n = way == KN_RECREEP_ELEMENT ? 0 : KN_RECREEP_CELLS;
    kn_bench_options opt = {.subcommand = subcommand,
                            .specimen = scene,
                            .constant_area = c->constant_area,
                            .sets = gas,
                            .set_count = way == KN_RECREEP_GAS,
                            .lattice = {n, n, n}};
    kn_bench b;
    int code = kn_bench_open(&b, &opt);
    if (code == KN_EXIT_OK) code = follow(&b, c, back->strain[way]);
    kn_bench_close(&b);
    back->from_data[way] = apart(c->value, back->strain[way], c);
    back->from_element[way] = apart(back->strain[KN_RECREEP_ELEMENT], back->strain[way], c);
    return code;
}

int kn_recreep_run(kn_recreep *back, const char *subcommand, const char *scene, const kn_curve *c)
{
    int code = KN_EXIT_OK;
    *back = (kn_recreep){.strain = {calloc(KN_RECREEP_WAYS * (size_t)c->count, sizeof(double))}};
    if (!back->strain[0]) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    for (int way = 1; way < KN_RECREEP_WAYS; way++) back->strain[way] = back->strain[way - 1] + c->count;
    for (int way = 0; way < KN_RECREEP_WAYS && code == KN_EXIT_OK; way++)
        code = run(back, (kn_recreep_way)way, subcommand, scene, c);
    return code;
}

void kn_recreep_free(kn_recreep *back)
{
    free(back->strain[0]);
    *back = (kn_recreep){.strain = {NULL}};
}
