#ifndef KN_CLIENTS_MESHER_H
#define KN_CLIENTS_MESHER_H
// Fills a closed surface with tetrahedra by an external program. Gmsh (GPL) and TetGen (AGPL) are run, never linked.
// They run in a folder of their own, which is removed afterwards, also after Ctrl-C.
//
//   gmsh     splits the surface at edges sharper than 40 degrees, meshes its pieces anew, then the inside: edges have
//            the wanted length, whatever the triangles were
//   tetgen   keeps the surface and adds points if quality or size need them, so it is never coarser than the triangles
#include "core/scene/mesh_file.h"
#include "core/simplices.h"

typedef enum kn_mesher { KN_MESHER_GMSH, KN_MESHER_TETGEN } kn_mesher;

// Fill a surface. `size` is the desired edge length, in the length unit of the surface. `units_per_m` is the number of
// these units in a metre. The mesh is in metres and has passed kn_simplices_check. Return an exit code KN_EXIT_*. If it
// is not KN_EXIT_OK, one line in error gives the reason.
int kn_mesher_run(kn_mesher mesher, const kn_shell *shell, double size, double units_per_m, kn_simplices **mesh,
                  char *error, size_t error_size);

#endif
