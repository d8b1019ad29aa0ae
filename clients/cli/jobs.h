#ifndef KN_CLIENTS_JOBS_H
#define KN_CLIENTS_JOBS_H
// Jobs: many runs of knead, each in a process of its own, which an engine starts. A job has a result, one file in a
// folder. The file appears whole, by a rename. A job with a result is never played again, so the same command continues
// after an interruption. This module decides nothing else: order, load, transfer and requeueing belong to the engine.
//
//     here       one at a time; no other package is needed
//     --jobs     GNU parallel, N at a time
//     --hosts    GNU parallel over ssh; files are sent, results are fetched, no folder is shared
//     --slurm    one array of sbatch in a shared folder; a task plays every N-th job. Tasks of a failed node are requeued
//
//     folder/  jobs      a shell script with one line for each job (jobs.sh)
//              results   the names of all results
//              sent      the files that a host needs; locked while a command is at work in this folder
//              NAME      one result
//
// The process of a job is `knead COMMAND --job PATH WORD...`. It writes its result to PATH and exits with 0, whatever the
// result says. Any other exit code stops the engine, or this task of the array.
#include "clients/cli/output.h"
#include "server/option_table.h"
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>

typedef struct kn_jobs_engine { // options of the command line; all fields 0: the jobs are played here, one at a time
    // Hosts in the syntax of parallel --sshlogin; ":" is this machine. NULL: this machine alone.
    const char *hosts;
    // Number of processes on this machine or on each host, or of tasks of the array. 0: the default of the engine.
    int jobs;
    bool parallel; // true: --jobs was given
    bool slurm;
} kn_jobs_engine;

// Rows of an option table and lines of a help text for the member `engine` of the struct `options`.
#define KN_JOBS_OPTIONS(options)                                                                                       \
    KN_OPTION("jobs", INTEGER, .offset = offsetof(options, engine.jobs), .given = offsetof(options, engine.parallel),  \
              KN_RANGE(0, 1000), .expected = "a whole number up to 1000, 0: one per processor"),                       \
        KN_OPTION("hosts", TEXT, .offset = offsetof(options, engine.hosts), .expected = "host,host"),                  \
        KN_OPTION("slurm", FLAG, .offset = offsetof(options, engine.slurm))
#define KN_JOBS_HELP                                                                                                   \
    "  --jobs N           N runs at a time by GNU parallel, 0: one per processor\n"                                    \
    "  --hosts LIST       distribute the runs to hosts; the syntax is that of parallel's --sshlogin:\n"                \
    "                     user@host, 'ssh -p 2222 user@host', or : for this machine.\n"                                \
    "                     Each host needs rsync and the same build of knead in its PATH\n"                             \
    "  --slurm            distribute the runs by one sbatch array of at most 1000 tasks (--jobs N: of N tasks).\n"     \
    "                     The nodes share this folder and this program. A task on a failed node is requeued.\n"        \
    "                     Options of sbatch are its variables, such as SBATCH_PARTITION and SBATCH_TIMELIMIT\n"

// Return true if the options choose no engine, so that the jobs are played one at a time on this machine.
bool kn_jobs_here(const kn_jobs_engine *engine);

typedef struct kn_jobs {
    const char *command; // subcommand that plays the jobs, for the script and for messages
    kn_jobs_engine engine;
    const char *hint; // end of the message on missing results: how to go on
    // Set by kn_jobs_open and kn_jobs_add.
    char folder[PATH_MAX];
    bool fresh;     // true: the folder was new or empty
    bool temporary; // true: kn_jobs_close removes the folder
    int count;      // number of jobs added
    FILE *script, *results, *sent;
} kn_jobs;

// All functions that return int return an exit code. On failure they print one line on stderr.

// Create or find the folder of the results, and lock it; NULL: create a temporary one. The jobs run in the folder `home`,
// NULL: in the folder of the results. On a host both are one new folder. From here on, signals only set kn_interrupted.
// After this call the folder must be closed, even if a later step fails.
int kn_jobs_open(kn_jobs *jobs, const char *folder, const char *home);
// Return `path` with the path of a file in the folder, or "" if that is too long.
const char *kn_jobs_path(const kn_jobs *jobs, const char *name, char path[PATH_MAX]);
// Add a file that a host needs. "a/b" is in the folder of the results. "/x/./a/b" becomes a/b on the host.
void kn_jobs_send(kn_jobs *jobs, const char *path);
// Add a job. result: name of its file, without characters that are special in a shell. words: arguments of the command
// after --job PATH. An old result, which the caller has found damaged, is removed.
void kn_jobs_add(kn_jobs *jobs, const char *result, int count, char *const *words);
// Play all jobs. It is a failure if one has no result afterwards.
int kn_jobs_play(kn_jobs *jobs);
// Unlock the folder, and remove it if it is temporary. If this process received a signal, end by it.
void kn_jobs_close(kn_jobs *jobs);

// To be called first in the process of a job: the process ends when the process that started it ends.
void kn_jobs_begin(void);

#endif
