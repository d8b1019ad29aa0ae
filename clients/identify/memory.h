#ifndef KN_CLIENTS_IDENTIFY_MEMORY_H
#define KN_CLIENTS_IDENTIFY_MEMORY_H
// How any linear material creeps under steps of load, from its creep compliance J(t) alone: Boltzmann's superposition,
//
//     x(t) = integral of J(t - s) dP(s),   P = W/S0 (1 - x), or W/S0 where the area is taken as constant           (1)
//
// by product integration: P is taken as straight between nodes, which lie the closer the shorter ago the load has
// changed, and J is integrated exactly. For models that no row of springs and dampers is. The lags between nodes and
// their logarithms are made once per curve.
#include <stdbool.h>

#define KN_MEMORY_STEPS 8 // pairs of nodes grow as its square

typedef struct kn_memory {
    int nodes, steps;
    double *time_s;            // of the nodes; each change of load is one
    int step[KN_MEMORY_STEPS]; // node of each change
    double nominal_pa[KN_MEMORY_STEPS];
    bool constant_area;
    // private: of the pairs (n, j < n), n(n-1)/2 + j
    double *lag_s, *ln_lag, *j, *k;
    double *strain, *slope;
} kn_memory;

// Compliance, 0 at 0, and its integral from 0 at count lags > 0, whose logarithms are known.
typedef void kn_memory_compliance(const void *of, int count, const double *lag_s, const double *ln_lag, double *j,
                                  double *k);

// Loads (nominal stress, Pa) from times on that rise, up to until_s, behind the last. False: too many, or no memory.
bool kn_memory_open(kn_memory *m, bool constant_area, int steps, const double *step_s, const double *nominal_pa,
                    double until_s);
void kn_memory_close(kn_memory *m); // zeroed is fine

// Strain at count times that rise, up to until_s. False: not finite.
bool kn_memory_creep(kn_memory *m, kn_memory_compliance *compliance, const void *of, int count, const double *time_s,
                     double *strain);

#endif
