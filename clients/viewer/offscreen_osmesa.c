// Back end of offscreen: OSMesa. Neither libGL nor libOSMesa is linked (see offscreen.h).
#include "clients/viewer/offscreen_backend.h"
#include <GL/osmesa.h>
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#define LIBRARY "libOSMesa.so.8" // library with the ABI of <GL/osmesa.h>, unchanged since Mesa 9

// Side of the default frame buffer that OSMesa demands. Nothing is drawn into it.
enum { SIDE = 16 };

typedef struct context {
    OSMesaContext mesa;
    uint32_t window[SIDE * SIDE];
} context;

static struct {
    __typeof__(&OSMesaCreateContextAttribs) create;
    __typeof__(&OSMesaMakeCurrent) make_current;
    __typeof__(&OSMesaDestroyContext) destroy;
    __typeof__(&OSMesaGetProcAddress) get_proc;
} mesa;

static bool load(char *error, size_t error_size)
{
    if (mesa.create) return true;
    // the library is never closed, because exit handlers of LLVM point into it
    void *library = dlopen(LIBRARY, RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        snprintf(error, error_size, "no pictures without " LIBRARY " (%s): install the package libosmesa6", dlerror());
        return false;
    }
    mesa.make_current = (__typeof__(mesa.make_current))dlsym(library, "OSMesaMakeCurrent");
    mesa.destroy = (__typeof__(mesa.destroy))dlsym(library, "OSMesaDestroyContext");
    mesa.get_proc = (__typeof__(mesa.get_proc))dlsym(library, "OSMesaGetProcAddress");
    mesa.create = (__typeof__(mesa.create))dlsym(library, "OSMesaCreateContextAttribs");
    if (mesa.create && mesa.make_current && mesa.destroy && mesa.get_proc) return true;
    snprintf(error, error_size, LIBRARY " is older than Mesa 12 and cannot create core contexts");
    mesa.create = NULL;
    return false;
}

static bool make_current(context *c) { return mesa.make_current(c->mesa, c->window, GL_UNSIGNED_BYTE, SIDE, SIDE); }

static void use(void *self) { make_current(self); }

static void destroy(void *self)
{
    context *c = self;
    if (c->mesa) mesa.destroy(c->mesa); // destroying the context also frees everything that was created in it
    free(c);
}

static void *create(void)
{
    static const int attributes[] = {
        OSMESA_FORMAT,
        OSMESA_RGBA,
        OSMESA_PROFILE,
        OSMESA_CORE_PROFILE,
        OSMESA_CONTEXT_MAJOR_VERSION,
        3,
        OSMESA_CONTEXT_MINOR_VERSION,
        3,
        0,
    };
    context *c = calloc(1, sizeof *c);
    if (!c) return NULL;
    c->mesa = mesa.create(attributes, NULL);
    if (c->mesa && make_current(c)) return c;
    destroy(c);
    return NULL;
}

static kn_gl_proc get_proc(const char *name) { return mesa.get_proc(name); }

const kn_offscreen_backend kn_offscreen_osmesa = {"osmesa", load, create, use, destroy, get_proc};
