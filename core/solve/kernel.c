// Choice of the kernels for a model by processor, lattice and precision, and allocation of their tables.
#include "core/solve/kernel.h"

#include <stdlib.h>
#include <string.h>

static bool supports(kn_isa isa)
{
#if defined(__x86_64__)
    if (isa == KN_ISA_AVX512)
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
               __builtin_cpu_supports("avx512dq");
    if (isa == KN_ISA_AVX2) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif
    return isa == KN_ISA_BASE;
}

bool kn_isa_supported(kn_isa isa) { return isa == KN_ISA_AUTO || supports(isa); }

bool kn_kernels_choose(kn_model *m)
{
    static const kn_kernels *const set[2][3][2] = {{{&kn_kernels_grid_base_f32, &kn_kernels_grid_base_f64},
                                                    {&kn_kernels_grid_avx2_f32, &kn_kernels_grid_avx2_f64},
                                                    {&kn_kernels_grid_avx512_f32, &kn_kernels_grid_avx512_f64}},
                                                   {{&kn_kernels_net_base_f32, &kn_kernels_net_base_f64},
                                                    {&kn_kernels_net_avx2_f32, &kn_kernels_net_avx2_f64},
                                                    {&kn_kernels_net_avx512_f32, &kn_kernels_net_avx512_f64}}};
    m->isa = m->def.solver.isa;
    if (m->isa == KN_ISA_AUTO)
        m->isa = supports(KN_ISA_AVX512) ? KN_ISA_AVX512 : supports(KN_ISA_AVX2) ? KN_ISA_AVX2 : KN_ISA_BASE;
    m->kernels = set[m->def.mesh != NULL][m->isa - KN_ISA_BASE][m->def.solver.precision];
    return supports(m->isa);
}

void *kn_tables_create(const kn_model *model, const kn_kernels *kernels)
{
    size_t bytes = (kernels->tables_size(model) + 63) / 64 * 64;
    void *tables = aligned_alloc(64, bytes);
    if (!tables) return NULL;
    memset(tables, 0, bytes);
    kernels->tables_build(model, tables);
    return tables;
}

bool kn_rigid_wanted(const kn_model *model)
{
    const kn_model_def *def = &model->def;
    return def->solver.kind == KN_SOLVER_IMPLICIT && def->support >= KN_SUPPORT_NONE && !model->composite &&
           def->thickness_m == 0;
}
