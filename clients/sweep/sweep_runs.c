#include "clients/sweep/sweep_runs.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/sweep/replay_trace.h"
#include "core/hash.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static const char prefix[] = "knead-sweep-", temporary[] = "temporary\n";

// Return the path of the file `name` in the folder with `ending` appended, or "" if the path is too long.
static const char *folder_path(const kn_sweep_folder *f, const char *name, const char *ending, char path[PATH_MAX])
{
    if (snprintf(path, PATH_MAX, "%s/%s%s", f->path, name, ending) >= PATH_MAX) *path = '\0';
    return path;
}

// Remove the folder of the sweep and the files in it.
static void remove_folder(const kn_sweep_folder *f)
{
    char path[PATH_MAX];
    DIR *d = opendir(f->path);
    for (struct dirent *e; d && (e = readdir(d));) {
        if (e->d_name[0] == '.' || unlink(folder_path(f, e->d_name, "", path)) == 0) continue;
        // If the entry is an empty folder, remove it. GNU parallel leaves such folders if this machine is one of
        // several hosts.
        rmdir(path);
    }
    if (d) closedir(d);
    rmdir(f->path);
}

// ---- leftovers of killed sweeps

// Return true if the folder was left behind by a killed sweep of this user.
static bool is_left(const kn_sweep_folder *f)
{
    char path[PATH_MAX], text[200];
    struct stat here;
    if (lstat(f->path, &here) != 0 || !S_ISDIR(here.st_mode) || here.st_uid != geteuid()) return false;
    // Do not follow symbolic links, because every user can write to the parent folder (/tmp).
    int file = open(folder_path(f, "sweep", "", path), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    if (file < 0) return false;
    // If a sweep that is still running holds the lock, the folder is not a leftover.
    ssize_t size = flock(file, LOCK_EX | LOCK_NB) == 0 ? read(file, text, sizeof text) : -1;
    size_t end = sizeof temporary - 1;
    bool left = size > (ssize_t)end && !memcmp(text + size - end, temporary, end);
    close(file);
    return left;
}

// Remove the folders that killed sweeps have left behind in the folder for temporary files.
static void remove_leftovers(const char *parent)
{
    DIR *d = opendir(parent);
    for (struct dirent *e; d && (e = readdir(d));) {
        kn_sweep_folder f = {.lock = -1};
        if (strncmp(e->d_name, prefix, sizeof prefix - 1) != 0) continue;
        if (snprintf(f.path, sizeof f.path, "%s/%s", parent, e->d_name) < PATH_MAX && is_left(&f)) remove_folder(&f);
    }
    if (d) closedir(d);
}

// ---- this sweep's folder

// Create a temporary folder, or create or find the folder that --resume names.
static int make(kn_sweep_folder *f, const char *resume)
{
    const char *parent = getenv("TMPDIR");
    if (!parent || !*parent) parent = "/tmp";
    f->temporary = !resume;
    if (resume) {
        if ((mkdir(resume, 0777) == 0 || errno == EEXIST) && realpath(resume, f->path)) return KN_EXIT_OK;
        int why = errno;
        f->path[0] = '\0';
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s, expected a folder to keep the runs in", resume,
                           strerror(why));
    }
    remove_leftovers(parent);
    snprintf(f->path, sizeof f->path, "%s/%sXXXXXX", parent, prefix);
    if (mkdtemp(f->path)) return KN_EXIT_OK;
    int code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s, expected a folder for temporary files", f->path,
                           strerror(errno));
    f->path[0] = '\0';
    return code;
}

static bool is_empty(const char *folder)
{
    DIR *d = opendir(folder);
    bool empty = d;
    for (struct dirent *e; d && (e = readdir(d));) empty &= !strcmp(e->d_name, ".") || !strcmp(e->d_name, "..");
    if (d) closedir(d);
    return empty;
}

// Return the name of the part (program, scene or log) that differs from the earlier sweep in this folder, or "kind" if
// the file is not that of a sweep. Return NULL if the earlier sweep can be resumed.
static const char *compare(const uint64_t now[3], const char *text)
{
    static const char *const what[] = {"program", "scene", "log"};
    unsigned long long then[3];
    if (sscanf(text, "knead sweep 1\nprogram %llx\nscene %llx\nlog %llx\n", &then[0], &then[1], &then[2]) != 3)
        return "kind";
    for (int i = 0; i < 3; i++)
        if (then[i] != now[i]) return what[i];
    return NULL;
}

// Open the folder `resume`, or a temporary folder in $TMPDIR or /tmp if `resume` is NULL. `now` holds the hashes of
// program, scene and log. The file `sweep` in the folder is opened and locked. Without the lock, two sweeps in the same
// folder would each replay every run. Return an exit code. On failure print one line on stderr.
static int folder_open(kn_sweep_folder *f, const char *resume, const uint64_t now[3])
{
    char path[PATH_MAX], text[200] = "";
    f->lock = -1;
    int code = make(f, resume);
    if (code != KN_EXIT_OK) return code;
    bool fresh = is_empty(f->path);
    // Refuse a folder with files that no sweep has made, because such files must not be changed.
    if (!fresh && access(folder_path(f, "sweep", "", path), F_OK) != 0)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "%s: is not a folder of knead tradeoff --resume, expected such a folder or an empty one",
                           f->path);
    f->lock = open(folder_path(f, "sweep", "", path), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (f->lock < 0 || flock(f->lock, LOCK_EX | LOCK_NB) != 0)
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path,
                           errno == EWOULDBLOCK ? "another sweep is running in this folder" : strerror(errno));
    ssize_t size = pread(f->lock, text, sizeof text - 1, 0);
    const char *other = size > 0 ? compare(now, text) : NULL;
    if (other)
        return kn_complain(
            "tradeoff", KN_EXIT_USAGE,
            "%s: its runs are of another %s, expected the same program, scene and log, or an empty folder", f->path,
            other);
    int length = snprintf(text, sizeof text, "knead sweep 1\nprogram %llx\nscene %llx\nlog %llx\n%s",
                          (unsigned long long)now[0], (unsigned long long)now[1], (unsigned long long)now[2],
                          // If --resume names a leftover of a killed sweep, the folder is no longer temporary.
                          f->temporary ? temporary : "");
    if (pwrite(f->lock, text, (size_t)length, 0) == length && ftruncate(f->lock, length) == 0) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
}

// Close the folder of the sweep. Remove the folder if it is temporary.
static void folder_close(kn_sweep_folder *f)
{
    if (f->temporary && f->path[0]) remove_folder(f);
    if (f->lock >= 0) close(f->lock);
    f->lock = -1;
    f->path[0] = '\0';
}

// ---- a run for another process

// Path of this program's executable file; every trace holds the hash of the executable.
static const char program_file[] = "/proc/self/exe";

// Write the job file of a run.
static bool write_job(const char *path, const kn_sweep_run *run, const char *log)
{
    kn_sweep_run_sets sets;
    kn_sweep_run_sets_make(&sets, run);
    FILE *f = fopen(path, "w");
    bool ok = f && fprintf(f, "scene scene.yaml\nlog %s\ntrace %s.trace\n", log, run->id) > 0;
    for (int i = 0; ok && i < sets.count; i++) ok = fprintf(f, "set %s\n", sets.set[i]) > 0;
    return f && fclose(f) == 0 && ok;
}

// Contents of a job file.
typedef struct job_file {
    char scene[PATH_MAX], log[PATH_MAX], trace[PATH_MAX], set[KN_SWEEP_RUN_SETS][80];
    const char *sets[KN_SWEEP_RUN_SETS];
    int count;
} job_file;

// Read one line of a job file, a name and a value. Return false if the name is unknown or the line is too long.
static bool read_line(job_file *j, const char *line)
{
    const char *value = strchr(line, ' ');
    if (!value++) return false;
    size_t size = (size_t)(value - line);
    if (!strncmp(line, "scene ", size)) return snprintf(j->scene, sizeof j->scene, "%s", value) < PATH_MAX;
    if (!strncmp(line, "log ", size)) return snprintf(j->log, sizeof j->log, "%s", value) < PATH_MAX;
    if (!strncmp(line, "trace ", size)) return snprintf(j->trace, sizeof j->trace, "%s", value) < PATH_MAX;
    // A job may have several `set` lines.
    if (strncmp(line, "set ", size) != 0 || j->count == KN_SWEEP_RUN_SETS) return false;
    j->sets[j->count] = j->set[j->count];
    return snprintf(j->set[j->count++], sizeof j->set[0], "%s", value) < (int)sizeof j->set[0];
}

// Read a job file. Return false if scene, log or trace is missing in it.
static bool read_job(job_file *j, const char *path)
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

int kn_sweep_job_play(const char *path)
{
    char error[512];
    uint64_t program;
    kn_replay_trace t;
    job_file *j = calloc(1, sizeof *j);
    // If this machine is one of several hosts, GNU parallel starts the job one folder below the sweep's folder.
    if (access(path, F_OK) != 0 && *path != '/' && chdir("..") != 0) path = "..";
    if (!j || !read_job(j, path) || !kn_replay_trace_hash(program_file, &program)) {
        free(j);
        return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: expected a job that knead tradeoff --jobs has written",
                           path);
    }
    // Replay the run and save its trace with the hash of this program.
    kn_replay_def def = {
        .log_path = j->log, .scene_path = j->scene, .sets = j->sets, .set_count = j->count, .afresh = true};
    int code = KN_EXIT_OK;
    if (!kn_replay_trace_play(&t, &def, error, sizeof error))
        code = kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    else if (!kn_replay_trace_save(&t, j->trace, program))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", j->trace, strerror(errno));
    kn_replay_trace_free(&t);
    free(j);
    return code;
}

// If two measurements of the computing time of one point differ by more than this factor, the machine was probably busy
// with other work.
#define UNSTEADY 1.15

static const char *in_folder(const kn_sweep_runs *c, const char *name, const char *ending, char path[PATH_MAX])
{
    return folder_path(&c->folder, name, ending, path);
}

// ---- the folder

// Load the trace of a run from the folder.
static kn_replay_trace_found load(const kn_sweep_runs *c, const kn_sweep_run *run, kn_replay_trace *t)
{
    char path[PATH_MAX];
    return kn_replay_trace_load(t, in_folder(c, run->id, ".trace", path), c->program);
}

// Return true if a run must still be replayed. This is the case if it has no trace, or if `times` is true and the trace
// has no valid times.
static bool is_missing(const kn_sweep_runs *c, const kn_sweep_run *run, bool times)
{
    kn_replay_trace t;
    bool missing = load(c, run, &t) != KN_REPLAY_TRACE_FOUND;
    // If a point was replayed in parallel with others, its times are not valid, and `sitting` in its trace is 0.
    missing |= times && run->role == KN_ROLE_POINT && t.sitting == 0;
    kn_replay_trace_free(&t);
    return missing;
}

// Write a small text file into the folder of the sweep.
static bool write_file(const kn_sweep_runs *c, const char *name, const char *ending, const char *text)
{
    char path[PATH_MAX];
    FILE *f = fopen(in_folder(c, name, ending, path), "w");
    bool ok = f && fputs(text, f) >= 0;
    return f && fclose(f) == 0 && ok;
}

// Describe the replay of a run on the scene in the folder. `sets` and `scene` are the memory that the description
// points to.
static kn_replay_def replay_of(const kn_sweep_runs *c, const kn_sweep_run *run, kn_sweep_run_sets *sets,
                               char scene[PATH_MAX])
{
    kn_sweep_run_sets_make(sets, run);
    return (kn_replay_def){.log_path = c->plan->log_path,
                           .scene_path = in_folder(c, "scene.yaml", "", scene),
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
    uint64_t now[3];
    c->folder = (kn_sweep_folder){.lock = -1};
    clock_gettime(CLOCK_REALTIME, &now_s);
    c->sitting = 1000000000 * (int64_t)now_s.tv_sec + now_s.tv_nsec;
    // Compute the hashes of program, plan and log, so that traces of a different sweep are not used.
    if (!kn_replay_trace_hash(program_file, &now[0]))
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", program_file, strerror(errno));
    now[1] = kn_hash_bytes(KN_HASH_SEED, c->plan->text, strlen(c->plan->text));
    if (!kn_replay_trace_hash(c->plan->log_path, &now[2]))
        return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: %s, expected a log", c->plan->log_path, strerror(errno));
    c->program = now[0];
    // Let signals only set a flag, so that the folder is closed properly.
    kn_interrupt_watch();
    // After this call the folder must be closed, even if a later step fails.
    int code = folder_open(&c->folder, c->resume, now);
    if (code == KN_EXIT_OK && !write_file(c, "scene", ".yaml", c->plan->text))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", c->folder.path, strerror(errno));
    if (code == KN_EXIT_OK) code = try_log(c);
    // Count the runs whose traces an earlier call of the same sweep has left in the folder.
    for (int i = 0; i < c->plan->count && code == KN_EXIT_OK; i++) c->kept += !is_missing(c, &c->plan->run[i], false);
    return code;
}

// Close the folder. If this process received a signal, end it by the same signal, so that the parent process sees the
// cause.
void kn_sweep_runs_close(kn_sweep_runs *c)
{
    folder_close(&c->folder);
    if (kn_interrupted) fflush(stdout);
    kn_interrupt_die();
}

// ---- one at a time

// Replay one run in this process.
static int play_here(kn_sweep_runs *c, const kn_sweep_run *run, kn_replay_trace *t)
{
    char scene[PATH_MAX], error[512];
    kn_sweep_run_sets sets;
    kn_replay_def def = replay_of(c, run, &sets, scene);
    if (!kn_replay_trace_play(t, &def, error, sizeof error))
        return kn_interrupted ? KN_EXIT_DEVICE : kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    t->sitting = c->sitting;
    return KN_EXIT_OK;
}

// Save the trace of a run in the folder.
static int keep_trace(const kn_sweep_runs *c, const kn_sweep_run *run, const kn_replay_trace *t)
{
    char path[PATH_MAX];
    if (kn_replay_trace_save(t, in_folder(c, run->id, ".trace", path), c->program)) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
}

// Replay a point a second time, minutes after the first. The shorter of the two times of each tick counts.
static int play_again(kn_sweep_runs *c, const kn_sweep_run *run)
{
    kn_replay_trace first, second = {0};
    bool timed =
        load(c, run, &first) == KN_REPLAY_TRACE_FOUND && first.sitting == c->sitting && run->role == KN_ROLE_POINT;
    int code = timed ? play_here(c, run, &second) : KN_EXIT_OK;
    if (timed && code == KN_EXIT_OK) {
        // Count the point as unsteady if its two measured times differ so much that the machine must have been busy
        // with other work.
        double ratio = second.median_us / first.median_us;
        c->timed++;
        c->unsteady += ratio > UNSTEADY || ratio < 1 / UNSTEADY;
        if (!kn_replay_trace_calm(&second, &first)) code = kn_complain("tradeoff", KN_EXIT_INTERNAL, "out of memory");
        else code = keep_trace(c, run, &second);
    }
    kn_replay_trace_free(&first);
    kn_replay_trace_free(&second);
    return code;
}

// Replay all missing runs one at a time in a first pass. Replay every point again in a second pass to measure its times
// a second time.
static int play_serially(kn_sweep_runs *c)
{
    const kn_sweep_plan *plan = c->plan;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("tradeoff", 2 * plan->count); // the bar counts the runs of both passes
    for (int i = 0; i < plan->count && code == KN_EXIT_OK; i++) {
        kn_replay_trace t = {0};
        if (!is_missing(c, &plan->run[i], true)) continue;
        kn_progress_step(&bar, i);
        code = play_here(c, &plan->run[i], &t);
        if (code == KN_EXIT_OK) code = keep_trace(c, &plan->run[i], &t);
        kn_replay_trace_free(&t);
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
static bool copy_log(const kn_sweep_runs *c)
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
static int write_jobs(const kn_sweep_runs *c)
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
            const kn_sweep_run *run = &c->plan->run[i];
            if ((int)run->role != role || !is_missing(c, run, false)) continue;
            ok = ok && write_job(in_folder(c, run->id, ".job", path), run, log) &&
                 fprintf(list, "%s.job\n", run->id) > 0;
            jobs++;
        }
    return list && fclose(list) == 0 && ok ? jobs : -1;
}

// Write the name of the sweep's folder in the home directory of a remote host. No other sweep on any machine uses the
// same name, so the folder can be deleted with its contents.
static const char *folder_there(const kn_sweep_runs *c, char name[40])
{
    snprintf(name, 40, "knead-sweep-%llx", (unsigned long long)c->sitting);
    return name;
}

// Replace this child process by the program GNU parallel. The child ends when its parent ends, and its output is
// discarded.
static void become(const kn_sweep_runs *c, const char *const *argv)
{
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    int null = open("/dev/null", O_RDWR);
    dup2(null, STDIN_FILENO);
    dup2(null, STDOUT_FILENO);
    if (chdir(c->folder.path) == 0) execvp("parallel", (char *const *)argv);
    _exit(127);
}

// Build the command line of GNU parallel and replace this process by it.
static void become_parallel(const kn_sweep_runs *c)
{
    char jobs[16], folder[40], program[PATH_MAX] = "knead"; // on remote hosts, run the knead in their PATH
    const char *argv[40] = {"parallel", "--plain", "--will-cite", "--quote", "--halt", "now,fail=1"};
    int n = 6;
    // Local jobs run the same program file as this process.
    ssize_t length = c->hosts ? 0 : readlink(program_file, program, sizeof program - 1);
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
static void clean_hosts(const kn_sweep_runs *c)
{
    char folder[40];
    const char *const argv[] = {
        "parallel", "--plain", "--will-cite",           "--timeout", "20", "--nonall", "--sshlogin", c->hosts,
        "rm",       "-rf",     folder_there(c, folder), NULL};
    pid_t child = fork();
    if (child == 0) {
        // GNU parallel has already reported the error of a host, so discard the messages.
        dup2(open("/dev/null", O_WRONLY), STDERR_FILENO);
        become(c, argv);
    }
    while (child > 0 && waitpid(child, NULL, 0) < 0 && errno == EINTR) continue;
}

// Return the number of trace files in the folder of the sweep.
static int count_traces(const kn_sweep_runs *c)
{
    char path[PATH_MAX];
    int count = 0;
    for (int i = 0; i < c->plan->count; i++)
        count += access(in_folder(c, c->plan->run[i].id, ".trace", path), F_OK) == 0;
    return count;
}

// Wait until GNU parallel has ended, and draw a progress bar meanwhile. Return the exit code of GNU parallel.
static int attend(const kn_sweep_runs *c, pid_t child)
{
    static const struct timespec pause = {0, 200000000};
    int status = 0, asked = 0;
    kn_progress bar = kn_progress_open(c->hosts ? "tradeoff on hosts" : "tradeoff by parallel", c->plan->count);
    while (waitpid(child, &status, WNOHANG) == 0) {
        // After the first SIGTERM GNU parallel lets the running jobs end. After the second SIGTERM it stops them.
        if (kn_interrupted && asked++ < 2) kill(child, SIGTERM);
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
static int play_in_parallel(kn_sweep_runs *c)
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
    if (kn_interrupted) return KN_EXIT_DEVICE;
    if (code == 127)
        return kn_complain("tradeoff", KN_EXIT_DEVICE,
                           "GNU parallel cannot be run (package parallel); without --jobs and "
                           "--hosts runs are played one at a time");
    // Count the missing and the unusable traces, because the exit code of GNU parallel alone is not reliable.
    int missing = 0, foreign = 0;
    for (int i = 0; i < c->plan->count; i++) {
        kn_replay_trace t;
        kn_replay_trace_found found = load(c, &c->plan->run[i], &t);
        kn_replay_trace_free(&t);
        missing += found != KN_REPLAY_TRACE_FOUND;
        foreign += found == KN_REPLAY_TRACE_FOREIGN;
    }
    if (foreign)
        return kn_complain("tradeoff", KN_EXIT_DEVICE,
                           "%d runs are of another build of knead, expected the same on every "
                           "host",
                           foreign);
    if (code == 0 && missing == 0) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE, "%d of %d runs have no result%s", missing, c->plan->count,
                       c->resume ? "; repeat the command to play them"
                                 : "; with --resume DIR the finished runs would be kept");
}

// ---- all of it

int kn_sweep_runs_play(kn_sweep_runs *c)
{
    int code = KN_EXIT_OK;
    // First replay the runs by GNU parallel if this was requested. Then replay in this process the runs without a trace
    // or without valid times, because times are valid only if the runs are replayed one at a time.
    if (c->jobs != 1 || c->hosts) code = play_in_parallel(c);
    return code == KN_EXIT_OK ? play_serially(c) : code;
}

int kn_sweep_runs_load(const kn_sweep_runs *c, kn_replay_trace *traces)
{
    char path[PATH_MAX];
    for (int i = 0; i < c->plan->count; i++)
        if (kn_replay_trace_load(&traces[i], in_folder(c, c->plan->run[i].id, ".trace", path), c->program) !=
            KN_REPLAY_TRACE_FOUND)
            return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: is damaged or missing", path);
    return KN_EXIT_OK;
}
