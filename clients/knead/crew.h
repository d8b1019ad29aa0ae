#ifndef KN_CLIENTS_CREW_H
#define KN_CLIENTS_CREW_H
// Execution of a plan (plan.h): one or several processes replay its runs. A folder keeps the trace of each run.
//
//     folder/  sweep                 hashes (folder.h): traces of another sweep are never used
//              scene.yaml            the plan's text; every run is made from it
//              ID.trace              one complete run (trace.h)
//              ID.job                for other processes: the run to play and the name of its trace
//              log.lcmlog            copy of the log for other hosts
//
// Every run is replayed once. A sweep that was killed can be resumed with the next run. Runs are replayed one at a time
// in this process, where their times are valid. Alternatively GNU parallel replays the runs in several processes here
// and on other hosts, where the times are not valid. In that case the points (plan.h) are replayed once more, one at a
// time, only to measure their times. At the end every point is replayed a second time. The shorter of the two times of
// each tick counts.
#include "clients/knead/folder.h"
#include "clients/knead/plan.h"
#include "clients/knead/trace.h"

typedef struct kn_crew {
    const kn_plan *plan;
    const char *resume; // folder of the traces, which is kept at the end; NULL: use a temporary folder
    // Number of processes on this machine, or on each host if hosts are given. 0: default of GNU parallel, one per
    // processor.
    int jobs;
    // Hosts in the syntax of parallel --sshlogin; ":" is this machine. NULL: this machine alone.
    const char *hosts;
    kn_folder folder;
    uint64_t program;
    int64_t sitting; // wall-clock time at the start of this serial pass, ns; identifies the pass
    int kept;        // number of runs whose traces an earlier call has left in the folder
    // Number of points that were timed twice in this serial pass, and number of those whose two times differ by more
    // than 15 %.
    int timed, unsteady;
} kn_crew;

// All functions of this header that return int return an exit code. On failure they print one line on stderr.
int kn_crew_open(kn_crew *crew); // open the folder; the caller must have set the fields before `folder`
int kn_crew_play(kn_crew *crew);
// Load the traces of all runs into traces[number of runs], which the caller has zeroed.
int kn_crew_load(const kn_crew *crew, kn_trace *traces);
void kn_crew_close(kn_crew *crew);

#endif
