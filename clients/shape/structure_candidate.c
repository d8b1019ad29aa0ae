#include "clients/shape/structure_candidate.h"
#include "clients/cli/yaml_patch.h"
#include "clients/shape/trust_region.h"
#include "server/clock.h"
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double atm_pa = 101325;
// if the stiffness of the scene's diagonals is below this, the structures `diagonals` and `both` use 1 instead
static const double weak = 0.1;
// largest difference between the extents of a mesh and of the object, as a share of the object's extent
static const double alike = 0.1;
static const double least_pa = 100, most_pa = 1e7; // limits of the inside pressure P0 in a scene
static const double area_low = 0.2, area_high = 5; // limits of the factor on gamma

// ---- list of structures

typedef struct kind {
    const char *name, *words;
    bool mesh, gas;
    // stiffness of the diagonals; NULL: the stiffness in the scene, or 1 if the stiffness in the scene is below `weak`
    const char *stiffness;
} kind;

static const kind kinds[KN_CANDIDATES] = {
    {"diagonals", "diagonals", false, false, NULL},
    {"pressure", "inside pressure with the fewest diagonals", false, true, "0.02"},
    {"both", "diagonals and inside pressure", false, true, NULL},
    {"mesh", "the edges of the mesh", true, false, NULL},
    {"mesh-pressure", "the edges of the mesh and inside pressure", true, true, NULL}};

// Return whether `name` is the first name of a list whose names are separated by commas.
static bool is_first(const char *list, const char *name)
{
    return strlen(name) == strcspn(list, ",") && !strncmp(list, name, strlen(name));
}

// Return the rest of a list after its first name, or NULL.
static const char *rest_of(const char *list) { return strchr(list, ',') ? strchr(list, ',') + 1 : NULL; }

// Return whether the name is in the list `only`. Without a list (NULL), return true.
static bool is_wanted(const char *only, const char *name)
{
    for (const char *at = only; at; at = rest_of(at))
        if (is_first(at, name)) return true;
    return !only;
}

// Return whether all names in the list `only` are structures. If one is not, write an error to `error`.
static bool are_known(const char *only, char *error, size_t error_size)
{
    for (const char *at = only; at; at = rest_of(at)) {
        bool known = false;
        for (int k = 0; k < KN_CANDIDATES; k++) known |= is_first(at, kinds[k].name);
        if (known) continue;
        snprintf(error, error_size,
                 "--only %s: unknown structure '%.*s', expected a list separated by commas: "
                 "diagonals, pressure, both, mesh, mesh-pressure",
                 only, (int)fmin((double)strcspn(at, ","), 40), at);
        return false;
    }
    return true;
}

// Return the text of the scene, freed by the caller. If the structure is a mesh and --mesh gives one, the mesh replaces
// the scene's object.
static char *text_for(const kn_scene *base, const kind *k, const kn_candidate_def *def, char *error, size_t error_size)
{
    char block[PATH_MAX + 100], path[PATH_MAX];
    if (!k->mesh || !def->mesh) return strdup(base->text);
    if (!realpath(def->mesh, path)) {
        snprintf(error, error_size, "--mesh %s: no such file", def->mesh);
        return NULL;
    }
    snprintf(block, sizeof block, "object:\n  mesh: \"%s\"\n  mesh_unit: %s\n", path, def->mesh_unit);
    return kn_yaml_patch(base->text, "object", block, error, error_size);
}

// Parse the text of a scene with settings, as if the text were in the scene file.
static kn_scene *parse(const kn_candidate_def *def, const char *text, const char *const *sets, int count, char *error,
                       size_t error_size)
{
    return kn_scene_parse_beside(def->scene_path, def->scene_path, text, strlen(text), sets, count, error, error_size);
}

// Parse the scene with the settings of one structure.
static kn_scene *scene_of(const kn_scene *base, const kind *k, const kn_candidate_def *def, char *error,
                          size_t error_size)
{
    const double e = base->model.diagonal_stiffness;
    char stiffness[64], pressure[40];
    snprintf(stiffness, sizeof stiffness, "object.diagonal_stiffness=%.17g", e >= weak ? e : 1);
    if (k->stiffness) snprintf(stiffness, sizeof stiffness, "object.diagonal_stiffness=%s", k->stiffness);
    snprintf(pressure, sizeof pressure, "object.pressure=%s", k->gas ? "cells" : "none");
    // A mesh has its own edges, so only the pressure is set for it.
    const char *const sets[] = {pressure, "object.accuracy=0", "object.structure=diagonals", stiffness};
    char *text = text_for(base, k, def, error, error_size);
    kn_scene *scene = text ? parse(def, text, sets, k->mesh ? 1 : 4, error, error_size) : NULL;
    free(text);
    return scene;
}

// Build the model and the surface at rest of a candidate whose scene is already set.
static bool prepare(kn_candidate *c, char *error, size_t error_size)
{
    char why[200];
    c->area_factor = 1;
    c->pressure_pa = c->scene->model.inside_pressure_pa;
    c->first = kn_model_build(&c->scene->model, why, sizeof why);
    if (!c->first) snprintf(error, error_size, "%s: %s: %s", c->scene->name, c->name, why);
    if (!c->first) return false;
    snprintf(error, error_size, "out of memory");
    c->gamma = c->first->gamma;
    c->surface.mesh = kn_surface_create(c->first);
    const int vertices = c->surface.mesh ? c->surface.mesh->vertex_count : 0;
    c->surface.rest_m = calloc((size_t)vertices, sizeof *c->surface.rest_m);
    for (int v = 0; c->surface.rest_m && v < vertices; v++) {
        double x_m[3];
        kn_surface_rest(c->surface.mesh, c->first, v, x_m);
        for (int i = 0; i < 3; i++) c->surface.rest_m[v][i] = (float)x_m[i];
    }
    return c->surface.mesh && c->surface.rest_m;
}

// Make the scene, the model and the surface of one structure.
static bool open_one(kn_candidate *c, const kn_scene *base, const kind *k, const kn_candidate_def *def, char *error,
                     size_t error_size)
{
    *c = (kn_candidate){.name = k->name, .words = k->words, .gas = k->gas};
    c->scene = scene_of(base, k, def, error, error_size);
    if (!c->scene) return false;
    const kn_damper damper = c->scene->model.material.damper;
    // The factor on gamma matters only if the damper depends on the stress.
    c->area = damper == KN_DAMPER_EXPONENTIAL || damper == KN_DAMPER_RAMP;
    return prepare(c, error, error_size);
}

void kn_candidate_free(kn_candidate *c)
{
    kn_pressed_free(&c->pressed);
    kn_surface_destroy(c->surface.mesh);
    free(c->surface.rest_m);
    kn_model_destroy(c->first);
    kn_scene_destroy(c->scene);
    free(c->residual);
    memset(c, 0, sizeof *c);
}

// Check that mesh and object have similar extents. Their places need no check, since both are centred in the scene.
// Without this check, a mesh of a wrong object would be fitted without an error.
static bool is_same_object(const kn_candidate *c, const kn_scene *base, const kn_candidate_def *def, char *error,
                           size_t error_size)
{
    double is_m[3], was_m[3];
    bool same = true;
    kn_model_def_extent(&c->scene->model, is_m);
    kn_model_def_extent(&base->model, was_m);
    for (int k = 0; k < 3; k++) same &= fabs(is_m[k] - was_m[k]) <= alike * was_m[k];
    if (!same)
        snprintf(error, error_size,
                 "--mesh %s: the mesh is %.3g x %.3g x %.3g mm, "
                 "expected the object's %.3g x %.3g x %.3g mm within 10 %%; is --mesh-unit %s right?",
                 def->mesh, 1e3 * is_m[0], 1e3 * is_m[1], 1e3 * is_m[2], 1e3 * was_m[0], 1e3 * was_m[1], 1e3 * was_m[2],
                 def->mesh_unit);
    return same;
}

int kn_candidates_open(kn_candidate candidate[KN_CANDIDATES], const kn_candidate_def *def, const char *only,
                       char *error, size_t error_size)
{
    int count = 0;
    bool ok = are_known(only, error, error_size);
    kn_scene *base = ok ? kn_scene_load(def->scene_path, def->sets, def->set_count, error, error_size) : NULL;
    ok = base;
    for (int k = 0; ok && k < KN_CANDIDATES; k++) {
        // Mesh structures need a mesh; the other structures need a block.
        const bool there = kinds[k].mesh ? def->mesh || base->model.mesh : !base->model.mesh;
        if (!there || !is_wanted(only, kinds[k].name)) continue;
        kn_candidate *c = &candidate[count++];
        ok = open_one(c, base, &kinds[k], def, error, error_size) &&
             (!kinds[k].mesh || !def->mesh || is_same_object(c, base, def, error, error_size));
        c->one_skin = base->model.pressure == KN_PRESSURE_OBJECT;
    }
    if (ok && count == 0)
        snprintf(error, error_size, "--only %s: %s has no such structure%s", only, base->name,
                 base->model.mesh ? "" : " without --mesh");
    for (int i = 0; i < count && !ok; i++) kn_candidate_free(&candidate[i]);
    kn_scene_destroy(base);
    return ok ? count : 0;
}

// ---- fitting a candidate

kn_model_def kn_candidate_model(const kn_candidate *c, double pressure_pa, double area_factor)
{
    kn_model_def def = c->scene->model;
    if (c->gas) def.inside_pressure_pa = pressure_pa;
    if (c->area) { // stretch the damper law by the factor on gamma
        def.material.p0_pa *= area_factor;
        def.material.p1_pa *= area_factor;
        def.material.beta_per_pa /= area_factor;
    }
    return def;
}

typedef struct work {
    kn_candidate *candidate;
    const kn_measurement *measurement;
    void (*told)(void *of, int64_t ticks);
    void *of;
    double shift_m[2]; // shift of the best press so far; the next search for the shift begins there
} work;

// Press the structure with these values of the unknowns, and compute the residuals. Keep the result of the best press.
// If P0 or gamma is no unknown, kn_candidate_model ignores its value.
static bool press(void *of, const double value[KN_TRUST_UNKNOWNS], double *residual)
{
    work *w = of;
    kn_candidate *c = w->candidate;
    const kn_measurement *m = w->measurement;
    // Build the model with the values of the unknowns, and press it.
    const kn_model_def def = kn_candidate_model(c, value[0], value[c->gas]);
    kn_pressed pressed = {0};
    kn_model *model = kn_model_build(&def, c->why, sizeof c->why);
    const kn_press_play play = {model, c->surface.mesh, m->surfaces, m->moment_s, m->until_s, w->told, w->of};
    double shift_m[2] = {w->shift_m[0], w->shift_m[1]}, sum = 0;
    c->presses++;
    bool ok = model && kn_press_run(&m->press, &play, &pressed);
    if (model && !ok) snprintf(c->why, sizeof c->why, "the simulated press diverges");
    kn_model_destroy(model);
    ok = ok && kn_measurement_compare(m, &c->surface, &pressed, shift_m, residual, NULL);
    for (int i = 0; ok && i < m->readings; i++) sum += residual[i] * residual[i];
    // Keep the best press for the report and the files.
    if (ok && isfinite(sum) && (!c->found || sum < c->sum)) {
        kn_pressed_free(&c->pressed);
        c->pressed = pressed;
        c->found = true;
        c->sum = sum;
        memcpy(w->shift_m, shift_m, sizeof w->shift_m);
    } else kn_pressed_free(&pressed);
    return ok;
}

// Set up the search: the unknowns with their bounds, and start values spread over the range of P0.
static kn_trust_region search_of(const kn_candidate *c, const kn_measurement *m)
{
    static const double start_atm[] = {0.1, 0.5, 2.5};
    kn_trust_region s = {
        .unknowns = c->gas + c->area, .readings = m->readings, .misfit = press, .starts = c->gas ? 3 : 1};
    // The factor on gamma comes after P0, if both are unknowns. The search for the factor starts at 1.
    s.name[c->gas] = "gamma";
    s.low[c->gas] = area_low;
    s.high[c->gas] = area_high;
    for (int i = 0; i < s.starts; i++) s.start[i][c->gas] = 1;
    if (!c->gas) return s;
    s.name[0] = "P0";
    s.low[0] = least_pa;
    s.high[0] = most_pa;
    for (int i = 0; i < s.starts; i++) s.start[i][0] = start_atm[i] * atm_pa;
    return s;
}

// Take the values of the unknowns and their intervals from the finished search.
static void take(kn_candidate *c, const kn_trust_region *s)
{
    c->settled = s->settled;
    c->early = s->settled && s->early;
    if (c->gas) {
        c->pressure_pa = s->value[0];
        kn_parameter_estimate_set(&c->known[0], "inside_pressure", "Pa", s->value[0],
                                  kn_trust_region_interval(s, 0, c->independent));
        // A pressure near 0 whose interval is open below means that the fit has removed the gas.
        c->no_gas_left = c->known[0].interval.open_low && c->pressure_pa < 0.05 * atm_pa;
    }
    if (!c->area) return;
    kn_parameter_estimate *k = &c->known[c->gas];
    c->area_factor = s->value[c->gas];
    kn_fit_interval i = kn_trust_region_interval(s, c->gas, c->independent);
    // The search has fitted the factor on gamma. The interval of gamma itself is reported, so multiply by gamma.
    i.low *= c->gamma, i.high *= c->gamma;
    kn_parameter_estimate_set(k, "gamma", "", c->gamma * c->area_factor, i);
}

// Return the rms difference of the force as a share of the largest force.
static double force_share(const kn_measurement *m, const kn_candidate *c)
{
    double residual[KN_FORCE_SPANS], model_n[KN_FORCE_SPANS], sum = 0;
    const kn_force_residual *f = &m->force;
    if (!m->has_force) return (double)NAN;
    kn_force_residual_compare(f, &m->press, &c->pressed, residual, model_n);
    for (int b = 0; b < f->spans; b++) sum += (model_n[b] - f->span_n[b]) * (model_n[b] - f->span_n[b]);
    return sqrt(sum / f->spans) / f->most_n;
}

double kn_candidate_work(const kn_candidate *c, const kn_measurement *m)
{
    // Typical number of presses of a fit. First index: whether P0 is an unknown. Second index: whether the factor on
    // gamma is an unknown.
    static const double presses[2][2] = {{1, 4}, {7, 11}};
    return presses[c->gas][c->area] * (double)(kn_press_tick(&m->press, m->until_s) + 1);
}

bool kn_candidate_fit(kn_candidate *c, const kn_measurement *m, void (*told)(void *of, int64_t ticks), void *of)
{
    const int64_t began_ns = kn_now_ns();
    work w = {.candidate = c, .measurement = m, .told = told, .of = of};
    kn_trust_region s = search_of(c, m);
    s.of = &w;
    const bool ran = kn_trust_region_run(&s);
    c->residual = calloc((size_t)m->readings + 1, sizeof *c->residual);
    memcpy(c->shift_m, w.shift_m, sizeof c->shift_m);
    bool ok = c->residual && (ran || !c->found);
    if (ok && c->found) {
        // Compare the best press with the measurement once more, to get its residuals and misfits.
        ok = kn_measurement_compare(m, &c->surface, &c->pressed, c->shift_m, c->residual, c->misfit);
        c->independent = kn_measurement_independent(m, c->residual);
        c->unknowns = s.unknowns + (m->align ? 2 : 0);
        c->force_share = force_share(m, c);
        take(c, &s);
    }
    kn_trust_region_free(&s);
    c->seconds = 1e-9 * (double)(kn_now_ns() - began_ns);
    return ok;
}

// ---- a candidate as a scene

char *kn_candidate_scene(const kn_candidate *c, const kn_candidate_def *def, char *error, size_t error_size)
{
    char set[4][80];
    const char *const sets[] = {set[0], set[1], set[2], set[3]};
    int count = 0;
    const kn_material found = kn_candidate_model(c, c->pressure_pa, c->area_factor).material;
    if (c->gas) snprintf(set[count++], sizeof *set, "object.inside_pressure=%.17g Pa", c->pressure_pa);
    // A factor on gamma is written as a stretched damper law of the material.
    if (c->area) {
        snprintf(set[count++], sizeof *set, "material.p0=%.17g Pa", found.p0_pa);
        snprintf(set[count++], sizeof *set, "material.p1=%.17g Pa", found.p1_pa);
    }
    if (c->area && found.damper == KN_DAMPER_EXPONENTIAL)
        snprintf(set[count++], sizeof *set, "material.beta=%.17g 1/Pa", found.beta_per_pa);
    kn_scene *scene = parse(def, c->scene->text, sets, count, error, error_size);
    char *text = scene ? strdup(scene->text) : NULL;
    if (scene && !text) snprintf(error, error_size, "out of memory");
    kn_scene_destroy(scene);
    return text;
}

bool kn_candidate_finer(kn_candidate *finer, const kn_candidate *c, const kn_candidate_def *def, char *error,
                        size_t error_size)
{
    char set[64];
    const char *const sets[] = {set};
    *finer = (kn_candidate){.name = "halved cells", .words = c->words};
    char *text = kn_candidate_scene(c, def, error, error_size);
    snprintf(set, sizeof set, "object.spacing=%.17g m", 0.5 * c->scene->model.spacing_m);
    if (text) finer->scene = parse(def, text, sets, 1, error, error_size);
    free(text);
    if (finer->scene && prepare(finer, error, error_size)) return true;
    kn_candidate_free(finer);
    return false;
}

// ---- the verdict on the candidates

// Return the AICc of a candidate. readings: number of residuals. independent: number of independent readings. If the
// sum of squares is below `readings`, use `readings` as the sum, since a misfit below the noise does not favour a
// candidate.
static double aicc(const kn_candidate *c, int readings, double independent)
{
    const int n = (int)fmax(independent, c->unknowns + 3);
    return kn_fit_aicc(n, c->unknowns, fmax(c->sum, readings) * n / readings);
}

static void judge(kn_structure_verdict *v, int count, const kn_candidate *c, int readings)
{
    double best_sum = INFINITY, independent = 0, least = INFINITY;
    // The candidate with the least sum of squares determines the number of independent readings for all candidates.
    for (int i = 0; i < count; i++)
        if (c[i].found && c[i].sum < best_sum) best_sum = c[i].sum, independent = c[i].independent;
    for (int i = 0; i < count; i++) {
        v->off[i] = c[i].found ? sqrt(c[i].sum / readings) : (double)INFINITY;
        v->delta[i] = c[i].found ? aicc(&c[i], readings, independent) : (double)INFINITY;
        // A candidate whose fit removed the gas can be the best only if no other candidate has a solution.
        if (!c[i].found || c[i].no_gas_left || !(v->delta[i] < least)) continue;
        least = v->delta[i];
        v->best = i;
    }
    for (int i = 0; i < count && v->best < 0; i++)
        if (c[i].found && v->delta[i] < least) least = v->delta[i], v->best = i;
    for (int i = 0; i < count; i++) v->delta[i] -= least;
    v->explained = v->best >= 0 && v->off[v->best] <= KN_STRUCTURE_VERDICT_OFF;
    // If the chosen candidate does not explain the data, choose the candidate with the least `off` (size of the
    // residuals) instead. Candidates whose fit removed the gas are still avoided.
    for (int i = 0; i < count && v->best >= 0 && !v->explained; i++)
        if (c[i].found && c[i].no_gas_left == c[v->best].no_gas_left && v->off[i] < v->off[v->best]) v->best = i;
    v->explained = v->best >= 0 && v->off[v->best] <= KN_STRUCTURE_VERDICT_OFF;
    // The rival is the nearest of the other candidates that cannot be excluded. A candidate whose fit removed the gas
    // is no rival.
    for (int i = 0; i < count && v->best >= 0; i++) {
        const bool near = v->explained ? v->delta[i] < KN_STRUCTURE_VERDICT_APART
                                       : v->off[i] < KN_STRUCTURE_VERDICT_NEAR * v->off[v->best];
        if (i == v->best || c[i].no_gas_left || !near) continue;
        const bool nearer =
            v->rival >= 0 && (v->explained ? v->delta[i] < v->delta[v->rival] : v->off[i] < v->off[v->rival]);
        if (v->rival < 0 || nearer) v->rival = i;
    }
}

__attribute__((format(printf, 2, 3))) static void add(kn_structure_verdict *v, const char *format, ...)
{
    const size_t n = strlen(v->words);
    va_list args;
    va_start(args, format);
    vsnprintf(v->words + n, sizeof v->words - n, format, args);
    va_end(args);
}

// State how the rival compares with the best candidate, and which measurement could separate the two.
static void tell_rival(kn_structure_verdict *v, const kn_candidate *c)
{
    const kn_candidate *a = &c[v->best], *b = &c[v->rival];
    if (!v->explained) {
        add(v,
            " %s is nearly as close, %.1f times the noise: these measurements do not show which of the two is right.",
            b->name, v->off[v->rival]);
        return;
    }
    add(v, " It cannot be told apart from %s (dAICc %.1f)", b->words, v->delta[v->rival]);
    if (a->gas != b->gas) add(v, ": so little gas hardly changes the measured quantities.");
    else add(v, ": a range image of the dent without the tool, or the force over the hold, may tell them apart.");
}

// State the verdict in words: the best candidate, its misfit, the rival, and candidates whose fit removed the gas.
static void tell(kn_structure_verdict *v, int count, const kn_candidate *c, const kn_measurement *m)
{
    const kn_candidate *best = &c[v->best];
    if (v->explained) {
        add(v, "%s explains the measurements: the residual is %.2g times the noise.", best->name, v->off[v->best]);
    } else {
        add(v, "None of the structures explains the measurements. %s comes nearest and is off by %.1f times the noise",
            best->name, v->off[v->best]);
        if (m->surfaces > 0) add(v, ", %.2g mm of the shape", 1e3 * best->misfit[0].height_m);
        if (m->has_force) add(v, ", %.2g %% of the force", 100 * best->force_share);
        add(v, ": its parameters are only an approximation, since the material, the lattice or the set-up is not the "
               "real one.");
    }
    if (v->rival >= 0) tell_rival(v, c);
    for (int i = 0; i < count; i++)
        if (c[i].no_gas_left && i != v->best)
            add(v, " The fit of %s has no gas left: it equals the structure without gas.", c[i].name);
    if (best->no_gas_left) add(v, " The fit has no gas left.");
    if (!best->settled) add(v, " The search for its parameters reached the limit of presses.");
}

void kn_structure_verdict_make(kn_structure_verdict *v, int count, const kn_candidate *candidate,
                               const kn_measurement *measurement)
{
    *v = (kn_structure_verdict){.best = -1, .rival = -1};
    judge(v, count, candidate, measurement->readings);
    if (v->best < 0) {
        add(v, "No structure can be pressed in the way the specimen was pressed: %s", candidate[0].why);
        return;
    }
    tell(v, count, candidate, measurement);
}
