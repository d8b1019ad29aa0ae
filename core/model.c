#include "core/model.h"
#include "core/composite.h"
#include "core/contact.h"
#include "core/kernel.h"
#include "core/net.h"
#include "core/outside.h"
#include "core/solver_fixed.h"
#include "core/solver_rk4.h"
#include "core/state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Longest step with gas, s. In a longer step, a press reduces a cell's volume too much at once.
#define GAS_STEP_MOST_S 0.03
#define NODES_MAX (1 << 22) // largest number of nodes: their state takes 3 GB, and no index overflows

kn_model_def kn_model_def_default(void)
{
    const double gf_cm2 = 98.0665; // 1 gf/cm^2 in Pa
    return (kn_model_def){
        // the first paper's dough, per cm of specimen height
        .material = {.k1_pa = 470 * gf_cm2,
                     .c1_pa_s = 2500 * gf_cm2,
                     .damper = KN_DAMPER_EXPONENTIAL,
                     .alpha_pa_s = 8.16e4 * gf_cm2,
                     .beta_per_pa = 0.0815 / gf_cm2,
                     .p0_pa = 9 * gf_cm2,
                     .p1_pa = 80 * gf_cm2},
        .density_kg_m3 = 1200,
        .nodes = {6, 6, 4},
        .spacing_m = 0.01,
        .diagonal_stiffness = 1,
        .inside_pressure_pa = 101325, // 1 atm
        .solver =
            {.dt_s = 1e-3, .iterations = 4, .iterations_max = 24, .tolerance = 1e-3, .passes = 1, .mass_scale = 1},
    };
}

void kn_model_def_extent(const kn_model_def *def, double extent_m[3])
{
    for (int k = 0; k < 3; k++) {
        // the extent of a block follows from its numbers of nodes; a mesh is centred over the origin and stands on
        // z = 0
        extent_m[k] = def->mesh ? 0 : def->spacing_m * (def->nodes[k] - 1);
        for (int i = 0; def->mesh && i < def->mesh->node_count; i++)
            extent_m[k] = fmax(extent_m[k], (k == 2 ? 1 : 2) * fabs(def->mesh->x_m[i][k]));
    }
    extent_m[1] = fmax(extent_m[1], def->thickness_m);
}

static bool is_real(double x) { return x >= 0 && isfinite(x); }

// Check contact and coupling of one probe. All check functions return NULL or a sentence that says what is wrong.
static const char *check_tool(const kn_model_def *def, const kn_probe_def *p)
{
    const bool plate = p->shape == KN_PROBE_PLATE;
    if (!is_real(p->friction) || !is_real(p->adhesion_pa) || !is_real(p->grip_n))
        return "a probe's friction, adhesion and grip must not be negative";
    if (!is_real(p->coupling_n_m) || !is_real(p->coupling_n_s_m)) return "a probe's coupling must not be negative";
    const bool more = p->friction > 0 || p->adhesion_pa > 0 || p->grip_n > 0 || p->coupling_n_m > 0;
    if (plate && more) return "a plate always sticks: friction, adhesion, grip and coupling need another shape";
    if (p->adhesion_pa > kn_probe_foundation(p) * 0.2 * def->spacing_m)
        return "adhesion would stretch the foundation by more than a fifth of a spacing: needs a stiffer foundation";
    if (def->solver.kind != KN_SOLVER_IMPLICIT && more)
        return "friction, adhesion, grip and coupling need the implicit solver";
    return NULL;
}

// Check shape and foundation of one probe.
static const char *check_probe(const kn_model_def *def, const kn_probe_def *p)
{
    const char *wrong = check_tool(def, p);
    if (!wrong) wrong = kn_outside_unfit(p, def->spacing_m);
    if (!wrong && !(p->foundation_n_m3 >= 0 && isfinite(p->foundation_n_m3)))
        wrong = "a foundation stiffness must not be negative";
    return wrong;
}

// Check the numbers that describe a block.
static const char *check_block(const kn_model_def *def)
{
    const bool flat = def->thickness_m > 0;
    double nodes = 1;
    if (!(def->thickness_m >= 0 && isfinite(def->thickness_m))) return "thickness must not be negative";
    if (flat && def->nodes[1] != 1) return "a flat object has one layer of nodes along y";
    for (int k = 0; k < 3; k++) {
        const bool thin = def->nodes[k] < 2 && !(flat && k == 1);
        if (def->nodes[k] < 1) return "needs at least one node along every axis";
        if (def->structure == KN_STRUCTURE_DIAGONALS && thin)
            return "a lattice with diagonals needs two nodes along every axis";
        if (def->pressure != KN_PRESSURE_NONE && thin) return "pressure needs two nodes along every axis";
        nodes *= def->nodes[k];
    }
    if (nodes > NODES_MAX) return "more than 4194304 nodes";
    if (def->structure == KN_STRUCTURE_DIAGONALS && !(def->diagonal_stiffness > 0 && def->diagonal_stiffness <= 1))
        return "diagonal_stiffness must be in (0, 1]";
    return NULL;
}

// Check the numbers that describe a net.
static const char *check_mesh(const kn_model_def *def)
{
    const bool flat = def->mesh->dimension == 2;
    if (flat && !(def->thickness_m > 0 && isfinite(def->thickness_m))) return "a flat mesh needs a positive thickness";
    for (int p = 0; flat && p < def->probe_count; p++)
        if (def->probe[p].shape != KN_PROBE_PLATE)
            return "a tool needs a solid object; a flat object takes only plates";
    return NULL;
}

// Check everything about the object except the material.
static const char *check_lattice(const kn_model_def *def)
{
    const char *wrong = def->mesh ? check_mesh(def) : check_block(def);
    if (wrong) return wrong;
    if (def->pressure != KN_PRESSURE_NONE && !(def->inside_pressure_pa > 0 && isfinite(def->inside_pressure_pa)))
        return "the pressure inside must be positive";
    if (!(def->spacing_m > 0 && isfinite(def->spacing_m))) return "spacing must be positive";
    if (!(def->density_kg_m3 > 0 && isfinite(def->density_kg_m3))) return "density must be positive";
    if (!(def->support_friction >= 0 && isfinite(def->support_friction))) return "friction must not be negative";
    if (def->support == KN_SUPPORT_FRICTION && def->solver.kind == KN_SOLVER_RK4)
        return "a table with friction needs the implicit solver";
    if (!(def->gravity_m_s2 >= 0 && isfinite(def->gravity_m_s2))) return "gravity must not be negative";
    return NULL;
}

static const char *check_solver(const kn_solver_def *s)
{
    if (!(s->dt_s > 0 && s->dt_s <= 0.1)) return "dt must be in (0, 0.1] s";
    if (!(s->mass_scale >= 1 && isfinite(s->mass_scale))) return "mass_scale must be at least 1";
    if (s->kind != KN_SOLVER_IMPLICIT && s->precision != KN_PRECISION_F64) return "rk4 and fixed run in f64 only";
    if (s->kind == KN_SOLVER_RK4) return NULL;
    if (s->iterations < 1 || s->iterations_max < s->iterations || s->iterations_max > 100000)
        return "needs 1 <= iterations <= iterations_max <= 100000";
    if (!(s->tolerance >= 0 && s->tolerance < 1)) return "tolerance must be in [0, 1)";
    if (s->passes < 1 || s->passes > 100) return "passes must be in 1..100";
    return NULL;
}

// Check a whole definition: parts first, then how they fit together.
static const char *check(const kn_model_def *def)
{
    const char *wrong = kn_material_check(&def->material);
    if (!wrong) wrong = check_lattice(def);
    if (!wrong) wrong = check_solver(&def->solver);
    if (!wrong) wrong = kn_composite_check(def);
    if (!wrong && (def->probe_count < 0 || def->probe_count > KN_PROBES_MAX)) wrong = "too many probes";
    for (int p = 0; p < def->probe_count && !wrong; p++) wrong = check_probe(def, &def->probe[p]);
    if (!wrong && def->pressure != KN_PRESSURE_NONE && def->solver.dt_s > GAS_STEP_MOST_S)
        wrong = "gas needs steps of at most 30 ms: in longer ones a press takes too much of a cell's volume at once";
    return wrong;
}

// List the faces that a probe can touch: top, four sides, base. u x v points outwards on each of them.
static void build_faces(kn_model *m)
{
    const int *n = m->grid.n, x = 1, y = n[0], z = n[0] * n[1];
    const double h = m->grid.spacing_m;
    const kn_face face[6] = {
        {(n[2] - 1) * z, {x, y}, {n[0], n[1]}, h},
        {(n[0] - 1) * x, {y, z}, {n[1], n[2]}, h},
        {0, {z, y}, {n[2], n[1]}, h},
        {(n[1] - 1) * y, {z, x}, {n[2], n[0]}, h},
        {0, {x, z}, {n[0], n[2]}, h},
        {0, {y, x}, {n[1], n[0]}, h},
    };
    memcpy(m->face, face, sizeof face);
    m->face_count = m->def.support >= KN_SUPPORT_NONE ? 6 : 5;
    m->outside_count = 6;
    if (!m->grid.flat) return;
    // a flat object: top and two ends; faces along its plane cannot be touched
    m->face[2] = face[2];
    m->face[3] = face[5];
    m->face_count -= 2;
    m->outside_count -= 2;
}

// Allocate the arrays of nodes and of the top. A mesh and a composite call this function, too.
bool kn_model_nodes(kn_model *m, int nodes, int top)
{
    m->node_count = nodes;
    m->top_count = top;
    m->offset = calloc((size_t)nodes, sizeof *m->offset);
    m->rest_m = calloc((size_t)nodes, sizeof *m->rest_m);
    m->node_mass_kg = calloc((size_t)nodes, sizeof *m->node_mass_kg);
    m->support = calloc((size_t)nodes, 1);
    m->top = calloc((size_t)top + 1, sizeof *m->top);
    m->top_share = calloc((size_t)top + 1, sizeof *m->top_share);
    return m->offset && m->rest_m && m->node_mass_kg && m->support && m->top && m->top_share;
}

bool kn_model_cells(kn_model *m, int cells)
{
    m->cell_count = cells;
    m->cells = calloc((size_t)cells + 1, sizeof *m->cells);
    m->cell_volume = calloc((size_t)cells + 1, sizeof *m->cell_volume);
    return m->cells && m->cell_volume;
}

// Return the components that a support holds, as bits.
uint8_t kn_support_mask(kn_support support)
{
    return support == KN_SUPPORT_BONDED ? 7 : support == KN_SUPPORT_FRICTIONLESS ? 4 : 0;
}

// List the nodes of the top and their shares of a dead load, which sum to 1.
static void build_top(kn_model *m)
{
    const kn_face *top = &m->face[0];
    double shares = 0;
    for (int t = 0; t < m->top_count; t++) {
        m->top[t] = top->origin + t % top->len[0] * top->step[0] + t / top->len[0] * top->step[1];
        m->top_share[t] = kn_grid_share(&m->grid, m->top[t]);
        shares += m->top_share[t];
    }
    for (int t = 0; t < m->top_count; t++) m->top_share[t] /= shares;
}

// Build the nodes of a plain block.
static bool build_block(kn_model *m)
{
    const kn_grid *g = &m->grid;
    build_faces(m);
    if (!kn_model_nodes(m, g->nodes, m->face[0].len[0] * m->face[0].len[1])) return false;
    m->row_count = g->rows;
    m->stride = kn_grid_stride(g);
    m->edge_reals = kn_grid_field(g, KN_FORWARD);
    m->kappa_m = g->kappa_m;
    m->gamma = g->gamma;
    m->size_m = fmax(fmax(g->n[0], g->n[1]), g->n[2]) * g->spacing_m;
    double h = g->spacing_m, whole = m->def.density_kg_m3 * h * h * g->depth_m;
    for (int i = 0; i < g->nodes; i++) {
        m->offset[i] = kn_grid_offset(g, i);
        kn_grid_rest(g, i, m->rest_m[i]);
        m->node_mass_kg[i] = whole * kn_grid_share(g, i);
        // the base has the first ids, because ids count z slowest; nodes of a flat object stay in its plane
        if (i < g->n[0] * g->n[1]) m->support[i] = kn_support_mask(m->def.support);
        if (g->flat) m->support[i] |= 2;
    }
    build_top(m);
    return true;
}

// Limits of the stiffness of tools' foundations and of gas, relative to the resistance of an object's node at rest in
// one step. Beyond these limits, conjugate gradients in f32 (seven digits) need more iterations than any step has
// (measured with `knead stability`, family mixed). Gas is stiff in only one direction of each cell.
#define FOUNDATION_MOST 500.0
#define GAS_MOST 1e4
// Limit of the gas in f32, relative to the pressure of a tool one spacing deep: the rounding of the gas is then a
// hundredth of that pressure.
#define GAS_MOST_F32 1e4

static const char *check_stiffness(const kn_model *m)
{
    const kn_model_def *def = &m->def;
    double h = def->spacing_m, dt = def->solver.dt_s, at_rest = m->law.kind == KN_LAW_VOIGT ? 1 : m->law.slope_rest;
    // body: resistance of one node to a change of velocity, kg/s
    double body = m->kappa_m * m->law.a_pa_s * at_rest + kn_model_mass(m) / m->node_count / dt;
    double gas = def->pressure != KN_PRESSURE_NONE ? def->inside_pressure_pa : 0;
    if (def->solver.kind != KN_SOLVER_RK4 && gas * h * dt > GAS_MOST * body)
        return "the gas inside is more than 10000 times as stiff as the object around it";
    for (int p = 0; p < def->probe_count; p++) {
        if (def->probe[p].shape == KN_PROBE_PLATE) continue;
        double foundation = kn_probe_foundation(&def->probe[p]);
        if (foundation * h * h * dt > FOUNDATION_MOST * body)
            return "the tool's foundation is more than 500 times as stiff as the object under it";
        if (def->solver.precision == KN_PRECISION_F32 && gas > GAS_MOST_F32 * foundation * h)
            return "in f32 the gas inside rounds by more than the tool's soft foundation presses: needs precision: f64";
    }
    return NULL;
}

static bool build_tables(kn_model *m)
{
    if (!m->composite) m->tables = kn_tables_create(m, m->kernels);
    return m->composite || m->tables;
}

static bool build_cells(kn_model *m)
{
    const kn_grid *g = &m->grid;
    if (!kn_model_cells(m, kn_grid_cells(g, NULL))) return false;
    kn_grid_cells(g, m->cells);
    for (int c = 0; c < m->cell_count; c++) m->cell_volume[c] = g->spacing_m * g->spacing_m * g->depth_m;
    return true;
}

static bool build_edges(kn_model *m)
{
    if (m->def.mesh) return true; // a mesh has its own nodes and faces
    m->edge_count = kn_grid_edges(&m->grid, NULL);
    m->edges = calloc((size_t)m->edge_count + 1, sizeof(kn_edge));
    if (m->edges) kn_grid_edges(&m->grid, m->edges);
    return m->edges != NULL;
}

static bool build_gas(kn_model *m) { return m->def.mesh || m->def.pressure == KN_PRESSURE_NONE || build_cells(m); }

static bool build_rk4(kn_model *m)
{
    if (!build_edges(m) || !build_gas(m)) return false;
    m->rk4_limit_s = kn_rk4_limit(m);
    return m->rk4_limit_s >= 0;
}

static bool fail(char *error, size_t size, const char *text)
{
    if (size > 0) snprintf(error, size, "%s", text);
    return false;
}

// Speed of a press for the check below. If a hand moves by an element's height in one step, the element turns inside
// out and back in every step, because the step uses the edges' directions at its beginning. Measured with `knead
// stability`, family sliver: the object is calm if the height over the step is 2 cm/s, and oscillates if it is 7 mm/s.
#define HAND_M_S 0.01

// Refuse a step that is too long for the flattest element of a mesh.
static bool check_flattest(const kn_model *m, char *error, size_t size)
{
    int element = 0;
    if (!m->def.mesh || m->def.solver.kind == KN_SOLVER_RK4) return true;
    double low_m = kn_simplices_lowest(m->def.mesh, &element), most_s = low_m / HAND_M_S;
    if (m->def.solver.dt_s <= most_s) return true;
    if (size > 0)
        snprintf(error, size,
                 "element %ld is only %.2g m high, and a hand at 1 cm/s moves that far in one step: dt must be at most "
                 "%.3g s here",
                 m->def.mesh->tag[element], low_m, 0.99 * most_s);
    return false;
}

static bool build(kn_model *m, const kn_model_def *def, char *error, size_t size)
{
    bool rk4 = def->solver.kind == KN_SOLVER_RK4;
    m->def = *def;
    // lattice, law and kernels first: everything else depends on them
    if (!def->mesh)
        kn_grid_init(&m->grid, def->nodes, def->spacing_m, def->thickness_m,
                     def->structure == KN_STRUCTURE_AXIS ? 0 : def->diagonal_stiffness);
    kn_law_build(&m->law, &def->material, rk4 ? 0 : def->solver.dt_s, def->solver.precision == KN_PRECISION_F64);
    if (!kn_kernels_choose(m))
        return fail(error, size, "this processor lacks the instruction set that solver.isa asks for");
    // then the nodes: of a mesh, of a block with a fine box, or of a plain block
    const char *wrong;
    if (def->mesh) wrong = kn_net_build(m);
    else if (kn_composite_is(def)) wrong = kn_composite_build(m);
    else wrong = build_block(m) ? NULL : KN_NO_MEMORY;
    if (!wrong && !kn_outside_build(m)) wrong = KN_NO_MEMORY;
    if (!wrong) wrong = check_stiffness(m);
    // then the tables of the chosen solver
    char text[160];
    if (!wrong && def->solver.kind == KN_SOLVER_FIXED)
        wrong = build_edges(m) && build_gas(m) ? kn_fixed_build(m, text, sizeof text) : KN_NO_MEMORY;
    else if (!wrong && (rk4 ? !build_rk4(m) : !build_tables(m))) wrong = KN_NO_MEMORY;
    if (wrong) return fail(error, size, wrong);
    if (!check_flattest(m, error, size)) return false;
    // an explicit step beyond its stability limit is refused, with the mass scale that would allow it
    if (rk4 && def->solver.dt_s > m->rk4_limit_s) {
        if (size > 0)
            snprintf(error, size,
                     "rk4 is stable up to dt = %.3g s here and dt = %.3g s was asked for; solver.mass_scale = %.3g "
                     "would allow it",
                     m->rk4_limit_s, def->solver.dt_s,
                     ceil(def->solver.mass_scale * def->solver.dt_s / m->rk4_limit_s * 1.05));
        return false;
    }
    m->state_bytes = kn_state_size(m);
    return true;
}

kn_model *kn_model_build(const kn_model_def *def, char *error, size_t error_size)
{
    const char *wrong = check(def);
    if (wrong) {
        fail(error, error_size, wrong);
        return NULL;
    }
    kn_model *m = calloc(1, sizeof *m);
    if (m && build(m, def, error, error_size)) return m;
    if (!m) fail(error, error_size, KN_NO_MEMORY);
    kn_model_destroy(m);
    return NULL;
}

void kn_model_destroy(kn_model *model)
{
    if (!model) return;
    kn_composite_destroy(model->composite);
    free(model->tables);
    free(model->offset);
    free(model->rest_m);
    free(model->node_mass_kg);
    free(model->support);
    free(model->top);
    free(model->top_share);
    kn_fixed_destroy(model->fixed);
    free(model->edges);
    free(model->skin);
    free(model->shape);
    free(model->base);
    free(model->base_area_m2);
    free(model->cells);
    free(model->cell_volume);
    free(model);
}

double kn_model_mass(const kn_model *model)
{
    double mass = 0;
    for (int i = 0; i < model->node_count; i++) mass += model->node_mass_kg[i];
    return mass;
}
