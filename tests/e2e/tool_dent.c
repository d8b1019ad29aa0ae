// dent LOG: a log of a kneadd --state-dir that was killed and started again: its first life is replayed, and the object
// as it was in the end compared with what the second one restored:
//
//     lost_ms N same N deep_mm N restored_mm N apart_mm N gaps N
//
// same: 1, what was restored is the object after that tick of the first life, to the bit. deep, restored: how far the
// deepest node is below where it was made, in the end and as restored; apart: how far any node has moved in between.
#include "proto/knead_event_t.h"
#include "server/replay.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool find_restore(const char *path, knead_event_t *found)
{
    lcm_eventlog_t *log = lcm_eventlog_create(path, "r");
    bool is = false;
    for (lcm_eventlog_event_t *e; log && !is && (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e))
        is = !strcmp(e->channel, "KNEAD_EVENT") && knead_event_t_decode(e->data, 0, e->datalen, found) >= 0 &&
             found->kind == KNEAD_EVENT_T_KIND_RESTORE;
    if (log) lcm_eventlog_destroy(log);
    return is;
}

static double (*positions(kn_replay *r))[3]
{
    double(*x)[3] = calloc((size_t)r->model->node_count, sizeof *x);
    if (!x) exit(70);
    for (int i = 0; i < r->model->node_count; i++) kn_state_position(r->model, kn_replay_state(r), i, x[i]);
    return x;
}

int main(int argc, char **argv)
{
    char error[512] = "no restore in it";
    kn_replay_def def = {.log_path = argv[1]};
    knead_event_t restore;
    kn_replay *r = argc == 2 && find_restore(argv[1], &restore) ? kn_replay_create(&def, error, sizeof error) : NULL;
    if (!r) return fprintf(stderr, "dent: %s\n", error), 2;
    double(*made)[3] = positions(r), (*restored)[3] = NULL, deep = 0, left = 0, apart = 0;
    int64_t last = -1, from = (int64_t)restore.arg[1];
    bool same = false;
    while (kn_replay_step(r)) {
        last = r->tick.out.tick;
        if (last != from) continue;
        restored = positions(r);
        same = kn_state_hash(r->model, kn_replay_state(r)) == (uint64_t)restore.state_hash;
    }
    if (!restored) return fprintf(stderr, "dent: tick %lld is not in it\n", (long long)from), 2;
    double(*end)[3] = positions(r);
    for (int i = 0; i < r->model->node_count; i++) {
        double way[3];
        for (int k = 0; k < 3; k++) way[k] = end[i][k] - restored[i][k];
        deep = fmax(deep, made[i][2] - end[i][2]);
        left = fmax(left, made[i][2] - restored[i][2]);
        apart = fmax(apart, sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]));
    }
    printf("lost_ms %lld same %d deep_mm %.3f restored_mm %.3f apart_mm %.3f gaps %lld\n", (long long)(last - from),
           same, 1e3 * deep, 1e3 * left, 1e3 * apart, (long long)r->tally.gaps);
    free(made);
    free(restored);
    free(end);
    kn_replay_destroy(r);
    return 0;
}
