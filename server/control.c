#include "server/control.h"
#include "server/clock.h"
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define CREDIT_NS (1000000000 / KN_CONTROL_HZ) // of one command
#define GROUPS_MAX 256

typedef struct peer {
    int fd; // -1: nobody
    struct ucred who;
    int64_t paid_ns; // up to when the time has been spent on commands
    size_t length;   // of the line so far; KN_CONTROL_LINE: too long, its rest is passed over
    char line[KN_CONTROL_LINE];
} peer;

struct kn_control {
    int fd;
    struct stat own; // of the socket's file
    struct sockaddr_un at;
    kn_control_answer answer;
    void *self;
    peer peers[KN_CONTROL_PEERS];
};

json_t *kn_control_error(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    json_t *error = json_vsprintf(format, arguments);
    va_end(arguments);
    return json_pack("{s:b, s:o}", "ok", 0, "error", error ? error : json_string("out of memory, or no UTF-8"));
}

// --- the socket ---

static bool serves(const struct sockaddr_un *at) // whether somebody accepts there
{
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    bool yes = fd >= 0 && (connect(fd, (const struct sockaddr *)at, sizeof *at) == 0 || errno == EAGAIN);
    if (fd >= 0) close(fd);
    return yes;
}

// Why the path cannot be bound, NULL when it is free now.
static const char *make_room(const struct sockaddr_un *at)
{
    struct stat there;
    if (lstat(at->sun_path, &there) != 0) return NULL;
    if (!S_ISSOCK(there.st_mode)) return "exists and is no socket";
    if (serves(at)) return "another server answers there";
    return unlink(at->sun_path) == 0 ? NULL : strerror(errno);
}

kn_control *kn_control_open(const char *path, kn_control_answer answer, void *self, char *error, size_t error_size)
{
    kn_control *c = calloc(1, sizeof *c);
    const char *why = c ? NULL : "out of memory";
    if (c) {
        *c = (kn_control){.fd = -1, .at.sun_family = AF_UNIX, .answer = answer, .self = self};
        for (int i = 0; i < KN_CONTROL_PEERS; i++) c->peers[i].fd = -1;
        if (!*path || strlen(path) > KN_CONTROL_PATH) why = "expected a path of 1 to 107 bytes";
    }
    if (!why) {
        strcpy(c->at.sun_path, path);
        why = make_room(&c->at);
    }
    if (!why) {
        mode_t mask = umask(0117); // nobody else may connect, not even before a chmod
        c->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        if (c->fd < 0 || bind(c->fd, (const struct sockaddr *)&c->at, sizeof c->at) != 0 ||
            listen(c->fd, KN_CONTROL_PEERS) != 0 || lstat(path, &c->own) != 0)
            why = strerror(errno);
        umask(mask);
    }
    if (!why) return c;
    snprintf(error, error_size, "--control %s: %s", path, why);
    if (c && c->fd >= 0) close(c->fd);
    free(c);
    return NULL;
}

void kn_control_close(kn_control *c)
{
    struct stat now;
    if (!c) return;
    for (int i = 0; i < KN_CONTROL_PEERS; i++)
        if (c->peers[i].fd >= 0) close(c->peers[i].fd);
    if (lstat(c->at.sun_path, &now) == 0 && now.st_dev == c->own.st_dev && now.st_ino == c->own.st_ino)
        unlink(c->at.sun_path);
    close(c->fd);
    free(c);
}

// --- who is heard ---

static bool may_command(const kn_control *c, int fd, struct ucred *who)
{
    gid_t groups[GROUPS_MAX];
    socklen_t size = sizeof *who;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, who, &size) != 0) return false;
    if (who->uid == 0 || who->uid == geteuid() || who->gid == c->own.st_gid) return true;
    size = sizeof groups;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size) != 0) return false;
    for (size_t i = 0; i < size / sizeof *groups; i++)
        if (groups[i] == c->own.st_gid) return true;
    return false;
}

static void hang_up(peer *p)
{
    close(p->fd);
    p->fd = -1;
}

static void send_reply(peer *p, json_t *answer)
{
    char *text = answer ? json_dumps(answer, JSON_COMPACT | JSON_ENSURE_ASCII) : NULL;
    size_t size = text ? strlen(text) : 0;
    if (text) text[size++] = '\n'; // in the NUL's place
    if (!text || send(p->fd, text, size, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)size) hang_up(p); // nobody reads
    free(text);
    json_decref(answer);
}

static void greet(kn_control *c)
{
    int fd = accept4(c->fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) return;
    peer one = {.fd = fd}, *p = &one;
    bool known = may_command(c, fd, &one.who);
    if (!known) fprintf(stderr, "kneadd: control: uid %d pid %d: refused\n", (int)one.who.uid, (int)one.who.pid);
    for (int i = 0; i < KN_CONTROL_PEERS && known && p == &one; i++)
        if (c->peers[i].fd < 0) p = &c->peers[i];
    *p = one;
    if (p != &one) return;
    send_reply(p, known ? kn_control_error("too many connections, expected %d at most", KN_CONTROL_PEERS)
                   : kn_control_error("uid %d may not command this server", (int)one.who.uid));
    if (p->fd >= 0) hang_up(p);
}

// --- lines ---

static bool afford(peer *p)
{
    int64_t now_ns = kn_now_ns(), earliest_ns = now_ns - (int64_t)KN_CONTROL_HZ * CREDIT_NS;
    if (p->paid_ns < earliest_ns) p->paid_ns = earliest_ns;
    if (p->paid_ns + CREDIT_NS > now_ns) return false;
    p->paid_ns += CREDIT_NS;
    return true;
}

static void tell_audit(const peer *p, const json_t *request, const json_t *answer)
{
    const json_t *tick = json_object_get(answer, "tick"), *error = json_object_get(answer, "error");
    char *asked = json_dumps(request, JSON_COMPACT | JSON_ENSURE_ASCII);
    fprintf(stderr, "kneadd: control: uid %d pid %d: %.200s: ", (int)p->who.uid, (int)p->who.pid, asked ? asked : "?");
    if (error)
        fprintf(stderr, "refused: %.200s\n", json_string_value(error));
    else if (tick)
        fprintf(stderr, "tick %" PRId64 "\n", (int64_t)json_integer_value(tick));
    else
        fprintf(stderr, "done\n");
    free(asked);
}

// Reader and writer of JSON go down a level of the stack for each of these.
static int brackets(const char *line, size_t length)
{
    int count = 0;
    for (size_t i = 0; i < length; i++) count += line[i] == '[' || line[i] == '{';
    return count;
}

json_t *kn_control_judge(kn_control_answer answer, void *self, const char *line, size_t length, json_t **request)
{
    json_error_t why;
    *request = NULL;
    if (brackets(line, length) > KN_CONTROL_BRACKETS)
        return kn_control_error("more than %d of [ and {", KN_CONTROL_BRACKETS);
    json_t *asked = json_loadb(line, length, JSON_REJECT_DUPLICATES, &why);
    if (!asked) return kn_control_error("no JSON at byte %d, expected one object per line", why.position);
    bool audit = false;
    json_t *reply = json_is_object(asked) ? answer(self, asked, &audit) : kn_control_error("expected one object per line");
    if (audit) *request = asked;
    else json_decref(asked);
    return reply;
}

static json_t *judge(kn_control *c, const peer *p, size_t length)
{
    json_t *request, *answer = kn_control_judge(c->answer, c->self, p->line, length, &request);
    if (request) tell_audit(p, request, answer);
    json_decref(request);
    return answer;
}

static void hear(kn_control *c, peer *p, const char *bytes, size_t size)
{
    for (size_t i = 0; i < size && p->fd >= 0; i++) {
        if (bytes[i] != '\n') {
            if (p->length < KN_CONTROL_LINE) p->line[p->length++] = bytes[i];
            continue;
        }
        size_t length = p->length;
        p->length = 0;
        if (length == KN_CONTROL_LINE)
            send_reply(p, kn_control_error("a line of more than %d bytes", KN_CONTROL_LINE - 1));
        else if (!afford(p))
            send_reply(p, kn_control_error("more than %d commands a second", KN_CONTROL_HZ));
        else
            send_reply(p, judge(c, p, length));
    }
}

void kn_control_turn(kn_control *c, int timeout_ms)
{
    struct pollfd polled[1 + KN_CONTROL_PEERS] = {{.fd = c->fd, .events = POLLIN}};
    char bytes[KN_CONTROL_LINE];
    for (int i = 0; i < KN_CONTROL_PEERS; i++) polled[1 + i] = (struct pollfd){.fd = c->peers[i].fd, .events = POLLIN};
    if (poll(polled, 1 + KN_CONTROL_PEERS, timeout_ms) <= 0) return;
    for (int i = 0; i < KN_CONTROL_PEERS; i++) {
        peer *p = &c->peers[i];
        if (!polled[1 + i].revents) continue;
        ssize_t size = recv(p->fd, bytes, sizeof bytes, 0);
        if (size > 0)
            hear(c, p, bytes, (size_t)size);
        else if (size == 0 || (errno != EAGAIN && errno != EINTR))
            hang_up(p);
    }
    if (polled[0].revents) greet(c);
}
