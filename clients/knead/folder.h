#ifndef KN_CLIENTS_FOLDER_H
#define KN_CLIENTS_FOLDER_H
// The folder in which a sweep keeps its runs. A sweep is one call of `knead tradeoff`, which replays a log with many
// solver settings. The folder is the one that --resume names, or a temporary one that is removed when the sweep ends.
//
//     folder/sweep     hashes of program, scene and log, so that no run of another sweep is used. A temporary folder
//                      has a last line `temporary`. The file is locked while the sweep is at work
//
// A sweep that was killed cannot remove its own folder, so the next sweep removes the leftover. A leftover has the line
// `temporary`, belongs to this user and is not locked. The line is written under the lock, so a new folder is never
// mistaken for a leftover.
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_folder {
    char path[PATH_MAX]; // path of the folder; "": no folder is open
    bool temporary;
    int lock; // descriptor of the locked file `sweep` in the folder; -1: not open
} kn_folder;

// Open the folder `resume`, or a temporary folder in $TMPDIR or /tmp if `resume` is NULL. `hashes` holds the hashes of
// program, scene and log. Return an exit code. On failure print one line on stderr.
int kn_folder_open(kn_folder *folder, const char *resume, const uint64_t hashes[3]);
// Close the folder of the sweep. Remove the folder if it is temporary.
void kn_folder_close(kn_folder *folder);

// Return the path of the file `name` in the folder with `ending` appended, or "" if the path is too long.
const char *kn_folder_path(const kn_folder *folder, const char *name, const char *ending, char path[PATH_MAX]);

#endif
