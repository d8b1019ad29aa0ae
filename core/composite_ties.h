// Exchange between tied nodes and their masters, in one precision. The includer defines `real`, and NAME,
// which makes the functions' names.

// Set a field at tied nodes to the mean of their masters.
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

// Add a part's forces at tied nodes to their masters, in equal shares, and clear them at the tied nodes.
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

// Add share^2 of tied nodes' diagonal blocks to those of their masters. Blocks between neighbours that share a master
// are left out. The sum is therefore up to an eighth too stiff, which is good enough for a preconditioner.
static void NAME(gather_blocks)(const kn_composite *c, size_t stride, void *blocks, const void *whole, int part)
{
    real *p = blocks;
    const real *m = whole;
    const size_t row = 3 * stride;
    for (int t = c->tie_first[part]; t < c->tie_first[part + 1]; t++) {
        const kn_tie *tie = &c->tie[t];
        const real share = tie->count == 1 ? (real)1 : tie->count == 2 ? (real)0.25 : (real)0.0625;
        // blocks have 6 components per row, vectors 3
        const size_t from = tie->node / row * 2 * row + tie->node % row;
        for (int i = 0; i < tie->count; i++) {
            const size_t to = tie->master[i] / row * 2 * row + tie->master[i] % row;
            for (size_t k = 0; k < 6 * stride; k += stride) p[to + k] += share * m[from + k];
        }
    }
}
