#ifndef KN_CLIENTS_RESULT_H
#define KN_CLIENTS_RESULT_H
// Output of --json: a subcommand prints its results to stdout as one JSON object instead of text. The name of a number
// ends with its unit; a name without a unit means SI units. A number that is not finite is written as null.
//
//     if (option == JSON) kn_result_open();              from here on, printing to stdout has no effect
//     kn_result_number(kn_result(), "force_n", 3.1);     without --json this call has no effect
//     kn_result_close(code);                             called by main
#include "clients/cli/curve_table.h"
#include <jansson.h>
#include <stdint.h>

// Begin the JSON object with the results and redirect stdout to /dev/null.
void kn_result_open(void);
// Return the JSON object with the results, which this module owns. Without --json return NULL; the functions below do
// nothing with NULL.
json_t *kn_result(void);
// Append a new object to the list named `list`. Return the new object, which this module owns.
json_t *kn_result_add(const char *list);

// Set a member of a JSON object.
void kn_result_number(json_t *to, const char *name, double value);
void kn_result_integer(json_t *to, const char *name, int64_t value);
void kn_result_bool(json_t *to, const char *name, bool value);
void kn_result_text(json_t *to, const char *name, const char *value);
// Append each row of a table to a list. A row becomes an object with one number per column, under the column's name,
// and with the label of the row's series under the name `series`.
void kn_result_table(const char *list, const kn_table *table);

// Restore stdout. If `code` is KN_EXIT_OK or KN_EXIT_FAILED, print the JSON object with the results. With any other
// code, print nothing.
void kn_result_close(int code);

#endif
