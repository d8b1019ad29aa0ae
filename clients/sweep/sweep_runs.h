#ifndef KN_CLIENTS_SWEEP_RUNS_H
#define KN_CLIENTS_SWEEP_RUNS_H
// Execution of a plan (sweep_plan.h): one or several processes replay its runs. A folder keeps the trace of each run.
//
//     folder/  jobs, results, sent   the list of jobs (cli/jobs.h)
//              scene.yaml            the plan's text; every run is made from it
//              log.lcmlog            link to the log
//              ID.trace              one complete run (replay_trace.h). ID is a hash of the run, the log and the program
//
// Every run is replayed once. With --resume, a sweep that was killed continues with its missing runs. Runs are replayed
// one at a time in this process, where their times are valid. Alternatively an engine (cli/jobs.h) replays the runs in
// several processes here and on other hosts, where the times are not valid. In that case the points (sweep_plan.h) are
// replayed once more, one at a time, only to measure their times. At the end every point is replayed a second time. The
// shorter of the two times of each tick counts.
#include "clients/cli/jobs.h"
#include "clients/sweep/replay_trace.h"
#include "clients/sweep/sweep_plan.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_sweep_runs {
    const kn_sweep_plan *plan;
    const char *resume;     // folder of the traces, which is kept at the end; NULL: use a temporary folder
    kn_replay_trace *trace; // [number of runs], zeroed and later freed by the caller; the traces of the runs
    kn_jobs jobs;           // folder, and the engine that the caller sets
    int64_t sitting;        // wall-clock time at the start of this serial pass, ns; identifies the pass
    int kept;               // number of runs whose traces an earlier call has left in the folder
    // timed: number of points that were timed twice in this serial pass. unsteady: number of those points whose two
    // times differ by more than 15 %.
    int timed, unsteady;
} kn_sweep_runs;

// All functions of this header that return int return an exit code. On failure they print one line on stderr.

// Open the folder. The caller has set plan, resume, trace and jobs.engine. It calls kn_jobs_close even after a failure.
int kn_sweep_runs_open(kn_sweep_runs *crew);
// Replay the runs whose traces are missing, and measure the times of the points. Then `trace` has the traces of all
// runs.
int kn_sweep_runs_play(kn_sweep_runs *crew);

// Replay one run into *trace, and save the trace in the file `path`. If *trace is an earlier replay of the same run in
// this serial pass, the shorter of the two times of each tick counts. A job (`knead tradeoff --job TRACE SCENE LOG`)
// passes a zeroed `crew`: its times are not valid.
int kn_sweep_run_play(kn_sweep_runs *crew, const char *path, const kn_replay_def *def, kn_replay_trace *trace);

#endif
