#include "server/skin.h"
#include "core/hash.h"
#include "proto/knead_mesh_init_t.h"
#include "proto/knead_mesh_update_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/wire.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static knead_mesh_init_t topology_message(const kn_skin *skin, int64_t utime)
{
    const kn_surface *s = skin->surface;
    return (knead_mesh_init_t){.utime = utime,
                               .mesh_id = skin->mesh_id,
                               .topology_hash = skin->topology_hash,
                               .vertex_count = s->vertex_count,
                               .triangle_count = s->triangle_count,
                               .index_count = 3 * s->triangle_count,
                               .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE,
                               .triangles = s->triangle};
}

bool kn_skin_open(kn_skin *skin, const char *url, const kn_model *model, double mesh_hz, uint64_t text_hash,
                  char *error, size_t error_size)
{
    memset(skin, 0, sizeof *skin);
    skin->model = model;
    skin->period_ticks = (int)(1000.0 / mesh_hz + 0.5);
    skin->surface = kn_surface_create(model);
    const char *what = "out of memory";
    if (!skin->surface) goto fail;
    const kn_surface *s = skin->surface;
    size_t frame_bytes = (sizeof(kn_skin_frame) + 3 * sizeof(float) * (size_t)s->vertex_count + 63) / 64 * 64;
    skin->memory = calloc(3, frame_bytes);
    if (!skin->memory) goto fail;
    kn_mailbox_init(&skin->frames, skin->memory, frame_bytes);

    uint64_t hash = kn_hash_bytes(KN_HASH_SEED, s->triangle, 3 * sizeof(int) * (size_t)s->triangle_count);
    skin->topology_hash = (int64_t)hash;
    skin->mesh_id = (int64_t)kn_hash_bytes(hash, &text_hash, sizeof text_hash);
    knead_mesh_init_t message = topology_message(skin, 0);
    skin->topology_size = knead_mesh_init_t_encoded_size(&message);
    skin->topology = malloc((size_t)skin->topology_size + KN_WIRE_MAC);
    if (!skin->topology) goto fail;
    skin->lcm = lcm_create(url);
    what = "LCM refused this URL";
    if (skin->lcm) return true;
fail:
    snprintf(error, error_size, "%s: %s", url, what);
    kn_skin_close(skin);
    return false;
}

void kn_skin_close(kn_skin *skin)
{
    if (skin->lcm) lcm_destroy(skin->lcm);
    free(skin->topology);
    free(skin->memory);
    kn_surface_destroy(skin->surface);
    memset(skin, 0, sizeof *skin);
}

void kn_skin_capture(kn_skin *skin, const kn_state *state, int64_t tick, int32_t generation)
{
    if (tick < skin->next_tick) return;
    skin->next_tick = tick + skin->period_ticks;
    kn_skin_frame *frame = kn_mailbox_back(&skin->frames);
    frame->tick = tick;
    frame->generation = generation;
    kn_surface_positions(skin->surface, skin->model, state, frame->xyz_m);
    kn_mailbox_post(&skin->frames);
}

static void send_bytes(kn_skin *skin, const char *channel, uint8_t *bytes, int size) // room for a tag behind them
{
    if (size > 0 && skin->auth) size = (int)kn_auth_sign(skin->auth, channel, bytes, (size_t)size);
    if (size > 0) lcm_publish(skin->lcm, channel, bytes, (unsigned)size);
}

void kn_skin_publish_topology(kn_skin *skin, int64_t utime)
{
    knead_mesh_init_t message = topology_message(skin, utime);
    int size = knead_mesh_init_t_encode(skin->topology, 0, skin->topology_size, &message);
    send_bytes(skin, "KNEAD_MESH_INIT", skin->topology, size);
}

bool kn_skin_publish(kn_skin *skin, int64_t utime)
{
    bool fresh;
    const kn_skin_frame *frame = kn_mailbox_latest(&skin->frames, &fresh);
    int vertices = skin->surface->vertex_count, chunks = (vertices + KN_SKIN_CHUNK - 1) / KN_SKIN_CHUNK;
    for (int i = 0; fresh && i < chunks; i++) {
        int first = i * KN_SKIN_CHUNK, count = vertices - first < KN_SKIN_CHUNK ? vertices - first : KN_SKIN_CHUNK;
        knead_mesh_update_t message = {.utime = utime,
                                       .mesh_id = skin->mesh_id,
                                       .tick = frame->tick,
                                       .generation = frame->generation,
                                       .chunk = i,
                                       .chunks = chunks,
                                       .first = first,
                                       .count = count,
                                       .position_count = 3 * count,
                                       .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE,
                                       // lcm-gen's arrays are not const; encoding only reads
                                       .positions_m = (float *)frame->xyz_m + 3 * first};
        int size = knead_mesh_update_t_encode(skin->update, 0, sizeof skin->update - KN_WIRE_MAC, &message);
        send_bytes(skin, "KNEAD_MESH_UPDATE", skin->update, size);
        // back to back, larger meshes would overflow the usual 208 kB receive buffer of the screens
        if (i + 1 < chunks) nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    return fresh;
}
