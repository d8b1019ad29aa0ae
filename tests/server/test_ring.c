#include "server/ring.h"
#include "tests/check.h"
#include <pthread.h>
#include <sched.h>
#include <stdint.h>

TEST("records leave the ring in the order they entered; a full ring refuses and keeps its records")
{
    AT_END(kn_ring_free) kn_ring ring;
    CHECK(kn_ring_init(&ring, 4, sizeof(int)));
    CHECK(kn_ring_front(&ring) == NULL);
    for (int n = 0; n < 4; n++) CHECK(kn_ring_push(&ring, &n));
    int refused = 99;
    CHECK(!kn_ring_push(&ring, &refused));
    for (int n = 0; n < 10; n++) { // wrap around several times
        const int *front = kn_ring_front(&ring);
        CHECK(front && *front == n);
        kn_ring_pop(&ring);
        int next = n + 4;
        CHECK(kn_ring_push(&ring, &next));
    }
}

enum { RECORDS = 200000 };
typedef struct record {
    uint64_t n, copy[15];
} record;

// The writer thread: fill every word of a record with its number, so that a torn record shows.
static void *push_records(void *ring)
{
    for (uint64_t n = 0; n < RECORDS; n++) {
        record r = {.n = n};
        for (int i = 0; i < 15; i++) r.copy[i] = n;
        while (!kn_ring_push(ring, &r)) sched_yield();
    }
    return NULL;
}

TEST("a push of the start of a record writes only the start")
{
    AT_END(kn_ring_free) kn_ring ring;
    CHECK(kn_ring_init(&ring, 2, sizeof(record)));
    record r = {.n = 7, .copy = {7, 7}};
    for (int i = 0; i < 2; i++) {
        CHECK(kn_ring_push_start(&ring, &r, sizeof r.n + sizeof r.copy[0]));
        const record *read = kn_ring_front(&ring);
        CHECK(read->n == 7 && read->copy[0] == 7 && read->copy[1] == 0);
        kn_ring_pop(&ring);
    }
}

TEST("between two threads every record arrives once, whole and in order")
{
    AT_END(kn_ring_free) kn_ring ring;
    CHECK(kn_ring_init(&ring, 64, sizeof(record)));
    pthread_t writer;
    CHECK(pthread_create(&writer, NULL, push_records, &ring) == 0);
    uint64_t wrong = 0;
    for (uint64_t n = 0; n < RECORDS;) {
        const record *r = kn_ring_front(&ring);
        if (!r) {
            sched_yield();
            continue;
        }
        wrong += r->n != n;
        for (int i = 0; i < 15; i++) wrong += r->copy[i] != n;
        kn_ring_pop(&ring);
        n++;
    }
    pthread_join(writer, NULL);
    CHECK(wrong == 0);
    CHECK(kn_ring_front(&ring) == NULL);
}

TESTS_MAIN
