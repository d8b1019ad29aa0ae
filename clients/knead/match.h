#ifndef KN_CLIENTS_MATCH_H
#define KN_CLIENTS_MATCH_H
// Comparison of two objects point by point. Each vertex of the second object is matched with the nearest vertex of the
// first object at rest. In equal meshes that is the same vertex. The distance tells how far two matched vertices have
// moved apart: |(x2 - X2) - (x1 - X1)|, x now, X at rest.
#include "clients/knead/still.h"

typedef struct kn_match {
    int count;      // number of the second object's vertices
    int *first;     // [count] matching vertex of the first object
    bool same;      // all matched vertices lie at the same place
    double apart_m; // largest distance at rest of nearest vertices, in either direction
} kn_match;

// Match two objects. Return false with one sentence in error if out of memory, or if the objects at rest are further
// apart than the coarser mesh can explain.
bool kn_match_make(kn_match *match, const kn_still *first, const kn_still *second, char *error, size_t error_size);
// Return true if the match can still be used: the number of vertices has not changed.
bool kn_match_fits(const kn_match *match, const kn_still *first, const kn_still *second);

// Compute the distance of every vertex, value[count], m.
void kn_match_distance(const kn_match *match, const kn_still *first, const kn_still *second, float *value);
void kn_match_free(kn_match *match); // all zero is allowed

#endif
