// Every linearisation, precision and instruction set gives the same result within a stated bound.
#include "tests/lattice.h"
#include "tests/physics/bcc.h"

// A short press: down 2 mm, held, lifted off.
static const press path = {.depth_m = 0.002, .hold_s = 0.05};
#define SECONDS 0.4

// Compare every linearisation, in f32 or in both precisions, with the converged reference at the same dt. bound: of the
// force, relative L2.
static void compare(int per_cm, double seconds, int precisions, const double bound[3])
{
    static const char *const names[] = {"blend", "secant", "tangent"};
    kn_model_def def = converged(press_def(per_cm));
    AT_END(run_free) run reference = press_run(&def, &path, seconds, 1e-3);
    CHECK(reference.status == KN_OK && peak_n(&reference) > 1);
    for (int i = 0; i < 3 * precisions; i++) {
        def = press_def(per_cm);
        def.solver.linearization = (kn_linearization)(i % 3);
        def.solver.precision = (kn_precision)(i / 3);
        AT_END(run_free) run r = press_run(&def, &path, seconds, 1e-3);
        printf("     %4d nodes, %s f%d force %.3f %%, shape %.3f %%, variation %.2f x peak\n", r.nodes, names[i % 3],
               i < 3 ? 32 : 64, 100 * force_error(&r, &reference), 100 * shape_error(&r, &reference), variation(&r));
        CHECK_NEAR(force_error(&r, &reference), 0, bound[i % 3]);
        CHECK_NEAR(shape_error(&r, &reference), 0, 0.01);
        CHECK(variation(&r) < 4);
    }
}

TEST("144 nodes: blend and tangent within 0.5 % of the converged force, secant within 1 %, all shapes within 1 %")
{
    compare(1, SECONDS, 2, (const double[]){0.005, 0.01, 0.005});
}

TEST("847 nodes: blend within 0.5 % of the converged force, secant and tangent within 1 %, all shapes within 1 %")
{
    compare(2, 0.28, 1, (const double[]){0.005, 0.01, 0.01}); // down and held
}

TEST("two independent references agree: blend and secant, both iterated to convergence")
{
    kn_model_def def = converged(press_def(1));
    AT_END(run_free) run secant = press_run(&def, &path, SECONDS, 1e-3);
    def.solver.linearization = KN_LINEARIZATION_BLEND;
    def.solver.passes = 8;
    AT_END(run_free) run blend = press_run(&def, &path, SECONDS, 1e-3);
    CHECK_NEAR(force_error(&blend, &secant), 0, 1e-3);
    CHECK_NEAR(shape_error(&blend, &secant), 0, 1e-3);
}

// A team of one thread that does part 1 before part 0. A part that needs what the other part writes gives other bits.
static long loops_in_parts;
static void backwards(kn_team *team, kn_team_work *work, void *job)
{
    (void)team;
    loops_in_parts++;
    for (int part = KN_TEAM_PARTS - 1; part >= 0; part--) work(job, part);
}

static void same_bits(const char *what, kn_model_def def, double seconds)
{
    press p = {.depth_m = 0.002, .hold_s = 0.02}; // down, held and on the way up at 0.3 s
    kn_team team = {backwards, 0};
    uint64_t base = 0;
    for (int isa = KN_ISA_BASE; isa <= KN_ISA_AVX512; isa++) {
        def.solver.isa = (kn_isa)isa;
        if (!kn_isa_supported(def.solver.isa)) continue;
        OWN(kn_model) *model = build(&def);
        AT_END(run_free) run r = press_run(&def, &p, seconds, 1e-3);
        if (isa == KN_ISA_BASE) base = r.hash;
        CHECK(model->isa == def.solver.isa && r.status == KN_OK && peak_n(&r) > 0.01);
        p.team = &team; // from the second instruction set on
        if (r.hash != base)
            KN_TEST_FAIL("%s, f%d: instruction set %d in %s gives %016llx, base in one part %016llx", what,
                         def.solver.precision ? 64 : 32, isa, p.team ? "two parts" : "one part",
                         (unsigned long long)r.hash, (unsigned long long)base);
    }
}

// Compare a model with a coarse level for 60 ms.
static void same_bits_coarse(const char *what, kn_model_def def)
{
    OWN(kn_model) *model = build(&def);
    CHECK(model->coarse);
    same_bits(what, def, 0.06);
}

TEST("every instruction set of this processor gives the same bits, in one part or two: dough, jelly and clay, two "
     "resolutions, meshes, f32 and f64, with and without gas")
{
    OWN(kn_simplices) *mesh = bcc_block((const int[3]){5, 5, 3}, 0.01);
    OWN(kn_simplices) *cells = bcc_block((const int[3]){8, 7, 5}, 0.006);
    for (int precision = 0; precision < 2; precision++) {
        kn_model_def plate = press_def(1), ball = ball_def(1), net = press_def(1), fine = press_def(2);
        plate.solver.precision = ball.solver.precision = net.solver.precision = fine.solver.precision =
            (kn_precision)precision;
        same_bits("plate", plate, 0.3);
        same_bits("ball", ball, 0.3);
        plate.material = jelly(), ball.material = clay();
        same_bits("plate on jelly", plate, 0.3);
        same_bits("ball on clay", ball, 0.3);
        plate.material.damper = KN_DAMPER_CONSTANT, plate.material.c2_pa_s = 1e6;
        plate.material.stroke[1] = 0.6, plate.material.stroke[0] = 0.4, plate.material.ratio = 0.5;
        same_bits("stops", plate, 0.1);
        fine.nodes[0] = fine.nodes[1] = 9, fine.nodes[2] = 13;
        memcpy(fine.fine, (int[2][3]){{2, 2, 6}, {6, 6, 12}}, sizeof fine.fine);
        same_bits("two resolutions", fine, 0.3);
        // with a coarse level: two vectors per row, cells of two sizes, a mesh, and a coupled ball on a table
        kn_model_def large = plate, parts = fine, table = ball_def(1);
        large.nodes[0] = 20, large.nodes[1] = 6, large.nodes[2] = 5;
        parts.nodes[0] = parts.nodes[1] = 15;
        net.mesh = cells;
        table.solver.precision = (kn_precision)precision;
        table.support = KN_SUPPORT_FRICTION;
        table.support_friction = table.probe[0].friction = 0.4;
        table.probe[0].coupling_n_m = 600, table.probe[0].coupling_n_s_m = 1.5;
        same_bits_coarse("two vectors", large);
        same_bits_coarse("two resolutions", parts);
        same_bits_coarse("mesh", net);
        same_bits_coarse("coupled ball on a table", table);
        net.mesh = mesh;
        for (int pressure = 0; pressure < 3; pressure++)
            net.pressure = (kn_pressure)pressure, same_bits("mesh", net, 0.3);
    }
    CHECK(loops_in_parts > 10000 || !kn_isa_supported(KN_ISA_AVX2));
}

TEST(
    "rows of one to three vectors along every axis give the same bits on every instruction set, with gas and flat, too")
{
    static const int blocks[][3] = {{20, 4, 3}, {4, 20, 3}, {3, 4, 20}, {35, 3, 3}, {3, 3, 40},
                                    {6, 5, 4},  {6, 1, 5},  {3, 1, 20}, {20, 1, 3}};
    for (int i = 0; i < COUNT(blocks) * 3 * 2; i++) {
        kn_model_def def = press_def(1);
        memcpy(def.nodes, blocks[i / 6], sizeof def.nodes);
        if (def.nodes[1] == 1) def.thickness_m = 0.02;
        def.pressure = (kn_pressure)(i % 3);
        def.diagonal_stiffness = def.pressure ? 0.1 : 1;
        def.solver.precision = (kn_precision)(i / 3 % 2);
        same_bits("block", def, 0.1);
    }
}
