#ifndef KN_CORE_SCENE_MSH_H
#define KN_CORE_SCENE_MSH_H
// Meshes as Gmsh writes them: .msh 2.2 and 4.1, ASCII and binary, https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format
//
// Four-node tetrahedra make an object in three dimensions; the points, lines and surface triangles that Gmsh saves
// beside them are left out. Three-node triangles alone make one in two: all in a plane z = const, whose y becomes our z,
// or in a plane y = const; seen from behind they are turned round together. Other elements are refused by name.
// Nodes that no element has (centres of arcs) are left out. What is left passes kn_simplices_check.
//
// Every complaint is one line, `file:line:col: what is wrong, what was expected`; in a binary file it is
// `file:1:1: byte N: ...`. Memory and time are bounded by the size of the file, whatever counts it declares.
#include "core/simplices.h"
#include <stdint.h>

typedef struct kn_msh_facts {
    const char *format; // "2.2 ASCII", "4.1 binary", ...
    int left_out;       // elements of lower dimension
    int loose;          // nodes without element
    uint64_t hash;      // kn_hash_bytes of the file
} kn_msh_facts;

// Coordinates are in units of which units_per_m make a metre: 1000 for millimetres. They are divided by it, so that
// 5 mm and 0.005 m are the same bits. facts may be NULL. NULL and one line in error when anything is wrong.
kn_simplices *kn_msh_read(const char *name, const void *bytes, size_t size, double units_per_m, kn_msh_facts *facts,
                          char *error, size_t error_size);
// The same of a file of at most 256 MiB.
kn_simplices *kn_msh_load(const char *path, double units_per_m, kn_msh_facts *facts, char *error, size_t error_size);

#endif
