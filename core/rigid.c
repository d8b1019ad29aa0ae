#include "core/rigid.h"
#include "core/foundation.h"
#include "core/six.h"

#include <string.h>

bool kn_rigid_wanted(const kn_model *model)
{
    const kn_model_def *def = &model->def;
    return def->solver.kind == KN_SOLVER_IMPLICIT && def->support >= KN_SUPPORT_NONE && !model->composite &&
           def->thickness_m == 0;
}

// The arm holds x - centre of every node in the layout of the solver's fields, and a fourth
// component, 1 where there is a node.
size_t kn_rigid_bytes(const kn_model *model)
{
    return kn_rigid_wanted(model) ? kn_model_field(model, 4) * sizeof(float) : 0;
}

static size_t arm_of(const kn_model *m, int node)
{
    size_t row = m->offset[node] / (3 * m->stride);
    return row * 4 * m->stride + m->offset[node] % (3 * m->stride);
}

// Add mass and inertia over dt, lower half.
static void add_inertia(const kn_model *m, const kn_rigid *rigid, double a[6][6])
{
    double scale = m->def.solver.mass_scale / m->def.solver.dt_s;
    for (int i = 0; i < m->node_count; i++) {
        const float *arm = rigid->arm + arm_of(m, i);
        double mass = scale * m->node_mass_kg[i], x = (double)arm[0], y = (double)arm[m->stride],
               z = (double)arm[2 * m->stride];
        a[0][0] += mass, a[1][1] += mass, a[2][2] += mass;
        a[3][1] -= mass * z, a[3][2] += mass * y, a[4][0] += mass * z; // mass (w x arm), in the rows of v
        a[4][2] -= mass * x, a[5][0] -= mass * y, a[5][1] += mass * x;
        a[3][3] += mass * (y * y + z * z), a[4][4] += mass * (x * x + z * z), a[5][5] += mass * (x * x + y * y);
        a[4][3] -= mass * x * y, a[5][3] -= mass * x * z, a[5][4] -= mass * y * z;
    }
}

// Compute the centre of mass, and the arm of every node from it.
static void find_centre(const kn_model *m, const kn_state *state, kn_rigid *rigid)
{
    double mass = 0, sum[3] = {0}, x[3];
    for (int i = 0; i < m->node_count; i++) {
        kn_state_position(m, state, i, x);
        mass += m->node_mass_kg[i];
        for (int k = 0; k < 3; k++) sum[k] += m->node_mass_kg[i] * x[k];
    }
    for (int k = 0; k < 3; k++) rigid->centre_m[k] = sum[k] / mass;
    for (int i = 0; i < m->node_count; i++) {
        float *arm = rigid->arm + arm_of(m, i);
        kn_state_position(m, state, i, x);
        for (size_t k = 0; k < 3; k++) arm[k * m->stride] = (float)(x[k] - rigid->centre_m[k]);
        arm[3 * m->stride] = 1;
    }
}

void kn_rigid_begin(const kn_model *model, const kn_state *state, kn_scratch *scratch)
{
    kn_rigid *rigid = &scratch->rigid;
    rigid->on = kn_rigid_wanted(model) && scratch->contact.hold_count == 0;
    if (!rigid->on) return;
    find_centre(model, state, rigid);
    memset(rigid->factor, 0, sizeof rigid->factor);
    // R'AR: inertia and contact, in closed form
    add_inertia(model, rigid, rigid->factor);
    kn_foundation_rigid(model, scratch, rigid->centre_m, rigid->factor);
    double *w[3] = {&rigid->factor[3][3], &rigid->factor[4][4], &rigid->factor[5][5]}, spin = *w[0] + *w[1] + *w[2];
    // a bar has no inertia about its own axis: keep the matrix regular
    for (int k = 0; k < 3; k++) *w[k] += 1e-9 * spin + 1e-30;
    kn_six_factor(rigid->factor);
}

// Loops over the nodes of one row, one source for both precisions. Rows of a field: x, y and z of `stride` nodes each.
#define GATHER(real)                                                                                                   \
    const real *r = (const real *)scratch->work.r + 3 * at;                                                            \
    const float *x = rigid->arm + 4 * at, *y = x + stride, *z = y + stride;                                            \
    for (size_t i = 0; i < stride; i++) {                                                                              \
        double f[3] = {(double)r[i], (double)r[stride + i], (double)r[2 * stride + i]};                                \
        const double arm[3] = {(double)x[i], (double)y[i], (double)z[i]};                                              \
        kn_six_wrench(arm, f, 1, sum);                                                                                 \
    }

#define SCATTER(real)                                                                                                  \
    real *out = (real *)scratch->work.z + 3 * at;                                                                      \
    const float *x = rigid->arm + 4 * at, *y = x + stride, *z = y + stride, *here = z + stride;                        \
    for (size_t i = 0; i < stride; i++) {                                                                              \
        const double arm[3] = {(double)x[i], (double)y[i], (double)z[i]};                                              \
        double v[3];                                                                                                   \
        kn_six_velocity(c, arm, v);                                                                                    \
        for (size_t k = 0; k < 3; k++) out[k * stride + i] += (real)v[k] * (real)here[i];                              \
    }

double kn_rigid_add(const kn_model *model, kn_scratch *scratch)
{
    const kn_rigid *rigid = &scratch->rigid;
    const size_t stride = model->stride, end = (size_t)model->row_count * stride;
    const bool single = model->def.solver.precision == KN_PRECISION_F32;
    double sum[6] = {0}, c[6], more = 0;
    if (!rigid->on) return 0;
    // R'r: total force and torque of the residual
    for (size_t at = 0; at < end; at += stride) {
        if (single) {
            GATHER(float)
        } else {
            GATHER(double)
        }
    }
    // solve the 6 x 6 system, then add the rigid motion to z
    memcpy(c, sum, sizeof c);
    kn_six_solve((const double(*)[6])rigid->factor, c);
    for (int k = 0; k < 6; k++) more += c[k] * sum[k];
    for (size_t at = 0; at < end; at += stride) {
        if (single) {
            SCATTER(float)
        } else {
            SCATTER(double)
        }
    }
    return more;
}
