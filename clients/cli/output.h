#ifndef KN_CLIENTS_OUTPUT_H
#define KN_CLIENTS_OUTPUT_H
// Files of results: check before a long computation that they can be written and are different files, and write them.
#include "clients/viewer/beside.h"

// Try to open path for writing. An existing file keeps its contents, and a file that did not exist is removed again.
// Return 0, or print an error message that begins with the name of the subcommand and return an exit code.
int kn_output_try(const char *subcommand, const char *path);

// Return true if path `b` equals path `a` or lies inside the folder `a`. Neither path has to exist.
bool kn_output_holds(const char *a, const char *b);

// Return true if both paths lead to the same file, whether the file exists yet or not. Return false if either is NULL.
bool kn_output_same(const char *a, const char *b);

// Open a file of results, which appears whole when kn_output_close puts it in place (kn_beside_write). Return the stream,
// which is also out->file, or print an error message that begins with the name of the subcommand and return NULL.
FILE *kn_output_open(kn_beside *out, const char *subcommand, const char *path);
// Close the file. Return 0, or print an error message and return an exit code.
int kn_output_close(kn_beside *out, const char *subcommand);

#endif
