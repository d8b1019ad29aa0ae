// A spacenavd without a puck: its socket and its protocol, for the real libspnav.
//
//     spacenavd SOCKET SECONDS [old]      old: protocol 0, no answer to a client that asks for another protocol
//
// Lines on stdin are commands:
//     push X Y Z RX RY RZ   push the puck so, from now on   button N 0|1
//     pull                  unplug the puck                 noise   200 events of random bytes
//     half                  half an event                   away, back   end or start the whole daemon
#include "server/clock.h"
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { MOTION, PRESS, RELEASE, DEVICE, CLIENTS = 8, ASK_PROTOCOL = 0x7faa5500 };

static int listener = -1, client[CLIENTS], clients, old, deaf;
static const char *path;

static void come(void)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "%s", path);
    unlink(path);
    listener = socket(AF_UNIX, SOCK_STREAM, 0);
    if (listener < 0 || bind(listener, (struct sockaddr *)&at, sizeof at) || listen(listener, CLIENTS)) exit(3);
}

static void go(void)
{
    while (clients > 0) close(client[--clients]);
    close(listener);
    unlink(path);
    listener = -1;
}

static void tell(const void *bytes, size_t size)
{
    for (int i = 0; i < clients; i++) send(client[i], bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
}

// Obey a line of stdin. Return false if the line is not understood.
static int obey(void)
{
    char text[80] = {0};
    int32_t e[8] = {0};
    int n, down;
    for (size_t i = 0; i + 1 < sizeof text && read(STDIN_FILENO, text + i, 1) == 1 && text[i] != '\n';) i++;
    if (!*text) return deaf = 1; // end of input
    if (sscanf(text, "push %d %d %d %d %d %d", e + 1, e + 2, e + 3, e + 4, e + 5, e + 6) == 6) {
        e[7] = 16, tell(e, sizeof e);
    } else if (sscanf(text, "button %d %d", &n, &down) == 2) {
        e[0] = down ? PRESS : RELEASE, e[1] = n, tell(e, sizeof e);
    } else if (!strncmp(text, "pull", 4)) {
        e[0] = DEVICE, e[1] = 1, tell(e, sizeof e);
    } else if (!strncmp(text, "noise", 5)) {
        unsigned seed = 1;
        for (int i = 0; i < 200; i++) {
            for (int k = 0; k < 8; k++) e[k] = (int32_t)((unsigned)rand_r(&seed) << 16 ^ (unsigned)rand_r(&seed));
            if (i % 4 == 0) e[0] &= 7; // a known kind, or nearly
            tell(e, sizeof e);
        }
        memset(e, 0, sizeof e), tell(e, sizeof e);
    } else if (!strncmp(text, "half", 4)) {
        tell(e, sizeof e / 2);
    } else if (!strncmp(text, "away", 4)) {
        go();
    } else if (!strncmp(text, "back", 4)) {
        come();
    } else {
        return fprintf(stderr, "spacenavd: %s?\n", text), 0;
    }
    return 1;
}

static void hear(const struct pollfd *wait)
{
    for (int i = clients - 1; i >= 0; i--) {
        int32_t ask;
        if (!wait[i].revents) continue;
        if (recv(client[i], &ask, sizeof ask, MSG_DONTWAIT) <= 0) {
            close(client[i]);
            client[i] = client[--clients];
        } else if ((ask & ~0xff) == ASK_PROTOCOL && !old) {
            ask = ASK_PROTOCOL | 1;
            send(client[i], &ask, sizeof ask, MSG_NOSIGNAL);
        }
    }
    if (wait[CLIENTS].revents && clients < CLIENTS) client[clients++] = accept(listener, NULL, NULL);
}

int main(int argc, char **argv)
{
    int seconds = argc > 2 ? atoi(argv[2]) : 0;
    if (seconds <= 0) return fprintf(stderr, "usage: spacenavd SOCKET SECONDS [old]\n"), 2;
    path = argv[1];
    old = argc > 3;
    come();
    for (int64_t end_ns = kn_now_ns() + 1000000000ll * seconds; kn_now_ns() < end_ns;) {
        struct pollfd wait[CLIENTS + 2];
        for (int i = 0; i < CLIENTS; i++)
            wait[i] = (struct pollfd){.fd = i < clients ? client[i] : -1, .events = POLLIN};
        wait[CLIENTS] = (struct pollfd){.fd = listener, .events = POLLIN};
        wait[CLIENTS + 1] = (struct pollfd){.fd = deaf ? -1 : STDIN_FILENO, .events = POLLIN};
        if (poll(wait, CLIENTS + 2, 1000) <= 0) continue;
        hear(wait);
        if (wait[CLIENTS + 1].revents && !obey()) return 2;
    }
    if (listener >= 0) go();
    return 0;
}
