#include "clients/cli/jobs.h"
#include "clients/cli/command.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

// Text of jobs.sh, which the build embeds in the program.
extern const char jobs_sh[];
__asm__(".section .rodata\njobs_sh: .incbin \"" KN_CLIENTS_DIR "/cli/jobs.sh\"\n.byte 0\n.previous\n");

bool kn_jobs_here(const kn_jobs_engine *e) { return !e->hosts && !e->slurm && (!e->parallel || e->jobs == 1); }

const char *kn_jobs_path(const kn_jobs *j, const char *name, char path[PATH_MAX])
{
    if (snprintf(path, PATH_MAX, "%s/%s", j->folder, name) >= PATH_MAX) *path = '\0';
    return path;
}

// Write a word so that a shell reads it as it is: in quotes, and each quote of its own outside of them.
static void put_word(FILE *f, const char *before, const char *word)
{
    fprintf(f, "%s'", before);
    for (; *word; word++) {
        if (*word == '\'') fputs("'\\'", f);
        fputc(*word, f);
    }
    fputc('\'', f);
}

// Check that the engine can be run. Return an exit code.
static int try_engine(const kn_jobs *j)
{
    if (j->engine.hosts && j->engine.slurm)
        return kn_complain(j->command, KN_EXIT_USAGE, "--slurm: expected no --hosts, because Slurm chooses the hosts");
    if (kn_jobs_here(&j->engine) ||
        system(j->engine.slurm ? "command -v sbatch >/dev/null" : "command -v parallel >/dev/null") == 0)
        return KN_EXIT_OK;
    return kn_complain(
        j->command, KN_EXIT_DEVICE, "%s; without --jobs, --hosts and --slurm runs are played one at a time",
        j->engine.slurm ? "no sbatch here (package slurm-client)" : "no GNU parallel here (package parallel)");
}

// Create or find the folder. Return an exit code.
static int make_folder(kn_jobs *j, const char *folder)
{
    char path[PATH_MAX];
    const char *parent = getenv("TMPDIR");
    if (!folder) snprintf(path, sizeof path, "%s/knead-jobs-XXXXXX", parent && *parent ? parent : "/tmp");
    j->temporary = !folder;
    j->fresh = !folder || kn_output_empty(folder) == 1;
    bool made = folder ? mkdir(folder, 0777) == 0 || errno == EEXIST : mkdtemp(path) != NULL;
    if (!folder) folder = path;
    if (!made || !realpath(folder, j->folder)) {
        j->folder[0] = '\0';
        return kn_complain(j->command, KN_EXIT_DEVICE, "%s: %s, expected a folder for the runs", folder,
                           strerror(errno));
    }
    // Refuse a folder with files of another origin, because they must not be changed.
    if (j->fresh || access(kn_jobs_path(j, "sent", path), F_OK) == 0) return KN_EXIT_OK;
    return kn_complain(j->command, KN_EXIT_USAGE, "%s: is not a folder of runs, expected such a folder or an empty one",
                       folder);
}

int kn_jobs_open(kn_jobs *j, const char *folder, const char *home)
{
    char path[PATH_MAX], program[PATH_MAX] = "";
    struct timespec now;
    int code = try_engine(j);
    // Let signals only set a flag, so that the folder is closed properly.
    kn_interrupt_watch();
    if (code == KN_EXIT_OK) code = make_folder(j, folder);
    if (code != KN_EXIT_OK) return code;
    // Open without truncation, because another process may hold the lock.
    j->sent = fopen(kn_jobs_path(j, "sent", path), "ae");
    if (!j->sent || flock(fileno(j->sent), LOCK_EX | LOCK_NB) != 0) {
        j->fresh = false; // it belongs to the other command
        return kn_complain(j->command, KN_EXIT_DEVICE, "%s: %s", j->folder,
                           errno == EWOULDBLOCK ? "another command is playing the runs of this folder"
                                                : strerror(errno));
    }
    // Make new files, because an array whose command was killed may still be reading the old ones.
    unlink(kn_jobs_path(j, "results", path));
    j->results = fopen(path, "we");
    unlink(kn_jobs_path(j, "jobs", path));
    j->script = fopen(path, "we");
    if (!j->results || !j->script || ftruncate(fileno(j->sent), 0) != 0 ||
        readlink("/proc/self/exe", program, sizeof program - 1) < 0)
        return kn_complain(j->command, KN_EXIT_DEVICE, "%s: %s", j->folder, strerror(errno));
    // The name is unique on all machines, so a folder of this name may be deleted, and the array of this name ended.
    clock_gettime(CLOCK_REALTIME, &now);
    fprintf(j->script, "command=%s name=knead-jobs-%lld%09ld ", j->command, (long long)now.tv_sec, now.tv_nsec);
    fprintf(j->script, j->engine.jobs > 0 ? "jobs=%d " : "jobs= ", j->engine.jobs);
    put_word(j->script, "hosts=", j->engine.hosts ? j->engine.hosts : "");
    put_word(j->script, " folder=", j->folder);
    put_word(j->script, " home=", home ? home : j->folder);
    put_word(j->script, " knead=", program);
    fprintf(j->script, "\n%s", jobs_sh);
    kn_jobs_send(j, "jobs");
    return KN_EXIT_OK;
}

void kn_jobs_send(kn_jobs *j, const char *path) { fprintf(j->sent, "%s\n", path); }

void kn_jobs_add(kn_jobs *j, const char *result, int count, char *const *words)
{
    char path[PATH_MAX];
    unlink(kn_jobs_path(j, result, path));
    j->count++;
    fprintf(j->results, "%s\n", result);
    fprintf(j->script, "job %s", result);
    for (int i = 0; i < count; i++) put_word(j->script, " ", words[i]);
    fputc('\n', j->script);
}

// Return the number of jobs without a result.
static int missing(const kn_jobs *j)
{
    char path[PATH_MAX], name[NAME_MAX + 1];
    int count = 0;
    FILE *f = fopen(kn_jobs_path(j, "results", path), "re");
    while (f && fscanf(f, "%255s", name) == 1) count += access(kn_jobs_path(j, name, path), F_OK) != 0;
    if (f) fclose(f);
    return count;
}

// Start the script. It ends when this process ends. Its output is discarded, and `errors` gets its errors.
static pid_t start(const kn_jobs *j, const char *engine, FILE *errors)
{
    pid_t child = fork();
    if (child != 0) return child;
    // A Ctrl-C of the terminal goes to this process alone, which then tells the script. So the script can clean up.
    setsid();
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    kn_interrupt_unwatch();
    dup2(open("/dev/null", O_WRONLY | O_CLOEXEC), STDOUT_FILENO);
    dup2(fileno(errors), STDERR_FILENO);
    if (chdir(j->folder) == 0) execlp("sh", "sh", "jobs", engine, NULL);
    _exit(127);
}

// Read the first error of the engine, without the end of its line.
static void read_reason(FILE *errors, char *line, int size)
{
    rewind(errors);
    do line[0] = '\0';
    while (fgets(line, size, errors) && (*line == '\n' || !strncmp(line, "parallel: Warning", 17)));
    line[strcspn(line, "\n")] = '\0';
}

int kn_jobs_play(kn_jobs *j)
{
    static const struct timespec pause = {0, 100000000};
    const char *engine = j->engine.slurm            ? "slurm"
                         : j->engine.hosts          ? "hosts"
                         : kn_jobs_here(&j->engine) ? "here"
                                                    : "parallel";
    if (fflush(j->script) | fflush(j->results) | fflush(j->sent) | ferror(j->script) | ferror(j->results) |
        ferror(j->sent))
        return kn_complain(j->command, KN_EXIT_DEVICE, "%s: the list of runs could not be written", j->folder);
    if (kn_interrupted) return KN_EXIT_DEVICE;
    if (j->count == 0) return KN_EXIT_OK;
    char reason[500];
    FILE *errors = tmpfile();
    kn_progress bar = kn_progress_open(j->command, j->count);
    pid_t child = errors ? start(j, engine, errors) : -1;
    if (child < 0) snprintf(reason, sizeof reason, "%s", strerror(errno));
    for (int asked = 0; child > 0 && waitpid(child, NULL, WNOHANG) == 0; nanosleep(&pause, NULL)) {
        // After the first SIGTERM GNU parallel lets the running jobs end. After the second SIGTERM it stops them.
        if (kn_interrupted && asked++ < 2) kill(child, SIGTERM);
        if (bar.terminal) kn_progress_step(&bar, j->count - missing(j));
    }
    kn_progress_close(&bar);
    if (child > 0) read_reason(errors, reason, sizeof reason);
    if (errors) fclose(errors);
    if (kn_interrupted) return KN_EXIT_DEVICE;
    // Count the results, because the exit code of an engine alone is not reliable.
    int left = missing(j);
    if (left == 0) return KN_EXIT_OK;
    return kn_complain(j->command, KN_EXIT_DEVICE, "%d of %d runs have no result (%s); %s", left, j->count,
                       *reason ? reason : "no error was reported", j->hint);
}

void kn_jobs_close(kn_jobs *j)
{
    kn_output_folder all = {0};
    FILE *const file[] = {j->script, j->results, j->sent};
    if (j->temporary && snprintf(all.folder, sizeof all.folder, "%s", j->folder) < (int)sizeof all.folder)
        kn_output_folder_drop(&all);
    for (int i = 0; i < 3; i++)
        if (file[i]) fclose(file[i]);
    if (kn_interrupted) fflush(stdout);
    kn_interrupt_die();
}

void kn_jobs_begin(void) { prctl(PR_SET_PDEATHSIG, SIGTERM); }
