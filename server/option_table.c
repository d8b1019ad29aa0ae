#include "server/option_table.h"
#include "core/scene/keys.h"
#include "core/scene/units.h"
#include <assert.h>
#include <getopt.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WORDS_MAX = 200 }; // largest length of the text that describes a valid value, bytes

// Values that getopt_long returns: FIRST + i for row i of the table. They are greater than any letter.
enum { FIRST = 256, HELP = FIRST + KN_OPTIONS_MAX, VERSION };

bool kn_quantity_read(const char *text, const char *unit_text, bool bare, double least, double most, double *value)
{
    kn_unit unit = {0};
    kn_quantity q;
    char why[128];
    if (*unit_text && !kn_unit_parse(&unit, unit_text, why, sizeof why)) return false;
    if (!kn_quantity_parse(&q, text, why, sizeof why)) return false;
    if (q.bare ? !bare : !*unit_text || !kn_unit_same_dimension(&q.unit, &unit)) return false;
    *value = kn_quantity_in(&q, &unit);
    return *value >= least && *value <= most;
}

bool kn_number_take(const char *text, double low, double high, double *value)
{
    // The quantity parser allows blanks in the text, but an option must not contain any.
    return !strchr(text, ' ') && kn_quantity_read(text, "", true, low, high, value);
}

static bool take_integer(const kn_option *o, const char *text, int *value)
{
    char *end;
    const long number = strtol(text, &end, 10);
    *value = (int)number;
    return end != text && !*end && (double)number >= o->least && (double)number <= o->most;
}

// Append a text to a list of texts. Return false if the list is full, or if the row's `map` refuses the text.
static bool take_text(const kn_option *o, const char *text, void *field, int *count)
{
    if (o->most > 0 && *count == (int)o->most) return false;
    if (o->map && !(text = o->map(text))) return false;
    (o->most > 0 ? (const char **)field : *(const char ***)field)[(*count)++] = text;
    return true;
}

// Store the value `text` of an option in the struct. Return false if the value is invalid.
static bool store(const kn_option *o, char *to, const char *text)
{
    void *field = to + o->offset;
    const bool positive = o->least == 0 && o->most == 0; // no range is given: the number must be above 0
    const double least = positive ? KN_ABOVE_0 : o->least, most = positive ? DBL_MAX : o->most;
    int index = 0;
    switch (o->kind) {
    case KN_OPTION_FLAG: return *(bool *)field = true;
    case KN_OPTION_CALL:
    case KN_OPTION_ANSWER: return o->call(), true;
    case KN_OPTION_TEXT: return *(const char **)field = text, true;
    case KN_OPTION_NUMBER: return kn_number_take(text, least, most, field);
    case KN_OPTION_INTEGER: return take_integer(o, text, field);
    case KN_OPTION_QUANTITY:
        return kn_quantity_read(text, o->unit, !strcmp(o->unit, "s") || !strcmp(o->unit, "1"), least, most, field);
    case KN_OPTION_CHOICE: return (*(int *)field = kn_choice_of(o->unit, text)) >= 0;
    case KN_OPTION_EITHER: index = kn_choice_of(o->unit, text); return *(bool *)field = index == 1, index >= 0;
    default: return take_text(o, text, field, (int *)(void *)(to + o->count));
    }
}

// Return the text that describes a valid value: `expected` of the row, or "a, b or c" for a choice, or "1 to 10" for a
// number.
static const char *expectation(const kn_option *o, char text[WORDS_MAX])
{
    if (o->expected) return o->expected;
    if (o->kind != KN_OPTION_CHOICE && o->kind != KN_OPTION_EITHER) {
        snprintf(text, WORDS_MAX, "%g to %g", o->least, o->most);
        return text;
    }
    size_t n = 0;
    for (const char *word = o->unit; *word && n + 1 < WORDS_MAX; word++) {
        const char *between = *word != '|' ? (char[]){*word, 0} : strchr(word + 1, '|') ? ", " : " or ";
        n += (size_t)snprintf(text + n, WORDS_MAX - n, "%s", between);
    }
    return text;
}

// Store the value of an option in the struct. Return NULL on success; otherwise return the text after "expected" in the
// message.
static const char *take(const kn_option *o, char *to, const char *text, char made[WORDS_MAX])
{
    if (o->kind != KN_OPTION_SPECIAL) return store(o, to, text) ? NULL : expectation(o, made);
    const char *expected = o->take(to + o->offset, text);
    return expected && o->expected ? o->expected : expected;
}

// Store a list of values, separated by commas, in the struct. Return NULL on success; otherwise return the text after
// "expected" in the message.
static const char *take_items(const kn_option *o, char *to, const char *text, char made[WORDS_MAX])
{
    kn_option item = *o;
    int *count = (int *)(void *)(to + o->count);
    for (*count = 0; *count < o->items; text++) {
        char one[64];
        const size_t n = strcspn(text, ",");
        if (snprintf(one, sizeof one, "%.*s", (int)n, text) >= (int)sizeof one) break;
        ++*count;
        const char *expected = take(&item, to, one, made);
        text += n;
        if (expected || !*text) return expected;
        item.offset += o->kind == KN_OPTION_INTEGER || o->kind == KN_OPTION_CHOICE ? sizeof(int) : sizeof(double);
    }
    return o->expected;
}

// Fill in getopt_long's lists of long and of short options.
static void describe(const kn_option_table *t, struct option *list, char *letters)
{
    int n = 0;
    assert(t->options <= KN_OPTIONS_MAX);
    letters += sprintf(letters, "%s:h", t->options_first ? "+" : "");
    for (int i = 0; i < t->options; i++) {
        const kn_option *o = &t->option[i];
        const bool value = o->kind > KN_OPTION_RENAMED;
        list[n++] = (struct option){o->name, o->kind == KN_OPTION_RENAMED ? optional_argument : value, NULL, FIRST + i};
        if (o->letter) letters += sprintf(letters, "%c%s", o->letter, value ? ":" : "");
    }
    list[n++] = (struct option){"help", 0, NULL, HELP};
    if (t->version) list[n++] = (struct option){"version", 0, NULL, VERSION};
}

// Return the argument at which getopt_long stopped. In a group of letters like "-xy", optind stays at the group until
// its last letter has been read. Otherwise optind is behind the option, and behind its value if the value is an
// argument of its own.
static const char *stopped_at(int c, char *const *argv)
{
    const char *last = argv[optind - 1];
    if (c == '?' && optopt > 0 && optopt < FIRST) // getopt_long stopped at an unknown single-letter option
        return last[0] == '-' && last[1] != '-' && last[strlen(last) - 1] == optopt ? last : argv[optind];
    return c != '?' && c != ':' && optarg == last ? argv[optind - 2] : last;
}

// Print the message on a mistake in the command line. Return the exit code.
__attribute__((format(printf, 2, 3))) static int refuse(const char *program, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fprintf(stderr, "%s: ", program);
    vfprintf(stderr, format, args);
    fputc('\n', stderr);
    va_end(args);
    return 2;
}

// Return true if this command has the option.
static bool has(const kn_option_table *t, const kn_option *o)
{
    return !o->belongs || strchr(o->belongs, t->experiment);
}

// Refuse an argument at which getopt_long stopped: an option without its value, with a value too many, or unknown.
static int refuse_option(const kn_option_table *t, const char *program, int c, const char *text)
{
    if (c == ':') return refuse(program, "%s: expected a value", text);
    if (c == '?' && optopt >= FIRST) return refuse(program, "%s: expected no value", text);
    // Look for options that begin with the text, and for the most similar option.
    char name[64], list[WORDS_MAX] = "";
    const char *nearest = NULL;
    int edits = 0, begin = 0, n = 0;
    snprintf(name, sizeof name, "%.*s", (int)strcspn(text, "="), text);
    for (int i = 0; i < t->options && !strncmp(name, "--", 2); i++) {
        const kn_option *o = &t->option[i];
        if (!has(t, o) || o->kind == KN_OPTION_RENAMED) continue;
        if (!strncmp(o->name, name + 2, strlen(name + 2)) && n < WORDS_MAX)
            n += snprintf(list + n, WORDS_MAX - (size_t)n, "%s--%s", begin++ ? ", " : "", o->name);
        if (kn_word_nearer(name + 2, o->name, &edits)) nearest = o->name;
    }
    if (begin > 1) return refuse(program, "%s: could be any of %s", name, list);
    if (nearest) return refuse(program, "%s: unknown option; did you mean --%s?", text, nearest);
    return refuse(program, "%s: unknown option; --help lists them", text);
}

int kn_options_read(const kn_option_table *t, void *to, int argc, char **argv)
{
    struct option list[KN_OPTIONS_MAX + 3] = {{0}};
    char letters[2 * KN_OPTIONS_MAX + 4], made[WORDS_MAX];
    const char *program = t->program ? t->program : argv[0];
    describe(t, list, letters);
    optind = 0; // restart getopt, because a process may read several command lines
    for (int c; (c = getopt_long(argc, argv, letters, list, NULL)) != -1;) {
        // Replace the letter of a short option by FIRST + i, where i is the row of the option in the table.
        for (int i = 0; i < t->options; i++)
            if (c == t->option[i].letter) c = FIRST + i;
        if (c == VERSION) return puts(t->version), 0;
        if (c == HELP || c == 'h') return t->print_help ? t->print_help() : (void)fputs(t->help, stdout), 0;
        const kn_option *o = c >= FIRST ? &t->option[c - FIRST] : NULL;
        if (!o || !has(t, o)) return refuse_option(t, program, c, stopped_at(c, argv));
        if (o->kind == KN_OPTION_RENAMED) return refuse(program, "--%s is now %s", o->name, o->expected);
        if (optarg && !*optarg) return refuse(program, "--%s '': expected a value", o->name);
        if (o->given) *(bool *)((char *)to + o->given) = true;
        const char *expected = (o->items ? take_items : take)(o, to, optarg, made);
        if (expected && !*expected) return 2; // the message has already been printed
        if (expected) return refuse(program, "--%s %s: expected %s", o->name, optarg, expected);
        if (o->kind == KN_OPTION_ANSWER) return 0;
    }
    return KN_OPTIONS_READ;
}
