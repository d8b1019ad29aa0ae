#include "clients/shape/verdict.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

// Return the AICc of a candidate for `worth` independent readings. A sum of squares below the number of residuals is
// raised to that number, since a misfit below the noise supports no candidate.
static double aicc(const kn_candidate *c, int readings, double worth)
{
    const int n = (int)fmax(worth, c->unknowns + 3);
    return kn_fit_aicc(n, c->unknowns, fmax(c->sum, readings) * n / readings);
}

static void judge(kn_verdict *v, int count, const kn_candidate *c, int readings)
{
    double best_sum = INFINITY, worth = 0, least = INFINITY;
    // The candidate with the least sum of squares determines the number of independent readings for all candidates.
    for (int i = 0; i < count; i++)
        if (c[i].found && c[i].sum < best_sum) best_sum = c[i].sum, worth = c[i].worth;
    for (int i = 0; i < count; i++) {
        v->off[i] = c[i].found ? sqrt(c[i].sum / readings) : (double)INFINITY;
        v->delta[i] = c[i].found ? aicc(&c[i], readings, worth) : (double)INFINITY;
        // A candidate whose fit removed the gas cannot be the best, unless there is no other.
        if (!c[i].found || c[i].no_gas_left || !(v->delta[i] < least)) continue;
        least = v->delta[i];
        v->best = i;
    }
    for (int i = 0; i < count && v->best < 0; i++)
        if (c[i].found && v->delta[i] < least) least = v->delta[i], v->best = i;
    for (int i = 0; i < count; i++) v->delta[i] -= least;
    v->explained = v->best >= 0 && v->off[v->best] <= KN_VERDICT_OFF;
    // If no candidate explains the data, choose the candidate with the least `off` (size of the residuals).
    for (int i = 0; i < count && v->best >= 0 && !v->explained; i++)
        if (c[i].found && c[i].no_gas_left == c[v->best].no_gas_left && v->off[i] < v->off[v->best]) v->best = i;
    v->explained = v->best >= 0 && v->off[v->best] <= KN_VERDICT_OFF;
    // The rival is the candidate other than the best that is nearest to the best and cannot be excluded.
    for (int i = 0; i < count && v->best >= 0; i++) {
        const bool near = v->explained ? v->delta[i] < KN_VERDICT_APART : v->off[i] < KN_VERDICT_NEAR * v->off[v->best];
        if (i == v->best || c[i].no_gas_left || !near) continue;
        const bool nearer =
            v->rival >= 0 && (v->explained ? v->delta[i] < v->delta[v->rival] : v->off[i] < v->off[v->rival]);
        if (v->rival < 0 || nearer) v->rival = i;
    }
}

__attribute__((format(printf, 2, 3))) static void add(kn_verdict *v, const char *format, ...)
{
    const size_t n = strlen(v->words);
    va_list args;
    va_start(args, format);
    vsnprintf(v->words + n, sizeof v->words - n, format, args);
    va_end(args);
}

// State how the rival compares with the best, and which measurement could separate the two.
static void tell_rival(kn_verdict *v, const kn_candidate *c)
{
    const kn_candidate *a = &c[v->best], *b = &c[v->rival];
    if (!v->explained) {
        add(v, " %s is nearly as close, %.1f times the noise: these measurements cannot tell which of the two it is.",
            b->name, v->off[v->rival]);
        return;
    }
    add(v, " It cannot be told apart from %s (dAICc %.1f)", b->words, v->delta[v->rival]);
    if (a->gas != b->gas) add(v, ": so little gas hardly changes the measured quantities.");
    else add(v, ": a range image of the dent without the tool, or the force over the hold, may tell them apart.");
}

// State the verdict in words: the best, its misfit, the rival, and structures without gas.
static void tell(kn_verdict *v, int count, const kn_candidate *c, const kn_evidence *e)
{
    const kn_candidate *best = &c[v->best];
    if (v->explained) {
        add(v, "%s explains it: the residual is %.2g times the noise.", best->name, v->off[v->best]);
    } else {
        add(v, "None of them explains it. %s comes nearest and is off by %.1f times the noise", best->name,
            v->off[v->best]);
        if (e->reliefs > 0) add(v, ", %.2g mm of the shape", 1e3 * best->misfit[0].height_m);
        if (e->pulled) add(v, ", %.2g %% of the force", 100 * best->pull_share);
        add(v, ": use its parameters as the nearest ones; the material, the lattice or the set-up differs as well.");
    }
    if (v->rival >= 0) tell_rival(v, c);
    for (int i = 0; i < count; i++)
        if (c[i].no_gas_left && i != v->best)
            add(v, " The fit of %s has no gas left: it equals the structure without gas.", c[i].name);
    if (best->no_gas_left) add(v, " The fit has no gas left.");
    if (!best->settled) add(v, " Its fit had not settled.");
}

void kn_verdict_make(kn_verdict *v, int count, const kn_candidate *candidate, const kn_evidence *evidence)
{
    *v = (kn_verdict){.best = -1, .rival = -1};
    judge(v, count, candidate, evidence->readings);
    if (v->best < 0) {
        add(v, "No structure can be pressed like that: %s", candidate[0].why);
        return;
    }
    tell(v, count, candidate, evidence);
}
