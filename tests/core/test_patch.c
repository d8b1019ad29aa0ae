#include "core/local/patch.h"
#include "tests/check.h"

// The top of a block, 11 by 11 nodes. The tests draw patches on it.

typedef struct rig {
    kn_model *model;
    kn_patches *patches;
    double share[KN_PATCHES_MAX][KN_PATCHES_MAX];
} rig;

static rig rig_make(void)
{
    kn_model_def def = kn_model_def_default();
    def.nodes[0] = def.nodes[1] = 11;
    def.nodes[2] = 3;
    def.probe_count = 2;
    for (int p = 0; p < 2; p++)
        def.probe[p] = (kn_probe_def){.name = {(char)('a' + p)}, .shape = KN_PROBE_SPHERE, .radius_m = 0.01};
    rig r = {.model = build(&def)};
    r.patches = kn_patches_create(r.model);
    CHECK(r.patches != NULL);
    return r;
}

static void rig_free(rig *r)
{
    kn_patches_destroy(r->patches);
    kn_model_destroy(r->model);
}

static int at(const rig *r, int x, int y) { return r->model->top[y * 11 + x]; }
static int patch(const rig *r, int p, int x, int y) { return kn_patches_at(r->patches, p, at(r, x, y)); }

// Press the nodes given by rows of characters: '#' with 1 N, '2' with 2 N.
static unsigned draw(rig *r, int p, const char *const row[], int rows)
{
    kn_patches_begin(r->patches, p);
    for (int y = 0; y < rows; y++)
        for (int x = 0; row[y][x]; x++)
            if (row[y][x] != '.') kn_patches_press(r->patches, at(r, x, y), row[y][x] == '2' ? 2 : 1);
    return kn_patches_end(r->patches, r->share);
}

static int bits(unsigned used)
{
    int count = 0;
    for (; used; used &= used - 1) count++;
    return count;
}

TEST("neighbouring nodes, also across a corner, form one patch; a free node between them separates two patches")
{
    AT_END(rig_free) rig r = rig_make();
    CHECK(draw(&r, 0, (const char *const[]){"...........", "..##.......", "....#......", "...#......."}, 4) == 1);
    CHECK(patch(&r, 0, 4, 2) == 0 && patch(&r, 0, 0, 0) == -1);
    CHECK(bits(draw(&r, 1, (const char *const[]){".......", "..#.#..", "..#.##."}, 3)) == 2);
    CHECK(patch(&r, 1, 2, 1) != patch(&r, 1, 4, 1));
    CHECK(patch(&r, 0, 2, 1) == 0); // patches of the other tool are unchanged
    CHECK(draw(&r, 0, (const char *const[]){"."}, 1) == 0);
    CHECK(patch(&r, 0, 2, 1) == -1);
}

TEST("a patch keeps its number while it moves; when two meet, the stronger one continues with the content of both")
{
    AT_END(rig_free) rig r = rig_make();
    draw(&r, 0, (const char *const[]){"##..22....."}, 1);
    int left = patch(&r, 0, 0, 0), right = patch(&r, 0, 4, 0);
    CHECK(left >= 0 && right >= 0 && left != right);
    draw(&r, 0, (const char *const[]){".#...22...."}, 1);
    CHECK(patch(&r, 0, 1, 0) == left && patch(&r, 0, 6, 0) == right);
    CHECK_NEAR(r.share[right][right], 1, 0);
    unsigned used = draw(&r, 0, (const char *const[]){".#####2...."}, 1);
    CHECK(used == 1u << right); // the right part had more of the load
    CHECK_NEAR(r.share[right][left], 1, 0);
    CHECK_NEAR(r.share[right][right], 1, 0);
}

TEST("when a patch splits, the stronger part keeps the number, and each part takes its share of the content")
{
    AT_END(rig_free) rig r = rig_make();
    draw(&r, 0, (const char *const[]){"#######"}, 1);
    unsigned used = draw(&r, 0, (const char *const[]){"#...###"}, 1);
    int left = patch(&r, 0, 0, 0), right = patch(&r, 0, 5, 0);
    CHECK(used == (1u << left | 1u << right) && right == 0);
    CHECK_NEAR(r.share[left][0], 0.25, 1e-12);
    CHECK_NEAR(r.share[right][0], 0.75, 1e-12);
}

TEST("with more than eight patches the strongest keep their own number, and the rest share one")
{
    AT_END(rig_free) rig r = rig_make();
    const char *rows[9];
    for (int y = 0; y < 9; y++) rows[y] = y == 0 ? "2.2.2.2.2.2" : y % 2 ? "..........." : "#.#.#.#.#.#";
    CHECK(bits(draw(&r, 0, rows, 9)) == KN_PATCHES_MAX);
    for (int y = 0; y < 9; y += 2)
        for (int x = 0; x < 11; x += 2) CHECK(patch(&r, 0, x, y) >= 0);
    for (int x = 2; x < 11; x += 2) CHECK(patch(&r, 0, x, 0) != patch(&r, 0, x - 2, 0));
}

TEST("a patch continues over the edge of the block")
{
    AT_END(rig_free) rig r = rig_make();
    int below = -1;
    const double *rim = r.model->rest_m[at(&r, 3, 0)];
    for (int i = 0; i < r.model->node_count; i++) { // the next node down the side
        const double *x = r.model->rest_m[i];
        bool under = x[0] == rim[0] && x[1] == rim[1] && x[2] < rim[2];
        if (under && (below < 0 || x[2] > r.model->rest_m[below][2])) below = i;
    }
    kn_patches_begin(r.patches, 0);
    kn_patches_press(r.patches, at(&r, 3, 0), 1);
    kn_patches_press(r.patches, below, 1);
    CHECK(bits(kn_patches_end(r.patches, r.share)) == 1);
}
