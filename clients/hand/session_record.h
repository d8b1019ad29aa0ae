#ifndef KN_CLIENTS_SESSION_RECORD_H
#define KN_CLIENTS_SESSION_RECORD_H
// Record of all messages of a session. A thread of its own receives the messages. A hand needs only the newest force
// and skips the others, but a log and a force table need every force. On request the messages are also written to an
// LCM event log as they arrive: KNEAD_SCENE first, then the object as kneadd's control socket gives it (KNEAD_SNAPSHOT,
// a snapshot file in pieces), then every pose, force and event since kn_session_record_start.
// kn_session_record_start opens the log file, so a record that never starts does not overwrite an older file.
//
//     open -> scene -> start -> ... the session ... -> stop
#include "clients/hand/bus_client.h"
#include "clients/hand/virtual_hand.h"
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

typedef struct kn_session_record {
    char *scene_name, *scene_text; // name and text of the scene; set by kn_session_record_scene
    // Forces and poses in order of arrival; valid after kn_session_record_stop.
    kn_heard_force *force;
    knead_probe_pose_t *pose;
    int force_count, pose_count;
    bool out_of_memory;
    // True: forces and poses are written to the log only and not kept in memory. The caller sets this field before
    // kn_session_record_start.
    bool log_only;
    // Path of kneadd's control socket; NULL: kn_live_server_control. Set by the caller before kn_session_record_start.
    const char *control;
    _Atomic(int64_t) logged; // number of bytes of messages written to the log so far
    char no_object[256];     // why the log does not hold the object; "": it does, or there is no control socket to ask
    // The fields below are used by session_record.c only.
    kn_bus_client *bus;
    struct _lcm_eventlog_t *log;
    // Path of the log. The text belongs to the caller and must outlive the record.
    const char *log_path;
    void *scene_bytes; // encoded KNEAD_SCENE message, the first record of the log
    int scene_size;
    uint64_t scene_hash;
    int64_t scene_utime;
    char log_error[128]; // error message of the first failed write to the log, or ""
    char force_channel[64], pose_channel[64];
    int force_room, pose_room;
    bool started;
    atomic_bool stop;
    pthread_t thread;
} kn_session_record;

// Join the bus and begin to receive messages. Return NULL and one line in `error` on failure.
kn_session_record *kn_session_record_open(const char *url, char *error, size_t error_size);
// Wait for the scene. Return false if no KNEAD_SCENE came in time.
bool kn_session_record_scene(kn_session_record *record, int timeout_ms);
// Start recording the messages of a probe, and open the log file. log_path NULL: no log is written. Return false and
// one line in error on failure.
bool kn_session_record_start(kn_session_record *record, const char *probe, const char *log_path, char *error,
                             size_t error_size);
// Wait for messages that are still on their way, stop the thread and close the log. Return false and one line in
// `error` if any part of the log could not be written.
bool kn_session_record_stop(kn_session_record *record, char *error, size_t error_size);
// Stop the thread of a record, if it runs, and free the record. NULL is allowed.
void kn_session_record_destroy(kn_session_record *record);

// Report of a session of `knead probe`: the printed table of results and the CSV file of all forces. A force echoes
// (repeats) the session and the number of the pose that it answers. The functions depend only on the hand and the
// record of its messages.

typedef struct kn_session_report {
    // Results of the last attempt to play the path. Times count from the beginning of the path. A contact lasts while
    // at least one node or contact sample carries load.
    double contact_from_s, contact_s; // time at which the contact begins, and its duration; contact_s 0: no contact
    double peak_n, peak_s;            // largest magnitude of contact_force_n, and the time at which it occurs
    // Contact force when the path's piece "hold" ends; NAN: the path has no such piece.
    double hold_end_n;
    double given_peak_n; // largest magnitude of force_n, the force given to the hand
    double gain_min;     // smallest gain of kneadd while the path was played; below 1: kneadd missed poses
    double residual_m;   // depth of the dent left in the object, set by the caller; NAN: not known
    // Numbers of messages in all attempts to play the path.
    int64_t sent, forces; // number of poses sent, and of forces received
    int64_t matched;      // number of forces that answer a pose of this hand
    int64_t strange;      // number of forces that answer a pose of another hand
    // Number of forces that kneadd computed once more from an old pose of this hand, although a newer pose had been
    // sent.
    int64_t stale;
    // Number of lost forces. A loss shows as a gap in the tick numbers that missed_cycles does not explain.
    int64_t lost;
    int64_t missed; // number of cycles of the servo loop that kneadd skipped
    // Median and 99th percentile of the time from a pose to the force that answers it, without stale forces; NAN: no
    // forces.
    double round_trip_p50_ms, round_trip_p99_ms;
} kn_session_report;

// Compute the report of a session, except the field residual_m, which becomes NAN.
void kn_session_report_make(kn_session_report *report, const kn_hand *hand, const kn_session_record *record);

// Print the table at the end of `knead probe`: first the counts of messages, then what the object did, with the largest
// force in the last line. clamp_n: contact force at which the device reaches its limit.
void kn_session_report_print_link(FILE *out, const kn_session_report *report);
void kn_session_report_print(FILE *out, const kn_session_report *report, const kn_hand *hand, double clamp_n);

// Write one CSV row per force, in order of arrival, with the columns of `knead replay --csv`. Forces that do not echo a
// pose of this hand are left out.
void kn_session_report_csv(FILE *out, const kn_hand *hand, const kn_session_record *record, const char *probe);

// CSV table of poses and forces. It has one row per tick and live probe (a probe with a session). `knead replay`,
// `knead export` and `knead probe` write this table.

typedef struct kn_force_row { // forces and pose of one probe in one tick: one row of the CSV table
    int64_t tick, execution_ns;
    double time_s;
    const char *probe;
    const double *position_m, *contact_force_n, *force_n, *torque_n_m, *proxy_position_m; // arrays of 3 numbers
    int contacts;
    double residual;
} kn_force_row;

// Write the header line of the CSV table.
void kn_rows_head(FILE *out);
// Write one row of the CSV table.
void kn_rows_add(FILE *out, const kn_force_row *row);
struct kn_replay;
// Write the row of a live probe for the last tick of a replay.
void kn_rows_tick(FILE *out, const struct kn_replay *replay, int probe);

#endif
