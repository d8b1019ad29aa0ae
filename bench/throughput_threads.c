// Table of steps with one thread and with two, and of the error that a deadline causes. The second thread is awake all
// the time here, so the table does not show how long it takes to wake.
#include "bench/throughput.h"
#include "core/algebra/algebra.h"
#include "server/team.h"
#include "tests/physics/press.h"

static int64_t deadline; // units of work, 0: none

static kn_input hand(const kn_model *model, double t_s)
{
    kn_input in = press_hand(model, t_s);
    in.deadline = deadline;
    return in;
}

typedef struct pressed { // the whole press
    double force_n[PRESS_TICKS][3];
    int capped;
    double units_per_us; // while the plate goes down, if the times of the ticks are given
} pressed;

static void press_all(const kn_model_def *def, kn_team *team, const double *us, pressed *p)
{
    kn_model *m = build(def);
    kn_state *state = kn_state_create(m);
    kn_scratch *scratch = kn_scratch_create(m);
    double units = 0, sum_us = 0;
    if (!state || !scratch) abort();
    kn_scratch_team(m, scratch, team);
    p->capped = 0;
    for (int i = 0; i < PRESS_TICKS; i++) {
        const kn_input in = hand(m, (i + 1) * def->solver.dt_s);
        kn_output out;
        if (kn_step(m, state, scratch, &in, &out) != KN_OK) abort();
        memcpy(p->force_n[i], out.probe[0].force_n, sizeof p->force_n[i]);
        p->capped += out.capped;
        if (us && i < PRESS_MIDDLE) units += (double)out.units, sum_us += us[i];
    }
    p->units_per_us = us ? units / sum_us : 0;
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
    kn_model_destroy(m);
}

// Print a row: steps with these threads and, if not 0, a deadline of this many us. Return the units of work per us.
static double row(const kn_model_def *def, kn_team *team, double most_us, double units_per_us, const pressed *exact,
                  const throughput_options *o)
{
    static pressed p;
    char object[48];
    deadline = (int64_t)(most_us * units_per_us);
    runner r = turns_knead(def, hand, NULL, 0);
    turns_team(&r, team);
    turns_run(&r, 1, PRESS_TICKS, o->quick ? 1 : 3);
    press_all(def, team, r.us, &p);
    qsort(r.us, PRESS_TICKS, sizeof *r.us, kn_ascending);
    const double force = 100 * relative_error((const double(*)[3])p.force_n, exact->force_n, PRESS_TICKS);
    snprintf(object, sizeof object, "%d%s", def->nodes[0] * def->nodes[1] * def->nodes[2],
             def->pressure == KN_PRESSURE_NONE ? "" : " gas");
    printf("| %-9s | %7d | %8.2f | %6.0f | %6.0f | %6.0f | %6d | %8.3f |\n", object, team ? 2 : 1, 1e-3 * most_us,
           r.us[PRESS_TICKS / 2], r.us[PRESS_TICKS * 9 / 10], r.us[PRESS_TICKS * 99 / 100], p.capped, force);
    turns_free(&r, 1);
    turns_destroy(&r);
    return p.units_per_us;
}

void table_threads(const throughput_options *o)
{
    static const int cells[4][3] = {{10, 10, 6}, {15, 15, 9}, {20, 20, 12}, {28, 28, 19}};
    static pressed exact;
    char why[64] = "";
    kn_helper *helper = kn_helper_create(why, sizeof why);
    kn_team *team = kn_helper_wake(helper);
    kn_rt_move(KN_RT_CPU_SERVO);
    puts("\nSteps with one thread and with two, us, over the whole press. deadline: limit of a step's work, told as "
         "the time\n"
         "that this work takes with these threads, ms; kneadd sets 0.56 ms; 0: none. capped: ticks that ended before "
         "the\n"
         "tolerance was met. force: relative L2 error beside linear systems that are solved in f64 to a millionth.\n");
    if (!helper) printf("No second thread: %s.\n\n", why);
    puts("| nodes     | threads | deadline | median |    p90 |    p99 | capped |  force % |\n"
         "|----------:|--------:|---------:|-------:|-------:|-------:|-------:|---------:|");
    for (int i = 0; i < 8; i++) {
        kn_model_def def = press_def(2), solved;
        for (int k = 0; k < 3; k++) def.nodes[k] = cells[i / 2][k] + 1;
        def.spacing_m = 0.05 / cells[i / 2][0];
        if (def.nodes[0] * def.nodes[1] * def.nodes[2] > o->nodes_max) break;
        if (i % 2) def.pressure = KN_PRESSURE_CELLS;
        solved = def;
        solved.solver.precision = KN_PRECISION_F64, solved.solver.tolerance = 1e-6, solved.solver.iterations_max = 1000;
        deadline = 0;
        press_all(&solved, team, NULL, &exact);
        double rate = row(&def, NULL, 0, 0, &exact, o);
        if (helper) rate = row(&def, team, 0, 0, &exact, o);
        row(&def, team, 560, rate, &exact, o);
        row(&def, team, 900, rate, &exact, o);
    }
    kn_rt_move(KN_RT_CPU_ANY);
    kn_helper_rest(helper);
    kn_helper_destroy(helper);
}
