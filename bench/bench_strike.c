// Strokes and stirring with every tool of every shipped scene, through the servo's own tick. The bench shows whether
// any tick takes longer than 1 ms. It also shows the error of the force that is caused by the deadline, which ends
// ticks in time.
//
//     bench_strike [--units N] [SCENE...]
//
// Without SCENE, the bench runs all core/scenes/*.yaml, and dough.yaml with a spacing of 2.5 mm. --units sets the
// deadline to N units of the solver's work; 0 means no deadline. Without --units, the deadline is computed as in
// kneadd.
//
// A stroke goes 8 mm into the object and out again at one speed, without a pause. Stirring is a circle of 5 mm radius
// at a depth of 5 mm. A blow of a rigid plate would trip the impulse guard, so the limit of the guard is set to its
// maximum. The time of a tick is the processor time of this thread, the smallest of three rounds with identical states.
//
// Errors are relative to the largest force of the stroke. A capped tick is one that ended above the solver's tolerance.
// Its force is compared with that of the same step from the same state, solved by 12 linearisations of 300 iterations.
// The reference for a whole stroke is this stroke with every step solved in that way. A jump is the change of the force
// in 1 ms, minus the largest change of the reference force within two ticks. The stirring of a rigid plate gets no
// error of the whole stroke and no jump, because both depend on which node lets go first. The exit code is 1 if a tick
// takes more than 1 ms or a force is not finite.
#include "bench/bench.h"
#include "core/solve/step_effort.h"
#include "server/clock.h"
#include "server/served_object.h"
#include <glob.h>
#include <math.h>
#include <string.h>

#define DEPTH_M 8e-3
#define STIR_M 5e-3 // depth of the stirring, and radius of its circle, m
#define AIR_M 2e-3
#define ROUNDS 3
// WARM: number of ticks that the tool spends in the air before a stroke. In this time the tool engages and its gain
// rises to 1.
enum { WARM = 450, TICKS = 2500 };

static const struct stroke {
    const char *name;
    double speed_m_s, hz;
} strokes[] = {{"1 cm/s", 0.01, 0}, {"2 cm/s", 0.02, 0}, {"5 cm/s", 0.05, 0},    {"10 cm/s", 0.1, 0},
               {"20 cm/s", 0.2, 0}, {"30 cm/s", 0.3, 0}, {"stir 2 Hz", 0.05, 2}, {"stir 5 Hz", 0.05, 5}};
enum { STROKES = sizeof strokes / sizeof *strokes };

typedef struct track { // ticks of one stroke
    int ticks;
    double force_n[TICKS][3], us[TICKS];
    double off_n[TICKS]; // error of the force, N; computed for capped ticks only
    bool capped[TICKS];  // true: the tick ended with a residual above the solver's tolerance
} track;

typedef struct tally { // results of one tool over all its strokes
    int ticks, over, capped;
    double worst_us, off, off_capped, jump_n;
    const char *off_by;
} tally;

// State and input with which the last step began. If this step is capped, the reference solver repeats it from this
// state.
static struct last {
    const kn_model *model;
    const kn_backend *backend, *reference;
    void (*submit)(void *self, const kn_input *input);
    kn_state *from;
    kn_input input;
} last;

static void keep_and_submit(void *self, const kn_input *input)
{
    kn_state_copy(last.model, last.from, last.backend->state(self));
    last.input = *input;
    last.submit(self, input);
}

static double apart(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static double off_n(int probe, const double force_n[3])
{
    kn_output output;
    last.input.deadline = 0;
    last.input.effort = (kn_effort){0};
    last.reference->restore(last.reference->self, last.from);
    last.reference->submit(last.reference->self, &last.input);
    last.reference->wait(last.reference->self, 0, &output);
    return apart(output.probe[probe].force_n, force_n);
}

static double touch_height(const kn_served_object *on, int p)
{
    double low = 0, high = 0.3, at[3] = {0};
    for (int i = 0; i < 50; i++) {
        at[2] = 0.5 * (low + high);
        bool clear = kn_clearance(on->model, on->backend.state(on->backend.self), p, at, (double[]){1, 0, 0, 0}) > 0;
        *(clear ? &high : &low) = at[2];
    }
    return high;
}

// Set position and velocity of the tool. t: time since the beginning of the stroke, s. Return false after the end of
// the stroke.
static bool move(const struct stroke *s, double touch_m, double t, kn_pose *pose)
{
    const double depth_m = s->hz > 0 ? STIR_M : DEPTH_M, in_s = (AIR_M + depth_m) / s->speed_m_s, stir_s = s->hz > 0;
    const double w = 2 * 3.14159265358979 * s->hz, a = w * (t - in_s);
    double *x = pose->position_m, *v = pose->velocity_m_s;
    memset(x, 0, sizeof pose->position_m), memset(v, 0, sizeof pose->velocity_m_s);
    x[2] = touch_m + AIR_M;
    if (t > 0 && t <= in_s) v[2] = -s->speed_m_s, x[2] += t * v[2];
    if (t > in_s) x[2] = touch_m - depth_m;
    if (t > in_s && t <= in_s + stir_s) {
        x[0] = STIR_M * (1 - cos(a)), x[1] = STIR_M * sin(a);
        v[0] = STIR_M * w * sin(a), v[1] = STIR_M * w * cos(a);
    }
    if (t > in_s + stir_s) v[2] = s->speed_m_s, x[2] += (t - in_s - stir_s) * v[2];
    return t <= 2 * in_s + stir_s + 0.1;
}

// Play one stroke and write its ticks to `to`. If `reference` is NULL, measure the time of each tick. Otherwise measure
// no times, but compute the error of the force of each tick that ended above the solver's tolerance, with `reference`
// as the exact solver.
static void run(kn_served_object *on, kn_served_object *reference, const struct stroke *s, int probe, int64_t deadline,
                track *to)
{
    static kn_servo servo;
    static kn_tick_out out;
    kn_pose pose = {.session = 1, .orientation_wxyz = {1}};
    kn_tick_in in = {.tick = -1};
    kn_backend backend = on->backend;
    backend.reset(backend.self);
    if (reference) {
        last = (struct last){.model = on->model,
                             .backend = &on->backend,
                             .reference = &reference->backend,
                             .submit = backend.submit,
                             .from = kn_state_create(on->model)};
        backend.submit = keep_and_submit;
    }
    kn_servo_init(&servo, on->scene, on->model, &backend);
    servo.deadline = deadline;
    const double touch_m = touch_height(on, probe);
    for (to->ticks = 0; to->ticks < TICKS;) {
        in.tick++;
        if (!move(s, touch_m, 1e-3 * (double)(in.tick - WARM), &pose)) break;
        pose.seq++;
        in.pose[probe] = &pose, in.fresh[probe] = true;
        double from_us = thread_us();
        kn_servo_tick(&servo, &in, &out);
        double us = thread_us() - from_us;
        if (in.tick < WARM) continue;
        int n = to->ticks++;
        if (!reference)
            // With a reference, every tick also copies the state. So measure times only without a reference.
            to->us[n] = to->us[n] > 0 ? fmin(us, to->us[n]) : us;
        to->capped[n] = out.capped;
        memcpy(to->force_n[n], out.force[probe].contact_force_n, sizeof to->force_n[n]);
        if (reference && out.capped) to->off_n[n] = off_n(probe, to->force_n[n]);
        if (!isfinite(apart(to->force_n[n], (double[3]){0}) + to->off_n[n]))
            fprintf(stderr, "bench_strike: %s: the force is not finite\n", s->name), exit(1);
    }
    if (reference) kn_state_destroy(last.from);
}

// Add a stroke to the results of a tool. follows: true if the forces of all ticks can be compared with those of the
// reference stroke `exact`. If not, only the capped ticks get an error.
static void add(tally *sum, const struct stroke *s, const track *t, const track *exact, bool follows)
{
    static const double none[3] = {0};
    double peak_n = 0;
    for (int i = 0; i < t->ticks; i++) peak_n = fmax(peak_n, apart(exact->force_n[i], none));
    for (int i = 1; i < t->ticks; i++) {
        double off = apart(t->force_n[i], exact->force_n[i]) / peak_n, step_n = 0;
        for (int k = i > 2 ? i - 2 : 1; k <= i + 2 && k < t->ticks; k++)
            step_n = fmax(step_n, apart(exact->force_n[k], exact->force_n[k - 1]));
        if (t->off_n[i] > sum->off_capped * peak_n) sum->off_capped = t->off_n[i] / peak_n, sum->off_by = s->name;
        if (follows) sum->off = fmax(sum->off, off);
        if (follows) sum->jump_n = fmax(sum->jump_n, apart(t->force_n[i], t->force_n[i - 1]) - step_n);
        sum->capped += t->capped[i];
        sum->over += t->us[i] > 1000;
        sum->worst_us = fmax(sum->worst_us, t->us[i]);
        sum->ticks++;
    }
}

static void load(kn_served_object *on, const char *path, const char *const *sets, int count)
{
    char error[400];
    int code = kn_served_object_load(on, &(kn_served_object_def){.scene_path = path, .sets = sets, .set_count = count},
                                     error, sizeof error);
    if (code) fprintf(stderr, "bench_strike: %s\n", error), exit(code);
}

// Play all strokes of every tool in a scene, and print one row per tool. Return the number of ticks that took longer
// than 1 ms. If `finer` is true, use a spacing of 2.5 mm and run no reference model. units: deadline of a step, in
// units of the solver's work; 0: no deadline; -1: the deadline that kneadd would use.
static int strike(const char *path, bool finer, int64_t units)
{
    static track t, exact;
    kn_served_object on, reference;
    load(&on, path, (const char *const[]){"device.guard=100 N/ms", "object.spacing=2.5mm"}, finer ? 2 : 1);
    load(&reference, path,
         (const char *const[]){"device.guard=100 N/ms", "solver.iterations_max=300", "solver.tolerance=1e-5",
                               "solver.passes=12"},
         4);
    const int64_t deadline =
        units < 0 ? kn_served_object_deadline(&on.backend, NULL, on.model, on.scene->budget_s) : units;
    int over = 0;
    for (int p = 0; p < on.model->def.probe_count; p++) {
        const bool rigid = on.model->def.probe[p].shape == KN_PROBE_PLATE;
        tally sum = {.off_by = ""};
        for (int k = 0; k < STROKES; k++) {
            memset(&t, 0, sizeof t);
            if (!finer) run(&reference, NULL, &strokes[k], p, 0, &exact);
            for (int r = 0; r < ROUNDS + !finer; r++)
                run(&on, r == 0 && !finer ? &reference : NULL, &strokes[k], p, deadline, &t);
            add(&sum, &strokes[k], &t, finer ? &t : &exact, !finer && (strokes[k].hz == 0 || !rigid));
        }
        printf("| %-13.*s | %-9s | %6d | %4.0f | %5d | %4d | %4.0f |", (int)strcspn(on.scene->name, "."),
               on.scene->name, on.model->def.probe[p].name, on.model->node_count, 1e-3 * (double)deadline, sum.ticks,
               sum.over, sum.worst_us);
        if (!finer)
            printf(" %5d | %6.2f %s | %6.2f | %5.2f |\n", sum.capped, 100 * sum.off_capped, sum.off_by, 100 * sum.off,
                   sum.jump_n);
        else printf(" %5d | | | |\n", sum.capped);
        fflush(stdout);
        over += sum.over;
    }
    kn_served_object_free(&reference);
    kn_served_object_free(&on);
    return over;
}

int main(int argc, char **argv)
{
    glob_t found;
    glob(KN_SOURCE_DIR "/core/scenes/*.yaml", 0, NULL, &found);
    const bool given = argc > 1 && !strcmp(argv[1], "--units"), all = argc == 1 + 2 * given;
    char *end = "x";
    const int64_t units = argc > 2 && given ? strtoll(argv[2], &end, 10) : -1;
    if (given && (*end || units < 0))
        return fprintf(stderr, "bench_strike: --units: expected a whole number; 0 means no deadline\n"), 2;
    char **scene = all ? found.gl_pathv : argv + 1 + 2 * given;
    int over = 0, count = all ? (int)found.gl_pathc : argc - 1 - 2 * given;
    print_machine();
    printf("\n| scene         | tool      |  nodes | k units | ticks | above 1 ms | worst us | capped "
           "| error of capped ticks, %% of the peak | of all ticks | jump N |\n"
           "|---|---|--:|--:|--:|--:|--:|--:|---|--:|--:|\n");
    for (int i = 0; i < count; i++) over += strike(scene[i], false, units);
    if (all) over += strike(KN_SOURCE_DIR "/core/scenes/dough.yaml", true, units);
    globfree(&found);
    return over > 0;
}
