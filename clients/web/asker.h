#ifndef KN_CLIENTS_ASKER_H
#define KN_CLIENTS_ASKER_H
// Requests to kneadd's control socket (server/control.h) from the libev thread, which waits for none of them: a
// connection each, its answer when it comes.
//
//     kn_asker_ask -> ... libev ... -> answered(arg, tag, answer), once for each
#include <ev.h>
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_ASKER_CALLS 5 // at once, one of them kept for what is urgent: kneadd hears eight

typedef struct kn_asker_call {
    ev_io readable;
    ev_timer patience;
    struct kn_asker *asker;
    int tag;
    char *text; // NULL: free
    size_t size;
} kn_asker_call;

typedef struct kn_asker {
    struct ev_loop *ev;
    const char *path; // of the socket, borrowed; NULL: every request is refused
    // tag as it was given. answer: borrowed, an object; never NULL: {"ok": false, "error": "..."} where none came.
    void (*answered)(void *arg, int tag, const json_t *answer);
    void *arg;
    kn_asker_call call[KN_ASKER_CALLS]; // private
} kn_asker;

// asker: zeroed but for path, answered, arg, and stays where it is.
void kn_asker_open(kn_asker *asker, struct ev_loop *ev);

// Borrows request. False and one line in error: it did not go out, and is not answered.
bool kn_asker_ask(kn_asker *asker, int tag, const json_t *request, bool urgent, char *error, size_t error_size);
void kn_asker_close(kn_asker *asker); // what is on its way is not waited for

#endif
