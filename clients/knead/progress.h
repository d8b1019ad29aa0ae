#ifndef KN_CLIENTS_PROGRESS_H
#define KN_CLIENTS_PROGRESS_H
// Progress bar on stderr for long work, with the estimated time left. If stderr is not a terminal, nothing is printed.
// The bar is redrawn at most five times a second. Closing the bar clears its line, so that the next message starts on
// an empty line.
//
//     kn_progress p = kn_progress_open("film", 300);
//     for (...) kn_progress_step(&p, frames_done);
//     kn_progress_close(&p);                              before other output
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_progress {
    const char *what;
    double total;
    bool terminal;
    int64_t began_ns, shown_ns; // times (CLOCK_MONOTONIC) when the bar was opened and last drawn
} kn_progress;

// Open a progress bar. what: label of one or two words; the text must outlive the bar. total: amount of work in any
// unit, > 0.
kn_progress kn_progress_open(const char *what, double total);
// Redraw the progress bar if it was last drawn at least 0.2 s ago. done: amount of work done, 0..total.
void kn_progress_step(kn_progress *progress, double done);
// Clear the line of the progress bar.
void kn_progress_close(kn_progress *progress);

#define KN_PROGRESS_LINE 100
// Format the progress bar that is shown `elapsed_s` after the work began, such as
// "film  [##########          ]  50 %  12 s left".
void kn_progress_line(const kn_progress *progress, double done, double elapsed_s, char line[KN_PROGRESS_LINE]);

#endif
