#include "core/material.h"

#include <math.h>
#include <stddef.h>

double kn_material_c2(const kn_material *mat, double stress_pa)
{
    switch (mat->damper) {
    case KN_DAMPER_NONE: return INFINITY;
    case KN_DAMPER_CONSTANT: return mat->c2_pa_s;
    case KN_DAMPER_EXPONENTIAL: break;
    }
    double s = fmin(fmax(fabs(stress_pa), mat->p0_pa), mat->p1_pa);
    return mat->alpha_pa_s * exp(-mat->beta_per_pa * s);
}

double kn_material_flow(const kn_material *mat, double stress_pa)
{
    return mat->damper == KN_DAMPER_NONE ? 0.0 : stress_pa / kn_material_c2(mat, stress_pa);
}

double kn_material_compliance(const kn_material *mat, double seconds)
{
    double voigt = mat->k1_pa > 0 ? 1 / mat->k1_pa : seconds / mat->c1_pa_s;
    if (mat->k1_pa > 0 && mat->c1_pa_s > 0) voigt *= -expm1(-mat->k1_pa / mat->c1_pa_s * seconds);
    return voigt + seconds / kn_material_c2(mat, 0);
}

const char *kn_material_check(const kn_material *mat)
{
    if (!(isfinite(mat->k1_pa) && mat->k1_pa >= 0)) return "k1 must be finite and not negative";
    if (!(isfinite(mat->c1_pa_s) && mat->c1_pa_s >= 0)) return "c1 must be finite and not negative";
    if (mat->k1_pa == 0 && mat->c1_pa_s == 0) return "k1 and c1 cannot both be 0: nothing would resist";
    if (mat->damper == KN_DAMPER_CONSTANT && !(isfinite(mat->c2_pa_s) && mat->c2_pa_s > 0))
        return "c2 must be finite and positive (damper: none makes it rigid)";
    if (mat->damper != KN_DAMPER_EXPONENTIAL) return NULL;
    if (!(isfinite(mat->alpha_pa_s) && mat->alpha_pa_s > 0)) return "alpha must be finite and positive";
    if (!(isfinite(mat->beta_per_pa) && mat->beta_per_pa >= 0)) return "beta must be finite and not negative";
    if (!(isfinite(mat->p1_pa) && mat->p0_pa >= 0 && mat->p0_pa < mat->p1_pa)) return "needs 0 <= p0 < p1, finite";
    if (mat->beta_per_pa * mat->p1_pa > 600) return "beta * p1 above 600 leaves the range of a double";
    return NULL;
}
