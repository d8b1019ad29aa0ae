#ifndef KN_SERVER_CONTROL_H
#define KN_SERVER_CONTROL_H
// The control socket: an AF_UNIX stream, on which an operator sends one JSON object per line and gets one per line.
//
//     {"command": "quality", "name": "fast"}      -->      {"ok": true, "tick": 4711}
//     {"command": "qualty"}                       -->      {"ok": false, "error": "command 'qualty': expected ..."}
//
// Commands never come over LCM, where anyone may speak. The socket has mode 0660, and the kernel says who is at its
// other end (SO_PEERCRED): root, the user that kneadd runs as, and members of the socket's group are heard. What a line
// means is its owner's (operator.h); here it is bytes, peers and limits: KN_CONTROL_LINE bytes a line, KN_CONTROL_PEERS
// at once (the one that was silent for longest gives way), KN_CONTROL_HZ commands a second of each, and no reply is
// waited for that nobody reads. Everybody is heard in turn, a line at a time, whatever another one waits for. What is
// urgent, an emergency stop, is held up by none of these limits: it is done as soon as it has been read, ahead of the
// same peer's other lines, and answered when it is its turn. What stands without a newline when a peer has said all is
// a line, too.
//
// On stderr: changes and who made them, all of each request, in lines of 3000 bytes of it; and once a second at most
// how many lines were no requests, or too many.
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_CONTROL_LINE 4096   // with its newline
#define KN_CONTROL_BRACKETS 64 // in a line, nested or not
#define KN_CONTROL_PATH 107    // bytes of a path at most: sockaddr_un's
#define KN_CONTROL_PEERS 8
#define KN_CONTROL_LAST_MS 1000 // for what is heard at the end
#define KN_CONTROL_HZ 100       // after as many at once

typedef struct kn_control kn_control;

typedef struct kn_control_def {
    void *self;
    // The reply to one request, a JSON object: a new reference, never NULL.
    json_t *(*answer)(void *self, const json_t *request);
    bool (*audits)(void *self, const json_t *request); // whether it is worth a line on stderr
    // Whether its answer may take longer than some ticks: then it is asked for in kn_control_work's thread, and the
    // other peers are heard meanwhile. NULL: none.
    bool (*slow)(void *self, const json_t *request);
    // Whether it waits for nothing. It is no slow one, takes about a tick and what the disk takes for an empty file, and
    // may come twice. NULL: none.
    bool (*urgent)(void *self, const json_t *request);
} kn_control_def;

// {"ok": false, "error": "..."}
json_t *kn_control_error(const char *format, ...) __attribute__((format(printf, 1, 2)));

// The reply to one line without its newline, whatever its bytes: a new reference, never NULL. *request: what it asked,
// a new reference; NULL: it is no request.
json_t *kn_control_judge(const kn_control_def *def, const char *line, size_t length, json_t **request);

// Binds path, replacing a socket there that nobody serves. NULL and one line in error.
kn_control *kn_control_open(const char *path, const kn_control_def *def, char *error, size_t error_size);
void kn_control_close(kn_control *control); // removes the path while it is still ours; NULL is fine. After its threads

// Hears one line of everybody who has said one, for timeout_ms at most while nobody has. One thread, not real-time.
void kn_control_turn(kn_control *control, int timeout_ms);

// Another thread's body: the slow requests, one at a time. Returns after kn_control_end, which any thread may call.
void kn_control_work(kn_control *control);
void kn_control_end(kn_control *control);
// After both threads: what has been said by now is answered, but slow requests are refused; KN_CONTROL_LAST_MS at most.
// Whoever says something later is hung up on without an answer.
void kn_control_drain(kn_control *control);

#endif
