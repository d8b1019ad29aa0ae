#include "core/model.h"

#include <math.h>

kn_model_def kn_model_def_default(void)
{
    const double gf_cm2 = 98.0665; // 1 gf/cm^2 in Pa
    return (kn_model_def){
        // dough of the first paper, whose moduli are per height, for a height of 1 cm
        .material = {.k1_pa = 470 * gf_cm2,
                     .c1_pa_s = 2500 * gf_cm2,
                     .damper = KN_DAMPER_EXPONENTIAL,
                     .alpha_pa_s = 8.16e4 * gf_cm2,
                     .beta_per_pa = 0.0815 / gf_cm2,
                     .p0_pa = 9 * gf_cm2,
                     .p1_pa = 80 * gf_cm2},
        .density_kg_m3 = 1200,
        .nodes = {6, 6, 4},
        .spacing_m = 0.01,
        .diagonal_stiffness = 1,
        .inside_pressure_pa = 101325, // 1 atm
        .force_factor = 1,
        .probe_count = 1,
        .probe[0] = {.name = "finger", .shape = KN_PROBE_SPHERE, .radius_m = 0.015},
        .solver =
            {.dt_s = 1e-3, .iterations = 4, .iterations_max = 24, .tolerance = 1e-3, .passes = 1, .mass_scale = 1},
    };
}

void kn_model_def_extent(const kn_model_def *def, double extent_m[3])
{
    for (int k = 0; k < 3; k++) {
        // the extent of a block follows from its number of nodes; a mesh is centred over the origin and stands on z = 0
        extent_m[k] = def->mesh ? 0 : def->spacing_m * (def->nodes[k] - 1);
        for (int i = 0; def->mesh && i < def->mesh->node_count; i++)
            extent_m[k] = fmax(extent_m[k], (k == 2 ? 1 : 2) * fabs(def->mesh->x_m[i][k]));
    }
    extent_m[1] = fmax(extent_m[1], def->thickness_m);
}

double kn_model_mass(const kn_model *model)
{
    double mass = 0;
    for (int i = 0; i < model->node_count; i++) mass += model->node_mass_kg[i];
    return mass;
}
