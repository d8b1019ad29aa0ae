#ifndef KN_CLIENTS_VIEWER_OFFSCREEN_H
#define KN_CLIENTS_VIEWER_OFFSCREEN_H
// Drawing without a window: an OpenGL 3.3 core context, its functions, frame buffers of a given size, and their pixels.
//
// There are two back ends. One is OSMesa, the software rasteriser of Mesa as a library of its own. Mesa 25.1 and later
// do not contain OSMesa. The other is the surfaceless platform of EGL. Both work without a display, a GPU and root
// rights. The environment variable KNEAD_GL (osmesa or egl) selects a back end; without KNEAD_GL, the first one that is
// installed is used. The module is not thread safe: one thread must open, draw, read and close.
//
// The library of the back end is loaded with the first picture, not at the program's start. The library loads 117 MB of
// LLVM, and `knead probe` must neither wait 25 ms for LLVM nor lock it into memory.
//
// LP_NUM_THREADS, the number of rasteriser threads, is set to 1 unless the environment sets it, because the servo uses
// the other core. The pictures do not depend on the number of threads.
//
// Nothing links libGL. The addresses of OpenGL's functions come from the context, so a process can also load a
// desktop's libGL without a conflict.
#define GL_GLEXT_PROTOTYPES // makes the header declare the types of the functions below
#include <GL/glcorearb.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Functions of OpenGL 3.3 core that the viewer calls. To use a new function, add one line to the list.
// clang-format off
#define KN_GL_FUNCTIONS(X)                                                                                             \
    X(AttachShader) X(BindBuffer) X(BindFramebuffer) X(BindRenderbuffer) X(BindTexture) X(BindVertexArray)             \
    X(BlendFunc) X(BlitFramebuffer) X(BufferData) X(CheckFramebufferStatus) X(Clear) X(ColorMask) X(CompileShader)     \
    X(CreateProgram) X(CreateShader) X(CullFace) X(DeleteProgram) X(DeleteShader) X(Disable)                           \
    X(DisableVertexAttribArray) X(DrawArrays) X(DrawBuffer) X(Enable) X(EnableVertexAttribArray)                       \
    X(FramebufferRenderbuffer) X(FramebufferTexture2D) X(GenBuffers) X(GenFramebuffers) X(GenRenderbuffers)            \
    X(GenTextures) X(GenVertexArrays) X(GetError) X(GetProgramInfoLog) X(GetProgramiv) X(GetUniformLocation)           \
    X(LinkProgram) X(PolygonOffset) X(ReadBuffer) X(ReadPixels) X(RenderbufferStorageMultisample)                      \
    X(ShaderSource) X(TexImage2D) X(TexParameteri) X(Uniform1f) X(Uniform1i) X(Uniform3fv) X(Uniform4fv)               \
    X(UniformMatrix4fv) X(UseProgram) X(VertexAttribPointer) X(Viewport)
// clang-format on

typedef struct kn_gl {
#define KN_GL_MEMBER(name) __typeof__(gl##name) *name;
    KN_GL_FUNCTIONS(KN_GL_MEMBER)
#undef KN_GL_MEMBER
} kn_gl;

// Frame buffers of one size. The buffer of the solids has depth and several samples per pixel, and is resolved into the
// picture. With one sample per pixel, the solids are drawn directly into the picture. The buffers are freed with their
// context, and never deleted singly.
typedef struct kn_gl_target {
    int width, height;
    GLuint solids, picture;
    GLuint buffer[3]; // render buffers: picture, colour and depth of the solids
} kn_gl_target;

void kn_gl_target_solids(const kn_gl *gl,
                         const kn_gl_target *target); // begin to draw the solids, into a cleared buffer
// Resolve the solids into the picture (average their samples). Everything that is drawn afterwards goes into the
// picture, behind the solids. Alpha is the fraction of a pixel that the solids cover, and later drawing fills the rest
// of the pixel. With one sample per pixel, a solid covers a pixel completely or not at all, and later drawing uses the
// depth buffer to find the pixels that no solid covers.
void kn_gl_target_picture(const kn_gl *gl, const kn_gl_target *target);

#define KN_OFFSCREEN_MIN 16
// Largest width or height of a picture, pixels. The limit bounds the memory: 4 samples of colour and depth take 32
// bytes per pixel.
#define KN_OFFSCREEN_MAX 4096

typedef struct kn_offscreen kn_offscreen;

// Return true if the environment variable KNEAD_GL may have this value: "osmesa" or "egl".
bool kn_offscreen_knows(const char *name);

// Open a context with frame buffers. `samples`: samples per pixel, 1..4. Return NULL with one sentence in error if the
// size is out of range, the library is missing, or the context is refused.
kn_offscreen *kn_offscreen_open(int width, int height, int samples, char *error, size_t error_size);

// Make the context current and return the functions for drawing.
const kn_gl *kn_offscreen_begin(kn_offscreen *screen);
const kn_gl_target *kn_offscreen_target(const kn_offscreen *screen); // return the frame buffers to draw into

// Wait until drawing has finished, and copy the picture: [height][width][4] bytes, top row first.
void kn_offscreen_read_rgba(kn_offscreen *screen, uint8_t *rgba);

void kn_offscreen_close(kn_offscreen *screen); // `screen` may be NULL

#endif
