// Table of steps with one thread and with two, and of what kneadd's deadline cuts off. Here, the second thread spins
// all the time, so nothing shows of the time in which it wakes.
#include "bench/throughput.h"
#include "server/team.h"
#include "tests/physics/press.h"

static kn_team *team;
static int64_t deadline; // units of work

static kn_input hand_in_time(const kn_model *model, double t_s)
{
    kn_input in = press_hand(model, t_s);
    in.deadline = deadline;
    return in;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

static double percentile(const runner *r, int percent)
{
    static double us[PRESS_TICKS];
    memcpy(us, r->us, sizeof us);
    qsort(us, PRESS_TICKS, sizeof *us, ascending);
    return us[PRESS_TICKS * percent / 100];
}

// Store the force of the whole press, and return how many ticks were capped. With `exact`, the linear systems of the
// step are solved in f64 to a millionth.
static int press_force(kn_model_def def, hand_fn *hand, bool exact, double force_n[PRESS_TICKS])
{
    if (exact) def.solver.precision = KN_PRECISION_F64, def.solver.tolerance = 1e-6, def.solver.iterations_max = 1000;
    kn_model *m = build(&def);
    kn_state *state = kn_state_create(m);
    kn_scratch *scratch = kn_scratch_create(m);
    int capped = 0;
    if (!state || !scratch) abort();
    kn_scratch_team(m, scratch, team);
    for (int i = 0; i < PRESS_TICKS; i++) {
        const kn_input in = hand(m, (i + 1) * def.solver.dt_s);
        kn_output out;
        if (kn_step(m, state, scratch, &in, &out) != KN_OK) abort();
        force_n[i] = out.probe[0].force_n[2];
        capped += out.capped;
    }
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
    kn_model_destroy(m);
    return capped;
}

// Return the largest difference of two forces, in per cent of the largest force.
static double worst(const double a[PRESS_TICKS], const double exact[PRESS_TICKS])
{
    double most = 0, peak = 0;
    for (int i = 0; i < PRESS_TICKS; i++) most = fmax(most, fabs(a[i] - exact[i])), peak = fmax(peak, fabs(exact[i]));
    return 100 * most / peak;
}

// Set the deadline to what two threads do in the share of the time budget that kneadd gives a step (server/servo.h).
static void price(const runner *two)
{
    double us = 0;
    int64_t units = 0;
    kn_state *state = kn_state_create(turns_model(two));
    kn_scratch *scratch = kn_scratch_create(turns_model(two));
    kn_output out;
    for (int i = 0; i < PRESS_MIDDLE; i++) {
        const kn_input in = press_hand(turns_model(two), (i + 1) * 1e-3);
        kn_step(turns_model(two), state, scratch, &in, &out);
        us += two->us[i], units += out.units;
    }
    deadline = (int64_t)(560 * (double)units / us);
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
}

static void row(kn_model_def def, const throughput_options *o)
{
    static double exact[PRESS_TICKS], own[PRESS_TICKS], in_time[PRESS_TICKS];
    char object[32];
    snprintf(object, sizeof object, "%d%s", def.nodes[0] * def.nodes[1] * def.nodes[2],
             def.pressure == KN_PRESSURE_NONE ? "" : " gas");
    runner r[3] = {turns_knead(&def, press_hand, NULL, 0), turns_knead(&def, press_hand, NULL, 0)};
    turns_team(&r[1], team);
    turns_run(r, 2, PRESS_TICKS, o->quick ? 1 : 3);
    price(&r[1]);
    r[2] = turns_knead(&def, hand_in_time, NULL, 0);
    turns_team(&r[2], team);
    turns_run(r + 2, 1, PRESS_TICKS, o->quick ? 1 : 3);
    const int capped = press_force(def, press_hand, false, own), cut = press_force(def, hand_in_time, false, in_time);
    press_force(def, press_hand, true, exact);
    printf("| %-9s |", object);
    for (int i = 0; i < 3; i++)
        printf(" %6.0f %6.0f %6.0f |", percentile(&r[i], 50), percentile(&r[i], 90), percentile(&r[i], 99));
    printf(" %5.2f | %3d %6.3f | %3d %6.3f |\n", percentile(&r[0], 50) / percentile(&r[1], 50), capped,
           worst(own, exact), cut, worst(in_time, exact));
    for (int i = 0; i < 3; i++) {
        static const char *const kernel[3] = {"one", "two", "two in time"};
        note("threads", object, kernel[i], "median_us", percentile(&r[i], 50));
        note("threads", object, kernel[i], "p90_us", percentile(&r[i], 90));
        note("threads", object, kernel[i], "p99_us", percentile(&r[i], 99));
    }
    turns_free(r, 3);
    for (int i = 0; i < 3; i++) turns_destroy(&r[i]);
}

void table_threads(const throughput_options *o)
{
    static const int cells[4][3] = {{10, 10, 6}, {15, 15, 9}, {20, 20, 12}, {28, 28, 19}};
    char why[64];
    kn_helper *helper = kn_helper_create(why, sizeof why);
    team = kn_helper_wake(helper);
    if (!helper) printf("\nNo second thread: %s.\n", why);
    else
        puts("\nTwo threads: us per step, at the median, the 90th and the 99th percentile of the whole press. In time: "
             "with\n"
             "a deadline of 0.56 ms, as kneadd sets it. Capped ticks, and the largest error of the force in % of its "
             "peak\n"
             "beside f64 solved to a millionth, without and with the deadline.\n\n"
             "| nodes     | one    p90    p99    | two    p90    p99    | two in time, p90, p99 | ratio | capped, % |"
             " in time, % |\n"
             "|----------:|---------------------:|---------------------:|---------------------:|------:|----------:|"
             "-----------:|");
    for (int i = 0; helper && i < 8; i++) {
        kn_model_def def = press_def(2);
        for (int k = 0; k < 3; k++) def.nodes[k] = cells[i / 2][k] + 1;
        def.spacing_m = 0.05 / cells[i / 2][0];
        if (def.nodes[0] * def.nodes[1] * def.nodes[2] > o->nodes_max) break;
        if (i % 2) def.pressure = KN_PRESSURE_CELLS;
        row(def, o);
    }
    kn_helper_rest(helper);
    kn_helper_destroy(helper);
}
