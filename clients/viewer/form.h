#ifndef KN_CLIENTS_VIEWER_FORM_H
#define KN_CLIENTS_VIEWER_FORM_H
// Form: triangles in OpenGL's memory, ready to be drawn. A form is an object's skin, which is uploaded for every
// picture, or a unit solid. Tools, arrows and the table are made of unit solids. Forms are freed with their OpenGL
// context, and never deleted singly.
#include "clients/viewer/gl.h"

typedef struct kn_form {
    // OpenGL names: `array`: vertex array; `buffer`: positions and normals; `sides`: distances of each corner from the
    // triangle sides that are drawn as lines; `values`: values on the colour scale.
    GLuint array, buffer, sides, values;
    int corners;
    float half, low, high; // extent of a solid of revolution: -half .. half along x and y, low .. high along z
} kn_form;

kn_form kn_form_create(const kn_gl *gl); // create a form without triangles

// Upload triangles. `data`: [corners][6], position and unit normal.
void kn_form_corners(const kn_gl *gl, kn_form *form, int corners, const float *data, GLenum usage);

// Create a solid of revolution about z. profile[i] is {radius, z} from the bottom up, with at most 17 entries. There
// are at most 32 segments, and four segments make a box of radius sqrt(1/2). If memory is short, the form stays empty.
kn_form kn_form_turn(const kn_gl *gl, int count, const float (*profile)[2], int segments);

#endif
