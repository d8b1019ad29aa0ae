#include "core/grid.h"
#include "tests/check.h"

typedef struct edges { // a grid and its edges
    kn_grid g;
    kn_edge *edge;
    int count;
} edges;

static edges edges_of(const int n[3], double diagonal)
{
    edges e;
    kn_grid_init(&e.g, n, 0.005, 0, diagonal);
    e.count = kn_grid_edges(&e.g, NULL);
    e.edge = malloc((size_t)e.count * sizeof *e.edge);
    if (kn_grid_edges(&e.g, e.edge) != e.count) abort();
    return e;
}

static void edges_free(edges *e) { free(e->edge); }

#define EDGES AT_END(edges_free) edges
#define EACH(edge, e) (const kn_edge *edge = (e).edge; edge < (e).edge + (e).count; edge++)

// Return the neighbourhood of nodes i < j from their coordinates alone: 1 side, 2 face diagonal, 3 body diagonal. Store
// the coordinates of i and the steps from i to j.
static int steps_between(const kn_grid *g, int i, int j, int from[3], int step[3])
{
    int count = 0;
    kn_grid_coords(g, i, from);
    kn_grid_coords(g, j, step);
    for (int k = 0; k < 3; k++) {
        step[k] -= from[k];
        if (abs(step[k]) > 1) return 0;
        count += step[k] != 0;
    }
    return count;
}

static int kind_of(const kn_grid *g, int i, int j)
{
    int from[3], step[3];
    return steps_between(g, i, j, from, step);
}

// One block for each choice of row axis and each number of vectors in a row, including bars and sheets.
static const int blocks[][3] = {{6, 6, 4},  {11, 11, 7}, {4, 6, 16}, {5, 15, 3}, {17, 3, 2}, {3, 32, 2}, {2, 3, 33},
                                {40, 2, 2}, {1, 1, 2},   {1, 1, 20}, {7, 1, 5},  {2, 1, 1},  {1, 1, 1},  {29, 29, 3}};

TEST("a block of 847 nodes has 8 706 edges: 2 266 sides, 4 040 face and 2 400 body diagonals; 144 nodes have 1 208")
{
    EDGES e = edges_of(blocks[1], 1), small = edges_of(blocks[0], 1), sides = edges_of(blocks[1], 0);
    int kinds[4] = {0};
    for
        EACH(edge, e) kinds[kind_of(&e.g, edge->i, edge->j)]++;
    CHECK(e.g.nodes == 847 && e.count == 8706 && small.count == 1208 && sides.count == 2266);
    CHECK(kinds[1] == 2266 && kinds[2] == 4040 && kinds[3] == 2400);
}

TEST("in every shape of block the edges are all pairs of neighbours, each once and with the right length")
{
    for (int t = 0; t < COUNT(blocks); t++) {
        EDGES e = edges_of(blocks[t], 1);
        const int nodes = e.g.nodes;
        int expected = 0;
        unsigned char *seen = calloc((size_t)nodes * (size_t)nodes, 1);
        for
            EACH(edge, e)
            {
                int steps = kind_of(&e.g, edge->i, edge->j);
                CHECK(steps > 0 && !seen[edge->i * nodes + edge->j] && !seen[edge->j * nodes + edge->i]);
                seen[edge->i * nodes + edge->j] = 1;
                CHECK_NEAR(edge->rest_m, 0.005 * sqrt(steps), 1e-15);
            }
        for (int i = 0; i < nodes; i++)
            for (int j = i + 1; j < nodes; j++) expected += kind_of(&e.g, i, j) > 0;
        CHECK(e.count == expected);
        free(seen);
    }
}

TEST("every edge has its own strain slot and every node its own offset, all inside the field")
{
    for (int t = 0; t < COUNT(blocks); t++) {
        EDGES e = edges_of(blocks[t], 1);
        const kn_grid *g = &e.g;
        unsigned char *slot = calloc(kn_grid_field(g, KN_FORWARD), 1), *real = calloc(kn_grid_field(g, 3), 1);
        for
            EACH(edge, e)
            {
                CHECK(edge->slot >= 0 && (size_t)edge->slot < kn_grid_field(g, KN_FORWARD));
                CHECK(!slot[edge->slot]++);
            }
        for (int i = 0; i < g->nodes; i++)
            for (size_t k = 0; k < 3; k++) {
                size_t at = kn_grid_offset(g, i) + k * kn_grid_stride(g);
                CHECK(at < kn_grid_field(g, 3));
                CHECK(!real[at]++);
            }
        free(slot), free(real);
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
    for (int t = 0; t < COUNT(cases); t++) {
        kn_grid g;
        kn_grid_init(&g, cases[t].n, 0.01, 0, 1);
        CHECK(g.axis[0] == cases[t].axis && g.vectors == cases[t].vectors);
        CHECK(g.axis[0] + g.axis[1] + g.axis[2] == 3 && g.len[0] * g.len[1] * g.len[2] == g.nodes);
        CHECK(kn_grid_stride(&g) == (size_t)g.vectors * KN_LANES);
    }
}

TEST("lane l of vector k is node l K + k of its row; components are a stride apart, and rows follow one another")
{
    for (int t = 0; t < COUNT(blocks); t++) {
        EDGES e = edges_of(blocks[t], 1);
        const kn_grid *g = &e.g;
        for (int i = 0; i < g->nodes; i++) {
            int c[3];
            kn_grid_coords(g, i, c);
            CHECK(kn_grid_node(g, c[0], c[1], c[2]) == i);
            int a = c[g->axis[0]], row = c[g->axis[2]] * g->len[1] + c[g->axis[1]];
            size_t lane = (size_t)(a % g->vectors * KN_LANES + a / g->vectors);
            CHECK(kn_grid_offset(g, i) == (size_t)row * 3 * kn_grid_stride(g) + lane);
        }
    }
}

TEST("forward edges connect the lanes as drawn in the header and never lead to an earlier row")
{
    static const int group[5][2] = {{0, 0}, {1, 0}, {-1, 1}, {0, 1}, {1, 1}}; // steps along b, c
    for (int t = 0; t < COUNT(blocks); t++) {
        EDGES e = edges_of(blocks[t], 1);
        for
            EACH(edge, e)
            {
                int from[3], step[3], forward = edge->slot / (int)kn_grid_stride(&e.g) % KN_FORWARD;
                const int *row = group[forward ? 1 + (forward - 1) / 3 : 0], *axis = e.g.axis;
                steps_between(&e.g, edge->i, edge->j, from, step);
                CHECK(step[axis[0]] == (forward ? (forward - 1) % 3 - 1 : 1));
                CHECK(step[axis[1]] == row[0] && step[axis[2]] == row[1]);
            }
    }
}

TEST("the shares of the nodes add up to the volume, and the weights of the edges to those of whole cells")
{
    for (int t = 0; t < COUNT(blocks); t++) {
        EDGES e = edges_of(blocks[t], 1);
        double cells = 1, sum = 0, weight[4] = {0};
        bool solid = true;
        for (int k = 0; k < 3; k++) {
            cells *= e.g.n[k] > 1 ? e.g.n[k] - 1 : 1; // a single layer of nodes counts as one cell thick
            solid = solid && e.g.n[k] > 1;
        }
        for (int i = 0; i < e.g.nodes; i++) sum += kn_grid_share(&e.g, i);
        CHECK_NEAR(sum, cells, 1e-9 * cells);
        if (!solid) continue;
        for
            EACH(edge, e) weight[kind_of(&e.g, edge->i, edge->j)] += edge->weight;
        // A cell has 12 sides shared by 4 cells, 12 face diagonals shared by 2, and 4 body diagonals of its own.
        static const int share[] = {0, 3, 6, 4};
        for (int kind = 1; kind < 4; kind++) CHECK_NEAR(weight[kind], share[kind] * cells, 1e-9 * cells);
    }
}

TEST("an inner edge weighs 1, an edge in a face 1/2, an edge of the block 1/4 and a single bar 1")
{
    EDGES e = edges_of((const int[]){4, 4, 4}, 1), bar = edges_of((const int[]){1, 1, 2}, 0);
    for
        EACH(edge, e)
        {
            int from[3], step[3], outside = 0;
            steps_between(&e.g, edge->i, edge->j, from, step);
            for (int k = 0; k < 3; k++) outside += step[k] == 0 && (from[k] == 0 || from[k] == 3);
            CHECK_NEAR(edge->weight, pow(0.5, outside), 0);
        }
    CHECK(bar.count == 1 && bar.edge->weight == 1);
}

TEST("calibrated stiffness is E h/2.7 with diagonals and E h without; the stress area is 0.46 of the share with "
     "diagonals")
{
    EDGES all = edges_of(blocks[0], 1), sides = edges_of(blocks[0], 0);
    CHECK_NEAR(all.g.kappa_m, 0.005 / 2.7, 1e-15);
    CHECK_NEAR(sides.g.kappa_m, 0.005, 1e-15);
    CHECK(all.g.gamma == 0.46 && sides.g.gamma == 1);
}

TEST("the origin is the centre of the base, and z points up")
{
    EDGES e = edges_of(blocks[1], 1);
    double low[3], high[3];
    kn_grid_rest(&e.g, 0, low);
    kn_grid_rest(&e.g, e.g.nodes - 1, high);
    for (int k = 0; k < 3; k++) {
        CHECK_NEAR(low[k], k == 2 ? 0 : -0.025, 1e-12);
        CHECK_NEAR(high[k], k == 2 ? 0.03 : 0.025, 1e-12);
    }
}
