#include "clients/sweep/tick_cost.h"
#include "core/lattice/lattice.h"
#include "core/shape.h"
#include "core/solve/contact.h"
#include "core/solve/kernel.h"
#include "core/solve/step_effort.h"

#include <math.h>
#include <stdio.h>

// Computing times per SIMD lane of the padded lattice, ns, by instruction set (base, avx2, avx512) and precision (f32,
// f64). once_ns is the time of all edges per linearisation, iteration_ns the time per iteration of conjugate gradients
// (CG). Both were measured on one core of a Sapphire Rapids. A processor without fused multiply-add (base) computes it
// in software.
static const double once_ns[3][2] = {{1200, 2700}, {66, 150}, {34, 78}};
static const double iteration_ns[3][2] = {{100, 190}, {7.2, 18}, {4.3, 11}};

// The same times of a mesh. An element of gas takes element_ns and element_iteration_ns, with avx512 in f32.
static const double mesh_once_ns[3][2] = {{600, 1200}, {45, 175}, {40, 120}};
static const double mesh_iteration_ns[3][2] = {{350, 390}, {10.5, 24}, {9.5, 21}};
static const double element_ns = 11, element_iteration_ns = 5;

// Computing time of the coarse level per iteration, ns: per SIMD lane, and per element of its matrix, with avx512 in
// f32.
static const double coarse_ns = 0.9, coarse_element_ns = 0.06;

// Computing times per node whose motion is interpolated from other nodes, ns. Such nodes exist in a composite (a
// lattice with two resolutions).
#define TIE_NS 50.0
#define TIE_ITERATION_NS 15.0

// Computing time of the edges of one SIMD lane, ns, if each edge is solved separately by Newton's method.
#define NEWTON_NS 1700.0

// law_share: computing time of each material law, as a fraction of once_ns. gas_ns, gas_iteration_ns: time that gas
// adds per SIMD lane, ns, per linearisation and per CG iteration; indexed by kn_pressure.
static const double law_share[] = {
    [KN_LAW_VOIGT] = 0.85, [KN_LAW_LINEAR] = 0.8, [KN_LAW_TABLE] = 1, [KN_LAW_EXACT] = 1};
static const double gas_ns[] = {0, 6, 4}, gas_iteration_ns[] = {0, 1.8, 0.5};

bool kn_tick_cost_newton(const kn_model *model)
{
    bool f64 = model->def.solver.precision == KN_PRECISION_F64;
    return model->law.kind == KN_LAW_EXACT && !(f64 && kn_law_in_lanes(&model->law));
}

// Return the index of the model's instruction set in the tables once_ns and iteration_ns.
static int isa_of(const kn_model *m) { return m->isa == KN_ISA_AVX512 ? 2 : m->isa == KN_ISA_AVX2 ? 1 : 0; }

// Return how much slower than avx512 in f32 the kernels of the model are.
static double slower_of(const kn_model *m)
{
    return once_ns[isa_of(m)][m->def.solver.precision == KN_PRECISION_F64] / once_ns[2][0];
}

// Return the computing cost of all edges and nodes of the lattice or mesh.
static kn_tick_cost_part edges(const kn_model *m)
{
    static const char *const law[] = {"no damper", "constant damper", "damper by table", "damper exactly"};
    kn_tick_cost_part p = {.name = ""};
    const bool f64 = m->def.solver.precision == KN_PRECISION_F64;
    const double nodes = (double)kn_model_field(m, 1);
    snprintf(p.name, sizeof p.name, "edges, %s%s", law[m->law.kind], m->law.stroke ? " with stops" : "");
    const bool mesh = m->def.mesh != NULL;
    p.once_us = 1e-3 * nodes * (mesh ? mesh_once_ns : once_ns)[isa_of(m)][f64] * law_share[m->law.kind];
    p.iteration_us = 1e-3 * nodes * (mesh ? mesh_iteration_ns : iteration_ns)[isa_of(m)][f64];
    if (kn_tick_cost_newton(m)) p.once_us += 1e-3 * nodes * NEWTON_NS;
    // Add the time of nodes that are interpolated from other nodes, because every matrix product interpolates them.
    p.once_us += 1e-3 * TIE_NS * kn_composite_tied(m);
    p.iteration_us += 1e-3 * TIE_ITERATION_NS * kn_composite_tied(m);
    return p;
}

// Return the computing cost of the gas, which is either in each cell or in the whole object.
static kn_tick_cost_part gas(const kn_model *m)
{
    const bool cells = m->def.pressure == KN_PRESSURE_CELLS;
    // gas_ns was measured with avx512 in f32. For other instruction sets and precisions, scale gas_ns by the ratio of
    // the edge times once_ns.
    double slower = slower_of(m), nodes = (double)kn_model_field(m, 1);
    double count = m->def.mesh ? m->def.mesh->element_count : nodes;
    kn_tick_cost_part p = {.once_us = 1e-3 * count * gas_ns[m->def.pressure] * slower,
                           .iteration_us = 1e-3 * count * gas_iteration_ns[m->def.pressure] * slower};
    snprintf(p.name, sizeof p.name, "gas in %s", cells ? "the cells" : "the object");
    if (m->def.mesh) {
        p.once_us = 1e-3 * count * element_ns * slower;
        p.iteration_us = 1e-3 * count * element_iteration_ns * slower;
    }
    return p;
}

// Return the computing cost of the coarse level of the preconditioner.
static kn_tick_cost_part coarse(const kn_model *m)
{
    const double nodes = (double)kn_model_field(m, 1);
    const double elements = (double)m->coarse->unknowns * m->coarse->padded;
    kn_tick_cost_part p = {.name = ""};
    snprintf(p.name, sizeof p.name, "coarse level, %d nodes", m->coarse->unknowns / 3);
    p.iteration_us = 1e-3 * (coarse_ns * nodes + coarse_element_ns * elements) * slower_of(m);
    return p;
}

// Return the estimated area of the object's skin that a tool touches, m^2. A ball or fingertip is assumed to be pressed
// in by half its radius. A union or mesh is assumed to touch with half of its bounding rectangle, any other shape with
// its whole face.
static double touched_m2(const kn_probe_def *probe)
{
    const double r = probe->radius_m, *size = probe->size_m;
    switch (probe->shape) {
    case KN_PROBE_BOX: return size[0] * size[1];
    case KN_PROBE_CROSS: return 2 * size[0] * size[1] - size[1] * size[1];
    case KN_PROBE_CYLINDER: return 3.1416 * r * r;
    case KN_PROBE_UNION:
    case KN_PROBE_MESH: return 0.5 * kn_shape_span(probe->parts, 0) * kn_shape_span(probe->parts, 1);
    default: return 3.1416 * 0.75 * r * r;
    }
}

// Return the computing cost of the contact of one tool. A plate has to find its nodes and solves a second law for the
// edges on these nodes. Any other shape has a cost per sample. Friction adds the cost per sample once more, because
// each sample must be kept within its friction cone. Coupling also adds the cost per sample once more.
static kn_tick_cost_part contact(const kn_model *m, int index)
{
    static const char *const shape[] = {"plate", "ball", "capsule", "box", "cross", "cylinder", "union", "mesh"};
    const kn_probe_def *probe = &m->def.probe[index];
    kn_tick_cost_part p = {.contact = true};
    double h = m->def.spacing_m;
    if (probe->shape == KN_PROBE_PLATE) {
        snprintf(p.name, sizeof p.name, "plate %s", probe->name);
        p.once_us = 0.02 * m->top_count;
        return p;
    }
    // Number of contact samples per node spacing and direction.
    double per = kn_samples_per_patch(h, m->shape[index].fine_m),
           more = 1 + (probe->coupling_n_m > 0) + (probe->friction > 0);
    double extent_m[3];
    kn_model_def_extent(&m->def, extent_m);
    double samples = fmin(touched_m2(probe), extent_m[0] * extent_m[1]) / (h * h) * per * per;
    snprintf(p.name, sizeof p.name, "%s %s, about %.0f samples", shape[probe->shape], probe->name, samples);
    p.once_us = samples * 0.12 * more;
    p.iteration_us = samples * 0.008 * more;
    return p;
}

int kn_tick_cost_parts(const kn_model *model, kn_tick_cost_part part[KN_TICK_COST_PARTS])
{
    int count = 0;
    part[count++] = edges(model);
    if (model->coarse) part[count++] = coarse(model);
    if (model->def.pressure != KN_PRESSURE_NONE) part[count++] = gas(model);
    for (int p = 0; p < model->def.probe_count; p++) part[count++] = contact(model, p);
    return count;
}

// Return the computing time of one linearisation with the given number of CG iterations, us.
static double line_us(const kn_model *model, double iterations)
{
    kn_tick_cost_part part[KN_TICK_COST_PARTS];
    double us = 0, dearest = 0;
    // The times of all parts are added, but among the contacts only the most expensive contact counts.
    for (int i = kn_tick_cost_parts(model, part) - 1; i >= 0; i--) {
        double own = part[i].once_us + iterations * part[i].iteration_us;
        if (part[i].contact) dearest = fmax(dearest, own); // because probes seldom press at the same time
        else us += own;
    }
    return us + dearest;
}

double kn_tick_cost_us(const kn_model *model, const kn_effort *effort, bool at_cap)
{
    int usual = effort->iterations < effort->iterations_max ? effort->iterations + 1 : effort->iterations;
    // a long step that takes its linearisations on demand rarely takes a second one
    const bool one = kn_step_on_demand(model, effort->passes) && !at_cap;
    const int lines = one ? 1 : kn_impact_lines(model, effort->passes);
    return lines * line_us(model, at_cap ? effort->iterations_max : usual);
}

double kn_tick_cost_blow_us(const kn_model *model, const kn_effort *effort)
{
    const int lines = kn_impact_lines(model, effort->passes);
    // No step is solved again if the material law is linear, or if every step already has the largest number of
    // linearisations.
    if (isinf(kn_impact_power(model)) || lines >= KN_IMPACT_PASSES) return 0;
    return KN_IMPACT_PASSES * line_us(model, effort->iterations_max);
}
