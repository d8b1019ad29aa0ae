#include "server/team.h"
#include <errno.h>
#include <sched.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// LINE: bytes of a cache line. LEAST_VECTORS: with fewer, some 700 nodes, two threads took as long as one.
enum { LINE = 64, LEAST_VECTORS = 64 };

// A cache line takes up to 0.2 us from one processor to the other, so what is read together is in one line.
struct kn_helper {
    kn_team team; // must be first
    pthread_t thread;
    sem_t called;
    atomic_bool awake, leave;
    _Alignas(LINE) _Atomic uint64_t turn; // odd: part 1 of the present loop is not claimed
    kn_team_work *work;
    void *job;
    _Alignas(LINE) _Atomic uint64_t done;  // value of `turn` with which the helper did its last part
    _Alignas(LINE) _Atomic int64_t helped; // number of parts that the helper did
};

// Tell the processor that this thread spins.
static void spin(void)
{
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

static void run(kn_team *team, kn_team_work *work, void *job)
{
    kn_helper *h = (kn_helper *)team;
    uint64_t open = atomic_load_explicit(&h->turn, memory_order_relaxed) + 1;
    h->work = work;
    h->job = job;
    atomic_store_explicit(&h->turn, open, memory_order_release);
    work(job, 0);
    const uint64_t claimed = open + 1;
    if (atomic_load_explicit(&h->done, memory_order_acquire) == claimed) return;
    if (atomic_compare_exchange_strong(&h->turn, &open, claimed)) {
        work(job, 1);
        return;
    }
    while (atomic_load_explicit(&h->done, memory_order_acquire) != claimed) spin();
}

// Do all parts that are open until the tick ends.
static void help(kn_helper *h)
{
    while (atomic_load_explicit(&h->awake, memory_order_relaxed)) {
        uint64_t open = atomic_load_explicit(&h->turn, memory_order_relaxed);
        if (open % 2 == 0 || !atomic_compare_exchange_strong(&h->turn, &open, open + 1)) {
            spin();
            continue;
        }
        h->work(h->job, 1);
        atomic_store_explicit(&h->done, open + 1, memory_order_release);
        atomic_fetch_add_explicit(&h->helped, 1, memory_order_relaxed);
    }
}

static void *helper_main(void *helper)
{
    kn_helper *h = helper;
    for (;;) {
        while (sem_wait(&h->called) != 0) continue; // interrupted
        if (atomic_load_explicit(&h->leave, memory_order_relaxed)) return NULL;
        help(h);
    }
}

kn_helper *kn_helper_create(char *why, size_t why_size)
{
    cpu_set_t may;
    if (sched_getaffinity(0, sizeof may, &may) == 0 && CPU_COUNT(&may) < 2)
        return snprintf(why, why_size, "only one processor"), NULL;
    kn_helper *h = aligned_alloc(LINE, sizeof *h);
    if (h) memset(h, 0, sizeof *h);
    if (h) h->team = (kn_team){run, LEAST_VECTORS};
    if (h) sem_init(&h->called, 0, 0);
    const kn_rt rt = {0};
    const int error = h ? kn_rt_thread(&rt, &h->thread, "helper", 0, KN_RT_CPU_HELPER, helper_main, h) : ENOMEM;
    if (!error) return h;
    snprintf(why, why_size, "%s", strerror(error));
    if (h) sem_destroy(&h->called);
    free(h);
    return NULL;
}

void kn_helper_raise(kn_helper *helper, const kn_rt *rt)
{
    if (helper) kn_rt_raise(rt, helper->thread, KN_RT_HELPER);
}

void kn_helper_destroy(kn_helper *helper)
{
    if (!helper) return;
    kn_helper_rest(helper);
    atomic_store(&helper->leave, true);
    sem_post(&helper->called);
    pthread_join(helper->thread, NULL);
    sem_destroy(&helper->called);
    free(helper);
}

kn_team *kn_helper_wake(kn_helper *helper)
{
    if (!helper) return NULL;
    atomic_store_explicit(&helper->awake, true, memory_order_relaxed);
    sem_post(&helper->called);
    return &helper->team;
}

bool kn_helper_join(kn_helper *helper, kn_backend *backend, const kn_model *model)
{
    // a backend lends its scratch for reading; the team is the one thing that is set in it from outside
    return kn_scratch_team(model, (kn_scratch *)backend->scratch(backend->self), helper ? &helper->team : NULL);
}

void kn_helper_rest(kn_helper *helper)
{
    if (helper) atomic_store_explicit(&helper->awake, false, memory_order_relaxed);
}

double kn_helper_share(const kn_helper *helper)
{
    const double loops = helper ? (double)(atomic_load(&helper->turn) / 2) : 0;
    return loops > 0 ? (double)atomic_load(&helper->helped) / loops : 0;
}
