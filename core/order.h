#ifndef KN_CORE_ORDER_H
#define KN_CORE_ORDER_H
#include <stdint.h>

// Comparison functions for qsort, ascending. Doubles must not be NaN.
static inline int kn_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static inline int kn_ascending_i64(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

#endif
