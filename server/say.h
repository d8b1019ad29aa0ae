#ifndef KN_SERVER_SAY_H
#define KN_SERVER_SAY_H
// What a running kneadd says on stdout and stderr. A reader that does not read, a pipe that is full or a terminal that
// is stopped, holds up no thread: a line that finds no room is dropped and counted, and the next one that finds some is
// preceded by
//
//     kneadd: 12 lines before this one were not written: nobody read them
//
// A line goes out by one write of at most PIPE_BUF bytes, after a poll without waiting: pipes that are ready take as
// many, and never a part of them. Pipes and terminals are opened once more where the kernel lets us, to be written to
// without blocking, and without changing the flags that others share. Files take everything. Any thread, none of them
// real-time.
#include <stdbool.h>

#define KN_SAY_LINE 4096 // with its newline: PIPE_BUF; what is longer is cut

// Once, before the threads: takes stdout and stderr as they are, and from then on a reader that leaves ends no process
// (SIGPIPE). Before it lines go out all the same.
void kn_say_start(void);

void kn_say(const char *format, ...) __attribute__((format(printf, 1, 2)));     // a line on stderr; adds the newline
void kn_say_out(const char *format, ...) __attribute__((format(printf, 1, 2))); // on stdout
void kn_say_lines(int fd, const char *text); // whole lines on STDOUT_FILENO or STDERR_FILENO

// Whether all that was said there stands there, but for what a later line has told of.
bool kn_say_whole(int fd);

#endif
