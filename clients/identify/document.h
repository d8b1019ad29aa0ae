#ifndef KN_CLIENTS_IDENTIFY_DOCUMENT_H
#define KN_CLIENTS_IDENTIFY_DOCUMENT_H
// --report DIR: what was found, for eyes: a folder with index.html, its pictures, and the files that it names. The page
// is plain HTML, no script, nothing from elsewhere; light and dark; tables and pictures say what they are to a reader
// who does not see them. The folder appears whole, or not at all; one that is not empty is refused.
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
// Ctrl-C or a plain kill takes the unfinished folder away: looked for at each section and at the end.
//
// Text goes in as it is: &, < and what is no UTF-8 are taken care of. After a failure, and of one that is not open (all
// 0), all do nothing, so that callers need not ask whether a report is wanted.
#include "clients/knead/batch.h"
#include <stdbool.h>
#include <stdio.h>

typedef enum kn_document_mood { KN_DOCUMENT_HOLDS, KN_DOCUMENT_BEWARE, KN_DOCUMENT_FAILS } kn_document_mood;

typedef struct kn_document {
    // private
    kn_batch batch;
    const char *subcommand;
    FILE *body; // into memory; NULL: not open
    char *text;
    size_t size;
    char title[200], command[1000], columns[24]; // of the open table
    int sections;
    char heading[24][80];
    bool in_table, failed;
} kn_document;

// folder NULL: none is wanted; the document is then not open. An exit code, after a complaint. argc, argv: what was
// typed.
int kn_document_open(kn_document *d, const char *subcommand, const char *folder, const char *title, int argc,
                     char *const *argv);
// Into its place if code is ok or a check failed, else dropped. Returns code, or why it could not be written.
int kn_document_close(kn_document *d, int code);
bool kn_document_is_open(const kn_document *d);

void kn_document_section(kn_document *d, const char *heading); // at most 24 stand in the list of contents
__attribute__((format(printf, 2, 3))) void kn_document_text(kn_document *d, const char *format, ...); // a paragraph
// A paragraph that says how far to trust, with a word for it, not by colour alone.
__attribute__((format(printf, 3, 4))) void kn_document_verdict(kn_document *d, kn_document_mood mood,
                                                               const char *format, ...);

// Rows follow until anything else does. columns: l or r for each; cells are separated by tabs; the first is the row's
// name.
void kn_document_table(kn_document *d, const char *caption, const char *columns, const char *head);
__attribute__((format(printf, 2, 3))) void kn_document_row(kn_document *d, const char *format, ...);

// Where to write a file of that name, so that it is in the folder. path: PATH_MAX; empty where none is wanted.
const char *kn_document_file(const kn_document *d, const char *name, char path[PATH_MAX]);
// A PNG that has been written there. alt: what it shows, for who cannot see it; caption: what it means.
void kn_document_picture(kn_document *d, const char *name, const char *alt, const char *caption);
void kn_document_link(kn_document *d, const char *name, const char *words); // to such a file

#endif
