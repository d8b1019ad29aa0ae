// Compare the circuit with core/fixed in random lattices: every number of every tick. KN_MODELS=N, KN_SEED=N. Through a
// board's top (hdl/sim/ports.h) the lattices are small, since a word takes a serial line a thousand clocks. Exit 1 at a
// mismatch, and print the seed of the model that shows it.
#include <algorithm>

#include "hdl/sim/ports.h"

extern "C" {
#include "core/fixed.h"
}
#include "knead_hash.h"

namespace
{

enum { LIST = (1 << LOG_LIST) - 1 };
enum { STAR = 2300 }; // edges on one node, more than 2^35/2^24

// --- random numbers --------------------------------------------------------------------------------------------------

chance dice;
uint64_t model_seed;

// Random numbers: least <= number <= most; true in one of n calls; signed with `most` bits.
int64_t between(int64_t least, int64_t most) { return least + (int64_t)(dice() % (uint64_t)(most - least + 1)); }
bool one_in(uint32_t n) { return dice.below(n) == 0; }
int64_t bits(int most) { return between(-(INT64_C(1) << most), (INT64_C(1) << most) - 1); }

// --- the circuit behind its bus --------------------------------------------------------------------------------------

struct device : host {
    uint32_t seq = 0;

    device() : host((int)dice.below(INT32_MAX)) {}
    void put64(uint32_t address, int64_t v)
    {
        put(address, v);
        put(address + 1, v >> 32);
    }
    int64_t get64(uint32_t address)
    {
        uint64_t low = get(address);
        return (int64_t)(low | (uint64_t)get(address + 1) << 32);
    }
    void step() { put(KN_REG_STEP_SEQ, ++seq); }
};

// --- a lattice and its twin ------------------------------------------------------------------------------------------

// A random lattice and the state of its twin in C.
struct lattice {
    kn_fixed_image image{};
    std::vector<kn_fixed_node> node;
    std::vector<kn_fixed_edge> edge;
    std::vector<uint64_t> memory;
    kn_fixed fixed{};

    void init()
    {
        image.node = node.data();
        image.edge = edge.data();
        if (const char *wrong = kn_fixed_check(&image)) {
            fprintf(stderr, "the bench's own model: %s\n", wrong);
            exit(2);
        }
        memory.assign(kn_fixed_bytes(&image) / 8 + 8, 0);
        void *aligned = (void *)(((uintptr_t)memory.data() + 63) / 64 * 64);
        kn_fixed_init(&fixed, &image, aligned);
    }
};

// Choose a configuration. wild: anything that kn_fixed_check admits. Otherwise values with which few numbers saturate.
void make_config(kn_fixed_config &c, bool wild)
{
    c.passes = (int32_t)between(1, one_in(20) ? 15 : 3);
    c.iterations = (int32_t)between(1, one_in(20) ? 32 : 6);
    c.d_shift = (int32_t)between(0, 18);
    c.kv_shift = (int32_t)(wild ? between(0, 40) : between(12, 24));
    c.octave = (int32_t)(wild ? between(-64, 63) : between(8, 24));
    c.beta = (int32_t)between(0, (1 << KN_FIXED_BETA) - 1);
    c.beta_shift = (int32_t)(wild ? between(0, 40) : between(8, 20));
    c.relax = (int32_t)between(1, (1 << KN_FIXED_RELAX) - 1);
    for (int k = 0; k < KN_FIXED_ITERATIONS_MAX; k++)
        c.omega[k] = (int32_t)(wild ? between(0, 2 << KN_FIXED_OMEGA_FRACTION) : between(1 << 15, 3 << 15));
}

// Choose the nodes and edges that the configuration counts, and the table.
void populate(lattice &l, bool wild)
{
    const kn_fixed_config &c = l.image.config;
    const int size = wild         ? (int)between(0, KN_FIXED_X - 1)
                     : one_in(10) ? c.d_shift + (int)between(0, 2) // edges a few units long
                                  : c.d_shift + (int)between(8, 15);
    const int load = wild ? (int)between(0, KN_FIXED_T - 1) : 10;
    l.node.resize((size_t)c.node_count);
    for (kn_fixed_node &n : l.node) {
        for (int k = 0; k < 3; k++) {
            n.x[k] = one_in(30) && wild ? 0 : bits(size);
            n.load[k] = (int32_t)bits(load);
        }
        n.held = one_in(6) ? (uint8_t)between(0, 7) : 0;
    }
    l.edge.resize((size_t)c.edge_count);
    const kn_fixed_edge *last = nullptr;
    for (kn_fixed_edge &e : l.edge) {
        // Use the nodes of the edge before, in both roles, in a third of the cases: the sums must forward.
        for (uint16_t *end : {&e.i, &e.j})
            *end = last && one_in(3) ? (one_in(2) ? last->i : last->j) : (uint16_t)between(0, c.node_count - 1);
        if (e.i == e.j) e.j = (uint16_t)((e.i + 1) % c.node_count);
        e.kv = (int32_t)(one_in(12) ? between(0, 1) * ((1 << KN_FIXED_KV) - 1) : between(0, (1 << KN_FIXED_KV) - 1));
        e.ia = (int32_t)(one_in(12) ? 1 : between(1, (1 << KN_FIXED_IA) - 1));
        last = &e;
    }
    const bool falling = one_in(2);
    for (int i = 0; i <= KN_FIXED_SEGMENTS; i++)
        l.image.table[i] = (int32_t)(falling ? (1 << 17) - i * 200 : one_in(9) ? 1 << 17 : between(0, 1 << 17));
}

void make_model(lattice &l, bool wild)
{
    kn_fixed_config &c = l.image.config;
    make_config(c, wild);
    c.node_count = (int32_t)between(2, one_in(8) && !SMALL ? 1 << LOG_NODES : 24);
    c.edge_count = (int32_t)between(one_in(10) ? 0 : 1, SMALL ? 40 : one_in(8) ? 600 : 90);
    populate(l, wild);
}

// Set a state that no tick has made.
void stir(lattice &l, bool wild)
{
    const kn_fixed_config &c = l.image.config;
    const int u = wild ? (int)between(0, KN_FIXED_U - 1) : 12, h = wild ? (int)between(0, KN_FIXED_H - 1) : 28;
    for (int n = 0; n < 3 * c.node_count; n++) l.fixed.u[n] = (int32_t)bits(u);
    for (int e = 0; e < c.edge_count; e++) l.fixed.h[e] = wild && one_in(4) ? (INT64_C(1) << 35) - 1 : bits(h);
    if (wild)
        // Put some components at the limits of X.
        for (int n = 0; n < 3 * c.node_count; n++)
            l.fixed.x[n] =
                one_in(4) ? (one_in(2) ? (INT64_C(1) << 35) - 1 : -(INT64_C(1) << 35)) : bits(KN_FIXED_X - 1);
}

// Load circuit and twin with the lattice at rest.
void load(device &d, lattice &l)
{
    l.init();
    const kn_fixed_config &c = l.image.config;
    const int32_t settings[] = {c.node_count, c.edge_count,   c.passes, c.iterations, c.d_shift,
                                c.kv_shift,   c.octave & 127, c.beta,   c.beta_shift, c.relax};
    for (uint32_t r = 0; r < 10; r++) d.put(KN_REG_NODE_COUNT + r, settings[r]);
    for (int k = 0; k < c.iterations; k++) d.put((uint32_t)(KN_REG_OMEGA + k), c.omega[k]);
    for (uint32_t n = 0; n < l.node.size(); n++) {
        const uint32_t at = KN_WINDOW_NODES + 16 * n;
        for (uint32_t k = 0; k < 3; k++) {
            d.put64(KN_WINDOW_REST + 8 * n + 2 * k, l.node[n].x[k]);
            d.put(at + 10 + k, l.node[n].load[k]);
        }
        d.put(at + 6, l.node[n].held);
    }
    for (uint32_t e = 0; e < l.edge.size(); e++) {
        const uint32_t at = KN_WINDOW_EDGES + 8 * e;
        d.put(at, l.edge[e].i | (int64_t)l.edge[e].j << 16);
        d.put(at + 1, l.edge[e].kv);
        d.put(at + 2, l.edge[e].ia);
    }
    for (uint32_t i = 0; i <= KN_FIXED_SEGMENTS; i++) d.put(KN_WINDOW_TABLE + i, l.image.table[i]);
    d.put(KN_REG_CONTROL, KN_CONTROL_REST | KN_CONTROL_CLEAR | KN_CONTROL_LOADED);
    d.wait();
}

// Write x, u and h of the twin to the circuit.
void put_state(device &d, const lattice &l)
{
    for (uint32_t n = 0; n < l.node.size(); n++) {
        for (uint32_t k = 0; k < 3; k++) {
            d.put64(KN_WINDOW_NODES + 16 * n + 2 * k, l.fixed.x[3 * n + k]);
            d.put(KN_WINDOW_NODES + 16 * n + 7 + k, l.fixed.u[3 * n + k]);
        }
    }
    for (uint32_t e = 0; e < l.edge.size(); e++) d.put64(KN_WINDOW_EDGES + 8 * e + 3, l.fixed.h[e]);
    d.put(KN_REG_CONTROL, KN_CONTROL_LOADED);
}

// --- comparing -------------------------------------------------------------------------------------------------------

int mismatches, flag_reached[7];

// Count a mismatch and print the first twenty.
void same(const char *what, int64_t index, int64_t device, int64_t twin)
{
    if (device == twin) return;
    if (mismatches++ < 20)
        fprintf(stderr, "model %llu: %s %lld: device %lld, twin %lld\n", (unsigned long long)model_seed, what,
                (long long)index, (long long)device, (long long)twin);
}

// Compare the state, word by word and by its CRC.
void compare(device &d, const lattice &l)
{
    for (uint32_t n = 0; n < l.node.size(); n++) {
        for (uint32_t k = 0; k < 3; k++) {
            same("x", n, d.get64(KN_WINDOW_NODES + 16 * n + 2 * k), l.fixed.x[3 * n + k]);
            same("u", n, (int32_t)d.get(KN_WINDOW_NODES + 16 * n + 7 + k), l.fixed.u[3 * n + k]);
        }
    }
    for (uint32_t e = 0; e < l.edge.size(); e++) same("h", e, d.get64(KN_WINDOW_EDGES + 8 * e + 3), l.fixed.h[e]);
    d.put(KN_REG_CONTROL, KN_CONTROL_CRC);
    d.wait();
    same("STATE_CRC", 0, d.get(KN_REG_STATE_CRC), kn_fixed_crc(&l.fixed));
}

// Run one tick on both and compare reactions, residual, flags, clocks and tick number. The reactions behind the list
// must stay as they were.
void tick(device &d, lattice &l, const std::vector<kn_fixed_bound> &bound)
{
    const int count = (int)bound.size();
    const kn_fixed_config &c = l.image.config;
    d.put(KN_REG_BOUND_COUNT, count);
    for (uint32_t b = 0; b < bound.size(); b++) {
        d.put(KN_WINDOW_BOUNDS + 4 * b, bound[b].node | (int64_t)bound[b].holds << 31);
        for (uint32_t k = 0; k < 3; k++) d.put(KN_WINDOW_BOUNDS + 4 * b + 1 + k, bound[b].value[k]);
    }
    const uint32_t ticks = d.get(KN_REG_TICK), behind = KN_WINDOW_REACTIONS + 6 * (uint32_t)count;
    const int64_t kept[2] = {d.get64(behind), count < LIST ? d.get64(behind + 6) : 0};
    d.step();
    int64_t reaction[LIST][3];
    kn_fixed_result result;
    kn_fixed_tick(&l.fixed, bound.data(), count, reaction, &result);
    d.wait();

    for (uint32_t b = 0; b < bound.size(); b++)
        for (uint32_t k = 0; k < 3; k++)
            same("reaction", b, d.get64(KN_WINDOW_REACTIONS + 6 * b + 2 * k), reaction[b][k]);
    same("reaction behind the list", 0, d.get64(behind), kept[0]);
    if (count < LIST) same("reaction behind the list", 1, d.get64(behind + 6), kept[1]);
    same("residual", 0, d.get64(KN_REG_RESIDUAL_LO), result.residual);
    same("flags", 0, d.get(KN_REG_FLAGS), result.flags);
    same("flags of the tick", 0, d.get(KN_REG_RESULT_FLAGS), result.flags);
    same("CYCLES", 0, d.get(KN_REG_CYCLES),
         kn_engine_clocks((uint32_t)c.node_count, (uint32_t)c.edge_count, (uint32_t)count, (uint32_t)c.passes,
                          (uint32_t)c.iterations));
    same("TICK", 0, d.get(KN_REG_TICK), ticks + 1);
    for (int f = 0; f < 7; f++) flag_reached[f] += (int)(result.flags >> f & 1);
}

// Return a random boundary list in which no node occurs twice.
std::vector<kn_fixed_bound> some_bounds(const lattice &l, bool wild)
{
    std::vector<kn_fixed_bound> list;
    std::vector<uint16_t> nodes;
    for (int n = 0; n < l.image.config.node_count; n++) nodes.push_back((uint16_t)n);
    const int64_t count = between(0, std::min<int64_t>(LIST, (int64_t)nodes.size()));
    const int size = wild ? (int)between(0, 31) : 14;
    for (int64_t b = 0; b < count; b++) {
        std::swap(nodes[(size_t)b], nodes[(size_t)between(b, (int64_t)nodes.size() - 1)]);
        kn_fixed_bound record = {nodes[(size_t)b], one_in(2), {0, 0, 0}};
        for (int k = 0; k < 3; k++) record.value[k] = (int32_t)bits(size);
        list.push_back(record);
    }
    return list;
}

// --- tests -----------------------------------------------------------------------------------------------------------

// One random lattice: load, sometimes set a state, up to four ticks, then compare state and CRC.
void try_model(device &d, uint64_t seed)
{
    dice.seed(model_seed = seed);
    lattice l;
    const bool wild = one_in(3);
    make_model(l, wild);
    load(d, l);
    if (one_in(2)) {
        stir(l, wild);
        put_state(d, l);
    }
    for (int64_t ticks = between(1, 4); ticks > 0; ticks--) tick(d, l, some_bounds(l, wild));
    compare(d, l);
    if (one_in(8)) { // rest must give the initial state again
        d.put(KN_REG_CONTROL, KN_CONTROL_REST | KN_CONTROL_CLEAR);
        d.wait();
        kn_fixed_rest(&l.fixed);
        compare(d, l);
        same("TICK at rest", 0, d.get(KN_REG_TICK), 0);
    }
}

// Two nodes with many edges between them, and R = 1.
void make_star(lattice &l)
{
    kn_fixed_config &c = l.image.config;
    make_config(c, false);
    c.node_count = 2;
    c.edge_count = STAR;
    c.d_shift = 0;
    l.node.resize(2);
    for (int32_t &ratio : l.image.table) ratio = 1 << 17;
}

// Sums beyond 36 bits: more edges than 2^35/2^24 on one node, each at its largest tension.
void try_star(device &d, uint32_t axis)
{
    dice.seed(model_seed = 0);
    lattice l;
    make_star(l);
    kn_fixed_config &c = l.image.config;
    c.passes = c.iterations = 2;
    c.relax = 1; // free nodes hardly move, so that the residual is as large as it can be, too
    c.kv_shift = 0;
    l.node[1].x[axis] = 1000;
    for (int e = 0; e < c.edge_count; e++) {
        uint16_t i = (uint16_t)(e & 1);
        l.edge.push_back({i, (uint16_t)(1 - i), (1 << KN_FIXED_KV) - 1, 1});
    }
    load(d, l);
    std::vector<kn_fixed_bound> bound = {{0, true, {0, 0, 0}}, {1, true, {0, 0, 0}}};
    bound[1].value[axis] = 1 << 20;
    tick(d, l, bound);
    same("a sum at its limit", axis, d.get64(KN_WINDOW_REACTIONS + 2 * axis), (INT64_C(1) << 35) - 1);
    for (int32_t pull : {1 << 20, -(1 << 20)}) {
        bound = {{1, true, {5, 5, 5}}};
        bound[0].value[axis] = pull;
        tick(d, l, bound);
        same("a residual at its limit", pull, d.get64(KN_REG_RESIDUAL_LO), (INT64_C(1) << 35) - (pull > 0));
    }
    compare(d, l);
}

// As many nodes, edges and records as there is room for, and OMEGA at its limit.
void try_full(device &d)
{
    dice.seed(model_seed = 0);
    lattice l;
    kn_fixed_config &c = l.image.config;
    make_config(c, false);
    c.node_count = 1 << LOG_NODES;
    c.edge_count = 1 << LOG_EDGES;
    c.passes = c.iterations = 2;
    c.omega[0] = c.omega[1] = 2 << KN_FIXED_OMEGA_FRACTION;
    populate(l, false);
    load(d, l);
    std::vector<kn_fixed_bound> bound;
    do bound = some_bounds(l, false);
    while (bound.size() < LIST);
    for (int ticks = 0; ticks < 2; ticks++) tick(d, l, bound);
    compare(d, l);
}

// Two nodes that nearly fill the sums of D, in every direction, with nearly all of it in one end's sums.
void try_heavy(device &d, uint64_t seed)
{
    dice.seed(model_seed = seed);
    lattice l;
    make_star(l);
    kn_fixed_config &c = l.image.config;
    c.passes = 15; // each pass has sums of its own
    c.iterations = 1;
    c.kv_shift = 25;
    const bool turned = one_in(2);
    for (int n = 0; n < 2; n++)
        for (int k = 0; k < 3; k++) {
            l.node[(size_t)n].x[k] = (n ? 1 : -1) * between(9000, 10000);
            l.node[(size_t)n].load[k] = (int32_t)bits(KN_FIXED_T - 3);
        }
    for (int e = 0; e < c.edge_count; e++) {
        const bool from = turned != one_in(40);
        l.edge.push_back({from, !from, (int32_t)((1 << KN_FIXED_KV) - between(1, 1 << 10)), 1});
    }
    load(d, l);
    for (int ticks = 0; ticks < 3; ticks++) tick(d, l, {});
    compare(d, l);
}

bool refused(device &d, bool write, uint32_t address, uint32_t word = 0) { return !d.transfer(write, address, &word); }

// Test the transfers that a busy engine refuses. hdl/sim/registers.cpp compares all others with the simulated device.
void try_bus()
{
    device d;
    lattice l;
    do make_model(l, false);
    while (l.image.config.edge_count < 60);
    load(d, l);
    same("STATUS at rest", 0, d.get(KN_REG_STATUS), KN_STATUS_LOADED);
    tick(d, l, some_bounds(l, false));

    d.step();
    same("STATUS at work", 0, d.get(KN_REG_STATUS), KN_STATUS_BUSY | KN_STATUS_LOADED);
    for (uint32_t window :
         {KN_WINDOW_NODES, KN_WINDOW_EDGES, KN_WINDOW_TABLE, KN_WINDOW_BOUNDS, KN_WINDOW_REACTIONS, KN_WINDOW_REST}) {
        same("window read at work", window, refused(d, false, window), 1);
        same("window written at work", window, refused(d, true, window), 1);
    }
    for (uint32_t reg = KN_REG_NODE_COUNT; reg <= KN_REG_BOUND_COUNT; reg++)
        same("register written at work", reg, refused(d, true, reg, 1), 1);
    same("register written at work", KN_REG_CONTROL, refused(d, true, KN_REG_CONTROL, 1), 1);
    same("register written at work", KN_REG_OMEGA, refused(d, true, KN_REG_OMEGA, 1), 1);
    same("next step at work", 0, refused(d, true, KN_REG_STEP_SEQ, d.seq + 1), 1);
    d.put(KN_REG_STEP_SEQ, d.seq); // the number of the running step
    same("STATUS at work", 0, d.get(KN_REG_STATUS), KN_STATUS_BUSY | KN_STATUS_LOADED);
    d.wait();
    same("TICK", 0, d.get(KN_REG_TICK), 2);
    d.put(KN_REG_CONTROL, KN_CONTROL_CLEAR);
    same("CYCLES_MAX", 0, d.get(KN_REG_CYCLES_MAX), 0);
    same("FLAGS", 0, d.get(KN_REG_FLAGS), 0);
}

} // namespace

int main(int argc, char **argv)
{
    Verilated::commandArgs(argc, argv);
    const long models = from_environment("KN_MODELS", 1000), seed = from_environment("KN_SEED", 1);
    dice.seed((uint64_t)seed);
    if (!SMALL) try_bus();
    device d;
    if (!SMALL) try_full(d);
    for (uint32_t axis = 0; !SMALL && axis < 3; axis++) try_star(d, axis);
    long tried = 0;
    for (; tried < models && mismatches == 0; tried++)
        (!SMALL && tried % 20 == 1 ? try_heavy : try_model)(d, (uint64_t)(seed * 1000003 + tried));
    printf("seed %ld: %ld models, %llu clocks, %d mismatches; ticks with a flag", seed, tried,
           (unsigned long long)d.clocks, mismatches);
    bool all = true;
    for (int reached : flag_reached) {
        printf(" %d", reached);
        all = all && reached > 0;
    }
    printf("\n");
    if (models >= 100 && !all) fprintf(stderr, "a flag was never reached\n");
    return mismatches > 0 || (models >= 100 && !all);
}
