#include "core/simplices.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

kn_simplices *kn_simplices_create(int dimension, int node_count, int element_count)
{
    kn_simplices *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    *s = (kn_simplices){.dimension = dimension, .node_count = node_count, .element_count = element_count};
    s->x_m = calloc((size_t)node_count + 1, sizeof *s->x_m);
    s->element = calloc((size_t)element_count + 1, sizeof *s->element);
    s->tag = calloc((size_t)element_count + 1, sizeof *s->tag);
    if (s->x_m && s->element && s->tag) return s;
    kn_simplices_destroy(s);
    return NULL;
}

void kn_simplices_destroy(kn_simplices *s)
{
    if (!s) return;
    free(s->x_m);
    free(s->element);
    free(s->tag);
    free(s);
}

// ---- one element

static int corners(const kn_simplices *s) { return s->dimension + 1; }

// Return the signed volume of a tetrahedron, or the signed area of a triangle in the x-z plane.
static double volume_of(const kn_simplices *s, int e)
{
    double d[3][3] = {{0}};
    const int *node = s->element[e];
    for (int k = 1; k < corners(s); k++)
        for (int c = 0; c < 3; c++) d[k - 1][c] = s->x_m[node[k]][c] - s->x_m[node[0]][c];
    if (s->dimension == 2) return (d[0][0] * d[1][2] - d[0][2] * d[1][0]) / 2;
    double det = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) - d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                 d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
    return det / 6;
}

static double square_of_edge(const kn_simplices *s, int i, int j)
{
    double sum = 0;
    for (int c = 0; c < 3; c++) {
        double d = s->x_m[i][c] - s->x_m[j][c];
        sum += d * d;
    }
    return sum;
}

// Return the quality of an element, see simplices.h; 0 if it is flat or inverted.
static double quality_of(const kn_simplices *s, int e)
{
    double squares = 0, volume = volume_of(s, e);
    const int *node = s->element[e];
    for (int a = 0; a < corners(s); a++)
        for (int b = 0; b < a; b++) squares += square_of_edge(s, node[a], node[b]);
    if (!(volume > 0)) return 0; // an element with a volume > 0 also has `squares` > 0
    if (s->dimension == 2) return 4 * sqrt(3) * volume / squares;
    double root = cbrt(3 * volume);
    return 12 * root * root / squares;
}

static void box_of(const kn_simplices *s, double low[3], double high[3])
{
    for (int c = 0; c < 3; c++) low[c] = high[c] = s->x_m[0][c];
    for (int i = 1; i < s->node_count; i++)
        for (int c = 0; c < 3; c++) {
            low[c] = fmin(low[c], s->x_m[i][c]);
            high[c] = fmax(high[c], s->x_m[i][c]);
        }
}

// ---- the check

typedef struct checker {
    const kn_simplices *s;
    int *owner; // one element that each node belongs to; -1: none
    int blame;
    char *error;
    size_t size;
} checker;

// Set the error text and the element to blame. Return false.
__attribute__((format(printf, 3, 4))) static bool fault(checker *c, int blame, const char *format, ...)
{
    va_list args;
    c->blame = blame;
    va_start(args, format);
    vsnprintf(c->error, c->size, format, args);
    va_end(args);
    return false;
}

// Check that the dimension and the counts are within their limits. The later checks rely on that.
static bool check_counts(checker *c)
{
    const kn_simplices *s = c->s;
    if (s->dimension != 2 && s->dimension != 3) return fault(c, -1, "neither triangles nor tetrahedra");
    if (s->element_count < 1 || s->element_count > KN_SIMPLICES_ELEMENTS_MAX)
        return fault(c, -1, "%d elements, expected 1 to %d", s->element_count, KN_SIMPLICES_ELEMENTS_MAX);
    if (s->node_count < corners(s) || s->node_count > KN_SIMPLICES_NODES_MAX)
        return fault(c, -1, "%d nodes, expected %d to %d", s->node_count, corners(s), KN_SIMPLICES_NODES_MAX);
    return true;
}

// Check that all nodes have finite positions, that a flat mesh lies in the x-z plane, and that the object is not too
// large.
static bool check_nodes(checker *c)
{
    const kn_simplices *s = c->s;
    double low[3], high[3];
    for (int i = 0; i < s->node_count; i++) {
        const double *x = s->x_m[i];
        if (!isfinite(x[0]) || !isfinite(x[1]) || !isfinite(x[2]))
            return fault(c, c->owner[i], "a node of element %ld is not at a finite place", s->tag[c->owner[i]]);
        if (s->dimension == 2 && x[1] != 0)
            return fault(c, c->owner[i], "a node of triangle %ld is not in the x-z plane", s->tag[c->owner[i]]);
    }
    box_of(s, low, high);
    double extent = fmax(high[0] - low[0], fmax(high[1] - low[1], high[2] - low[2]));
    if (extent <= KN_SIMPLICES_EXTENT_MAX_M) return true;
    return fault(c, -1, "the object is %.3g m across, expected at most %g m: is its unit right?", extent,
                 KN_SIMPLICES_EXTENT_MAX_M);
}

// Check that elements name existing nodes only, that no element has a node twice, and that every node is in an element.
static bool check_numbers(checker *c)
{
    const kn_simplices *s = c->s;
    for (int i = 0; i < s->node_count; i++) c->owner[i] = -1;
    for (int e = 0; e < s->element_count; e++) {
        const int *node = s->element[e];
        for (int a = 0; a < corners(s); a++) {
            if (node[a] < 0 || node[a] >= s->node_count)
                return fault(c, e, "element %ld has a node that does not exist", s->tag[e]);
            for (int b = 0; b < a; b++)
                if (node[a] == node[b])
                    return fault(c, e, "element %ld is degenerate: it has one node twice", s->tag[e]);
            c->owner[node[a]] = e;
        }
    }
    for (int i = 0; i < s->node_count; i++)
        if (c->owner[i] < 0) return fault(c, -1, "node %d of %d belongs to no element", i + 1, s->node_count);
    return true;
}

// Check the quality of every element, and the mean quality of all elements.
static bool check_shapes(checker *c)
{
    const kn_simplices *s = c->s;
    double mean = 0;
    for (int e = 0; e < s->element_count; e++) {
        double volume = volume_of(s, e), quality = quality_of(s, e);
        const int *node = s->element[e];
        mean += quality / s->element_count;
        if (quality >= KN_SIMPLICES_QUALITY_MIN) continue;
        double edge = sqrt(square_of_edge(s, node[0], node[1])), flat = KN_SIMPLICES_QUALITY_MIN * edge * edge;
        // the volume of a flat element may be slightly negative by rounding: call the element degenerate, not inverted
        if (s->dimension == 3) flat *= 0.01 * edge;
        if (volume < -flat)
            return fault(c, e,
                         "element %ld is inverted (%.3g %s), expected its nodes in the order that makes it positive",
                         s->tag[e], volume, s->dimension == 3 ? "m^3" : "m^2");
        return fault(c, e, "element %ld is degenerate (quality %.2g of 1), expected at least %g", s->tag[e], quality,
                     KN_SIMPLICES_QUALITY_MIN);
    }
    if (mean >= KN_SIMPLICES_QUALITY_MEAN) return true;
    return fault(c, -1, "elements are flat or elongated on average (mean quality %.2g of 1), expected at least %g",
                 mean, KN_SIMPLICES_QUALITY_MEAN);
}

// A record for sorting, which brings equal keys together. A key is a cell of space, or the nodes of an element, a face
// or an edge.
typedef struct record {
    int key[4];
    int owner;
} record;

static int by_key(const void *a, const void *b)
{
    const record *p = a, *q = b;
    for (int k = 0; k < 4; k++)
        if (p->key[k] != q->key[k]) return p->key[k] < q->key[k] ? -1 : 1;
    return p->owner < q->owner ? -1 : p->owner > q->owner; // records with equal keys stay in the order of the file
}

static bool same_key(const record *p, const record *q) { return memcmp(p->key, q->key, sizeof p->key) == 0; }

// Sort a few numbers in ascending order. Return whether the number of exchanges was odd.
static bool sort_few(int *key, int count)
{
    bool odd = false;
    for (int a = 1; a < count; a++)
        for (int b = a; b > 0 && key[b] < key[b - 1]; b--) {
            int swap = key[b];
            key[b] = key[b - 1];
            key[b - 1] = swap;
            odd = !odd;
        }
    return odd;
}

// Return the index of the first record with a key. If there is none, return the index at which it would be.
static int first_at(const record *r, int count, const int key[4])
{
    record wanted = {.owner = -1};
    memcpy(wanted.key, key, sizeof wanted.key);
    int low = 0;
    for (int high = count; low < high;) {
        int middle = low + (high - low) / 2;
        if (by_key(&r[middle], &wanted) < 0) low = middle + 1;
        else high = middle;
    }
    return low;
}

// Return a node in a cell of space whose distance from node i is at most the tolerance, or -1 if there is none.
static int coincident(const kn_simplices *s, const record *r, int i, const int cell[4], double tolerance)
{
    for (int k = first_at(r, s->node_count, cell); k < s->node_count && memcmp(r[k].key, cell, sizeof r[k].key) == 0;
         k++)
        if (r[k].owner < i && square_of_edge(s, i, r[k].owner) <= tolerance * tolerance) return r[k].owner;
    return -1;
}

// Check that no two nodes lie in the same place. Space is divided into cells whose side is twice the tolerance. The
// cells that contain the eight corners of a cube around a node, with the tolerance as the cube's half side, contain all
// nodes within the tolerance of this node.
static bool check_places(checker *c, record *r)
{
    const kn_simplices *s = c->s;
    double low[3], high[3], diagonal = 0;
    box_of(s, low, high);
    for (int k = 0; k < 3; k++) diagonal += (high[k] - low[k]) * (high[k] - low[k]);
    double tolerance = KN_SIMPLICES_COINCIDENT * sqrt(diagonal), cell = 2 * tolerance;
    for (int i = 0; i < s->node_count; i++) {
        r[i] = (record){.owner = i};
        for (int k = 0; k < 3; k++) r[i].key[k] = (int)floor((s->x_m[i][k] - low[k]) / cell);
    }
    // sort the nodes by cell, then search around every node
    qsort(r, (size_t)s->node_count, sizeof *r, by_key);
    for (int i = 0; i < s->node_count; i++)
        for (int corner = 0; corner < 8; corner++) {
            int key[4] = {0};
            for (int k = 0; k < 3; k++)
                key[k] = (int)floor((s->x_m[i][k] - low[k] + (corner >> k & 1 ? tolerance : -tolerance)) / cell);
            int other = coincident(s, r, i, key, tolerance);
            if (other < 0) continue;
            int a = c->owner[i], b = c->owner[other];
            if (a > b) a = c->owner[other], b = c->owner[i];
            return fault(c, b, "elements %ld and %ld have different nodes at one place, expected one node", s->tag[a],
                         s->tag[b]);
        }
    return true;
}

// Check that no two elements have the same set of nodes.
static bool check_twins(checker *c, record *r)
{
    const kn_simplices *s = c->s;
    // two elements with the same nodes have equal sorted node numbers
    for (int e = 0; e < s->element_count; e++) {
        memcpy(r[e].key, s->element[e], sizeof r[e].key);
        sort_few(r[e].key, corners(s));
        r[e].owner = e;
    }
    qsort(r, (size_t)s->element_count, sizeof *r, by_key);
    for (int e = 1; e < s->element_count; e++)
        if (same_key(&r[e - 1], &r[e]))
            return fault(c, r[e].owner, "elements %ld and %ld have the same nodes, expected each once",
                         s->tag[r[e - 1].owner], s->tag[r[e].owner]);
    return true;
}

// List the faces of every element, sorted by key. key holds the nodes of the face in ascending order; key[3] is 0.
// owner is 2 * element + p, where p is the parity of the nodes' order seen from outside the element.
static int list_faces(const kn_simplices *s, record *r)
{
    static const int of_tetrahedron[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
    static const int of_triangle[3][2] = {{0, 1}, {1, 2}, {2, 0}};
    int count = 0;
    for (int e = 0; e < s->element_count; e++)
        for (int f = 0; f < corners(s); f++) {
            const int *corner = s->dimension == 3 ? of_tetrahedron[f] : of_triangle[f];
            record *face = &r[count++];
            *face = (record){.owner = 0};
            for (int k = 0; k < s->dimension; k++) face->key[k] = s->element[e][corner[k]];
            face->owner = 2 * e + sort_few(face->key, s->dimension);
        }
    qsort(r, (size_t)count, sizeof *r, by_key);
    return count;
}

// Return the element that represents the connected part to which element `e` belongs (union-find, path halving).
static int root_of(int *parent, int e)
{
    while (parent[e] != e) e = parent[e] = parent[parent[e]];
    return e;
}

// Join elements that share a face to parts. If three elements share a face, or two elements are on one side of a face,
// report an error.
static bool join_faces(checker *c, const record *r, int count, int *parent)
{
    const kn_simplices *s = c->s;
    const char *face = s->dimension == 3 ? "face" : "edge";
    for (int e = 0; e < s->element_count; e++) parent[e] = e;
    for (int f = 0; f + 1 < count; f++) {
        if (!same_key(&r[f], &r[f + 1])) continue;
        int a = r[f].owner / 2, b = r[f + 1].owner / 2;
        if (f + 2 < count && same_key(&r[f], &r[f + 2])) {
            int third = r[f + 2].owner / 2;
            return fault(c, third, "elements %ld, %ld and %ld share one %s, expected two at most", s->tag[a], s->tag[b],
                         s->tag[third], face);
        }
        // two elements on opposite sides of their common face have opposite parities of its nodes
        if (r[f].owner % 2 == r[f + 1].owner % 2)
            return fault(c, b, "elements %ld and %ld overlap: both lie on one side of their common %s", s->tag[a],
                         s->tag[b], face);
        parent[root_of(parent, b)] = root_of(parent, a);
    }
    return true;
}

// Check that all elements form one part.
static bool check_parts(checker *c, int *parent, int *members)
{
    const kn_simplices *s = c->s;
    int parts = 0, least = -1;
    memset(members, 0, sizeof *members * (size_t)s->element_count);
    for (int e = 0; e < s->element_count; e++) members[root_of(parent, e)]++;
    for (int e = 0; e < s->element_count; e++) {
        if (members[e] == 0) continue;
        parts++;
        if (least < 0 || members[e] <= members[least])
            least = e; // if two parts are equally small, choose the later one in the file
    }
    if (parts == 1) return true;
    return fault(
        c, least, "%d parts that share no %s, expected one object: element %ld is in the smallest, of %d element%s",
        parts, s->dimension == 3 ? "face" : "edge", s->tag[least], members[least], members[least] == 1 ? "" : "s");
}

static bool check(checker *c)
{
    const kn_simplices *s = c->s;
    // the checks that sort records use one array, one after the other
    if (!check_counts(c)) return false;
    size_t elements = (size_t)s->element_count, nodes = (size_t)s->node_count;
    size_t records = elements * (size_t)corners(s) > nodes ? elements * (size_t)corners(s) : nodes;
    record *r = malloc(records * sizeof *r);
    int *number = malloc((nodes + 2 * elements) * sizeof *number);
    c->owner = number;
    bool good = r && number ? check_numbers(c) && check_nodes(c) && check_shapes(c) && check_places(c, r) &&
                                  check_twins(c, r) && join_faces(c, r, list_faces(s, r), number + nodes) &&
                                  check_parts(c, number + nodes, number + nodes + elements)
                            : fault(c, -1, "not enough memory to check the mesh");
    free(number);
    free(r);
    return good;
}

bool kn_simplices_blame(const kn_simplices *s, int *blame, char *error, size_t size)
{
    checker c = {.s = s, .blame = -1, .error = error, .size = size};
    bool good = check(&c);
    if (blame) *blame = c.blame;
    return good;
}

bool kn_simplices_check(const kn_simplices *s, char *error, size_t size)
{
    return kn_simplices_blame(s, NULL, error, size);
}

// ---- frame and measures

// Move the mesh so that the centre of its bounding box is over the origin, and its lowest point at z = 0.
void kn_simplices_place(kn_simplices *s)
{
    double low[3], high[3];
    box_of(s, low, high);
    double origin[3] = {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]};
    for (int i = 0; i < s->node_count; i++)
        for (int c = 0; c < 3; c++) s->x_m[i][c] -= origin[c];
}

// List every edge of the mesh once, and return the number of edges.
static int list_edges(const kn_simplices *s, record *r)
{
    int count = 0;
    for (int e = 0; e < s->element_count; e++)
        for (int a = 0; a < corners(s); a++)
            for (int b = 0; b < a; b++) {
                r[count] = (record){.key = {s->element[e][a], s->element[e][b]}};
                sort_few(r[count++].key, 2);
            }
    // duplicates are neighbours after sorting
    qsort(r, (size_t)count, sizeof *r, by_key);
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (i == 0 || !same_key(&r[i], &r[kept - 1])) r[kept++] = r[i];
    return kept;
}

static bool measure_edges(const kn_simplices *s, kn_simplices_measures *m)
{
    record *r = malloc((size_t)s->element_count * (s->dimension == 3 ? 6 : 3) * sizeof *r);
    if (!r) return false;
    m->edges = list_edges(s, r);
    m->edge_min_m = INFINITY;
    for (int i = 0; i < m->edges; i++) {
        double length = sqrt(square_of_edge(s, r[i].key[0], r[i].key[1]));
        m->edge_min_m = fmin(m->edge_min_m, length);
        m->edge_max_m = fmax(m->edge_max_m, length);
        m->edge_mean_m += length / m->edges;
    }
    free(r);
    return true;
}

bool kn_simplices_measure(const kn_simplices *s, kn_simplices_measures *m)
{
    *m = (kn_simplices_measures){.quality_min = INFINITY};
    box_of(s, m->low_m, m->high_m);
    for (int e = 0; e < s->element_count; e++) {
        double quality = quality_of(s, e);
        m->volume += volume_of(s, e);
        m->quality_mean += quality / s->element_count;
        if (quality >= m->quality_min) continue;
        m->quality_min = quality;
        m->worst = e;
    }
    return measure_edges(s, m);
}

// Return the square of the area of a tetrahedron's face opposite to a corner, by Heron's formula. For a triangle,
// return the square of the length of the opposite side.
static double square_of_face(const kn_simplices *s, int e, int corner)
{
    const int *node = s->element[e];
    double side[3] = {0};
    int count = 0;
    for (int a = 0; a < corners(s); a++)
        for (int b = 0; b < a; b++)
            if (a != corner && b != corner) side[count++] = square_of_edge(s, node[a], node[b]);
    if (count == 1) return side[0];
    double sum = side[0] + side[1] + side[2], squares = side[0] * side[0] + side[1] * side[1] + side[2] * side[2];
    return fmax(0, sum * sum - 2 * squares) / 16;
}

double kn_simplices_lowest(const kn_simplices *s, int *element)
{
    double lowest = INFINITY;
    for (int e = 0; e < s->element_count; e++) {
        double face = 0;
        for (int a = 0; a < corners(s); a++) face = fmax(face, square_of_face(s, e, a));
        // the smallest height of an element is the height over its largest face
        double height = s->dimension * volume_of(s, e) / sqrt(face);
        if (height >= lowest) continue;
        lowest = height;
        *element = e;
    }
    return lowest;
}
