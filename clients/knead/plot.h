#ifndef KN_CLIENTS_PLOT_H
#define KN_CLIENTS_PLOT_H
// A PNG drawn by gnuplot, which is run as a program: its script, with the data inside, goes through a pipe. plot.gp is
// the look of all of them: fonts, colours, grid; what follows has curves, axes and words.
#include <stdio.h>

// Whether gnuplot is there and the file can be written, before the work that is to be drawn. An exit code, after a
// complaint.
int kn_plot_try(const char *subcommand, const char *path);

// Where the script of a picture of so many pixels goes, plot.gp being in it already; NULL after a complaint in one line
// in the name of the subcommand, and then *code. No shell and no script sees the path: gnuplot draws into
// memory, and what it has drawn is written when the plot is closed, so that a full disk is told.
FILE *kn_plot_open(const char *subcommand, const char *path, int wide, int high, int *code);
int kn_plot_close(FILE *f, const char *subcommand, const char *path); // an exit code

// In single quotes gnuplot takes everything as it is, but them: a prime stands for one.
void kn_plot_quote(FILE *f, const char *text);

#define KN_PLOT_COLOURS 8
extern const char *const kn_plot_colour[KN_PLOT_COLOURS]; // those of plot.gp's line types 1.., "0072b2"

#endif
