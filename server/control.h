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
// at once, KN_CONTROL_HZ commands a second of each, and no reply is waited for that nobody reads.
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_CONTROL_LINE 4096 // with its newline
#define KN_CONTROL_BRACKETS 64 // in a line, nested or not
#define KN_CONTROL_PATH 107  // bytes of a path at most: sockaddr_un's
#define KN_CONTROL_PEERS 8
#define KN_CONTROL_HZ 100 // after as many at once

typedef struct kn_control kn_control;

// The reply to one request, a JSON object: a new reference, never NULL. *audit: whether it is worth a line on stderr.
typedef json_t *(*kn_control_answer)(void *self, const json_t *request, bool *audit);

// {"ok": false, "error": "..."}
json_t *kn_control_error(const char *format, ...) __attribute__((format(printf, 1, 2)));

// The reply to one line without its newline, whatever its bytes: a new reference, never NULL. *request: what it asked,
// a new reference, where it is worth a line on stderr, else NULL.
json_t *kn_control_judge(kn_control_answer answer, void *self, const char *line, size_t length, json_t **request);

// Binds path, replacing a socket there that nobody serves. NULL and one line in error.
kn_control *kn_control_open(const char *path, kn_control_answer answer, void *self, char *error, size_t error_size);
void kn_control_close(kn_control *control); // removes the path while it is still ours; NULL is fine

// Serves whoever has something to say, for timeout_ms at most while nobody has. One thread, not real-time.
void kn_control_turn(kn_control *control, int timeout_ms);

#endif
