#ifndef KN_CORE_KERNEL_LAW_H
#define KN_CORE_KERNEL_LAW_H
// Sixteen edges and the law of law.h, for whoever has gathered their ends. Private to the kernels.
#include "core/kernel.h"
#include "core/lanes.h"

// kn_kernels_<lattice>_<isa>_<precision>
#if KN_KERNEL_AVX512
#define ISA avx512
#elif KN_KERNEL_AVX2
#define ISA avx2
#else
#define ISA base
#endif
#if KN_KERNEL_F32
#define PRECISION f32
#else
#define PRECISION f64
#endif
#define SYMBOL3(lattice, isa, precision) kn_kernels_##lattice##_##isa##_##precision
#define SYMBOL2(lattice, isa, precision) SYMBOL3(lattice, isa, precision)
#define NAME3(isa, precision) #isa " " #precision
#define NAME2(isa, precision) NAME3(isa, precision)
#define KN_KERNELS(lattice) SYMBOL2(lattice, ISA, PRECISION)
#define KN_KERNELS_NAME NAME2(ISA, PRECISION)

// Constants of the law in the model's precision. The same for every instruction set.
typedef struct law_tables {
    real cubic[4][KN_LAW_SEGMENTS]; // first: 64-byte aligned with the block
    real slope[3][3][KN_LAW_SEGMENTS];
    real a, k1, keep, gain;      // A; k1; u <- keep u + gain s
    real dt, half_dt, shortest2; // shortest2: squared length below which n is no longer scaled up, m^2
    real inverse_b0, b0, yh, rest, flow, root_rest, root_flow; // the law's ends: slopes and their square roots
    real inwards, outwards, stop_per_strain, stroke_ends; // z_in, z_out; A/dt; where a stroke counts as used up
    real gamma;
    real beta, r0, bh; // r = A/c2(s) = r0 exp(beta s); begin of the flowing branch
    int shift;
    bool halley; // f64: the exponential damper in lanes
} law_tables;

// Strains are read off displacements, which are exact to a share of the whole object.
static void build_stroke(law_tables *t, const kn_model *model)
{
    double across = model->size_m / model->def.spacing_m / model->gamma;
    double rounding = sizeof(real) == sizeof(float) ? 0x1p-23 : 0;
    t->inwards = (real)(model->law.in / model->gamma);
    t->outwards = (real)(model->law.out / model->gamma);
    t->stop_per_strain = (real)(model->law.a_pa_s / model->law.dt_s);
    t->stroke_ends = (real)fmax(KN_LAW_STROKE_ENDS, across * rounding);
}

static void law_tables_build(law_tables *t, const kn_model *model)
{
    const kn_law *law = &model->law;
    for (int i = 0; i < KN_LAW_SEGMENTS; i++) {
        for (int k = 0; k < 4; k++) t->cubic[k][i] = law->cubic[k][i];
        for (int k = 0; k < 9; k++) t->slope[k / 3][k % 3][i] = law->slope[k / 3][k % 3][i];
    }
    t->shift = law->shift;
    t->beta = (real)law->mat.beta_per_pa;
    t->r0 = (real)(law->a_pa_s / law->mat.alpha_pa_s);
    t->bh = (real)law->bh_pa;
    t->halley = kn_law_in_lanes(law);
    t->a = (real)law->a_pa_s;
    t->k1 = (real)law->mat.k1_pa;
    t->keep = (real)(1.0 - law->dt_s * law->mat.k1_pa / law->a_pa_s);
    t->gain = (real)(law->dt_s / law->a_pa_s);
    t->dt = (real)law->dt_s;
    t->half_dt = (real)(0.5 * law->dt_s);
    t->rest = (real)law->slope_rest;
    t->flow = (real)law->slope_flow;
    t->root_rest = (real)sqrt(law->slope_rest);
    t->root_flow = (real)sqrt(law->slope_flow);
    bool table = law->kind == KN_LAW_TABLE || t->halley;
    t->b0 = (real)law->b0_pa;
    t->inverse_b0 = (real)(table ? 1.0 / law->b0_pa : 0);
    double yh = law->bh_pa / law->b0_pa;
    t->yh = (real)(table ? yh : 0);
    t->shortest2 = (real)(1e-12 * model->def.spacing_m * model->def.spacing_m);
    t->gamma = (real)model->gamma;
    build_stroke(t, model);
}

// s = T(b) and root = sqrt(ds/db).
static void law_exact(const kn_law *law, kn_linearization how, lanes b, lanes *s, lanes *root)
{
    _Alignas(64) real at_b[KN_LANES], at_s[KN_LANES], at_root[KN_LANES];
    lanes_store(at_b, b);
    for (int i = 0; i < KN_LANES; i++) {
        double stress = kn_law_stress(law, (double)at_b[i]);
        at_s[i] = (real)stress;
        at_root[i] = (real)sqrt(kn_law_slope(law, stress, how));
    }
    *s = lanes_load(at_s);
    *root = lanes_load(at_root);
}

// s/b0 of y = |b|/b0 by the table alone, and where it was looked up.
LANES_INLINE lanes law_cubic(const law_tables *t, lanes inside, segment i)
{
    lanes p = lanes_table(t->cubic[3], i);
    for (int k = 2; k >= 0; k--) p = lanes_fma(p, inside, lanes_table(t->cubic[k], i));
    return p;
}

#if KN_KERNEL_F32
LANES_INLINE void law_table(const law_tables *t, kn_linearization how, lanes b, lanes *s, lanes *root)
{
    const lanes one = lanes_set(1), zero = lanes_set(0), yh = lanes_set(t->yh);
    lanes y = lanes_mul(lanes_max(b, lanes_sub(zero, b)), lanes_set(t->inverse_b0));
    lanes inside = lanes_min(lanes_max(y, one), yh);
    segment i = segment_of(inside, t->shift);
    lanes p = law_cubic(t, inside, i);
    p = lanes_max(lanes_mul(lanes_set(t->flow), y), lanes_min(lanes_mul(lanes_set(t->rest), y), p));
    p = lanes_mul(p, lanes_set(t->b0));
    *s = lanes_less(b, zero, lanes_sub(zero, p), p);
    lanes c = lanes_table(t->slope[how][2], i);
    for (int k = 1; k >= 0; k--) c = lanes_fma(c, inside, lanes_table(t->slope[how][k], i));
    c = lanes_less(yh, y, lanes_set(t->root_flow), c);
    *root = lanes_less(y, one, lanes_set(t->root_rest), c);
}
#else
// From the table's s by one of Halley's steps on s (1 + r) = b, r = r0 exp(beta s), which leaves the cube of the table's
// error, below 1e-10, and one of Newton's, which leaves rounding.
static __attribute__((noinline)) void law_halley(const law_tables *t, kn_linearization how, const lanes *of, lanes *s,
                                                 lanes *root)
{
    const lanes b = *of, one = lanes_set(1), zero = lanes_set(0), beta = lanes_set(t->beta), half = lanes_set(0.5);
    lanes size = lanes_max(b, lanes_sub(zero, b)), y = lanes_mul(size, lanes_set(t->inverse_b0));
    lanes inside = lanes_min(lanes_max(y, one), lanes_set(t->yh)), sought = lanes_mul(inside, lanes_set(t->b0));
    lanes p = lanes_mul(law_cubic(t, inside, segment_of(inside, t->shift)), lanes_set(t->b0));
    lanes r = lanes_mul(lanes_set(t->r0), lanes_exp(lanes_mul(beta, p)));
    lanes over = lanes_sub(lanes_fma(p, r, p), sought), thin = lanes_fma(beta, p, one);
    lanes slope = lanes_fma(r, thin, one), bend = lanes_mul(lanes_mul(r, beta), lanes_add(thin, one));
    lanes step = lanes_div(lanes_mul(over, slope), lanes_fnma(lanes_mul(half, over), bend, lanes_mul(slope, slope)));
    p = lanes_sub(p, step);
    // r exp(-x), |x| < 1e-3
    static const double part[4] = {1.0, 1.0 / 2, 1.0 / 3, 1.0 / 4};
    lanes x = lanes_mul(beta, step), decay = one;
    for (int i = 3; i >= 0; i--) decay = lanes_fnma(decay, lanes_mul(x, lanes_set(part[i])), one);
    r = lanes_mul(r, decay);
    // one of Newton's, whose divisor the slope of s(b), 1/secant, 1/slope or their mean, needs anyway: continuous to
    // rounding where the table goes on to its next segment
    slope = lanes_fma(r, lanes_fma(beta, p, one), one);
    lanes secant = lanes_add(one, r), inverse = lanes_div(one, lanes_mul(secant, slope)), c;
    p = lanes_fnma(lanes_sub(lanes_fma(p, r, p), sought), lanes_mul(secant, inverse), p);
    if (how == KN_LINEARIZATION_BLEND) c = lanes_mul(half, lanes_add(secant, slope));
    else c = how == KN_LINEARIZATION_TANGENT ? secant : slope;
    c = lanes_mul(c, inverse);
    p = lanes_less(y, one, lanes_mul(size, lanes_set(t->rest)), p);
    p = lanes_less(lanes_set(t->bh), size, lanes_mul(size, lanes_set(t->flow)), p);
    *s = lanes_less(b, zero, lanes_sub(zero, p), p);
    c = lanes_less(y, one, lanes_set(t->root_rest), lanes_sqrt(c));
    *root = lanes_less(lanes_set(t->bh), size, lanes_set(t->root_flow), c);
}
#endif

LANES_INLINE void law_of(const kn_model *model, const law_tables *t, kn_law_kind kind, kn_linearization how, lanes b,
                         lanes *s, lanes *root)
{
    if (kind == KN_LAW_EXACT) {
#if !KN_KERNEL_F32
        if (t->halley) {
            law_halley(t, how, &b, s, root);
            return;
        }
#endif
        law_exact(&model->law, how, b, s, root);
#if KN_KERNEL_F32
    } else if (kind == KN_LAW_TABLE) {
        law_table(t, how, b, s, root);
#endif
    } else {
        *s = lanes_mul(b, lanes_set(t->rest)); // 1 for a Voigt part alone
        *root = lanes_set(t->root_rest);
    }
}

// The second evaluation, for the few edges beside prescribed nodes: out of line, to keep the first one's loop small.
static __attribute__((noinline)) void law_again(const kn_model *model, const law_tables *t, kn_law_kind kind,
                                                kn_linearization how, const lanes *b, lanes *s, lanes *root)
{
    law_of(model, t, kind, how, *b, s, root);
}

// (2) in law.h: what the stops make of s = T(b). z: strain of the damper before the step.
LANES_INLINE void law_stop(const law_tables *t, lanes b, lanes z, lanes *s, lanes *root)
{
    lanes zero = lanes_set(0), ends = lanes_set(t->stroke_ends), per_strain = lanes_set(t->stop_per_strain);
    lanes in = lanes_sub(z, lanes_set(t->inwards)), out = lanes_sub(lanes_set(t->outwards), z);
    lanes most = lanes_add(b, lanes_less(ends, in, lanes_mul(per_strain, in), zero));
    lanes least = lanes_sub(b, lanes_less(ends, out, lanes_mul(per_strain, out), zero));
    *root = lanes_less(most, *s, lanes_set(1), lanes_less(*s, least, lanes_set(1), *root));
    *s = lanes_max(least, lanes_min(*s, most));
}

LANES_INLINE lanes dot(const lanes a[3], const lanes b[3])
{
    return lanes_fma(a[2], b[2], lanes_fma(a[1], b[1], lanes_mul(a[0], b[0])));
}

// Sixteen edges as their ends stand: differences far end minus near end.
typedef struct bars {
    lanes rest[3], shift[3], dv[3]; // rest vector, m; how much it has changed, m; of the last velocities, m/s
    lanes n[3];                     // unit vectors
    lanes length2, inverse, rate;   // squared length; 1/length; how fast it grew in the last step
    lanes scale;                    // 1/(gamma L0)
} bars;

// From rest, shift and dv to n, length2, inverse and rate.
LANES_INLINE void bars_direct(const law_tables *t, bars *x)
{
    lanes d[3];
    for (int c = 0; c < 3; c++) d[c] = lanes_add(x->rest[c], x->shift[c]);
    x->length2 = lanes_max(dot(d, d), lanes_set(t->shortest2));
    x->inverse = lanes_div(lanes_set(1), lanes_sqrt(x->length2));
    for (int c = 0; c < 3; c++) x->n[c] = lanes_mul(d[c], x->inverse);
    x->rate = dot(x->n, x->dv);
}

// Strain from the length itself: L - L0 = (d + d0).(d - d0)/(L + L0) keeps all digits.
LANES_INLINE lanes bars_strain(const law_tables *t, const bars *x)
{
    lanes twice[3];
    for (int c = 0; c < 3; c++) twice[c] = lanes_add(lanes_add(x->rest[c], x->shift[c]), x->rest[c]);
    lanes rest = lanes_div(lanes_set(1), lanes_mul(x->scale, lanes_set(t->gamma)));
    lanes stretch = lanes_div(dot(twice, x->shift), lanes_add(lanes_mul(x->length2, x->inverse), rest));
    return lanes_mul(stretch, x->scale);
}

// Stress at the linearisation point and root of its slope; advances the strain of sixteen edges unless `again`.
// wanted: growth by the guess. afresh: it is not the last velocity: evaluate the law twice. here: [16] 1 where an edge
// exists, else 0. strain: NULL under KN_LAW_VOIGT.
LANES_INLINE void bars_law(const kn_model *model, const law_tables *t, const bars *x, kn_law_kind kind, bool stroke,
                           kn_linearization how, lanes wanted, bool afresh, bool again, const real *here, real *strain,
                           lanes *stress, lanes *root)
{
    const lanes scale = x->scale, a = lanes_set(t->a), k1 = lanes_set(t->k1), zero = lanes_set(0);
    lanes u, b = zero, s = zero;
    if (kind == KN_LAW_VOIGT) {
        u = bars_strain(t, x);
        law_of(model, t, kind, how, lanes_fma(a, lanes_mul(wanted, scale), lanes_mul(k1, u)), stress, root);
        return;
    }
    u = lanes_load(strain);
    lanes whole = stroke ? bars_strain(t, x) : u;
    if (!again) {
        // what the edge really did in the last step, to second order from velocities: differences of lengths in f32
        // lose 4 digits. (L_new - L_old)/dt = Ld - dt/2 (|dv|^2 - Ld^2)/L
        lanes across2 = lanes_fnma(x->rate, x->rate, dot(x->dv, x->dv));
        lanes done = lanes_fnma(lanes_mul(lanes_set(t->half_dt), across2), x->inverse, x->rate);
        b = lanes_fma(a, lanes_mul(done, scale), lanes_mul(k1, u));
        law_of(model, t, kind, how, b, &s, root);
        u = lanes_fma(lanes_set(t->gain), s, lanes_mul(lanes_set(t->keep), u));
        if (stroke)
            u = lanes_max(lanes_sub(whole, lanes_set(t->outwards)),
                          lanes_min(lanes_sub(whole, lanes_set(t->inwards)), u));
        u = lanes_mul(u, lanes_load(here));
        lanes_store(strain, u);
    }
    lanes sought = lanes_fma(a, lanes_mul(wanted, scale), lanes_mul(k1, u));
    if (stroke) {
        law_of(model, t, kind, how, sought, stress, root);
        law_stop(t, sought, lanes_sub(whole, u), stress, root);
    } else if (afresh) {
        law_again(model, t, kind, how, &sought, stress, root);
    } else {
        // one evaluation serves both: the guess is the last velocity, b moved only by k1 du and the second-order term
        *stress = lanes_fma(lanes_mul(*root, *root), lanes_sub(sought, b), s);
    }
}

#endif
