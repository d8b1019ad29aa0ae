// A block under its own weight for five minutes. The force-dependent damper keeps the block in shape. A linear damper
// of the viscosity that a press meets does not, and without diagonals no damper does.
#include "tests/lattice.h"

#define SETS_MAX 4
typedef const char *sets[SETS_MAX]; // unused ones are NULL

static lattice weighed(const sets given)
{
    const char *all[SETS_MAX + 1] = {"gravity=9.81 m/s^2"};
    int count = 1;
    while (count <= SETS_MAX && given[count - 1]) all[count] = given[count - 1], count++;
    return lattice_of_scene(load_scene("dough-small.yaml", all, count));
}

static double height_m(const lattice *l) { return l->model->def.spacing_m * (l->model->def.nodes[2] - 1); }

// Lean the block by a share of its height, and store the mean displacement of the top after some time, m. To first
// order, the lean changes the length of no edge along an axis.
static void top_after(lattice *l, double seconds, double leaning, double mean_m[3])
{
    for (int i = 0; i < l->model->node_count; i++)
        kn_real_set(l->model, l->state->displacement, l->model->offset[i], leaning * l->model->rest_m[i][2]);
    for (int i = 0; i < (int)(seconds / l->model->def.solver.dt_s); i++)
        if (kn_step(l->model, l->state, l->scratch, &l->in, &l->out) != KN_OK) break;
    memset(mean_m, 0, 3 * sizeof *mean_m);
    for (int t = 0; t < l->model->top_count; t++) {
        double u[3];
        displacement(l->model, l->state, l->model->top[t], u);
        for (int k = 0; k < 3; k++) mean_m[k] += u[k] / l->model->top_count;
    }
}

// Return the fall of the top as a share of the height.
static double sag_after(const sets given, double seconds, double leaning)
{
    LATTICE l = weighed(given);
    double mean_m[3], sag;
    top_after(&l, seconds, leaning, mean_m);
    sag = -mean_m[2] / height_m(&l);
    printf("     %s: sags by %.2f %% in %.0f s\n", given[0] ? given[0] : "dough", 100 * sag, seconds);
    return sag;
}

NIGHT_TEST("dough sags by less than 1.6 % in five minutes, as its stiffness at rest predicts")
{
    LATTICE l = weighed((sets){NULL});
    const kn_model_def *def = &l.model->def;
    double weight_pa = def->density_kg_m3 * def->gravity_m_s2 * height_m(&l), sag = sag_after((sets){NULL}, 300, 0);
    CHECK(sag < 0.016);
    // as knead check predicts
    CHECK_NEAR(sag / (0.85 * 0.5 * weight_pa * kn_material_compliance(&def->material, 300)), 1, 0.05);
}

NIGHT_TEST(
    "a block slumps with a linear damper of the viscosity in a press, and stands with the force-dependent damper")
{
    static const struct {
        sets sets;
        double least, most;
    } table[] = {
        {{"material.damper=constant", "material.c2=1387 gf s/cm^3"}, 0.5, INFINITY},
        {{"material={k1: 0 Pa, c1: 2774 gf s/cm^3, damper: constant, c2: 2774 gf s/cm^3}",
          "material.specimen_height=1 cm"},
         0.47,
         0.57},
        {{"material=dough-plastic"}, 0.011, 0.013},
        {{"object.pressure=cells", "object.diagonal_stiffness=0.02", "solver.dt=2 ms"}, 0.009, 0.011},
    };
    for (int i = 0; i < COUNT(table); i++) {
        double sag = sag_after(table[i].sets, 300, 0);
        CHECK(sag >= table[i].least && sag <= table[i].most);
    }
}

TEST("a block leaning by 2 % stands with diagonals and collapses within a second without them")
{
    CHECK(sag_after((sets){NULL}, 1, 0.02) < 0.01);
    CHECK(sag_after((sets){"object.structure=axis"}, 1, 0.02) > 0.5);
}

TEST("gas in the cells does not stop a lattice without diagonals from leaning over; diagonals of 1 % stiffness do")
{
    double drift_m[2], mean_m[3];
    for (int braced = 0; braced < 2; braced++) {
        LATTICE l = weighed(
            (sets){"object.pressure=cells", braced ? "object.diagonal_stiffness=0.01" : "object.structure=axis"});
        top_after(&l, 20, 0.02, mean_m);
        drift_m[braced] = mean_m[0] - 0.02 * height_m(&l);
    }
    printf("     after 20 s the top has gone %.2f mm sideways without diagonals, %.3f mm with them\n", 1e3 * drift_m[0],
           1e3 * drift_m[1]);
    CHECK(drift_m[0] > 2e-3 && fabs(drift_m[1]) < 0.1 * drift_m[0]);
}
