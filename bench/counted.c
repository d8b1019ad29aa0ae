// Loops of a step that count their operations (throughput.h). This file is compiled once for each precision, like
// core/solve/kernel_grid.c.
#define KN_KERNEL_BASE 1
#include "core/solve/lanes.h"

#include "bench/throughput.h"
#include <stdlib.h>

static counted now; // counts of the loop that runs at present

typedef struct region { // the memory of the state, and that of the scratch
    const char *base;
    size_t count;        // number of 64-byte lines
    unsigned char *line; // [count] 1: the running loop has touched the line
} region;
static region regions[2];

static void add_operations(int operations, int flops)
{
    now.operations += operations * KN_LANES;
    now.flops += flops * KN_LANES;
}

static void touch(const real *p)
{
    for (region *b = regions; b < regions + 2; b++) {
        // Index of the first 64-byte line at p. An address below the region gives a huge index, because the difference
        // wraps around; such a line is not counted.
        size_t first = (size_t)((const char *)p - b->base) / 64;
        for (size_t i = first; i < first + KN_LANES * sizeof(real) / 64; i++)
            if (i < b->count && !b->line[i]) {
                b->line[i] = 1;
                now.bytes += 64;
            }
    }
}

// Replace each function of lanes.h by a macro of the same name that counts the operation and then calls the function.
// The macro does not call itself, because the preprocessor does not expand a macro inside its own expansion.
#define lanes_add(a, b) (add_operations(1, 1), lanes_add(a, b))
#define lanes_sub(a, b) (add_operations(1, 1), lanes_sub(a, b))
#define lanes_mul(a, b) (add_operations(1, 1), lanes_mul(a, b))
#define lanes_div(a, b) (add_operations(1, 1), lanes_div(a, b))
#define lanes_sqrt(a) (add_operations(1, 1), lanes_sqrt(a))
#define lanes_min(a, b) (add_operations(1, 0), lanes_min(a, b))
#define lanes_max(a, b) (add_operations(1, 0), lanes_max(a, b))
#define lanes_less(a, b, x, y) (add_operations(2, 0), lanes_less(a, b, x, y))
#define lanes_fma(a, b, c) (add_operations(1, 2), lanes_fma(a, b, c))
#define lanes_fnma(a, b, c) (add_operations(1, 2), lanes_fnma(a, b, c))
#define lanes_load(p) (touch(p), lanes_load(p))
#define lanes_store(p, a) (touch(p), lanes_store(p, a))

#if KN_KERNEL_F32
#define kn_kernels_grid_base_f32 counted_grid_f32
#define counted_step counted_step_f32
#else
#define kn_kernels_grid_base_f64 counted_grid_f64
#define counted_step counted_step_f64
#endif
#include "core/solve/kernel_grid.c"

static counted *edge_now, *iteration_now;

static void begin(void)
{
    now = (counted){0};
    for (region *b = regions; b < regions + 2; b++) memset(b->line, 0, b->count);
}

static double counted_edge(const kn_model *model, kn_state *state, const kn_work *work, kn_linearization how,
                           bool again)
{
    begin();
    double rz = KN_KERNELS(grid).edge(model, state, work, how, again);
    *edge_now = now;
    return rz;
}

static double counted_apply(const kn_model *model, const kn_state *state, const kn_work *work, double beta)
{
    begin();
    double dq = KN_KERNELS(grid).apply(model, state, work, beta);
    *iteration_now = now;
    return dq;
}

static double counted_update(const kn_model *model, const kn_work *work, double alpha)
{
    begin();
    double rz = KN_KERNELS(grid).update(model, work, alpha);
    iteration_now->operations += now.operations;
    iteration_now->flops += now.flops;
    iteration_now->bytes += now.bytes;
    return rz;
}

void counted_step(kn_model *model, kn_state *state, kn_scratch *scratch, const kn_input *input, counted *edge_,
                  counted *iteration)
{
    kn_kernels counting = KN_KERNELS(grid);
    const kn_kernels *before = model->kernels;
    counting.edge = counted_edge;
    counting.apply = counted_apply;
    counting.update = counted_update;
    edge_now = edge_, iteration_now = iteration;
    regions[0] = (region){(const char *)state, kn_state_size(model) / 64, NULL};
    regions[1] = (region){(const char *)scratch, kn_scratch_size(model) / 64, NULL};
    for (region *b = regions; b < regions + 2; b++)
        if (!(b->line = calloc(b->count, 1))) abort();
    model->kernels = &counting;
    kn_output out;
    kn_step(model, state, scratch, input, &out);
    model->kernels = before;
    for (region *b = regions; b < regions + 2; b++) free(b->line);
}
