#include "server/survey.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Append an event. Return false when memory is short.
static bool keep_event(kn_survey *s, const knead_event_t *e)
{
    if (s->event_count == s->event_capacity) {
        size_t capacity = s->event_capacity ? 2 * s->event_capacity : 256;
        knead_event_t *events = realloc(s->events, capacity * sizeof *events);
        if (!events) return false;
        s->events = events;
        s->event_capacity = capacity;
    }
    s->events[s->event_count++] = *e;
    return true;
}

// Keep the text of another scene, but only once, because kneadd repeats it every second. Return false when memory is
// short.
static bool keep_other(kn_survey *s, const knead_scene_t *told)
{
    for (size_t i = 0; i < s->other_count; i++)
        if (s->others[i].hash == (uint64_t)told->text_hash) return true;
    kn_survey_scene *more = realloc(s->others, (s->other_count + 1) * sizeof *more);
    char *text = strdup(told->text);
    if (more) s->others = more;
    if (more && text) more[s->other_count++] = (kn_survey_scene){(uint64_t)told->text_hash, text};
    else free(text);
    return more && text;
}

// Keep the first scene of the log. Return false when memory is short.
static bool keep_scene(kn_survey *s, const knead_scene_t *told)
{
    s->scene_name = strdup(told->name);
    s->scene_text = strdup(told->text);
    s->scene_hash = (uint64_t)told->text_hash;
    return s->scene_name && s->scene_text;
}

int64_t kn_survey_missed(const knead_event_t *e)
{
    // the log may be forged, so accept no more missed cycles than there were earlier ticks
    if (e->kind != KNEAD_EVENT_T_KIND_CHECKPOINT || !(e->arg[0] > 0)) return 0;
    return (int64_t)fmin(e->arg[0], fmin((double)e->tick, INT32_MAX));
}

// Return the longest span that the number of records so far allows, ms.
static int64_t span_ms(const kn_survey *s) { return KN_SURVEY_PAUSE_MS + KN_SURVEY_RECORD_MS * s->told; }

// Record the tick number of a force or an event. Return NULL, or the reason why the replay must end before this record.
static const char *see_tick(kn_survey *s, int64_t tick, int64_t missed, int64_t utime)
{
    if (s->first_tick < 0) {
        s->first_tick = s->last_tick = tick;
        s->before_tick = tick - 1;
        s->origin_utime = utime - 1000 * tick;
    }
    // records of the first tick tell which tick ran before it
    if (missed > KN_SURVEY_PAUSE_MS) missed = KN_SURVEY_PAUSE_MS;
    if (tick == s->first_tick && tick - 1 - missed < s->before_tick) s->before_tick = tick - 1 - missed;
    if (tick - s->first_tick > span_ms(s)) return "more than an hour without records";
    if (tick < s->last_tick - KN_SURVEY_RECORD_MS) return "a second run of the server, or ticks that go back";
    if (tick > s->last_tick) s->last_tick = tick;
    return NULL;
}

// Keep the name of a probe that has forces, but only once.
static void keep_probe(kn_survey *s, const char *name)
{
    for (int i = 0; i < KN_PROBES_MAX; i++) {
        if (!*s->felt[i]) snprintf(s->felt[i], sizeof s->felt[i], "%s", name);
        if (!strcmp(s->felt[i], name)) return;
    }
}

// Find the settings in force where the log begins. The first event that records a setting determines its value: the
// server's start, a change of the setting, or a checkpoint, which repeats all settings.
static void see_stood(kn_survey_stood *s, const knead_event_t *e)
{
    const bool start = e->kind == KNEAD_EVENT_T_KIND_START, all = start || e->kind == KNEAD_EVENT_T_KIND_CHECKPOINT;
    // a change event implies the value before the change; a checkpoint gives the value in force
    if (!s->deadline_told && (all || e->kind == KNEAD_EVENT_T_KIND_DEADLINE)) {
        const double units = start ? 0 : e->arg[all ? 5 : 1];
        s->deadline_told = true;
        if (units >= 1 && units < 0x1p53) s->deadline = (int64_t)units;
    }
    if (!s->overload_told && (all || e->kind == KNEAD_EVENT_T_KIND_OVERLOAD)) {
        s->overload_told = true;
        s->overloaded = !start && (all ? e->arg[6] != 0 : e->arg[0] == 0);
    }
    // arg[7] packs both quality points (in use and requested); 0: not recorded
    const double points = all && !start ? e->arg[7] : 0;
    if (points >= 1 && points <= KN_QUALITIES * KN_QUALITIES && !s->quality_told) {
        s->quality_told = true;
        s->quality = (kn_quality)(((int)points - 1) % KN_QUALITIES);
        s->asked = (kn_quality)(((int)points - 1) / KN_QUALITIES);
    }
}

// Enter a record into the survey. Return NULL, or the reason why the part that can be replayed ends before this record.
static const char *note(kn_survey *s, const kn_log_record *record)
{
    bool first = s->first_tick < 0;
    const char *ends = NULL;
    // Check the times of the log only until the first tick. A log with ticks is replayed by its ticks, whatever the
    // clock showed, because a machine that was suspended ran no ticks.
    if (first && s->records > 0 && llabs(record->utime - s->first_utime) > 1000 * span_ms(s))
        return "more than an hour without records";
    s->told += record->kind == KN_LOG_POSE || record->kind == KN_LOG_FORCE || record->kind == KN_LOG_EVENT ||
               record->kind == KN_LOG_SCENE;
    switch (record->kind) {
    case KN_LOG_FORCE:
        if ((ends = see_tick(s, record->force.tick, record->force.missed_cycles, record->utime))) return ends;
        s->forces++;
        keep_probe(s, record->probe);
        if (s->first_force_tick < 0) s->first_force_tick = record->force.tick;
        return NULL;
    case KN_LOG_EVENT:
        if (record->event.kind == KNEAD_EVENT_T_KIND_START) {
            if (!first) return "a second run of the server";
            s->started = true;
        }
        if ((ends = see_tick(s, record->event.tick, kn_survey_missed(&record->event), record->utime))) return ends;
        if (record->event.kind == KNEAD_EVENT_T_KIND_RESTORE) {
            s->undoes |= record->event.arg[0] == 0;
            s->restores += record->event.arg[0] != 0;
        }
        see_stood(&s->stood, &record->event);
        return keep_event(s, &record->event) ? NULL : "more events than fit into memory";
    case KN_LOG_SCENE:
        if (s->scene_text && (uint64_t)record->scene.text_hash != s->scene_hash) {
            if (strcmp(record->scene.name, s->scene_name) != 0) return "a second scene";
            return keep_other(s, &record->scene) ? NULL : "more scenes than fit into memory";
        }
        if (s->scene_text) return NULL;
        return keep_scene(s, &record->scene) ? NULL : "a scene too large for the memory";
    case KN_LOG_POSE:
        if (s->first_pose_utime < 0) s->first_pose_utime = record->utime;
        return NULL;
    case KN_LOG_MALFORMED: s->malformed++; return NULL;
    case KN_LOG_OTHER:
    case KN_LOG_END: break;
    }
    return NULL;
}

bool kn_survey_log(kn_survey *survey, const char *path, char *error, size_t error_size)
{
    kn_survey *s = survey;
    kn_log log;
    kn_log_record record;
    *s = (kn_survey){0};
    if (!kn_log_open(&log, path, error, error_size)) return false;
    s->first_tick = s->last_tick = s->first_force_tick = s->first_pose_utime = -1;
    // read until the log ends, or a record does not belong to one run of a server
    for (int64_t at = 0; kn_log_read(&log, &record) != KN_LOG_END; at = log.offset) {
        const char *ends = note(s, &record);
        if (ends) {
            snprintf(s->damage, sizeof s->damage, "%s begins at byte %lld, after %lld records", ends, (long long)at,
                     (long long)s->records);
            break;
        }
        if (s->records++ == 0) s->first_utime = s->last_utime = record.utime;
        if (record.utime > s->last_utime) s->last_utime = record.utime;
        s->end_offset = log.offset;
    }
    if (log.damage[0]) snprintf(s->damage, sizeof s->damage, "%s", log.damage);
    kn_log_close(&log);
    if (s->forces > 0 || s->first_pose_utime >= 0) return true;
    snprintf(error, error_size, "%s: %s%sholds no poses and no forces (%lld records), expected those of a hand", path,
             s->damage, s->damage[0] ? "; " : "", (long long)s->records);
    return false;
}

void kn_survey_free(kn_survey *survey)
{
    for (size_t i = 0; i < survey->other_count; i++) free(survey->others[i].text);
    free(survey->others);
    free(survey->events);
    free(survey->scene_name);
    free(survey->scene_text);
    *survey = (kn_survey){0};
}
