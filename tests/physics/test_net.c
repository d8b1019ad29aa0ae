// Lattices of tetrahedra: their elasticity and creep compared with the element's. Their step compared with Runge-Kutta:
// test_oracle.c; their conservation laws: test_invariance.c.
#include "tests/lattice.h"
#include "tests/physics/bcc.h"

// Make the block of press.h from tetrahedra with 1/per_cm cm between corners.
static kn_model_def net_def(kn_simplices **mesh, int per_cm)
{
    kn_model_def def = press_def(per_cm);
    *mesh = bcc_block((const int[3]){5 * per_cm, 5 * per_cm, 3 * per_cm}, def.spacing_m);
    def.mesh = *mesh;
    return def;
}

// Return the mean height of the nodes whose rest height is height_m, weighted by their share of a load on the top.
static double layer_height(const lattice *l, double height_m)
{
    double sum = 0, share = 0, x[3];
    const kn_model *m = l->model;
    bool top = height_m > m->rest_m[m->top[0]][2] - 1e-6;
    for (int i = 0; i < (top ? m->top_count : m->node_count); i++) {
        int node = top ? m->top[i] : i;
        if (fabs(m->rest_m[node][2] - height_m) > 1e-6) continue;
        double part = top ? m->top_share[i] : 1;
        kn_state_position(m, l->state, node, x);
        sum += part * x[2], share += part;
    }
    return sum / share;
}

// Store the strains of a block with a free base and free sides under a constant load, after so many steps of 50 ms: of
// the whole height, and of the middle third as an extensometer reads it.
static void strain_under(kn_model_def def, double stress_pa, int count, double *whole, double *middle)
{
    def.support = KN_SUPPORT_FRICTIONLESS;
    def.probe_count = 0;
    def.solver.dt_s = 0.05;
    LATTICE l = lattice_of(converged(def));
    double extent[3];
    kn_model_def_extent(&def, extent);
    l.in.top_load_n = stress_pa * extent[0] * extent[1];
    steps(&l, count);
    double third = extent[2] / 3;
    *whole = 1 - layer_height(&l, extent[2]) / extent[2];
    *middle = 1 - (layer_height(&l, 2 * third) - layer_height(&l, third)) / third;
}

TEST("a block of tetrahedra under a small load has the strain of load over k1 and its own E along z, within 3 %")
{
    for (int per_cm = 1; per_cm <= 2; per_cm++) {
        OWN(kn_simplices) *mesh = NULL;
        kn_model_def def = net_def(&mesh, per_cm);
        def.material = jelly();
        OWN(kn_model) *model = build(&def);
        double strain, middle, own = model->moduli.young[2];
        strain_under(def, 20, 60, &strain, &middle);
        printf("     %d per cm: %.4f %%, element %.4f %%, E along z %.4f\n", per_cm, 100 * strain,
               100 * 20 / def.material.k1_pa, own);
        CHECK_NEAR(strain * own * def.material.k1_pa / 20, 1, 0.03);
        CHECK_NEAR(own, 1, 0.08);
    }
}

// The directions of the springs and E V/L^2 give C11 = 10/9, C12 = C44 = 4/9 of E.
TEST("a body-centred lattice has the elastic constants of its directions: E and a shear of 4/3 of an isotropic body "
     "within 4 %, nu = 2/7 within 0.01")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 2);
    OWN(kn_model) *model = build(&def);
    const kn_net_moduli *own = &model->moduli;
    printf("     E %.3f %.3f %.3f, nu %.3f, G/Giso %.3f, gamma %.3f\n", own->young[0], own->young[1], own->young[2],
           own->poisson, own->shear * 2 * (1 + own->poisson), model->gamma);
    for (int k = 0; k < 3; k++) CHECK_NEAR(own->young[k], 1, 0.04);
    CHECK_NEAR(own->poisson, 2.0 / 7, 0.01);
    CHECK_NEAR(own->shear * 2 * (1 + own->poisson), 4.0 / 3, 0.04);
}

NIGHT_TEST("the middle of a dough block of tetrahedra creeps within 10 % of the element in 60 s at 20 and 30 gf/cm^2")
{
    // Under a dead load the corners, held by few springs, sink deeper than the nodes below once their dampers thin.
    // With 1 cm between corners the whole height shrinks by a quarter more, and no gamma fits both.
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    kn_material *m = &def.material;
    // Twenty times the moduli: the load is then small against k1, so that the block's own area hardly changes.
    m->k1_pa *= 20, m->c1_pa_s *= 20, m->alpha_pa_s *= 20;
    for (double gf = 20; gf <= 30; gf += 10) {
        double whole, strain, stress_pa = gf * GF_CM2; // the element: a Voigt element and a damper
        double element =
            stress_pa / m->k1_pa * -expm1(-60 * m->k1_pa / m->c1_pa_s) + 60 * kn_material_flow(m, stress_pa);
        strain_under(def, stress_pa, 1200, &whole, &strain);
        printf("     %2.0f gf/cm^2: %.5f, element %.5f, %+.1f %%; whole height %+.1f %%\n", gf, strain, element,
               100 * (strain / element - 1), 100 * (whole / element - 1));
        CHECK_NEAR(strain / element, 1, 0.10);
    }
}
