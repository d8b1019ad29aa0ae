#ifndef KN_CLIENTS_RESULT_H
#define KN_CLIENTS_RESULT_H
// --json: what a subcommand has found, as one JSON object on stdout in place of the text for eyes. Names end with their
// unit, SI unless they say otherwise; a number that is none is null.
//
//     if (option == JSON) kn_result_open();              what is printed from there on goes nowhere
//     kn_result_number(kn_result(), "force_n", 3.1);     nothing happens when nobody asked for it
//     main calls kn_result_close
#include "clients/knead/table.h"
#include <jansson.h>
#include <stdint.h>

void kn_result_open(void);
json_t *kn_result(void);                 // the object, borrowed; NULL: not asked for, and then all below do nothing
json_t *kn_result_add(const char *list); // a new object at the end of a list of that name; borrowed

void kn_result_number(json_t *to, const char *name, double value);
void kn_result_integer(json_t *to, const char *name, int64_t value);
void kn_result_bool(json_t *to, const char *name, bool value);
void kn_result_text(json_t *to, const char *name, const char *value);
void kn_result_table(const char *list, const kn_table *table); // an object per row, by its columns and `series`

// Prints it, unless the code says that there is none: neither ok nor a check that failed.
void kn_result_close(int code);

#endif
