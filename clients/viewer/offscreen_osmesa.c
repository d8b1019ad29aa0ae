// offscreen on OSMesa. No libGL is linked, and no libOSMesa either (see offscreen.h).
#include "clients/viewer/offscreen.h"
#include <GL/osmesa.h>
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#define LIBRARY "libOSMesa.so.8" // the ABI of <GL/osmesa.h> since Mesa 9

#ifdef KN_SANITIZED // the leak sanitizer's hook: OSMesa 22.3 forgets 200 bytes with every context that it destroys,
// fontconfig 651 once (label.c)
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libOSMesa\nleak:libfontconfig\n"; }
#endif

struct kn_offscreen {
    OSMesaContext context;
    kn_gl gl;
    kn_gl_target target;
    uint32_t window[KN_OFFSCREEN_MIN * KN_OFFSCREEN_MIN]; // OSMesa wants a default frame buffer; nothing is drawn in it
};

static struct {
    __typeof__(&OSMesaCreateContextAttribs) create;
    __typeof__(&OSMesaMakeCurrent) make_current;
    __typeof__(&OSMesaDestroyContext) destroy;
    __typeof__(&OSMesaGetProcAddress) get_proc;
} mesa;

static bool load(char *error, size_t error_size)
{
    if (mesa.create) return true;
    setenv("LP_NUM_THREADS", "1", 0); // read once, when the first context is made
    void *library = dlopen(LIBRARY, RTLD_NOW | RTLD_LOCAL); // never closed: LLVM's exit handlers point into it
    if (!library) {
        snprintf(error, error_size, "no pictures without " LIBRARY " (%s): install the package libosmesa6", dlerror());
        return false;
    }
    mesa.make_current = (__typeof__(mesa.make_current))dlsym(library, "OSMesaMakeCurrent");
    mesa.destroy = (__typeof__(mesa.destroy))dlsym(library, "OSMesaDestroyContext");
    mesa.get_proc = (__typeof__(mesa.get_proc))dlsym(library, "OSMesaGetProcAddress");
    mesa.create = (__typeof__(mesa.create))dlsym(library, "OSMesaCreateContextAttribs");
    if (mesa.create && mesa.make_current && mesa.destroy && mesa.get_proc) return true;
    snprintf(error, error_size, LIBRARY " is older than Mesa 12: it makes no core contexts");
    mesa.create = NULL;
    return false;
}

kn_gl_proc kn_offscreen_get_proc(const char *name) { return mesa.get_proc ? mesa.get_proc(name) : NULL; }

static bool open_context(kn_offscreen *screen, int width, int height, int samples, char *error, size_t error_size)
{
    static const int attributes[] = {
        OSMESA_FORMAT, OSMESA_RGBA, OSMESA_PROFILE, OSMESA_CORE_PROFILE,
        OSMESA_CONTEXT_MAJOR_VERSION, 3, OSMESA_CONTEXT_MINOR_VERSION, 3, 0,
    };
    screen->context = mesa.create(attributes, NULL);
    if (!screen->context || !mesa.make_current(screen->context, screen->window, GL_UNSIGNED_BYTE, KN_OFFSCREEN_MIN,
                                               KN_OFFSCREEN_MIN)) {
        snprintf(error, error_size, "OSMesa makes no OpenGL 3.3 core context here");
        return false;
    }
    const char *missing = kn_gl_load(&screen->gl, kn_offscreen_get_proc);
    if (missing) {
        snprintf(error, error_size, "OSMesa has no %s", missing);
        return false;
    }
    if (kn_gl_target_create(&screen->gl, &screen->target, width, height, samples)) return true;
    snprintf(error, error_size, "OSMesa makes no frame buffer of %d x %d with %d samples", width, height, samples);
    return false;
}

kn_offscreen *kn_offscreen_open(int width, int height, int samples, char *error, size_t error_size)
{
    if (width < KN_OFFSCREEN_MIN || width > KN_OFFSCREEN_MAX || height < KN_OFFSCREEN_MIN ||
        height > KN_OFFSCREEN_MAX) {
        snprintf(error, error_size, "a picture of %d x %d pixels, expected %d..%d on each side", width, height,
                 KN_OFFSCREEN_MIN, KN_OFFSCREEN_MAX);
        return NULL;
    }
    if (!load(error, error_size)) return NULL;
    kn_offscreen *screen = calloc(1, sizeof *screen);
    if (!screen) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    if (open_context(screen, width, height, samples, error, error_size)) return screen;
    kn_offscreen_close(screen);
    return NULL;
}

const kn_gl *kn_offscreen_begin(kn_offscreen *screen)
{
    mesa.make_current(screen->context, screen->window, GL_UNSIGNED_BYTE, KN_OFFSCREEN_MIN, KN_OFFSCREEN_MIN);
    return &screen->gl;
}

const kn_gl_target *kn_offscreen_target(const kn_offscreen *screen) { return &screen->target; }

void kn_offscreen_read_rgba(kn_offscreen *screen, uint8_t *rgba)
{
    kn_gl_target_read(&screen->gl, &screen->target, rgba);
}

void kn_offscreen_close(kn_offscreen *screen)
{
    if (!screen) return;
    if (screen->context) mesa.destroy(screen->context); // and with it everything that was made in it
    free(screen);
}
