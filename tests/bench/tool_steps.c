// The code that test_instructions.sh counts with callgrind: 25 steps into a press, then fifty steps, all within
// `counted`, by the AVX2 kernels (valgrind 3.19 does not know AVX-512).
//
//     steps NAME      f32: 847 nodes; f64, gas, ball: 144; net: 219. Prints the iterations of the fifty
//     steps           the compiler that built it
#include "tests/physics/bcc.h"
#include "tests/physics/press.h"

enum { WARM_UP = 25, COUNTED = 50 };

static int step(const kn_model *model, kn_state *state, kn_scratch *scratch, int tick)
{
    static const press path = {.depth_m = 0.01};
    kn_input in = press_input(model, &path, (tick + 1) * 1e-3);
    kn_output out;
    if (kn_step(model, state, scratch, &in, &out) != KN_OK) exit(1);
    return out.iterations;
}

__attribute__((noinline)) int counted(const kn_model *model, kn_state *state, kn_scratch *scratch);
int counted(const kn_model *model, kn_state *state, kn_scratch *scratch)
{
    int iterations = 0;
    for (int tick = WARM_UP; tick < WARM_UP + COUNTED; tick++) iterations += step(model, state, scratch, tick);
    return iterations;
}

int main(int argc, char **argv)
{
    if (argc == 1) {
        puts("gcc " __VERSION__);
        return 0;
    }
    const char *name = argv[1];
    kn_model_def def = strcmp(name, "ball") == 0 ? ball_def(1) : press_def(strcmp(name, "f32") == 0 ? 2 : 1);
    kn_simplices *mesh = NULL;
    def.solver.isa = KN_ISA_AVX2;
    if (strcmp(name, "f64") == 0) def.solver.precision = KN_PRECISION_F64;
    if (strcmp(name, "gas") == 0) def.pressure = KN_PRESSURE_CELLS;
    if (strcmp(name, "net") == 0) def.mesh = mesh = bcc_block((const int[3]){5, 5, 3}, def.spacing_m);
    if (!kn_isa_supported(KN_ISA_AVX2)) return 77;
    kn_model *model = build(&def);
    kn_state *state = kn_state_create(model);
    kn_scratch *scratch = kn_scratch_create(model);
    if (!state || !scratch) return 70;
    for (int tick = 0; tick < WARM_UP; tick++) step(model, state, scratch, tick);
    printf("%d\n", counted(model, state, scratch));
    kn_state_destroy(state);
    kn_scratch_destroy(scratch);
    kn_model_destroy(model);
    kn_simplices_destroy(mesh);
    return 0;
}
