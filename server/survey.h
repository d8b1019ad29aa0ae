#ifndef KN_SERVER_SURVEY_H
#define KN_SERVER_SURVEY_H
// What is in a log, by one reading from end to end: its scenes, its events, whose forces it has, from which tick to
// which; and where the part ends that one run of a server said, whole. replay.h steps it in a second reading.
#include "proto/knead_event_t.h"
#include "server/log.h"
#include "server/servo.h"

// A log is as long as it tells: kneadd records a checkpoint a second. What a few records say of a far tick is refused.
#define KN_SURVEY_RECORD_MS 1000   // of ticks and of time for each record
#define KN_SURVEY_PAUSE_MS 3600000 // beyond that, all pauses together: missed cycles, a clock that was set
#define KN_SURVEY_LOST_MS 60000    // of these, ticks that ran and whose records were lost

typedef struct kn_survey_scene {
    uint64_t hash;
    char *text;
} kn_survey_scene;

typedef struct kn_survey_stood { // what a server does when its log begins; as new where the log does not tell
    bool deadline_told, overload_told, quality_told;
    int64_t deadline; // units, 0: none
    bool overloaded;
    kn_quality quality, asked;
} kn_survey_stood;

typedef struct kn_survey {
    knead_event_t *events; // [event_count] in order
    size_t event_count, event_capacity;
    char *scene_name, *scene_text; // of the first scene, NULL: none
    uint64_t scene_hash;
    kn_survey_scene *others; // [other_count] that were changed to
    size_t other_count;
    int64_t forces, records, malformed;
    int64_t told;                                    // poses, forces, events and scenes among the records
    char felt[KN_PROBES_MAX][64];                    // probes that have forces
    int64_t first_tick, last_tick, first_force_tick; // -1: none
    int64_t before_tick; // the last one the server ran before first_tick: first_tick - 1 unless it missed cycles
    int64_t first_utime, last_utime, first_pose_utime, origin_utime; // us; of tick 0 the last, as if it had been told
    bool started;                                                    // the log begins with the server's start
    bool undoes;                                                     // something was undone
    int64_t restores;                                                // from a snapshot
    kn_survey_stood stood;
    int64_t end_offset; // bytes: where the part ends that can be replayed
    char damage[160];   // "" or what is wrong with the file; what stands before it is told of
} kn_survey;

int64_t kn_survey_missed(const knead_event_t *e); // cycles missed just before its tick, which no force reports; 0: none

// False and one line in error when it cannot be read, or holds no hand's poses or forces; free it all the same.
bool kn_survey_log(kn_survey *survey, const char *path, char *error, size_t error_size);
void kn_survey_free(kn_survey *survey); // one that is all 0 is fine

#endif
