#ifndef KN_CORE_SOLVE_KERNEL_LAW_H
#define KN_CORE_SOLVE_KERNEL_LAW_H
// The law of law.h for sixteen edges at a time. The caller gathers the values at the edges' ends. Only the kernels
// include this header.
#include "core/solve/kernel.h"
#include "core/solve/lanes.h"

// Name of the kernels: kn_kernels_<lattice>_<isa>_<precision>.
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

#if KN_KERNEL_F32
enum { DEGREE = 3, SLOPE_DEGREE = 2 };
#else
enum { DEGREE = KN_LAW_FINE, SLOPE_DEGREE = 3 };
#endif

// Unroll a loop with n turns, so that its counter is a constant. Without UNROLL, gcc does not unroll the loop over the
// three shifts along a row, and the edge pass takes 18 % longer.
#define PRAGMA(x) _Pragma(#x)
// base and checked builds need not be fast, and unrolling takes compile time
#if KN_KERNEL_BASE || KN_KERNEL_CHECKED
#define UNROLL(n)
#elif defined(__clang__)
#define UNROLL(n) PRAGMA(unroll(n))
#else
#define UNROLL(n) PRAGMA(GCC unroll n)
#endif

// Constants of the law in the model's precision, equal for every instruction set.
typedef struct law_tables {
    // Middle of each segment of the law's table; it is subtracted from y in f64, and is 0 in f32. The array is the
    // first member, so it is aligned to 64 bytes like the block of tables.
    real middle[KN_LAW_SEGMENTS];
    real stress[DEGREE + 1][KN_LAW_SEGMENTS], slope[3][SLOPE_DEGREE + 1][KN_LAW_SEGMENTS];
    kn_law_kind kind;       // kind of the law; KN_LAW_TABLE in f64 means the f64 table
    real a, k1, keep, gain; // a: A; k1: stiffness of the spring; keep, gain: the strain advances by u = keep u + gain s
    real dt, half_dt, shortest2; // shortest2: lower limit of the squared length in the division for n [m^2]
    // The law's two straight branches. The resting branch ends at y = 1 (b = b0), the flowing branch begins at y = yh.
    // rest, flow: their slopes; root_rest, root_flow: roots of the slopes.
    real inverse_b0, b0, yh, rest, flow, root_rest, root_flow;
    // inwards, outwards: stops z_in, z_out of the damper; stop_per_strain: A/dt; stroke_ends: distance from a stop
    // below which the damper is treated as at the stop
    real inwards, outwards, stop_per_strain, stroke_ends;
    real gamma;
    int shift;
} law_tables;

// Set the constants of a damper with stops. stroke_ends covers the rounding of strains in f32: strains are computed
// from displacements, whose rounding is proportional to the size of the object.
static void build_stroke(law_tables *t, const kn_model *model)
{
    double across = model->size_m / model->def.spacing_m / model->gamma;
    double rounding = sizeof(real) == sizeof(float) ? 0x1p-23 : 0;
    t->inwards = (real)(model->law.in / model->gamma);
    t->outwards = (real)(model->law.out / model->gamma);
    t->stop_per_strain = (real)(model->law.a_pa_s / model->law.dt_s);
    t->stroke_ends = (real)fmax(KN_LAW_STROKE_ENDS, across * rounding);
}

static void build_polynomials(law_tables *t, const kn_law *law)
{
#if KN_KERNEL_F32
    memcpy(t->stress, law->cubic, sizeof t->stress);
    memcpy(t->slope, law->slope, sizeof t->slope);
#else
    memcpy(t->middle, law->middle, sizeof t->middle);
    memcpy(t->stress, law->fine, sizeof t->stress);
    memcpy(t->slope, law->fine_slope, sizeof t->slope);
#endif
}

static void law_tables_build(law_tables *t, const kn_model *model)
{
    const kn_law *law = &model->law;
    build_polynomials(t, law);
    t->shift = law->shift;
    t->kind = law->kind;
    // in f64, the f64 table replaces Newton's method if the table is accurate enough
    if (sizeof(real) == sizeof(double) && kn_law_in_lanes(law)) t->kind = KN_LAW_TABLE;
    t->a = (real)law->a_pa_s;
    t->k1 = (real)law->mat.k1_pa;
    // a step of the strain: u + dt (s - k1 u)/A = keep u + gain s
    t->keep = (real)(1.0 - law->dt_s * law->mat.k1_pa / law->a_pa_s);
    t->gain = (real)(law->dt_s / law->a_pa_s);
    t->dt = (real)law->dt_s;
    t->half_dt = (real)(0.5 * law->dt_s);
    t->rest = (real)law->slope_rest;
    t->flow = (real)law->slope_flow;
    t->root_rest = (real)sqrt(law->slope_rest);
    t->root_flow = (real)sqrt(law->slope_flow);
    bool table = t->kind == KN_LAW_TABLE;
    t->b0 = (real)law->b0_pa;
    t->inverse_b0 = (real)(table ? 1.0 / law->b0_pa : 0);
    double yh = law->bh_pa / law->b0_pa;
    t->yh = (real)(table ? yh : 0);
    t->shortest2 = (real)(1e-12 * model->def.spacing_m * model->def.spacing_m);
    t->gamma = (real)model->gamma;
    build_stroke(t, model);
}

// Compute s = T(b) and root = sqrt(ds/db) by Newton's method, one lane after the other.
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

// Evaluate a polynomial by Horner's rule. Its coefficients depend on the segment.
LANES_INLINE lanes polynomial(int degree, const real (*table)[KN_LAW_SEGMENTS], lanes x, segment i)
{
    lanes sum = lanes_table(table[degree], i);
    UNROLL(16)
    for (int k = degree - 1; k >= 0; k--) sum = lanes_fma(sum, x, lanes_table(table[k], i));
    return sum;
}

// Compute s = T(b) and root = sqrt(ds/db) from the table. The law is odd, so it is evaluated at y = |b|/b0, and s gets
// the sign of b at the end.
LANES_INLINE void law_table(const law_tables *t, kn_linearization how, lanes b, lanes *s, lanes *root)
{
    const lanes one = lanes_set(1), zero = lanes_set(0), yh = lanes_set(t->yh);
    lanes y = lanes_mul(lanes_max(b, lanes_sub(zero, b)), lanes_set(t->inverse_b0));
    // the polynomials hold for y in [1, yh]
    lanes inside = lanes_min(lanes_max(y, one), yh);
    segment i = segment_of(inside, t->shift);
#if !KN_KERNEL_F32
    inside = lanes_sub(inside, lanes_table(t->middle, i));
#endif
    lanes p = polynomial(DEGREE, t->stress, inside, i);
    // outside [1, yh] the law is one of two straight lines; max and min make the kinks at both ends exact
    p = lanes_max(lanes_mul(lanes_set(t->flow), y), lanes_min(lanes_mul(lanes_set(t->rest), y), p));
    p = lanes_mul(p, lanes_set(t->b0));
    *s = lanes_less(b, zero, lanes_sub(zero, p), p);
    // root of the slope: a polynomial for y in [1, yh], constants outside
    lanes c = polynomial(SLOPE_DEGREE, t->slope[how], inside, i);
    c = lanes_less(yh, y, lanes_set(t->root_flow), c);
    *root = lanes_less(y, one, lanes_set(t->root_rest), c);
}

// Compute s = T(b) and root = sqrt(ds/db) by the kind of law. In inlined calls, `kind` is a constant.
LANES_INLINE void law_of(const kn_model *model, const law_tables *t, kn_law_kind kind, kn_linearization how, lanes b,
                         lanes *s, lanes *root)
{
    if (kind == KN_LAW_EXACT) {
        law_exact(&model->law, how, b, s, root);
    } else if (kind == KN_LAW_TABLE) {
        law_table(t, how, b, s, root);
    } else {
        *s = lanes_mul(b, lanes_set(t->rest)); // slope ds/db; 1 for a Voigt element without damper
        *root = lanes_set(t->root_rest);
    }
}

// Evaluate the law a second time, for the few edges whose ends have a prescribed velocity that has changed. The
// function is not inlined, which keeps the loop of the first evaluation small.
static __attribute__((noinline)) void law_again(const kn_model *model, const law_tables *t, kn_law_kind kind,
                                                kn_linearization how, const lanes *b, lanes *s, lanes *root)
{
    law_of(model, t, kind, how, *b, s, root);
}

// Apply the stops to s = T(b), equation (2) of law.h. `z`: strain of the damper before the step.
LANES_INLINE void law_stop(const law_tables *t, lanes b, lanes z, lanes *s, lanes *root)
{
    lanes zero = lanes_set(0), ends = lanes_set(t->stroke_ends), per_strain = lanes_set(t->stop_per_strain);
    lanes in = lanes_sub(z, lanes_set(t->inwards)), out = lanes_sub(lanes_set(t->outwards), z);
    // limit s to the stress with which the damper would just reach an end stop; if the damper is already at that end
    // stop, this stress is b
    lanes most = lanes_add(b, lanes_less(ends, in, lanes_mul(per_strain, in), zero));
    lanes least = lanes_sub(b, lanes_less(ends, out, lanes_mul(per_strain, out), zero));
    // if a stop limits s, then s = b + constant, and the slope ds/db is 1
    *root = lanes_less(most, *s, lanes_set(1), lanes_less(*s, least, lanes_set(1), *root));
    *s = lanes_max(least, lanes_min(*s, most));
}

LANES_INLINE lanes dot(const lanes a[3], const lanes b[3])
{
    return lanes_fma(a[2], b[2], lanes_fma(a[1], b[1], lanes_mul(a[0], b[0])));
}

// Geometry of sixteen edges. A difference is the value at the far end minus that at the near end.
typedef struct bars {
    // rest: vector of the edge at rest, m; shift: change of this vector (difference of displacements), m; dv:
    // difference of the last velocities, m/s
    lanes rest[3], shift[3], dv[3];
    lanes n[3];                   // unit vectors from the near to the far end
    lanes length2, inverse, rate; // squared length; 1/length; growth rate of the length in the last step
    lanes scale;                  // factor 1/(gamma L0) from length to strain
} bars;

// Compute n, length2, inverse and rate from rest, shift and dv.
LANES_INLINE void bars_direct(const law_tables *t, bars *x)
{
    lanes d[3];
    for (int c = 0; c < 3; c++) d[c] = lanes_add(x->rest[c], x->shift[c]);
    x->length2 = lanes_max(dot(d, d), lanes_set(t->shortest2));
    x->inverse = lanes_inverse_root(x->length2);
    for (int c = 0; c < 3; c++) x->n[c] = lanes_mul(d[c], x->inverse);
    x->rate = dot(x->n, x->dv);
}

// Compute the strain (L - L0)/(gamma L0) from the vectors d now and d0 at rest. The formula L - L0 = (d + d0).(d -
// d0)/(L + L0) loses no digits.
LANES_INLINE lanes bars_strain(const law_tables *t, const bars *x)
{
    lanes twice[3];
    for (int c = 0; c < 3; c++) twice[c] = lanes_add(lanes_add(x->rest[c], x->shift[c]), x->rest[c]);
    lanes rest = lanes_div(lanes_set(1), lanes_mul(x->scale, lanes_set(t->gamma)));
    lanes stretch = lanes_div(dot(twice, x->shift), lanes_add(lanes_mul(x->length2, x->inverse), rest));
    return lanes_mul(stretch, x->scale);
}

// Compute the stress of sixteen edges at the solver's guess, and the root of the law's slope there. Unless `again`,
// first advance the strains over the last step. `wanted`: growth rate of the edges at the guess. `afresh`: the guess
// differs from the last velocity, so the law is evaluated twice. `here`: [16] 1 if the edge exists, else 0. `strain`:
// the strains, NULL with KN_LAW_VOIGT.
LANES_INLINE void bars_law(const kn_model *model, const law_tables *t, const bars *x, kn_law_kind kind, bool stroke,
                           kn_linearization how, lanes wanted, bool afresh, bool again, const real *here, real *strain,
                           lanes *stress, lanes *root)
{
    const lanes scale = x->scale, a = lanes_set(t->a), k1 = lanes_set(t->k1), zero = lanes_set(0);
    lanes u, b = zero, s = zero;
    // without a damper the strain follows from the length and is not stored
    if (kind == KN_LAW_VOIGT) {
        u = bars_strain(t, x);
        law_of(model, t, kind, how, lanes_fma(a, lanes_mul(wanted, scale), lanes_mul(k1, u)), stress, root);
        return;
    }
    u = lanes_load(strain);
    lanes whole = stroke ? bars_strain(t, x) : u;
    if (!again) {
        // Growth rate of the edge over the last step, from the velocities to second order, because a difference of
        // lengths would lose 4 digits in f32: (L_new - L_old)/dt = L' - dt/2 (|dv|^2 - L'^2)/L
        lanes across2 = lanes_fnma(x->rate, x->rate, dot(x->dv, x->dv));
        lanes done = lanes_fnma(lanes_mul(lanes_set(t->half_dt), across2), x->inverse, x->rate);
        b = lanes_fma(a, lanes_mul(done, scale), lanes_mul(k1, u));
        law_of(model, t, kind, how, b, &s, root);
        // advance u by dt (s - k1 u)/A, keep the damper between its stops, and set u = 0 where there is no edge
        u = lanes_fma(lanes_set(t->gain), s, lanes_mul(lanes_set(t->keep), u));
        if (stroke)
            u = lanes_max(lanes_sub(whole, lanes_set(t->outwards)),
                          lanes_min(lanes_sub(whole, lanes_set(t->inwards)), u));
        u = lanes_mul(u, lanes_load(here));
        lanes_store(strain, u);
    }
    // compute the stress at the end of this step
    lanes sought = lanes_fma(a, lanes_mul(wanted, scale), lanes_mul(k1, u));
    if (stroke) {
        law_of(model, t, kind, how, sought, stress, root);
        law_stop(t, sought, lanes_sub(whole, u), stress, root);
    } else if (afresh) {
        law_again(model, t, kind, how, &sought, stress, root);
    } else {
        // the guess is the last velocity, so b has changed only by k1 du and the second-order term: the linearised law
        // is accurate enough
        *stress = lanes_fma(lanes_mul(*root, *root), lanes_sub(sought, b), s);
    }
}

#endif
