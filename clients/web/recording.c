#include "clients/web/recording.h"
#include "clients/hand/session_record.h"
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

#define SECONDS_MAX 120      // longest duration of a recording, s
#define BYTES_MAX (96 << 20) // largest size of a recording, bytes of messages
#define SCENE_MS 8000        // longest wait for the scene message that begins a recording
#define LEAVING_MS 300 // time in which kneadd ends the session of the page's hand, before another hand takes the tool
#define HEED_MS 50     // interval at which the waiting recording thread checks whether it must end

void kn_recordings_path(const kn_recordings *t, int number, const char *kind, char path[128])
{
    snprintf(path, 128, "%s/%d.%s", t->folder, number, kind);
}

// Remove a recording with its files.
static void drop(kn_recordings *t, kn_recording *one)
{
    static const char *const kinds[] = {"lcmlog", "csv", "path"};
    char path[128];
    for (int i = 0; one->number && i < 3; i++) kn_recordings_path(t, one->number, kinds[i], path), unlink(path);
    one->number = 0;
}

// ---- recording thread

// Write the poses of a log as a table for `knead probe --path`. The times come from the poses and start at 0. Leave out
// poses whose time does not increase.
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
static bool hear_scene(kn_recordings *t, kn_recording *one, kn_session_record *r)
{
    const int64_t end_ns = kn_now_ns() + SCENE_MS * 1000000ll;
    while (!kn_session_record_scene(r, HEED_MS) && !atomic_load(&t->end) && kn_now_ns() < end_ns)
        ;
    if (kn_session_record_scene(r, 0)) return !atomic_load(&t->end);
    snprintf(one->words, sizeof one->words, "kneadd sent no scene for %d s.", SCENE_MS / 1000);
    return false;
}

// Record until the end is requested or a limit is reached. The atomic fields report progress to the main thread.
static bool record(kn_recordings *t, kn_recording *one, const char *path)
{
    kn_session_record *r = kn_session_record_open(t->url, one->words, sizeof one->words);
    bool ok = r && hear_scene(t, one, r);
    if (ok) r->log_only = true, r->control = t->client->path;
    ok = ok && kn_session_record_start(r, t->probe, path, one->words, sizeof one->words);
    if (ok && *r->no_object)
        snprintf(one->words, sizeof one->words, "The recording does not hold the object: %.150s", r->no_object);
    if (ok) {
        const int64_t begin_ns = kn_now_ns();
        atomic_store(&one->state, KN_RECORDING_RUNS);
        while (!atomic_load(&t->end) && atomic_load(&one->ms) < 1000 * SECONDS_MAX &&
               atomic_load(&one->bytes) < BYTES_MAX) {
            usleep(20000);
            atomic_store(&one->ms, (int)((kn_now_ns() - begin_ns) / 1000000));
            atomic_store(&one->bytes, atomic_load(&r->logged));
        }
        ok = kn_session_record_stop(r, one->words, sizeof one->words);
    }
    kn_session_record_destroy(r);
    return ok;
}

// Run the recording thread: record, then write the path for playing. Store the state last, because other threads may
// read the other fields once the state is set.
static void *run(void *self)
{
    kn_recordings *t = self;
    kn_recording *one = t->now;
    char log[128], path[128];
    kn_recordings_path(t, one->number, "lcmlog", log);
    kn_recordings_path(t, one->number, "path", path);
    bool ok = record(t, one, log);
    // A recording that was ended before it began leaves no files.
    if (atomic_load(&t->end) && atomic_load(&one->ms) == 0) {
        atomic_store(&one->state, KN_RECORDING_EMPTY);
        return NULL;
    }
    if (ok && !write_path(log, t->probe, path)) {
        snprintf(one->words, sizeof one->words, "The poses of the recording cannot be written: is the folder full?");
        ok = false;
    }
    atomic_store(&one->state, ok ? KN_RECORDING_WHOLE : KN_RECORDING_FAILED);
    return NULL;
}

int kn_recordings_running(const kn_recordings *t)
{
    return t->now && atomic_load(&t->now->state) < KN_RECORDING_WHOLE ? t->now->number : 0;
}

// Remove a recording in state EMPTY; return true if one was removed.
static bool tidy(kn_recordings *t)
{
    if (!t->now || atomic_load(&t->now->state) != KN_RECORDING_EMPTY) return false;
    pthread_join(t->thread, NULL);
    drop(t, t->now);
    t->now = NULL;
    return true;
}

// Begin a recording of the tool's messages. Return NULL, or the reason why this is impossible.
static const char *begin(kn_recordings *t)
{
    kn_recording *one = &t->recording[t->count % KN_RECORDINGS];
    if (!t->tool->hand[0].def || t->tool->lent) return "The pointer moves no tool now.";
    tidy(t);
    if (kn_recordings_running(t)) return "Another recording is running.";
    if (!*t->folder) return "There is no folder for recordings: see the messages of knead web.";
    if (t->child_pid && t->child_of == one->number) return "The oldest recording is in use.";
    // The thread of the last recording has ended, so this join does not wait.
    if (t->now) pthread_join(t->thread, NULL);
    drop(t, one);
    snprintf(t->probe, sizeof t->probe, "%s", t->tool->hand[0].def->name);
    atomic_store(&t->end, false);
    memset(one, 0, sizeof *one);
    one->number = ++t->count;
    t->now = one;
    if (pthread_create(&t->thread, NULL, run, t) == 0) return NULL;
    t->now = NULL;
    one->number = 0;
    return "Cannot start a thread for the recording.";
}

kn_recording *kn_recordings_find(kn_recordings *t, int number)
{
    for (int i = 0; i < KN_RECORDINGS; i++)
        if (t->recording[i].number == number && atomic_load(&t->recording[i].state) == KN_RECORDING_WHOLE)
            return &t->recording[i];
    return NULL;
}

// ---- child processes

// Get the path of the file that collects the output of a child process.
static void told_path(const kn_recordings *t, char path[128]) { snprintf(path, 128, "%s/told", t->folder); }

// Get the last line of the child's output. If a progress bar has written carriage returns into this line, get the text
// after the last carriage return.
static void last_line(const kn_recordings *t, char *words, size_t size)
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

// Answer the page that requested the verification or the playing, once.
static void tell_end(kn_recordings *t, bool ok, const char *words)
{
    kn_gateway_answer(t->gateway, t->page, t->id, ok, "%s", words);
    t->page = -1;
}

// Handle the end of a child: read its outcome, keep it with a verified recording, report it.
static void on_child(struct ev_loop *ev, ev_child *w, int events)
{
    (void)events;
    kn_recordings *t = w->data;
    kn_recording *one = kn_recordings_find(t, t->child_of);
    const bool stopped = t->child_stopped;
    const bool ok = !stopped && WIFEXITED(w->rstatus) && WEXITSTATUS(w->rstatus) == 0;
    char words[200] = "The program ended without a message.";
    ev_child_stop(ev, w);
    t->child_pid = 0;
    last_line(t, words, sizeof words);
    if (t->child_plays && ok) snprintf(words, sizeof words, "Played to its end.");
    if (stopped) snprintf(words, sizeof words, "Stopped.");
    if (one && !t->child_plays) {
        char path[128];
        kn_recordings_path(t, one->number, "csv", path);
        if (stopped) unlink(path); // delete the CSV file, which is incomplete
        one->csv = access(path, R_OK) == 0;
        snprintf(one->words, sizeof one->words, "%s", words);
    }
    if (t->tool->lent) kn_page_tool_take_back(t->tool);
    tell_end(t, ok, words);
    t->changed(t->arg);
}

// Start knead itself as a child process, with its output in a file. Return NULL, or the reason why this is impossible.
static const char *start(kn_recordings *t, int number, bool plays, char *const argv[])
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
    if (pid < 0) return "Cannot start a process for the recording.";
    t->child_pid = pid;
    t->child_of = number;
    t->child_plays = plays;
    t->child_stopped = false;
    ev_child_init(&t->child, on_child, pid, 0);
    t->child.data = t;
    ev_child_start(t->ev, &t->child);
    return NULL;
}

// Check that no child process runs and that the recording exists. Return NULL, or what is wrong.
static const char *obstacle(kn_recordings *t, int number)
{
    return t->child_pid                     ? "Another recording is being replayed."
           : !kn_recordings_find(t, number) ? "There is no such recording."
                                            : NULL;
}

// Verify a recording in a child process, and write its forces as CSV. kneadd's snapshots are needed if one was restored
// while it was recorded.
static const char *verify(kn_recordings *t, int number)
{
    char log[128], csv[128];
    const char *why = t->tool->lent ? "Another recording is being replayed." : obstacle(t, number);
    if (why) return why;
    kn_recordings_path(t, number, "lcmlog", log);
    kn_recordings_path(t, number, "csv", csv);
    const char *argv[10] = {"knead", "replay", log, "--verify", "--csv", csv};
    const char *snapshots = kn_control_client_snapshots(t->client);
    if (snapshots) argv[6] = "--snapshot", argv[7] = snapshots;
    return start(t, number, false, (char *const *)(uintptr_t)argv);
}

// Play the poses of a recording in a child process.
static const char *play(kn_recordings *t, int number)
{
    char path[128];
    const char *why = t->tool->hand[0].def ? obstacle(t, number) : "There is no such tool.";
    if (why) return why;
    kn_recordings_path(t, number, "path", path);
    const char *argv[12] = {"knead",   "probe", "--path", path, "--probe", t->tool->hand[0].def->name,
                            "--tries", "1",     "--quiet"};
    if (t->url) argv[9] = "--lcm-url", argv[10] = t->url;
    return start(t, number, true, (char *const *)(uintptr_t)argv);
}

// ---- requests

// Play a recording. First stop the page's own hand, so that kneadd ends its session and the child can take the tool.
static const char *lend(kn_recordings *t, int number)
{
    const char *why = !kn_recordings_find(t, number)  ? "There is no such recording."
                      : t->tool->lent || t->child_pid ? "Another recording is being replayed."
                      : !t->tool->hand[0].moving      ? "The pointer moves no tool now."
                      : t->tool->hand[1].wish.held    ? "Two fingers grip the object."
                                                      : NULL;
    if (why) return why;
    kn_page_tool_lend(t->tool, number);
    t->lent_ms = kn_live_server_now_ms();
    return NULL;
}

// Stop a recording, its verification or its playing. Return false if there is nothing to stop.
static bool stop(kn_recordings *t, int number)
{
    const bool runs = kn_recordings_running(t) == number, child = t->child_pid && t->child_of == number;
    // True: the recording is to be played, but the child process that plays it has not started yet.
    const bool waits = t->tool->lent == number && t->lent_ms;
    if (runs) atomic_store(&t->end, true);
    if (child) kill(t->child_pid, SIGINT), t->child_stopped = true;
    if (waits) {
        kn_page_tool_take_back(t->tool);
        tell_end(t, false, "Stopped.");
    }
    return runs || child || waits;
}

void kn_recordings_request(kn_recordings *t, int page, const kn_page_request *r)
{
    const int number = (int)r->value;
    const char *why;
    switch (r->verb) {
    case KN_VERB_RECORD:
        why = begin(t);
        kn_gateway_answer(t->gateway, page, r->id, !why, "%s", why ? why : "The recording begins within a second.");
        return;
    case KN_VERB_STOP:
        why = stop(t, number) ? NULL : "This recording is not running.";
        kn_gateway_answer(t->gateway, page, r->id, !why, "%s", why ? why : "Stopped.");
        return;
    default: // the answer comes when the child process ends
        why = r->verb == KN_VERB_PLAY ? lend(t, number) : verify(t, number);
        if (why) kn_gateway_answer(t->gateway, page, r->id, false, "%s", why);
        else t->page = page, t->id = r->id;
    }
}

bool kn_recordings_turn(kn_recordings *t)
{
    const bool removed = tidy(t);
    const int64_t now_ms = kn_live_server_now_ms();
    // Start the child process that plays the recording, once kneadd has ended the session of the page's hand.
    if (!t->tool->lent || !t->lent_ms || now_ms - t->lent_ms < LEAVING_MS) return removed;
    t->lent_ms = 0;
    const char *why = play(t, t->tool->lent);
    if (!why) return removed;
    kn_page_tool_take_back(t->tool);
    tell_end(t, false, why);
    return removed;
}

void kn_recordings_gone(kn_recordings *t, int page)
{
    if (t->page == page) t->page = -1;
}

void kn_recordings_close(kn_recordings *t)
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
    for (int i = 0; i < KN_RECORDINGS; i++) drop(t, &t->recording[i]);
    told_path(t, path);
    unlink(path);
}
