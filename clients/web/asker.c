#include "clients/web/asker.h"
#include "clients/knead/ask.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

// Longest wait for an answer, s; kneadd answers within 2 s, except when it loads a large scene.
#define PATIENCE_S 12
#define ANSWER_MAX (1 << 18) // largest answer, bytes

// End a request: close its connection, then deliver its answer. If `why` is not NULL, deliver this error instead of the
// answer.
static void end(kn_asker_call *c, const char *why)
{
    kn_asker *a = c->asker;
    char *text = c->text;
    json_t *answer = why ? NULL : kn_ask_read(text, c->size);
    ev_io_stop(a->ev, &c->readable);
    ev_timer_stop(a->ev, &c->patience);
    close(c->readable.fd);
    // Free the request's place before the callback, because the callback may make a new request.
    c->text = NULL;
    if (!json_is_object(answer)) {
        json_decref(answer);
        answer = json_pack("{s:b, s:s}", "ok", 0, "error", why ? why : "the program that answers there is not kneadd");
    }
    if (answer) a->answered(a->arg, c->tag, answer);
    json_decref(answer);
    free(text);
}

static void on_readable(struct ev_loop *ev, ev_io *w, int events)
{
    (void)ev, (void)events;
    kn_asker_call *c = w->data;
    ssize_t got = recv(w->fd, c->text + c->size, ANSWER_MAX - c->size, 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (got > 0) c->size += (size_t)got;
    // An answer ends with a newline. Anything larger than ANSWER_MAX is not from kneadd.
    if (c->size > 0 && c->text[c->size - 1] == '\n') end(c, NULL);
    else if (got <= 0) end(c, "kneadd closed the connection without an answer");
    else if (c->size == ANSWER_MAX) end(c, "the program that answers there is not kneadd");
}

static void on_late(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)ev, (void)events;
    end(w->data, "kneadd has not answered for 12 s");
}

void kn_asker_open(kn_asker *a, struct ev_loop *ev) { a->ev = ev; }

bool kn_asker_ask(kn_asker *a, int tag, const json_t *request, bool urgent, char *error, size_t error_size)
{
    kn_asker_call *c = NULL;
    // Place 0 is reserved for urgent requests.
    for (int i = urgent ? 0 : 1; !c && i < KN_ASKER_CALLS; i++)
        if (!a->call[i].text) c = &a->call[i];
    snprintf(error, error_size, "%s",
             !a->path ? "knead web has no --control" : "kneadd is still busy with earlier requests");
    if (!a->path || !c) return false;
    int fd = kn_ask_begin(a->path, request, error, error_size);
    if (fd < 0) return false;
    *c = (kn_asker_call){.asker = a, .tag = tag, .text = malloc(ANSWER_MAX)};
    if (!c->text) {
        snprintf(error, error_size, "out of memory");
        close(fd);
        return false;
    }
    ev_io_init(&c->readable, on_readable, fd, EV_READ);
    ev_timer_init(&c->patience, on_late, PATIENCE_S, 0);
    c->readable.data = c->patience.data = c;
    ev_io_start(a->ev, &c->readable);
    ev_timer_start(a->ev, &c->patience);
    return true;
}

void kn_asker_close(kn_asker *a)
{
    for (int i = 0; i < KN_ASKER_CALLS; i++) {
        kn_asker_call *c = &a->call[i];
        if (!c->text) continue;
        ev_io_stop(a->ev, &c->readable);
        ev_timer_stop(a->ev, &c->patience);
        close(c->readable.fd);
        free(c->text);
        c->text = NULL;
    }
}
