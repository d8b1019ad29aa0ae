#include "core/hash.h"
#include "tests/lattice.h"

static lattice under_ball(kn_damper damper, kn_precision precision)
{
    kn_model_def def = ball_def(1);
    def.material = (kn_material){.k1_pa = 4e4, .c1_pa_s = 2e4, .damper = damper, .c2_pa_s = 4e5};
    def.solver.precision = precision;
    def.probe[0].radius_m = 0.015;
    def.probe[0].friction = 0.5;
    return lattice_of(def);
}

static void press_for(lattice *l, int ticks)
{
    put(l, 0, 0, 0, 0.045);
    move(l, 0, 0, 0, -0.01, ticks);
}

TEST(
    "a new state is the undeformed object at rest at tick 0, and a reset restores the same bits; only an object with a "
    "damper stores strains")
{
    size_t bytes[4];
    for (int t = 0; t < 4; t++) {
        LATTICE l = under_ball(t / 2 ? KN_DAMPER_CONSTANT : KN_DAMPER_NONE, (kn_precision)(t % 2));
        CHECK(l.state->tick == 0 && !l.state->bad && !l.state->probe[0].attached);
        CHECK(!l.state->strain == (t < 2));
        bytes[t] = kn_state_size(l.model);
        CHECK(t < 2 || bytes[t] > bytes[t - 2]);
        for (int i = 0; i < l.model->grid.nodes; i++) {
            double x[3], v[3], rest[3];
            kn_state_position(l.model, l.state, i, x);
            kn_state_velocity(l.model, l.state, i, v);
            kn_grid_rest(&l.model->grid, i, rest);
            for (int k = 0; k < 3; k++) CHECK(x[k] == rest[k] && v[k] == 0);
        }
        uint64_t rest = hash_of(&l);
        press_for(&l, 100);
        CHECK(l.state->tick == 100 && hash_of(&l) != rest);
        kn_state_reset(l.model, l.state);
        CHECK(hash_of(&l) == rest);
    }
}

TEST("the hash changes with the lowest bit of a node, an edge, a probe or an anchor, but not with the tick")
{
    LATTICE l = under_ball(KN_DAMPER_CONSTANT, KN_PRECISION_F32);
    press_for(&l, 120);
    CHECK(l.state->anchor_count > 3);
    uint64_t before = hash_of(&l);
    unsigned char *bytes[] = {l.state->displacement, l.state->velocity, l.state->strain,
                              (unsigned char *)&l.state->probe[0].position_m[2],
                              (unsigned char *)&l.state->anchor[3].stretch_m[1]};
    for (int i = 0; i < COUNT(bytes); i++) {
        bytes[i][0] ^= 1;
        CHECK(hash_of(&l) != before);
        bytes[i][0] ^= 1;
    }
    l.state->tick += 1000;
    CHECK(hash_of(&l) == before);
}

TEST("the hash of bytes depends on every byte, the length and the seed")
{
    unsigned char data[101] = {0}, zeros[64] = {0};
    for (int i = 0; i < 100; i++) data[i] = (unsigned char)(i * 37);
    for (size_t n = 0; n <= 100; n++) {
        uint64_t h = kn_hash_bytes(KN_HASH_SEED, data, n);
        CHECK(h == kn_hash_bytes(KN_HASH_SEED, data, n) && h != kn_hash_bytes(KN_HASH_SEED + 1, data, n));
        CHECK(h != kn_hash_bytes(KN_HASH_SEED, data, n + 1));
        for (size_t i = 0; i < n; i++) {
            data[i] ^= 0x10;
            CHECK(h != kn_hash_bytes(KN_HASH_SEED, data, n));
            data[i] ^= 0x10;
        }
    }
    CHECK(kn_hash_bytes(1, zeros, 32) != kn_hash_bytes(1, zeros, 64));
}
