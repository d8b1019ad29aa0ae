#ifndef KN_CLIENTS_VIEWER_BESIDE_H
#define KN_CLIENTS_VIEWER_BESIDE_H
// Atomic replacement of a file. The data is written to a new file with an unused name in the same folder. Renaming then
// puts the new file in place. A reader of the path sees the old file or the whole new one.
//
//     kn_beside_open or kn_beside_write -> write .file, or the name .tmp -> kn_beside_keep, or kn_beside_drop
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

typedef struct kn_beside {
    const char *path;
    char tmp[4096]; // name of the new file; "": no new file, `path` is written directly
    bool unnamed;   // true: the new file has no name yet, so nothing is left of the file if this process is killed
    FILE *file;
} kn_beside;

// Create the new file. `path` must stay valid until the last call. Refuse a `path` that exists and is not a regular
// file, because the rename would replace a device or a link by a file. On failure return false and put one sentence in
// error.
bool kn_beside_open(kn_beside *beside, const char *path, char *error, size_t error_size);

// Like kn_beside_open, for a path that the user may choose freely. If the file system supports unnamed files, the new
// file has no name until kn_beside_keep. If `path` is a pipe, a device, a link, a file with several names, or a file of
// another user or group, a rename would change more than the contents. So such a `path` is written directly, without a
// new file. `path` is also written directly if no new file can be created in the folder. A file that is replaced keeps
// its permissions. On failure return false with the reason in errno.
bool kn_beside_write(kn_beside *beside, const char *path);

// kn_beside_keep puts the new file in place at `path`, and kn_beside_drop removes the new file. Every use must end with
// one of the two calls. If the new file could not be written completely, kn_beside_keep removes it, returns false and
// puts one sentence in error.
bool kn_beside_keep(kn_beside *beside, char *error, size_t error_size);
void kn_beside_drop(kn_beside *beside);

#endif
