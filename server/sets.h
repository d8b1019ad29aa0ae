#ifndef KN_SERVER_SETS_H
#define KN_SERVER_SETS_H
// Settings with which an operator overrides those of a scene while it is served: lines of KEY=VALUE, each key once.
// Plain text without pointers, so that a snapshot can hold the settings.
#include <stdbool.h>

#define KN_SETS_BYTES 1024 // size of the text with its NUL, bytes
#define KN_SETS_MAX 32     // largest number of settings

typedef struct kn_sets {
    char text[KN_SETS_BYTES]; // one setting per line, for example "material.c1=3 kPa*s\ndevice.clamp=2 N\n"
} kn_sets;

// Add the setting `set`, or replace an earlier one with the same key. If `set` is not KEY=VALUE, holds control
// characters or does not fit, return false, put one line in error, and leave the settings as they were.
bool kn_sets_add(kn_sets *sets, const char *set, char *error, int error_size);

// List the settings as --set takes them. The strings point into `room`, which gets a copy of the text. Return the
// number of settings.
int kn_sets_list(const kn_sets *sets, char room[KN_SETS_BYTES], const char *list[KN_SETS_MAX]);

#endif
