#include "core/fixed.h"
#include "core/algebra/bytes.h"

#include <string.h>

typedef struct kn_fixed_line line;

// --- integers --------------------------------------------------------------------------------------------------------

// Return v / 2^shift, rounded to the nearest integer; halves are rounded up.
static int64_t round_shift(int64_t v, int shift) { return shift > 0 ? (v + ((int64_t)1 << (shift - 1))) >> shift : v; }

// Saturate v: return v if it fits a signed number of `bits` bits. Else raise the flag and return the nearest number
// that fits. The branch is rarely taken; code without a branch takes twice as long.
static inline int64_t saturate(int64_t v, int bits, uint32_t *flags, uint32_t flag)
{
    const int64_t most = ((int64_t)1 << (bits - 1)) - 1;
    if (__builtin_expect((uint64_t)(v + most + 1) >> bits == 0, 1)) return v;
    *flags |= flag;
    return v < 0 ? -most - 1 : most;
}

static int top_bit(uint64_t v) { return 63 - __builtin_clzll(v); } // v > 0

// Return the integer square root of v, rounded down. From the top, set each bit with which the square is at most v.
static int32_t root(uint64_t v)
{
    uint64_t r = 0;
    for (int bit = 31; bit >= 0; bit--) {
        uint64_t more = r | (uint64_t)1 << bit;
        if (more * more <= v) r = more;
    }
    return (int32_t)r;
}

// Fill the table of seeds. Seed i is 2^21/sqrt(2 i + 1), the value at the middle of the interval of numbers whose 9
// leading bits are i.
void kn_fixed_seeds(int32_t seed[KN_FIXED_SEEDS])
{
    memset(seed, 0, KN_FIXED_SEEDS * sizeof *seed);
    for (int i = KN_FIXED_SEEDS / 4; i < KN_FIXED_SEEDS; i++)
        seed[i] = root(((uint64_t)1 << 42) / (uint64_t)(2 * i + 1));
}

// Look up a seed by the 9 leading bits of q, then take one Newton step: r (3 - q r^2)/2.
int32_t kn_fixed_rsqrt(const int32_t seed[KN_FIXED_SEEDS], uint64_t q, int *n)
{
    *n = (35 - top_bit(q)) & ~1;
    const int64_t y = (int64_t)(q << *n), r = seed[y >> 27];
    const int64_t square = round_shift(r * r, 16);
    const int64_t rest = round_shift(((int64_t)3 << 34) - (y >> 18) * square, 17);
    return (int32_t)round_shift(r * rest, 18);
}

// --- an edge ---------------------------------------------------------------------------------------------------------

// Return dl = e.(b - a), the change of an edge's length. a and b are the displacements of its two ends in this tick.
static inline int32_t change_of_length(const int32_t *a, const int32_t *b, const int32_t e[3], uint32_t *flags)
{
    int64_t sum = 0;
    for (int k = 0; k < 3; k++) sum += saturate((int64_t)b[k] - a[k], KN_FIXED_U, flags, KN_FIXED_SAT_U) * e[k];
    return (int32_t)saturate(round_shift(sum, KN_FIXED_E_FRACTION), KN_FIXED_U, flags, KN_FIXED_SAT_U);
}

// Return the tension t = g dl + t0 of an edge whose damper and direction are frozen.
static inline int32_t tension(int64_t dl, const line *at, int kv_shift, uint32_t *flags)
{
    return (int32_t)saturate(round_shift(at->g * dl, kv_shift) + at->t0, KN_FIXED_T, flags, KN_FIXED_SAT_TENSION);
}

// Add the force of a tension t to both ends of an edge; t > 0 pulls the ends together. The force is rounded once, so
// the forces on the two ends are exactly opposite.
static inline void scatter(const int32_t e[3], int64_t t, int64_t *i, int64_t *j)
{
    for (int k = 0; k < 3; k++) {
        int64_t force = round_shift(t * e[k], KN_FIXED_E_FRACTION);
        i[k] += force;
        j[k] -= force;
    }
}

// Stage EDGE: add every edge's tension to its two nodes. A local variable collects the flags, so that the loop does not
// write them to memory.
static void pull(kn_fixed *f)
{
    const kn_fixed_edge *restrict edge = f->image->edge;
    const line *restrict at = f->line;
    const int32_t *restrict u = f->u;
    int64_t *restrict force = f->force;
    const int count = f->image->config.edge_count, kv_shift = f->image->config.kv_shift;
    uint32_t flags = 0;
    for (int n = 0; n < count; n++, edge++, at++) {
        const int32_t dl = change_of_length(u + 3 * edge->i, u + 3 * edge->j, at->e, &flags);
        scatter(at->e, tension(dl, at, kv_shift, &flags), force + 3 * edge->i, force + 3 * edge->j);
    }
    f->flags |= flags;
}

// Return the force H of an edge's spring k1, rounded to whole phi.
static int32_t spring(kn_fixed *f, int edge)
{
    return (int32_t)saturate(round_shift(f->h[edge], KN_FIXED_H_FRACTION), KN_FIXED_T, &f->flags, KN_FIXED_SAT_SPRING);
}

// Compute the unit vector e of an edge at the middle of the tick, with the nodes at x + u/2.
static void direction(kn_fixed *f, int edge)
{
    const kn_fixed_edge *at = &f->image->edge[edge];
    const int shift = f->image->config.d_shift;
    int64_t d[3], square = 0;
    for (int k = 0; k < 3; k++) {
        int i = 3 * at->i + k, j = 3 * at->j + k;
        // compute twice the vector, so that no bit of u/2 is lost; the shift is larger by 1 to halve the result
        int64_t twice = 2 * (f->x[j] - f->x[i]) + f->u[j] - f->u[i];
        d[k] = saturate(round_shift(twice, shift + 1), KN_FIXED_D, &f->flags, KN_FIXED_SAT_DIRECTION);
        square += d[k] * d[k];
    }
    int n = 0;
    const int64_t r = square > 0 ? kn_fixed_rsqrt(f->seed, (uint64_t)square, &n) : 0;
    for (int k = 0; k < 3; k++) {
        // rounding can make the unit vector slightly longer than 1: clamp its components
        int64_t e = round_shift(d[k] * r, 18 - n / 2), one = 1 << KN_FIXED_E_FRACTION;
        f->line[edge].e[k] = (int32_t)(e > one ? one : e < -one ? -one : e);
    }
}

// Look up R at the key |b| ia. The exponent and the five bits after the leading bit of the key choose the segment;
// eleven more bits interpolate within it. A key beyond an end of the table gets the value at that end.
static int32_t ratio(const kn_fixed_image *image, int64_t b, int32_t ia)
{
    const uint64_t a = (uint64_t)(b < 0 ? -b : b);
    if (a == 0) return image->table[0];
    const int exponent = top_bit(a) - 17;
    const uint64_t mantissa = exponent > 0 ? a >> exponent : a << -exponent; // in the range 2^17 .. 2^18 - 1
    const uint64_t key = mantissa * (uint64_t)ia;
    const int top = top_bit(key), octave = top + exponent - image->config.octave;
    const int64_t bits = (int64_t)(key << (40 - top) >> 24) & 0xffff; // the 16 bits below the key's leading bit
    if (octave < 0) return image->table[0];
    if (octave >= KN_FIXED_SEGMENTS / 32) return image->table[KN_FIXED_SEGMENTS];
    const int32_t *at = image->table + 32 * octave + (bits >> 11);
    return at[0] + (int32_t)round_shift((at[1] - at[0]) * (bits & 0x7ff), 11);
}

// Stage SETUP for one edge: compute e, g and t0, which stay frozen for K iterations. Add the edge's share of the
// diagonal D to both nodes.
static void setup(kn_fixed *f, int edge)
{
    const kn_fixed_image *image = f->image;
    const kn_fixed_edge *at = &image->edge[edge];
    line *out = &f->line[edge];
    direction(f, edge);
    const int64_t dl = change_of_length(f->u + 3 * at->i, f->u + 3 * at->j, out->e, &f->flags), h = spring(f, edge);
    const int64_t rigid = round_shift(at->kv * dl, image->config.kv_shift) + h;
    const int64_t b = saturate(rigid, KN_FIXED_B, &f->flags, KN_FIXED_SAT_TENSION);
    const int64_t r = ratio(image, b, at->ia);
    out->g = (int32_t)round_shift(at->kv * r, KN_FIXED_R_FRACTION);
    out->t0 = (int32_t)round_shift(h * r, KN_FIXED_R_FRACTION);

    // the edge's share of D is g |e|_1 |e_k|
    int64_t size[3], sum = 0;
    for (int k = 0; k < 3; k++) sum += size[k] = out->e[k] < 0 ? -out->e[k] : out->e[k];
    const int64_t whole = round_shift(out->g * sum, KN_FIXED_E_FRACTION);
    for (int k = 0; k < 3; k++) {
        int64_t share = round_shift(whole * size[k], KN_FIXED_E_FRACTION);
        f->force[3 * at->i + k] += share;
        f->force[3 * at->j + k] += share;
    }
}

// Stage COMMIT for one edge: add its tension at the end of the tick to both nodes, and advance the force H of its
// spring.
static void commit_edge(kn_fixed *f, int edge)
{
    const kn_fixed_config *config = &f->image->config;
    const kn_fixed_edge *at = &f->image->edge[edge];
    const line *held = &f->line[edge];
    const int32_t dl = change_of_length(f->u + 3 * at->i, f->u + 3 * at->j, held->e, &f->flags);
    const int32_t t = tension(dl, held, config->kv_shift, &f->flags);
    scatter(held->e, t, f->force + 3 * at->i, f->force + 3 * at->j);
    int64_t gap = saturate((int64_t)t - spring(f, edge), KN_FIXED_T, &f->flags, KN_FIXED_SAT_TENSION);
    f->h[edge] = saturate(f->h[edge] + round_shift(gap * config->beta, config->beta_shift), KN_FIXED_H, &f->flags,
                          KN_FIXED_SAT_SPRING);
}

// --- a node ----------------------------------------------------------------------------------------------------------

// Stage INVERT for one component of a node: compute relax/D as mantissa and shift, so that z = r inverse / 2^shift. A
// node without edges has D = 0 and gets z = 0.
static void invert(kn_fixed *f, int component)
{
    const kn_fixed_config *config = &f->image->config;
    const int64_t d = f->force[component];
    f->force[component] = 0;
    f->inverse[component] = 0;
    f->shift[component] = 0;
    if (d <= 0) return;
    // 1/D is the square of 1/sqrt(D); the shift contains the exponents of D and of kv
    int n = 0;
    const int64_t r = kn_fixed_rsqrt(f->seed, (uint64_t)d, &n), mantissa = round_shift(r * r, 16);
    const int shift = 52 - n - config->kv_shift;
    f->inverse[component] = (int32_t)round_shift(mantissa * config->relax, KN_FIXED_RELAX_FRACTION);
    f->shift[component] = (uint8_t)(shift < 0 ? 0 : shift);
}

// Return the force on one component of a node, load included, and clear the sum of forces for the next iteration.
static int64_t take_residual(kn_fixed *f, int component)
{
    int64_t r = saturate(f->force[component] + f->load[component], KN_FIXED_ACC, &f->flags, KN_FIXED_SAT_REACTION);
    f->force[component] = 0;
    return r;
}

// Take one Jacobi step of a free component with Chebyshev's weight, equation (2) of fixed.h.
static void iterate_component(kn_fixed *f, int component, int32_t omega)
{
    int64_t r = saturate(take_residual(f, component), KN_FIXED_T, &f->flags, KN_FIXED_SAT_RESIDUAL);
    int64_t z = round_shift(r * f->inverse[component], f->shift[component]);
    z = saturate(z, KN_FIXED_U, &f->flags, KN_FIXED_SAT_U);
    int64_t u = f->u[component], last = f->last[component];
    f->last[component] = (int32_t)u;
    u = last + round_shift(omega * (u + z - last), KN_FIXED_OMEGA_FRACTION);
    f->u[component] = (int32_t)saturate(u, KN_FIXED_U, &f->flags, KN_FIXED_SAT_U);
}

// Stage NODE: take one Jacobi step of every free component, and clear the sums of forces of held components.
static void iterate(kn_fixed *f, int32_t omega)
{
    for (int n = 0; n < f->image->config.node_count; n++) {
        for (int k = 0; k < 3; k++) {
            if (f->held[n] >> k & 1) f->force[3 * n + k] = 0;
            else iterate_component(f, 3 * n + k, omega);
        }
    }
}

// Stage COMMIT for the nodes: find the largest residual of the free components, keep the reactions of the held
// components, and advance the positions x by u.
static void commit_nodes(kn_fixed *f, kn_fixed_result *result)
{
    for (int c = 0; c < 3 * f->image->config.node_count; c++) {
        int64_t r = take_residual(f, c), size = r < 0 ? -r : r;
        f->force[c] = r; // if the node is held, r is its reaction
        if (!(f->held[c / 3] >> c % 3 & 1) && size > result->residual) result->residual = size;
        f->x[c] = saturate(f->x[c] + f->u[c], KN_FIXED_X, &f->flags, KN_FIXED_SAT_POSITION);
    }
}

// --- the tick --------------------------------------------------------------------------------------------------------

// Apply one boundary record: hold the node and prescribe its displacement, or add a load to the node.
static void take_bound(kn_fixed *f, const kn_fixed_bound *b)
{
    const kn_fixed_node *node = &f->image->node[b->node];
    for (int k = 0; k < 3; k++) {
        int c = 3 * b->node + k;
        const int64_t load = (int64_t)node->load[k] + b->value[k];
        if (!b->holds) f->load[c] = (int32_t)saturate(load, KN_FIXED_T, &f->flags, KN_FIXED_SAT_REACTION);
        else if (node->held >> k & 1) continue;
        else f->u[c] = (int32_t)saturate(b->value[k], KN_FIXED_U, &f->flags, KN_FIXED_SAT_U);
    }
    if (b->holds) f->held[b->node] = 7;
}

// Start a tick from the image's loads and held components, then apply the boundary list.
static void begin(kn_fixed *f, const kn_fixed_bound *bound, int count)
{
    const kn_fixed_image *image = f->image;
    for (int n = 0; n < image->config.node_count; n++) {
        f->held[n] = image->node[n].held;
        memcpy(f->load + 3 * n, image->node[n].load, sizeof image->node[n].load);
    }
    memset(f->force, 0, 3 * (size_t)image->config.node_count * sizeof *f->force);
    for (int i = 0; i < count; i++) take_bound(f, &bound[i]);
}

// Compute one tick: O passes of K iterations, see the drawing in fixed.h.
static void solve(kn_fixed *f)
{
    const kn_fixed_config *config = &f->image->config;
    for (int pass = 0; pass < config->passes; pass++) {
        for (int e = 0; e < config->edge_count; e++) setup(f, e);
        for (int c = 0; c < 3 * config->node_count; c++) invert(f, c);
        for (int k = 0; k < config->iterations; k++) {
            pull(f);
            if (k == 0) memcpy(f->last, f->u, 3 * (size_t)config->node_count * sizeof *f->last);
            iterate(f, config->omega[k]);
        }
    }
}

void kn_fixed_tick(kn_fixed *f, const kn_fixed_bound *bound, int count, int64_t (*reaction)[3], kn_fixed_result *result)
{
    *result = (kn_fixed_result){0};
    begin(f, bound, count);
    solve(f);
    for (int e = 0; e < f->image->config.edge_count; e++) commit_edge(f, e);
    commit_nodes(f, result);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) reaction[i][k] = bound[i].holds ? f->force[3 * bound[i].node + k] : 0;
    result->flags = f->flags;
}

// --- memory ----------------------------------------------------------------------------------------------------------

// Place the arrays one after the other from `base` on, and return their size in bytes. If `base` is NULL, only measure.
static size_t lay_out(kn_fixed *f, const kn_fixed_image *image, char *base)
{
    const size_t nodes = (size_t)image->config.node_count, edges = (size_t)image->config.edge_count;
    kn_arena a = {.base = base};
    f->x = kn_arena_take(&a, 3 * nodes * sizeof *f->x);
    f->u = kn_arena_take(&a, 3 * nodes * sizeof *f->u);
    f->h = kn_arena_take(&a, edges * sizeof *f->h);
    f->last = kn_arena_take(&a, 3 * nodes * sizeof *f->last);
    f->load = kn_arena_take(&a, 3 * nodes * sizeof *f->load);
    f->inverse = kn_arena_take(&a, 3 * nodes * sizeof *f->inverse);
    f->shift = kn_arena_take(&a, 3 * nodes);
    f->held = kn_arena_take(&a, nodes);
    f->force = kn_arena_take(&a, 3 * nodes * sizeof *f->force);
    f->line = kn_arena_take(&a, edges * sizeof *f->line);
    return a.used;
}

size_t kn_fixed_bytes(const kn_fixed_image *image)
{
    kn_fixed unused;
    return lay_out(&unused, image, NULL);
}

void kn_fixed_rest(kn_fixed *f)
{
    const kn_fixed_image *image = f->image;
    for (int n = 0; n < image->config.node_count; n++) memcpy(f->x + 3 * n, image->node[n].x, sizeof image->node[n].x);
    memset(f->u, 0, 3 * (size_t)image->config.node_count * sizeof *f->u);
    memset(f->h, 0, (size_t)image->config.edge_count * sizeof *f->h);
    f->flags = 0;
}

void kn_fixed_init(kn_fixed *f, const kn_fixed_image *image, void *memory)
{
    *f = (kn_fixed){.image = image};
    memset(memory, 0, lay_out(f, image, memory));
    kn_fixed_seeds(f->seed);
    kn_fixed_rest(f);
}

// --- checks ----------------------------------------------------------------------------------------------------------

static bool within(int64_t v, int64_t least, int64_t most) { return v >= least && v <= most; }

// Check the configuration. This and the checks below return NULL, or a text that names the first value out of range.
static const char *check_config(const kn_fixed_config *c)
{
    if (!within(c->node_count, 1, KN_FIXED_NODES_MAX)) return "node_count outside 1..65535";
    if (!within(c->edge_count, 0, INT32_MAX / 64)) return "edge_count outside 0..2^25";
    if (!within(c->passes, 1, KN_FIXED_PASSES_MAX)) return "passes outside 1..15";
    if (!within(c->iterations, 1, KN_FIXED_ITERATIONS_MAX)) return "iterations outside 1..32";
    if (!within(c->d_shift, 0, 18)) return "d_shift outside 0..18";
    if (!within(c->kv_shift, 0, 40)) return "kv_shift outside 0..40";
    if (!within(c->octave, -64, 63)) return "octave outside -64..63";
    if (!within(c->beta, 0, (1 << KN_FIXED_BETA) - 1)) return "beta outside 0..2^17 - 1";
    if (!within(c->beta_shift, 0, 40)) return "beta_shift outside 0..40";
    if (!within(c->relax, 1, (1 << KN_FIXED_RELAX) - 1)) return "relax outside 1..2^17 - 1";
    for (int k = 0; k < c->iterations; k++)
        if (!within(c->omega[k], 0, 2 << KN_FIXED_OMEGA_FRACTION)) return "omega outside 0..2";
    return NULL;
}

static const char *check_node(const kn_fixed_node *node)
{
    const int64_t far = (int64_t)1 << (KN_FIXED_X - 1), most = 1 << (KN_FIXED_T - 1);
    for (int k = 0; k < 3; k++) {
        if (!within(node->x[k], -far, far - 1)) return "a node's position outside 36 bits";
        if (!within(node->load[k], -most, most - 1)) return "a node's load outside 25 bits";
    }
    return node->held > 7 ? "a node holds more than three components" : NULL;
}

static const char *check_edge(const kn_fixed_config *c, const kn_fixed_edge *edge)
{
    if (edge->i >= c->node_count || edge->j >= c->node_count || edge->i == edge->j) return "an edge without two nodes";
    if (!within(edge->kv, 0, (1 << KN_FIXED_KV) - 1)) return "an edge's kv outside 0..2^17 - 1";
    return within(edge->ia, 1, (1 << KN_FIXED_IA) - 1) ? NULL : "an edge's ia outside 1..2^17 - 1";
}

const char *kn_fixed_check(const kn_fixed_image *image)
{
    const char *wrong = check_config(&image->config);
    for (int n = 0; !wrong && n < image->config.node_count; n++) wrong = check_node(&image->node[n]);
    for (int e = 0; !wrong && e < image->config.edge_count; e++) wrong = check_edge(&image->config, &image->edge[e]);
    for (int i = 0; !wrong && i <= KN_FIXED_SEGMENTS; i++)
        if (!within(image->table[i], 0, 1 << KN_FIXED_R_FRACTION)) wrong = "the table's R outside 0..1";
    return wrong;
}

// --- checksum --------------------------------------------------------------------------------------------------------

// Add the eight bytes of a word, lowest first, to a CRC.
static uint32_t crc_word(uint32_t crc, int64_t word)
{
    for (int byte = 0; byte < 8; byte++) {
        crc ^= (uint32_t)(word >> 8 * byte) & 0xff;
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return crc;
}

uint32_t kn_fixed_crc(const kn_fixed *f)
{
    uint32_t crc = 0xffffffffu;
    for (int c = 0; c < 3 * f->image->config.node_count; c++) crc = crc_word(crc, f->x[c]);
    for (int c = 0; c < 3 * f->image->config.node_count; c++) crc = crc_word(crc, f->u[c]);
    for (int e = 0; e < f->image->config.edge_count; e++) crc = crc_word(crc, f->h[e]);
    return ~crc;
}
