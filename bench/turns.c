#include "bench/throughput.h"
#include "bench/bench.h"
#include "core/algebra/algebra.h"
#include "tests/physics/press.h"

enum { TURN = 20 };

static void turn(runner *r, int from, int to)
{
    for (int tick = from; tick < to; tick++) {
        double us = r->step(r->self, tick, &r->iterations[tick]);
        if (us < r->us[tick]) r->us[tick] = us;
    }
}

void turns_run(runner *runners, int count, int ticks, int rounds)
{
    for (int i = 0; i < count; i++) {
        runners[i].us = malloc((size_t)ticks * sizeof(double));
        runners[i].iterations = calloc((size_t)ticks, sizeof(int));
        if (!runners[i].us || !runners[i].iterations) abort();
        for (int tick = 0; tick < ticks; tick++) runners[i].us[tick] = INFINITY;
    }
    for (int round = 0; round < rounds; round++) {
        for (int i = 0; i < count; i++) runners[i].rewind(runners[i].self);
        for (int from = 0, to; from < ticks; from = to) {
            to = from == 0 ? TURN * (round + 1) / rounds : from + TURN;
            to = to > ticks ? ticks : to;
            for (int i = 0; i < count; i++) turn(&runners[i], from, to);
        }
    }
}

static int ascending_int(const void *a, const void *b)
{
    int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

summary turns_summary(const runner *r, int ticks)
{
    double *us = malloc((size_t)ticks * sizeof *us);
    int *iterations = malloc((size_t)ticks * sizeof *iterations);
    if (!us || !iterations) abort();
    memcpy(us, r->us, (size_t)ticks * sizeof *us);
    memcpy(iterations, r->iterations, (size_t)ticks * sizeof *iterations);
    qsort(us, (size_t)ticks, sizeof *us, kn_ascending);
    qsort(iterations, (size_t)ticks, sizeof *iterations, ascending_int);
    summary s = {.median_us = us[ticks / 2], .p90_us = us[ticks * 9 / 10], .median_iterations = iterations[ticks / 2]};
    for (int i = 0; i < ticks; i++) {
        s.mean_us += us[i] / ticks;
        s.mean_iterations += (double)iterations[i] / ticks;
    }
    free(us);
    free(iterations);
    return s;
}

void turns_free(runner *runners, int count)
{
    for (int i = 0; i < count; i++) {
        free(runners[i].us);
        free(runners[i].iterations);
    }
}

// --- runner of knead's step

typedef struct subject {
    kn_model *model;
    kn_state *state, *start;
    kn_scratch *scratch;
    hand_fn *hand;
    int from;
} subject;

static void subject_rewind(void *self)
{
    subject *s = self;
    kn_state_copy(s->model, s->state, s->start);
}

static double subject_step(void *self, int tick, int *iterations)
{
    subject *s = self;
    kn_input in = s->hand(s->model, (s->from + tick + 1) * s->model->def.solver.dt_s);
    kn_output out;
    double before = thread_us();
    kn_status status = kn_step(s->model, s->state, s->scratch, &in, &out);
    double us = thread_us() - before;
    if (status != KN_OK) {
        fprintf(stderr, "bench: a step of %d nodes, tick %d: %s\n", s->model->node_count, s->from + tick,
                kn_status_text(status));
        exit(1);
    }
    *iterations = out.iterations;
    return us;
}

runner turns_knead(const kn_model_def *def, hand_fn *hand, const kn_state *start, int from)
{
    subject *s = malloc(sizeof *s);
    if (!s) abort();
    *s = (subject){.model = build(def), .hand = hand, .from = from};
    s->state = kn_state_create(s->model);
    s->start = kn_state_create(s->model);
    s->scratch = kn_scratch_create(s->model);
    if (!s->state || !s->start || !s->scratch) abort();
    if (start) kn_state_copy(s->model, s->start, start);
    return (runner){.self = s, .rewind = subject_rewind, .step = subject_step};
}

const kn_model *turns_model(const runner *r) { return ((const subject *)r->self)->model; }

void turns_team(runner *r, kn_team *team)
{
    subject *s = r->self;
    kn_scratch_team(s->model, s->scratch, team);
}

void turns_destroy(runner *r)
{
    subject *s = r->self;
    kn_state_destroy(s->start);
    kn_state_destroy(s->state);
    kn_scratch_destroy(s->scratch);
    kn_model_destroy(s->model);
    free(s);
}

kn_state *turns_warm(const kn_model_def *def, hand_fn *hand, int ticks)
{
    runner r = turns_knead(def, hand, NULL, 0);
    subject *s = r.self;
    int iterations;
    for (int tick = 0; tick < ticks; tick++) subject_step(s, tick, &iterations);
    kn_state *state = s->state;
    s->state = NULL;
    turns_destroy(&r);
    return state;
}

kn_model_def turns_fixed(kn_model_def def, int iterations)
{
    def.solver.iterations = def.solver.iterations_max = iterations;
    def.solver.tolerance = 0;
    return def;
}
