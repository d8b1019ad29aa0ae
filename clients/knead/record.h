#ifndef KN_CLIENTS_RECORD_H
#define KN_CLIENTS_RECORD_H
// All that a session says, heard on a thread of its own: the hand wants the newest force and
// skips what it missed, a log and a force table want every one. Written as an LCM event log on the way, if asked:
// KNEAD_SCENE first, then every pose, force and event from the moment the record starts. Only then is the file opened:
// a record that never begins leaves an older one whole.
//
//     kn_record_open -> kn_record_scene -> kn_record_start -> ... the session ... -> kn_record_stop
#include "clients/knead/join.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>

typedef struct kn_heard_force {
    knead_contact_force_t force;
    int64_t arrived_ns; // CLOCK_MONOTONIC
} kn_heard_force;

typedef struct kn_record {
    char *scene_name, *scene_text; // after kn_record_scene
    // after kn_record_stop, in order of arrival:
    kn_heard_force *force;
    knead_probe_pose_t *pose;
    int force_count, pose_count;
    bool out_of_memory;
    bool log_only; // the caller's, before kn_record_start: forces and poses go to the log alone, whatever they come to
    _Atomic(int64_t) logged; // bytes of messages in the log so far
    atomic_bool felt;        // the log holds a force of the probe
    // private
    kn_join *bus;
    struct _lcm_eventlog_t *log;
    const char *log_path; // borrowed
    void *scene_bytes;    // the message as it came, first record of the log
    int scene_size;
    int64_t scene_utime;
    char log_error[128]; // first failed write
    char force_channel[64], pose_channel[64];
    int force_room, pose_room;
    bool started;
    atomic_bool stop;
    pthread_t thread;
} kn_record;

// Joins and listens from now on. NULL and one line in error.
kn_record *kn_record_open(const char *url, char *error, size_t error_size);
bool kn_record_scene(kn_record *record, int timeout_ms); // false: no KNEAD_SCENE came in time
// log_path NULL: no log. False and one line in error.
bool kn_record_start(kn_record *record, const char *probe, const char *log_path, char *error, size_t error_size);
// Hears out what is on its way, closes the log. False and one line in error if anything of it could not be written.
bool kn_record_stop(kn_record *record, char *error, size_t error_size);
void kn_record_destroy(kn_record *record); // NULL is fine; stops first

#endif
