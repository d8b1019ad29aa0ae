// Compare the circuit's registers and windows with the simulated device's (clients/simdev/golden.c). For any request of
// a host both give the same answer or refuse alike. KN_CASES=N transfers, KN_SEED=N.
#include "hdl/sim/ports.h"

extern "C" {
#include "clients/simdev/engine.h"
#include "core/fixed.h"
}

namespace
{

// Return a random address: in or just behind each window, or a register.
uint32_t some_place(chance &c)
{
    switch (c.below(10)) {
    case 0: return KN_WINDOW_TABLE + c.below(KN_FIXED_SEGMENTS + 3);
    case 1: return KN_WINDOW_BOUNDS + c.below((4 << LOG_LIST) + 2);
    case 2: return KN_WINDOW_REACTIONS + c.below((6 << LOG_LIST) + 2);
    case 3: return KN_WINDOW_NODES + c.below((16 << LOG_NODES) + 2);
    case 4: return KN_WINDOW_REST + c.below((8 << LOG_NODES) + 2);
    case 5: return KN_WINDOW_EDGES + c.below((8 << LOG_EDGES) + 2);
    case 6: return c.below(40) == 0 ? KN_REG_NODE_COUNT + c.below(12) : c.word() & 0xffffff;
    case 7: return c.below(40) == 0 ? KN_REG_OMEGA + c.below(33) : c.below(0x10);
    case 8: return c.below(3) ? KN_REG_STEP_SEQ : KN_REG_CONTROL;
    default: return c.below(0x20);
    }
}

// Return a random word that is often one that the address accepts, or one bit.
uint32_t some_word(chance &c, uint32_t address, uint32_t seq)
{
    // Record n has node n or a node that does not exist, so that no node stands in the list twice.
    if (address >> 16 == KN_WINDOW_BOUNDS >> 16 && address % 4 == 0)
        return c.below(2) ? (address / 4) % (1 << LOG_LIST) | c.below(2) << 31
                          : c.word() | 1u << (LOG_NODES + c.below(31 - LOG_NODES));
    if (address == KN_REG_STEP_SEQ) return c.below(4) ? seq + 1 : c.below(2) ? seq : c.word();
    if (address == KN_REG_CONTROL) return c.below(4) ? 8 | c.below(8) : c.below(32);
    if (c.below(address < KN_WINDOW_TABLE ? 2 : 8) == 0) return 1u << c.below(32);
    if (address >= KN_REG_OMEGA && address < KN_REG_OMEGA + KN_FIXED_ITERATIONS_MAX) return c.below(2 << 16);
    if (address >= KN_WINDOW_EDGES && address % 8 == 0 && c.below(8)) return c.below(8) | c.below(8) << 16;
    if (address >= KN_WINDOW_TABLE && address < KN_WINDOW_BOUNDS) return c.below((1 << 17) + 1);
    if (address < KN_WINDOW_TABLE && c.below(8)) return c.below(c.below(2) ? 5 : 41);
    return c.word();
}

void put_both(host &d, const kn_word_bus &g, uint32_t address, uint32_t word)
{
    d.put(address, word);
    g.write(g.self, address, word);
}

// Load both with a chain of edges and zeros, so that no memory holds undefined values.
void load(host &d, const kn_word_bus &g)
{
    const auto put = [&](uint32_t address, uint32_t word) { put_both(d, g, address, word); };
    for (uint32_t n = 0; n < 16 << LOG_NODES; n++) put(KN_WINDOW_NODES + n, 0);
    for (uint32_t n = 0; n < 8 << LOG_NODES; n++) put(KN_WINDOW_REST + n, n * 977);
    for (uint32_t e = 0; e < 1 << LOG_EDGES; e++)
        for (uint32_t w = 0; w < 8; w++) put(KN_WINDOW_EDGES + 8 * e + w, w ? 1 : e % 7 | (e % 7 + 1) << 16);
    for (uint32_t i = 0; i <= KN_FIXED_SEGMENTS; i++) put(KN_WINDOW_TABLE + i, 1 << 16);
    for (uint32_t b = 0; b < 4 << LOG_LIST; b++) put(KN_WINDOW_BOUNDS + b, b / 4);
    for (uint32_t k = 0; k < KN_FIXED_ITERATIONS_MAX; k++) put(KN_REG_OMEGA + k, 1 << 16);
    const uint32_t config[] = {8, 16, 2, 2, 1, 3, 4, 5, 6, 7, 3};
    for (uint32_t r = 0; r < 11; r++) put(KN_REG_NODE_COUNT + r, config[r]);
    put(KN_REG_CONTROL, KN_CONTROL_REST | KN_CONTROL_CLEAR | KN_CONTROL_LOADED);
    d.wait();
    put(KN_REG_STEP_SEQ, d.get(KN_REG_STEP_SEQ) + 1); // a step, so that the results are those of a tick
    d.wait();
}

} // namespace

int main()
{
    chance c(static_cast<uint64_t>(from_environment("KN_SEED", 1)));
    const long cases = from_environment("KN_CASES", 300000);
    kn_engine golden;
    if (!kn_engine_golden(&golden, {LOG_NODES, LOG_EDGES, LOG_LIST})) return 3;
    const kn_word_bus &g = golden.bus;
    host d(0);
    load(d, g);
    long refused = 0, ticks = 0, unsound = 0;
    // The circuit checks only its settings, the simulated device also the image: an edge from a node to itself, R
    // above 1. The ticks of such an image have no defined result.
    const auto difference = [&] {
        uint32_t status = 0;
        g.read(g.self, KN_REG_STATUS, &status);
        return status ^ d.get(KN_REG_STATUS);
    };
    const auto alike = [&](bool image) {
        if (!image || difference() != KN_STATUS_LOADED) return difference() == 0;
        put_both(d, g, KN_REG_EDGE_COUNT, 0); // without edges, and with R = 1/2, the settings alone decide
        for (uint32_t i = 0; i <= KN_FIXED_SEGMENTS; i++) put_both(d, g, KN_WINDOW_TABLE + i, 1 << 16);
        put_both(d, g, KN_REG_CONTROL, KN_CONTROL_LOADED);
        const bool same = difference() == 0;
        load(d, g);
        unsound++;
        return same;
    };
    for (long n = 0; n < cases; n++) {
        const uint32_t address = some_place(c) ^ (c.below(8) ? 0 : 1u << c.below(24)); // or an address one bit away
        const bool write = c.below(2);
        if (n % 400 == 399) load(d, g);
        // before a step let both check the image again
        if (write && address == KN_REG_STEP_SEQ && d.get(KN_REG_STATUS) & KN_STATUS_LOADED) {
            put_both(d, g, KN_REG_CONTROL, KN_CONTROL_LOADED);
            alike(true);
        }
        const uint32_t seq = d.get(KN_REG_STEP_SEQ);
        uint32_t circuit_word = write ? some_word(c, address, seq) : 0, golden_word = circuit_word;
        const bool taken = d.transfer(write, address, &circuit_word);
        const bool golden_taken = write ? g.write(g.self, address, golden_word) : g.read(g.self, address, &golden_word);
        d.wait();
        refused += !taken;
        ticks += d.get(KN_REG_STEP_SEQ) != seq;
        const bool same = alike(write && address == KN_REG_CONTROL);
        if (taken != golden_taken || circuit_word != golden_word || !same) {
            printf("transfer %ld: %s 0x%06x: circuit %s 0x%08x; simulated %s 0x%08x; status %s\n", n,
                   write ? "write" : "read", address, taken ? "took" : "refused", circuit_word,
                   golden_taken ? "took" : "refused", golden_word, same ? "alike" : "different");
            return 1;
        }
    }
    printf("%ld transfers, %ld refused, %ld ticks, %ld images that only the simulated device refuses: alike\n", cases,
           refused, ticks, unsound);
    golden.destroy(g.self);
    return 0;
}
