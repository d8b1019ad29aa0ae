// hear PROBE SECONDS: print every pose and force of a probe on the default bus as CSV on stdout, using stock LCM.
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

static void on_pose(const lcm_recv_buf_t *buf, const char *channel, const knead_probe_pose_t *p, void *begin_ns)
{
    (void)buf, (void)channel;
    const double *x = p->position_m, *v = p->velocity_m_s, *q = p->orientation_wxyz;
    printf("pose,%.4f,%" PRId64 ",%" PRId64 ",%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.5f,%.5f,%.5f,%.5f,%d\n",
           1e-9 * (double)(kn_now_ns() - *(int64_t *)begin_ns), p->session, p->seq, x[0], x[1], x[2], v[0], v[1], v[2],
           q[0], q[1], q[2], q[3], p->buttons);
}

static void on_force(const lcm_recv_buf_t *buf, const char *channel, const knead_contact_force_t *f, void *begin_ns)
{
    (void)buf, (void)channel;
    printf("force,%.4f,%" PRId64 ",%" PRId64 ",%.4f,%.4f,%.4f,%d,%d\n",
           1e-9 * (double)(kn_now_ns() - *(int64_t *)begin_ns), f->session, f->seq, f->force_n[0], f->force_n[1],
           f->force_n[2], f->flags, f->fault);
}

int main(int argc, char **argv)
{
    char channel[64];
    int64_t begin_ns = kn_now_ns();
    lcm_t *lcm = argc == 3 ? lcm_create(NULL) : NULL;
    if (!lcm) return fprintf(stderr, "usage: hear PROBE SECONDS\n"), 2;
    setvbuf(stdout, NULL, _IOLBF, 0); // whole rows, even if the program is killed
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", argv[1]);
    knead_probe_pose_t_subscription_t *poses = knead_probe_pose_t_subscribe(lcm, channel, on_pose, &begin_ns);
    snprintf(channel, sizeof channel, "KNEAD_FORCE_%s", argv[1]);
    knead_contact_force_t_subscription_t *forces = knead_contact_force_t_subscribe(lcm, channel, on_force, &begin_ns);
    while (kn_now_ns() < begin_ns + (int64_t)(1e9 * atof(argv[2]))) lcm_handle_timeout(lcm, 50);
    knead_probe_pose_t_unsubscribe(lcm, poses);
    knead_contact_force_t_unsubscribe(lcm, forces);
    lcm_destroy(lcm);
    return 0;
}
