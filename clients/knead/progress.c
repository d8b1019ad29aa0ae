#include "clients/knead/progress.h"
#include <math.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#define PERIOD_NS 200000000 // shortest time between two redraws of the bar
#define TRUSTED 0.02        // fraction of the work that must be done before the remaining time is estimated

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

kn_progress kn_progress_open(const char *what, double total)
{
    return (kn_progress){.what = what, .total = total, .terminal = isatty(STDERR_FILENO), .began_ns = now_ns()};
}

void kn_progress_line(const kn_progress *p, double done, double elapsed_s, char line[KN_PROGRESS_LINE])
{
    static const char bar[] = "####################";
    const double share = p->total > 0 && done > 0 ? fmin(done / p->total, 1) : 0;
    const int n = snprintf(line, KN_PROGRESS_LINE, "%.30s  [%-20.*s] %3.0f %%", p->what, (int)(20 * share), bar,
                           floor(100 * share));
    if (share < TRUSTED) return;
    const double left_s = ceil(elapsed_s * (1 - share) / share);
    if (left_s < 120) snprintf(line + n, KN_PROGRESS_LINE - (size_t)n, "  %.0f s left", left_s);
    else snprintf(line + n, KN_PROGRESS_LINE - (size_t)n, "  %.0f min left", ceil(left_s / 60));
}

void kn_progress_step(kn_progress *p, double done)
{
    const int64_t now = p->terminal ? now_ns() : 0;
    if (!p->terminal || (p->shown_ns > 0 && now - p->shown_ns < PERIOD_NS)) return;
    char line[KN_PROGRESS_LINE];
    p->shown_ns = now;
    // The time left is extrapolated from the speed so far.
    kn_progress_line(p, done, (double)(now - p->began_ns) * 1e-9, line);
    fprintf(stderr, "\r%-70s", line);
}

void kn_progress_close(kn_progress *p)
{
    if (p->shown_ns > 0) fprintf(stderr, "\r%70s\r", "");
    p->shown_ns = 0;
}
