#include "core/grid.h"
#include "tests/check.h"

static kn_grid grid_of(int nx, int ny, int nz, double diagonal)
{
    kn_grid g;
    kn_grid_init(&g, (const int[3]){nx, ny, nz}, 0.005, 0, diagonal);
    return g;
}

static kn_edge *edges_of(const kn_grid *g, int *count)
{
    *count = kn_grid_edges(g, NULL);
    kn_edge *edges = malloc((size_t)*count * sizeof *edges);
    if (!edges || kn_grid_edges(g, edges) != *count) abort();
    return edges;
}

// Return the neighbourhood of nodes i < j from their coordinates alone: 1 side, 2 face diagonal, 3 body diagonal.
static int steps_between(const kn_grid *g, int i, int j)
{
    int a[3], b[3], steps = 0;
    kn_grid_coords(g, i, a);
    kn_grid_coords(g, j, b);
    for (int k = 0; k < 3; k++) {
        if (abs(a[k] - b[k]) > 1) return 0;
        steps += a[k] != b[k];
    }
    return steps;
}

// One block for each choice of row axis and each number of vectors in a row, including bars and sheets.
static const int blocks[][3] = {{6, 6, 4},  {11, 11, 7}, {4, 6, 16}, {5, 15, 3}, {17, 3, 2}, {3, 32, 2}, {2, 3, 33},
                                {40, 2, 2}, {1, 1, 2},   {1, 1, 20}, {7, 1, 5},  {2, 1, 1},  {1, 1, 1},  {29, 29, 3}};
#define BLOCKS (int)(sizeof blocks / sizeof blocks[0])

TEST("a block of 847 nodes has 8 706 edges: 2 266 sides, 4 040 face and 2 400 body diagonals; 144 nodes have 1 208")
{
    kn_grid g = grid_of(11, 11, 7, 1);
    int count, kinds[4] = {0};
    kn_edge *edges = edges_of(&g, &count);
    for (int e = 0; e < count; e++) kinds[steps_between(&g, edges[e].i, edges[e].j)]++;
    CHECK(g.nodes == 847 && count == 8706);
    CHECK(kinds[1] == 2266 && kinds[2] == 4040 && kinds[3] == 2400);
    free(edges);
    g = grid_of(6, 6, 4, 1);
    CHECK(kn_grid_edges(&g, NULL) == 1208);
    g = grid_of(11, 11, 7, 0);
    CHECK(kn_grid_edges(&g, NULL) == 2266);
}

TEST("in every shape of block the edges are all pairs of neighbours, each once and with the right length")
{
    for (int t = 0; t < BLOCKS; t++) {
        kn_grid g = grid_of(blocks[t][0], blocks[t][1], blocks[t][2], 1);
        int count, expected = 0;
        kn_edge *edges = edges_of(&g, &count);
        unsigned char *seen = calloc((size_t)g.nodes * (size_t)g.nodes, 1);
        for (int e = 0; e < count; e++) {
            int i = edges[e].i, j = edges[e].j, steps = steps_between(&g, i, j);
            CHECK(steps > 0 && !seen[i * g.nodes + j] && !seen[j * g.nodes + i]);
            seen[i * g.nodes + j] = 1;
            CHECK_NEAR(edges[e].rest_m, 0.005 * sqrt(steps), 1e-15);
        }
        for (int i = 0; i < g.nodes; i++)
            for (int j = i + 1; j < g.nodes; j++) expected += steps_between(&g, i, j) > 0;
        CHECK(count == expected);
        free(seen);
        free(edges);
    }
}

TEST("every edge has its own strain slot and every node its own offset, all inside the field")
{
    for (int t = 0; t < BLOCKS; t++) {
        kn_grid g = grid_of(blocks[t][0], blocks[t][1], blocks[t][2], 1);
        int count;
        kn_edge *edges = edges_of(&g, &count);
        unsigned char *slot = calloc(kn_grid_field(&g, KN_FORWARD), 1), *real = calloc(kn_grid_field(&g, 3), 1);
        for (int e = 0; e < count; e++) {
            CHECK(edges[e].slot >= 0 && (size_t)edges[e].slot < kn_grid_field(&g, KN_FORWARD));
            CHECK(!slot[edges[e].slot]++);
        }
        for (int i = 0; i < g.nodes; i++)
            for (size_t k = 0; k < 3; k++) {
                size_t at = kn_grid_offset(&g, i) + k * kn_grid_stride(&g);
                CHECK(at < kn_grid_field(&g, 3));
                CHECK(!real[at]++);
            }
        free(slot);
        free(real);
        free(edges);
    }
}

TEST("rows run along the axis that fills sixteen lanes best, for every axis and one to three vectors")
{
    static const struct {
        int n[3], axis, vectors;
    } cases[] = {
        {{16, 5, 3}, 0, 1}, {{5, 15, 3}, 1, 1}, {{4, 6, 16}, 2, 1},  {{32, 3, 3}, 0, 2},   {{3, 31, 3}, 1, 2},
        {{3, 3, 47}, 2, 3}, {{48, 3, 3}, 0, 3}, {{11, 11, 7}, 0, 1}, {{29, 29, 20}, 0, 2},
    };
    for (int t = 0; t < (int)(sizeof cases / sizeof cases[0]); t++) {
        kn_grid g;
        kn_grid_init(&g, cases[t].n, 0.01, 0, 1);
        CHECK(g.axis[0] == cases[t].axis && g.vectors == cases[t].vectors);
        CHECK(g.axis[0] + g.axis[1] + g.axis[2] == 3 && g.len[0] * g.len[1] * g.len[2] == g.nodes);
        CHECK(kn_grid_stride(&g) == (size_t)g.vectors * KN_LANES);
    }
}

TEST("lane l of vector k is node l K + k of its row; components are a stride apart, and rows follow one another")
{
    for (int t = 0; t < BLOCKS; t++) {
        kn_grid g = grid_of(blocks[t][0], blocks[t][1], blocks[t][2], 1);
        for (int i = 0; i < g.nodes; i++) {
            int ixyz[3];
            kn_grid_coords(&g, i, ixyz);
            CHECK(kn_grid_node(&g, ixyz[0], ixyz[1], ixyz[2]) == i);
            int a = ixyz[g.axis[0]], row = ixyz[g.axis[2]] * g.len[1] + ixyz[g.axis[1]];
            size_t expected = (size_t)row * 3 * kn_grid_stride(&g) + (size_t)(a % g.vectors * KN_LANES + a / g.vectors);
            CHECK(kn_grid_offset(&g, i) == expected);
        }
    }
}

TEST("forward edges connect the lanes as drawn in the header and never lead to an earlier row")
{
    for (int t = 0; t < BLOCKS; t++) {
        kn_grid g = grid_of(blocks[t][0], blocks[t][1], blocks[t][2], 1);
        static const int group[4][2] = {{1, 0}, {-1, 1}, {0, 1}, {1, 1}}; // steps along b, c
        int count;
        kn_edge *edges = edges_of(&g, &count);
        for (int e = 0; e < count; e++) {
            int from[3], to[3], step[3];
            kn_grid_coords(&g, edges[e].i, from);
            kn_grid_coords(&g, edges[e].j, to);
            for (int k = 0; k < 3; k++) step[k] = to[g.axis[k]] - from[g.axis[k]];
            int forward = edges[e].slot / (int)kn_grid_stride(&g) % KN_FORWARD;
            if (forward == 0) {
                CHECK(step[0] == 1 && step[1] == 0 && step[2] == 0);
                continue;
            }
            CHECK(step[0] == (forward - 1) % 3 - 1);
            CHECK(step[1] == group[(forward - 1) / 3][0] && step[2] == group[(forward - 1) / 3][1]);
        }
        free(edges);
    }
}

TEST("the shares of the nodes add up to the volume, and the weights of the edges to those of whole cells")
{
    for (int t = 0; t < BLOCKS; t++) {
        kn_grid g = grid_of(blocks[t][0], blocks[t][1], blocks[t][2], 1);
        double cells = 1, sum = 0;
        bool solid = true;
        for (int k = 0; k < 3; k++) {
            cells *= g.n[k] > 1 ? g.n[k] - 1 : 1; // a single layer of nodes counts as one cell thick
            solid = solid && g.n[k] > 1;
        }
        for (int i = 0; i < g.nodes; i++) sum += kn_grid_share(&g, i);
        CHECK_NEAR(sum, cells, 1e-9 * cells);
        if (!solid) continue;
        double weight[4] = {0};
        int count;
        kn_edge *edges = edges_of(&g, &count);
        for (int e = 0; e < count; e++) weight[steps_between(&g, edges[e].i, edges[e].j)] += edges[e].weight;
        // A cell has 12 sides shared by 4 cells, 12 face diagonals shared by 2, and 4 body diagonals of its own.
        CHECK_NEAR(weight[1], 3 * cells, 1e-9 * cells);
        CHECK_NEAR(weight[2], 6 * cells, 1e-9 * cells);
        CHECK_NEAR(weight[3], 4 * cells, 1e-9 * cells);
        free(edges);
    }
}

TEST("an inner edge weighs 1, an edge in a face 1/2, an edge of the block 1/4 and a single bar 1")
{
    kn_grid g = grid_of(4, 4, 4, 1);
    int count;
    kn_edge *edges = edges_of(&g, &count);
    for (int e = 0; e < count; e++) {
        int a[3], b[3], outside = 0;
        kn_grid_coords(&g, edges[e].i, a);
        kn_grid_coords(&g, edges[e].j, b);
        for (int k = 0; k < 3; k++) outside += a[k] == b[k] && (a[k] == 0 || a[k] == 3);
        CHECK_NEAR(edges[e].weight, outside == 0 ? 1 : outside == 1 ? 0.5 : 0.25, 0);
    }
    free(edges);
    g = grid_of(1, 1, 2, 0);
    kn_edge bar;
    CHECK(kn_grid_edges(&g, &bar) == 1 && bar.weight == 1);
}

TEST("calibrated stiffness is E h/2.7 with diagonals and E h without; the stress area is 0.46 of the share with "
     "diagonals")
{
    kn_grid g = grid_of(4, 4, 4, 1);
    CHECK_NEAR(g.kappa_m, 0.005 / 2.7, 1e-15);
    CHECK_NEAR(g.gamma, 0.46, 0);
    g = grid_of(4, 4, 4, 0);
    CHECK_NEAR(g.kappa_m, 0.005, 1e-15);
    CHECK_NEAR(g.gamma, 1, 0);
}

TEST("the origin is the centre of the base, and z points up")
{
    kn_grid g = grid_of(11, 11, 7, 1);
    double low[3], high[3];
    kn_grid_rest(&g, 0, low);
    kn_grid_rest(&g, g.nodes - 1, high);
    for (int k = 0; k < 3; k++) {
        CHECK_NEAR(low[k], k == 2 ? 0 : -0.025, 1e-12);
        CHECK_NEAR(high[k], k == 2 ? 0.03 : 0.025, 1e-12);
    }
}

TESTS_MAIN
