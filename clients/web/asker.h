#ifndef KN_CLIENTS_ASKER_H
#define KN_CLIENTS_ASKER_H
// Asynchronous requests to kneadd's control socket (server/control.h), for the libev thread. Each request uses its own
// connection, and the caller never waits for an answer.
//
//     kn_asker_ask -> ... libev ... -> answered(arg, tag, answer), once for each request
#include <ev.h>
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

// Most requests that wait for answers at once, one of them reserved for urgent requests; kneadd accepts 8.
#define KN_ASKER_CALLS 5

typedef struct kn_asker_call {
    ev_io readable;
    ev_timer patience;
    struct kn_asker *asker;
    int tag;
    char *text; // part of the answer received so far; NULL: this place for a request is free
    size_t size;
} kn_asker_call;

typedef struct kn_asker {
    struct ev_loop *ev;
    const char *path; // path of the socket, must outlive the asker; NULL: every request is refused
    // Called with each answer and the tag of its request. `answer` is valid during the call only. It is always an
    // object. If no answer came, it is {"ok": false, "error": "..."}.
    void (*answered)(void *arg, int tag, const json_t *answer);
    void *arg;
    kn_asker_call call[KN_ASKER_CALLS]; // the requests that wait for answers (private)
} kn_asker;

// Prepare an asker. It must be zeroed except for path, answered and arg, and must not move afterwards.
void kn_asker_open(kn_asker *asker, struct ev_loop *ev);

// Send a request. If it cannot be sent, return false and one line in `error`; `answered` is then not called for this
// request. The caller keeps `request`. urgent: the request may use the place that is reserved for urgent requests.
bool kn_asker_ask(kn_asker *asker, int tag, const json_t *request, bool urgent, char *error, size_t error_size);
void kn_asker_close(kn_asker *asker); // closes all connections without waiting for pending answers

#endif
