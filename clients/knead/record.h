#ifndef KN_CLIENTS_RECORD_H
#define KN_CLIENTS_RECORD_H
// Record of all messages of a session. A thread of its own receives the messages. A hand needs only the newest force
// and skips the others, but a log and a force table need every force. On request the messages are also written to an
// LCM event log as they arrive: KNEAD_SCENE first, then every pose, force and event since kn_record_start.
// kn_record_start opens the log file, so a record that never starts does not overwrite an older file.
//
//     kn_record_open -> kn_record_scene -> kn_record_start -> ... the session ... -> kn_record_stop
#include "clients/knead/join.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>

// Force message and the time of its arrival.
typedef struct kn_heard_force {
    knead_contact_force_t force;
    int64_t arrived_ns; // time of arrival (CLOCK_MONOTONIC)
} kn_heard_force;

typedef struct kn_record {
    char *scene_name, *scene_text; // name and text of the scene; set by kn_record_scene
    // Valid after kn_record_stop, in order of arrival:
    kn_heard_force *force;
    knead_probe_pose_t *pose;
    int force_count, pose_count;
    bool out_of_memory;
    // Set by the caller before kn_record_start: forces and poses are written to the log only and not kept in memory.
    bool log_only;
    _Atomic(int64_t) logged; // number of bytes of messages written to the log so far
    atomic_bool felt;        // true: the log contains at least one force on the probe
    // private
    kn_join *bus;
    struct _lcm_eventlog_t *log;
    // Path of the log. The text belongs to the caller and must outlive the record.
    const char *log_path;
    void *scene_bytes; // encoded KNEAD_SCENE message, the first record of the log
    int scene_size;
    int64_t scene_utime;
    char log_error[128]; // error message of the first failed write to the log, or ""
    char force_channel[64], pose_channel[64];
    int force_room, pose_room;
    bool started;
    atomic_bool stop;
    pthread_t thread;
} kn_record;

// Join the bus and begin to receive messages. Return NULL and one line in `error` on failure.
kn_record *kn_record_open(const char *url, char *error, size_t error_size);
// Wait for the scene. Return false if no KNEAD_SCENE came in time.
bool kn_record_scene(kn_record *record, int timeout_ms);
// Start recording the messages of a probe, and open the log file. log_path NULL: no log is written. Return false and
// one line in error on failure.
bool kn_record_start(kn_record *record, const char *probe, const char *log_path, char *error, size_t error_size);
// Wait for messages that are still on their way, stop the thread and close the log. Return false and one line in
// `error` if any part of the log could not be written.
bool kn_record_stop(kn_record *record, char *error, size_t error_size);
// Stop the thread of a record, if it runs, and free the record. NULL is allowed.
void kn_record_destroy(kn_record *record);

#endif
