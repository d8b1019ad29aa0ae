#include "core/surface.h"
#include "core/algebra/algebra.h"
#include "tests/lattice.h"

static lattice block(int nx, int ny, int nz) // of cells of 1 cm
{
    kn_model_def def = press_def(1);
    def.nodes[0] = nx, def.nodes[1] = ny, def.nodes[2] = nz;
    if (ny == 1) def.thickness_m = 0.02;
    return lattice_of(def);
}

// Check that each side of a triangle occurs once in the other direction, and return the enclosed volume.
static double closed_volume(const lattice *l, const kn_surface *s)
{
    int n = s->vertex_count, *way = calloc((size_t)(n * n), sizeof *way);
    float *x = malloc((size_t)n * 3 * sizeof *x);
    double volume = 0;
    kn_surface_positions(s, l->model, l->state, x);
    for (int t = 0; t < s->triangle_count; t++) {
        double corner[3][3], across[3];
        for (int k = 0; k < 3; k++) {
            way[s->triangle[3 * t + k] * n + s->triangle[3 * t + (k + 1) % 3]]++;
            for (int c = 0; c < 3; c++) corner[k][c] = (double)x[3 * s->triangle[3 * t + k] + c];
        }
        kn_cross(corner[1], corner[2], across);
        volume += kn_dot(corner[0], across) / 6;
    }
    for (int i = 0; i < n * n; i++) CHECK(way[i] <= 1 && way[i] == way[i % n * n + i / n]);
    free(x), free(way);
    return volume;
}

TEST("the skin has every outer node once and is closed; its triangles turn counter-clockwise seen from outside and "
     "enclose the volume of the block; its vertices follow the nodes")
{
    LATTICE l = block(6, 5, 4);
    OWN(kn_surface) *s = kn_surface_create(l.model);
    CHECK(s->vertex_count == 6 * 5 * 4 - 4 * 3 * 2);
    CHECK(s->triangle_count == 2 * 2 * (5 * 4 + 5 * 3 + 4 * 3));
    CHECK(s->vertex_count - 3 * s->triangle_count / 2 + s->triangle_count == 2); // Euler's formula
    CHECK_NEAR(closed_volume(&l, s), 0.05 * 0.04 * 0.03, 1e-10);
    float x[3 * 96];
    double deepest = 0, u[3];
    press_until(&l, &(press){.depth_m = 0.002, .hold_s = 1}, 200);
    kn_surface_positions(s, l.model, l.state, x);
    for (int i = 0; i < 3 * s->vertex_count; i++) {
        displacement(l.model, l.state, s->node[i / 3], u);
        CHECK_NEAR(x[i], l.model->rest_m[s->node[i / 3]][i % 3] + u[i % 3], 1e-8);
        deepest = fmax(deepest, -u[2]);
    }
    CHECK(deepest > 1e-3);
}

TEST("the skin of a flat block is closed and as thick as the block, with a vertex before and behind every node")
{
    LATTICE l = block(6, 1, 4);
    OWN(kn_surface) *s = kn_surface_create(l.model);
    CHECK(s->vertex_count == 2 * 6 * 4);
    CHECK_NEAR(closed_volume(&l, s), 0.05 * 0.02 * 0.03, 1e-10);
    int behind = 0;
    for (int v = 0; v < s->vertex_count; v++) {
        double x[3];
        kn_surface_rest(s, l.model, v, x);
        CHECK_NEAR(x[0], l.model->rest_m[s->node[v]][0], 0);
        CHECK_NEAR(fabs(x[1]), 0.01, 1e-15);
        behind += x[1] > 0;
    }
    CHECK(behind == 6 * 4);
}
