#ifndef KN_TESTS_MADE_H
#define KN_TESTS_MADE_H
// A curve that a test builds reading by reading.
#include "clients/identify/measured_curve.h"

enum { MADE_MOST = 4000 };

typedef struct made {
    kn_curve curve;
    double time_s[MADE_MOST], value[MADE_MOST], other[MADE_MOST], weight[MADE_MOST];
    int line[MADE_MOST];
} made;

static inline kn_curve *made_begin(made *m, kn_curve_kind kind, double strain)
{
    m->curve = (kn_curve){.kind = kind,
                          .name = "made",
                          .file = "made.csv",
                          .time_s = m->time_s,
                          .value = m->value,
                          .weight = m->weight,
                          .line = m->line,
                          .strain = strain,
                          .noise = 1};
    return &m->curve;
}

static inline void made_put(made *m, double time_s, double value, double other)
{
    const int i = m->curve.count++;
    m->time_s[i] = time_s;
    m->value[i] = value;
    m->other[i] = other;
    m->weight[i] = 1;
    m->line[i] = i + 2;
}

#endif
