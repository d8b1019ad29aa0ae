#include "clients/knead/ask.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

// Longest wait for an answer from kneadd, s. kneadd answers in milliseconds, unless a request makes it build an object
// first.
#define PATIENCE_S 10
// Largest size of an answer from kneadd, bytes.
#define ANSWER_MAX (1 << 20)

// Connect to the control socket. Return the descriptor, or -1 with errno set.
static int dial(const char *path, int flags)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof at.sun_path) return errno = ENAMETOOLONG, -1;
    strcpy(at.sun_path, path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | flags, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&at, sizeof at) == 0) return fd;
    int why = errno;
    if (fd >= 0) close(fd);
    errno = why;
    return -1;
}

// Send the request over the socket as one line. Return false if not all bytes were sent.
static bool send_line(int fd, const json_t *request, int flags)
{
    char *text = json_dumps(request, JSON_COMPACT);
    size_t size = text ? strlen(text) : 0;
    if (text) text[size++] = '\n'; // replace the terminating NUL
    bool sent = text && send(fd, text, size, MSG_NOSIGNAL | flags) == (ssize_t)size;
    free(text);
    return sent;
}

static void tell_absence(const char *path, char *error, size_t error_size)
{
    snprintf(error, error_size, "%s: %s: is kneadd running with --control %s?", path, strerror(errno), path);
}

json_t *kn_ask_read(const char *text, size_t size)
{
    json_error_t why;
    return size > 0 && text[size - 1] == '\n' ? json_loadb(text, size, JSON_REJECT_DUPLICATES, &why) : NULL;
}

json_t *kn_ask(const char *path, const json_t *request, char *error, size_t error_size)
{
    int fd = dial(path, 0);
    if (fd < 0) {
        tell_absence(path, error, error_size);
        return NULL;
    }
    // Limit the wait, so that a server that hangs does not make this client hang.
    struct timeval patience = {.tv_sec = PATIENCE_S};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    char *text = malloc(ANSWER_MAX);
    size_t size = 0;
    // Read until the newline that ends the answer, an error, or the end of the connection.
    ssize_t got = text && send_line(fd, request, 0) ? 1 : -1;
    while (got > 0 && size < ANSWER_MAX && !(size > 0 && text[size - 1] == '\n')) {
        got = recv(fd, text + size, ANSWER_MAX - size, 0);
        if (got > 0) size += (size_t)got;
    }
    json_t *answer = got >= 0 ? kn_ask_read(text, size) : NULL;
    // Distinguish a program that is not kneadd, a server that does not answer, and a server that closes the connection.
    if (!answer)
        snprintf(error, error_size, "%s: %s", path,
                 size > 0                                               ? "the program that answers there is not kneadd"
                 : got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK) ? "no answer for 10 s"
                                                                        : "closed the connection without an answer");
    free(text);
    close(fd);
    return answer;
}

int kn_ask_begin(const char *path, const json_t *request, char *error, size_t error_size)
{
    int fd = dial(path, SOCK_NONBLOCK);
    if (fd < 0) tell_absence(path, error, error_size);
    else if (!send_line(fd, request, MSG_DONTWAIT)) {
        snprintf(error, error_size, "%s: %s", path, strerror(errno));
        close(fd);
        fd = -1;
    }
    return fd;
}
