#ifndef KN_BENCH_BENCH_H
#define KN_BENCH_BENCH_H
// Helpers that all benches share: clocks, and the lines about processor and compiler that every bench prints first.
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

// Return the time of a clock, us. CLOCK_THREAD_CPUTIME_ID counts only the processor time of the calling thread.
static inline double clock_us(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static inline double thread_us(void) { return clock_us(CLOCK_THREAD_CPUTIME_ID); }

static inline void print_machine(void)
{
    char line[256], model[200] = "unknown processor";
    FILE *f = fopen("/proc/cpuinfo", "r");
    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, "model name : %199[^\n]", model) == 1) break;
    if (f) fclose(f);
#ifdef __clang__
    const char *compiler = "clang " __clang_version__;
#else
    const char *compiler = "gcc " __VERSION__;
#endif
#ifdef __OPTIMIZE__
    const char *level = "optimised";
#else
    const char *level = "NOT optimised";
#endif
    printf("machine   %s\ncompiler  %s, %s\n", model, compiler, level);
}

#endif
