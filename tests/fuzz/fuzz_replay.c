// libFuzzer target: whatever stands in a log, it is either refused in one line or replays.
#include "server/replay.h"
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static void require(int condition)
{
    if (!condition) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static int fd = -1;
    char path[32], error[512] = "";
    if (fd < 0) fd = memfd_create("log", 0);
    require(fd >= 0 && ftruncate(fd, 0) == 0 && pwrite(fd, data, size, 0) == (ssize_t)size);
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);

    const char *set = "solver.iterations=1"; // another computation than any log's: its scene does not matter
    kn_replay_def def = {
        .log_path = path, .scene_path = KN_SOURCE_DIR "/tests/fuzz/replay.yaml", .sets = &set, .set_count = 1};
    kn_replay *replay = kn_replay_create(&def, error, sizeof error);
    require(replay || (error[0] && !strchr(error, '\n')));
    for (int i = 0; replay && i < 50 && kn_replay_step(replay); i++) continue;
    kn_replay_destroy(replay);
    return 0;
}
