// logcheck LOG: a log of the pose bus, read by liblcm and lcm-gen's decoders as any client would, in numbers for a script:
//
//     poses N forces N echoed N events N scenes N statuses N undecodable N     echoed: forces whose session and seq a pose had
//     received N accepted N rejected N kernel_drops N ticks N missed N hist N  of the last status; hist: sum of wakeup_hist
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_probe_pose_t.h"
#include "proto/knead_scene_t.h"
#include "proto/knead_status_t.h"
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct echo {
    int64_t session, seq;
} echo;

static echo *poses;
static int64_t pose_count, forces, echoed, events, scenes, statuses, undecodable;
static knead_status_t status;

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
    if (pose_count % 4096 == 0) poses = realloc(poses, (size_t)(pose_count + 4096) * sizeof *poses);
    poses[pose_count++] = (echo){m.session, m.seq};
}

static void take_force(const lcm_eventlog_event_t *e)
{
    knead_contact_force_t m;
    if (knead_contact_force_t_decode(e->data, 0, e->datalen, &m) < 0) {
        undecodable++;
        return;
    }
    forces++;
    for (int64_t i = pose_count - 1; i >= 0; i--) { // the answer is to one of the last few
        if (poses[i].session != m.session || poses[i].seq != m.seq) continue;
        echoed++;
        return;
    }
}

static void take(const lcm_eventlog_event_t *e)
{
    knead_event_t event;
    knead_scene_t scene;
    if (begins(e, "KNEAD_POSE_")) take_pose(e);
    else if (begins(e, "KNEAD_FORCE_")) take_force(e);
    else if (begins(e, "KNEAD_EVENT")) *(knead_event_t_decode(e->data, 0, e->datalen, &event) < 0 ? &undecodable : &events) += 1;
    else if (begins(e, "KNEAD_STATUS")) *(knead_status_t_decode(e->data, 0, e->datalen, &status) < 0 ? &undecodable : &statuses) += 1;
    else if (begins(e, "KNEAD_SCENE")) {
        if (knead_scene_t_decode(e->data, 0, e->datalen, &scene) < 0) undecodable++;
        else scenes++, knead_scene_t_decode_cleanup(&scene);
    }
}

int main(int argc, char **argv)
{
    lcm_eventlog_t *log = argc == 2 ? lcm_eventlog_create(argv[1], "r") : NULL;
    if (!log) return 3;
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) take(e);
    lcm_eventlog_destroy(log);
    int64_t rejected = 0, hist = 0;
    for (int i = 0; i < 24; i++) rejected += status.rejected[i];
    for (int i = 0; i < 32; i++) hist += status.wakeup_hist[i];
    printf("poses %" PRId64 " forces %" PRId64 " echoed %" PRId64 " events %" PRId64 " scenes %" PRId64 " statuses %" PRId64
           " undecodable %" PRId64 "\n", pose_count, forces, echoed, events, scenes, statuses, undecodable);
    printf("received %" PRId64 " accepted %" PRId64 " rejected %" PRId64 " kernel_drops %" PRId64 " ticks %" PRId64
           " missed %" PRId64 " hist %" PRId64 "\n", status.received, status.accepted, rejected, status.kernel_drops,
           status.tick, status.missed_cycles, hist);
    free(poses);
    return 0;
}
