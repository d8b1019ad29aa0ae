#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/hand/bus_client.h"
#include "clients/hand/virtual_hand.h"
#include "clients/knead/latency.h"
#include "proto/knead_contact_force_t.h"
#include "server/clock.h"
#include "server/mailbox.h"
#include "server/wire.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

// The three real-time threads of knead latency. The hand sends poses, the ear receives all answers, and the echo
// answers each of its poses at once with a force.

// Real-time priority of the hand: as in knead probe, below that of kneadd's threads.
static const int hand_priority = 60;
// Real-time priority of the echo. It equals the priority of kneadd's main thread, because the echo does the work of
// that thread.
static const int echo_priority = 70;
static const int64_t echo_at_ns = 500000;      // delay from the pose to kneadd until the pose to the echo, ns
static const int64_t straggler_ns = 100000000; // wait for late answers at the end of the measurement, ns
static const char echo_out[] = "KNEAD_LATENCY_POSE", echo_back[] = "KNEAD_LATENCY_FORCE";
// HANDS_MAX: largest number of hands that are started one after the other in one measurement. MESSAGE_MAX: largest size
// of a message, bytes.
enum { HANDS_MAX = 100, MESSAGE_MAX = 512 };

typedef struct run {
    kn_latency *l;
    const volatile int *stop;
    // Connections to the buses. ear_bus: to the bus of kneadd; ear_echo: to the bus of the echo. The ear (the thread
    // that receives all answers) and the hand use both. echo_bus: the echo's own connection to the bus of the echo.
    kn_bus_client *ear_bus, *ear_echo, *echo_bus;
    // Answers in the order of arrival. The receiving thread (ear) stores session, seq, back_ns, execution_ns and
    // contacts.
    kn_flights answers[KN_LATENCY_PATHS];
    kn_mailbox forces; // mailbox that passes forces from the receiving thread (ear) to the hand
    kn_hand_force force_slots[3];
    kn_hand hand;
    int64_t session; // session number of the next hand
    int hands;
    uint32_t echo_seq;
    atomic_bool done;
    atomic_int worked; // number of milliseconds in which the hand played the piece `work` of its path
} run;

static bool reserve(kn_flights *f, int capacity)
{
    f->list = malloc((size_t)capacity * sizeof *f->list);
    // Write to all memory pages now, so that no page fault occurs during the measurement.
    if (f->list) memset(f->list, 0xff, (size_t)capacity * sizeof *f->list);
    f->capacity = f->list ? capacity : 0;
    return f->list != NULL;
}

// Append a flight (a pose or an answer) to the list. If the list is full, drop the flight.
static void note(kn_flights *f, const kn_flight *flight)
{
    if (f->count < f->capacity) f->list[f->count++] = *flight;
}

// --- echo: answers each pose with a force at once

static void on_echo(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    (void)channel;
    knead_probe_pose_t pose;
    if (knead_probe_pose_t_decode(buf->data, 0, (int)buf->data_size, &pose) < 0) return;
    knead_contact_force_t force = {.session = pose.session, .seq = pose.seq, .sent_ns = pose.sent_ns};
    uint8_t out[MESSAGE_MAX];
    int size = knead_contact_force_t_encode(out, 0, sizeof out, &force);
    if (size > 0) kn_bus_client_send(((run *)self)->echo_bus, echo_back, out, size);
}

static void *echo_main(void *self)
{
    run *r = self;
    kn_bus_client_priority(echo_priority);
    while (!atomic_load(&r->done)) kn_bus_client_handle(r->echo_bus, 100);
    return NULL;
}

// --- ear: receives all answers in one thread

// Record an answer of kneadd or of the echo. An answer of kneadd is also passed to the hand.
static void hear_force(run *r, int path, const void *bytes, int size)
{
    knead_contact_force_t f;
    if (knead_contact_force_t_decode(bytes, 0, size, &f) < 0) return;
    int64_t now_ns = kn_now_ns();
    kn_flights *heard = &r->answers[path];
    const kn_flight *last = heard->count ? &heard->list[heard->count - 1] : NULL;
    if (!last || last->session != f.session || last->seq != f.seq) // record only the first answer to a pose
        note(heard, &(kn_flight){.session = f.session,
                                 .seq = f.seq,
                                 .back_ns = now_ns,
                                 .contacts = f.contacts,
                                 .execution_ns = f.execution_ns});
    if (path != KN_LATENCY_POSE) return;
    kn_hand_force *force = kn_mailbox_back(&r->forces);
    *force = (kn_hand_force){
        .session = f.session, .seq = f.seq, .tick = f.tick, .flags = f.flags, .fault = f.fault, .contacts = f.contacts};
    memcpy(force->force_n, f.force_n, sizeof force->force_n);
    kn_mailbox_post(&r->forces);
}

static void on_force(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    hear_force(self, strcmp(channel, echo_back) ? KN_LATENCY_POSE : KN_LATENCY_ECHO, buf->data, (int)buf->data_size);
}

static void *ear_main(void *self)
{
    run *r = self;
    kn_bus_client_priority(hand_priority);
    // Poll both buses in one thread, so that the receiver delays the answers of kneadd and of the echo alike.
    struct pollfd in[] = {{kn_bus_client_fd(r->ear_bus), POLLIN, 0}, {kn_bus_client_fd(r->ear_echo), POLLIN, 0}};
    while (!atomic_load(&r->done)) {
        if (poll(in, 2, 100) <= 0) continue;
        if (in[0].revents) kn_bus_client_handle(r->ear_bus, 0);
        if (in[1].revents) kn_bus_client_handle(r->ear_echo, 0);
    }
    return NULL;
}

// --- hand

static void send_pose(run *r, int path, kn_pose *pose, bool counts)
{
    static char channel[64]; // name of the pose channel; static, because only one hand exists at a time
    uint8_t bytes[MESSAGE_MAX];
    knead_probe_pose_t message;
    if (path == KN_LATENCY_POSE) snprintf(channel, sizeof channel, "KNEAD_POSE_%s", r->l->probe);
    // Set the time stamp of the pose as late as possible, because the latency is measured from this time.
    pose->utime = kn_stamp_us();
    pose->sent_ns = kn_now_ns();
    note(&r->l->flights[path],
         &(kn_flight){.session = pose->session, .seq = pose->seq, .sent_ns = pose->sent_ns, .counts = counts});
    kn_wire_pose(&message, pose);
    int size = knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &message);
    if (path == KN_LATENCY_POSE) kn_bus_client_send(r->ear_bus, channel, bytes, size);
    else kn_bus_client_send(r->ear_echo, echo_out, bytes, size);
}

// Start a new hand with new session numbers.
static void take_hand(run *r)
{
    double top_m = r->l->path->piece[0].from.position_m[2]; // height z at which the path begins, above the object, m
    kn_hand_init(&r->hand, &(kn_hand_def){.path = r->l->path, .clear_z_m = top_m, .session = r->session});
    r->session += KN_HAND_TRIES;
    r->hands++;
}

// Play one millisecond of the hand. Return false if the hand gave up for good.
static bool move(run *r, const kn_wake *wake, bool *at_work)
{
    bool fresh;
    const kn_hand_force *force = kn_mailbox_latest(&r->forces, &fresh);
    kn_hand_out out = kn_hand_tick(&r->hand, fresh ? force : NULL, 1 + wake->missed);
    // If the hand gave up because the machine stalled too often, start a new hand after the silence that ends a
    // session.
    if (out.end) {
        if (r->hand.trouble != KN_HAND_SPOILT || r->hands == HANDS_MAX) return false;
        kn_clock_sleep(kn_now_ns() + 1200000000);
        r->l->interrupted += r->hand.trips;
        take_hand(r);
        return true;
    }
    // Poses count only while the hand plays the piece `work` of the path.
    *at_work = out.send && r->hand.mode == KN_HAND_PLAY && !strcmp(r->hand.piece, r->l->work);
    if (!out.send) return true;
    kn_pose pose = {.session = out.session, .seq = out.seq};
    memcpy(pose.position_m, out.point.position_m, sizeof pose.position_m);
    memcpy(pose.velocity_m_s, out.point.velocity_m_s, sizeof pose.velocity_m_s);
    memcpy(pose.orientation_wxyz, out.point.orientation_wxyz, sizeof pose.orientation_wxyz);
    send_pose(r, KN_LATENCY_POSE, &pose, *at_work);
    return true;
}

static void *hand_main(void *self)
{
    run *r = self;
    kn_latency *l = r->l;
    l->real_time = kn_bus_client_priority(hand_priority) == 0;
    kn_clock clock;
    kn_clock_start(&clock, kn_now_ns());
    take_hand(r);
    // `wanted` is the time to measure, ms. `limit` is the duration after which the measurement ends on a machine that
    // stalls most of the time, ms.
    int wanted = 1000 * l->seconds, limit = 3 * wanted + 60000;
    for (int worked = 0; worked < wanted && clock.tick < limit && !*r->stop;) {
        bool at_work = false;
        // Let the hand's clock run slower than the server's clock by drift_ppm.
        clock.start_ns += (int64_t)(l->drift_ppm * 1e-6 * KN_PERIOD_NS);
        kn_wake wake = kn_clock_wait(&clock);
        if (!move(r, &wake, &at_work)) break;
        if (!at_work) continue;
        atomic_store_explicit(&r->worked, ++worked, memory_order_relaxed);
        l->missed_ms += wake.missed;
        // Send the pose to the echo half a millisecond after the pose to kneadd.
        kn_clock_sleep(clock.start_ns + clock.tick * KN_PERIOD_NS + echo_at_ns);
        kn_pose pose = {.session = 1, .seq = ++r->echo_seq, .orientation_wxyz = {1}};
        send_pose(r, KN_LATENCY_ECHO, &pose, true);
    }
    l->interrupted += r->hand.trips;
    return NULL;
}

// --- all threads together

// Allocate the lists, join the buses and subscribe to the channels.
static bool open_all(run *r)
{
    kn_latency *l = r->l;
    char *error = l->error;
    size_t size = sizeof l->error;
    int capacity = 3000 * l->seconds + 100000;
    for (int p = 0; p < KN_LATENCY_PATHS; p++)
        if (!reserve(&l->flights[p], capacity) || !reserve(&r->answers[p], capacity))
            return snprintf(error, size, "out of memory"), false;
    const char *echo = l->echo_url;
    if (!(r->ear_bus = kn_bus_client_open(l->url, KN_FORCE_URL, error, size))) return false;
    if (!kn_bus_client_speaks(error, size)) return false;
    kn_bus_client **echoes[] = {&r->ear_echo, &r->echo_bus};
    // The messages of the echo are not signed, because no kneadd receives them.
    for (int i = 0; i < 2; i++) {
        if (!(*echoes[i] = kn_bus_client_open(echo, echo, error, size))) return false;
        kn_bus_client_trust(*echoes[i]);
    }
    char channel[64];
    snprintf(channel, sizeof channel, "KNEAD_FORCE_%s", l->probe);
    kn_bus_client_hear(r->ear_bus, channel, on_force, r);
    kn_bus_client_hear(r->ear_echo, echo_back, on_force, r);
    kn_bus_client_hear(r->echo_bus, echo_out, on_echo, r);
    return true;
}

static void close_all(run *r)
{
    kn_bus_client *bus[] = {r->ear_bus, r->ear_echo, r->echo_bus};
    for (size_t i = 0; i < sizeof bus / sizeof *bus; i++) kn_bus_client_close(bus[i]);
    for (int p = 0; p < KN_LATENCY_PATHS; p++) free(r->answers[p].list);
}

// Find the pose that an answer or a row of a trace belongs to. Search the list from *at on, because answers and rows
// come in the order in which the poses were sent. Return NULL if the list does not contain the pose.
static kn_flight *find_pose(kn_flights *sent, const kn_flight *answer, int *at)
{
    for (int i = *at; i < sent->count; i++)
        if (sent->list[i].session == answer->session && sent->list[i].seq == answer->seq) return &sent->list[*at = i];
    return NULL;
}

// Copy the times of the answers into the list of the poses that they answer. Both lists are in the order of sending.
static void join_answers(kn_flights *sent, const kn_flights *heard)
{
    for (int i = 0, at = 0; i < heard->count; i++) {
        const kn_flight *a = &heard->list[i];
        kn_flight *pose = find_pose(sent, a, &at);
        if (!pose) continue; // the message is not an answer to a pose of this process
        pose->back_ns = a->back_ns;
        pose->execution_ns = a->execution_ns;
        pose->contacts = a->contacts;
    }
    const kn_flight *later = NULL; // the first later pose that has an answer
    // Going backwards, find for each pose the first answer to this pose or to a later pose of its session.
    for (int i = sent->count - 1; i >= 0; i--) {
        kn_flight *pose = &sent->list[i];
        if (pose->back_ns) later = pose;
        if (later && later->session == pose->session) pose->newer_ns = later->back_ns;
    }
}

// Wait for the hand's thread. The progress bar is drawn only five times a second, and only on a terminal, because
// drawing could delay the threads that are measured.
static void wait_for_hand(run *r, pthread_t hand)
{
    kn_progress bar = kn_progress_open("latency", 1000 * r->l->seconds);
    while (bar.terminal && pthread_tryjoin_np(hand, NULL) != 0) {
        kn_progress_step(&bar, atomic_load_explicit(&r->worked, memory_order_relaxed));
        kn_clock_sleep(kn_now_ns() + 200000000);
    }
    if (!bar.terminal) pthread_join(hand, NULL);
    kn_progress_close(&bar);
}

// Run the three threads until the hand has finished. Return false if a thread cannot be started.
static bool run_threads(run *r)
{
    pthread_t hand, ear, echo;
    if (pthread_create(&ear, NULL, ear_main, r) != 0) return false;
    bool echoes = pthread_create(&echo, NULL, echo_main, r) == 0;
    bool moved = echoes && pthread_create(&hand, NULL, hand_main, r) == 0;
    if (moved) wait_for_hand(r, hand);
    // Wait for late answers, so that they are included in the measurement.
    if (moved) kn_clock_sleep(kn_now_ns() + straggler_ns);
    atomic_store(&r->done, true);
    if (echoes) pthread_join(echo, NULL);
    pthread_join(ear, NULL);
    return moved;
}

bool kn_latency_run(kn_latency *l, const volatile int *stop)
{
    static run r;
    r = (run){.l = l, .stop = stop};
    kn_mailbox_init(&r.forces, r.force_slots, sizeof *r.force_slots);
    r.session = kn_hand_session();
    bool ok = open_all(&r) && run_threads(&r);
    if (!ok && !*l->error) snprintf(l->error, sizeof l->error, "LCM or the machine refuses threads for the echo");
    // If the hand gave up, report the reason.
    if (ok && r.hand.trouble != KN_HAND_NO_TROUBLE) {
        snprintf(l->error, sizeof l->error, "%s",
                 r.hand.trouble == KN_HAND_NO_ANSWER
                     ? kn_bus_client_why("no force for 3 s: is kneadd running on this bus?")
                 : r.hand.trouble == KN_HAND_NOT_ENGAGED
                     ? "kneadd answers, but does not let the tool in: does another hand hold it?"
                     : "the machine stood still too often, so the hand gave up");
        ok = false;
    }
    for (int p = 0; p < KN_LATENCY_PATHS; p++) join_answers(&l->flights[p], &r.answers[p]);
    close_all(&r);
    return ok;
}

void kn_latency_free(kn_latency *l)
{
    for (int p = 0; p < KN_LATENCY_PATHS; p++) free(l->flights[p].list);
}

// The kneadd that knead latency starts for its measurement.

// Ports of the buses. ports_from: the first port. ports_each: number of ports for one run of knead latency. ports_sets:
// number of runs for which there are different ports. All ports are below the range from which Linux assigns ports by
// itself.
static const int ports_from = 12000, ports_each = 3, ports_sets = 6000;

// Choose ports by process id. Two simultaneous runs must not receive each other's messages, and stock liblcm
// distinguishes buses only by port.
void kn_latency_served_urls(kn_latency_served *s, char echo_url[KN_LATENCY_URL_SIZE])
{
    int port = ports_from + ports_each * (int)(getpid() % ports_sets);
    snprintf(s->url, sizeof s->url, "udpm://239.255.76.67:%d?ttl=0", port);
    snprintf(s->mesh_url, sizeof s->mesh_url, "udpm://239.255.76.67:%d?ttl=0", port + 1);
    snprintf(echo_url, KN_LATENCY_URL_SIZE, "udpm://239.255.76.67:%d?ttl=0", port + 2);
}

// Start a child process that ends when this process ends. The descriptor `out` becomes the standard output of the
// child. Return the process id of the child, or 0 on failure.
static int spawn(const char *path, char *const argv[], int out)
{
    pid_t parent = getpid(), pid = fork();
    if (pid < 0) return 0;
    if (pid > 0) return pid;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    // Put the child into its own process group. Ctrl-C in the terminal then reaches only this process, which stops the
    // child.
    setpgid(0, 0);
    // Exit if the parent process died before prctl took effect.
    if (getppid() != parent) _exit(KN_EXIT_DEVICE);
    dup2(out, STDOUT_FILENO);
    execvp(path, argv);
    _exit(127);
}

// Return the path of the kneadd that is in the same folder as knead. Builds and installations have both programs in one
// folder. If the folder has no kneadd, return the bare name, so that PATH is searched.
static const char *find_kneadd(char path[PATH_MAX])
{
    ssize_t n = readlink("/proc/self/exe", path, PATH_MAX - sizeof "kneadd");
    char *slash = n > 0 ? memrchr(path, '/', (size_t)n) : NULL;
    if (!slash) return "kneadd";
    strcpy(slash + 1, "kneadd");
    return access(path, X_OK) == 0 ? path : "kneadd";
}

int kn_latency_served_start(kn_latency_served *s, const char *scene, const char *phase)
{
    char program[PATH_MAX], trace[32];
    int pipes[2];
    s->trace = memfd_create("knead latency", 0); // the child inherits the descriptor
    if (s->trace < 0 || pipe2(pipes, O_CLOEXEC) != 0)
        return kn_complain("latency", KN_EXIT_DEVICE, "no pipe to kneadd: %s", strerror(errno));
    snprintf(trace, sizeof trace, "/proc/self/fd/%d", s->trace);
    char *argv[] = {"kneadd",  (char *)scene, "--lcm-url", s->url, "--mesh-url", s->mesh_url,
                    "--phase", (char *)phase, "--trace",   trace,  NULL};
    s->pid = spawn(find_kneadd(program), argv, pipes[1]);
    close(pipes[1]);
    // Wait for the first line of kneadd's output, which kneadd prints as soon as it serves the scene.
    s->said = fdopen(pipes[0], "r");
    if (s->pid && s->said && fgets(s->greeting, sizeof s->greeting, s->said)) return KN_EXIT_OK;
    int status = 0, pid = s->pid;
    s->pid = 0;
    if (pid) waitpid(pid, &status, 0);
    // If kneadd ended with an exit code, it has already printed the error.
    if (pid && WIFEXITED(status) && WEXITSTATUS(status) != 127) return WEXITSTATUS(status);
    return kn_complain("latency", KN_EXIT_DEVICE, "kneadd cannot be run: expected it beside knead, or in PATH");
}

// Copy the times of each tick's stages from kneadd's trace to the poses. The rows of the trace and the poses have the
// same order. A pose that two ticks used gets the times of the first tick.
static void take_stages(FILE *trace, kn_flights *poses)
{
    char line[512];
    kn_flight row;
    for (int at = 0; fgets(line, sizeof line, trace);) {
        if (sscanf(line, "%*[^,],%*[^,],%" SCNd64 ",%" SCNd64 ",%" SCNd64 ",%" SCNd64 ",%" SCNd64 ",%" SCNd64,
                   &row.session, &row.seq, &row.arrived_ns, &row.woke_ns, &row.stepped_ns, &row.guarded_ns) != 6)
            continue;
        kn_flight *pose = find_pose(poses, &row, &at);
        if (!pose || pose->woke_ns) continue;
        pose->arrived_ns = row.arrived_ns;
        pose->woke_ns = row.woke_ns;
        pose->stepped_ns = row.stepped_ns;
        pose->guarded_ns = row.guarded_ns;
    }
}

bool kn_latency_served_stop(kn_latency_served *s, kn_flights *poses)
{
    // kneadd writes the end of its trace before it exits, so wait for its exit.
    int status = 0;
    if (s->pid) {
        kill(s->pid, SIGTERM);
        waitpid(s->pid, &status, 0);
    }
    s->pid = 0;
    if (s->said) fclose(s->said);
    s->said = NULL;
    FILE *trace = s->trace >= 0 ? fdopen(s->trace, "r") : NULL;
    if (trace) {
        rewind(trace);
        take_stages(trace, poses);
        fclose(trace);
    }
    s->trace = -1;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}
