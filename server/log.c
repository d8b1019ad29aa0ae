#include "server/log.h"
#include "server/auth.h"
#include "server/bus.h"
#include "server/console.h"
#include "server/wire.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define MAGIC 0xEDA1DA01u
#define HEADER_SIZE 28
#define CHANNEL_MAX 63     // longest channel name that LCM allows, bytes
#define DATA_MAX (1 << 28) // largest message that LCM allows, bytes

bool kn_log_open(kn_log *log, const char *path, char *error, size_t error_size)
{
    memset(log, 0, sizeof *log);
    struct stat status;
    const char *what = NULL;
    if (stat(path, &status) != 0) what = strerror(errno);
    else if (!S_ISREG(status.st_mode)) what = "not a regular file";
    else if (!(log->file = fopen(path, "rb"))) what = strerror(errno);
    if (what) return kn_refuse(error, error_size, "%s: %s, expected an LCM event log", path, what);
    log->size = status.st_size;
    return true;
}

// Free the strings of the last scene that was read.
static void forget_scene(kn_log *log)
{
    if (log->has_scene) knead_scene_t_decode_cleanup(&log->scene);
    log->has_scene = false;
}

void kn_log_close(kn_log *log)
{
    forget_scene(log);
    free(log->buffer);
    if (log->file) fclose(log->file);
    memset(log, 0, sizeof *log);
}

// Record the damage and its offset in the file. Always return false.
static bool damaged(kn_log *log, const char *what)
{
    snprintf(log->damage, sizeof log->damage, "%s at byte %lld of %lld, after %lld complete records", what,
             (long long)log->offset, (long long)log->size, (long long)log->records);
    return false;
}

// Enlarge the buffer to at least `size` bytes.
static bool reserve(kn_log *log, size_t size)
{
    if (size <= log->capacity) return true;
    unsigned char *buffer = realloc(log->buffer, size);
    if (!buffer) return false;
    log->buffer = buffer;
    log->capacity = size;
    return true;
}

// Read the next record into the buffer: channel, an added NUL, data. Before that, check that the record's sizes fit
// into the file.
static bool fetch(kn_log *log, kn_log_record *r)
{
    unsigned char h[HEADER_SIZE];
    int64_t left = log->size - log->offset;
    // Read the header of the record. If its first four bytes are wrong, the record is damaged or the file is not a log.
    // An incomplete header means that the file was cut.
    if (left == 0 || log->damage[0]) return false;
    size_t got = fread(h, 1, sizeof h, log->file);
    if (got >= 4 && kn_bytes_32(h) != MAGIC) return damaged(log, "not a record of an LCM event log");
    if (got < HEADER_SIZE) return damaged(log, "cut within a record");
    // Check the lengths of channel name and data before they are used.
    int64_t channel = (int32_t)kn_bytes_32(h + 20), data = (int32_t)kn_bytes_32(h + 24);
    if (channel < 1 || channel > CHANNEL_MAX) return damaged(log, "channel name of a length that LCM does not allow");
    if (data < 0 || data > DATA_MAX) return damaged(log, "message of a size that LCM does not allow");
    if (HEADER_SIZE + channel + data > left) return damaged(log, "cut within a record");
    r->utime = kn_bytes_64(h + 12);
    if (r->utime < 0 || r->utime > KN_LOG_UTIME_MAX) return damaged(log, "time stamp out of range");

    // Read channel and data, and terminate the channel name.
    if (!reserve(log, (size_t)(channel + 1 + data))) return damaged(log, "record too large for the memory");
    unsigned char *body = log->buffer + channel + 1;
    bool whole = fread(log->buffer, 1, (size_t)channel, log->file) == (size_t)channel &&
                 fread(body, 1, (size_t)data, log->file) == (size_t)data;
    if (!whole) return damaged(log, "cannot be read");
    log->buffer[channel] = 0;
    r->channel = (const char *)log->buffer;
    r->data = body;
    r->size = (size_t)data;
    log->offset += HEADER_SIZE + channel + data;
    log->records++;
    return true;
}

// Return whether the record has the size of a fixed-size type, with or without a trailer, and the type's hash.
static bool fits(const kn_log_record *r, int encoded_size, int64_t hash)
{
    size_t size = (size_t)encoded_size;
    return kn_auth_fits(r->size, size) && kn_bytes_64(r->data) == hash;
}

// Decode and check a force record, so that a replay calculates only with numbers in their valid ranges.
static kn_log_kind read_force(kn_log_record *r)
{
    int size = knead_contact_force_t_encoded_size(&r->force);
    if (!fits(r, size, __knead_contact_force_t_get_hash())) return KN_LOG_MALFORMED;
    if (knead_contact_force_t_decode(r->data, 0, size, &r->force) != size) return KN_LOG_MALFORMED;
    const knead_contact_force_t *f = &r->force;
    bool sane = kn_wire_finite(f->contact_force_n, 3) && kn_wire_finite(f->force_n, 3) && isfinite(f->gain) &&
                f->tick >= 0 && f->tick <= KN_LOG_TICK_MAX && f->missed_cycles >= 0 && f->missed_cycles <= f->tick;
    return sane ? KN_LOG_FORCE : KN_LOG_MALFORMED;
}

static kn_log_kind read_event(kn_log_record *r)
{
    int size = knead_event_t_encoded_size(&r->event);
    if (!fits(r, size, __knead_event_t_get_hash())) return KN_LOG_MALFORMED;
    if (knead_event_t_decode(r->data, 0, size, &r->event) != size) return KN_LOG_MALFORMED;
    bool sane = r->event.tick >= 0 && r->event.tick <= KN_LOG_TICK_MAX && kn_wire_finite(r->event.arg, 8);
    return sane ? KN_LOG_EVENT : KN_LOG_MALFORMED;
}

// Decode a scene message. First check the lengths in the message, because the generated decoder trusts them.
static kn_log_kind read_scene(kn_log *log, kn_log_record *r)
{
    if (!kn_wire_scene_fits(r->data, r->size)) return KN_LOG_MALFORMED;
    log->has_scene = knead_scene_t_decode(r->data, 0, (int)r->size, &log->scene) > 0;
    r->scene = log->scene;
    return log->has_scene ? KN_LOG_SCENE : KN_LOG_MALFORMED;
}

// Return the part of the channel name after the prefix, or NULL if the prefix does not match or nothing follows it.
static const char *after(const char *channel, const char *prefix)
{
    size_t n = strlen(prefix);
    return strncmp(channel, prefix, n) == 0 && channel[n] ? channel + n : NULL;
}

// Determine the kind of a record by its channel, and decode it.
static kn_log_kind classify(kn_log *log, kn_log_record *r)
{
    bool ours = after(r->channel, "KNEAD_") != NULL;
    if (strcmp(r->channel, KN_LOG_SNAPSHOT_CHANNEL) == 0) return KN_LOG_SNAPSHOT;
    // a message on one of Knead's channels needs at least 8 bytes for its type hash
    if (ours && r->size < 8) return KN_LOG_MALFORMED;
    if ((r->probe = after(r->channel, "KNEAD_POSE_"))) return KN_LOG_POSE;
    if ((r->probe = after(r->channel, "KNEAD_FORCE_"))) return read_force(r);
    if (strcmp(r->channel, "KNEAD_EVENT") == 0) return read_event(r);
    if (strcmp(r->channel, "KNEAD_SCENE") == 0) return read_scene(log, r);
    return KN_LOG_OTHER;
}

kn_log_kind kn_log_read(kn_log *log, kn_log_record *record)
{
    forget_scene(log);
    memset(record, 0, sizeof *record);
    return record->kind = fetch(log, record) ? classify(log, record) : KN_LOG_END;
}

bool kn_log_write(lcm_eventlog_t *file, int64_t utime, const char *channel, void *data, size_t size)
{
    lcm_eventlog_event_t event = {
        .timestamp = utime,
        .channellen = (int32_t)strlen(channel),
        .datalen = (int32_t)size,
        .channel = (char *)channel,
        .data = data,
    };
    return lcm_eventlog_write_event(file, &event) == 0;
}

// --- summary ---

// Append an event. Return false when memory is short.
static bool keep_event(kn_log_summary *s, const knead_event_t *e)
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

// Keep the text of a later scene. Keep each text only once, because kneadd publishes its scene every second. Return
// false when memory is short.
static bool keep_other(kn_log_summary *s, const knead_scene_t *told)
{
    for (size_t i = 0; i < s->other_count; i++)
        if (s->others[i].hash == (uint64_t)told->text_hash) return true;
    kn_log_scene *more = realloc(s->others, (s->other_count + 1) * sizeof *more);
    char *text = strdup(told->text);
    if (more) s->others = more;
    if (more && text) more[s->other_count++] = (kn_log_scene){(uint64_t)told->text_hash, text};
    else free(text);
    return more && text;
}

// Keep the first scene of the log. Return false when memory is short.
static bool keep_scene(kn_log_summary *s, const knead_scene_t *told)
{
    s->scene_name = strdup(told->name);
    s->scene_text = strdup(told->text);
    s->scene_hash = (uint64_t)told->text_hash;
    s->initial_hash = (uint64_t)told->initial_hash;
    return s->scene_name && s->scene_text;
}

// Append a piece of the snapshot that stands at the beginning of the log. Return false if the snapshot is larger than
// any, or when memory is short.
static bool keep_piece(kn_log_summary *s, const kn_log_record *record)
{
    uint8_t *more = s->object_size > DATA_MAX ? NULL : realloc(s->object, s->object_size + record->size + 1);
    if (!more) return false;
    memcpy(more + s->object_size, record->data, record->size);
    s->object = more;
    s->object_size += record->size;
    return true;
}

int64_t kn_log_missed(const knead_event_t *e)
{
    // the log may be forged, so accept no more missed cycles than there were earlier ticks
    if (e->kind != KNEAD_EVENT_T_KIND_CHECKPOINT || !(e->arg[0] > 0)) return 0;
    return (int64_t)fmin(e->arg[0], fmin((double)e->tick, INT32_MAX));
}

// Return the longest time that a log with the records read so far may span, ms.
static int64_t span_ms(const kn_log_summary *s) { return KN_LOG_PAUSE_MS + KN_LOG_RECORD_MS * s->own_records; }

// Record the tick number of a force or an event. Return NULL, or the reason why the replay must end before this record.
static const char *see_tick(kn_log_summary *s, int64_t tick, int64_t missed, int64_t utime)
{
    if (s->first_tick < 0) {
        s->first_tick = s->last_tick = tick;
        s->before_tick = tick - 1;
        s->origin_utime = utime - 1000 * tick;
    }
    // the records of first_tick hold the number of cycles missed just before it; subtract these cycles to find
    // before_tick, the last tick that ran
    if (missed > KN_LOG_PAUSE_MS) missed = KN_LOG_PAUSE_MS;
    if (tick == s->first_tick && tick - 1 - missed < s->before_tick) s->before_tick = tick - 1 - missed;
    if (tick - s->first_tick > span_ms(s)) return "more than an hour without records";
    if (tick < s->last_tick - KN_LOG_RECORD_MS) return "a second run of the server, or ticks that go back";
    if (tick > s->last_tick) s->last_tick = tick;
    return NULL;
}

// Add the name of a probe that has forces, if the summary does not have the name yet.
static void keep_probe(kn_log_summary *s, const char *name)
{
    for (int i = 0; i < KN_PROBES_MAX; i++) {
        if (!*s->force_probe[i]) snprintf(s->force_probe[i], sizeof s->force_probe[i], "%s", name);
        if (!strcmp(s->force_probe[i], name)) return;
    }
}

// Find the deadline, the overload and the quality that were in force where the log begins. Each is determined by the
// first event that records it: the server's start, a change, or a checkpoint, which records all three.
static void see_stood(kn_log_initial *s, const knead_event_t *e)
{
    const bool start = e->kind == KNEAD_EVENT_T_KIND_START, all = start || e->kind == KNEAD_EVENT_T_KIND_CHECKPOINT;
    // a change event gives the value from before the change; a checkpoint gives the value in force
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

// Enter a record into the summary. Return NULL, or the reason why the part that can be replayed ends before this
// record.
static const char *note(kn_log_summary *s, const kn_log_record *record)
{
    bool first = s->first_tick < 0;
    const char *ends = NULL;
    // Check the log times of the records only until the first record with a tick number. From then on see_tick() checks
    // the tick numbers instead, because a suspended machine runs no ticks while its clock goes on.
    if (first && s->records > 0 && llabs(record->utime - s->first_utime) > 1000 * span_ms(s))
        return "more than an hour without records";
    s->own_records += record->kind == KN_LOG_POSE || record->kind == KN_LOG_FORCE || record->kind == KN_LOG_EVENT ||
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
        if ((ends = see_tick(s, record->event.tick, kn_log_missed(&record->event), record->utime))) return ends;
        if (record->event.kind == KNEAD_EVENT_T_KIND_RESTORE) {
            s->undoes |= record->event.arg[0] == 0;
            s->restores += record->event.arg[0] != 0;
        }
        see_stood(&s->initial, &record->event);
        return keep_event(s, &record->event) ? NULL : "more events than fit into memory";
    case KN_LOG_SCENE:
        if (s->scene_text && (uint64_t)record->scene.text_hash != s->scene_hash) {
            if (strcmp(record->scene.name, s->scene_name) != 0) return "a second scene";
            return keep_other(s, &record->scene) ? NULL : "more scenes than fit into memory";
        }
        if (s->scene_text) return NULL;
        return keep_scene(s, &record->scene) ? NULL : "a scene too large for the memory";
    case KN_LOG_SNAPSHOT: return !first || keep_piece(s, record) ? NULL : "a snapshot too large";
    case KN_LOG_POSE:
        if (s->first_pose_utime < 0) s->first_pose_utime = record->utime;
        return NULL;
    case KN_LOG_MALFORMED: s->malformed++; return NULL;
    case KN_LOG_OTHER:
    case KN_LOG_END: break;
    }
    return NULL;
}

bool kn_log_summarise(kn_log_summary *summary, const char *path, char *error, size_t error_size)
{
    kn_log_summary *s = summary;
    kn_log log;
    kn_log_record record;
    *s = (kn_log_summary){0};
    if (!kn_log_open(&log, path, error, error_size)) return false;
    s->first_tick = s->last_tick = s->first_force_tick = s->first_pose_utime = -1;
    // read until the log ends, or until a record that does not belong to the same run of the server
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
    return kn_refuse(error, error_size,
                     "%s: %s%sholds no poses and no forces (%lld records), expected the log of a session", path,
                     s->damage, s->damage[0] ? "; " : "", (long long)s->records);
}

void kn_log_summary_free(kn_log_summary *summary)
{
    for (size_t i = 0; i < summary->other_count; i++) free(summary->others[i].text);
    free(summary->others);
    free(summary->events);
    free(summary->object);
    free(summary->scene_name);
    free(summary->scene_text);
    *summary = (kn_log_summary){0};
}
