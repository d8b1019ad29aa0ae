#ifndef KN_CLIENTS_PROGRESS_H
#define KN_CLIENTS_PROGRESS_H
// A bar on stderr for work that takes longer than a glance, with what is left of it. Says nothing when stderr is no
// terminal, redraws five times a second at most, and leaves the line empty, so that the next word begins a clean one.
//
//     kn_progress p = kn_progress_open("film", 300);
//     for (...) kn_progress_step(&p, frames_done);
//     kn_progress_close(&p);                              before anything else is told
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_progress {
    const char *what;
    double total;
    bool terminal;
    int64_t began_ns, shown_ns; // CLOCK_MONOTONIC
} kn_progress;

// what: one or two words, kept as long as the bar. total: of whatever step counts, > 0.
kn_progress kn_progress_open(const char *what, double total);
void kn_progress_step(kn_progress *progress, double done); // 0..total
void kn_progress_close(kn_progress *progress);

#define KN_PROGRESS_LINE 100
// The line that is shown after so many seconds: "film  [##########          ]  50 %  12 s left".
void kn_progress_line(const kn_progress *progress, double done, double elapsed_s, char line[KN_PROGRESS_LINE]);

#endif
