// Messages to the pages. Every message contains the present state, and the newest mesh or picture if the page does not
// have it yet. Facts that change rarely (`about`) are added only when they have changed.
#include "clients/web/web.h"
#include "core/scene/scene.h"
#include "core/lattice/measure.h"
#include "proto/knead_event_t.h"
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UNHEARD_MS 1000 // if no mesh message arrives for this time, kneadd counts as not running
#define STALE_MS 3500   // a message that normally comes once a second counts as missing above this age, ms

// ---- messages of kneadd

// Message handlers: each keeps the newest message of its channel.
static void on_status(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    kn_page_state *s = user;
    knead_status_t heard;
    if (knead_status_t_decode(buffer->data, 0, (int)buffer->data_size, &heard) < 0) return;
    s->status = heard;
    s->status_ms = kn_live_server_now_ms();
}

static void on_health(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    kn_page_state *s = user;
    knead_health_t heard;
    if (knead_health_t_decode(buffer->data, 0, (int)buffer->data_size, &heard) < 0) return;
    s->health = heard;
    s->health_ms = kn_live_server_now_ms();
}

// Keep the energies of kneadd's energy audit. Only events of the kind checkpoint contain them.
static void on_event(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    kn_page_state *s = user;
    knead_event_t e;
    if (knead_event_t_decode(buffer->data, 0, (int)buffer->data_size, &e) < 0) return;
    if (e.kind != KNEAD_EVENT_T_KIND_CHECKPOINT || !isfinite(e.arg[1]) || !isfinite(e.arg[2])) return;
    s->stored_j = e.arg[1];
    s->work_j = e.arg[2];
    s->energy_ms = kn_live_server_now_ms();
}

// Keep the contact patch of the chosen probe. The subscription delivers the patches of all probes.
static void on_touch(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_page_state *s = user;
    knead_touch_patch_t heard;
    if (strcmp(channel, s->touch_channel) != 0) return;
    if (knead_touch_patch_t_decode(buffer->data, 0, (int)buffer->data_size, &heard) < 0) return;
    s->touch = heard;
    s->touch_ms = kn_live_server_now_ms();
}

// Count the bytes of the mesh messages, from which the page's data rate is computed.
static void on_mesh(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel;
    ((kn_page_state *)user)->all_mesh_bytes += buffer->data_size;
}

bool kn_page_state_open(kn_web *w)
{
    kn_page_state *s = &w->state;
    return kn_bus_client_hear(w->live.mesh_bus, "KNEAD_MESH_UPDATE", on_mesh, s) &&
           kn_bus_client_hear(w->live.bus, "KNEAD_STATUS", on_status, s) &&
           kn_bus_client_hear(w->live.bus, "KNEAD_HEALTH", on_health, s) &&
           kn_bus_client_hear(w->live.bus, "KNEAD_EVENT", on_event, s) &&
           kn_bus_client_hear(w->live.bus, "KNEAD_TOUCH_*", on_touch, s);
}

// Return a limit below which at least the fraction `share` of the tick times lies: the smallest power of two with this
// property, us. Return 0 if no ticks have been counted yet. histogram[n]: number of ticks shorter than 2^n us and not
// counted in a lower bucket.
static int64_t share_us(const int64_t histogram[32], double share)
{
    int64_t all = 0, seen = 0;
    for (int i = 0; i < 32; i++) all += histogram[i];
    // Find the bucket in which the cumulative count reaches the share. Bucket n counts ticks of less than 2^n us.
    if (all <= 0) return 0;
    int bucket = 0;
    while (bucket < 31 && (double)(seen += histogram[bucket]) < share * (double)all) bucket++;
    return (int64_t)1 << bucket;
}

// ---- state of the tool

static bool stale(int64_t heard_ms) { return !heard_ms || kn_live_server_now_ms() - heard_ms > STALE_MS; }

// Return true if the tool is in contact with a force that the page shows. Beside an edge a contact can carry none.
static bool touches(const kn_pointer_hand_news *n) { return n->contact && n->force_n >= 0.005; }

// Write the status of the tool in words. Return the kind of the status: "ok", "wait" or "fault". The first condition
// that holds decides.
static const char *status(const kn_web *w, int page, char *words, size_t size)
{
    const kn_page_hand *hand = kn_page_tool_told(&w->tool);
    const kn_pointer_hand_news *n = &hand->news;
    const bool grips = w->tool.button == KN_BUTTON_GRIPS;
#define SAY(level, ...) return snprintf(words, size, __VA_ARGS__), level
#define SAY_FAULT(fault)                                                                                               \
    SAY("fault", "force set to zero: %s. To continue: %s", kn_fault_name(fault), kn_fault_remedy(fault))
    if (w->live.scene_error[0]) SAY("fault", "cannot read the scene that is served: %s", w->live.scene_error);
    if (kn_live_server_now_ms() - w->state.mesh_ms > UNHEARD_MS) SAY("wait", "waiting for kneadd: nothing is served");
    if (!w->live.scene) SAY("wait", "waiting for the scene");
    if (!w->tool.hand[0].def) SAY("fault", "the scene has no probe%s%s", w->probe ? " " : "", w->probe ? w->probe : "");
    // An emergency stop applies to all tools, even if this page has no tool.
    if (!stale(w->state.status_ms) && w->state.status.mode == KNEAD_STATUS_T_MODE_ESTOP) SAY_FAULT(KN_FAULT_ESTOP);
    if (w->tool.lent) SAY("wait", "recording %d is being played", w->tool.lent);
    for (int i = 0; i < 2; i++)
        if (w->tool.hand[i].def && !w->tool.hand[i].moving) SAY("fault", "no device: %.300s", w->tool.hand[i].error);
    // The conditions from here on depend on the tool: first faults, then reasons to wait, then contact.
    if (!kn_pointer_hand_reach_fits(&w->tool.hand[0].reach, &w->live.mesh))
        SAY("wait", "waiting for the mesh of this scene");
    if (kn_page_tool_is_taken(&w->tool, page)) SAY("wait", "another page holds the tool");
    if (n->mode == KN_POINTER_HAND_SILENT) SAY("fault", "force is zero; a new session begins in a moment");
    if (n->fault > KN_FAULT_IMPULSE && n->fault != KN_FAULT_OVERLOAD) SAY_FAULT((kn_fault)n->fault);
    if (n->fault || n->mode == KN_POINTER_HAND_LET_GO)
        SAY("fault", "force set to zero: %s. The tool lifts; let go, then press again",
            n->fault ? kn_fault_name((kn_fault)n->fault) : "no force for 20 ms");
    const char *trouble = kn_picture_trouble(&w->picture);
    if (trouble && w->gateway.page[page].draws == KN_WEB_PICTURE && w->tool.button == KN_BUTTON_UP)
        SAY("fault", "no pictures: knead web cannot draw here: %s", trouble);
    if (n->mode == KN_POINTER_HAND_ABSENT && w->tool.button == KN_BUTTON_UP) SAY("ok", "ready: press on the object");
    if (!n->heard && n->mode == KN_POINTER_HAND_FOLLOW)
        SAY("wait", "no force from kneadd: does another hand hold %s?", hand->def->name);
    if (!n->released || w->tool.button == KN_BUTTON_BARRED) SAY("wait", "let go, then press again");
    if (!(n->flags & KN_FLAG_ENGAGED))
        SAY("wait", n->contact ? "poses were late: the force fades and returns" : "engaging");
    if (w->tool.button == KN_BUTTON_STEEP)
        SAY("wait", "to grip, look at a side of the object: press Front, Side or Corner");
    if (w->tool.button == KN_BUTTON_BESIDE) SAY("wait", "nothing is under the tool here");
    if (n->flags & KN_FLAG_CLAMPED) SAY("ok", "in contact; the force is at the device's limit");
    if (touches(n)) SAY("ok", "in contact");
    SAY("ok", w->tool.button == KN_BUTTON_UP  ? "ready: press on the object"
              : grips && !w->tool.grip.closes ? "both tools move beside the object"
              : grips                         ? "move the fingers together to grip"
              : n->depth_m > 0                ? "held still: no contact force"
                                              : "moving down");
#undef SAY_FAULT
#undef SAY
}

// Writer of JSON text into a buffer of fixed size. Text beyond the end of the buffer is dropped.
typedef struct json {
    char *at, *end;
} json;

__attribute__((format(printf, 2, 3))) static void put(json *t, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    int n = vsnprintf(t->at, (size_t)(t->end - t->at), format, args);
    va_end(args);
    t->at = n < t->end - t->at ? t->at + n : t->end - 1;
}

// Write a member of a JSON object with a string value, escaped for JSON.
static void put_words(json *t, const char *name, const char *words)
{
    put(t, ",\"%s\":\"", name);
    for (; *words; words++)
        put(t, (unsigned char)*words < ' ' || *words == '"' || *words == '\\' ? "\\u%04x" : "%c", *words);
    put(t, "\"");
}

// ---- present state

enum { FORCE, DEPTH, WORK, ROUND_TRIP, TRACES };

static double traced(const kn_page_tool_sample *s, int which)
{
    switch (which) {
    case FORCE: return s->news.force_n;
    case DEPTH: return 1e3 * s->news.depth_m;
    case WORK: return (double)s->work_mj;
    default: return (double)s->round_trip_ms;
    }
}

// Write one number per millisecond since this page's last message; null: no value in that millisecond.
static void put_traces(kn_web *w, kn_web_page *p, json *t)
{
    static const char *const names[TRACES] = {"force", "depth", "work", "trip"};
    if (p->about == 0) p->told = w->tool.traced; // a new page begins with the present
    // A page that got no message for a long time gets only the samples that are still kept.
    if (w->tool.traced - p->told > KN_PAGE_TOOL_TRACE)
        p->told = w->tool.traced < KN_PAGE_TOOL_TRACE ? 0 : w->tool.traced - KN_PAGE_TOOL_TRACE;
    put(t, ",\"trace\":{");
    for (int k = 0; k < TRACES; k++) {
        put(t, "%s\"%s\":[", k ? "," : "", names[k]);
        for (uint64_t i = p->told; i < w->tool.traced; i++) {
            double x = traced(&w->tool.trace[i % KN_PAGE_TOOL_TRACE], k);
            put(t, fabs(x) < 1e9 ? "%s%.2f" : "%snull", i > p->told ? "," : "", x);
        }
        put(t, "]");
    }
    put(t, "}");
    p->told = w->tool.traced;
}

// Write and clear the answers that wait for this page.
static void put_answers(kn_web_page *p, json *t)
{
    put(t, ",\"answers\":[");
    for (const kn_web_answer *a = p->answer; a < p->answer + p->answers; a++) {
        put(t, "%s{\"id\":%u,\"ok\":%s", a > p->answer ? "," : "", a->id, a->ok ? "true" : "false");
        put_words(t, "words", a->words);
        put(t, "}");
    }
    p->answers = 0;
    put(t, "]");
}

// Write the contact patch of the tool, if the newest patch message is recent.
static void put_touch(const kn_web *w, json *t)
{
    const knead_touch_patch_t *p = &w->state.touch;
    if (!w->state.touch_ms || kn_live_server_now_ms() - w->state.touch_ms > 500 ||
        !isfinite(p->area_m2 + p->peak_pressure_pa)) // leave out a patch with NaN, because JSON cannot express NaN
        return;
    put(t, ",\"touch\":{\"area_mm2\":%.1f,\"peak_kpa\":%.2f,\"kpa\":[", 1e6 * p->area_m2, 1e-3 * p->peak_pressure_pa);
    for (int i = 0; i < 64; i++) {
        double x = p->pressure_pa[i / 8][i % 8];
        put(t, "%s%.2f", i ? "," : "", isfinite(x) ? 1e-3 * x : 0);
    }
    put(t, "]}");
}

// Write `count` numbers as a JSON array. A number that is not finite, or absurdly large, becomes 0.
static void put_numbers(json *t, const char *format, const double *x, int count)
{
    for (int i = 0; i < count; i++) {
        put(t, "%c", i ? ',' : '[');
        put(t, format, fabs(x[i]) < 1e9 ? x[i] : 0);
    }
    put(t, "]");
}

// Write the poses and forces of all tools of the scene, in its order; null: nobody holds the tool. A page that draws
// the object itself draws the tools, too.
static void put_tools(const kn_web *w, json *t)
{
    const kn_model_def *def = &w->live.scene->model;
    put(t, ",\"tools\":[");
    for (int i = 0; i < def->probe_count; i++) {
        const kn_live_server_probe *p = kn_live_server_find(&w->live, def->probe[i].name);
        put(t, "%s", i ? "," : "");
        if (!p) {
            put(t, "null");
            continue;
        }
        put(t, "{\"acts\":%s,\"at\":", p->gain > 0 ? "true" : "false");
        put_numbers(t, "%.5f", p->position_m, 3);
        put(t, ",\"turn\":");
        put_numbers(t, "%.4f", p->orientation_wxyz, 4);
        put(t, ",\"force\":");
        put_numbers(t, "%.3f", p->force_n, 3);
        if (kn_live_server_held(p)) {
            put(t, ",\"hand\":{\"at\":");
            put_numbers(t, "%.5f", p->hand_position_m, 3);
            put(t, ",\"turn\":");
            put_numbers(t, "%.4f", p->hand_orientation_wxyz, 4);
            put(t, "}");
        }
        put(t, "}");
    }
    put(t, "]");
}

// Sizes of the blocks that follow the JSON of a message, bytes; 0: not in this message.
typedef struct blocks {
    size_t surface, shape, picture;
} blocks;

// Decide which blocks a page gets. Blocks for which there is no room are left out.
static blocks choose_blocks(kn_web *w, const kn_web_page *p, size_t room)
{
    blocks b = {0};
    if (p->draws == KN_WEB_MESH && w->live.scene) {
        if (p->surface != w->mesh.surface) b.surface = kn_page_mesh_write_surface(&w->mesh, NULL);
        if (b.surface || p->shape != w->mesh.shape) b.shape = kn_page_mesh_write_shape(&w->mesh, p->measure, NULL);
    }
    if (p->draws == KN_WEB_PICTURE && p->picture != w->picture.count) b.picture = w->picture.jpeg_size;
    return b.surface + b.shape + b.picture <= room ? b : (blocks){0};
}

// Write the sizes of the blocks, and the facts that belong to them.
static void put_blocks(kn_web *w, kn_web_page *p, int page, blocks b, json *t)
{
    const bool pictures = p->draws == KN_WEB_PICTURE;
    // `event` is the number of the newest pointer event whose effect the mesh or the picture shows. If another page
    // sent the event, write 0.
    if (b.shape) p->shown = kn_page_tool_answered(&w->tool, p->shown, w->live.mesh.tick);
    put(t, ",\"event\":%u,\"blocks\":[%zu,%zu,%zu]",
        kn_page_tool_event(&w->tool, pictures ? w->picture.shown : p->shown, page), b.surface, b.shape, b.picture);
    const bool colored = w->picture.measure >= 0 && w->picture.still.view.value;
    const double top = !pictures ? kn_page_mesh_top(&w->mesh, p->measure) : colored ? w->picture.top : 0;
    if (top > 0) put(t, ",\"top\":%.6g", top);
    if (b.shape) put_tools(w, t);
}

// Write a message: length of the JSON, the JSON, and the surface, shape and picture that the page does not have yet.
size_t kn_page_state_write(void *self, int page, uint8_t *bytes, size_t size)
{
    kn_web *w = self;
    kn_web_page *p = &w->gateway.page[page];
    char words[400], *begin = (char *)bytes + 4;
    const blocks b = choose_blocks(w, p, size - KN_PAGE_STATE_JSON);
    // The JSON leaves room for the blocks and for its padding.
    json t = {begin, (char *)bytes + size - b.surface - b.shape - b.picture - 4};
    const char *level = status(w, page, words, sizeof words);
    put(&t,
        "{\"frame\":%u,\"tick\":%" PRId64
        ",\"force_n\":%.3f,\"depth_mm\":%.2f,\"deepest_mm\":%.1f,\"contact\":%s,\"mine\":%s,\"level\":\"%s\"",
        p->sent, w->live.mesh.tick, w->tool.hand[0].news.force_n, 1e3 * w->tool.hand[0].news.depth_m,
        w->tool.hand[0].moving ? 1e3 * kn_pointer_hand_reach_deepest(&w->tool.hand[0].reach, &w->tool.hand[0].wish) : 0,
        touches(&w->tool.hand[0].news) ? "true" : "false", w->tool.owner == page ? "true" : "false", level);
    put_words(&t, "status", words);
    put_traces(w, p, &t);
    put_answers(p, &t);
    put_touch(w, &t);
    put_blocks(w, p, page, b, &t);
    if (p->about != w->state.abouts && w->state.about) {
        put(&t, ",\"about\":%s", w->state.about);
        p->about = w->state.abouts;
    }
    // The blocks begin at a multiple of four bytes, so that the page can read their numbers in place.
    put(&t, "}");
    for (int i = (int)((begin - t.at) & 3); i > 0; i--) put(&t, " ");
    uint32_t length = (uint32_t)(t.at - begin);
    // Length of the JSON in the machine's byte order, which is little-endian on all supported machines.
    memcpy(bytes, &length, 4);
    uint8_t *at = (uint8_t *)t.at;
    if (b.surface) at += kn_page_mesh_write_surface(&w->mesh, at), p->surface = w->mesh.surface;
    if (b.shape) at += kn_page_mesh_write_shape(&w->mesh, p->measure, at), p->shape = w->mesh.shape;
    if (b.picture) memcpy(at, w->picture.jpeg, b.picture), p->picture = w->picture.count;
    return (size_t)(at - bytes) + b.picture;
}

// ---- rarely changing facts

// Count nodes, edges and cells by building the model once, when the scene changes.
void kn_page_state_scene(kn_web *w)
{
    kn_page_state *s = &w->state;
    char why[300];
    kn_springs springs = {0};
    snprintf(s->touch_channel, sizeof s->touch_channel, "KNEAD_TOUCH_%s",
             w->tool.hand[0].def ? w->tool.hand[0].def->name : "");
    s->touch_ms = 0;
    kn_model *model = kn_model_build(&w->live.scene->model, why, sizeof why);
    s->nodes = s->edges = s->cells = 0;
    if (model && kn_springs_init(&springs, model)) s->edges = springs.count;
    if (model) s->nodes = model->node_count;
    if (model) s->cells = model->def.mesh ? model->def.mesh->element_count : kn_grid_cells(&model->grid, NULL);
    kn_springs_free(&springs);
    kn_model_destroy(model);
}

void kn_page_state_count(kn_web *w, int64_t now_ms)
{
    kn_page_state *s = &w->state;
    const int64_t meshes = w->live.meshes - s->counted_meshes, bytes = s->all_mesh_bytes - s->counted_bytes;
    s->meshes_hz = 1e3 * (double)meshes / (double)(now_ms - s->counted_ms);
    if (meshes > 0) s->mesh_bytes = round((double)bytes / (double)meshes);
    s->counted_ms = now_ms;
    s->counted_meshes = w->live.meshes;
    s->counted_bytes = s->all_mesh_bytes;
}

// Round to four digits, so that a change too small to see does not make the program send `about` once more.
static json_t *rounded(double x)
{
    char text[32];
    snprintf(text, sizeof text, "%.4g", x);
    return isfinite(x) ? json_real(strtod(text, NULL)) : json_null();
}

// Return a material as JSON, with only those parameters that its damper uses.
static json_t *material(const kn_material *m)
{
    static const char *const dampers[] = {"none", "constant", "exponential", "ramp"};
    enum { CONSTANT = 1 << KN_DAMPER_CONSTANT, EXPONENTIAL = 1 << KN_DAMPER_EXPONENTIAL, RAMP = 1 << KN_DAMPER_RAMP };
    const struct {
        const char *name;
        int dampers; // bit mask of the kinds of damper that use the parameter
        double value;
    } all[] = {{"c2", CONSTANT, m->c2_pa_s},          {"alpha", EXPONENTIAL, m->alpha_pa_s},
               {"beta", EXPONENTIAL, m->beta_per_pa}, {"c_max", RAMP, m->c_max_pa_s},
               {"c_min", RAMP, m->c_min_pa_s},        {"p0", EXPONENTIAL | RAMP, m->p0_pa},
               {"p1", EXPONENTIAL | RAMP, m->p1_pa}};
    json_t *o =
        json_pack("{s:s, s:o, s:o}", "damper", dampers[m->damper], "k1", rounded(m->k1_pa), "c1", rounded(m->c1_pa_s));
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (all[i].dampers >> m->damper & 1) json_object_set_new(o, all[i].name, rounded(all[i].value));
    return o;
}

static json_t *materials(void)
{
    json_t *names = json_array();
    for (const kn_library_entry *e = kn_library; e->name; e++) json_array_append_new(names, json_string(e->name));
    return names;
}

static json_t *scenes(const kn_web *w)
{
    json_t *names = json_array();
    for (int i = 0; i < w->client.scene_files; i++) json_array_append_new(names, json_string(w->client.scene_file[i]));
    return names;
}

// List the quality points that a running kneadd accepts. Leave out points that need a restart, for example because
// their spacing is different.
static json_t *points(const kn_scene *scene)
{
    json_t *names = json_array();
    for (int q = 0; q < KN_QUALITIES; q++)
        if (scene->point[q].live) json_array_append_new(names, json_string(kn_quality_name((kn_quality)q)));
    return names;
}

// Return the counters of the servo loop as JSON, or null if no status message has come for STALE_MS.
static json_t *loop(const kn_page_state *v)
{
    const knead_status_t *s = &v->status;
    if (stale(v->status_ms)) return json_null();
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:o}", "ticks", (json_int_t)s->tick, "missed",
                     (json_int_t)s->missed_cycles, "explained", (json_int_t)s->missed_explained, "overruns",
                     (json_int_t)s->overruns, "p50_us", (json_int_t)share_us(s->execution_hist, 0.5), "p99_us",
                     (json_int_t)share_us(s->execution_hist, 0.99), "mean_us",
                     v->health_ms ? rounded(v->health.execution_us[0]) : json_null());
}

// Return the energies of kneadd's last energy audit as JSON. The dissipated energy is the work of all tools minus the
// stored energy.
static json_t *energy(const kn_page_state *v)
{
    if (stale(v->energy_ms)) return json_null();
    return json_pack("{s:o, s:o}", "stored_mj", rounded(1e3 * v->stored_j), "dissipated_mj",
                     rounded(1e3 * (v->work_j - v->stored_j)));
}

static json_t *mesh(const kn_web *w)
{
    const kn_mesh *m = &w->live.mesh;
    return json_pack("{s:i, s:i, s:i, s:i, s:i, s:o, s:o}", "nodes", w->state.nodes, "edges", w->state.edges, "cells",
                     w->state.cells, "vertices", (int)m->vertex_count, "triangles", (int)m->triangle_count, "hz",
                     rounded(round(w->state.meshes_hz)), "bytes", rounded(w->state.mesh_bytes));
}

// Return true if a tool other than the page's tool has a fault.
static bool fault_of_another(const kn_web *w)
{
    const json_t *probes = json_object_get(w->client.status, "probes"), *one;
    size_t i;
    json_array_foreach(probes, i, one)
    {
        const char *name = json_string_value(json_object_get(one, "name"));
        const char *fault = json_string_value(json_object_get(one, "fault"));
        // The second tool is the page's own only while two fingers grip.
        bool own = false;
        for (int k = 0; k < 2; k++) {
            const kn_page_hand *h = &w->tool.hand[k];
            if (k == 1 && h->news.mode == KN_POINTER_HAND_ABSENT) continue;
            own = own || (h->def && name && strcmp(name, h->def->name) == 0);
        }
        if (!own && fault && strcmp(fault, kn_fault_name(KN_FAULT_NONE)) != 0) return true;
    }
    return false;
}

// Report whether kneadd accepts orders, and the parts of its state that the page's buttons depend on.
static json_t *control(const kn_web *w)
{
    const json_t *state = json_object_get(w->client.status, "state"),
                 *quality = json_object_get(w->client.status, "quality");
    const char *mode = json_string_value(json_object_get(w->client.status, "mode"));
    const char *why = !w->control        ? "knead web was started without --control"
                      : w->client.status ? NULL
                      : *w->client.error ? w->client.error
                                         : "kneadd has not answered yet";
    // If lifting the tool does not clear a latched fault, the page needs the button Recover, as after an emergency
    // stop. Recover is not needed if only the session of this page has a fault and the hand has left the tool, because
    // the fault then ends by itself.
    const bool fault = mode && strcmp(mode, "FAULT") == 0 &&
                       (w->tool.hand[0].news.mode != KN_POINTER_HAND_ABSENT ||
                        w->tool.hand[1].news.mode != KN_POINTER_HAND_ABSENT || fault_of_another(w));
    const bool stopped = fault || (mode && strcmp(mode, "ESTOP") == 0);
    return json_pack("{s:s?, s:b, s:b, s:I, s:s?, s:b, s:s?, s:s?}", "why", why, "orders", w->control != NULL, "saves",
                     json_is_string(json_object_get(state, "directory")), "snapshot",
                     json_integer_value(json_object_get(state, "snapshot_gen")), "mode", mode, "stopped", stopped,
                     "quality", json_string_value(json_object_get(quality, "in_force")), "asked",
                     json_string_value(json_object_get(quality, "asked")));
}

// List all recordings that are not empty. The field `words` of a recording may be read only once the recording's thread
// has finished.
static json_t *recordings(const kn_web *w)
{
    static const char *const states[] = {"waits", "runs", "whole", "failed"};
    json_t *list = json_array();
    for (int i = 0; i < KN_RECORDINGS; i++) {
        const kn_recording *one = &w->recordings.recording[i];
        const int state = atomic_load(&one->state);
        if (!one->number || state == KN_RECORDING_EMPTY) continue;
        json_array_append_new(list, json_pack("{s:i, s:s, s:f, s:f, s:b, s:s}", "number", one->number, "state",
                                              states[state], "s", floor(1e-2 * atomic_load(&one->ms)) / 10, "mb",
                                              floor(1e-5 * (double)atomic_load(&one->bytes)) / 10, "csv", one->csv,
                                              "words", state >= KN_RECORDING_WHOLE ? one->words : ""));
    }
    return list;
}

static json_t *measures(const kn_web *w)
{
    json_t *names = json_array();
    for (int i = 0; i < KN_MEASURES; i++)
        if (kn_picture_measured(&w->live, i))
            json_array_append_new(
                names, json_pack("{s:s, s:s}", "name", kn_measure_names[i].name, "words", kn_measure_names[i].words));
    return names;
}

static json_t *view(const kn_web *w)
{
    return json_pack("{s:f, s:f, s:f, s:s, s:o}", "azimuth", w->picture.look.azimuth_deg, "elevation",
                     w->picture.look.elevation_deg, "zoom", w->picture.look.zoom > 0 ? w->picture.look.zoom : 1,
                     "measure", w->picture.measure < 0 ? "none" : kn_measure_names[w->picture.measure].name, "measures",
                     measures(w));
}

// Return a name from the bus as JSON; "?" if it is not valid UTF-8.
static json_t *told(const char *words)
{
    json_t *text = json_string(words);
    return text ? text : json_string("?");
}

// Compose `about`: all facts that are sent to the pages again whenever one of them has changed.
static json_t *about(const kn_web *w)
{
    const kn_scene *s = w->live.scene;
    json_t *all =
        json_pack("{s:o, s:o, s:o, s:o, s:i, s:o, s:o, s:o, s:o, s:o, s:o, s:i, s:i, s:i}", "scene",
                  told(s ? s->name : ""), "tool", told(w->tool.hand[0].def ? w->tool.hand[0].def->name : ""), "control",
                  control(w), "scenes", scenes(w), "unlisted", w->client.scenes_unlisted, "materials", materials(),
                  "loop", loop(&w->state), "energy", energy(&w->state), "mesh", mesh(w), "view", view(w), "recordings",
                  recordings(w), "recording", kn_recordings_running(&w->recordings), "playing", w->tool.lent,
                  "replaying", w->recordings.child_pid ? w->recordings.child_of : 0);
    if (all && s) json_object_set_new(all, "material", material(&s->model.material));
    if (all && s) json_object_set_new(all, "points", points(s));
    json_t *object = all ? kn_page_mesh_describe(&w->mesh) : NULL;
    if (object) json_object_set_new(all, "object", object);
    if (all && w->tool.hand[1].def) json_object_set_new(all, "second", told(w->tool.hand[1].def->name));
    if (all && s && *s->label) json_object_set_new(all, "label", told(s->label));
    return all;
}

// Return the text of `about`. If the text is too long, leave out its long parts one after the other, so that the text
// is never cut off in the middle.
static char *fitting(json_t *all)
{
    static const char *const long_ones[] = {"scenes", "recordings", "scene", "tool"};
    char *text = json_dumps(all, JSON_COMPACT | JSON_REAL_PRECISION(6));
    for (int i = 0; text && strlen(text) > KN_PAGE_STATE_ABOUT && i < 4; i++) {
        json_object_set_new(all, long_ones[i], i < 2 ? json_array() : json_string("?"));
        free(text);
        text = json_dumps(all, JSON_COMPACT | JSON_REAL_PRECISION(6));
    }
    return text;
}

// Update `about`. If the text has changed, raise its version, so that each page gets the text with its next message.
void kn_page_state_refresh(void *self)
{
    kn_web *w = self;
    json_t *all = about(w);
    char *text = all ? fitting(all) : NULL;
    json_decref(all);
    if (!text || strlen(text) > KN_PAGE_STATE_ABOUT || (w->state.about && strcmp(text, w->state.about) == 0)) {
        free(text);
        return;
    }
    free(w->state.about);
    w->state.about = text;
    w->state.abouts++;
}
