#ifndef KN_CLIENTS_REACH_H
#define KN_CLIENTS_REACH_H
// What a pointer in a picture means for a tool over an object: where it hangs, where it would touch, how deep it may
// go.
#include "clients/knead/dent.h"
#include "clients/knead/pointer.h"
#include "clients/viewer/camera.h"

typedef struct kn_reach {
    const kn_model_def *def; // of the scene; borrowed, as the tool
    const kn_probe_def *tool;
    uint8_t *top;
    int vertices;       // of the scene's mesh
    double extent_m[3]; // of the undeformed object
    kn_camera camera;   // of the picture
} kn_reach;

// False: memory is short.
bool kn_reach_open(kn_reach *reach, const kn_model_def *def, const kn_probe_def *tool, const kn_camera_view *view);
void kn_reach_look(kn_reach *reach, const kn_camera_view *view); // from elsewhere
void kn_reach_close(kn_reach *reach);

bool kn_reach_fits(const kn_reach *reach, const kn_mesh *mesh); // false: not yet, or another scene's
// With a mesh that fits:
void kn_reach_hover(const kn_reach *reach, const kn_mesh *mesh, kn_pointer_wish *wish); // fills hover_z_m
void kn_reach_aim(const kn_reach *reach, double u, double v, kn_pointer_wish *wish);    // fills at_m
bool kn_reach_touch(const kn_reach *reach, const kn_mesh *mesh,
                    kn_pointer_wish *wish); // fills touch, flush; false: beside
double kn_reach_deepest(const kn_reach *reach,
                        const kn_pointer_wish *wish); // m below where it touches, or would on a whole top

#endif
