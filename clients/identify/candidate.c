#include "clients/identify/candidate.h"
#include "clients/knead/graft.h"
#include "core/surface.h"
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double atm_pa = 101325;
// if the scene's diagonal stiffness is below this, the structure `diagonals` uses 1 instead
static const double weak = 0.1;
// largest difference of a mesh's extent from the object's extent, as a share of the latter
static const double alike = 0.1;
static const double area_low = 0.2, area_high = 5;

// ---- list of structures

typedef struct kind {
    const char *name, *words;
    bool mesh, gas;
    // stiffness of the diagonals; NULL: the scene's stiffness, or 1 if the scene's is below `weak`
    const char *stiffness;
} kind;

static const kind kinds[KN_CANDIDATES] = {
    {"diagonals", "diagonals", false, false, NULL},
    {"pressure", "inside pressure with the fewest diagonals", false, true, "0.02"},
    {"both", "diagonals and inside pressure", false, true, NULL},
    {"mesh", "the edges of the mesh", true, false, NULL},
    {"mesh-pressure", "the edges of the mesh and inside pressure", true, true, NULL}};

// Return whether the name is in the list `only`, or the list is absent.
static bool is_wanted(const char *only, const char *name)
{
    const size_t n = strlen(name);
    for (const char *at = only; at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL)
        if (strcspn(at, ",") == n && !strncmp(at, name, n)) return true;
    return !only;
}

// Return whether all names in the list `only` are structures. If one is not, write an error to `error`.
static bool are_known(const char *only, char *error, size_t error_size)
{
    for (const char *at = only; at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
        bool known = false;
        for (int k = 0; k < KN_CANDIDATES; k++)
            known |= strlen(kinds[k].name) == strcspn(at, ",") && !strncmp(at, kinds[k].name, strcspn(at, ","));
        if (known) continue;
        snprintf(error, error_size,
                 "--only %s: unknown structure '%.*s', expected a list of diagonals, pressure, both, mesh, "
                 "mesh-pressure, separated by commas",
                 only, (int)fmin((double)strcspn(at, ","), 40), at);
        return false;
    }
    return true;
}

// Return the text of the scene, freed by the caller. If a mesh is wanted and given, it replaces the scene's object.
static char *text_for(const kn_scene *base, const kind *k, const kn_candidate_def *def, char *error, size_t error_size)
{
    char block[PATH_MAX + 100], path[PATH_MAX];
    if (!k->mesh || !def->mesh) return strdup(base->text);
    if (!realpath(def->mesh, path)) {
        snprintf(error, error_size, "--mesh %s: no such file", def->mesh);
        return NULL;
    }
    snprintf(block, sizeof block, "object:\n  mesh: \"%s\"\n  mesh_unit: %s\n", path, def->mesh_unit);
    return kn_graft(base->text, "object", block, error, error_size);
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
    kn_scene *scene = text ? kn_scene_parse_beside(def->scene_path, def->scene_path, text, strlen(text), sets,
                                                   k->mesh ? 1 : 4, error, error_size)
                           : NULL;
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
    c->best.surface = kn_surface_create(c->first);
    if (c->best.surface) c->rest_m = calloc((size_t)c->best.surface->vertex_count, sizeof *c->rest_m);
    for (int v = 0; c->rest_m && v < c->best.surface->vertex_count; v++) {
        double x_m[3];
        kn_surface_rest(c->best.surface, c->first, v, x_m);
        for (int i = 0; i < 3; i++) c->rest_m[v][i] = (float)x_m[i];
    }
    c->best.rest_m = (const float(*)[3])c->rest_m;
    return c->rest_m;
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
    kn_pressed_free(&c->best.pressed);
    kn_surface_destroy((kn_surface *)(uintptr_t)c->best.surface);
    kn_model_destroy(c->first);
    kn_scene_destroy(c->scene);
    free(c->rest_m);
    free(c->residual);
    memset(c, 0, sizeof *c);
}

// Check that mesh and object have similar extents; both are centred in the scene. Without this check, a mesh of a wrong
// object would be fitted without an error.
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
                 "--mesh %s: the mesh is %.3g x %.3g x %.3g mm, expected the object's %.3g x %.3g x %.3g mm within 10 "
                 "%%; is --mesh-unit %s right?",
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

// ---- the fit

// Stretch the damper's law by a factor on gamma.
static void stretch(kn_material *m, double factor)
{
    m->p0_pa *= factor;
    m->p1_pa *= factor;
    m->beta_per_pa /= factor;
}

kn_model_def kn_candidate_model(const kn_candidate *c, double pressure_pa, double area_factor)
{
    kn_model_def def = c->scene->model;
    if (c->gas) def.inside_pressure_pa = pressure_pa;
    if (c->area) stretch(&def.material, area_factor);
    return def;
}

typedef struct work {
    kn_candidate *candidate;
    const kn_evidence *evidence;
    void (*told)(void *of, int64_t ticks);
    void *of;
    double shift_m[2]; // shift of the best press so far; the next search for the shift begins there
    bool short_of_memory;
} work;

// Press the structure with these parameters and compute the residuals. Keep the result of the best press.
static bool press(void *of, const double value[KN_SEARCH_UNKNOWNS], double *residual)
{
    work *w = of;
    kn_candidate *c = w->candidate;
    const kn_evidence *e = w->evidence;
    // Build the model with these parameters and repeat the press.
    const double pressure_pa = c->gas ? value[0] : c->pressure_pa, factor = c->area ? value[c->gas] : 1;
    const kn_model_def def = kn_candidate_model(c, pressure_pa, factor);
    kn_exhibit x = {.surface = c->best.surface, .rest_m = c->best.rest_m};
    kn_model *model = kn_model_build(&def, c->why, sizeof c->why);
    const kn_press_play play = {model, x.surface, e->reliefs, e->moment_s, e->until_s, w->told, w->of};
    double shift_m[2] = {w->shift_m[0], w->shift_m[1]}, sum = 0;
    c->presses++;
    bool ok = model && kn_press_run(&e->press, &play, &x.pressed);
    if (model && !ok) snprintf(c->why, sizeof c->why, "the simulated press diverges");
    kn_model_destroy(model);
    ok = ok && kn_evidence_compare(e, &x, shift_m, residual, NULL);
    for (int i = 0; ok && i < e->readings; i++) sum += residual[i] * residual[i];
    // Keep the best press for the report and the files.
    if (ok && isfinite(sum) && (!c->found || sum < c->sum)) {
        kn_pressed_free(&c->best.pressed);
        c->best.pressed = x.pressed;
        c->found = true;
        c->sum = sum;
        memcpy(w->shift_m, shift_m, sizeof w->shift_m);
    } else kn_pressed_free(&x.pressed);
    return ok;
}

// Set up the search: unknowns with their bounds, and starts over the range of P0.
static kn_search plan_of(const kn_candidate *c, const kn_evidence *e)
{
    static const double start_atm[] = {0.1, 0.5, 2.5};
    kn_search s = {.readings = e->readings, .look = press, .starts = c->gas ? 3 : 1};
    if (c->gas) {
        s.name[s.unknowns] = "P0";
        s.low[s.unknowns] = KN_LEAST_PA;
        s.high[s.unknowns++] = KN_MOST_PA;
    }
    if (c->area) {
        s.name[s.unknowns] = "gamma";
        s.low[s.unknowns] = area_low;
        s.high[s.unknowns++] = area_high;
    }
    for (int i = 0; i < s.starts; i++) {
        s.start[i][c->gas] = 1; // the search for the factor on gamma starts at 1
        if (c->gas) s.start[i][0] = start_atm[i] * atm_pa;
        else s.start[i][0] = 1;
    }
    return s;
}

// Take values and intervals from the finished search.
static void take(kn_candidate *c, const kn_search *s)
{
    c->sought = s->unknowns;
    c->settled = s->settled;
    c->early = s->settled && s->early;
    if (c->gas) {
        c->pressure_pa = s->value[0];
        kn_parameter_estimate_set(&c->known[0], "inside_pressure", "Pa", s->value[0],
                                  kn_search_interval(s, 0, c->worth));
        // A pressure near 0 whose interval is open below means that the fit has removed the gas.
        c->no_gas_left = c->known[0].interval.open_low && c->pressure_pa < 0.05 * atm_pa;
    }
    if (!c->area) return;
    kn_parameter_estimate *k = &c->known[c->gas];
    c->area_factor = s->value[c->gas];
    *k = (kn_parameter_estimate){0};
    kn_fit_interval i = kn_search_interval(s, c->gas, c->worth);
    // The search has fitted the factor on gamma. The interval of gamma itself is reported, so multiply by gamma.
    i.low *= c->gamma, i.high *= c->gamma;
    kn_parameter_estimate_set(k, "gamma", "", c->gamma * c->area_factor, i);
}

// Return the rms difference of the force as a share of the largest force.
static double pull_share(const kn_evidence *e, const kn_candidate *c)
{
    double residual[KN_PULL_BINS], model_n[KN_PULL_BINS], sum = 0;
    if (!e->pulled) return (double)NAN;
    kn_pull_compare(&e->pull, &e->press, &c->best.pressed, residual, model_n);
    for (int b = 0; b < e->pull.bins; b++) sum += (model_n[b] - e->pull.bin_n[b]) * (model_n[b] - e->pull.bin_n[b]);
    return sqrt(sum / e->pull.bins) / e->pull.most_n;
}

double kn_candidate_work(const kn_candidate *c, const kn_evidence *e)
{
    // Typical numbers of presses per fit, indexed by gas and area: whether P0 and the factor on gamma are unknowns.
    static const double presses[2][2] = {{1, 4}, {7, 11}};
    return presses[c->gas][c->area] * (double)(kn_press_tick(&e->press, e->until_s) + 1);
}

bool kn_candidate_fit(kn_candidate *c, const kn_evidence *e, void (*told)(void *of, int64_t ticks), void *of)
{
    struct timespec began, now;
    work w = {.candidate = c, .evidence = e, .told = told, .of = of};
    kn_search s = plan_of(c, e);
    s.of = &w;
    clock_gettime(CLOCK_MONOTONIC, &began);
    const bool ran = kn_search_run(&s);
    c->residual = calloc((size_t)e->readings + 1, sizeof *c->residual);
    memcpy(c->shift_m, w.shift_m, sizeof c->shift_m);
    bool ok = c->residual && (ran || !c->found);
    if (ok && c->found) {
        // Compare the best press once more to get the residuals and misfits that belong to it.
        ok = kn_evidence_compare(e, &c->best, c->shift_m, c->residual, c->misfit);
        c->worth = kn_evidence_worth(e, c->residual);
        c->unknowns = s.unknowns + (e->align ? 2 : 0);
        c->pull_share = pull_share(e, c);
        take(c, &s);
    }
    kn_search_free(&s);
    clock_gettime(CLOCK_MONOTONIC, &now);
    c->seconds = (double)(now.tv_sec - began.tv_sec) + 1e-9 * (double)(now.tv_nsec - began.tv_nsec);
    return ok;
}

// ---- output as a scene

char *kn_candidate_scene(const kn_candidate *c, const kn_candidate_def *def, char *error, size_t error_size)
{
    char set[KN_CANDIDATE_SETS][80];
    const char *sets[KN_CANDIDATE_SETS];
    int count = 0;
    const kn_model_def found = kn_candidate_model(c, c->pressure_pa, c->area_factor);
    if (c->gas) snprintf(set[count++], sizeof *set, "object.inside_pressure=%.17g Pa", c->pressure_pa);
    // A factor on gamma is written as a stretched damper law of the material.
    if (c->area) {
        snprintf(set[count++], sizeof *set, "material.p0=%.17g Pa", found.material.p0_pa);
        snprintf(set[count++], sizeof *set, "material.p1=%.17g Pa", found.material.p1_pa);
    }
    if (c->area && found.material.damper == KN_DAMPER_EXPONENTIAL)
        snprintf(set[count++], sizeof *set, "material.beta=%.17g 1/Pa", found.material.beta_per_pa);
    for (int i = 0; i < count; i++) sets[i] = set[i];
    kn_scene *scene = kn_scene_parse_beside(def->scene_path, def->scene_path, c->scene->text, strlen(c->scene->text),
                                            sets, count, error, error_size);
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
    if (text)
        finer->scene =
            kn_scene_parse_beside(def->scene_path, def->scene_path, text, strlen(text), sets, 1, error, error_size);
    free(text);
    if (finer->scene && prepare(finer, error, error_size)) return true;
    kn_candidate_free(finer);
    return false;
}
