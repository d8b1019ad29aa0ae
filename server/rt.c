#include "server/rt.h"
#include <errno.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

// size of a thread's stack, bytes, all locked in memory; a tick needs less than 32 kB, because its arrays are in the
// state
#define STACK_BYTES (512 << 10)
// part of the stack that is touched before the thread runs, bytes, so that a tick has no page fault
#define TOUCHED_BYTES (128 << 10)

bool kn_rt_files(char *error, size_t error_size)
{
    // number of descriptors that must be free; kneadd with every option opens about 20, knead web about 30
    enum { FILES = 56 };
    // open as many descriptors as will be needed, then close them again
    int fd[FILES], count = 0;
    while (count < FILES && (fd[count] = eventfd(0, EFD_CLOEXEC)) >= 0) count++;
    snprintf(error, error_size,
             "%s: only %d more files can be opened, expected %d: raise ulimit -n (in a systemd service: LimitNOFILE=)",
             strerror(errno), count, FILES);
    for (int i = 0; i < count; i++) close(fd[i]);
    return count == FILES;
}

int64_t kn_rt_clock_ns(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

// Add a refused request to rt->missing, with its reason and remedy.
static void add_missing(kn_rt *rt, const char *what, const char *why, const char *cure)
{
    size_t used = strlen(rt->missing);
    snprintf(rt->missing + used, sizeof rt->missing - used, "%s%s (%s%s%s)", used ? "; " : "", what, why,
             *cure ? ": " : "", cure);
}

static int set_priority(int priority)
{
    struct sched_param param = {.sched_priority = priority};
    return pthread_setschedparam(pthread_self(), SCHED_FIFO, &param);
}

void kn_rt_enter(kn_rt *rt, kn_rt_mode mode)
{
    *rt = (kn_rt){.mode = mode};
    if (mode == KN_RT_OFF) return;
    // try the highest priority first, because RLIMIT_RTPRIO may grant only lower priorities
    int error = set_priority(KN_RT_SERVO);
    if (!error) error = set_priority(KN_RT_MAIN);
    rt->fifo = !error;
    if (error) add_missing(rt, "no SCHED_FIFO", strerror(error), "root, CAP_SYS_NICE or ulimit -r 80");
}

void kn_rt_leave(const kn_rt *rt)
{
    if (rt->fifo) pthread_setschedparam(pthread_self(), SCHED_OTHER, &(struct sched_param){0});
}

typedef struct thread_start {
    void *(*run)(void *);
    void *arg;
} thread_start;

// Touch the pages of the stack, so that they are mapped before the first deadline. volatile keeps the compiler from
// removing the writes.
static void touch_stack(void)
{
    volatile char page[TOUCHED_BYTES];
    for (size_t i = 0; i < sizeof page; i += 4096) page[i] = 0;
}

// Body of every thread: touch the thread's stack, then run the caller's function.
static void *thread_main(void *memory)
{
    thread_start start = *(thread_start *)memory;
    free(memory);
    touch_stack();
    return start.run(start.arg);
}

// Put the one processor `where`, of those that the calling thread may use, into a set. Return false if there is none.
static bool one_of(kn_rt_cpu where, cpu_set_t *one)
{
    cpu_set_t may;
    int left = (int)where;
    if (where == KN_RT_CPU_ANY || sched_getaffinity(0, sizeof may, &may) != 0) return false;
    CPU_ZERO(one);
    for (size_t cpu = CPU_SETSIZE; cpu-- > 0 && left > 0;)
        if (CPU_ISSET(cpu, &may) && --left == 0) CPU_SET(cpu, one);
    return left == 0;
}

void kn_rt_move(kn_rt_cpu cpu)
{
    static _Thread_local cpu_set_t before, one;
    static _Thread_local bool moved;
    if (moved) sched_setaffinity(0, sizeof before, &before);
    else if (sched_getaffinity(0, sizeof before, &before) != 0) return;
    moved = one_of(cpu, &one) && sched_setaffinity(0, sizeof one, &one) == 0;
}

void kn_rt_raise(const kn_rt *rt, pthread_t thread, int priority)
{
    if (rt->fifo) pthread_setschedparam(thread, SCHED_FIFO, &(struct sched_param){.sched_priority = priority});
}

int kn_rt_thread(const kn_rt *rt, pthread_t *thread, const char *name, int priority, kn_rt_cpu cpu,
                 void *(*run)(void *), void *arg)
{
    bool fifo = rt->fifo && priority != KN_RT_NORMAL;
    struct sched_param param = {.sched_priority = fifo ? priority : 0};
    pthread_attr_t attr;
    thread_start *start = malloc(sizeof *start);
    if (!start) return ENOMEM;
    *start = (thread_start){run, arg};
    pthread_attr_init(&attr);
#ifndef KN_SANITIZED // set the small stack only without sanitizers, which need hundreds of kB of stack themselves
    pthread_attr_setstacksize(&attr, STACK_BYTES);
#endif
    // use the policy and priority set here, not those of the creating thread
    pthread_attr_setinheritsched(&attr, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attr, fifo ? SCHED_FIFO : SCHED_OTHER);
    pthread_attr_setschedparam(&attr, &param);
    cpu_set_t one;
    if (one_of(cpu, &one)) pthread_attr_setaffinity_np(&attr, sizeof one, &one);
    // block all signals, because a new thread inherits the signal mask and only the main thread may receive signals
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = pthread_create(thread, &attr, thread_main, start);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attr);
    if (error) free(start);
    else pthread_setname_np(*thread, name);
    return error;
}

#ifndef KN_SANITIZED
// Lock all present memory. Lock future memory only if RLIMIT_MEMLOCK is unlimited; otherwise a later mmap could fail.
static bool lock_all(void)
{
    struct rlimit limit;
    bool unlimited = getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
    return mlockall(unlimited ? MCL_CURRENT | MCL_FUTURE : MCL_CURRENT) == 0;
}
#endif

void kn_rt_lock_memory(kn_rt *rt)
{
    if (rt->mode == KN_RT_OFF) return;
#ifdef KN_SANITIZED
    add_missing(rt, "memory not locked", "sanitizer build", "");
#else
    rt->locked = lock_all();
    if (!rt->locked) add_missing(rt, "memory not locked", strerror(errno), "root, CAP_IPC_LOCK or ulimit -l unlimited");
#endif
}

void kn_rt_lock_more(const kn_rt *rt)
{
#ifdef KN_SANITIZED
    (void)rt;
#else
    if (rt->locked) lock_all();
#endif
}
