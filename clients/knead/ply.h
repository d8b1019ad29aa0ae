#ifndef KN_CLIENTS_PLY_H
#define KN_CLIENTS_PLY_H
// The surface of a still as a PLY file, binary little-endian: positions in m, normals, a number per vertex as `quality`
// (MeshLab's name) and its colour on the scale of the pictures. Neighbouring triangles share their vertices.
#include "clients/knead/still.h"
#include <stdio.h>

// still->value is in the measure's unit, the scale ends at top > 0. about: what the file says of itself, one line.
// False: memory is short. What cannot be written the caller learns from the file.
bool kn_ply_write(FILE *file, const kn_still *still, kn_measure what, double top, const char *about);

#endif
