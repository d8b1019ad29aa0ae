#ifndef KN_CLIENTS_OUTPUT_H
#define KN_CLIENTS_OUTPUT_H
// A file that will be written after hours of work: whether it can be, before them.
#include <stdbool.h>

// Leaves what is there as it is, and nothing where nothing was. An exit code, after a complaint.
int kn_output_try(const char *subcommand, const char *path);

// Whether b is a, or is in it, by what their folders are; neither need be there.
bool kn_output_holds(const char *a, const char *b);

// Whether both lead to one file, be it there or not yet. NULL is none.
bool kn_output_same(const char *a, const char *b);

#endif
