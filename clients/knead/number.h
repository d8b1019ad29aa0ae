#ifndef KN_CLIENTS_NUMBER_H
#define KN_CLIENTS_NUMBER_H
// A number of an option, written as numbers of a scene are: "2", "-0.5", "1e-3". No blanks, no "0x2", no "inf".
#include <stdbool.h>

bool kn_number_take(const char *text, double low, double high, double *value); // false: none, or not in low..high

// "1280x720": two whole numbers of up to 5 digits.
bool kn_number_pair(const char *text, int *first, int *second);

#endif
