#include "core/impact.h"
#include "core/kernel.h"

#include <math.h>

// A plate: how much faster or slower its nodes must go, and how far they go, of the limits.
static double carried(const kn_model *m, const kn_state *state, const kn_contact *contact)
{
    double h = m->def.spacing_m, flow_m_s = m->law.s1_pa / m->law.a_pa_s * m->gamma * h, change = 0, way = 0;
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_hold *hold = &contact->hold[i];
        double x[3], high = m->rest_m[hold->node][2], left = 1; // of the height below the node
        kn_state_position(m, state, hold->node, x);
        if (high > 0) left = fmin(1, fmax(0.02, x[2] / high));
        for (size_t k = 0; k < 3; k++) {
            double now = kn_real_get(m, state->velocity, m->offset[hold->node] + k * m->stride);
            change = fmax(change, fabs(hold->velocity_m_s[k] - now));
            way = fmax(way, fabs(hold->velocity_m_s[k]) * m->def.solver.dt_s / (h * left));
        }
    }
    return fmax(change / flow_m_s / KN_IMPACT_RATE, way / KN_IMPACT_WAY);
}

// A tool of another shape: what its pressure would change by, were the skin to go on as it does.
static double pressed(const kn_model *m, const kn_state *state, const kn_contact *contact)
{
    double most = 0;
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *sample = &contact->sample[i];
        if (!sample->line.active || sample->probe == KN_TABLE) continue;
        most = fmax(most, kn_probe_foundation(&m->def.probe[sample->probe]) *
                              fabs(kn_sample_gap_rate(m, contact, sample, state->velocity)));
    }
    return most * m->def.solver.dt_s / m->law.s1_pa / KN_IMPACT_PRESS;
}

int kn_impact_lines(const kn_model *model)
{
    const kn_material *mat = &model->law.mat;
    if (!(model->law.s1_pa > 0)) return 1;
    if (model->def.solver.dt_s >= KN_IMPACT_LONG_S) return 12;
    return kn_material_thinning(mat, mat->p1_pa) * mat->p1_pa > KN_IMPACT_BEND ? 4 : 1;
}

double kn_impact_power(const kn_model *model)
{
    const kn_law *law = &model->law;
    if (!(law->s1_pa > 0)) return INFINITY;
    double flow_n = law->s1_pa * model->gamma * model->def.spacing_m * model->kappa_m; // an edge that flows pulls so
    double flow_w = flow_n * flow_n / (model->kappa_m * law->a_pa_s);                  // force^2 / damping
    return KN_IMPACT_POWER * model->node_count * flow_w;
}

bool kn_impact(const kn_model *model, const kn_state *state, const kn_contact *contact, double rz)
{
    if (!(model->law.s1_pa > 0)) return false;
    double power = kn_impact_power(model);
    double least = state->residual_scale > KN_IMPACT_RECENT * power ? KN_IMPACT_AFTER : 1;
    return rz > least * power || carried(model, state, contact) > 1 || pressed(model, state, contact) > 1;
}
