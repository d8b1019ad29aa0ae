#include "core/deadline.h"
#include "core/composite.h"
#include "core/kernel.h"
#include "core/rigid.h"

// Prices: estimated units of work of the parts of a step, per lane of a lattice, per edge of a net, per sample of a
// tool. LINE is one linearisation of the law, ITERATION one iteration. The prices were measured in ns on a Sapphire
// Rapids, f32, by fitting them to the ticks of bench_strike. If a price is too small, steps with much of that part take
// longer than estimated. If a price is too large, such steps are capped early.
enum {
    STEP = 10000,
    LANE_LINE = 45,
    LANE_ITERATION = 5,
    EDGE_LINE = 44,
    EDGE_ITERATION = 4,
    GAS_LINE = 20,
    GAS_ITERATION = 2,
    TIE_LINE = 50,
    TIE_ITERATION = 15, // per tied node of a composite, for one iteration
    RIGID_LINE = 30,
    RIGID_ITERATION = 12,
    NEWTON_LINE = 1700, // per lane, for one linearisation whose law is solved edge by edge
    LAW = 4,            // without Newton, evaluating the law takes a fourth (1/LAW) of a linearisation's time
    F64_TIMES = 2,
    SAMPLE_FIND = 100,
    SAMPLE_LINE = 120,
    SAMPLE_ITERATION = 35,
    SAMPLE_LOOK = 100, // per sample, for one look at the contact; counted twice if the tool is coupled
    HOLD_LINE = 20,
    NODE_GUESS = 18
};

// Least number of iterations for which a linearisation is worth its time.
#define LINE_ITERATIONS 4

// Return the prices that depend on the lattice alone. `held`: a plate holds nodes in this step, so the rigid motions
// are not solved (rigid.h).
static kn_deadline of_lattice(const kn_model *m, bool held)
{
    const int64_t lanes = (int64_t)kn_model_field(m, 1), parts = m->def.mesh ? m->edge_count : lanes;
    kn_deadline d = {.line = parts * (m->def.mesh ? EDGE_LINE : LANE_LINE),
                     .iteration = parts * (m->def.mesh ? EDGE_ITERATION : LANE_ITERATION)};
    // gas adds the cells' pressure to every part, and f64 costs twice as much
    if (m->def.pressure != KN_PRESSURE_NONE) d.line += parts * GAS_LINE, d.iteration += parts * GAS_ITERATION;
    const bool f64 = m->def.solver.precision == KN_PRECISION_F64;
    if (f64) d.line *= F64_TIMES, d.iteration *= F64_TIMES;
    d.law = d.line / LAW;
    // a law that the lanes cannot evaluate is solved by Newton, edge by edge
    if (m->law.kind == KN_LAW_EXACT && !(f64 && kn_law_in_lanes(&m->law)))
        d.line += lanes * NEWTON_LINE, d.law += lanes * NEWTON_LINE;
    if (m->composite) d.line += kn_composite_tied(m) * TIE_LINE, d.iteration += kn_composite_tied(m) * TIE_ITERATION;
    if (kn_rigid_wanted(m) && !held) d.line += lanes * RIGID_LINE, d.iteration += lanes * RIGID_ITERATION;
    return d;
}

void kn_deadline_begin(kn_deadline *deadline, const kn_model *model, const kn_contact *contact, int64_t most)
{
    // with a coupled tool every sample counts twice
    const int64_t samples = contact->sample_count * (int64_t)(1 + contact->coupled);
    kn_deadline d = of_lattice(model, contact->hold_count > 0);
    d.most = most;
    d.spent = STEP + samples * SAMPLE_FIND;
    // contact adds units to every linearisation and every iteration
    d.line += samples * SAMPLE_LINE + contact->hold_count * (int64_t)HOLD_LINE;
    d.iteration += samples * SAMPLE_ITERATION;
    // a look that changes a sample needs a new residual, which counts as an iteration
    if (samples > 0) d.look = samples * SAMPLE_LOOK + d.iteration;
    *deadline = d;
}

bool kn_deadline_line(kn_deadline *d, bool first)
{
    const int64_t price = d->line + d->look;
    // the first linearisation is always taken; a further one must leave time for two iterations
    if (!first && d->most > 0 && d->spent + price + 2 * d->iteration > d->most) return false;
    d->spent += price;
    return true;
}

// The price covers every node once per probe, an upper bound for the plates, and the law: after a guess the first
// linearisation evaluates the law twice.
int64_t kn_deadline_guess(const kn_deadline *d, const kn_model *model, int lines, int iterations)
{
    // no guess without a deadline, nor when all linearisations fit
    if (d->most == 0 || d->spent + lines * (d->line + d->look + iterations * d->iteration) <= d->most) return 0;
    const int64_t price = model->def.probe_count * model->node_count * (int64_t)NODE_GUESS + d->law;
    // no guess if it would leave no time for one linearisation
    return d->spent + price + d->line + d->look + 2 * d->iteration > d->most ? 0 : price;
}

void kn_deadline_share(kn_deadline *d, int lines, int iterations)
{
    const int64_t room = d->most - d->spent, price = d->line + d->look, few = LINE_ITERATIONS * d->iteration;
    // longest: units that the present linearisation can still take, with one change of its contact
    const int64_t longest = d->look + iterations * d->iteration;
    d->line_most = d->most;
    d->hurried = false;
    // do not hurry when there is no deadline, only one linearisation, or time for all of them
    if (d->most == 0 || lines == 1 || lines * longest + (lines - 1) * price <= room) return;
    // fitting: number of linearisations that fit with a few iterations each
    int64_t fitting = 1 + (room - few) / (price + few);
    if (fitting > lines) fitting = lines;
    if (fitting < 2) return;
    // give each an equal share, although the first linearisations need more than the last ones
    d->line_most = d->spent + room / fitting;
    d->hurried = true;
}

bool kn_deadline_spend(kn_deadline *d, int64_t units)
{
    if (d->most > 0 && d->spent + units > d->line_most) return false;
    d->spent += units;
    return true;
}

int64_t kn_deadline_least(const kn_model *model)
{
    const kn_deadline d = of_lattice(model, false);
    // two iterations: one for the solve, and one for the look at the contact, which counts even without contact
    return STEP + d.line + 2 * d.iteration;
}
