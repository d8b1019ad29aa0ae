// The coarse level of the preconditioner: T is linear in place, its transpose sums forces, and Ac^-1 undoes T'A T.
#include "core/algebra/algebra.h"
#include "core/solve/coarse.h"
#include "core/solve/solver.h"
#include "tests/lattice.h"
#include "tests/physics/bcc.h"

// Numbers between -1 and 1, the same in every run.
static double dice(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)*seed / 9.3e18;
}

// Definitions with a coarse level: two blocks, one of two vectors per row; a flat object; two resolutions; a mesh; a
// block with more coarse nodes; each in f32 and f64. The caller keeps the mesh.
enum { CASES = 12 };
static kn_model_def case_of(int i, const kn_simplices *mesh)
{
    kn_model_def def = press_def(2);
    if (i / 2 == 1) def.nodes[0] = 20, def.nodes[1] = 4, def.nodes[2] = 9;
    if (i / 2 == 2) {
        def.nodes[0] = 30, def.nodes[1] = 1, def.nodes[2] = 20;
        def.thickness_m = 0.02;
    }
    if (i / 2 == 3) memcpy(def.fine, (int[2][3]){{2, 0, 2}, {8, 10, 6}}, sizeof def.fine);
    if (i / 2 == 4) def.mesh = mesh;
    if (i / 2 == 5) def.nodes[0] = def.nodes[1] = 18, def.nodes[2] = 12;
    def.solver.precision = (kn_precision)(i % 2);
    return def;
}

static void set_free(lattice *l, void *field, int node, const double v[3])
{
    const kn_model *m = l->model;
    for (size_t k = 0; k < 3; k++) kn_real_set(m, field, m->offset[node] + k * m->stride, v[k]);
}

TEST("velocities of the coarse nodes that are linear in the place are the same at all free nodes, and 0 at others")
{
    OWN(kn_simplices) *mesh = bcc_block((const int[3]){8, 7, 5}, 0.006);
    for (int i = 0; i < CASES; i++) {
        LATTICE l = lattice_of(case_of(i, mesh));
        const kn_model *m = l.model;
        const kn_coarse *c = m->coarse;
        const kn_work *w = &l.scratch->work;
        static const double slope[3][3] = {{3, -2, 5}, {1, 7, -4}, {-6, 2, 2}};
        CHECK(c && c->unknowns >= 27);
        memset(w->z, 0, kn_state_field(m, 3));
        for (int j = 0; j < c->unknowns; j++) {
            int node = j / 3,
                at[3] = {node % c->nodes[0], node / c->nodes[0] % c->nodes[1], node / c->nodes[0] / c->nodes[1]};
            double v = 0.5;
            // a block's places count from its first node, which lies at half its width and at the height 0
            for (int k = 0; k < 3; k++)
                v += slope[j % 3][k] * (c->first_m[k] + at[k] * c->cell_m[k] + (m->def.mesh ? 0 : m->rest_m[0][k]));
            kn_real_set(m, w->coarse, (size_t)(c->padded + j), v);
        }
        m->kernels->prolongation(m, w);
        for (int n = 0; n < m->node_count; n++)
            for (size_t k = 0; k < 3; k++) {
                const double v = m->support[n] >> k & 1 ? 0 : 0.5 + kn_dot(slope[k], m->rest_m[n]);
                CHECK_NEAR(kn_real_get(m, w->z, m->offset[n] + k * m->stride), v, 1e-6);
            }
    }
}

TEST("the restriction is the transpose of the prolongation, also with held nodes; the coarse solution undoes T'A T")
{
    OWN(kn_simplices) *mesh = bcc_block((const int[3]){8, 7, 5}, 0.006);
    uint64_t seed = 1;
    for (int i = 0; i < CASES; i++) {
        LATTICE l = lattice_of(case_of(i, mesh));
        const kn_model *m = l.model;
        const size_t padded = (size_t)m->coarse->padded, unknowns = (size_t)m->coarse->unknowns;
        const kn_work *w = &l.scratch->work;
        const double exact = i % 2 ? 1e-9 : 2e-4;
        double up = 0, down = 0, size = 0, error = 0, *y = calloc(unknowns, sizeof *y);
        OWN(kn_state) *rest = kn_state_create(m);
        CHECK(y && rest);
        memset(w->r, 0, kn_state_field(m, 3));
        memset(w->p, 0, kn_state_field(m, 6));
        m->kernels->edge(m, rest, w, m->def.solver.linearization, false);

        // r.(T y) and (T'r).y
        memset(w->z, 0, kn_state_field(m, 3));
        memset(w->coarse, 0, 2 * padded * kn_model_real(m));
        for (int n = 0; n < m->node_count; n++)
            set_free(&l, w->r, n, (double[]){dice(&seed), dice(&seed), dice(&seed)});
        for (size_t j = 0; j < unknowns; j++) kn_real_set(m, w->coarse, padded + j, y[j] = dice(&seed));
        m->kernels->prolongation(m, w);
        m->kernels->restriction(m, w);
        for (size_t o = 0; o < kn_model_field(m, 3); o++) up += kn_real_get(m, w->r, o) * kn_real_get(m, w->z, o);
        for (size_t j = 0; j < unknowns; j++) down += kn_real_get(m, w->coarse, j) * y[j];
        CHECK_NEAR(down, up, exact * fabs(up));

        // y of r_c = T'A T y; a coarse node that moves nothing gets 0
        memset(w->r, 0, kn_state_field(m, 3));
        memset(w->q, 0, kn_state_field(m, 3));
        m->kernels->apply(m, rest, w, 0);
        m->kernels->update(m, w, -1);
        memset(w->coarse, 0, 2 * padded * kn_model_real(m));
        m->kernels->restriction(m, w);
        m->kernels->coarse_solve(m, w);
        size_t still = 0;
        for (size_t j = 0; j < unknowns; j++) {
            const double found = kn_real_get(m, w->coarse, padded + j);
            still += found == 0;
            size += found == 0 ? 0 : y[j] * y[j];
            error += found == 0 ? 0 : (found - y[j]) * (found - y[j]);
        }
        // what moves across a flat object moves nothing
        CHECK(still == (m->grid.flat ? unknowns / 3 : 0) && sqrt(error / size) < (i % 2 ? 1e-6 : 0.02));
        free(y);
    }
}

// Press for 0.4 s. Return the mean number of iterations, and count the ticks that iterations_max ended.
static double iterations_of(kn_model_def def, int *capped)
{
    LATTICE l = lattice_of(def);
    static const press path = {.depth_m = 0.003, .hold_s = 0.05};
    double sum = 0;
    *capped = 0;
    for (int i = 0; i < 400; i++) {
        l.in = press_input(l.model, &path, (i + 1) * 1e-3);
        step(&l);
        sum += l.out.iterations / 400.0;
        *capped += l.out.capped;
    }
    return sum;
}

TEST("a press takes few iterations on blocks, two resolutions and meshes, also where only a table holds the object")
{
    OWN(kn_simplices) *mesh = bcc_block((const int[3]){12, 12, 7}, 0.0042);
    kn_model_def table = press_def(2), fine = press_def(4), net = press_def(1);
    table.support = fine.support = KN_SUPPORT_FRICTION;
    table.support_friction = fine.support_friction = 0.5;
    memcpy(fine.fine, (int[2][3]){{4, 0, 4}, {16, 20, 12}}, sizeof fine.fine);
    net.mesh = mesh;
    const struct {
        const char *what;
        kn_model_def def;
        double most; // mean number of iterations
    } table_of[] = {
        {"block", press_def(4), 7},
        {"block on a table", table, 9},
        {"two resolutions", fine, 12},
        {"mesh", net, 8}}; // without the coarse level: 9.5, 21, 23 and 8.7 iterations, 62, 285, 361 and 19 ticks capped
    for (int i = 0; i < COUNT(table_of); i++) {
        int capped;
        const double mean = iterations_of(table_of[i].def, &capped);
        printf("     %s: %.2f iterations, %d ticks capped\n", table_of[i].what, mean, capped);
        CHECK(mean < table_of[i].most && capped <= 10);
    }
}
