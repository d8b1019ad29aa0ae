#include "clients/web/vitals.h"
#include "clients/knead/live.h"
#include "proto/knead_event_t.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

// Message handlers: each keeps the newest message of its channel.
static void on_status(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    kn_vitals *v = user;
    knead_status_t heard;
    if (knead_status_t_decode(buffer->data, 0, (int)buffer->data_size, &heard) < 0) return;
    v->status = heard;
    v->status_ms = kn_live_now_ms();
}

static void on_health(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    kn_vitals *v = user;
    knead_health_t heard;
    if (knead_health_t_decode(buffer->data, 0, (int)buffer->data_size, &heard) < 0) return;
    v->health = heard;
    v->health_ms = kn_live_now_ms();
}

// Keep the energies of an audit. Only checkpoint events have them.
static void on_event(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    kn_vitals *v = user;
    knead_event_t e;
    if (knead_event_t_decode(buffer->data, 0, (int)buffer->data_size, &e) < 0) return;
    if (e.kind != KNEAD_EVENT_T_KIND_CHECKPOINT || !isfinite(e.arg[1]) || !isfinite(e.arg[2])) return;
    v->stored_j = e.arg[1];
    v->work_j = e.arg[2];
    v->energy_ms = kn_live_now_ms();
}

// The subscription covers all probes; keep the patch of the chosen probe only.
static void on_touch(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_vitals *v = user;
    knead_touch_patch_t heard;
    if (strcmp(channel, v->touch_channel) != 0) return;
    if (knead_touch_patch_t_decode(buffer->data, 0, (int)buffer->data_size, &heard) < 0) return;
    v->touch = heard;
    v->touch_ms = kn_live_now_ms();
}

// Count the bytes of the mesh messages, from which the page's data rate is computed.
static void on_mesh(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    ((kn_vitals *)user)->mesh_bytes += buffer->data_size;
}

bool kn_vitals_open(kn_vitals *v, kn_join *bus, kn_join *mesh_bus)
{
    *v = (kn_vitals){0};
    return kn_join_hear(mesh_bus, "KNEAD_MESH_UPDATE", on_mesh, v) && kn_join_hear(bus, "KNEAD_STATUS", on_status, v) &&
           kn_join_hear(bus, "KNEAD_HEALTH", on_health, v) && kn_join_hear(bus, "KNEAD_EVENT", on_event, v) &&
           kn_join_hear(bus, "KNEAD_TOUCH_*", on_touch, v);
}

void kn_vitals_touch(kn_vitals *v, const char *probe)
{
    snprintf(v->touch_channel, sizeof v->touch_channel, "KNEAD_TOUCH_%s", probe ? probe : "");
    v->touch_ms = 0;
}

int64_t kn_vitals_share_us(const int64_t histogram[32], double share)
{
    int64_t all = 0, seen = 0;
    for (int i = 0; i < 32; i++) all += histogram[i];
    // Find the bucket in which the cumulative count reaches the share. Bucket n counts ticks of less than 2^n us.
    if (all <= 0) return 0;
    int bucket = 0;
    while (bucket < 31 && (double)(seen += histogram[bucket]) < share * (double)all) bucket++;
    return (int64_t)1 << bucket;
}
