#include "clients/sweep/stability_trial.h"
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Number of time steps of one trial.
#define STEPS 160

// --- scenes ---------------------------------------------------------------------------------------------------------

static kn_probe_def plate(double along_m)
{
    return (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {0.01, along_m}};
}

static kn_probe_def ball(double radius_m)
{
    return (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = radius_m};
}

// Return the standard trial: a plate of 1 x 2 cm is pressed 3 mm deep into a block of dough of 3 x 2 x 2 cm.
static kn_stability_trial block(double dt_s)
{
    kn_stability_trial t = {
        .def = kn_model_def_default(), .steps = STEPS, .depth_m = 0.003, .strain = 0.05, .squeezed = 1};
    memcpy(t.def.nodes, (int[]){4, 3, 3}, sizeof t.def.nodes);
    t.def.solver.dt_s = dt_s;
    t.def.probe_count = 1;
    t.def.probe[0] = plate(0.02);
    return t;
}

// Scale the force-dependent damper c2. A material may define c2 by several parameters, so scale all of them.
static void scale_c2(kn_material *m, double by)
{
    m->c2_pa_s *= by;
    m->alpha_pa_s *= by;
    m->c_max_pa_s *= by;
    m->c_min_pa_s *= by;
}

enum { K1, C1, C2, MASS, PARAMETERS };
static const char *const parameter_name[] = {"k1", "c1", "c2", "mass"};

// Multiply one parameter of the model by a factor.
static void scale(kn_model_def *def, int parameter, double by)
{
    if (parameter == K1) def->material.k1_pa *= by;
    if (parameter == C1) def->material.c1_pa_s *= by;
    if (parameter == C2) scale_c2(&def->material, by);
    if (parameter == MASS) def->density_kg_m3 *= by;
}

static void constant_c2(kn_material *m, double c2_pa_s)
{
    m->damper = KN_DAMPER_CONSTANT;
    m->c2_pa_s = c2_pa_s;
}

typedef struct kind { // a material of a trial, made by a change of the material dough
    const char *name;
    void (*of)(kn_material *m); // function that changes the parameters of dough into those of this material
} kind;

// The functions below make three whole materials, and dough with one or two parameters at a limit.
static void dough(kn_material *m) { (void)m; }
static void jelly(kn_material *m) { *m = (kn_material){.k1_pa = 1e4, .c1_pa_s = 500}; }
static void clay(kn_material *m)
{
    *m = (kn_material){.c1_pa_s = 4e4};
    constant_c2(m, 4e4);
}
static void no_k1(kn_material *m) { m->k1_pa = 0; }
static void no_c1(kn_material *m) { m->c1_pa_s = 0; }
static void no_flow(kn_material *m) { m->damper = KN_DAMPER_NONE; }
static void no_beta(kn_material *m) { m->beta_per_pa = 0; }
static void no_c1_no_flow(kn_material *m) { m->c1_pa_s = 0, m->damper = KN_DAMPER_NONE; }
static void no_k1_no_flow(kn_material *m) { m->k1_pa = 0, m->damper = KN_DAMPER_NONE; }
static void no_c1_no_beta(kn_material *m) { m->c1_pa_s = 0, m->beta_per_pa = 0; }
static void no_p0(kn_material *m) { m->p0_pa = 0; }
// Replace the exponential damper by a damper that varies linearly with stress between its values at p0 and p1.
static void ramp(kn_material *m)
{
    m->c_max_pa_s = kn_material_c2(m, m->p0_pa);
    m->c_min_pa_s = kn_material_c2(m, m->p1_pa);
    m->damper = KN_DAMPER_RAMP;
}
static void stops(kn_material *m) { m->ratio = 0.2, m->stroke[0] = 0.1, m->stroke[1] = 0.3; }

static const kind kinds[] = {{"k1 = 0", no_k1},
                             {"c1 = 0", no_c1},
                             {"1/c2 = 0", no_flow},
                             {"beta = 0", no_beta},
                             {"p0 = 0", no_p0},
                             {"c1, 1/c2 = 0", no_c1_no_flow},
                             {"k1, 1/c2 = 0", no_k1_no_flow},
                             {"c1, beta = 0", no_c1_no_beta},
                             {"ramp", ramp},
                             {"stops", stops}};
static const kind common[] = {{"dough", dough}, {"jelly", jelly}, {"clay", clay}, {"dough, stops", stops}};

#define COUNT(a) ((int)(sizeof(a) / sizeof(a)[0]))

// --- families -------------------------------------------------------------------------------------------------------

// Make a trial with one parameter scaled by x, at the time step y. `variant` selects the parameter, and whether the
// tool is a plate or a ball.
static bool make_scale(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->y[j]);
    if (c->variant / PARAMETERS) t->def.probe[0] = ball(0.01);
    scale(&t->def, c->variant % PARAMETERS, c->x[i]);
    return true;
}

// Make a trial of a block under a plate, with two parameters scaled independently by x and y.
static bool make_pair(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(1e-3);
    scale(&t->def, c->variant % PARAMETERS, c->x[i]);
    scale(&t->def, c->variant / PARAMETERS, c->y[j]);
    return true;
}

// Make a trial of a material with parameters at a limit, under a plate, a ball or a dead load. The x value of the map
// is the time step.
static bool make_limit(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->x[i]);
    if (c->variant == 1) t->def.probe[0] = ball(0.01);
    if (c->variant == 2) t->def.probe_count = 0, t->hand = KN_STABILITY_TRIAL_HAND_LOAD;
    kinds[(int)c->y[j]].of(&t->def.material);
    return true;
}

// Make a trial of one upright edge with a fixed base, or of a single node. The single node falls freely, or a plate
// pushes it down.
static bool make_bar(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->x[i]);
    t->def.structure = KN_STRUCTURE_AXIS;
    memcpy(t->def.nodes, (int[]){1, 1, c->variant < 2 ? 2 : 1}, sizeof t->def.nodes);
    common[(int)c->y[j] % COUNT(common)].of(&t->def.material);
    if (c->variant == 0) t->def.probe_count = 0, t->hand = KN_STABILITY_TRIAL_HAND_LOAD;
    if (c->variant == 2) {
        t->def.probe_count = 0, t->hand = KN_STABILITY_TRIAL_HAND_NONE;
        t->def.support = KN_SUPPORT_NONE;
        t->def.gravity_m_s2 = 9.81;
    }
    if (c->variant == 3) t->def.support = KN_SUPPORT_NONE;
    return true;
}

// Create a mesh of 3 x 3 x 2 equal cells. Each cell is divided into six tetrahedra of the same shape (Kuhn's division).
// The cells are stretched along z by `aspect` at a constant volume.
static kn_simplices *kuhn(double aspect)
{
    static const int n[3] = {3, 3, 2}, turn[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    const int x = 1, y = n[0] + 1, z = y * (n[1] + 1), step[3] = {x, y, z};
    double across = 0.01 * pow(aspect, -1.0 / 3), up = 0.01 * pow(aspect, 2.0 / 3);
    kn_simplices *s = kn_simplices_create(3, z * (n[2] + 1), 6 * n[0] * n[1] * n[2]);
    if (!s) return NULL;
    for (int i = 0; i < s->node_count; i++) {
        s->x_m[i][0] = across * (i % y);
        s->x_m[i][1] = across * (i % z / y);
        s->x_m[i][2] = up * (i / z);
    }
    // Each of the six tetrahedra follows one order of the three axes from a corner of the cell to the opposite corner.
    for (int e = 0; e < s->element_count; e++) {
        int cell = e / 6, at = cell % n[0] * x + cell / n[0] % n[1] * y + cell / (n[0] * n[1]) * z;
        const int *way = turn[e % 6];
        int a = at + step[way[0]], b = a + step[way[1]], far = at + x + y + z;
        // An odd permutation of the axes gives a tetrahedron of the opposite orientation, so swap two of its corners.
        bool even = e % 6 < 3;
        memcpy(s->element[e], (int[]){at, even ? a : b, even ? b : a, far}, sizeof s->element[e]);
        s->tag[e] = e + 1;
    }
    return s;
}

// Put the mesh into the trial, and adapt plate size and press depth to the size of the mesh. Return false if out of
// memory.
static bool on_mesh(kn_stability_trial *t, kn_simplices *mesh)
{
    t->mesh = mesh;
    t->def.mesh = mesh;
    if (!mesh) return false;
    kn_simplices_place(mesh);
    kn_simplices_measures m;
    if (!kn_simplices_measure(mesh, &m)) return false;
    t->def.spacing_m = m.edge_mean_m;
    t->def.probe[0].size_m[0] = 0.5 * (m.high_m[0] - m.low_m[0]);
    t->def.probe[0].size_m[1] = 2 * (m.high_m[1] - m.low_m[1]);
    t->depth_m = fmin(0.003, 0.1 * (m.high_m[2] - m.low_m[2]));
    return true;
}

// Make a trial of dough, jelly or clay on stretched or flattened tetrahedra.
static bool make_aspect(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->y[j]);
    common[c->variant].of(&t->def.material);
    return on_mesh(t, kuhn(c->x[i]));
}

// Make a trial on a mesh with a nearly flat element. An inner node is moved towards the plane of an opposite face,
// until the flattest element has only the share x of its original volume.
static bool make_sliver(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->y[j]);
    common[c->variant].of(&t->def.material);
    kn_simplices *s = kuhn(1);
    if (s) s->x_m[(4 + 1) + 16][2] += 0.01 * (1 - c->x[i]);
    return on_mesh(t, s);
}

// Make a trial that compresses the whole block by the share x of its height, with or without gas.
static bool make_squash(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->y[j]);
    common[c->variant % 3].of(&t->def.material);
    if (c->variant >= 3) t->def.pressure = KN_PRESSURE_CELLS;
    t->def.probe[0].size_m[0] = t->def.probe[0].size_m[1] = 0.04;
    t->depth_m = 0.02 * c->x[i];
    return true;
}

// Make a trial with gas in cells, or in the whole object. The topmost cells start at x times their volume at rest, and
// the gas has the pressure y. No tool touches the object.
static bool make_gas(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    static const double dt[3] = {1e-4, 1e-3, 1e-2};
    *t = block(dt[c->variant % 3]);
    t->def.pressure = c->variant >= 3 ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS;
    t->def.inside_pressure_pa = c->y[j];
    t->squeezed = c->x[i];
    t->hand = KN_STABILITY_TRIAL_HAND_NONE;
    t->def.probe_count = 0;
    return true;
}

// Make a trial with a tool whose pose jumps by x: down, up or sideways.
static bool make_jump(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    *t = block(c->y[j]);
    if (c->variant % 2) t->def.probe[0] = ball(0.01);
    t->hand = KN_STABILITY_TRIAL_HAND_JUMP;
    t->jump_m[c->variant < 4 ? 2 : 0] = c->variant < 2 ? -c->x[i] : c->x[i];
    return true;
}

// Return a pseudo-random number in [0, 1) that depends only on the arguments (SplitMix64).
static double dice(int seed, int which)
{
    uint64_t z = 0x9e3779b97f4a7c15u * (uint64_t)(1 + seed * 16 + which);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

// Make a trial of a block with random parameters. Draw each parameter independently within ten decades around its
// common value.
static bool make_mixed(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    int seed = (int)(c->x[i] + 100 * c->y[j]) + 10000 * c->variant;
    *t = block(c->variant ? pow(10, -5 + 4 * dice(seed, 0)) : 1e-3);
    if (dice(seed, 1) < 0.33) t->def.probe[0] = ball(0.01);
    if (dice(seed, 2) < 0.5) common[(int)(COUNT(common) * dice(seed, 3))].of(&t->def.material);
    else kinds[(int)(COUNT(kinds) * dice(seed, 3))].of(&t->def.material);
    for (int p = 0; p < PARAMETERS; p++) scale(&t->def, p, pow(10, -5 + 10 * dice(seed, 4 + p)));
    t->def.diagonal_stiffness = pow(10, -2 * dice(seed, 8));
    if (dice(seed, 9) < 0.33) {
        t->def.pressure = KN_PRESSURE_CELLS;
        t->def.inside_pressure_pa = 101325 * pow(10, -5 + 10 * dice(seed, 10));
    }
    t->def.probe[0].foundation_n_m3 = 2.5e7 * pow(10, -5 + 10 * dice(seed, 11));
    return true;
}

// Make a trial of a larger block. Information crosses one cell per iteration, so larger blocks need more iterations.
static bool make_size(const kn_stability_map *c, int i, int j, kn_stability_trial *t)
{
    int cells = (int)c->x[i];
    *t = block(c->variant ? 1e-2 : 1e-3);
    t->steps = 80;
    memcpy(t->def.nodes, (int[]){cells + 1, cells + 1, (2 * cells + 2) / 3 + 1}, sizeof t->def.nodes);
    t->def.spacing_m = 0.03 / cells;
    scale(&t->def, K1, c->y[j]);
    return true;
}

// --- maps ---------------------------------------------------------------------------------------------------------

enum { F_K1, F_C1, F_C2, F_MASS, F_PAIR, F_LIMIT, F_BAR, F_ASPECT, F_SLIVER, F_SQUASH, F_GAS, F_JUMP, F_MIXED, F_SIZE };

const char *const kn_stability_families[] = {"k1",     "c1",     "c2",     "mass", "pairs", "limits", "bar",
                                             "aspect", "sliver", "squash", "gas",  "jump",  "mixed",  "size"};

static bool (*const make[])(const kn_stability_map *c, int column, int row, kn_stability_trial *t) = {
    make_scale,  make_scale,  make_scale,  make_scale, make_pair, make_limit, make_bar,
    make_aspect, make_sliver, make_squash, make_gas,   make_jump, make_mixed, make_size};

typedef struct list {
    kn_stability_map *map;
    int count;
    bool quick;
} list;

static const double all_scales[13] = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6};
static const double half_scales[7] = {1e-6, 1e-4, 1e-2, 1, 1e2, 1e4, 1e6}, few_scales[5] = {1e-6, 1e-3, 1, 1e3, 1e6};
static const double all_steps[9] = {1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1};
static const double decades[5] = {1e-5, 1e-4, 1e-3, 1e-2, 1e-1}, few_steps[3] = {1e-5, 1e-3, 1e-1};

// Append a map of the family with number `f` to the list of maps. The title is given as for printf.
__attribute__((format(printf, 6, 7))) static kn_stability_map *add(list *l, int f, int variant, const char *across,
                                                                   const char *down, const char *title, ...)
{
    kn_stability_map *c = &l->map[l->count++];
    *c = (kn_stability_map){.family = f, .across = across, .down = down, .variant = variant};
    va_list args;
    va_start(args, title);
    vsnprintf(c->title, sizeof c->title, title, args);
    va_end(args);
    return c;
}

static void set_x(kn_stability_map *c, const double *x, int count)
{
    c->columns = count;
    memcpy(c->x, x, (size_t)count * sizeof *x);
}

static void set_y(kn_stability_map *c, const double *y, int count)
{
    c->rows = count;
    memcpy(c->y, y, (size_t)count * sizeof *y);
}

// Set the columns (X) or the rows (Y) of a map. A quick survey takes the short list of values. Otherwise the long list
// is taken.
#define X(few, all) (l->quick ? set_x(c, few, COUNT(few)) : set_x(c, all, COUNT(all)))
#define Y(few, all) (l->quick ? set_y(c, few, COUNT(few)) : set_y(c, all, COUNT(all)))

// Let the rows of a map be materials instead of numbers.
static void set_kinds(kn_stability_map *c, const kind *k, int count)
{
    c->rows = count;
    for (int i = 0; i < count; i++) c->y[i] = i, c->y_text[i] = k[i].name;
}

// Add maps in which the scale of one parameter varies against the time step, for a plate and for a ball.
static void add_scales(list *l)
{
    for (int p = 0; p < PARAMETERS; p++)
        for (int probe = 0; probe < (l->quick ? 1 : 2); probe++) {
            kn_stability_map *c = add(l, F_K1 + p, p + PARAMETERS * probe, parameter_name[p], "dt, s",
                                      "dough under a %s, %s scaled", probe ? "ball" : "plate", parameter_name[p]);
            X(few_scales, all_scales), Y(few_steps, all_steps);
        }
}

// Add one map for each pair of scaled parameters.
static void add_pairs(list *l)
{
    static const double ends[] = {1e-6, 1e6};
    for (int p = 0; p < PARAMETERS; p++)
        for (int q = p + 1; q < PARAMETERS; q++) {
            kn_stability_map *c =
                add(l, F_PAIR, p + PARAMETERS * q, parameter_name[p], parameter_name[q],
                    "dough under a plate, 1 ms, %s and %s scaled", parameter_name[p], parameter_name[q]);
            X(ends, half_scales), Y(ends, half_scales);
        }
}

// Add maps of materials at their limits, then of single edges and nodes.
static void add_materials(list *l)
{
    static const char *const who[] = {"under a plate", "under a ball", "under a dead load"};
    static const char *const bars[] = {"one edge under a load", "one edge under a plate", "one node, falling",
                                       "one node before a plate"};
    for (int v = 0; v < (l->quick ? 1 : COUNT(who)); v++) {
        kn_stability_map *c = add(l, F_LIMIT, v, "dt, s", "", "dough %s, but", who[v]);
        X(few_steps, all_steps);
        set_kinds(c, kinds, COUNT(kinds));
    }
    for (int v = 0; v < COUNT(bars); v++) {
        kn_stability_map *c = add(l, F_BAR, v, "dt, s", "", "%s", bars[v]);
        X(decades, all_steps);
        set_kinds(c, common, COUNT(common));
    }
}

// Add maps of meshes of stretched tetrahedra, then of meshes with one nearly flat element.
static void add_meshes(list *l)
{
    static const double aspects[] = {1e-3, 1e-2, 0.1, 0.3, 1, 3, 10, 30, 100, 1000};
    static const double left[] = {1, 0.3, 0.1, 0.03, 0.01, 0.003, 1e-3, 1e-4, 0, -0.1};
    static const double few_aspects[] = {1e-2, 0.3, 3, 100}, few_left[] = {0.1, 0.01, 1e-3, 0};
    for (int v = 0; v < (l->quick ? 1 : 3); v++) {
        kn_stability_map *c =
            add(l, F_ASPECT, v, "aspect", "dt, s", "%s on tetrahedra, height over width", common[v].name);
        X(few_aspects, aspects), Y(few_steps, decades);
    }
    for (int v = 0; v < (l->quick ? 1 : 3); v++) {
        kn_stability_map *c =
            add(l, F_SLIVER, v, "volume", "dt, s", "%s on tetrahedra, volume of the flattest", common[v].name);
        X(few_left, left), Y(few_steps, decades);
    }
}

// Add maps with violent motions: deep compression, collapsed gas cells, jumps of the tool.
static void add_violence(list *l)
{
    static const double deep[] = {0.3, 0.5, 0.7, 0.8, 0.9, 0.95}, few_deep[] = {0.5, 0.9, 0.95};
    static const double begin[] = {0.5, 0.1, 0.01, 1e-6, 0, -0.1, -0.5, -1}, few_begin[] = {0.1, 0, -1};
    static const double gas[] = {1e3, 1e4, 1e5, 1e6, 1e7}, few_gas[] = {1e4, 1e5, 1e6};
    static const double far[] = {1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1}, few_far[] = {1e-3, 1e-2, 1e-1};
    static const char *const step[] = {"0.1 ms", "1 ms", "10 ms"};
    static const char *const jumps[] = {"plate, down", "ball, down",   "plate, up",
                                        "ball, up",    "plate, along", "ball, along"};
    // A quick survey leaves out some variants and columns, but no family.
    for (int v = 0; v < 6; v += l->quick ? 3 : 1) {
        kn_stability_map *c = add(l, F_SQUASH, v, "share", "dt, s", "%s%s, height lost under a plate",
                                  common[v % 3].name, v >= 3 ? " with gas" : "");
        X(few_deep, deep), Y(few_steps, decades);
    }
    for (int v = 0; v < 6; v++) {
        if (l->quick && v % 3 != 1) continue;
        kn_stability_map *c = add(l, F_GAS, v, "V/V0", "P, Pa", "gas in %s, upper cells begin at V/V0, %s",
                                  v < 3 ? "cells" : "the object", step[v % 3]);
        X(few_begin, begin), Y(few_gas, gas);
    }
    for (int v = 0; v < 6; v++) {
        kn_stability_map *c = add(l, F_JUMP, v, "jump, m", "dt, s", "dough under a jumping %s, m", jumps[v]);
        X(few_far, far), Y(few_steps, decades);
    }
}

// Add maps of random parameters, then of larger blocks.
static void add_rest(list *l)
{
    static const double few_cells[] = {3, 4}, cells[] = {3, 6, 9, 12}, few_k1[] = {1, 1e6}, k1[] = {1, 1e2, 1e4, 1e6};
    double seeds[KN_STABILITY_MAP_SIDE];
    for (int i = 0; i < KN_STABILITY_MAP_SIDE; i++) seeds[i] = i;
    for (int v = 0; v < 2; v++) {
        kn_stability_map *c =
            add(l, F_MIXED, v, "draw", "draw", "every parameter%s", v ? " and the step at random" : " at random, 1 ms");
        set_x(c, seeds, l->quick ? 8 : 16);
        set_y(c, seeds, l->quick ? 5 : 16);
    }
    for (int v = 0; v < 2; v++) {
        kn_stability_map *c =
            add(l, F_SIZE, v, "cells", "k1", "cells across 3 cm, k1 scaled, %s", v ? "10 ms" : "1 ms");
        X(few_cells, cells), Y(few_k1, k1);
    }
}

int kn_stability_maps(kn_stability_map maps[KN_STABILITY_MAPS_MAX], bool quick)
{
    list l = {.map = maps, .quick = quick};
    add_scales(&l);
    add_pairs(&l);
    add_materials(&l);
    add_meshes(&l);
    add_violence(&l);
    add_rest(&l);
    return l.count;
}

bool kn_stability_map_trial(const kn_stability_map *map, int column, int row, kn_stability_trial *trial)
{
    return make[map->family](map, column, row, trial);
}
