#ifndef KN_CLIENTS_VIEWER_OFFSCREEN_BACKEND_H
#define KN_CLIENTS_VIEWER_OFFSCREEN_BACKEND_H
// Source of OpenGL contexts for offscreen.c. A context belongs to the back end that created it. All drawing goes into
// the frame buffers of gl.h, so a back end has no surface.
#include "clients/viewer/gl.h"

typedef struct kn_offscreen_backend {
    const char *name; // value of the environment variable KNEAD_GL that chooses this back end, for example "osmesa"
    // Load the library, once. Return false if the library is missing, with one sentence in error that names the
    // package.
    bool (*load)(char *error, size_t error_size);
    void *(*create)(void);      // creates an OpenGL 3.3 core context and makes it current; returns NULL on failure
    void (*use)(void *context); // makes a context current
    void (*destroy)(void *context);
    kn_gl_proc (*get_proc)(const char *name);
} kn_offscreen_backend;

extern const kn_offscreen_backend kn_offscreen_osmesa; // Mesa's software rasteriser OSMesa, a library of its own
extern const kn_offscreen_backend kn_offscreen_egl;    // EGL without a surface, also in software

#endif
