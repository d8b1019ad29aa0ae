#ifndef KN_CORE_ORDER_H
#define KN_CORE_ORDER_H

// For qsort: doubles from the smallest on, none of them a NaN.
static inline int kn_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

#endif
