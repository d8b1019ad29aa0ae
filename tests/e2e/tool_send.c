// send PROBE [KEY] <<EOF: what a test wants a kneadd to hear, from a socket of its own, so that it can send anything.
//
//     poses COUNT session=S seq=Q [step=1] [rate=1000] [utime=U] [x=0] [z=0.2] [vz=0] [leave]
//     flood COUNT seed=S [rate=50000]
//     forge COUNT seed=S [rate=50000]
//     sleep MS
//
// poses: seq rises by step, utime is seq in ms; leave: the last one says that the session ends; with a KEY (a file) they are
// signed under the life of the kneadd that answers, and kept. flood: relatives
// of poses (kn_random_datagram), each of its own session; rate=0: as fast as they are taken. forge: what a
// holder of the key never sends, or not now (kn_forged_datagram), of its own poses among others.
// SIGTERM ends what is being sent. Prints how many datagrams it sent.
#include "server/auth.h"
#include "server/bus.h"
#include "server/clock.h"
#include "tests/server/datagram.h"
#include <arpa/inet.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static int fd;
static struct sockaddr_in group;
static char channel[64];
static int64_t sent;
static kn_auth auth;
static bool keyed;
static volatile sig_atomic_t ended;

static void on_term(int number)
{
    ended = number;
}

// The life of the kneadd that answers a hello, and when it began by our clock.
static bool find_life(char *error, size_t error_size)
{
    kn_bus bus;
    kn_packet p;
    unsigned char bytes[KN_TEST_DATAGRAM], nonce[KN_AUTH_NONCE] = "a nonce";
    if (!kn_bus_parse(&bus, "udpm://239.255.76.67:7667?ttl=0", NULL, error, error_size)) return false;
    int ear = kn_bus_listen(&bus, 1 << 20, error, error_size);
    for (int64_t end_ns = kn_now_ns() + 3000000000; ear >= 0 && kn_now_ns() < end_ns;) {
        size_t size = kn_lc02(bytes, sizeof bytes, KN_HELLO_CHANNEL, nonce, sizeof nonce);
        size = kn_sign_datagram(bytes, size, KN_HELLO_CHANNEL, &auth, (kn_auth_stamp){0, 0});
        sendto(fd, bytes, size, 0, (const struct sockaddr *)&group, sizeof group);
        nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
        bool here;
        for (ssize_t n; (n = kn_bus_take(&bus, ear, bytes, sizeof bytes, &here)) >= 0;) {
            kn_auth_stamp stamp;
            if (kn_bus_unpack(bytes, (size_t)n, &p) != KN_FRAMED || !p.channel || strcmp(p.channel, KN_LIFE_CHANNEL) ||
                !kn_auth_check(&auth, p.channel, p.payload, p.size, &stamp))
                continue;
            auth.life = stamp.life;
            auth.born_ns = kn_now_ns() - 1000 * stamp.age_us;
            return close(ear) == 0;
        }
    }
    snprintf(error, error_size, "no kneadd with this key answers");
    return false;
}

static kn_auth_stamp now(void) { return (kn_auth_stamp){auth.life, (kn_now_ns() - auth.born_ns) / 1000}; }

static void send_bytes(const unsigned char *bytes, size_t size)
{
    sent += sendto(fd, bytes, size, 0, (const struct sockaddr *)&group, sizeof group) == (ssize_t)size;
}

static double option(const char *line, const char *name, double otherwise)
{
    const char *at = strstr(line, name);
    return at ? strtod(at + strlen(name), NULL) : otherwise; // strtod reads nan and inf as well
}

// What a listener has of this sender.
typedef struct kn_recording {
    unsigned char bytes[256];
    size_t size;
} kn_recording;
static kn_recording recording[4096];
static int recorded;

static void keep(const unsigned char *bytes, size_t size)
{
    if (recorded == sizeof recording / sizeof *recording || size > sizeof recording->bytes) return;
    memcpy(recording[recorded].bytes, bytes, size);
    recording[recorded++].size = size;
}

// Sleeps until the n-th of a stream is due; one that was held up catches up.
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
        pose.utime = utime ? utime : 1000 * seq; // not the clock's: a held-up sender would make other speeds
        pose.sent_ns = kn_now_ns();
        if (n + 1 == count && strstr(line, " leave")) pose.buttons = KNEAD_PROBE_POSE_T_BUTTON_LEAVING;
        size_t size = kn_pose_datagram(bytes, sizeof bytes - KN_AUTH_TRAILER, channel, &pose);
        if (keyed) keep(bytes, size = kn_sign_datagram(bytes, size, channel, &auth, now()));
        send_bytes(bytes, size);
    }
}

// --- many at once ---

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

static size_t forged(unsigned char bytes[KN_TEST_DATAGRAM], uint64_t *random, int64_t n)
{
    knead_probe_pose_t pose = {.session = 1000000 + n,
                               .seq = n,
                               .utime = n,
                               .orientation_wxyz = {1, 0, 0, 0},
                               .position_m = {0, 0, 0.2}};
    const kn_recording *r = recorded > 0 ? &recording[kn_random_bits(random) % (size_t)recorded] : NULL;
    return kn_forged_datagram(bytes, random, channel, pose, &auth, now(), r ? r->bytes : NULL, r ? r->size : 0);
}

int main(int argc, char **argv)
{
    char error[200];
    if (argc < 2 || argc > 3) return 2;
    keyed = argc == 3;
    if (keyed && !kn_auth_load(&auth, argv[2], error, sizeof error)) return fprintf(stderr, "%s\n", error), 2;
    sigaction(SIGTERM, &(struct sigaction){.sa_handler = on_term}, NULL);
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", argv[1]);
    group.sin_family = AF_INET;
    group.sin_port = htons(7667);
    inet_pton(AF_INET, "239.255.76.67", &group.sin_addr);
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &(unsigned char){0}, 1) != 0) return 3;
    if (keyed && !find_life(error, sizeof error)) return fprintf(stderr, "%s\n", error), 3;
    static const struct {
        const char *verb;
        make *one;
    } many[] = {{"flood", relative}, {"forge", forged}};
    for (char line[256]; fgets(line, sizeof line, stdin);) {
        char verb[16] = "";
        long count = 0;
        size_t m = 0;
        if (sscanf(line, "%15s %ld", verb, &count) != 2) return 2;
        while (m < sizeof many / sizeof *many && strcmp(verb, many[m].verb) != 0) m++;
        if (strcmp(verb, "poses") == 0)
            send_poses(line, count);
        else if (m < sizeof many / sizeof *many)
            send_many(line, count, many[m].one);
        else if (strcmp(verb, "sleep") == 0)
            nanosleep(&(struct timespec){count / 1000, count % 1000 * 1000000}, NULL);
        else
            return 2;
    }
    printf("%" PRId64 "\n", sent);
    return 0;
}
