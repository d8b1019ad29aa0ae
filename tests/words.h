#ifndef KN_TESTS_WORDS_H
#define KN_TESTS_WORDS_H
// A list of short inputs as one text: "udpm://|tcpq://localhost:7700|memq://".
#include <stdlib.h>
#include <string.h>

// Return word number n of a text whose words are separated by `|`, or NULL behind the last word. A word may be empty.
// It is valid until the next call.
static inline const char *word_of(const char *text, int n)
{
    static char word[1000];
    for (; text && n > 0; n--) text = strchr(text, '|') ? strchr(text, '|') + 1 : NULL;
    if (!text) return NULL;
    size_t size = strcspn(text, "|");
    if (size >= sizeof word) abort();
    word[size] = '\0';
    return memcpy(word, text, size);
}

#endif
