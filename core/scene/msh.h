#ifndef KN_CORE_SCENE_MSH_H
#define KN_CORE_SCENE_MSH_H
// Reader of Gmsh meshes: .msh 2.2 and 4.1, ASCII and binary.
// https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format
//
// Four-node tetrahedra make an object in three dimensions. The points, lines and surface triangles that Gmsh saves with
// them are left out. Three-node triangles alone make an object in two dimensions. They must lie in a plane z = const,
// whose y becomes the scene's z, or in a plane y = const. Triangles that are seen from behind are reversed together.
// For any other kind of element, the file is refused and the error names the kind. Nodes without an element (centres of
// arcs) are left out. The result passes kn_simplices_check.
//
// Every error is one line, `file:line:col: what is wrong, what was expected`, or `file:1:1: byte N: ...` in a binary
// file. Memory and time are bounded by the size of the file, whatever counts the file declares.
#include "core/simplices.h"
#include <stdint.h>

typedef struct kn_msh_facts {
    const char *format; // format of the file: "2.2 ASCII", "4.1 binary", ...
    int left_out;       // number of elements that were left out because their dimension is lower
    int loose;          // number of nodes that were left out because they belong to no element
    uint64_t hash;      // hash of the file's contents (kn_hash_bytes)
} kn_msh_facts;

// Read a mesh from bytes. `units_per_m`: file units per metre, 1000 for millimetres. Coordinates are divided by
// units_per_m, so that 5 mm and 0.005 m give the same bits. facts may be NULL. Return NULL with one line in error if
// anything is wrong.
kn_simplices *kn_msh_read(const char *name, const void *bytes, size_t size, double units_per_m, kn_msh_facts *facts,
                          char *error, size_t error_size);
// Read a mesh from a file of at most 256 MiB.
kn_simplices *kn_msh_load(const char *path, double units_per_m, kn_msh_facts *facts, char *error, size_t error_size);

#endif
