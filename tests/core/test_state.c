#include "core/hash.h"
#include "core/step.h"
#include "tests/check.h"

static kn_model *block(kn_material material, kn_precision precision)
{
    kn_model_def def = kn_model_def_default();
    def.material = material;
    def.solver.precision = precision;
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.015};
    return build(&def);
}

static kn_material stiff(kn_damper damper)
{
    return (kn_material){.k1_pa = 4e4, .c1_pa_s = 2e4, .damper = damper, .c2_pa_s = 4e5};
}

static void press(const kn_model *model, kn_state *state, int steps)
{
    for (int i = 0; i < steps; i++) {
        kn_input in = {0};
        kn_output out;
        in.probe[0] = (kn_probe_input){.attached = true,
                                       .position_m = {0, 0, 0.045 - 1e-5 * (double)(state->tick + 1)},
                                       .velocity_m_s = {0, 0, -0.01}};
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
    }
}

TEST("a new state is the undeformed object at rest at tick 0, and a reset restores the same bits")
{
    for (int t = 0; t < 4; t++) {
        OWN(kn_model) *model = block(stiff(t / 2 ? KN_DAMPER_CONSTANT : KN_DAMPER_NONE), (kn_precision)(t % 2));
        OWN(kn_state) *state = kn_state_create(model);
        CHECK(state->tick == 0 && !state->bad && !state->probe[0].attached);
        for (int i = 0; i < model->grid.nodes; i++) {
            double x[3], v[3], rest[3];
            kn_state_position(model, state, i, x);
            kn_state_velocity(model, state, i, v);
            kn_grid_rest(&model->grid, i, rest);
            for (int k = 0; k < 3; k++) CHECK(x[k] == rest[k] && v[k] == 0);
        }
        uint64_t rest = kn_state_hash(model, state);
        press(model, state, 100);
        CHECK(state->tick == 100 && kn_state_hash(model, state) != rest);
        kn_state_reset(model, state);
        CHECK(kn_state_hash(model, state) == rest);
    }
}

TEST("a viscoelastic object stores no strain per edge, an object with a damper does")
{
    OWN(kn_model) *none = block(stiff(KN_DAMPER_NONE), KN_PRECISION_F32),
                  *some = block(stiff(KN_DAMPER_CONSTANT), KN_PRECISION_F32);
    OWN(kn_state) *a = kn_state_create(none), *b = kn_state_create(some);
    CHECK(!a->strain && b->strain);
    CHECK(a->bytes < b->bytes && a->bytes <= none->state_bytes && b->bytes <= some->state_bytes);
}

TEST("a copied state is a snapshot: it has the same hash and the same future, independent of the original")
{
    OWN(kn_model) *model = block(stiff(KN_DAMPER_CONSTANT), KN_PRECISION_F32);
    OWN(kn_state) *state = kn_state_create(model), *copy = kn_state_create(model);
    press(model, copy, 30); // give the copy other contents to overwrite
    press(model, state, 150);
    kn_state_copy(model, copy, state);
    uint64_t at = kn_state_hash(model, state);
    CHECK(kn_state_hash(model, copy) == at);
    press(model, state, 100);
    CHECK(kn_state_hash(model, copy) == at);
    press(model, copy, 100);
    CHECK(kn_state_hash(model, copy) == kn_state_hash(model, state));
}

TEST("the hash changes with one bit of a node, an edge or a probe, but not with the tick")
{
    OWN(kn_model) *model = block(stiff(KN_DAMPER_CONSTANT), KN_PRECISION_F32);
    OWN(kn_state) *state = kn_state_create(model);
    press(model, state, 120);
    uint64_t before = kn_state_hash(model, state);
    unsigned char *bytes[] = {state->displacement, state->velocity, state->strain,
                              (unsigned char *)&state->probe[0].position_m[2]};
    for (int i = 0; i < 4; i++) {
        bytes[i][0] ^= 1;
        CHECK(kn_state_hash(model, state) != before);
        bytes[i][0] ^= 1;
    }
    state->tick += 1000;
    CHECK(kn_state_hash(model, state) == before);
}

TEST("the hash of bytes depends on every byte, the length and the seed")
{
    unsigned char data[100];
    for (int i = 0; i < 100; i++) data[i] = (unsigned char)(i * 37);
    for (size_t n = 0; n <= 100; n++) {
        uint64_t h = kn_hash_bytes(KN_HASH_SEED, data, n);
        CHECK(h == kn_hash_bytes(KN_HASH_SEED, data, n));
        CHECK(h != kn_hash_bytes(KN_HASH_SEED + 1, data, n));
        if (n < 100) CHECK(h != kn_hash_bytes(KN_HASH_SEED, data, n + 1));
        for (size_t i = 0; i < n; i++) {
            data[i] ^= 0x10;
            CHECK(h != kn_hash_bytes(KN_HASH_SEED, data, n));
            data[i] ^= 0x10;
        }
    }
    unsigned char zeros[64] = {0};
    CHECK(kn_hash_bytes(1, zeros, 32) != kn_hash_bytes(1, zeros, 64));
}

TESTS_MAIN
