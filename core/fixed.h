#ifndef KN_CORE_FIXED_H
#define KN_CORE_FIXED_H
// The lattice in integers, as a twin of the circuit in hdl/rtl: both give equal bits. Inertia is left out, and there is
// no floating point and no division.
//
// The unknown of a tick is the displacement u of every node. The tension of edge i-j, with unit vector e, in force
// units:
//
//     B = kv dl + H,     t = R(|B|/area) B,     dl = e.(u_j - u_i),     kv = A kappa w/dt,     H = k1 u_p area      (1)
//
// This is s = T(b) of law.h with R = T(b)/b from a table; the viscoelastic, plastic and rheological laws differ only in
// their table. The damper is evaluated at the force of the present tick, never at that of the last tick. After the
// solve, H grows by beta (t - H), with beta = k1 dt/A. The equilibrium sum t e + load = 0 is solved in O passes. A pass
// freezes e and R at the last u and takes K damped Jacobi steps, accelerated by Chebyshev's polynomials (u_: u of the
// iteration before):
//
//     z = D^-1 r,     u <- u_ + omega (u + z - u_),     D_k = sum R kv |e_k| |e|_1                                  (2)
//
// |e_k||e|_1 bounds each edge's block, so the spectrum of D^-1 M lies in 0..2 for any state of the dampers. e is taken
// at the middle of the tick, x + u/2; then e.(u_j - u_i) is the change of length to third order in u.
//
// Every sum of forces is exact, because the forces of an edge on its two ends differ only in sign. Every shift rounds
// to nearest (halves up). A number that does not fit saturates and raises a flag; nothing wraps. Therefore the order of
// the edges, the number of lanes and the machine do not change a bit of the result.
//
//                 +----- O times -------------------------------------------------+
//     u of the    |  SETUP   per edge: e, B, R -> g = R kv, t0 = R H; sum D       |      COMMIT  per edge: t, H
//     last tick ->|  INVERT  per node: 1/D                                        |->            per node: reaction,
//     + held      |  K times EDGE per edge: t = g dl + t0, sum t e; NODE: (2)     |              x += u, residual
//                 +---------------------------------------------------------------+
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Number formats of the circuit: name, bits (s signed, u unsigned), fraction bits, unit. lambda is the unit of length,
// phi that of force; both are powers of two chosen by the host (core/solver_fixed.h). C, Verilog and hdl/REGISTERS.md
// get the formats from here.
#define KN_FIXED_FORMATS(FORMAT)                                                                                       \
    FORMAT(X, s, 36, 0, "lambda", "position of a node")                                                                \
    FORMAT(U, s, 25, 0, "lambda", "displacement of a node in this tick; of an edge's ends against each other")         \
    FORMAT(D, s, 18, 0, "lambda 2^d_shift", "edge vector, for its direction")                                          \
    FORMAT(E, s, 18, 16, "1", "unit vector of an edge")                                                                \
    FORMAT(KV, u, 17, 0, "phi/lambda 2^-kv_shift", "tension per change of length while the damper is rigid")           \
    FORMAT(IA, u, 17, 0, "1", "1/stress area, relative to the largest")                                                \
    FORMAT(T, s, 25, 0, "phi", "tension; residual on its way to u")                                                    \
    FORMAT(B, s, 36, 0, "phi", "tension if the damper were rigid")                                                     \
    FORMAT(H, s, 36, 12, "phi", "force of the spring k1")                                                              \
    FORMAT(R, u, 18, 17, "1", "T(b)/b, of the table")                                                                  \
    FORMAT(BETA, u, 17, 0, "2^-beta_shift 2^-12", "k1 dt/A")                                                           \
    FORMAT(ACC, s, 36, 0, "phi", "sum of forces on a node")                                                            \
    FORMAT(INV, u, 18, 16, "1", "mantissa of relax/D; its shift has 6 bits")                                           \
    FORMAT(OMEGA, u, 18, 16, "1", "Chebyshev's weights")                                                               \
    FORMAT(RELAX, u, 17, 17, "1", "damping of the Jacobi step")

enum {
#define KN_FORMAT(name, sign, bits, fraction, unit, what) KN_FIXED_##name = bits, KN_FIXED_##name##_FRACTION = fraction,
    KN_FIXED_FORMATS(KN_FORMAT)
#undef KN_FORMAT
        KN_FIXED_SEGMENTS = 512,  // segments of the table of R: 16 octaves, 32 segments each
    KN_FIXED_ITERATIONS_MAX = 32, // largest number K of iterations per pass
    KN_FIXED_PASSES_MAX = 15,     // largest number O of passes per tick
    KN_FIXED_NODES_MAX = 65535,
    KN_FIXED_LIST_MAX = 1023, // largest number of boundary records (kn_fixed_bound) in a tick
    KN_FIXED_SEEDS = 512      // entries of the table of seeds for the reciprocal square root
};

// Flags of numbers that exceeded their format and were saturated since the flags were last cleared. The flag RESIDUAL
// only means slower convergence. Any other flag means that a tick did not solve equation (1).
enum {
    KN_FIXED_SAT_U = 1,          // a node moved by more than 2^24 lambda in a tick
    KN_FIXED_SAT_TENSION = 2,    // the tension of an edge exceeded 2^24 phi
    KN_FIXED_SAT_SPRING = 4,     // the force H of a spring k1 exceeded 2^23 phi
    KN_FIXED_SAT_POSITION = 8,   // the position of a node exceeded its 36 bits
    KN_FIXED_SAT_DIRECTION = 16, // an edge became longer than 2^17 2^d_shift lambda
    KN_FIXED_SAT_RESIDUAL = 32,  // the residual of a node exceeded 25 bits
    KN_FIXED_SAT_REACTION = 64,  // the sum of forces on a node exceeded 36 bits
};

typedef struct kn_fixed_config {
    int32_t node_count, edge_count;
    int32_t passes, iterations;             // passes O per tick, iterations K per pass
    int32_t d_shift;                        // exponent of the unit of edge vectors, format D; 0..18
    int32_t kv_shift;                       // exponent of the unit of kv, format KV; 0..40
    int32_t octave;                         // the table of R begins at the key |B| ia = 2^octave; -64..63
    int32_t beta, beta_shift;               // k1 dt/A and the exponent of its unit, format BETA; beta_shift 0..40
    int32_t relax;                          // damping of the Jacobi step, format RELAX
    int32_t omega[KN_FIXED_ITERATIONS_MAX]; // Chebyshev's weight of each iteration; 1.0 for iteration 0
} kn_fixed_config;

typedef struct kn_fixed_node {
    int64_t x[3];    // rest position, lambda
    int32_t load[3]; // load that acts in every tick (the weight), phi
    uint8_t held;    // bit k is set if component k of the node never moves
} kn_fixed_node;

typedef struct kn_fixed_edge {
    uint16_t i, j;  // nodes at the two ends; the edge runs from i to j, i != j
    int32_t kv, ia; // tension per change of length if the damper were rigid, format KV; 1/area, format IA, >= 1
} kn_fixed_edge;

typedef struct kn_fixed_image { // constant data that is loaded into a circuit; arrays are the caller's
    kn_fixed_config config;
    kn_fixed_node *node;                  // [config.node_count]
    kn_fixed_edge *edge;                  // [config.edge_count]
    int32_t table[KN_FIXED_SEGMENTS + 1]; // R at the key 2^(octave + i/32) (1 + (i mod 32)/32), i/32 rounded down
} kn_fixed_image;

// A boundary record: one node that tools or gas act on in one tick. The node is either held and moved by `value`, or
// free and pushed by `value`.
typedef struct kn_fixed_bound {
    uint16_t node;    // number of the node; each node occurs at most once in a list
    bool holds;       // true: the node is held; components in kn_fixed_node.held do not move all the same
    int32_t value[3]; // held: displacement in this tick, lambda; free: load, phi
} kn_fixed_bound;

typedef struct kn_fixed_result {
    int64_t residual; // largest absolute residual of a free component, phi
    uint32_t flags;   // bits KN_FIXED_SAT_* that were set since the flags were last cleared
} kn_fixed_result;

typedef struct kn_fixed { // state of one lattice; its arrays are in the caller's memory
    const kn_fixed_image *image;
    int64_t *x; // [node][3] positions, lambda
    int32_t *u; // [node][3] displacement in the last tick, lambda
    int64_t *h; // [edge] force H of the spring k1, 2^-12 phi
    // the arrays from here on are scratch memory of one tick
    int32_t *last, *load, *inverse; // [node][3] u of the iteration before; load; mantissa of relax/D
    uint8_t *shift, *held;          // [node][3] shift of `inverse`; [node] held components of this tick, as bits
    int64_t *force;                 // [node][3] sum of forces
    struct kn_fixed_line {
        int32_t e[3], g, t0;
    } * line; // [edge] unit vector e and the line t = g dl + t0 of the edge's tension
    uint32_t flags;
    int32_t seed[KN_FIXED_SEEDS];
} kn_fixed;

// Return the number of bytes of memory that kn_fixed_init needs. The memory must be 64-byte aligned and stays the
// caller's, as does the image; both must outlive `fixed`. kn_fixed_init leaves the lattice at rest.
size_t kn_fixed_bytes(const kn_fixed_image *image);
void kn_fixed_init(kn_fixed *fixed, const kn_fixed_image *image, void *memory);
void kn_fixed_rest(kn_fixed *fixed); // set the lattice to its rest state and clear the flags; real-time safe

// Take one tick with the boundary records bound[count]. Store reaction[count][3], phi: the force of the lattice and of
// the load on each held node, also along components that never move; 0 for a record that pushes. Real-time safe: at
// most O K + 2 O + 1 visits of every edge.
void kn_fixed_tick(kn_fixed *fixed, const kn_fixed_bound *bound, int count, int64_t (*reaction)[3],
                   kn_fixed_result *result);

// Return NULL if the circuit accepts the image, else a static text that names the first value out of its range.
const char *kn_fixed_check(const kn_fixed_image *image);

// Return the CRC-32 (IEEE 802.3) of x, u, h in this order, each as 64-bit little-endian words. The circuit and this
// software twin compare their checksums.
uint32_t kn_fixed_crc(const kn_fixed *fixed);

// Return rsqrt in 2^16 .. 2^17 and store the even number n, so that 1/sqrt(q) = rsqrt 2^(n/2 - 34). q must be in 1 ..
// 2^36 - 1. kn_fixed_seeds fills the table `seed`, indexed by the 9 leading bits of q 2^n, 128..511.
void kn_fixed_seeds(int32_t seed[KN_FIXED_SEEDS]);
int32_t kn_fixed_rsqrt(const int32_t seed[KN_FIXED_SEEDS], uint64_t q, int *n);

#endif
