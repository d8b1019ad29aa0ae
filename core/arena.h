#ifndef KN_CORE_ARENA_H
#define KN_CORE_ARENA_H
// An arena: it hands out pieces of one block, each aligned to 64 bytes. If `base` is NULL, the arena only adds up the
// sizes.
#include <stddef.h>

typedef struct kn_arena {
    char *base;
    size_t used;
} kn_arena;

static inline void *kn_arena_take(kn_arena *a, size_t bytes)
{
    void *p = a->base ? a->base + a->used : NULL;
    a->used += (bytes + 63) / 64 * 64;
    return p;
}

#endif
