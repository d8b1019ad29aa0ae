// steady [--timeout S] COMMAND...: run a test that depends on millisecond timing. Beside it run a witness that
// records whether the machine allowed such timing.
//
//     processor 0   witness  |.|.|.|.|.|            |.|.|.|.|    sleeps of 1 ms, whose timers come unless the host has
//     processor 1   witness  |.|.|.|.|.|.|.|.|.|.|.|.|.|.|.|     taken the processor away: a standstill
//     COMMAND and all its processes                    exit 1    failed, disturbed
//
// A standstill is lateness of a sleep, without the time in which the witness was runnable and waited for its
// processor. The kernel counts that waiting time (schedstat's run_delay). So load made by the test itself excuses
// nothing. A thread with a higher priority than the witness is no excuse. The 50 ms of every second that the kernel
// keeps from a real-time thread that never sleeps, and from all above it, are no excuse either.
//
//     the test passes, or exits with more than 1, or is killed    its exit code: passed, skipped, bad input, a crash
//     it takes longer than --timeout (600 s)                      1; all processes that it started are killed
//     it fails while the machine never stood still                1
//     it fails while the machine stood still                      77 and the figures: nothing was learnt
//
// This program makes one attempt. tests/run makes the second.
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define MS INT64_C(1000000)
#define SECOND INT64_C(1000000000)
// a pose 20 ms late fades the force; part of that margin is used up without any standstill
#define STANDSTILL_NS (10 * MS)
#define LOST_NS MS // less is the lateness of an ordinary wake
#define STACK_BYTES (128 << 10)
enum { FAILED = 1, USAGE = 2, SKIPPED = 77, INTERNAL = 70, WITNESS_PRIORITY = 99 };

typedef struct witness {
    int processor;
    bool sees; // the witness can tell a standstill from load
    _Atomic int64_t standstills, longest_ns, lost_ns;
} witness;

typedef struct figures { // sums over all processors
    int64_t standstills, longest_ns, lost_ns, watched_ns;
} figures;

static witness witnesses[CPU_SETSIZE];
static int witness_count;
static char blind[200]; // the reason why the witnesses cannot see some standstills
static sigset_t news;   // signals to wait for: a child ended, or this program is to end

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * SECOND + t.tv_nsec;
}

static void sleep_until(int64_t due_ns)
{
    struct timespec due = {due_ns / SECOND, due_ns % SECOND};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) continue;
}

// Return how long a thread was runnable without running, in total. Return -1 if this kernel does not count it.
static int64_t waited_ns(int schedstat)
{
    char text[100];
    long long waited, turns;
    ssize_t size = pread(schedstat, text, sizeof text - 1, 0);
    if (size <= 0) return -1;
    text[size] = '\0';
    return sscanf(text, "%*s %lld %lld", &waited, &turns) == 2 && turns > 0 ? waited : -1;
}

static void *watch(void *memory)
{
    witness *w = memory;
    int schedstat = open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);
    int64_t before_ns = waited_ns(schedstat);
    for (int64_t due_ns = now_ns() + MS;; due_ns = now_ns() + MS) {
        sleep_until(due_ns);
        int64_t woken_ns = now_ns(), after_ns = waited_ns(schedstat);
        int64_t still_ns = woken_ns - due_ns - (after_ns - before_ns);
        before_ns = after_ns;
        if (!w->sees || still_ns < LOST_NS) continue;
        w->lost_ns += still_ns;
        if (still_ns > w->longest_ns) w->longest_ns = still_ns;
        if (still_ns < STANDSTILL_NS) continue;
        w->standstills++;
    }
    return NULL;
}

static int start_witness(witness *w, int policy)
{
    pthread_t thread;
    pthread_attr_t attr;
    cpu_set_t its;
    struct sched_param param = {.sched_priority = policy == SCHED_FIFO ? WITNESS_PRIORITY : 0};
    CPU_ZERO(&its);
    CPU_SET((size_t)w->processor, &its);
    pthread_attr_init(&attr);
    pthread_attr_setstacksize(&attr, STACK_BYTES);
    pthread_attr_setinheritsched(&attr, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attr, policy);
    pthread_attr_setschedparam(&attr, &param);
    pthread_attr_setaffinity_np(&attr, sizeof its, &its);
    int error = pthread_create(&thread, &attr, watch, w);
    pthread_attr_destroy(&attr);
    return error;
}

// Start one witness for each processor that this process may use. Without real-time priority, a standstill counts as
// load if it comes while the witness waits for its processor. If the kernel does not count waiting times, the witness
// must run at the highest priority, and all its lateness counts. If neither is available there are no witnesses, and
// no failure is excused.
static void start_witnesses(void)
{
    cpu_set_t may;
    int schedstat = open("/proc/self/schedstat", O_RDONLY), refused = 0;
    bool counts = waited_ns(schedstat) >= 0;
    close(schedstat);
    if (sched_getaffinity(0, sizeof may, &may) != 0) CPU_ZERO(&may);
#ifndef KN_SANITIZED
    if (mlockall(MCL_CURRENT) != 0) errno = 0; // a page read from disk would look like a standstill; not vital
#endif
    for (int i = 0; i < CPU_SETSIZE; i++) {
        witness *w = &witnesses[witness_count];
        if (!CPU_ISSET((size_t)i, &may)) continue;
        *w = (witness){.processor = i, .sees = true};
        if (!refused) refused = start_witness(w, SCHED_FIFO);
        if (refused) w->sees = counts;
        if (refused && start_witness(w, SCHED_OTHER) != 0) continue;
        witness_count++;
    }
    if (refused)
        snprintf(blind, sizeof blind, " (no SCHED_FIFO: %s, %s)", strerror(refused),
                 counts ? "so some are not seen" : "nor does this kernel count waits: none is seen");
    else if (!counts) snprintf(blind, sizeof blind, " (this kernel does not count waits: load may be among it)");
}

static figures take_figures(int64_t since_ns)
{
    figures f = {.watched_ns = (now_ns() - since_ns) * witness_count};
    for (int i = 0; i < witness_count; i++) {
        if (witnesses[i].longest_ns > f.longest_ns) f.longest_ns = witnesses[i].longest_ns;
        f.standstills += witnesses[i].standstills;
        f.lost_ns += witnesses[i].lost_ns;
    }
    return f;
}

static void print_figures(const figures *f)
{
    double share = f->watched_ns > 0 ? (double)f->lost_ns / (double)f->watched_ns : 0.0;
    printf("%lld standstills of 10 ms or more, the longest %.1f ms, %.2f %% of the processors' time lost%s\n",
           (long long)f->standstills, 1e-6 * (double)f->longest_ns, 100.0 * share, blind);
}

static pid_t start_command(char **command)
{
    pid_t parent = getpid(), child = fork();
    if (child != 0) {
        if (child > 0) setpgid(child, child); // both processes set the group, because either may run first
        return child;
    }
    setpgid(0, 0);
    sigprocmask(SIG_UNBLOCK, &news, NULL);
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) _exit(INTERNAL);
    execvp(command[0], command);
    dprintf(STDERR_FILENO, "steady: %s: %s\n", command[0], strerror(errno));
    _exit(errno == ENOENT ? 127 : 126);
}

static void end_command(pid_t group)
{
    kill(-group, SIGTERM); // netns then takes down its namespace
    sleep_until(now_ns() + SECOND);
    kill(-group, SIGKILL);
}

// Run the command. Return its exit code, 128 + signal if it was killed, or -1 if it did not end in time. A signal to
// this program ends the command and then this program.
static int run_command(char **command, int64_t timeout_ns)
{
    pid_t child = start_command(command);
    if (child < 0) return perror("steady: fork"), INTERNAL;
    int status = 0, signal = 0;
    bool late = false;
    for (int64_t end_ns = now_ns() + timeout_ns; !late && signal <= 0;) {
        siginfo_t ended = {0};
        if (waitid(P_PID, (id_t)child, &ended, WEXITED | WNOHANG | WNOWAIT) == 0 && ended.si_pid == child) break;
        int64_t left_ns = end_ns - now_ns();
        late = left_ns <= 0;
        if (late) break;
        signal = sigtimedwait(&news, NULL, &(struct timespec){left_ns / SECOND, left_ns % SECOND});
        if (signal == SIGCHLD) signal = 0;
    }
    if (late || signal > 0) end_command(child);
    kill(-child, SIGKILL); // kill the processes left behind, while the process id is not yet reused
    waitpid(child, &status, 0);
    if (signal > 0) exit(128 + signal);
    if (late) return -1;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

static int run(char **command, int64_t timeout_ns)
{
    int64_t start_ns = now_ns();
    int code = run_command(command, timeout_ns);
    sleep_until(now_ns() + 5 * MS); // let each witness record a standstill at the very end
    figures f = take_figures(start_ns);
    double took_s = 1e-9 * (double)(now_ns() - start_ns);
    if (code >= 0) printf("steady: exit %d after %.1f s; ", code, took_s);
    else printf("steady: did not end in %.1f s; ", took_s);
    print_figures(&f);
    if (code != FAILED || f.standstills == 0) return code >= 0 ? code : FAILED;
    printf("skipped: the machine stood still while it failed: ");
    print_figures(&f);
    return SKIPPED;
}

int main(int argc, char **argv)
{
    static const int signals[] = {SIGCHLD, SIGINT, SIGTERM, SIGHUP};
    double timeout_s = 600.0;
    char **command = argv + 1, *end = "";
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (argc > 2 && strcmp(argv[1], "--timeout") == 0) {
        timeout_s = strtod(argv[2], &end);
        command += 2;
    }
    if (!*command || **command == '-' || *end || end == argv[2] || !(timeout_s >= 0.0 && timeout_s <= 1e6)) {
        fprintf(stderr, "steady: expected [--timeout S] COMMAND...\n");
        return USAGE;
    }
    sigemptyset(&news);
    for (int i = 0; i < 4; i++) sigaddset(&news, signals[i]);
    sigprocmask(SIG_BLOCK, &news, NULL); // before any thread starts
    start_witnesses();
    return run(command, (int64_t)(1e9 * timeout_s));
}
