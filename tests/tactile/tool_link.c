// link NEAR_URL FAR_URL DELAY_MS SECONDS: a slow link between two buses. What kneadd says on the near one is repeated on
// the far one after half of the delay, the poses of the far one on the near one after the other half; by stock LCM.
#include "clients/knead/join.h"
#include "server/clock.h"
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define WAY 1024 // messages under way in one direction
#define LONGEST 65000

typedef struct way {
    lcm_t *from, *to;
    int64_t delay_ns, in, out;
    struct {
        int64_t due_ns;
        char channel[64];
        unsigned size;
        void *bytes;
    } message[WAY];
} way;

static void on_message(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    way *w = self;
    int at = (int)(w->in % WAY);
    if (w->in - w->out == WAY || buf->data_size > LONGEST) return; // as any link
    w->message[at].due_ns = kn_now_ns() + w->delay_ns;
    w->message[at].size = buf->data_size;
    w->message[at].bytes = malloc(buf->data_size);
    snprintf(w->message[at].channel, sizeof w->message[at].channel, "%s", channel);
    memcpy(w->message[at].bytes, buf->data, buf->data_size);
    w->in++;
}

static void deliver(way *w)
{
    for (; w->out < w->in && w->message[w->out % WAY].due_ns <= kn_now_ns(); w->out++) {
        int at = (int)(w->out % WAY);
        lcm_publish(w->to, w->message[at].channel, w->message[at].bytes, w->message[at].size);
        free(w->message[at].bytes);
    }
}

static bool open_way(way *w, lcm_t *from, lcm_t *to, const char *channels, double delay_ms)
{
    *w = (way){.from = from, .to = to, .delay_ns = (int64_t)(1e6 * delay_ms)};
    lcm_subscription_t *all = lcm_subscribe(from, channels, on_message, w);
    return all && lcm_subscription_set_queue_capacity(all, 64) == 0;
}

int main(int argc, char **argv)
{
    static way down, up;
    char error[256] = "usage: link NEAR_URL FAR_URL DELAY_MS SECONDS";
    kn_join_priority(60);
    lcm_t *near = argc == 5 ? kn_join(argv[1], KN_FORCE_URL, error, sizeof error) : NULL;
    lcm_t *far = near ? kn_join(argv[2], KN_FORCE_URL, error, sizeof error) : NULL;
    if (!far) return fprintf(stderr, "link: %s\n", error), 2;
    double half_ms = 0.5 * atof(argv[3]);
    if (!open_way(&down, near, far, "KNEAD_(FORCE|CONTACT)_.*|KNEAD_SCENE", half_ms) ||
        !open_way(&up, far, near, "KNEAD_POSE_.*", half_ms))
        return fprintf(stderr, "link: no subscription\n"), 3;
    struct pollfd ends[2] = {{lcm_get_fileno(near), POLLIN, 0}, {lcm_get_fileno(far), POLLIN, 0}};
    for (int64_t end_ns = kn_now_ns() + (int64_t)(1e9 * atof(argv[4])); kn_now_ns() < end_ns;) {
        bool waiting = down.in > down.out || up.in > up.out;
        ppoll(ends, 2, &(struct timespec){.tv_nsec = waiting ? 100000 : 10000000}, NULL);
        while (lcm_handle_timeout(near, 0) > 0);
        while (lcm_handle_timeout(far, 0) > 0);
        deliver(&down);
        deliver(&up);
    }
    return 0;
}
