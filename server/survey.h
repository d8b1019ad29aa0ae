#ifndef KN_SERVER_SURVEY_H
#define KN_SERVER_SURVEY_H
// A survey reads a log once from beginning to end and collects scenes, events, probes with forces, and the range of
// ticks. The survey also finds the end of the part that one run of a server recorded without damage. replay.h replays
// that part in a second reading.
#include "proto/knead_event_t.h"
#include "server/log.h"
#include "server/servo.h"

// kneadd records a checkpoint every second, so the number of records limits the span of a log. This limit prevents a
// few records with a very large tick number from making a replay run for ever.
#define KN_SURVEY_RECORD_MS 1000 // time span that each record allows a log, both in ticks and in log time, ms
// Additional time span for all pauses together (missed cycles, a wall clock that was set), ms.
#define KN_SURVEY_PAUSE_MS 3600000
// Part of KN_SURVEY_PAUSE_MS allowed for ticks that a replay runs although their records were lost, ms.
#define KN_SURVEY_LOST_MS 60000

typedef struct kn_survey_scene {
    uint64_t hash;
    char *text;
} kn_survey_scene;

// Settings of the server that were in force when its log begins. A setting that the log does not record has the value
// that it has at a server's start.
typedef struct kn_survey_stood {
    bool deadline_told, overload_told, quality_told;
    int64_t deadline; // largest number of units of work (core/step_effort.h) per step; 0: no limit
    bool overloaded;
    kn_quality quality, asked;
} kn_survey_stood;

typedef struct kn_survey {
    knead_event_t *events; // [event_count], in the order of the log
    size_t event_count, event_capacity;
    char *scene_name, *scene_text; // name and text of the first scene in the log; NULL: none
    uint64_t scene_hash;
    kn_survey_scene *others; // [other_count] later scenes, which result from settings made at run time
    size_t other_count;
    int64_t forces, records, malformed;
    int64_t told;                                    // number of poses, forces, events and scenes among the records
    char felt[KN_PROBES_MAX][64];                    // names of the probes for which the log holds forces
    int64_t first_tick, last_tick, first_force_tick; // numbers of ticks; -1: none
    int64_t before_tick; // last tick that ran before first_tick; equals first_tick - 1 unless cycles were missed
    // Log times, us. first_pose_utime: -1 if there is no pose. origin_utime: time of tick 0, extrapolated from
    // first_tick.
    int64_t first_utime, last_utime, first_pose_utime, origin_utime;
    bool started;     // true if the log begins with the server's start
    bool undoes;      // true if the log contains an undo
    int64_t restores; // number of restores from a snapshot
    kn_survey_stood stood;
    int64_t end_offset; // end of the part that can be replayed, bytes from the beginning of the file
    char damage[160];   // damage found in the file, "" if none; the survey covers the part before the damage
} kn_survey;

// Return the number of cycles missed just before the event's tick if only this checkpoint reports them, else 0.
int64_t kn_survey_missed(const knead_event_t *e);

// Survey a log. If the log cannot be read, or holds neither poses nor forces, return false and put one line in error.
// Free the survey in both cases.
bool kn_survey_log(kn_survey *survey, const char *path, char *error, size_t error_size);
void kn_survey_free(kn_survey *survey); // a zeroed survey is allowed

#endif
