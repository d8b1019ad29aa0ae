#include "core/material.h"

#include <math.h>
#include <stddef.h>

// The limits of the permanent strain, a0/a - 1, follow from the limits of the ratio a. The damper cannot move if both
// of its stops are at one place.
bool kn_material_stroke(const kn_material *mat, double *in, double *out)
{
    bool stops = mat->stroke[1] > 0;
    *in = stops ? mat->ratio / mat->stroke[1] - 1 : -INFINITY;
    *out = stops ? mat->ratio / mat->stroke[0] - 1 : INFINITY;
    return mat->damper == KN_DAMPER_NONE || (stops && mat->stroke[0] == mat->stroke[1]);
}

// Return whether the damper cannot move.
static bool rigid(const kn_material *mat)
{
    double in, out;
    return kn_material_stroke(mat, &in, &out);
}

// Return where a stress lies on the ramp of c2: 0 at p0, 1 at p1.
static double along(const kn_material *mat, double s) { return (s - mat->p0_pa) / (mat->p1_pa - mat->p0_pa); }

double kn_material_c2(const kn_material *mat, double stress_pa)
{
    if (rigid(mat)) return INFINITY;
    if (mat->damper == KN_DAMPER_CONSTANT) return mat->c2_pa_s;
    double s = fmin(fmax(fabs(stress_pa), mat->p0_pa), mat->p1_pa);
    if (mat->damper == KN_DAMPER_RAMP) return mat->c_max_pa_s + (mat->c_min_pa_s - mat->c_max_pa_s) * along(mat, s);
    return mat->alpha_pa_s * exp(-mat->beta_per_pa * s);
}

double kn_material_flow(const kn_material *mat, double stress_pa)
{
    return rigid(mat) ? 0.0 : stress_pa / kn_material_c2(mat, stress_pa);
}

double kn_material_thinning(const kn_material *mat, double stress_pa)
{
    if (rigid(mat) || mat->damper == KN_DAMPER_CONSTANT || stress_pa < mat->p0_pa || stress_pa > mat->p1_pa) return 0;
    if (mat->damper == KN_DAMPER_EXPONENTIAL) return mat->beta_per_pa;
    return (mat->c_max_pa_s - mat->c_min_pa_s) / (mat->p1_pa - mat->p0_pa) / kn_material_c2(mat, stress_pa);
}

double kn_material_compliance(const kn_material *mat, double seconds)
{
    // add the creep of the Voigt element and the flow of the damper with c2 at zero stress
    double voigt = mat->k1_pa > 0 ? 1 / mat->k1_pa : seconds / mat->c1_pa_s;
    if (mat->k1_pa > 0 && mat->c1_pa_s > 0) voigt *= -expm1(-mat->k1_pa / mat->c1_pa_s * seconds);
    return voigt + seconds / kn_material_c2(mat, 0);
}

static const char *check_stroke(const kn_material *mat)
{
    double least = mat->stroke[0], most = mat->stroke[1];
    if (least == 0 && most == 0) return NULL;
    if (!(least >= 0 && least <= most && most > 0 && most <= 1))
        return "stroke needs 0 <= a_min <= a_max <= 1, a_max > 0";
    if (!(mat->ratio > 0 && mat->ratio >= least && mat->ratio <= most))
        return "ratio must be within the stroke, a_min <= a0 <= a_max, and above 0";
    return NULL;
}

static const char *check_damper(const kn_material *mat)
{
    if (mat->damper == KN_DAMPER_NONE) return NULL;
    if (mat->damper == KN_DAMPER_CONSTANT) {
        if (isfinite(mat->c2_pa_s) && mat->c2_pa_s > 0) return NULL;
        return "c2 must be finite and positive (damper: none makes it rigid)";
    }
    if (!(isfinite(mat->p1_pa) && mat->p0_pa >= 0 && mat->p0_pa < mat->p1_pa)) return "needs 0 <= p0 < p1, finite";
    if (mat->damper == KN_DAMPER_RAMP) {
        if (!(isfinite(mat->c_max_pa_s) && mat->c_min_pa_s > 0 && mat->c_min_pa_s <= mat->c_max_pa_s))
            return "needs 0 < c_min <= c_max, finite: a damper may not thicken under load";
        return NULL;
    }
    if (!(isfinite(mat->alpha_pa_s) && mat->alpha_pa_s > 0)) return "alpha must be finite and positive";
    if (!(isfinite(mat->beta_per_pa) && mat->beta_per_pa >= 0)) return "beta must be finite and not negative";
    if (mat->beta_per_pa * mat->p1_pa > 600) return "beta * p1 above 600 leaves the range of a double";
    return NULL;
}

const char *kn_material_check(const kn_material *mat)
{
    if (!(isfinite(mat->k1_pa) && mat->k1_pa >= 0)) return "k1 must be finite and not negative";
    if (!(isfinite(mat->c1_pa_s) && mat->c1_pa_s >= 0)) return "c1 must be finite and not negative";
    if (mat->k1_pa == 0 && mat->c1_pa_s == 0) return "k1 and c1 cannot both be 0: nothing would resist";
    const char *wrong = check_damper(mat);
    return wrong ? wrong : check_stroke(mat);
}
