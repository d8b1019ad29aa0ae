#ifndef KN_SERVER_SETS_H
#define KN_SERVER_SETS_H
// What an operator has set over a scene while it was served: KEY=VALUE lines, a key once. Plain text without pointers,
// so that a snapshot can hold it.
#include <stdbool.h>

#define KN_SETS_BYTES 1024 // of the text, its NUL included
#define KN_SETS_MAX 32

typedef struct kn_sets {
    char text[KN_SETS_BYTES]; // "material.c1=3 kPa*s\ndevice.clamp=2 N\n"
} kn_sets;

// The last word on a key counts. False and one line in error: no KEY=VALUE, control characters, no room.
bool kn_sets_add(kn_sets *sets, const char *set, char *error, int error_size);

// As --set takes them, pointing into `room`, a copy of the text. Returns how many.
int kn_sets_list(const kn_sets *sets, char room[KN_SETS_BYTES], const char *list[KN_SETS_MAX]);

#endif
