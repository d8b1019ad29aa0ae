#ifndef KN_CLIENTS_VIEWER_OFFSCREEN_H
#define KN_CLIENTS_VIEWER_OFFSCREEN_H
// A place to draw without a window: an OpenGL 3.3 core context, frame buffers of a given size, and their pixels.
//
// Two back ends (offscreen_backend.h): OSMesa, Mesa's software rasteriser as a library of its own, which Mesa 25.1
// dropped, and EGL's surfaceless platform; no display, no GPU, no root. KNEAD_GL=osmesa or =egl of the environment
// chooses; without it the first of the two that is there. Not thread safe: one thread opens, draws, reads and closes.
//
// The library is loaded when the first picture is wanted, not when the program starts: it brings 117 MB of LLVM, which
// `knead probe` must neither wait for (25 ms) nor lock into memory.
//
// LP_NUM_THREADS, the number of rasteriser threads, is set to 1 when the environment does not say: the servo has the
// other core. Pictures do not depend on it.
#include "clients/viewer/gl.h"

#define KN_OFFSCREEN_MIN 16
#define KN_OFFSCREEN_MAX 4096 // pixels on a side: 4 samples of colour and depth are 32 bytes per pixel

typedef struct kn_offscreen kn_offscreen;

bool kn_offscreen_knows(const char *name); // as KNEAD_GL has it: "osmesa" or "egl"

// samples: 1..4 per pixel. NULL and one sentence in error: size out of range, library missing, context refused.
kn_offscreen *kn_offscreen_open(int width, int height, int samples, char *error, size_t error_size);

// Makes the context current and returns the functions to draw with.
const kn_gl *kn_offscreen_begin(kn_offscreen *screen);
const kn_gl_target *kn_offscreen_target(const kn_offscreen *screen); // where to

// Waits for the drawing to end and copies the picture out: [height][width][4] bytes, top row first.
void kn_offscreen_read_rgba(kn_offscreen *screen, uint8_t *rgba);

kn_gl_proc kn_offscreen_get_proc(const char *name); // NULL before the first open or when there is no such function
void kn_offscreen_close(kn_offscreen *screen);      // NULL is fine

#endif
