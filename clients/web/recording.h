#ifndef KN_CLIENTS_RECORDING_H
#define KN_CLIENTS_RECORDING_H
// Recordings of the session of a page. Each recording is an LCM event log, as `knead probe --record` writes it, in a
// folder of this run. Child processes verify a recording (`knead replay --verify --csv`) or play it (`knead probe
// --path`), one at a time.
//
//     RECORD -> (a thread waits for the scene, writes the log until the end or a limit, then the path) -> WHOLE
//     VERIFY, PLAY -> (a child process) -> an answer to the page
#include "clients/web/control_client.h"
#include "clients/web/page_tool.h"
#include <pthread.h>
#include <stdatomic.h>

#define KN_RECORDINGS 6 // largest number of recordings that are kept; a further one replaces the oldest

// WAITS: waiting for the scene, which kneadd sends every second. RUNS: recording. WHOLE: complete. EMPTY: ended before
// recording began; kn_recordings_turn removes this recording.
typedef enum kn_recording_state {
    KN_RECORDING_WAITS,
    KN_RECORDING_RUNS,
    KN_RECORDING_WHOLE,
    KN_RECORDING_FAILED,
    KN_RECORDING_EMPTY
} kn_recording_state;

typedef struct kn_recording {
    int number; // number of the recording, from 1 on; 0: this place for a recording is free
    // A kn_recording_state. Once the state is WHOLE or FAILED, another thread may also read the fields that are not
    // atomic.
    _Atomic int state;
    _Atomic int ms; // duration of the recording so far
    _Atomic int64_t bytes;
    bool csv;        // true: the CSV file with the forces exists
    char words[200]; // outcome of the recording or of its verification in words; "": none yet
} kn_recording;

typedef struct kn_recordings {
    // Set by the caller. folder: folder for the files, "": none. changed: called when a child process has ended.
    const char *folder, *url;
    struct ev_loop *ev; // libev's default loop; no other loop can watch child processes
    kn_gateway *gateway;
    kn_page_tool *tool;
    kn_control_client *client;
    void (*changed)(void *arg);
    void *arg;
    // State, read by other modules.
    kn_recording recording[KN_RECORDINGS];
    kn_recording *now;       // recording whose thread must still be joined; NULL: none
    int child_pid, child_of; // id of the child process, and number of the recording that it uses; 0: no child process
    // The fields below are used by recording.c only.
    int count;
    atomic_bool end;
    pthread_t thread;
    char probe[64];
    ev_child child;
    bool child_plays, child_stopped;
    // Time when the page's hand was stopped so that a recording can be played; 0: the child process that plays the
    // recording has been started.
    int64_t lent_ms;
    // page: index of the page that gets an answer when the verification or the playing ends, -1: none. id: id of the
    // page's request.
    int page;
    uint32_t id;
} kn_recordings;

// Handle a request of a page: RECORD, VERIFY, PLAY or STOP.
void kn_recordings_request(kn_recordings *recordings, int page, const kn_page_request *request);
// Called ten times a second: continues pending work. Returns true if a recording was removed.
bool kn_recordings_turn(kn_recordings *recordings);
void kn_recordings_gone(kn_recordings *recordings, int page);            // forgets a page
kn_recording *kn_recordings_find(kn_recordings *recordings, int number); // returns a recording that is WHOLE, or NULL
// Return the number of the recording that is in state WAITS or RUNS, or 0.
int kn_recordings_running(const kn_recordings *recordings);
// Get the path of a recording's file. kind: "lcmlog", "csv" (forces), "path" (poses, as knead probe --path takes them).
void kn_recordings_path(const kn_recordings *recordings, int number, const char *kind, char path[128]);
void kn_recordings_close(kn_recordings *recordings); // ends all work and removes all recordings with their files

#endif
