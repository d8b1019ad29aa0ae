#ifndef KN_CLIENTS_NUMBER_H
#define KN_CLIENTS_NUMBER_H
// Parsing of a number in an option, written as in a scene: "2", "-0.5", "1e-3". Blanks, "0x2" and "inf" are refused.
#include <stdbool.h>

// Parse `text` into *value. Return false if `text` is not a number, or if the number is outside `low`..`high`.
bool kn_number_take(const char *text, double low, double high, double *value);

// Parse a pair such as "1280x720": two whole numbers of up to 5 digits, separated by "x". Return false for any other
// text.
bool kn_number_pair(const char *text, int *first, int *second);

#endif
