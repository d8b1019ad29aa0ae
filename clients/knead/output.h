#ifndef KN_CLIENTS_OUTPUT_H
#define KN_CLIENTS_OUTPUT_H
// Checks of output files before a long computation: can a file be written, and do two paths name the same file.
#include <stdbool.h>

// Try to open path for writing. An existing file keeps its contents, and a file that did not exist is removed again.
// Return 0, or print an error message that begins with the name of the subcommand and return an exit code.
int kn_output_try(const char *subcommand, const char *path);

// Return true if path `b` equals path `a` or lies inside the folder `a`. Neither path has to exist.
bool kn_output_holds(const char *a, const char *b);

// Return true if both paths lead to the same file, whether the file exists yet or not. Return false if either is NULL.
bool kn_output_same(const char *a, const char *b);

#endif
