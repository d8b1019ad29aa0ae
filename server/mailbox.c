#include "server/mailbox.h"

// Bits of `shared`: the number of the slot, and a flag that is set until the reader has seen the slot's value.
enum { SLOT = 3, UNSEEN = 4 };

void kn_mailbox_init(kn_mailbox *box, void *memory, size_t size)
{
    for (int i = 0; i < 3; i++) box->slot[i] = (char *)memory + (size_t)i * size;
    box->back = 0;
    box->front = 2;
    atomic_init(&box->shared, 1);
}

void *kn_mailbox_back(kn_mailbox *box) { return box->slot[box->back]; }

// Release order: the reader that takes this slot sees all bytes that were written into the slot. Acquire order: the
// reader has finished with the slot that the writer gets back.
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
    // Exchange slots only if there is an unseen value; otherwise the reader keeps its present slot.
    if (*fresh) box->front = atomic_exchange_explicit(&box->shared, box->front, memory_order_acq_rel) & SLOT;
    return box->slot[box->front];
}
