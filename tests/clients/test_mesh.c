// knead_mesh.h: the chunks of one tick are applied together or not at all, and no message is trusted.
#include "clients/knead_mesh.h"
#include "tests/check.h"

static uint8_t datagram[1 << 16];
static kn_mesh m;

static uint32_t encode_init(int64_t id, int32_t corner)
{
    int32_t triangle[6] = {0, 1, 2, 0, 2, corner};
    knead_mesh_init_t msg = {
        .mesh_id = id, .vertex_count = 4, .triangle_count = 2, .index_count = 6, .triangles = triangle};
    return (uint32_t)knead_mesh_init_t_encode(datagram, 0, sizeof datagram, &msg);
}

enum { STRAIN = 1, STRESS = 2 };

// Encode positions and residual strain `value`, and stress 2 `value`. Measures that are not asked for are NULL.
static uint32_t encode_update(int64_t id, int64_t tick, int32_t first, int32_t count, float value, int measures)
{
    float xyz[12], two[4] = {2 * value, 2 * value, 2 * value, 2 * value};
    for (int i = 0; i < 12; i++) xyz[i] = value;
    knead_mesh_update_t msg = {.mesh_id = id,
                               .tick = tick,
                               .chunks = 2,
                               .first = first,
                               .count = count,
                               .position_count = 3 * count,
                               .positions_m = xyz,
                               .strain_count = measures & STRAIN ? count : 0,
                               .residual_strain = xyz,
                               .stress_count = measures & STRESS ? count : 0,
                               .stress_pa = two};
    return (uint32_t)knead_mesh_update_t_encode(datagram, 0, sizeof datagram, &msg);
}

static bool init(int64_t id, int32_t corner) { return kn_mesh_init(&m, datagram, encode_init(id, corner)); }

static bool update_measured(int64_t tick, int32_t first, int32_t count, int measures, float value)
{
    return kn_mesh_update(&m, datagram, encode_update(7, tick, first, count, value, measures));
}

static bool update(int64_t tick, int32_t first, int32_t count, float value)
{
    return update_measured(tick, first, count, 0, value);
}

static void begin(void) // a test with an empty mesh, number 7
{
    kn_mesh_free(&m);
    m = (kn_mesh){0};
    CHECK(init(7, 3) && !m.whole);
}

TEST(
    "a tick is applied when its last chunk arrives, in any order of the chunks, and an incomplete tick changes nothing")
{
    begin();
    CHECK(!update(10, 2, 2, 1));
    CHECK(update(10, 0, 2, 1));
    CHECK(m.whole && m.tick == 10 && m.positions_m[0] == 1 && m.positions_m[11] == 1);
    CHECK(!update(10, 0, 2, 2));
    CHECK(!update(11, 0, 2, 2));
    CHECK(!update(12, 2, 2, 3));
    CHECK(m.tick == 10 && m.positions_m[0] == 1 && m.positions_m[11] == 1);
    CHECK(update(12, 0, 2, 3));
    CHECK(m.tick == 12 && m.positions_m[0] == 3 && m.positions_m[11] == 3);
}

TEST("a repeated topology keeps the positions, and another topology starts a new mesh")
{
    begin();
    CHECK(update(10, 0, 4, 1) && !init(7, 3) && m.whole);
    CHECK(!kn_mesh_update(&m, datagram, encode_update(8, 11, 0, 4, 2, 0)));
    CHECK(init(8, 3) && !m.whole && m.mesh_id == 8);
}

TEST("measures are present only if every chunk of their tick carries them, and non-finite measures are refused")
{
    begin();
    CHECK(update(10, 0, 4, 1) && !m.residual_strain && !m.stress_pa);
    CHECK(!update_measured(11, 2, 2, STRAIN | STRESS, 3) && !m.residual_strain && !m.stress_pa);
    CHECK(update_measured(11, 0, 2, STRAIN | STRESS, 4) && m.residual_strain && m.stress_pa);
    for (int i = 0; i < 4 && m.residual_strain && m.stress_pa; i++)
        CHECK(m.residual_strain[i] == (i < 2 ? 4 : 3) && m.stress_pa[i] == (i < 2 ? 8 : 6));
    CHECK(!update_measured(12, 0, 2, STRAIN | STRESS, 5));
    CHECK(update_measured(12, 2, 2, STRESS, 5));
    CHECK(!m.residual_strain && m.stress_pa && m.stress_pa[0] == 10 && m.stress_pa[3] == 10);
    CHECK(update_measured(14, 0, 4, STRAIN, 6) && m.residual_strain && !m.stress_pa);
    for (int offset = 0; offset < 2; offset++) { // a NaN or an infinity as the last residual strain
        const uint32_t size = encode_update(7, 15, 0, 4, 6, STRAIN);
        memcpy(datagram + size - 4, offset ? "\x7f\xc0\0" : "\x7f\x80\0", 4);
        CHECK(!kn_mesh_update(&m, datagram, size) && m.tick == 14);
    }
}

TEST("chunks outside the mesh, corners outside the mesh and NaN positions are refused")
{
    kn_mesh_free(&m);
    m = (kn_mesh){0};
    CHECK(!init(7, 4) && !init(7, -1) && !update(10, 0, 4, 1)); // no topology yet
    begin();
    CHECK(!update(10, 1, 4, 1) && !update(10, -1, 4, 1) && !update(10, INT32_MAX, 4, 1) && !update(10, 0, 4, NAN));
    CHECK(!m.whole);
    CHECK(update(10, 0, 4, 1));
}

static void put(int offset, int32_t number)
{
    for (int b = 0; b < 4; b++) datagram[offset + b] = (uint8_t)((uint32_t)number >> (24 - 8 * b));
}

TEST("a datagram whose counts disagree with its size is refused before decoding")
{
    static const int32_t lies[] = {-1, INT32_MIN, INT32_MAX, 0x20000001, 0x40000000, 13, 11, 0};
    begin();
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        for (int field = 52; field <= 60; field += 4) { // offsets of position_count, strain_count, stress_count
            const uint32_t size = encode_update(7, 20, 0, 4, 1, 0);
            put(field, lies[i]);
            CHECK((field > 52 && lies[i] == 0) || !kn_mesh_update(&m, datagram, size)); // 0 measures are valid
        }
        const uint32_t size = encode_init(9, 3);
        put(40, lies[i]); // index_count
        CHECK(!kn_mesh_init(&m, datagram, size));
    }
    CHECK(m.mesh_id == 7);
}

TEST("a truncated datagram is refused, and a flipped bit never puts a triangle corner outside the mesh")
{
    begin();
    const uint32_t update_size = encode_update(7, 20, 0, 4, 1, 0), init_size = encode_init(7, 3);
    for (uint32_t at = 0; at < update_size; at++) {
        encode_update(7, 20, 0, 4, 1, 0);
        CHECK(!kn_mesh_update(&m, datagram, at));
        for (int bit = 0; bit < 8; bit++) {
            encode_update(7, 20, 0, 4, 1, 0);
            datagram[at] ^= (uint8_t)(1 << bit);
            kn_mesh_update(&m, datagram, update_size);
            encode_init(7, 3);
            if (at < init_size) datagram[at] ^= (uint8_t)(1 << bit);
            kn_mesh_init(&m, datagram, init_size);
        }
    }
    for (int32_t i = 0; i < 3 * m.triangle_count; i++) CHECK(m.triangles[i] >= 0 && m.triangles[i] < m.vertex_count);
    kn_mesh_free(&m);
}

TESTS_MAIN
