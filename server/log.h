#ifndef KN_SERVER_LOG_H
#define KN_SERVER_LOG_H
// LCM event logs, the files that lcm-logger writes and lcm-logplayer plays.
//
//     magic u32 | number i64 | timestamp i64 us | channel length i32 | data length i32 | channel | data     big-endian
//
// A log is an untrusted file. The header of every record is checked against the rest of the file before anything is
// allocated. Every payload is checked against the size of its type before a generated decoder reads it, because these
// decoders trust the counts in the payload. A log that was cut or is damaged is readable up to the damage.
// lcm_eventlog_read_next_event is not used. This function allocates as many bytes as a damaged header demands, loses
// the good record before the damage, and cannot tell damage from the end of the file. Not real-time.
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_scene_t.h"
#include <lcm/lcm.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

// Bounds of the ticks and times of a log, so that arithmetic on them cannot overflow.
#define KN_LOG_TICK_MAX ((int64_t)1 << 42)  // largest tick number in a log, 139 years of 1 ms ticks
#define KN_LOG_UTIME_MAX ((int64_t)1 << 52) // largest time in a log, us since 1970: the year 2112

typedef enum kn_log_kind {
    KN_LOG_END,      // end of the file, or of its undamaged part
    KN_LOG_POSE,     // a pose as raw bytes, which the receiver judges
    KN_LOG_FORCE,    // a force; the field .force is valid: its numbers are finite and its tick is 0 .. KN_LOG_TICK_MAX
    KN_LOG_EVENT,    // an event; the field .event is valid: its numbers are finite and its tick is 0 .. KN_LOG_TICK_MAX
    KN_LOG_SCENE,    // a scene; the field .scene is valid
    KN_LOG_OTHER,    // a record on a channel that a replay does not need
    KN_LOG_MALFORMED // a record on the channel of a pose, force, event or scene, with invalid bytes
} kn_log_kind;

typedef struct kn_log_record { // valid until the next read
    kn_log_kind kind;
    int64_t utime; // time at which the record was logged, us, 0 .. KN_LOG_UTIME_MAX
    const char *channel;
    const char *probe; // name of the probe, that is, the channel name without its prefix; set for POSE and FORCE only
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
    unsigned char *buffer; // bytes of the last record
    size_t capacity;
    knead_scene_t scene; // the last decoded scene; its strings are freed at the next read
    bool has_scene;
    int64_t size, offset; // `size`: size of the file, bytes; `offset`: start of the next record in the file
    int64_t records;
    char damage[160]; // description of the damage found at `offset`; "" if the log is undamaged
} kn_log;

// Open a log. On failure return false and put one line in error.
bool kn_log_open(kn_log *log, const char *path, char *error, size_t error_size);
// Read the next record. Its strings and data stay valid until the next read.
kn_log_kind kn_log_read(kn_log *log, kn_log_record *record);
// Close the log. A zeroed log is fine.
void kn_log_close(kn_log *log);

// Append one record to a log that liblcm writes: lcm_eventlog_create(path, "w"), this function, lcm_eventlog_destroy.
// Return false if the disk is full.
bool kn_log_write(lcm_eventlog_t *file, int64_t utime, const char *channel, void *data, size_t size);

#endif
