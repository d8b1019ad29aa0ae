#include "clients/web/painter.h"
#include "clients/viewer/image.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <turbojpeg.h>
#include <unistd.h>

#define QUALITY 82 // JPEG quality at which the squares of the table stay clean

size_t kn_painter_largest(int width, int height) { return tjBufSize(width, height, TJSAMP_420); }

// Write the PNG copy of the picture with its label. On success png_error stays empty.
static void write_png(kn_painter *p, uint8_t *rgba)
{
    char bar[32];
    p->png_error[0] = 0;
    kn_label_bar(&p->label, bar, p->bar_m, p->width, p->height);
    if (kn_label_draw(&p->label, p->width, p->height, rgba, p->png_error, sizeof p->png_error))
        kn_image_write_png(p->png, p->width, p->height, rgba, p->png_error, sizeof p->png_error);
}

// Draw the still, compress it, and write a PNG if wanted.
static void draw(kn_painter *p, kn_renderer *r, tjhandle packer, uint8_t *rgba)
{
    kn_still *s = &p->still;
    unsigned long size = 0;
    bool ready = !p->fresh || kn_renderer_mesh(r, s->vertex_count, (const float(*)[3])s->rest, s->triangle_count,
                                               (const int(*)[3])s->triangle);
    // If the mesh cannot be loaded, this picture is empty, and loading is tried again for the next picture.
    p->fresh = !ready;
    if (ready) {
        s->view.xyz = (const float(*)[3])s->now;
        kn_renderer_draw(r, &s->view, rgba);
        p->bar_m = kn_renderer_bar(r, p->label.bar_at);
        if (tjCompress2(packer, rgba, p->width, 0, p->height, TJPF_RGBX, &p->jpeg, &size, TJSAMP_420, QUALITY,
                        TJFLAG_NOREALLOC) != 0)
            size = 0;
        if (p->png) write_png(p, rgba);
    }
    p->size = size;
}

// Run the painter's thread: open OpenGL, post the semaphore `opened`, then draw a still each time that the semaphore
// `wake` is posted.
static void *run(void *self)
{
    kn_painter *p = self;
    // On Linux this call sets the priority of the calling thread only. Threads that Mesa starts from this thread
    // inherit the priority.
    setpriority(PRIO_PROCESS, (id_t)gettid(), 5);
    // Let llvmpipe (OpenGL in software) use two threads. While a browser on this machine also draws in software, a
    // picture takes 5 ms less than with one thread.
    setenv("LP_NUM_THREADS", "2", 0);
    kn_renderer *r = kn_renderer_open(p->width, p->height, 1, p->error, p->error_size);
    tjhandle packer = tjInitCompress();
    uint8_t *rgba = malloc((size_t)p->width * (size_t)p->height * 4);
    p->jpeg = tjAlloc((int)kn_painter_largest(p->width, p->height));
    bool ok = r && packer && rgba && p->jpeg;
    if (r && !ok) snprintf(p->error, p->error_size, "out of memory");
    if (!ok) atomic_store(&p->stop, true);
    sem_post(&p->opened);
    for (;;) {
        // sem_wait returns early when a signal arrives.
        while (sem_wait(&p->wake) != 0)
            ;
        if (atomic_load(&p->stop)) break;
        draw(p, r, packer, rgba);
        atomic_store(&p->drawn, true);
        p->done(p->arg);
    }
    kn_renderer_close(r);
    if (packer) tjDestroy(packer);
    free(rgba);
    return NULL;
}

bool kn_painter_open(kn_painter *p, int width, int height, void (*done)(void *arg), void *arg, char *error,
                     size_t error_size)
{
    p->width = width;
    p->height = height;
    p->done = done;
    p->arg = arg;
    p->error = error;
    p->error_size = error_size;
    p->fresh = true;
    sem_init(&p->wake, 0, 0);
    sem_init(&p->opened, 0, 0);
    if (pthread_create(&p->thread, NULL, run, p) != 0) {
        snprintf(error, error_size, "no thread to draw in");
        p->width = 0;
        return false;
    }
    // sem_wait returns early when a signal arrives.
    while (sem_wait(&p->opened) != 0)
        ;
    if (!atomic_load(&p->stop)) return true;
    kn_painter_close(p);
    return false;
}

void kn_painter_draw(kn_painter *p)
{
    atomic_store(&p->drawn, false);
    sem_post(&p->wake);
}

bool kn_painter_drawn(const kn_painter *p) { return atomic_load(&p->drawn); }

void kn_painter_close(kn_painter *p)
{
    if (!p->width) return; // the painter was never opened
    atomic_store(&p->stop, true);
    sem_post(&p->wake);
    pthread_join(p->thread, NULL);
    sem_destroy(&p->wake);
    sem_destroy(&p->opened);
    tjFree(p->jpeg);
    kn_still_free(&p->still);
    p->width = 0;
}
