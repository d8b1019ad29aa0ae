// One law, three materials (second paper): recovery after a press, and the remaining dent.
#include "tests/lattice.h"

TEST("of a dent of 1 cm jelly keeps less than 0.1 %, clay more than 99.9 % and dough 50 to 98 %, in f32 as in f64")
{
    const struct {
        kn_material material;
        double least, most; // shares of the dent
    } table[] = {{jelly(), -1e-3, 1e-3}, {dough, 0.5, 0.98}, {clay(), 1 - 1e-3, 1 + 1e-3}};
    const press p = {.depth_m = 0.01, .hold_s = 1};
    for (int m = 0; m < COUNT(table); m++) {
        double left_m[2];
        for (int precision = 0; precision < 2; precision++) {
            kn_model_def def = press_def(1);
            def.material = table[m].material;
            def.solver.precision = (kn_precision)precision;
            LATTICE l = lattice_of(def);
            double pressed[3], left[3];
            int node = kn_grid_node(&l.model->grid, 2, 3, 3); // on top, under the plate
            press_until(&l, &p, (int)(press_up_s(&p) * 1000));
            displacement(l.model, l.state, node, pressed);
            press_until(&l, &p, 11000); // 8 s of rest
            displacement(l.model, l.state, node, left);
            CHECK(l.out.probe[0].contacts == 0);
            CHECK_NEAR(pressed[2], -0.01, 1e-4);
            double share = left[2] / pressed[2];
            printf("     material %d, f%d: keeps %.4f of the dent\n", m, precision ? 64 : 32, share);
            CHECK(share >= table[m].least && share <= table[m].most);
            left_m[precision] = left[2];
        }
        CHECK_NEAR(left_m[0], left_m[1], 1e-5);
    }
}
