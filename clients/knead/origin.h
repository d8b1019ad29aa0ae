#ifndef KN_CLIENTS_ORIGIN_H
#define KN_CLIENTS_ORIGIN_H
// Whether a log is fit to be played again and again: whole, and of the scene that it is played on.
//
// `knead replay` uses what stands before the damage and says so; a sweep of hours on half a log says nothing about the
// other half. A log without a scene of its own (lcm-logger, started after the server) is believed.
#include "server/replay.h"

// def: as it will be played, with at least one set, or another scene is refused before this can judge it. The scene,
// that of the path with the user's sets, is the log's when nothing but solver, quality, what meshes tell and
// where cells are small (object.accuracy, object.margin, the probes' reach) differ, with or without the sets. False and one line in error.
bool kn_origin_check(const kn_replay_def *def, const char *scene_path, const kn_scene *scene, char *error,
                     size_t error_size);

#endif
