#include "bench/throughput.h"
#include "bench/bench.h"
#include "tests/physics/press.h"

const char *kernel_name(const kn_model_def *def)
{
    static const char *const name[4][2] = {
        {"auto f32", "auto f64"}, {"base f32", "base f64"}, {"avx2 f32", "avx2 f64"}, {"avx512 f32", "avx512 f64"}};
    return name[def->solver.isa][def->solver.precision];
}

int kernels_of(kn_model_def def, kn_model_def out[KERNELS])
{
    int count = 0;
    for (int isa = KN_ISA_AVX512; isa >= KN_ISA_AVX2; isa--)
        for (int p = KN_PRECISION_F32; p <= KN_PRECISION_F64; p++) {
            def.solver.isa = (kn_isa)isa;
            def.solver.precision = (kn_precision)p;
            if (kn_isa_supported(def.solver.isa)) out[count++] = def;
        }
    return count;
}

kn_input press_hand(const kn_model *model, double t_s)
{
    static const press path = {.depth_m = 0.01, .hold_s = 0.5};
    double highest = model->rest_m[model->top[0]][2]; // height of the highest node, which the plate touches first
    for (int t = 1; t < model->top_count; t++) highest = fmax(highest, model->rest_m[model->top[t]][2]);
    kn_input in = press_input(model, &path, t_s);
    in.probe[0].position_m[2] += highest - model->rest_m[model->top[0]][2];
    return in;
}

kn_state *warm_state(kn_model_def def)
{
    def.solver.isa = KN_ISA_AUTO;
    return turns_warm(&def, press_hand, PRESS_MIDDLE);
}

enum { FEW = 4, MANY = 20 };

void take_apart(const kn_model_def *def, int count, kn_state *const start[2], int ticks, int rounds, taken_apart *out)
{
    runner r[2 * KERNELS];
    for (int i = 0; i < 2 * count; i++) {
        kn_model_def fixed = turns_fixed(def[i / 2], i % 2 ? MANY : FEW);
        r[i] = turns_knead(&fixed, press_hand, start[fixed.solver.precision], PRESS_MIDDLE);
    }
    turns_run(r, 2 * count, ticks, rounds);
    for (int i = 0; i < count; i++) {
        summary few = turns_summary(&r[2 * i], ticks), many = turns_summary(&r[2 * i + 1], ticks);
        out[i].iteration_us = (many.median_us - few.median_us) / (many.mean_iterations - few.mean_iterations);
        out[i].edge_us = few.median_us - few.mean_iterations * out[i].iteration_us;
    }
    turns_free(r, 2 * count);
    for (int i = 0; i < 2 * count; i++) turns_destroy(&r[i]);
}
