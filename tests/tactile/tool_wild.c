// wild PROBE NEWTON SECONDS: wait until kneadd's force on that probe is above 0.3 N. Then send own forces in kneadd's
// name, NEWTON upwards, one behind each of 20 forces and with a seq two poses later. A client may accept only the
// newest force, and the forces sent behind late ones are not newest. Exit 1 if no tool was pressed for SECONDS.
#include "proto/knead_contact_force_t.h"
#include "server/clock.h"
#include <stdio.h>
#include <stdlib.h>

static const int wild = 20;
static const char *wanted_n;
static int sent;

static void on_force(const lcm_recv_buf_t *buf, const char *channel, const knead_contact_force_t *heard, void *self)
{
    (void)buf;
    knead_contact_force_t f = *heard;
    double newton = atof(wanted_n);
    if (f.force_n[2] < 0.3 || f.force_n[2] == newton) return; // the second case is our own force
    f.force_n[2] = newton;
    f.seq += 2, f.tick += 2; // no news, unless newer than the last force heard
    sent += knead_contact_force_t_publish(self, channel, &f) == 0;
}

int main(int argc, char **argv)
{
    char channel[64];
    lcm_t *lcm = argc == 4 ? lcm_create(NULL) : NULL;
    if (!lcm) return fprintf(stderr, "usage: wild PROBE NEWTON SECONDS\n"), 2;
    wanted_n = argv[2];
    snprintf(channel, sizeof channel, "KNEAD_FORCE_%s", argv[1]);
    knead_contact_force_t_subscription_t *heard = knead_contact_force_t_subscribe(lcm, channel, on_force, lcm);
    int64_t end_ns = kn_now_ns() + (int64_t)(1e9 * atof(argv[3]));
    while (sent < wild && kn_now_ns() < end_ns) lcm_handle_timeout(lcm, 20);
    knead_contact_force_t_unsubscribe(lcm, heard);
    lcm_destroy(lcm);
    return sent < wild;
}
