#include "server/mailbox.h"

// Bits of shared: the slot's number, and the flag that the reader has not seen it.
enum { SLOT = 3, UNSEEN = 4 };

void kn_mailbox_init(kn_mailbox *box, void *memory, size_t size)
{
    for (int i = 0; i < 3; i++) box->slot[i] = (char *)memory + (size_t)i * size;
    box->back = 0;
    box->front = 2;
    atomic_init(&box->shared, 1);
}

void *kn_mailbox_back(kn_mailbox *box) { return box->slot[box->back]; }

// release: the reader that takes this slot sees all that was written into it. acquire: the reader has finished with the
// slot that comes back.
void kn_mailbox_post(kn_mailbox *box)
{
    box->back = atomic_exchange_explicit(&box->shared, box->back | UNSEEN, memory_order_acq_rel) & SLOT;
}

bool kn_mailbox_unseen(const kn_mailbox *box)
{
    return atomic_load_explicit(&box->shared, memory_order_relaxed) & UNSEEN;
}

const void *kn_mailbox_latest(kn_mailbox *box, bool *fresh)
{
    *fresh = kn_mailbox_unseen(box);
    // Trade slots only for an unseen value; otherwise the last one stays in front.
    if (*fresh) box->front = atomic_exchange_explicit(&box->shared, box->front, memory_order_acq_rel) & SLOT;
    return box->slot[box->front];
}
