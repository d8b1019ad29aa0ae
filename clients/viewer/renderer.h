#ifndef KN_CLIENTS_VIEWER_RENDERER_H
#define KN_CLIENTS_VIEWER_RENDERER_H
// Renderer of an object, its probes and a table. The surface of the object is lit from the left of the viewer, casts a
// shadow, and shows the lines of the lattice. An arrow shows the force on a probe. The table has squares of 1 cm, or of
// another power of ten that suits the size of the object. The surface may be coloured by values (label.h), and the
// lattice may be shown as bare lines.
//
//     kn_renderer_open -> kn_renderer_mesh -> kn_renderer_draw for each picture -> kn_renderer_close
//
// The same input gives the same bytes on the same Mesa. The frame is the scene frame of proto/REFERENCE.md, in metres,
// z up. Use from one thread only. kn_renderer_open and kn_renderer_mesh allocate everything, and kn_renderer_draw
// allocates nothing. Exceptions are Mesa itself and the first picture of a tool that is a mesh.
#include "clients/viewer/camera.h"
#include <stddef.h>
#include <stdint.h>

typedef struct kn_renderer kn_renderer;

// Open a renderer. `samples`: number of samples per pixel for the solids (object, tools, arrows); 4 samples smooth the
// outlines, and 1 sample halves the drawing time. On failure (for example a wrong size or a missing library, see
// offscreen.h) return NULL and put one sentence in error.
kn_renderer *kn_renderer_open(int width, int height, int samples, char *error, size_t error_size);

// Set the object's topology and its rest shape. The rest shape determines the creases (shading.h) and the camera's
// position, so the camera does not move while the object is deformed. The function may be called again with another
// mesh. Return false if the mesh is invalid (shading.h) or memory is short; the old mesh is then gone.
bool kn_renderer_mesh(kn_renderer *renderer, int vertex_count, const float (*rest)[3], int triangle_count,
                      const int (*triangle)[3]);

// Draw a picture and read it back: rgba [height][width][4], top row first. A mesh must have been set. Triangles with a
// vertex that is not finite are left out.
void kn_renderer_draw(kn_renderer *renderer, const kn_view_scene *scene, uint8_t *rgba);

// Return the length of the bar on the table, m. Set `at` to the middle of the bar's edge that is nearer to the viewer,
// as a position in the last picture, pixels from the upper left corner.
double kn_renderer_bar(const kn_renderer *renderer, float at[2]);

void kn_renderer_close(kn_renderer *renderer); // `renderer` may be NULL

#endif
