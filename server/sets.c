#include "server/sets.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>

int kn_sets_list(const kn_sets *sets, char room[KN_SETS_BYTES], const char *list[KN_SETS_MAX])
{
    int count = 0;
    // cut the copy into strings at its newlines
    memcpy(room, sets->text, KN_SETS_BYTES);
    room[KN_SETS_BYTES - 1] = '\0';
    for (char *line = room, *end; count < KN_SETS_MAX && (end = strchr(line, '\n')); line = end + 1) {
        *end = '\0';
        list[count++] = line;
    }
    return count;
}

// Return whether a text is KEY=VALUE without control characters, which would break the lines.
static bool is_set(const char *set)
{
    const char *equals = strchr(set, '=');
    if (!equals || equals == set) return false;
    for (const char *c = set; *c; c++)
        if (iscntrl((unsigned char)*c)) return false;
    return true;
}

bool kn_sets_add(kn_sets *sets, const char *set, char *error, int error_size)
{
    char room[KN_SETS_BYTES];
    const char *list[KN_SETS_MAX];
    kn_sets more = {0};
    size_t key = strcspn(set, "=") + 1, at = 0;
    if (!is_set(set)) {
        snprintf(error, (size_t)error_size, "set '%.100s': expected KEY=VALUE", set);
        return false;
    }
    // copy all settings of other keys, then append the new one
    int count = kn_sets_list(sets, room, list), kept = 0;
    for (int i = 0; i < count; i++) {
        if (strncmp(list[i], set, key) == 0) continue;
        at += (size_t)sprintf(more.text + at, "%s\n", list[i]); // the line fits, because the text does not get longer
        kept++;
    }
    if (kept == KN_SETS_MAX || at + strlen(set) + 2 > sizeof more.text) {
        snprintf(error, (size_t)error_size, "set '%.100s': expected at most %d settings of %d bytes in all", set,
                 KN_SETS_MAX, KN_SETS_BYTES);
        return false;
    }
    sprintf(more.text + at, "%s\n", set);
    *sets = more;
    return true;
}
