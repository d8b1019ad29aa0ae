#include "server/option_table.h"
#include "core/scene/keys.h"
#include "core/scene/units.h"
#include <assert.h>
#include <getopt.h>
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

static const char digits[] = "0123456789";

bool kn_number_pair(const char *text, int *first, int *second)
{
    const size_t n = strspn(text, digits);
    if (n < 1 || n > 5 || text[n] != 'x') return false;
    const char *next = text + n + 1;
    const size_t m = strspn(next, digits);
    if (m < 1 || m > 5 || next[m]) return false;
    *first = atoi(text);
    *second = atoi(next);
    return true;
}

static bool take_real(const char *text, double least, double most, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return end != text && !*end && *value >= least && *value <= most;
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
    case KN_OPTION_SET: return *(int *)field = (int)o->least, true;
    case KN_OPTION_CALL:
    case KN_OPTION_ANSWER: return o->call(), true;
    case KN_OPTION_TEXT: return *(const char **)field = text, *text || !o->expected;
    case KN_OPTION_NUMBER: return kn_number_take(text, least, most, field);
    case KN_OPTION_REAL: return take_real(text, least, most, field);
    case KN_OPTION_INTEGER: return take_integer(o, text, field);
    case KN_OPTION_DIGITS:
        index = (int)strspn(text, digits);
        return index >= 1 && index <= 7 && !text[index] && take_integer(o, text, field);
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
    letters += sprintf(letters, "%s%s%s", t->options_first ? "+" : "", t->unknown ? ":" : "", t->short_help ? "h" : "");
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

// Return true if the message contains a place in a file, like "scene.yaml:14:9: ".
static bool has_place(const char *text)
{
    for (const char *at = text; (at = strchr(at, ':')); at++) {
        int length = 0;
        // sscanf sets length only if the whole pattern matched.
        if (sscanf(at, ":%*[0-9]:%*[0-9]:%n", &length) == 0 && length > 0 && at[length] == ' ') return true;
    }
    return false;
}

void kn_message_print(const char *program, bool always_named, const char *format, va_list args)
{
    char text[16384]; // room for a value as long as four file paths
    vsnprintf(text, sizeof text, format, args);
    // If the message begins with a place in a file, print no prefix, so that the place stays at the beginning of the
    // line.
    if (!always_named && has_place(text)) fprintf(stderr, "%s\n", text);
    else fprintf(stderr, "%s: %s\n", program, text);
}

// Print the message on a mistake in the command line. Return the exit code.
__attribute__((format(printf, 3, 4))) static int refuse(const kn_option_table *t, const char *program,
                                                        const char *format, ...)
{
    va_list args;
    va_start(args, format);
    kn_message_print(program, t->always_named, format, args);
    va_end(args);
    return 2;
}

static int answer_help(const kn_option_table *t)
{
    if (t->print_help) t->print_help();
    else fputs(t->help, stdout);
    return 0;
}

int kn_options_read(const kn_option_table *t, void *to, int argc, char **argv)
{
    struct option list[KN_OPTIONS_MAX + 3] = {{0}};
    char letters[2 * KN_OPTIONS_MAX + 4], made[WORDS_MAX];
    const char *program = t->program ? t->program : argv[0];
    bool help = false;
    describe(t, list, letters);
    optind = 0; // restart getopt, because a process may read several command lines
    for (int c; (c = getopt_long(argc, argv, letters, list, NULL)) != -1;) {
        // Replace the letter of a short option by FIRST + i, where i is the row of the option in the table.
        for (int i = 0; i < t->options; i++)
            if (c == t->option[i].letter) c = FIRST + i;
        if (c == '?' && !t->unknown) return 2; // getopt_long has printed the reason
        if (c == VERSION) return puts(t->version), 0;
        if ((c == HELP || c == 'h') && !t->help_last) return answer_help(t);
        if (c == HELP || c == 'h') {
            help = true;
            continue;
        }
        const kn_option *o = c >= FIRST ? &t->option[c - FIRST] : NULL;
        // If only other commands have this option (`belongs`), refuse it as unknown.
        if (!o || (o->belongs && !strchr(o->belongs, t->experiment)))
            return refuse(t, program, "%s: %s", stopped_at(c, argv), c == ':' ? "expected a value" : t->unknown);
        if (o->kind == KN_OPTION_RENAMED) return refuse(t, program, "--%s is now %s", o->name, o->expected);
        if (t->no_empty && optarg && !*optarg) return refuse(t, program, "--%s '': expected a value", o->name);
        if (o->given) *(bool *)((char *)to + o->given) = true;
        const char *expected = (o->items ? take_items : take)(o, to, optarg, made), *quote = t->quotes ? "'" : "";
        if (expected && !*expected) return 2; // the message has already been printed
        if (expected && t->value_first) return refuse(t, program, "%s: expected %s", optarg, expected);
        if (expected) return refuse(t, program, "--%s %s%s%s: expected %s", o->name, quote, optarg, quote, expected);
        if (o->kind == KN_OPTION_ANSWER) return 0;
    }
    return help ? answer_help(t) : KN_OPTIONS_READ;
}
