#ifndef KN_CLIENTS_IDENTIFY_MEMORY_H
#define KN_CLIENTS_IDENTIFY_MEMORY_H
// Creep of any linear material under steps of load, from its creep compliance J(t) alone. The strain x follows from
// Boltzmann's superposition:
//
//     x(t) = integral of J(t - s) dP(s),   P = W/S0 (1 - x), or W/S0 where the area is taken as constant           (1)
//
// The method is product integration: P is linear between nodes, and J is integrated exactly. Nodes are densest just
// after a change of load. It is used for laws that are not a chain of springs and dampers. Lags are the times between
// two nodes. The lags and their logarithms are computed once per curve.
#include <stdbool.h>

#define KN_MEMORY_STEPS 8 // the number of node pairs grows as its square

typedef struct kn_memory {
    int nodes, steps;
    double *time_s;            // times of the nodes; each change of load is a node
    int step[KN_MEMORY_STEPS]; // node of each change of load
    double nominal_pa[KN_MEMORY_STEPS];
    bool constant_area;
    // private: one entry per pair (n, j < n), at n(n-1)/2 + j
    double *lag_s, *ln_lag, *j, *k;
    double *strain, *slope;
} kn_memory;

// Compute the compliance `j` and its integral `k` from lag 0, at `count` lags > 0. Their logarithms are given. `j` must
// be 0 at lag 0.
typedef void kn_memory_compliance(const void *of, int count, const double *lag_s, const double *ln_lag, double *j,
                                  double *k);

// Prepare for loads (nominal stress, Pa) that begin at rising times. `until_s`, the last time of the prediction, must
// be after the last load. Return false if there are too many loads or no memory.
bool kn_memory_open(kn_memory *m, bool constant_area, int steps, const double *step_s, const double *nominal_pa,
                    double until_s);
void kn_memory_close(kn_memory *m); // a zeroed struct is fine

// Compute the strain at `count` rising times, up to `until_s`. Return false if a strain is not finite.
bool kn_memory_creep(kn_memory *m, kn_memory_compliance *compliance, const void *of, int count, const double *time_s,
                     double *strain);

#endif
