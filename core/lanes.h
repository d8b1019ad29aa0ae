#ifndef KN_CORE_LANES_H
#define KN_CORE_LANES_H
// Sixteen lanes of float or double on whatever the file is compiled for. Private to kernel.c.
//
// Every instruction set gets the same 16 logical lanes, IEEE division and square root, and fused operations only where
// lanes_fma is written, so all of them give the same bits: a native vector N of W lanes is repeated PARTS = 16/W times.
//
//     KN_KERNEL_AVX512  f32 1 x 16   f64 2 x 8        KN_KERNEL_BASE  1 x 16, fma() from libm: in software where the
//     KN_KERNEL_AVX2    f32 2 x 8    f64 4 x 4                        processor has none (right, not real time)
#include "core/grid.h"
#include <math.h>
#include <stdint.h>
#include <string.h>

#if KN_KERNEL_F32
typedef float real;
#else
typedef double real;
#endif

#if KN_KERNEL_AVX512 || KN_KERNEL_AVX2
#include <immintrin.h>
#endif

#if KN_KERNEL_BASE || KN_KERNEL_CHECKED // not fast anyway: inlined everywhere they would take a compiler minutes
#define LANES_INLINE static inline
#else
#define LANES_INLINE static inline __attribute__((always_inline))
#endif

#if KN_KERNEL_AVX512 && KN_KERNEL_F32
typedef __m512 native;
#define PARTS 1
#define N(op) _mm512_##op##_ps
#define N_MIN(a, b) _mm512_min_ps(a, b)
#define N_MAX(a, b) _mm512_max_ps(a, b)
#define N_LESS(a, b, x, y) _mm512_mask_blend_ps(_mm512_cmp_ps_mask(a, b, _CMP_LT_OQ), y, x)
#elif KN_KERNEL_AVX512
typedef __m512d native;
#define PARTS 2
#define N(op) _mm512_##op##_pd
#define N_MIN(a, b) _mm512_min_pd(a, b)
#define N_MAX(a, b) _mm512_max_pd(a, b)
#define N_LESS(a, b, x, y) _mm512_mask_blend_pd(_mm512_cmp_pd_mask(a, b, _CMP_LT_OQ), y, x)
#elif KN_KERNEL_AVX2 && KN_KERNEL_F32
typedef __m256 native;
#define PARTS 2
#define N(op) _mm256_##op##_ps
#define N_MIN(a, b) _mm256_min_ps(a, b)
#define N_MAX(a, b) _mm256_max_ps(a, b)
#define N_LESS(a, b, x, y) _mm256_blendv_ps(y, x, _mm256_cmp_ps(a, b, _CMP_LT_OQ))
#elif KN_KERNEL_AVX2
typedef __m256d native;
#define PARTS 4
#define N(op) _mm256_##op##_pd
#define N_MIN(a, b) _mm256_min_pd(a, b)
#define N_MAX(a, b) _mm256_max_pd(a, b)
#define N_LESS(a, b, x, y) _mm256_blendv_pd(y, x, _mm256_cmp_pd(a, b, _CMP_LT_OQ))
#else
// GNU vectors of all 16 lanes: the compiler makes of them what the processor has. Fused operations and roots: by lane.
typedef real native __attribute__((vector_size(KN_LANES * sizeof(real)), may_alias));
typedef __typeof__((native){0} < (native){0}) native_mask;
#define PARTS 1
#define N(op) base_##op
LANES_INLINE native base_set1(real a) { return a - (native){0}; }
LANES_INLINE native base_load(const real *p) { return *(const native *)(const void *)p; }
LANES_INLINE void base_store(real *p, native a) { *(native *)(void *)p = a; }
LANES_INLINE native base_add(native a, native b) { return a + b; }
LANES_INLINE native base_sub(native a, native b) { return a - b; }
LANES_INLINE native base_mul(native a, native b) { return a * b; }
LANES_INLINE native base_div(native a, native b) { return a / b; }
LANES_INLINE native base_sqrt(native a)
{
    for (int i = 0; i < KN_LANES; i++)
        a[i] = sizeof(real) == sizeof(float) ? (real)sqrtf((float)a[i]) : (real)sqrt((double)a[i]);
    return a;
}
static __attribute__((noinline)) void base_fuse(const native *a, const native *b, native *c)
{
    for (int i = 0; i < KN_LANES; i++)
        (*c)[i] = sizeof(real) == sizeof(float) ? (real)fmaf((float)(*a)[i], (float)(*b)[i], (float)(*c)[i])
                                                : (real)fma((double)(*a)[i], (double)(*b)[i], (double)(*c)[i]);
}
LANES_INLINE native base_fmadd(native a, native b, native c)
{
    base_fuse(&a, &b, &c);
    return c;
}
LANES_INLINE native base_fnmadd(native a, native b, native c) { return base_fmadd(-a, b, c); }
LANES_INLINE native base_less(native a, native b, native x, native y)
{
    native_mask m = a < b;
    return (native)((m & (native_mask)x) | (~m & (native_mask)y));
}
#define N_MIN(a, b) base_less(a, b, a, b) // as minps: the second when unordered
#define N_MAX(a, b) base_less(b, a, a, b)
#define N_LESS(a, b, x, y) base_less(a, b, x, y)
#endif

#define W (KN_LANES / PARTS)

typedef struct lanes {
    native part[PARTS];
} lanes;

#define EACH for (int i = 0; i < PARTS; i++)

LANES_INLINE lanes lanes_set(real a)
{
    lanes r;
    EACH r.part[i] = N(set1)(a);
    return r;
}
LANES_INLINE lanes lanes_load(const real *p)
{
    lanes r;
    EACH r.part[i] = N(load)(p + W * i);
    return r;
}
LANES_INLINE void lanes_store(real *p, lanes a) { EACH N(store)(p + W * i, a.part[i]); }

#define LANES_2(name, expression)                                                                                      \
    LANES_INLINE lanes lanes_##name(lanes a, lanes b)                                                                  \
    {                                                                                                                  \
        lanes r;                                                                                                       \
        EACH r.part[i] = expression;                                                                                   \
        return r;                                                                                                      \
    }
LANES_2(add, N(add)(a.part[i], b.part[i]))
LANES_2(sub, N(sub)(a.part[i], b.part[i]))
LANES_2(mul, N(mul)(a.part[i], b.part[i]))
LANES_2(div, N(div)(a.part[i], b.part[i]))
LANES_2(min, N_MIN(a.part[i], b.part[i]))
LANES_2(max, N_MAX(a.part[i], b.part[i]))

LANES_INLINE lanes lanes_fma(lanes a, lanes b, lanes c) // a b + c
{
    lanes r;
    EACH r.part[i] = N(fmadd)(a.part[i], b.part[i], c.part[i]);
    return r;
}
LANES_INLINE lanes lanes_fnma(lanes a, lanes b, lanes c) // c - a b
{
    lanes r;
    EACH r.part[i] = N(fnmadd)(a.part[i], b.part[i], c.part[i]);
    return r;
}
LANES_INLINE lanes lanes_sqrt(lanes a)
{
    lanes r;
    EACH r.part[i] = N(sqrt)(a.part[i]);
    return r;
}
LANES_INLINE lanes lanes_less(lanes a, lanes b, lanes x, lanes y) // a < b ? x : y
{
    lanes r;
    EACH r.part[i] = N_LESS(a.part[i], b.part[i], x.part[i], y.part[i]);
    return r;
}

// Lane l takes lane l+1 (next) or l-1 (prev); the row's end wraps, where the edge that uses it has weight 0.
#if KN_KERNEL_AVX512 && KN_KERNEL_F32
#define ROTATE(v, n)                                                                                                   \
    _mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512((v).part[0]), _mm512_castps_si512((v).part[0]), n))
LANES_INLINE lanes lanes_next(lanes a) { return (lanes){{ROTATE(a, 1)}}; }
LANES_INLINE lanes lanes_prev(lanes a) { return (lanes){{ROTATE(a, 15)}}; }
#elif KN_KERNEL_AVX512
#define ROTATE(hi, lo, n) _mm512_castsi512_pd(_mm512_alignr_epi64(_mm512_castpd_si512(hi), _mm512_castpd_si512(lo), n))
LANES_INLINE lanes lanes_next(lanes a)
{
    return (lanes){{ROTATE(a.part[1], a.part[0], 1), ROTATE(a.part[0], a.part[1], 1)}};
}
LANES_INLINE lanes lanes_prev(lanes a)
{
    return (lanes){{ROTATE(a.part[0], a.part[1], 7), ROTATE(a.part[1], a.part[0], 7)}};
}
#elif KN_KERNEL_AVX2 && KN_KERNEL_F32
LANES_INLINE lanes lanes_next(lanes a)
{
    const __m256i turn = _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 0);
    __m256 lo = _mm256_permutevar8x32_ps(a.part[0], turn), hi = _mm256_permutevar8x32_ps(a.part[1], turn);
    return (lanes){{_mm256_blend_ps(lo, hi, 0x80), _mm256_blend_ps(hi, lo, 0x80)}};
}
LANES_INLINE lanes lanes_prev(lanes a)
{
    const __m256i turn = _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6);
    __m256 lo = _mm256_permutevar8x32_ps(a.part[0], turn), hi = _mm256_permutevar8x32_ps(a.part[1], turn);
    return (lanes){{_mm256_blend_ps(lo, hi, 0x01), _mm256_blend_ps(hi, lo, 0x01)}};
}
#elif KN_KERNEL_AVX2
LANES_INLINE lanes lanes_next(lanes a)
{
    lanes t, r;
    EACH t.part[i] = _mm256_permute4x64_pd(a.part[i], 0x39);
    EACH r.part[i] = _mm256_blend_pd(t.part[i], t.part[(i + 1) % PARTS], 0x8);
    return r;
}
LANES_INLINE lanes lanes_prev(lanes a)
{
    lanes t, r;
    EACH t.part[i] = _mm256_permute4x64_pd(a.part[i], 0x93);
    EACH r.part[i] = _mm256_blend_pd(t.part[i], t.part[(i + PARTS - 1) % PARTS], 0x1);
    return r;
}
#else
LANES_INLINE lanes lanes_next(lanes a)
{
    native v = a.part[0];
    return (lanes){{__builtin_shufflevector(v, v, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0)}};
}
LANES_INLINE lanes lanes_prev(lanes a)
{
    native v = a.part[0];
    return (lanes){{__builtin_shufflevector(v, v, 15, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14)}};
}
#endif

// Sum of all lanes as a fixed tree in double: the same on every machine.
LANES_INLINE double lanes_sum(lanes a)
{
    _Alignas(64) real lane[KN_LANES];
    double sum[KN_LANES];
    lanes_store(lane, a);
    for (int i = 0; i < KN_LANES; i++) sum[i] = (double)lane[i];
    for (int half = KN_LANES / 2; half > 0; half /= 2)
        for (int i = 0; i < half; i++) sum[i] += sum[i + half];
    return sum[0];
}

// Look-up in a table of 16 floats by (bits(y) - bits(1)) >> shift, y in [1, end of table].
#if KN_KERNEL_F32
#if KN_KERNEL_AVX512
typedef __m512i segment;
LANES_INLINE segment segment_of(lanes y, int shift)
{
    __m512i bits = _mm512_sub_epi32(_mm512_castps_si512(y.part[0]), _mm512_set1_epi32(0x3f800000));
    return _mm512_srl_epi32(bits, _mm_cvtsi32_si128(shift));
}
LANES_INLINE lanes lanes_table(const float *table, segment s)
{
    return (lanes){{_mm512_permutexvar_ps(s, _mm512_load_ps(table))}};
}
#elif KN_KERNEL_AVX2
typedef struct segment {
    __m256i part[2];
} segment;
LANES_INLINE segment segment_of(lanes y, int shift)
{
    segment s;
    for (int i = 0; i < 2; i++)
        s.part[i] = _mm256_srl_epi32(
            _mm256_sub_epi32(_mm256_castps_si256(y.part[i]), _mm256_set1_epi32(0x3f800000)), _mm_cvtsi32_si128(shift));
    return s;
}
LANES_INLINE lanes lanes_table(const float *table, segment s)
{
    __m256 low = _mm256_load_ps(table), high = _mm256_load_ps(table + 8);
    lanes r;
    for (int i = 0; i < 2; i++) // bit 3 of the index, moved to the sign, chooses the half
        r.part[i] = _mm256_blendv_ps(_mm256_permutevar8x32_ps(low, s.part[i]),
                                     _mm256_permutevar8x32_ps(high, s.part[i]),
                                     _mm256_castsi256_ps(_mm256_slli_epi32(s.part[i], 28)));
    return r;
}
#else
typedef struct segment {
    uint32_t index[KN_LANES];
} segment;
LANES_INLINE segment segment_of(lanes y, int shift)
{
    segment s;
    memcpy(s.index, y.part, sizeof s.index); // float bits
    for (int i = 0; i < KN_LANES; i++) s.index[i] = ((s.index[i] - 0x3f800000u) >> shift) & (16 - 1);
    return s;
}
LANES_INLINE lanes lanes_table(const float *table, segment s)
{
    lanes r;
    for (int i = 0; i < KN_LANES; i++) r.part[0][i] = table[s.index[i]];
    return r;
}
#endif
#endif

#endif
