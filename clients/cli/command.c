#include "clients/cli/command.h"
#include "server/scene_name.h"
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

// Return true if the message contains a place in a file, like "scene.yaml:14:9: ".
static bool has_place(const char *text)
{
    for (const char *at = text; (at = strchr(at, ':')); at++) {
        int length = 0;
        // sscanf sets length only if the whole pattern matched.
        if (sscanf(at, ":%*[0-9]:%*[0-9]:%n", &length) == 0 && length > 0 && at[length] == ' ') return true;
    }
    return false;
}

int kn_complain(const char *subcommand, int code, const char *format, ...)
{
    char text[16384]; // room for a value as long as four file paths
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    // If the message begins with a place in a file, print no prefix, so that the place stays at the beginning of the
    // line.
    if (has_place(text)) fprintf(stderr, "%s\n", text);
    else fprintf(stderr, "knead %s: %s\n", subcommand, text);
    return code;
}

int kn_command_scene(const char *subcommand, const char **path, const char *text)
{
    const char *expected = kn_scene_take(path, text);
    return expected ? kn_complain(subcommand, KN_EXIT_USAGE, "%s: expected %s", text, expected) : KN_EXIT_OK;
}

volatile int kn_interrupted;

// Only store the number of the signal, because little else is safe in a signal handler.
static void on_signal(int number) { kn_interrupted = number; }

static void handle(void (*handler)(int))
{
    static const int deadly[] = {SIGINT, SIGTERM, SIGHUP};
    struct sigaction before;
    for (int i = 0; i < 3; i++) {
        // If SIGHUP (hang-up) is ignored, as in a program started by nohup, keep ignoring it.
        if (deadly[i] == SIGHUP && sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler == SIG_IGN) continue;
        sigaction(deadly[i], &(struct sigaction){.sa_handler = handler}, NULL);
    }
}

void kn_interrupt_watch(void) { handle(on_signal); }

void kn_interrupt_unwatch(void) { handle(SIG_DFL); }

void kn_interrupt_die(void)
{
    if (!kn_interrupted) return;
    // Restore the default action of the signal, which ends the process. Then raise the signal again.
    signal((int)kn_interrupted, SIG_DFL);
    raise((int)kn_interrupted);
}

#define PERIOD_NS 200000000 // shortest time between two redraws of the bar
#define TRUSTED 0.02        // fraction of the work that must be done before the remaining time is estimated

static int64_t monotonic_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

kn_progress kn_progress_open(const char *what, double total)
{
    return (kn_progress){.what = what, .total = total, .terminal = isatty(STDERR_FILENO), .began_ns = monotonic_ns()};
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
    const int64_t now = p->terminal ? monotonic_ns() : 0;
    if (!p->terminal || (p->shown_ns > 0 && now - p->shown_ns < PERIOD_NS)) return;
    char line[KN_PROGRESS_LINE];
    p->shown_ns = now;
    // Estimate the remaining time from the average speed so far.
    kn_progress_line(p, done, (double)(now - p->began_ns) * 1e-9, line);
    fprintf(stderr, "\r%-70s", line);
}

void kn_progress_close(kn_progress *p)
{
    if (p->shown_ns > 0) fprintf(stderr, "\r%70s\r", "");
    p->shown_ns = 0;
}
