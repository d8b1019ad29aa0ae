#ifndef KN_SERVER_RING_H
#define KN_SERVER_RING_H
// Every value in order from one thread to one other, through a fixed number of equal records. Full: push refuses and
// the caller counts; the servo never waits for a reader. Real-time safe on both sides but for create and destroy.
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_ring {
    _Alignas(64) _Atomic size_t head; // records pushed; only the writer stores it. Own cache lines: no false sharing
    _Alignas(64) _Atomic size_t tail; // records popped; only the reader stores it
    size_t capacity;                  // a power of two
    size_t size;                      // bytes of a record
    char *records;
} kn_ring;

// capacity: a power of two. False when memory is short.
bool kn_ring_init(kn_ring *ring, size_t capacity, size_t size);
void kn_ring_free(kn_ring *ring);

bool kn_ring_push(kn_ring *ring, const void *record); // false: full, nothing was written
// Its first bytes alone, where the reader looks at no more: the rest of the record is whatever stood there.
bool kn_ring_push_start(kn_ring *ring, const void *record, size_t bytes);
const void *kn_ring_front(kn_ring *ring);             // oldest record, NULL: empty; valid until pop
void kn_ring_pop(kn_ring *ring);                      // after front gave a record

#endif
