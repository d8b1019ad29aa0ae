// Grip of a page on the tool: choice of the tool, choice of the page that has it, and wishes to the device's thread.
#include "clients/knead/foot.h"
#include "clients/web/web.h"
#include "server/clock.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

#define IDLE_MS 2000 // after this time without pointer events another page may take the tool
#define HELD_MS 5000 // after this time without pointer events another program may take the tool

// Compute the next pose of the tool from the newest wish. This function runs every ms in the device's thread.
static kn_hand_out move(void *self, const kn_hand_force *force, int elapsed_ms)
{
    kn_web *w = self;
    bool fresh;
    kn_pointer_wish wish = *(const kn_pointer_wish *)kn_mailbox_latest(&w->wishes, &fresh);
    // The main thread posts a wish at least every 100 ms. If no wish comes for KN_WEB_LET_GO_MS, the main thread stands
    // still, so the wish counts as stale.
    w->stale_ms = fresh ? 0 : w->stale_ms + elapsed_ms;
    wish.stale = w->stale_ms > KN_WEB_LET_GO_MS;
    kn_hand_out out = kn_pointer_tick(&w->pointer, &wish, force, elapsed_ms);
    kn_web_sample sample = {.news = w->pointer.news, .work_mj = NAN, .round_trip_ms = NAN};
    if (force && force->session == w->pointer.session) {
        sample.work_mj = (float)(1e3 * force->energy_j);
        sample.round_trip_ms = (float)(1e-6 * (double)(kn_now_ns() - force->sent_ns));
    }
    kn_ring_push(&w->samples, &sample); // if the ring is full, only this sample of the trace is lost
    return out;
}

// Post the current wish to the device's thread. If the page has sent no pointer event for HELD_MS, the wish lets the
// tool leave.
void kn_web_post_wish(kn_web *w)
{
    const bool used = w->owner >= 0 && kn_live_now_ms() - w->gateway.page[w->owner].pointed_ms <= HELD_MS;
    w->wish.held = used && w->moving && w->wish.hover_z_m > 0;
    w->wish.pressed = w->button == KN_BUTTON_PRESSES;
    *(kn_pointer_wish *)kn_mailbox_back(&w->wishes) = w->wish;
    kn_mailbox_post(&w->wishes);
}

// Take the samples of the device's thread: the newest state, the ticks of answered events, and the trace.
void kn_web_take_samples(kn_web *w)
{
    for (const kn_web_sample *s; (s = kn_ring_front(&w->samples)); kn_ring_pop(&w->samples)) {
        const kn_pointer_news *n = &s->news;
        // The first sample with a new event carries the tick at which kneadd answered that event.
        if (n->event && n->event != w->news.event) w->event[n->event % KN_WEB_EVENTS].tick = n->tick;
        w->news = *n;
        w->trace[w->traced++ % KN_WEB_TRACE] = *s;
    }
}

// Return true if the hand can continue in the new scene. This is the case if the tool, the size of the object and the
// spacing of the nodes are unchanged, so that only the material differs.
static bool goes_on(const kn_web *w, const kn_probe_def *tool)
{
    double extent_m[3];
    const kn_model_def *def = &w->live.scene->model;
    kn_model_def_extent(def, extent_m);
    return w->moving && tool && !tool->parts && memcmp(tool, &w->held, sizeof w->held) == 0 &&
           memcmp(extent_m, w->reach.extent_m, sizeof extent_m) == 0 && def->spacing_m == w->held_spacing_m;
}

// Stop the hand, because the scene changes or another program takes the tool.
void kn_web_let_go(kn_web *w)
{
    if (w->moving) kn_device_stop(&w->device);
    w->moving = false;
    if (w->button != KN_BUTTON_UP) w->button = KN_BUTTON_BARRED;
    // Reset the wish, because it was made for the old object. hover_z_m = 0 means that there is no tool. The numbers of
    // event and press continue.
    w->wish = (kn_pointer_wish){.event = w->wish.event, .press = w->wish.press};
    kn_web_post_wish(w);
}

// Start a new hand with a random session number. Only 7 random bytes are used, so that the number is positive.
void kn_web_take_up(kn_web *w)
{
    int64_t session = 0;
    if (getrandom(&session, 7, 0) < 0) session = kn_live_now_ms();
    kn_pointer_init(&w->pointer, w->tool->shape, session);
    memset(&w->device, 0, sizeof w->device);
    w->moving = kn_device_start(&w->device, move, w, w->url, w->tool->name, w->error, sizeof w->error);
}

kn_camera_view kn_web_camera(const kn_web *w)
{
    return (kn_camera_view){.azimuth_deg = w->look.azimuth_deg,
                            .elevation_deg = w->look.elevation_deg,
                            .zoom = w->look.zoom,
                            .turns = w->look.turns,
                            .aspect = (float)w->width / (float)w->height};
}

// Adapt to a new scene: choose the tool, and restart the hand unless it can continue.
void kn_web_take_scene(kn_web *w)
{
    if (!w->live.scene || (w->live.scene == w->scene && w->live.scene->text_hash == w->scene_hash)) return;
    const kn_probe_def *tool = kn_foot_choose_tool(&w->live.scene->model, w->probe);
    const bool on = goes_on(w, tool);
    if (!on) kn_web_let_go(w);
    // The reach depends on the scene and must be opened again in any case.
    kn_reach_close(&w->reach);
    w->scene = w->live.scene;
    w->scene_hash = w->scene->text_hash;
    w->mesh_id = 0;
    w->tool = tool;
    kn_vitals_touch(&w->vitals, tool ? tool->name : NULL);
    kn_web_count(w);
    kn_web_refresh(w);
    snprintf(w->error, sizeof w->error, "out of memory");
    const kn_camera_view view = kn_web_camera(w);
    if (!tool || !kn_reach_open(&w->reach, &w->live.scene->model, tool, &view)) {
        if (on) kn_web_let_go(w);
        return;
    }
    w->held = *tool;
    w->held_spacing_m = w->live.scene->model.spacing_m;
    // While a recording that is played moves the tool, the hand stays stopped.
    if (!on && !w->lent) kn_web_take_up(w);
}

// ---- messages of a page

bool kn_web_is_taken(const kn_web *w, int page)
{
    return w->owner >= 0 && w->owner != page && kn_live_now_ms() - w->gateway.page[w->owner].pointed_ms <= IDLE_MS;
}

// Handle a pointer event: take the tool if it is free, aim, press or release.
static void point(kn_web *w, int page, const kn_web_message *m)
{
    kn_web_page *p = &w->gateway.page[page];
    if (kn_web_is_taken(w, page)) return;
    if (w->owner != page) w->button = KN_BUTTON_UP;
    w->owner = page;
    p->pointed_ms = kn_live_now_ms();
    // Without a tool or a matching mesh, a press counts only after the button has been up.
    if (!w->moving || !kn_reach_fits(&w->reach, &w->live.mesh)) {
        if (m->pressed) w->button = KN_BUTTON_BARRED;
        return;
    }
    kn_web_take_samples(w);
    // True if the tool has reached the object's surface that was visible when the press began.
    const bool met = w->button == KN_BUTTON_PRESSES && w->news.depth_m > 0;
    // Move the goal of the tool to the pointer while the button is up, or during a stroke. A press that has not reached
    // the surface yet keeps its place.
    if (w->button == KN_BUTTON_UP || (met && !w->turned)) kn_reach_aim(&w->reach, m->u, m->v, &w->wish);
    // A press starts where the object is; a press beside the object does nothing until the button is up.
    if (!m->pressed) {
        w->button = KN_BUTTON_UP;
    } else if (w->button == KN_BUTTON_UP) {
        w->button = kn_reach_touch(&w->reach, &w->live.mesh, &w->wish) ? KN_BUTTON_PRESSES : KN_BUTTON_BESIDE;
        w->turned = false;
        w->wish.press++;
    }
    w->wish.pressed = w->button == KN_BUTTON_PRESSES;
    w->wish.depth_m = fmin(m->depth_m, kn_reach_deepest(&w->reach, &w->wish));
    // Number the event, so that a picture can say which events it shows.
    if (m->number != p->event) {
        int32_t n = ++w->wish.event % KN_WEB_EVENTS;
        w->event[n].number = p->event = m->number;
        w->event[n].page = page;
        w->event[n].tick = INT64_MAX;
    }
    kn_web_post_wish(w);
}

void kn_web_on_message(void *self, int page, const kn_web_message *m) { point(self, page, m); }

// Forget a page in all pending work, because its place may be given to another page.
void kn_web_on_gone(void *self, int page)
{
    kn_web *w = self;
    for (int i = 0; i < KN_WEB_EVENTS; i++)
        if (w->event[i].page == page) w->event[i].page = -1;
    if (w->png_page == page) w->png_page = -1;
    if (w->replayed.page == page) w->replayed.page = -1;
    for (int i = 0; i < KN_ASKER_CALLS; i++)
        if (w->asked[i].page == page) w->asked[i].page = -1;
    w->waiting[page].count = 0;
    if (w->ordered_by == page) w->ordered_by = -1;
    // The page that had the tool is gone, so lift the tool.
    if (w->owner != page) return;
    w->owner = -1;
    w->button = KN_BUTTON_UP;
    kn_web_post_wish(w);
}
