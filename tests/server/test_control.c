#include "server/control.h"
#include "server/clock.h"
#include "tests/check.h"
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

OWNS(kn_control, kn_control_close)

#define OK(request) "{\"ok\":true,\"request\":" request "}\n" // the answer to a request

static char path[64];
static sem_t hurry; // a slow answer waits for this semaphore
static _Atomic int answered;
static int silent[2]; // the real stderr, and the pipe that replaces it

static bool has(const json_t *request, const char *key) { return json_object_get(request, key) != NULL; }
static json_t *answer(void *self, const json_t *request)
{
    (void)self;
    answered++;
    if (has(request, "slow")) sem_wait(&hurry);
    return json_pack("{s:b, s:O}", "ok", 1, "request", request);
}

static bool audits(void *self, const json_t *request) { return (void)self, has(request, "audit"); }
static bool slow(void *self, const json_t *request) { return (void)self, has(request, "slow"); }
static bool urgent(void *self, const json_t *request) { return (void)self, has(request, "urgent"); }

static const kn_control_def def = {NULL, answer, audits, slow, urgent};

static kn_control *start(void)
{
    char error[256] = "";
    if (!*path) snprintf(path, sizeof path, "control.%d", (int)getpid());
    kn_control *c = kn_control_open(path, &def, error, sizeof error);
    if (!c) KN_TEST_FAIL("%s", error);
    answered = 0;
    return c;
}

static int connection(void) // -1: refused
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    strcpy(at.sun_path, path);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    return connect(fd, (struct sockaddr *)&at, sizeof at) == 0 ? fd : -1;
}

static int dial(void)
{
    int fd = connection();
    CHECK(fd >= 0);
    return fd;
}

// Return the reply after some turns: "" for none, "closed" for an end without a word.
static const char *hear(kn_control *c, int fd)
{
    static char text[1 << 16];
    size_t size = 0;
    ssize_t got = 0;
    for (int i = 0; i < 20; i++) {
        kn_control_turn(c, 0);
        while (size < sizeof text - 1 && (got = recv(fd, text + size, sizeof text - 1 - size, MSG_DONTWAIT)) > 0)
            size += (size_t)got;
    }
    text[size] = '\0';
    return size == 0 && got == 0 ? "closed" : text;
}

static const char *say(kn_control *c, int fd, const char *line)
{
    CHECK(send(fd, line, strlen(line), MSG_NOSIGNAL) == (ssize_t)strlen(line));
    return hear(c, fd);
}

static void hush(void) // redirect stderr into a pipe
{
    fflush(stderr);
    int keep = dup(2), ends[2];
    CHECK(pipe2(ends, O_NONBLOCK) == 0 && dup2(ends[1], 2) == 2);
    close(ends[1]);
    silent[0] = keep, silent[1] = ends[0];
}

static const char *unhush(void)
{
    static char told[1 << 15];
    fflush(stderr);
    ssize_t size = read(silent[1], told, sizeof told - 1);
    told[size > 0 ? size : 0] = '\0';
    dup2(silent[0], 2);
    close(silent[0]), close(silent[1]);
    return told;
}

TEST("a line is a request in any number of pieces, and each request gets one line back")
{
    kn_control *c = start();
    int fd = dial();
    CHECK_STR(say(c, fd, "{\"a\":"), "");
    CHECK_STR(say(c, fd, "1}\n"), OK("{\"a\":1}"));
    CHECK_STR(say(c, fd, "{}\n{}\n{"), OK("{}") OK("{}"));
    CHECK_STR(say(c, fd, "}\n"), OK("{}"));
    close(fd);
    fd = dial(); // the sender does not wait for the answer
    CHECK(send(fd, "{\"b\":2}\n", 8, 0) == 8);
    close(fd);
    answered = 0;
    for (int i = 0; i < 5; i++) kn_control_turn(c, 0);
    CHECK(answered == 1);
    fd = dial(); // a request without a newline, then half a request
    CHECK(send(fd, "{\"c\":3}\n{\"d\":4}", 15, 0) == 15 && shutdown(fd, SHUT_WR) == 0);
    CHECK_STR(hear(c, fd), OK("{\"c\":3}") OK("{\"d\":4}"));
    close(fd);
    fd = dial();
    CHECK(send(fd, "{\"e\":", 5, 0) == 5 && shutdown(fd, SHUT_WR) == 0);
    CHECK(strstr(hear(c, fd), "not JSON at byte"));
    close(fd);
    kn_control_close(c);
    CHECK(access(path, F_OK) != 0);
}

// Send a request as another user and return the reply. Return "refused" if the mode of the socket's file forbids it.
static const char *ask_as(kn_control *c, uid_t uid, gid_t gid)
{
    static char told[300];
    int ends[2];
    CHECK(pipe(ends) == 0);
    pid_t child = fork();
    if (child == 0) {
        int fd = setgroups(0, NULL) == 0 && setgid(gid) == 0 && setuid(uid) == 0 ? connection() : -1;
        if (fd >= 0) send(fd, "{}\n", 3, MSG_NOSIGNAL); // a refusal may come before the request
        ssize_t size = fd >= 0 ? recv(fd, told, sizeof told, 0) : -1;
        if (size < 0) size = snprintf(told, sizeof told, "%s", errno == EACCES ? "refused" : strerror(errno));
        _exit(write(ends[1], told, (size_t)size) == size ? 0 : 1);
    }
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) kn_control_turn(c, 10);
    ssize_t size = read(ends[0], told, sizeof told - 1);
    told[size > 0 ? size : 0] = '\0';
    close(ends[0]), close(ends[1]);
    return told;
}

TEST("only root, the server's own user and its group may send commands; others are refused and logged")
{
    enum { NOBODY = 65534 };
    if (geteuid() != 0) return; // only root can become another user
    OWN(kn_control) *c = start();
    CHECK_STR(ask_as(c, NOBODY, NOBODY), "refused");
    chmod(path, 0666); // even if the file's mode allows everybody
    hush();
    for (int i = 0; i < 3; i++)
        CHECK_STR(ask_as(c, NOBODY, NOBODY), "{\"ok\":false,\"error\":\"uid 65534 may not command this server\"}\n");
    const char *told = unhush();
    CHECK(answered == 0 && strstr(told, "kneadd: control: uid 65534 pid ") && strstr(told, ": refused\n"));
    CHECK_STR(ask_as(c, NOBODY, getegid()), OK("{}"));
}

TEST("a line that is not a JSON object is refused with the place of the error and not executed")
{
    static const struct {
        const char *line, *says;
    } bad[] = {{"\n", "not JSON at byte"},
               {"reset\n", "not JSON at byte"},
               {"{\"a\":1\n", "not JSON at byte"},
               {"{\"a\":1}{}\n", "not JSON at byte"},
               {"{\"a\":1,\"a\":2}\n", "not JSON at"},
               {"[1]\n", "expected one JSON object per line"},
               {"\xff\xfe{}\n", "not JSON at byte"},
               {"{\"a\":1e999}\n", "not JSON at byte"}};
    OWN(kn_control) *c = start();
    int fd = dial();
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        const char *told = say(c, fd, bad[i].line);
        if (!strstr(told, bad[i].says) || strncmp(told, "{\"ok\":false,\"error\":", 20) != 0)
            KN_TEST_FAIL("%s is answered %s", bad[i].line, told);
    }
    CHECK(answered == 0);
    CHECK_STR(say(c, fd, "{}\n"), OK("{}")); // the next request is still answered
    close(fd);
}

TEST("a line of a megabyte gets one error, deep nesting another, and random bytes are never executed")
{
    OWN(kn_control) *c = start();
    int fd = dial();
    static char many[5000];
    memset(many, 'x', sizeof many - 1);
    CHECK_STR(say(c, fd, many), "{\"ok\":false,\"error\":\"a line of more than 4095 bytes\"}\n");
    for (int i = 0; i < 200; i++) CHECK_STR(say(c, fd, many), "");
    CHECK_STR(say(c, fd, "\n"), "");
    memset(many, '[', 4000);
    many[4000] = '\0';
    CHECK_STR(say(c, fd, many), "");
    CHECK(strstr(say(c, fd, "\n"), "more than 64 brackets [ and {"));
    unsigned random = 1;
    for (int round = 0; round < 60; round++) {
        for (size_t k = 0; k < 500; k++) many[k] = (char)((random = random * 1664525u + 1013904223u) >> 24 | 1);
        many[500] = '\0';
        say(c, fd, many);
    }
    CHECK(answered == 0);
    say(c, fd, "\n");
    CHECK_STR(say(c, fd, "{}\n"), OK("{}"));
    close(fd);
}

TEST("after a hundred commands at once a peer may send a hundred a second, and other peers are still answered")
{
    OWN(kn_control) *c = start();
    int fd = dial(), other = dial();
    int refused = 0;
    int64_t start_ns = kn_now_ns();
    for (int i = 0; i < 300; i++) refused += strstr(say(c, fd, "{}\n"), "commands a second") != NULL;
    int64_t paid = (kn_now_ns() - start_ns) / 10000000; // commands allowed by the time passed
    CHECK(answered >= 100 && answered <= 101 + paid && refused == 300 - answered);
    CHECK_STR(say(c, other, "{}\n"), OK("{}"));
    close(fd), close(other);
}

TEST("an urgent command is answered despite the rate limit, and a flood of urgent commands is executed once per turn")
{
    static const char line[] = "{\"urgent\":1}\n", ok[] = OK("{\"urgent\":1}");
    OWN(kn_control) *c = start();
    int fd = dial(), size = 0;
    bool refused = false;
    for (int i = 0; i < 1000 && !refused; i++) refused = strstr(say(c, fd, "{}\n"), "commands a second") != NULL;
    CHECK(refused);
    for (int i = 0; i < 50; i++) CHECK_STR(say(c, fd, line), ok);
    static char flood[4096], *at = flood;
    for (size_t i = 0; i < 250; i++) at = stpcpy(at, line);
    answered = 0;
    hush();
    CHECK(send(fd, flood, strlen(flood), MSG_NOSIGNAL) == (ssize_t)strlen(flood));
    for (int i = 0; i < 300; i++) kn_control_turn(c, 0);
    CHECK(answered == 1);
    CHECK(strlen(unhush()) < 200);
    while ((size = (int)recv(fd, flood, sizeof flood, MSG_DONTWAIT)) > 0) answered += size;
    CHECK(answered == 1 + 250 * (int)strlen(ok));
    close(fd);
}

TEST("an urgent command done early is repeated in its turn if a command before it may have undone it")
{
    OWN(kn_control) *c = start();
    int fd = dial();
    hush();
    CHECK_STR(say(c, fd, "{\"urgent\":1}\n{\"audit\":1}\n{\"urgent\":2}\n"),
              OK("{\"urgent\":2}") OK("{\"audit\":1}") OK("{\"urgent\":2}"));
    unhush();
    CHECK(answered == 3);
    close(fd);
}

TEST("a ninth peer replaces the peer that was silent the longest")
{
    OWN(kn_control) *c = start();
    int fd[KN_CONTROL_PEERS];
    for (int i = 0; i < KN_CONTROL_PEERS; i++) {
        fd[i] = dial();
        kn_control_turn(c, 0);
    }
    for (int i = 0; i < KN_CONTROL_PEERS; i++)
        if (i != 3) CHECK_STR(say(c, fd[i], "{}\n"), OK("{}"));
    CHECK_STR(say(c, fd[3], "{\"command\":"), ""); // begins a request and does not finish it
    int late = dial();
    CHECK_STR(say(c, late, "{}\n"), OK("{}"));
    CHECK(strstr(hear(c, fd[3]), "yours was silent the longest"));
    CHECK_STR(hear(c, fd[3]), "closed");
    close(fd[3]);
    for (int i = 0; i < KN_CONTROL_PEERS; i++)
        if (i != 3) close(fd[i]);
    close(late);
}

TEST("a peer that does not read its answers is disconnected when they no longer fit, and delays nobody")
{
    OWN(kn_control) *c = start();
    int fd = dial(), other = dial(), small = 1;
    CHECK(setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &small, sizeof small) == 0);
    bool gone = false;
    static char line[4000];
    memset(line, 'x', sizeof line);
    memcpy(line, "{\"a\":\"", 6);
    memcpy(line + sizeof line - 4, "\"}\n", 4);
    for (int i = 0; i < 100 && !gone; i++) {
        gone = send(fd, line, strlen(line), MSG_NOSIGNAL | MSG_DONTWAIT) < 0;
        kn_control_turn(c, 0);
    }
    CHECK(gone);
    CHECK_STR(say(c, other, "{}\n"), OK("{}"));
    close(fd), close(other);
}

TEST("the socket has mode 0660 and replaces a dead socket, but not a live one or a file")
{
    char error[256] = "";
    struct stat there;
    OWN(kn_control) *c = start();
    CHECK(stat(path, &there) == 0 && S_ISSOCK(there.st_mode) && (there.st_mode & 0777) == 0660);
    CHECK(!kn_control_open(path, &def, error, sizeof error) && strstr(error, "another server answers there"));
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "dead.%d", (int)getpid());
    int dead = socket(AF_UNIX, SOCK_STREAM, 0);
    CHECK(bind(dead, (struct sockaddr *)&at, sizeof at) == 0);
    close(dead);
    kn_control *again = kn_control_open(at.sun_path, &def, error, sizeof error);
    CHECK(again);
    kn_control_close(again);
    close(open(at.sun_path, O_CREAT | O_WRONLY, 0600));
    CHECK(!kn_control_open(at.sun_path, &def, error, sizeof error) && strstr(error, "exists and is not a socket"));
    CHECK(access(at.sun_path, F_OK) == 0 && unlink(at.sun_path) == 0);
    CHECK(!kn_control_open("/nowhere/at/all", &def, error, sizeof error));
    CHECK_STR(error, "--control /nowhere/at/all: No such file or directory");
}

TEST("a change is logged with its user, a query is not, and control characters are escaped")
{
    OWN(kn_control) *c = start();
    int fd = dial();
    char expected[128];
    hush();
    say(c, fd, "{}\n{\"audit\":\"\\u001b[31m\\n\"}\n");
    const char *told = unhush();
    snprintf(expected, sizeof expected, "kneadd: control: uid %d pid %d: {\"audit\":\"\\u001B[31m\\n\"}: done\n",
             (int)getuid(), (int)getpid());
    CHECK_STR(told, expected);
    close(fd);
}

TEST("a request is logged in full, and invalid lines are counted in the log at most once a second")
{
    static char line[KN_CONTROL_LINE];
    kn_control *c = start();
    int fd = dial(), bad = 0, lines = 0;
    memset(line, 'x', sizeof line - 1);
    memcpy(line, "{\"audit\":\"", 10);
    strcpy(line + sizeof line - 8, "LAST\"}\n");
    hush();
    say(c, fd, line);
    const char *told = unhush();
    size_t all = 0;
    for (const char *at = told; *at; at++) all += *at == 'x', lines += *at == '\n';
    CHECK(all == strlen(line) - 17 && lines == 2 && strstr(told, "LAST\"}: done\n"));
    hush();
    int64_t from_ns = kn_now_ns();
    for (int i = 0; i < 50; i++) say(c, fd, "no request\n");
    kn_control_close(c); // closing reports the rest
    told = unhush();
    for (lines = 0; (told = strstr(told, "above 100 a second: ")); lines++) bad += atoi(told += 20);
    CHECK(bad == 50 && lines >= 1 && lines <= 2 + (kn_now_ns() - from_ns) / 1000000000);
    close(fd);
}

static const char *await(kn_control *c, int fd, int lines)
{
    static char all[4096];
    all[0] = '\0';
    for (int i = 0; i < 5000 && lines > 0; i++, usleep(1000)) {
        const char *text = hear(c, fd);
        strncat(all, text, sizeof all - 1 - strlen(all));
        while ((text = strchr(text, '\n'))) text++, lines--;
    }
    return all;
}

static void *work(void *control) { return kn_control_work(control), NULL; }

TEST("peers are served in turn, one line each, and no peer waits for another's slow request")
{
    OWN(kn_control) *c = start();
    pthread_t worker;
    sem_init(&hurry, 0, 0);
    CHECK(pthread_create(&worker, NULL, work, c) == 0);
    int fd = dial(), second = dial(), other = dial();
    CHECK_STR(say(c, fd, "{\"slow\":1}\n{\"slow\":2}\n{}\n"), "");
    CHECK_STR(say(c, second, "{\"slow\":3}\n"), "");
    for (int i = 0; i < 10; i++) CHECK_STR(say(c, other, "{}\n"), OK("{}"));
    sem_post(&hurry);
    CHECK_STR(await(c, fd, 1), OK("{\"slow\":1}"));
    sem_post(&hurry); // next is the request of the other peer, who has waited longer
    CHECK_STR(await(c, second, 1), OK("{\"slow\":3}"));
    for (int i = 0; i < 5000 && answered < 13; i++) usleep(1000);
    close(fd); // while one of its requests is at work
    sem_post(&hurry);
    for (int i = 0; i < 20; i++) hear(c, other), usleep(1000);
    CHECK_STR(say(c, other, "{}\n"), OK("{}"));
    CHECK(answered == 10 + 3 + 1);
    fd = dial();
    CHECK_STR(say(c, fd, "{\"slow\":4}\n{}\n"), "");
    // queued behind the peer's own requests: done at once, answered in order
    CHECK_STR(say(c, fd, "{\"urgent\":1}\n"), "");
    for (int i = 0; i < 5000 && answered < 16; i++) usleep(1000);
    CHECK(answered == 16);
    sem_post(&hurry);
    CHECK_STR(await(c, fd, 3), OK("{\"slow\":4}") OK("{}") OK("{\"urgent\":1}"));
    CHECK(answered == 17);
    CHECK_STR(say(c, fd, "{\"slow\":5}\n{}\n"), "");
    CHECK_STR(say(c, other, "{}\n"), OK("{}"));
    close(fd); // with an answer unread and a request at work
    for (int i = 0; i < 5; i++) kn_control_turn(c, 0);
    sem_post(&hurry);
    for (int i = 0; i < 20; i++) hear(c, other), usleep(1000);
    CHECK_STR(say(c, other, "{}\n"), OK("{}"));
    kn_control_end(c);
    pthread_join(worker, NULL);
    close(second), close(other);
}

static const char *heard(int fd) // without a turn of the server
{
    static char text[4096];
    ssize_t got = recv(fd, text, sizeof text - 1, MSG_DONTWAIT);
    text[got > 0 ? got : 0] = '\0';
    return text;
}

#define REFUSED "{\"ok\":false,\"error\":\"the server is stopping: the command is not carried out\"}\n"

TEST("at the end pending commands are answered in order; slow ones are refused unless their answer is ready")
{
    kn_control *c = start();
    sem_init(&hurry, 0, 1);
    int fd = dial(), second = dial(), third = dial();
    CHECK_STR(say(c, fd, "{\"slow\":1}\n{\"stop\":1}\n{\"slow\":2}\n"), "");
    CHECK_STR(say(c, second, "{\"slow\":3}\n{\"stop\":2}\n{\"half\":"), "");
    CHECK(send(third, "{\"stop\":3}\n", 11, MSG_NOSIGNAL) == 11); // the server has not read from this peer yet
    int fourth = dial();                                          // nor accepted this one
    CHECK(send(fourth, "{\"stop\":4}\n", 11, MSG_NOSIGNAL) == 11);
    kn_control_end(c);
    kn_control_work(c); // finish the last slow request
    kn_control_drain(c);
    CHECK_STR(heard(fd), OK("{\"slow\":1}") OK("{\"stop\":1}") REFUSED);
    CHECK_STR(heard(second), REFUSED OK("{\"stop\":2}"));
    CHECK_STR(heard(third), OK("{\"stop\":3}"));
    CHECK_STR(heard(fourth), OK("{\"stop\":4}"));
    kn_control_close(c);
    close(fd), close(second), close(third), close(fourth);
    sem_destroy(&hurry);
}

TESTS_MAIN
