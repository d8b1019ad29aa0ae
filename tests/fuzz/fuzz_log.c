// libFuzzer target: any bytes as a log are read to their end or to their damage. The properties reported of a record
// hold, and its bytes can be read. fuzz_replay tests the replay.
#include "server/log.h"
#include "tests/fuzz/memory_file.h"
#include <math.h>
#include <string.h>

static void check(const kn_log_record *r)
{
    unsigned sum = 0; // sum of every byte, so that the address sanitizer checks each
    for (size_t i = 0; i < r->size; i++) sum += ((const unsigned char *)r->data)[i];
    require(sum <= 255 * r->size && r->utime >= 0 && r->utime <= KN_LOG_UTIME_MAX && strlen(r->channel) < 64);
    switch (r->kind) {
    case KN_LOG_FORCE:
        require(r->force.tick >= 0 && r->force.tick <= KN_LOG_TICK_MAX && *r->probe);
        for (int i = 0; i < 3; i++) require(isfinite(r->force.force_n[i]));
        break;
    case KN_LOG_EVENT: require(r->event.tick >= 0 && r->event.tick <= KN_LOG_TICK_MAX); break;
    case KN_LOG_SCENE: require(strlen(r->scene.name) + strlen(r->scene.text) < r->size); break;
    case KN_LOG_POSE: require(*r->probe); break;
    default: break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char error[512] = "";
    kn_log log;
    kn_log_record record;
    int64_t records = 0;
    require(kn_log_open(&log, memory_file(data, size), error, sizeof error));
    for (; kn_log_read(&log, &record) != KN_LOG_END; records++) check(&record);
    require(log.records == records && (log.offset == (int64_t)size || log.damage[0]));
    kn_log_close(&log);
    return 0;
}
