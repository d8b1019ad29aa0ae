#ifndef KN_CLIENTS_JOB_H
#define KN_CLIENTS_JOB_H
// A run of a sweep that another process plays, on this or another host: `knead tradeoff --job FILE`. Each line of the
// file has a name and a value. Paths are relative to the folder in which the process is started.
//
//     scene scene.yaml       log log.lcmlog       trace ID.trace       set solver.iterations=8    ...
#include "clients/knead/plan.h"

extern const char kn_job_program[]; // path of this program's own file; traces carry its hash

bool kn_job_write(const char *path, const kn_run *run, const char *log);

// Play a job. Return an exit code. On failure one line on stderr has given the reason. A file that is not found is
// looked for in the parent folder. This is needed if this machine (`:`) is one of several hosts: GNU parallel then
// starts its jobs in an empty folder inside the sweep's folder.
int kn_job_play(const char *path);

#endif
