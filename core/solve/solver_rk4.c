#include "core/solve/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- gas ------------------------------------------------------------------------------------------------------------

// Compute the positions of the corners of cell c for the displacements x.
static void gas_corners(const kn_model *model, int c, const double *rest, const double *x, double corner[8][3])
{
    for (int i = 0; i < 8; i++) {
        int node = model->cells[c].corner[i];
        for (int k = 0; k < 3; k++) corner[i][k] = node < 0 ? 0 : rest[3 * node + k] + x[3 * node + k];
    }
}

// Return the volume of a cell, m^3, and store dV/dx of each corner, m^2.
static double gas_volume(const kn_model *model, const double corner[8][3], double gradient[8][3])
{
    return model->def.mesh ? kn_simplex_volume(model->def.thickness_m, corner, gradient)
                           : kn_cell_volume(&model->grid, corner, gradient);
}

// Add the forces over_pa dV/dx to f at the corners of a cell.
static void push_corners(const kn_cell *cell, double force_pa, const double gradient[8][3], double *f)
{
    for (int i = 0; i < 8 && cell->corner[i] >= 0; i++)
        for (int k = 0; k < 3; k++) f[3 * cell->corner[i] + k] += force_pa * gradient[i][k];
}

void kn_gas_push(const kn_model *model, const double *rest, const double *x, double *f)
{
    double corner[8][3], gradient[8][3], slope, sum = 0, sum0 = 0;
    bool whole = model->def.pressure == KN_PRESSURE_OBJECT;
    // pass 0 sums the volume of the whole object, pass 1 adds the forces
    for (int pass = whole ? 0 : 1; pass < 2; pass++)
        for (int c = 0; c < model->cell_count; c++) {
            gas_corners(model, c, rest, x, corner);
            double volume = gas_volume(model, (const double(*)[3])corner, gradient);
            if (pass == 0) {
                sum0 += model->cell_volume[c];
                sum += volume;
                continue;
            }
            double over = kn_cell_pressure(whole ? sum / sum0 : volume / model->cell_volume[c], &slope);
            push_corners(&model->cells[c], over * kn_model_gas_pa(model), (const double(*)[3])gradient, f);
        }
}

// --- Runge-Kutta ----------------------------------------------------------------------------------------------------

// Layout of the integrated vector y = [x: 3 per node][v: 3 per node][u: 1 per edge], with nodes and edges in the order
// of their ids. Once per step, the fields of the state, which have padding, are copied to y and back.
typedef struct shape {
    // x, v, u: offsets of displacements, velocities and strains in y; count: number of reals in y
    size_t x, v, u, count;
} shape;

static shape shape_of(const kn_model *model)
{
    size_t nodes = 3 * (size_t)model->node_count;
    size_t strains = model->law.kind == KN_LAW_VOIGT ? 0 : (size_t)model->edge_count;
    return (shape){.x = 0, .v = nodes, .u = 2 * nodes, .count = 2 * nodes + strains};
}

size_t kn_rk4_scratch(const kn_model *model)
{
    size_t reals = 4 * shape_of(model).count + 3 * (size_t)model->node_count; // y0, y, y', sum, rest positions
    return (reals * sizeof(double) + 63) / 64 * 64;
}

static void gather(const kn_model *model, const void *field, double *out)
{
    for (int i = 0; i < model->node_count; i++)
        for (size_t k = 0; k < 3; k++) *out++ = ((const double *)field)[model->offset[i] + k * model->stride];
}

static void scatter(const kn_model *model, const double *in, void *field)
{
    for (int i = 0; i < model->node_count; i++)
        for (size_t k = 0; k < 3; k++) ((double *)field)[model->offset[i] + k * model->stride] = *in++;
}

// Return the length of an edge, and store its unit vector from i to j and the growth rate of its length.
static double edge_geometry(const double *rest, const double *x, const double *v, const kn_edge *e, double n[3],
                            double *rate)
{
    const size_t i = 3 * (size_t)e->i, j = 3 * (size_t)e->j;
    double square = 0;
    for (size_t k = 0; k < 3; k++) {
        n[k] = (rest[j + k] - rest[i + k]) + (x[j + k] - x[i + k]);
        square += n[k] * n[k];
    }
    double length = sqrt(square);
    *rate = 0;
    for (size_t k = 0; k < 3; k++) {
        n[k] = length > 0 ? n[k] / length : 0; // an edge of length 0 has no direction and exerts no force
        *rate += n[k] * (v[j + k] - v[i + k]);
    }
    return length;
}

// Return true if a damper is at the stop towards which the stress s drives the damper. `inwards`: distance by which the
// damper has moved inwards, divided by the edge's rest length.
static bool at_stop(const kn_law *law, double s, double inwards)
{
    return s < 0 ? -inwards <= law->in + KN_LAW_STROKE_ENDS : -inwards >= law->out - KN_LAW_STROKE_ENDS;
}

// Add the force of every edge to f, 3 reals per node, and compute u' of every edge.
static void edge_forces(const kn_model *model, shape at, const double *rest, const double *y, double *f, double *du)
{
    const kn_law *law = &model->law;
    bool voigt = law->kind == KN_LAW_VOIGT;
    for (int e = 0; e < model->edge_count; e++) {
        const kn_edge *edge = &model->edges[e];
        double n[3], rate;
        double length = edge_geometry(rest, y + at.x, y + at.v, edge, n, &rate);
        double per_m = 1.0 / (model->gamma * edge->rest_m); // length to strain
        double w = rate * per_m;
        double u = voigt ? (length - edge->rest_m) * per_m : y[at.u + (size_t)e];
        // solve the law for the stress; at a stop the damper is rigid, and the stress is b
        double b = law->a_pa_s * w + law->mat.k1_pa * u, s = kn_law_stress(law, b);
        bool still = law->stroke && at_stop(law, s, model->gamma * (u + (edge->rest_m - length) * per_m));
        if (still) s = b;
        if (!voigt) du[e] = still ? w : w - kn_material_flow(&law->mat, s);
        double tension = s * model->kappa_m * edge->weight / per_m;
        for (size_t k = 0; k < 3; k++) {
            f[3 * (size_t)edge->i + k] += tension * n[k];
            f[3 * (size_t)edge->j + k] -= tension * n[k];
        }
    }
}

// Compute dy = y'. At fixed components, subtract `share` times the force of the lattice and loads from the reaction.
static void derivative(const kn_model *model, const kn_boundary *b, const double *rest, const double *y, double *dy,
                       double share)
{
    shape at = shape_of(model);
    size_t nodes = (size_t)model->node_count;
    double *f = dy + at.v;
    // add external loads and weight, then the forces of the edges, then the forces of the gas
    for (size_t i = 0; i < nodes; i++)
        for (size_t k = 0; k < 3; k++) f[3 * i + k] = b->force_n ? b->force_n[i][k] : 0.0;
    for (size_t i = 0; i < nodes; i++) f[3 * i + 2] -= model->node_mass_kg[i] * model->def.gravity_m_s2;
    edge_forces(model, at, rest, y, f, dy + at.u);
    kn_gas_push(model, rest, y + at.x, f);
    // turn forces into accelerations; a fixed component has no acceleration
    for (size_t i = 0; i < nodes; i++)
        for (size_t k = 0; k < 3; k++) {
            double *acceleration = &f[3 * i + k];
            if (b->fixed[i] >> k & 1) {
                b->reaction_n[i][k] -= share * *acceleration;
                *acceleration = 0;
            } else {
                *acceleration /= model->node_mass_kg[i] * model->def.solver.mass_scale;
            }
        }
    memcpy(dy + at.x, y + at.v, 3 * nodes * sizeof *dy);
}

// Set fixed components to their prescribed velocities at once. The reaction begins with the force of this change.
static void prescribe(const kn_model *model, const kn_boundary *b, double *v)
{
    for (size_t i = 0; i < (size_t)model->node_count; i++)
        for (size_t k = 0; k < 3; k++) {
            b->reaction_n[i][k] = 0;
            if (!(b->fixed[i] >> k & 1)) continue;
            double mass = model->node_mass_kg[i] * model->def.solver.mass_scale;
            b->reaction_n[i][k] = mass * (b->velocity_m_s[i][k] - v[3 * i + k]) / model->def.solver.dt_s;
            v[3 * i + k] = b->velocity_m_s[i][k];
        }
}

void kn_rk4_step(const kn_model *model, kn_state *state, const kn_boundary *boundary, void *scratch)
{
    static const double reach[4] = {0, 0.5, 0.5, 1}, share[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    shape at = shape_of(model);
    double dt = model->def.solver.dt_s;
    double *y0 = scratch, *y = y0 + at.count, *dy = y + at.count, *sum = dy + at.count, *rest = sum + at.count;

    // copy the fields of the state to y0
    memcpy(rest, model->rest_m, (size_t)model->node_count * sizeof *model->rest_m);
    gather(model, state->displacement, y0 + at.x);
    gather(model, state->velocity, y0 + at.v);
    double *strain = state->strain;
    if (at.count > at.u)
        for (int e = 0; e < model->edge_count; e++) y0[at.u + (size_t)e] = strain[model->edges[e].slot];
    prescribe(model, boundary, y0 + at.v);

    // four stages: each evaluates y' at a point on the slope of the stage before
    memset(sum, 0, at.count * sizeof *sum);
    memset(dy, 0, at.count * sizeof *dy);
    for (int stage = 0; stage < 4; stage++) {
        for (size_t i = 0; i < at.count; i++) y[i] = y0[i] + reach[stage] * dt * dy[i];
        derivative(model, boundary, rest, y, dy, share[stage]);
        for (size_t i = 0; i < at.count; i++) sum[i] += share[stage] * dy[i];
    }
    for (size_t i = 0; i < at.count; i++) y0[i] += dt * sum[i];

    // copy the result y0 back to the fields of the state
    scatter(model, y0 + at.x, state->displacement);
    scatter(model, y0 + at.v, state->velocity);
    if (at.count > at.u)
        for (int e = 0; e < model->edge_count; e++) strain[model->edges[e].slot] = y0[at.u + (size_t)e];
}

// Compute q = M^-1/2 (sum (1/V0) G G^T over the cells) M^-1/2 d at rest, with G = dV/dx. The matrix is the stiffness of
// gas at a pressure of 1 Pa, scaled by the masses.
static void apply_cells(const kn_model *model, const double *rest, const double *root, const double *zero,
                        const double *d, double *q)
{
    memset(q, 0, 3 * (size_t)model->node_count * sizeof *q);
    for (int c = 0; c < model->cell_count; c++) {
        const int *node = model->cells[c].corner;
        double corner[8][3], gradient[8][3], rate = 0;
        gas_corners(model, c, rest, zero, corner);
        double volume = gas_volume(model, (const double(*)[3])corner, gradient);
        for (int i = 0; i < 8 && node[i] >= 0; i++)
            for (int k = 0; k < 3; k++) rate += gradient[i][k] * d[3 * node[i] + k] / root[node[i]];
        for (int i = 0; i < 8 && node[i] >= 0; i++)
            for (int k = 0; k < 3; k++) q[3 * node[i] + k] += gradient[i][k] * rate / (volume * root[node[i]]);
    }
}

// Compute q = M^-1/2 (sum kappa weight n n^T) M^-1/2 d at rest. The support is ignored, because held nodes can only
// slow down the fastest mode.
static void apply_rest(const kn_model *model, const double *rest, const double *root, const double *zero,
                       const double *d, double *q)
{
    memset(q, 0, 3 * (size_t)model->node_count * sizeof *q);
    for (int e = 0; e < model->edge_count; e++) {
        const kn_edge *edge = &model->edges[e];
        size_t i = (size_t)edge->i, j = (size_t)edge->j;
        double n[3], rate, along = 0;
        edge_geometry(rest, zero, zero, edge, n, &rate);
        for (size_t k = 0; k < 3; k++) along += n[k] * (d[3 * j + k] / root[j] - d[3 * i + k] / root[i]);
        along *= model->kappa_m * edge->weight;
        for (size_t k = 0; k < 3; k++) {
            q[3 * i + k] -= along * n[k] / root[i];
            q[3 * j + k] += along * n[k] / root[j];
        }
    }
}

// Return the largest eigenvalue of the matrix of apply_rest, or of apply_cells if `of_cells`, m/kg, by power iteration.
// `work` holds 13 reals per node.
static double largest_eigenvalue(const kn_model *model, bool of_cells, double *work)
{
    size_t nodes = (size_t)model->node_count;
    double *rest = work, *zero = rest + 3 * nodes, *d = zero + 3 * nodes, *q = d + 3 * nodes, *root = q + 3 * nodes;
    memset(zero, 0, 3 * nodes * sizeof *zero);
    for (size_t i = 0; i < nodes; i++) {
        memcpy(rest + 3 * i, model->rest_m[i], sizeof model->rest_m[i]);
        root[i] = sqrt(model->node_mass_kg[i] * model->def.solver.mass_scale);
    }
    // Start from a pseudo-random vector. The fastest mode alternates from node to node, and a random vector has a part
    // along this mode, whatever the symmetry of the lattice.
    for (size_t i = 0; i < 3 * nodes; i++) d[i] = (double)((i * 2654435761u >> 7) % 1000) / 500.0 - 1.0;
    double eigenvalue = 0;
    // 200 iterations give the result of 2000 iterations to 0.5 % on blocks of 144 to 5 733 nodes
    for (int turn = 0; turn < 200; turn++) {
        double norm = 0;
        for (size_t i = 0; i < 3 * nodes; i++) norm += d[i] * d[i];
        norm = sqrt(norm);
        for (size_t i = 0; i < 3 * nodes; i++) d[i] /= norm;
        (of_cells ? apply_cells : apply_rest)(model, rest, root, zero, d, q);
        eigenvalue = 0;
        for (size_t i = 0; i < 3 * nodes; i++) eigenvalue += d[i] * q[i];
        memcpy(d, q, 3 * nodes * sizeof *d);
    }
    return eigenvalue;
}

double kn_rk4_limit(const kn_model *model)
{
    const kn_law *law = &model->law;
    double *work = malloc(13 * (size_t)model->node_count * sizeof *work);
    if (!work) return -1;
    double lattice = largest_eigenvalue(model, false, work);
    // gas with one pressure for the whole object is softer than gas in cells, so the eigenvalue is an upper bound
    double gas = model->cell_count == 0 ? 0 : kn_model_gas_pa(model) * largest_eigenvalue(model, true, work);
    free(work);
    double damping = lattice * law->a_pa_s * law->slope_rest;
    double ringing = sqrt(lattice * law->mat.k1_pa + gas);
    // creep: rate of the Voigt element by itself
    double creep = law->mat.k1_pa / (law->mat.c1_pa_s + kn_material_c2(&law->mat, INFINITY));
    // the fastest of the three rates limits the step
    return 2.785 / fmax(damping, fmax(ringing, creep));
}
