#ifndef KN_CLIENTS_ORIGIN_H
#define KN_CLIENTS_ORIGIN_H
// Check that a log can be used for a sweep (many replays): the log must be undamaged and must belong to the scene under
// test.
//
// `knead replay` replays a damaged log up to the damage and reports the damage. A sweep refuses a damaged log, because
// hours of work on the first half would say nothing about the second half. A log may contain no scene, for example if
// lcm-logger was started after the server. Such a log is accepted as if it had been recorded with the scene under test.
#include "server/replay.h"

// Check the log of `def` against `scene`. Return false and one line in `error` if the log cannot be used.
// def: the replay that will be run. It needs at least one set (a `key=value` that overrides the scene). A replay
// without sets refuses a log of another scene by itself, before this function can compare the two scenes.
// scene: the scene at `scene_path` with the user's sets. `scene` may differ from the scene of the log in these keys
// only: solver, quality, mesh (contents of mesh messages), and the places of small cells (object.accuracy,
// object.margin, the probes' reach). The two scenes are compared with the user's sets and, if they differ, once more
// without the sets.
bool kn_origin_check(const kn_replay_def *def, const char *scene_path, const kn_scene *scene, char *error,
                     size_t error_size);

#endif
