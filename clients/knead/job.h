#ifndef KN_CLIENTS_JOB_H
#define KN_CLIENTS_JOB_H
// A run of a sweep that a separate process replays, on this machine or a remote host: `knead tradeoff --job FILE`. Each
// line of the file has a name and a value. Paths are relative to the folder in which the process is started.
//
//     scene scene.yaml       log log.lcmlog       trace ID.trace       set solver.iterations=8    ...
#include "clients/knead/plan.h"

// Path of this program's executable file; every trace holds the hash of the executable.
extern const char kn_job_program[];

bool kn_job_write(const char *path, const kn_run *run, const char *log);

// Replay the run that the job file `path` describes. Return an exit code. On failure print one line on stderr. If the
// job file is not found, the parent folder is searched. This search is needed if this machine (`:`) is one of several
// hosts: GNU parallel then starts its jobs in an empty folder inside the sweep's folder.
int kn_job_play(const char *path);

#endif
