#include "clients/identify/note.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>

bool kn_note_read(const char *text, int line, kn_note *note)
{
    const char *key = text + strspn(text, "# \t"), *mark = strpbrk(key, ":=");
    if (!mark || mark == key || mark - key >= (int)sizeof note->key) return false;
    const char *value = mark + 1 + strspn(mark + 1, " \t");
    *note = (kn_note){.line = line, .at = (int)(value - text) + 1};
    int n = 0, words = 1;
    // Copy the key in small letters and count its words.
    for (const char *p = key; p < mark; p++) {
        note->key[n++] = (char)tolower((unsigned char)*p);
        words += *p == ' ' && p[1] != ' ' && p + 1 < mark;
    }
    while (n > 0 && isspace((unsigned char)note->key[n - 1])) n--;
    note->key[n] = '\0';
    size_t length = strcspn(value, ";\t"); // spreadsheets fill up lines with separators, so cut the value there
    while (length > 0 && strchr(" ,", value[length - 1])) length--;
    snprintf(note->value, sizeof note->value, "%.*s", (int)length, value);
    for (char *p = note->value; *p; p++)
        // replace control characters, since the text is shown on terminals
        if ((unsigned char)*p < ' ' || *p == 0x7f) *p = '?';
    return words <= 3 && *note->value;
}
