// send PROBE <<EOF: what a test wants a kneadd to hear, from a socket of its own, so that it can send anything.
//
//     poses COUNT session=S seq=Q [step=1] [rate=1000] [utime=U] [x=0] [z=0.2] [vz=0]
//     flood COUNT seed=S [rate=50000]
//     sleep MS
//
// poses: seq rises by step, utime is seq in ms. flood: relatives of poses (kn_random_datagram), each of its own
// session. Prints how many datagrams it sent.
#include "tests/server/datagram.h"
#include <arpa/inet.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>

static int fd;
static struct sockaddr_in group;
static char channel[64];
static int64_t sent;

static void send_bytes(const unsigned char *bytes, size_t size)
{
    sent += sendto(fd, bytes, size, 0, (const struct sockaddr *)&group, sizeof group) == (ssize_t)size;
}

static double option(const char *line, const char *name, double otherwise)
{
    const char *at = strstr(line, name);
    return at ? strtod(at + strlen(name), NULL) : otherwise; // strtod reads nan and inf as well
}

static int64_t now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000) + t.tv_nsec / 1000;
}

// Sleeps until the n-th of a stream is due; one that was held up catches up.
static void pace(int64_t start_us, int64_t n, double rate)
{
    int64_t ahead_us = start_us + (int64_t)(1e6 * (double)n / rate) - now_us();
    if (ahead_us > 500) nanosleep(&(struct timespec){.tv_nsec = ahead_us * 1000}, NULL);
}

static void send_poses(const char *line, int64_t count)
{
    int64_t seq = (int64_t)option(line, " seq=", 1), step = (int64_t)option(line, " step=", 1), start_us = now_us();
    int64_t utime = (int64_t)option(line, " utime=", 0);
    knead_probe_pose_t pose = {.session = (int64_t)option(line, " session=", 1),
                               .orientation_wxyz = {1, 0, 0, 0},
                               .position_m = {option(line, " x=", 0), 0, option(line, " z=", 0.2)},
                               .velocity_m_s = {0, 0, option(line, " vz=", 0)}};
    for (int64_t n = 0; n < count; n++, seq += step) {
        unsigned char bytes[KN_TEST_DATAGRAM];
        pace(start_us, n, option(line, " rate=", 1000));
        pose.seq = seq;
        pose.utime = utime ? utime : 1000 * seq; // not the clock's: a held-up sender would make other speeds
        pose.sent_ns = now_us() * 1000;
        send_bytes(bytes, kn_pose_datagram(bytes, sizeof bytes, channel, &pose));
    }
}

static void flood(const char *line, int64_t count)
{
    uint64_t random = (uint64_t)option(line, " seed=", 1);
    int64_t start_us = now_us();
    for (int64_t n = 0; n < count; n++) {
        unsigned char bytes[KN_TEST_DATAGRAM];
        if (n % 64 == 0) pace(start_us, n, option(line, " rate=", 50000));
        knead_probe_pose_t pose = {
            .session = 1000000 + n, .seq = n, .utime = n, .orientation_wxyz = {1, 0, 0, 0}, .position_m = {0, 0, 0.2}};
        send_bytes(bytes, kn_random_datagram(bytes, &random, channel, pose));
    }
}

int main(int argc, char **argv)
{
    if (argc != 2) return 2;
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", argv[1]);
    group.sin_family = AF_INET;
    group.sin_port = htons(7667);
    inet_pton(AF_INET, "239.255.76.67", &group.sin_addr);
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &(unsigned char){0}, 1) != 0) return 3;
    for (char line[256]; fgets(line, sizeof line, stdin);) {
        char verb[16] = "";
        long count = 0;
        if (sscanf(line, "%15s %ld", verb, &count) != 2) return 2;
        if (strcmp(verb, "poses") == 0)
            send_poses(line, count);
        else if (strcmp(verb, "flood") == 0)
            flood(line, count);
        else if (strcmp(verb, "sleep") == 0)
            nanosleep(&(struct timespec){count / 1000, count % 1000 * 1000000}, NULL);
        else
            return 2;
    }
    printf("%" PRId64 "\n", sent);
    return 0;
}
