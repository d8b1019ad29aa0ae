#include "clients/viewer/gl.h"
#include <stdio.h>
#include <string.h>

#define SAMPLES 4 // what every software Mesa has; the edges of a block at 720 lines need no more

const char *kn_gl_load(kn_gl *gl, kn_gl_get_proc get_proc)
{
#define LOAD(type, name)                                                                                                \
    gl->name = (type)get_proc("gl" #name);                                                                              \
    if (!gl->name) return "gl" #name;
    KN_GL_FUNCTIONS(LOAD)
#undef LOAD
    return NULL;
}

static void attach(const kn_gl *gl, GLuint buffer, GLenum point, GLenum format, int samples, int width, int height)
{
    gl->BindRenderbuffer(GL_RENDERBUFFER, buffer);
    gl->RenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width, height);
    gl->FramebufferRenderbuffer(GL_FRAMEBUFFER, point, GL_RENDERBUFFER, buffer);
}

bool kn_gl_target_create(const kn_gl *gl, kn_gl_target *t, int width, int height)
{
    *t = (kn_gl_target){.width = width, .height = height};
    gl->GenFramebuffers(1, &t->draw);
    gl->GenFramebuffers(1, &t->resolve);
    gl->GenRenderbuffers(3, t->buffer);
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->draw);
    attach(gl, t->buffer[0], GL_COLOR_ATTACHMENT0, GL_RGBA8, SAMPLES, width, height);
    attach(gl, t->buffer[1], GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT24, SAMPLES, width, height);
    bool ok = gl->CheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->resolve);
    attach(gl, t->buffer[2], GL_COLOR_ATTACHMENT0, GL_RGBA8, 0, width, height);
    ok = ok && gl->CheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    return ok && gl->GetError() == GL_NO_ERROR;
}

void kn_gl_target_bind(const kn_gl *gl, const kn_gl_target *t)
{
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->draw);
    gl->Viewport(0, 0, t->width, t->height);
}

void kn_gl_target_resolve(const kn_gl *gl, const kn_gl_target *t)
{
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, t->draw);
    gl->BindFramebuffer(GL_DRAW_FRAMEBUFFER, t->resolve);
    gl->BlitFramebuffer(0, 0, t->width, t->height, 0, 0, t->width, t->height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->resolve);
}

void kn_gl_target_read(const kn_gl *gl, const kn_gl_target *t, uint8_t *rgba)
{
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->resolve);
    gl->ReadPixels(0, 0, t->width, t->height, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
    // OpenGL counts rows from the bottom
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
        gl->DeleteShader(shader); // lives as long as the program
    }
    gl->LinkProgram(program); // fails with the words of a shader that did not compile
    GLint linked = 0;
    gl->GetProgramiv(program, GL_LINK_STATUS, &linked);
    if (linked) return program;
    char log[256] = "";
    gl->GetProgramInfoLog(program, sizeof log, NULL, log);
    snprintf(error, error_size, "the picture's shaders do not build on this OpenGL: %s", log);
    gl->DeleteProgram(program);
    return 0;
}
