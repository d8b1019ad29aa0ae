#ifndef KNEAD_MESH_H
#define KNEAD_MESH_H
// Collect KNEAD_MESH_INIT and KNEAD_MESH_UPDATE (mesh port 7668) into a complete mesh. Copy this header to use it.
//
//     kn_mesh mesh = {0};
//     on KNEAD_MESH_INIT:    kn_mesh_init(&mesh, data, size);           true: new topology, no positions yet
//     on KNEAD_MESH_UPDATE:  if (kn_mesh_update(&mesh, data, size))     true: all chunks of a tick have come; draw
//     at the end:            kn_mesh_free(&mesh);
//
// `data` and `size` come from lcm_recv_buf_t. The decoders of lcm-gen do not check the counts in a message, and 28
// bytes can make them write past their heap block. So the functions below check the counts first.
#include "proto/knead_mesh_init_t.h"
#include "proto/knead_mesh_update_t.h"
#include <math.h>
#include <stdbool.h>

#define KN_MESH_VERTICES_MAX (1 << 22) // more than a network carries at 30 Hz; limits the memory of a mesh

typedef struct kn_mesh {
    int64_t mesh_id, tick; // tick: the tick of positions_m, valid if `whole` is true
    int32_t generation, vertex_count, triangle_count;
    bool whole;                         // positions_m holds the positions of one tick
    int32_t *triangles;                 // [triangle_count][3], indices of vertices, each < vertex_count
    float *positions_m;                 // [vertex_count][3], finite, all of the same tick
    float *residual_strain, *stress_pa; // [vertex_count] finite values of that tick; NULL: not in the messages
    float *staged_m; // private from here on: received chunks of staged_tick; the measures follow the positions
    uint8_t *seen;   // [vertex_count] 1: received; told: bit mask of the measures that every chunk so far had
    int64_t staged_tick, staged_generation, seen_count, told;
} kn_mesh;

static inline int64_t kn_mesh_int(const void *data, int offset) // big-endian int32
{
    const uint8_t *d = (const uint8_t *)data + offset;
    return (int32_t)((uint32_t)d[0] << 24 | (uint32_t)d[1] << 16 | (uint32_t)d[2] << 8 | d[3]);
}

static inline void kn_mesh_free(kn_mesh *m)
{
    free(m->triangles), free(m->positions_m), free(m->staged_m), free(m->seen);
    memset(m, 0, sizeof *m);
}

// Return false if the mesh is not new, the message is malformed, or memory runs out. The mesh is then unchanged.
static inline bool kn_mesh_init(kn_mesh *m, const void *data, uint32_t size)
{
    enum { INDEX_COUNT = 8 + 24 + 8, TRIANGLES = INDEX_COUNT + 5, TRAILER = 32 }; // bytes; TRAILER: added by --key
    if (size < TRIANGLES || (size - TRIANGLES - 4 * kn_mesh_int(data, INDEX_COUNT)) & ~TRAILER) return false;
    knead_mesh_init_t msg;
    if (knead_mesh_init_t_decode(data, 0, (int)size, &msg) < 0) return false;
    bool fits = msg.vertex_count > 0 && msg.vertex_count <= KN_MESH_VERTICES_MAX && msg.triangle_count >= 0 &&
                (int64_t)msg.triangle_count * 3 == msg.index_count && !(m->positions_m && m->mesh_id == msg.mesh_id);
    for (int i = 0; fits && i < msg.index_count; i++) fits = (uint32_t)msg.triangles[i] < (uint32_t)msg.vertex_count;
    if (fits) {
        size_t n = (size_t)msg.vertex_count;
        kn_mesh next = {.mesh_id = msg.mesh_id, .vertex_count = msg.vertex_count, .staged_tick = -1};
        next.triangle_count = msg.triangle_count, next.seen = calloc(n, 1);
        next.positions_m = calloc(5 * n, sizeof(float)), next.staged_m = calloc(5 * n, sizeof(float));
        fits = next.positions_m && next.staged_m && next.seen;
        if (fits) next.triangles = msg.triangles, msg.triangles = NULL, kn_mesh_free(m), *m = next; // no copy
        else kn_mesh_free(&next);
    }
    knead_mesh_init_t_decode_cleanup(&msg);
    return fits;
}

// Return true if this chunk completes a tick; positions_m then holds that tick. Other chunks do not change it.
static inline bool kn_mesh_update(kn_mesh *m, const void *data, uint32_t size)
{
    enum { COUNTS = 8 + 24 + 20, FLOATS = COUNTS + 13, TRAILER = 32 };
    if (size < FLOATS || !m->positions_m) return false;
    const int64_t n[3] = {kn_mesh_int(data, COUNTS), kn_mesh_int(data, COUNTS + 4), kn_mesh_int(data, COUNTS + 8)};
    if (n[0] < 0 || n[1] < 0 || n[2] < 0 || (size - FLOATS - 4 * (n[0] + n[1] + n[2])) & ~TRAILER) return false;
    knead_mesh_update_t msg;
    if (knead_mesh_update_t_decode(data, 0, (int)size, &msg) < 0) return false;
    const int64_t all = m->vertex_count, first = msg.first, at[3] = {3 * first, 3 * all + first, 4 * all + first};
    bool fits = msg.mesh_id == m->mesh_id && first >= 0 && msg.count >= 0 && n[0] == 3 * (int64_t)msg.count &&
                (!n[1] || n[1] == msg.count) && (!n[2] || n[2] == msg.count) && first + msg.count <= all;
    const float *told[3] = {msg.positions_m, msg.residual_strain, msg.stress_pa};
    for (int k = 0; k < 3; k++)
        for (int64_t i = 0; fits && i < n[k]; i++) fits = isfinite(told[k][i]);
    if (fits && (msg.tick != m->staged_tick || msg.generation != m->staged_generation)) { // another tick
        memset(m->seen, 0, (size_t)all);
        m->seen_count = 0, m->told = 3, m->staged_tick = msg.tick, m->staged_generation = msg.generation;
    }
    for (int k = 0; fits && k < 3; k++) memcpy(m->staged_m + at[k], n[k] ? told[k] : m->staged_m, 4 * (size_t)n[k]);
    if (fits) m->told &= (n[1] == msg.count) | (n[2] == msg.count) << 1;
    for (int64_t v = first; fits && v < first + msg.count; v++) m->seen_count += !m->seen[v], m->seen[v] = 1;
    const bool again = m->whole && m->tick == msg.tick && m->generation == msg.generation; // tick already complete
    const bool whole = fits && !again && m->seen_count == all;
    if (whole) {
        float *before_m = m->positions_m;
        m->positions_m = m->staged_m, m->staged_m = before_m;
        m->residual_strain = m->told & 1 ? m->positions_m + 3 * all : NULL;
        m->stress_pa = m->told & 2 ? m->positions_m + 4 * all : NULL;
        m->tick = msg.tick, m->generation = msg.generation, m->whole = true;
    }
    knead_mesh_update_t_decode_cleanup(&msg);
    return whole;
}
#endif
