#ifndef KN_CORE_DEADLINE_H
#define KN_CORE_DEADLINE_H
// Limit on the work of one step, in units of work that the step itself counts. The count depends on the input alone. So
// a step that the deadline ends early has the same bits on every machine. A unit is about one nanosecond of one core
// with AVX-512. The caller that sets the deadline measures the length of a unit on its own machine (server/served_object.h).
//
//     spent  |find|line i i i i|look|i i|line i i i i|look|i i        most
//            '-----------------------------------------------------'   the next part would not fit: the step ends
//
// Terms: find is the search for contact, a line is one linearisation of the law, i an iteration along the line, a look
// one evaluation of the contact. The work of each part of an implicit step is counted before the part begins. The
// shortest step is one line, one iteration and one look. It is taken even if the deadline is shorter. A blow (impact.h)
// may need more lines than fit. Then the units are shared among as many lines as fit with a few iterations each. All
// lines but the last are solved only to a fifth of their initial residual. If a plate strikes, the step starts from a
// guessed velocity field (kn_impact_guess). The unsolved part stays in the residual from which the next step starts.
// The stages of Runge-Kutta and the passes of the integer solver are fixed by the model: they have no deadline.
#include "core/contact.h"

typedef struct kn_deadline {
    int64_t most, spent;           // units of work: limit of the step and count so far; `most` 0: no deadline
    int64_t line, iteration, look; // estimated units of work of one linearisation, one iteration, one contact look
    int64_t law;                   // estimated units of work of evaluating the law once, a part of a linearisation
    int64_t line_most;             // limit of `spent` for the linearisation that is being solved
    bool hurried;                  // linearisations are cut short to leave time for later ones
} kn_deadline;

// Estimate the units of work of each part of this step, and count the contact search, which is already done. `most`:
// limit of the step, in units of work.
void kn_deadline_begin(kn_deadline *deadline, const kn_model *model, const kn_contact *contact, int64_t most);

// Begin a linearisation (line) and count its work and that of its look at the contact. Return false if the
// linearisation and two iterations exceed the deadline. The first linearisation always begins.
bool kn_deadline_line(kn_deadline *deadline, bool first);

// Return the units that kn_impact_guess takes when a plate strikes. Return 0 if no guess is needed, because `lines`
// lines of `iterations` iterations each fit. Return 0, too, if a guess, a line and two iterations do not fit.
int64_t kn_deadline_guess(const kn_deadline *deadline, const kn_model *model, int lines, int iterations);

// Limit the linearisation that has begun to its share of the remaining units of work. `lines`: number of linearisations
// from this one on, each of at most `iterations` iterations.
void kn_deadline_share(kn_deadline *deadline, int lines, int iterations);

// If the present linearisation has that many units of work left, count them and return true. Else return false.
bool kn_deadline_spend(kn_deadline *deadline, int64_t units);

// Return the units of work of the shortest step of a model while no tool touches the object.
int64_t kn_deadline_least(const kn_model *model);

#endif
