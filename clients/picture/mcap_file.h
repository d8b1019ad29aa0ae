#ifndef KN_CLIENTS_MCAP_FILE_H
#define KN_CLIENTS_MCAP_FILE_H
// Writer of an MCAP file: messages with their times and with the schema that describes them, for Foxglove and every
// other reader of MCAP. The messages are JSON, and the file is indexed. Its topics are
//
//     /tf           foxglove.FrameTransform  pose of each tool, every tick: frame NAME in the frame World
//     /scene        foxglove.SceneUpdate     every moment: surfaces of the object and of the tools, and for the force
//                                            on each tool an arrow, whose shaft is 1 cm long per newton
//     /NAME/force   knead.Force              position and forces of the tool NAME, every tick
#include "clients/picture/object_still.h"
#include "clients/picture/paraview.h"
#include "server/log_replay.h"
#include <stdio.h>

typedef struct kn_mcap kn_mcap;

// Begin a file for the probes of `model`. epoch_us: time of the clock at the recording's time 0, us since 1970. `file`
// must stay open until kn_mcap_close. Return NULL when memory is short. The functions do not check for errors of
// `file`; the caller does.
kn_mcap *kn_mcap_open(FILE *file, const kn_model *model, int64_t epoch_us);

// Add the poses and forces of a tick. Ticks and moments come in the order of time.
void kn_mcap_tick(kn_mcap *mcap, const kn_model *model, const kn_replay_tick *tick);

// Add the object and its tools at a moment.
void kn_mcap_moment(kn_mcap *mcap, const kn_moment *moment);

// Write the index and free `mcap`; NULL is allowed. Return false if memory was short since kn_mcap_open.
bool kn_mcap_close(kn_mcap *mcap);

#endif
