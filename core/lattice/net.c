#include "core/lattice/lattice.h"
#include "core/algebra/algebra.h"
#include "core/law.h"
#include "core/solve/coarse.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void difference(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

// --- edges ----------------------------------------------------------------------------------------------------------

typedef struct side { // side of one element, or the sum of equal sides of several elements
    int i, j, element;
    double kappa_m;
} side;

// Compare two sides for qsort: by their end nodes, then by element, so that sums do not depend on the order of equal
// keys.
static int by_ends(const void *a, const void *b)
{
    const side *x = a, *y = b;
    if (x->i != y->i) return x->i < y->i ? -1 : 1;
    if (x->j != y->j) return x->j < y->j ? -1 : 1;
    return (x->element > y->element) - (x->element < y->element);
}

// Return the volume of an element, m^3; for a triangle, its area times the thickness.
static double volume_of(const kn_model *m, const int element[4])
{
    const kn_simplices *s = m->def.mesh;
    double a[3], b[3], c[3], ab[3];
    difference(s->x_m[element[1]], s->x_m[element[0]], a);
    difference(s->x_m[element[2]], s->x_m[element[0]], b);
    kn_cross(a, b, ab);
    if (s->dimension == 2) return 0.5 * sqrt(kn_dot(ab, ab)) * m->def.thickness_m;
    difference(s->x_m[element[3]], s->x_m[element[0]], c);
    return kn_dot(ab, c) / 6;
}

// List all sides of all elements, with kappa = V/L^2 for each.
static int list_sides(const kn_model *m, side *sides)
{
    const kn_simplices *s = m->def.mesh;
    int count = 0;
    for (int e = 0; e < s->element_count; e++) {
        double volume = volume_of(m, s->element[e]);
        for (int a = 0; a <= s->dimension; a++)
            for (int b = a + 1; b <= s->dimension; b++) {
                int i = s->element[e][a], j = s->element[e][b];
                double d[3];
                difference(s->x_m[i], s->x_m[j], d);
                sides[count++] = (side){i < j ? i : j, i < j ? j : i, e, volume / kn_dot(d, d)};
            }
    }
    return count;
}

// Merge the sides that elements share into edges. The model's kappa is the mean of the edges' kappa. The weight of an
// edge is its kappa divided by this mean.
static bool build_edges(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    side *sides = malloc((size_t)s->element_count * (s->dimension == 2 ? 3 : 6) * sizeof *sides);
    if (!sides) return false;
    int count = list_sides(m, sides), merged = 0;
    qsort(sides, (size_t)count, sizeof *sides, by_ends);
    for (int k = 0; k < count; k++) {
        bool same = merged > 0 && sides[merged - 1].i == sides[k].i && sides[merged - 1].j == sides[k].j;
        if (same) sides[merged - 1].kappa_m += sides[k].kappa_m;
        else sides[merged++] = sides[k];
    }
    m->edges = calloc((size_t)merged, sizeof *m->edges);
    m->edge_count = m->edges ? merged : 0;
    m->kappa_m = 0;
    for (int k = 0; k < m->edge_count; k++) m->kappa_m += sides[k].kappa_m / merged;
    for (int k = 0; k < m->edge_count; k++) {
        double d[3];
        difference(s->x_m[sides[k].i], s->x_m[sides[k].j], d);
        m->edges[k] = (kn_edge){sides[k].i, sides[k].j, k, sides[k].kappa_m / m->kappa_m, sqrt(kn_dot(d, d))};
    }
    free(sides);
    return m->edges != NULL;
}

// --- skin -----------------------------------------------------------------------------------------------------------

// A facet: a face of a tetrahedron, with its corners counter-clockwise seen from outside, or a side of a triangle, with
// third corner -1.
typedef struct facet {
    int corner[3], sorted[3];
} facet;

static int by_corners(const void *a, const void *b)
{
    return memcmp(((const facet *)a)->sorted, ((const facet *)b)->sorted, sizeof((const facet *)a)->sorted);
}

// Make a facet, with its corners also sorted for comparison.
static facet facet_of(int a, int b, int c)
{
    facet f = {{a, b, c}, {a, b, c}};
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < 2; k++)
            if (f.sorted[k] > f.sorted[k + 1]) {
                int swap = f.sorted[k];
                f.sorted[k] = f.sorted[k + 1];
                f.sorted[k + 1] = swap;
            }
    return f;
}

// Return the facets that belong to one element only, and store their number. The caller frees them. Return NULL if
// memory is short.
static facet *outer_facets(const kn_simplices *s, int *count)
{
    static const int solid[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}, flat[3][2] = {{0, 1}, {1, 2}, {2, 0}};
    int per = s->dimension + 1, all = 0;
    facet *f = malloc((size_t)s->element_count * (size_t)per * sizeof *f);
    if (!f) return NULL;
    for (int e = 0; e < s->element_count; e++)
        for (int k = 0; k < per; k++) {
            const int *x = s->element[e];
            f[all++] = s->dimension == 3 ? facet_of(x[solid[k][0]], x[solid[k][1]], x[solid[k][2]])
                                         : facet_of(x[flat[k][0]], x[flat[k][1]], -1);
        }
    qsort(f, (size_t)all, sizeof *f, by_corners);
    *count = 0;
    for (int k = 0; k < all; k++) {
        bool lone = (k == 0 || by_corners(&f[k - 1], &f[k])) && (k + 1 == all || by_corners(&f[k + 1], &f[k]));
        if (lone) f[(*count)++] = f[k];
    }
    return f;
}

// Compute the area of a facet as a vector that points outwards, m^2. The area of a triangle's side is its length times
// the thickness.
static void facet_area(const kn_model *m, const facet *f, double area_m2[3])
{
    const kn_simplices *s = m->def.mesh;
    double a[3], b[3];
    difference(s->x_m[f->corner[1]], s->x_m[f->corner[0]], a);
    // the corners of a triangle turn from x to z, so the outward normal of side (dx, dz) is (dz, -dx)
    if (s->dimension == 2) {
        area_m2[0] = a[2] * m->def.thickness_m;
        area_m2[1] = 0;
        area_m2[2] = -a[0] * m->def.thickness_m;
        return;
    }
    difference(s->x_m[f->corner[2]], s->x_m[f->corner[0]], b);
    kn_cross(a, b, area_m2);
    for (int k = 0; k < 3; k++) area_m2[k] *= 0.5;
}

// A facet belongs to the top, which plates press, if its outward normal is within 60 degrees of the z axis. This
// number is the cosine of that angle.
#define TOP_COSINE 0.5

// List the nodes of the top with their shares in a load. A node's share is proportional to the horizontal area of its
// facets.
static void build_top(kn_model *m, const facet *facets, int count)
{
    double *share = m->top_share, sum = 0; // shares are indexed by node until the list of top nodes is made
    for (int f = 0; f < count; f++) {
        double area[3];
        facet_area(m, &facets[f], area);
        if (area[2] < TOP_COSINE * sqrt(kn_dot(area, area))) continue;
        for (int k = 0; k < m->def.mesh->dimension; k++) share[facets[f].corner[k]] += area[2];
        sum += area[2] * m->def.mesh->dimension;
    }
    m->top_area_m2 = sum / m->def.mesh->dimension;
    kn_top_list(m, sum);
}

// Build the triangles of the outside. For a flat object, each of its triangles is listed twice: seen from one side, and
// from the other.
static bool build_skin(kn_model *m, const facet *facets, int count)
{
    const kn_simplices *s = m->def.mesh;
    m->skin_count = s->dimension == 3 ? count : 2 * s->element_count;
    m->skin = malloc((size_t)m->skin_count * sizeof *m->skin);
    if (!m->skin) return false;
    for (int k = 0; k < m->skin_count; k++) {
        if (s->dimension == 3) {
            memcpy(m->skin[k], facets[k].corner, sizeof *m->skin);
        } else {
            const int *e = s->element[k / 2];
            for (int c = 0; c < 3; c++) m->skin[k][c] = e[k % 2 ? 2 - c : c];
        }
    }
    return true;
}

// --- nodes ----------------------------------------------------------------------------------------------------------

// Give every node its share of the elements' masses.
static void build_masses(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    for (int e = 0; e < s->element_count; e++) {
        double mass = m->def.density_kg_m3 * volume_of(m, s->element[e]) / (s->dimension + 1);
        for (int k = 0; k <= s->dimension; k++) m->node_mass_kg[s->element[e][k]] += mass;
    }
}

// Hold the lowest nodes, which stand on the table, or those up to a height, and keep a flat object in its plane.
static void build_support(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < s->node_count; i++) {
        low = fmin(low, s->x_m[i][2]), high = fmax(high, s->x_m[i][2]);
        for (int k = 0; k < 3; k++) m->size_m = fmax(m->size_m, 2 * fabs(s->x_m[i][k]));
    }
    for (int i = 0; i < s->node_count; i++) {
        bool base = s->x_m[i][2] <= low + fmax(m->def.support_depth_m, 1e-6 * (high - low));
        m->support[i] = (uint8_t)((base ? kn_support_mask(m->def.support) : 0) | (s->dimension == 2 ? 2 : 0));
    }
}

// Make every element a cell of gas.
static bool build_cells(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    if (m->def.pressure == KN_PRESSURE_NONE) return true;
    if (!kn_model_cells(m, s->element_count)) return false;
    for (int c = 0; c < m->cell_count; c++) {
        for (int i = 0; i < 8; i++) m->cells[c].corner[i] = -1;
        memcpy(m->cells[c].corner, s->element[c], sizeof s->element[c]); // a triangle's fourth corner is -1
        m->cell_volume[c] = volume_of(m, s->element[c]);
    }
    return true;
}

// --- tension and creep of a specimen --------------------------------------------------------------------------------

// Test of a net: measure its elastic constants, and find the gamma with which the net creeps like the 1-D element. A
// uniform stress sigma loads the whole outside of the body, whatever its shape: traction = sigma . normal. The mean
// strain also follows from the outside: 1/V sum of u (x) area. The creep strain follows from all nodes, by the linear
// map that fits their displacements best. The test corresponds to the frictionless tension test of a block, but the net
// needs no flat ends.

typedef struct mesh_specimen { // a net under test; strains are small, so directions and areas are those at rest
    int nodes, edges;
    bool flat;
    const double (*x_m)[3];     // [nodes] rest positions
    const double (*area_m2)[3]; // [nodes] outward vector of the surface area that belongs to a node; 0 at inner nodes
    const kn_edge *edge;        // [edges]
    double kappa_m, volume_m3;
} mesh_specimen;

// Memory of a test. `x` to `f` and `moved`: three reals per node. Per edge: `n`, the unit vector; `k`, the stiffness;
// `u`, the strain of the law.
typedef struct bench {
    const mesh_specimen *s;
    double *x, *r, *z, *d, *q, *jacobi, *f;
    double *moved; // displacements in the creep test
    double *n, *k, *u;
    double *memory;
} bench;

// Allocate all vectors in one block, and compute the edges' unit vectors.
static bool bench_open(bench *b, const mesh_specimen *s)
{
    size_t reals = 3 * (size_t)s->nodes, edges = (size_t)s->edges;
    b->s = s;
    b->memory = calloc(8 * reals + 5 * edges, sizeof *b->memory);
    if (!b->memory) return false;
    double **field[] = {&b->x, &b->r, &b->z, &b->d, &b->q, &b->jacobi, &b->f, &b->moved};
    for (size_t i = 0; i < 8; i++) *field[i] = b->memory + i * reals;
    b->n = b->memory + 8 * reals;
    b->k = b->n + 3 * edges;
    b->u = b->k + edges;
    for (size_t e = 0; e < edges; e++)
        for (size_t c = 0; c < 3; c++)
            b->n[3 * e + c] = (s->x_m[s->edge[e].j][c] - s->x_m[s->edge[e].i][c]) / s->edge[e].rest_m;
    return true;
}

// Return the change of an edge's length if the nodes move by the field x.
static double growth(const bench *b, int e, const double *x)
{
    const double *n = b->n + 3 * e, *i = x + 3 * b->s->edge[e].i, *j = x + 3 * b->s->edge[e].j;
    return n[0] * (j[0] - i[0]) + n[1] * (j[1] - i[1]) + n[2] * (j[2] - i[2]);
}

// Add the forces of an edge's tension to both of its ends.
static void pull(const bench *b, int e, double tension, double *f)
{
    const double *n = b->n + 3 * e;
    for (int c = 0; c < 3; c++) {
        f[3 * b->s->edge[e].i + c] += tension * n[c];
        f[3 * b->s->edge[e].j + c] -= tension * n[c];
    }
}

static double inner(const double *a, const double *b, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += a[i] * b[i];
    return sum;
}

static double precondition(bench *b)
{
    int count = 3 * b->s->nodes;
    for (int i = 0; i < count; i++) b->z[i] = b->jacobi[i] > 0 ? b->r[i] / b->jacobi[i] : 0;
    return inner(b->r, b->z, count);
}

// Solve K dx = r by conjugate gradients with a Jacobi preconditioner, and add dx to x. Stop when the residual has
// fallen to `part` times the initial residual. K is singular for rigid motions, but the loads balance, so there is a
// solution.
static void solve(bench *b, double part)
{
    int count = 3 * b->s->nodes, most = 20 * (int)cbrt((double)count) + 200;
    memset(b->jacobi, 0, (size_t)count * sizeof *b->jacobi);
    for (int e = 0; e < b->s->edges; e++)
        for (int c = 0; c < 3; c++) {
            double stiff = b->k[e] * b->n[3 * e + c] * b->n[3 * e + c];
            b->jacobi[3 * b->s->edge[e].i + c] += stiff;
            b->jacobi[3 * b->s->edge[e].j + c] += stiff;
        }
    double rz = precondition(b), enough = part * part * rz, beta = 0;
    for (int i = 0; i < most && rz > enough; i++) {
        for (int k = 0; k < count; k++) b->d[k] = b->z[k] + beta * b->d[k];
        memset(b->q, 0, (size_t)count * sizeof *b->q);
        for (int e = 0; e < b->s->edges; e++) pull(b, e, -b->k[e] * growth(b, e, b->d), b->q);
        double dq = inner(b->d, b->q, count);
        if (!(dq > 0)) break;
        double alpha = rz / dq;
        for (int k = 0; k < count; k++) {
            b->x[k] += alpha * b->d[k];
            b->r[k] -= alpha * b->q[k];
        }
        double next = precondition(b);
        beta = next / rz;
        rz = next;
    }
}

// Set the loads on the nodes to the tractions of a uniform stress whose components (a, c) and (c, a) are `stress` and
// all others 0.
static void load(bench *b, int a, int c, double stress)
{
    memset(b->f, 0, 3 * (size_t)b->s->nodes * sizeof *b->f);
    for (int i = 0; i < b->s->nodes; i++) {
        b->f[3 * i + a] += stress * b->s->area_m2[i][c];
        if (a != c) b->f[3 * i + c] += stress * b->s->area_m2[i][a];
    }
}

// Return the mean of the strain component (a, c) of displacements x over the body, from the nodes on its surface.
static double strain(const bench *b, const double *x, int a, int c)
{
    double sum = 0;
    for (int i = 0; i < b->s->nodes; i++)
        sum += 0.5 * (x[3 * i + a] * b->s->area_m2[i][c] + x[3 * i + c] * b->s->area_m2[i][a]);
    return sum / b->s->volume_m3;
}

// Measure the elastic constants of a net. Return NULL, or a sentence if memory is short or the net cannot carry a load.
static const char *specimen_moduli(const mesh_specimen *s, kn_net_moduli *out)
{
    bench b;
    if (!bench_open(&b, s)) return KN_NO_MEMORY;
    int step = s->flat ? 2 : 1, axes = s->flat ? 2 : 3, planes = s->flat ? 1 : 3;
    *out = (kn_net_moduli){.poisson = 0};
    for (int e = 0; e < s->edges; e++) b.k[e] = s->kappa_m * s->edge[e].weight;
    bool ok = true;
    // one test per stress component: tension along the axes gives E and Poisson's ratio, shear gives the shear modulus
    for (int a = 0; a < 3 && ok; a += step)
        for (int c = a; c < 3 && ok; c += step) {
            memset(b.x, 0, 3 * (size_t)s->nodes * sizeof *b.x);
            load(&b, a, c, 1);
            memcpy(b.r, b.f, 3 * (size_t)s->nodes * sizeof *b.r);
            solve(&b, 1e-5);
            double along = strain(&b, b.x, a, c);
            ok = along > 0;
            if (a != c) {
                out->shear += 0.5 / along / planes;
                continue;
            }
            out->young[a] = 1 / along;
            for (int k = 0; k < 3; k += step)
                if (k != a) out->poisson -= strain(&b, b.x, k, k) / along / (axes * (axes - 1));
        }
    free(b.memory);
    return ok ? NULL : "the springs of this mesh do not hold it together";
}

#define CREEP_S 60.0
#define CREEP_STEPS 12

static double at(const bench *b, const double *centre, int i, int c) { return b->s->x_m[i][c] - centre[c]; }

// Solve m x = y for a symmetric 3 x 3 matrix, by cofactors. x is zero if m is singular.
static void solve3(double m[3][3], const double y[3], double x[3])
{
    double inverse[3][3], det = 0;
    for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++) {
            int a1 = (a + 1) % 3, a2 = (a + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            inverse[c][a] = m[a1][c1] * m[a2][c2] - m[a1][c2] * m[a2][c1];
        }
    for (int c = 0; c < 3; c++) det += m[0][c] * inverse[c][0];
    for (int a = 0; a < 3; a++) x[a] = det > 0 ? inner(inverse[a], y, 3) / det : 0;
}

// Return the strain along z of the linear map that fits the nodes' displacements best. A node whose displacement is far
// from the map gets less weight. The mean strain from the outside was rejected as a measure. If only a few springs hold
// a node of the outside, the node moves far under its traction when the dampers there soften, and the mean follows this
// node. With the mean, gamma changed from 0.65 to 1.5 between meshes of one block that differ by a few nodes.
static double stretch(bench *b)
{
    int nodes = b->s->nodes;
    double *weight = b->z, slope[3] = {0}, centre[3], mean, scale = INFINITY;
    memset(b->q, 0, (size_t)nodes * sizeof *b->q);
    // fit the map four times; each round weights the nodes by their distance from the map of the round before
    for (int round = 0; round < 4; round++) {
        double m[3][3] = {{0}}, y[3] = {0}, sum = 0, off = 0;
        memset(centre, 0, sizeof centre);
        mean = 0;
        for (int i = 0; i < nodes; i++) {
            // far: distance of a node from the map of the last round, divided by three times the mean distance; 0 at
            // first
            double far = b->q[i] / (3 * scale);
            sum += weight[i] = 1 / (1 + far * far);
        }
        // weighted means of places and displacements
        for (int i = 0; i < nodes; i++) {
            for (int c = 0; c < 3; c++) centre[c] += weight[i] / sum * b->s->x_m[i][c];
            mean += weight[i] / sum * b->moved[3 * i + 2];
        }
        // add up the normal equations for the slope of the linear map
        for (int i = 0; i < nodes; i++)
            for (int c = 0; c < 3; c++) {
                y[c] += weight[i] * at(b, centre, i, c) * (b->moved[3 * i + 2] - mean);
                for (int a = 0; a < 3; a++) m[a][c] += weight[i] * at(b, centre, i, a) * at(b, centre, i, c);
            }
        if (b->s->flat) m[1][1] = m[0][0];
        solve3(m, y, slope);
        // distance of every node from the map, and its mean as the scale of the next round
        for (int i = 0; i < nodes; i++) {
            b->q[i] = b->moved[3 * i + 2] - mean;
            for (int c = 0; c < 3; c++) b->q[i] -= slope[c] * at(b, centre, i, c);
            off += weight[i] / sum * fabs(b->q[i]);
        }
        scale = fmax(off, 1e-300);
    }
    return slope[2];
}

// Return the stress of an edge at the present velocities x of the nodes.
static double stress_of(const bench *b, const kn_law *law, double gamma, int e)
{
    double rate = growth(b, e, b->x) / (gamma * b->s->edge[e].rest_m);
    return kn_law_stress(law, law->a_pa_s * rate + law->mat.k1_pa * b->u[e]);
}

// Add the forces of all edges to the residual r, and set the stiffness k of all edges.
static void pull_all(bench *b, const kn_law *law, double gamma)
{
    for (int e = 0; e < b->s->edges; e++) {
        double stress = stress_of(b, law, gamma, e), spring = b->s->kappa_m * b->s->edge[e].weight;
        b->k[e] = spring * law->a_pa_s * kn_law_slope(law, stress, KN_LINEARIZATION_BLEND);
        pull(b, e, gamma * b->s->edge[e].rest_m * spring * stress, b->r);
    }
}

// Return the strain along z of the net after 60 s under a constant stress, in twelve implicit steps. The result is
// negative if memory is short.
static double specimen_creep(const mesh_specimen *s, const kn_material *mat, double gamma, double stress_pa)
{
    bench b;
    kn_law law;
    if (!bench_open(&b, s)) return -1;
    double dt = CREEP_S / CREEP_STEPS;
    kn_law_build(&law, mat, dt, true);
    load(&b, 2, 2, stress_pa);
    double whole = sqrt(inner(b.f, b.f, 3 * s->nodes));
    for (int step = 0; step < CREEP_STEPS; step++) {
        // find the velocities x by repeated linearisation, starting from the velocities of the last step
        for (int pass = 0; pass < 30; pass++) {
            memcpy(b.r, b.f, 3 * (size_t)s->nodes * sizeof *b.r);
            pull_all(&b, &law, gamma);
            if (sqrt(inner(b.r, b.r, 3 * s->nodes)) < 1e-3 * whole) break;
            solve(&b, 0.05);
        }
        // advance the edges' strains and the displacements
        for (int e = 0; e < s->edges; e++)
            b.u[e] += dt * (stress_of(&b, &law, gamma, e) - mat->k1_pa * b.u[e]) / law.a_pa_s;
        for (int k = 0; k < 3 * s->nodes; k++) b.moved[k] += dt * b.x[k];
    }
    double crept = stretch(&b);
    free(b.memory);
    return crept;
}

// Return the strain of the 1-D element after 60 s under a constant stress, in twelve implicit steps as for the net.
static double element_creep(const kn_material *mat, double stress_pa)
{
    double dt = CREEP_S / CREEP_STEPS, a = mat->c1_pa_s + dt * mat->k1_pa, u = 0;
    for (int step = 0; step < CREEP_STEPS; step++) u += dt * (stress_pa - mat->k1_pa * u) / a;
    return u + CREEP_S * kn_material_flow(mat, stress_pa);
}

// Find the gamma between 0.2 and 1.5 at which the net creeps as much as the 1-D element. The stress of the test is the
// geometric mean of p0 and p1, between which c2 falls, or 0.3 p1 if p0 is 0. gamma is 1 if the damper does not depend
// on force. The net must already have E = 1. The search takes at most nine creep tests and is deterministic. `error`:
// remaining relative difference of the two creep strains. Return false if memory is short.
static bool specimen_gamma(const mesh_specimen *s, const kn_material *mat, double *gamma, double *error)
{
    *gamma = 1;
    *error = 0;
    if (mat->damper == KN_DAMPER_NONE || mat->damper == KN_DAMPER_CONSTANT) return true;
    double stress = mat->p0_pa > 0 ? sqrt(mat->p0_pa * mat->p1_pa) : 0.3 * mat->p1_pa;
    double target = element_creep(mat, stress), low = 0.2, high = 1.5;
    // bisect: with a larger gamma, a damper sees less stress and creeps less
    for (int i = 0; i < 9; i++) {
        *gamma = sqrt(low * high);
        double crept = specimen_creep(s, mat, *gamma, stress);
        if (crept < 0) return false;
        *error = crept / target - 1;
        if (fabs(*error) < 2e-3) break;
        if (*error > 0) low = *gamma;
        else high = *gamma;
    }
    return true;
}

// --- fit of kappa and gamma -----------------------------------------------------------------------------------------

// Largest number of nodes of the specimen in the fit of gamma. With this many nodes, the fit takes some tenths of a
// second.
#define CREEP_NODES_MAX 1000

// Compute the outward area vector of every node on the surface, m^2. Return the volume of the net, m^3.
static double areas(const kn_model *m, const facet *facets, int count, double (*area_m2)[3])
{
    const kn_simplices *s = m->def.mesh;
    double volume = 0;
    for (int f = 0; f < count; f++) {
        double area[3];
        facet_area(m, &facets[f], area);
        for (int c = 0; c < s->dimension; c++)
            for (int k = 0; k < 3; k++) area_m2[facets[f].corner[c]][k] += area[k] / s->dimension;
    }
    for (int e = 0; e < s->element_count; e++) volume += volume_of(m, s->element[e]);
    return volume;
}

typedef struct near {
    double square;
    int element;
} near;

static int by_distance(const void *a, const void *b)
{
    const near *x = a, *y = b;
    if (x->square != y->square) return x->square < y->square ? -1 : 1;
    return (x->element > y->element) - (x->element < y->element);
}

// List all elements in the order of their distance from the middle of the mesh. The caller frees the list. Return NULL
// if memory is short.
static near *from_middle(const kn_simplices *s)
{
    near *order = malloc((size_t)s->element_count * sizeof *order);
    double middle[3] = {0};
    for (int i = 0; i < s->node_count; i++)
        for (int k = 0; k < 3; k++) middle[k] += s->x_m[i][k] / s->node_count;
    for (int e = 0; order && e < s->element_count; e++) {
        double d[3] = {-middle[0], -middle[1], -middle[2]};
        for (int c = 0; c <= s->dimension; c++)
            for (int k = 0; k < 3; k++) d[k] += s->x_m[s->element[e][c]][k] / (s->dimension + 1);
        order[e] = (near){kn_dot(d, d), e};
    }
    if (order) qsort(order, (size_t)s->element_count, sizeof *order, by_distance);
    return order;
}

// Cut out the middle of a mesh, with at most CREEP_NODES_MAX nodes. Return NULL if memory is short.
static kn_simplices *middle_of(const kn_simplices *s)
{
    near *order = from_middle(s);
    // number of each node in the specimen, from 1; 0: not in the specimen
    int *number = calloc((size_t)s->node_count, sizeof *number);
    kn_simplices *part = kn_simplices_create(s->dimension, CREEP_NODES_MAX, s->element_count);
    if (order && number && part) {
        part->node_count = part->element_count = 0;
        for (int e = 0; e < s->element_count && part->node_count + 4 <= CREEP_NODES_MAX; e++) {
            const int *from = s->element[order[e].element];
            int *to = part->element[part->element_count++];
            to[3] = -1;
            for (int c = 0; c <= s->dimension; c++) {
                if (number[from[c]] == 0) {
                    memcpy(part->x_m[part->node_count], s->x_m[from[c]], sizeof *s->x_m);
                    number[from[c]] = ++part->node_count;
                }
                to[c] = number[from[c]] - 1;
            }
        }
    }
    bool ok = order && number && part;
    free(order);
    free(number);
    if (ok) return part;
    kn_simplices_destroy(part);
    return NULL;
}

static mesh_specimen specimen_of(const kn_model *m, const double (*area_m2)[3], double volume)
{
    const kn_simplices *s = m->def.mesh;
    return (mesh_specimen){s->node_count, m->edge_count, s->dimension == 2, (const double(*)[3])s->x_m,
                           area_m2,       m->edges,      m->kappa_m,        volume};
}

// Fit kappa and gamma of a net. One factor on kappa makes Young's modulus of the body equal to that of the material.
// gamma follows from creep tests, unless the mesh has more than CREEP_NODES_MAX nodes. Return NULL, or a sentence that
// says what is wrong.
static const char *fit(kn_model *m, const facet *facets, int count)
{
    const kn_simplices *s = m->def.mesh;
    double(*area)[3] = calloc((size_t)s->node_count, sizeof *area);
    if (!area) return KN_NO_MEMORY;
    double volume = areas(m, facets, count, area);
    mesh_specimen specimen = specimen_of(m, (const double(*)[3])area, volume);
    kn_net_moduli *own = &m->moduli;
    const char *wrong = specimen_moduli(&specimen, own);
    if (!wrong) {
        double mean = s->dimension == 3 ? (own->young[0] + own->young[1] + own->young[2]) / 3
                                        : (own->young[0] + own->young[2]) / 2;
        // scale the springs and the measured moduli, so that the mean of Young's moduli is 1
        m->kappa_m /= mean;
        for (int k = 0; k < 3; k++) own->young[k] /= mean;
        own->shear /= mean;
        specimen.kappa_m = m->kappa_m;
        if (s->node_count <= CREEP_NODES_MAX &&
            !specimen_gamma(&specimen, &m->def.material, &m->gamma, &m->creep_error))
            wrong = KN_NO_MEMORY;
    }
    free(area);
    return wrong;
}

// Fit gamma of a large mesh with a specimen cut from its middle.
static const char *fit_middle(kn_model *m)
{
    kn_simplices *part = middle_of(m->def.mesh);
    kn_model *specimen = calloc(1, sizeof *specimen);
    int count = 0;
    facet *facets = part ? outer_facets(part, &count) : NULL;
    const char *wrong = KN_NO_MEMORY;
    if (facets && specimen) {
        specimen->def = m->def;
        specimen->def.mesh = part;
        if (build_edges(specimen)) wrong = fit(specimen, facets, count);
        m->gamma = specimen->gamma;
        m->creep_error = specimen->creep_error;
        free(specimen->edges);
    }
    free(facets);
    free(specimen);
    kn_simplices_destroy(part);
    return wrong;
}

// --- order in memory ------------------------------------------------------------------------------------------------

// The place of a node in memory. The nodes of a cell of the coarse level follow one another and begin a row. Within the
// cell the nodes with the most edges come first, so that the nodes of a row have about as many.
typedef struct place {
    int cell[3], degree, node;
} place;

static int by_place(const void *a, const void *b)
{
    const place *x = a, *y = b;
    for (int k = 2; k >= 0; k--)
        if (x->cell[k] != y->cell[k]) return x->cell[k] < y->cell[k] ? -1 : 1;
    if (x->degree != y->degree) return x->degree > y->degree ? -1 : 1;
    return (x->node > y->node) - (x->node < y->node);
}

// The place of an edge in memory: that of its ends.
typedef struct pair {
    size_t low, high;
    int edge;
} pair;

static int by_pair(const void *a, const void *b)
{
    const pair *x = a, *y = b;
    if (x->low != y->low) return x->low < y->low ? -1 : 1;
    return (x->high > y->high) - (x->high < y->high);
}

// Give every edge its slot in the field `strain`.
static bool order_edges(kn_model *m)
{
    pair *order = malloc((size_t)m->edge_count * sizeof *order);
    if (!order) return false;
    for (int e = 0; e < m->edge_count; e++) {
        const size_t i = m->offset[m->edges[e].i], j = m->offset[m->edges[e].j];
        order[e] = (pair){i < j ? i : j, i < j ? j : i, e};
    }
    qsort(order, (size_t)m->edge_count, sizeof *order, by_pair);
    for (int slot = 0; slot < m->edge_count; slot++) m->edges[order[slot].edge].slot = slot;
    free(order);
    return true;
}

// Give every node its offset, and every row the number of its turns (core/solve/kernel_net.c).
static bool order_nodes(kn_model *m)
{
    const int nodes = m->def.mesh->node_count;
    place *order = calloc((size_t)nodes, sizeof *order);
    m->row_turns = calloc((size_t)nodes, sizeof *m->row_turns);
    if (!order || !m->row_turns) {
        free(order);
        return false;
    }
    for (int i = 0; i < nodes; i++) {
        double at[3];
        order[i].node = i;
        if (m->coarse) kn_coarse_cell(m->coarse, m->def.mesh->x_m[i], order[i].cell, at);
    }
    for (int e = 0; e < m->edge_count; e++) order[m->edges[e].i].degree++, order[m->edges[e].j].degree++;
    qsort(order, (size_t)nodes, sizeof *order, by_place);
    int turns = 0;
    for (int i = 0, lane = KN_LANES; i < nodes; i++, lane++) {
        // a row begins where the last one is full, and with every cell
        if (lane == KN_LANES || memcmp(order[i].cell, order[i - 1].cell, sizeof order[i].cell) != 0) {
            lane = 0;
            m->row_turns[m->row_count++] = order[i].degree;
            turns += order[i].degree;
        }
        m->offset[order[i].node] = (size_t)(m->row_count - 1) * 3 * KN_LANES + (size_t)lane;
    }
    m->product_reals = 3 * (size_t)turns * KN_LANES;
    free(order);
    return order_edges(m);
}

const char *kn_net_build(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    int count = 0;
    facet *facets = outer_facets(s, &count);
    const char *wrong = KN_NO_MEMORY;
    if (facets && kn_model_nodes(m, s->node_count, s->node_count) && build_edges(m) && build_skin(m, facets, count) &&
        build_cells(m) && order_nodes(m)) {
        m->stride = KN_LANES;
        m->edge_reals = (size_t)(m->edge_count + KN_LANES - 1) / KN_LANES * KN_LANES;
        // make the nodes first, because support, top and fit need them
        memcpy(m->rest_m, s->x_m, (size_t)s->node_count * sizeof *m->rest_m);
        build_masses(m);
        build_support(m);
        build_top(m, facets, count);
        wrong = fit(m, facets, count);
        if (!wrong && s->node_count > CREEP_NODES_MAX) wrong = fit_middle(m);
        m->kappa_m *= m->def.force_factor;
        for (int k = 0; k < 3; k++) m->moduli.young[k] *= m->def.force_factor;
        m->moduli.shear *= m->def.force_factor;
    }
    free(facets);
    return wrong;
}
