// Press a ball into dough, wait and lift it; also a C++ program. press.py does the same in Python.
//     cc press.c $(pkg-config --cflags --libs knead) && ./a.out
//     c++ -x c++ press.c -x none $(pkg-config --cflags --libs knead) && ./a.out
#include <inttypes.h>
#include <knead/knead.h>
#include <stdio.h>

int main(void)
{
    char error[200];
    kn_model *model = kn_model_build(NULL, error, sizeof error); // a block of dough 3 cm high, and a ball of 3 cm
    kn_state *state = model ? kn_state_create(model) : NULL;
    kn_scratch *scratch = model ? kn_scratch_create(model) : NULL;
    static kn_input in; // all 0
    kn_output out;
    if (!state || !scratch) return fprintf(stderr, "%s\n", model ? "out of memory" : error), 1;
    in.probe[0].attached = true;
    in.probe[0].position_m[2] = 0.045; // the ball's lowest point is on the dough
    for (int ms = 1; ms <= 1500; ms++) {
        in.probe[0].velocity_m_s[2] = ms <= 500 ? -0.01 : ms <= 1000 ? 0 : 0.01;
        kn_status status = kn_step(model, state, scratch, &in, &out);
        if (status != KN_OK) return fprintf(stderr, "%s\n", kn_status_text(status)), 1;
        in.probe[0].position_m[2] += 0.001 * in.probe[0].velocity_m_s[2];
        if (ms % 50 == 0) printf("%4d ms  %.17g N\n", ms, out.probe[0].force_n[2]);
    }
    printf("hash %016" PRIx64 "\n", kn_state_hash(model, state));
    kn_scratch_destroy(scratch);
    kn_state_destroy(state);
    kn_model_destroy(model);
    return 0;
}
