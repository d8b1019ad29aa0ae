#include "clients/viewer/gl.h"
#include <stdio.h>
#include <string.h>

const char *kn_gl_load(kn_gl *gl, kn_gl_get_proc get_proc)
{
#define LOAD(type, name)                                                                                               \
    gl->name = (type)get_proc("gl" #name);                                                                             \
    if (!gl->name) return "gl" #name;
    KN_GL_FUNCTIONS(LOAD)
#undef LOAD
    return NULL;
}

// Give a render buffer its storage, and attach it to the bound frame buffer.
static void attach(const kn_gl *gl, GLuint buffer, GLenum point, GLenum format, int samples, const kn_gl_target *t)
{
    gl->BindRenderbuffer(GL_RENDERBUFFER, buffer);
    gl->RenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, t->width, t->height);
    gl->FramebufferRenderbuffer(GL_FRAMEBUFFER, point, GL_RENDERBUFFER, buffer);
}

// Create a frame buffer from its colour buffer and, unless 0, its depth buffer.
static bool create_frame(const kn_gl *gl, kn_gl_target *t, GLuint *frame, GLuint color, GLuint depth, int samples)
{
    gl->GenFramebuffers(1, frame);
    gl->BindFramebuffer(GL_FRAMEBUFFER, *frame);
    attach(gl, color, GL_COLOR_ATTACHMENT0, GL_RGBA8, samples, t);
    if (depth) attach(gl, depth, GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT24, samples, t);
    return gl->CheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

bool kn_gl_target_create(const kn_gl *gl, kn_gl_target *t, int width, int height, int samples)
{
    *t = (kn_gl_target){.width = width, .height = height};
    gl->GenRenderbuffers(4, t->buffer);
    bool ok = create_frame(gl, t, &t->backdrop, t->buffer[0], 0, 0) &&
              create_frame(gl, t, &t->picture, t->buffer[3], samples > 1 ? 0 : t->buffer[2], 0);
    // With one sample per pixel, the solids are drawn into the picture itself, so the picture needs the depth buffer.
    t->solids = t->picture;
    if (samples > 1) ok = ok && create_frame(gl, t, &t->solids, t->buffer[1], t->buffer[2], samples);
    return ok && gl->GetError() == GL_NO_ERROR;
}

void kn_gl_target_backdrop(const kn_gl *gl, const kn_gl_target *t)
{
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->backdrop);
    gl->Viewport(0, 0, t->width, t->height);
    gl->Disable(GL_SCISSOR_TEST);
}

static void copy(const kn_gl *gl, GLuint from, GLuint to, kn_gl_region r)
{
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, from);
    gl->BindFramebuffer(GL_DRAW_FRAMEBUFFER, to);
    gl->BlitFramebuffer(r.x, r.y, r.x + r.width, r.y + r.height, r.x, r.y, r.x + r.width, r.y + r.height,
                        GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

// The scissor limits clearing and drawing of the solids to their region.
void kn_gl_target_solids(const kn_gl *gl, const kn_gl_target *t, kn_gl_region region, bool before_backdrop)
{
    bool direct = t->solids == t->picture;
    gl->Disable(GL_SCISSOR_TEST);
    if (before_backdrop) copy(gl, t->backdrop, t->picture, (kn_gl_region){0, 0, t->width, t->height});
    else {
        gl->BindFramebuffer(GL_FRAMEBUFFER, t->picture);
        // With one sample per pixel the table covers the whole picture, so the picture's colour need not be cleared.
        gl->Clear(direct ? GL_DEPTH_BUFFER_BIT : GL_COLOR_BUFFER_BIT);
    }
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->solids);
    gl->Viewport(0, 0, t->width, t->height);
    gl->Enable(GL_SCISSOR_TEST);
    gl->Scissor(region.x, region.y, region.width, region.height);
    gl->Clear(GL_DEPTH_BUFFER_BIT | (direct ? 0 : GL_COLOR_BUFFER_BIT));
}

// Copying from several samples to one resolves them: colour and alpha become averages over the pixel.
void kn_gl_target_picture(const kn_gl *gl, const kn_gl_target *t, kn_gl_region region)
{
    if (t->solids == t->picture) return;
    gl->Disable(GL_SCISSOR_TEST);
    copy(gl, t->solids, t->picture, region);
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->picture);
    gl->Enable(GL_SCISSOR_TEST);
}

void kn_gl_target_read(const kn_gl *gl, const kn_gl_target *t, uint8_t *rgba)
{
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->picture);
    gl->ReadPixels(0, 0, t->width, t->height, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
    // Swap the rows, because OpenGL counts them from the bottom.
    size_t row = (size_t)t->width * 4;
    uint8_t swap[256];
    for (int top = 0, bottom = t->height - 1; top < bottom; top++, bottom--) {
        uint8_t *a = rgba + (size_t)top * row, *b = rgba + (size_t)bottom * row;
        for (size_t done = 0; done < row; done += sizeof swap) {
            size_t n = row - done < sizeof swap ? row - done : sizeof swap;
            memcpy(swap, a + done, n);
            memcpy(a + done, b + done, n);
            memcpy(b + done, swap, n);
        }
    }
}

GLuint kn_gl_program(const kn_gl *gl, const char *vertex, const char *fragment, char *error, size_t error_size)
{
    const char *source[2] = {vertex, fragment};
    const GLenum kind[2] = {GL_VERTEX_SHADER, GL_FRAGMENT_SHADER};
    GLuint program = gl->CreateProgram();
    for (int i = 0; i < 2; i++) {
        GLuint shader = gl->CreateShader(kind[i]);
        gl->ShaderSource(shader, 1, &source[i], NULL);
        gl->CompileShader(shader);
        gl->AttachShader(program, shader);
        gl->DeleteShader(shader); // OpenGL deletes the shader together with the program
    }
    gl->LinkProgram(program); // if a shader did not compile, linking fails and the log contains the shader's error
    GLint linked = 0;
    gl->GetProgramiv(program, GL_LINK_STATUS, &linked);
    if (linked) return program;
    char log[256] = "";
    gl->GetProgramInfoLog(program, sizeof log, NULL, log);
    snprintf(error, error_size, "the shaders do not compile on this OpenGL: %s", log);
    gl->DeleteProgram(program);
    return 0;
}
