#ifndef KN_CLIENTS_OUTPUT_H
#define KN_CLIENTS_OUTPUT_H
// A file that will be written after hours of work: whether it can be, before them.
#include <stdbool.h>

// Leaves what is there as it is, and nothing where nothing was. An exit code, after a complaint.
int kn_output_try(const char *subcommand, const char *path);

// Whether both lead to one file that is there. NULL is none.
bool kn_output_same(const char *a, const char *b);

#endif
