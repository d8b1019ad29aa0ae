#include "clients/identify/loop.h"
#include "clients/identify/joint.h"
#include "clients/knead/bench.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdlib.h>

// Loads the bench as the curve says and reads it at the curve's readings.
static int follow(kn_bench *b, const kn_curve *c, double *strain)
{
    int next = 0, code = KN_EXIT_OK;
    kn_bench_fresh(b);
    kn_bench_bar(b, c->time_s[c->count - 1]);
    for (int i = 0; i < c->count && code == KN_EXIT_OK; i++) {
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

static double apart(const double *a, const double *b, const kn_curve *c)
{
    double sum = 0, most = 0;
    for (int i = 0; i < c->count; i++) {
        sum += (a[i] - b[i]) * (a[i] - b[i]);
        most = fmax(most, c->value[i]);
    }
    return sqrt(sum / c->count) / most;
}

int kn_loop_creep(kn_loop *loop, const char *subcommand, const char *scene, const kn_curve *c)
{
    kn_bench_options opt = {.subcommand = subcommand,
                            .specimen = scene,
                            .constant_area = c->constant_area,
                            .lattice = {KN_LOOP_CELLS, KN_LOOP_CELLS, KN_LOOP_CELLS}};
    kn_bench b;
    *loop = (kn_loop){.element = calloc(2 * (size_t)c->count, sizeof *loop->element)};
    if (!loop->element) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    loop->lattice = loop->element + c->count;
    int code = kn_bench_open(&b, &opt);
    kn_model *model = code == KN_EXIT_OK ? b.model : NULL;
    b.model = NULL;
    if (code == KN_EXIT_OK) code = follow(&b, c, loop->element);
    b.model = model;
    if (code == KN_EXIT_OK) code = follow(&b, c, loop->lattice);
    kn_bench_close(&b);
    loop->data_element = apart(c->value, loop->element, c);
    loop->data_lattice = apart(c->value, loop->lattice, c);
    loop->element_lattice = apart(loop->element, loop->lattice, c);
    return code;
}

void kn_loop_free(kn_loop *loop)
{
    free(loop->element);
    *loop = (kn_loop){.element = NULL};
}
