#ifndef KN_CLIENTS_PLY_H
#define KN_CLIENTS_PLY_H
// Writer of PLY files, binary little-endian. A file holds the surface of a still (still.h): position in m, normal,
// value of a measure and colour of each vertex. The value is named `quality`, as in MeshLab. The vertices have the same
// colours as in the pictures of `knead view`. Neighbouring triangles share vertices.
#include "clients/knead/still.h"
#include <stdio.h>

// Write the surface of `still` to `file`. what: the measure whose values are in still->value. top: value at the end of
// the colour scale, > 0, in the unit of the measure. about: one line of text for the header of the file. Return false
// when memory is short. Write errors are not checked here. The caller checks the stream.
bool kn_ply_write(FILE *file, const kn_still *still, kn_measure what, double top, const char *about);

#endif
