#include "clients/knead/record.h"
#include "clients/knead/join.h"
#include "proto/knead_scene_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>

// Priority of the record's thread: below all threads with a deadline, above other programs.
static const int reader_priority = 40;
static const int64_t last_words_ns = 50000000; // time for messages still on their way when the record stops, 50 ms

// Append a message to the log. After the first failed write, nothing more is written.
static void write_log(kn_record *r, const char *channel, int64_t utime, void *data, int size)
{
    if (!r->log || *r->log_error) return;
    lcm_eventlog_event_t event = {.timestamp = utime,
                                  .channellen = (int32_t)strlen(channel),
                                  .datalen = size,
                                  .channel = (char *)channel,
                                  .data = data};
    if (lcm_eventlog_write_event(r->log, &event) != 0)
        snprintf(r->log_error, sizeof r->log_error, "%s", strerror(errno));
    atomic_fetch_add(&r->logged, size);
}

// Make room for one more element in an array of messages. A full array is reallocated with twice its size.
static bool grow(void **array, int count, int *room, size_t size)
{
    if (count < *room) return true;
    int more = *room ? 2 * *room : 1 << 14;
    void *bigger = realloc(*array, (size_t)more * size);
    if (!bigger) return false;
    *array = bigger, *room = more;
    return true;
}

static void hear_force(kn_record *r, const lcm_recv_buf_t *buf)
{
    if (!grow((void **)&r->force, r->force_count, &r->force_room, sizeof *r->force)) {
        r->out_of_memory = true;
        return;
    }
    kn_heard_force *heard = &r->force[r->force_count];
    heard->arrived_ns = kn_now_ns();
    r->force_count += knead_contact_force_t_decode(buf->data, 0, (int)buf->data_size, &heard->force) >= 0;
}

static void hear_pose(kn_record *r, const lcm_recv_buf_t *buf)
{
    if (!grow((void **)&r->pose, r->pose_count, &r->pose_room, sizeof *r->pose)) {
        r->out_of_memory = true;
        return;
    }
    r->pose_count += knead_probe_pose_t_decode(buf->data, 0, (int)buf->data_size, &r->pose[r->pose_count]) >= 0;
}

// Keep the first scene message, both decoded and as encoded bytes.
static void hear_scene(kn_record *r, const lcm_recv_buf_t *buf)
{
    knead_scene_t scene;
    if (r->scene_text || knead_scene_t_decode(buf->data, 0, (int)buf->data_size, &scene) < 0) return;
    r->scene_name = strdup(scene.name); // if memory is short, the NULL counts as no scene
    r->scene_text = strdup(scene.text);
    knead_scene_t_decode_cleanup(&scene);
    r->scene_utime = buf->recv_utime;
    r->scene_size = (int)buf->data_size;
    r->scene_bytes = malloc(buf->data_size);
    if (r->scene_bytes) memcpy(r->scene_bytes, buf->data, buf->data_size);
}

// Handle one received message. Before kn_record_start only scene messages are kept.
static void on_message(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    kn_record *r = self;
    bool scene = !strcmp(channel, "KNEAD_SCENE");
    if (scene && !kn_wire_scene_fits(buf->data, buf->data_size)) return;
    if (scene) hear_scene(r, buf);
    if (!scene && !r->started) return;
    write_log(r, channel, buf->recv_utime, buf->data, (int)buf->data_size);
    const bool force = !strcmp(channel, r->force_channel);
    if (force) atomic_store(&r->felt, true);
    if (r->log_only) return;
    if (force) hear_force(r, buf);
    else if (!strcmp(channel, r->pose_channel)) hear_pose(r, buf);
}

// Create the log with the scene as its first record.
static bool open_log(kn_record *r, const char *path, char *error, size_t error_size)
{
    r->log_path = path;
    r->log = lcm_eventlog_create(path, "w");
    if (r->log) {
        write_log(r, "KNEAD_SCENE", r->scene_utime, r->scene_bytes, r->scene_size);
        return true;
    }
    snprintf(error, error_size, "%s: %s", path, strerror(errno));
    return false;
}

kn_record *kn_record_open(const char *url, char *error, size_t error_size)
{
    kn_record *r = calloc(1, sizeof *r);
    if (!r) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    // Subscribe with wildcards, because the names of the tools are not known yet.
    static const char *const channels[] = {"KNEAD_SCENE", "KNEAD_EVENT", "KNEAD_POSE_*", "KNEAD_FORCE_*",
                                           "KNEAD_CONTACT_*"};
    r->bus = kn_join_open(url, KN_FORCE_URL, error, error_size);
    for (size_t i = 0; r->bus && i < sizeof channels / sizeof *channels; i++)
        kn_join_hear(r->bus, channels[i], on_message, r);
    if (r->bus) return r;
    kn_record_destroy(r);
    return NULL;
}

bool kn_record_scene(kn_record *r, int timeout_ms)
{
    int64_t end_ns = kn_now_ns() + (int64_t)timeout_ms * 1000000;
    while (!r->scene_text && kn_now_ns() < end_ns) kn_join_handle(r->bus, 50);
    return r->scene_text && r->scene_name && r->scene_bytes;
}

// The thread of the record.
static void *run(void *self)
{
    kn_record *r = self;
    kn_join_priority(reader_priority); // if refused, the receive buffer must be large enough
    while (!atomic_load(&r->stop)) kn_join_handle(r->bus, 20);
    // Take the messages that are still on their way, for a fixed time. kneadd keeps answering the last pose, so waiting
    // for silence would not end.
    for (int64_t end_ns = kn_now_ns() + last_words_ns; kn_now_ns() < end_ns;) kn_join_handle(r->bus, 5);
    return NULL;
}

bool kn_record_start(kn_record *r, const char *probe, const char *log_path, char *error, size_t error_size)
{
    snprintf(r->force_channel, sizeof r->force_channel, "KNEAD_FORCE_%s", probe);
    snprintf(r->pose_channel, sizeof r->pose_channel, "KNEAD_POSE_%s", probe);
    while (kn_join_handle(r->bus, 0) > 0)
        ; // drop messages that arrived before the record was started
    if (log_path && !open_log(r, log_path, error, error_size)) return false;
    r->started = true;
    if (pthread_create(&r->thread, NULL, run, r) == 0) return true;
    r->started = false;
    snprintf(error, error_size, "cannot start a thread for the recording");
    return false;
}

bool kn_record_stop(kn_record *r, char *error, size_t error_size)
{
    if (r->started) {
        atomic_store(&r->stop, true);
        pthread_join(r->thread, NULL);
        r->started = false;
    }
    if (!r->log) return true;
    // Data in the buffer of the stream may fail to reach the disk only now.
    if (fflush(r->log->f) != 0 && !*r->log_error) snprintf(r->log_error, sizeof r->log_error, "%s", strerror(errno));
    lcm_eventlog_destroy(r->log);
    r->log = NULL;
    if (!*r->log_error) return true;
    snprintf(error, error_size, "%s: %s", r->log_path, r->log_error);
    return false;
}

void kn_record_destroy(kn_record *r)
{
    char error[256];
    if (!r) return;
    kn_record_stop(r, error, sizeof error);
    kn_join_close(r->bus);
    free(r->scene_name);
    free(r->scene_text);
    free(r->scene_bytes);
    free(r->force);
    free(r->pose);
    free(r);
}
