// rules LOG PROBE CLAMP GUARD: judge the forces of a log by tests/tactile/rules.h.
#include "tests/tactile/rules.h"
#include <stdlib.h>

int main(int argc, char **argv)
{
    lcm_eventlog_t *log = argc == 5 ? lcm_eventlog_create(argv[1], "r") : NULL;
    char channel[80];
    if (!log) return fprintf(stderr, "usage: rules LOG PROBE CLAMP GUARD\n"), 2;
    snprintf(channel, sizeof channel, "KNEAD_FORCE_%.60s", argv[2]);
    kn_rules rules = {.of = KN_JUDGED_SERVER, .clamp_n = atof(argv[3]), .guard_n_per_ms = atof(argv[4])};
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) {
        knead_contact_force_t f;
        if (!strcmp(e->channel, channel) && knead_contact_force_t_decode(e->data, 0, e->datalen, &f) >= 0)
            kn_rules_force(&rules, &f);
    }
    lcm_eventlog_destroy(log);
    kn_rules_print(&rules);
    return 0;
}
