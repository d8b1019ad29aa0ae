// Table of steps that compute in the circuit's integers on one core, compared with steps in floating point. The last
// columns are the circuit's clock cycles and its time on the board of hdl/boards, whose clock closes timing there.
#include "bench/throughput.h"
#include "core/solver_fixed.h"
#include "hdl/registers.h"
#include "tests/physics/press.h"

// Return the number of clock cycles that the circuit needs for a tick. records: number of nodes under tools. The test
// hdl.engine compares this number with a counter in the circuit.
static double clocks_of(const kn_model *m, uint32_t records)
{
    const kn_fixed_config *c = &m->fixed->image.config;
    return kn_engine_clocks((uint32_t)c->node_count, (uint32_t)c->edge_count, records, (uint32_t)c->passes,
                            (uint32_t)c->iterations);
}

static kn_model_def integers(int per_cm)
{
    kn_model_def def = press_def(per_cm);
    def.solver.kind = KN_SOLVER_FIXED;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.passes = 2;
    def.solver.iterations = 8;
    return def;
}

static void measure(int per_cm, const throughput_options *o)
{
    const double board_mhz = 45; // board_mhz of hdl/boards/run
    const kn_model_def def[] = {press_def(per_cm), integers(per_cm)};
    const int ticks = o->quick ? 200 : PRESS_TICKS;
    runner r[] = {turns_knead(&def[0], press_hand, NULL, 0), turns_knead(&def[1], press_hand, NULL, 0)};
    turns_run(r, 2, ticks, 2);
    summary real = turns_summary(&r[0], ticks), whole = turns_summary(&r[1], ticks);
    const kn_model *m = turns_model(&r[1]);
    const double clocks = clocks_of(m, 16);
    printf("| %5d | %5d | %8.1f | %8.1f | %8.0f | %8.0f |\n", m->node_count, m->edge_count, real.median_us,
           whole.median_us, clocks, clocks / board_mhz);
    turns_free(r, 2);
    for (int i = 0; i < 2; i++) turns_destroy(&r[i]);
}

void table_integers(const throughput_options *o)
{
    puts(
        "\nIntegers: a step of core/fixed.h on one core, with two passes of eight iterations, and the default step in\n"
        "f32. Clock cycles of a tick of the circuit with 16 nodes under a plate, and its time on an LFE5U-85F at\n"
        "45 MHz (hdl/README.md). The circuit there holds 1024 nodes and 8192 edges; a row with more assumes larger "
        "memories.\n");
    puts("| nodes | edges | f32 us   | fixed us | clocks   | board us |");
    puts("|------:|------:|---------:|---------:|---------:|---------:|");
    for (int per_cm = 1; per_cm <= 3; per_cm++)
        if (per_cm < 3 || (!o->quick && o->nodes_max >= 2560)) measure(per_cm, o);
}
