#include "clients/knead/job.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/trace.h"
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const char kn_job_program[] = "/proc/self/exe";

// Stop flag for the replay, which stays 0: a signal ends this process by its default action.
static const volatile sig_atomic_t never;

bool kn_job_write(const char *path, const kn_run *run, const char *log)
{
    kn_run_sets sets;
    kn_run_sets_make(&sets, run);
    FILE *f = fopen(path, "w");
    bool ok = f && fprintf(f, "scene scene.yaml\nlog %s\ntrace %s.trace\n", log, run->id) > 0;
    for (int i = 0; ok && i < sets.count; i++) ok = fprintf(f, "set %s\n", sets.set[i]) > 0;
    return f && fclose(f) == 0 && ok;
}

// Contents of a job file.
typedef struct job {
    char scene[PATH_MAX], log[PATH_MAX], trace[PATH_MAX], set[KN_RUN_SETS][80];
    const char *sets[KN_RUN_SETS];
    int count;
} job;

// Read one line of a job file, a name and a value. Return false if the name is unknown or the line is too long.
static bool read_line(job *j, const char *line)
{
    const char *value = strchr(line, ' ');
    if (!value++) return false;
    size_t size = (size_t)(value - line);
    if (!strncmp(line, "scene ", size)) return snprintf(j->scene, sizeof j->scene, "%s", value) < PATH_MAX;
    if (!strncmp(line, "log ", size)) return snprintf(j->log, sizeof j->log, "%s", value) < PATH_MAX;
    if (!strncmp(line, "trace ", size)) return snprintf(j->trace, sizeof j->trace, "%s", value) < PATH_MAX;
    // A job may have several `set` lines.
    if (strncmp(line, "set ", size) != 0 || j->count == KN_RUN_SETS) return false;
    j->sets[j->count] = j->set[j->count];
    return snprintf(j->set[j->count++], sizeof j->set[0], "%s", value) < (int)sizeof j->set[0];
}

// Read a job file. Return false if scene, log or trace is missing in it.
static bool read_job(job *j, const char *path)
{
    char line[PATH_MAX + 16];
    FILE *f = fopen(path, "r");
    bool ok = f;
    while (ok && fgets(line, sizeof line, f)) {
        line[strcspn(line, "\n")] = '\0';
        ok = read_line(j, line);
    }
    if (f) fclose(f);
    return ok && *j->scene && *j->log && *j->trace;
}

int kn_job_play(const char *path)
{
    char error[512];
    uint64_t program;
    kn_trace t;
    job *j = calloc(1, sizeof *j);
    // If this machine is one of several hosts, GNU parallel starts the job one folder below the sweep's folder.
    if (access(path, F_OK) != 0 && *path != '/' && chdir("..") != 0) path = "..";
    if (!j || !read_job(j, path) || !kn_trace_hash(kn_job_program, &program)) {
        free(j);
        return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: expected a job that knead tradeoff --jobs has written",
                           path);
    }
    // Replay the run and save its trace with the hash of this program.
    kn_replay_def def = {
        .log_path = j->log, .scene_path = j->scene, .sets = j->sets, .set_count = j->count, .afresh = true};
    int code = KN_EXIT_OK;
    if (!kn_trace_play(&t, &def, &never, error, sizeof error))
        code = kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    else if (!kn_trace_save(&t, j->trace, program))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", j->trace, strerror(errno));
    kn_trace_free(&t);
    free(j);
    return code;
}
