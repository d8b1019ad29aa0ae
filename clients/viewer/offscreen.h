#ifndef KN_CLIENTS_VIEWER_OFFSCREEN_H
#define KN_CLIENTS_VIEWER_OFFSCREEN_H
// Drawing without a window: an OpenGL 3.3 core context, frame buffers of a given size, and their pixels.
//
// There are two back ends (offscreen_backend.h). OSMesa is Mesa's software rasteriser as a library of its own, which
// Mesa 25.1 dropped. The other is EGL's surfaceless platform. They need no display, no GPU and no root. The environment
// variable KNEAD_GL=osmesa or =egl chooses one; without it, the first one that is installed is used. The module is not
// thread safe: the same thread must open, draw, read and close.
//
// The library is loaded with the first picture, not at the program's start. It brings 117 MB of LLVM, and `knead probe`
// must neither wait for that (25 ms) nor lock it into memory.
//
// LP_NUM_THREADS, the number of rasteriser threads, is set to 1 unless the environment sets it, because the servo uses
// the other core. The pictures do not depend on the number of threads.
#include "clients/viewer/gl.h"

#define KN_OFFSCREEN_MIN 16
// Largest size of a picture, pixels on a side; 4 samples of colour and depth take 32 bytes per pixel.
#define KN_OFFSCREEN_MAX 4096

typedef struct kn_offscreen kn_offscreen;

// Return true if the environment variable KNEAD_GL may have this value ("osmesa" or "egl")
bool kn_offscreen_knows(const char *name);

// Open a context with frame buffers. `samples`: samples per pixel, 1..4. Return NULL with one sentence in error if the
// size is out of range, the library is missing, or the context is refused.
kn_offscreen *kn_offscreen_open(int width, int height, int samples, char *error, size_t error_size);

// Make the context current and return the functions for drawing.
const kn_gl *kn_offscreen_begin(kn_offscreen *screen);
const kn_gl_target *kn_offscreen_target(const kn_offscreen *screen); // return the frame buffers to draw into

// Wait until drawing has finished, and copy the picture: [height][width][4] bytes, top row first.
void kn_offscreen_read_rgba(kn_offscreen *screen, uint8_t *rgba);

// Return the OpenGL function `name`. Return NULL before the first kn_offscreen_open, or if there is no such function.
kn_gl_proc kn_offscreen_get_proc(const char *name);
void kn_offscreen_close(kn_offscreen *screen); // `screen` may be NULL

#endif
