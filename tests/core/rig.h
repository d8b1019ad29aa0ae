#ifndef KN_TESTS_CORE_RIG_H
#define KN_TESTS_CORE_RIG_H
// A random lattice in integers, with memory for its ticks.
#include "core/fixed.h"
#include "core/hash.h"
#include "tests/check.h"

typedef struct rig {
    kn_fixed_image image;
    kn_fixed fixed;
    void *memory;
    kn_fixed_bound *bound;
    int64_t (*reaction)[3];
    kn_fixed_result result;
} rig;

static inline uint64_t next(uint64_t *seed)
{
    *seed = kn_hash_bytes(KN_HASH_SEED, seed, sizeof *seed);
    return *seed;
}
static inline int32_t within(uint64_t *seed, int32_t least, int32_t most)
{
    return least + (int32_t)(next(seed) % (uint64_t)((int64_t)most - least + 1));
}

// Make random nodes, random edges between pairs of nodes, and a table that falls from 1 to 1/20.
static inline rig *make(int nodes, int edges, uint64_t seed)
{
    rig *r = calloc(1, sizeof *r);
    kn_fixed_config *c = &r->image.config;
    *c = (kn_fixed_config){.node_count = nodes,
                           .edge_count = edges,
                           .passes = 2,
                           .iterations = 4,
                           .d_shift = 12,
                           .kv_shift = 13,
                           .octave = 10,
                           .beta = 90000,
                           .beta_shift = 16,
                           .relax = 126000,
                           .omega = {65536, 80000, 78000, 77500}};
    r->image.node = calloc((size_t)nodes, sizeof *r->image.node);
    r->image.edge = calloc((size_t)edges, sizeof *r->image.edge);
    for (int n = 0; n < nodes; n++)
        for (int k = 0; k < 3; k++) r->image.node[n].x[k] = within(&seed, -(1 << 28), 1 << 28);
    for (int e = 0; e < edges; e++) {
        kn_fixed_edge *edge = &r->image.edge[e];
        edge->i = (uint16_t)within(&seed, 0, nodes - 1);
        edge->j = (uint16_t)((edge->i + within(&seed, 1, nodes - 1)) % nodes);
        edge->kv = within(&seed, 1, (1 << 17) - 1);
        edge->ia = within(&seed, 1 << 14, (1 << 17) - 1);
    }
    for (int i = 0; i <= KN_FIXED_SEGMENTS; i++) r->image.table[i] = 131072 - 240 * i;
    r->memory = aligned_alloc(64, kn_fixed_bytes(&r->image));
    r->bound = calloc((size_t)nodes, sizeof *r->bound);
    r->reaction = calloc((size_t)nodes, sizeof *r->reaction);
    kn_fixed_init(&r->fixed, &r->image, r->memory);
    const char *wrong = kn_fixed_check(&r->image);
    if (wrong) KN_TEST_FAIL("%s", wrong);
    return r;
}

static inline void unmake(rig *r)
{
    free(r->image.node);
    free(r->image.edge);
    free(r->memory);
    free(r->bound);
    free(r->reaction);
    free(r);
}

OWNS(rig, unmake)

static inline void tick(rig *r, int count) { kn_fixed_tick(&r->fixed, r->bound, count, r->reaction, &r->result); }

// Hold every node and move it at random.
static inline void move_all(rig *r, uint64_t *seed, int32_t most)
{
    for (int n = 0; n < r->image.config.node_count; n++)
        r->bound[n] = (kn_fixed_bound){
            .node = (uint16_t)n,
            .holds = true,
            .value = {within(seed, -most, most), within(seed, -most, most), within(seed, -most, most)}};
}

#endif
