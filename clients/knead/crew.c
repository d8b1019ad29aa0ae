#include "clients/knead/crew.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/job.h"
#include "clients/knead/origin.h"
#include "clients/knead/progress.h"
#include "core/hash.h"
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

// If two measurements of the computing time of one point differ by more than this factor, the machine was probably busy
// with other work.
#define UNSTEADY 1.15

static volatile sig_atomic_t stopped;

static void on_signal(int number) { stopped = number; }

static const char *in_folder(const kn_crew *c, const char *name, const char *ending, char path[PATH_MAX])
{
    return kn_folder_path(&c->folder, name, ending, path);
}

// ---- the folder

// Return true if a run must still be replayed. This is the case if it has no trace, or if `times` is true and the trace
// has no valid times.
static bool is_missing(const kn_crew *c, const kn_run *run, bool times)
{
    char path[PATH_MAX];
    kn_trace t;
    bool missing = kn_trace_load(&t, in_folder(c, run->id, ".trace", path), c->program) != KN_TRACE_FOUND;
    // If a point was replayed in parallel with others, its times are not valid, and `sitting` in its trace is 0.
    missing |= times && run->role == KN_ROLE_POINT && t.sitting == 0;
    kn_trace_free(&t);
    return missing;
}

// Write a small text file into the folder of the sweep.
static bool write_file(const kn_crew *c, const char *name, const char *ending, const char *text)
{
    char path[PATH_MAX];
    FILE *f = fopen(in_folder(c, name, ending, path), "w");
    bool ok = f && fputs(text, f) >= 0;
    return f && fclose(f) == 0 && ok;
}

// Check that the log fits the scene, before anything is printed or replayed.
static int try_log(const kn_crew *c)
{
    char scene[PATH_MAX], error[512];
    // The check gives the same result for all runs, so use the first run.
    kn_run_sets sets;
    kn_run_sets_make(&sets, &c->plan->run[0]);
    kn_replay_def def = {.log_path = c->plan->log_path,
                         .scene_path = in_folder(c, "scene.yaml", "", scene),
                         .sets = sets.set,
                         .set_count = sets.count,
                         .afresh = true};
    bool fit = kn_origin_check(&def, c->plan->scene_path, c->plan->scene, error, sizeof error);
    // The error names the copy scene.yaml in the folder. Replace this name by the name that the user gave.
    static const char ours[] = "scene.yaml: ";
    if (fit) return KN_EXIT_OK;
    if (strncmp(error, ours, sizeof ours - 1) != 0) return kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: %s", c->plan->scene_path, error + sizeof ours - 1);
}

int kn_crew_open(kn_crew *c)
{
    struct sigaction action = {.sa_handler = on_signal};
    struct timespec now_s;
    uint64_t now[3];
    c->folder = (kn_folder){.lock = -1};
    clock_gettime(CLOCK_REALTIME, &now_s);
    c->sitting = 1000000000 * (int64_t)now_s.tv_sec + now_s.tv_nsec;
    // Compute the hashes of program, plan and log, so that traces of a different sweep are not used.
    if (!kn_trace_hash(kn_job_program, &now[0]))
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", kn_job_program, strerror(errno));
    now[1] = kn_hash_bytes(KN_HASH_SEED, c->plan->text, strlen(c->plan->text));
    if (!kn_trace_hash(c->plan->log_path, &now[2]))
        return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: %s, expected a log", c->plan->log_path, strerror(errno));
    c->program = now[0];
    // Let signals only set a flag, so that the folder is closed properly.
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
    // After this call the folder must be closed, even if a later step fails.
    int code = kn_folder_open(&c->folder, c->resume, now);
    if (code == KN_EXIT_OK && !write_file(c, "scene", ".yaml", c->plan->text))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", c->folder.path, strerror(errno));
    if (code == KN_EXIT_OK) code = try_log(c);
    // Count the runs whose traces an earlier call of the same sweep has left in the folder.
    for (int i = 0; i < c->plan->count && code == KN_EXIT_OK; i++) c->kept += !is_missing(c, &c->plan->run[i], false);
    return code;
}

// Close the folder. If this process received a signal, end it by the same signal, so that the parent process sees the
// cause.
void kn_crew_close(kn_crew *c)
{
    kn_folder_close(&c->folder);
    if (!stopped) return;
    fflush(stdout);
    signal((int)stopped, SIG_DFL);
    raise((int)stopped);
}

// ---- one at a time

// Replay one run in this process.
static int play_here(kn_crew *c, const kn_run *run, kn_trace *t)
{
    char scene[PATH_MAX], error[512];
    kn_run_sets sets;
    kn_run_sets_make(&sets, run);
    kn_replay_def def = {.log_path = c->plan->log_path,
                         .scene_path = in_folder(c, "scene.yaml", "", scene),
                         .sets = sets.set,
                         .set_count = sets.count,
                         .afresh = true};
    if (!kn_trace_play(t, &def, &stopped, error, sizeof error))
        return stopped ? KN_EXIT_DEVICE : kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    t->sitting = c->sitting;
    return KN_EXIT_OK;
}

// Save the trace of a run in the folder.
static int keep(const kn_crew *c, const kn_run *run, const kn_trace *t)
{
    char path[PATH_MAX];
    if (kn_trace_save(t, in_folder(c, run->id, ".trace", path), c->program)) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
}

// Replay a point a second time, minutes after the first. The shorter of the two times of each tick counts.
static int play_again(kn_crew *c, const kn_run *run)
{
    char path[PATH_MAX];
    kn_trace first, second = {0};
    kn_trace_found found = kn_trace_load(&first, in_folder(c, run->id, ".trace", path), c->program);
    bool timed = found == KN_TRACE_FOUND && first.sitting == c->sitting && run->role == KN_ROLE_POINT;
    int code = timed ? play_here(c, run, &second) : KN_EXIT_OK;
    if (timed && code == KN_EXIT_OK) {
        // Count the point as unsteady if its two measured times differ so much that the machine must have been busy
        // with other work.
        double ratio = second.median_us / first.median_us;
        c->timed++;
        c->unsteady += ratio > UNSTEADY || ratio < 1 / UNSTEADY;
        if (!kn_trace_calm(&second, &first)) code = kn_complain("tradeoff", KN_EXIT_INTERNAL, "out of memory");
        else code = keep(c, run, &second);
    }
    kn_trace_free(&first);
    kn_trace_free(&second);
    return code;
}

// Replay all missing runs one at a time in a first pass. Replay every point again in a second pass to measure its times
// a second time.
static int play_serially(kn_crew *c)
{
    const kn_plan *plan = c->plan;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("tradeoff", 2 * plan->count); // the bar counts the runs of both passes
    for (int i = 0; i < plan->count && code == KN_EXIT_OK; i++) {
        kn_trace t = {0};
        if (!is_missing(c, &plan->run[i], true)) continue;
        kn_progress_step(&bar, i);
        code = play_here(c, &plan->run[i], &t);
        if (code == KN_EXIT_OK) code = keep(c, &plan->run[i], &t);
        kn_trace_free(&t);
    }
    for (int i = 0; i < plan->count && code == KN_EXIT_OK; i++) {
        kn_progress_step(&bar, plan->count + i);
        code = play_again(c, &plan->run[i]);
    }
    kn_progress_close(&bar);
    return code;
}

// ---- by GNU parallel

// Copy the log into the folder of the sweep. GNU parallel sends this copy to the hosts.
static bool copy_log(const kn_crew *c)
{
    static char bytes[1 << 16];
    char path[PATH_MAX];
    FILE *from = fopen(c->plan->log_path, "rb"), *to = fopen(in_folder(c, "log.lcmlog", "", path), "wb");
    bool ok = from && to;
    for (size_t n; ok && (n = fread(bytes, 1, sizeof bytes, from)) > 0;) ok = fwrite(bytes, 1, n, to) == n;
    ok = ok && !ferror(from);
    if (from) fclose(from);
    return to && fclose(to) == 0 && ok;
}

// Write a job file for each missing run, the longest run first. Return the number of job files, or -1 if a file cannot
// be written.
static int write_jobs(const kn_crew *c)
{
    char log[PATH_MAX] = "log.lcmlog", path[PATH_MAX];
    int jobs = 0;
    // A host reads a copy of the log in the folder of the job file. A local process reads the original log.
    bool ok = c->hosts ? copy_log(c) : realpath(c->plan->log_path, log) != NULL;
    FILE *list = fopen(in_folder(c, "jobs", "", path), "w");
    // Runs with finer lattices and smaller time steps take longer and are last in the plan, so list the runs from the
    // end.
    for (int role = KN_ROLE_FINE; list && role >= KN_ROLE_POINT; role--)
        for (int i = c->plan->count - 1; i >= 0; i--) {
            const kn_run *run = &c->plan->run[i];
            if ((int)run->role != role || !is_missing(c, run, false)) continue;
            ok = ok && kn_job_write(in_folder(c, run->id, ".job", path), run, log) &&
                 fprintf(list, "%s.job\n", run->id) > 0;
            jobs++;
        }
    return list && fclose(list) == 0 && ok ? jobs : -1;
}

// Write the name of the sweep's folder in the home directory of a remote host. No other sweep on any machine uses the
// same name, so the folder can be deleted with its contents.
static const char *folder_there(const kn_crew *c, char name[40])
{
    snprintf(name, 40, "knead-sweep-%llx", (unsigned long long)c->sitting);
    return name;
}

// Replace this child process by the program GNU parallel. The child ends when its parent ends, and its output is
// discarded.
static void become(const kn_crew *c, const char *const *argv)
{
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    int null = open("/dev/null", O_RDWR);
    dup2(null, STDIN_FILENO);
    dup2(null, STDOUT_FILENO);
    if (chdir(c->folder.path) == 0) execvp("parallel", (char *const *)argv);
    _exit(127);
}

// Build the command line of GNU parallel and replace this process by it.
static void become_parallel(const kn_crew *c)
{
    char jobs[16], folder[40], program[PATH_MAX] = "knead"; // on remote hosts, run the knead in their PATH
    const char *argv[40] = {"parallel", "--plain", "--will-cite", "--quote", "--halt", "now,fail=1"};
    int n = 6;
    // Local jobs run the same program file as this process.
    ssize_t length = c->hosts ? 0 : readlink(kn_job_program, program, sizeof program - 1);
    if (length > 0) program[length] = '\0';
    snprintf(jobs, sizeof jobs, "%d", c->jobs);
    if (c->jobs > 0) argv[n++] = "--jobs", argv[n++] = jobs;
    // GNU parallel copies scene, log and job file to the hosts by ssh, and copies the trace back.
    if (c->hosts) {
        static const char *const transfer[] = {"--basefile", "scene.yaml", "--basefile", "log.lcmlog", "--transferfile",
                                               "{}",         "--return",   "{.}.trace",  "--cleanup"};
        argv[n++] = "--sshlogin", argv[n++] = c->hosts;
        argv[n++] = "--workdir", argv[n++] = folder_there(c, folder);
        for (size_t i = 0; i < sizeof transfer / sizeof *transfer; i++) argv[n++] = transfer[i];
    }
    const char *const command[] = {program, "tradeoff", "--job", "{}", "::::", "jobs", NULL};
    memcpy(argv + n, command, sizeof command);
    become(c, argv);
}

// Delete the sweep's folder on every host. The option --cleanup of GNU parallel is not sufficient: it leaves all files
// if a job failed or was interrupted. The timeout of 20 s is for a host that is unreachable.
static void clean_hosts(const kn_crew *c)
{
    char folder[40];
    const char *const argv[] = {
        "parallel", "--plain", "--will-cite",           "--timeout", "20", "--nonall", "--sshlogin", c->hosts,
        "rm",       "-rf",     folder_there(c, folder), NULL};
    pid_t child = fork();
    if (child == 0) {
        // GNU parallel has already reported the error of a host, so discard the messages
        dup2(open("/dev/null", O_WRONLY), STDERR_FILENO);
        become(c, argv);
    }
    while (child > 0 && waitpid(child, NULL, 0) < 0 && errno == EINTR) continue;
}

// Return the number of trace files in the folder of the sweep.
static int count_traces(const kn_crew *c)
{
    char path[PATH_MAX];
    int count = 0;
    for (int i = 0; i < c->plan->count; i++)
        count += access(in_folder(c, c->plan->run[i].id, ".trace", path), F_OK) == 0;
    return count;
}

// Wait until GNU parallel has ended, and draw a progress bar meanwhile. Return the exit code of GNU parallel.
static int attend(const kn_crew *c, pid_t child)
{
    static const struct timespec pause = {0, 200000000};
    int status = 0, asked = 0;
    kn_progress bar = kn_progress_open(c->hosts ? "tradeoff on hosts" : "tradeoff by parallel", c->plan->count);
    while (waitpid(child, &status, WNOHANG) == 0) {
        // After the first SIGTERM GNU parallel lets the running jobs end. After the second SIGTERM it stops them.
        if (stopped && asked++ < 2) kill(child, SIGTERM);
        if (bar.terminal) kn_progress_step(&bar, count_traces(c));
        nanosleep(&pause, NULL);
    }
    kn_progress_close(&bar);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

// Return true if the scene refers to mesh files, of its object or of a tool.
static bool has_files(const kn_scene *scene)
{
    bool any = scene->mesh != NULL;
    for (int p = 0; p < scene->model.probe_count; p++) any |= scene->model.probe[p].shape == KN_PROBE_MESH;
    return any;
}

// Replay the missing runs in several processes by GNU parallel.
static int play_in_parallel(kn_crew *c)
{
    if (c->hosts && has_files(c->plan->scene))
        return kn_complain(
            "tradeoff", KN_EXIT_USAGE,
            "--hosts: does not send meshes, expected a scene without object.mesh and without tools from files");
    int jobs = write_jobs(c);
    if (jobs < 0) return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: the jobs could not be written", c->folder.path);
    if (jobs == 0) return KN_EXIT_OK;
    pid_t child = fork();
    if (child == 0) become_parallel(c);
    int code = child > 0 ? attend(c, child) : 126;
    if (c->hosts && code != 0) clean_hosts(c);
    if (stopped) return KN_EXIT_DEVICE;
    if (code == 127)
        return kn_complain("tradeoff", KN_EXIT_DEVICE,
                           "GNU parallel cannot be run (package parallel); without --jobs and "
                           "--hosts runs are played one at a time");
    // Count the missing and the unusable traces, because the exit code of GNU parallel alone is not reliable.
    int missing = 0, foreign = 0;
    char path[PATH_MAX];
    for (int i = 0; i < c->plan->count; i++) {
        kn_trace_found found = kn_trace_peek(in_folder(c, c->plan->run[i].id, ".trace", path), c->program);
        missing += found != KN_TRACE_FOUND;
        foreign += found == KN_TRACE_FOREIGN;
    }
    if (foreign)
        return kn_complain("tradeoff", KN_EXIT_DEVICE,
                           "%d runs are of another build of knead, expected the same on every "
                           "host",
                           foreign);
    if (code == 0 && missing == 0) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE, "%d of %d runs have no result%s", missing, c->plan->count,
                       c->resume ? "; repeat the command to play them" : "; --resume DIR would keep the others");
}

// ---- all of it

int kn_crew_play(kn_crew *c)
{
    int code = KN_EXIT_OK;
    // First replay the runs by GNU parallel if this was requested. Then replay in this process the runs without a trace
    // or without valid times, because times are valid only if the runs are replayed one at a time.
    if (c->jobs != 1 || c->hosts) code = play_in_parallel(c);
    return code == KN_EXIT_OK ? play_serially(c) : code;
}

int kn_crew_load(const kn_crew *c, kn_trace *traces)
{
    char path[PATH_MAX];
    for (int i = 0; i < c->plan->count; i++)
        if (kn_trace_load(&traces[i], in_folder(c, c->plan->run[i].id, ".trace", path), c->program) != KN_TRACE_FOUND)
            return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: is damaged or missing", path);
    return KN_EXIT_OK;
}
