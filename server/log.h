#ifndef KN_SERVER_LOG_H
#define KN_SERVER_LOG_H
// LCM event logs, the files that lcm-logger writes and lcm-logplayer plays; and a summary of a log.
//
//     magic u32 | number i64 | timestamp i64 us | channel length i32 | data length i32 | channel | data     big-endian
//
// A log is an untrusted file. The header of every record is checked against the rest of the file before anything is
// allocated. Every payload is checked against the size of its type before a generated decoder reads it, because these
// decoders trust the counts in the payload. A log that was cut or is damaged is readable up to the damage.
// lcm_eventlog_read_next_event is not used. This function allocates as many bytes as a damaged header demands, loses
// the good record before the damage, and cannot tell damage from the end of the file. Not real-time.
#include "core/scene/scene.h"
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
    KN_LOG_SNAPSHOT, // a piece of a snapshot file, as raw bytes
    KN_LOG_OTHER,    // a record on a channel that a replay does not need
    KN_LOG_MALFORMED // a record on the channel of a pose, force, event or scene, with invalid bytes
} kn_log_kind;

typedef struct kn_log_record { // one record of a log; its pointers are valid until the next read
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
// Read the next record. The record's strings and data stay valid until the next read.
kn_log_kind kn_log_read(kn_log *log, kn_log_record *record);
// Close the log. A log whose fields are all 0 is allowed.
void kn_log_close(kn_log *log);

// A snapshot file is logged in pieces of at most this size, so that a datagram can hold each of them.
#define KN_LOG_SNAPSHOT_CHANNEL "KNEAD_SNAPSHOT"
#define KN_LOG_SNAPSHOT_PIECE 60000
// Append one record to a log that liblcm writes: lcm_eventlog_create(path, "w"), this function, lcm_eventlog_destroy.
// Return false if the disk is full.
bool kn_log_write(lcm_eventlog_t *file, int64_t utime, const char *channel, void *data, size_t size);

// --- summary ---
//
// The summary of a log is collected by reading the log once from beginning to end: scenes, events, probes with forces,
// and the range of ticks. It also gives the end of the part that one run of a server recorded without damage.
// log_replay.h replays this part when it reads the log a second time.

// Limits of the time that a log may span. kneadd records a checkpoint every second, so a genuine log has at least one
// record per second. Without limits, a few forged records with very large tick numbers could make a replay run for
// ever.
#define KN_LOG_RECORD_MS 1000 // time that a log may span for each of its records, in ticks and in log time, ms
// Time that a log may span in addition to KN_LOG_RECORD_MS per record, ms. This time covers all pauses of the log
// together: missed cycles, and a wall clock that was set.
#define KN_LOG_PAUSE_MS 3600000
// Number of ticks without a record that a replay may run in addition to KN_LOG_RECORD_MS ticks for each record of the
// log.
#define KN_LOG_LOST_MS 60000

typedef struct kn_log_scene {
    uint64_t hash;
    char *text;
} kn_log_scene;

// Deadline, overload and quality of the server when its log begins. A value that the log does not record has its
// default, with which every server starts.
typedef struct kn_log_initial {
    bool deadline_told, overload_told, quality_told;
    int64_t deadline; // largest number of units of work (core/solve/step_effort.h) per step; 0: no limit
    bool overloaded;
    kn_quality quality, asked;
} kn_log_initial;

typedef struct kn_log_summary {
    knead_event_t *events; // array of event_count events, in the order of the log
    size_t event_count, event_capacity;
    char *scene_name, *scene_text;     // name and text of the first scene in the log; NULL: none
    uint64_t scene_hash, initial_hash; // initial_hash: state hash of the untouched object
    kn_log_scene *others;              // array of other_count later scenes, which result from settings made at run time
    size_t other_count;
    uint8_t *object; // snapshot file of the object where the log begins, object_size bytes; NULL: none
    size_t object_size;
    int64_t forces, records, malformed;
    int64_t own_records; // number of poses, forces, events and scenes among the records, without snapshots
    char force_probe[KN_PROBES_MAX][64]; // names of the probes for which the log holds forces
    // First and last tick number of all records; first tick number of a force; -1: none.
    int64_t first_tick, last_tick, first_force_tick;
    int64_t before_tick; // last tick that ran before first_tick; first_tick - 1 if no cycle was missed
    // Log times, us. first_utime, last_utime: first and last record; first_pose_utime: first pose, -1: no pose;
    // origin_utime: tick 0, extrapolated from first_tick.
    int64_t first_utime, last_utime, first_pose_utime, origin_utime;
    bool started;     // true if the log begins with the server's start
    bool undoes;      // true if the log contains an undo
    int64_t restores; // number of restores from a snapshot
    kn_log_initial initial;
    int64_t end_offset; // end of the part that can be replayed, bytes from the beginning of the file
    char damage[160];   // damage found in the file, "" if none; the summary covers the part before the damage
} kn_log_summary;

// Return how many cycles were missed just before the tick of a checkpoint that reports missed cycles. Return 0 for
// every other event.
int64_t kn_log_missed(const knead_event_t *e);

// Summarise a log. If the log cannot be read, or holds neither poses nor forces, return false and put one line in
// error. The caller frees the summary in both cases.
bool kn_log_summarise(kn_log_summary *summary, const char *path, char *error, size_t error_size);
void kn_log_summary_free(kn_log_summary *summary); // a zeroed summary is allowed

#endif
