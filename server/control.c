#include "server/control.h"
#include "server/clock.h"
#include "server/console.h"
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <semaphore.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define CREDIT_NS (1000000000 / KN_CONTROL_HZ) // time credit that one command uses up, ns
#define GROUPS_MAX 256
#define AUDIT_PIECE 3000 // largest part of a request that one line on stderr shows, bytes

typedef struct peer {
    int fd; // descriptor of the peer's connection; -1: this entry is free
    struct ucred who;
    int64_t paid_ns;  // rate limit: the time from paid_ns to the present is the peer's unused credit, ns
    int64_t heard_ns; // time of the peer's latest whole line; before its first line: time of the connection
    // slow request of this peer that has no answer yet; the peer's further lines wait for this answer; NULL: none
    json_t *request;
    bool ended;      // true if the peer has finished sending; its remaining lines are still answered
    bool passing;    // true while the rest of a line that was too long is skipped
    size_t length;   // number of bytes in `line` that were read and not served yet
    size_t hastened; // number of bytes in `line` that were already searched for urgent requests
    json_t *done;    // answer to the urgent requests in `line`; each of them gets this answer in its turn; NULL: none
    int64_t told_ns; // time of the last stderr line about an urgent request
    char line[KN_CONTROL_LINE];
} peer;

typedef enum job { JOB_NONE, JOB_GIVEN, JOB_DONE } job;

struct kn_control {
    int fd;
    struct stat own; // the socket's file; members of its group may connect, and its inode shows whether it was replaced
    struct sockaddr_un at;
    kn_control_def def;
    peer peers[KN_CONTROL_PEERS];
    // The slow request that the worker is answering. These fields belong to the control thread while `job` is JOB_NONE
    // or JOB_DONE, and to the worker while `job` is JOB_GIVEN.
    _Atomic job job;
    int job_peer; // index in `peers` of the peer whose slow request is being answered; -1: none
    const json_t *job_request;
    json_t *job_answer;
    sem_t given;
    atomic_bool ending;
    int done_fd; // eventfd with which the worker wakes the control thread
    // Number of malformed or rate-limited lines that have not been reported yet.
    int untold;
    struct ucred untold_of; // sender of the latest line counted in `untold`
    int64_t untold_ns;      // time of the last report of `untold`
};

json_t *kn_control_error(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    json_t *error = json_vsprintf(format, arguments);
    va_end(arguments);
    return json_pack("{s:b, s:o}", "ok", 0, "error", error ? error : json_string("out of memory, or not UTF-8"));
}

// --- malformed and rate-limited lines, which are counted and reported together ---

// Report the number of malformed and rate-limited lines since the last report, at most once a second.
static void tell_untold(kn_control *c, int64_t now_ns)
{
    if (c->untold == 0 || now_ns - c->untold_ns < 1000000000) return;
    kn_console_err(
        "kneadd: control: lines that were malformed or above %d a second: %d, the last one from uid %d pid %d",
        KN_CONTROL_HZ, c->untold, (int)c->untold_of.uid, (int)c->untold_of.pid);
    c->untold = 0;
    c->untold_ns = now_ns;
}

static void count_untold(kn_control *c, const peer *p)
{
    c->untold++;
    c->untold_of = p->who;
}

// --- the socket ---

// Return whether a server accepts connections at this address. EAGAIN means that the server's queue is full.
static bool serves(const struct sockaddr_un *at)
{
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    bool yes = fd >= 0 && (connect(fd, (const struct sockaddr *)at, sizeof *at) == 0 || errno == EAGAIN);
    if (fd >= 0) close(fd);
    return yes;
}

// Remove the socket file of a server that has ended. Return NULL if the path can then be bound; otherwise return the
// reason why it cannot.
static const char *make_room(const struct sockaddr_un *at)
{
    struct stat there;
    if (lstat(at->sun_path, &there) != 0) return NULL;
    if (!S_ISSOCK(there.st_mode)) return "exists and is not a socket";
    if (serves(at)) return "another server answers there";
    return unlink(at->sun_path) == 0 ? NULL : strerror(errno);
}

kn_control *kn_control_open(const char *path, const kn_control_def *def, char *error, size_t error_size)
{
    kn_control *c = calloc(1, sizeof *c);
    const char *why = c ? NULL : "out of memory";
    if (c) {
        *c = (kn_control){.fd = -1, .at.sun_family = AF_UNIX, .def = *def, .job_peer = -1};
        for (int i = 0; i < KN_CONTROL_PEERS; i++) c->peers[i].fd = -1;
        c->done_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
        if (c->done_fd < 0 || sem_init(&c->given, 0, 0) != 0) why = strerror(errno);
        else if (!*path || strlen(path) > KN_CONTROL_PATH) why = "expected a path of 1 to 107 bytes";
    }
    if (!why) {
        strcpy(c->at.sun_path, path);
        why = make_room(&c->at);
    }
    if (!why) {
        mode_t mask = umask(0117); // create the socket file so that only its user and group may connect
        c->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        if (c->fd < 0 || bind(c->fd, (const struct sockaddr *)&c->at, sizeof c->at) != 0 ||
            listen(c->fd, KN_CONTROL_PEERS) != 0 || lstat(path, &c->own) != 0)
            why = strerror(errno);
        umask(mask);
    }
    if (!why) return c;
    snprintf(error, error_size, "--control %s: %s", path, why);
    if (c && c->fd >= 0) close(c->fd);
    if (c && c->done_fd >= 0) close(c->done_fd);
    free(c);
    return NULL;
}

static void hang_up(peer *p)
{
    close(p->fd);
    json_decref(p->request);
    json_decref(p->done);
    *p = (peer){.fd = -1};
}

void kn_control_close(kn_control *c)
{
    struct stat now;
    if (!c) return;
    tell_untold(c, INT64_MAX);
    if (atomic_load(&c->job) == JOB_DONE) json_decref(c->job_answer);
    for (int i = 0; i < KN_CONTROL_PEERS; i++)
        if (c->peers[i].fd >= 0) hang_up(&c->peers[i]);
    // Remove the socket's file only if it is still our own, because another server may have replaced it.
    if (lstat(c->at.sun_path, &now) == 0 && now.st_dev == c->own.st_dev && now.st_ino == c->own.st_ino)
        unlink(c->at.sun_path);
    sem_destroy(&c->given);
    close(c->done_fd);
    close(c->fd);
    free(c);
}

// --- who may send commands ---

// Return whether the peer is root, the user of this process or a member of the socket's group.
static bool may_command(const kn_control *c, int fd, struct ucred *who)
{
    gid_t groups[GROUPS_MAX];
    socklen_t size = sizeof *who;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, who, &size) != 0) return false;
    if (who->uid == 0 || who->uid == geteuid() || who->gid == c->own.st_gid) return true;
    // Check the supplementary groups.
    size = sizeof groups;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size) != 0) return false;
    for (size_t i = 0; i < size / sizeof *groups; i++)
        if (groups[i] == c->own.st_gid) return true;
    return false;
}

// Send a reply without waiting. A peer that has not read its earlier replies is disconnected. Takes ownership of
// `answer`.
static void send_reply(peer *p, json_t *answer)
{
    // Hand over the descriptor of the reply.
    const json_t *handed = json_object_get(answer, "descriptor");
    const int fd = handed ? (int)json_integer_value(handed) : -1;
    if (handed) json_object_set_new(answer, "descriptor", json_true());
    char *text = answer ? json_dumps(answer, JSON_COMPACT | JSON_ENSURE_ASCII) : NULL;
    size_t size = text ? strlen(text) : 0;
    if (text) text[size++] = '\n'; // the newline replaces the text's NUL
    struct iovec part = {text, size};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    _Alignas(struct cmsghdr) char room[CMSG_SPACE(sizeof fd)] = {0};
    if (fd >= 0) {
        message.msg_control = room;
        message.msg_controllen = sizeof room;
        struct cmsghdr *rights = CMSG_FIRSTHDR(&message);
        *rights = (struct cmsghdr){CMSG_LEN(sizeof fd), SOL_SOCKET, SCM_RIGHTS};
        memcpy(CMSG_DATA(rights), &fd, sizeof fd);
    }
    // A reply that cannot be sent at once means that the peer does not read.
    if (!text || sendmsg(p->fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)size) hang_up(p);
    if (fd >= 0) close(fd);
    free(text);
    json_decref(answer);
}

// Return an entry of `peers` for a new connection. If there is no free entry, disconnect the peer that was silent for
// longest, and return its entry. Peers that wait for the answer to a slow request are disconnected only if all others
// wait as well. So a new peer can always connect to send an emergency stop, even if silent peers held all connections.
static peer *make_place(kn_control *c)
{
    peer *place = NULL;
    for (int i = 0; i < KN_CONTROL_PEERS; i++) {
        peer *p = &c->peers[i];
        if (p->fd < 0) return p;
        // keep the peer whose slow request the worker is answering, because the answer is sent to this entry
        if (i == c->job_peer) continue;
        bool sooner = !place || (!p->request && place->request) ||
                      (!p->request == !place->request && p->heard_ns < place->heard_ns);
        if (sooner) place = p;
    }
    send_reply(place, kn_control_error("more than %d connections: yours was silent the longest", KN_CONTROL_PEERS));
    if (place->fd >= 0) hang_up(place);
    return place;
}

// Accept one connection.
static void greet(kn_control *c)
{
    peer one = {.fd = accept4(c->fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK), .heard_ns = kn_now_ns()};
    if (one.fd < 0) return;
    if (may_command(c, one.fd, &one.who)) {
        *make_place(c) = one;
        return;
    }
    kn_console_err("kneadd: control: uid %d pid %d: refused", (int)one.who.uid, (int)one.who.pid);
    send_reply(&one, kn_control_error("uid %d may not command this server", (int)one.who.uid));
    if (one.fd >= 0) hang_up(&one);
}

// --- lines ---

// Charge one command to the peer. Return false if the peer exceeds its rate. The credit is the time between paid_ns and
// the present, one second at most, which allows a burst of KN_CONTROL_HZ commands. Each command moves paid_ns on by
// CREDIT_NS.
static bool afford(peer *p)
{
    int64_t now_ns = kn_now_ns(), earliest_ns = now_ns - (int64_t)KN_CONTROL_HZ * CREDIT_NS;
    if (p->paid_ns < earliest_ns) p->paid_ns = earliest_ns;
    if (p->paid_ns + CREDIT_NS > now_ns) return false;
    p->paid_ns += CREDIT_NS;
    return true;
}

// Copy text without control characters, so that one line stays one line and no escape sequence reaches a terminal.
static const char *legible(const char *text, char *room, size_t size)
{
    snprintf(room, size, "%s", text);
    for (char *c = room; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 0x7f) *c = '?';
    return room;
}

// Log a request and its outcome. A long request is split into several lines, so that none of it is cut.
static void tell_audit(const peer *p, const json_t *request, const json_t *answer)
{
    const json_t *tick = json_object_get(answer, "tick"), *generation = json_object_get(answer, "generation");
    const json_t *error = json_object_get(answer, "error");
    char why[400], outcome[500] = "done";
    char *asked = json_dumps(request, JSON_COMPACT | JSON_ENSURE_ASCII);
    const char *rest = asked ? asked : "?", *more = "";
    if (error) snprintf(outcome, sizeof outcome, "refused: %s", legible(json_string_value(error), why, sizeof why));
    else if (json_integer_value(generation) > 0)
        snprintf(outcome, sizeof outcome, "tick %" PRId64 ", generation %" PRId64, (int64_t)json_integer_value(tick),
                 (int64_t)json_integer_value(generation));
    else if (tick) snprintf(outcome, sizeof outcome, "tick %" PRId64, (int64_t)json_integer_value(tick));
    for (; strlen(rest) > AUDIT_PIECE; rest += AUDIT_PIECE, more = "... ")
        kn_console_err("kneadd: control: uid %d pid %d: %s%.*s ...", (int)p->who.uid, (int)p->who.pid, more,
                       AUDIT_PIECE, rest);
    kn_console_err("kneadd: control: uid %d pid %d: %s%s: %s", (int)p->who.uid, (int)p->who.pid, more, rest, outcome);
    free(asked);
}

// Count the opening brackets, because the JSON reader and writer recurse once for each nested bracket.
static int brackets(const char *line, size_t length)
{
    int count = 0;
    for (size_t i = 0; i < length; i++) count += line[i] == '[' || line[i] == '{';
    return count;
}

// Parse one line. Return the request, a new reference. If the line is not a request, return NULL and put the error
// reply in *refusal.
static json_t *parse(const char *line, size_t length, json_t **refusal)
{
    json_error_t why;
    *refusal = NULL;
    if (brackets(line, length) > KN_CONTROL_BRACKETS) {
        *refusal = kn_control_error("more than %d brackets [ and {", KN_CONTROL_BRACKETS);
        return NULL;
    }
    json_t *request = json_loadb(line, length, JSON_REJECT_DUPLICATES, &why);
    if (request && json_is_object(request)) return request;
    *refusal = request ? kn_control_error("expected one JSON object per line")
                       : kn_control_error("not JSON at byte %d, expected one JSON object per line", why.position);
    json_decref(request);
    return NULL;
}

json_t *kn_control_judge(const kn_control_def *def, const char *line, size_t length, json_t **request)
{
    json_t *refusal;
    *request = parse(line, length, &refusal);
    return *request ? def->answer(def->self, *request) : refusal;
}

// Send the reply to a request. If the callback `audits` returns true, log request and reply first. Takes ownership of
// `reply`.
static void answer(const kn_control *c, peer *p, const json_t *request, json_t *reply)
{
    if (c->def.audits(c->def.self, request)) tell_audit(p, request, reply);
    send_reply(p, reply);
}

static void forget_done(peer *p)
{
    json_decref(p->done);
    p->done = NULL;
}

// Return whether a line is a well-formed urgent request.
static bool is_urgent(const kn_control *c, const char *line, size_t length)
{
    json_t *refusal, *request = parse(line, length, &refusal);
    bool urgent = request && c->def.urgent(c->def.self, request);
    json_decref(request);
    json_decref(refusal);
    return urgent;
}

// Answer an urgent request that was already carried out, now that its turn has come. Return false for any other line.
static bool answer_done(const kn_control *c, peer *p, size_t length)
{
    if (!p->done || length >= p->hastened || !is_urgent(c, p->line, length)) return false;
    send_reply(p, json_incref(p->done));
    return true;
}

// Serve one line of `length` bytes.
static void hear_line(kn_control *c, peer *p, size_t length)
{
    json_t *refusal, *request;
    p->heard_ns = kn_now_ns();
    bool paid = afford(p);
    if (answer_done(c, p, length)) return;
    if (!paid && !(c->def.urgent && is_urgent(c, p->line, length))) {
        count_untold(c, p);
        send_reply(p, kn_control_error("more than %d commands a second", KN_CONTROL_HZ));
    } else if (!(request = parse(p->line, length, &refusal))) {
        count_untold(c, p);
        send_reply(p, refusal);
    } else if (c->def.slow && c->def.slow(c->def.self, request)) {
        // the request waits until give() passes it to the worker, or kn_control_drain() refuses it
        p->request = request;
    } else {
        // This request may have undone an urgent request that was carried out earlier; for example, `recover` ends an
        // `estop`. Forget the earlier answer, so that the next urgent line is carried out again.
        if (c->def.audits(c->def.self, request)) forget_done(p);
        answer(c, p, request, c->def.answer(c->def.self, request));
        json_decref(request);
    }
}

// Carry out an urgent request and keep its answer. Log urgent requests at most KN_CONTROL_HZ times a second.
static void do_urgent(kn_control *c, peer *p, const json_t *request)
{
    int64_t now_ns = kn_now_ns();
    forget_done(p);
    p->done = c->def.answer(c->def.self, request);
    if (now_ns - p->told_ns >= CREDIT_NS) {
        tell_audit(p, request, p->done);
        p->told_ns = now_ns;
    } else {
        count_untold(c, p);
    }
}

// Carry out urgent requests ahead of the peer's earlier lines, even while a slow request of the peer is being answered,
// and regardless of the limit of commands a second. Urgent lines that arrived together are carried out only once, so
// that no peer can occupy this thread. Each of these lines is answered in its turn.
static void hasten(kn_control *c, peer *p)
{
    json_t *urgent = NULL, *refusal;
    const char *end;
    // The first line in the buffer may be the rest of a line that was too long. This rest is not parsed.
    bool passing = p->passing && p->hastened == 0;
    for (; (end = memchr(p->line + p->hastened, '\n', p->length - p->hastened)); passing = false) {
        const char *line = p->line + p->hastened;
        json_t *request = passing ? NULL : parse(line, (size_t)(end - line), &refusal);
        if (!request && !passing) json_decref(refusal);
        p->hastened = (size_t)(end + 1 - p->line);
        if (!request || !c->def.urgent(c->def.self, request)) {
            json_decref(request);
            continue;
        }
        json_decref(urgent);
        urgent = request;
    }
    if (urgent) do_urgent(c, p, urgent);
    json_decref(urgent);
}

// Serve only one of the peer's lines, so that each peer gets its turn.
static void hear(kn_control *c, peer *p)
{
    char *end = memchr(p->line, '\n', p->length);
    size_t size = end ? (size_t)(end + 1 - p->line) : p->length;
    if (p->passing) {
        p->passing = !end;
    } else if (end) {
        hear_line(c, p, size - 1);
    } else if (p->length == KN_CONTROL_LINE) {
        p->passing = true;
        count_untold(c, p);
        send_reply(p, kn_control_error("a line of more than %d bytes", KN_CONTROL_LINE - 1));
    } else {
        return;
    }
    if (p->fd < 0) return; // return if the peer was disconnected because it did not read the reply
    p->length -= size;
    p->hastened -= size < p->hastened ? size : p->hastened;
    memmove(p->line, p->line + size, p->length);
}

// Record that the peer has finished sending. The peer's last line is served even if its newline is missing.
static void end(peer *p)
{
    p->ended = true;
    if (p->length > 0 && p->line[p->length - 1] != '\n') p->line[p->length++] = '\n';
}

// Read what a peer has sent.
static void listen_to(peer *p)
{
    ssize_t size = recv(p->fd, p->line + p->length, sizeof p->line - p->length, 0);
    if (size > 0) p->length += (size_t)size;
    else if (size == 0) end(p);
    // on a read error, disconnect the peer, except if its slow request still waits for an answer
    else if (errno != EAGAIN && errno != EINTR) p->request ? end(p) : hang_up(p);
}

// --- slow requests: one at a time, while the other peers are served ---

// Take the answer from the worker and send it.
static void collect(kn_control *c)
{
    uint64_t count;
    if (atomic_load(&c->job) != JOB_DONE) return;
    // Reset the eventfd.
    ssize_t woken = read(c->done_fd, &count, sizeof count);
    (void)woken;
    peer *p = &c->peers[c->job_peer];
    json_t *request = p->request;
    p->request = NULL;
    answer(c, p, request, c->job_answer);
    json_decref(request);
    c->job_peer = -1;
    atomic_store(&c->job, JOB_NONE);
}

// Give the worker the slow request that has waited for longest.
static void give(kn_control *c)
{
    int next = -1;
    for (int i = 0; i < KN_CONTROL_PEERS; i++)
        if (c->peers[i].request && (next < 0 || c->peers[i].heard_ns < c->peers[next].heard_ns)) next = i;
    if (next < 0 || atomic_load(&c->job) != JOB_NONE) return;
    c->job_peer = next;
    c->job_request = c->peers[next].request;
    atomic_store(&c->job, JOB_GIVEN);
    sem_post(&c->given);
}

void kn_control_work(kn_control *c)
{
    for (;;) {
        while (sem_wait(&c->given) != 0)
            ; // a signal interrupted the wait, so wait again
        if (atomic_load(&c->job) == JOB_GIVEN) {
            c->job_answer = c->def.answer(c->def.self, c->job_request);
            atomic_store(&c->job, JOB_DONE);
            // if this write to the eventfd fails, the control thread's wait still ends by its time limit
            ssize_t woken = write(c->done_fd, &(uint64_t){1}, sizeof(uint64_t));
            (void)woken;
        }
        if (atomic_load(&c->ending)) return;
    }
}

void kn_control_end(kn_control *c)
{
    atomic_store(&c->ending, true);
    sem_post(&c->given);
}

void kn_control_turn(kn_control *c, int timeout_ms)
{
    struct pollfd polled[2 + KN_CONTROL_PEERS] = {{.fd = c->fd, .events = POLLIN},
                                                  {.fd = c->done_fd, .events = POLLIN}};
    // Wait for a connection, an answer of the worker, or bytes of a peer whose buffer has room. Do not wait if a whole
    // line has been read already.
    for (int i = 0; i < KN_CONTROL_PEERS; i++) {
        const peer *p = &c->peers[i];
        bool full = p->length == sizeof p->line, waits = p->request != NULL;
        polled[2 + i] = (struct pollfd){.fd = full || p->ended ? -1 : p->fd, .events = POLLIN};
        if (p->fd >= 0 && !waits && (full || memchr(p->line, '\n', p->length))) timeout_ms = 0;
    }
    if (poll(polled, 2 + KN_CONTROL_PEERS, timeout_ms) < 0) return;
    // For each peer: read, carry out urgent lines, then serve one line. Disconnect a peer that has finished sending and
    // has been answered.
    for (int i = 0; i < KN_CONTROL_PEERS; i++) {
        peer *p = &c->peers[i];
        if (polled[2 + i].revents) listen_to(p);
        if (p->fd >= 0 && c->def.urgent) hasten(c, p);
        if (p->fd >= 0 && !p->request) hear(c, p);
        if (p->fd >= 0 && p->ended && !p->request && !memchr(p->line, '\n', p->length)) hang_up(p);
    }
    collect(c);
    give(c);
    if (polled[0].revents) greet(c);
    tell_untold(c, kn_now_ns());
}

// Refuse the slow request of a peer, because no worker will answer it.
static void refuse_slow(const kn_control *c, peer *p)
{
    if (!p->request) return;
    answer(c, p, p->request, kn_control_error("the server is stopping: the command is not carried out"));
    json_decref(p->request);
    p->request = NULL;
}

void kn_control_drain(kn_control *c)
{
    int64_t end_ns = kn_now_ns() + KN_CONTROL_LAST_MS * INT64_C(1000000);
    // Send the worker's last answer, and accept the connections that wait.
    collect(c);
    for (int i = 0; i < KN_CONTROL_PEERS; i++) greet(c);
    for (int i = 0; i < KN_CONTROL_PEERS; i++) {
        peer *p = &c->peers[i];
        if (p->fd < 0 || i == c->job_peer) continue; // skip the peer whose request the worker is still answering
        refuse_slow(c, p);
        while (p->fd >= 0 && kn_now_ns() < end_ns) {
            if (!p->ended && p->length < sizeof p->line) listen_to(p);
            if (p->fd < 0 || (p->length < sizeof p->line && !memchr(p->line, '\n', p->length))) break;
            hear(c, p);
            refuse_slow(c, p);
        }
    }
}
