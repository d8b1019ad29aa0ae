#ifndef KN_SERVER_OPTION_TABLE_H
#define KN_SERVER_OPTION_TABLE_H
// Command lines as tables. A row says which values an option accepts and where the value goes:
//
//     KN_OPTION("zoom", NUMBER, .offset = offsetof(options, zoom), .expected = "0.2..20", KN_RANGE(0.2, 20)),
//
// kn_options_read stores the options of a command line in a struct. getopt_long splits the line, so an option may be
// shortened, `--zoom 2` and `--zoom=2` are equal, and `--` ends the options. A mistake is one line on stderr:
//
//     knead view: --zoom 30: expected 0.2..20
//
// The table stands in server, because kneadd has a command line too, and server must not depend on clients.
#include <float.h>
#include <getopt.h> // for optind
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>

#define KN_OPTION(text, type, ...)                                                                                     \
    {                                                                                                                  \
        .name = text, .kind = KN_OPTION_##type, __VA_ARGS__                                                            \
    }
#define KN_RANGE(low, high) .least = low, .most = high
#define KN_ABOVE_0 DBL_TRUE_MIN          // least value of a range that begins above 0
#define KN_BELOW_1 (1 - DBL_EPSILON / 2) // largest value of a range that ends below 1

typedef enum kn_option_kind { // type of the field, and values
    KN_OPTION_FLAG,           // bool: true if the option is given; it has no value
    KN_OPTION_SET,            // int: becomes `least`; the option has no value
    KN_OPTION_CALL,           // no field: calls `call`; the option has no value
    KN_OPTION_ANSWER,         // no field: calls `call`, which prints an answer, and ends with exit code 0; no value
    KN_OPTION_TEXT,           // const char *: the text itself, never empty if `expected` is set
    KN_OPTION_NUMBER,         // double: a number without unit, as in a scene (kn_number_take)
    KN_OPTION_REAL,           // double: a number that strtod accepts
    KN_OPTION_INTEGER,        // int: a decimal number, which may have a sign
    KN_OPTION_DIGITS,         // int: 1 to 7 decimal digits
    KN_OPTION_QUANTITY,       // double: a quantity in the dimension of `unit`; without a unit for "s" and "1" only
    KN_OPTION_CHOICE,         // int or enum: index of a word in the list `unit`, "a|b|c"
    KN_OPTION_EITHER,         // bool: true for the second word of the list `unit`, "a|b"
    KN_OPTION_LIST,           // const char *[most], or with most 0 a const char ** with enough room: every text given
    KN_OPTION_SPECIAL         // any: `take` reads the value
} kn_option_kind;

typedef struct kn_option {
    const char *name; // without "--"
    kn_option_kind kind;
    size_t offset;        // offset of the field in the struct [bytes]
    const char *expected; // words after "expected" if the value is bad; NULL: made from the row, or by `take`
    const char *unit;
    // Range of a number, in SI units. Both 0: above 0; INTEGER and DIGITS need a range. SET: `least` is the value that is
    // stored. LIST: `most` is the size of the list.
    double least, most;
    // SPECIAL: store the value. Return NULL, or the words after "expected" if the value is bad and the row has none.
    const char *(*take)(void *field, const char *text);
    void (*call)(void);
    int items; // not 0: the value is a list of at most that many values of this kind, separated by commas. The field is
               // an array of int for INTEGER and CHOICE, else of double
    size_t count;                         // LIST, or with `items`: offset of an int with the number of values [bytes]
    const char *(*map)(const char *text); // LIST: text that is stored instead; it returns NULL if the value is bad
    size_t given;                         // offset of a bool that becomes true; 0: none
    const char *belongs;                  // experiments that know the option, see kn_option_table; NULL: all
    char letter;                          // short form of the option; 0: none
} kn_option;

typedef struct kn_option_table {
    const kn_option *option; // [options], see KN_OPTION_ROWS
    int options;
    const char *program;      // name in messages; NULL: argv[0]
    const char *help;         // answer to --help
    void (*print_help)(void); // prints the answer to --help; NULL: `help` is printed
    const char *version;      // answer to --version; NULL: no such option
    const char *unknown;      // message on an unknown option; NULL: getopt_long prints its own messages
    char experiment;          // letter of this command in `belongs`; options of others are unknown
    bool short_help;          // -h means --help
    bool help_last;           // --help is answered at the end of the line, so that a mistake behind it is found
    bool options_first;       // options end at the first argument that is none
    bool quotes;              // messages quote the bad value
    bool value_first;         // messages begin with the bad value and do not name the option; `expected` does
    bool always_named;        // messages begin with the program even if they contain a place, see kn_message_print
    bool no_empty;            // no option takes an empty text
} kn_option_table;

#define KN_OPTION_ROWS(rows) .option = rows, .options = (int)(sizeof(rows) / sizeof *(rows))
#define KN_OPTIONS_MAX 32 // options of a table
#define KN_OPTION_TOLD "" // result of `take`: the value is bad, and the message is printed already

enum { KN_OPTIONS_READ = -1 };

// Read a command line into the struct at `to`, which holds the defaults. Return KN_OPTIONS_READ, with optind at the
// arguments that are no options. Otherwise the command is over, and the result is its exit code: 0 after --help and
// other answers, 2 after a mistake, which is printed.
int kn_options_read(const kn_option_table *table, void *to, int argc, char **argv);

// Print a message on stderr: "knead check: what is wrong, what was expected". Unless always_named is set, a message that
// names a place in a file, "scene.yaml:14:9: ...", gets no prefix, because editors jump to a place at the beginning of
// a line.
void kn_message_print(const char *program, bool always_named, const char *format, va_list args);

// Read a quantity, in the SI unit `unit`, into *value. Return false unless it has the dimension of `unit` and is in
// least..most. bare: a number without a unit has this unit. If `unit` is "", no unit may be written.
bool kn_quantity_read(const char *text, const char *unit, bool bare, double least, double most, double *value);

// Parse `text` into *value: a number without a unit, written as in a scene: "2", "-0.5", "1e-3". Return false if `text`
// is not a number (blanks, "0x2" and "inf" are refused), or if the number is outside `low`..`high`.
bool kn_number_take(const char *text, double low, double high, double *value);

// Parse a pair such as "1280x720": two whole numbers of up to 5 digits, separated by "x". Return false for any other
// text.
bool kn_number_pair(const char *text, int *first, int *second);

#endif
