#ifndef KN_SERVER_MAILBOX_H
#define KN_SERVER_MAILBOX_H
// The latest value from one thread to one other: what was not looked at in time is overwritten, never queued. A pose
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
    _Atomic unsigned shared; // slot number, + 4 while unseen
    unsigned back;           // writer's
    unsigned front;          // reader's
    void *slot[3];           // the caller's memory, equal sizes
} kn_mailbox;

// Lends three equal slots that start at memory, each of size bytes (a multiple of the alignment wanted).
void kn_mailbox_init(kn_mailbox *box, void *memory, size_t size);

// Writer: fill what back returns (its old content is any earlier value), then post it.
void *kn_mailbox_back(kn_mailbox *box);
void kn_mailbox_post(kn_mailbox *box);

// Whether the reader has not seen the latest yet. Any thread; the reader's next call to latest may already know more.
bool kn_mailbox_unseen(const kn_mailbox *box);

// Reader: the latest posted value, the same one again when nothing new came (fresh tells), the initial bytes of the
// memory before the first. Valid until the next call.
const void *kn_mailbox_latest(kn_mailbox *box, bool *fresh);

#endif
