// paired: decide whether the machine or kneadd made a tick of kneadd late, in two parts that are independent of
// kneadd's own sentinel.
//
//     paired witness PROCESSOR SECONDS     a thread ahead of the servo (FIFO 99) on that processor, which no servo can
//                                          delay: its lateness, every 0.5 ms, from 0.1 ms on: "due_ns late_ns"
//     paired judge TRACE WITNESS           that and the ticks of `kneadd --trace`, as numbers:
//
//     ticks N, woken_1ms N unexplained_1ms N, the same of 0.5 ms (half) and overruns            of the servo
//     unexplained_long N: overruns that are also longer than ten times the median tick or 3 ms, whichever is less
//     wakes N late_1ms N late_half N                                                            of the witness
//     execution_us p50 F p99 F p99_9 F max F undisturbed_max F
//
// woken: late after its deadline or after the end of the tick before. An overrun is a tick that ends when the next one
// is already due. Explained: the witness was late within 2 ms of it. Execution: from the wake to the end of all work of
// a tick, which the next tick's asked_ns gives. undisturbed_max leaves out ticks in which the witness was late.
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#define MS INT64_C(1000000)
#define PERIOD (MS / 2)
#define MARGIN (2 * MS)
#define STALL (MS / 10)

typedef struct stall {
    int64_t from_ns, to_ns;
} stall;

static stall *stalls;
static int64_t stall_count, stall_room;

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000 * MS + t.tv_nsec;
}

// Sleep until every half millisecond at FIFO 99 and record each wake that is 0.1 ms late or more.
static int witness(int processor, double seconds)
{
    cpu_set_t its;
    CPU_ZERO(&its);
    CPU_SET((size_t)processor, &its);
    stall_room = (int64_t)(2e3 * seconds) + 1;
    stalls = calloc((size_t)stall_room, sizeof *stalls);
    if (!stalls || sched_setaffinity(0, sizeof its, &its) != 0 || mlockall(MCL_CURRENT) != 0 ||
        sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){99}) != 0)
        return fprintf(stderr, "paired: no witness at FIFO 99: %s\n", strerror(errno)), 3;
    int64_t start_ns = now_ns(), due_ns = start_ns, end_ns = due_ns + (int64_t)(1e9 * seconds), wakes = 0;
    while ((due_ns += PERIOD) < end_ns) {
        struct timespec due = {due_ns / (1000 * MS), due_ns % (1000 * MS)};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR)
            ;
        int64_t woken_ns = now_ns();
        wakes++;
        if (woken_ns - due_ns >= STALL && stall_count < stall_room) stalls[stall_count++] = (stall){due_ns, woken_ns};
        // Skip the cycles that passed.
        while (due_ns + PERIOD <= woken_ns) due_ns += PERIOD;
    }
    printf("wakes %" PRId64 " from %" PRId64 " to %" PRId64 "\n", wakes, start_ns, end_ns);
    for (int64_t i = 0; i < stall_count; i++)
        printf("%" PRId64 " %" PRId64 "\n", stalls[i].from_ns, stalls[i].to_ns - stalls[i].from_ns);
    return 0;
}

static bool add(stall s)
{
    if (stall_count == stall_room) {
        stall_room = stall_room ? 2 * stall_room : 1024;
        stalls = realloc(stalls, (size_t)stall_room * sizeof *stalls);
    }
    if (!stalls) return false;
    stalls[stall_count++] = s;
    return true;
}

// Return true if the witness was late in this time. Stalls and ticks are both in order, so the search goes on from the
// last place.
static bool stalled(int64_t from_ns, int64_t to_ns)
{
    static int64_t at;
    while (at < stall_count && stalls[at].to_ns + 100 * MS < from_ns) at++;
    for (int64_t i = at; i < stall_count && stalls[i].from_ns <= to_ns; i++)
        if (stalls[i].to_ns >= from_ns) return true;
    return false;
}

typedef struct tick {
    int64_t number, due_ns, asked_ns, late_ns, woke_ns;
} tick;

typedef struct count {
    int64_t all, unexplained;
} count;

static int64_t *executions, execution_count, *undisturbed, undisturbed_count;
static count whole, half, overrun;

// Count a tick as late or not, explained or not, and the execution of the tick before it.
static void judge_tick(const tick *t, const tick *last)
{
    bool busy = t->asked_ns > t->due_ns, late = t->late_ns >= MS / 2;
    int64_t began_ns = (busy ? t->asked_ns : t->due_ns), woke_ns = began_ns + t->late_ns;
    bool explained = late && stalled(began_ns - MARGIN, woke_ns + MARGIN);
    half.all += late;
    half.unexplained += late && !explained;
    whole.all += t->late_ns >= MS;
    whole.unexplained += t->late_ns >= MS && !explained;
    // The execution of the tick before is known only if that tick is in the trace: its number must fit the cycles that
    // passed.
    int64_t took_ns = t->asked_ns - last->woke_ns; // execution of the tick before
    if (last->woke_ns == 0 || t->number - last->number != 1 + (woke_ns - t->due_ns) / MS) return;
    bool excused = stalled(last->woke_ns, t->asked_ns);
    executions[execution_count++] = took_ns;
    overrun.all += took_ns > MS;
    overrun.unexplained += took_ns > MS && !excused;
    if (!excused) undisturbed[undisturbed_count++] = took_ns;
}

static int ascending(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static double quantile_us(double q)
{
    return execution_count ? 1e-3 * (double)executions[(int64_t)(q * (double)(execution_count - 1))] : 0.0;
}

// Return the number of undisturbed ticks that are too long: longer than 1 ms, and longer than ten times the median of
// the run or 3 ms, whichever is less. A shared processor may be three times as slow all the time, in pieces that no
// witness sees; hence the margin.
static int64_t long_ones(void)
{
    int64_t found = 0, most_ns = (int64_t)fmin(1e4 * quantile_us(0.5), 3e6);
    for (int64_t i = 0; i < undisturbed_count; i++) found += undisturbed[i] > MS && undisturbed[i] > most_ns;
    return found;
}

// Read both files, judge the ticks that the witness covers, and print the numbers.
static int judge(const char *trace_name, const char *witness_name)
{
    FILE *trace = fopen(trace_name, "r"), *seen = fopen(witness_name, "r");
    char line[512];
    int64_t wakes = 0, ticks = 0, late = 0, later = 0, start_ns = 0, end_ns = 0;
    if (!trace || !seen ||
        fscanf(seen, "wakes %" SCNd64 " from %" SCNd64 " to %" SCNd64, &wakes, &start_ns, &end_ns) != 3)
        return fprintf(stderr, "paired: %s or %s: expected a trace and a witness\n", trace_name, witness_name), 2;
    for (stall s; fscanf(seen, "%" SCNd64 " %" SCNd64, &s.from_ns, &s.to_ns) == 2;) {
        late += s.to_ns >= MS / 2;
        later += s.to_ns >= MS;
        s.to_ns += s.from_ns;
        if (!add(s)) return 70;
    }
    int64_t room = 0;
    while (fgets(line, sizeof line, trace)) room++;
    rewind(trace);
    executions = calloc((size_t)room + 1, sizeof *executions);
    undisturbed = calloc((size_t)room + 1, sizeof *undisturbed);
    if (!executions || !undisturbed) return 70;
    tick t, last = {0};
    while (fgets(line, sizeof line, trace)) {
        if (sscanf(line,
                   "%" SCNd64 ",%*[^,],%*[^,],%*[^,],%*[^,],%" SCNd64 ",%*[^,],%*[^,],%" SCNd64 ",%" SCNd64 ",%" SCNd64,
                   &t.number, &t.woke_ns, &t.due_ns, &t.asked_ns, &t.late_ns) != 5 ||
            t.number == last.number)
            continue; // the header, or another probe's row
        bool seen_all = t.due_ns > start_ns + MARGIN && t.woke_ns < end_ns - MARGIN;
        ticks += seen_all;
        if (seen_all) judge_tick(&t, &last);
        last = t;
    }
    qsort(executions, (size_t)execution_count, sizeof *executions, ascending);
    qsort(undisturbed, (size_t)undisturbed_count, sizeof *undisturbed, ascending);
    printf("ticks %" PRId64 " woken_1ms %" PRId64 " unexplained_1ms %" PRId64 " woken_half %" PRId64
           " unexplained_half %" PRId64 " overruns %" PRId64 " unexplained_overruns %" PRId64
           " unexplained_long %" PRId64 "\n",
           ticks, whole.all, whole.unexplained, half.all, half.unexplained, overrun.all, overrun.unexplained,
           long_ones());
    printf("wakes %" PRId64 " late_1ms %" PRId64 " late_half %" PRId64 "\n", wakes, later, late);
    printf("execution_us p50 %.0f p99 %.0f p99_9 %.0f max %.0f undisturbed_max %.0f\n", quantile_us(0.5),
           quantile_us(0.99), quantile_us(0.999), quantile_us(1.0),
           undisturbed_count ? 1e-3 * (double)undisturbed[undisturbed_count - 1] : 0.0);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 4 && !strcmp(argv[1], "witness")) return witness(atoi(argv[2]), atof(argv[3]));
    if (argc == 4 && !strcmp(argv[1], "judge")) return judge(argv[2], argv[3]);
    return fprintf(stderr, "usage: paired witness PROCESSOR SECONDS | paired judge TRACE WITNESS\n"), 2;
}
