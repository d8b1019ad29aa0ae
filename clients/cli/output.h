#ifndef KN_CLIENTS_OUTPUT_H
#define KN_CLIENTS_OUTPUT_H
// Files of results. Before a long computation, check that the files can be written and are different. Then write them.
#include "clients/viewer/beside.h"
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

// Try to open path for writing. An existing file keeps its contents, and a file that did not exist is removed again.
// Return 0, or print an error message that begins with the name of the subcommand and return an exit code.
int kn_output_try(const char *subcommand, const char *path);

// Return true if path `b` equals path `a` or lies inside the folder `a`. Neither path has to exist.
bool kn_output_holds(const char *a, const char *b);

// Return true if both paths lead to the same file, whether the file exists yet or not. Return false if either is NULL.
bool kn_output_same(const char *a, const char *b);

// Open a file of results for writing. The file appears under its name, complete, when kn_output_close is called
// (kn_beside_write). Return the stream, which is also out->file. On failure print an error message that begins with the
// name of the subcommand, and return NULL.
FILE *kn_output_open(kn_beside *out, const char *subcommand, const char *path);
// Close the file. Return 0, or print an error message and return an exit code.
int kn_output_close(kn_beside *out, const char *subcommand);

// Return 1 if nothing exists at `path`, or if it is an empty folder. Return 0 if it is a folder with files, and -1 if
// it is not a folder.
int kn_output_empty(const char *path);

// A folder of files that appears only when it is complete. The folder is filled under a temporary name in the same
// parent folder and then renamed to its final path.
//
//     kn_output_folder_open -> write files into batch.folder -> kn_output_folder_keep, or kn_output_folder_drop
typedef struct kn_output_folder {
    char path[PATH_MAX - 256], folder[PATH_MAX - 256];
} kn_output_folder;

// Create the temporary folder. If `path` is a file or a folder that is not empty, set *taken to true and fail, because
// existing files are never replaced. On any failure return false with one sentence in error.
bool kn_output_folder_open(kn_output_folder *batch, const char *path, bool *taken, char *error, size_t error_size);

// Rename the temporary folder to its final path. On failure remove the folder and return false with one sentence in
// error. Do nothing and return true if no folder is open (all fields are zero).
bool kn_output_folder_keep(kn_output_folder *batch, char *error, size_t error_size);
// Remove the temporary folder with its files. Do nothing if no folder is open (all fields are zero).
void kn_output_folder_drop(kn_output_folder *batch);

#endif
