// stock: hears KNEAD_POSE_* and KNEAD_MESH_UPDATE as any program does that is built against liblcm, by subscriptions
// and decoders of lcm-gen, in a process of its own; and tells what became of it, in one line, once that has ended, or
// after SIGTERM. Beside it a socket of our own counts the datagrams of the stream: those of senders that were silent
// until "ready" was printed.
#include "proto/knead_mesh_update_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include <arpa/inet.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define URL "udpm://239.255.76.67:7667?ttl=0"

static volatile sig_atomic_t ended;

static void on_signal(int number)
{
    ended = number;
}

// --- what a user writes ---

static volatile double last_x;

static void hear_pose(const lcm_recv_buf_t *buffer, const char *channel, const knead_probe_pose_t *pose, void *user)
{
    (void)buffer, (void)channel, (void)user;
    last_x = pose->position_m[0];
}

static void hear_mesh(const lcm_recv_buf_t *buffer, const char *channel, const knead_mesh_update_t *mesh, void *user)
{
    (void)buffer, (void)channel, (void)user;
    if (mesh->position_count > 0) last_x = (double)mesh->positions_m[0];
}

static int subscribe(int ready)
{
    lcm_t *lcm = lcm_create(URL);
    if (!lcm || !knead_probe_pose_t_subscribe(lcm, "KNEAD_POSE_.*", hear_pose, NULL) ||
        !knead_mesh_update_t_subscribe(lcm, "KNEAD_MESH_UPDATE", hear_mesh, NULL))
        return 3;
    if (write(ready, "", 1) != 1) return 3;
    while (lcm_handle(lcm) == 0) continue;
    return 4;
}

// --- who watches it ---

static long memory_kb(pid_t pid)
{
    char path[40], line[100];
    long kb = 0;
    snprintf(path, sizeof path, "/proc/%d/status", (int)pid);
    FILE *file = fopen(path, "r");
    while (file && fgets(line, sizeof line, file)) sscanf(line, "VmRSS: %ld", &kb);
    if (file) fclose(file);
    return kb;
}

static int listen_to_group(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons(7667)};
    struct ip_mreqn group = {.imr_ifindex = 1};
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0), on = 1, room = 8 << 20;
    inet_pton(AF_INET, "239.255.76.67", &at.sin_addr);
    group.imr_multiaddr = at.sin_addr;
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room) != 0)
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    bool fine = setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
                bind(fd, (const struct sockaddr *)&at, sizeof at) == 0 &&
                setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0;
    return fine ? fd : -1;
}

static bool other[65536]; // ports: who sent before the stream

// Takes what waits; how much of it is of the stream.
static int64_t drain(int fd, bool before)
{
    int64_t count = 0;
    unsigned char bytes[64];
    struct sockaddr_in from;
    for (socklen_t size = sizeof from; recvfrom(fd, bytes, sizeof bytes, 0, (struct sockaddr *)&from, &size) >= 0;) {
        if (before) other[from.sin_port] = true;
        count += !other[from.sin_port];
        size = sizeof from;
    }
    return count;
}

int main(void)
{
    int ready[2], status = 0;
    char byte;
    if (pipe(ready) != 0) return 3;
    pid_t user = fork();
    if (user == 0) _exit(subscribe(ready[1]));
    close(ready[1]);
    int fd = listen_to_group();
    sigaction(SIGTERM, &(struct sigaction){.sa_handler = on_signal}, NULL);
    if (user < 0 || fd < 0 || read(ready[0], &byte, 1) != 1) return 3;
    for (int64_t end_ns = kn_now_ns() + 1200000000; kn_now_ns() < end_ns; usleep(1000)) drain(fd, true);
    puts("ready");
    fflush(stdout);

    int64_t datagrams = 0, first_ns = 0, last_ns = 0, count;
    long before_kb = memory_kb(user), most_kb = before_kb;
    pid_t gone = 0;
    while (!ended && (gone = waitpid(user, &status, WNOHANG)) == 0) {
        poll(&(struct pollfd){.fd = fd, .events = POLLIN}, 1, 1);
        if ((count = drain(fd, false)) > 0) last_ns = kn_now_ns();
        if (datagrams == 0 && count > 0) first_ns = last_ns;
        datagrams += count;
        long kb = memory_kb(user);
        if (kb > most_kb) most_kb = kb;
    }
    if (gone == 0) {
        kill(user, SIGKILL);
        waitpid(user, NULL, 0);
    }
    char fate[64] = "lives";
    if (gone && WIFSIGNALED(status))
        snprintf(fate, sizeof fate, "died of SIG%s", sigabbrev_np(WTERMSIG(status)));
    else if (gone)
        snprintf(fate, sizeof fate, "ended with %d", WEXITSTATUS(status));
    printf("liblcm %d.%d.%d %s %" PRId64 " ms and %" PRId64 " datagrams into the stream; its memory grew by %ld kB\n",
           LCM_MAJOR_VERSION, LCM_MINOR_VERSION, LCM_MICRO_VERSION, fate,
           ((gone ? kn_now_ns() : last_ns) - first_ns) / 1000000, datagrams, most_kb - before_kb);
    return 0;
}
