// Engine `golden`: the register map of the circuit, computed by core/fixed.h. A write that requests a tick returns when
// the tick is over.
#include "clients/simdev/engine.h"
#include "core/fixed.h"
#include "hdl/knead_hash.h"
#include "hdl/registers.h"
#include <stdlib.h>
#include <string.h>

typedef struct golden {
    kn_engine_caps caps;
    uint32_t nodes, edges, bounds;        // capacity
    uint32_t reg[KN_REG_BOUND_COUNT + 1]; // registers that are neither FLAGS nor a setting of the image
    kn_fixed_image image;
    kn_fixed fixed;
    kn_fixed_bound *bound;
    int64_t (*reaction)[3];
    void *memory;
} golden;

static uint32_t half(int64_t v, uint32_t which) { return (uint32_t)(v >> 32 * which); }

// Access one half of a 64-bit number. Writing the high half extends the sign of a number of `bits` bits.
static void access_half(int64_t *v, uint32_t which, uint32_t *word, bool write, int bits)
{
    if (!write) *word = half(*v, which);
    else if (which == 0) *v = (int64_t)(((uint64_t)*v & ~(uint64_t)UINT32_MAX) | *word);
    else *v = (int64_t)(((uint64_t)*word << 32 | (uint32_t)*v) << (64 - bits)) >> (64 - bits);
}

// Return the signed number in the lowest `bits` bits of a word.
static int32_t narrow(uint32_t word, int bits) { return (int32_t)(word << (32 - bits)) >> (32 - bits); }

// ---- windows: each function reads or writes one word of a window of hdl/REGISTERS.md, and returns false if there is
// none

static bool node(golden *g, uint32_t at, uint32_t *word, bool write)
{
    uint32_t n = at / 16, w = at % 16;
    if (n >= g->nodes) return false;
    // Words 0..5 are x, 6 is held, 7..9 u, 10..12 load; the index of the component follows from the word.
    kn_fixed_node *rest = &g->image.node[n];
    int64_t *x = &g->fixed.x[3 * n + w / 2 % 3];
    int32_t *u = &g->fixed.u[3 * n + (w + 2) % 3], *load = &rest->load[(w + 2) % 3];
    if (w >= 13) return write || (*word = 0, true);
    if (w < 6) access_half(x, w % 2, word, write, KN_FIXED_X);
    else if (!write) *word = w == 6 ? rest->held : w < 10 ? (uint32_t)*u : (uint32_t)*load;
    else if (w == 6) rest->held = *word & 7;
    else *(w < 10 ? u : load) = narrow(*word, w < 10 ? KN_FIXED_U : KN_FIXED_T);
    return true;
}

static bool rest(golden *g, uint32_t at, uint32_t *word, bool write)
{
    uint32_t n = at / 8, w = at % 8;
    if (n >= g->nodes) return false;
    if (w >= 6) return write || (*word = 0, true);
    access_half(&g->image.node[n].x[w / 2], w % 2, word, write, KN_FIXED_X);
    return true;
}

// Write a word of an edge. Refuse an edge with an end that is not a node.
static bool write_edge(golden *g, uint32_t n, uint32_t w, uint32_t word)
{
    kn_fixed_edge *e = &g->image.edge[n];
    if (w == 0 && ((word & 0xffff) >= g->nodes || word >> 16 >= g->nodes)) return false;
    switch (w) {
    case 0: e->i = (uint16_t)word, e->j = (uint16_t)(word >> 16); break;
    case 1: e->kv = (int32_t)(word & ((1u << KN_FIXED_KV) - 1)); break;
    case 2: e->ia = (int32_t)(word & ((1u << KN_FIXED_IA) - 1)); break;
    case 3:
    case 4: access_half(&g->fixed.h[n], w - 3, &word, true, KN_FIXED_H); break;
    default: break;
    }
    return true;
}

static bool edge(golden *g, uint32_t at, uint32_t *word, bool write)
{
    uint32_t n = at / 8, w = at % 8;
    if (n >= g->edges) return false;
    if (write) return write_edge(g, n, w, *word);
    const kn_fixed_edge *e = &g->image.edge[n];
    const uint32_t words[8] = {(uint32_t)e->i | (uint32_t)e->j << 16, (uint32_t)e->kv, (uint32_t)e->ia,
                               half(g->fixed.h[n], 0), half(g->fixed.h[n], 1)};
    *word = words[w];
    return true;
}

static bool bound(golden *g, uint32_t at, uint32_t *word, bool write)
{
    uint32_t n = at / 4, w = at % 4;
    if (n >= g->bounds) return false;
    kn_fixed_bound *b = &g->bound[n];
    if (write && w == 0 && (*word & 0x7fffffff) >= g->nodes) return false;
    if (!write) *word = w ? (uint32_t)b->value[w - 1] : b->node | (uint32_t)b->holds << 31;
    else if (w == 0) b->node = (uint16_t)*word, b->holds = *word >> 31;
    else b->value[w - 1] = (int32_t)*word;
    return true;
}

static bool table(golden *g, uint32_t at, uint32_t *word, bool write)
{
    if (at > KN_FIXED_SEGMENTS) return false;
    if (write) g->image.table[at] = (int32_t)(*word & ((1u << KN_FIXED_R) - 1));
    else *word = (uint32_t)g->image.table[at];
    return true;
}

// Find the window of an address, from the highest window down, and access the word in this window.
static bool window(golden *g, uint32_t address, uint32_t *word, bool write)
{
    if (address >= KN_WINDOW_EDGES) return edge(g, address - KN_WINDOW_EDGES, word, write);
    if (address >= KN_WINDOW_REST) return rest(g, address - KN_WINDOW_REST, word, write);
    if (address >= KN_WINDOW_NODES) return node(g, address - KN_WINDOW_NODES, word, write);
    if (address >= KN_WINDOW_REACTIONS) {
        uint32_t at = address - KN_WINDOW_REACTIONS;
        if (write || at / 6 >= g->bounds) return false;
        *word = half(g->reaction[at / 6][at % 6 / 2], at % 2);
        return true;
    }
    if (address >= KN_WINDOW_BOUNDS) return bound(g, address - KN_WINDOW_BOUNDS, word, write);
    return address >= KN_WINDOW_TABLE && table(g, address - KN_WINDOW_TABLE, word, write);
}

// ---- registers

// Return a pointer to the setting that a register holds, or NULL if the register holds no setting.
static int32_t *config_of(golden *g, uint32_t address)
{
    kn_fixed_config *c = &g->image.config;
    int32_t *const at[] = {&c->node_count, &c->edge_count, &c->passes, &c->iterations, &c->d_shift,
                           &c->kv_shift,   &c->octave,     &c->beta,   &c->beta_shift, &c->relax};
    if (address >= KN_REG_OMEGA && address < KN_REG_OMEGA + KN_FIXED_ITERATIONS_MAX)
        return &c->omega[address - KN_REG_OMEGA];
    return address >= KN_REG_NODE_COUNT && address <= KN_REG_RELAX ? at[address - KN_REG_NODE_COUNT] : NULL;
}

// Return the number of bits of a register, or 0 if there is no register at this address.
static int bits_of(uint32_t address)
{
    if (address >= KN_REG_OMEGA) return KN_FIXED_OMEGA;
    switch (address) {
#define KN_BITS(name, at, access, bits, what)                                                                          \
    case at: return bits;
        KN_REGISTERS(KN_BITS)
#undef KN_BITS
    default: return 0;
    }
}

// Step one tick. The register CYCLES gets the number of clock cycles that the circuit would need.
static void tick(golden *g)
{
    const kn_fixed_config *c = &g->image.config;
    kn_fixed_result result;
    kn_fixed_tick(&g->fixed, g->bound, (int)g->reg[KN_REG_BOUND_COUNT], g->reaction, &result);
    g->reg[KN_REG_TICK]++;
    g->reg[KN_REG_RESIDUAL_LO] = half(result.residual, 0);
    g->reg[KN_REG_RESIDUAL_HI] = half(result.residual, 1);
    g->reg[KN_REG_RESULT_FLAGS] = result.flags;
    g->reg[KN_REG_CYCLES] = kn_engine_clocks((uint32_t)c->node_count, (uint32_t)c->edge_count,
                                             g->reg[KN_REG_BOUND_COUNT], (uint32_t)c->passes, (uint32_t)c->iterations);
    if (g->reg[KN_REG_CYCLES] > g->reg[KN_REG_CYCLES_MAX]) g->reg[KN_REG_CYCLES_MAX] = g->reg[KN_REG_CYCLES];
}

// Handle a write to the doorbell STEP_SEQ. Writing its present value plus 1 steps a tick if an object is loaded.
// Writing its present value again has no effect.
static void step(golden *g, uint32_t seq)
{
    if (seq == g->reg[KN_REG_STEP_SEQ]) return;
    if (seq != g->reg[KN_REG_STEP_SEQ] + 1) {
        g->reg[KN_REG_STATUS] |= KN_STATUS_SEQ;
    } else if (!(g->reg[KN_REG_STATUS] & KN_STATUS_LOADED)) {
        g->reg[KN_REG_STATUS] |= KN_STATUS_EMPTY;
    } else {
        g->reg[KN_REG_STEP_SEQ] = seq;
        tick(g);
    }
}

// Execute the commands in a word that was written to CONTROL. Each bit is a command.
static void control(golden *g, uint32_t what)
{
    if (what & KN_CONTROL_REST) {
        // The command REST keeps the flags, because only the command CLEAR clears them.
        uint32_t flags = g->fixed.flags;
        kn_fixed_rest(&g->fixed);
        g->fixed.flags = flags;
        g->reg[KN_REG_TICK] = 0;
    }
    // Do not mark an invalid image as loaded: a step would follow its indices into memory outside the arrays.
    if (what & KN_CONTROL_LOADED) {
        g->reg[KN_REG_STATUS] &= ~(uint32_t)KN_STATUS_LOADED;
        if (!kn_fixed_check(&g->image)) g->reg[KN_REG_STATUS] |= KN_STATUS_LOADED;
        g->reg[KN_REG_TICK] = 0;
    }
    if (what & KN_CONTROL_CLEAR) g->fixed.flags = 0, g->reg[KN_REG_CYCLES_MAX] = 0;
    if (what & KN_CONTROL_CRC) g->reg[KN_REG_STATE_CRC] = kn_fixed_crc(&g->fixed);
}

// Read a register. Return false if there is no register at this address.
static bool read_register(golden *g, uint32_t address, uint32_t *word)
{
    const int32_t *config = config_of(g, address);
    if (config) *word = (uint32_t)*config & ((1u << bits_of(address)) - 1);
    else if (address == KN_REG_FLAGS) *word = g->fixed.flags;
    else if (address <= KN_REG_BOUND_COUNT) *word = g->reg[address];
    else return false;
    return true;
}

// Write a setting, and clear the status LOADED. Return false if the value has too many bits or exceeds the capacity.
static bool write_config(golden *g, int32_t *config, uint32_t address, uint32_t word)
{
    if (word >> bits_of(address)) return false;
    if ((address == KN_REG_NODE_COUNT && word > g->nodes) || (address == KN_REG_EDGE_COUNT && word > g->edges))
        return false;
    g->reg[KN_REG_STATUS] &= ~(uint32_t)KN_STATUS_LOADED;
    *config = address == KN_REG_OCTAVE ? narrow(word, 7) : (int32_t)word;
    return true;
}

// Write a register. Return false if it is read-only, or if the value has too many bits or exceeds the capacity.
static bool write_register(golden *g, uint32_t address, uint32_t word)
{
    int32_t *config = config_of(g, address);
    if (config) return write_config(g, config, address, word);
    int bits = bits_of(address);
    if (bits < 32 && word >> bits) return false;
    switch (address) {
    case KN_REG_CONTROL: control(g, word); return true;
    case KN_REG_STATUS: g->reg[KN_REG_STATUS] &= ~(word & (KN_STATUS_SEQ | KN_STATUS_EMPTY)); return true;
    case KN_REG_FLAGS: g->fixed.flags &= ~word; return true;
    case KN_REG_SCRATCH: g->reg[KN_REG_SCRATCH] = word; return true;
    case KN_REG_STEP_SEQ: step(g, word); return true;
    case KN_REG_BOUND_COUNT:
        if (word >= 1u << g->caps.bounds || word > KN_FIXED_LIST_MAX) return false;
        g->reg[KN_REG_BOUND_COUNT] = word;
        return true;
    default: return false;
    }
}

static bool bus_read(void *self, uint32_t address, uint32_t *word)
{
    return address < KN_WINDOW_TABLE ? read_register(self, address, word) : window(self, address, word, false);
}

static bool bus_write(void *self, uint32_t address, uint32_t word)
{
    return address < KN_WINDOW_TABLE ? write_register(self, address, word) : window(self, address, &word, true);
}

// ---- power

// Switch the power on: all memory is zero, and no object is loaded.
static void blank(void *self)
{
    golden *g = self;
    kn_fixed_node *nodes = g->image.node;
    kn_fixed_edge *edges = g->image.edge;
    memset(nodes, 0, g->nodes * sizeof *nodes);
    memset(edges, 0, g->edges * sizeof *edges);
    memset(g->bound, 0, g->bounds * sizeof *g->bound);
    memset(g->reaction, 0, g->bounds * sizeof *g->reaction);
    g->image = (kn_fixed_image){
        .config = {.node_count = (int32_t)g->nodes, .edge_count = (int32_t)g->edges}, .node = nodes, .edge = edges};
    kn_fixed_init(&g->fixed, &g->image, g->memory); // lay the arrays out for the largest image
    g->image.config = (kn_fixed_config){0};
    memset(g->reg, 0, sizeof g->reg);
    g->reg[KN_REG_ID] = KN_ENGINE_ID;
    g->reg[KN_REG_VERSION] = KN_ENGINE_VERSION;
    g->reg[KN_REG_BUILD_HASH] = KN_BUILD_HASH;
    g->reg[KN_REG_CAPS] = (uint32_t)(g->caps.nodes | g->caps.edges << 8 | g->caps.bounds << 16);
}

// Step a tick that no host has requested, for the fault `torn`.
static void stray(void *self)
{
    golden *g = self;
    if (g->reg[KN_REG_STATUS] & KN_STATUS_LOADED) tick(g);
}

static void destroy(void *self)
{
    golden *g = self;
    free(g->image.node);
    free(g->image.edge);
    free(g->bound);
    free(g->reaction);
    free(g->memory);
    free(g);
}

bool kn_engine_golden(kn_engine *engine, kn_engine_caps caps)
{
    golden *g = calloc(1, sizeof *g);
    if (!g) return false;
    g->caps = caps;
    g->nodes = 1u << caps.nodes;
    if (g->nodes > KN_FIXED_NODES_MAX) g->nodes = KN_FIXED_NODES_MAX;
    g->edges = 1u << caps.edges;
    g->bounds = 1u << caps.bounds;
    const kn_fixed_image most = {.config = {.node_count = (int32_t)g->nodes, .edge_count = (int32_t)g->edges}};
    g->image.node = calloc(g->nodes, sizeof *g->image.node);
    g->image.edge = calloc(g->edges, sizeof *g->image.edge);
    g->bound = calloc(g->bounds, sizeof *g->bound);
    g->reaction = calloc(g->bounds, sizeof *g->reaction);
    g->memory = aligned_alloc(64, kn_fixed_bytes(&most));
    if (!g->image.node || !g->image.edge || !g->bound || !g->reaction || !g->memory) return destroy(g), false;
    blank(g);
    *engine = (kn_engine){"golden", {g, bus_read, bus_write}, blank, stray, NULL, destroy};
    return true;
}
