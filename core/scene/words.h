#ifndef KN_CORE_SCENE_WORDS_H
#define KN_CORE_SCENE_WORDS_H
// The words and numbers of a mesh file one after the other, written out or as bytes; whoever reads them need not care.
// Every function is false, and has put one line into error, when what it was to read is not there.
#include <stdbool.h>
#include <stddef.h>

#define KN_WORD_MAX 64 // bytes that are kept of a word, with the NUL

typedef struct kn_words {
    const char *name;           // of the file, for complaints
    const unsigned char *bytes; // not owned
    size_t size, at;
    size_t begun;        // where the last word or number began
    const char *section; // "$Nodes", for complaints
    bool binary;         // numbers are bytes, little-endian
    char *error;
    size_t error_size;
} kn_words;

typedef enum kn_width { KN_WIDTH_INT = 4, KN_WIDTH_LONG = 8 } kn_width; // bytes of an integer in a binary file

#define KN_WORDS_MAX_BYTES (256 << 20) // of a file

// The bytes of a file, or of a pipe; the caller frees them. NULL and one line in error when it cannot be read.
unsigned char *kn_words_load(const char *path, size_t *size, char *error, size_t error_size);

// "name:line:col: ..." of byte at; "name:1:1: byte at: ..." in a binary file. Always false.
__attribute__((format(printf, 3, 4))) bool kn_words_complain(kn_words *w, size_t at, const char *format, ...);

// The next word between white space; its whole length, 0 at the end of the file.
size_t kn_words_next(kn_words *w, char text[KN_WORD_MAX]);

// The next number. what: "the number of nodes", for complaints.
bool kn_words_integer(kn_words *w, kn_width width, long least, long most, long *value, const char *what);
bool kn_words_real(kn_words *w, double *value); // finite

// Whether count things of at least that many bytes each may still follow: asked before memory is taken for them.
bool kn_words_room(kn_words *w, long count, size_t each, const char *what);

// Binary data begins behind the line that announces it: takes the end of that line. In text there is nothing to take.
bool kn_words_line_end(kn_words *w);
// The word that ends the section, "$EndNodes".
bool kn_words_section_end(kn_words *w);

#endif
