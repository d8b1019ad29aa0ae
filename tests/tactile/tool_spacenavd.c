// A spacenavd that has no puck: its socket and its protocol, for the real libspnav to talk to.
//
//     spacenavd SOCKET SECONDS [EVENT]...        times since the first client came
//     at=MS:X,Y,Z,RX,RY,RZ   the puck is pushed so, from then on   button=MS:N:0|1
//     pull=MS                it is pulled out                      noise=MS       200 events of random bytes
//     half=MS                half an event                         hangup=MS:MS   is away, for so long
//     old                    protocol 0: says nothing to whoever asks for another
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

static int64_t begin_ms;
static int listener = -1, client[CLIENTS], clients, old;
static const char *path;

static int now_ms(void)
{
    int64_t ms = kn_now_ns() / 1000000;
    if (clients == 0 && begin_ms == 0) return -1;
    if (begin_ms == 0) begin_ms = ms;
    return (int)(ms - begin_ms);
}

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

static void listen_for(int ms)
{
    struct pollfd wait[1 + CLIENTS] = {{.fd = listener, .events = POLLIN}};
    for (int i = 0; i < clients; i++) wait[1 + i] = (struct pollfd){.fd = client[i], .events = POLLIN};
    if (poll(wait, 1 + (nfds_t)clients, ms) <= 0) return;
    for (int i = clients - 1; i >= 0; i--) {
        int32_t ask;
        if (!wait[1 + i].revents) continue;
        if (recv(client[i], &ask, sizeof ask, MSG_DONTWAIT) <= 0) {
            close(client[i]);
            client[i] = client[--clients];
        } else if ((ask & ~0xff) == ASK_PROTOCOL && !old) {
            ask = ASK_PROTOCOL | 1;
            send(client[i], &ask, sizeof ask, MSG_NOSIGNAL);
        }
    }
    if (wait[0].revents && clients < CLIENTS) client[clients++] = accept(listener, NULL, NULL);
}

// Does what is due in (last, now]. False: not understood.
static int happen(const char *text, int last, int now)
{
    int32_t e[8] = {0};
    int at, n, down, for_ms;
    if (sscanf(text, "at=%d:%d,%d,%d,%d,%d,%d", &at, e + 1, e + 2, e + 3, e + 4, e + 5, e + 6) == 7) {
        if (at > last && at <= now) e[7] = 16, tell(e, sizeof e);
    } else if (sscanf(text, "button=%d:%d:%d", &at, &n, &down) == 3) {
        if (at > last && at <= now) e[0] = down ? PRESS : RELEASE, e[1] = n, tell(e, sizeof e);
    } else if (sscanf(text, "pull=%d", &at) == 1) {
        if (at > last && at <= now) e[0] = DEVICE, e[1] = 1, tell(e, sizeof e);
    } else if (sscanf(text, "noise=%d", &at) == 1) {
        unsigned seed = 1;
        for (int i = 0; i < 200 && at > last && at <= now; i++) {
            for (int k = 0; k < 8; k++) e[k] = (int32_t)((unsigned)rand_r(&seed) << 16 ^ (unsigned)rand_r(&seed));
            if (i % 4 == 0) e[0] &= 7; // of a known kind, or nearly
            tell(e, sizeof e);
        }
        e[0] = e[1] = e[2] = e[3] = e[4] = e[5] = e[6] = 0;
        if (at > last && at <= now) tell(e, sizeof e);
    } else if (sscanf(text, "half=%d", &at) == 1) {
        if (at > last && at <= now) tell(e, sizeof e / 2);
    } else if (sscanf(text, "hangup=%d:%d", &at, &for_ms) == 2) {
        if (at > last && at <= now) go();
        if (at + for_ms > last && at + for_ms <= now) come();
    } else {
        return 0;
    }
    return 1;
}

int main(int argc, char **argv)
{
    int seconds = argc > 2 ? atoi(argv[2]) : 0;
    if (seconds <= 0) return fprintf(stderr, "usage: spacenavd SOCKET SECONDS [EVENT]...\n"), 2;
    path = argv[1];
    come();
    for (int last = -1, now; (now = now_ms()) < 1000 * seconds; last = now) {
        for (int i = 3; i < argc; i++) {
            if (!strcmp(argv[i], "old")) old = 1;
            else if (!happen(argv[i], last, now)) return fprintf(stderr, "spacenavd: %s?\n", argv[i]), 2;
        }
        if (listener >= 0) listen_for(5);
        else usleep(5000);
    }
    if (listener >= 0) go();
    return 0;
}
