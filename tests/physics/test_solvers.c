// Every linearisation, precision and instruction set gives the same result within a stated bound.
#include "tests/check.h"
#include "tests/physics/press.h"

// A short press: down 2 mm, held, lifted off.
static const press path = {.depth_m = 0.002, .hold_s = 0.05};
#define SECONDS 0.4

typedef struct setting {
    const char *name;
    kn_linearization how;
    kn_precision precision;
    double force, shape; // bounds, relative L2 against the converged reference at the same dt
} setting;

static void compare(int per_cm, double seconds, const setting *settings, int count)
{
    kn_model_def def = converged(press_def(per_cm));
    AT_END(run_free) run reference = press_run(&def, &path, seconds, 1e-3);
    CHECK(reference.status == KN_OK && peak_n(&reference) > 1);
    for (int i = 0; i < count; i++) {
        const setting *s = &settings[i];
        def = press_def(per_cm);
        def.solver.linearization = s->how;
        def.solver.precision = s->precision;
        AT_END(run_free) run r = press_run(&def, &path, seconds, 1e-3);
        printf("     %4d nodes, %-12s force %.3f %%, shape %.3f %%, variation %.2f x peak\n", r.nodes, s->name,
               100 * force_error(&r, &reference), 100 * shape_error(&r, &reference), variation(&r));
        CHECK_NEAR(force_error(&r, &reference), 0, s->force);
        CHECK_NEAR(shape_error(&r, &reference), 0, s->shape);
        CHECK(variation(&r) < 4);
    }
}

static const setting small[] = {
    {"blend f32", KN_LINEARIZATION_BLEND, KN_PRECISION_F32, 0.005, 0.01},
    {"blend f64", KN_LINEARIZATION_BLEND, KN_PRECISION_F64, 0.005, 0.01},
    {"secant f32", KN_LINEARIZATION_SECANT, KN_PRECISION_F32, 0.01, 0.01},
    {"secant f64", KN_LINEARIZATION_SECANT, KN_PRECISION_F64, 0.01, 0.01},
    {"tangent f32", KN_LINEARIZATION_TANGENT, KN_PRECISION_F32, 0.005, 0.01},
    {"tangent f64", KN_LINEARIZATION_TANGENT, KN_PRECISION_F64, 0.005, 0.01},
};

TEST("144 nodes: blend and tangent within 0.5 % of the converged force, secant within 1 %, all shapes within 1 %")
{
    compare(1, SECONDS, small, 6);
}

TEST("847 nodes: blend within 0.5 % of the converged force, secant and tangent within 1 %, all shapes within 1 %")
{
    static const setting large[] = {
        {"blend f32", KN_LINEARIZATION_BLEND, KN_PRECISION_F32, 0.005, 0.01},
        {"secant f32", KN_LINEARIZATION_SECANT, KN_PRECISION_F32, 0.01, 0.01},
        {"tangent f32", KN_LINEARIZATION_TANGENT, KN_PRECISION_F32, 0.01, 0.01},
    };
    compare(2, 0.28, large, 3); // down and held
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

// Compute the hash of a press. Return -1 if this processor lacks the instruction set.
static int hash_of(kn_model_def def, kn_isa isa, const press *p, uint64_t *hash, double *peak)
{
    char error[256];
    def.solver.isa = isa;
    OWN(kn_model) *model = kn_model_build(&def, error, sizeof error);
    if (!model) return -1;
    bool got = model->isa == isa;
    if (!got) return -1;
    AT_END(run_free) run r = press_run(&def, p, 0.3, 1e-3);
    *hash = r.hash;
    *peak = peak_n(&r);
    CHECK(r.status == KN_OK);
    return 0;
}

TEST(
    "every instruction set of this processor gives the same bits after 300 steps, under plate and ball, in f32 and f64")
{
    static const char *names[] = {"auto", "base", "avx2", "avx512"};
    press p = {.depth_m = 0.002, .hold_s = 0.02}; // down, held and on the way up at 0.3 s
    const struct {
        kn_model_def def;
        kn_material material;
        kn_precision precision;
    } cases[6] = {
        {press_def(1), dough, KN_PRECISION_F32},   {press_def(1), dough, KN_PRECISION_F64},
        {ball_def(1), dough, KN_PRECISION_F32},    {ball_def(1), dough, KN_PRECISION_F64},
        {press_def(1), jelly(), KN_PRECISION_F32}, {ball_def(1), clay(), KN_PRECISION_F32},
    };
    for (int t = 0; t < 6; t++) {
        kn_model_def def = cases[t].def;
        def.material = cases[t].material;
        def.solver.precision = cases[t].precision;
        uint64_t first = 0, hash;
        double peak = 0;
        int compared = 0;
        for (int isa = KN_ISA_BASE; isa <= KN_ISA_AVX512; isa++) {
            if (hash_of(def, (kn_isa)isa, &p, &hash, &peak)) {
                if (t == 0) printf("     this processor has no %s\n", names[isa]);
                continue;
            }
            if (!compared++) first = hash;
            if (hash != first)
                KN_TEST_FAIL("case %d: %s gives %016llx, base %016llx", t, names[isa], (unsigned long long)hash,
                             (unsigned long long)first);
        }
        CHECK(compared >= 1 && peak > 0.01);
    }
}

TEST("rows of several vectors and rows along every axis give the same bits on every instruction set")
{
    static const int blocks[4][3] = {{20, 4, 3}, {4, 20, 3}, {3, 4, 20}, {35, 3, 3}};
    press p = {.depth_m = 0.002, .hold_s = 0.02};
    for (int t = 0; t < 4; t++) {
        kn_model_def def = press_def(1);
        memcpy(def.nodes, blocks[t], sizeof def.nodes);
        uint64_t first = 0, hash;
        double peak = 0;
        for (int isa = KN_ISA_BASE; isa <= KN_ISA_AVX512; isa++) {
            if (hash_of(def, (kn_isa)isa, &p, &hash, &peak)) continue;
            if (!first) first = hash;
            CHECK(hash == first);
        }
        CHECK(peak > 0.01);
    }
}

TEST("a run is repeatable to the bit, and a copied state continues like the original")
{
    kn_model_def def = press_def(1);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model), *copy = kn_state_create(model);
    press p = {.depth_m = 0.002, .hold_s = 0.02};
    kn_output out;
    for (int i = 1; i <= 300; i++) {
        kn_input in = press_input(model, &p, i * 1e-3);
        if (i == 151) kn_state_copy(model, copy, state);
        kn_step(model, state, &in, &out);
        if (i > 150) kn_step(model, copy, &in, &out);
    }
    CHECK(kn_state_hash(model, state) == kn_state_hash(model, copy));
    kn_state_reset(model, state);
    for (int i = 1; i <= 300; i++) {
        kn_input in = press_input(model, &p, i * 1e-3);
        kn_step(model, state, &in, &out);
    }
    CHECK(kn_state_hash(model, state) == kn_state_hash(model, copy));
}

TESTS_MAIN
