#ifndef KN_TESTS_PHYSICS_BCC_H
#define KN_TESTS_PHYSICS_BCC_H
// A block of tetrahedra on a body-centred lattice: the corners and centres of cubes of side h. A tetrahedron has two
// neighbouring centres and a side of the face between them. At the outside a tetrahedron has one centre and half a
// face. All edges except the cubes' sides are alike, and the lattice is nearly isotropic, so no other net does
// better.
#include "core/simplices.h"
#include <stdlib.h>

typedef struct bcc {
    kn_simplices *mesh;
    const int *n; // number of cubes along x, y, z
} bcc;

static inline int bcc_corner(const bcc *b, int x, int y, int z) { return (z * (b->n[1] + 1) + y) * (b->n[0] + 1) + x; }

static inline int bcc_centre(const bcc *b, int x, int y, int z)
{
    return bcc_corner(b, 0, 0, b->n[2] + 1) + (z * b->n[1] + y) * b->n[0] + x;
}

static inline void bcc_add(kn_simplices *s, int a, int b, int c, int d)
{
    double u[3], v[3], w[3];
    for (int k = 0; k < 3; k++) {
        u[k] = s->x_m[b][k] - s->x_m[a][k];
        v[k] = s->x_m[c][k] - s->x_m[a][k];
        w[k] = s->x_m[d][k] - s->x_m[a][k];
    }
    double turn =
        u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
    int *e = s->element[s->element_count];
    s->tag[s->element_count] = s->element_count + 1;
    s->element_count++;
    e[0] = a, e[1] = turn > 0 ? b : c, e[2] = turn > 0 ? c : b, e[3] = d;
}

// Add the tetrahedra on the faces of cube (x, y, z) across axis a: the far face with its neighbour, both end faces at
// the outside.
static inline void bcc_face(const bcc *b, const int at[3], int a, int far)
{
    int u = (a + 1) % 3, v = (a + 2) % 3, corner[4], other[3] = {at[0], at[1], at[2]};
    for (int i = 0; i < 4; i++) {
        int c[3] = {at[0], at[1], at[2]};
        c[a] += far;
        c[u] += i == 1 || i == 2;
        c[v] += i >= 2;
        corner[i] = bcc_corner(b, c[0], c[1], c[2]);
    }
    int centre = bcc_centre(b, at[0], at[1], at[2]);
    other[a] += far ? 1 : -1;
    if (other[a] < 0 || other[a] == b->n[a]) {
        int turn = (at[0] + at[1] + at[2]) & 1; // diagonals alternate at the outside
        bcc_add(b->mesh, centre, corner[turn], corner[turn + 1], corner[turn + 2]);
        bcc_add(b->mesh, centre, corner[turn], corner[turn + 2], corner[(turn + 3) % 4]);
    } else if (far) {
        for (int i = 0; i < 4; i++)
            bcc_add(b->mesh, centre, bcc_centre(b, other[0], other[1], other[2]), corner[i], corner[(i + 1) % 4]);
    }
}

// Make a block centred over the origin, with its base at z = 0. The caller frees it.
static inline kn_simplices *bcc_block(const int n[3], double h)
{
    int cubes = n[0] * n[1] * n[2], corners = (n[0] + 1) * (n[1] + 1) * (n[2] + 1);
    bcc b = {kn_simplices_create(3, corners + cubes, 12 * cubes + 4 * corners), n};
    if (!b.mesh) abort();
    b.mesh->element_count = 0;
    for (int i = 0, half = 0; half < 2; half++)
        for (int z = 0; z < n[2] + 1 - half; z++)
            for (int y = 0; y < n[1] + 1 - half; y++)
                for (int x = 0; x < n[0] + 1 - half; x++, i++) {
                    b.mesh->x_m[i][0] = (x + 0.5 * half - 0.5 * n[0]) * h;
                    b.mesh->x_m[i][1] = (y + 0.5 * half - 0.5 * n[1]) * h;
                    b.mesh->x_m[i][2] = (z + 0.5 * half) * h;
                }
    for (int z = 0; z < n[2]; z++)
        for (int y = 0; y < n[1]; y++)
            for (int x = 0; x < n[0]; x++)
                for (int a = 0; a < 3; a++)
                    for (int far = 0; far < 2; far++) bcc_face(&b, (const int[3]){x, y, z}, a, far);
    return b.mesh;
}

#endif
