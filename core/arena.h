#ifndef KN_CORE_ARENA_H
#define KN_CORE_ARENA_H
// Hands out pieces of one block, 64-byte aligned. With base NULL it only measures.
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
