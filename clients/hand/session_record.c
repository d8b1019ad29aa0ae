#include "clients/hand/session_record.h"
#include "clients/hand/live_server.h"
#include "core/algebra/algebra.h"
#include "proto/knead_scene_t.h"
#include "server/clock.h"
#include "server/log.h"
#include "server/log_replay.h"
#include "server/wire.h"
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Priority of the record's thread: below all threads with a deadline, above other programs.
static const int reader_priority = 40;
static const int64_t settle_ns = 2000000;      // two ticks
static const int64_t last_words_ns = 50000000; // time for messages still on their way when the record stops, 50 ms

// Append a message to the log. After the first failed write, nothing more is written.
static void write_log(kn_session_record *r, const char *channel, int64_t utime, void *data, int size)
{
    if (!r->log || *r->log_error) return;
    if (!kn_log_write(r->log, utime, channel, data, (size_t)size))
        snprintf(r->log_error, sizeof r->log_error, "%s", strerror(errno));
    atomic_fetch_add(&r->logged, size);
}

// Make room for one more element in an array of messages. A full array is reallocated with twice its size.
static bool grow(kn_session_record *r, void **array, int count, int *room, size_t size)
{
    if (count < *room) return true;
    int more = *room ? 2 * *room : 1 << 14;
    void *bigger = realloc(*array, (size_t)more * size);
    if (!bigger) r->out_of_memory = true;
    else *array = bigger, *room = more;
    return bigger;
}

static void hear_force(kn_session_record *r, const lcm_recv_buf_t *buf)
{
    if (!grow(r, (void **)&r->force, r->force_count, &r->force_room, sizeof *r->force)) return;
    kn_heard_force *heard = &r->force[r->force_count];
    heard->arrived_ns = kn_now_ns();
    r->force_count += knead_contact_force_t_decode(buf->data, 0, (int)buf->data_size, &heard->force) >= 0;
}

static void hear_pose(kn_session_record *r, const lcm_recv_buf_t *buf)
{
    if (!grow(r, (void **)&r->pose, r->pose_count, &r->pose_room, sizeof *r->pose)) return;
    r->pose_count += knead_probe_pose_t_decode(buf->data, 0, (int)buf->data_size, &r->pose[r->pose_count]) >= 0;
}

// Keep the first scene message, both decoded and as encoded bytes.
static void hear_scene(kn_session_record *r, const lcm_recv_buf_t *buf)
{
    knead_scene_t scene;
    if (r->scene_text || knead_scene_t_decode(buf->data, 0, (int)buf->data_size, &scene) < 0) return;
    r->scene_name = strdup(scene.name); // if memory is short, scene_name is NULL, which means that there is no scene
    r->scene_text = strdup(scene.text);
    knead_scene_t_decode_cleanup(&scene);
    r->scene_hash = (uint64_t)scene.text_hash;
    r->scene_utime = buf->recv_utime;
    r->scene_size = (int)buf->data_size;
    r->scene_bytes = malloc(buf->data_size);
    if (r->scene_bytes) memcpy(r->scene_bytes, buf->data, buf->data_size);
}

// Handle one received message. Before kn_session_record_start only scene messages are kept.
static void on_message(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    kn_session_record *r = self;
    bool scene = !strcmp(channel, "KNEAD_SCENE");
    if (scene && !kn_wire_scene_fits(buf->data, buf->data_size)) return;
    if (scene) hear_scene(r, buf);
    if (!scene && !r->started) return;
    write_log(r, channel, buf->recv_utime, buf->data, (int)buf->data_size);
    if (r->log_only) return;
    if (!strcmp(channel, r->force_channel)) hear_force(r, buf);
    else if (!strcmp(channel, r->pose_channel)) hear_pose(r, buf);
}

// Write the object as kneadd has it now. Messages that arrive meanwhile wait in the receive buffer. Without the object,
// a log of an untouched object can be replayed, but not one of a kneaded object.
static void log_object(kn_session_record *r)
{
    const char *usual = kn_live_server_control(), *control = r->control ? r->control : usual;
    // a kneadd without --control is no fault, so ask at the usual path only if there is a socket
    if (!r->control && !strcmp(usual, KN_LIVE_SERVER_CONTROL) && access(usual, F_OK) != 0) return;
    // Poses that were dropped before this record began must have reached a tick before the copy.
    kn_clock_sleep(kn_now_ns() + settle_ns);
    const int64_t utime = kn_wall_us();
    int fd = kn_live_server_copy(control, r->scene_hash, r->no_object, sizeof r->no_object);
    char *piece = malloc(KN_LOG_SNAPSHOT_PIECE);
    ssize_t size = 0;
    while (fd >= 0 && piece && (size = read(fd, piece, KN_LOG_SNAPSHOT_PIECE)) > 0)
        write_log(r, KN_LOG_SNAPSHOT_CHANNEL, utime, piece, (int)size);
    if (!piece || size < 0) snprintf(r->no_object, sizeof r->no_object, "%s", strerror(errno));
    free(piece);
    if (fd >= 0) close(fd);
    atomic_store(&r->logged, 0); // counts messages only
}

// Create the log, with the scene as its first record and the object next.
static bool open_log(kn_session_record *r, const char *path, char *error, size_t error_size)
{
    r->log_path = path;
    r->log = lcm_eventlog_create(path, "w");
    if (r->log) {
        write_log(r, "KNEAD_SCENE", r->scene_utime, r->scene_bytes, r->scene_size);
        log_object(r);
        return true;
    }
    snprintf(error, error_size, "%s: %s", path, strerror(errno));
    return false;
}

kn_session_record *kn_session_record_open(const char *url, char *error, size_t error_size)
{
    kn_session_record *r = calloc(1, sizeof *r);
    if (!r) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    // Subscribe with wildcards, because the names of the tools are not known yet.
    static const char *const channels[] = {"KNEAD_SCENE", "KNEAD_EVENT", "KNEAD_POSE_*", "KNEAD_FORCE_*",
                                           "KNEAD_CONTACT_*"};
    r->bus = kn_bus_client_open(url, KN_FORCE_URL, error, error_size);
    for (size_t i = 0; r->bus && i < sizeof channels / sizeof *channels; i++)
        kn_bus_client_hear(r->bus, channels[i], on_message, r);
    if (r->bus) return r;
    kn_session_record_destroy(r);
    return NULL;
}

bool kn_session_record_scene(kn_session_record *r, int timeout_ms)
{
    int64_t end_ns = kn_now_ns() + (int64_t)timeout_ms * 1000000;
    while (!r->scene_text && kn_now_ns() < end_ns) kn_bus_client_handle(r->bus, 50);
    return r->scene_text && r->scene_name && r->scene_bytes;
}

// Main function of the thread that receives the messages.
static void *run(void *self)
{
    kn_session_record *r = self;
    // A refusal by the kernel is no error: messages then only wait longer in the receive buffer.
    kn_bus_client_priority(reader_priority);
    while (!atomic_load(&r->stop)) kn_bus_client_handle(r->bus, 20);
    // Take the messages that are still on their way, for a fixed time. Waiting for silence would never end, because
    // kneadd keeps answering the last pose.
    for (int64_t end_ns = kn_now_ns() + last_words_ns; kn_now_ns() < end_ns;) kn_bus_client_handle(r->bus, 5);
    return NULL;
}

bool kn_session_record_start(kn_session_record *r, const char *probe, const char *log_path, char *error,
                             size_t error_size)
{
    snprintf(r->force_channel, sizeof r->force_channel, "KNEAD_FORCE_%s", probe);
    snprintf(r->pose_channel, sizeof r->pose_channel, "KNEAD_POSE_%s", probe);
    while (kn_bus_client_handle(r->bus, 0) > 0)
        ; // drop messages that arrived before the record was started
    if (log_path && !open_log(r, log_path, error, error_size)) return false;
    r->started = true;
    if (pthread_create(&r->thread, NULL, run, r) == 0) return true;
    r->started = false;
    snprintf(error, error_size, "cannot start a thread for the recording");
    return false;
}

bool kn_session_record_stop(kn_session_record *r, char *error, size_t error_size)
{
    if (r->started) {
        atomic_store(&r->stop, true);
        pthread_join(r->thread, NULL);
        r->started = false;
    }
    if (!r->log) return true;
    // Write the rest of the stream's buffer now, because a failed write must be reported.
    if (fflush(r->log->f) != 0 && !*r->log_error) snprintf(r->log_error, sizeof r->log_error, "%s", strerror(errno));
    lcm_eventlog_destroy(r->log);
    r->log = NULL;
    if (!*r->log_error) return true;
    snprintf(error, error_size, "%s: %s", r->log_path, r->log_error);
    return false;
}

void kn_session_record_destroy(kn_session_record *r)
{
    char error[256];
    if (!r) return;
    kn_session_record_stop(r, error, sizeof error);
    kn_bus_client_close(r->bus);
    free(r->scene_name);
    free(r->scene_text);
    free(r->scene_bytes);
    free(r->force);
    free(r->pose);
    free(r);
}

// A force answers one pose. Return the attempt (to play the path) in which this pose was sent, or NULL.
static const kn_attempt *attempt_of(const kn_hand *hand, const knead_contact_force_t *f)
{
    for (int i = 0; i < hand->tries; i++) {
        const kn_attempt *t = &hand->attempt[i];
        if (f->session == t->session && f->seq >= 1 && f->seq <= t->sent + 1)
            // The last pose of an attempt has the number sent + 1. This pose only tells kneadd that the hand leaves the
            // tool.
            return t;
    }
    return NULL;
}

// Return the time on the path, s, of the pose that this force answers. The path begins with pose number play_seq and
// advances by 1 ms per pose.
static double path_time(const kn_attempt *t, const knead_contact_force_t *f)
{
    return 1e-3 * (double)(f->seq - t->play_seq);
}

// Add one force of the last attempt to the report. Leave out forces that answer a pose before or after the path.
static void add_to_table(kn_session_report *r, const kn_hand *hand, const kn_attempt *t, const knead_contact_force_t *f)
{
    double s = path_time(t, f), contact_n = sqrt(kn_dot(f->contact_force_n, f->contact_force_n));
    bool after = f->seq > t->sent || (f->seq == t->sent && f->flags & KN_FLAG_STALE);
    if (!t->play_seq || s < 0.0 || after) return;
    r->given_peak_n = fmax(r->given_peak_n, sqrt(kn_dot(f->force_n, f->force_n)));
    // Overwrite this value with every force until the hold ends, so that the last force of the hold remains.
    if (s <= hand->def.path->hold_end_s) r->hold_end_n = contact_n;
    if (!f->contacts) return;
    r->gain_min = fmin(r->gain_min, f->gain);
    // The contact lasts from the first to the last tick in which a contact carries load.
    if (r->contact_s == 0.0) r->contact_from_s = s;
    r->contact_s = s - r->contact_from_s + 1e-3;
    if (contact_n > r->peak_n) r->peak_n = contact_n, r->peak_s = s;
}

void kn_session_report_make(kn_session_report *r, const kn_hand *hand, const kn_session_record *record)
{
    const kn_attempt *last = &hand->attempt[hand->tries - 1];
    int64_t *trip_ns = malloc(sizeof *trip_ns * ((size_t)record->force_count + 1)), trips = 0;
    *r = (kn_session_report){.gain_min = 1.0, .hold_end_n = NAN, .residual_m = NAN};
    r->round_trip_p50_ms = r->round_trip_p99_ms = NAN;
    for (int i = 0; i < hand->tries; i++) r->sent += hand->attempt[i].sent;
    for (int i = 0; i < record->force_count; i++) {
        const knead_contact_force_t *f = &record->force[i].force;
        const knead_contact_force_t *before = i > 0 ? &record->force[i - 1].force : NULL;
        const kn_attempt *t = attempt_of(hand, f);
        r->forces++;
        r->matched += t != NULL;
        r->strange += t == NULL;
        r->missed += f->missed_cycles;
        // If the tick number has not increased, kneadd was restarted, so count no losses.
        bool goes_on = before && before->session == f->session && f->tick > before->tick;
        if (goes_on) r->lost += f->tick - before->tick - 1 - f->missed_cycles;
        if (!t) continue;
        // Count a stale force (one that answers a pose again) only if the hand had sent a newer pose. Take round trips
        // from forces that are not stale.
        if (f->flags & KN_FLAG_STALE) r->stale += f->seq < t->sent;
        else if (trip_ns) trip_ns[trips++] = record->force[i].arrived_ns - f->sent_ns;
        if (t == last) add_to_table(r, hand, t, f);
    }
    // A path without a hold has no force at the end of a hold.
    if (hand->def.path->hold_end_s == 0.0) r->hold_end_n = NAN;
    if (trips > 0) {
        qsort(trip_ns, (size_t)trips, sizeof *trip_ns, kn_ascending_i64);
        r->round_trip_p50_ms = 1e-6 * (double)trip_ns[trips / 2];
        r->round_trip_p99_ms = 1e-6 * (double)trip_ns[trips * 99 / 100];
    }
    free(trip_ns);
}

void kn_session_report_print_link(FILE *out, const kn_session_report *r)
{
    fprintf(out, "  poses sent      %8lld\n  forces received %8lld      %lld lost\n", (long long)r->sent,
            (long long)r->forces, (long long)r->lost);
    fprintf(
        out,
        "  echoes matched  %8lld      %lld of them answer an old pose again; %lld more forces answer another hand\n",
        (long long)r->matched, (long long)r->stale, (long long)r->strange);
    fprintf(out, "  round trip      %8.2f ms   median; p99 %.2f ms\n", r->round_trip_p50_ms, r->round_trip_p99_ms);
}

void kn_session_report_print(FILE *out, const kn_session_report *r, const kn_hand *hand, double clamp_n)
{
    if (hand->tries > 1)
        fprintf(out, "  try %d: the object keeps the deformation of the interrupted tries\n", hand->tries);
    if (r->gain_min < 1.0)
        fprintf(out,
                "  gain            %8.0f %%    at least: some poses came late, and the hand felt less than the contact "
                "force\n",
                100.0 * r->gain_min);
    if (r->peak_n > clamp_n) fprintf(out, "  given to hand   %8.2f N    limited by the device\n", r->given_peak_n);
    if (r->contact_s > 0.0)
        fprintf(out, "  contact         %8.2f s    from %.2f s on\n", r->contact_s, r->contact_from_s);
    else fprintf(out, "  contact             none\n");
    if (!isnan(r->residual_m)) fprintf(out, "  residual depth  %8.2f mm   1 s after withdrawal\n", 1e3 * r->residual_m);
    if (!isnan(r->hold_end_n)) fprintf(out, "  end of hold     %8.2f N\n", r->hold_end_n);
    if (r->contact_s > 0.0)
        fprintf(out, "  peak            %8.2f N    %.2f s after touch\n", r->peak_n, r->peak_s - r->contact_from_s);
}

// Compare two poses by session and then by number, for sorting.
static int by_number(const void *a, const void *b)
{
    const knead_probe_pose_t *x = a, *y = b;
    if (x->session != y->session) return x->session < y->session ? -1 : 1;
    return (x->seq > y->seq) - (x->seq < y->seq);
}

void kn_session_report_csv(FILE *out, const kn_hand *hand, const kn_session_record *record, const char *probe)
{
    kn_rows_head(out);
    // Sort the poses for the binary search below. The poses of one session arrive in order, but a later session can
    // have a lower number.
    qsort(record->pose, (size_t)record->pose_count, sizeof *record->pose, by_number);
    int64_t first_tick = record->force_count ? record->force[0].force.tick : 0;
    for (int i = 0; i < record->force_count; i++) {
        const knead_contact_force_t *f = &record->force[i].force;
        // Find the pose that this force answers.
        knead_probe_pose_t key = {.session = f->session, .seq = f->seq};
        const knead_probe_pose_t *pose =
            bsearch(&key, record->pose, (size_t)record->pose_count, sizeof *record->pose, by_number);
        if (!attempt_of(hand, f) || !pose) continue;
        kn_rows_add(out, &(kn_force_row){f->tick, f->execution_ns, 1e-3 * (double)(f->tick - first_tick), probe,
                                         pose->position_m, f->contact_force_n, f->force_n, f->torque_n_m,
                                         f->proxy_position_m, f->contacts, f->residual});
    }
}

void kn_rows_head(FILE *out)
{
    fputs("tick,time_s,probe,x_m,y_m,z_m,contact_fx_n,contact_fy_n,contact_fz_n,fx_n,fy_n,fz_n,tx_n_m,ty_n_m,tz_n_m,"
          "contacts,residual,execution_ns,proxy_x_m,proxy_y_m,proxy_z_m\n",
          out);
}

void kn_rows_add(FILE *out, const kn_force_row *r)
{
    const double *vectors[] = {r->position_m, r->contact_force_n, r->force_n, r->torque_n_m};
    fprintf(out, "%lld,%.3f,%s", (long long)r->tick, r->time_s, r->probe);
    for (int i = 0; i < 4; i++) fprintf(out, ",%.9g,%.9g,%.9g", vectors[i][0], vectors[i][1], vectors[i][2]);
    const double *proxy = r->proxy_position_m;
    fprintf(out, ",%d,%.3g,%lld,%.9g,%.9g,%.9g\n", r->contacts, r->residual, (long long)r->execution_ns, proxy[0],
            proxy[1], proxy[2]);
}

void kn_rows_tick(FILE *out, const kn_replay *r, int p)
{
    const kn_replay_tick *t = &r->tick;
    const kn_force *f = &t->out.force[p];
    kn_rows_add(out, &(kn_force_row){t->out.tick, t->execution_ns, t->time_s, r->model->def.probe[p].name,
                                     t->pose[p].position_m, f->contact_force_n, f->force_n, f->torque_n_m,
                                     f->proxy_position_m, f->contacts, f->residual});
}
