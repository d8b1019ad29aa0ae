#ifndef KN_CLIENTS_TAKES_H
#define KN_CLIENTS_TAKES_H
// Takes: recordings of the session of a page. Each recording is an LCM event log, as `knead probe --record` writes it,
// in a folder of this run. Child processes verify a recording (`knead replay --verify --csv`) or play it (`knead probe
// --path`), one at a time.
//
//     kn_takes_begin -> (a thread waits for the scene, writes the log until the end or a limit, then the path) -> WHOLE
//     kn_takes_verify, kn_takes_play -> (a child process) -> done(arg, number, ok, words)
#include <ev.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_TAKES 6               // most recordings kept; a further recording replaces the oldest one
#define KN_TAKE_SECONDS 120      // longest duration of a recording, s
#define KN_TAKE_BYTES (96 << 20) // largest size of a recording, bytes of messages
#define KN_TAKE_SCENE_MS 8000    // longest wait for the scene message that begins a recording

// WAITS: waiting for the scene, which kneadd sends every second. RUNS: recording. WHOLE: complete. EMPTY: ended before
// recording began; kn_takes_tidy removes this recording.
typedef enum kn_take_state { KN_TAKE_WAITS, KN_TAKE_RUNS, KN_TAKE_WHOLE, KN_TAKE_FAILED, KN_TAKE_EMPTY } kn_take_state;

typedef struct kn_take {
    int number; // number of the recording, from 1 on; 0: this place for a recording is free
    // A kn_take_state. Once the state is WHOLE or FAILED, another thread may also read the fields that are not atomic.
    _Atomic int state;
    _Atomic int ms; // duration of the recording so far
    _Atomic int64_t bytes;
    // True: the log contains a force, so a replay can start from any snapshot that is saved from now on.
    atomic_bool felt;
    bool csv;        // true: the CSV file with the forces exists
    char words[200]; // outcome of the recording or of its verification in words; "": none yet
} kn_take;

typedef struct kn_takes {
    const char *folder, *url; // texts of the caller; they must outlive `takes`
    struct ev_loop *ev;       // libev's default loop; no other loop can watch child processes
    void (*done)(void *arg, int number, bool ok, const char *words);
    void *arg;
    kn_take take[KN_TAKES];
    // private
    int count;
    kn_take *now; // recording whose thread must still be joined; NULL: none
    atomic_bool end;
    pthread_t thread;
    char probe[64];
    ev_child child;
    int child_pid, child_of; // id of the child process, and number of the recording that it uses; 0: no child process
    bool child_plays, child_stopped;
} kn_takes;

// Begin a recording of the probe's messages. On failure return false and one line in `error`.
bool kn_takes_begin(kn_takes *takes, const char *probe, char *error, size_t error_size);
// End the recording with this number if its state is WAITS or RUNS. Otherwise end the child process that verifies or
// plays the recording. Return false if neither exists.
bool kn_takes_end(kn_takes *takes, int number);
// Removes a recording in state EMPTY; returns true if one was removed.
bool kn_takes_tidy(kn_takes *takes);
kn_take *kn_takes_find(kn_takes *takes, int number); // returns a recording that is WHOLE, or NULL
bool kn_takes_busy(const kn_takes *takes);           // returns true if a recording is in state WAITS or RUNS
// Verify a recording in a child process, and write its forces as CSV. snapshots: kneadd's --state-dir; NULL: none. The
// snapshots are needed if the recording began on a deformed object.
bool kn_takes_verify(kn_takes *takes, int number, const char *snapshots, char *error, size_t error_size);
// Play the poses of a recording in a child process.
bool kn_takes_play(kn_takes *takes, int number, const char *probe, char *error, size_t error_size);
// Get the path of a recording's file. kind: "lcmlog", "csv" (forces), "path" (poses, as knead probe --path takes them).
void kn_takes_path(const kn_takes *takes, int number, const char *kind, char path[128]);
void kn_takes_close(kn_takes *takes); // ends all work and removes all recordings with their files

#endif
