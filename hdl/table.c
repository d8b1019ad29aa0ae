// Print the circuit's formats and registers: --verilog (knead_formats.vh), --seeds (knead_seeds.vh), --c
// (knead_hash.h), --markdown (hdl/REGISTERS.md). All come from core/fixed.h and hdl/registers.h. The hash covers the
// output of --markdown.
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "core/fixed.h"
#include "hdl/registers.h"

enum { TEXT = 1 << 16 };

// Text that is collected before it is printed, because the hash needs all of it.
typedef struct text {
    char at[TEXT];
    size_t length;
} text;

// Append to a text; TEXT is large enough for all tables.
#define SAY(t, ...) ((t)->length += (size_t)snprintf((t)->at + (t)->length, TEXT - (t)->length, __VA_ARGS__))

// Write the three tables of hdl/REGISTERS.md.
static void markdown(text *t)
{
    SAY(t, "| format | bits | fraction | unit | what |\n|---|---|---|---|---|\n");
#define KN_FORMAT(name, sign, bits, fraction, unit, what)                                                              \
    SAY(t, "| %s | %s%d | %d | %s | %s |\n", #name, #sign, bits, fraction, unit, what);
    KN_FIXED_FORMATS(KN_FORMAT)
    SAY(t, "\n| register | word | access | bits | what |\n|---|---|---|---|---|\n");
#define KN_REGISTER(name, address, access, bits, what)                                                                 \
    SAY(t, "| %s | 0x%02x | %s | %d | %s |\n", #name, address, #access, bits, what);
    KN_REGISTERS(KN_REGISTER)
    SAY(t, "\n| window | first word | words of a record | record |\n|---|---|---|---|\n");
#define KN_WINDOW(name, first, words, what) SAY(t, "| %s | 0x%06x | %d | %s |\n", #name, first, words, what);
    KN_WINDOWS(KN_WINDOW)
}

static uint32_t fnv1a(const text *t)
{
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < t->length; i++) hash = (hash ^ (uint8_t)t->at[i]) * 16777619u;
    return hash;
}

// Print formats, registers, clocks and identification as `define lines.
static void verilog(uint32_t hash)
{
    printf("// printed by hdl/table.c\n");
#define KN_VERILOG_FORMAT(name, sign, bits, fraction, unit, what)                                                      \
    printf("`define KN_%s %d\n`define KN_%s_FRACTION %d\n", #name, bits, #name, fraction);
    KN_FIXED_FORMATS(KN_VERILOG_FORMAT)
#define KN_VERILOG_REGISTER(name, address, access, bits, what)                                                         \
    printf("`define KN_REG_%s 7'h%02x\n`define KN_BITS_%s %d\n", #name, address, #name, bits);
    KN_REGISTERS(KN_VERILOG_REGISTER)
#define KN_VERILOG_CYCLES(name, clocks) printf("`define KN_CYCLES_%s %d\n", #name, clocks);
    KN_CYCLES(KN_VERILOG_CYCLES)
    printf("`define KN_SEGMENTS %d\n", KN_FIXED_SEGMENTS);
    printf("`define KN_ENGINE_ID 32'h%08x\n`define KN_ENGINE_VERSION 32'h%08x\n", KN_ENGINE_ID, KN_ENGINE_VERSION);
    printf("`define KN_BUILD_HASH 32'h%08x\n", hash);
}

// Print the seeds of kn_fixed_rsqrt as assignments to the words of a memory.
static void seeds(void)
{
    int32_t seed[KN_FIXED_SEEDS];
    kn_fixed_seeds(seed);
    printf("// printed by hdl/table.c\n");
    for (int i = 0; i < KN_FIXED_SEEDS; i++) printf("seed[%d] = 17'd%d;\n", i, seed[i]);
}

int main(int argc, char **argv)
{
    static text t;
    markdown(&t);
    const uint32_t hash = fnv1a(&t);
    const char *what = argc == 2 ? argv[1] : "";
    if (strcmp(what, "--markdown") == 0) printf("%s", t.at);
    else if (strcmp(what, "--verilog") == 0) verilog(hash);
    else if (strcmp(what, "--seeds") == 0) seeds();
    else if (strcmp(what, "--c") == 0) printf("// printed by hdl/table.c\n#define KN_BUILD_HASH 0x%08xu\n", hash);
    else return fprintf(stderr, "usage: table --markdown | --verilog | --seeds | --c\n"), 2;
    return 0;
}
