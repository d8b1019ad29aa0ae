#ifndef KN_CLIENTS_MATCH_H
#define KN_CLIENTS_MATCH_H
// Two objects compared point by point: for every vertex of the second, which vertex of the first lies beside it at
// rest. The same meshes have the same vertices; of others it is the nearest. Distance is how far apart two such points
// have come: |(x2 - X2) - (x1 - X1)|, x now, X at rest.
#include "clients/knead/still.h"

typedef struct kn_match {
    int count;      // of the second's vertices
    int *first;     // [count]
    bool same;      // each lies where the other one does
    double apart_m; // at rest, at most, from either to the other
} kn_match;

// False and one sentence in error: at rest they are further apart than the coarser mesh is coarse, or out of memory.
bool kn_match_make(kn_match *match, const kn_still *first, const kn_still *second, char *error, size_t error_size);
bool kn_match_fits(const kn_match *match, const kn_still *first, const kn_still *second); // as many vertices as then

// value[count], m.
void kn_match_distance(const kn_match *match, const kn_still *first, const kn_still *second, float *value);
void kn_match_free(kn_match *match); // zeroed is fine

#endif
