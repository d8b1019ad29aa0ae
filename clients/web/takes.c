#include "clients/web/takes.h"
#include "clients/knead/record.h"
#include "server/clock.h"
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#define HEED_MS 50 // interval at which the waiting recording thread checks whether it must end

void kn_takes_path(const kn_takes *t, int number, const char *kind, char path[128])
{
    snprintf(path, 128, "%s/%d.%s", t->folder, number, kind);
}

// Remove a recording with its files.
static void drop(kn_takes *t, kn_take *one)
{
    static const char *const kinds[] = {"lcmlog", "csv", "path"};
    char path[128];
    for (int i = 0; one->number && i < 3; i++) kn_takes_path(t, one->number, kinds[i], path), unlink(path);
    one->number = 0;
}

// ---- recording thread

// Write the poses of a log as a path. Times start at 0, on the clock of the poses. Poses whose time does not increase
// are left out.
static bool write_path(const char *log_path, const char *probe, const char *path)
{
    char channel[80];
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", probe);
    lcm_eventlog_t *log = lcm_eventlog_create(log_path, "r");
    FILE *out = log ? fopen(path, "w") : NULL;
    int64_t first_ns = -1, last_ns = -1;
    if (out) fprintf(out, "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n");
    for (lcm_eventlog_event_t *e; out && (e = lcm_eventlog_read_next_event(log)); lcm_eventlog_free_event(e)) {
        knead_probe_pose_t p;
        // Skip messages of other channels, malformed poses and poses out of order.
        if (strncmp(e->channel, channel, (size_t)e->channellen) != 0 || strlen(channel) != (size_t)e->channellen ||
            knead_probe_pose_t_decode(e->data, 0, e->datalen, &p) < 0 || p.sent_ns <= last_ns)
            continue;
        if (first_ns < 0) first_ns = p.sent_ns;
        last_ns = p.sent_ns;
        fprintf(out, "%.6f,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", 1e-9 * (double)(p.sent_ns - first_ns),
                p.position_m[0], p.position_m[1], p.position_m[2], p.orientation_wxyz[0], p.orientation_wxyz[1],
                p.orientation_wxyz[2], p.orientation_wxyz[3]);
    }
    if (log) lcm_eventlog_destroy(log);
    const bool whole = out && !ferror(out);
    return out && fclose(out) == 0 && whole;
}

// Wait for a scene, which every log must begin with. Return false if none came, or if the recording was ended.
static bool hear_scene(kn_takes *t, kn_take *one, kn_record *r)
{
    const int64_t end_ns = kn_now_ns() + KN_TAKE_SCENE_MS * 1000000ll;
    while (!kn_record_scene(r, HEED_MS) && !atomic_load(&t->end) && kn_now_ns() < end_ns)
        ;
    if (kn_record_scene(r, 0)) return !atomic_load(&t->end);
    snprintf(one->words, sizeof one->words, "No scene was heard for %d s.", KN_TAKE_SCENE_MS / 1000);
    return false;
}

// Record until the end is requested or a limit is reached. The atomic fields report progress to the main thread.
static bool record(kn_takes *t, kn_take *one, const char *path)
{
    kn_record *r = kn_record_open(t->url, one->words, sizeof one->words);
    bool ok = r && hear_scene(t, one, r);
    if (ok) r->log_only = true;
    ok = ok && kn_record_start(r, t->probe, path, one->words, sizeof one->words);
    if (ok) {
        const int64_t begin_ns = kn_now_ns();
        atomic_store(&one->state, KN_TAKE_RUNS);
        while (!atomic_load(&t->end) && atomic_load(&one->ms) < 1000 * KN_TAKE_SECONDS &&
               atomic_load(&one->bytes) < KN_TAKE_BYTES) {
            usleep(20000);
            atomic_store(&one->ms, (int)((kn_now_ns() - begin_ns) / 1000000));
            atomic_store(&one->bytes, atomic_load(&r->logged));
            atomic_store(&one->felt, atomic_load(&r->felt));
        }
        ok = kn_record_stop(r, one->words, sizeof one->words);
    }
    kn_record_destroy(r);
    return ok;
}

// Run the recording thread: record, then write the path for playing. Store the state last, because other threads may
// read the other fields once the state is set.
static void *run(void *self)
{
    kn_takes *t = self;
    kn_take *one = t->now;
    char log[128], path[128];
    kn_takes_path(t, one->number, "lcmlog", log);
    kn_takes_path(t, one->number, "path", path);
    bool ok = record(t, one, log);
    // A recording that was ended before it began leaves no files.
    if (atomic_load(&t->end) && atomic_load(&one->ms) == 0) {
        atomic_store(&one->state, KN_TAKE_EMPTY);
        return NULL;
    }
    if (ok && !write_path(log, t->probe, path)) {
        snprintf(one->words, sizeof one->words, "Its poses cannot be written: is the folder for recordings full?");
        ok = false;
    }
    atomic_store(&one->state, ok ? KN_TAKE_WHOLE : KN_TAKE_FAILED);
    return NULL;
}

static bool ended(const kn_take *one)
{
    int state = atomic_load(&one->state);
    return state >= KN_TAKE_WHOLE;
}

bool kn_takes_busy(const kn_takes *t) { return t->now && !ended(t->now); }

bool kn_takes_begin(kn_takes *t, const char *probe, char *error, size_t error_size)
{
    kn_take *one = &t->take[t->count % KN_TAKES];
    kn_takes_tidy(t);
    const char *why = kn_takes_busy(t)                             ? "Another recording is running."
                      : !*t->folder                                ? "There is no folder for recordings."
                      : t->child_pid && t->child_of == one->number ? "The oldest recording is in use."
                                                                   : NULL;
    if (why) {
        snprintf(error, error_size, "%s", why);
        return false;
    }
    // The thread of the last recording has ended, so this join does not wait.
    if (t->now) pthread_join(t->thread, NULL);
    drop(t, one);
    snprintf(t->probe, sizeof t->probe, "%s", probe);
    atomic_store(&t->end, false);
    memset(one, 0, sizeof *one);
    one->number = ++t->count;
    t->now = one;
    if (pthread_create(&t->thread, NULL, run, t) == 0) return true;
    t->now = NULL;
    one->number = 0;
    snprintf(error, error_size, "Cannot start a thread for the recording.");
    return false;
}

bool kn_takes_end(kn_takes *t, int number)
{
    const bool runs = kn_takes_busy(t) && t->now->number == number, child = t->child_pid && t->child_of == number;
    if (runs) atomic_store(&t->end, true);
    if (child) kill(t->child_pid, SIGINT), t->child_stopped = true;
    return runs || child;
}

bool kn_takes_tidy(kn_takes *t)
{
    if (!t->now || atomic_load(&t->now->state) != KN_TAKE_EMPTY) return false;
    pthread_join(t->thread, NULL);
    drop(t, t->now);
    t->now = NULL;
    return true;
}

kn_take *kn_takes_find(kn_takes *t, int number)
{
    for (int i = 0; i < KN_TAKES; i++)
        if (t->take[i].number == number && atomic_load(&t->take[i].state) == KN_TAKE_WHOLE) return &t->take[i];
    return NULL;
}

// ---- child processes

// Get the path of the file that collects the output of a child process.
static void told_path(const kn_takes *t, char path[128]) { snprintf(path, 128, "%s/told", t->folder); }

// Get the last line of the child's output. If a progress bar has written carriage returns into this line, get the text
// after the last carriage return.
static void last_line(const kn_takes *t, char *words, size_t size)
{
    char path[128], line[400];
    told_path(t, path);
    FILE *in = fopen(path, "r");
    while (in && fgets(line, sizeof line, in)) {
        line[strcspn(line, "\n")] = 0;
        const char *begin = strrchr(line, '\r') ? strrchr(line, '\r') + 1 : line;
        if (*begin) snprintf(words, size, "%.199s", begin);
    }
    if (in) fclose(in);
    unlink(path);
}

// Handle the end of a child: read its outcome, keep it with a verified recording, report it.
static void on_child(struct ev_loop *ev, ev_child *w, int events)
{
    (void)events;
    kn_takes *t = w->data;
    kn_take *one = kn_takes_find(t, t->child_of);
    const bool stopped = t->child_stopped;
    const bool ok = !stopped && WIFEXITED(w->rstatus) && WEXITSTATUS(w->rstatus) == 0;
    char words[200] = "It ended without a message.";
    ev_child_stop(ev, w);
    t->child_pid = 0;
    last_line(t, words, sizeof words);
    if (t->child_plays && ok) snprintf(words, sizeof words, "Played to its end.");
    if (stopped) snprintf(words, sizeof words, "Stopped.");
    if (one && !t->child_plays) {
        char path[128];
        kn_takes_path(t, one->number, "csv", path);
        if (stopped) unlink(path); // delete the CSV file, which is incomplete
        one->csv = access(path, R_OK) == 0;
        snprintf(one->words, sizeof one->words, "%s", words);
    }
    t->done(t->arg, t->child_of, ok, words);
}

// Start knead itself as a child process, with its output in a file.
static bool start(kn_takes *t, int number, bool plays, char *const argv[], char *error, size_t error_size)
{
    char path[128];
    told_path(t, path);
    pid_t pid = fork();
    // In the child, use only calls that are safe after a fork in a program with threads.
    if (pid == 0) {
        int told = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600), nothing = open("/dev/null", O_RDONLY);
        // Run a verification at low priority (nice 15). Playing keeps its priority, because it must send poses at 1
        // kHz.
        if (!plays) setpriority(PRIO_PROCESS, 0, 15);
        if (told < 0 || nothing < 0 || dup2(nothing, 0) < 0 || dup2(told, 1) < 0 || dup2(told, 2) < 0) _exit(3);
        close_range(3, ~0u, 0);
        execv("/proc/self/exe", argv);
        _exit(3);
    }
    if (pid < 0) {
        snprintf(error, error_size, "Cannot start a process for it.");
        return false;
    }
    t->child_pid = pid;
    t->child_of = number;
    t->child_plays = plays;
    t->child_stopped = false;
    ev_child_init(&t->child, on_child, pid, 0);
    t->child.data = t;
    ev_child_start(t->ev, &t->child);
    return true;
}

// Check that no child process runs and that the recording exists.
static bool may_start(kn_takes *t, int number, char *error, size_t error_size)
{
    const char *why = t->child_pid                ? "Another recording is being replayed."
                      : !kn_takes_find(t, number) ? "There is no such recording."
                                                  : NULL;
    if (why) snprintf(error, error_size, "%s", why);
    return !why;
}

bool kn_takes_verify(kn_takes *t, int number, const char *snapshots, char *error, size_t error_size)
{
    char log[128], csv[128];
    if (!may_start(t, number, error, error_size)) return false;
    kn_takes_path(t, number, "lcmlog", log);
    kn_takes_path(t, number, "csv", csv);
    const char *argv[10] = {"knead", "replay", log, "--verify", "--csv", csv};
    if (snapshots) argv[6] = "--snapshot", argv[7] = snapshots;
    return start(t, number, false, (char *const *)(uintptr_t)argv, error, error_size);
}

bool kn_takes_play(kn_takes *t, int number, const char *probe, char *error, size_t error_size)
{
    char path[128];
    if (!may_start(t, number, error, error_size)) return false;
    kn_takes_path(t, number, "path", path);
    const char *argv[12] = {"knead", "probe", "--path", path, "--probe", probe, "--tries", "1", "--quiet"};
    if (t->url) argv[9] = "--lcm-url", argv[10] = t->url;
    return start(t, number, true, (char *const *)(uintptr_t)argv, error, error_size);
}

void kn_takes_close(kn_takes *t)
{
    char path[128];
    // Stop the child and the recording thread before their files are removed.
    atomic_store(&t->end, true);
    if (t->child_pid) {
        ev_child_stop(t->ev, &t->child);
        kill(t->child_pid, SIGTERM);
        waitpid(t->child_pid, NULL, 0);
    }
    if (t->now) pthread_join(t->thread, NULL);
    t->now = NULL;
    for (int i = 0; i < KN_TAKES; i++) drop(t, &t->take[i]);
    told_path(t, path);
    unlink(path);
}
