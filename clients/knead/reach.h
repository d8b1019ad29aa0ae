#ifndef KN_CLIENTS_REACH_H
#define KN_CLIENTS_REACH_H
// Translation of a pointer's place in a picture into a wish for a tool (pointer.h): the place and height at which the
// tool hovers, the height at which it would touch the object, and the largest depth of a press.
#include "clients/knead/dent.h"
#include "clients/knead/pointer.h"
#include "clients/viewer/camera.h"

typedef struct kn_reach {
    const kn_model_def *def; // model of the scene; def and tool must outlive the reach
    const kn_probe_def *tool;
    uint8_t *top;       // marks the vertices of the top face, see kn_dent_top
    int vertices;       // number of vertices of the scene's mesh
    double extent_m[3]; // size of the undeformed object along x, y, z
    kn_camera camera;   // camera that draws the picture in which the user points
} kn_reach;

// Prepare a reach for one tool and the camera of one picture. Return false when memory is short.
bool kn_reach_open(kn_reach *reach, const kn_model_def *def, const kn_probe_def *tool, const kn_camera_view *view);
// Change the camera of the picture in which the user points.
void kn_reach_look(kn_reach *reach, const kn_camera_view *view);
void kn_reach_close(kn_reach *reach);

// Return true if the mesh is complete and belongs to the reach's scene. The functions below may only be called with
// such a mesh.
bool kn_reach_fits(const kn_reach *reach, const kn_mesh *mesh);
// Set wish->hover_z_m above the highest point of the mesh.
void kn_reach_hover(const kn_reach *reach, const kn_mesh *mesh, kn_pointer_wish *wish);
// Set wish->at_m to the place in the plane of the object's top that is seen at (u, v) in the picture. If the plane is
// not seen at (u, v), leave the wish unchanged.
void kn_reach_aim(const kn_reach *reach, double u, double v, kn_pointer_wish *wish);
// Set wish->touch_z_m and wish->flush_z_m at wish->at_m. Return false if no part of the object is under the tool.
bool kn_reach_touch(const kn_reach *reach, const kn_mesh *mesh, kn_pointer_wish *wish);
// Return the largest depth of a press below wish->touch_z_m, m. While nothing is pressed, return the largest depth
// below the top of the undeformed object.
double kn_reach_deepest(const kn_reach *reach, const kn_pointer_wish *wish);

#endif
