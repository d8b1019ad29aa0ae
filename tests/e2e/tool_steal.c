// steal PID: take the processor from kneadd's servo for 0.8 s, at a higher priority, on the processor that the servo
// is pinned to.
//
//     this    |==== 0.9 ms ====|..|==== 0.9 ms ====|..|====    the servo gets the gaps in which this sleeps, for a tick
//     servo                     ==                  ==         two or more of them
//
// The time of a tick and the length of a sleep depend on the machine, so the gaps get shorter step by step. The total
// stays below the 0.95 s of every second that the kernel leaves to real-time threads (sched_rt_runtime_us). Exit 77
// with a reason: this is not allowed here.
#include "server/clock.h"
#include <dirent.h>
#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define BURST_NS 900000
#define STEP_NS 200000000
#define ABOVE_SERVO 90

// Return the id of the thread that kneadd calls "servo", or 0 if there is none.
static int find_servo(const char *pid)
{
    char path[300], name[32] = "";
    int found = 0;
    snprintf(path, sizeof path, "/proc/%.20s/task", pid);
    DIR *tasks = opendir(path);
    for (struct dirent *task; !found && tasks && (task = readdir(tasks));) {
        snprintf(path, sizeof path, "/proc/%.20s/task/%.20s/comm", pid, task->d_name);
        FILE *comm = fopen(path, "r");
        if (comm && fgets(name, sizeof name, comm) && strcmp(name, "servo\n") == 0) found = atoi(task->d_name);
        if (comm) fclose(comm);
    }
    if (tasks) closedir(tasks);
    return found;
}

int main(int argc, char **argv)
{
    static const long gap_ns[] = {80000, 40000, 20000, 10000};
    int servo = argc == 2 ? find_servo(argv[1]) : 0;
    cpu_set_t its;
    if (servo == 0) return 2;
    if (sched_getaffinity(servo, sizeof its, &its) != 0 || sched_setaffinity(0, sizeof its, &its) != 0 ||
        sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = ABOVE_SERVO}) != 0) {
        printf("skipped: no time can be stolen: %s\n", strerror(errno));
        return 77;
    }
    for (size_t i = 0; i < sizeof gap_ns / sizeof *gap_ns; i++)
        for (int64_t end_ns = kn_now_ns() + STEP_NS, ns; (ns = kn_now_ns()) < end_ns;) {
            while (kn_now_ns() - ns < BURST_NS) continue;
            nanosleep(&(struct timespec){.tv_nsec = gap_ns[i]}, NULL);
        }
    return 0;
}
