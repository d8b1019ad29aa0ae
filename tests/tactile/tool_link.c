// link NEAR_URL FAR_URL DELAY_MS SECONDS [FAULT=VALUE]...: a bad link between two buses. What kneadd says on the
// near one is repeated on the far one after half of the delay, the poses of the far one on the near one after the other
// half; by stock LCM, so that a damaged payload travels under a right checksum. Faults of either way, by one seed:
//
//     loss=0.05 burst=3    a share of the messages, so many in a row each time (1)
//     jitter=5             of the round trip, ms; each way half of it at most, so that messages overtake one another
//     twice=0.01           is delivered again, right behind
//     swap=0.01            comes 1.5 ms late: behind the next one
//     flip=0.001           one bit of the payload is another
//     seed=1
//
// At its end, or by SIGTERM: what it did, per direction:  poses carried N lost N flipped N twice N swapped N
#include "clients/knead/join.h"
#include "server/clock.h"
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define WAY 1024 // messages under way in one direction
#define LONGEST 65000
#define SWAP_NS 1500000

typedef struct fault {
    double loss, burst, jitter, twice, swap, flip, seed;
} fault;

typedef struct message {
    int64_t due_ns, number;
    char channel[64];
    unsigned size;
    void *bytes;
} message;

typedef struct way {
    lcm_t *from, *to;
    const fault *fault;
    int64_t delay_ns, number;
    uint64_t dice;
    int burst; // of the messages that are lost in a row, how many are left
    int count;
    message list[WAY]; // in no order
    int64_t carried, lost, flipped, twice, swapped;
} way;

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static double throw(way *w) // [0, 1), Marsaglia's xorshift
{
    w->dice ^= w->dice << 13;
    w->dice ^= w->dice >> 7;
    w->dice ^= w->dice << 17;
    return (double)(w->dice >> 11) * 0x1p-53;
}

static bool loses(way *w)
{
    const fault *f = w->fault;
    // good ones between two bursts are (1 - q)/q on average
    if (w->burst == 0 && throw(w) < f->loss / (f->loss + f->burst * (1.0 - f->loss))) w->burst = (int)f->burst;
    if (w->burst == 0) return false;
    w->burst--;
    return true;
}

static void put(way *w, const char *channel, const void *bytes, unsigned size, int64_t due_ns)
{
    if (w->count == WAY || size > LONGEST) return; // as any link
    message *m = &w->list[w->count++];
    *m = (message){.due_ns = due_ns, .number = w->number++, .size = size, .bytes = malloc(size)};
    snprintf(m->channel, sizeof m->channel, "%s", channel);
    memcpy(m->bytes, bytes, size);
}

static void on_message(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    way *w = self;
    const fault *f = w->fault;
    bool scene = !strcmp(channel, "KNEAD_SCENE"); // who would not hear it would not begin
    if (!scene && loses(w)) {
        w->lost++;
        return;
    }
    int64_t due_ns = kn_now_ns() + w->delay_ns + (int64_t)(5e5 * f->jitter * throw(w));
    bool swaps = throw(w) < f->swap, twice = throw(w) < f->twice, flips = throw(w) < f->flip && !scene;
    put(w, channel, buf->data, buf->data_size, due_ns + (swaps ? SWAP_NS : 0));
    if (flips && w->count > 0) {
        message *m = &w->list[w->count - 1];
        unsigned bit = (unsigned)(throw(w) * 8.0 * m->size);
        ((unsigned char *)m->bytes)[bit / 8] ^= (unsigned char)(1u << bit % 8);
    }
    if (twice) put(w, channel, buf->data, buf->data_size, due_ns);
    w->carried++;
    w->swapped += swaps;
    w->twice += twice;
    w->flipped += flips;
}

// What has been due longest; of the same time, what came first.
static message *first(way *w)
{
    message *best = NULL;
    for (message *m = w->list; m < w->list + w->count; m++)
        if (!best || m->due_ns < best->due_ns || (m->due_ns == best->due_ns && m->number < best->number)) best = m;
    return best;
}

static void deliver(way *w)
{
    for (message *m; (m = first(w)) && m->due_ns <= kn_now_ns();) {
        lcm_publish(w->to, m->channel, m->bytes, m->size);
        free(m->bytes);
        *m = w->list[--w->count];
    }
}

static bool open_way(way *w, lcm_t *from, lcm_t *to, const char *channels, double delay_ms, const fault *f,
                     uint64_t salt)
{
    *w = (way){.from = from, .to = to, .delay_ns = (int64_t)(1e6 * delay_ms), .fault = f};
    w->dice = ((uint64_t)f->seed + salt) * 0x9e3779b97f4a7c15u | 1;
    for (int i = 0; i < 10; i++) throw(w);
    lcm_subscription_t *all = lcm_subscribe(from, channels, on_message, w);
    return all && lcm_subscription_set_queue_capacity(all, 64) == 0;
}

static bool take_faults(fault *f, int count, char **words)
{
    struct {
        const char *name;
        double *value;
    } all[] = {{"loss", &f->loss}, {"burst", &f->burst}, {"jitter", &f->jitter}, {"twice", &f->twice},
               {"swap", &f->swap}, {"flip", &f->flip}, {"seed", &f->seed}};
    for (int i = 0; i < count; i++) {
        size_t at = strcspn(words[i], "="), n = 0;
        while (n < sizeof all / sizeof *all && (strlen(all[n].name) != at || strncmp(all[n].name, words[i], at))) n++;
        if (n == sizeof all / sizeof *all || !words[i][at]) return false;
        *all[n].value = atof(words[i] + at + 1);
    }
    return f->burst >= 1 && f->loss < 1;
}

static void tell(const char *what, const way *w)
{
    printf("%s carried %lld lost %lld flipped %lld twice %lld swapped %lld\n", what, (long long)w->carried,
           (long long)w->lost, (long long)w->flipped, (long long)w->twice, (long long)w->swapped);
}

int main(int argc, char **argv)
{
    static way down, up;
    fault f = {.burst = 1, .seed = 1};
    char error[256] = "usage: link NEAR_URL FAR_URL DELAY_MS SECONDS [FAULT=VALUE]...";
    kn_join_priority(60);
    signal(SIGTERM, on_signal);
    bool known = argc >= 5 && take_faults(&f, argc - 5, argv + 5);
    lcm_t *near = known ? kn_join(argv[1], KN_FORCE_URL, error, sizeof error) : NULL;
    lcm_t *far = near ? kn_join(argv[2], KN_FORCE_URL, error, sizeof error) : NULL;
    if (!far) return fprintf(stderr, "link: %s\n", error), 2;
    double half_ms = 0.5 * atof(argv[3]);
    if (!open_way(&down, near, far, "KNEAD_(FORCE|CONTACT)_.*|KNEAD_SCENE", half_ms, &f, 1) ||
        !open_way(&up, far, near, "KNEAD_POSE_.*", half_ms, &f, 2))
        return fprintf(stderr, "link: no subscription\n"), 3;
    struct pollfd ends[2] = {{lcm_get_fileno(near), POLLIN, 0}, {lcm_get_fileno(far), POLLIN, 0}};
    int64_t end_ns = kn_now_ns() + (int64_t)(1e9 * atof(argv[4]));
    while (kn_now_ns() < end_ns && !interrupted) {
        ppoll(ends, 2, &(struct timespec){.tv_nsec = down.count + up.count ? 100000 : 10000000}, NULL);
        while (lcm_handle_timeout(near, 0) > 0);
        while (lcm_handle_timeout(far, 0) > 0);
        deliver(&down);
        deliver(&up);
    }
    tell("poses", &up);
    tell("forces", &down);
    return 0;
}
