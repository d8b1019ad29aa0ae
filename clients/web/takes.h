#ifndef KN_CLIENTS_TAKES_H
#define KN_CLIENTS_TAKES_H
// Recordings of what a page does: an LCM event log each, as `knead probe --record` writes it, in a folder of this run.
// What comes of them is other programs' work, one at a time: `knead replay --verify --csv`, `knead probe --path`.
//
//     kn_takes_begin -> (a thread: scene, log, until it is told to end or at its bounds; then the path) -> WHOLE
//     kn_takes_verify, kn_takes_play -> (a child process) -> done(arg, number, ok, words)
#include <ev.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_TAKES 6               // are kept; the oldest gives way
#define KN_TAKE_SECONDS 120      // at most,
#define KN_TAKE_BYTES (96 << 20) // and of messages
#define KN_TAKE_SCENE_MS 8000    // that it waits for a scene at most

typedef enum kn_take_state { KN_TAKE_WAITS, KN_TAKE_RUNS, KN_TAKE_WHOLE, KN_TAKE_FAILED, KN_TAKE_EMPTY } kn_take_state;
// WAITS: for the scene, which kneadd tells every second; EMPTY: ended before it ran, and is tidied away

typedef struct kn_take {
    int number;        // 1 and up; 0: free
    _Atomic int state; // kn_take_state; whoever reads WHOLE or FAILED may read the rest
    _Atomic int ms;    // its length so far
    _Atomic int64_t bytes;
    atomic_bool felt; // the log holds a force: a replay can go on from any snapshot taken from now on
    bool csv;         // forces.csv has been made
    char words[200];  // what came of it, "" nothing yet
} kn_take;

typedef struct kn_takes {
    const char *folder, *url; // borrowed
    struct ev_loop *ev;       // the default one, for children
    void (*done)(void *arg, int number, bool ok, const char *words);
    void *arg;
    kn_take take[KN_TAKES];
    // private
    int count;
    kn_take *now; // whose thread runs or has run, NULL: none
    atomic_bool end;
    pthread_t thread;
    char probe[64];
    ev_child child;
    int child_pid, child_of; // 0: none
    bool child_plays, child_stopped;
} kn_takes;

bool kn_takes_begin(kn_takes *takes, const char *probe, char *error, size_t error_size);
// Of that number: its recording, if that waits or runs; the child that verifies or plays it. False: there is neither.
bool kn_takes_end(kn_takes *takes, int number);
bool kn_takes_tidy(kn_takes *takes);                 // an EMPTY one goes; whether there was one
kn_take *kn_takes_find(kn_takes *takes, int number); // that is whole, or NULL
bool kn_takes_busy(const kn_takes *takes);           // a take runs
// snapshots: kneadd's --state-dir, NULL: none, for a take that began on a kneaded object. Makes forces.csv, too.
bool kn_takes_verify(kn_takes *takes, int number, const char *snapshots, char *error, size_t error_size);
bool kn_takes_play(kn_takes *takes, int number, const char *probe, char *error, size_t error_size);
// kind: "lcmlog", "csv" (forces), "path" (poses, as knead probe --path takes them).
void kn_takes_path(const kn_takes *takes, int number, const char *kind, char path[128]);
void kn_takes_close(kn_takes *takes); // removes all of it

#endif
