#ifndef KN_CLIENTS_VIEWER_GL_H
#define KN_CLIENTS_VIEWER_GL_H
// Functions of OpenGL 3.3 core that the viewer calls, looked up at run time, and the frame buffers that it draws into.
//
// Nothing links libGL. The addresses come from the context (OSMesaGetProcAddress, eglGetProcAddress). So a process can
// also load a desktop's libGL without a conflict. To use a new function, add one line to the list.
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

// Look up all functions in the current context and fill in the table. Return NULL, or the name of the first missing
// function.
const char *kn_gl_load(kn_gl *gl, kn_gl_get_proc get_proc);

// Frame buffers of one size. The backdrop (the table without an object) is drawn once for many pictures. The solids
// have depth and several samples per pixel. The picture receives the solids, resolved over the backdrop. With one
// sample per pixel, the solids are drawn directly into the picture. The buffers are freed with their context, and never
// deleted singly.
typedef struct kn_gl_target {
    int width, height;
    GLuint backdrop, solids, picture;
    GLuint buffer[4]; // render buffers: backdrop, colour and depth of the solids, picture
} kn_gl_target;

typedef struct kn_gl_region { // rectangle of the picture, pixels from its lower left corner
    int x, y, width, height;
} kn_gl_region;

// Create the frame buffers. Return false if the context refuses them.
bool kn_gl_target_create(const kn_gl *gl, kn_gl_target *target, int width, int height, int samples);
void kn_gl_target_backdrop(const kn_gl *gl, const kn_gl_target *target); // make the backdrop the target of all drawing
// Begin to draw the solids: make their buffer the target of all drawing. Clear only their region, because buffers with
// several samples take most of the time of a picture. `before_backdrop`: the picture starts as a copy of the backdrop;
// otherwise it starts empty.
void kn_gl_target_solids(const kn_gl *gl, const kn_gl_target *target, kn_gl_region region, bool before_backdrop);
// Resolve the solids into the picture. From then on, drawing goes to this region of the picture, behind the solids.
// Alpha is the fraction of a pixel that solids cover, and drawing fills the remaining fraction. With one sample per
// pixel, the depth buffer decides.
void kn_gl_target_picture(const kn_gl *gl, const kn_gl_target *target, kn_gl_region region);
// Copy the picture to rgba[height][width][4], top row first.
void kn_gl_target_read(const kn_gl *gl, const kn_gl_target *target, uint8_t *rgba);

// Compile and link a program. If a shader is wrong or the context is not OpenGL 3.3, return 0 and put the compiler's
// message in error.
GLuint kn_gl_program(const kn_gl *gl, const char *vertex, const char *fragment, char *error, size_t error_size);

#endif
