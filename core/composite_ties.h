// What goes to and fro between tied nodes and their masters, in one precision: `real`, and NAME makes its names.

// field of tied nodes = mean of their masters'
static void NAME(spread)(const kn_composite *c, size_t stride, void *field)
{
    real *v = field;
    for (int t = 0; t < c->tie_first[c->part_count]; t++) {
        const kn_tie *tie = &c->tie[t];
        const real share = tie->count == 1 ? (real)1 : tie->count == 2 ? (real)0.5 : (real)0.25;
        for (size_t k = 0; k < 3 * stride; k += stride) {
            real sum = v[tie->master[0] + k];
            for (int i = 1; i < tie->count; i++) sum += v[tie->master[i] + k];
            v[tie->node + k] = share * sum;
        }
    }
}

// masters' forces += shares of what the nodes of a part have, which then have none
static void NAME(gather)(const kn_composite *c, size_t stride, void *field, int part)
{
    real *v = field;
    for (int t = c->tie_first[part]; t < c->tie_first[part + 1]; t++) {
        const kn_tie *tie = &c->tie[t];
        const real share = tie->count == 1 ? (real)1 : tie->count == 2 ? (real)0.5 : (real)0.25;
        for (size_t k = 0; k < 3 * stride; k += stride) {
            real each = share * v[tie->node + k];
            for (int i = 0; i < tie->count; i++) v[tie->master[i] + k] += each;
            v[tie->node + k] = 0;
        }
    }
}

// masters' diagonal blocks += share^2 of tied nodes'. Blocks between neighbours that share a master are left out, so
// the sum is up to an eighth too stiff: for a preconditioner it will do.
static void NAME(gather_blocks)(const kn_composite *c, size_t stride, void *blocks, const void *whole, int part)
{
    real *p = blocks;
    const real *m = whole;
    const size_t row = 3 * stride;
    for (int t = c->tie_first[part]; t < c->tie_first[part + 1]; t++) {
        const kn_tie *tie = &c->tie[t];
        const real share = tie->count == 1 ? (real)1 : tie->count == 2 ? (real)0.25 : (real)0.0625;
        const size_t from = tie->node / row * 2 * row + tie->node % row;
        for (int i = 0; i < tie->count; i++) {
            const size_t to = tie->master[i] / row * 2 * row + tie->master[i] % row;
            for (size_t k = 0; k < 6 * stride; k += stride) p[to + k] += share * m[from + k];
        }
    }
}
