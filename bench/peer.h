#ifndef KN_BENCH_PEER_H
#define KN_BENCH_PEER_H
// Block of dough in another physics engine, for a comparison with knead. The block consists of nodes and links. All
// links have one stiffness and one damping, because other engines allow no more. A held node stands still, or moves as
// `hold` prescribes.
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct peer_block {
    int node_count, link_count;
    const double (*x_m)[3]; // [node_count]
    const int (*link)[2];   // [link_count]
    const bool *held;       // [node_count]
    double mass_kg;         // of each node
    double stiffness_n_m;   // of each link
    double damping_n_s_m;
    bool axial; // true: damp the relative velocity along the link; false: damp the whole relative velocity
    double dt_s;
} peer_block;

typedef struct peer peer; // a block in the engine

typedef struct peer_engine {
    const char *name;                         // name and version
    peer *(*create)(const peer_block *block); // copies the block
    void (*destroy)(peer *p);
    // Prescribe position and velocity of a held node for the next step.
    void (*hold)(peer *p, int node, const double x_m[3], const double v_m_s[3]);
    void (*step)(peer *p);
    void (*read)(const peer *p, int node, double x_m[3], double v_m_s[3]);
} peer_engine;

extern const peer_engine peer_bullet, peer_vega;

#ifdef __cplusplus
}
#endif
#endif
