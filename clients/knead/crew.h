#ifndef KN_CLIENTS_CREW_H
#define KN_CLIENTS_CREW_H
// Who replays the runs of a plan, and where their traces are kept.
//
//     folder/  sweep                 what it is of (folder.h): of another sweep's traces nothing can be used
//              scene.yaml            the plan's text, which every run is made of
//              ID.trace              one run, whole (trace.h)
//              ID.job, log.lcmlog    for processes: what to play on it, where to put the trace; the log for other hosts
//
// Every run is done once; whoever is killed goes on with the next one. One at a time in this process, where its times
// count, or by GNU parallel in processes here and on other hosts, where they do not: then the points are replayed once
// more, one at a time, for their times alone. At the end every point is timed a second time, and of every tick the
// better time counts.
#include "clients/knead/folder.h"
#include "clients/knead/plan.h"
#include "clients/knead/trace.h"

typedef struct kn_crew {
    const kn_plan *plan;
    const char *resume; // folder that stays; NULL: a temporary one
    int jobs;           // processes here, or on each host; 0: parallel's default, as many as there are processors
    const char *hosts;  // as parallel --sshlogin takes them, ":" is this machine; NULL: this machine alone
    kn_folder folder;
    uint64_t program;
    int64_t sitting;
    int kept;            // runs found done
    int timed, unsteady; // points timed in this sitting; those whose two times differ by more than 15 %
} kn_crew;

// All return an exit code and complain in one line.
int kn_crew_open(kn_crew *crew); // the fields before folder are set
int kn_crew_play(kn_crew *crew);
int kn_crew_load(const kn_crew *crew, kn_trace *traces); // [runs], zeroed
void kn_crew_close(kn_crew *crew);

#endif
