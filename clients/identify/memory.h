#ifndef KN_CLIENTS_IDENTIFY_MEMORY_H
#define KN_CLIENTS_IDENTIFY_MEMORY_H
// Creep of any linear material under steps of load, from its creep compliance J(t) alone. The strain x follows from
// Boltzmann's superposition:
//
//     x(t) = integral of J(t - s) dP(s),   P = W/S0 (1 - x), or W/S0 where the area is taken as constant           (1)
//
// The method is product integration: P is linear between nodes (points in time), and J is integrated exactly. Nodes are
// densest just after a change of load. The method is used for laws that are no chain of springs and dampers. A lag is
// the time between two nodes. The lags and their logarithms are computed once per curve.
#include <stdbool.h>

#define KN_SUPERPOSITION_STEPS                                                                                         \
    8 // largest number of changes of load; the number of node pairs grows as the square of it

typedef struct kn_superposition {
    int nodes, steps;
    double *time_s;                   // [nodes] times of the nodes; each change of load is a node
    int step[KN_SUPERPOSITION_STEPS]; // index of the node at each change of load
    double nominal_pa[KN_SUPERPOSITION_STEPS];
    bool constant_area;
    // private: lag, logarithm of the lag, compliance and its integral; one entry for each pair of nodes (n, j) with j <
    // n, at the index n(n-1)/2 + j
    double *lag_s, *ln_lag, *j, *k;
    double *strain, *slope;
} kn_superposition;

// Callback: compute the compliance j[] and its integral k[] from lag 0, at `count` lags > 0. ln_lag[] holds the
// logarithms of the lags. The compliance must be 0 at lag 0.
typedef void kn_superposition_compliance(const void *of, int count, const double *lag_s, const double *ln_lag,
                                         double *j, double *k);

// Prepare the nodes for `steps` loads. The nominal stress nominal_pa[i] begins at step_s[i]; these times rise.
// `until_s` is the last time of the prediction and must be after the last change of load. Return false if there are
// more than KN_SUPERPOSITION_STEPS changes of load or if memory runs out.
bool kn_superposition_open(kn_superposition *m, bool constant_area, int steps, const double *step_s,
                           const double *nominal_pa, double until_s);
void kn_superposition_close(kn_superposition *m); // a zeroed struct is allowed

// Compute the strain at `count` rising times, up to `until_s`. Return false if a strain is not finite.
bool kn_superposition_creep(kn_superposition *m, kn_superposition_compliance *compliance, const void *of, int count,
                            const double *time_s, double *strain);

#endif
