#include "core/energy.h"
#include "core/scratch.h"
#include "core/springs.h"
#include "core/vec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct lattice { // lists of everything that stores energy
    const kn_model *model;
    kn_springs springs;
    kn_cell *cell;
    double *cell_volume_m3;
    int cells;
} lattice;

// --- lists ----------------------------------------------------------------------------------------------------------

// List all cells with their volumes at rest.
static bool list_cells(lattice *l)
{
    const kn_model *m = l->model;
    if (m->def.pressure == KN_PRESSURE_NONE) return true;
    l->cells = m->cells ? m->cell_count : kn_grid_cells(&m->grid, NULL);
    l->cell = malloc((size_t)l->cells * sizeof *l->cell + 1);
    l->cell_volume_m3 = malloc((size_t)l->cells * sizeof *l->cell_volume_m3 + 1);
    if (!l->cell || !l->cell_volume_m3) return false;
    if (m->cells) memcpy(l->cell, m->cells, (size_t)l->cells * sizeof *l->cell);
    else kn_grid_cells(&m->grid, l->cell);
    double whole = m->grid.spacing_m * m->grid.spacing_m * m->grid.depth_m;
    for (int i = 0; i < l->cells; i++) l->cell_volume_m3[i] = m->cells ? m->cell_volume[i] : whole;
    return true;
}

static void lattice_free(lattice *l)
{
    kn_springs_free(&l->springs);
    free(l->cell);
    free(l->cell_volume_m3);
}

static bool lattice_init(lattice *l, const kn_model *model)
{
    *l = (lattice){.model = model};
    bool fits = kn_springs_init(&l->springs, model) && list_cells(l);
    if (!fits) lattice_free(l);
    return fits;
}

// --- sums -----------------------------------------------------------------------------------------------------------

// Return the energy stored in a Voigt element, J.
static double in_edge(const kn_springs *s, const kn_state *state, int number)
{
    double u = kn_spring_look(s, state, number).voigt;
    return 0.5 * s->law.mat.k1_pa * u * u * s->spring[number].volume_m3;
}

// Return the kinetic energy of a node, J, and add its potential energy of height.
static double in_node(const kn_model *m, const kn_state *state, int i, double *height_j)
{
    double x[3], v[3];
    kn_state_position(m, state, i, x);
    kn_state_velocity(m, state, i, v);
    *height_j += m->node_mass_kg[i] * m->def.gravity_m_s2 * (x[2] - m->rest_m[i][2]);
    return 0.5 * m->node_mass_kg[i] * m->def.solver.mass_scale * kn_dot(v, v);
}

static double volume_of(const kn_model *m, const kn_state *state, const kn_cell *cell)
{
    double x[8][3], gradient[8][3];
    for (int i = 0; i < 8; i++)
        if (cell->corner[i] >= 0) kn_state_position(m, state, cell->corner[i], x[i]);
    if (m->def.mesh) return kn_simplex_volume(m->def.thickness_m, (const double(*)[3])x, gradient);
    return kn_cell_volume(&m->grid, (const double(*)[3])x, gradient);
}

// Return the energy of the gas at J = V/V0, in units of P0 V0: the integral of cell.h's law.
static double gas(double j)
{
    double slope, least = fmax(j, KN_CELL_LEAST), under = least - j, pressure = kn_cell_pressure(least, &slope);
    return least - 1 - log(least) + under * (pressure + 0.5 * slope * under);
}

typedef struct sum { // sums over a state, part by part
    kn_energy energy;
    double volume_m3, rest_m3; // present volume and rest volume of all cells
    int edge, node, cell;      // next edge, node and cell to sum
} sum;

// Sum the next `count` edges, nodes and cells. Return true when none are left.
static bool sum_some(const lattice *l, const kn_state *state, sum *s, int count)
{
    const kn_model *m = l->model;
    for (; count > 0 && s->edge < l->springs.count; count--)
        s->energy.elastic += in_edge(&l->springs, state, s->edge++);
    for (; count > 0 && s->node < m->node_count; count--)
        s->energy.kinetic += in_node(m, state, s->node++, &s->energy.height);
    for (; count > 0 && s->cell < l->cells; count--) {
        double rest = l->cell_volume_m3[s->cell], now = volume_of(m, state, &l->cell[s->cell++]);
        if (m->def.pressure == KN_PRESSURE_CELLS) s->energy.gas += m->def.inside_pressure_pa * rest * gas(now / rest);
        s->volume_m3 += now;
        s->rest_m3 += rest;
    }
    // one pressure for the whole object needs the whole volume first
    if (count == 0) return false;
    if (m->def.pressure == KN_PRESSURE_OBJECT)
        s->energy.gas = m->def.inside_pressure_pa * s->rest_m3 * gas(s->volume_m3 / s->rest_m3);
    return true;
}

bool kn_energy_of(const kn_model *model, const kn_state *state, kn_energy *energy)
{
    lattice l;
    sum s = {0};
    if (!lattice_init(&l, model)) return false;
    while (!sum_some(&l, state, &s, 1 << 20)) continue;
    *energy = s.energy;
    lattice_free(&l);
    return true;
}

// --- audit ----------------------------------------------------------------------------------------------------------

typedef struct moment {      // the energies at one copy of the state
    double work_j, either_j; // work done, and sum of its absolute values, since the last reset
    double contact_j;        // largest energy that the contact layers may give back
    double stored_j;
} moment;

struct kn_audit {
    lattice lattice;
    kn_state *copy;
    sum sum;
    int at_once;          // number of edges summed per tick
    bool summing, closed; // the copy of the state is being summed; `first` and `last` are valid
    int64_t ticks, steps; // number of ticks audited since the last reset; state->tick at the last audited tick
    moment now, taken, first, last;
    double probe_work_j[KN_PROBES_MAX];
    bool attached[KN_PROBES_MAX];
    kn_audit_news news;
};

kn_audit *kn_audit_create(const kn_model *model)
{
    kn_audit *a = model->def.solver.kind == KN_SOLVER_IMPLICIT ? calloc(1, sizeof *a) : NULL;
    if (!a || !lattice_init(&a->lattice, model)) {
        free(a);
        return NULL;
    }
    a->copy = kn_state_keep(model);
    a->at_once = 2 * (a->lattice.springs.count + model->node_count + a->lattice.cells) / KN_AUDIT_TICKS + 1;
    if (a->copy) return a;
    kn_audit_destroy(a);
    return NULL;
}

void kn_audit_destroy(kn_audit *audit)
{
    if (!audit) return;
    lattice_free(&audit->lattice);
    kn_state_destroy(audit->copy);
    free(audit);
}

// Add the tools' work of the last tick to the account. A tool's work begins at 0 when the tool is attached. The value
// of a detached tool is not used.
static void book_work(kn_audit *a, const kn_state *state)
{
    for (int p = 0; p < a->lattice.model->def.probe_count; p++) {
        const kn_probe_state *probe = &state->probe[p];
        double done = !probe->attached ? 0 : a->attached[p] ? probe->work_j - a->probe_work_j[p] : probe->work_j;
        a->now.work_j += done;
        a->now.either_j += fabs(done);
        a->probe_work_j[p] = probe->work_j;
        a->attached[p] = probe->attached;
    }
}

// Return the most energy that contact may give back: half of force times deflection of every pressing sample.
static double in_contact(const kn_state *state)
{
    const kn_contact *c = &kn_state_scratch(state)->contact;
    double most = 0;
    for (int i = 0; i < c->sample_count; i++) {
        const kn_sample *s = &c->sample[i];
        if (!s->line.active) continue;
        double pressing = fabs(s->pressing_n), side[3], square = 0;
        for (int k = 0; k < 3; k++) {
            side[k] = s->force_n[k] - s->pressing_n * s->normal[k];
            square += side[k] * side[k];
        }
        // a layer gets stiffer with depth, so it stores less than this
        most += 0.5 * (pressing * pressing + square) / s->foundation_n_m;
    }
    return most;
}

// Start a new energy account: forget all work and stored energy.
static void begin(kn_audit *a)
{
    a->ticks = a->steps = 0;
    a->summing = a->closed = false;
    a->now = (moment){0};
    memset(a->probe_work_j, 0, sizeof a->probe_work_j);
    memset(a->attached, 0, sizeof a->attached);
}

// Judge the window between the last two copies. The stored energy must not exceed the energy at the earlier copy plus
// the work done since then.
static void judge(kn_audit *a)
{
    kn_audit_news *news = &a->news;
    a->taken.stored_j = kn_energy_sum(&a->sum.energy);
    // the energy of a diverged state is not finite, so start a new account
    if (!isfinite(a->taken.stored_j)) {
        begin(a);
        return;
    }
    news->stored = a->sum.energy;
    news->work_j = a->taken.work_j;
    if (a->closed) {
        // most: the largest energy that may be stored now; created energy beyond the tolerance is counted
        double most = a->last.stored_j + a->last.contact_j + a->taken.work_j - a->last.work_j;
        double either = a->taken.either_j - a->last.either_j;
        news->lost_j = most - a->taken.stored_j;
        news->windows++;
        if (!(news->lost_j >= -KN_AUDIT_SHARE * either - 1e-9)) {
            news->created++;
            news->most_j = fmax(news->most_j, -news->lost_j);
        }
    }
    if (!a->closed) a->first = a->taken;
    news->balance_j = a->taken.work_j - a->first.work_j - (a->taken.stored_j - a->first.stored_j);
    a->last = a->taken;
    a->closed = true;
    a->summing = false;
}

void kn_audit_restart(kn_audit *audit) { begin(audit); }

void kn_audit_follow(kn_audit *next, const kn_audit *last) { next->news = last->news; }

void kn_audit_tick(kn_audit *audit, const kn_state *state)
{
    kn_audit *a = audit;
    // if the state's tick has gone back, the state was reset
    if (state->tick < a->steps || state->bad) begin(a);
    a->steps = state->tick;
    if (state->bad) return; // the energies are not finite; keep the earlier judgements
    book_work(a, state);
    // copy the state at the start of a window, then sum the copy over the following ticks
    if (a->ticks++ % KN_AUDIT_TICKS == 0 && !a->summing) {
        kn_state_copy(a->lattice.model, a->copy, state);
        a->now.contact_j = in_contact(state);
        a->taken = a->now;
        a->sum = (sum){0};
        a->summing = true;
    } else if (a->summing && sum_some(&a->lattice, a->copy, &a->sum, a->at_once)) {
        judge(a);
    }
}

const kn_audit_news *kn_audit_read(const kn_audit *audit) { return &audit->news; }
