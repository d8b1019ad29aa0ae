#include "core/mobility.h"
#include "core/scratch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SLOWER 30 // factor S by which the inertia is reduced, see mobility.h
#define COLD 60   // number of iterations of a probe's first solve
#define WARM 12   // number of iterations of every later solve, which starts from the last solution
// residual relative to the load at which a solve ends; the error of Y is the square of this residual
#define ENOUGH 1e-4

struct kn_mobility {
    const kn_model *model;
    // the object at rest; its scratch holds matrix and vectors, its field `change` holds the pattern
    kn_state *rest;
    void *field[KN_PROBES_MAX]; // solution z of each probe's last solve
    bool warm[KN_PROBES_MAX];
    int probe, left;
    double rz, beta, enough;
};

// Return the size of a field with the given number of components [bytes].
static size_t bytes_of(const kn_model *m, int components)
{
    return kn_model_field(m, components) * m->kernels->real_size;
}

// Scale the first reals of a field.
static void scale(const kn_model *m, void *field, size_t reals, double by)
{
    for (size_t i = 0; field && i < reals; i++) kn_real_set(m, field, i, by * kn_real_get(m, field, i));
}

// Hold the nodes that lie on the table at rest. Other nodes of the outside may reach the table later, but are not held.
static void hold_table(kn_mobility *m)
{
    const kn_model *model = m->model;
    for (int i = 0; i < model->base_count; i++) {
        if (model->rest_m[model->base[i]][2] > 0.1 * model->def.spacing_m) continue;
        size_t o = model->offset[model->base[i]];
        kn_state_scratch(m->rest)->work.row_held[o / (3 * model->stride)] = 1;
        for (size_t k = 0; k < 3; k++) kn_real_set(model, kn_state_work(m->rest)->free, o + k * model->stride, 0);
    }
}

// Assemble the step's matrix of the object at rest, with S times its stiffness. The result is the same as with S times
// less inertia, except for the factor S.
static void assemble(kn_mobility *m)
{
    const kn_model *model = m->model;
    kn_work *w = kn_state_work(m->rest);
    hold_table(m);
    memset(w->guess, 0, bytes_of(model, 3));
    memset(w->r, 0, bytes_of(model, 3));
    memset(w->p, 0, bytes_of(model, 6));
    model->kernels->edge(model, m->rest, KN_LINEARIZATION_TANGENT, false);
    // Remove the dampers' flow and multiply the stiffness by S. In f64 a lattice's g has the stiffness itself, else
    // vectors of its root (kernel.h).
    const double softer = SLOWER / model->law.slope_rest;
    const size_t reals = (size_t)kn_work_edge(model);
    scale(model, w->g, reals * model->edge_reals, reals == 1 ? softer : sqrt(softer));
    memset(m->rest->change, 0, bytes_of(model, 3));
}

kn_mobility *kn_mobility_create(const kn_model *model)
{
    if (model->def.solver.kind != KN_SOLVER_IMPLICIT) return NULL;
    kn_mobility *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->model = model;
    m->rest = kn_state_create(model);
    bool made = m->rest != NULL;
    for (int p = 0; p < model->def.probe_count; p++) made &= (m->field[p] = calloc(1, bytes_of(model, 3))) != NULL;
    if (made) {
        assemble(m);
        return m;
    }
    kn_mobility_destroy(m);
    return NULL;
}

void kn_mobility_destroy(kn_mobility *m)
{
    if (!m) return;
    kn_state_destroy(m->rest);
    for (int p = 0; p < KN_PROBES_MAX; p++) free(m->field[p]);
    free(m);
}

void kn_mobility_begin(kn_mobility *m, int p)
{
    m->probe = p;
    memset(m->rest->change, 0, bytes_of(m->model, 3));
}

// Add a force to the pattern. Held components carry no load, since they do not move.
void kn_mobility_load(kn_mobility *m, size_t offset, const double force_n[3])
{
    for (size_t k = 0; k < 3; k++)
        if (kn_real_get(m->model, kn_state_work(m->rest)->free, offset + k * m->model->stride) != 0)
            kn_real_add(m->model, m->rest->change, offset + k * m->model->stride, force_n[k]);
}

static double product(const kn_model *m, const void *a, const void *b)
{
    double sum = 0;
    for (size_t i = 0, n = kn_model_field(m, 3); i < n; i++) sum += kn_real_get(m, a, i) * kn_real_get(m, b, i);
    return sum;
}

// Start a round from the last round's solution z: r = b - A z, which costs one product. The residual r then is only the
// change of the pattern since the last round.
void kn_mobility_start(kn_mobility *m)
{
    const kn_model *model = m->model;
    kn_work *w = kn_state_work(m->rest);
    // first z = P b, whose size sets the threshold
    memcpy(w->r, m->rest->change, bytes_of(model, 3));
    memset(w->guess, 0, bytes_of(model, 3));
    memset(w->d, 0, bytes_of(model, 3));
    memset(w->q, 0, bytes_of(model, 3));
    m->enough = ENOUGH * ENOUGH * fabs(model->kernels->update(model, m->rest, 0)); // z = P b
    // then one product with the last solution, which becomes the first guess
    memcpy(w->z, m->field[m->probe], bytes_of(model, 3));
    model->kernels->apply(model, m->rest, 0);
    m->rz = model->kernels->update(model, m->rest, 1);
    m->beta = 0;
    m->left = m->warm[m->probe] ? WARM : COLD;
}

// End a round: Y = b'z. A bad solution is dropped, so that the next round starts from zero.
static bool finish(kn_mobility *m, double *a_n_s_per_m)
{
    kn_work *w = kn_state_work(m->rest);
    double y = SLOWER * product(m->model, m->rest->change, w->guess);
    bool good = isfinite(y) && y > 0;
    if (good) memcpy(m->field[m->probe], w->guess, bytes_of(m->model, 3));
    else memset(m->field[m->probe], 0, bytes_of(m->model, 3));
    m->warm[m->probe] = good;
    *a_n_s_per_m = good ? 1 / y : 0;
    return true;
}

bool kn_mobility_iterate(kn_mobility *m, double *a_n_s_per_m)
{
    // one iteration of conjugate gradients with the step's own kernels
    if (m->left-- <= 0 || !(m->rz > m->enough)) return finish(m, a_n_s_per_m);
    double dq = m->model->kernels->apply(m->model, m->rest, m->beta);
    if (!(dq > 0)) return finish(m, a_n_s_per_m);
    double next = m->model->kernels->update(m->model, m->rest, m->rz / dq);
    m->beta = next / m->rz;
    m->rz = next;
    return false;
}

double kn_mobility_rate(const kn_mobility *m, int p, size_t offset, const double force_n[3])
{
    double rate = 0;
    for (size_t k = 0; k < 3; k++)
        rate += force_n[k] * kn_real_get(m->model, m->field[p], offset + k * m->model->stride);
    return SLOWER * rate;
}
