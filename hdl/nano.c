// The small circuit's program (hdl/rtl/knead_nano.v): core/fixed.c as one operation after another. --program prints
// its words, --constants the memory of seeds, --verilog the names of operations, --c the clocks of each loop
// (knead_nano.h), counted as it is laid out.
//
//     a, b    48 bits, signed; m a word of memory, of 36 bits, or a setting
//     p       "not here": an operation with PRED set then changes no memory and raises no flag, but takes its time
//     count   places that NORM shifted; the shift of an inverse
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/fixed.h"

enum { MOST = 512 }; // words

// A word: op 5 bits, source 4, field 5, immediate 6, unsigned, pred, first, 0; a jump: op 5, kind 4, 2 of 0,
// target 9, 4 of 0.
// clang-format off
#define OPS(OP)                                                                                                        \
    OP(LOAD) OP(ADD) OP(SUB)                 /* a = m, a + m, a - m */                                                 \
    OP(DOUBLE) OP(MAGNITUDE) OP(THREE)       /* 2 a, |a|, 3 2^34 - a */                                                \
    OP(ADD_B) OP(SUB_B) OP(LOAD_B) OP(KEEP)  /* a + b, a - b, b; b = a */                                              \
    OP(STORE) OP(FILL) OP(INVERSE)           /* m = a, 0 or all ones, a with the shift that makes it relax/D */        \
    OP(MULTIPLY)                             /* a m, 27 bits by 19; of an inverse, count takes the shift */            \
    OP(ROUND)                                /* a / 2^shift; unsigned: its floor */                                    \
    OP(SATURATE) OP(CLAMP)                   /* to 18, 25, 36 bits, immediate the flag; to -2^16 .. 2^16 */            \
    OP(NORM) OP(NORM2)                       /* left until bit 35 is set; 35 or 34, by an even count */                \
    OP(TABLE)                                /* the place in the table of a key that NORM left */                      \
    OP(ENDS) OP(RECORD)                      /* i, j of an edge; node and `holds` of a record of the list */           \
    OP(PRED)                                 /* p = m's bit, holds, not holds, not holds or m's bit */                 \
    OP(RESIDUAL) OP(CRC)                                                                                               \
    OP(CALL) OP(RETURN) OP(EMPTY) OP(LOOP) OP(END) /* EMPTY jumps over a loop without items */
#define SOURCES(SOURCE)                                                                                                \
    SOURCE(NODE) SOURCE(I) SOURCE(J) SOURCE(LISTED) SOURCE(TEMP) SOURCE(RESULT) SOURCE(EDGE) SOURCE(SEED) SOURCE(HERE) \
    SOURCE(NEXT) SOURCE(OMEGA) SOURCE(BETA) SOURCE(RELAX) SOURCE(WAY)
// clang-format on
#define NAME(name) name,
typedef enum op { OPS(NAME) } op;
typedef enum source { SOURCES(NAME) } source;
#undef NAME
typedef enum shift { BY, BY_KV, BY_BETA, BY_D, BY_COUNT, BY_REST } shift;
enum { TO_18, TO_25, TO_36 };
enum { IF_BIT, IF_HOLDS, IF_FREE, IF_FREE_OR_BIT };
typedef enum loop { NODES, EDGES, RECORDS, ITERATIONS, PASSES } loop;
enum { OF_TICK, OF_REST, OF_CRC };
enum { IS_UNSIGNED = 8, IS_PRED = 4, IS_FIRST = 2 }; // first: u in the place of last in a pass's first iteration
enum { F_U, F_TENSION, F_SPRING, F_POSITION, F_DIRECTION, F_RESIDUAL, F_REACTION }; // KN_FIXED_SAT_* as bits

// fields of a node's 32 words; temporaries, the list and the reactions live in words that nodes leave
enum {
    X = 0,
    HELD = 3,
    U = 4,
    HELD_NOW = 7,
    LOADED = 8,
    LAST = 12,
    LOAD_NOW = 16,
    REST = 19,
    FORCE = 22,
    INV = 25,
    LIST = 28
};
enum { ENDS_IA = 0, KV = 1, H = 2, E = 3, G = 6, T0 = 7 }; // of an edge's 8

static uint32_t program[MOST];
static int at, clocks, counted[16];

static void word(op o, int src, int rest, int time)
{
    if (at == MOST) fprintf(stderr, "nano: the program is longer than %d words\n", MOST), exit(1);
    program[at++] = (uint32_t)o << 19 | (uint32_t)src << 15 | (uint32_t)rest;
    clocks += time;
}

static void with(op o, source from, int field, int immediate, int bits)
{
    word(o, (int)from, field << 10 | immediate << 4 | bits, o == MULTIPLY ? 5 : 2);
}

static void of(op o, source from, int field) { with(o, from, field, 0, 0); }
static void if_here(op o, source from, int field) { with(o, from, field, 0, IS_PRED); }
static void a(op o) { word(o, 0, 0, o == NORM || o == NORM2 ? 7 : o == CRC ? 9 : 2); }
static void rounded(shift by, int places) { with(ROUND, (source)by, 0, places, 0); }
static void saturated(int to, int flag) { with(SATURATE, (source)to, 0, flag, 0); }
static void saturated_here(int to, int flag) { with(SATURATE, (source)to, 0, flag, IS_PRED); }
static void floored(int places) { with(ROUND, (source)BY, 0, places, IS_UNSIGNED); }
static void pred(int kind, source from, int field, int bit) // kind rides in the immediate's upper bits
{
    with(PRED, from, field, kind << 2 | bit, 0);
}
static void jump(op o, int kind, int target) { word(o, kind, target << 4, 2); }

// A loop's body between these; what it takes is counted under its name.
static int begun_at, empty_at;
static void begin(loop of_items)
{
    empty_at = at;
    jump(EMPTY, (int)of_items, 0);
    begun_at = at;
    clocks = 0;
}
static int end(loop of_items)
{
    jump(LOOP, (int)of_items, begun_at);
    program[empty_at] |= (uint32_t)at << 4;
    return clocks;
}

// --- an edge ---------------------------------------------------------------------------------------------------------

static int rsqrt_at, rsqrt_clocks;

// a = 1/sqrt(a) of kn_fixed_rsqrt, count = n; temporaries 3 to 5
static void rsqrt(void)
{
    rsqrt_at = at;
    clocks = 0;
    a(NORM2);
    of(STORE, TEMP, 3);
    of(LOAD, SEED, 0);
    of(STORE, TEMP, 4);
    of(MULTIPLY, TEMP, 4);
    rounded(BY, 16);
    of(STORE, TEMP, 5);
    with(LOAD, TEMP, 3, 0, IS_UNSIGNED);
    floored(18);
    of(MULTIPLY, TEMP, 5);
    a(THREE);
    rounded(BY, 17);
    of(MULTIPLY, TEMP, 4);
    rounded(BY, 18);
    a(RETURN);
    rsqrt_clocks = clocks;
}

static void call_rsqrt(void)
{
    jump(CALL, 0, rsqrt_at);
    clocks += rsqrt_clocks;
}

static void change_of_length(void)
{
    for (int k = 0; k < 3; k++) {
        of(LOAD, J, U + k);
        of(SUB, I, U + k);
        saturated(TO_25, F_U);
        of(MULTIPLY, EDGE, E + k);
        if (k > 0) a(ADD_B);
        if (k < 2) a(KEEP);
    }
    rounded(BY, KN_FIXED_E_FRACTION);
    saturated(TO_25, F_U);
}

// a, kept in temporary `kept`, times a direction: onto the force of i and, by ADD_B or SUB_B, of j
static void scatter(int kept, source from, int direction, op onto_j)
{
    of(STORE, TEMP, kept);
    for (int k = 0; k < 3; k++) {
        if (k > 0) of(LOAD, TEMP, kept);
        of(MULTIPLY, from, direction + k);
        rounded(BY, KN_FIXED_E_FRACTION);
        a(KEEP);
        of(ADD, I, FORCE + k);
        of(STORE, I, FORCE + k);
        of(LOAD, J, FORCE + k);
        a(onto_j);
        of(STORE, J, FORCE + k);
    }
}

// t stays in temporary 0
static void pull(void)
{
    of(ENDS, EDGE, ENDS_IA);
    change_of_length();
    of(MULTIPLY, EDGE, G);
    rounded(BY_KV, 0);
    of(ADD, EDGE, T0);
    saturated(TO_25, F_TENSION);
    scatter(0, EDGE, E, SUB_B);
}

static void flow(void)
{
    of(LOAD, EDGE, H);
    rounded(BY, KN_FIXED_H_FRACTION);
    a(KEEP);
    of(LOAD, TEMP, 0);
    a(SUB_B);
    saturated(TO_25, F_TENSION);
    of(MULTIPLY, BETA, 0);
    rounded(BY_BETA, 0);
    of(ADD, EDGE, H);
    saturated(TO_36, F_SPRING);
    of(STORE, EDGE, H);
}

static void direction(void) // d in temporaries 0 to 2
{
    for (int k = 0; k < 3; k++) {
        of(LOAD, J, X + k);
        of(SUB, I, X + k);
        a(DOUBLE);
        of(ADD, J, U + k);
        of(SUB, I, U + k);
        rounded(BY_D, 0);
        saturated(TO_18, F_DIRECTION);
        of(STORE, TEMP, k);
        of(MULTIPLY, TEMP, k);
        if (k > 0) a(ADD_B);
        if (k < 2) a(KEEP);
    }
    call_rsqrt();
    of(STORE, TEMP, 6);
    for (int k = 0; k < 3; k++) {
        of(LOAD, TEMP, k);
        of(MULTIPLY, TEMP, 6);
        rounded(BY_REST, 0);
        a(CLAMP);
        of(STORE, EDGE, E + k);
    }
}

static void ratio(void) // of |a| and ia; R in temporary 2
{
    a(MAGNITUDE);
    with(NORM, NODE, 0, 1, 0); // a new count
    clocks += 5;
    floored(18);
    of(MULTIPLY, EDGE, ENDS_IA);
    a(NORM);
    a(TABLE);
    of(LOAD, HERE, 0);
    of(STORE, TEMP, 1);
    of(LOAD, NEXT, 0);
    of(SUB, TEMP, 1);
    of(MULTIPLY, WAY, 0);
    rounded(BY, 11);
    of(ADD, TEMP, 1);
    of(STORE, TEMP, 2);
}

static void share(void) // g |e|_1 |e_k|
{
    for (int k = 0; k < 3; k++) {
        of(LOAD, EDGE, E + k);
        a(MAGNITUDE);
        of(STORE, TEMP, 3 + k);
        if (k > 0) a(ADD_B);
        if (k < 2) a(KEEP);
    }
    of(MULTIPLY, EDGE, G);
    rounded(BY, KN_FIXED_E_FRACTION);
    scatter(6, TEMP, 3, ADD_B);
}

static void setup(void)
{
    of(ENDS, EDGE, ENDS_IA);
    direction();
    change_of_length();
    of(MULTIPLY, EDGE, KV);
    rounded(BY_KV, 0);
    a(KEEP);
    of(LOAD, EDGE, H);
    rounded(BY, KN_FIXED_H_FRACTION);
    of(STORE, TEMP, 0);
    a(ADD_B);
    saturated(TO_36, F_TENSION);
    ratio();
    of(LOAD, EDGE, KV);
    of(MULTIPLY, TEMP, 2);
    rounded(BY, KN_FIXED_R_FRACTION);
    of(STORE, EDGE, G);
    of(LOAD, TEMP, 0);
    of(MULTIPLY, TEMP, 2);
    rounded(BY, KN_FIXED_R_FRACTION);
    of(STORE, EDGE, T0);
    share();
}

// --- a node ----------------------------------------------------------------------------------------------------------

static void invert(int k)
{
    of(LOAD, NODE, FORCE + k);
    call_rsqrt();
    of(STORE, TEMP, 4);
    of(MULTIPLY, TEMP, 4);
    rounded(BY, 16);
    of(MULTIPLY, RELAX, 0);
    rounded(BY, KN_FIXED_RELAX_FRACTION);
    of(INVERSE, NODE, INV + k);
    of(FILL, NODE, FORCE + k);
}

static void iterate(int k)
{
    pred(IF_BIT, NODE, HELD_NOW, k);
    of(LOAD, NODE, FORCE + k);
    of(ADD, NODE, LOAD_NOW + k);
    saturated_here(TO_36, F_REACTION);
    of(FILL, NODE, FORCE + k);
    saturated_here(TO_25, F_RESIDUAL);
    of(MULTIPLY, NODE, INV + k);
    rounded(BY_COUNT, 0);
    saturated_here(TO_25, F_U);
    of(ADD, NODE, U + k);
    with(SUB, NODE, LAST + k, 0, IS_FIRST);
    of(MULTIPLY, OMEGA, 0);
    rounded(BY, KN_FIXED_OMEGA_FRACTION);
    with(ADD, NODE, LAST + k, 0, IS_FIRST);
    saturated_here(TO_25, F_U);
    a(KEEP);
    of(LOAD, NODE, U + k);
    of(STORE, NODE, LAST + k);
    a(LOAD_B);
    if_here(STORE, NODE, U + k);
}

static void commit(int k)
{
    of(LOAD, NODE, FORCE + k);
    of(ADD, NODE, LOAD_NOW + k);
    saturated(TO_36, F_REACTION);
    of(STORE, NODE, FORCE + k);
    pred(IF_BIT, NODE, HELD_NOW, k);
    a(MAGNITUDE);
    with(RESIDUAL, NODE, 0, 0, IS_PRED);
    of(LOAD, NODE, X + k);
    of(ADD, NODE, U + k);
    saturated(TO_36, F_POSITION);
    of(STORE, NODE, X + k);
}

static void copy(source from, int field, source to, int other)
{
    of(LOAD, from, field);
    of(STORE, to, other);
}

static void bound(int k)
{
    pred(IF_HOLDS, NODE, 0, 0);
    of(LOAD, LISTED, LOADED + k);
    of(ADD, NODE, LIST + 1 + k);
    saturated_here(TO_25, F_REACTION);
    if_here(STORE, LISTED, LOAD_NOW + k);
    pred(IF_FREE_OR_BIT, LISTED, HELD, k);
    of(LOAD, NODE, LIST + 1 + k);
    saturated_here(TO_25, F_U);
    if_here(STORE, LISTED, U + k);
}

// --- the tick --------------------------------------------------------------------------------------------------------

static int tick_at, rest_at, crc_at;
enum { C_BEGIN, C_BOUND, C_SETUP, C_INVERT, C_EDGE, C_NODE, C_EDGE_COMMIT, C_NODE_COMMIT, C_REACTION };

static void lay_out_tick(void)
{
    tick_at = at;
    begin(NODES);
    for (int k = 0; k < 3; k++) copy(NODE, LOADED + k, NODE, LOAD_NOW + k);
    copy(NODE, HELD, NODE, HELD_NOW);
    for (int k = 0; k < 3; k++) of(FILL, NODE, FORCE + k);
    counted[C_BEGIN] = end(NODES);

    begin(RECORDS);
    of(RECORD, NODE, LIST);
    for (int k = 0; k < 3; k++) bound(k);
    pred(IF_FREE, NODE, 0, 0);
    with(FILL, LISTED, HELD_NOW, 1, IS_PRED);
    counted[C_BOUND] = end(RECORDS);

    const int pass = at;
    begin(EDGES);
    setup();
    counted[C_SETUP] = end(EDGES);
    begin(NODES);
    for (int k = 0; k < 3; k++) invert(k);
    counted[C_INVERT] = end(NODES);
    const int iteration = at;
    begin(EDGES);
    pull();
    counted[C_EDGE] = end(EDGES);
    begin(NODES);
    for (int k = 0; k < 3; k++) iterate(k);
    counted[C_NODE] = end(NODES);
    jump(LOOP, ITERATIONS, iteration);
    jump(LOOP, PASSES, pass);

    begin(EDGES);
    pull();
    flow();
    counted[C_EDGE_COMMIT] = end(EDGES);
    begin(NODES);
    for (int k = 0; k < 3; k++) commit(k);
    counted[C_NODE_COMMIT] = end(NODES);

    begin(RECORDS);
    of(RECORD, NODE, LIST);
    pred(IF_FREE, NODE, 0, 0);
    for (int k = 0; k < 3; k++) {
        of(FILL, RESULT, k);
        of(LOAD, LISTED, FORCE + k);
        if_here(STORE, RESULT, k);
    }
    counted[C_REACTION] = end(RECORDS);
    word(END, OF_TICK, 0, 2);
}

static void lay_out_rest(void)
{
    rest_at = at;
    begin(NODES);
    for (int k = 0; k < 3; k++) {
        copy(NODE, REST + k, NODE, X + k);
        of(FILL, NODE, U + k);
    }
    end(NODES);
    begin(EDGES);
    of(FILL, EDGE, H);
    end(EDGES);
    word(END, OF_REST, 0, 2);
}

static void lay_out_crc(void)
{
    crc_at = at;
    for (int field = X; field <= U; field += U - X) {
        begin(NODES);
        for (int k = 0; k < 3; k++) {
            of(LOAD, NODE, field + k);
            a(CRC);
        }
        end(NODES);
    }
    begin(EDGES);
    of(LOAD, EDGE, H);
    a(CRC);
    end(EDGES);
    word(END, OF_CRC, 0, 2);
}

static void words(void)
{
    printf("// printed by hdl/nano.c\n");
    for (int i = 0; i < at; i++) printf("word[%d] = 24'h%06x;\n", i, program[i]);
}

static void constants(void)
{
    int32_t seed[KN_FIXED_SEEDS];
    kn_fixed_seeds(seed);
    printf("// printed by hdl/nano.c\n");
    for (int i = 0; i < KN_FIXED_SEEDS; i++) printf("cells[%d] = 18'd%d;\n", i, seed[i]);
}

static void names(void)
{
    printf("// printed by hdl/nano.c\n");
#define NAME(name) printf("`define KN_OP_%s 5'd%d\n", #name, (int)name);
    OPS(NAME)
#undef NAME
#define NAME(name) printf("`define KN_FROM_%s 4'd%d\n", #name, (int)name);
    SOURCES(NAME)
#undef NAME
    printf("`define KN_AT_TICK 9'd%d\n`define KN_AT_REST 9'd%d\n`define KN_AT_CRC 9'd%d\n", tick_at, rest_at, crc_at);
}

static void c(void)
{
    printf("// printed by hdl/nano.c\nenum {\n");
    static const char *const name[] = {"BEGIN", "BOUND",       "SETUP",       "INVERT",  "EDGE",
                                       "NODE",  "EDGE_COMMIT", "NODE_COMMIT", "REACTION"};
    for (int i = 0; i <= C_REACTION; i++) printf("    KN_NANO_%s = %d,\n", name[i], counted[i]);
    printf("    KN_NANO_WORDS = %d\n};\n", at);
}

int main(int argc, char **argv)
{
    rsqrt();
    lay_out_tick();
    lay_out_rest();
    lay_out_crc();
    const char *what = argc == 2 ? argv[1] : "";
    if (strcmp(what, "--program") == 0) words();
    else if (strcmp(what, "--constants") == 0) constants();
    else if (strcmp(what, "--verilog") == 0) names();
    else if (strcmp(what, "--c") == 0) c();
    else return fprintf(stderr, "usage: nano --program | --constants | --verilog | --c\n"), 2;
    return 0;
}
