#include "bench/throughput.h"
#include "bench/bench.h"

#include <string.h>
#include <unistd.h>

const char *const ceiling_level[CEILING_LEVELS] = {"L1", "L2", "L3", "memory"};

enum { CHAINS = 12, STREAMS = 8, RUNS = 5, ROUNDS = 8 };

#if defined(__x86_64__)
#include <immintrin.h>

// Call the fused multiply-add as an intrinsic, because -ffp-contract=off keeps the compiler from fusing. noinline keeps
// the compiler from computing the result in advance.
#define FMA_CHAINS(name, isa, vector, real, set, fma)                                                                  \
    static __attribute__((noinline, target(isa))) double name(long rounds)                                             \
    {                                                                                                                  \
        vector sum[CHAINS], a = set((real)0.999), b = set((real)1e-3);                                                 \
        real last[sizeof(vector) / sizeof(real)];                                                                      \
        double total = 0;                                                                                              \
        for (int i = 0; i < CHAINS; i++) sum[i] = set((real)i);                                                        \
        for (long r = 0; r < rounds; r++)                                                                              \
            for (int i = 0; i < CHAINS; i++) sum[i] = fma(sum[i], a, b);                                               \
        for (int i = 0; i < CHAINS; i++) {                                                                             \
            memcpy(last, &sum[i], sizeof last);                                                                        \
            total += (double)last[0];                                                                                  \
        }                                                                                                              \
        return total;                                                                                                  \
    }
FMA_CHAINS(fma_256_f32, "avx2,fma", __m256, float, _mm256_set1_ps, _mm256_fmadd_ps)
FMA_CHAINS(fma_256_f64, "avx2,fma", __m256d, double, _mm256_set1_pd, _mm256_fmadd_pd)
FMA_CHAINS(fma_512_f32, "avx512f", __m512, float, _mm512_set1_ps, _mm512_fmadd_ps)
FMA_CHAINS(fma_512_f64, "avx512f", __m512d, double, _mm512_set1_pd, _mm512_fmadd_pd)

#define READ_STREAMS(name, isa, bits)                                                                                  \
    typedef float name##_vector __attribute__((vector_size(bits / 8)));                                                \
    static __attribute__((noinline, target(isa))) double name(const void *p, size_t bytes)                             \
    {                                                                                                                  \
        const name##_vector *v = p;                                                                                    \
        name##_vector sum[STREAMS] = {{0}};                                                                            \
        float total = 0;                                                                                               \
        for (size_t i = 0; i + STREAMS <= bytes / sizeof *v; i += STREAMS)                                             \
            for (int s = 0; s < STREAMS; s++) sum[s] += v[i + (size_t)s];                                              \
        for (int s = 0; s < STREAMS; s++) total += sum[s][0];                                                          \
        return (double)total;                                                                                          \
    }
READ_STREAMS(read_256, "avx2", 256)
READ_STREAMS(read_512, "avx512f", 512)

static bool has(int width)
{
    return width == CEILING_512 ? __builtin_cpu_supports("avx512f")
                                : __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}

static volatile double sink; // keeps the compiler from removing the computation

static double measure_fma(int width, int f64)
{
    static double (*const chains[CEILING_WIDTHS][2])(long) = {{fma_256_f32, fma_256_f64}, {fma_512_f32, fma_512_f64}};
    const long rounds = 200000;
    double best_us = 1e30, lanes = (width == CEILING_512 ? 64 : 32) / (f64 ? 8.0 : 4.0);
    for (int i = 0; i < RUNS; i++) {
        double before = thread_us();
        sink = chains[width][f64](rounds);
        double us = thread_us() - before;
        if (us < best_us) best_us = us;
    }
    return 2 * lanes * CHAINS * (double)rounds / best_us * 1e-3;
}

static double measure_read(int width, const void *p, size_t bytes)
{
    const long passes = bytes < (16 << 20) ? (long)((32 << 20) / bytes) : 1;
    double best_us = 1e30;
    for (int i = 0; i < (passes == 1 ? 1 : RUNS); i++) {
        double before = thread_us();
        for (long k = 0; k < passes; k++) sink = width == CEILING_512 ? read_512(p, bytes) : read_256(p, bytes);
        double us = thread_us() - before;
        if (us < best_us) best_us = us;
    }
    return (double)bytes * (double)passes / best_us * 1e-3;
}
#else
static bool has(int width) { return width < 0; }
static double measure_fma(int width, int f64) { return width + f64; }
static double measure_read(int width, const void *p, size_t bytes) { return p ? width + (double)bytes : 0; }
#endif

static size_t cache(int name, size_t otherwise)
{
    long bytes = sysconf(name);
    return bytes > 0 ? (size_t)bytes : otherwise;
}

// Choose the amount of data to read for each level. L1 and L2: half of the cache, so that the other data of the program
// fits in too. L3, which other cores share: 8 times the L2 cache, at most half of the L3 cache. Memory: four times the
// L3 cache, at most 1 GiB and at most a quarter of the memory.
static void choose_sizes(ceilings *c)
{
    c->l1_bytes = cache(_SC_LEVEL1_DCACHE_SIZE, 32 << 10);
    c->l2_bytes = cache(_SC_LEVEL2_CACHE_SIZE, 1 << 20);
    c->l3_bytes = cache(_SC_LEVEL3_CACHE_SIZE, 16 << 20);
    size_t most = (size_t)sysconf(_SC_PHYS_PAGES) * (size_t)sysconf(_SC_PAGESIZE) / 4;
    if (most > 1u << 30) most = 1u << 30;
    size_t third = 8 * c->l2_bytes < c->l3_bytes / 2 ? 8 * c->l2_bytes : c->l3_bytes / 2;
    c->level[CEILING_L1].bytes = c->l1_bytes / 2;
    c->level[CEILING_L2].bytes = c->l2_bytes / 2;
    c->level[CEILING_L3].bytes = third;
    c->level[CEILING_MEMORY].bytes = 4 * c->l3_bytes < most ? 4 * c->l3_bytes : most;
}

static void keep_best(double *best, double rate)
{
    if (rate > *best) *best = rate;
}

ceilings ceilings_measure(void)
{
    ceilings c = {0};
    choose_sizes(&c);
    size_t bytes = (c.level[CEILING_MEMORY].bytes + 63) / 64 * 64;
    void *p = aligned_alloc(64, bytes);
    if (!p) abort();
    memset(p, 0, bytes);
    // Measure in several rounds, because other programs use the caches at times.
    for (int round = 0; round < ROUNDS * CEILING_WIDTHS; round++) {
        int width = round % CEILING_WIDTHS;
        if (!has(width)) continue;
        for (int f64 = 0; f64 < 2; f64++) keep_best(&c.gflop_s[width][f64], measure_fma(width, f64));
        for (int level = 0; level < CEILING_LEVELS; level++)
            keep_best(&c.level[level].gb_s[width], measure_read(width, p, c.level[level].bytes));
    }
    free(p);
    return c;
}

int ceiling_of(const ceilings *c, size_t bytes)
{
    return bytes <= c->l1_bytes   ? CEILING_L1
           : bytes <= c->l2_bytes ? CEILING_L2
           : bytes <= c->l3_bytes ? CEILING_L3
                                  : CEILING_MEMORY;
}
