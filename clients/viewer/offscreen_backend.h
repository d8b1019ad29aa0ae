#ifndef KN_CLIENTS_VIEWER_OFFSCREEN_BACKEND_H
#define KN_CLIENTS_VIEWER_OFFSCREEN_BACKEND_H
// What makes OpenGL contexts for offscreen.c. A context is of one kind for life; all drawing goes into gl.h's own frame
// buffers, so a back end has no surface.
#include "clients/viewer/gl.h"

typedef struct kn_offscreen_backend {
    const char *name; // "osmesa", as KNEAD_GL says it
    // Loads the library, once; false and one sentence in error: it is not there, and which package brings it.
    bool (*load)(char *error, size_t error_size);
    void *(*create)(void);      // an OpenGL 3.3 core context, current; NULL: none to be had
    void (*use)(void *context); // makes it current
    void (*destroy)(void *context);
    kn_gl_proc (*get_proc)(const char *name);
} kn_offscreen_backend;

extern const kn_offscreen_backend kn_offscreen_osmesa; // Mesa's software rasteriser as a library of its own
extern const kn_offscreen_backend kn_offscreen_egl;    // EGL without a surface, drawn in software, too

#endif
