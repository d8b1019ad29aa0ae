#include "core/springs.h"
#include "core/composite.h"
#include "core/kernel.h"

#include <math.h>
#include <stdlib.h>

// List the edges of one part, with offsets from its own nodes and slots to those of the whole model.
static void list_edges(kn_springs *s, const kn_model *part, const kn_edge *edge, int count, int node, int slot)
{
    double kappa_m = part->def.mesh ? part->kappa_m : part->grid.kappa_m;
    for (int e = 0; e < count; e++) {
        double length = s->gamma * edge[e].rest_m;
        s->spring[s->count++] = (kn_spring){edge[e].i + node, edge[e].j + node, edge[e].slot + slot, edge[e].rest_m,
                                            length * length * kappa_m * edge[e].weight};
    }
}

static int edges_of(const kn_model *m)
{
    if (m->def.mesh) return m->edge_count;
    return m->composite ? kn_composite_edges(m) : kn_grid_edges(&m->grid, NULL);
}

bool kn_springs_init(kn_springs *s, const kn_model *model)
{
    const kn_model *m = model;
    const kn_composite *c = m->composite;
    // with an explicit method the state already holds the end of the step, so the law is built with dt = 0
    bool stepped = m->def.solver.kind == KN_SOLVER_IMPLICIT;
    *s = (kn_springs){.model = m, .gamma = m->def.mesh ? m->gamma : m->grid.gamma};
    kn_law_build(&s->law, &m->def.material, stepped ? m->def.solver.dt_s : 0, true);
    size_t count = (size_t)edges_of(m) + 1;
    s->spring = malloc(count * sizeof *s->spring);
    kn_edge *edge = malloc(count * sizeof *edge);
    bool fits = s->spring && edge;
    // a net has its own list; a block and the parts of a composite generate theirs
    if (fits && m->def.mesh) list_edges(s, m, m->edges, m->edge_count, 0, 0);
    else if (fits && !c) list_edges(s, m, edge, kn_grid_edges(&m->grid, edge), 0, 0);
    for (int p = 0; fits && c && p < c->part_count; p++)
        list_edges(s, &c->part[p], edge, kn_grid_edges(&c->part[p].grid, edge), c->node_first[p],
                   c->row_first[p] * KN_FORWARD * (int)m->stride);
    free(edge);
    if (!fits) kn_springs_free(s);
    return fits;
}

size_t kn_springs_bytes(const kn_model *model)
{
    return ((size_t)edges_of(model) + 1) * (sizeof(kn_spring) + sizeof(kn_edge));
}

void kn_springs_free(kn_springs *springs)
{
    free(springs->spring);
    *springs = (kn_springs){0};
}

// Return the length of an edge now, and in *before its length one step ago.
static double length_of(const kn_model *m, const kn_state *state, const kn_spring *e, double *before)
{
    double xi[3], xj[3], vi[3], vj[3], now = 0, then = 0;
    kn_state_position(m, state, e->i, xi);
    kn_state_position(m, state, e->j, xj);
    kn_state_velocity(m, state, e->i, vi);
    kn_state_velocity(m, state, e->j, vj);
    for (int k = 0; k < 3; k++) {
        double d = xj[k] - xi[k], last = d - m->def.solver.dt_s * (vj[k] - vi[k]);
        now += d * d;
        then += last * last;
    }
    *before = sqrt(then);
    return sqrt(now);
}

kn_spring_now kn_spring_look(const kn_springs *s, const kn_state *state, int number)
{
    const kn_spring *e = &s->spring[number];
    const kn_law *law = &s->law;
    const kn_material *mat = &law->mat;
    // growth rate and stretch in the last step
    double unit = s->gamma * e->rest_m, before, now = length_of(s->model, state, e, &before);
    double rate = (now - before) / (s->model->def.solver.dt_s * unit), stretch = (now - e->rest_m) / e->rest_m;
    kn_spring_now n = {.length_m = now};
    // the strain follows from the length; the integer solver's stored strain has the same value
    if (law->kind == KN_LAW_VOIGT) {
        n.voigt = stretch / s->gamma;
        n.stress_pa = mat->c1_pa_s * rate + mat->k1_pa * n.voigt;
        return n;
    }
    // the strain in the state is that before the last step: repeat the step of the law
    double last = kn_real_get(s->model, state->strain, (size_t)e->slot), dt = law->dt_s;
    double b = law->a_pa_s * rate + mat->k1_pa * last;
    n.stress_pa = kn_law_stress(law, b);
    double left = stretch - s->gamma * last; // stretch of the damper if the Voigt element kept its strain
    if (law->stroke && dt > 0)
        n.stress_pa = kn_law_stop(law, n.stress_pa, b, (left - law->in) / s->gamma, (law->out - left) / s->gamma);
    if (law->stroke && dt == 0 && // Runge-Kutta: rigid at a stop
        (n.stress_pa < 0 ? left <= law->in + KN_LAW_STROKE_ENDS : left >= law->out - KN_LAW_STROKE_ENDS))
        n.stress_pa = b;
    n.voigt = last + (dt > 0 ? dt * (n.stress_pa - mat->k1_pa * last) / law->a_pa_s : 0);
    // without a spring, the Voigt element does not return, so its strain is residual, too
    n.residual = stretch - (mat->k1_pa > 0 ? s->gamma * n.voigt : 0);
    return n;
}
