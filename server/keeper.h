#ifndef KN_SERVER_KEEPER_H
#define KN_SERVER_KEEPER_H
// State that survives a restart: the thread that writes snapshots, the copies that the servo leaves for it, and the
// functions for an operator.
//
//     servo thread ---- in what is left of a tick: a copy ----> slot, slot ----> keeper thread ----> store (files)
//        ^  ^
//        |  +-- kn_tick_in.restore <---- incoming <---- kn_keeper_restore: a file, read by the operator's thread
//        +----- kn_tick_in.undo    <------------------- kn_keeper_undo
//
// Every KN_KEEPER_TICKS ticks, between two copies of the audit, the servo compares the object with its last copy. It
// makes a new copy if a node has moved by KN_KEEPER_MOVED_M, or if the strain of an edge has changed by that length
// over the spacing. Dough that is left alone never rests: it moves 30 um in half a second after a press, 1 um after a
// minute, 0.1 um after ten. It is therefore written ever less often, and a crash loses less than a micron of an object
// that nobody touched. The servo takes no lock and makes no system call for this. A slot belongs to the servo until it
// is full, and to the thread until it is free again. If the disk is slow or fails, the next copy is written instead.
#include "server/loop.h"
#include "server/store.h"
#include <pthread.h>

#define KN_KEEPER_TICKS 500
#define KN_KEEPER_MOVED_M 1e-6
#define KN_KEEPER_PATIENCE_MS 2000 // wait for an answer; after that the disk or the servo is taken to hang

typedef struct kn_kept { // a slot
    kn_saved saved;
    int64_t now_ns; // CLOCK_MONOTONIC of the copy
    int64_t asked;  // number of the kn_keeper_snapshot that this copy answers
    _Atomic(const kn_model *) of;
    atomic_bool full; // the slot belongs to the thread
    atomic_bool saved_whole;
} kn_kept;

typedef struct kn_answer { // answer to an operator
    bool ok;
    int64_t generation;  // of the file; 0: an undo
    int64_t tick;        // of the snapshot; for undo and restore, the tick that did it
    uint64_t state_hash; // of the object as saved or restored
    char error[200];     // one line, when not ok
} kn_answer;

typedef struct kn_keeper {
    const kn_model *model;
    kn_store store; // dir -1: no directory; nothing is saved or restored
    kn_undo undo;
    kn_kept slot[2];
    int last;           // the servo's: the slot of its last copy
    uint64_t last_hash; // hash of that copy's scene; the thread writes the slot's own
    int64_t looked;     // number of the last comparison, tick / KN_KEEPER_TICKS
    int64_t asked_served;
    bool due;
    kn_saved incoming;        // snapshot that a restore uses
    int64_t incoming_order;   // order that uses it, 0: none
    _Atomic int64_t asked;    // snapshots asked for
    atomic_bool again;        // the last save failed
    _Atomic int64_t as_of_ns; // last time at which the newest file was the object as it is; 0: no file
    _Atomic int64_t saves, errors, last_us, most_us;
    _Atomic int64_t generation; // of the newest file, 0: no file
    pthread_mutex_t answering;  // lock of thread and operator for the answers
    kn_answer answer;
    int64_t answered;
    _Atomic int64_t marks; // 2 x number of orders about the emergency stop, + 1 if it stands now
    int64_t marked;        // the last of these that the thread has done; under answering
    char unmarked[200];    // why it failed, "" if it did not
    atomic_bool ending;
    char told[200];          // the last complaint
    int64_t told_ns, untold; // untold: errors since then
} kn_keeper;

// Open a keeper. directory NULL: nothing is saved, but undo works. Borrows scene, model and directory. Return 0, or an
// exit code with one line in error.
int kn_keeper_open(kn_keeper *keeper, const char *directory, const kn_scene *scene, const kn_model *model, char *error,
                   size_t error_size);
void kn_keeper_close(kn_keeper *keeper);                   // a keeper that is all 0 except store.dir -1 is allowed
size_t kn_keeper_bytes(const kn_model *model, bool saves); // memory that a keeper takes

// Connect keeper and loop before the loop runs, and order the newest snapshot that fits into the first tick. Print on
// stdout which one is restored, and on stderr every newer one that was refused.
void kn_keeper_start(kn_keeper *keeper, kn_loop *loop);

void *kn_keeper_run(void *keeper); // thread body if there is a directory; returns after `ending`
// Save the object at the end, when all threads have ended, unless the newest file already is that object. Return false
// if it could not be saved.
bool kn_keeper_finish(kn_keeper *keeper, const kn_servo *servo, int64_t tick);

// Leave a copy for the thread if one is due. Called by the servo after a tick, when its forces have been sent.
// Real-time safe.
void kn_keeper_tick(kn_keeper *keeper, const kn_servo *servo, const kn_wake *wake, int64_t utime);

// Write to disk that an emergency stop stands, or no longer stands. The mark holds for every start until the opposite
// is written. Called by another thread before `ending`. Return false, with one line in why, if it was not written
// within KN_KEEPER_PATIENCE_MS. Without a directory there is nothing to do.
bool kn_keeper_mark(kn_keeper *keeper, bool estopped, char *why, size_t why_size);

// Return the ms since the newest file was the object as it is; -1: there is no file.
int64_t kn_keeper_age_ms(const kn_keeper *keeper);

// Return true if a copy of an object of that model waits for the disk. For a model that is no longer served, false
// stays false.
bool kn_keeper_writes(const kn_keeper *keeper, const kn_model *model);

// Functions for the operator's thread; each waits at most KN_KEEPER_PATIENCE_MS. generation 0: the newest.
kn_answer kn_keeper_snapshot(kn_keeper *keeper);
// scene, model: those served now.
kn_answer kn_keeper_restore(kn_keeper *keeper, kn_loop *loop, const kn_scene *scene, const kn_model *model,
                            int64_t generation);
kn_answer kn_keeper_undo(kn_keeper *keeper, kn_loop *loop);

#endif
