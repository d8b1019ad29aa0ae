#ifndef KN_SERVER_COMMAND_H
#define KN_SERVER_COMMAND_H
// The private pipe from whoever started kneadd: an inherited file descriptor, on which it writes commands, one per
// line.
//
//     reset           the object is as new; probes leave it, and the forces they gave fade
//     quality NAME    another of the scene's points: fast, balanced, accurate, own; forces fade and come back
//
// Private, because nobody has it who was not given it; on LCM anyone may speak. Any other line is told on stderr, once,
// and does nothing. At the end of the pipe nobody is listened to any more, and kneadd serves on.
//
// The pipe stays as it came, without O_NONBLOCK: that is a property of what was opened, which the starter and others
// may share. A read does not wait all the same, when poll has seen something and nobody else reads there; telling may,
// when nobody reads stderr: not for the servo or the main thread.
#include "core/scene/scene.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define KN_COMMAND_MAX 64 // bytes of a line; of a longer one no more is kept

typedef struct kn_command {
    int fd;        // to poll for POLLIN; -1: nobody to listen to
    size_t length; // of the line so far, KN_COMMAND_MAX + 1 when it is too long
    char line[KN_COMMAND_MAX];
} kn_command;

typedef struct kn_orders { // what was read: of several alike the last
    bool reset;
    bool take; // quality
    kn_quality quality;
} kn_orders;

// number: decimal, of an open pipe, FIFO or socket, which is now this command's; NULL: nobody to listen to. False and
// one line in error.
bool kn_command_open(kn_command *command, const char *number, char *error, size_t error_size);
void kn_command_close(kn_command *command);

// One read, after poll saw something.
kn_orders kn_command_read(kn_command *command);

// What read does with what it got; complaints go to a stream of the caller's.
kn_orders kn_command_feed(kn_command *command, const char *bytes, size_t size, FILE *complaints);

#endif
