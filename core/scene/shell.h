#ifndef KN_CORE_SCENE_SHELL_H
#define KN_CORE_SCENE_SHELL_H
// The closed surface of a solid as triangles, from an OBJ or STL file (text or binary). `knead mesh` fills it with
// tetrahedra, and a tool may have it as its shape (core/field.h). Corners in one place become one vertex. Polygons
// become fans of triangles. Triangles in which two corners are one vertex are dropped.
//
// The surface must be watertight: every edge belongs to two triangles, which run along it in opposite directions. There
// must be only one closed surface, because it is unclear whether the space between two of them is solid. An error names
// the place of a triangle in the file, `file:line:col: what is wrong, what was expected`. Triangles count from 1.
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_shell {
    int vertex_count;
    double (*x)[3]; // [vertex_count] positions, in the file's unit of length
    int triangle_count;
    int (*triangle)[3]; // [triangle_count] vertices of each triangle
    double volume;      // enclosed volume, cube of the file's unit
    double extent;      // longest side of the bounding box, in the file's unit
} kn_shell;

#define KN_SHELL_TRIANGLES_MAX (1 << 20) // largest number of triangles in a file

// Return true if a file name ends in .obj or .stl, in upper or lower case.
bool kn_shell_named(const char *path);

// Read a surface from bytes or from a file. The name's ending tells the format. Return NULL with one line in error if
// anything is wrong.
kn_shell *kn_shell_read(const char *name, const void *bytes, size_t size, char *error, size_t error_size);
kn_shell *kn_shell_load(const char *path, char *error, size_t error_size);
void kn_shell_destroy(kn_shell *shell); // does nothing if `shell` is NULL

// Write a surface for gmsh (STL) or for tetgen (OFF). Return false if the file cannot be written.
bool kn_shell_write_stl(const kn_shell *shell, const char *path);
bool kn_shell_write_off(const kn_shell *shell, const char *path);

#endif
