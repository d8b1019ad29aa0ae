#define EGL_NO_X11
#include "clients/viewer/offscreen.h"
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/osmesa.h>
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef KN_SANITIZED
// Hook of the leak sanitizer. It names leaks to ignore: OSMesa 22.3 leaks 200 bytes with every context that it
// destroys, and fontconfig, which label.c uses, leaks 651 bytes once.
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libOSMesa\nleak:libfontconfig\n"; }
#endif

typedef void (*kn_gl_proc)(void);

// Source of OpenGL contexts. A context belongs to the back end that created it. All drawing goes into the frame buffers
// of kn_gl_target, so a back end needs no surface to draw on.
typedef struct backend {
    const char *name; // value of the environment variable KNEAD_GL that chooses this back end, for example "osmesa"
    // Load the library, once. Return false if the library is missing, with one sentence in error that names the
    // package.
    bool (*load)(char *error, size_t error_size);
    void *(*create)(void);      // creates an OpenGL 3.3 core context and makes it current; returns NULL on failure
    void (*use)(void *context); // makes a context current
    void (*destroy)(void *context);
    kn_gl_proc (*get_proc)(const char *name);
} backend;

// ---- OSMesa, Mesa's software rasteriser as a library of its own

#define OSMESA_LIBRARY "libOSMesa.so.8" // library with the ABI of <GL/osmesa.h>, unchanged since Mesa 9

// Side of the default frame buffer, pixels. OSMesa demands such a buffer, but nothing is drawn into it.
enum { OSMESA_SIDE = 16 };

typedef struct osmesa_context {
    OSMesaContext mesa;
    uint32_t window[OSMESA_SIDE * OSMESA_SIDE];
} osmesa_context;

#define OSMESA_FUNCTIONS(X) X(CreateContextAttribs) X(MakeCurrent) X(DestroyContext) X(GetProcAddress)
#define OSMESA_FIELD(name) __typeof__(OSMesa##name) *name;
static struct {
    OSMESA_FUNCTIONS(OSMESA_FIELD)
} osmesa;

static bool osmesa_load(char *error, size_t error_size)
{
    if (osmesa.CreateContextAttribs) return true;
    // Never close the library, because exit handlers of LLVM point into it.
    void *library = dlopen(OSMESA_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        snprintf(error, error_size, "no pictures without " OSMESA_LIBRARY " (%s): install the package libosmesa6",
                 dlerror());
        return false;
    }
    bool whole = true;
#define OSMESA_LOAD(name)                                                                                              \
    osmesa.name = (__typeof__(osmesa.name))dlsym(library, "OSMesa" #name);                                             \
    whole = whole && osmesa.name;
    OSMESA_FUNCTIONS(OSMESA_LOAD)
    if (whole) return true;
    snprintf(error, error_size, OSMESA_LIBRARY " is older than Mesa 12 and cannot create core contexts");
    osmesa.CreateContextAttribs = NULL;
    return false;
}

static bool osmesa_make_current(osmesa_context *c)
{
    return osmesa.MakeCurrent(c->mesa, c->window, GL_UNSIGNED_BYTE, OSMESA_SIDE, OSMESA_SIDE);
}

static void osmesa_use(void *self) { osmesa_make_current(self); }

static void osmesa_destroy(void *self)
{
    osmesa_context *c = self;
    if (c->mesa) osmesa.DestroyContext(c->mesa); // destroying the context also frees everything that was created in it
    free(c);
}

static void *osmesa_create(void)
{
    static const int attributes[] = {OSMESA_FORMAT,
                                     OSMESA_RGBA,
                                     OSMESA_PROFILE,
                                     OSMESA_CORE_PROFILE,
                                     OSMESA_CONTEXT_MAJOR_VERSION,
                                     3,
                                     OSMESA_CONTEXT_MINOR_VERSION,
                                     3,
                                     0};
    osmesa_context *c = calloc(1, sizeof *c);
    if (!c) return NULL;
    c->mesa = osmesa.CreateContextAttribs(attributes, NULL);
    if (c->mesa && osmesa_make_current(c)) return c;
    osmesa_destroy(c);
    return NULL;
}

static kn_gl_proc osmesa_get_proc(const char *name) { return (kn_gl_proc)osmesa.GetProcAddress(name); }

// ---- EGL
//
// EGL on Mesa's surfaceless platform. It is needed for Mesa 25.1 and later, which have no OSMesa. libEGL is not linked.
// If LIBGL_ALWAYS_SOFTWARE is not set in the environment, drawing is in software, as with OSMesa. A viewer should load
// a GPU driver beside the servo only if the user sets this variable to 0.

#define EGL_LIBRARY "libEGL.so.1"

#define EGL_FUNCTIONS(X)                                                                                               \
    X(BindAPI) X(ChooseConfig) X(CreateContext) X(DestroyContext) X(GetProcAddress) X(Initialize) X(MakeCurrent)
#define EGL_FIELD(name) __typeof__(egl##name) *name;
static struct {
    EGL_FUNCTIONS(EGL_FIELD)
} egl;
static EGLDisplay egl_display;
static EGLConfig egl_config;

// Open an EGL display that needs no display server and no device. Return false if this EGL has no surfaceless platform
// or no driver.
static bool open_display(void)
{
    static const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_NONE};
    PFNEGLGETPLATFORMDISPLAYEXTPROC get_display =
        (PFNEGLGETPLATFORMDISPLAYEXTPROC)egl.GetProcAddress("eglGetPlatformDisplayEXT");
    EGLint count = 0;
    egl_display = get_display ? get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL) : EGL_NO_DISPLAY;
    return egl_display != EGL_NO_DISPLAY && egl.Initialize(egl_display, NULL, NULL) && egl.BindAPI(EGL_OPENGL_API) &&
           egl.ChooseConfig(egl_display, wanted, &egl_config, 1, &count) && count == 1;
}

static bool egl_load(char *error, size_t error_size)
{
    static bool ready;
    if (ready) return true;
    setenv("LIBGL_ALWAYS_SOFTWARE", "1", 0);
    void *library = dlopen(EGL_LIBRARY, RTLD_NOW | RTLD_LOCAL); // never closed, like the library of OSMesa
    if (!library) {
        snprintf(error, error_size,
                 "no pictures without " EGL_LIBRARY " (%s): install the packages libegl1 and "
                 "libgl1-mesa-dri",
                 dlerror());
        return false;
    }
    const char *missing = NULL;
#define EGL_LOAD(name)                                                                                                 \
    egl.name = (__typeof__(egl.name))dlsym(library, "egl" #name);                                                      \
    if (!egl.name) missing = "egl" #name;
    EGL_FUNCTIONS(EGL_LOAD)
    if (missing) snprintf(error, error_size, EGL_LIBRARY " has no %s", missing);
    ready = !missing && open_display();
    if (!missing && !ready)
        snprintf(error, error_size, EGL_LIBRARY " cannot draw without a screen: install the package libgl1-mesa-dri");
    return ready;
}

static void egl_use(void *context)
{
    egl.BindAPI(EGL_OPENGL_API); // choose OpenGL; this setting applies to the calling thread only
    egl.MakeCurrent(egl_display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);
}

static void egl_destroy(void *context)
{
    // Release the context first, because EGL does not destroy a context that is current.
    egl.MakeCurrent(egl_display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    egl.DestroyContext(egl_display, context);
}

static void *egl_create(void)
{
    static const EGLint attributes[] = {
        EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    egl.BindAPI(EGL_OPENGL_API);
    EGLContext context = egl.CreateContext(egl_display, egl_config, EGL_NO_CONTEXT, attributes);
    if (context == EGL_NO_CONTEXT) return NULL;
    if (egl.MakeCurrent(egl_display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return context;
    egl.DestroyContext(egl_display, context);
    return NULL;
}

static kn_gl_proc egl_get_proc(const char *name) { return (kn_gl_proc)egl.GetProcAddress(name); }

// ---- functions and frame buffers

// Look up all functions in the current context and fill in the table. Return NULL, or the name of the first missing
// function.
static const char *load_functions(kn_gl *gl, kn_gl_proc (*get_proc)(const char *name))
{
#define LOAD(name)                                                                                                     \
    gl->name = (__typeof__(gl->name))get_proc("gl" #name);                                                             \
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

// Create a frame buffer with the colour buffer `color` and, if `depth` is not 0, with the depth buffer `depth`.
static bool create_frame(const kn_gl *gl, kn_gl_target *t, GLuint *frame, GLuint color, GLuint depth, int samples)
{
    gl->GenFramebuffers(1, frame);
    gl->BindFramebuffer(GL_FRAMEBUFFER, *frame);
    attach(gl, color, GL_COLOR_ATTACHMENT0, GL_RGBA8, samples, t);
    if (depth) attach(gl, depth, GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT24, samples, t);
    return gl->CheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

// Create the frame buffers. Return false if the context refuses them.
static bool create_target(const kn_gl *gl, kn_gl_target *t, int width, int height, int samples)
{
    *t = (kn_gl_target){.width = width, .height = height};
    gl->GenRenderbuffers(3, t->buffer);
    bool ok = create_frame(gl, t, &t->picture, t->buffer[0], samples > 1 ? 0 : t->buffer[2], 0);
    // With one sample per pixel, the solids are drawn into the picture itself, so the picture needs the depth buffer.
    t->solids = t->picture;
    if (samples > 1) ok = ok && create_frame(gl, t, &t->solids, t->buffer[1], t->buffer[2], samples);
    return ok && gl->GetError() == GL_NO_ERROR;
}

void kn_gl_target_solids(const kn_gl *gl, const kn_gl_target *t)
{
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->solids);
    gl->Viewport(0, 0, t->width, t->height);
    // With one sample per pixel the table covers the whole picture, so the picture's colour need not be cleared.
    gl->Clear(GL_DEPTH_BUFFER_BIT | (t->solids == t->picture ? 0 : GL_COLOR_BUFFER_BIT));
}

// Copy from a buffer with several samples per pixel to a buffer with one sample per pixel. The copy resolves the
// samples: colour and alpha become averages over the pixel.
void kn_gl_target_picture(const kn_gl *gl, const kn_gl_target *t)
{
    if (t->solids == t->picture) return;
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, t->solids);
    gl->BindFramebuffer(GL_DRAW_FRAMEBUFFER, t->picture);
    gl->BlitFramebuffer(0, 0, t->width, t->height, 0, 0, t->width, t->height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->picture);
}

// ---- context

struct kn_offscreen {
    const backend *backend;
    void *context;
    kn_gl gl;
    kn_gl_target target;
};

// Back ends in the order in which they are tried.
static const backend backends[] = {
    {"osmesa", osmesa_load, osmesa_create, osmesa_use, osmesa_destroy, osmesa_get_proc},
    {"egl", egl_load, egl_create, egl_use, egl_destroy, egl_get_proc},
};
enum { BACKENDS = sizeof backends / sizeof *backends };

bool kn_offscreen_knows(const char *name)
{
    int i = 0;
    while (i < BACKENDS && strcmp(backends[i].name, name) != 0) i++;
    return i < BACKENDS;
}

// Return the back end that KNEAD_GL names, or, without KNEAD_GL, the first one that loads. If none loads, return NULL
// and put into error why the first one does not load.
static const backend *choose(char *error, size_t error_size)
{
    const char *asked = getenv("KNEAD_GL");
    char later[300];
    // Set the number of rasteriser threads. Mesa reads the variable once, when the first context is created.
    setenv("LP_NUM_THREADS", "1", 0);
    for (int i = 0; asked && *asked && i < BACKENDS; i++)
        if (strcmp(backends[i].name, asked) == 0) return backends[i].load(error, error_size) ? &backends[i] : NULL;
    if (asked && *asked) return snprintf(error, error_size, "KNEAD_GL=%s: expected osmesa or egl", asked), NULL;
    for (int i = 0; i < BACKENDS; i++)
        if (backends[i].load(i == 0 ? error : later, i == 0 ? error_size : sizeof later)) return &backends[i];
    return NULL;
}

// Create the context, load its functions and create the frame buffers.
static bool open_context(kn_offscreen *screen, int width, int height, int samples, char *error, size_t error_size)
{
    const char *name = screen->backend->name;
    screen->context = screen->backend->create();
    if (!screen->context) {
        snprintf(error, error_size, "%s cannot create an OpenGL 3.3 core context here", name);
        return false;
    }
    const char *missing = load_functions(&screen->gl, screen->backend->get_proc);
    if (missing) {
        snprintf(error, error_size, "%s has no %s", name, missing);
        return false;
    }
    if (create_target(&screen->gl, &screen->target, width, height, samples)) return true;
    snprintf(error, error_size, "%s cannot create a frame buffer of %d x %d with %d samples", name, width, height,
             samples);
    return false;
}

kn_offscreen *kn_offscreen_open(int width, int height, int samples, char *error, size_t error_size)
{
    if (width < KN_OFFSCREEN_MIN || width > KN_OFFSCREEN_MAX || height < KN_OFFSCREEN_MIN ||
        height > KN_OFFSCREEN_MAX) {
        snprintf(error, error_size, "picture of %d x %d pixels, expected %d..%d on each side", width, height,
                 KN_OFFSCREEN_MIN, KN_OFFSCREEN_MAX);
        return NULL;
    }
    const backend *way = choose(error, error_size);
    if (!way) return NULL;
    kn_offscreen *screen = calloc(1, sizeof *screen);
    if (!screen) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    screen->backend = way;
    if (open_context(screen, width, height, samples, error, error_size)) return screen;
    kn_offscreen_close(screen);
    return NULL;
}

const kn_gl *kn_offscreen_begin(kn_offscreen *screen)
{
    screen->backend->use(screen->context);
    return &screen->gl;
}

const kn_gl_target *kn_offscreen_target(const kn_offscreen *screen) { return &screen->target; }

void kn_offscreen_read_rgba(kn_offscreen *screen, uint8_t *rgba)
{
    const kn_gl *gl = &screen->gl;
    const kn_gl_target *t = &screen->target;
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

void kn_offscreen_close(kn_offscreen *screen)
{
    if (!screen) return;
    if (screen->context) screen->backend->destroy(screen->context);
    free(screen);
}
