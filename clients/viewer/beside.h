#ifndef KN_CLIENTS_VIEWER_BESIDE_H
#define KN_CLIENTS_VIEWER_BESIDE_H
// A file that appears whole: written under a name that nobody has, in the folder of its path, then renamed. Whoever
// looks at the path sees the old file or the whole new one.
//
//     kn_beside_open -> write .file, or the name .tmp -> kn_beside_keep, or kn_beside_drop
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

typedef struct kn_beside {
    const char *path;
    char tmp[4096];
    FILE *file;
} kn_beside;

// path is kept. One that is there and no regular file is refused: renaming would put a file in the place of a device or
// a link. False and one sentence in error.
bool kn_beside_open(kn_beside *beside, const char *path, char *error, size_t error_size);

// Either one ends it. False and one sentence in error: it could not be written to its end, and is gone.
bool kn_beside_keep(kn_beside *beside, char *error, size_t error_size);
void kn_beside_drop(kn_beside *beside);

#endif
