#ifndef KN_CORE_SCENE_MESH_FILE_H
#define KN_CORE_SCENE_MESH_FILE_H
// Readers of mesh files: Gmsh meshes (msh.c), closed surfaces from OBJ and STL files (shell.c), and the words and
// numbers of which these files consist (words.c). The functions allocate memory and read files: not for a real-time
// loop.
#include "core/simplices.h"
#include <stdint.h>

// --- Gmsh meshes ----------------------------------------------------------------------------------------------------

// Reader of Gmsh meshes: .msh 2.0 to 2.2, and 4.1, ASCII and binary.
// https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format
//
// Four-node tetrahedra make an object in three dimensions. The points, lines and surface triangles that Gmsh saves with
// them are left out. Three-node triangles alone make an object in two dimensions. They must lie in a plane z = const,
// whose y becomes the scene's z, or in a plane y = const. If most triangles are seen from behind, all triangles are
// reversed. A file with any other kind of element is refused, and the error names the kind. Nodes that belong to no
// element (such as centres of arcs) are left out. The result passes kn_simplices_check.
//
// Every error is one line, `file:line:col: what is wrong, what was expected`, or `file:1:1: byte N: ...` in a binary
// file. The size of the file bounds memory and time, even if the file declares wrong counts.

typedef struct kn_msh_facts {
    const char *format; // format of the file: "2.2 ASCII", "4.1 binary", ...
    int left_out;       // number of elements left out because their dimension is lower than that of the mesh
    int loose;          // number of nodes left out because they belong to no element of the mesh
    uint64_t hash;      // hash of the file's contents (kn_hash_bytes)
} kn_msh_facts;

// Read a mesh from the bytes of a file. `units_per_m`: units of the file per metre, 1000 for millimetres. Coordinates
// are divided by units_per_m, so that 5 mm and 0.005 m give the same bits. `facts` may be NULL. Return the mesh, which
// the caller destroys. If anything is wrong, return NULL and write one line into `error`, a buffer of error_size bytes.
kn_simplices *kn_msh_read(const char *name, const void *bytes, size_t size, double units_per_m, kn_msh_facts *facts,
                          char *error, size_t error_size);
// Read a mesh from a file of at most 256 MiB. Arguments and result are those of kn_msh_read.
kn_simplices *kn_msh_load(const char *path, double units_per_m, kn_msh_facts *facts, char *error, size_t error_size);

// --- closed surfaces ------------------------------------------------------------------------------------------------

// The closed surface of a solid as triangles, from an OBJ or STL file (text or binary). `knead mesh` fills the surface
// with tetrahedra, and a tool may have a surface as its shape (core/field.h). Corners at the same place, up to 5e-6 of
// the largest coordinate, become one vertex. Polygons become fans of triangles. Triangles of which two corners are the
// same vertex are dropped.
//
// The surface must be watertight: every edge belongs to two triangles, which run along the edge in opposite directions.
// There must be only one closed surface, because the space between two surfaces might be solid or empty. An error names
// the place of a triangle in the file, `file:line:col: what is wrong, what was expected`. Messages count triangles
// from 1.

typedef struct kn_shell {
    int vertex_count;
    double (*x)[3]; // [vertex_count] positions, in the file's unit of length
    int triangle_count;
    int (*triangle)[3]; // [triangle_count] vertices of each triangle
    double volume;      // enclosed volume, in the cube of the file's unit
    double extent;      // longest side of the bounding box, in the file's unit
    int welded;         // number of corners that were moved to a vertex, because rounding had set them apart
    double gap;         // farthest of them, in the file's unit
} kn_shell;

#define KN_SHELL_TRIANGLES_MAX (1 << 20) // largest number of triangles in a file

// Return true if a file name ends in .obj or .stl, in upper or lower case.
bool kn_shell_named(const char *path);

// Read a surface from the bytes of a file, or from a file. The ending of the name tells the format. Return the surface,
// which the caller destroys. If anything is wrong, return NULL and write one line into `error`, a buffer of error_size
// bytes.
kn_shell *kn_shell_read(const char *name, const void *bytes, size_t size, char *error, size_t error_size);
kn_shell *kn_shell_load(const char *path, char *error, size_t error_size);
void kn_shell_destroy(kn_shell *shell); // does nothing if `shell` is NULL

// Write a surface to a file for gmsh (STL) or for tetgen (OFF). Return false if the file cannot be written.
bool kn_shell_write_stl(const kn_shell *shell, const char *path);
bool kn_shell_write_off(const kn_shell *shell, const char *path);

// --- words and numbers ----------------------------------------------------------------------------------------------

// A reader of the words and numbers of a mesh file, one after the other. The calls are the same for text and for binary
// files. If the expected word or number is missing or wrong, a function returns false and writes one line into `error`.

#define KN_WORD_MAX 64 // size of the buffer for a word, NUL included [bytes]; longer words are cut

typedef struct kn_words {
    const char *name;           // name of the file, for error messages
    const unsigned char *bytes; // contents of the file, not owned
    size_t size, at;            // size: number of bytes in the file; at: position of the next byte to read
    size_t begun;               // position where the word or number that was read last begins
    const char *section;        // section that is being read, e.g. "$Nodes", for error messages
    bool binary;                // numbers of the file are binary, little-endian; false: numbers are text
    char *error;
    size_t error_size;
} kn_words;

typedef enum kn_width { KN_WIDTH_INT = 4, KN_WIDTH_LONG = 8 } kn_width; // bytes of an integer in a binary file

#define KN_WORDS_MAX_BYTES (256 << 20) // largest size of a file

// Return the bytes of a file or pipe; the caller frees them. If the file cannot be read, return NULL and write one line
// into `error`.
unsigned char *kn_words_load(const char *path, size_t *size, char *error, size_t error_size);

// Write an error about byte number `at` of the file: "name:line:col: MESSAGE" for a text file, "name:1:1: byte AT:
// MESSAGE" for a binary file. Always return false.
__attribute__((format(printf, 3, 4))) bool kn_words_complain(kn_words *w, size_t at, const char *format, ...);

// Read the next word between white space into `text`, cut if it is too long. Return the length of the uncut word, 0 at
// the end of the file.
size_t kn_words_next(kn_words *w, char text[KN_WORD_MAX]);

// Read the next number. An integer must be from `least` to `most`; `width` is its size in a binary file. `what`:
// description of the number for error messages, e.g. "the number of nodes".
bool kn_words_integer(kn_words *w, kn_width width, long least, long most, long *value, const char *what);
bool kn_words_real(kn_words *w, double *value); // the number must be finite

// Check that the rest of the file is long enough for `count` items of at least `each` bytes. Call before memory for the
// items is allocated. `what`: name of the items for error messages.
bool kn_words_room(kn_words *w, long count, size_t each, const char *what);

// Skip the line end that comes before binary data. In a text file, do nothing.
bool kn_words_line_end(kn_words *w);
// Read the word that ends the present section, e.g. "$EndNodes".
bool kn_words_section_end(kn_words *w);

#endif
