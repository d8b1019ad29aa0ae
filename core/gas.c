#include "core/gas.h"

// Compute the corners of cell c at rest + x.
void kn_gas_corners(const kn_model *model, int c, const double *rest, const double *x, double corner[8][3])
{
    for (int i = 0; i < 8; i++) {
        int node = model->cells[c].corner[i];
        for (int k = 0; k < 3; k++) corner[i][k] = node < 0 ? 0 : rest[3 * node + k] + x[3 * node + k];
    }
}

double kn_gas_volume(const kn_model *model, const double corner[8][3], double gradient[8][3])
{
    return model->def.mesh ? kn_simplex_volume(model->def.thickness_m, corner, gradient)
                           : kn_cell_volume(&model->grid, corner, gradient);
}

// Add force_pa dV/dx to f at a cell's corners.
static void push_corners(const kn_cell *cell, double force_pa, const double gradient[8][3], double *f)
{
    for (int i = 0; i < 8 && cell->corner[i] >= 0; i++)
        for (int k = 0; k < 3; k++) f[3 * cell->corner[i] + k] += force_pa * gradient[i][k];
}

void kn_gas_push(const kn_model *model, const double *rest, const double *x, double *f)
{
    double corner[8][3], gradient[8][3], slope, sum = 0, sum0 = 0;
    bool whole = model->def.pressure == KN_PRESSURE_OBJECT;
    // pass 0 sums the volume of the whole object, pass 1 pushes
    for (int pass = whole ? 0 : 1; pass < 2; pass++)
        for (int c = 0; c < model->cell_count; c++) {
            kn_gas_corners(model, c, rest, x, corner);
            double volume = kn_gas_volume(model, (const double(*)[3])corner, gradient);
            if (pass == 0) {
                sum0 += model->cell_volume[c];
                sum += volume;
                continue;
            }
            double over = kn_cell_pressure(whole ? sum / sum0 : volume / model->cell_volume[c], &slope);
            push_corners(&model->cells[c], over * model->def.inside_pressure_pa, (const double(*)[3])gradient, f);
        }
}
