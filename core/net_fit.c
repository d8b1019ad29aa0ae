#include "core/net_fit.h"
#include "core/net.h"
#include "core/law.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Memory of the tests: vectors of three reals per node; per edge a unit vector, a stiffness, and the strain u of the
// law.
typedef struct bench {
    const kn_specimen *s;
    double *x, *r, *z, *d, *q, *jacobi, *f;
    double *moved; // displacements of a creep test
    double *n, *k, *u;
    double *memory;
} bench;

// Allocate all vectors in one block, and compute the edges' unit vectors.
static bool bench_open(bench *b, const kn_specimen *s)
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

// Return the growth of an edge under a field.
static double growth(const bench *b, int e, const double *x)
{
    const double *n = b->n + 3 * e, *i = x + 3 * b->s->edge[e].i, *j = x + 3 * b->s->edge[e].j;
    return n[0] * (j[0] - i[0]) + n[1] * (j[1] - i[1]) + n[2] * (j[2] - i[2]);
}

// Add an edge's pull to both of its ends.
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

// Solve K x = r by conjugate gradients with a Jacobi preconditioner, and add the result to x. Stop at `part` of the
// initial residual. K is singular for rigid motions, but the loads are in balance, so there is a solution.
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

// Set the loads to the traction of a stress component (a, c), symmetric.
static void load(bench *b, int a, int c, double stress)
{
    memset(b->f, 0, 3 * (size_t)b->s->nodes * sizeof *b->f);
    for (int i = 0; i < b->s->nodes; i++) {
        b->f[3 * i + a] += stress * b->s->area_m2[i][c];
        if (a != c) b->f[3 * i + c] += stress * b->s->area_m2[i][a];
    }
}

// Return the mean of a strain component of displacements x, read off the outside.
static double strain(const bench *b, const double *x, int a, int c)
{
    double sum = 0;
    for (int i = 0; i < b->s->nodes; i++)
        sum += 0.5 * (x[3 * i + a] * b->s->area_m2[i][c] + x[3 * i + c] * b->s->area_m2[i][a]);
    return sum / b->s->volume_m3;
}

const char *kn_specimen_moduli(const kn_specimen *s, kn_net_moduli *out)
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

// Return the strain along z of the linear map that fits the displacements best. Nodes far from the map count less.
// Rejected: the mean strain over the outside. A node of the outside that only a few springs hold moves far under its
// traction when the dampers there soften, and the mean would follow this node. With the mean, gamma changed from 0.65
// to 1.5 between meshes of one block that differ by a few nodes.
static double stretch(bench *b)
{
    int nodes = b->s->nodes;
    double *weight = b->z, slope[3] = {0}, centre[3], mean, scale = INFINITY;
    memset(b->q, 0, (size_t)nodes * sizeof *b->q);
    // fit the map four times; each round weights the nodes by their distance from the last map
    for (int round = 0; round < 4; round++) {
        double m[3][3] = {{0}}, y[3] = {0}, sum = 0, off = 0;
        memset(centre, 0, sizeof centre);
        mean = 0;
        for (int i = 0; i < nodes; i++) {
            // distance from the last map, relative to three times the mean; 0 in the first round
            double far = b->q[i] / (3 * scale);
            sum += weight[i] = 1 / (1 + far * far);
        }
        // weighted means of places and displacements
        for (int i = 0; i < nodes; i++) {
            for (int c = 0; c < 3; c++) centre[c] += weight[i] / sum * b->s->x_m[i][c];
            mean += weight[i] / sum * b->moved[3 * i + 2];
        }
        // normal equations of the slope
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

// Return the stress of an edge at the present velocities.
static double stress_of(const bench *b, const kn_law *law, double gamma, int e)
{
    double rate = growth(b, e, b->x) / (gamma * b->s->edge[e].rest_m);
    return kn_law_stress(law, law->a_pa_s * rate + law->mat.k1_pa * b->u[e]);
}

// Add the edges' forces to the residual, and set their stiffness.
static void pull_all(bench *b, const kn_law *law, double gamma)
{
    for (int e = 0; e < b->s->edges; e++) {
        double stress = stress_of(b, law, gamma, e), spring = b->s->kappa_m * b->s->edge[e].weight;
        b->k[e] = spring * law->a_pa_s * kn_law_slope(law, stress, KN_LINEARIZATION_BLEND);
        pull(b, e, gamma * b->s->edge[e].rest_m * spring * stress, b->r);
    }
}

double kn_specimen_creep(const kn_specimen *s, const kn_material *mat, double gamma, double stress_pa)
{
    bench b;
    kn_law law;
    if (!bench_open(&b, s)) return -1;
    double dt = CREEP_S / CREEP_STEPS;
    kn_law_build(&law, mat, dt, true);
    load(&b, 2, 2, stress_pa);
    double whole = sqrt(inner(b.f, b.f, 3 * s->nodes));
    for (int step = 0; step < CREEP_STEPS; step++) {
        // find the velocities x by repeated linearisation, starting from those of the last step
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

double kn_element_creep(const kn_material *mat, double stress_pa)
{
    double dt = CREEP_S / CREEP_STEPS, a = mat->c1_pa_s + dt * mat->k1_pa, u = 0;
    for (int step = 0; step < CREEP_STEPS; step++) u += dt * (stress_pa - mat->k1_pa * u) / a;
    return u + CREEP_S * kn_material_flow(mat, stress_pa);
}

bool kn_specimen_gamma(const kn_specimen *s, const kn_material *mat, double *gamma, double *error)
{
    *gamma = 1;
    *error = 0;
    if (mat->damper == KN_DAMPER_NONE || mat->damper == KN_DAMPER_CONSTANT) return true;
    double stress = mat->p0_pa > 0 ? sqrt(mat->p0_pa * mat->p1_pa) : 0.3 * mat->p1_pa;
    double target = kn_element_creep(mat, stress), low = 0.2, high = 1.5;
    // Bisect: the larger gamma is, the less stress a damper sees, and the less it creeps.
    for (int i = 0; i < 9; i++) {
        *gamma = sqrt(low * high);
        double crept = kn_specimen_creep(s, mat, *gamma, stress);
        if (crept < 0) return false;
        *error = crept / target - 1;
        if (fabs(*error) < 2e-3) break;
        if (*error > 0) low = *gamma;
        else high = *gamma;
    }
    return true;
}
