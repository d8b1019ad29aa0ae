#ifndef KN_CLIENTS_OUTPUT_FOLDER_H
#define KN_CLIENTS_OUTPUT_FOLDER_H
// A folder of files that appears only when it is complete. The folder is filled under a temporary name in the same
// parent folder and then renamed to its final path.
//
//     kn_output_folder_open -> write files into batch.folder -> kn_output_folder_keep, or kn_output_folder_drop
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_output_folder {
    char path[PATH_MAX - 256], folder[PATH_MAX - 256];
} kn_output_folder;

// Create the temporary folder. If the path exists, it must be an empty folder: existing files are never replaced. On
// failure return false with one sentence in error. `*taken` becomes true if a file or a folder that is not empty exists
// at the path.
bool kn_output_folder_open(kn_output_folder *batch, const char *path, bool *taken, char *error, size_t error_size);

// Rename the folder to its final path and end the batch. On failure remove the folder and return false with one
// sentence in error. Do nothing and return true if the batch is not open (all zero).
bool kn_output_folder_keep(kn_output_folder *batch, char *error, size_t error_size);
// Remove the folder with its files and end the batch. Do nothing if the batch is not open (all zero).
void kn_output_folder_drop(kn_output_folder *batch);

#endif
