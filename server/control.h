#ifndef KN_SERVER_CONTROL_H
#define KN_SERVER_CONTROL_H
// The control socket: an AF_UNIX stream. An operator sends one JSON object per line and gets one JSON object per line
// back.
//
//     {"command": "quality", "name": "fast"}      -->      {"ok": true, "tick": 4711}
//     {"command": "qualty"}                       -->      {"ok": false, "error": "command 'qualty': expected ..."}
//
// Commands are never accepted over LCM, where any program may send. The socket has mode 0660. The kernel identifies the
// peer (SO_PEERCRED). Commands are accepted from root, from the user that kneadd runs as, and from members of the
// socket's group.
//
// This module handles bytes, peers and limits; operator.h interprets the lines. A line has at most KN_CONTROL_LINE
// bytes. At most KN_CONTROL_PEERS peers are connected; a further peer replaces the one that was silent for longest.
// Each peer may send KN_CONTROL_HZ commands a second. A peer that does not read its replies is disconnected. Peers are
// served in turn, one line each, also while one of them waits for a slow request. The last line of a peer that has
// finished sending is served even without a newline.
//
// None of these limits delays an urgent request, that is, an emergency stop. An urgent request is carried out as soon
// as it has been read, ahead of the peer's other lines, and answered in its turn.
//
// stderr gets one entry for each change: the peer that made it and the whole request. A long request is split into
// lines of 3000 bytes. Malformed and rate-limited lines are counted and reported at most once a second.
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_CONTROL_LINE 4096   // largest length of a line, bytes, including its newline
#define KN_CONTROL_BRACKETS 64 // largest number of [ and { in a line, nested or not
#define KN_CONTROL_PATH 107    // largest length of the socket's path, bytes (limit of sockaddr_un)
#define KN_CONTROL_PEERS 8
#define KN_CONTROL_LAST_MS 1000 // time limit for answering the last requests (kn_control_drain)
#define KN_CONTROL_HZ 100       // largest number of commands per second from one peer; also the largest burst

typedef struct kn_control kn_control;

typedef struct kn_control_def {
    void *self;
    // Return the reply to `request`, which is a JSON object. The reply is a new reference, never NULL. If the reply has
    // a number `descriptor`, this file descriptor is handed to the peer with the reply (SCM_RIGHTS) and closed here.
    json_t *(*answer)(void *self, const json_t *request);
    // Return whether the request is logged on stderr.
    bool (*audits)(void *self, const json_t *request);
    // Return whether the answer may take longer than a few ticks. A slow request is answered in kn_control_work's
    // thread, and the other peers are served meanwhile. NULL: no request is slow.
    bool (*slow)(void *self, const json_t *request);
    // Return whether the request is urgent. An urgent request must not be slow: it may take about a tick, and the time
    // in which the disk creates an empty file (the mark of an emergency stop). It must be safe to repeat, because it
    // may be carried out twice. NULL: no request is urgent.
    bool (*urgent)(void *self, const json_t *request);
} kn_control_def;

// Return an error reply, {"ok": false, "error": "..."}.
json_t *kn_control_error(const char *format, ...) __attribute__((format(printf, 1, 2)));

// Parse one line, given without its newline, and return the reply: a new reference, never NULL. The line may hold any
// bytes. Set *request to the parsed request, a new reference, or to NULL if the line is not a request.
json_t *kn_control_judge(const kn_control_def *def, const char *line, size_t length, json_t **request);

// Bind the socket to `path`. The socket file of a server that has ended is replaced. On failure return NULL and put one
// line in error.
kn_control *kn_control_open(const char *path, const kn_control_def *def, char *error, size_t error_size);
// Close the socket and remove its file. Keep the file if another server has replaced it. Call this function after the
// threads that run kn_control_turn and kn_control_work have ended. `control` may be NULL.
void kn_control_close(kn_control *control);

// Serve one line of every peer that has sent one. If no peer has sent a line, wait at most timeout_ms. Called by one
// thread, not real-time.
void kn_control_turn(kn_control *control, int timeout_ms);

// Body of the worker thread: answer the slow requests, one at a time, until any thread calls kn_control_end.
void kn_control_work(kn_control *control);
void kn_control_end(kn_control *control);
// Answer the requests sent until now, but refuse requests that take long to serve. Call this function after the threads
// that run kn_control_turn and kn_control_work have ended. It takes at most KN_CONTROL_LAST_MS. A peer that sends
// something later is disconnected without an answer.
void kn_control_drain(kn_control *control);

#endif
