#ifndef KNEAD_MESH_H
#define KNEAD_MESH_H
// KNEAD_MESH_INIT and KNEAD_MESH_UPDATE (mesh port, 7668) -> one mesh, always whole. One header, to copy.
//
//     kn_mesh mesh = {0};
//     on KNEAD_MESH_INIT:    kn_mesh_init(&mesh, data, size);           true: new topology, positions not known yet
//     on KNEAD_MESH_UPDATE:  if (kn_mesh_update(&mesh, data, size))     true: all chunks of one tick are in: draw
//     at the end:            kn_mesh_free(&mesh);
//
// data and size are those of lcm_recv_buf_t. The decoders of lcm-gen believe the counts in a message (28 bytes can make
// them write past their heap block), so the counts are held against the size before anything is decoded.
#include "proto/knead_mesh_init_t.h"
#include "proto/knead_mesh_update_t.h"
#include <math.h>
#include <stdbool.h>
#include <string.h>

#define KN_MESH_VERTICES_MAX (1 << 22) // far above what the wire carries at 30 Hz; bounds the memory a message asks for

typedef struct kn_mesh {
    int64_t mesh_id, tick; // tick of positions_m, when whole
    int32_t generation, vertex_count, triangle_count;
    bool whole;         // positions_m is filled
    int32_t *triangles; // [triangle_count][3], every one < vertex_count
    float *positions_m; // [vertex_count][3], all of one tick, finite
    float *residual_strain, *stress_pa; // [vertex_count] of that tick, finite; NULL: the scene's mesh.measures ask for none
    float *staged_m;    // private from here on: chunks of staged_tick as they come in; both measures behind the positions
    uint8_t *seen;      // [vertex_count]
    bool told[2];       // of the measures, by every chunk of staged_tick
    int64_t staged_tick, staged_generation, seen_count;
} kn_mesh;

static inline int64_t kn_mesh_int(const uint8_t *data, int offset) // big-endian int32
{
    return (int32_t)((uint32_t)data[offset] << 24 | (uint32_t)data[offset + 1] << 16 | (uint32_t)data[offset + 2] << 8 |
                     data[offset + 3]);
}

static inline void kn_mesh_free(kn_mesh *m)
{
    free(m->triangles), free(m->positions_m), free(m->staged_m), free(m->seen);
    memset(m, 0, sizeof *m);
}

// False: nothing new (the same mesh again), malformed, or out of memory; the mesh is then as before.
static inline bool kn_mesh_init(kn_mesh *m, const void *data, uint32_t size)
{
    enum { INDEX_COUNT = 8 + 24 + 8, TRIANGLES = INDEX_COUNT + 5, TAG = 16 }; // byte offsets, after
    // the type's hash; kneadd --key appends a tag
    if (size < TRIANGLES || (size - TRIANGLES - 4 * kn_mesh_int(data, INDEX_COUNT)) & ~TAG) return false;
    knead_mesh_init_t msg;
    if (knead_mesh_init_t_decode(data, 0, (int)size, &msg) < 0) return false;
    bool fits = msg.vertex_count > 0 && msg.vertex_count <= KN_MESH_VERTICES_MAX && msg.triangle_count >= 0 &&
                (int64_t)msg.triangle_count * 3 == msg.index_count;
    for (int32_t i = 0; fits && i < msg.index_count; i++)
        fits = msg.triangles[i] >= 0 && msg.triangles[i] < msg.vertex_count;
    fits = fits && !(m->positions_m && m->mesh_id == msg.mesh_id);
    if (fits) {
        size_t n = (size_t)msg.vertex_count;
        kn_mesh next = {.mesh_id = msg.mesh_id, .vertex_count = msg.vertex_count, .triangle_count = msg.triangle_count,
                        .positions_m = calloc(5 * n, sizeof(float)), .staged_m = calloc(5 * n, sizeof(float)),
                        .seen = calloc(n, 1), .staged_tick = -1};
        fits = next.positions_m && next.staged_m && next.seen;
        if (fits) next.triangles = msg.triangles, msg.triangles = NULL; // taken over from the decoder
        if (fits) kn_mesh_free(m), *m = next;
        else kn_mesh_free(&next);
    }
    knead_mesh_init_t_decode_cleanup(&msg);
    return fits;
}

// True: positions_m now is the tick whose last missing chunk this was. Other chunks change nothing that can be seen.
static inline bool kn_mesh_update(kn_mesh *m, const void *data, uint32_t size)
{
    enum { COUNTS = 8 + 24 + 20, FLOATS = COUNTS + 13, TAG = 16 };
    if (size < FLOATS || !m->positions_m) return false;
    int64_t n[3] = {kn_mesh_int(data, COUNTS), kn_mesh_int(data, COUNTS + 4), kn_mesh_int(data, COUNTS + 8)};
    if (n[0] < 0 || n[1] < 0 || n[2] < 0 || (size - FLOATS - 4 * (n[0] + n[1] + n[2])) & ~TAG) return false;
    knead_mesh_update_t msg;
    if (knead_mesh_update_t_decode(data, 0, (int)size, &msg) < 0) return false;
    bool fits = msg.mesh_id == m->mesh_id && msg.first >= 0 && msg.count >= 0 && n[0] == 3 * (int64_t)msg.count &&
                (int64_t)msg.first + msg.count <= m->vertex_count;
    const size_t vertices = (size_t)m->vertex_count;
    const float *told[3] = {msg.positions_m, msg.residual_strain, msg.stress_pa};
    for (int k = 0; k < 3; k++) {
        fits = fits && (k == 0 || n[k] == 0 || n[k] == msg.count);
        for (int64_t i = 0; fits && i < n[k]; i++) fits = isfinite(told[k][i]);
    }
    if (fits) {
        if (msg.tick != m->staged_tick || msg.generation != m->staged_generation) { // the tick before was not whole
            memset(m->seen, 0, (size_t)m->vertex_count);
            m->seen_count = 0, m->staged_tick = msg.tick, m->staged_generation = msg.generation;
            m->told[0] = m->told[1] = true;
        }
        float *staged[3] = {m->staged_m + 3 * msg.first, m->staged_m + 3 * vertices + msg.first,
                            m->staged_m + 4 * vertices + msg.first};
        for (int k = 0; k < 3; k++)
            if (n[k]) memcpy(staged[k], told[k], sizeof(float) * (size_t)n[k]);
        m->told[0] &= n[1] == msg.count, m->told[1] &= n[2] == msg.count;
        for (int32_t v = msg.first; v < msg.first + msg.count; v++) m->seen_count += !m->seen[v], m->seen[v] = 1;
    }
    bool news = !m->whole || m->tick != msg.tick || m->generation != msg.generation; // else a chunk that came twice
    bool whole = fits && news && m->seen_count == m->vertex_count;
    if (whole) {
        float *previous_m = m->positions_m;
        m->positions_m = m->staged_m, m->staged_m = previous_m;
        m->residual_strain = m->told[0] ? m->positions_m + 3 * vertices : NULL;
        m->stress_pa = m->told[1] ? m->positions_m + 4 * vertices : NULL;
        m->tick = msg.tick, m->generation = msg.generation, m->whole = true;
    }
    knead_mesh_update_t_decode_cleanup(&msg);
    return whole;
}
#endif
