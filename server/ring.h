#ifndef KN_SERVER_RING_H
#define KN_SERVER_RING_H
// Ring: a queue from one thread to one other thread. It passes on every record, in order, and has room for a fixed
// number of records of equal size. When the ring is full, kn_ring_push returns false and the caller counts the loss;
// the servo never waits for a reader. Real-time safe on both sides, except init and free.
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_ring {
    // Records pushed (stored only by the writer) and popped (stored only by the reader). Each count has a cache line of
    // its own, so there is no false sharing.
    _Alignas(64) _Atomic size_t head;
    _Alignas(64) _Atomic size_t tail;
    size_t capacity; // number of records that the ring can hold, a power of two
    size_t size;     // size of one record, bytes
    char *records;
} kn_ring;

// Allocate a ring. capacity is a power of two. Return false when memory is short.
bool kn_ring_init(kn_ring *ring, size_t capacity, size_t size);
void kn_ring_free(kn_ring *ring);

// Append a record; return false if the ring is full, and then nothing was written.
bool kn_ring_push(kn_ring *ring, const void *record);
// Append a record, but copy only its first `bytes` bytes, because the reader reads no more. The rest of the record in
// the ring keeps old content.
bool kn_ring_push_start(kn_ring *ring, const void *record, size_t bytes);
const void *kn_ring_front(kn_ring *ring); // return the oldest record, valid until kn_ring_pop; NULL: the ring is empty
void kn_ring_pop(kn_ring *ring);          // remove the oldest record; call only after kn_ring_front returned a record

#endif
