#ifndef KN_HDL_REGISTERS_H
#define KN_HDL_REGISTERS_H
// The circuit as a host sees it: words of 32 bits at word addresses of 24 bits. C, Verilog and hdl/REGISTERS.md get the
// table from this file (hdl/table.c). The hash of the table, together with that of the formats, is BUILD_HASH.
// hdl/REGISTERS.md says which transfers are refused.
#include <stdint.h>

// Registers: name, word address, access (R read, W write, C write one to clear), bits, description.
#define KN_REGISTERS(REGISTER)                                                                                         \
    REGISTER(ID, 0x00, R, 32, "0x4b4e4541, KNEA")                                                                      \
    REGISTER(VERSION, 0x01, R, 32, "of this table: major 16, minor 8, patch 8")                                        \
    REGISTER(BUILD_HASH, 0x02, R, 32, "FNV-1a of formats and registers as printed here; the host's must be the same")  \
    REGISTER(CAPS, 0x03, R, 24, "log2 nodes + (log2 edges << 8) + (log2 boundary records << 16)")                      \
    REGISTER(CONTROL, 0x04, W, 4, "1 rest: x = rest, u = h = 0; 2 clear FLAGS, CYCLES_MAX; 4 STATE_CRC; 8 loaded")     \
    REGISTER(STATUS, 0x05, C, 4, "1 busy; 2 loaded; 4 STEP_SEQ out of order; 8 step without a loaded state")           \
    REGISTER(FLAGS, 0x06, C, 7, "KN_FIXED_SAT_*, sticky")                                                              \
    REGISTER(SCRATCH, 0x07, RW, 32, "the host's")                                                                      \
    REGISTER(TICK, 0x08, R, 32, "ticks since rest or loaded")                                                          \
    REGISTER(STEP_SEQ, 0x09, RW, 32, "doorbell: its value + 1 steps, its value does nothing; outlives rest")           \
    REGISTER(CYCLES, 0x0a, R, 32, "clocks of the last tick")                                                           \
    REGISTER(CYCLES_MAX, 0x0b, R, 32, "most clocks of a tick")                                                         \
    REGISTER(STATE_CRC, 0x0c, R, 32, "kn_fixed_crc of the state when last asked for")                                  \
    REGISTER(RESIDUAL_LO, 0x0d, R, 32, "of the last tick, phi")                                                        \
    REGISTER(RESIDUAL_HI, 0x0e, R, 32, "its upper word")                                                               \
    REGISTER(RESULT_FLAGS, 0x0f, R, 7, "FLAGS when the last tick ended")                                               \
    REGISTER(NODE_COUNT, 0x10, RW, 17, "1 .. 2^log2 nodes")                                                            \
    REGISTER(EDGE_COUNT, 0x11, RW, 21, "0 .. 2^log2 edges")                                                            \
    REGISTER(PASSES, 0x12, RW, 4, "O, 1..15")                                                                          \
    REGISTER(ITERATIONS, 0x13, RW, 6, "K, 1..32")                                                                      \
    REGISTER(D_SHIFT, 0x14, RW, 5, "0..18")                                                                            \
    REGISTER(KV_SHIFT, 0x15, RW, 6, "0..40")                                                                           \
    REGISTER(OCTAVE, 0x16, RW, 7, "-64..63, two's complement of 7 bits")                                               \
    REGISTER(BETA, 0x17, RW, 17, "k1 dt/A")                                                                            \
    REGISTER(BETA_SHIFT, 0x18, RW, 6, "0..40")                                                                         \
    REGISTER(RELAX, 0x19, RW, 17, "damping")                                                                           \
    REGISTER(BOUND_COUNT, 0x1a, RW, 11, "records of the boundary list, below 2^log2 records")                          \
    REGISTER(OMEGA, 0x40, RW, 18, "0x40..0x5f: OMEGA[32]")

// Windows: name, first word, words of a record, the words of a record.
#define KN_WINDOWS(WINDOW)                                                                                             \
    WINDOW(TABLE, 0x010000, 1, "R; 513 records")                                                                       \
    WINDOW(BOUNDS, 0x020000, 4, "node + (holds << 31), value x, y, z")                                                 \
    WINDOW(REACTIONS, 0x030000, 6, "reaction x lo, x hi, y lo, y hi, z lo, z hi; read only")                           \
    WINDOW(NODES, 0x100000, 16, "x lo, hi, y lo, hi, z lo, hi; held; u x, y, z; load x, y, z; 0, 0, 0")                \
    WINDOW(REST, 0x200000, 8, "rest position x lo, hi, y lo, hi, z lo, hi; 0, 0")                                      \
    WINDOW(EDGES, 0x800000, 8, "i + (j << 16); kv; ia; h lo, hi; 0, 0, 0")

// Clocks that a phase takes in addition to one for each of its nodes or edges (INVERT: three for each node), until its
// last write is done. BOUND and REACTION: clocks for each record of the boundary list. kn_engine_clocks adds them up.
#define KN_CYCLES(CYCLES)                                                                                              \
    CYCLES(BEGIN, 1)                                                                                                   \
    CYCLES(BOUND, 7)                                                                                                   \
    CYCLES(SETUP, 41)                                                                                                  \
    CYCLES(INVERT, 14)                                                                                                 \
    CYCLES(EDGE, 12)                                                                                                   \
    CYCLES(NODE, 11)                                                                                                   \
    CYCLES(EDGE_COMMIT, 13)                                                                                            \
    CYCLES(NODE_COMMIT, 8)                                                                                             \
    CYCLES(REACTION, 12)

enum { KN_ENGINE_ID = 0x4b4e4541, KN_ENGINE_VERSION = 0x00010000 };
enum {
#define KN_REGISTER(name, address, access, bits, what) KN_REG_##name = address,
    KN_REGISTERS(KN_REGISTER)
#undef KN_REGISTER
#define KN_WINDOW(name, first, words, what) KN_WINDOW_##name = first,
        KN_WINDOWS(KN_WINDOW)
#undef KN_WINDOW
#define KN_CYCLE(name, clocks) KN_CYCLES_##name = clocks,
            KN_CYCLES(KN_CYCLE)
#undef KN_CYCLE
};
enum { KN_CONTROL_REST = 1, KN_CONTROL_CLEAR = 2, KN_CONTROL_CRC = 4, KN_CONTROL_LOADED = 8 };
enum { KN_STATUS_BUSY = 1, KN_STATUS_LOADED = 2, KN_STATUS_SEQ = 4, KN_STATUS_EMPTY = 8 };

// Return CYCLES of a tick with n nodes, e edges, b boundary records, o passes of k iterations.
static inline uint32_t kn_engine_clocks(uint32_t n, uint32_t e, uint32_t b, uint32_t o, uint32_t k)
{
    const uint32_t inner = e + KN_CYCLES_EDGE + n + KN_CYCLES_NODE;
    const uint32_t outer = e + KN_CYCLES_SETUP + 3 * n + KN_CYCLES_INVERT + k * inner;
    const uint32_t ends = n + KN_CYCLES_BEGIN + e + KN_CYCLES_EDGE_COMMIT + n + KN_CYCLES_NODE_COMMIT;
    return ends + b * (KN_CYCLES_BOUND + KN_CYCLES_REACTION) + o * outer;
}

#endif
