// lives LOG: read a log of successive runs (lives) of one kneadd --state-dir, each killed. Print the work that each
// life lost, in ms, one line each:
//
//     lost N
//
// A tick counts as work if the tool touched. The loss is the number of 1 ms ticks from the first touching tick after
// the restored snapshot to the last published tick. KIND_RESTORE of the next life names the generation and tick of
// that snapshot. An untouched object is saved only while it still moves by 1 um. If the generation was already
// restored before, the snapshot is of an earlier life, and all of this life is lost. The log's first life may restore
// a life outside of this log.
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define TICKS 1000000                // touching ticks of one life
static int64_t touched[TICKS], last; // last: last of all its ticks
static int count;

static int64_t after(int64_t from)
{
    for (int i = 0; i < count; i++)
        if (touched[i] > from) return last - touched[i] + 1;
    return 0;
}

int main(int argc, char **argv)
{
    lcm_eventlog_t *log = argc == 2 ? lcm_eventlog_create(argv[1], "r") : NULL;
    if (!log) return 3;
    bool begins = false; // a life begins, and its first tick restores; later restores by an operator do not count
    int64_t lives = 0, generation = 0;
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) {
        knead_contact_force_t force;
        knead_event_t event;
        if (!strncmp(e->channel, "KNEAD_FORCE_", 12) &&
            knead_contact_force_t_decode(e->data, 0, e->datalen, &force) >= 0) {
            last = force.tick;
            if (force.contacts > 0 && count < TICKS) touched[count++] = last;
        }
        if (strcmp(e->channel, "KNEAD_EVENT") || knead_event_t_decode(e->data, 0, e->datalen, &event) < 0) continue;
        if (event.kind == KNEAD_EVENT_T_KIND_START) lives++, begins = true;
        if (event.kind != KNEAD_EVENT_T_KIND_RESTORE || !begins) continue;
        int64_t from = (int64_t)event.arg[0] == generation ? -1 : (int64_t)event.arg[1];
        if (lives > 1) printf("lost %" PRId64 "\n", after(from));
        generation = (int64_t)event.arg[0];
        count = 0;
        begins = false;
    }
    lcm_eventlog_destroy(log);
    return 0;
}
