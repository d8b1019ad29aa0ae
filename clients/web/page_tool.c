#include "clients/web/page_tool.h"
#include "clients/hand/tool_height.h"
#include "server/clock.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

// A page on which the user presses sends a message every 50 ms. If the page sends no message for LET_GO_MS, it counts
// as gone. The main thread is supervised in the same way: if the device's thread gets no wanted motion from it for
// LET_GO_MS, the device's thread lifts the tool.
#define LET_GO_MS 400
#define IDLE_MS 2000 // after this time without pointer events another page may take the tool
#define HELD_MS 5000 // after this time without pointer events another program may take the tool

// Compute the next pose of the tool from the newest wanted motion. This function runs every ms in the device's thread.
static kn_hand_out move(void *self, const kn_hand_force *force, int elapsed_ms)
{
    kn_page_tool *t = self;
    bool fresh;
    kn_pointer_hand_wish wish = *(const kn_pointer_hand_wish *)kn_mailbox_latest(&t->wishes, &fresh);
    // The main thread sends a wanted motion at least every 100 ms. If none comes for LET_GO_MS, the main thread hangs,
    // so the last wanted motion is too old to be followed.
    t->stale_ms = fresh ? 0 : t->stale_ms + elapsed_ms;
    wish.stale = t->stale_ms > LET_GO_MS;
    kn_hand_out out = kn_pointer_hand_tick(&t->pointer, &wish, force, elapsed_ms);
    kn_page_tool_sample sample = {.news = t->pointer.news, .work_mj = NAN, .round_trip_ms = NAN};
    if (force && force->session == t->pointer.session) {
        sample.work_mj = (float)(1e3 * force->energy_j);
        sample.round_trip_ms = (float)(1e-6 * (double)(kn_now_ns() - force->sent_ns));
    }
    kn_ring_push(&t->samples, &sample); // if the ring is full, only this sample of the trace is lost
    return out;
}

bool kn_page_tool_open(kn_page_tool *t)
{
    t->owner = -1;
    kn_mailbox_init(&t->wishes, t->wish_slots, sizeof *t->wish_slots);
    return kn_ring_init(&t->samples, 1024, sizeof(kn_page_tool_sample));
}

int64_t kn_page_tool_idle_ms(const kn_page_tool *t)
{
    return t->owner < 0 ? INT64_MAX : kn_live_server_now_ms() - t->gateway->page[t->owner].pointed_ms;
}

bool kn_page_tool_is_taken(const kn_page_tool *t, int page)
{
    return t->owner != page && kn_page_tool_idle_ms(t) <= IDLE_MS;
}

// Send the wanted motion of the tool to the device's thread. If the page has sent no pointer event for HELD_MS, the
// wanted motion releases the tool, so that another program can take it.
static void post_wish(kn_page_tool *t)
{
    t->wish.held = kn_page_tool_idle_ms(t) <= HELD_MS && t->moving && t->wish.hover_z_m > 0;
    t->wish.pressed = t->button == KN_BUTTON_PRESSES;
    *(kn_pointer_hand_wish *)kn_mailbox_back(&t->wishes) = t->wish;
    kn_mailbox_post(&t->wishes);
}

// Take the samples of the device's thread. Keep the newest state, the ticks of answered events, and the trace.
void kn_page_tool_listen(kn_page_tool *t)
{
    for (const kn_page_tool_sample *s; (s = kn_ring_front(&t->samples)); kn_ring_pop(&t->samples)) {
        const kn_pointer_hand_news *n = &s->news;
        // The first sample with a new event carries the tick at which kneadd answered that event.
        if (n->event && n->event != t->news.event) t->event[n->event % KN_PAGE_TOOL_EVENTS].tick = n->tick;
        t->news = *n;
        t->trace[t->traced++ % KN_PAGE_TOOL_TRACE] = *s;
    }
}

// Return true if the hand can continue in the new scene. This is the case if the tool, the size of the object and the
// spacing of the nodes are unchanged, so that only the material differs.
static bool goes_on(const kn_page_tool *t, const kn_probe_def *tool)
{
    double extent_m[3];
    const kn_model_def *def = &t->live->scene->model;
    kn_model_def_extent(def, extent_m);
    return t->moving && tool && !tool->parts && memcmp(tool, &t->held, sizeof t->held) == 0 &&
           memcmp(extent_m, t->reach.extent_m, sizeof extent_m) == 0 && def->spacing_m == t->held_spacing_m;
}

// Stop the hand, because the scene changes or another program takes the tool.
static void let_go(kn_page_tool *t)
{
    if (t->moving) kn_virtual_device_stop(&t->device);
    t->moving = false;
    if (t->button != KN_BUTTON_UP) t->button = KN_BUTTON_BARRED;
    // Reset the wanted motion, because it was made for the old object. hover_z_m = 0 means that there is no tool. Keep
    // the numbers of the last event and of the last press.
    t->wish = (kn_pointer_hand_wish){.event = t->wish.event, .press = t->wish.press};
    post_wish(t);
}

// Start a new hand with a random session number. Only 7 random bytes are used, so that the number is positive.
static void take_up(kn_page_tool *t)
{
    int64_t session = 0;
    if (getrandom(&session, 7, 0) < 0) session = kn_live_server_now_ms();
    kn_pointer_hand_init(&t->pointer, t->def->shape, session);
    memset(&t->device, 0, sizeof t->device);
    t->moving = kn_virtual_device_start(&t->device, move, t, t->url, t->def->name, t->error, sizeof t->error);
}

bool kn_page_tool_scene(kn_page_tool *t)
{
    const kn_scene *scene = t->live->scene;
    if (!scene || (scene == t->scene && scene->text_hash == t->scene_hash)) return false;
    const kn_probe_def *tool = kn_tool_height_choose_tool(&scene->model, t->probe);
    const bool on = goes_on(t, tool);
    if (!on) let_go(t);
    // Prepare the translation from pointer to tool (`reach`) anew in any case, because it depends on the scene.
    kn_pointer_hand_reach_close(&t->reach);
    t->scene = scene;
    t->scene_hash = scene->text_hash;
    t->def = tool;
    snprintf(t->error, sizeof t->error, "out of memory");
    if (!tool || !kn_pointer_hand_reach_open(&t->reach, &scene->model, tool)) {
        if (on) let_go(t);
        return true;
    }
    t->held = *tool;
    t->held_spacing_m = scene->model.spacing_m;
    // While a recording is being played, it moves the tool, so the hand of `knead web` stays stopped.
    if (!on && !t->lent) take_up(t);
    return true;
}

void kn_page_tool_mesh(kn_page_tool *t)
{
    if (t->moving && kn_pointer_hand_reach_fits(&t->reach, &t->live->mesh))
        kn_pointer_hand_reach_hover(&t->reach, &t->live->mesh, &t->wish);
    post_wish(t);
}

void kn_page_tool_turn(kn_page_tool *t)
{
    kn_page_tool_listen(t);
    // If a page presses and sends nothing for LET_GO_MS, lift the tool. The page can press again only after the button
    // has been released.
    if (t->button != KN_BUTTON_UP && kn_page_tool_idle_ms(t) > LET_GO_MS) t->button = KN_BUTTON_BARRED;
    post_wish(t);
}

void kn_page_tool_point(kn_page_tool *t, int page, const kn_web_message *m)
{
    kn_web_page *p = &t->gateway->page[page];
    if (kn_page_tool_is_taken(t, page)) return;
    if (t->owner != page) t->button = KN_BUTTON_UP;
    t->owner = page;
    p->pointed_ms = kn_live_server_now_ms();
    // Without a tool or a matching mesh, ignore a press until the button has been released.
    if (!t->moving || !kn_pointer_hand_reach_fits(&t->reach, &t->live->mesh)) {
        t->button = m->pressed ? KN_BUTTON_BARRED : KN_BUTTON_UP;
        return post_wish(t);
    }
    kn_page_tool_listen(t);
    // true if the tool has reached the surface at which the press began
    const bool met = t->button == KN_BUTTON_PRESSES && t->news.depth_m > 0;
    // Aim the tool at the pointer while the button is up. During a press, aim only after the tool has reached the
    // surface, so that the user can stroke the object. Before that, the tool comes down where the press began.
    if (t->button == KN_BUTTON_UP || met) kn_pointer_hand_reach_aim(&t->reach, m->eye_m, m->sight, &t->wish);
    // A press begins if the object is under the tool. A press beside the object has no effect until the button is
    // released.
    if (!m->pressed) {
        t->button = KN_BUTTON_UP;
    } else if (t->button == KN_BUTTON_UP) {
        t->button =
            kn_pointer_hand_reach_touch(&t->reach, &t->live->mesh, &t->wish) ? KN_BUTTON_PRESSES : KN_BUTTON_BESIDE;
        t->wish.press++;
    }
    t->wish.pressed = t->button == KN_BUTTON_PRESSES;
    t->wish.depth_m = fmin((double)m->depth_m, kn_pointer_hand_reach_deepest(&t->reach, &t->wish));
    // Number the event, so that a page can find out which of its events a picture shows.
    if (m->number != p->event) {
        int32_t n = ++t->wish.event % KN_PAGE_TOOL_EVENTS;
        t->event[n].number = p->event = m->number;
        t->event[n].page = page;
        t->event[n].tick = INT64_MAX;
    }
    post_wish(t);
}

void kn_page_tool_gone(kn_page_tool *t, int page)
{
    for (int i = 0; i < KN_PAGE_TOOL_EVENTS; i++)
        if (t->event[i].page == page) t->event[i].page = -1;
    // If this page had the tool, lift the tool.
    if (t->owner != page) return;
    t->owner = -1;
    t->button = KN_BUTTON_UP;
    post_wish(t);
}

int32_t kn_page_tool_answered(const kn_page_tool *t, int32_t since, int64_t tick)
{
    for (int32_t n = t->wish.event; n > since && n > t->wish.event - KN_PAGE_TOOL_EVENTS; n--)
        if (t->event[n % KN_PAGE_TOOL_EVENTS].tick <= tick) return n;
    return since;
}

uint32_t kn_page_tool_event(const kn_page_tool *t, int32_t event, int page)
{
    const int n = event % KN_PAGE_TOOL_EVENTS;
    return event > t->wish.event - KN_PAGE_TOOL_EVENTS && t->event[n].page == page ? t->event[n].number : 0;
}

void kn_page_tool_lend(kn_page_tool *t, int recording)
{
    let_go(t);
    t->lent = recording;
}

void kn_page_tool_take_back(kn_page_tool *t)
{
    t->lent = 0;
    if (t->def && t->reach.top) take_up(t);
}

void kn_page_tool_close(kn_page_tool *t)
{
    post_wish(t);
    for (int i = 0; t->moving && i < 50 && t->news.mode != KN_POINTER_HAND_ABSENT; i++)
        usleep(10000), kn_page_tool_listen(t); // wait while the hand lifts the tool
    if (t->moving) kn_virtual_device_stop(&t->device);
    kn_pointer_hand_reach_close(&t->reach);
    kn_ring_free(&t->samples);
}
