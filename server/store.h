#ifndef KN_SERVER_STORE_H
#define KN_SERVER_STORE_H
// A directory of snapshots, a file per generation, of which the last KN_STORE_KEPT stay, and those that are read-only:
//
//     dough.1f0c9a7e.00000012.knead
//
// scene, a hash of what its lattice is made of and of knead's version, generation. Another lattice or version is
// another series: it is never read as ours, and never removed by us.
//
//     .tmp  write .. write  fdatasync  close  rename  fsync(directory)  remove the oldest
//
// so that at every moment, a power cut included, the newest whole file is the one before or the new one. A store is
// locked: two daemons that write alternately would each restore the other's object. Not real-time: a save takes 5 ms
// and more.
#include "server/snapshot.h"
#include <stdatomic.h>
#include <stdio.h>
#include <sys/types.h>

#define KN_STORE_KEPT 8
#define KN_STORE_PINS 4
#define KN_STORE_STAY 100 // read-only ones of a scene: more are refused until their owner has removed some

// Every call that a save or a load makes of the disk, so that a test can have any of them fail. As the system's, which
// kn_files_system are; dir: of openat.
typedef struct kn_files {
    int (*open)(int dir, const char *name, int flags, mode_t mode);
    ssize_t (*read)(int fd, void *bytes, size_t size);
    ssize_t (*write)(int fd, const void *bytes, size_t size);
    int (*sync)(int fd); // its data
    int (*close)(int fd);
    int (*rename)(int dir, const char *from, const char *to);
    int (*sync_dir)(int dir);
    int (*unlink)(int dir, const char *name);
} kn_files;
extern const kn_files kn_files_system;

typedef struct kn_kept_file {
    int64_t generation;
    char series[96];
} kn_kept_file;

typedef struct kn_store {
    const kn_files *files; // replaced by tests
    const kn_scene *scene; // of the series that was saved last, as model
    const kn_model *model;
    uint64_t text_hash;               // of that scene: what it points at comes and goes
    const char *path;                 // of the directory, as given
    int dir;                          // locked; -1: not open
    char series[96];                  // "dough.1f0c9a7e"
    int64_t generation;               // the highest of the scene, of any series; 0: none
    kn_kept_file kept[KN_STORE_KEPT]; // ours, ascending: of one series at the start, of each that something was set to
    int kept_count;
    _Atomic int64_t pin[KN_STORE_PINS]; // restored last: they stay while the store is open, for whoever replays the log
    atomic_int pins;
    uint8_t *bytes; // of one file
    size_t room;
} kn_store;

// Borrows all. Expects a directory of ours that not everybody may write to; takes the lock, removes what a save that
// was cut off has left, and generations beyond the last. 0, or an exit code and one line in error: 2 no such directory
// or not ours, 3 another daemon's or the machine refuses.
int kn_store_open(kn_store *store, const char *path, const kn_scene *scene, const kn_model *model, char *error,
                  size_t error_size);
void kn_store_close(kn_store *store); // one that was not opened is fine when dir is -1

// What was set at run time over the scene of the newest whole snapshot that is of it, whatever its lattice; none when
// there is none. Before the store is open: of its directory, as kn_store_open takes it; says nothing of one that it
// refuses.
void kn_store_sets(const char *path, const kn_scene *scene, kn_sets *sets);

// saved: as kn_saved_encode wants it, but for the generation, which is the next; of the scene and the model that its
// servo has, which may be others than before, and then another series. False and the reason in why: nothing of what
// there was is lost, and the next one can be tried. stays: an operator's, a read-only file, which nobody removes but
// its owner.
bool kn_store_save(kn_store *store, kn_saved *saved, bool stays, char *why, size_t why_size);

// It has been restored: it is not removed before KN_STORE_PINS others have been. Any thread.
void kn_store_pin(kn_store *store, int64_t generation);

// The newest that fits the scene and model of saved's servo, and saved (as kn_saved_decode wants it); told: one line
// for every newer one that was refused, NULL: nobody. generation: that one or none; 0: the newest. name: of its file,
// 256 bytes. False when there is none, and in why what became of the last one looked at, "none" if there was none at
// all. Another thread may be saving.
bool kn_store_load(const kn_store *store, int64_t generation, kn_saved *saved, char *name, FILE *told, char *why,
                   size_t why_size);

// An operator's emergency stop, which outlives the process: an empty file `estop`. Whether one stands there; where that
// cannot be told, too.
bool kn_store_estopped(const kn_store *store);
// Creates or removes it, on disk when this returns. False and the reason in why: either may be there by the next start.
bool kn_store_estop(const kn_store *store, bool stands, char *why, size_t why_size);

typedef bool (*kn_store_look)(void *arg, const kn_saved *saved);

// For replays. Every snapshot in a directory, or the one file, that fits this scene and model, by ascending generation,
// to `look` until it says true; saved and look_arg are handed to it. No lock. What look said at last; in why, when it
// never did, why the last one did not fit: "another state" when nothing but look was against it.
bool kn_store_browse(const char *path, const kn_scene *scene, const kn_model *model, kn_saved *saved,
                     kn_store_look look, void *look_arg, char *why, size_t why_size);

#endif
