#ifndef KN_CLIENTS_IDENTIFY_DOCUMENT_H
#define KN_CLIENTS_IDENTIFY_DOCUMENT_H
// A report, --report DIR: a folder with index.html, its pictures, and the files it links to. The page is plain HTML
// without scripts or external resources, for light and dark themes. Tables and pictures have descriptions for readers
// who cannot see them. The folder appears complete or not at all. A folder that is not empty is refused.
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
// Ctrl-C or a plain kill removes the unfinished folder. The signal is checked at each section and at the end.
//
// Callers pass plain text; the functions escape &, < and invalid UTF-8. All functions do nothing after a failure or if
// the document is not open (all 0). Callers thus need not check if a report is wanted.
#include "clients/knead/batch.h"
#include <stdbool.h>
#include <stdio.h>

typedef enum kn_document_mood { KN_DOCUMENT_HOLDS, KN_DOCUMENT_BEWARE, KN_DOCUMENT_FAILS } kn_document_mood;

typedef struct kn_document {
    // private
    kn_batch batch;
    const char *subcommand;
    FILE *body; // stream into memory; NULL: not open
    char *text;
    size_t size;
    char title[200], command[1000], columns[24]; // columns: alignment of the columns of the open table
    int sections;
    char heading[24][80];
    bool in_table, failed;
} kn_document;

// Open a report. folder NULL: no report is wanted, and the document stays closed. argc and argv are the command line.
// Return an exit code, after a complaint.
int kn_document_open(kn_document *d, const char *subcommand, const char *folder, const char *title, int argc,
                     char *const *argv);
// Move the folder to its final place if `code` is 0 or says that a check failed, else remove the folder. Return `code`,
// or the exit code of a failed write.
int kn_document_close(kn_document *d, int code);
bool kn_document_is_open(const kn_document *d);

void kn_document_section(kn_document *d, const char *heading); // the first 24 are in the table of contents
__attribute__((format(printf, 2, 3))) void kn_document_text(kn_document *d, const char *format, ...); // a paragraph
// Add a paragraph that states how far to trust a result, marked by a word and not by colour alone.
__attribute__((format(printf, 3, 4))) void kn_document_verdict(kn_document *d, kn_document_mood mood,
                                                               const char *format, ...);

// Begin a table. Rows follow until anything else is added. `columns`: one letter for each column, l (left) or r
// (right). `head`: the column headings. Tabs separate the cells. The first cell is the row's name.
void kn_document_table(kn_document *d, const char *caption, const char *columns, const char *head);
__attribute__((format(printf, 2, 3))) void kn_document_row(kn_document *d, const char *format, ...);

// Return the path for a file of this name in the folder. path: PATH_MAX bytes; empty if no report is wanted.
const char *kn_document_file(const kn_document *d, const char *name, char path[PATH_MAX]);
// Add a PNG that was written to this path. alt: what it shows, for readers who cannot see it; caption: what it means.
void kn_document_picture(kn_document *d, const char *name, const char *alt, const char *caption);
void kn_document_link(kn_document *d, const char *name, const char *words); // link to a file in the folder

#endif
