// knead_mesh.h: the chunks of one tick are applied together or not at all, and no message is trusted.
#include "clients/knead_mesh.h"
#include "tests/check.h"

static uint8_t datagram[1 << 16];

static uint32_t encode_init(int64_t id, int32_t vertices, int32_t corner)
{
    int32_t triangle[6] = {0, 1, 2, 0, 2, corner};
    knead_mesh_init_t msg = {
        .mesh_id = id, .vertex_count = vertices, .triangle_count = 2, .index_count = 6, .triangles = triangle};
    return (uint32_t)knead_mesh_init_t_encode(datagram, 0, sizeof datagram, &msg);
}

static uint32_t encode_update(int64_t id, int64_t tick, int32_t first, int32_t count, float value)
{
    float xyz[12];
    for (int i = 0; i < 12; i++) xyz[i] = value;
    knead_mesh_update_t msg = {.mesh_id = id,
                               .tick = tick,
                               .chunks = 2,
                               .first = first,
                               .count = count,
                               .position_count = 3 * count,
                               .positions_m = xyz};
    return (uint32_t)knead_mesh_update_t_encode(datagram, 0, sizeof datagram, &msg);
}

// Send residual strain `value` and stress 2 `value`. The arrays are NULL where a count is 0.
static bool update_measured(kn_mesh *m, int64_t tick, int32_t first, int32_t count, bool strain, bool stress,
                            float value)
{
    float xyz[12] = {0}, one[4], two[4];
    for (int i = 0; i < 4; i++) one[i] = value, two[i] = 2 * value;
    knead_mesh_update_t msg = {.mesh_id = 7,
                               .tick = tick,
                               .chunks = 2,
                               .first = first,
                               .count = count,
                               .position_count = 3 * count,
                               .positions_m = xyz,
                               .strain_count = strain ? count : 0,
                               .residual_strain = one,
                               .stress_count = stress ? count : 0,
                               .stress_pa = two};
    return kn_mesh_update(m, datagram, (uint32_t)knead_mesh_update_t_encode(datagram, 0, sizeof datagram, &msg));
}

static bool update(kn_mesh *m, int64_t id, int64_t tick, int32_t first, int32_t count, float value)
{
    return kn_mesh_update(m, datagram, encode_update(id, tick, first, count, value));
}

TEST("a tick is applied when its last chunk arrives, in any order of the chunks")
{
    AT_END(kn_mesh_free) kn_mesh m = {0};
    CHECK(kn_mesh_init(&m, datagram, encode_init(7, 4, 3)));
    CHECK(!m.whole);
    CHECK(!update(&m, 7, 10, 2, 2, 1));
    CHECK(update(&m, 7, 10, 0, 2, 1));
    CHECK(m.whole && m.tick == 10 && m.positions_m[0] == 1 && m.positions_m[11] == 1);
    CHECK(!update(&m, 7, 10, 0, 2, 2));
    CHECK(m.positions_m[0] == 1);
}

TEST("chunks of an incomplete tick change nothing")
{
    AT_END(kn_mesh_free) kn_mesh m = {0};
    kn_mesh_init(&m, datagram, encode_init(7, 4, 3));
    CHECK(update(&m, 7, 10, 0, 4, 1));
    CHECK(!update(&m, 7, 11, 0, 2, 2));
    CHECK(!update(&m, 7, 12, 2, 2, 3));
    CHECK(m.tick == 10 && m.positions_m[0] == 1 && m.positions_m[11] == 1);
    CHECK(update(&m, 7, 12, 0, 2, 3));
    CHECK(m.tick == 12 && m.positions_m[0] == 3 && m.positions_m[11] == 3);
}

TEST("a repeated topology keeps the positions, and another topology starts a new mesh")
{
    AT_END(kn_mesh_free) kn_mesh m = {0};
    kn_mesh_init(&m, datagram, encode_init(7, 4, 3));
    update(&m, 7, 10, 0, 4, 1);
    CHECK(!kn_mesh_init(&m, datagram, encode_init(7, 4, 3)));
    CHECK(m.whole);
    CHECK(!update(&m, 8, 11, 0, 4, 2));
    CHECK(kn_mesh_init(&m, datagram, encode_init(8, 4, 3)));
    CHECK(!m.whole && m.mesh_id == 8);
}

TEST("measures are present only if every chunk of their tick carries them, and non-finite measures are refused")
{
    AT_END(kn_mesh_free) kn_mesh m = {0};
    kn_mesh_init(&m, datagram, encode_init(7, 4, 3));
    CHECK(update(&m, 7, 10, 0, 4, 1) && !m.residual_strain && !m.stress_pa);
    CHECK(!update_measured(&m, 11, 2, 2, true, true, 3));
    CHECK(!m.residual_strain && !m.stress_pa);
    CHECK(update_measured(&m, 11, 0, 2, true, true, 4));
    if (m.residual_strain && m.stress_pa) {
        CHECK(m.residual_strain[0] == 4 && m.residual_strain[1] == 4 && m.residual_strain[3] == 3);
        CHECK(m.stress_pa[0] == 8 && m.stress_pa[1] == 8 && m.stress_pa[2] == 6 && m.stress_pa[3] == 6);
        CHECK(m.positions_m[0] == 0 && m.positions_m[11] == 0);
    } else KN_TEST_FAIL("%s", "one is missing");
    CHECK(!update_measured(&m, 12, 0, 2, true, true, 5));
    CHECK(update_measured(&m, 12, 2, 2, false, true, 5));
    CHECK(!m.residual_strain && m.stress_pa && m.stress_pa[0] == 10 && m.stress_pa[3] == 10);
    CHECK(!update_measured(&m, 13, 0, 4, true, true, NAN) && m.tick == 12);
    CHECK(!update_measured(&m, 13, 0, 4, true, true, INFINITY) && m.tick == 12);
    CHECK(update_measured(&m, 14, 0, 4, true, false, 6) && m.residual_strain && !m.stress_pa);
}

TEST("chunks outside the mesh, corners outside the mesh and NaN positions are refused")
{
    AT_END(kn_mesh_free) kn_mesh m = {0};
    CHECK(!kn_mesh_init(&m, datagram, encode_init(7, 4, 4)));
    CHECK(!kn_mesh_init(&m, datagram, encode_init(7, 4, -1)));
    CHECK(!update(&m, 7, 10, 0, 4, 1)); // no topology yet
    CHECK(kn_mesh_init(&m, datagram, encode_init(7, 4, 3)));
    CHECK(!update(&m, 7, 10, 1, 4, 1));
    CHECK(!update(&m, 7, 10, -1, 4, 1));
    CHECK(!update(&m, 7, 10, INT32_MAX, 4, 1));
    CHECK(!update(&m, 7, 10, 0, 4, NAN));
    CHECK(!m.whole);
    CHECK(update(&m, 7, 10, 0, 4, 1));
}

TEST("a datagram whose counts disagree with its size is refused before decoding")
{
    static const int32_t lies[] = {-1, INT32_MIN, INT32_MAX, 0x20000001, 0x40000000, 13, 11, 0};
    AT_END(kn_mesh_free) kn_mesh m = {0};
    kn_mesh_init(&m, datagram, encode_init(7, 4, 3));
    for (int field = 52; field <= 60; field += 4) // offsets of position_count, strain_count, stress_count
        for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
            uint32_t size = encode_update(7, 20, 0, 4, 1);
            if (field > 52 && lies[i] == 0) continue; // a valid count
            for (int b = 0; b < 4; b++) datagram[field + b] = (uint8_t)((uint32_t)lies[i] >> (24 - 8 * b));
            CHECK(!kn_mesh_update(&m, datagram, size));
        }
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        uint32_t size = encode_init(9, 4, 3);
        for (int b = 0; b < 4; b++) datagram[40 + b] = (uint8_t)((uint32_t)lies[i] >> (24 - 8 * b)); // index_count
        CHECK(!kn_mesh_init(&m, datagram, size));
    }
    CHECK(m.mesh_id == 7);
}

TEST("a truncated datagram is refused, and a flipped bit never puts a triangle corner outside the mesh")
{
    AT_END(kn_mesh_free) kn_mesh m = {0};
    kn_mesh_init(&m, datagram, encode_init(7, 4, 3));
    uint32_t size = encode_update(7, 20, 0, 4, 1);
    for (uint32_t cut = 0; cut < size; cut++) CHECK(!kn_mesh_update(&m, datagram, cut));
    for (uint32_t at = 0; at < size; at++)
        for (int bit = 0; bit < 8; bit++) {
            size = encode_update(7, 20, 0, 4, 1);
            datagram[at] ^= (uint8_t)(1 << bit);
            kn_mesh_update(&m, datagram, size);
            size = encode_init(7, 4, 3);
            if (at < size) datagram[at] ^= (uint8_t)(1 << bit);
            kn_mesh_init(&m, datagram, size);
        }
    for (int32_t i = 0; i < 3 * m.triangle_count; i++) CHECK(m.triangles[i] >= 0 && m.triangles[i] < m.vertex_count);
}

TESTS_MAIN
