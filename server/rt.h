#ifndef KN_SERVER_RT_H
#define KN_SERVER_RT_H
// Real-time priority and locked memory: asked for, never silently done without.
//
//     thread     policy          why
//     servo      SCHED_FIFO 80   a tick must start within the millisecond
//     sentinel   SCHED_FIFO 79   one below, on the same core: sees the machine's stalls, never delays a tick
//     main       SCHED_FIFO 70   poses in, forces out
//     mesh       normal          may be late
//     control    normal          an operator's lines; worker: those of them that wait for the disk
//     keeper     normal          snapshots
//
// Flush-to-zero and denormals-are-zero stay off: replay, tests and the circuit's twin must get the same bits, and the
// kernels of core keep out of denormals by themselves.
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>

typedef enum kn_rt_mode {
    KN_RT_AUTO,    // what the machine grants; what is missing is said
    KN_RT_REQUIRE, // all of it or nothing
    KN_RT_OFF      // normal priority, memory not locked
} kn_rt_mode;

enum { KN_RT_NORMAL = 0, KN_RT_MAIN = 70, KN_RT_SENTINEL = 79, KN_RT_SERVO = 80 };

typedef struct kn_rt {
    kn_rt_mode mode;
    bool fifo;         // threads get their real-time priority
    bool locked;       // memory is locked
    char missing[256]; // what is not granted, why, and the cure; "" when nothing is missing or wanted
} kn_rt;

// Check at the start that a program can open the files of all its buses, sockets and libraries: liblcm and libev hang or
// abort where one is missing. False and one line in error.
bool kn_rt_files(char *error, size_t error_size);

bool kn_rt_mode_parse(const char *name, kn_rt_mode *mode); // auto, require, off

// Moves the calling thread to KN_RT_MAIN if priorities up to KN_RT_SERVO are granted. Before the threads.
void kn_rt_enter(kn_rt *rt, kn_rt_mode mode);
void kn_rt_leave(const kn_rt *rt); // and back, when they have ended

// A thread with a small stack, touched before run is called, and without signals. pinned: on the last processor we
// may use. name: what ps and top -H show, <= 15 bytes. Returns pthread_create's error.
int kn_rt_thread(const kn_rt *rt, pthread_t *thread, const char *name, int priority, bool pinned, void *(*run)(void *),
                 void *arg);

// Locks what is mapped now, and what will be when memlock is unlimited: below a limit every later mmap could fail
// instead. Sanitizer builds never lock: their shadow memory is terabytes. After all allocations and thread creations.
void kn_rt_lock_memory(kn_rt *rt);
void kn_rt_lock_more(const kn_rt *rt); // what has been allocated since, too. Any thread

#endif
