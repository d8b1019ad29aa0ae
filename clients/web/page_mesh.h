#ifndef KN_CLIENTS_PAGE_MESH_H
#define KN_CLIENTS_PAGE_MESH_H
// The object for pages that draw it themselves: its surface, which a page gets once, and its present shape, which a
// page gets with every mesh of kneadd. DEVELOPING.md of this folder has the layout of both blocks. All functions are
// called by the main thread.
//
//     new mesh -> kn_page_mesh_take -> kn_page_mesh_write_surface, kn_page_mesh_write_shape for each page
#include "clients/picture/object_still.h"
#include "clients/viewer/shading.h"
#include "clients/web/gateway.h"

typedef struct kn_page_mesh {
    kn_live_server *live; // set by the caller
    int64_t surface;      // number of the present surface, larger for each new one; 0: none yet
    int64_t shape;        // number of the newest shape, larger for each mesh of kneadd
    // The fields below are used by page_mesh.c only. shaded: NULL if there is no surface. valued: number of the shape
    // to which `value` belongs, for each measure.
    kn_object_still still;
    kn_shaded_mesh *shaded;
    int64_t mesh_id, valued[KN_MEASURES];
    int64_t refused; // id of a mesh that does not belong to the last received scene
    double top[KN_MEASURES];
    uint8_t *value[KN_MEASURES];
} kn_page_mesh;

// Take the newest mesh of `live`. Return false, and keep the last one, if it does not belong to the last received
// scene, or if memory is short.
bool kn_page_mesh_take(kn_page_mesh *mesh);
void kn_page_mesh_forget(kn_page_mesh *mesh); // compare the next mesh with the scene, because another scene has come

// Write the surface or the present shape to `bytes`, and return its size. `bytes` may be NULL, to get the size only. If
// there is no surface, the size is 0. largest: size of both together with any measure. measure: measure that colours
// the vertices, -1: none.
size_t kn_page_mesh_largest(const kn_page_mesh *mesh);
size_t kn_page_mesh_write_surface(const kn_page_mesh *mesh, uint8_t *bytes);
size_t kn_page_mesh_write_shape(kn_page_mesh *mesh, int measure, uint8_t *bytes);

// Return the value at the top of the colour scale, in the unit of the measure; 0 if the mesh messages do not contain
// the measure.
double kn_page_mesh_top(kn_page_mesh *mesh, int measure);
// Return the value for the top of a colour scale. `top`: the present one, 0: none; most: largest value of the measure.
// The result follows the largest value with hysteresis, so that the colours do not flicker.
double kn_page_mesh_next_top(double top, int measure, double most);

// Return the shape at rest (box), the colour, and the tools as JSON, for `about`; NULL if there is no surface.
json_t *kn_page_mesh_describe(const kn_page_mesh *mesh);
// Get the triangles of a tool that is a mesh: three corners for each, position and unit normal, f32. Return false if
// tool number `index` of the scene is no mesh, or if memory is short.
bool kn_page_mesh_tool(const kn_page_mesh *mesh, int index, kn_web_file *file);
void kn_page_mesh_close(kn_page_mesh *mesh);

#endif
