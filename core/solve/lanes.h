#ifndef KN_CORE_SOLVE_LANES_H
#define KN_CORE_SOLVE_LANES_H
// Vectors of sixteen lanes of float or double, for the instruction set for which a file is compiled. Only the kernels
// include this header.
//
// On every instruction set there are 16 logical lanes, with IEEE division and square root. Operations are fused only
// where lanes_fma is written. Therefore all instruction sets give the same bits. A native vector has W lanes, so a
// vector of 16 lanes is PARTS = 16/W native vectors.
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

// BASE and CHECKED builds need not be fast, and forced inlining would take a compiler minutes.
#if KN_KERNEL_BASE || KN_KERNEL_CHECKED
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
// GNU vectors of all 16 lanes, which the compiler maps to the processor. Fused operations and roots are computed one
// lane after the other.
typedef real native __attribute__((vector_size(KN_LANES * sizeof(real)), may_alias));
typedef __typeof__((native){0} < (native){0}) native_mask;
// A vector in memory: arrays are aligned to 64 bytes, while the type of 16 doubles would require 128.
typedef real stored __attribute__((vector_size(KN_LANES * sizeof(real)), may_alias, aligned(64)));
#define PARTS 1
#define N(op) base_##op
LANES_INLINE native base_set1(real a) { return a - (native){0}; }
LANES_INLINE native base_load(const real *p) { return *(const stored *)(const void *)p; }
LANES_INLINE void base_store(real *p, native a) { *(stored *)(void *)p = a; }
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
// Compute c = a b + c with the library's fma(), one lane after the other.
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
// as with the instruction minps, the result is the second operand if one of the two is NaN
#define N_MIN(a, b) base_less(a, b, a, b)
#define N_MAX(a, b) base_less(b, a, a, b)
#define N_LESS(a, b, x, y) base_less(a, b, x, y)
#endif

#define W (KN_LANES / PARTS) // number of lanes of a native vector

// A vector of 16 lanes. Its parts are separate members, not an array, and no code loops over them. With an array, gcc
// keeps the vectors in memory instead of registers, and the edge pass takes three times as long.
#if PARTS == 1
#define EACH(part) part(0)
typedef struct lanes {
    native p0;
} lanes;
#elif PARTS == 2
#define EACH(part) part(0) part(1)
typedef struct lanes {
    native p0, p1;
} lanes;
#else
#define EACH(part) part(0) part(1) part(2) part(3)
typedef struct lanes {
    native p0, p1, p2, p3;
} lanes;
#endif

// Each operation is written once, for one part; EACH repeats it for all parts.
#define SET(i) N(set1)(a),
#define LOAD(i) N(load)(p + W * i),
#define STORE(i) N(store)(p + W * i, a.p##i);
LANES_INLINE lanes lanes_set(real a) { return (lanes){EACH(SET)}; }
LANES_INLINE lanes lanes_load(const real *p) { return (lanes){EACH(LOAD)}; }
LANES_INLINE void lanes_store(real *p, lanes a){EACH(STORE)}

#define ADD(i) N(add)(a.p##i, b.p##i),
#define SUB(i) N(sub)(a.p##i, b.p##i),
#define MUL(i) N(mul)(a.p##i, b.p##i),
#define DIV(i) N(div)(a.p##i, b.p##i),
#define MIN(i) N_MIN(a.p##i, b.p##i),
#define MAX(i) N_MAX(a.p##i, b.p##i),
#define FMA(i) N(fmadd)(a.p##i, b.p##i, c.p##i),
#define FNMA(i) N(fnmadd)(a.p##i, b.p##i, c.p##i),
#define SQRT(i) N(sqrt)(a.p##i),
#define LESS(i) N_LESS(a.p##i, b.p##i, x.p##i, y.p##i),
LANES_INLINE lanes lanes_add(lanes a, lanes b)
{
    return (lanes){EACH(ADD)};
}
LANES_INLINE lanes lanes_sub(lanes a, lanes b) { return (lanes){EACH(SUB)}; }
LANES_INLINE lanes lanes_mul(lanes a, lanes b) { return (lanes){EACH(MUL)}; }
LANES_INLINE lanes lanes_div(lanes a, lanes b) { return (lanes){EACH(DIV)}; }
LANES_INLINE lanes lanes_min(lanes a, lanes b) { return (lanes){EACH(MIN)}; }
LANES_INLINE lanes lanes_max(lanes a, lanes b) { return (lanes){EACH(MAX)}; }
LANES_INLINE lanes lanes_sqrt(lanes a) { return (lanes){EACH(SQRT)}; }
LANES_INLINE lanes lanes_fma(lanes a, lanes b, lanes c) { return (lanes){EACH(FMA)}; }            // a b + c
LANES_INLINE lanes lanes_fnma(lanes a, lanes b, lanes c) { return (lanes){EACH(FNMA)}; }          // c - a b
LANES_INLINE lanes lanes_less(lanes a, lanes b, lanes x, lanes y) { return (lanes){EACH(LESS)}; } // a < b ? x : y

// Rotate: lane l takes the value of lane l+1 (next) or l-1 (prev). The last and the first lane are neighbours in this
// rotation, but an edge between them has weight 0.
#if KN_KERNEL_AVX512 && KN_KERNEL_F32
#define ROTATE(v, n)                                                                                                   \
    _mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512((v).p0), _mm512_castps_si512((v).p0), n))
LANES_INLINE lanes lanes_next(lanes a) { return (lanes){ROTATE(a, 1)}; }
LANES_INLINE lanes lanes_prev(lanes a) { return (lanes){ROTATE(a, 15)}; }
#elif KN_KERNEL_AVX512
#define ROTATE(hi, lo, n) _mm512_castsi512_pd(_mm512_alignr_epi64(_mm512_castpd_si512(hi), _mm512_castpd_si512(lo), n))
LANES_INLINE lanes lanes_next(lanes a) { return (lanes){ROTATE(a.p1, a.p0, 1), ROTATE(a.p0, a.p1, 1)}; }
LANES_INLINE lanes lanes_prev(lanes a) { return (lanes){ROTATE(a.p0, a.p1, 7), ROTATE(a.p1, a.p0, 7)}; }
#elif KN_KERNEL_AVX2 && KN_KERNEL_F32
LANES_INLINE lanes lanes_next(lanes a)
{
    const __m256i turn = _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 0);
    __m256 lo = _mm256_permutevar8x32_ps(a.p0, turn), hi = _mm256_permutevar8x32_ps(a.p1, turn);
    return (lanes){_mm256_blend_ps(lo, hi, 0x80), _mm256_blend_ps(hi, lo, 0x80)};
}
LANES_INLINE lanes lanes_prev(lanes a)
{
    const __m256i turn = _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6);
    __m256 lo = _mm256_permutevar8x32_ps(a.p0, turn), hi = _mm256_permutevar8x32_ps(a.p1, turn);
    return (lanes){_mm256_blend_ps(lo, hi, 0x01), _mm256_blend_ps(hi, lo, 0x01)};
}
#elif KN_KERNEL_AVX2
#define TURN(i) __m256d t##i = _mm256_permute4x64_pd(a.p##i, WHICH);
LANES_INLINE lanes lanes_next(lanes a)
{
#define WHICH 0x39
    EACH(TURN)
#undef WHICH
    return (lanes){_mm256_blend_pd(t0, t1, 0x8), _mm256_blend_pd(t1, t2, 0x8), _mm256_blend_pd(t2, t3, 0x8),
                   _mm256_blend_pd(t3, t0, 0x8)};
}
LANES_INLINE lanes lanes_prev(lanes a)
{
#define WHICH 0x93
    EACH(TURN)
#undef WHICH
    return (lanes){_mm256_blend_pd(t0, t3, 0x1), _mm256_blend_pd(t1, t0, 0x1), _mm256_blend_pd(t2, t1, 0x1),
                   _mm256_blend_pd(t3, t2, 0x1)};
}
#else
LANES_INLINE lanes lanes_next(lanes a)
{
    native v = a.p0;
    return (lanes){__builtin_shufflevector(v, v, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0)};
}
LANES_INLINE lanes lanes_prev(lanes a)
{
    native v = a.p0;
    return (lanes){__builtin_shufflevector(v, v, 15, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14)};
}
#endif

// Records of four reals, of which the first three are used. lanes_fetch loads sixteen records from anywhere, lanes_put
// stores sixteen that follow one another; each lane belongs to one record.
#if KN_KERNEL_F32 && (KN_KERNEL_AVX512 || KN_KERNEL_AVX2)
// Row k of a square of 4 x 4 reals in each 128 bits: the records k, k + 4, ... of the native vector i.
#define QUAD(i, k) _mm_load_ps(records + offset[W * i + k])
#if KN_KERNEL_AVX512
#define QUADS(i, k)                                                                                                    \
    _mm512_insertf32x8(_mm512_castps256_ps512(_mm256_set_m128(QUAD(i, k + 4), QUAD(i, k))),                            \
                       _mm256_set_m128(QUAD(i, k + 12), QUAD(i, k + 8)), 1)
#define UNQUAD(a, j) _mm512_extractf32x4_ps(a, j)
#else
#define QUADS(i, k) _mm256_set_m128(QUAD(i, k + 4), QUAD(i, k))
#define UNQUAD(a, j) _mm256_extractf128_ps(a, j)
#endif
#define FETCH(i)                                                                                                       \
    native a##i = QUADS(i, 0), b##i = QUADS(i, 1), c##i = QUADS(i, 2), d##i = QUADS(i, 3);                             \
    native ab##i = N(unpacklo)(a##i, b##i), cd##i = N(unpacklo)(c##i, d##i);                                           \
    out[0].p##i = N(shuffle)(ab##i, cd##i, 0x44);                                                                      \
    out[1].p##i = N(shuffle)(ab##i, cd##i, 0xee);                                                                      \
    out[2].p##i = N(shuffle)(N(unpackhi)(a##i, b##i), N(unpackhi)(c##i, d##i), 0x44);
LANES_INLINE void lanes_fetch(const real *records, const int offset[KN_LANES], lanes out[3]){EACH(FETCH)}

#define PUT_ROW(i, k, a)                                                                                               \
    _mm_store_ps(records + 4 * (W * i + k), UNQUAD(a, 0));                                                             \
    _mm_store_ps(records + 4 * (W * i + k + 4), UNQUAD(a, 1));                                                         \
    if (W == 16) {                                                                                                     \
        _mm_store_ps(records + 4 * (W * i + k + 8), UNQUAD(a, 2 % (W / 4)));                                           \
        _mm_store_ps(records + 4 * (W * i + k + 12), UNQUAD(a, 3 % (W / 4)));                                          \
    }
#define PUT(i)                                                                                                         \
    {                                                                                                                  \
        native zero = N(set1)(0);                                                                                      \
        native xy = N(unpacklo)(v[0].p##i, v[1].p##i), z = N(unpacklo)(v[2].p##i, zero);                               \
        PUT_ROW(i, 0, N(shuffle)(xy, z, 0x44))                                                                         \
        PUT_ROW(i, 1, N(shuffle)(xy, z, 0xee))                                                                         \
        xy = N(unpackhi)(v[0].p##i, v[1].p##i), z = N(unpackhi)(v[2].p##i, zero);                                      \
        PUT_ROW(i, 2, N(shuffle)(xy, z, 0x44))                                                                         \
        PUT_ROW(i, 3, N(shuffle)(xy, z, 0xee))                                                                         \
    }
LANES_INLINE void lanes_put(real *records, const lanes v[3]){EACH(PUT)}
#else
LANES_INLINE void lanes_fetch(const real *records, const int offset[KN_LANES], lanes out[3])
{
    _Alignas(64) real each[3][KN_LANES];
    for (int l = 0; l < KN_LANES; l++)
        for (int k = 0; k < 3; k++) each[k][l] = records[offset[l] + k];
    for (int k = 0; k < 3; k++) out[k] = lanes_load(each[k]);
}

LANES_INLINE void lanes_put(real *records, const lanes v[3])
{
    _Alignas(64) real each[3][KN_LANES];
    for (int k = 0; k < 3; k++) lanes_store(each[k], v[k]);
    for (int l = 0; l < KN_LANES; l++)
        for (int k = 0; k < 4; k++) records[4 * l + k] = k < 3 ? each[k][l] : 0;
}
#endif

// Sum all lanes in double precision, in the fixed order of a binary tree, so that all machines give the same result.
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

// Look up a table of 16 reals. The index is (bits(y) - bits(1)) >> shift, for y between 1 and the end of the table. For
// a float the bits are shifted by `shift`, for a double by `shift` + 29.
#if KN_KERNEL_F32
#define TABLE_ONE 0x3f800000
#define TABLE_SHIFT(shift) (shift)
#else
#define TABLE_ONE 0x3ff0000000000000
#define TABLE_SHIFT(shift) ((shift) + 29)
#endif
#if KN_KERNEL_AVX512 && KN_KERNEL_F32
typedef __m512i index_native;
#define SEGMENT(i) _mm512_srl_epi32(_mm512_sub_epi32(_mm512_castps_si512(y.p##i), _mm512_set1_epi32(TABLE_ONE)), by),
#define LOOK(i) _mm512_permutexvar_ps(s.p##i, _mm512_load_ps(table)),
#elif KN_KERNEL_AVX512
typedef __m512i index_native;
#define SEGMENT(i) _mm512_srl_epi64(_mm512_sub_epi64(_mm512_castpd_si512(y.p##i), _mm512_set1_epi64(TABLE_ONE)), by),
#define LOOK(i) _mm512_permutex2var_pd(_mm512_load_pd(table), s.p##i, _mm512_load_pd(table + 8)),
#elif KN_KERNEL_AVX2 && KN_KERNEL_F32
typedef __m256i index_native;
#define SEGMENT(i) _mm256_srl_epi32(_mm256_sub_epi32(_mm256_castps_si256(y.p##i), _mm256_set1_epi32(TABLE_ONE)), by),
// bit 3 of the index, moved to the sign bit, tells which half of the table holds the value
#define LOOK(i)                                                                                                        \
    _mm256_blendv_ps(_mm256_permutevar8x32_ps(_mm256_load_ps(table), s.p##i),                                          \
                     _mm256_permutevar8x32_ps(_mm256_load_ps(table + 8), s.p##i),                                      \
                     _mm256_castsi256_ps(_mm256_slli_epi32(s.p##i, 28))),
#elif KN_KERNEL_AVX2
typedef __m256i index_native;
#define SEGMENT(i) _mm256_srl_epi64(_mm256_sub_epi64(_mm256_castpd_si256(y.p##i), _mm256_set1_epi64x(TABLE_ONE)), by),
#define LOOK(i) _mm256_i64gather_pd(table, s.p##i, 8),
#endif
#if KN_KERNEL_AVX512 || KN_KERNEL_AVX2
#define MEMBER(i) index_native p##i;
typedef struct segment {
    EACH(MEMBER)
} segment;
LANES_INLINE segment segment_of(lanes y, int shift)
{
    const __m128i by = _mm_cvtsi32_si128(TABLE_SHIFT(shift));
    return (segment){EACH(SEGMENT)};
}
LANES_INLINE lanes lanes_table(const real *table, segment s) { return (lanes){EACH(LOOK)}; }
#else
typedef struct segment {
    int index[KN_LANES];
} segment;
#if KN_KERNEL_F32
typedef uint32_t real_bits;
#else
typedef uint64_t real_bits;
#endif
LANES_INLINE segment segment_of(lanes y, int shift)
{
    real_bits bits[KN_LANES];
    segment s;
    memcpy(bits, &y, sizeof bits);
    for (int i = 0; i < KN_LANES; i++) s.index[i] = (int)((bits[i] - TABLE_ONE) >> TABLE_SHIFT(shift)) & (16 - 1);
    return s;
}
LANES_INLINE lanes lanes_table(const real *table, segment s)
{
    lanes r;
    for (int i = 0; i < KN_LANES; i++) r.p0[i] = table[s.index[i]];
    return r;
}
#endif

// lanes_inverse_root computes 1/sqrt(a) in every lane, for a > 0.
#if KN_KERNEL_F32
LANES_INLINE lanes lanes_inverse_root(lanes a) { return lanes_div(lanes_set(1), lanes_sqrt(a)); }
#else
// Halving the exponent by a shift of the bits gives 1/sqrt(a) to 3.5 %. Two iterations of fourth order reduce the error
// to one unit in the last place. The method takes a third of the time of a root and a quotient, which keep the divider
// busy for 45 cycles per 8 lanes.
#define INVERSE_ROOT_BITS 0x5fe6eb50c7b537a9 // C. Lomont, Fast inverse square root (2003), for doubles
#if KN_KERNEL_AVX512
#define GUESS(i)                                                                                                       \
    _mm512_castsi512_pd(                                                                                               \
        _mm512_sub_epi64(_mm512_set1_epi64(INVERSE_ROOT_BITS), _mm512_srli_epi64(_mm512_castpd_si512(a.p##i), 1))),
#elif KN_KERNEL_AVX2
#define GUESS(i)                                                                                                       \
    _mm256_castsi256_pd(                                                                                               \
        _mm256_sub_epi64(_mm256_set1_epi64x(INVERSE_ROOT_BITS), _mm256_srli_epi64(_mm256_castpd_si256(a.p##i), 1))),
#else
LANES_INLINE native base_guess(native a)
{
    uint64_t bits[KN_LANES];
    memcpy(bits, &a, sizeof bits);
    for (int i = 0; i < KN_LANES; i++) bits[i] = INVERSE_ROOT_BITS - (bits[i] >> 1);
    memcpy(&a, bits, sizeof bits);
    return a;
}
#define GUESS(i) base_guess(a.p##i),
#endif
LANES_INLINE lanes lanes_inverse_root(lanes a)
{
    lanes root = {EACH(GUESS)};
    // with the error off = 1 - a root^2, add root (off/2 + 3/8 off^2 + 5/16 off^3) to root
    for (int i = 0; i < 2; i++) {
        lanes off = lanes_fnma(a, lanes_mul(root, root), lanes_set(1));
        lanes series = lanes_fma(off, lanes_fma(off, lanes_set(5.0 / 16), lanes_set(3.0 / 8)), lanes_set(0.5));
        root = lanes_fma(lanes_mul(root, off), series, root);
    }
    return root;
}
#endif

#endif
