#include "clients/viewer/offscreen.h"
#include "clients/viewer/offscreen_backend.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef KN_SANITIZED
// Hook of the leak sanitizer: OSMesa 22.3 leaks 200 bytes with every context that it destroys, and fontconfig 651 bytes
// once (label.c).
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libOSMesa\nleak:libfontconfig\n"; }
#endif

struct kn_offscreen {
    const kn_offscreen_backend *backend;
    void *context;
    kn_gl gl;
    kn_gl_target target;
};

// Back ends in the order in which they are tried.
static const kn_offscreen_backend *const backends[] = {&kn_offscreen_osmesa, &kn_offscreen_egl};
enum { BACKENDS = sizeof backends / sizeof *backends };
// Back end that the last kn_offscreen_open used, for kn_offscreen_get_proc.
static const kn_offscreen_backend *last;

bool kn_offscreen_knows(const char *name)
{
    int i = 0;
    while (i < BACKENDS && strcmp(backends[i]->name, name) != 0) i++;
    return i < BACKENDS;
}

// Return the back end that KNEAD_GL names, or, without KNEAD_GL, the first one that loads. If none loads, return NULL
// and put the reason of the first one in error.
static const kn_offscreen_backend *choose(char *error, size_t error_size)
{
    const char *asked = getenv("KNEAD_GL");
    char later[300];
    // set the number of rasteriser threads; Mesa reads it once, when the first context is created
    setenv("LP_NUM_THREADS", "1", 0);
    for (int i = 0; asked && *asked && i < BACKENDS; i++)
        if (strcmp(backends[i]->name, asked) == 0) return backends[i]->load(error, error_size) ? backends[i] : NULL;
    if (asked && *asked) return snprintf(error, error_size, "KNEAD_GL=%s: expected osmesa or egl", asked), NULL;
    for (int i = 0; i < BACKENDS; i++)
        if (backends[i]->load(i == 0 ? error : later, i == 0 ? error_size : sizeof later)) return backends[i];
    return NULL;
}

kn_gl_proc kn_offscreen_get_proc(const char *name) { return last ? last->get_proc(name) : NULL; }

// Create the context, load its functions and create the frame buffers.
static bool open_context(kn_offscreen *screen, int width, int height, int samples, char *error, size_t error_size)
{
    const char *name = screen->backend->name;
    screen->context = screen->backend->create();
    if (!screen->context) {
        snprintf(error, error_size, "%s cannot create an OpenGL 3.3 core context here", name);
        return false;
    }
    const char *missing = kn_gl_load(&screen->gl, screen->backend->get_proc);
    if (missing) {
        snprintf(error, error_size, "%s has no %s", name, missing);
        return false;
    }
    if (kn_gl_target_create(&screen->gl, &screen->target, width, height, samples)) return true;
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
    const kn_offscreen_backend *backend = choose(error, error_size);
    if (!backend) return NULL;
    kn_offscreen *screen = calloc(1, sizeof *screen);
    if (!screen) {
        snprintf(error, error_size, "out of memory");
        return NULL;
    }
    screen->backend = last = backend;
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
    kn_gl_target_read(&screen->gl, &screen->target, rgba);
}

void kn_offscreen_close(kn_offscreen *screen)
{
    if (!screen) return;
    if (screen->context) screen->backend->destroy(screen->context);
    free(screen);
}
