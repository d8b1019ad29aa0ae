#ifndef KN_SERVER_OPTION_TABLE_H
#define KN_SERVER_OPTION_TABLE_H
// Command lines as tables. A row says which values an option accepts and where the value goes:
//
//     KN_OPTION("zoom", NUMBER, .offset = offsetof(options, zoom), .expected = "0.2..20", KN_RANGE(0.2, 20)),
//
// kn_options_read stores the options of a command line in a struct. getopt_long splits the line, so an option may be
// shortened, `--zoom 2` and `--zoom=2` are equal, and `--` ends the options. -h means --help. A mistake is one line on
// stderr:
//
//     knead view: --zoom 30: expected 0.2..20
//     knead view: --colour: unknown option; did you mean --color?
//
// This file is in the folder server and not in clients, because kneadd has a command line too, and server must not
// depend on clients.
#include <float.h>
#include <getopt.h> // for optind
#include <stdbool.h>
#include <stddef.h>

#define KN_OPTION(text, type, ...)                                                                                     \
    {                                                                                                                  \
        .name = text, .kind = KN_OPTION_##type, __VA_ARGS__                                                            \
    }
#define KN_RANGE(low, high) .least = low, .most = high
#define KN_ABOVE_0 DBL_TRUE_MIN          // least value of a range that begins above 0
#define KN_BELOW_1 (1 - DBL_EPSILON / 2) // largest value of a range that ends below 1

typedef enum kn_option_kind { // type of an option's field in the struct, and values that the option accepts
    KN_OPTION_FLAG,           // bool: true if the option is given; it has no value
    KN_OPTION_CALL,           // no field: the function `call` is called; the option has no value
    KN_OPTION_ANSWER,         // no field: `call` prints an answer, then the program ends with exit code 0; no value
    KN_OPTION_RENAMED,        // no field: the option is refused, and the message names the new spelling `expected`
    KN_OPTION_TEXT,           // const char *: the text itself
    KN_OPTION_NUMBER,         // double: a number without unit, as in a scene (kn_number_take)
    KN_OPTION_INTEGER,        // int: a decimal number, which may have a sign
    // Double: a quantity in the dimension of `unit`; a number without a unit only if `unit` is "s" or "1".
    KN_OPTION_QUANTITY,
    KN_OPTION_CHOICE, // int or enum: index of a word in the list `unit`, "a|b|c"
    KN_OPTION_EITHER, // bool: true for the second word of the list `unit`, "a|b"
    // Array of const char *, which gets the text of each use of the option. `most`: size of the array; 0: the field is
    // a pointer to an array that is large enough (const char **).
    KN_OPTION_LIST,
    KN_OPTION_SPECIAL // any: `take` reads the value
} kn_option_kind;

typedef struct kn_option {
    const char *name; // without "--"
    kn_option_kind kind;
    size_t offset; // offset of the field in the struct, bytes
    // Text after "expected" in the message on an invalid value; NULL: made from the row, or by `take`.
    const char *expected;
    const char *unit;
    // Range of a number, in SI units. Both 0: the number must be above 0. INTEGER needs a range. LIST: `most` is the
    // size of the list.
    double least, most;
    // SPECIAL: store the value and return NULL. If the value is invalid, return the text after "expected" in the
    // message. A text `expected` in the row replaces the returned text.
    const char *(*take)(void *field, const char *text);
    void (*call)(void);
    // Not 0: the option takes a list of at most `items` values, separated by commas. The field is then an array: of int
    // for INTEGER and CHOICE, otherwise of double.
    int items;
    // For a LIST, or if `items` is not 0: offset in bytes of an int that receives the number of values.
    size_t count;
    // LIST: return the text to store instead of `text`, or NULL if `text` is invalid.
    const char *(*map)(const char *text);
    size_t given; // offset in bytes of a bool that becomes true if the option is given; 0: none
    // Letters of the commands (kn_option_table.experiment) that have the option; NULL: all commands.
    const char *belongs;
    char letter; // short form of the option; 0: none
} kn_option;

typedef struct kn_option_table {
    const kn_option *option; // [options], see KN_OPTION_ROWS
    int options;
    const char *program;      // name of the program in messages; NULL: argv[0]
    const char *help;         // answer to --help
    void (*print_help)(void); // prints the answer to --help; NULL: `help` is printed
    const char *version;      // answer to --version; NULL: no such option
    // Letter of this command in kn_option.belongs; options that only other commands have are unknown.
    char experiment;
    bool options_first; // true: options end at the first argument that is not an option
} kn_option_table;

#define KN_OPTION_ROWS(rows) .option = rows, .options = (int)(sizeof(rows) / sizeof *(rows))
#define KN_OPTIONS_MAX 32 // largest number of options in a table
#define KN_OPTION_TOLD "" // result of `take`: the value is invalid, and `take` has printed the message

enum { KN_OPTIONS_READ = -1 };

// Read a command line into the struct at `to`, which holds the defaults. On success return KN_OPTIONS_READ, and set
// optind to the first argument that is not an option. Otherwise the program must end with the returned exit code: 0
// after --help and other answers, 2 after a mistake, whose message has been printed.
int kn_options_read(const kn_option_table *table, void *to, int argc, char **argv);

// Read a quantity such as "3 kPa" into *value, converted to `unit`. Return true if the quantity has the dimension of
// `unit` and lies in least..most. `bare`: accept a number without a unit, and take it in `unit`. If `unit` is "", the
// text must be a number without a unit.
bool kn_quantity_read(const char *text, const char *unit, bool bare, double least, double most, double *value);

// Parse `text` into *value: a number without a unit, written as in a scene: "2", "-0.5", "1e-3". Return false if `text`
// is not a number (blanks, "0x2" and "inf" are refused), or if the number is outside `low`..`high`.
bool kn_number_take(const char *text, double low, double high, double *value);

#endif
