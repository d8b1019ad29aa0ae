#ifndef KN_CLIENTS_JOB_H
#define KN_CLIENTS_JOB_H
// A run for another process, here or on another host: `knead tradeoff --job FILE`. The file says a name and a value in
// every line; paths are as seen from the folder that the process is started in.
//
//     scene scene.yaml       log log.lcmlog       trace ID.trace       set solver.iterations=8    ...
#include "clients/knead/plan.h"

extern const char kn_job_program[]; // whose hash a trace has: this very program

bool kn_job_write(const char *path, const kn_run *run, const char *log);

// An exit code, after a complaint. A file that is not here is looked for in the folder above: with this machine (:)
// among several hosts, GNU parallel starts its jobs in an empty folder inside the sweep's.
int kn_job_play(const char *path);

#endif
