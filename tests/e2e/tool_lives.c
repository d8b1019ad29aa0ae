// lives LOG: a log of one kneadd --state-dir after the other, each killed: what each life lost, in numbers:
//
//     lives N restored N within N most N         within: lost 1000 ticks at most; most: that any lost
//
// Lost are the ticks with a force after the one whose snapshot the next life restored: KIND_RESTORE tells its
// generation and tick. A generation that was restored before is of an earlier life: then all of it is lost.
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TICKS 1000000 // with a force, of one life

static int64_t tick[TICKS], lives, restored, within, most, generation;
static int count;

static void end_life(const knead_event_t *restore)
{
    int64_t lost = 0, from = (int64_t)restore->arg[0] == generation ? -1 : (int64_t)restore->arg[1];
    for (int i = 0; i < count; i++) lost += tick[i] > from && (i == 0 || tick[i] != tick[i - 1]);
    restored++;
    within += lost <= 1000;
    if (lost > most) most = lost;
    generation = (int64_t)restore->arg[0];
    count = 0;
}

int main(int argc, char **argv)
{
    lcm_eventlog_t *log = argc == 2 ? lcm_eventlog_create(argv[1], "r") : NULL;
    if (!log) return 3;
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) {
        knead_contact_force_t force;
        knead_event_t event;
        if (!strncmp(e->channel, "KNEAD_FORCE_", 12) && count < TICKS &&
            knead_contact_force_t_decode(e->data, 0, e->datalen, &force) >= 0)
            tick[count++] = force.tick;
        if (strcmp(e->channel, "KNEAD_EVENT") || knead_event_t_decode(e->data, 0, e->datalen, &event) < 0) continue;
        lives += event.kind == KNEAD_EVENT_T_KIND_START;
        if (event.kind == KNEAD_EVENT_T_KIND_RESTORE) end_life(&event);
    }
    lcm_eventlog_destroy(log);
    printf("lives %" PRId64 " restored %" PRId64 " within %" PRId64 " most %" PRId64 "\n", lives, restored, within,
           most);
    return 0;
}
