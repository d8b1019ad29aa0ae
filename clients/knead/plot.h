#ifndef KN_CLIENTS_PLOT_H
#define KN_CLIENTS_PLOT_H
// A PNG drawn by gnuplot, which is run as a program: its script, with the data inside, goes through a pipe.
#include <stdio.h>

// Whether gnuplot is there and the file can be written, before the work that is to be drawn. An exit code, after a
// complaint.
int kn_plot_try(const char *subcommand, const char *path);

// Where the script goes, the terminal being the script's to set; NULL after a complaint in one line in the name of the
// subcommand, and then *code. gnuplot inherits the file as its standard output: no shell and no script sees the path.
FILE *kn_plot_open(const char *subcommand, const char *path, int *code);
int kn_plot_close(FILE *f, const char *subcommand, const char *path); // an exit code

// In single quotes gnuplot takes everything as it is, but them: a prime stands for one.
void kn_plot_quote(FILE *f, const char *text);

#endif
