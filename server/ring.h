#ifndef KN_SERVER_RING_H
#define KN_SERVER_RING_H
// A queue from one thread to one other: every record, in order, in a fixed number of equal records. When it is full,
// push refuses and the caller counts; the servo never waits for a reader. Real-time safe on both sides, except init and
// free.
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_ring {
    // Records pushed (stored only by the writer) and popped (stored only by the reader). Each count has a cache line of
    // its own, so there is no false sharing.
    _Alignas(64) _Atomic size_t head;
    _Alignas(64) _Atomic size_t tail;
    size_t capacity; // a power of two
    size_t size;     // bytes of a record
    char *records;
} kn_ring;

// Allocate a ring. capacity is a power of two. Return false when memory is short.
bool kn_ring_init(kn_ring *ring, size_t capacity, size_t size);
void kn_ring_free(kn_ring *ring);

bool kn_ring_push(kn_ring *ring, const void *record); // false: full, nothing was written
// Push only the first bytes of a record, if the reader looks at no more. The rest keeps its old content.
bool kn_ring_push_start(kn_ring *ring, const void *record, size_t bytes);
const void *kn_ring_front(kn_ring *ring); // oldest record, valid until pop; NULL: empty
void kn_ring_pop(kn_ring *ring);          // call after front gave a record

#endif
