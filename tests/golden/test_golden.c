// Golden bits: the hash of state and force after fixed presses. The bits are equal for gcc and clang, -O1 and -O3,
// AVX-512, AVX2 and base (shown by test_compilers.sh and physics/test_solvers.c). So a change of any of these numbers
// is a change of the physics. To update after an intended change, run tests/one golden.golden and copy the printed
// numbers below. Say in the commit message why the bits moved, and by how much the force did. The law's table is
// fitted with libm's exp and log: the numbers are those of glibc 2.36 (Debian 12).
#include "core/hash.h"
#include "tests/check.h"
#include "tests/owned.h"
#include "tests/physics/bcc.h"
#include "tests/physics/press.h"

static const press paced = {.depth_m = 0.002, .hold_s = 0.05}; // 300 ticks: down, held, on the way up

static void check_golden(const char *name, uint64_t hash, uint64_t expected)
{
    printf("     golden %s %016llx\n", name, (unsigned long long)hash);
    if (hash != expected)
        KN_TEST_FAIL("%s gives %016llx, expected %016llx", name, (unsigned long long)hash,
                     (unsigned long long)expected);
}

static uint64_t hash_of(const run *r)
{
    return kn_hash_bytes(r->hash, r->force_n, (size_t)r->samples * sizeof *r->force_n);
}

TEST("presses on blocks of 144 to 2 560 nodes and on a mesh give the golden hashes: plate, ball, f64, integers, gas, "
     "flat, two resolutions")
{
    OWN(kn_simplices) *mesh = bcc_block((const int[3]){8, 8, 5}, 0.00625);
    kn_model_def f64 = press_def(1), integers, gas = press_def(2), shipped, flat, fine = press_def(2);
    kn_model_def large = ball_def(3), net = gas;
    f64.solver.precision = KN_PRECISION_F64;
    integers = f64;
    integers.solver.kind = KN_SOLVER_FIXED;
    integers.solver.iterations = 8;
    integers.solver.passes = 2;
    gas.pressure = KN_PRESSURE_CELLS;
    shipped = gas; // dough.yaml
    shipped.material = (kn_material)PAPER_MATERIAL(326, 2100, 6.45e4, 0.1212, 6.4, 55.8);
    shipped.diagonal_stiffness = 0.08;
    flat = gas;
    flat.nodes[1] = 1;
    flat.thickness_m = 0.05;
    flat.diagonal_stiffness = 0.1;
    flat.pressure = KN_PRESSURE_OBJECT;
    memcpy(fine.fine, (int[2][3]){{2, 0, 2}, {8, 10, 6}}, sizeof fine.fine);
    net.mesh = mesh;
    net.pressure = KN_PRESSURE_CELLS;
    const struct {
        const char *name;
        kn_model_def def;
        uint64_t hash;
    } table[] = {
        {"dough-small-plate", press_def(1), 0x2e7e723783abf25d},
        {"dough-small-ball", ball_def(1), 0xa0253ab8d7d859d0},
        {"dough-plate", press_def(2), 0x7b3eb20355501595},
        {"dough-ball", ball_def(2), 0x8c37b96e1599244e},
        {"dough-small-plate-f64", f64, 0x774fbacda3ca5e0c},
        {"dough-small-plate-fixed", integers, 0xde30178d424381bd},
        {"dough-pressure-plate", gas, 0xd55cab47f7817a6c},
        {"dough.yaml-plate", shipped, 0xbe13f3dca3e0a544},
        {"flat-pressure-plate", flat, 0xde20870edbf890f4},
        {"composite-plate", fine, 0xb4fe183100e0c8b0},
        {"large-ball", large, 0x31d0a30a530d1938},
        {"net-plate", net, 0x75b52707248ce1ef},
    };
    for (int i = 0; i < COUNT(table); i++) {
        AT_END(run_free) run r = press_run(&table[i].def, &paced, 0.3, 1e-3);
        CHECK(r.status == KN_OK && peak_n(&r) > 0.01);
        check_golden(table[i].name, hash_of(&r), table[i].hash);
    }
}

// Every tick counts on every instruction set: a difference in a last digit has ten seconds to show. All instruction
// sets run only on request (test_compilers.sh, -O3), because fused operations in software are slow.
TEST("ten seconds of a press on dough-small give the golden hash")
{
    const press p = {.depth_m = 0.01, .hold_s = 5};
    bool all = getenv("KN_ALL_ISAS") != NULL;
    const kn_isa first = all ? KN_LENGTH(KN_ISA_AVX2, KN_ISA_BASE, KN_ISA_BASE) : KN_ISA_AUTO;
    for (kn_isa isa = first; isa <= (all ? KN_ISA_AVX512 : KN_ISA_AUTO); isa++) {
        kn_model_def def = press_def(1);
        def.solver.isa = isa;
        if (!kn_isa_supported(isa)) continue;
        AT_END(run_free) run r = press_run(&def, &p, 10, 1e-3);
        CHECK(r.status == KN_OK && r.samples == 10000);
        check_golden("ten-seconds", hash_of(&r), 0xba6e31bc7568c78e);
    }
}

TEST("a coupled finger with friction, pressed askew into a block on a table, gives the golden hash")
{
    kn_model_def def = press_def(2);
    def.nodes[0] = def.nodes[1] = def.nodes[2] = 7;
    def.gravity_m_s2 = 9.81;
    def.support = KN_SUPPORT_FRICTION;
    def.support_friction = 0.5;
    def.probe[0] = (kn_probe_def){.name = "finger",
                                  .shape = KN_PROBE_CAPSULE,
                                  .radius_m = 0.008,
                                  .length_m = 0.03,
                                  .friction = 0.4,
                                  .coupling_n_m = 600,
                                  .coupling_n_s_m = 1.5};
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_scratch) *scratch = kn_scratch_create(model);
    uint64_t hash = KN_HASH_SEED;
    double least = 0;
    for (int i = 0; i < 300; i++) {
        kn_input in = {.probe[0] = {.attached = true,
                                    .position_m = {0, 1e-5 * i, 0.038 - 2e-5 * i},
                                    .velocity_m_s = {0, 0.01, -0.02},
                                    .orientation_wxyz = {0.96, 0.28, 0, 0}}};
        kn_output out;
        CHECK(kn_step(model, state, scratch, &in, &out) == KN_OK);
        hash = kn_hash_bytes(hash, &out.probe[0], sizeof out.probe[0].force_n + sizeof out.probe[0].torque_n_m);
        least = fmin(least, out.probe[0].force_n[1]);
    }
    CHECK(least < -0.01 && state->anchor_count > 10);
    check_golden("finger-askew", kn_hash_bytes(kn_state_hash(model, state), &hash, sizeof hash), 0xfabe60a708da61b0);
}

TEST("dough-small by Runge-Kutta, 300 steps of 10 us with the mass times 100, gives the golden hash")
{
    kn_model_def def = press_def(1);
    def.solver.kind = KN_SOLVER_RK4;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.dt_s = 1e-5;
    def.solver.mass_scale = 100;
    AT_END(run_free) run r = press_run(&def, &paced, 3e-3, 1e-5);
    const double *last = r.force_n[r.samples - 1];
    CHECK(r.samples == 300 && last[2] > 0);
    check_golden("dough-small-rk4", kn_hash_bytes(r.hash, last, 3 * sizeof *last), 0x9935c08eee9a133b);
}
