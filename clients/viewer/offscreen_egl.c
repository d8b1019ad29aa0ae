// Back end of offscreen: EGL on Mesa's surfaceless platform, for a Mesa without OSMesa (from 25.1 on). libEGL is not
// linked. Drawing is in software, as with OSMesa, unless the environment says LIBGL_ALWAYS_SOFTWARE=0. A viewer should
// not load a GPU driver beside the servo unless the user asks for it.
#define EGL_NO_X11
#include "clients/viewer/offscreen_backend.h"
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#define LIBRARY "libEGL.so.1"

#define FUNCTIONS(X)                                                                                                   \
    X(BindAPI) X(ChooseConfig) X(CreateContext) X(DestroyContext) X(GetProcAddress) X(Initialize) X(MakeCurrent)
#define FIELD(name) __typeof__(egl##name) *name;
static struct {
    FUNCTIONS(FIELD)
} egl;
static EGLDisplay display;
static EGLConfig config;

// Open a display without a display server and without a device. Return false if this EGL has no such platform or no
// driver.
static bool open_display(void)
{
    static const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_NONE};
    PFNEGLGETPLATFORMDISPLAYEXTPROC get_display =
        (PFNEGLGETPLATFORMDISPLAYEXTPROC)egl.GetProcAddress("eglGetPlatformDisplayEXT");
    EGLint count = 0;
    display = get_display ? get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL) : EGL_NO_DISPLAY;
    return display != EGL_NO_DISPLAY && egl.Initialize(display, NULL, NULL) && egl.BindAPI(EGL_OPENGL_API) &&
           egl.ChooseConfig(display, wanted, &config, 1, &count) && count == 1;
}

static bool load(char *error, size_t error_size)
{
    static bool ready;
    if (ready) return true;
    setenv("LIBGL_ALWAYS_SOFTWARE", "1", 0);
    void *library = dlopen(LIBRARY, RTLD_NOW | RTLD_LOCAL); // the library is never closed, like OSMesa's
    if (!library) {
        snprintf(error, error_size,
                 "no pictures without " LIBRARY " (%s): install the packages libegl1 and "
                 "libgl1-mesa-dri",
                 dlerror());
        return false;
    }
    const char *missing = NULL;
#define LOAD(name)                                                                                                     \
    egl.name = (__typeof__(egl.name))dlsym(library, "egl" #name);                                                      \
    if (!egl.name) missing = "egl" #name;
    FUNCTIONS(LOAD)
    if (missing) snprintf(error, error_size, LIBRARY " has no %s", missing);
    ready = !missing && open_display();
    if (!missing && !ready)
        snprintf(error, error_size, LIBRARY " cannot draw without a screen: install the package libgl1-mesa-dri");
    return ready;
}

static void use(void *context)
{
    egl.BindAPI(EGL_OPENGL_API); // choose OpenGL; this setting applies to the calling thread only
    egl.MakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);
}

static void destroy(void *context)
{
    // release the context first, because EGL does not destroy a current context
    egl.MakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    egl.DestroyContext(display, context);
}

static void *create(void)
{
    static const EGLint attributes[] = {
        EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    egl.BindAPI(EGL_OPENGL_API);
    EGLContext context = egl.CreateContext(display, config, EGL_NO_CONTEXT, attributes);
    if (context == EGL_NO_CONTEXT) return NULL;
    if (egl.MakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return context;
    egl.DestroyContext(display, context);
    return NULL;
}

static kn_gl_proc get_proc(const char *name) { return (kn_gl_proc)egl.GetProcAddress(name); }

const kn_offscreen_backend kn_offscreen_egl = {"egl", load, create, use, destroy, get_proc};
