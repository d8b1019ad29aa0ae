#ifndef KN_CORE_SCENE_WORDS_H
#define KN_CORE_SCENE_WORDS_H
// The words and numbers of a mesh file, one after the other. Numbers may be text or bytes; the caller does not see the
// difference. Every function returns false with one line in error if the expected item is not there.
#include <stdbool.h>
#include <stddef.h>

#define KN_WORD_MAX 64 // size of the buffer for a word, NUL included [bytes]; longer words are cut

typedef struct kn_words {
    const char *name;           // name of the file, for error messages
    const unsigned char *bytes; // contents of the file, not owned
    size_t size, at;            // number of bytes; position of the next byte to read
    size_t begun;               // position of the last word or number that was read
    const char *section;        // section that is being read, e.g. "$Nodes", for error messages
    bool binary;                // numbers are stored in binary, little-endian
    char *error;
    size_t error_size;
} kn_words;

typedef enum kn_width { KN_WIDTH_INT = 4, KN_WIDTH_LONG = 8 } kn_width; // bytes of an integer in a binary file

#define KN_WORDS_MAX_BYTES (256 << 20) // largest size of a file

// Return the bytes of a file or pipe; the caller frees them. Return NULL with one line in error if it cannot be read.
unsigned char *kn_words_load(const char *path, size_t *size, char *error, size_t error_size);

// Write an error about the byte at `at`: "name:line:col: ...", or "name:1:1: byte at: ..." in a binary file. Always
// return false.
__attribute__((format(printf, 3, 4))) bool kn_words_complain(kn_words *w, size_t at, const char *format, ...);

// Read the next word between white space into `text`. Return the word's full length, 0 at the end of the file.
size_t kn_words_next(kn_words *w, char text[KN_WORD_MAX]);

// Read the next number. `what`: description for error messages, e.g. "the number of nodes".
bool kn_words_integer(kn_words *w, kn_width width, long least, long most, long *value, const char *what);
bool kn_words_real(kn_words *w, double *value); // the number must be finite

// Check that the file still has at least `count` times `each` bytes for `count` items. Call before allocating memory
// for them.
bool kn_words_room(kn_words *w, long count, size_t each, const char *what);

// Read the end of the line that announces binary data; the data begins behind it. In text, do nothing.
bool kn_words_line_end(kn_words *w);
// Read the word that ends the section, "$EndNodes".
bool kn_words_section_end(kn_words *w);

#endif
