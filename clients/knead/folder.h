#ifndef KN_CLIENTS_FOLDER_H
#define KN_CLIENTS_FOLDER_H
// Where a sweep keeps its runs: the folder that --resume names, or one for temporary files that goes with the sweep.
//
//     folder/sweep     hashes of program, scene and log, so that no run is taken for another sweep's; a last line
//                      `temporary` in one that nobody asked to keep. Locked as long as the sweep is at work
//
// A sweep that was killed cannot remove its own folder. The next one does: whatever says `temporary`, is this user's
// and is not locked. The line is written under the lock, so a folder is never taken for a leftover while it comes to
// be.
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_folder {
    char path[PATH_MAX]; // "": none
    bool temporary;
    int lock; // descriptor of sweep, -1: none
} kn_folder;

// resume NULL: a temporary one, in $TMPDIR or /tmp. hashes: of program, scene, log. An exit code, after a complaint.
int kn_folder_open(kn_folder *folder, const char *resume, const uint64_t hashes[3]);
void kn_folder_close(kn_folder *folder); // removes a temporary one

// folder/name, its end being ending; "" when that is too long.
const char *kn_folder_path(const kn_folder *folder, const char *name, const char *ending, char path[PATH_MAX]);

#endif
