#ifndef KN_CLIENTS_REPORT_REPORT_PAGE_H
#define KN_CLIENTS_REPORT_REPORT_PAGE_H
// A report (option --report DIR): a folder with index.html, the pictures of that page, and the files to which the page
// links. The page is plain HTML without scripts or external resources, for light and dark themes. Tables and pictures
// have descriptions for readers who cannot see them. The folder appears complete or not at all. A DIR that exists and
// is not empty is refused.
//
//     kn_document d;
//     int code = kn_document_open(&d, "identify creep", "out", "Creep of wheat dough", argc, argv);
//     kn_document_section(&d, "What was measured");
//     kn_document_text(&d, "%d curves of a cube of %g cm.", 5, 1.0);
//     kn_document_table(&d, "The material", "lrl", "number\tvalue\t95 % interval");
//     kn_document_row(&d, "k1\t%.4g Pa\t%.4g to %.4g", k1, low, high);
//     draw(kn_document_file(&d, "fit.png", path));
//     kn_document_picture(&d, "fit.png", "Strain over time: ...", "Points: measured. Lines: ...");
//     code = kn_document_close(&d, code);
//
// After Ctrl-C or SIGTERM, the program removes the unfinished folder and ends. The signal is checked at each section
// and when the report is closed.
//
// Callers pass plain text. The functions escape & and <, and replace invalid UTF-8. All functions do nothing after a
// failure, or if the document is not open (all fields 0). Callers thus need not check whether a report is requested.
#include "clients/cli/output.h"
#include <stdbool.h>
#include <stdio.h>

typedef enum kn_document_mood { KN_DOCUMENT_HOLDS, KN_DOCUMENT_BEWARE, KN_DOCUMENT_FAILS } kn_document_mood;

typedef struct kn_document {
    // all fields are private to report_page.c
    kn_output_folder batch;
    const char *subcommand;
    FILE *body; // stream into the memory `text`, which collects the page; NULL: the document is not open
    char *text;
    size_t size;
    char title[200], command[1000], columns[24]; // columns: alignment of each column of the present table
    int sections;
    char heading[24][80];
    bool in_table;
} kn_document;

// Open a report. If `folder` is NULL, no report is requested, and the document stays closed. The report states the
// command line `argc`, `argv`. Return 0, or print an error and return an exit code.
int kn_document_open(kn_document *d, const char *subcommand, const char *folder, const char *title, int argc,
                     char *const *argv);
// Close a report. If `code` is 0 or the exit code of a failed check, move the folder to its final place. Otherwise
// remove the folder. Return `code`, or the exit code of a failed write.
int kn_document_close(kn_document *d, int code);
bool kn_document_is_open(const kn_document *d);

void kn_document_section(kn_document *d, const char *heading); // the first 24 sections are in the table of contents
__attribute__((format(printf, 2, 3))) void kn_document_text(kn_document *d, const char *format, ...); // add a paragraph
// Add a paragraph that states how far to trust a result. `mood` is the judgement: the result holds, needs care, or
// fails. The page shows the judgement by a word, not by colour alone.
__attribute__((format(printf, 3, 4))) void kn_document_verdict(kn_document *d, kn_document_mood mood,
                                                               const char *format, ...);

// Begin a table. kn_document_row adds rows. The table ends when anything else is added to the report. `columns` aligns
// each column by one letter, l (left) or r (right). `head` holds the column headings. Tabs separate the cells of `head`
// and of a row. The first cell of a row is the row's name.
void kn_document_table(kn_document *d, const char *caption, const char *columns, const char *head);
__attribute__((format(printf, 2, 3))) void kn_document_row(kn_document *d, const char *format, ...);

// Write the path of the file `name` in the report's folder to `path`, which has PATH_MAX bytes, and return `path`. The
// path is empty if no report is requested.
const char *kn_document_file(const kn_document *d, const char *name, char path[PATH_MAX]);
// Add the PNG file `name` of the report's folder. `alt` describes the picture for readers who cannot see it. `caption`
// states what the picture means.
void kn_document_picture(kn_document *d, const char *name, const char *alt, const char *caption);
void kn_document_link(kn_document *d, const char *name, const char *words); // add a link to a file in the folder

// ---- plots (plot_panels.c)
//
// Plots that compare measured values with those of a model. A plot consists of panels with points and lines, and is
// drawn by clients/cli/plot.h.
//
//     kn_figure_panel p = {.x_label = "time, s", .y_label = "strain"};
//     kn_figure_add(&p, (kn_figure_series){"50 gf", n, time_s, strain, .look = KN_FIGURE_POINTS, .hue = 1});
//     kn_figure_add(&p, (kn_figure_series){"fit", n, time_s, fitted, .look = KN_FIGURE_LINE, .hue = 1});
//     code = kn_figure_draw("identify creep", "fit.png", "dough", &p, 1, 1);

#define KN_FIGURE_SERIES 72 // largest number of series in a panel: points and a line for each of 32 curves, and 8 more

typedef enum kn_figure_look { KN_FIGURE_POINTS, KN_FIGURE_LINE, KN_FIGURE_DASHES } kn_figure_look;

typedef struct kn_figure_series {
    const char *name; // name in the legend; NULL: the series is not in the legend
    int count;        // number of values in x[] and in y[]
    // values owned by the caller; both arrays must stay valid until kn_figure_draw returns. A point is not drawn if a
    // value is not finite, or is not above 0 on a logarithmic axis.
    const double *x, *y;
    double x_scale, y_scale; // factors on x and y; 0 means 1
    kn_figure_look look;
    int hue; // colour: number of a line type of plot.gp, from 1 on; the colours repeat after 8; 0: black
} kn_figure_series;

typedef struct kn_figure_panel {
    const char *title, *x_label, *y_label; // title NULL: the panel has no title
    bool log_x, log_y;                     // whether the axis is logarithmic
    double band;                           // a grey band is drawn from y = -band to y = band; 0: no band
    int series;                            // number of series in of[]
    kn_figure_series of[KN_FIGURE_SERIES];
} kn_figure_panel;

void kn_figure_add(kn_figure_panel *panel, kn_figure_series series); // series beyond KN_FIGURE_SERIES are ignored

// Draw the panels to the PNG file `path`, in rows of `across` panels. If a panel has at most four names, its legend is
// in the corner with the fewest points. If a panel has more names, one common legend is drawn below all panels. Return
// 0, or print an error and return an exit code.
int kn_figure_draw(const char *subcommand, const char *path, const char *title, const kn_figure_panel *panel,
                   int panels, int across);

#endif
