#ifndef KN_CORE_SIMPLICES_H
#define KN_CORE_SIMPLICES_H
// An object that is not a block: nodes and the tetrahedra between them, or triangles in two dimensions. The data are
// independent of any file format: scene/mesh_file.h reads them from a file, and a program that links libknead may fill
// them in itself. No function here is for the tick.
//
//          3                        2
//         /|\                      / \        positive: node 3 sees 0, 1, 2 turn counter-clockwise,
//        / | \                    /   \       det(x1 - x0, x2 - x0, x3 - x0) > 0; a triangle turns from x to z.
//       0--|--2                  0-----1
//        \ | /                                Gmsh's order of nodes.
//          1
//
// Quality of an element, 1 if it is regular and 0 if it has no volume (mean ratio; Liu and Joe, BIT 34, 1994):
//     12 (3 V)^(2/3) / sum of the six L^2,  in two dimensions 4 sqrt(3) A / sum of the three L^2
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_simplices {
    int dimension; // 2: triangles in the x-z plane (y = 0), 3: tetrahedra
    int node_count;
    double (*x_m)[3]; // [node_count] positions of the nodes
    int element_count;
    int (*element)[4]; // [element_count] nodes of each element, counted from 0; the fourth of a triangle is -1
    long *tag;         // [element_count] number of the element in its file, for error messages
} kn_simplices;

// Allocate simplices with room for node_count nodes and element_count elements, all 0. Return NULL if memory is short.
// kn_simplices_destroy frees the struct with its arrays, and does nothing if `s` is NULL.
kn_simplices *kn_simplices_create(int dimension, int node_count, int element_count);
void kn_simplices_destroy(kn_simplices *s);

#define KN_SIMPLICES_NODES_MAX (1 << 18) // largest number of nodes: forty times as many as any processor steps in 1 ms
#define KN_SIMPLICES_ELEMENTS_MAX (1 << 21)
// Least quality of an element. An element of lower quality is degenerate. Compared with a regular element of the same
// mean square edge length, such a tetrahedron has less than a thousandth of the volume, and such a triangle less than a
// hundredth of the area.
#define KN_SIMPLICES_QUALITY_MIN 0.01
// Least mean quality of a mesh. `knead stability`, family aspect, has shown that a lattice of lower mean quality
// responds too late in some directions.
#define KN_SIMPLICES_QUALITY_MEAN 0.25
// Two nodes closer to each other than KN_SIMPLICES_COINCIDENT times the bounding box's diagonal count as one node that
// was written twice.
#define KN_SIMPLICES_COINCIDENT 1e-9
#define KN_SIMPLICES_EXTENT_MAX_M 10.0 // largest extent; in a larger mesh the unit was probably forgotten

// Check whether a lattice can be made of the mesh. If not, return false and store in error[size] one clause that names
// the elements by their tags. The clause describes the first of these problems:
//     counts beyond their limits; node numbers that do not exist; coordinates that are not finite; an inverted or
//     degenerate element; nodes without an element; different nodes in one place; an element given twice; a face
//     (2-D: an edge) with three elements, or with both of its elements on one side; parts that share no face (a shared
//     node or edge alone is a hinge)
// Takes time n log n. If `blame` is not NULL, kn_simplices_blame also stores in *blame the index of an element that the
// clause names, or -1.
bool kn_simplices_check(const kn_simplices *s, char *error, size_t size);
bool kn_simplices_blame(const kn_simplices *s, int *blame, char *error, size_t size);

// Move the mesh into the scene's frame: lowest point at z = 0, bounding box centred over the origin.
void kn_simplices_place(kn_simplices *s);

typedef struct kn_simplices_measures {
    int edges;     // number of edges
    double volume; // volume, m^3; in two dimensions the area of the triangles, m^2
    double edge_min_m, edge_mean_m, edge_max_m;
    double quality_min, quality_mean;
    int worst;                  // index of the element that has the quality quality_min
    double low_m[3], high_m[3]; // corners of the box around the mesh
} kn_simplices_measures;

// Measure a mesh that has passed the check. Return false if memory is short.
bool kn_simplices_measure(const kn_simplices *s, kn_simplices_measures *m);

// Return the height of the flattest element, m, and store the index of this element. The height of a tetrahedron is
// measured from its largest face, the height of a triangle from its longest side.
double kn_simplices_lowest(const kn_simplices *s, int *element);

#endif
