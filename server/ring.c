#include "server/ring.h"
#include <assert.h>
#include <stdlib.h>
#include <string.h>

bool kn_ring_init(kn_ring *ring, size_t capacity, size_t size)
{
    assert(capacity && (capacity & (capacity - 1)) == 0);
    atomic_init(&ring->head, 0);
    atomic_init(&ring->tail, 0);
    ring->capacity = capacity;
    ring->size = size;
    ring->records = calloc(capacity, size);
    return ring->records != NULL;
}

void kn_ring_free(kn_ring *ring)
{
    free(ring->records);
    ring->records = NULL;
}

// Return the address of record number n. The capacity is a power of two, so the record numbers may wrap around.
static char *record_at(const kn_ring *ring, size_t n)
{
    return ring->records + (n & (ring->capacity - 1)) * ring->size;
}

bool kn_ring_push(kn_ring *ring, const void *record) { return kn_ring_push_start(ring, record, ring->size); }

bool kn_ring_push_start(kn_ring *ring, const void *record, size_t bytes)
{
    // Acquire order: the reader has finished with the slot. Release order: the reader sees the record before the new
    // count.
    size_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    if (head - atomic_load_explicit(&ring->tail, memory_order_acquire) == ring->capacity) return false;
    memcpy(record_at(ring, head), record, bytes);
    atomic_store_explicit(&ring->head, head + 1, memory_order_release);
    return true;
}

const void *kn_ring_front(kn_ring *ring)
{
    // Acquire order pairs with the release order in kn_ring_push, so the record is complete.
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    return tail == atomic_load_explicit(&ring->head, memory_order_acquire) ? NULL : record_at(ring, tail);
}

void kn_ring_pop(kn_ring *ring)
{
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    // Release order: all reads of the record end before the writer may reuse the slot.
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
}
