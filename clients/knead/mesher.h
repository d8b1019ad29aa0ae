#ifndef KN_CLIENTS_MESHER_H
#define KN_CLIENTS_MESHER_H
// Fills a closed surface with tetrahedra by a program that is good at it. Gmsh (GPL) and TetGen (AGPL) are run, never
// linked, in a folder of their own that is removed again, also after Ctrl-C.
//
//   gmsh     splits the surface at edges sharper than 40 degrees and meshes its pieces anew, then what is inside: edges
//            as asked for, whatever the triangles were
//   tetgen   keeps the surface and adds points where quality or size want them: never coarser than the triangles
#include "core/scene/shell.h"
#include "core/simplices.h"

typedef enum kn_mesher { KN_MESHER_GMSH, KN_MESHER_TETGEN } kn_mesher;

// size: wanted length of an edge in the surface's unit, of which units_per_m make a metre; the mesh is in metres and
// has passed kn_simplices_check. Returns one of KN_EXIT_*; one line in error unless it is OK.
int kn_mesher_run(kn_mesher mesher, const kn_shell *shell, double size, double units_per_m, kn_simplices **mesh,
                  char *error, size_t error_size);

#endif
