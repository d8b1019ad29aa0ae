#ifndef KN_SERVER_LOG_H
#define KN_SERVER_LOG_H
// LCM event logs, nothing else: lcm-logger writes them, lcm-logplayer plays them.
//
//     magic u32 | number i64 | timestamp i64 us | channel length i32 | data length i32 | channel | data     big-endian
//
// A log is a file somebody gave us. The header of every record is checked against the rest of the file before anything
// is allocated, and every payload against its type's size before a generated decoder (which trusts its counts) sees it.
// A log that was cut, or is damaged somewhere, is good up to there. lcm_eventlog_read_next_event is not for us: it
// allocates what a damaged header asks for, drops the good record before the damage and cannot tell damage from the
// end. Not real-time.
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_scene_t.h"
#include <lcm/lcm.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define KN_LOG_TICK_MAX ((int64_t)1 << 42)  // 139 years: ticks and times of a log leave room to calculate with
#define KN_LOG_UTIME_MAX ((int64_t)1 << 52) // the year 2112

typedef enum kn_log_kind {
    KN_LOG_END,      // of the file, or of its undamaged part
    KN_LOG_POSE,     // the bytes; the receiver judges them
    KN_LOG_FORCE,    // .force, finite, tick 0 .. KN_LOG_TICK_MAX
    KN_LOG_EVENT,    // .event, the same
    KN_LOG_SCENE,    // .scene
    KN_LOG_OTHER,    // a channel that a replay does not need
    KN_LOG_MALFORMED // one of the above by its channel, but not by its bytes
} kn_log_kind;

typedef struct kn_log_record { // valid until the next read
    kn_log_kind kind;
    int64_t utime; // when it was logged, us, 0 .. KN_LOG_UTIME_MAX
    const char *channel;
    const char *probe; // POSE, FORCE: what follows the channel's prefix
    const void *data;
    size_t size;
    union {
        knead_contact_force_t force;
        knead_event_t event;
        knead_scene_t scene;
    };
} kn_log_record;

typedef struct kn_log {
    FILE *file;
    unsigned char *buffer; // of the last record
    size_t capacity;
    knead_scene_t scene; // decoded, its strings to be freed
    bool has_scene;
    int64_t size, offset; // of the file; where the next record begins
    int64_t records;
    char damage[160]; // "" or what is wrong at offset
} kn_log;

// False and one line in error.
bool kn_log_open(kn_log *log, const char *path, char *error, size_t error_size);
kn_log_kind kn_log_read(kn_log *log, kn_log_record *record);
void kn_log_close(kn_log *log); // a zeroed one is fine

// Writing is liblcm's: lcm_eventlog_create(path, "w"), this, lcm_eventlog_destroy. False: the disk is full.
bool kn_log_write(lcm_eventlog_t *file, int64_t utime, const char *channel, void *data, size_t size);

#endif
