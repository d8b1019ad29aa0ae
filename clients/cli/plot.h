#ifndef KN_CLIENTS_PLOT_H
#define KN_CLIENTS_PLOT_H
// Plots as PNG images. gnuplot runs as a child program and receives its script, which contains the data, through a
// pipe. plot.gp defines the look of all plots: fonts, colours, grid. The callers add curves, axes and texts.
#include <stdbool.h>
#include <stdio.h>

// Check that gnuplot is installed and that the file can be written. Call this before a long computation. Return 0, or
// print an error message that begins with the name of the subcommand and return an exit code.
int kn_plot_try(const char *subcommand, const char *path);

// Open a plot of `wide` x `high` pixels. Return the stream for its script; plot.gp is already written to it. On failure
// print one line that begins with the name of the subcommand, set *code and return NULL.
// gnuplot draws into memory, and kn_plot_close writes the image to the file. So the path appears neither in a shell
// command nor in a script, and a full disk is reported.
FILE *kn_plot_open(const char *subcommand, const char *path, int wide, int high, int *code);
// Close a plot and write its image to the file. Return 0, or print an error message and return an exit code.
int kn_plot_close(FILE *f, const char *subcommand, const char *path);

// Write text as a gnuplot string in single quotes. gnuplot takes every character in single quotes literally, except the
// quote itself, which is replaced by a prime.
void kn_plot_quote(FILE *f, const char *text);
// Write a label of the plot. what: "title", "xlabel" ...; text NULL: an empty label.
void kn_plot_label(FILE *f, const char *what, const char *text);
void kn_plot_panels(FILE *f, const char *title); // begin several panels below a common title

// Begin a legend below the panels of a plot that is `high` pixels high. The legend is the key of an additional plot
// without axes. It has `rows` rows of KN_PLOT_ROW pixels, and the caller adds its entries. objects: true if the panels
// contain gnuplot objects (rectangles, for example), which must not be drawn again in the legend.
#define KN_PLOT_ROW 22
void kn_plot_legend(FILE *f, bool objects, int rows, int high);

#define KN_PLOT_COLOURS 8
// Colours of the line types 1, 2, ... in plot.gp, as hexadecimal RGB such as "0072b2".
extern const char *const kn_plot_colour[KN_PLOT_COLOURS];

#endif
