// Print the circuit's formats and registers, which come from core/fixed.h and hdl/registers.h, as the file that is
// named: formats.vh, seeds.vh, hash.h, or the tables of REGISTERS.md, which the hash covers.
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/fixed.h"
#include "hdl/registers.h"

// Write the three tables of hdl/REGISTERS.md.
static void markdown(FILE *out)
{
    fprintf(out, "| format | bits | fraction | unit | what |\n|---|---|---|---|---|\n");
#define KN_FORMAT(name, sign, bits, fraction, unit, what)                                                              \
    fprintf(out, "| %s | %s%d | %d | %s | %s |\n", #name, #sign, bits, fraction, unit, what);
    KN_FIXED_FORMATS(KN_FORMAT)
    fprintf(out, "\n| register | word | access | bits | what |\n|---|---|---|---|---|\n");
#define KN_REGISTER(name, address, access, bits, what)                                                                 \
    fprintf(out, "| %s | 0x%02x | %s | %d | %s |\n", #name, address, #access, bits, what);
    KN_REGISTERS(KN_REGISTER)
    fprintf(out, "\n| window | first word | words of a record | record |\n|---|---|---|---|\n");
#define KN_WINDOW(name, first, words, what) fprintf(out, "| %s | 0x%06x | %d | %s |\n", #name, first, words, what);
    KN_WINDOWS(KN_WINDOW)
}

static uint32_t fnv1a(const char *text)
{
    uint32_t hash = 2166136261u;
    for (; *text; text++) hash = (hash ^ (uint8_t)*text) * 16777619u;
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
    char *tables = NULL;
    FILE *out = open_memstream(&tables, &(size_t){0});
    if (!out) return perror("knead_table"), 3;
    markdown(out);
    if (fclose(out) != 0) return perror("knead_table"), 3;
    const uint32_t hash = fnv1a(tables);
    const char *what = argc == 2 ? argv[1] : "";
    if (strcmp(what, "REGISTERS.md") == 0) printf("%s", tables);
    else if (strcmp(what, "formats.vh") == 0) verilog(hash);
    else if (strcmp(what, "seeds.vh") == 0) seeds();
    else if (strcmp(what, "hash.h") == 0) printf("// printed by hdl/table.c\n#define KN_BUILD_HASH 0x%08xu\n", hash);
    else return fprintf(stderr, "usage: knead_table REGISTERS.md | formats.vh | seeds.vh | hash.h\n"), 2;
    free(tables);
    return 0;
}
