#include "clients/web/picture.h"
#include "clients/web/page_mesh.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <turbojpeg.h>
#include <unistd.h>

#define WIDTH 800 // size of a picture, pixels
#define HEIGHT 450
#define PERIOD_MS (1000.0 / 15) // time from one picture to the next
#define QUALITY 82              // JPEG quality at which the squares of the table stay clean
#define MOVES_MS 200            // the pointer counts as moving for this time after a pointer event

size_t kn_picture_largest(void) { return tjBufSize(WIDTH, HEIGHT, TJSAMP_420); }

// ---- drawing thread

// Draw the object as stored in `still`, and compress the picture.
static void draw(kn_picture *p, kn_renderer *r, tjhandle packer, uint8_t *rgba)
{
    kn_object_still *s = &p->still;
    unsigned long size = 0;
    bool ready = !p->fresh || kn_renderer_mesh(r, s->vertex_count, (const float(*)[3])s->rest, s->triangle_count,
                                               (const int(*)[3])s->triangle);
    // If OpenGL cannot load the mesh, this picture is empty, and the next picture tries to load the mesh again.
    p->fresh = !ready;
    if (ready) {
        s->view.xyz = (const float(*)[3])s->now;
        kn_renderer_draw(r, &s->view, rgba);
        if (tjCompress2(packer, rgba, WIDTH, 0, HEIGHT, TJPF_RGBX, &p->drawn_jpeg, &size, TJSAMP_420, QUALITY,
                        TJFLAG_NOREALLOC) != 0)
            size = 0;
    }
    p->drawn_size = size;
}

// Run the thread: open OpenGL, then draw a picture each time that the semaphore `wake` is posted.
static void *run(void *self)
{
    kn_picture *p = self;
    // On Linux this call sets the priority of the calling thread only. Threads that Mesa starts from this thread
    // inherit the priority.
    setpriority(PRIO_PROCESS, (id_t)gettid(), 5);
    snprintf(p->error, sizeof p->error, "out of memory");
    kn_renderer *r = kn_renderer_open(WIDTH, HEIGHT, 1, p->error, sizeof p->error);
    tjhandle packer = tjInitCompress();
    uint8_t *rgba = malloc((size_t)WIDTH * HEIGHT * 4);
    p->drawn_jpeg = tjAlloc((int)kn_picture_largest());
    bool ok = r && packer && rgba && p->drawn_jpeg;
    atomic_store(&p->failed, !ok);
    while (ok) {
        // Call sem_wait again if a signal has interrupted it.
        while (sem_wait(&p->wake) != 0)
            ;
        if (atomic_load(&p->stop)) break;
        draw(p, r, packer, rgba);
        atomic_store(&p->drawn, true);
        ev_async_send(p->ev, &p->painted); // wakes the main thread; only this libev call is safe in another thread
    }
    kn_renderer_close(r);
    if (packer) tjDestroy(packer);
    free(rgba);
    return NULL;
}

// ---- pictures

// Fill `still` from the newest mesh. Return false if the mesh does not belong to the last received scene. The scene
// message that belongs to the mesh then comes within a second.
static bool fill_still(kn_picture *p)
{
    kn_object_still *s = &p->still;
    char error[400];
    // If `still` already contains this mesh with older positions, only move the vertices.
    if (p->mesh_id == p->live->mesh.mesh_id) return kn_object_still_update(s, p->live), true;
    kn_view_scene view = s->view;
    kn_object_still_free(s);
    s->view = view;
    s->view.value = NULL; // forget the pointer to the values of the old mesh
    p->mesh_id = 0;
    if (!kn_object_still_live(s, p->live, error, sizeof error) || error[0]) return false;
    p->mesh_id = p->live->mesh.mesh_id;
    return p->fresh = true;
}

// The displacement is always available, because it is computed from the vertices.
bool kn_picture_measured(const kn_live_server *live, int measure)
{
    return measure == KN_MEASURE_DISPLACEMENT || (measure == KN_MEASURE_STRESS && live->mesh.stress_pa) ||
           (measure == KN_MEASURE_RESIDUAL && live->mesh.residual_strain);
}

// Colour the object by the chosen measure.
static void color(kn_picture *p)
{
    p->still.view.value = NULL;
    if (p->measure < 0 || !kn_object_still_told(&p->still, p->live, (kn_measure)p->measure)) return;
    p->top = kn_page_mesh_next_top(p->top, p->measure, kn_object_still_most(&p->still));
    kn_object_still_scale(&p->still, p->top);
}

// Draw the next picture if it is due. A picture can be late, because it waits for the next mesh message. The picture
// after a late one is due earlier, which keeps the average rate. While the user moves the pointer, a picture without
// the effect of a new pointer event is delayed a little. The thread is then free when the mesh with that effect comes.
void kn_picture_paint(kn_picture *p)
{
    if (!p->live->scene || !kn_gateway_wants(p->gateway, KN_WEB_PICTURE) || p->drawing || atomic_load(&p->failed))
        return;
    kn_page_tool_listen(p->tool);
    int64_t now_ms = kn_live_server_now_ms();
    int32_t newest = kn_page_tool_answered(p->tool, p->painting, p->live->mesh.tick);
    bool moves = kn_page_tool_idle_ms(p->tool) < MOVES_MS && newest == p->painting;
    // A mesh that comes up to a tenth of a period early is drawn and not skipped.
    if ((double)now_ms < p->due_ms + (moves ? 0.4 : -0.1) * PERIOD_MS || !fill_still(p)) return;
    kn_view_scene *view = &p->still.view;
    view->azimuth_deg = p->look.azimuth_deg;
    view->elevation_deg = p->look.elevation_deg;
    view->zoom = p->look.zoom;
    color(p);
    // Compensate for a late picture by at most one period.
    p->due_ms = fmax(p->due_ms, (double)now_ms - PERIOD_MS) + PERIOD_MS;
    p->painting = newest;
    p->drawing = true;
    atomic_store(&p->drawn, false);
    sem_post(&p->wake);
}

// Take the finished picture from the thread and send it to the pages.
static void on_painted(struct ev_loop *ev, ev_async *a, int events)
{
    (void)ev, (void)events;
    kn_picture *p = a->data;
    // This atomic load lets the main thread see everything that the drawing thread has written before.
    if (!atomic_load(&p->drawn)) return;
    p->jpeg_size = p->drawn_size;
    memcpy(p->jpeg, p->drawn_jpeg, p->jpeg_size);
    p->shown = p->painting;
    p->drawing = false;
    p->count++;
    kn_page_tool_listen(p->tool);
    kn_gateway_news(p->gateway);
}

// ---- requests

// Colour the object by a measure, if the mesh messages contain the measure. Otherwise return false.
static bool take_measure(kn_picture *p, kn_web_page *page, const char *name)
{
    int measure = strcmp(name, "none") == 0 ? -1 : KN_MEASURES;
    for (int i = 0; i < KN_MEASURES; i++)
        if (strcmp(name, kn_measure_names[i].name) == 0) measure = i;
    const bool is = measure < 0 || kn_picture_measured(p->live, measure);
    if (is && page->draws == KN_WEB_PICTURE) p->measure = measure, p->top = 0;
    else if (is) page->measure = measure;
    return is;
}

// Let a page draw the object itself, or get pictures. The drawing thread starts with the first page that wants
// pictures.
static bool take_way(kn_picture *p, kn_web_page *page, const char *name)
{
    const bool mesh = strcmp(name, "mesh") == 0;
    if (!mesh && strcmp(name, "picture") != 0) return false;
    if (!mesh && !p->runs && !p->failed && !(p->runs = pthread_create(&p->thread, NULL, run, p) == 0)) {
        snprintf(p->error, sizeof p->error, "cannot start the drawing thread");
        atomic_store(&p->failed, true);
    }
    page->draws = mesh ? KN_WEB_MESH : KN_WEB_PICTURE;
    page->surface = 0; // the page gets the surface again
    return true;
}

void kn_picture_request(kn_picture *p, int page, const kn_page_request *r)
{
    kn_web_page *of = &p->gateway->page[page];
    bool ok = true;
    const char *words = "View changed.";
    switch (r->verb) {
    case KN_VERB_DRAW:
        ok = take_way(p, of, r->name);
        words = ok ? "Drawing." : "expected mesh or picture";
        break;
    case KN_VERB_MEASURE:
        ok = take_measure(p, of, r->name);
        words = ok ? "Colours changed." : "kneadd does not publish this measure: add it to mesh.measures of the scene.";
        break;
    default:
        p->look.azimuth_deg = r->azimuth_deg;
        p->look.elevation_deg = r->elevation_deg;
        p->look.zoom = r->zoom;
    }
    kn_gateway_answer(p->gateway, page, r->id, ok, "%s", words);
}

// ---- start and stop

bool kn_picture_open(kn_picture *p)
{
    // The drawing thread must not change the environment beside other threads, so set it now. Two threads of llvmpipe
    // (OpenGL in software) take 5 ms less for a picture, while a browser on this machine also draws in software.
    setenv("LP_NUM_THREADS", "2", 0);
    setenv("LIBGL_ALWAYS_SOFTWARE", "1", 0);
    p->fresh = true;
    p->measure = -1;
    p->still.view = p->look = kn_view_scene_default();
    p->look.turns = p->still.view.turns = true;
    p->still.view.hands = true;
    if (!(p->jpeg = malloc(kn_picture_largest()))) return false;
    ev_async_init(&p->painted, on_painted);
    p->painted.data = p;
    ev_async_start(p->ev, &p->painted);
    return sem_init(&p->wake, 0, 0) == 0;
}

const char *kn_picture_trouble(const kn_picture *p) { return atomic_load(&p->failed) ? p->error : NULL; }

void kn_picture_close(kn_picture *p)
{
    if (p->runs) {
        atomic_store(&p->stop, true);
        sem_post(&p->wake);
        pthread_join(p->thread, NULL);
    }
    tjFree(p->drawn_jpeg);
    kn_object_still_free(&p->still);
    free(p->jpeg);
}
