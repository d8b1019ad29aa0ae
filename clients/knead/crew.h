#ifndef KN_CLIENTS_CREW_H
#define KN_CLIENTS_CREW_H
// The process or processes that replay the runs of a plan, and the folder with their traces.
//
//     folder/  sweep                 hashes (folder.h): traces of another sweep are never used
//              scene.yaml            the plan's text; every run is made from it
//              ID.trace              one complete run (trace.h)
//              ID.job                for other processes: the run to play and the name of its trace
//              log.lcmlog            copy of the log for other hosts
//
// Every run is played once. A sweep that was killed goes on with the next run. Runs are played one at a time in this
// process, where their times are valid. Alternatively GNU parallel plays the runs in several processes here and on
// other hosts, where the times are not valid. In that case the points are replayed one at a time for their times alone.
// At the end every point is timed a second time, and the shorter time of each tick counts.
#include "clients/knead/folder.h"
#include "clients/knead/plan.h"
#include "clients/knead/trace.h"

typedef struct kn_crew {
    const kn_plan *plan;
    const char *resume; // folder to keep; NULL: a temporary folder
    // Number of processes on this machine, or on each host. 0: default of GNU parallel, one per processor.
    int jobs;
    // Hosts in the syntax of parallel --sshlogin; ":" is this machine. NULL: this machine alone.
    const char *hosts;
    kn_folder folder;
    uint64_t program;
    int64_t sitting; // wall-clock time at the start of this serial pass, ns; identifies the pass
    int kept;        // runs that were already done
    // Number of points that were timed twice in this serial pass, and number of those whose two times differ by more
    // than 15 %.
    int timed, unsteady;
} kn_crew;

// All functions that return int return an exit code. On failure they print one line on stderr.
int kn_crew_open(kn_crew *crew); // the fields before `folder` must be set
int kn_crew_play(kn_crew *crew);
int kn_crew_load(const kn_crew *crew, kn_trace *traces); // traces[runs], zeroed by the caller
void kn_crew_close(kn_crew *crew);

#endif
