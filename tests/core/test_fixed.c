// The circuit's golden model in integers. Its parts are compared with real numbers, and properties of exact sums are
// checked. tests/physics/test_fixed.c compares the model with the lattice.
#include "tests/check.h"
#include "tests/core/rig.h"

TEST("1/sqrt is within 1.5 * 2^-16 of the exact value for all arguments of 36 bits")
{
    int32_t seed[KN_FIXED_SEEDS];
    uint64_t random = 1;
    double worst = 0;
    kn_fixed_seeds(seed);
    for (int i = 0; i < 200000; i++) {
        uint64_t q = next(&random) >> (28 + i % 36);
        int n;
        if (q == 0) continue;
        double r = kn_fixed_rsqrt(seed, q, &n) * ldexp(1, n / 2 - 34);
        CHECK(n >= 0 && n <= 34 && n % 2 == 0);
        worst = fmax(worst, fabs(r * sqrt((double)q) - 1));
    }
    printf("     worst %.2f 2^-16\n", worst * 65536);
    CHECK(worst < 1.5 / 65536);
}

TEST("the inner forces sum to zero exactly")
{
    uint64_t seed = 7;
    OWN(rig) *r = make(60, 400, 3);
    for (int t = 0; t < 50; t++) {
        move_all(r, &seed, 1 << 14);
        tick(r, 60);
        int64_t sum[3] = {0}, size = 0;
        for (int n = 0; n < 60; n++)
            for (int k = 0; k < 3; k++) sum[k] += r->reaction[n][k], size += llabs(r->reaction[n][k]);
        CHECK(sum[0] == 0 && sum[1] == 0 && sum[2] == 0 && size > 1000);
    }
}

TEST("the order of the edges changes no bit")
{
    uint64_t seed = 11, other = 11, shuffle = 5;
    OWN(rig) *a = make(80, 600, 9), *b = make(80, 600, 9);
    int place[600];
    for (int e = 0; e < 600; e++) place[e] = e;
    for (int e = 599; e > 0; e--) {
        int with = within(&shuffle, 0, e), was = place[e];
        place[e] = place[with], place[with] = was;
    }
    for (int e = 0; e < 600; e++) b->image.edge[e] = a->image.edge[place[e]];
    for (int t = 0; t < 40; t++) {
        move_all(a, &seed, 3000), move_all(b, &other, 3000); // tick() holds the first 20 nodes, the others are free
        tick(a, 20), tick(b, 20);
        CHECK(memcmp(a->reaction, b->reaction, 20 * sizeof *a->reaction) == 0);
        CHECK(a->result.residual == b->result.residual && a->result.flags == b->result.flags);
    }
    CHECK(memcmp(a->fixed.x, b->fixed.x, 240 * sizeof *a->fixed.x) == 0);
    for (int e = 0; e < 600; e++) CHECK(b->fixed.h[e] == a->fixed.h[place[e]]);
}

// Make one edge along x between two nodes that a test moves.
static rig *bar(void)
{
    rig *r = make(2, 1, 1);
    r->image.node[0] = (kn_fixed_node){.held = 7};
    r->image.node[1] = (kn_fixed_node){.x = {1 << 26}, .held = 7};
    r->image.edge[0] = (kn_fixed_edge){.i = 0, .j = 1, .kv = 100000, .ia = 100000};
    r->image.config.octave = 20;
    kn_fixed_rest(&r->fixed);
    return r;
}

TEST("an edge obeys the three-element law: R from the table, and a spring that follows")
{
    OWN(rig) *r = bar();
    const kn_fixed_config *c = &r->image.config;
    double kv = ldexp(100000, -c->kv_shift), beta = ldexp(c->beta, -c->beta_shift - KN_FIXED_H_FRACTION), h = 0,
           most = 0;
    r->image.node[1].held = 0; // held only through the list of bounds
    for (int t = 0; t < 2000; t++) {
        int32_t u = t < 1000 ? 700 : -300;
        r->bound[0] = (kn_fixed_bound){.node = 1, .holds = true, .value = {u, 0, 0}};
        tick(r, 1);
        double b = kv * u + h, key = fabs(b) * 100000, octave = floor(log2(key));
        double at = 32 * (octave - c->octave) + 32 * (key / exp2(octave) - 1);
        double ratio = 1 - 240.0 / 131072 * fmin(fmax(at, 0), KN_FIXED_SEGMENTS), s = ratio * b;
        CHECK_NEAR(r->reaction[0][0], -s, 2 + 4e-5 * fabs(s)); // the force pulls back towards the other end
        h += beta * (s - h), most = fmax(most, h);
        CHECK_NEAR(ldexp((double)r->fixed.h[0], -KN_FIXED_H_FRACTION), h, 2 + 2e-4 * fabs(h));
    }
    CHECK(most > 1000);
}

TEST("a value that does not fit saturates and sets its own flag")
{
    OWN(rig) *r = bar();
    r->image.node[1].held = 0;
    const int32_t most = (1 << 24) - 1;
    struct {
        uint32_t flag;
        int32_t u;
        int64_t x;
        int d_shift, kv_shift;
    } way[] = {
        {KN_FIXED_SAT_TENSION, most, 1 << 26, 12, 4},
        {KN_FIXED_SAT_DIRECTION, 0, (int64_t)1 << 33, 12, 13},
        {KN_FIXED_SAT_POSITION, most, ((int64_t)1 << 35) - 2, 18, 13},
    };
    for (int i = 0; i < COUNT(way); i++) {
        r->image.config.d_shift = way[i].d_shift, r->image.config.kv_shift = way[i].kv_shift;
        r->image.node[1].x[0] = way[i].x;
        kn_fixed_rest(&r->fixed);
        r->bound[0] = (kn_fixed_bound){.node = 1, .holds = true, .value = {way[i].u, 0, 0}};
        tick(r, 1);
        if (!(r->result.flags & way[i].flag)) KN_TEST_FAIL("case %d: flags %x", i, r->result.flags);
        CHECK(llabs(r->fixed.x[3]) <= (int64_t)1 << 35);
    }
    // Pull both ends apart at full speed.
    r->image.config.d_shift = 18, r->image.config.kv_shift = 13;
    r->image.node[0].held = 0, r->image.node[1].x[0] = 1 << 26;
    kn_fixed_rest(&r->fixed);
    r->bound[0] = (kn_fixed_bound){.node = 0, .holds = true, .value = {-most, 0, 0}};
    r->bound[1] = (kn_fixed_bound){.node = 1, .holds = true, .value = {most, 0, 0}};
    tick(r, 2);
    CHECK(r->result.flags & KN_FIXED_SAT_U);
    kn_fixed_rest(&r->fixed);
    CHECK(r->fixed.flags == 0);
}

TEST("a node without edges and an edge of length 0 do no harm")
{
    OWN(rig) *r = make(4, 2, 1);
    r->image.edge[0] = (kn_fixed_edge){.i = 0, .j = 1, .kv = 1000, .ia = 1000};
    r->image.edge[1] = (kn_fixed_edge){.i = 1, .j = 2, .kv = 1000, .ia = 1000};
    memcpy(r->image.node[1].x, r->image.node[0].x, sizeof r->image.node[0].x);
    kn_fixed_rest(&r->fixed);
    r->bound[0] = (kn_fixed_bound){.node = 3, .value = {1000, 0, 0}};
    for (int t = 0; t < 10; t++) tick(r, 1);
    CHECK(r->fixed.x[9] == r->image.node[3].x[0] && r->result.residual == 1000);
}

TEST("an image that no circuit can run is refused with the reason")
{
    OWN(rig) *r = make(4, 3, 1);
    kn_fixed_image good = r->image;
#define REFUSED(change, why)                                                                                           \
    do {                                                                                                               \
        change;                                                                                                        \
        CHECK_STR(kn_fixed_check(&r->image), why);                                                                     \
        r->image = good;                                                                                               \
    } while (0)
    REFUSED(r->image.config.node_count = 0, "node_count outside 1..65535");
    REFUSED(r->image.config.passes = 16, "passes outside 1..15");
    REFUSED(r->image.config.iterations = 33, "iterations outside 1..32");
    REFUSED(r->image.config.kv_shift = 41, "kv_shift outside 0..40");
    REFUSED(r->image.config.omega[1] = 131073, "omega outside 0..2");
    REFUSED(r->image.table[512] = 131073, "the table's R outside 0..1");
    REFUSED(r->image.edge[2].j = r->image.edge[2].i, "an edge without two nodes");
}
