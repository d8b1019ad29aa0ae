#ifndef KN_CLIENTS_BATCH_H
#define KN_CLIENTS_BATCH_H
// A folder of files that appears whole: filled beside its path under a name that nobody has, then renamed.
//
//     kn_batch_open -> write files into .folder -> kn_batch_keep, or kn_batch_drop
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_batch {
    char path[PATH_MAX - 256], folder[PATH_MAX - 256];
} kn_batch;

// One that is there must be an empty folder: nothing of anybody's is replaced. False and one sentence in error; *taken
// then says whether it is that.
bool kn_batch_open(kn_batch *batch, const char *path, bool *taken, char *error, size_t error_size);

// Either one ends it; of one that is not open (all 0) nothing happens. False: one sentence in error, and it is gone.
bool kn_batch_keep(kn_batch *batch, char *error, size_t error_size);
void kn_batch_drop(kn_batch *batch); // with the files in it

#endif
