#ifndef KN_SERVER_KEEPER_H
#define KN_SERVER_KEEPER_H
// State that survives: the thread that writes snapshots, what the servo leaves for it, and what an operator may ask.
//
//     servo thread ---- in what is left of a tick: a copy ----> slot, slot ----> keeper thread ----> store (files)
//        ^  ^
//        |  +-- kn_tick_in.restore <---- incoming <---- kn_keeper_restore: a file, read by the operator's thread
//        +----- kn_tick_in.undo    <------------------- kn_keeper_undo
//
// Every KN_KEEPER_TICKS ticks, between two copies of the audit, the servo compares the object with its last copy and
// copies it when a node has moved by KN_KEEPER_MOVED_M, or the strain of an edge by as much over the spacing. Dough
// that is left alone never rests: 30 um in half a second after a press, 1 um after a minute, 0.1 after ten; so it is
// written ever less often, and what a crash loses is below a micron of what nobody touched. The servo takes no lock and
// makes no call: a slot is its own until it is full, and the thread's until it is free again. When the disk is slow or
// fails, the copy is the next one's.
#include "server/loop.h"
#include "server/store.h"
#include <pthread.h>

#define KN_KEEPER_TICKS 500
#define KN_KEEPER_MOVED_M 1e-6
#define KN_KEEPER_PATIENCE_MS 2000 // for an answer: longer, and the disk or the servo hangs

typedef struct kn_kept { // a slot
    kn_saved saved;
    int64_t now_ns;   // CLOCK_MONOTONIC of the copy
    int64_t asked;    // of kn_keeper_snapshot, that this copy answers
    _Atomic(const kn_model *) of;
    atomic_bool full; // the thread's
    atomic_bool saved_whole;
} kn_kept;

typedef struct kn_answer { // to an operator
    bool ok;
    int64_t generation;  // of the file; 0: undone
    int64_t tick;        // of the snapshot; of undo and restore that which made it
    uint64_t state_hash; // of the object as saved or restored
    char error[200];     // one line, when not ok
} kn_answer;

typedef struct kn_keeper {
    const kn_model *model;
    kn_store store; // dir -1: no directory, nothing is saved or restored
    kn_undo undo;
    kn_kept slot[2];
    int last;       // the servo's: the slot of its last copy
    uint64_t last_hash; // of the scene it was of; the thread writes the slot's own
    int64_t looked; // number of the last look, tick / KN_KEEPER_TICKS
    int64_t asked_served;
    bool due;
    kn_saved incoming;        // what a restore is from
    int64_t incoming_order;   // that took it, 0: none
    _Atomic int64_t asked;    // snapshots that were asked for
    atomic_bool again;        // the last one failed
    _Atomic int64_t as_of_ns; // the newest file is the object as it was then; 0: there is none
    _Atomic int64_t saves, errors, last_us, most_us;
    _Atomic int64_t generation; // of the newest file, 0: there is none
    pthread_mutex_t answering; // between thread and operator
    kn_answer answer;
    int64_t answered;
    _Atomic int64_t marks; // how often an operator has said whether an emergency stop stands << 1, and what at last
    int64_t marked;        // of these, by the thread; as answer
    char unmarked[200];    // why that could not be done, "" it could
    atomic_bool ending;
    char told[200]; // the last complaint
    int64_t told_ns, untold; // errors since
} kn_keeper;

// directory: NULL: nothing is saved, undo works. Borrows all. 0, or exit code and one line in error.
int kn_keeper_open(kn_keeper *keeper, const char *directory, const kn_scene *scene, const kn_model *model, char *error,
                   size_t error_size);
void kn_keeper_close(kn_keeper *keeper);                   // one that is all 0 but for store.dir -1 is fine
size_t kn_keeper_bytes(const kn_model *model, bool saves); // memory that it takes

// Before the loop runs: binds both, and orders the newest snapshot that fits into its first tick. Tells on stdout what
// is restored, on stderr every newer one that was refused.
void kn_keeper_start(kn_keeper *keeper, kn_loop *loop);

void *kn_keeper_run(void *keeper); // thread body, when there is a directory; ends after `ending`
// When all threads have ended: the object as it is, if the newest file is not that. False: it could not be saved.
bool kn_keeper_finish(kn_keeper *keeper, const kn_servo *servo, int64_t tick);

// The servo's: after a tick, its forces gone. Real-time safe.
void kn_keeper_tick(kn_keeper *keeper, const kn_servo *servo, const kn_wake *wake, int64_t utime);

// Another thread, before `ending`: that an emergency stop stands, or does no more, is on disk when this returns, for
// every start until the opposite is said. False and one line in why: not within KN_KEEPER_PATIENCE_MS. Without a
// directory there is nothing to do.
bool kn_keeper_mark(kn_keeper *keeper, bool estopped, char *why, size_t why_size);

// ms since the newest file was the object as it is; -1: there is none.
int64_t kn_keeper_age_ms(const kn_keeper *keeper);

// Whether a copy of an object of that model waits for the disk. Of a model that is not served any more: false stays.
bool kn_keeper_writes(const kn_keeper *keeper, const kn_model *model);

// The operator's thread: each waits KN_KEEPER_PATIENCE_MS at most. generation 0: the newest.
kn_answer kn_keeper_snapshot(kn_keeper *keeper);
// scene, model: as they are served now.
kn_answer kn_keeper_restore(kn_keeper *keeper, kn_loop *loop, const kn_scene *scene, const kn_model *model,
                            int64_t generation);
kn_answer kn_keeper_undo(kn_keeper *keeper, kn_loop *loop);

#endif
