#ifndef KN_CLIENTS_ORIGIN_H
#define KN_CLIENTS_ORIGIN_H
// Whether a log is fit to be played again and again: whole, and of the scene that it is played on.
//
// `knead replay` uses what stands before the damage and says so; a sweep of hours on half a log says nothing about the
// other half. A log without a scene of its own (lcm-logger, started after the server) is believed.
#include "clients/knead/plan.h"

// replay: of the log, created. The scene is the log's when nothing but solver and quality differ, with or without the
// plan's sets. False and one line in error.
bool kn_origin_check(const kn_replay *replay, const kn_plan *plan, char *error, size_t error_size);

#endif
