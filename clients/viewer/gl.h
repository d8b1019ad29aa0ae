#ifndef KN_CLIENTS_VIEWER_GL_H
#define KN_CLIENTS_VIEWER_GL_H
// The functions of OpenGL 3.3 core that the viewer calls, found at run time, and the frame buffer it draws into.
//
// Nothing links libGL: the context gives the addresses (OSMesaGetProcAddress, eglGetProcAddress), and a process
// can hold a desktop's libGL beside them without either one answering for the other. A new function is one line in the
// list.
#include <GL/glcorearb.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_GL_FUNCTIONS(X)                                                                                             \
    X(PFNGLATTACHSHADERPROC, AttachShader)                                                                             \
    X(PFNGLBINDBUFFERPROC, BindBuffer)                                                                                 \
    X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                                                                       \
    X(PFNGLBINDRENDERBUFFERPROC, BindRenderbuffer)                                                                     \
    X(PFNGLBINDTEXTUREPROC, BindTexture)                                                                               \
    X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                                                                       \
    X(PFNGLBLENDFUNCPROC, BlendFunc)                                                                                   \
    X(PFNGLBLITFRAMEBUFFERPROC, BlitFramebuffer)                                                                       \
    X(PFNGLBUFFERDATAPROC, BufferData)                                                                                 \
    X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus)                                                         \
    X(PFNGLCLEARPROC, Clear)                                                                                           \
    X(PFNGLCOLORMASKPROC, ColorMask)                                                                                   \
    X(PFNGLCOMPILESHADERPROC, CompileShader)                                                                           \
    X(PFNGLCREATEPROGRAMPROC, CreateProgram)                                                                           \
    X(PFNGLCREATESHADERPROC, CreateShader)                                                                             \
    X(PFNGLCULLFACEPROC, CullFace)                                                                                     \
    X(PFNGLDELETEPROGRAMPROC, DeleteProgram)                                                                           \
    X(PFNGLDELETESHADERPROC, DeleteShader)                                                                             \
    X(PFNGLDISABLEPROC, Disable)                                                                                       \
    X(PFNGLDISABLEVERTEXATTRIBARRAYPROC, DisableVertexAttribArray)                                                     \
    X(PFNGLDRAWARRAYSPROC, DrawArrays)                                                                                 \
    X(PFNGLDRAWBUFFERPROC, DrawBuffer)                                                                                 \
    X(PFNGLENABLEPROC, Enable)                                                                                         \
    X(PFNGLENABLEVERTEXATTRIBARRAYPROC, EnableVertexAttribArray)                                                       \
    X(PFNGLFRAMEBUFFERRENDERBUFFERPROC, FramebufferRenderbuffer)                                                       \
    X(PFNGLFRAMEBUFFERTEXTURE2DPROC, FramebufferTexture2D)                                                             \
    X(PFNGLGENBUFFERSPROC, GenBuffers)                                                                                 \
    X(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                                                                       \
    X(PFNGLGENRENDERBUFFERSPROC, GenRenderbuffers)                                                                     \
    X(PFNGLGENTEXTURESPROC, GenTextures)                                                                               \
    X(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                                                                       \
    X(PFNGLGETERRORPROC, GetError)                                                                                     \
    X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                                                                   \
    X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                                                                             \
    X(PFNGLGETSTRINGPROC, GetString)                                                                                   \
    X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)                                                                 \
    X(PFNGLLINKPROGRAMPROC, LinkProgram)                                                                               \
    X(PFNGLPOLYGONOFFSETPROC, PolygonOffset)                                                                           \
    X(PFNGLREADBUFFERPROC, ReadBuffer)                                                                                 \
    X(PFNGLREADPIXELSPROC, ReadPixels)                                                                                 \
    X(PFNGLRENDERBUFFERSTORAGEMULTISAMPLEPROC, RenderbufferStorageMultisample)                                         \
    X(PFNGLSCISSORPROC, Scissor)                                                                                       \
    X(PFNGLSHADERSOURCEPROC, ShaderSource)                                                                             \
    X(PFNGLTEXIMAGE2DPROC, TexImage2D)                                                                                 \
    X(PFNGLTEXPARAMETERIPROC, TexParameteri)                                                                           \
    X(PFNGLUNIFORM1FPROC, Uniform1f)                                                                                   \
    X(PFNGLUNIFORM1IPROC, Uniform1i)                                                                                   \
    X(PFNGLUNIFORM3FVPROC, Uniform3fv)                                                                                 \
    X(PFNGLUNIFORM4FVPROC, Uniform4fv)                                                                                 \
    X(PFNGLUNIFORMMATRIX4FVPROC, UniformMatrix4fv)                                                                     \
    X(PFNGLUSEPROGRAMPROC, UseProgram)                                                                                 \
    X(PFNGLVERTEXATTRIBPOINTERPROC, VertexAttribPointer)                                                               \
    X(PFNGLVIEWPORTPROC, Viewport)

typedef void (*kn_gl_proc)(void);
typedef kn_gl_proc (*kn_gl_get_proc)(const char *name);

typedef struct kn_gl {
#define KN_GL_MEMBER(type, name) type name;
    KN_GL_FUNCTIONS(KN_GL_MEMBER)
#undef KN_GL_MEMBER
} kn_gl;

// Fills the table from the current context; NULL, or the name of the first function that it does not have.
const char *kn_gl_load(kn_gl *gl, kn_gl_get_proc get_proc);

// Frame buffers of one size: the backdrop, drawn once for many pictures; the solids, with depth and several samples per
// pixel; and the picture, in which the solids are resolved over the backdrop. With one sample per pixel the solids are
// drawn into the picture itself. They go with their context, as everything made in one does: nothing here is deleted
// singly.
typedef struct kn_gl_target {
    int width, height;
    GLuint backdrop, solids, picture;
    GLuint buffer[4]; // render buffers: backdrop, colour and depth of the solids, picture
} kn_gl_target;

typedef struct kn_gl_region { // pixels, from the lower left corner of the picture
    int x, y, width, height;
} kn_gl_region;

bool kn_gl_target_create(const kn_gl *gl, kn_gl_target *target, int width, int height,
                         int samples);                                   // false: refused by the context
void kn_gl_target_backdrop(const kn_gl *gl, const kn_gl_target *target); // what is drawn from here on is the backdrop
// Empties the region of the solids (several samples are the dearest part of a picture: no more of them than needed) and
// makes the picture the backdrop or, not before_backdrop, empty; what is drawn from here on goes to the solids.
void kn_gl_target_solids(const kn_gl *gl, const kn_gl_target *target, kn_gl_region region, bool before_backdrop);
// The solids take their place in the picture. What is drawn from here on goes into that region of it: behind the solids
// where alpha, the share of a pixel that they cover, leaves room or, with one sample, where their depth does.
void kn_gl_target_picture(const kn_gl *gl, const kn_gl_target *target, kn_gl_region region);
void kn_gl_target_read(const kn_gl *gl, const kn_gl_target *target, uint8_t *rgba); // [height][width][4], top row first

// Compiles and links; 0 and the compiler's words in error (our shader is wrong, or the context is not OpenGL 3.3).
GLuint kn_gl_program(const kn_gl *gl, const char *vertex, const char *fragment, char *error, size_t error_size);

#endif
