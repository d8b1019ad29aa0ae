// link NEAR_URL FAR_URL DELAY_MS SECONDS [FAULT=VALUE]...: a bad link between two buses. kneadd's messages on the
// near bus are repeated on the far bus after half of the delay. The poses of the far bus are repeated on the near bus
// after the other half. The link uses stock LCM, so that a damaged payload travels under a correct checksum. Faults
// apply to both directions, by one seed:
//
//     loss=0.05 burst=3    a share of the messages is lost, so many in a row each time (1)
//     jitter=5             jitter of the round trip, ms; each direction has up to half of it: messages overtake
//     twice=0.01           a share is delivered again, directly behind the first
//     swap=0.01            a share comes 1.5 ms late: behind the next message
//     flip=0.001           a share has one flipped bit in the payload
//     seed=1
//
// At the end, or on SIGTERM, the counts of each direction:  poses carried N lost N flipped N twice N swapped N
#include "tests/tactile/link.h"
#include "clients/hand/bus_client.h"
#include <poll.h>
#include <signal.h>
#include <time.h>

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static void on_message(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    kn_way_take(self, channel, buf->data, buf->data_size);
}

static void publish(void *to, const char *channel, const void *bytes, unsigned size)
{
    lcm_publish(to, channel, bytes, size);
}

static bool open_way(kn_way *w, lcm_t *from, lcm_t *to, const char *channels, double delay_ms, const kn_link_fault *f,
                     uint64_t salt)
{
    kn_way_init(w, f, delay_ms, salt);
    w->deliver = publish;
    w->to = to;
    lcm_subscription_t *all = lcm_subscribe(from, channels, on_message, w);
    return all && lcm_subscription_set_queue_capacity(all, 64) == 0;
}

static bool take_faults(kn_link_fault *f, int count, char **words)
{
    struct {
        const char *name;
        double *value;
    } all[] = {{"loss", &f->loss}, {"burst", &f->burst}, {"jitter", &f->jitter}, {"twice", &f->twice},
               {"swap", &f->swap}, {"flip", &f->flip},   {"seed", &f->seed}};
    for (int i = 0; i < count; i++) {
        size_t at = strcspn(words[i], "="), n = 0;
        while (n < sizeof all / sizeof *all && (strlen(all[n].name) != at || strncmp(all[n].name, words[i], at))) n++;
        if (n == sizeof all / sizeof *all || !words[i][at]) return false;
        *all[n].value = atof(words[i] + at + 1);
    }
    return f->burst >= 1 && f->loss < 1;
}

static void tell(const char *what, const kn_way *w)
{
    printf("%s carried %lld lost %lld flipped %lld twice %lld swapped %lld\n", what, (long long)w->carried,
           (long long)w->lost, (long long)w->flipped, (long long)w->twice, (long long)w->swapped);
}

int main(int argc, char **argv)
{
    static kn_way down, up;
    kn_link_fault f = {.burst = 1, .seed = 1};
    char error[256] = "usage: link NEAR_URL FAR_URL DELAY_MS SECONDS [FAULT=VALUE]...";
    kn_bus_client_priority(60);
    signal(SIGTERM, on_signal);
    bool known = argc >= 5 && take_faults(&f, argc - 5, argv + 5);
    lcm_t *near = known ? lcm_create(argv[1]) : NULL, *far = near ? lcm_create(argv[2]) : NULL;
    if (known && !far) snprintf(error, sizeof error, "LCM refuses the URL");
    if (!far) return fprintf(stderr, "link: %s\n", error), 2;
    double half_ms = 0.5 * atof(argv[3]);
    if (!open_way(&down, near, far, "KNEAD_(FORCE|CONTACT)_.*|KNEAD_SCENE", half_ms, &f, 1) ||
        !open_way(&up, far, near, "KNEAD_POSE_.*", half_ms, &f, 2))
        return fprintf(stderr, "link: no subscription\n"), 3;
    struct pollfd ends[2] = {{lcm_get_fileno(near), POLLIN, 0}, {lcm_get_fileno(far), POLLIN, 0}};
    int64_t end_ns = kn_now_ns() + (int64_t)(1e9 * atof(argv[4]));
    while (kn_now_ns() < end_ns && !interrupted) {
        ppoll(ends, 2, &(struct timespec){.tv_nsec = down.count + up.count ? 100000 : 10000000}, NULL);
        while (lcm_handle_timeout(near, 0) > 0)
            ;
        while (lcm_handle_timeout(far, 0) > 0)
            ;
        kn_way_deliver(&down);
        kn_way_deliver(&up);
    }
    tell("poses", &up);
    tell("forces", &down);
    return 0;
}
