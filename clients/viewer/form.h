#ifndef KN_CLIENTS_VIEWER_FORM_H
#define KN_CLIENTS_VIEWER_FORM_H
// Triangles in OpenGL's memory, ready to be drawn: an object's skin, which is given anew with every picture, and the
// unit solids that tools, arrows and the table are made of. They go with their context: nothing is deleted singly.
#include "clients/viewer/gl.h"

typedef struct kn_form {
    GLuint array, buffer, sides, values; // buffers: position and normal; distances from drawn sides; places on a scale
    int corners;
    float half, low, high; // of a solid of revolution: extent along x and y, along z
} kn_form;

kn_form kn_form_create(const kn_gl *gl); // empty

// data: [corners][6], position and unit normal.
void kn_form_corners(const kn_gl *gl, kn_form *form, int corners, const float *data, GLenum usage);

// A solid of revolution about z: profile[i] is {radius, z} from the bottom up, at most 17 of them; at most 32 segments.
// Four make a box of radius sqrt(1/2). Out of memory: nothing is drawn.
kn_form kn_form_turn(const kn_gl *gl, int count, const float (*profile)[2], int segments);

#endif
