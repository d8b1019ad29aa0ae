#include "clients/sweep/sweep_runs.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/sweep/replay_trace.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

// If two measurements of the computing time of one point differ by more than this factor, the machine was probably busy
// with other work.
#define UNSTEADY 1.15

// Return the name of the trace of a run in the folder.
static const char *trace_of(const kn_sweep_run *run, char name[32])
{
    snprintf(name, 32, "%s.trace", run->id);
    return name;
}

// Load the trace of run i from the folder. Return false if it is missing or damaged.
static bool load(kn_sweep_runs *c, int i)
{
    char path[PATH_MAX], name[32];
    return kn_replay_trace_load(&c->trace[i], kn_jobs_path(&c->jobs, trace_of(&c->plan->run[i], name), path));
}

// Write the scene into the folder, and a link to the log, so that a job finds both under the same names on every host.
static bool write_inputs(const kn_sweep_runs *c)
{
    char path[PATH_MAX], log[PATH_MAX];
    FILE *f = fopen(kn_jobs_path(&c->jobs, "scene.yaml", path), "w");
    bool ok = f && fputs(c->plan->text, f) >= 0;
    ok = f && fclose(f) == 0 && ok && realpath(c->plan->log_path, log);
    unlink(kn_jobs_path(&c->jobs, "log.lcmlog", path));
    return ok && symlink(log, path) == 0;
}

// Describe the replay of a run on the scene in the folder. `sets` and `scene` are the memory that the description
// points to.
static kn_replay_def replay_of(const kn_sweep_runs *c, const kn_sweep_run *run, kn_sweep_run_sets *sets,
                               char scene[PATH_MAX])
{
    kn_sweep_run_sets_make(sets, run);
    return (kn_replay_def){.log_path = c->plan->log_path,
                           .scene_path = kn_jobs_path(&c->jobs, "scene.yaml", scene),
                           .sets = sets->set,
                           .set_count = sets->count,
                           .afresh = true};
}

// Check that the log fits the scene, before anything is printed or replayed.
static int try_log(const kn_sweep_runs *c)
{
    char scene[PATH_MAX], error[512];
    // The check gives the same result for all runs, so use the first run.
    kn_sweep_run_sets sets;
    kn_replay_def def = replay_of(c, &c->plan->run[0], &sets, scene);
    bool fit = kn_replay_log_check(&def, c->plan->scene_path, c->plan->scene, error, sizeof error);
    // The error names the copy scene.yaml in the folder. Replace this name by the name that the user gave.
    static const char ours[] = "scene.yaml: ";
    if (fit) return KN_EXIT_OK;
    if (strncmp(error, ours, sizeof ours - 1) != 0) return kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: %s", c->plan->scene_path, error + sizeof ours - 1);
}

int kn_sweep_runs_open(kn_sweep_runs *c)
{
    struct timespec now_s;
    clock_gettime(CLOCK_REALTIME, &now_s);
    c->sitting = 1000000000 * (int64_t)now_s.tv_sec + now_s.tv_nsec;
    c->jobs.command = "tradeoff";
    c->jobs.hint = c->resume ? "repeat the command to play them" : "with --resume DIR the finished runs would be kept";
    int code = kn_jobs_open(&c->jobs, c->resume, NULL);
    if (code == KN_EXIT_OK && !write_inputs(c))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", c->jobs.folder, strerror(errno));
    if (code == KN_EXIT_OK) code = try_log(c);
    // Load the traces that an earlier call of the same sweep has left in the folder.
    for (int i = 0; i < c->plan->count && code == KN_EXIT_OK; i++) c->kept += load(c, i);
    return code;
}

int kn_sweep_run_play(kn_sweep_runs *c, const char *path, const kn_replay_def *def, kn_replay_trace *trace)
{
    char error[512];
    kn_replay_trace t;
    const bool again = trace->ticks > 0 && trace->sitting == c->sitting; // `trace` is of this serial pass
    if (!kn_replay_trace_play(&t, def, error, sizeof error))
        return kn_interrupted ? KN_EXIT_DEVICE : kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    t.sitting = c->sitting;
    if (again) {
        // Count the point as unsteady if its two measured times differ so much that the machine must have been busy
        // with other work.
        double ratio = t.median_us / trace->median_us;
        c->timed++;
        c->unsteady += ratio > UNSTEADY || ratio < 1 / UNSTEADY;
    }
    bool saved = (!again || kn_replay_trace_calm(&t, trace)) && kn_replay_trace_save(&t, path);
    kn_replay_trace_free(trace);
    *trace = t;
    return saved ? KN_EXIT_OK : kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
}

// ---- one at a time

// Load or replay run i. An engine, or a run of another role with the same id, may have left its trace in the folder. In
// the first pass the missing runs are replayed, and the points without valid times, because they were replayed in
// parallel with others. In the second pass, `again`, these are the points that were replayed in the first pass, minutes
// ago.
static int play_here(kn_sweep_runs *c, int i, bool again)
{
    char path[PATH_MAX], name[32], scene[PATH_MAX];
    kn_sweep_run_sets sets;
    const kn_sweep_run *run = &c->plan->run[i];
    const kn_replay_def def = replay_of(c, run, &sets, scene);
    const bool found = c->trace[i].ticks > 0 || load(c, i), point = run->role == KN_ROLE_POINT;
    if (found && !(point && c->trace[i].sitting == (again ? c->sitting : 0))) return KN_EXIT_OK;
    return kn_sweep_run_play(c, kn_jobs_path(&c->jobs, trace_of(run, name), path), &def, &c->trace[i]);
}

static int play_serially(kn_sweep_runs *c)
{
    const int runs = c->plan->count;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("tradeoff", 2 * runs); // the bar counts the runs of both passes
    for (int i = 0; i < 2 * runs && code == KN_EXIT_OK; i++) {
        kn_progress_step(&bar, i);
        code = play_here(c, i % runs, i >= runs);
    }
    kn_progress_close(&bar);
    return code;
}

// ---- by an engine

// Add the job of a run.
static void add_job(kn_sweep_runs *c, const kn_sweep_run *run)
{
    char *words[2 + 2 * KN_SWEEP_RUN_SETS] = {"scene.yaml", "log.lcmlog"}, name[32];
    kn_sweep_run_sets sets;
    kn_sweep_run_sets_make(&sets, run);
    for (int i = 0; i < sets.count; i++) words[2 + 2 * i] = "--set", words[3 + 2 * i] = sets.made[i];
    kn_jobs_add(&c->jobs, trace_of(run, name), 2 + 2 * sets.count, words);
}

// List the files that a host needs: scene, log, and the meshes that the scene names by absolute paths. A mesh that is not
// found at its path is read from the folder of the job.
static void send_files(kn_sweep_runs *c)
{
    char path[PATH_MAX];
    kn_jobs_send(&c->jobs, "scene.yaml");
    kn_jobs_send(&c->jobs, "log.lcmlog");
    for (const char *line = c->plan->text; line; line = strchr(line, '\n')) {
        line += strspn(line, " \n");
        if (sscanf(line, "mesh: '/%4000[^'\n]", path + 1) != 1) continue;
        *path = '/';
        char *name = strrchr(path, '/') + 1;
        memmove(name + 2, name, strlen(name) + 1);
        memcpy(name, "./", 2);
        kn_jobs_send(&c->jobs, path);
    }
}

// Replay the missing runs by an engine, the longest first: those with finer lattices and smaller time steps, which are
// last in the plan.
static int play_by_engine(kn_sweep_runs *c)
{
    send_files(c);
    for (int role = KN_ROLE_FINE; role >= KN_ROLE_POINT; role--)
        for (int i = c->plan->count - 1; i >= 0; i--) {
            const kn_sweep_run *run = &c->plan->run[i];
            if ((int)run->role == role && c->trace[i].ticks == 0) add_job(c, run);
        }
    return kn_jobs_play(&c->jobs);
}

// ---- all of it

int kn_sweep_runs_play(kn_sweep_runs *c)
{
    int code = KN_EXIT_OK;
    // First replay the runs by an engine if this was requested. Then replay in this process the runs without a trace
    // or without valid times, because times are valid only if the runs are replayed one at a time.
    if (!kn_jobs_here(&c->jobs.engine)) code = play_by_engine(c);
    return code == KN_EXIT_OK ? play_serially(c) : code;
}
