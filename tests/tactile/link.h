#ifndef KN_TESTS_LINK_H
#define KN_TESTS_LINK_H
// One direction of a bad link. Messages come out after delay_ns, and some of them lost or changed. The same seed
// gives the same faults. The clock is server/clock.h's, real or virtual.
#include "server/clock.h"
#include "tests/dice.h"
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define KN_WAY 1024 // maximum number of messages under way
#define KN_WAY_LONGEST 65000

typedef struct kn_link_fault { // zero: no fault of this kind
    double loss, burst;        // share of the messages lost; number lost in a row each time (1)
    // jitter of the round trip, ms; each direction has up to half of it, so that messages overtake one another
    double jitter;
    double twice; // share of the messages delivered again, directly behind the first
    double swap;  // share delivered 1.5 ms late: behind the next message
    double flip;  // share with one flipped bit
    double seed;
} kn_link_fault;

typedef struct kn_way {
    kn_link_fault fault;
    int64_t delay_ns;
    void (*deliver)(void *to, const char *channel, const void *bytes, unsigned size);
    void *to;
    int64_t carried, lost, flipped, twice, swapped;
    // private
    uint64_t dice;
    int64_t number;
    int burst; // messages still to be lost in a row
    int count;
    struct kn_way_message {
        int64_t due_ns, number;
        char channel[64];
        unsigned size;
        void *bytes;
    } list[KN_WAY]; // unordered
} kn_way;

static inline double kn_way_throw(kn_way *w) { return kn_dice(&w->dice); }

static inline void kn_way_init(kn_way *w, const kn_link_fault *fault, double delay_ms, uint64_t salt)
{
    memset(w, 0, sizeof *w);
    w->fault = *fault;
    w->fault.burst = fault->burst >= 1 ? fault->burst : 1;
    w->delay_ns = (int64_t)(1e6 * delay_ms);
    w->dice = ((uint64_t)fault->seed + salt) * 0x9e3779b97f4a7c15u;
}

static inline bool kn_way_loses(kn_way *w)
{
    const kn_link_fault *f = &w->fault;
    // Between two bursts (1 - q)/q messages arrive on average.
    if (w->burst == 0 && kn_way_throw(w) < f->loss / (f->loss + f->burst * (1.0 - f->loss))) w->burst = (int)f->burst;
    if (w->burst == 0) return false;
    w->burst--;
    return true;
}

static inline void kn_way_put(kn_way *w, const char *channel, const void *bytes, unsigned size, int64_t due_ns)
{
    if (w->count == KN_WAY || size > KN_WAY_LONGEST) return; // dropped, as on any link
    struct kn_way_message *m = &w->list[w->count++];
    *m = (struct kn_way_message){.due_ns = due_ns, .number = w->number++, .size = size, .bytes = malloc(size)};
    snprintf(m->channel, sizeof m->channel, "%s", channel);
    memcpy(m->bytes, bytes, size);
}

static inline void kn_way_take(kn_way *w, const char *channel, const void *bytes, unsigned size)
{
    const kn_link_fault *f = &w->fault;
    bool scene = !strcmp(channel, "KNEAD_SCENE"); // never lose the scene: without it a hand would not begin
    if (!scene && kn_way_loses(w)) {
        w->lost++;
        return;
    }
    int64_t due_ns = kn_now_ns() + w->delay_ns + (int64_t)(5e5 * f->jitter * kn_way_throw(w));
    bool swaps = kn_way_throw(w) < f->swap, twice = kn_way_throw(w) < f->twice,
         flips = kn_way_throw(w) < f->flip && !scene;
    kn_way_put(w, channel, bytes, size, due_ns + (swaps ? 1500000 : 0));
    if (flips && w->count > 0) {
        struct kn_way_message *m = &w->list[w->count - 1];
        unsigned bit = (unsigned)(kn_way_throw(w) * 8.0 * m->size);
        ((unsigned char *)m->bytes)[bit / 8] ^= (unsigned char)(1u << bit % 8);
    }
    if (twice) kn_way_put(w, channel, bytes, size, due_ns);
    w->carried++;
    w->swapped += swaps;
    w->twice += twice;
    w->flipped += flips;
}

// Return the message that has been due longest, and the first sent if several have the same time. NULL: none is under
// way.
static inline struct kn_way_message *kn_way_first(kn_way *w)
{
    struct kn_way_message *best = NULL;
    for (struct kn_way_message *m = w->list; m < w->list + w->count; m++)
        if (!best || m->due_ns < best->due_ns || (m->due_ns == best->due_ns && m->number < best->number)) best = m;
    return best;
}

static inline bool kn_way_deliver(kn_way *w) // deliver all due messages; false: there were none
{
    int before = w->count;
    for (struct kn_way_message *m; (m = kn_way_first(w)) && m->due_ns <= kn_now_ns();) {
        w->deliver(w->to, m->channel, m->bytes, m->size);
        free(m->bytes);
        *m = w->list[--w->count];
    }
    return w->count < before;
}

#endif
