// logcheck LOG: summarise a log of the pose bus in numbers, read by liblcm and lcm-gen's decoders as by any client:
//
//     poses N forces N echoed N events N scenes N statuses N undecodable N         echoed: forces that answer a pose
//     peak_n F steepest_n F last_n F stopping N                                    of the forces given to the hand
//     resets N as_new N faded_n F again_n F        as_new: whose state hash is that of KNEAD_SCENE's untouched object
//     stepped N commanded N lowest_gain F reduced N mistaken N       points of quality taken over budget, or commanded
//     back N held_n F gone N      of the losses of a circuit that computed alone: their number; of the last one that
//                                 took a force: the last new force, and the ticks from it to the first force of 0
//     received N accepted N rejected N kernel_drops N ticks N missed N hist N      of the last status
//     healths N paired N ever_errors BITS                 paired: under a status' utime; of all current_errors
//     lost N late N duplicate N reordered N in_a_row N generation N saves N slews N silences N estops N   of the last
//                                                                              health, summed over the probes
//
// stopping counts the forces under FLAG_STOPPING. steepest_n is the largest change per ms among these forces and the
// forces of the 20 ms after a reset. faded_n is the largest force in the next 20 ms, again_n the largest force later
// than 20 ms after the last reset. lowest_gain is the lowest gain within 40 ms of a point taken. mistaken counts the
// forces whose FLAG_REDUCED contradicts the events. hist is the sum of wakeup_hist.
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_health_t.h"
#include "proto/knead_probe_pose_t.h"
#include "proto/knead_scene_t.h"
#include "proto/knead_status_t.h"
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

// The poses of one session. A force echoes a pose of the session if its seq lies between the first and the last: a
// logger may lose a pose that kneadd heard.
typedef struct stream {
    int64_t session, first, last;
} stream;

static stream streams[16];
static int stream_count;
static int64_t pose_count, forces, echoed, events, scenes, statuses, undecodable;
static double given_n[3], peak_n, steepest_n, last_n;
static int64_t stopping;
#define FADE_TICKS 20
static int64_t resets, as_new, initial_hash, reset_tick = -1;
static double faded_n, again_n;
static int64_t stepped, commanded, reduced, mistaken, quality_tick = -1;
static double lowest_gain = 1.0;
static bool is_reduced;                              // expected from the events so far
static int64_t back, back_tick = -1, gone, new_tick; // new_tick: tick of the last new contact force before back_tick
static double new_n, held_n, contact_n[3];
static knead_status_t status;
static knead_health_t health;
static int64_t healths, paired, ever_errors;

static bool begins(const lcm_eventlog_event_t *e, const char *prefix)
{
    return strncmp(e->channel, prefix, strlen(prefix)) == 0;
}

static void take_pose(const lcm_eventlog_event_t *e)
{
    knead_probe_pose_t m;
    if (knead_probe_pose_t_decode(e->data, 0, e->datalen, &m) < 0) {
        undecodable++;
        return;
    }
    pose_count++;
    int i = 0;
    while (i < stream_count && streams[i].session != m.session) i++;
    if (i == stream_count && stream_count < 16) streams[stream_count++] = (stream){m.session, m.seq, m.seq};
    if (i < stream_count && m.seq > streams[i].last) streams[i].last = m.seq;
}

static void take_force(const lcm_eventlog_event_t *e)
{
    knead_contact_force_t m;
    if (knead_contact_force_t_decode(e->data, 0, e->datalen, &m) < 0) {
        undecodable++;
        return;
    }
    forces++;
    double size = 0, step = 0;
    for (int i = 0; i < 3; i++) {
        size += m.force_n[i] * m.force_n[i];
        step += (m.force_n[i] - given_n[i]) * (m.force_n[i] - given_n[i]);
        given_n[i] = m.force_n[i];
    }
    last_n = sqrt(size);
    peak_n = fmax(peak_n, last_n);
    bool fading = reset_tick >= 0 && m.tick < reset_tick + FADE_TICKS,
         stops = m.flags & KNEAD_CONTACT_FORCE_T_FLAG_STOPPING;
    stopping += stops;
    if (stops || fading) steepest_n = fmax(steepest_n, sqrt(step) / (1 + m.missed_cycles));
    if (reset_tick >= 0 && !fading && m.tick < reset_tick + 2 * FADE_TICKS) faded_n = fmax(faded_n, last_n);
    if (reset_tick >= 0 && !fading) again_n = fmax(again_n, last_n);
    const bool new = memcmp(contact_n, m.contact_force_n, sizeof contact_n) != 0;
    memcpy(contact_n, m.contact_force_n, sizeof contact_n);
    if (back_tick >= 0 && m.tick >= back_tick && last_n == 0) gone = m.tick - new_tick, back_tick = -1;
    if (back_tick < 0 && new) new_tick = m.tick, new_n = last_n;
    bool says = m.flags & KNEAD_CONTACT_FORCE_T_FLAG_REDUCED;
    reduced += says;
    mistaken += says != is_reduced;
    if (quality_tick >= 0 && m.tick <= quality_tick + 40) lowest_gain = fmin(lowest_gain, m.gain);
    for (int i = 0; i < stream_count; i++)
        echoed += streams[i].session == m.session && streams[i].first <= m.seq && m.seq <= streams[i].last;
}

static void take_event(const lcm_eventlog_event_t *e)
{
    knead_event_t m;
    if (knead_event_t_decode(e->data, 0, e->datalen, &m) < 0) {
        undecodable++;
        return;
    }
    events++;
    const bool lost = m.kind == KNEAD_EVENT_T_KIND_RESTORE && m.arg[0] < 0;
    back += lost;
    if (lost && last_n > 0) back_tick = m.tick, held_n = new_n;
    if (m.kind == KNEAD_EVENT_T_KIND_QUALITY) {
        bool told = m.arg[2] != 0, other = m.arg[0] != m.arg[1];
        commanded += told;
        stepped += !told && other;
        is_reduced = !told && (other || is_reduced);
        if (other) quality_tick = m.tick;
    }
    if (m.kind != KNEAD_EVENT_T_KIND_RESET) return;
    resets++;
    as_new += m.state_hash == initial_hash;
    reset_tick = m.tick;
    again_n = 0.0;
}

static void take(const lcm_eventlog_event_t *e)
{
    knead_scene_t scene;
    if (begins(e, "KNEAD_FORCE_")) take_force(e);
    else if (begins(e, "KNEAD_EVENT")) take_event(e);
    else if (begins(e, "KNEAD_STATUS")) {
        *(knead_status_t_decode(e->data, 0, e->datalen, &status) < 0 ? &undecodable : &statuses) += 1;
        ever_errors |= status.current_errors;
    } else if (begins(e, "KNEAD_HEALTH")) {
        *(knead_health_t_decode(e->data, 0, e->datalen, &health) < 0 ? &undecodable : &healths) += 1;
        paired += health.utime == status.utime;
    } else if (begins(e, "KNEAD_SCENE")) {
        if (knead_scene_t_decode(e->data, 0, e->datalen, &scene) < 0) undecodable++;
        else scenes++, initial_hash = scene.initial_hash, knead_scene_t_decode_cleanup(&scene);
    }
}

static int64_t sum(const int64_t of[4]) { return of[0] + of[1] + of[2] + of[3]; }

static void tell_health(void)
{
    int64_t in_a_row = 0;
    for (int p = 0; p < 4; p++)
        if (health.lost_in_a_row_max[p] > in_a_row) in_a_row = health.lost_in_a_row_max[p];
    printf("healths %" PRId64 " paired %" PRId64 " ever_errors %" PRId64 "\n", healths, paired, ever_errors);
    printf("lost %" PRId64 " late %" PRId64 " duplicate %" PRId64 " reordered %" PRId64 " in_a_row %" PRId64
           " generation %" PRId64 " saves %" PRId64 " slews %" PRId64 " silences %" PRId64 " estops %" PRId64 "\n",
           sum(health.lost), sum(health.late), sum(health.duplicate), sum(health.reordered), in_a_row,
           health.snapshot_gen, health.snapshots, health.trips[KNEAD_HEALTH_T_TRIP_SLEW],
           health.trips[KNEAD_HEALTH_T_TRIP_POSE_SILENCE], health.trips[KNEAD_HEALTH_T_TRIP_ESTOP]);
}

int main(int argc, char **argv)
{
    for (int pass = 0; pass < 2; pass++) { // poses first
        lcm_eventlog_t *log = argc == 2 ? lcm_eventlog_create(argv[1], "r") : NULL;
        if (!log) return 3;
        for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) {
            if (pass == 1) take(e);
            else if (begins(e, "KNEAD_POSE_")) take_pose(e);
        }
        lcm_eventlog_destroy(log);
    }
    int64_t rejected = 0, hist = 0;
    for (int i = 0; i < 24; i++) rejected += status.rejected[i];
    for (int i = 0; i < 32; i++) hist += status.wakeup_hist[i];
    printf("poses %" PRId64 " forces %" PRId64 " echoed %" PRId64 " events %" PRId64 " scenes %" PRId64
           " statuses %" PRId64 " undecodable %" PRId64 "\n",
           pose_count, forces, echoed, events, scenes, statuses, undecodable);
    printf("peak_n %.6f steepest_n %.6f last_n %.6f stopping %" PRId64 "\n", peak_n, steepest_n, last_n, stopping);
    printf("resets %" PRId64 " as_new %" PRId64 " faded_n %.6f again_n %.6f\n", resets, as_new, faded_n, again_n);
    printf("stepped %" PRId64 " commanded %" PRId64 " lowest_gain %.6f reduced %" PRId64 " mistaken %" PRId64 "\n",
           stepped, commanded, lowest_gain, reduced, mistaken);
    printf("back %" PRId64 " held_n %.6f gone %" PRId64 "\n", back, held_n, gone);
    printf("received %" PRId64 " accepted %" PRId64 " rejected %" PRId64 " kernel_drops %" PRId64 " ticks %" PRId64
           " missed %" PRId64 " hist %" PRId64 "\n",
           status.received, status.accepted, rejected, status.kernel_drops, status.tick, status.missed_cycles, hist);
    tell_health();
    return 0;
}
