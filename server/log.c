#include "server/log.h"
#include "server/auth.h"
#include "server/bytes.h"
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
    if (what) {
        snprintf(error, error_size, "%s: %s, expected an LCM event log", path, what);
        return false;
    }
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

// Read the next record into the buffer: channel, an added NUL, data. All sizes are checked against the file first.
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
    // Check the sizes before they are used.
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

static bool all_finite(const double *value, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(value[i])) return false;
    return true;
}

// Return whether the record has the size of a fixed-size type, with or without a trailer, and the type's hash.
static bool fits(const kn_log_record *r, int encoded_size, int64_t hash)
{
    size_t size = (size_t)encoded_size;
    return kn_auth_fits(r->size, size) && kn_bytes_64(r->data) == hash;
}

// Decode and check a force record. The checks bound the numbers with which a replay calculates.
static kn_log_kind read_force(kn_log_record *r)
{
    int size = knead_contact_force_t_encoded_size(&r->force);
    if (!fits(r, size, __knead_contact_force_t_get_hash())) return KN_LOG_MALFORMED;
    if (knead_contact_force_t_decode(r->data, 0, size, &r->force) != size) return KN_LOG_MALFORMED;
    const knead_contact_force_t *f = &r->force;
    bool sane = all_finite(f->contact_force_n, 3) && all_finite(f->force_n, 3) && isfinite(f->gain) && f->tick >= 0 &&
                f->tick <= KN_LOG_TICK_MAX && f->missed_cycles >= 0 && f->missed_cycles <= f->tick;
    return sane ? KN_LOG_FORCE : KN_LOG_MALFORMED;
}

static kn_log_kind read_event(kn_log_record *r)
{
    int size = knead_event_t_encoded_size(&r->event);
    if (!fits(r, size, __knead_event_t_get_hash())) return KN_LOG_MALFORMED;
    if (knead_event_t_decode(r->data, 0, size, &r->event) != size) return KN_LOG_MALFORMED;
    bool sane = r->event.tick >= 0 && r->event.tick <= KN_LOG_TICK_MAX && all_finite(r->event.arg, 8);
    return sane ? KN_LOG_EVENT : KN_LOG_MALFORMED;
}

// Decode a scene. Its counts are checked first, because the decoder trusts them.
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
