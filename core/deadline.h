#ifndef KN_CORE_DEADLINE_H
#define KN_CORE_DEADLINE_H
// The work that a step may take, in units that the step counts itself. The count depends on the input alone, so a step
// that ends by its deadline ends with the same bits on every machine. A unit is about a nanosecond of one core with
// AVX-512; what it takes here is measured by whoever gives the deadline (server/served.h).
//
//     spent  |find|line i i i i|look|i i|line i i i i|look|i i        most
//            '-----------------------------------------------------'   the next part would not fit: the step ends
//
// Every part of an implicit step is counted before it is begun. The shortest step is one line through the law, one
// iteration along it and one look at the contact: it is taken even where the deadline is below it. Where a blow
// (impact.h) asks for more lines than fit, the time is shared among as many as do fit with a few iterations each, and
// all lines but the last are solved to a fifth only, and a plate's blow starts from a guess. What is left unsolved
// stays in the residual that the next step starts from. Runge-Kutta's stages and the integers' passes are fixed by the
// model: they have no deadline.
#include "core/contact.h"

typedef struct kn_deadline {
    int64_t most, spent;           // of the step; most 0: no deadline
    int64_t line, iteration, look; // price of each part in this step
    int64_t law;                   // of a line
    int64_t line_most;             // what spent may come to in the line that is being solved
    bool hurried;                  // lines are cut short to make room for others
} kn_deadline;

// The contact search is done and spent.
void kn_deadline_begin(kn_deadline *deadline, const kn_model *model, const kn_contact *contact, int64_t most);

// Begins a line with its look at the contact. False: there is no time for it and two iterations.
bool kn_deadline_line(kn_deadline *deadline, bool first);

// Units of a guess of a plate's blow (impact.h). 0 where all `lines` of so many iterations fit, since then no guess is
// needed. 0, too, where a guess, a line and two iterations do not fit.
int64_t kn_deadline_guess(const kn_deadline *deadline, const kn_model *model, int lines, int iterations);

// Gives the line that has begun its share; `lines`: this one and those that may follow, of at most `iterations` each.
void kn_deadline_share(kn_deadline *deadline, int lines, int iterations);

// Spends units of the line if there is room for them.
bool kn_deadline_spend(kn_deadline *deadline, int64_t units);

// Units of the shortest step while nothing touches.
int64_t kn_deadline_least(const kn_model *model);

#endif
