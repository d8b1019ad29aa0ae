#ifndef KN_CLIENTS_SWEEP_RUNS_H
#define KN_CLIENTS_SWEEP_RUNS_H
// Execution of a plan (sweep_plan.h): one or several processes replay its runs. A folder keeps the trace of each run.
//
//     folder/  sweep                 hashes (kn_sweep_folder): traces of another sweep are never used
//              scene.yaml            the plan's text; every run is made from it
//              ID.trace              one complete run (replay_trace.h)
//              ID.job                for other processes: the run to play and the name of its trace
//              log.lcmlog            copy of the log for other hosts
//
// Every run is replayed once. With --resume, a sweep that was killed continues with its missing runs. Runs are replayed
// one at a time in this process, where their times are valid. Alternatively GNU parallel replays the runs in several
// processes here and on other hosts, where the times are not valid. In that case the points (sweep_plan.h) are replayed
// once more, one at a time, only to measure their times. At the end every point is replayed a second time. The shorter
// of the two times of each tick counts.
#include "clients/sweep/replay_trace.h"
#include "clients/sweep/sweep_plan.h"
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

// The folder in which a sweep keeps its runs. A sweep is one call of `knead tradeoff`, which replays a log with many
// solver settings. The folder is the one that --resume names, or a temporary one that is removed when the sweep ends.
//
//     folder/sweep     hashes of program, scene and log, so that no run of another sweep is used. A temporary folder
//                      has a last line `temporary`. The file is locked while the sweep is at work
//
// A sweep that was killed cannot remove its own folder, so the next sweep removes the leftover. A leftover has the line
// `temporary`, belongs to this user and is not locked. The line is written under the lock, so a new folder is never
// mistaken for a leftover.
typedef struct kn_sweep_folder {
    char path[PATH_MAX]; // path of the folder; "": no folder is open
    bool temporary;
    int lock; // descriptor of the locked file `sweep` in the folder; -1: not open
} kn_sweep_folder;

// A run of a sweep that a separate process replays, on this machine or a remote host: `knead tradeoff --job FILE`. Each
// line of the file has a name and a value. Paths are relative to the folder in which the process is started.
//
//     scene scene.yaml       log log.lcmlog       trace ID.trace       set solver.iterations=8    ...
//
// Replay the run that the job file `path` describes. Return an exit code. On failure print one line on stderr. If the
// job file is not found, the parent folder is searched. This search is needed if this machine (`:`) is one of several
// hosts: GNU parallel then starts its jobs in an empty folder inside the sweep's folder.
int kn_sweep_job_play(const char *path);

typedef struct kn_sweep_runs {
    const kn_sweep_plan *plan;
    const char *resume; // folder of the traces, which is kept at the end; NULL: use a temporary folder
    // Number of processes on this machine, or on each host if hosts are given. 0: default of GNU parallel, one per
    // processor.
    int jobs;
    // Hosts in the syntax of parallel --sshlogin; ":" is this machine. NULL: this machine alone.
    const char *hosts;
    kn_sweep_folder folder;
    uint64_t program;
    int64_t sitting; // wall-clock time at the start of this serial pass, ns; identifies the pass
    int kept;        // number of runs whose traces an earlier call has left in the folder
    // timed: number of points that were timed twice in this serial pass. unsteady: number of those points whose two
    // times differ by more than 15 %.
    int timed, unsteady;
} kn_sweep_runs;

// All functions of this header that return int return an exit code. On failure they print one line on stderr.

// Open the folder; the caller must have set the fields declared before `folder`.
int kn_sweep_runs_open(kn_sweep_runs *crew);
int kn_sweep_runs_play(kn_sweep_runs *crew);
// Load the traces of all runs into traces[number of runs], which the caller has zeroed.
int kn_sweep_runs_load(const kn_sweep_runs *crew, kn_replay_trace *traces);
void kn_sweep_runs_close(kn_sweep_runs *crew);

#endif
