#ifndef KN_SERVER_RT_H
#define KN_SERVER_RT_H
// Real-time priority and locked memory. kneadd requests both, and reports which of them the machine refuses.
//
//     thread     policy          why
//     servo      SCHED_FIFO 80   a tick must start within the millisecond
//     sentinel   SCHED_FIFO 79   one below the servo, on its core: sees stalls, never delays a tick
//     main       SCHED_FIFO 70   receives poses, publishes forces
//     helper     SCHED_FIFO 60   a part of each loop of a step, if the scene asks for two threads (team.h)
//     mesh       normal          meshes may be late
//     control    normal          an operator's requests
//     worker     normal          the requests that wait for the disk
//     keeper     normal          snapshots
//     circuit    normal          brings a lost circuit back into step (backend/fpga.h)
//
// The processor's modes flush-to-zero and denormals-are-zero stay off, because replay, tests and the circuit's twin
// (the same computation on this processor) must get the same bits. The kernels of core avoid denormals by themselves.
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

typedef enum kn_rt_mode {
    KN_RT_AUTO,    // use the priorities and the memory lock that the machine grants, and report those that it refuses
    KN_RT_REQUIRE, // start only if the machine grants real-time priorities and locked memory
    KN_RT_OFF      // normal priority, memory not locked
} kn_rt_mode;

enum { KN_RT_NORMAL = 0, KN_RT_HELPER = 60, KN_RT_MAIN = 70, KN_RT_SENTINEL = 79, KN_RT_SERVO = 80 };

typedef enum kn_rt_cpu { // processor of a thread
    KN_RT_CPU_ANY,
    KN_RT_CPU_SERVO, // the last one that the process may use: most interrupts and kernel work run on the first
    KN_RT_CPU_HELPER // the one before the servo's
} kn_rt_cpu;

typedef struct kn_rt {
    kn_rt_mode mode;
    bool fifo;         // true if the machine granted the real-time priorities
    bool locked;       // true if memory is locked
    char missing[256]; // requests that the machine refused, each with its reason and remedy; "" if none was refused
} kn_rt;

// Check at the start that the process can open as many files as its buses, sockets and libraries need. liblcm and libev
// hang or abort when they cannot open a file. On failure return false and put one line in error.
bool kn_rt_files(char *error, size_t error_size);

// Return the time of a kernel clock, ns. CLOCK_THREAD_CPUTIME_ID gives the processor time of the calling thread.
int64_t kn_rt_clock_ns(clockid_t clock);

// Give the calling thread the real-time priority KN_RT_MAIN, if the machine grants priorities up to KN_RT_SERVO. Call
// this function before creating threads.
void kn_rt_enter(kn_rt *rt, kn_rt_mode mode);
void kn_rt_leave(const kn_rt *rt); // undo kn_rt_enter, when the other threads have ended or sleep

// Create a thread with all signals blocked and a small stack, whose pages are mapped before `run` is called. `name`:
// shown by ps and top -H, <= 15 bytes. Return pthread_create's error.
int kn_rt_thread(const kn_rt *rt, pthread_t *thread, const char *name, int priority, kn_rt_cpu cpu,
                 void *(*run)(void *), void *arg);
// Move the calling thread to a processor, or with KN_RT_CPU_ANY back to all that it could use before. It stays where it
// is if the kernel refuses. kn_rt_move and kn_rt_raise are system calls, not for a tick.
void kn_rt_move(kn_rt_cpu cpu);
// Give a thread the real-time priority `priority`, if the machine grants it.
void kn_rt_raise(const kn_rt *rt, pthread_t thread, int priority);

// Lock all memory that is mapped now. If RLIMIT_MEMLOCK is unlimited, also lock memory that is mapped later; under a
// limit, every later mmap could then fail. Sanitizer builds never lock, since their shadow memory is terabytes. Call
// this function after all allocations and thread creations.
void kn_rt_lock_memory(kn_rt *rt);
// Lock memory allocated after kn_rt_lock_memory, if memory is locked; any thread may call this.
void kn_rt_lock_more(const kn_rt *rt);

#endif
