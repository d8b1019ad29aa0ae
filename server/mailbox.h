#ifndef KN_SERVER_MAILBOX_H
#define KN_SERVER_MAILBOX_H
// Mailbox: hands the latest value from one thread to one other thread. A value that was not read in time is
// overwritten, never queued: a pose that waited in a queue would be an old pose, and the servo has no use for one.
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
    _Atomic unsigned shared; // index of the slot with the latest value, + 4 while the reader has not seen the value
    unsigned back;           // index of the slot that the writer fills
    unsigned front;          // index of the slot that the reader reads
    void *slot[3];           // three slots of equal size in the caller's memory
} kn_mailbox;

// Initialise a mailbox with three slots of `size` bytes, which lie one after the other at `memory`. `size` is a
// multiple of the required alignment.
void kn_mailbox_init(kn_mailbox *box, void *memory, size_t size);

// For the writer: fill the slot that kn_mailbox_back returns (the slot holds some earlier value), then call
// kn_mailbox_post.
void *kn_mailbox_back(kn_mailbox *box);
void kn_mailbox_post(kn_mailbox *box);

// Return true if the reader has not yet seen the latest value. May be called from any thread; the reader's next call to
// kn_mailbox_latest may already return a newer value.
bool kn_mailbox_unseen(const kn_mailbox *box);

// For the reader: return the latest posted value. Set *fresh to false if the previous call returned the same value.
// Before the first post, return the initial bytes of the memory. The value stays valid until the next call.
const void *kn_mailbox_latest(kn_mailbox *box, bool *fresh);

#endif
