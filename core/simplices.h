#ifndef KN_CORE_SIMPLICES_H
#define KN_CORE_SIMPLICES_H
// An object that is not a block: nodes, and the tetrahedra (or, in two dimensions, triangles) between them. Plain data
// that knows no file; scene/msh.h reads it, and a program that links libknead may fill it itself.
//
//          3                        2
//         /|\                      / \        positive: node 3 sees 0, 1, 2 turn counter-clockwise,
//        / | \                    /   \       det(x1 - x0, x2 - x0, x3 - x0) > 0; a triangle turns from x to z.
//       0--|--2                  0-----1
//        \ | /                                Gmsh's order of nodes.
//          1
//
// Quality of an element, 1 for the regular one and 0 for one without volume (mean ratio; Liu and Joe, BIT 34, 1994):
//     12 (3 V)^(2/3) / sum of the six L^2,  in two dimensions 4 sqrt(3) A / sum of the three L^2
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_simplices {
    int dimension; // 2: triangles in the x-z plane (y = 0), 3: tetrahedra
    int node_count;
    double (*x_m)[3];
    int element_count;
    int (*element)[4]; // node numbers from 0; a triangle's 4th is -1
    long *tag;         // [element_count] number of the element in its file, for complaints
} kn_simplices;

// Room for that many of each, zeroed; NULL when memory is short. destroy frees it with its arrays, NULL is fine.
kn_simplices *kn_simplices_create(int dimension, int node_count, int element_count);
void kn_simplices_destroy(kn_simplices *s);

#define KN_SIMPLICES_NODES_MAX (1 << 18) // forty times what any processor steps in a millisecond
#define KN_SIMPLICES_ELEMENTS_MAX (1 << 21)
#define KN_SIMPLICES_QUALITY_MIN 0.01  // below it degenerate: a thousandth of the volume that its edges could hold
#define KN_SIMPLICES_QUALITY_MEAN 0.25 // below it a net answers some directions too late, see knead stability: aspect
#define KN_SIMPLICES_COINCIDENT 1e-9   // of the diagonal of the box: nodes that close are one node written twice
#define KN_SIMPLICES_EXTENT_MAX_M 10.0 // a larger object is one whose unit was forgotten

// Whether a lattice can be made of it. False, and one clause that names element numbers, for the first of: counts out
// of their limits, node numbers that do not exist, coordinates that are no numbers, an element inverted or degenerate,
// nodes that no element has, different nodes in one place, the same element twice, a face (2-D: an edge) of three
// elements or with both of its elements on one side, parts that share no face (a shared node or edge alone is a hinge).
// Time n log n. blame, when not NULL, becomes the index of an element that the clause names, -1 if it names none.
bool kn_simplices_check(const kn_simplices *s, char *error, size_t size);
bool kn_simplices_blame(const kn_simplices *s, int *blame, char *error, size_t size);

// Moves it into the scene's frame: lowest point at z = 0, box centred over the origin.
void kn_simplices_place(kn_simplices *s);

typedef struct kn_simplices_measures {
    int edges;
    double volume; // m^3; area of the triangles, m^2, in two dimensions
    double edge_min_m, edge_mean_m, edge_max_m;
    double quality_min, quality_mean;
    int worst;                  // element of quality_min
    double low_m[3], high_m[3]; // corners of the box around it
} kn_simplices_measures;

// Of a mesh that passed the check. False when memory is short.
bool kn_simplices_measure(const kn_simplices *s, kn_simplices_measures *m);

// Least height of an element, m, over its largest face (a triangle's over its longest side), and which element that is.
double kn_simplices_lowest(const kn_simplices *s, int *element);

#endif
