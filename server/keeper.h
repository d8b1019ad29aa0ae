#ifndef KN_SERVER_KEEPER_H
#define KN_SERVER_KEEPER_H
// Keeper of the object's state, so that it survives a restart. This module holds the thread that writes snapshots, the
// slots in which the servo leaves copies for that thread, and the functions for an operator.
//
//     servo thread ---- in what is left of a tick: a copy ----> slot, slot ----> keeper thread ----> store (files)
//        ^  ^
//        |  +-- kn_tick_in.restore <---- incoming <---- kn_keeper_restore: a file, read by the operator's thread
//        +----- kn_tick_in.undo    <------------------- kn_keeper_undo
//
// Every KN_KEEPER_TICKS ticks, the servo compares the object with the last copy that it made. This happens midway
// between two copies for the energy audit. It makes a new copy if a node has moved by KN_KEEPER_MOVED_M, or if the
// strain of an edge has changed by KN_KEEPER_MOVED_M divided by the node spacing. Dough that is left alone never rests:
// it moves 30 um in half a second after a press, 1 um after a minute, 0.1 um after ten. Such an object is therefore
// written less and less often, and a crash loses less than a micron of an object that nobody touched. The servo takes
// no lock and makes no system call to leave a copy. A slot belongs to the servo until the slot is full, and then to the
// keeper thread until the slot is free again. If the disk is slow or a save fails, the next copy is saved instead.
#include "server/clock.h"
#include "server/operator_orders.h"
#include "server/store.h"
#include <pthread.h>

#define KN_KEEPER_TICKS 500
#define KN_KEEPER_MOVED_M 1e-6
// Longest wait for an answer, ms; after that time the disk or the servo is assumed to hang.
#define KN_KEEPER_PATIENCE_MS 2000

// Slot: memory for one copy of the object, which the servo fills and the keeper thread writes to a file.
typedef struct kn_kept {
    kn_saved saved;
    int64_t now_ns; // time at which the copy was made (CLOCK_MONOTONIC, ns)
    int64_t asked;  // number of the kn_keeper_snapshot request that this copy answers
    _Atomic(const kn_model *) of;
    atomic_bool full; // true: the slot belongs to the keeper thread; false: to the servo
    atomic_bool saved_whole;
} kn_kept;

typedef struct kn_answer { // answer to an operator's snapshot, copy, restore or undo
    bool ok;
    int64_t generation;  // generation (number) of the snapshot file; 0: the answer to an undo
    int64_t tick;        // tick of the snapshot; for undo and restore, the tick that replaced the object
    uint64_t state_hash; // hash of the state that was saved or restored
    char error[200];     // reason of the failure, one line; set only if `ok` is false
} kn_answer;

typedef struct kn_keeper {
    const kn_model *model;
    kn_store store; // snapshot directory; its dir is -1 if there is no directory, and then nothing is saved or restored
    kn_undo undo;
    kn_kept slot[2];
    int last; // index of the slot that holds the servo's last copy; used by the servo only
    // Text hash of the scene in the servo's last copy; kept here because the keeper thread changes the slot's own field
    uint64_t last_hash;
    // Number of the interval of KN_KEEPER_TICKS ticks in which the object was last compared with its copy.
    int64_t looked;
    int64_t asked_served;
    bool due;
    kn_saved outgoing;      // copy of the object for kn_keeper_copy
    atomic_bool copying;    // true: the next tick fills `outgoing`
    kn_saved incoming;      // snapshot that the next restore uses
    int64_t incoming_order; // number of the order (kn_orders_give) that restores `incoming`; 0: none
    _Atomic int64_t asked;  // number of snapshots that operators have requested
    atomic_bool again;      // true if the last save failed, so the object must be saved again
    // Last time at which the newest file equalled the object (CLOCK_MONOTONIC, ns); 0: no file.
    _Atomic int64_t as_of_ns;
    _Atomic int64_t saves, errors, last_us, most_us;
    _Atomic int64_t generation; // generation of the newest file; 0: no file
    pthread_mutex_t answering;  // lock between the keeper thread and the operator's thread for the fields below
    kn_answer answer;
    int64_t answered;
    // Lowest bit: 1 if the emergency stop is now in force. Upper bits: number of orders so far to write or remove the
    // emergency-stop mark on disk.
    _Atomic int64_t marks;
    int64_t marked;     // last value of `marks` that the keeper thread has written to disk; guarded by `answering`
    char unmarked[200]; // reason why writing the emergency-stop mark failed; "" if it did not fail
    atomic_bool ending;
    char told[200]; // last error message that was printed
    // `told_ns`: time at which `told` was printed; `untold`: number of failed saves since then.
    int64_t told_ns, untold;
} kn_keeper;

// Open a keeper. If `directory` is NULL, nothing is saved, but undo and kn_keeper_copy work. Borrows `scene`, `model`
// and `directory`. Return 0 on success. Otherwise put one line in `error` and return an exit code.
int kn_keeper_open(kn_keeper *keeper, const char *directory, const kn_scene *scene, const kn_model *model, char *error,
                   size_t error_size);
// Close a keeper. A keeper that was never opened is allowed if all its fields are 0 and store.dir is -1.
void kn_keeper_close(kn_keeper *keeper);
size_t kn_keeper_bytes(const kn_model *model, bool saves); // return the size of a keeper's memory, bytes

// Give the servo its undo points, before its first tick. Order the first tick to restore the newest snapshot that fits
// the scene. Print on stdout which snapshot is restored, and on stderr every newer snapshot that was refused.
void kn_keeper_start(kn_keeper *keeper, kn_servo *servo, kn_orders *orders);

// Body of the keeper thread, needed only with a snapshot directory; returns after `ending` is set.
void *kn_keeper_run(void *keeper);
// Save the object at the end, when all threads have ended, unless the newest file already holds this object. Return
// false if it could not be saved.
bool kn_keeper_finish(kn_keeper *keeper, const kn_servo *servo, int64_t tick);

// Leave a copy of the object for the keeper thread if a copy is due. Called by the servo after a tick, when its forces
// have been sent. Real-time safe.
void kn_keeper_tick(kn_keeper *keeper, const kn_servo *servo, const kn_wake *wake, int64_t utime);

// Write to disk whether an emergency stop is in force. Every later start of kneadd follows this mark until the opposite
// is written. Called by a thread other than the keeper thread, before `ending` is set. If the mark was not written
// within KN_KEEPER_PATIENCE_MS, put one line in `why` and return false. Without a directory, do nothing and return
// true.
bool kn_keeper_mark(kn_keeper *keeper, bool estopped, char *why, size_t why_size);

// Return the time since the object last equalled the newest snapshot file, ms; -1: there is no file.
int64_t kn_keeper_age_ms(const kn_keeper *keeper);

// Return true if a copy of an object of this model still waits to be written to disk. Once `model` is no longer served,
// the result cannot change from false to true any more.
bool kn_keeper_writes(const kn_keeper *keeper, const kn_model *model);

// The operator's thread calls the four functions below. Each of them waits at most
// KN_KEEPER_PATIENCE_MS for its answer.
kn_answer kn_keeper_snapshot(kn_keeper *keeper);
// Copy the object of the next tick into a file in memory, which has the form of a snapshot file. On success put a
// descriptor in *fd, which the caller closes; its position is 0. It waits 0.4 s at most.
kn_answer kn_keeper_copy(kn_keeper *keeper, int *fd);
// Restore the snapshot number `generation`; 0: the newest. `scene` and `model`: the scene and the model being served
// now.
kn_answer kn_keeper_restore(kn_keeper *keeper, kn_orders *orders, const kn_scene *scene, const kn_model *model,
                            int64_t generation);
kn_answer kn_keeper_undo(kn_orders *orders);

#endif
