#ifndef KN_SERVER_TEAM_H
#define KN_SERVER_TEAM_H
// The second thread of a team (core/state.h), the helper. It sleeps between ticks. In a tick it spins, so that it
// begins its part of a loop within a fraction of a microsecond.
//
//     servo    wake  part 0 ####..  part 0 ####  part 0 ####part 1 ####   rest       .. waits for a part that has begun
//     helper         part 1 ######  part 1 ###   (kept away by the kernel)  sleeps
//
// Each part 1 is claimed with one atomic operation. The servo claims it itself if the helper has not when part 0 is
// done. So a helper that is late, or does not run at all, costs nothing but its share of the work. The servo waits only
// for a part that the helper has begun: a helper that loses its processor in the middle of one makes that tick late.
#include "server/backend/backend.h"
#include "server/rt.h"

typedef struct kn_helper kn_helper;

// Create the helper, at normal priority, on another processor than the servo. Return NULL and put the reason in `why`
// if there is no second processor, if memory is short, or if the thread cannot be started.
kn_helper *kn_helper_create(char *why, size_t why_size);
// Give the helper its real-time priority (rt.h), if the machine grants it. `helper` may be NULL.
void kn_helper_raise(kn_helper *helper, const kn_rt *rt);
void kn_helper_destroy(kn_helper *helper); // does nothing if `helper` is NULL

// Make the helper's team that of a backend's steps; NULL: none. Return whether it takes part (kn_scratch_team).
bool kn_helper_join(kn_helper *helper, kn_backend *backend, const kn_model *model);
// Wake the helper before a tick and return its team; let it sleep after the tick. Both are real-time safe, and do
// nothing if `helper` is NULL.
kn_team *kn_helper_wake(kn_helper *helper);
void kn_helper_rest(kn_helper *helper);

// Return the share of all parts 1 that the helper has done. 0: it was never there in time.
double kn_helper_share(const kn_helper *helper);

#endif
