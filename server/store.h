#ifndef KN_SERVER_STORE_H
#define KN_SERVER_STORE_H
// A store: a directory of snapshots, one file per generation. The last KN_STORE_KEPT files and all read-only files are
// kept. A file name looks like this:
//
//     dough.1f0c9a7e.00000012.knead
//
// Generations count up. An operator's snapshots have the multiples of KN_STORE_OWN, so they are the operator's snapshots 1,
// 2, 3 ... The server's own follow by ones: 2000000005 is the server's fifth snapshot after the operator's second.
// The parts of the name are the scene, a hash of its lattice, material and knead's version, and the generation. Scene
// and hash name a series. Files of another series are never read as if they belonged to this one, and never removed.
//
//     .tmp  write .. write  fdatasync  close  rename  fsync(directory)  remove the oldest
//
// With this order, the newest whole file is at every moment either the previous one or the new one, even after a power
// cut. A store is locked, because two daemons that write alternately would each restore the other's object. Not
// real-time: a save takes 5 ms and more.
#include "server/snapshot_file.h"
#include <stdatomic.h>
#include <stdio.h>
#include <sys/types.h>

#define KN_STORE_OWN INT64_C(1000000000)
#define KN_STORE_KEPT 8 // number of latest files that are kept
#define KN_STORE_PINS 4 // number of latest restored files that are kept in addition; must be below KN_STORE_KEPT
// Largest number of read-only snapshot files of a scene. Operators save such files. When a scene has this many, an
// operator's next snapshot is refused until the owner of the directory deletes an old file.
#define KN_STORE_STAY 100

// The system calls of a save or a load, so that a test can make any of them fail. They behave like the system's calls,
// which kn_files_system holds; `dir` is a directory descriptor, as in openat.
typedef struct kn_files {
    int (*open)(int dir, const char *name, int flags, mode_t mode);
    ssize_t (*read)(int fd, void *bytes, size_t size);
    ssize_t (*write)(int fd, const void *bytes, size_t size);
    int (*sync)(int fd); // write a file's data to disk, without its metadata (fdatasync)
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
    const kn_files *files; // system calls; tests replace them
    const kn_scene *scene; // scene and model of the latest save; before the first save, those of the server's start
    const kn_model *model;
    // Text hash of `scene`; a pointer alone does not identify a scene, because a later scene may reuse its address.
    uint64_t text_hash;
    const char *path;   // path of the directory, as given by the caller
    int dir;            // descriptor of the directory, locked; -1: not open
    char series[96];    // first part of the file names, for example "dough.1f0c9a7e"
    int64_t generation; // highest generation of all files of the scene, in any series; 0: no file
    // Latest files that may be removed, oldest first. They may belong to several series, because a change of settings
    // may begin another series.
    kn_kept_file kept[KN_STORE_KEPT];
    int kept_count;
    // Latest restored generations; their files are kept so that a replay can use them.
    _Atomic int64_t pin[KN_STORE_PINS];
    atomic_int pins;
    uint8_t *bytes; // buffer for one file, `room` bytes
    size_t room;
} kn_store;

// Open and lock a directory. The directory must belong to the user of this process, and must not be writable by
// everybody. Remove the remains of an interrupted save, and the oldest generations. Borrows path, scene and model.
// Return 0 on success. Otherwise put one line in error and return an exit code: 2 if the directory does not exist or is
// not suitable, 3 if another daemon uses it, if memory is short or if a system call fails.
int kn_store_open(kn_store *store, const char *path, const kn_scene *scene, const kn_model *model, char *error,
                  size_t error_size);
void kn_store_close(kn_store *store); // a store that was never opened is allowed if its dir is -1

// Read the settings of the newest whole snapshot of this scene; the snapshot may have any lattice. The settings are
// empty if there is no snapshot. Call this function before kn_store_open, with the same path. kn_store_open reports a
// bad directory; this function does not.
void kn_store_settings(const char *path, const kn_scene *scene, kn_settings *settings);

// Save a snapshot as the next generation. `saved`: filled in as for kn_saved_encode, but without the generation. Scene
// and model of saved->servo may differ from those of the last save; the file may then begin another series. `stays`:
// make the file read-only, so that only its owner removes it (an operator's snapshot). On failure return false and put
// the reason in `why`; older files are still there, and the next save may succeed.
bool kn_store_save(kn_store *store, kn_saved *saved, bool stays, char *why, size_t why_size);

// Keep the file of a restored generation until KN_STORE_PINS other generations have been restored. Any thread may call
// this.
void kn_store_pin(kn_store *store, int64_t generation);

// Load the newest snapshot that fits the scene and model of saved->servo. `saved`: prepared as for kn_saved_decode.
// `generation`: load only the snapshot of this generation; 0: the newest. `told`: receives one line for each newer
// snapshot that was refused; may be NULL. `name`: receives the file name, 256 bytes. Return false if no snapshot fits;
// `why` is then the reason why the last snapshot was refused, or "none" if there was no snapshot at all. Another thread
// may be saving.
bool kn_store_load(const kn_store *store, int64_t generation, kn_saved *saved, char *name, FILE *told, char *why,
                   size_t why_size);

// Return whether an emergency stop is in force. The stop is stored as an empty file `estop`, so that it outlives the
// process. If the directory cannot be searched for the file, return true.
bool kn_store_estopped(const kn_store *store);
// Create or remove the file `estop`. The change is on disk when this function returns. On failure return false and put
// the reason in `why`; the file may then exist or not at the next start.
bool kn_store_estop(const kn_store *store, bool stands, char *why, size_t why_size);

typedef bool (*kn_store_look)(void *arg, const kn_saved *saved);

// For replays: pass every snapshot that fits scene and model to `look`, by ascending generation, until `look` returns
// true. `path`: a directory, or one file. Takes no lock. Return whether `look` has returned true. If not, `why` is the
// reason why the last snapshot did not fit, or "another state" if it fitted but `look` returned false.
bool kn_store_browse(const char *path, const kn_scene *scene, const kn_model *model, kn_saved *saved,
                     kn_store_look look, void *look_arg, char *why, size_t why_size);

#endif
