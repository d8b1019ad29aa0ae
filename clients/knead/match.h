#ifndef KN_CLIENTS_MATCH_H
#define KN_CLIENTS_MATCH_H
// Comparison of two objects vertex by vertex. Each vertex of the second object is matched with the nearest vertex of
// the first object at rest. In equal meshes that is the same vertex. The distance tells how far two matched vertices
// have moved apart: |(x2 - X2) - (x1 - X1)|, x now, X at rest.
#include "clients/knead/still.h"

typedef struct kn_match {
    int count;  // number of vertices of the second object
    int *first; // index of the matching vertex of the first object, for each vertex of the second object, [count]
    bool same;  // true: the two vertices of every match lie at the same place at rest
    // Largest distance at rest from a vertex of either object to the nearest vertex of the other object, m.
    double apart_m;
} kn_match;

// Match the vertices of two objects. Return false with one sentence in error if out of memory, or if apart_m is larger
// than the edge length of the coarser mesh can explain.
bool kn_match_make(kn_match *match, const kn_still *first, const kn_still *second, char *error, size_t error_size);
// Return true if the match can still be used, because the number of vertices of each object has not changed.
bool kn_match_fits(const kn_match *match, const kn_still *first, const kn_still *second);

// For every vertex of the second object, compute how far it has moved apart from its matched vertex of the first
// object, m, into value[count].
void kn_match_distance(const kn_match *match, const kn_still *first, const kn_still *second, float *value);
void kn_match_free(kn_match *match); // a struct that is all zero is allowed

#endif
