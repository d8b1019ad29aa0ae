#ifndef KN_CLIENTS_COMMAND_H
#define KN_CLIENTS_COMMAND_H
// Functions that every subcommand needs: exit codes, error messages, handling of Ctrl-C, a progress bar.
#include "server/option_table.h"
#include <stdbool.h>
#include <stdint.h>

enum { // exit codes of all programs of this project
    KN_EXIT_OK = 0,
    KN_EXIT_FAILED = 1,   // a check that the user asked for has failed, e.g. --verify or a latency contract
    KN_EXIT_USAGE = 2,    // bad input: a wrong option, scene file or log
    KN_EXIT_DEVICE = 3,   // a device, the message bus or the operating system failed
    KN_EXIT_INTERNAL = 70 // error in the program itself
};

// Print an error message as one line on stderr, such as "knead check: what is wrong, what was expected" for the
// subcommand "check". A message that begins with a place in a file, such as "scene.yaml:14:9: ...", is printed without
// "knead check: ", because editors can jump to a place only at the beginning of a line. Return `code`, an exit code
// KN_EXIT_*, unchanged.
__attribute__((format(printf, 3, 4))) int kn_complain(const char *subcommand, int code, const char *format, ...);

// Set *path to the scene that an argument means (kn_scene_take). Return KN_EXIT_OK, or print an error message and return
// KN_EXIT_USAGE.
int kn_command_scene(const char *subcommand, const char **path, const char *text);

// Handling of the signals SIGINT (Ctrl-C), SIGHUP (hang-up) and SIGTERM in a program that has something to clean up.
// Call kn_interrupt_watch before creating the first file or process that needs to be cleaned up. After the clean-up
// call kn_interrupt_die. It ends the process by the received signal, so that the parent process sees which signal ended
// it. kn_interrupted is an int, not a sig_atomic_t, so that this header does not have to include <signal.h>.
extern volatile int kn_interrupted; // number of the signal that this process received; 0: none

void kn_interrupt_watch(void);
// Let SIGINT, SIGHUP and SIGTERM end the process again. Call this function when there is nothing left to clean up.
void kn_interrupt_unwatch(void);
// End this process by the signal that it received. Return normally if no signal was received.
void kn_interrupt_die(void);

// Progress bar on stderr for long work, with the estimated time left. If stderr is not a terminal, nothing is printed.
// The bar is redrawn at most five times a second. Closing the bar clears its line, so that the next message starts on
// an empty line.
//
//     kn_progress p = kn_progress_open("film", 300);
//     for (...) kn_progress_step(&p, frames_done);
//     kn_progress_close(&p);                              before other output
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
// Format the line of the progress bar. `elapsed_s` is the time since the work began. Example: "film  [##########
// ]  50 %  12 s left".
void kn_progress_line(const kn_progress *progress, double done, double elapsed_s, char line[KN_PROGRESS_LINE]);

#endif
