// libFuzzer target: any bytes as a log are read to their end or to their damage, and what stands before it replays.
#include "server/log.h"
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
    char path[32], error[512] = "";
    int fd = memfd_create("log", 0);
    require(fd >= 0 && write(fd, data, size) == (ssize_t)size);
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);

    kn_log log;
    kn_log_record record;
    int64_t worth = 0;
    require(kn_log_open(&log, path, error, sizeof error));
    while (kn_log_read(&log, &record) != KN_LOG_END) worth += record.kind == KN_LOG_FORCE || record.kind == KN_LOG_POSE;
    require(log.offset == (int64_t)size || log.damage[0]);
    kn_log_close(&log);

    if (worth > 0) {
        const char *set = "solver.iterations=1"; // another computation than any log's: its scene does not matter
        kn_replay_def def = {.log_path = path,
                             .scene_path = KN_SOURCE_DIR "/core/scenes/dough-small.yaml",
                             .sets = &set,
                             .set_count = 1};
        kn_replay *replay = kn_replay_create(&def, error, sizeof error);
        require(replay || (error[0] && !strchr(error, '\n')));
        for (int i = 0; replay && i < 50 && kn_replay_step(replay); i++) continue;
        kn_replay_destroy(replay);
    }
    close(fd);
    return 0;
}
