#include "clients/identify/press_fit.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/output.h"
#include "clients/hand/tool_height.h"
#include "clients/identify/profile_interval.h"
#include "core/hash.h"
#include "core/step.h"
#include "server/clock.h"
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// ---- one press of the lattice

enum { COMPLIANCE = KN_ESTIMATE_NUMBERS, TOUCH }; // indices of the unknowns; TOUCH + k: place of touch of press k

#define STEPS 3000    // of a press in the search; more if they would be longer than LONGEST
#define LONGEST 0.008 // s, of such a step: a ball's contact needs many iterations in longer ones

typedef struct path { // of a tool: its depth in the object
    const kn_curve *curve;
    double touch_m, compliance_m_n;
    double speed_m_s; // of the stage before the first reading
} path;

// Return the depth of the tool at a reading. With a plate, the frame gives way to the measured force. The force is
// averaged over neighbours, since its noise times the compliance would shake the tool. Other tools hang on a spring
// (make_model).
static double depth_at(const path *p, int reading)
{
    const kn_curve *c = p->curve;
    const int ends = reading < c->count - 1 - reading ? reading : c->count - 1 - reading, reach = ends < 3 ? ends : 3;
    double sum = 0, all = 0;
    for (int i = -reach; i <= reach && p->compliance_m_n > 0; i++) {
        const int weight = reach + 1 - abs(i);
        sum += weight * c->value[reading + i], all += weight;
    }
    return c->other[reading] - p->touch_m - (all > 0 ? p->compliance_m_n * sum / all : 0);
}

// Return the speed of the stage over the first 2 % of its way.
static double first_speed(const kn_curve *c)
{
    double most = 0;
    int i = 1;
    for (int k = 0; k < c->count; k++) most = fmax(most, c->other[k] - c->other[0]);
    while (i < c->count - 1 && c->other[i] - c->other[0] < 0.02 * most) i++;
    return (c->other[i] - c->other[0]) / (c->time_s[i] - c->time_s[0]);
}

// Return the time at which the tool touches the object. It may be before the first reading.
static double touch_s(const path *p)
{
    const kn_curve *c = p->curve;
    double before = depth_at(p, 0);
    if (before >= 0) return c->time_s[0] - (p->speed_m_s > 0 ? before / p->speed_m_s : 0);
    for (int i = 1; i < c->count; i++) {
        const double now = depth_at(p, i);
        if (now >= 0) return c->time_s[i] - (c->time_s[i] - c->time_s[i - 1]) * now / (now - before);
        before = now;
    }
    return c->time_s[c->count - 1];
}

// Return the time step of a press.
static double step_s(const kn_press_fit *fit, const kn_curve *c, bool search)
{
    const double longer_s = fmin((c->time_s[c->count - 1] - c->time_s[0]) / STEPS, LONGEST);
    return search ? fmax(longer_s, fit->object->solver.dt_s) : fit->object->solver.dt_s;
}

// Make the model of a press. Its tool follows the stage, whatever coupling a hand would have: rigidly, or by a spring
// of the frame's compliance.
static kn_model *make_model(const kn_press_fit *fit, const kn_press_record *p, const kn_material *material,
                            double compliance_m_n, double dt_s)
{
    char error[256];
    kn_model_def def = *fit->object;
    def.material = *material;
    def.probe_count = 1;
    def.probe[0] = *p->tool;
    def.probe[0].coupling_n_m = def.probe[0].coupling_n_s_m = 0;
    if (kn_press_of_specimen(p)) {
        kn_served_lattice_shape(&p->specimen, &def);
        def.probe[0].size_m[0] = def.probe[0].size_m[1] = 1; // a laboratory's plate is wider than the specimen
    }
    if (p->tool->shape != KN_PROBE_PLATE && compliance_m_n > 1e-9) def.probe[0].coupling_n_m = 1 / compliance_m_n;
    if (dt_s > def.solver.dt_s) def.solver.iterations_max = 100; // longer steps need more iterations
    def.solver.dt_s = dt_s;
    return kn_model_build(&def, error, sizeof error);
}

typedef struct body { // what a tool presses: a lattice, or a block that stands for a specimen
    const kn_press_record *press;
    kn_model *model; // NULL: the block
    kn_state *state;
    kn_scratch *scratch;
    kn_affine_block block;
} body;

// Move the tool from one depth to another in a step, and compute its force.
static bool move(body *b, double from_m, double to_m, double dt_s, double *force_n)
{
    const kn_curve *c = b->press->curve;
    if (!b->model) {
        const double height = 1 - to_m / c->height_m;
        const kn_affine_block before = b->block;
        bool good = kn_affine_block_press(&b->block, dt_s, height);
        if (height > before.height && !(good && b->block.stress_pa > 0)) { // the plate leaves the specimen
            b->block = before;
            good = kn_affine_block_load(&b->block, dt_s, 0);
        }
        *force_n = b->block.stress_pa * c->area_m2;
        return good;
    }
    double extent_m[3];
    kn_output out;
    kn_model_def_extent(&b->model->def, extent_m);
    kn_input in = {.probe[0].attached = true};
    in.probe[0].position_m[2] = extent_m[2] + kn_tool_height_m(b->press->tool) - from_m;
    in.probe[0].velocity_m_s[2] = (from_m - to_m) / dt_s;
    const bool good = kn_step(b->model, b->state, b->scratch, &in, &out) == KN_OK;
    // whole cells seldom have the area of the specimen
    const double area = kn_press_of_specimen(b->press) ? c->area_m2 / (extent_m[0] * extent_m[1]) : 1;
    *force_n = area * out.probe[0].force_n[2];
    return good;
}

// Compute the force of a body at the readings of its press. The ticks begin at the touch, and the tool goes in a straight
// line from reading to reading. Return false if the body cannot follow.
static bool press(body *b, double touch, double compliance, double dt, double *force_n)
{
    const kn_curve *c = b->press->curve;
    const bool gives = b->press->tool->shape == KN_PROBE_PLATE && !kn_press_of_specimen(b->press);
    const path way = {c, touch, gives ? compliance : 0, first_speed(c)};
    const double begin = touch_s(&way);
    double before = 0, force = 0, low_s = begin, low_m = 0;
    int next = 0; // first reading whose force is not yet known
    bool good = true;
    while (next < c->count && c->time_s[next] <= begin) force_n[next++] = 0;
    // ahead: first reading that the tool has not passed
    for (int tick = 1, ahead = next; good && next < c->count; tick++) {
        const double end_s = begin + tick * dt, last = force;
        for (; ahead < c->count && c->time_s[ahead] < end_s; ahead++)
            low_s = c->time_s[ahead], low_m = depth_at(&way, ahead);
        double depth = low_m;
        if (ahead < c->count) depth += (depth_at(&way, ahead) - low_m) * (end_s - low_s) / (c->time_s[ahead] - low_s);
        good = move(b, before, depth, dt, &force);
        before = depth;
        for (; next < c->count && c->time_s[next] <= end_s; next++)
            force_n[next] = force - (force - last) * (end_s - c->time_s[next]) / dt;
    }
    return good;
}

// ---- presses at once, each in a thread

typedef struct job {
    const kn_press_fit *fit;
    const kn_press_record *press;
    const kn_material *material;
    double touch_m, compliance_m_n, *force_n;
    bool search, good;
} job;

static void *work(void *of)
{
    job *j = of;
    const kn_served_lattice *specimen = &j->press->specimen;
    const kn_curve *c = j->press->curve;
    const bool block = j->search && kn_press_of_specimen(j->press);
    if (c->kind == KN_CURVE_CREEP) {
        j->good = block ? kn_affine_block_creep(&specimen->structure, j->material, c, c->count, c->time_s, j->force_n)
                        : kn_served_lattice_creep(specimen, j->material, c, j->force_n);
        return NULL;
    }
    const double dt_s = step_s(j->fit, c, j->search);
    body b = {.press = j->press};
    if (block) kn_affine_block_init(&b.block, j->material, &specimen->structure);
    else b.model = make_model(j->fit, j->press, j->material, j->compliance_m_n, dt_s);
    b.state = b.model ? kn_state_create(b.model) : NULL;
    b.scratch = b.model ? kn_scratch_create(b.model) : NULL;
    j->good = (block || (b.state && b.scratch)) && press(&b, j->touch_m, j->compliance_m_n, dt_s, j->force_n);
    kn_state_destroy(b.state);
    kn_scratch_destroy(b.scratch);
    kn_model_destroy(b.model);
    return NULL;
}

static bool run_jobs(int count, job *all)
{
    pthread_t thread[KN_CURVES_MAX];
    int started = 0;
    bool good = true;
    while (started < count - 1 && pthread_create(&thread[started], NULL, work, &all[started]) == 0) started++;
    for (int i = started; i < count; i++) work(&all[i]);
    for (int i = 0; i < started; i++) pthread_join(thread[i], NULL);
    for (int i = 0; i < count; i++) good &= all[i].good;
    return good;
}

// ---- the fit

enum { TRIALS = 10000 };

typedef struct search {
    kn_press_fit *fit;
    int first, end; // presses that are compared: first..end-1
    bool keeps;     // the stages are over: keep the best values for an interrupted fit
    bool served;    // use the scene's own solver, not the longer steps of the search
    double *shift;  // of the readings of these presses: residuals with the scene's own solver minus those of the search
    int readings;   // of the fitted presses
    double least, kept_s; // least sum of squares so far; time when the file to resume was last written
    kn_progress bar;
    pthread_mutex_t lock; // of all above and below: misfit runs in several threads at once
    int tried; // what was tried since the shift: values of the material and the frame, and the sum of squares
    double trial[TRIALS][TOUCH], trial_sum[TRIALS];
} search;

// The model of the fitted presses, linearised about some values.
typedef struct straight {
    const search *s;
    const kn_fit_unknown *about;
    const double *at, *slope; // [readings] residuals, [unknowns][readings] slopes
    int without, only;        // press whose residuals do not count, or that alone counts; -1: none
} straight;

static double now_s(void) { return 1e-9 * (double)kn_now_ns(); }

// Keep the best values, so that an interrupted fit can go on.
static void keep(search *s, const double *value, double sum)
{
    kn_beside out;
    if (!(sum < s->least)) return;
    s->least = sum;
    if (!*s->fit->resume || now_s() < s->kept_s + 2) return;
    s->kept_s = now_s();
    FILE *f = kn_output_open(&out, s->fit->subcommand, s->fit->resume);
    if (!f) return;
    fprintf(f, KN_PRESS_FIT_MARK "%016" PRIx64 "\n", s->fit->inputs);
    for (int i = 0; i < TOUCH + s->fit->presses; i++) fprintf(f, "%.17g\n", value[i]);
    kn_output_close(&out, s->fit->subcommand);
}

// Read the values of an interrupted fit of the same inputs.
static bool resume(const kn_press_fit *fit, int unknowns, double value[KN_FIT_UNKNOWNS])
{
    uint64_t inputs;
    FILE *f = *fit->resume ? fopen(fit->resume, "r") : NULL;
    bool good = f && fscanf(f, KN_PRESS_FIT_MARK "%" SCNx64, &inputs) == 1 && inputs == fit->inputs;
    for (int i = 0; i < unknowns && good; i++) good = fscanf(f, "%lf", &value[i]) == 1 && isfinite(value[i]);
    if (f) fclose(f);
    return good;
}

// Compute the residuals of the presses first..end-1.
static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    search *s = of;
    const kn_press_fit *fit = s->fit;
    const kn_material material = kn_lattice_material(value, false);
    job jobs[KN_CURVES_MAX];
    const double *shift = s->shift;
    double *force = residual, sum = 0; // the forces become residuals where they are
    if (kn_interrupted) return false;
    for (int k = s->first; k < s->end; force += fit->press[k++].curve->count)
        jobs[k - s->first] =
            (job){fit, &fit->press[k], &material, value[TOUCH + k], value[COMPLIANCE], force, .search = !s->served};
    if (!run_jobs(s->end - s->first, jobs)) return false;
    for (int k = s->first; k < s->end; k++) {
        const kn_press_record *p = &fit->press[k];
        for (int i = 0; i < p->curve->count; i++, residual++) {
            *residual = (*residual - p->curve->value[i]) / p->sigma_n[i];
            if (!s->served) *residual += *shift++;
            sum += *residual * *residual;
        }
    }
    pthread_mutex_lock(&s->lock);
    s->bar.total = fmax(s->bar.total, ++s->fit->runs / 0.95);
    kn_progress_step(&s->bar, s->fit->runs);
    if (s->keeps && s->first == 0 && !s->served) keep(s, value, sum);
    if (s->first == 0 && !s->served && s->tried < TRIALS) {
        memcpy(s->trial[s->tried], value, sizeof s->trial[0]);
        s->trial_sum[s->tried++] = sum;
    }
    pthread_mutex_unlock(&s->lock);
    return !kn_interrupted;
}

// Compute the residuals of the fitted presses by the linearised model.
static bool misfit_straight(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const straight *l = of;
    const kn_fit_unknown *u = l->about;
    const kn_press_fit *fit = l->s->fit;
    for (int k = 0, i = 0; k < fit->fitted; k++) {
        const bool counts = k != l->without && (l->only < 0 || k == l->only);
        for (int n = 0; n < fit->press[k].curve->count; n++, i++) residual[i] = counts ? l->at[i] : 0;
        for (int j = 0; j < TOUCH + fit->presses && counts; j++) {
            const double way = kn_fit_inwards(&u[j], value[j]) - kn_fit_inwards(&u[j], u[j].value);
            for (int n = fit->press[k].curve->count; n > 0; n--)
                residual[i - n] += l->slope[j * l->s->readings + i - n] * way;
        }
    }
    return true;
}

// ---- the start

// Set sigma, leave out the pull that the tool cannot give, and guess the place of touch with its bounds.
static bool prepare(kn_press_record *p, kn_fit_unknown *touch)
{
    const kn_curve *c = p->curve;
    const double most = kn_curve_largest(c);
    const int peak = kn_curve_peak(c);
    p->lone = NAN;
    p->sigma_n = calloc(3 * (size_t)c->count, sizeof *p->sigma_n);
    if (!p->sigma_n) return false;
    p->model_n = p->sigma_n + c->count, p->band_n = p->model_n + c->count;
    // a range above 0 even if it is fixed, since a profile divides by it
    *touch = (kn_fit_unknown){.name = "touch", .unit = "m", .linear = true, .high = 1, .fixed = true};
    for (int i = 0; i < c->count; i++) {
        p->sigma_n[i] = hypot(c->noise / sqrt(c->weight[i]), 5e-3 * most);
        const bool pulls = p->tool->adhesion_pa > 0 && !kn_press_of_specimen(p); // the block cannot
        if (c->kind == KN_CURVE_CREEP || i <= peak || pulls || c->value[i] > -3 * c->noise) continue;
        p->sigma_n[i] = INFINITY;
        p->pull_n_s -= c->value[i] * (c->time_s[i] - c->time_s[i - 1]);
    }
    if (c->kind == KN_CURVE_CREEP) return true; // its plate lies on the specimen
    const int first = kn_curve_touch(c);
    const double range = c->other[peak] - c->other[first];
    touch->fixed = false;
    touch->low = c->other[first] - 0.3 * range, touch->high = c->other[first] + 0.3 * range;
    touch->value = first > 0 ? c->other[first] : c->other[first] - 0.01 * range;
    // If a plate meets a large force at once, it touches between two readings.
    if (first > 0 && p->tool->shape == KN_PROBE_PLATE && c->value[first] > 0.1 * most) {
        touch->low = c->other[first - 1], touch->high = c->other[first];
        touch->value = 0.5 * (touch->low + touch->high);
        p->sigma_n[first] = INFINITY;
    }
    // The path turns between two readings, and the force of a dashpot jumps there. So three readings are not compared.
    double deepest = -INFINITY;
    for (int i = 0; i < c->count; i++) deepest = fmax(deepest, c->other[i]);
    for (int i = 1; i < c->count; i++)
        if ((c->other[i] > deepest - 1e-3 * range) != (c->other[i - 1] > deepest - 1e-3 * range))
            for (int k = i - 1; k <= i + 1 && k < c->count; k++) p->sigma_n[k] = INFINITY;
    return true;
}

// Multiply all stresses of a material by `stress`, and all its times by `time`.
static kn_material scaled(kn_material m, double stress, double time)
{
    m.k1_pa *= stress, m.c1_pa_s *= stress * time, m.c2_pa_s *= stress * time, m.alpha_pa_s *= stress * time;
    m.beta_per_pa /= stress, m.p0_pa *= stress, m.p1_pa *= stress;
    return m;
}

// Compute the sums of residual^2, model^2 and model * measured for a material, in units of sigma.
static bool sums_at(search *s, const kn_fit *fit, const kn_material *m, double sum[3], double *residual)
{
    double value[KN_FIT_UNKNOWNS];
    static kn_fit at;
    at = *fit;
    kn_lattice_unknowns(&at, m, 0);
    at.unknowns = fit->unknowns;
    kn_fit_values(&at, value);
    sum[0] = sum[1] = sum[2] = 0;
    if (!misfit(s, value, residual)) return false;
    for (int k = 0; k < s->fit->fitted; k++) {
        const kn_press_record *p = &s->fit->press[k];
        for (int i = 0; i < p->curve->count; i++, residual++) {
            const double measured = p->curve->value[i] / p->sigma_n[i], model = measured + *residual;
            sum[0] += *residual * *residual;
            if (p->curve->kind == KN_CURVE_PRESS) sum[1] += model * model, sum[2] += model * measured;
        }
    }
    return isfinite(sum[0]);
}

// Find the scales of stress and time of a material that come nearest to the presses. For each scale of time, the scale
// of stress follows from the forces, in three rounds, since gas does not scale.
static bool find_start(search *s, const kn_fit *fit, kn_material *m)
{
    static const double times[] = {1, 0.1, 10, 0.01, 100};
    const kn_material from = *m;
    double least = INFINITY, sum[3], *residual = calloc((size_t)s->readings, sizeof *residual);
    for (size_t i = 0; i < sizeof times / sizeof *times && residual; i++) {
        double stress = 1;
        for (int round = 0; round < 3; round++) {
            const kn_material now = scaled(from, stress, times[i]);
            if (!sums_at(s, fit, &now, sum, residual)) break;
            if (sum[0] < least) least = sum[0], *m = now;
            if (!(sum[2] > 0)) break;
            stress = fmin(fmax(stress * sum[2] / sum[1], 1e-6), 1e6);
        }
    }
    free(residual);
    return isfinite(least);
}

// ---- intervals and bands

// Fit the linearised model without each replicate in turn. Set the covariance to that of the jackknife, if it is larger,
// and compute how well the press that was left out is predicted once its place of touch is fitted.
static void jackknife(const search *s, kn_fit *best, kn_fit *trial, const double *at, double *residual)
{
    straight model = {s, best->unknown, at, best->jacobian, .without = -1, .only = -1};
    static double moved[KN_CURVES_MAX][KN_FIT_UNKNOWNS], mean[KN_FIT_UNKNOWNS];
    const int count = s->fit->replicates, unknowns = best->unknowns;
    double value[KN_FIT_UNKNOWNS];
    memset(mean, 0, sizeof mean);
    memset(moved, 0, sizeof moved);
    for (int k = 0, from = 0; k < s->fit->fitted; from += s->fit->press[k++].curve->count) {
        kn_press_record *p = &s->fit->press[k];
        if (kn_press_of_specimen(p)) continue;
        *trial = *best;
        trial->misfit = misfit_straight, trial->of = &model;
        trial->jacobian = NULL, trial->coarse = trial->concurrent = false;
        trial->unknown[TOUCH + k].fixed = true;
        model.without = k, model.only = -1;
        const bool good = kn_lattice_fit(trial);
        for (int u = 0; u < unknowns; u++) {
            const kn_fit_unknown *is = &best->unknown[u];
            moved[k][u] = good ? kn_fit_inwards(is, trial->unknown[u].value) - kn_fit_inwards(is, is->value) : 0;
            mean[u] += moved[k][u] / count;
            trial->unknown[u].fixed = u != TOUCH + k;
        }
        model.without = -1, model.only = k;
        if (!good || !kn_fit_run(trial)) continue;
        double sum = 0;
        int all = 0;
        kn_fit_values(trial, value);
        misfit_straight(&model, value, residual);
        for (int n = 0; n < p->curve->count; n++)
            if (isfinite(p->sigma_n[n])) all++, sum += pow(residual[from + n] * p->sigma_n[n], 2);
        p->lone = sqrt(sum / all) / kn_curve_largest(p->curve);
    }
    for (int a = 0; a < unknowns; a++)
        for (int b = 0; b < unknowns; b++) {
            double spread = 0, *to = &best->covariance[a][b];
            const double noise = *to * best->scale * best->scale;
            for (int k = 0; k < s->fit->fitted; k++)
                if (!kn_press_of_specimen(&s->fit->press[k]))
                    spread += (count - 1.0) / count * (moved[k][a] - mean[a]) * (moved[k][b] - mean[b]);
            *to = a == b && !(spread > noise) ? noise
                                              : spread; // presses that happen to agree tell no more than their noise
        }
    best->scale = 1;
    best->freedom = count - 1;
}

// Widen the scale of the residuals if neighbours are alike, since these are not independent.
static double widened(const kn_fit *fit, const double *residual)
{
    double both = 0, all = 1e-300;
    for (int i = 0; i < fit->readings; i++) {
        if (i > 0) both += residual[i] * residual[i - 1];
        all += residual[i] * residual[i];
    }
    const double alike = fmin(fmax(both / all, 0), 0.98);
    return fit->scale * sqrt((1 + alike) / (1 - alike));
}

// Compute half of the 95 % band of each force of the presses first..end-1: what the covariance of the unknowns does to
// it, and the scatter of the residuals. slope: [unknowns][readings] of these presses.
static void make_bands(search *s, const kn_fit *best, double scatter, const double *slope, int readings)
{
    const double t = kn_fit_student(0.95, best->freedom);
    for (int k = s->first, i = 0; k < s->end; k++) {
        const kn_press_record *p = &s->fit->press[k];
        for (int n = 0; n < p->curve->count; n++, i++) {
            double sum = 0;
            for (int a = 0; a < best->unknowns; a++)
                for (int b = 0; b < best->unknowns; b++)
                    if (isfinite(best->covariance[a][a]) && isfinite(best->covariance[b][b]))
                        sum += slope[a * readings + i] * best->covariance[a][b] * slope[b * readings + i];
            const double sigma = isfinite(p->sigma_n[n]) ? p->sigma_n[n] : p->curve->noise;
            p->band_n[n] =
                fmin(sigma * (t * best->scale * sqrt(fmax(sum, 0)) + 2 * scatter), kn_curve_largest(p->curve));
        }
    }
}

// Press the lattices of the presses first..end-1 with the scene's own solver at these values, and shift the residuals of
// the search to these.
static bool shift_to_served(search *s, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    int readings = 0;
    for (int k = s->first; k < s->end; k++) readings += s->fit->press[k].curve->count;
    memset(s->shift, 0, (size_t)readings * sizeof *s->shift);
    bool good = misfit(s, value, residual);
    s->served = true;
    good = good && misfit(s, value, s->shift);
    s->served = false;
    double most = 0;
    for (int i = 0; i < readings; i++) {
        s->shift[i] -= residual[i];
        most = fmax(most, fabs(s->shift[i]));
    }
    if (most > 0) s->least = INFINITY, s->tried = 0; // sums from before are no longer comparable
    return good;
}

// Predict one press that is held out: fit its place of touch, and compute its band.
static bool predict(search *s, kn_fit *best, kn_fit *trial, double scatter, int press)
{
    const int readings = s->fit->press[press].curve->count, touch = TOUCH + press;
    double *slope = calloc((size_t)(best->unknowns + 2) * (size_t)readings, sizeof *slope);
    if (!slope) return false;
    s->first = press, s->end = press + 1;
    *trial = *best;
    trial->readings = readings, trial->jacobian = NULL;
    for (int u = 0; u < best->unknowns; u++) trial->unknown[u].fixed = u != touch;
    double value[KN_FIT_UNKNOWNS], *here = slope + best->unknowns * readings;
    s->shift = here + readings;
    kn_fit_values(best, value);
    bool good = shift_to_served(s, value, here) && kn_fit_run(trial);
    value[touch] = best->unknown[touch].value = trial->unknown[touch].value;
    good = good && misfit(s, value, here);
    for (int u = 0; u < TOUCH && good; u++) {
        const kn_fit_unknown *is = &best->unknown[u];
        const double step = is->linear ? 0.01 * (is->high - is->low) : 0.01, old = value[u];
        if (is->fixed) continue;
        value[u] = is->linear ? old + step : old * exp(step);
        good = misfit(s, value, slope + u * readings);
        value[u] = old;
        for (int i = 0; i < readings; i++) slope[u * readings + i] = (slope[u * readings + i] - here[i]) / step;
    }
    if (good) make_bands(s, best, scatter, slope, readings);
    free(slope);
    return good;
}

// ---- the results

// Press the lattice with the scene's own solver, and compare all presses.
static bool press_as_served(kn_press_fit *fit, const kn_fit *best)
{
    job jobs[KN_CURVES_MAX];
    for (int k = 0; k < fit->presses; k++) {
        kn_press_record *p = &fit->press[k];
        p->touch_m = best->unknown[TOUCH + k].value;
        jobs[k] = (job){fit, p, &fit->material, p->touch_m, fit->compliance_m_n, p->model_n, .search = false};
    }
    if (!run_jobs(fit->presses, jobs)) return false;
    for (int k = 0; k < fit->presses; k++) {
        kn_press_record *p = &fit->press[k];
        double sum = 0;
        int count = 0;
        for (int i = 0; i < p->curve->count; i++)
            if (isfinite(p->sigma_n[i])) count++, sum += pow(p->model_n[i] - p->curve->value[i], 2);
        p->left = sqrt(sum / count) / kn_curve_largest(p->curve);
    }
    return true;
}

// Fit the unknowns in stages, those first that every press shows: all at once, the search may run away along one that
// it hardly shows, such as k1 in a short press.
static bool search_in_stages(kn_fit *fit)
{
    static const int first[] = {1 << KN_ESTIMATE_C1 | 1 << KN_ESTIMATE_ALPHA,
                                1 << KN_ESTIMATE_C1 | 1 << KN_ESTIMATE_ALPHA | 1 << KN_ESTIMATE_BETA |
                                    1 << KN_ESTIMATE_P1};
    bool fixed[TOUCH], good = true;
    for (int u = 0; u < TOUCH; u++) fixed[u] = fit->unknown[u].fixed;
    for (int stage = 0; stage < 2 && good; stage++) {
        for (int u = 0; u < TOUCH; u++) fit->unknown[u].fixed = fixed[u] || !(first[stage] >> u & 1);
        good = kn_fit_search(fit);
    }
    for (int u = 0; u < TOUCH; u++) fit->unknown[u].fixed = fixed[u];
    ((search *)fit->of)->keeps = true;
    return good && kn_fit_search(fit);
}

// Search from several starts and keep the best result: with more and with less thinning than the material of the start,
// and with a softer spring, which a short press hardly shows.
static bool search_from_starts(kn_fit *best)
{
    static const double thinning[] = {1, 0.4, 2.5, 1}, spring[] = {1, 1, 1, 0.1};
    kn_fit_unknown from[KN_FIT_UNKNOWNS], found[KN_FIT_UNKNOWNS];
    double least = INFINITY;
    memcpy(from, best->unknown, sizeof from);
    for (size_t i = 0; i < sizeof thinning / sizeof *thinning; i++) {
        memcpy(best->unknown, from, sizeof from);
        kn_fit_unknown *beta = &best->unknown[KN_ESTIMATE_BETA];
        kn_fit_unknown *k1 = &best->unknown[KN_ESTIMATE_K1];
        beta->value = fmin(beta->value * thinning[i], beta->high);
        k1->value = fmax(k1->value * spring[i], k1->low);
        if (!search_in_stages(best) || !(best->sum < least)) continue;
        least = best->sum;
        memcpy(found, best->unknown, sizeof found);
    }
    if (isfinite(least)) memcpy(best->unknown, found, sizeof found);
    return isfinite(least);
}

static void join(kn_fit_interval *to, const kn_fit_interval *other, bool replace)
{
    if (replace) *to = *other;
    to->low = fmin(to->low, other->low), to->high = fmax(to->high, other->high);
    to->open_low |= other->open_low, to->open_high |= other->open_high;
}

// Widen the interval of an unknown to all that was tried and is not significantly worse: the searches from several
// starts may end in different parts of a long valley.
static void widen(const search *s, const kn_fit *best, double scale, int unknown, kn_fit_interval *i)
{
    const kn_fit_unknown *u = &best->unknown[unknown];
    const double t = kn_fit_student(0.95, best->freedom);
    double least = best->sum;
    for (int k = 0; k < s->tried; k++) least = fmin(least, s->trial_sum[k]);
    for (int k = 0; k < s->tried && !u->fixed; k++) {
        if (s->trial_sum[k] > least + t * t * scale * scale) continue;
        i->low = fmin(i->low, s->trial[k][unknown]), i->high = fmax(i->high, s->trial[k][unknown]);
    }
    if (u->linear || u->fixed) return;
    if (!i->open_low && i->low < u->value / KN_PROFILE_FAR) i->open_low = true, i->low = u->low;
    if (!i->open_high && i->high > u->value * KN_PROFILE_FAR) i->open_high = true, i->high = u->high;
}

// Search, then find intervals and bands. `trial` and `residual` are scratch.
static bool solve(search *s, kn_fit *best, kn_fit *trial, double *residual)
{
    kn_press_fit *fit = s->fit;
    double value[KN_FIT_UNKNOWNS];
    if (!(fit->resumed || search_from_starts(best))) return false;
    s->keeps = true;
    // the best values so far with the shift of their fit, and the shift of the present values' fit
    kn_fit_unknown kept[KN_FIT_UNKNOWNS];
    double *kept_shift = s->shift + s->readings, *fitted = kept_shift + s->readings;
    const size_t bytes = (size_t)s->readings * sizeof *s->shift;
    const int rounds = fit->replicates < fit->fitted ? 4 : 2;
    double least = INFINITY;
    for (int round = 0; round <= rounds; round++) {
        kn_fit_values(best, value);
        memcpy(fitted, s->shift, bytes);
        if (!shift_to_served(s, value, residual)) return false;
        double sum = 0;
        for (int i = 0; i < s->readings; i++) sum += pow(residual[i] + s->shift[i], 2);
        if (!(sum < least)) {
            if (round == 0) return false;
            // the last shift has led away: back to the values before it, and to the shift with which they were fitted
            memcpy(best->unknown, kept, sizeof kept);
            memcpy(s->shift, kept_shift, bytes);
            if (!kn_lattice_fit(best)) return false;
            break;
        }
        least = sum;
        memcpy(kept, best->unknown, sizeof kept);
        memcpy(kept_shift, fitted, bytes);
        if (round == rounds || (round > 0 && fabs(sum / best->sum - 1) < 1e-3)) break;
        if (!kn_lattice_fit(best)) return false;
    }
    // the search for the ends of the intervals may meet a better fit: then go on there
    kn_fit_interval interval[TOUCH];
    double scale = 1;
    for (int turn = 0; turn < 3; turn++) {
        kn_fit_interval found[TOUCH];
        kn_fit_values(best, value);
        if (!misfit(s, value, residual)) return false;
        best->sum = kn_fit_squares(residual, s->readings); // the shift may have changed since the fit
        // a scale below 1 is chance, or the readings come from a lattice
        scale = fmax(fit->replicates > 1 && fit->replicates == fit->fitted ? best->scale : widened(best, residual), 1);
        const int done = kn_profile_run(best, residual, scale, TOUCH, found);
        if (done < 0) return false;
        for (int u = 0; u < TOUCH; u++) join(&interval[u], &found[u], turn == 0);
        if (done || !kn_lattice_fit(best)) break;
    }
    kn_fit_values(best, value);
    if (!misfit(s, value, residual)) return false;
    for (int u = 0; u < TOUCH; u++) widen(s, best, scale, u, &interval[u]);
    fit->material = kn_lattice_material(value, false);
    fit->compliance_m_n = value[COMPLIANCE];
    const double scatter = best->scale;
    best->scale = scale;
    if (fit->replicates > 1) {
        double *spare = calloc((size_t)best->readings, sizeof *spare);
        if (!spare) return false;
        jackknife(s, best, trial, residual, spare);
        free(spare);
        for (int u = 0; u < TOUCH; u++) {
            const kn_fit_interval spread = kn_fit_interval_by(best, u, 0.95, KN_FIT_CURVATURE);
            join(&interval[u], &spread, false);
        }
    }
    kn_lattice_numbers(fit->number, best, &fit->material, interval);
    if (!best->unknown[COMPLIANCE].fixed) {
        kn_parameter_estimate_set(&fit->compliance, "frame", "m/N", value[COMPLIANCE], interval[COMPLIANCE]);
        if (fit->compliance.known == KN_UNKNOWN)
            snprintf(fit->compliance.words, sizeof fit->compliance.words,
                     "not determined by these measurements; the fit uses %.3g m/N", value[COMPLIANCE]);
    }
    make_bands(s, best, scatter, best->jacobian, best->readings);
    for (int k = fit->fitted; k < fit->presses; k++)
        if (!predict(s, best, trial, scatter, k)) return false;
    return true;
}

int kn_press_fit_run(kn_press_fit *fit)
{
    static kn_fit best, trial;
    static search s;
    s = (search){.fit = fit, .end = fit->fitted, .least = INFINITY, .kept_s = now_s()};
    kn_material start = fit->object->material;
    double highest_pa = 0;
    pthread_mutex_init(&s.lock, NULL);
    best = (kn_fit){.misfit = misfit, .of = &s, .coarse = true, .concurrent = true};
    kn_lattice_unknowns(&best, &start, 0);
    best.unknowns = TOUCH + fit->presses;
    for (int k = 0; k < fit->presses; k++) {
        const kn_curve *c = fit->press[k].curve;
        kn_fit_unknown *touch = &best.unknown[TOUCH + k];
        if (!prepare(&fit->press[k], touch)) return kn_complain(fit->subcommand, KN_EXIT_INTERNAL, "out of memory");
        touch->fixed |= k >= fit->fitted;
        if (k < fit->fitted) s.readings += c->count, fit->replicates += !kn_press_of_specimen(&fit->press[k]);
        for (int i = 0; i < c->steps; i++) highest_pa = fmax(highest_pa, c->step[i].stress_pa);
        if (c->kind == KN_CURVE_CREEP) continue;
        // the stress in an edge is at most the whole force on the area of one node
        highest_pa = fmax(highest_pa, kn_curve_largest(c) / pow(fit->object->spacing_m, 2));
        // bound: the frame yields by at most 30 % of the way down
        if (kn_press_of_specimen(&fit->press[k])) continue;
        const double yields = 0.3 * (c->other[kn_curve_peak(c)] - c->other[kn_curve_touch(c)]) / kn_curve_largest(c);
        kn_fit_unknown *frame = &best.unknown[COMPLIANCE];
        frame->high = frame->high > 0 ? fmin(frame->high, yields) : yields;
    }
    kn_fit_unknown *frame = &best.unknown[COMPLIANCE];
    const bool given = !isnan(fit->compliance_m_n);
    const bool shown = frame->high > 0; // by a press of the object
    *frame = (kn_fit_unknown){
        .name = "frame", .unit = "m/N", .linear = true, .high = shown ? frame->high : 1, .fixed = given || !shown};
    frame->value = given ? fit->compliance_m_n : shown ? 0.03 * frame->high : 0;
    best.readings = s.readings;
    best.jacobian = calloc((size_t)best.unknowns * (size_t)s.readings, sizeof *best.jacobian);
    double *residual = calloc(4 * (size_t)s.readings, sizeof *residual);
    s.shift = residual ? residual + s.readings : NULL;
    s.bar = kn_progress_open(fit->subcommand, 100);
    int code = KN_EXIT_OK;
    if (!best.jacobian || !residual) code = kn_complain(fit->subcommand, KN_EXIT_INTERNAL, "out of memory");
    else {
        double kept[KN_FIT_UNKNOWNS];
        fit->resumed = resume(fit, best.unknowns, kept);
        if (fit->resumed) start = kn_lattice_material(kept, false);
        bool good = fit->resumed || find_start(&s, &best, &start);
        kn_lattice_unknowns(&best, &start, highest_pa);
        best.unknowns = TOUCH + fit->presses;
        for (int i = COMPLIANCE; i < best.unknowns && fit->resumed; i++) best.unknown[i].value = kept[i];
        good = good && solve(&s, &best, &trial, residual) && press_as_served(fit, &best);
        kn_progress_close(&s.bar);
        if (kn_interrupted) code = KN_EXIT_FAILED; // the caller ends the process
        else if (!good)
            code = kn_complain(fit->subcommand, KN_EXIT_USAGE,
                               "%s%s: no material lets this lattice follow; expected a tool and an object as they were "
                               "measured, and presses that the lattice can bear",
                               fit->press[0].curve->file, fit->presses > 1 ? " and others" : "");
    }
    free(best.jacobian);
    free(residual);
    return code;
}

void kn_press_fit_free(kn_press_fit *fit)
{
    for (int k = 0; k < fit->presses; k++) free(fit->press[k].sigma_n);
}
