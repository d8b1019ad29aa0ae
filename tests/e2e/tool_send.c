// send PROBE <<EOF: send any datagrams to a kneadd from a socket of its own, for tests.
//
//     poses COUNT session=S seq=Q [step=1] [rate=1000] [utime=U] [x=0] [z=0.2] [vz=0] [leave]
//     flood COUNT seed=S [rate=50000]
//     sleep MS
//
// poses: seq rises by step, and utime is seq in ms. leave: the last pose announces the end of the session. flood:
// variants of poses (kn_random_datagram), each of its own session. rate=0: as fast as possible. SIGTERM ends the
// sending. The program prints the number of datagrams sent.
#include "server/clock.h"
#include "tests/server/datagram.h"
#include <arpa/inet.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>

static int fd;
static struct sockaddr_in group;
static char channel[64];
static int64_t sent;
static volatile sig_atomic_t ended;

static void on_term(int number) { ended = number; }

static void send_bytes(const unsigned char *bytes, size_t size)
{
    sent += sendto(fd, bytes, size, 0, (const struct sockaddr *)&group, sizeof group) == (ssize_t)size;
}

static double option(const char *line, const char *name, double otherwise)
{
    const char *at = strstr(line, name);
    return at ? strtod(at + strlen(name), NULL) : otherwise; // strtod also reads nan and inf
}

// Sleep until the n-th message of a stream is due. A sender that was held up catches up.
static void pace(int64_t start_ns, int64_t n, double rate)
{
    int64_t ahead_ns = start_ns + (int64_t)(1e9 * (double)n / rate) - kn_now_ns();
    if (ahead_ns > 500000) nanosleep(&(struct timespec){.tv_nsec = ahead_ns}, NULL);
}

static void send_poses(const char *line, int64_t count)
{
    int64_t seq = (int64_t)option(line, " seq=", 1), step = (int64_t)option(line, " step=", 1), start_ns = kn_now_ns();
    int64_t utime = (int64_t)option(line, " utime=", 0);
    knead_probe_pose_t pose = {.session = (int64_t)option(line, " session=", 1),
                               .orientation_wxyz = {1, 0, 0, 0},
                               .position_m = {option(line, " x=", 0), 0, option(line, " z=", 0.2)},
                               .velocity_m_s = {0, 0, option(line, " vz=", 0)}};
    for (int64_t n = 0; n < count && !ended; n++, seq += step) {
        unsigned char bytes[KN_TEST_DATAGRAM];
        pace(start_ns, n, option(line, " rate=", 1000));
        pose.seq = seq;
        pose.utime = utime ? utime : 1000 * seq; // not the clock's time: a held-up sender would give other speeds
        pose.sent_ns = kn_now_ns();
        if (n + 1 == count && strstr(line, " leave")) pose.buttons = KNEAD_PROBE_POSE_T_BUTTON_LEAVING;
        size_t size = kn_pose_datagram(bytes, sizeof bytes, channel, &pose);
        send_bytes(bytes, size);
    }
}

// --- many datagrams at once ---

enum { BATCH = 64 };
static unsigned char batch[BATCH][KN_TEST_DATAGRAM];
static size_t batch_size[BATCH];

static void send_batch(int count)
{
    struct mmsghdr message[BATCH] = {0};
    struct iovec vector[BATCH];
    for (int i = 0; i < count; i++) {
        vector[i] = (struct iovec){batch[i], batch_size[i]};
        message[i].msg_hdr =
            (struct msghdr){.msg_name = &group, .msg_namelen = sizeof group, .msg_iov = &vector[i], .msg_iovlen = 1};
    }
    for (int from = 0, n; from < count; from += n) {
        n = sendmmsg(fd, message + from, (unsigned)(count - from), 0);
        if (n <= 0) return;
        sent += n;
    }
}

typedef size_t make(unsigned char bytes[KN_TEST_DATAGRAM], uint64_t *random, int64_t n);

static void send_many(const char *line, int64_t count, make *one)
{
    uint64_t random = (uint64_t)option(line, " seed=", 1);
    double rate = option(line, " rate=", 50000);
    int64_t start_ns = kn_now_ns();
    for (int64_t n = 0; n < count && !ended; n += BATCH) {
        int size = count - n < BATCH ? (int)(count - n) : BATCH;
        for (int i = 0; i < size; i++) batch_size[i] = one(batch[i], &random, n + i);
        if (rate > 0) pace(start_ns, n, rate);
        send_batch(size);
    }
}

static size_t relative(unsigned char bytes[KN_TEST_DATAGRAM], uint64_t *random, int64_t n)
{
    knead_probe_pose_t pose = {
        .session = 1000000 + n, .seq = n, .utime = n, .orientation_wxyz = {1, 0, 0, 0}, .position_m = {0, 0, 0.2}};
    return kn_random_datagram(bytes, random, channel, pose);
}

int main(int argc, char **argv)
{
    if (argc != 2) return 2;
    sigaction(SIGTERM, &(struct sigaction){.sa_handler = on_term}, NULL);
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", argv[1]);
    group.sin_family = AF_INET;
    group.sin_port = htons(7667);
    inet_pton(AF_INET, "239.255.76.67", &group.sin_addr);
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &(unsigned char){0}, 1) != 0) return 3;
    static const struct {
        const char *verb;
        make *one;
    } many[] = {{"flood", relative}};
    for (char line[256]; fgets(line, sizeof line, stdin);) {
        char verb[16] = "";
        long count = 0;
        size_t m = 0;
        if (sscanf(line, "%15s %ld", verb, &count) != 2) return 2;
        while (m < sizeof many / sizeof *many && strcmp(verb, many[m].verb) != 0) m++;
        if (strcmp(verb, "poses") == 0) send_poses(line, count);
        else if (m < sizeof many / sizeof *many) send_many(line, count, many[m].one);
        else if (strcmp(verb, "sleep") == 0) nanosleep(&(struct timespec){count / 1000, count % 1000 * 1000000}, NULL);
        else return 2;
    }
    printf("%" PRId64 "\n", sent);
    return 0;
}
