#ifndef KN_CORE_SCENE_SHELL_H
#define KN_CORE_SCENE_SHELL_H
// The closed surface of a solid as triangles, from an OBJ or STL file (text or binary): what `knead mesh` fills with
// tetrahedra, and a tool's shape (core/field.h). Corners in one place become one vertex, polygons become fans, triangles without area are dropped.
//
// It must hold water: every edge belongs to two triangles that see it in opposite directions, and there is one such
// surface, since what lies between two of them is a matter of opinion. What is wrong is said with the place of a
// triangle in the file, `file:line:col: what is wrong, what was expected`; triangles are counted from 1.
#include <stdbool.h>
#include <stddef.h>

typedef struct kn_shell {
    int vertex_count;
    double (*x)[3]; // in the file's unit
    int triangle_count;
    int (*triangle)[3];
    double volume; // inside; unit cubed
    double extent; // longest side of the box around it
} kn_shell;

#define KN_SHELL_TRIANGLES_MAX (1 << 20)

// Whether the name ends in .obj or .stl, in either case.
bool kn_shell_named(const char *path);

// NULL and one line in error when anything is wrong. The name says which format it is.
kn_shell *kn_shell_read(const char *name, const void *bytes, size_t size, char *error, size_t error_size);
kn_shell *kn_shell_load(const char *path, char *error, size_t error_size);
void kn_shell_destroy(kn_shell *shell); // NULL is fine

// For gmsh and for tetgen. False when the file cannot be written.
bool kn_shell_write_stl(const kn_shell *shell, const char *path);
bool kn_shell_write_off(const kn_shell *shell, const char *path);

#endif
