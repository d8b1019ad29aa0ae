#include "clients/knead/number.h"
#include "core/scene/units.h"
#include <stdlib.h>
#include <string.h>

bool kn_number_take(const char *text, double low, double high, double *value)
{
    kn_quantity q;
    char error[100];
    const kn_unit none = {0};
    // Accept only a number without a unit ("bare"). The quantity parser allows blanks in the text, but an option must
    // not contain any.
    if (strchr(text, ' ') || !kn_quantity_parse(&q, text, error, sizeof error) || !q.bare) return false;
    *value = kn_quantity_in(&q, &none);
    return *value >= low && *value <= high;
}

bool kn_number_pair(const char *text, int *first, int *second)
{
    static const char digits[] = "0123456789";
    const size_t n = strspn(text, digits);
    if (n < 1 || n > 5 || text[n] != 'x') return false;
    const char *next = text + n + 1;
    const size_t m = strspn(next, digits);
    if (m < 1 || m > 5 || next[m]) return false;
    *first = atoi(text);
    *second = atoi(next);
    return true;
}
