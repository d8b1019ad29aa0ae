#include "core/net.h"
#include "core/net_fit.h"
#include "core/vec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void difference(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

// --- edges ----------------------------------------------------------------------------------------------------------

typedef struct side { // side of one element, or the sum of merged sides
    int i, j, element;
    double kappa_m;
} side;

// Compare two sides for qsort: by their end nodes, then by element, so that sums do not depend on the order of equal
// keys.
static int by_ends(const void *a, const void *b)
{
    const side *x = a, *y = b;
    if (x->i != y->i) return x->i < y->i ? -1 : 1;
    if (x->j != y->j) return x->j < y->j ? -1 : 1;
    return (x->element > y->element) - (x->element < y->element);
}

// Return the volume of an element, m^3; a flat element's area times thickness.
static double volume_of(const kn_model *m, const int element[4])
{
    const kn_simplices *s = m->def.mesh;
    double a[3], b[3], c[3], ab[3];
    difference(s->x_m[element[1]], s->x_m[element[0]], a);
    difference(s->x_m[element[2]], s->x_m[element[0]], b);
    kn_cross(a, b, ab);
    if (s->dimension == 2) return 0.5 * sqrt(kn_dot(ab, ab)) * m->def.thickness_m;
    difference(s->x_m[element[3]], s->x_m[element[0]], c);
    return kn_dot(ab, c) / 6;
}

// List all sides of all elements, with kappa = V/L^2 for each.
static int list_sides(const kn_model *m, side *sides)
{
    const kn_simplices *s = m->def.mesh;
    int count = 0;
    for (int e = 0; e < s->element_count; e++) {
        double volume = volume_of(m, s->element[e]);
        for (int a = 0; a <= s->dimension; a++)
            for (int b = a + 1; b <= s->dimension; b++) {
                int i = s->element[e][a], j = s->element[e][b];
                double d[3];
                difference(s->x_m[i], s->x_m[j], d);
                sides[count++] = (side){i < j ? i : j, i < j ? j : i, e, volume / kn_dot(d, d)};
            }
    }
    return count;
}

// Merge the sides that elements share into edges. kappa of the model is the mean of the edges, and weights are relative
// to this mean.
static bool build_edges(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    side *sides = malloc((size_t)s->element_count * (s->dimension == 2 ? 3 : 6) * sizeof *sides);
    if (!sides) return false;
    int count = list_sides(m, sides), merged = 0;
    qsort(sides, (size_t)count, sizeof *sides, by_ends);
    for (int k = 0; k < count; k++) {
        bool same = merged > 0 && sides[merged - 1].i == sides[k].i && sides[merged - 1].j == sides[k].j;
        if (same) sides[merged - 1].kappa_m += sides[k].kappa_m;
        else sides[merged++] = sides[k];
    }
    m->edges = calloc((size_t)merged, sizeof *m->edges);
    m->edge_count = m->edges ? merged : 0;
    m->kappa_m = 0;
    for (int k = 0; k < m->edge_count; k++) m->kappa_m += sides[k].kappa_m / merged;
    for (int k = 0; k < m->edge_count; k++) {
        double d[3];
        difference(s->x_m[sides[k].i], s->x_m[sides[k].j], d);
        m->edges[k] = (kn_edge){sides[k].i, sides[k].j, k, sides[k].kappa_m / m->kappa_m, sqrt(kn_dot(d, d))};
    }
    free(sides);
    return m->edges != NULL;
}

// --- skin -----------------------------------------------------------------------------------------------------------

// A face of one element. Corners turn counter-clockwise seen from outside; the third corner of a flat facet is -1.
typedef struct facet {
    int corner[3], sorted[3];
} facet;

static int by_corners(const void *a, const void *b)
{
    return memcmp(((const facet *)a)->sorted, ((const facet *)b)->sorted, sizeof((const facet *)a)->sorted);
}

// Make a facet, with its corners also sorted for comparison.
static facet facet_of(int a, int b, int c)
{
    facet f = {{a, b, c}, {a, b, c}};
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < 2; k++)
            if (f.sorted[k] > f.sorted[k + 1]) {
                int swap = f.sorted[k];
                f.sorted[k] = f.sorted[k + 1];
                f.sorted[k + 1] = swap;
            }
    return f;
}

// Return the facets that belong to one element only, and their number. NULL when memory is short.
static facet *outer_facets(const kn_simplices *s, int *count)
{
    static const int solid[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}, flat[3][2] = {{0, 1}, {1, 2}, {2, 0}};
    int per = s->dimension + 1, all = 0;
    facet *f = malloc((size_t)s->element_count * (size_t)per * sizeof *f);
    if (!f) return NULL;
    for (int e = 0; e < s->element_count; e++)
        for (int k = 0; k < per; k++) {
            const int *x = s->element[e];
            f[all++] = s->dimension == 3 ? facet_of(x[solid[k][0]], x[solid[k][1]], x[solid[k][2]])
                                         : facet_of(x[flat[k][0]], x[flat[k][1]], -1);
        }
    qsort(f, (size_t)all, sizeof *f, by_corners);
    *count = 0;
    for (int k = 0; k < all; k++) {
        bool lone = (k == 0 || by_corners(&f[k - 1], &f[k])) && (k + 1 == all || by_corners(&f[k + 1], &f[k]));
        if (lone) f[(*count)++] = f[k];
    }
    return f;
}

// Compute the area of a facet as a vector that points outwards, m^2; a flat facet's length times thickness.
static void facet_area(const kn_model *m, const facet *f, double area_m2[3])
{
    const kn_simplices *s = m->def.mesh;
    double a[3], b[3];
    difference(s->x_m[f->corner[1]], s->x_m[f->corner[0]], a);
    // triangles turn from x to z, so outwards is to the right of the direction along the side
    if (s->dimension == 2) {
        area_m2[0] = a[2] * m->def.thickness_m;
        area_m2[1] = 0;
        area_m2[2] = -a[0] * m->def.thickness_m;
        return;
    }
    difference(s->x_m[f->corner[2]], s->x_m[f->corner[0]], b);
    kn_cross(a, b, area_m2);
    for (int k = 0; k < 3; k++) area_m2[k] *= 0.5;
}

// A facet belongs to the top if the cosine between its normal and the vertical is at least this. (Plates press from
// above.)
#define TOP_COSINE 0.5

// List the top's nodes with their shares, by the horizontal area of their facets.
static void build_top(kn_model *m, const facet *facets, int count)
{
    double *share = m->top_share, sum = 0; // shares are indexed by node until the list of top nodes is made
    for (int f = 0; f < count; f++) {
        double area[3];
        facet_area(m, &facets[f], area);
        if (area[2] < TOP_COSINE * sqrt(kn_dot(area, area))) continue;
        for (int k = 0; k < m->def.mesh->dimension; k++) share[facets[f].corner[k]] += area[2];
        sum += area[2] * m->def.mesh->dimension;
    }
    m->top_count = 0;
    for (int node = 0; node < m->node_count; node++) {
        if (share[node] == 0) continue;
        m->top_share[m->top_count] = share[node] / sum;
        m->top[m->top_count++] = node;
    }
}

// Build the triangles of the outside. A flat object has its triangles on both sides.
static bool build_skin(kn_model *m, const facet *facets, int count)
{
    const kn_simplices *s = m->def.mesh;
    m->skin_count = s->dimension == 3 ? count : 2 * s->element_count;
    m->skin = malloc((size_t)m->skin_count * sizeof *m->skin);
    if (!m->skin) return false;
    for (int k = 0; k < m->skin_count; k++) {
        if (s->dimension == 3) {
            memcpy(m->skin[k], facets[k].corner, sizeof *m->skin);
        } else {
            const int *e = s->element[k / 2];
            for (int c = 0; c < 3; c++) m->skin[k][c] = e[k % 2 ? 2 - c : c];
        }
    }
    return true;
}

// --- nodes ----------------------------------------------------------------------------------------------------------

// Give every node its share of the elements' masses.
static void build_masses(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    for (int e = 0; e < s->element_count; e++) {
        double mass = m->def.density_kg_m3 * volume_of(m, s->element[e]) / (s->dimension + 1);
        for (int k = 0; k <= s->dimension; k++) m->node_mass_kg[s->element[e][k]] += mass;
    }
}

// Hold the lowest nodes, which stand on the table, and keep a flat object in its plane.
static void build_support(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < s->node_count; i++) {
        low = fmin(low, s->x_m[i][2]), high = fmax(high, s->x_m[i][2]);
        for (int k = 0; k < 3; k++) m->size_m = fmax(m->size_m, 2 * fabs(s->x_m[i][k]));
    }
    for (int i = 0; i < s->node_count; i++) {
        bool base = s->x_m[i][2] <= low + 1e-6 * (high - low);
        m->support[i] = (uint8_t)((base ? kn_support_mask(m->def.support) : 0) | (s->dimension == 2 ? 2 : 0));
    }
}

// Make every element a cell of gas.
static bool build_cells(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    if (m->def.pressure == KN_PRESSURE_NONE) return true;
    if (!kn_model_cells(m, s->element_count)) return false;
    for (int c = 0; c < m->cell_count; c++) {
        for (int i = 0; i < 8; i++) m->cells[c].corner[i] = -1;
        memcpy(m->cells[c].corner, s->element[c], sizeof s->element[c]); // a triangle's fourth corner is -1
        m->cell_volume[c] = volume_of(m, s->element[c]);
    }
    return true;
}

// --- fit ------------------------------------------------------------------------------------------------------------

// Largest number of nodes of the specimen in the fit of gamma. The fit takes some tenths of a second.
#define CREEP_NODES_MAX 1000

// Sum the outward area of every node of a specimen. Return the specimen's volume.
static double areas(const kn_model *m, const facet *facets, int count, double (*area_m2)[3])
{
    const kn_simplices *s = m->def.mesh;
    double volume = 0;
    for (int f = 0; f < count; f++) {
        double area[3];
        facet_area(m, &facets[f], area);
        for (int c = 0; c < s->dimension; c++)
            for (int k = 0; k < 3; k++) area_m2[facets[f].corner[c]][k] += area[k] / s->dimension;
    }
    for (int e = 0; e < s->element_count; e++) volume += volume_of(m, s->element[e]);
    return volume;
}

typedef struct near {
    double square;
    int element;
} near;

static int by_distance(const void *a, const void *b)
{
    const near *x = a, *y = b;
    if (x->square != y->square) return x->square < y->square ? -1 : 1;
    return (x->element > y->element) - (x->element < y->element);
}

// Compare two elements for qsort by their distance from the middle of the mesh.
static near *from_middle(const kn_simplices *s)
{
    near *order = malloc((size_t)s->element_count * sizeof *order);
    double middle[3] = {0};
    for (int i = 0; i < s->node_count; i++)
        for (int k = 0; k < 3; k++) middle[k] += s->x_m[i][k] / s->node_count;
    for (int e = 0; order && e < s->element_count; e++) {
        double d[3] = {-middle[0], -middle[1], -middle[2]};
        for (int c = 0; c <= s->dimension; c++)
            for (int k = 0; k < 3; k++) d[k] += s->x_m[s->element[e][c]][k] / (s->dimension + 1);
        order[e] = (near){kn_dot(d, d), e};
    }
    if (order) qsort(order, (size_t)s->element_count, sizeof *order, by_distance);
    return order;
}

// Cut out the middle of a mesh, with as many nodes as the fit can afford. NULL when memory is short.
static kn_simplices *middle_of(const kn_simplices *s)
{
    near *order = from_middle(s);
    // number of each node in the specimen, from 1; 0: not in the specimen
    int *number = calloc((size_t)s->node_count, sizeof *number);
    kn_simplices *part = kn_simplices_create(s->dimension, CREEP_NODES_MAX, s->element_count);
    if (order && number && part) {
        part->node_count = part->element_count = 0;
        for (int e = 0; e < s->element_count && part->node_count + 4 <= CREEP_NODES_MAX; e++) {
            const int *from = s->element[order[e].element];
            int *to = part->element[part->element_count++];
            to[3] = -1;
            for (int c = 0; c <= s->dimension; c++) {
                if (number[from[c]] == 0) {
                    memcpy(part->x_m[part->node_count], s->x_m[from[c]], sizeof *s->x_m);
                    number[from[c]] = ++part->node_count;
                }
                to[c] = number[from[c]] - 1;
            }
        }
    }
    bool ok = order && number && part;
    free(order);
    free(number);
    if (ok) return part;
    kn_simplices_destroy(part);
    return NULL;
}

static kn_specimen specimen_of(const kn_model *m, const double (*area_m2)[3], double volume)
{
    const kn_simplices *s = m->def.mesh;
    return (kn_specimen){s->node_count, m->edge_count, s->dimension == 2, (const double(*)[3])s->x_m,
                         area_m2,       m->edges,      m->kappa_m,        volume};
}

// Fit kappa and gamma. One factor on kappa makes the body's E equal to that of the material. gamma follows from a creep
// test, unless the mesh is too large. Return NULL, or what is wrong.
static const char *fit(kn_model *m, const facet *facets, int count)
{
    const kn_simplices *s = m->def.mesh;
    double(*area)[3] = calloc((size_t)s->node_count, sizeof *area);
    if (!area) return KN_NO_MEMORY;
    double volume = areas(m, facets, count, area);
    kn_specimen specimen = specimen_of(m, (const double(*)[3])area, volume);
    kn_net_moduli *own = &m->moduli;
    const char *wrong = kn_specimen_moduli(&specimen, own);
    if (!wrong) {
        double mean = s->dimension == 3 ? (own->young[0] + own->young[1] + own->young[2]) / 3
                                        : (own->young[0] + own->young[2]) / 2;
        // scale the springs, and with them the moduli, to a mean E of 1
        m->kappa_m /= mean;
        for (int k = 0; k < 3; k++) own->young[k] /= mean;
        own->shear /= mean;
        specimen.kappa_m = m->kappa_m;
        if (s->node_count <= CREEP_NODES_MAX &&
            !kn_specimen_gamma(&specimen, &m->def.material, &m->gamma, &m->creep_error))
            wrong = KN_NO_MEMORY;
    }
    free(area);
    return wrong;
}

// Fit gamma of a large mesh with a specimen cut from its middle.
static const char *fit_middle(kn_model *m)
{
    kn_simplices *part = middle_of(m->def.mesh);
    kn_model *specimen = calloc(1, sizeof *specimen);
    int count = 0;
    facet *facets = part ? outer_facets(part, &count) : NULL;
    const char *wrong = KN_NO_MEMORY;
    if (facets && specimen) {
        specimen->def = m->def;
        specimen->def.mesh = part;
        if (build_edges(specimen)) wrong = fit(specimen, facets, count);
        m->gamma = specimen->gamma;
        m->creep_error = specimen->creep_error;
        free(specimen->edges);
    }
    free(facets);
    free(specimen);
    kn_simplices_destroy(part);
    return wrong;
}

const char *kn_net_build(kn_model *m)
{
    const kn_simplices *s = m->def.mesh;
    int count = 0;
    facet *facets = outer_facets(s, &count);
    const char *wrong = KN_NO_MEMORY;
    if (facets && kn_model_nodes(m, s->node_count, s->node_count) && build_edges(m) && build_skin(m, facets, count) &&
        build_cells(m)) {
        m->row_count = s->node_count;
        m->stride = 1;
        m->edge_reals = (size_t)(m->edge_count + KN_LANES - 1) / KN_LANES * KN_LANES;
        // nodes first, since support, top and fit need them
        for (int i = 0; i < s->node_count; i++) m->offset[i] = 3 * (size_t)i;
        memcpy(m->rest_m, s->x_m, (size_t)s->node_count * sizeof *m->rest_m);
        build_masses(m);
        build_support(m);
        build_top(m, facets, count);
        wrong = fit(m, facets, count);
        if (!wrong && s->node_count > CREEP_NODES_MAX) wrong = fit_middle(m);
    }
    free(facets);
    return wrong;
}
