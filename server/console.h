#ifndef KN_SERVER_CONSOLE_H
#define KN_SERVER_CONSOLE_H
// Output of lines on stdout and stderr of a running kneadd. A reader that does not read (a full pipe, a stopped
// terminal) never blocks a thread. A line for which there is no room is dropped and counted. The next line that is
// written is preceded by
//
//     kneadd: 12 lines before this one were not written: nobody read them
//
// A line is written by one write() of at most PIPE_BUF bytes, after a poll() that does not wait. A pipe that is ready
// takes that many bytes at once, never a part of them. Pipes and terminals are opened once more where the kernel allows
// it. The new descriptor is non-blocking, and the flags that other processes share stay as they are. Regular files
// accept every line. Any thread but a real-time one may call these functions.
#include <stdbool.h>
#include <stddef.h>
#include <unistd.h>

#define KN_CONSOLE_LINE 4096 // largest length of a line with its newline, bytes (= PIPE_BUF); a longer line is cut

// Set up the output on stdout and stderr. Call this function once, before creating threads. From then on SIGPIPE is
// ignored, so that a reader that closes its end of a pipe does not end the process. Lines that stdio buffered before
// the call are still written.
void kn_console_start(void);

// Write one line to STDOUT_FILENO or STDERR_FILENO; a newline is added.
void kn_console_line(int fd, const char *format, ...) __attribute__((format(printf, 2, 3)));
#define kn_console_out(...) kn_console_line(STDOUT_FILENO, __VA_ARGS__)
#define kn_console_err(...) kn_console_line(STDERR_FILENO, __VA_ARGS__)
void kn_console_lines(int fd, const char *text); // write whole lines to STDOUT_FILENO or STDERR_FILENO

// Return true if no write to this descriptor has failed, and every dropped line has been reported by a later line.
bool kn_console_complete(int fd);

// Return the exit code of a program: `code`. If standard output could not be written completely, say so on stderr, and
// return 3 instead of 0.
int kn_console_end(const char *program, int code);

// Write a one-line reason into `error`, for the caller to print. Always return false, so that a function can fail with
// `return kn_refuse(...)`.
bool kn_refuse(char *error, size_t error_size, const char *format, ...) __attribute__((format(printf, 3, 4)));

#endif
