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
    kn_page_hand *h = self;
    bool fresh;
    kn_pointer_hand_wish wish = *(const kn_pointer_hand_wish *)kn_mailbox_latest(&h->wishes, &fresh);
    // The main thread sends a wanted motion at least every 100 ms. If none comes for LET_GO_MS, the main thread hangs,
    // so the last wanted motion is too old to be followed.
    h->stale_ms = fresh ? 0 : h->stale_ms + elapsed_ms;
    wish.stale = h->stale_ms > LET_GO_MS;
    kn_hand_out out = kn_pointer_hand_tick(&h->pointer, &wish, force, elapsed_ms);
    kn_page_tool_sample sample = {.news = h->pointer.news, .work_mj = NAN, .round_trip_ms = NAN};
    if (force && force->session == h->pointer.session) {
        sample.work_mj = (float)(1e3 * force->energy_j);
        sample.round_trip_ms = (float)(1e-6 * (double)(kn_now_ns() - force->sent_ns));
    }
    // One sample for each millisecond, with those that this thread has missed or rested. If the ring is full, only
    // samples of the trace are lost.
    for (int i = 0; i < elapsed_ms && kn_ring_push(&h->samples, &sample); i++) continue;
    return out;
}

bool kn_page_tool_open(kn_page_tool *t)
{
    t->owner = -1;
    bool good = true;
    for (kn_page_hand *h = t->hand; h < t->hand + 2; h++) {
        kn_mailbox_init(&h->wishes, h->wish_slots, sizeof *h->wish_slots);
        good = kn_ring_init(&h->samples, 1024, sizeof(kn_page_tool_sample)) && good;
    }
    return good;
}

int64_t kn_page_tool_idle_ms(const kn_page_tool *t)
{
    return t->owner < 0 ? INT64_MAX : kn_live_server_now_ms() - t->gateway->page[t->owner].pointed_ms;
}

bool kn_page_tool_is_taken(const kn_page_tool *t, int page)
{
    return t->owner != page && kn_page_tool_idle_ms(t) <= IDLE_MS;
}

const kn_page_hand *kn_page_tool_told(const kn_page_tool *t)
{
    bool fine[2];
    for (int i = 0; i < 2; i++) {
        const kn_pointer_hand_news *n = &t->hand[i].news;
        fine[i] = !n->fault && (n->mode == KN_POINTER_HAND_ABSENT || (n->mode == KN_POINTER_HAND_FOLLOW && n->heard));
    }
    return &t->hand[fine[0] && !fine[1]];
}

// Send the wanted motions of the tools to the devices' threads. If the page has sent no pointer event for HELD_MS, the
// wanted motion releases the tool, so that another program can take it. The second tool is used in a grip only.
static void post_wish(kn_page_tool *t)
{
    for (kn_page_hand *h = t->hand; h < t->hand + 2; h++) {
        const bool grips = t->button == KN_BUTTON_GRIPS, first = h == t->hand;
        h->wish.held = kn_page_tool_idle_ms(t) <= HELD_MS && h->moving && h->wish.hover_z_m > 0 && (first || grips);
        h->wish.pressed = grips || (first && t->button == KN_BUTTON_PRESSES);
        *(kn_pointer_hand_wish *)kn_mailbox_back(&h->wishes) = h->wish;
        kn_mailbox_post(&h->wishes);
    }
}

// Take the samples of the devices' threads. Keep the newest states, the ticks of answered events, and the trace. End a
// grip that cannot go on with both tools: one has a fault, or has lost the object, or rises because kneadd fades its
// force.
void kn_page_tool_listen(kn_page_tool *t)
{
    for (kn_page_hand *h = t->hand; h < t->hand + 2; h++)
        for (const kn_page_tool_sample *s; (s = kn_ring_front(&h->samples)); kn_ring_pop(&h->samples)) {
            const kn_pointer_hand_news *n = &s->news;
            // The first sample with a new event carries the tick at which kneadd answered that event.
            const bool first = h == t->hand;
            if (first && n->event && n->event != h->news.event) t->event[n->event % KN_PAGE_TOOL_EVENTS].tick = n->tick;
            h->news = *n;
            h->lost_ms = n->contact ? 0 : h->lost_ms + (h->lost_ms < KN_PAGE_TOOL_LOST_MS);
            if (first) t->trace[t->traced++ % KN_PAGE_TOOL_TRACE] = *s;
        }
    if (t->button != KN_BUTTON_GRIPS) return;
    t->met = t->met || (t->grip.closes && t->hand[0].news.contact && t->hand[1].news.contact);
    for (kn_page_hand *h = t->hand; h < t->hand + 2; h++) {
        const bool now = h->news.press == h->wish.press; // the news are about this grip
        const bool off = h->news.mode > KN_POINTER_HAND_FOLLOW || !h->news.released;
        if (now && (off || (t->met && h->lost_ms == KN_PAGE_TOOL_LOST_MS) || (t->grip.closes && !h->news.presses)))
            t->button = KN_BUTTON_BARRED;
    }
}

// Return true if the hand can continue in the new scene. This is the case if the tool, the size of the object and the
// spacing of the nodes are unchanged, so that only the material differs.
static bool goes_on(const kn_page_hand *h, const kn_model_def *def, const kn_probe_def *tool)
{
    double extent_m[3];
    kn_model_def_extent(def, extent_m);
    if (!tool || !h->def) return !tool && !h->def;
    return h->moving && !tool->parts && memcmp(tool, &h->held, sizeof h->held) == 0 &&
           memcmp(extent_m, h->reach.extent_m, sizeof extent_m) == 0 && def->spacing_m == h->held_spacing_m;
}

// Stop the hand, because the scene changes or another program takes the tool.
static void let_go(kn_page_tool *t, kn_page_hand *h)
{
    if (h->moving) kn_virtual_device_stop(&h->device);
    h->moving = false;
    kn_page_tool_listen(t); // the last samples of this hand
    h->news = (kn_pointer_hand_news){.event = h->news.event, .released = true};
    if (t->button != KN_BUTTON_UP) t->button = KN_BUTTON_BARRED;
    // Reset the wanted motion, because it was made for the old object. hover_z_m = 0 means that there is no tool. Keep
    // the numbers of the last event and of the last press.
    h->wish = (kn_pointer_hand_wish){.event = h->wish.event, .press = h->wish.press};
    post_wish(t);
}

// Start a new hand with a random session number. Only 7 random bytes are used, so that the number is positive.
static void take_up(const kn_page_tool *t, kn_page_hand *h)
{
    int64_t session = 0;
    if (getrandom(&session, 7, 0) < 0) session = kn_live_server_now_ms();
    kn_pointer_hand_init(&h->pointer, h->def->shape, session);
    memset(&h->device, 0, sizeof h->device);
    h->moving = kn_virtual_device_start(&h->device, move, h, t->url, h->def->name, h->error, sizeof h->error);
}

// Choose the tool of a hand. The second tool of a grip is another round one, if the first is round. Return NULL if the
// scene has no such tool.
static const kn_probe_def *choose(const kn_page_tool *t, const kn_page_hand *h, const kn_model_def *def)
{
    const kn_probe_def *first = kn_tool_height_choose_tool(def, t->probe);
    if (h == t->hand || !first || kn_tool_height_flat(first->shape)) return h == t->hand ? first : NULL;
    for (int i = 0; i < def->probe_count; i++)
        if (&def->probe[i] != first && !kn_tool_height_flat(def->probe[i].shape)) return &def->probe[i];
    return NULL;
}

// Adapt a hand to a new scene. on: the hand goes on.
static void take_tool(kn_page_tool *t, kn_page_hand *h, const kn_scene *scene, const kn_probe_def *tool, bool on)
{
    if (!on) let_go(t, h);
    // Prepare the translation from pointer to tool (`reach`) anew in any case, because it depends on the scene.
    kn_pointer_hand_reach_close(&h->reach);
    h->def = tool;
    snprintf(h->error, sizeof h->error, "out of memory");
    if (!tool || !kn_pointer_hand_reach_open(&h->reach, &scene->model, tool)) {
        if (on) let_go(t, h);
        return;
    }
    h->held = *tool;
    h->held_spacing_m = scene->model.spacing_m;
    // While a recording is being played, it moves the tool, so the hand of `knead web` stays stopped.
    if (!on && !(t->lent && h == t->hand)) take_up(t, h);
}

bool kn_page_tool_scene(kn_page_tool *t)
{
    const kn_scene *scene = t->live->scene;
    if (!scene || (scene == t->scene && scene->text_hash == t->scene_hash)) return false;
    t->scene = scene;
    t->scene_hash = scene->text_hash;
    const kn_probe_def *tool[2] = {choose(t, &t->hand[0], &scene->model), choose(t, &t->hand[1], &scene->model)};
    const bool on = goes_on(&t->hand[0], &scene->model, tool[0]) && goes_on(&t->hand[1], &scene->model, tool[1]);
    for (int i = 0; i < 2; i++) take_tool(t, &t->hand[i], scene, tool[i], on);
    return true;
}

// Return true if a hand can follow the pointer: its device runs, and the mesh is that of the scene.
static bool able(const kn_page_tool *t, const kn_page_hand *h)
{
    return h->moving && kn_pointer_hand_reach_fits(&h->reach, &t->live->mesh);
}

void kn_page_tool_mesh(kn_page_tool *t)
{
    for (kn_page_hand *h = t->hand; h < t->hand + 2; h++)
        if (able(t, h)) kn_pointer_hand_reach_hover(&h->reach, &t->live->mesh, &h->wish);
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

// Grip with both tools. The tools close when both have come down beside the object.
static void grip(kn_page_tool *t, const kn_web_message *m)
{
    const float sight[2][3] = {{m->sight[0], m->sight[1], m->sight[2]}, {m->second[0], m->second[1], m->second[2]}};
    const kn_mesh *mesh = &t->live->mesh;
    kn_page_hand *h = t->hand;
    if (t->button == KN_BUTTON_UP) {
        t->button = !able(t, &h[1])                                     ? KN_BUTTON_BARRED
                    : kn_pointer_hand_grip_begin(&t->grip, mesh, sight) ? KN_BUTTON_GRIPS
                                                                        : KN_BUTTON_STEEP;
        for (int i = 0; i < 2; i++) {
            h[i].wish.press++, h[i].wish.depth_m = 0;
            h[i].wish.touch_z_m = h[i].wish.flush_z_m = h[i].wish.hover_z_m;
        }
        t->met = false;
    }
    if (t->button != KN_BUTTON_GRIPS) return;
    bool down = true;
    for (int i = 0; i < 2; i++)
        down = down && h[i].news.press == h[i].wish.press && h[i].news.there && h[i].wish.depth_m > 0;
    t->grip.closes = t->grip.closes || down;
    for (int i = 0; i < 2; i++)
        if (t->grip.closes && h[i].news.contact && t->grip.lowest_m[i] == 0)
            t->grip.lowest_m[i] = h[i].wish.touch_z_m - h[i].wish.depth_m;
    kn_pointer_hand_grip_aim(&t->grip, (const kn_pointer_hand_reach *[]){&h[0].reach, &h[1].reach}, mesh, m->eye_m,
                             sight, (kn_pointer_hand_wish *[]){&h[0].wish, &h[1].wish});
}

// Aim the tool at the pointer, press with it, or release it.
static void press(kn_page_tool *t, const kn_web_message *m)
{
    kn_page_hand *h = t->hand;
    // true if the tool has reached the surface at which the press began
    const bool met = t->button == KN_BUTTON_PRESSES && h->news.depth_m > 0;
    // Aim the tool at the pointer while the button is up. During a press, aim only after the tool has reached the
    // surface, so that the user can stroke the object. Before that, the tool comes down where the press began.
    if (t->button == KN_BUTTON_UP || met) kn_pointer_hand_reach_aim(&h->reach, m->eye_m, m->sight, &h->wish);
    // A press begins if the object is under the tool. A press beside the object has no effect until the button is
    // released. A grip that one finger has left is over, and the other finger must leave, too.
    if (!m->pressed) {
        t->button = KN_BUTTON_UP;
    } else if (t->button == KN_BUTTON_UP) {
        t->button =
            kn_pointer_hand_reach_touch(&h->reach, &t->live->mesh, &h->wish) ? KN_BUTTON_PRESSES : KN_BUTTON_BESIDE;
        h->wish.press++;
    } else if (t->button == KN_BUTTON_GRIPS) t->button = KN_BUTTON_BARRED;
    h->wish.pressed = t->button == KN_BUTTON_PRESSES;
    memset(h->wish.axis, 0, sizeof h->wish.axis);
    h->wish.depth_m = fmin((double)m->depth_m, kn_pointer_hand_reach_deepest(&h->reach, &h->wish));
}

void kn_page_tool_point(kn_page_tool *t, int page, const kn_web_message *m)
{
    kn_web_page *p = &t->gateway->page[page];
    if (kn_page_tool_is_taken(t, page)) return;
    if (t->owner != page) t->button = KN_BUTTON_UP;
    t->owner = page;
    p->pointed_ms = kn_live_server_now_ms();
    // Without a tool or a matching mesh, ignore a press until the button has been released.
    if (!able(t, &t->hand[0])) {
        t->button = m->pressed ? KN_BUTTON_BARRED : KN_BUTTON_UP;
        return post_wish(t);
    }
    kn_page_tool_listen(t);
    if (m->kind == KN_WEB_GRIP) grip(t, m);
    else press(t, m);
    // Number the event, so that a page can find out which of its events a picture shows.
    if (m->number != p->event) {
        int32_t n = ++t->hand[0].wish.event % KN_PAGE_TOOL_EVENTS;
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
    for (int32_t n = t->hand[0].wish.event; n > since && n > t->hand[0].wish.event - KN_PAGE_TOOL_EVENTS; n--)
        if (t->event[n % KN_PAGE_TOOL_EVENTS].tick <= tick) return n;
    return since;
}

uint32_t kn_page_tool_event(const kn_page_tool *t, int32_t event, int page)
{
    const int n = event % KN_PAGE_TOOL_EVENTS;
    return event > t->hand[0].wish.event - KN_PAGE_TOOL_EVENTS && t->event[n].page == page ? t->event[n].number : 0;
}

void kn_page_tool_lend(kn_page_tool *t, int recording)
{
    let_go(t, t->hand);
    t->lent = recording;
}

void kn_page_tool_take_back(kn_page_tool *t)
{
    t->lent = 0;
    if (t->hand->def && t->hand->reach.top) take_up(t, t->hand);
}

void kn_page_tool_close(kn_page_tool *t)
{
    post_wish(t);
    // Wait while the hands lift their tools.
    for (int i = 0; i < 300; i++) {
        bool works = false;
        for (int k = 0; k < 2; k++) works |= t->hand[k].moving && t->hand[k].news.mode != KN_POINTER_HAND_ABSENT;
        if (!works) break;
        usleep(10000);
        kn_page_tool_listen(t);
    }
    for (kn_page_hand *h = t->hand; h < t->hand + 2; h++) {
        if (h->moving) kn_virtual_device_stop(&h->device);
        kn_pointer_hand_reach_close(&h->reach);
        kn_ring_free(&h->samples);
    }
}
