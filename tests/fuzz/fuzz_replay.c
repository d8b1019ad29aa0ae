// libFuzzer target: any log is either refused in one line or replays.
#include "server/log_replay.h"
#include "tests/fuzz/memory_file.h"
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char error[512] = "";
    const char *set = "solver.iterations=1"; // another computation than any log's, so that its scene does not matter
    kn_replay_def def = {.log_path = memory_file(data, size),
                         .scene_path = KN_SOURCE_DIR "/tests/fuzz/replay.yaml",
                         .sets = &set,
                         .set_count = 1};
    kn_replay *replay = kn_replay_create(&def, error, sizeof error);
    require(replay || (error[0] && !strchr(error, '\n')));
    // a record has at least a pose: header, KNEAD_POSE_x, type; ticks forwards and back
    const int64_t records = 1 + (int64_t)size / 48;
    require(!replay || replay->tally.ticks_total <= 2 * (3600000 + 1000 * records));
    for (int i = 0; replay && i < 50 && kn_replay_step(replay); i++) continue;
    kn_replay_destroy(replay);
    return 0;
}
