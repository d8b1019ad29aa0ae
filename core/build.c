// Assembly of a model: check its definition, then build the lattice, the kernels, the tools and the tables of the
// chosen solver. Assembly of a state: one block of memory with the fields and the memory of that solver.
#include "core/algebra/bytes.h"
#include "core/solve/coarse.h"
#include "core/solve/contact.h"
#include "core/solve/kernel.h"
#include "core/lattice/lattice.h"
#include "core/solve/solver.h"
#include "core/solver_fixed.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Longest time step of an object with gas in its cells, s. In a longer step, a press would take too much of a cell's
// volume at once.
#define GAS_STEP_MOST_S 0.03
#define NODES_MAX (1 << 22) // largest number of nodes: their state takes 3 GB, and no index overflows

// --- checks of a definition -----------------------------------------------------------------------------------------

static bool is_real(double x) { return x >= 0 && isfinite(x); }
static bool is_choice(int value, int last) { return value >= 0 && value <= last; }

// Check that every choice of a definition is one of its enum: a program may have filled it from anywhere.
static const char *check_choices(const kn_model_def *def)
{
    const kn_solver_def *s = &def->solver;
    if (!is_choice((int)s->kind, KN_SOLVER_FIXED) || !is_choice((int)s->precision, KN_PRECISION_F64) ||
        !is_choice((int)s->linearization, KN_LINEARIZATION_TANGENT) || !is_choice((int)s->isa, KN_ISA_AVX512))
        return "the solver's kind, precision, linearization or isa is none of its enum";
    if (!is_choice((int)def->material.damper, KN_DAMPER_RAMP)) return "the material's damper is none of its enum";
    if (!is_choice((int)def->structure, KN_STRUCTURE_AXIS) || !is_choice((int)def->pressure, KN_PRESSURE_OBJECT) ||
        !is_choice((int)def->support, KN_SUPPORT_FRICTION) || !is_choice((int)def->skin, KN_SKIN_BILINEAR))
        return "structure, pressure, support or skin is none of its enum";
    for (int p = 0; p < def->probe_count && p < KN_PROBES_MAX; p++)
        if (!is_choice((int)def->probe[p].shape, KN_PROBE_MESH) ||
            !is_choice((int)def->probe[p].surface, KN_PLATE_SLIDES))
            return "a probe's shape or surface is none of its enum";
    return NULL;
}

// Check contact and coupling of one probe. Every check function in this file returns NULL, or a sentence that says what
// is wrong.
static const char *check_tool(const kn_model_def *def, const kn_probe_def *p)
{
    const bool plate = p->shape == KN_PROBE_PLATE;
    if (!is_real(p->friction) || !is_real(p->adhesion_pa) || !is_real(p->grip_n))
        return "a probe's friction, adhesion and grip must not be negative";
    if (!is_real(p->coupling_n_m) || !is_real(p->coupling_n_s_m)) return "a probe's coupling must not be negative";
    const bool more = p->friction > 0 || p->adhesion_pa > 0 || p->grip_n > 0 || p->coupling_n_m > 0;
    if (plate && (p->friction > 0 || p->grip_n > 0 || p->coupling_n_m > 0))
        return "a plate sticks or slides: friction, grip and coupling need another shape";
    if (p->surface == KN_PLATE_SLIDES && (!plate || def->solver.kind == KN_SOLVER_FIXED))
        return "surface: slides needs a plate, and another solver than fixed";
    if (!plate && p->adhesion_pa > kn_probe_foundation(p) * 0.2 * def->spacing_m)
        return "adhesion would stretch the foundation by more than a fifth of a spacing: needs a stiffer foundation";
    if (def->solver.kind != KN_SOLVER_IMPLICIT && more)
        return "friction, adhesion, grip and coupling need the implicit solver";
    return NULL;
}

// Check shape and foundation of one probe.
static const char *check_probe(const kn_model_def *def, const kn_probe_def *p)
{
    const char *wrong = check_tool(def, p);
    if (!wrong) wrong = kn_tool_unfit(p, def->spacing_m);
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
    if (!(def->force_factor > 0 && isfinite(def->force_factor))) return "force_factor must be positive";
    if (!(def->spacing_m > 0 && isfinite(def->spacing_m))) return "spacing must be positive";
    if (!(def->density_kg_m3 > 0 && isfinite(def->density_kg_m3))) return "density must be positive";
    if (!(def->support_friction >= 0 && isfinite(def->support_friction))) return "friction must not be negative";
    if (!is_real(def->support_depth_m)) return "the depth of the support must not be negative";
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

// Check a whole definition: first its parts, then whether the parts fit together.
static const char *check(const kn_model_def *def)
{
    const char *wrong = check_choices(def);
    if (!wrong) wrong = kn_material_check(&def->material);
    if (!wrong) wrong = check_lattice(def);
    if (!wrong) wrong = check_solver(&def->solver);
    if (!wrong) wrong = kn_composite_check(def);
    if (!wrong && (def->probe_count < 0 || def->probe_count > KN_PROBES_MAX)) wrong = "too many probes";
    for (int p = 0; p < def->probe_count && !wrong; p++) wrong = check_probe(def, &def->probe[p]);
    if (!wrong && def->pressure != KN_PRESSURE_NONE && def->solver.dt_s > GAS_STEP_MOST_S)
        wrong = "gas needs steps of at most 30 ms: in longer ones a press takes too much of a cell's volume at once";
    return wrong;
}

// --- checks of a lattice --------------------------------------------------------------------------------------------

// Largest stiffness of a tool's foundation and of the gas: each limit is stiffness times dt, divided by the resistance
// of one node at rest (`body` below, kg/s). Above these limits, conjugate gradients in f32 (seven digits) need more
// iterations than a step allows. Both limits were measured with `knead stability`, family mixed. The limit of the gas
// is higher, because gas is stiff in only one direction of each cell.
#define FOUNDATION_MOST 500.0
#define GAS_MOST 1e4
// Largest gas pressure in f32, as a multiple of the pressure on a tool that is pressed in by one spacing. At this
// limit, the rounding error of the gas pressure is a hundredth of the pressure on the tool.
#define GAS_MOST_F32 1e4

static const char *check_stiffness(const kn_model *m)
{
    const kn_model_def *def = &m->def;
    double h = def->spacing_m, dt = def->solver.dt_s, at_rest = m->law.kind == KN_LAW_VOIGT ? 1 : m->law.slope_rest;
    // body: resistance of one node to a change of its velocity [kg/s], computed from its mass and from its edges at
    // rest
    double body = m->kappa_m * m->law.a_pa_s * at_rest + kn_model_mass(m) / m->node_count / dt;
    double gas = def->pressure != KN_PRESSURE_NONE ? kn_model_gas_pa(m) : 0;
    if (def->solver.kind != KN_SOLVER_RK4 && gas * h * dt > GAS_MOST * body)
        return "the gas inside is more than 10000 times as stiff as the object around it";
    for (int p = 0; p < def->probe_count; p++) {
        if (def->probe[p].shape == KN_PROBE_PLATE) continue;
        double foundation = kn_probe_foundation(&def->probe[p]);
        if (foundation * h * h * dt > FOUNDATION_MOST * body)
            return "the tool's foundation is more than 500 times as stiff as the object under it";
        if (def->solver.precision == KN_PRECISION_F32 && gas > GAS_MOST_F32 * foundation * h)
            return "in f32 the rounding error of the gas exceeds the pressure of a tool's soft foundation: needs "
                   "precision: f64";
    }
    return NULL;
}

// Build the shapes of the tools. Also list the nodes that the table can push, if the table can push the object at all.
// The table can push the object if the support is FRICTION, or if a tool is coupled: a coupled tool may press the
// object onto the table. Return false if memory is short.
static bool build_tools(kn_model *model)
{
    model->shape = calloc(KN_PROBES_MAX, sizeof *model->shape);
    if (!model->shape) return false;
    bool table = model->def.support == KN_SUPPORT_FRICTION;
    for (int p = 0; p < model->def.probe_count; p++) {
        kn_tool_shape(&model->def.probe[p], &model->shape[p]);
        // a coupled tool may push the object down onto the table, whatever the support: the table must stop the object
        table |= model->def.probe[p].coupling_n_m > 0 && model->def.support != KN_SUPPORT_NONE;
    }
    return !table || kn_base_build(model);
}

static bool build_tables(kn_model *m)
{
    if (!m->composite) m->tables = kn_tables_create(m, m->kernels);
    return m->composite || m->tables;
}

static bool build_rk4(kn_model *m)
{
    if (!kn_lattice_edges(m) || !kn_lattice_cells(m)) return false;
    m->rk4_limit_s = kn_rk4_limit(m);
    return m->rk4_limit_s >= 0;
}

static bool fail(char *error, size_t size, const char *text)
{
    if (size > 0) snprintf(error, size, "%s", text);
    return false;
}

// Speed of a pressing hand for the check of the flattest element. If a hand moves by an element's height in one step,
// the element turns inside out and back in every step, because a step uses the edges' directions at its beginning.
// `knead stability`, family sliver, showed: an object stays calm if its flattest element is dt times 2 cm/s high, and
// oscillates if this element is dt times 7 mm/s high.
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

// Return the area of a block's top. A row of single nodes is as wide as a flat object, or as a cell.
static double block_top(const kn_model_def *def)
{
    const double one = def->thickness_m > 0 ? def->thickness_m : def->spacing_m;
    double area = 1;
    for (int k = 0; k < 2; k++) area *= def->nodes[k] > 1 ? (def->nodes[k] - 1) * def->spacing_m : one;
    return area;
}

static bool build(kn_model *m, const kn_model_def *def, char *error, size_t size)
{
    bool rk4 = def->solver.kind == KN_SOLVER_RK4;
    m->def = *def;
    // build grid, law and kernels first, because everything else depends on them
    if (!def->mesh)
        kn_grid_init(&m->grid, def->nodes, def->spacing_m, def->thickness_m,
                     def->structure == KN_STRUCTURE_AXIS ? 0 : def->diagonal_stiffness);
    m->grid.kappa_m *= def->force_factor;
    kn_law_build(&m->law, &def->material, rk4 ? 0 : def->solver.dt_s, def->solver.precision == KN_PRECISION_F64);
    if (!kn_kernels_choose(m))
        return fail(error, size, "this processor lacks the instruction set that solver.isa asks for");
    if (!kn_coarse_plan(m)) return fail(error, size, KN_NO_MEMORY);
    // build the nodes of a mesh, of a block of two resolutions, or of a plain block
    const char *wrong;
    m->top_area_m2 = def->mesh ? 0 : block_top(def);
    if (def->mesh) wrong = kn_net_build(m);
    else if (kn_composite_is(def)) wrong = kn_composite_build(m);
    else wrong = kn_block_build(m) ? NULL : KN_NO_MEMORY;
    if (!wrong && !build_tools(m)) wrong = KN_NO_MEMORY;
    if (!wrong) wrong = check_stiffness(m);
    // build the tables of the chosen solver
    char text[160];
    if (!wrong && def->solver.kind == KN_SOLVER_FIXED)
        wrong = kn_lattice_edges(m) && kn_lattice_cells(m) ? kn_fixed_build(m, text, sizeof text) : KN_NO_MEMORY;
    else if (!wrong && (rk4 ? !build_rk4(m) : !build_tables(m))) wrong = KN_NO_MEMORY;
    if (!wrong && !kn_coarse_build(m)) wrong = KN_NO_MEMORY;
    if (wrong) return fail(error, size, wrong);
    if (!check_flattest(m, error, size)) return false;
    // refuse a Runge-Kutta step beyond its stability limit, and name the mass scale that would make this step stable
    if (rk4 && def->solver.dt_s > m->rk4_limit_s) {
        if (size > 0)
            snprintf(error, size,
                     "rk4 is stable up to dt = %.3g s here and dt = %.3g s was asked for; solver.mass_scale = %.3g "
                     "would allow it",
                     m->rk4_limit_s, def->solver.dt_s,
                     ceil(def->solver.mass_scale * def->solver.dt_s / m->rk4_limit_s * 1.05));
        return false;
    }
    return true;
}

kn_model *kn_model_build(const kn_model_def *def, char *error, size_t error_size)
{
    const kn_model_def standard = kn_model_def_default();
    if (!def) def = &standard;
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
    kn_coarse_destroy(model->coarse);
    free(model->tables);
    free(model->offset);
    free(model->row_turns);
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

// --- states ---------------------------------------------------------------------------------------------------------

// Return the number of reals that the field kn_work.cell holds for the gas pressure in the cells.
static size_t cell_reals(const kn_model *m)
{
    if (m->def.pressure == KN_PRESSURE_OBJECT) return kn_model_field(m, 3);
    return m->def.mesh ? 16 * kn_work_cells(m) : kn_model_field(m, m->grid.flat ? 8 : 24);
}

// Return the number of reals of kn_work.cut, see kernel.h. coarse_solve needs 16 for every 6 vectors of the coarse
// level, less than the rest.
static size_t cut_reals(const kn_model *m)
{
    size_t rows = m->composite || m->def.mesh ? 0 : (size_t)m->grid.len[1];
    if (m->def.mesh) return 24 * (size_t)m->row_count;
    for (int p = 0; m->composite && p < m->composite->part_count; p++) {
        const size_t each = (size_t)m->composite->part[p].grid.len[1];
        rows = each > rows ? each : rows;
    }
    return (rows + 3 * KN_TEAM_PARTS) * KN_FORWARD * m->stride;
}

// Divide the scratch memory among the arrays of the implicit solver.
static void layout_implicit(const kn_model *m, kn_arena *a, kn_scratch *s)
{
    kn_work *w = &s->work;
    // first the solver's vectors, then the values per edge, the blocks of held rows, and the values per cell
    struct {
        void **field;
        int components;
    } list[] = {{&w->guess, 3}, {&w->r, 3}, {&w->q, 3}, {&w->d, 3}, {&w->z, 3}, {&w->p, 6}, {&w->free, 3}};
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++)
        *list[i].field = kn_arena_take(a, kn_state_field(m, list[i].components));
    w->g = kn_arena_take(a, m->product_reals * kn_model_real(m));
    w->records = m->def.mesh ? kn_arena_take(a, kn_work_records(m) * kn_model_real(m)) : NULL;
    w->whole = m->composite ? kn_arena_take(a, kn_state_field(m, 6)) : NULL;
    w->cell = NULL;
    if (m->def.pressure != KN_PRESSURE_NONE) w->cell = kn_arena_take(a, cell_reals(m) * kn_model_real(m));
    w->coarse = m->coarse ? kn_arena_take(a, kn_coarse_reals(m) * kn_model_real(m)) : NULL;
    // then the flags of the rows, and the arrays of the rigid motions and of the held nodes
    w->row_held = kn_arena_take(a, (size_t)m->row_count);
    w->row_moved = kn_arena_take(a, (size_t)m->row_count);
    s->row_base = kn_arena_take(a, (size_t)m->row_count);
    s->rigid.arm = kn_rigid_wanted(m) ? kn_arena_take(a, kn_model_field(m, 4) * sizeof(float)) : NULL;
    s->last_held = kn_arena_take(a, (size_t)m->top_count * sizeof(int));
    w->sums = kn_arena_take(a, 2 * (size_t)m->row_count * sizeof *w->sums);
    w->cut = kn_arena_take(a, cut_reals(m) * kn_model_real(m));
}

// Divide the scratch memory among the arrays of the Runge-Kutta solver.
static void layout_rk4(const kn_model *m, kn_arena *a, kn_scratch *s)
{
    size_t nodes = (size_t)m->node_count;
    s->fixed = kn_arena_take(a, nodes);
    s->velocity = kn_arena_take(a, nodes * sizeof *s->velocity);
    s->force = kn_arena_take(a, nodes * sizeof *s->force);
    s->reaction = kn_arena_take(a, nodes * sizeof *s->reaction);
    s->stages = kn_arena_take(a, kn_rk4_scratch(m));
}

// Take the scratch memory of the integer solver as one piece; solver_fixed.c divides this piece itself.
static void layout_fixed(const kn_model *m, kn_arena *a, kn_scratch *s)
{
    s->stages = kn_arena_take(a, kn_fixed_scratch(m));
    if (s->stages) kn_fixed_scratch_init(m, s->stages);
}

// Lay out a state in the memory at `base` and return its size. If `base` is NULL, only measure.
static size_t layout_state(const kn_model *m, void *base)
{
    kn_arena a = {.base = base};
    kn_state unused, *state = kn_arena_take(&a, sizeof *state);
    if (!base) state = &unused;
#define KN_FIELD(name, components)                                                                                     \
    state->name = kn_arena_take(&a, kn_state_field(m, components));                                                    \
    if (kn_state_field(m, components) == 0) state->name = NULL;
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    state->held = kn_arena_take(&a, KN_PROBES_MAX * (size_t)m->top_count);
    size_t anchors = kn_contact_anchors(m);
    state->anchor = anchors > 0 ? kn_arena_take(&a, anchors * sizeof *state->anchor) : NULL;
    return a.used;
}

// Lay out a scratch in the memory at `base` and return its size. If `base` is NULL, only measure.
static size_t layout_scratch(const kn_model *m, void *base)
{
    kn_arena a = {.base = base};
    kn_scratch unused, *scratch = kn_arena_take(&a, sizeof *scratch);
    if (!base) scratch = &unused;
    void *contact = kn_arena_take(&a, kn_contact_bytes(m));
    if (base) kn_contact_init(m, &scratch->contact, contact);
    if (m->def.solver.kind == KN_SOLVER_IMPLICIT) layout_implicit(m, &a, scratch);
    else if (m->def.solver.kind == KN_SOLVER_FIXED) layout_fixed(m, &a, scratch);
    else layout_rk4(m, &a, scratch);
    return a.used;
}

size_t kn_state_size(const kn_model *model) { return layout_state(model, NULL); }
size_t kn_scratch_size(const kn_model *model) { return layout_scratch(model, NULL); }

// Allocate memory for a state or a scratch. This writes to every page now, so that no tick causes a page fault.
static void *allocate(size_t bytes)
{
    void *memory = aligned_alloc(64, bytes);
    return memory ? memset(memory, 0, bytes) : NULL;
}

kn_state *kn_state_create(const kn_model *model)
{
    kn_state *state = allocate(kn_state_size(model));
    if (state) layout_state(model, state);
    return state;
}

kn_scratch *kn_scratch_create(const kn_model *model)
{
    kn_scratch *scratch = allocate(kn_scratch_size(model));
    if (!scratch) return NULL;
    layout_scratch(model, scratch);
    kn_scratch_reset(model, scratch);
    return scratch;
}

bool kn_scratch_team(const kn_model *model, kn_scratch *scratch, kn_team *team)
{
    scratch->work.team =
        model->def.solver.kind == KN_SOLVER_IMPLICIT ? kn_work_team(model, team, team ? team->least : 0) : NULL;
    return scratch->work.team;
}

void kn_state_destroy(kn_state *state) { free(state); }
void kn_scratch_destroy(kn_scratch *scratch) { free(scratch); }

// Reset the implicit solver's scratch: clear its vectors, and mark all components of nodes as free, except those that
// the support holds.
static void reset_implicit(const kn_model *m, kn_scratch *s)
{
    kn_work *w = &s->work;
    memset(w->guess, 0, kn_state_field(m, 3));
    memset(w->q, 0, kn_state_field(m, 3));
    memset(w->d, 0, kn_state_field(m, 3));
    // the field g has room for edges that the lattice does not have; the steps never write there, so clear g here
    memset(w->g, 0, m->product_reals * kn_model_real(m));
    if (w->records) memset(w->records, 0, kn_work_records(m) * kn_model_real(m));
    memset(s->row_base, 0, (size_t)m->row_count);
    memset(w->row_moved, 0, (size_t)m->row_count);
    s->last_held_count = 0;
    // mark all components as free, then those that the support holds as held
    for (size_t i = 0; i < kn_model_field(m, 3); i++) kn_real_set(m, w->free, i, 1);
    for (int node = 0; node < m->node_count; node++) {
        size_t o = m->offset[node];
        if (m->support[node]) s->row_base[o / (3 * m->stride)] = 1;
        for (size_t k = 0; k < 3; k++) kn_real_set(m, w->free, o + k * m->stride, m->support[node] >> k & 1 ? 0 : 1);
    }
    memcpy(w->row_held, s->row_base, (size_t)m->row_count);
}

void kn_scratch_reset(const kn_model *model, kn_scratch *scratch)
{
    scratch->state = NULL;
    if (model->def.solver.kind == KN_SOLVER_IMPLICIT) reset_implicit(model, scratch);
}

void kn_state_reset(const kn_model *model, kn_state *state)
{
    // clear the plain members (anchor_count = 0 empties the list of anchors), then the fields and the held nodes
    memset(state, 0, offsetof(kn_state, displacement));
#define KN_FIELD(name, components)                                                                                     \
    if (state->name) memset(state->name, 0, kn_state_field(model, components));
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    memset(state->held, 0, KN_PROBES_MAX * (size_t)model->top_count);
}
