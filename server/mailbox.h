#ifndef KN_SERVER_MAILBOX_H
#define KN_SERVER_MAILBOX_H
// The latest value from one thread to one other. A value that was not read in time is overwritten, never queued: a pose
// that waited in a queue would be an old pose, and the servo has no use for one.
//
//     writer fills  back          three slots change hands by swapping indices; nobody waits, nobody copies,
//                    |  exchange  and a value is never seen half written
//                  shared        (bit 2: not yet seen)
//                    |  exchange
//     reader keeps  front
//
// Real-time safe on both sides; C11 atomics, no benign races.
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_mailbox {
    _Atomic unsigned shared; // number of the slot, + 4 while unseen
    unsigned back;           // the writer's slot
    unsigned front;          // the reader's slot
    void *slot[3];           // the caller's memory, of equal sizes
} kn_mailbox;

// Use the three equal slots that start at memory. size is the bytes of each, a multiple of the required alignment.
void kn_mailbox_init(kn_mailbox *box, void *memory, size_t size);

// Writer: fill the slot that back returns (it holds any earlier value), then post it.
void *kn_mailbox_back(kn_mailbox *box);
void kn_mailbox_post(kn_mailbox *box);

// Return true if the reader has not yet seen the latest value. May be called from any thread; the reader's next call to
// latest may already return a newer one.
bool kn_mailbox_unseen(const kn_mailbox *box);

// Reader: return the latest posted value; *fresh is false if it is the one of the last call. Before the first post,
// return the initial bytes of the memory. Valid until the next call.
const void *kn_mailbox_latest(kn_mailbox *box, bool *fresh);

#endif
