#include "clients/picture/view_panels.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "core/scene/mesh_file.h"
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Time to wait after the first complete mesh, ms. During this time, the forces of the probes arrive, and then a mesh
// that is not older than the forces.
#define SETTLE_MS 50

static int no_memory(void) { return kn_complain("view", KN_EXIT_DEVICE, "out of memory"); }

// ---- at rest

static void forget_scene(kn_view_source *s)
{
    kn_state_destroy(s->state);
    kn_model_destroy(s->model);
    kn_scene_destroy(s->scene);
    s->state = NULL;
    s->model = NULL;
    s->scene = NULL;
}

// Load a scene, apply the settings `sets` (KEY=VALUE, as for --set), and create its state at rest.
static int load_scene(kn_view_source *s, const char *path, const char *const *sets, int set_count)
{
    char error[400];
    s->scene = kn_scene_load(path, sets, set_count, error, sizeof error);
    if (!s->scene) return fprintf(stderr, "%s\n", error), KN_EXIT_USAGE;
    s->model = kn_model_build(&s->scene->model, error, sizeof error);
    if (!s->model) return kn_complain("view", KN_EXIT_USAGE, "%s: %s", path, error);
    s->state = kn_state_create(s->model);
    s->ended = true;
    return s->state ? KN_EXIT_OK : no_memory();
}

static int open_scene(kn_view_source *s) { return load_scene(s, s->path, NULL, 0); }

// ---- a snapshot

// Restore a snapshot. Load its scene with the settings that were made at run time; the snapshot contains these
// settings.
static int open_saved(kn_view_source *s, const char *scene, const uint8_t *bytes, size_t size)
{
    char error[400], room[KN_SETTINGS_BYTES];
    const char *list[KN_SETTINGS_MAX];
    kn_saved head;
    int code = load_scene(s, scene, NULL, 0);
    // kn_saved_peek needs the name of the scene to read the settings of a snapshot. So load the scene once without
    // settings, and if the snapshot contains settings, load it again with them.
    if (code == KN_EXIT_OK && kn_saved_peek(s->scene->name, bytes, size, &head) && *head.settings.text) {
        forget_scene(s);
        code = load_scene(s, scene, list, kn_settings_list(&head.settings, room, list));
    }
    if (code != KN_EXIT_OK) return code;
    s->saved = calloc(1, sizeof *s->saved);
    if (!s->saved) return no_memory();
    s->saved->state = s->state;
    kn_servo_init(&s->saved->servo, s->scene, s->model, NULL);
    if (kn_saved_decode(s->scene, s->model, bytes, size, s->saved, error, sizeof error)) return KN_EXIT_OK;
    return kn_complain("view", KN_EXIT_USAGE, "%s: %s", s->path, error);
}

static int open_snapshot(kn_view_source *s, const char *scene)
{
    size_t size;
    char error[400];
    uint8_t *bytes = kn_words_load(s->path, &size, error, sizeof error);
    if (!bytes) return kn_complain("view", KN_EXIT_USAGE, "%s", error);
    const int code = open_saved(s, scene, bytes, size);
    free(bytes);
    return code;
}

// Add the tools of a snapshot to the still. A tool that does not act on the object is drawn at the pose of its hand.
static void tools_of_saved(const kn_view_source *s, kn_object_still *still)
{
    for (int i = 0; i < s->model->def.probe_count; i++) {
        const kn_servo *servo = &s->saved->servo;
        const kn_pose *hand = &servo->tool[i];
        if (servo->last[i].session == 0) continue;
        const bool inside = s->state->probe[i].attached;
        kn_object_still_probe(still, &s->model->def.probe[i], inside ? s->state->probe[i].position_m : hand->position_m,
                              inside ? s->state->tool[i].orientation_wxyz : hand->orientation_wxyz,
                              servo->safety[i].force_n, servo->safety[i].gain);
        kn_object_still_hand(still, hand->position_m, hand->orientation_wxyz);
    }
}

// ---- a recording

static int open_log(kn_view_source *s)
{
    char error[400];
    s->replay = kn_replay_create(&(kn_replay_def){.log_path = s->path}, error, sizeof error);
    if (!s->replay) return kn_complain("view", KN_EXIT_USAGE, "%s", error);
    s->time_s = -INFINITY;
    return KN_EXIT_OK;
}

// Step a recording to the tick nearest to at_s.
static int step_log(kn_view_source *s, double at_s)
{
    kn_replay *r = s->replay;
    while (!s->ended && s->time_s < at_s - KN_REPLAY_HALF_TICK_S) {
        if (kn_replay_step(r)) s->time_s = r->tick.time_s;
        else s->ended = true;
    }
    // Report a damaged recording once.
    if (s->ended && r->damage[0])
        fprintf(stderr, "knead view: %s: %s; the part before the damage was used\n", s->path, r->damage),
            r->damage[0] = 0;
    if (isinf(s->time_s))
        return kn_complain("view", KN_EXIT_USAGE, "%s: it contains no tick, expected a recorded session", s->path);
    return KN_EXIT_OK;
}

// Add the tools of the last tick of a recording.
static void tools_of_log(const kn_replay *r, kn_object_still *still)
{
    for (int i = 0; i < r->tick.out.probes; i++) {
        const kn_force *f = &r->tick.out.force[i];
        if (!f->live) continue;
        kn_object_still_probe(still, &r->model->def.probe[i], f->proxy_position_m, f->proxy_orientation_wxyz,
                              f->force_n, f->gain);
        const kn_pose *hand = &r->servo.tool[i]; // pose of the hand that the servo loop uses, after the clutch
        if (r->servo.last[i].session != 0) kn_object_still_hand(still, hand->position_m, hand->orientation_wxyz);
    }
}

// ---- the bus

// Report which messages did not arrive on the bus.
static int unheard(const kn_view_options *o, const kn_live_server *live)
{
    const char *what = live->heard[0] ? "a server, but no mesh" : live->heard[1] ? "no whole mesh" : "nothing";
    return kn_complain(
        "view", KN_EXIT_DEVICE, "heard %s in %g s: %s", what, o->wait_s,
        kn_bus_client_why("is kneadd running, in this network namespace, with these --lcm-url and --mesh-url?"));
}

// Join the bus. Wait at most o->wait_s for a complete mesh and the scene. A missing mesh is an error, a missing scene
// is not.
static int open_bus(kn_view_source *s, const kn_view_options *o)
{
    char error[400];
    if (o->look.style == KN_VIEW_EDGES)
        return kn_complain("view", KN_EXIT_USAGE,
                           "--style edges: kneadd serves the surface alone, expected a log or --scene");
    if (!kn_bus_client_check(o->url, KN_FORCE_URL, error, sizeof error) ||
        !kn_bus_client_check(o->mesh_url, KN_MESH_URL, error, sizeof error))
        return kn_complain("view", KN_EXIT_USAGE, "%s", error);
    if (!kn_live_server_open(&s->live, o->url, o->mesh_url, error, sizeof error))
        return kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    int64_t end_ms = kn_live_server_now_ms() + (int64_t)(o->wait_s * 1000), now_ms;
    bool settling = false;
    while ((now_ms = kn_live_server_now_ms()) < end_ms) {
        kn_live_server_listen(&s->live, (int)(end_ms - now_ms));
        // When mesh and scene have arrived, listen a little longer for the poses of the tools.
        if (settling || !s->live.mesh.whole || !s->live.scene) continue;
        settling = true;
        end_ms = kn_live_server_now_ms() + SETTLE_MS;
    }
    s->opened_ms = kn_live_server_now_ms();
    return s->live.mesh.whole ? KN_EXIT_OK : unheard(o, &s->live);
}

// Receive messages until the time at_s.
static void listen_to(kn_view_source *s, double at_s)
{
    int64_t left_ms;
    while ((left_ms = s->opened_ms + llround(1000 * at_s) - kn_live_server_now_ms()) > 0)
        kn_live_server_listen(&s->live, (int)left_ms);
    s->time_s = 1e-3 * (double)(kn_live_server_now_ms() - s->opened_ms);
}

// Report that the mesh messages do not contain the measure of --color.
static int untold(const kn_live_server *live, kn_measure what)
{
    const int bit = what == KN_MEASURE_STRESS ? KN_MESH_STRESS : KN_MESH_RESIDUAL;
    const char *name = kn_measure_names[what].name;
    if (what == KN_MEASURE_DISPLACEMENT) return no_memory();
    if (live->scene->mesh_measures & bit)
        return kn_complain("view", KN_EXIT_DEVICE,
                           "--color %s: kneadd does not send this measure now, although its scene asks for it", name);
    return kn_complain("view", KN_EXIT_USAGE,
                       "--color %s: the served scene has no such mesh.measures, expected a scene with this measure",
                       name);
}

// Make a still of the object on the bus. If its scene is not known, the object is drawn without tools and colours.
static int still_of_bus(kn_view_source *s, const kn_view_options *o, kn_object_still *still)
{
    char error[400];
    if (!kn_object_still_live(still, &s->live, error, sizeof error))
        return kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    if (o->measure >= 0 && !error[0] && !kn_object_still_told(still, &s->live, (kn_measure)o->measure))
        return untold(&s->live, (kn_measure)o->measure);
    if (error[0] && !s->told) {
        fprintf(stderr, "knead view: %s; the object is drawn without probes and colours\n", error);
        s->told = true; // the warning is printed once per film
    }
    snprintf(still->caption, sizeof still->caption, "%s live, tick %" PRId64,
             s->live.scene ? s->live.scene->name : "an object", s->live.mesh.tick);
    return KN_EXIT_OK;
}

// ---- all kinds of sources

int kn_view_source_open(kn_view_source *s, const kn_view_options *o, int file)
{
    *s = (kn_view_source){.kind = KN_VIEW_BUS};
    if (o->file_count > 0) s->path = o->file[file], s->kind = o->kind[file];
    switch (s->kind) {
    case KN_VIEW_LOG: return open_log(s);
    case KN_VIEW_SNAPSHOT: return open_snapshot(s, o->scene);
    case KN_VIEW_SCENE: return open_scene(s);
    default: return open_bus(s, o);
    }
}

int kn_view_source_to(kn_view_source *s, double at_s)
{
    if (s->kind == KN_VIEW_BUS) listen_to(s, at_s);
    return s->kind == KN_VIEW_LOG ? step_log(s, at_s) : KN_EXIT_OK;
}

// Add the values of --color and the edges of --style to a still of a state.
static bool measured(kn_view_source *s, const kn_view_options *o, const kn_model *model, const kn_state *state,
                     kn_object_still *still)
{
    const bool edges = o->look.style == KN_VIEW_EDGES, colored = o->measure >= 0;
    if (!colored && !edges) return true;
    // A gauge belongs to one model, so create a new gauge when the model of the recording has changed.
    const int changes = s->replay ? s->replay->changes : 0;
    if (colored && (!s->gauge || s->gauged != changes)) {
        kn_gauge_destroy(s->gauge);
        s->gauge = kn_gauge_create(model);
        s->gauged = changes;
    }
    if (colored && !s->gauge) return false;
    return kn_object_still_measure(still, model, state, colored ? s->gauge : NULL,
                                   colored ? (kn_measure)o->measure : KN_MEASURE_DISPLACEMENT, edges);
}

// Return the name of the object in a caption. Different files are named by their file names, because their scenes may
// have the same name.
static const char *name_of(const kn_view_source *s, const kn_view_options *o)
{
    const char *base = strrchr(s->path, '/');
    for (int i = 1; i < o->file_count; i++)
        if (strcmp(o->file[i], o->file[0]) != 0) return base ? base + 1 : s->path;
    return s->replay ? s->replay->scene->name : s->scene->name;
}

int kn_view_source_still(kn_view_source *s, const kn_view_options *o, kn_object_still *still)
{
    if (s->kind == KN_VIEW_BUS) return still_of_bus(s, o, still);
    const kn_model *model = s->replay ? kn_replay_model(s->replay) : s->model;
    const kn_state *state = s->replay ? kn_replay_state(s->replay) : s->state;
    if (!kn_object_still_state(still, model, state) || !measured(s, o, model, state, still)) return no_memory();
    if (s->replay) {
        tools_of_log(s->replay, still);
        snprintf(still->caption, sizeof still->caption, "%s at %.3f s", name_of(s, o), s->time_s);
    } else if (s->saved) {
        tools_of_saved(s, still);
        snprintf(still->caption, sizeof still->caption, "%s, snapshot %" PRId64 " of tick %" PRId64, name_of(s, o),
                 s->saved->generation, s->saved->tick);
    } else snprintf(still->caption, sizeof still->caption, "%s at rest", name_of(s, o));
    return KN_EXIT_OK;
}

void kn_view_source_close(kn_view_source *s)
{
    if (s->live.bus) kn_live_server_close(&s->live);
    kn_gauge_destroy(s->gauge);
    kn_replay_destroy(s->replay);
    forget_scene(s);
    free(s->saved);
    *s = (kn_view_source){0};
}

const kn_view_extent kn_view_extent_none = {.box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}};

int kn_view_panels_open(kn_view_panels *l, const kn_view_options *o)
{
    int code = KN_EXIT_OK;
    *l = (kn_view_panels){.o = o, .count = o->file_count > 0 ? o->file_count : 1};
    // The option --compare adds one panel to the panels of the objects.
    l->panels = l->count + o->compare;
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) code = kn_view_source_open(&l->source[i], o, i);
    return code;
}

int kn_view_panels_to(kn_view_panels *l, double at_s)
{
    int code = KN_EXIT_OK;
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) code = kn_view_source_to(&l->source[i], at_s);
    return code;
}

bool kn_view_panels_ended(const kn_view_panels *l)
{
    int ended = 0;
    for (int i = 0; i < l->count; i++) ended += l->source[i].ended;
    return ended == l->count;
}

// Create the still of the last panel, which shows the comparison of two objects. Only the surfaces of the objects are
// compared, not their lattice edges.
static int compare(kn_view_panels *l)
{
    char error[300];
    kn_object_still *s = &l->still[2];
    // Use the match of vertices from the last picture again if it fits the two meshes.
    const bool known = kn_vertex_match_fits(&l->match, &l->still[0], &l->still[1]);
    if (!known) kn_vertex_match_free(&l->match);
    if (!known && !kn_vertex_match_make(&l->match, &l->still[0], &l->still[1], error, sizeof error))
        return kn_complain("view", KN_EXIT_USAGE, "--compare: %s", error);
    if (!kn_object_still_copy(s, &l->still[1])) return kn_complain("view", KN_EXIT_DEVICE, "out of memory");
    if (s->view.style == KN_VIEW_EDGES) s->view.style = KN_VIEW_LINED;
    kn_vertex_match_distance(&l->match, &l->still[0], &l->still[1], s->value);
    snprintf(s->caption, sizeof s->caption,
             l->match.same ? "distance of the second from the first object"
                           : "distance of the second from the first object (different meshes)");
    return KN_EXIT_OK;
}

// Widen the extent so that it contains an object at rest and at the present time. A position that is not finite is left
// out.
static void take_in(kn_view_extent *e, const kn_object_still *s, int scale)
{
    for (int v = 0; v < s->vertex_count; v++)
        for (int i = 0; i < 6; i++) {
            const float x = i < 3 ? s->now[v][i % 3] : s->rest[v][i % 3];
            if (!isfinite(x)) continue;
            e->box[0][i % 3] = fminf(e->box[0][i % 3], x);
            e->box[1][i % 3] = fmaxf(e->box[1][i % 3], x);
        }
    e->most[scale] = fmax(e->most[scale], kn_object_still_most(s));
}

int kn_view_panels_stills(kn_view_panels *l, kn_view_extent *e)
{
    int code = KN_EXIT_OK;
    // Reset the camera and the style of each still to those of the options.
    for (int i = 0; i < l->panels; i++) l->still[i].view = l->o->look;
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++)
        code = kn_view_source_still(&l->source[i], l->o, &l->still[i]);
    if (code == KN_EXIT_OK && l->o->compare) code = compare(l);
    for (int i = 0; code == KN_EXIT_OK && i < l->panels; i++) take_in(e, &l->still[i], i >= l->count);
    return code;
}

void kn_view_panels_drop(kn_view_panels *l)
{
    for (int i = 0; i < l->panels; i++) kn_object_still_free(&l->still[i]);
}

// ---- pictures

// Return the first pixel column of a panel. The widths of the panels differ by one pixel if the picture cannot be
// divided evenly.
static int left_of(const kn_view_panels *l, int panel) { return l->o->width * panel / l->panels; }

// Open one renderer per panel when the first picture is drawn.
static bool open_shots(kn_view_panels *l, char *error, size_t error_size)
{
    const size_t bytes = 4 * (size_t)l->o->width * (size_t)l->o->height;
    if (l->rgba) return true;
    snprintf(error, error_size, "out of memory");
    l->panel = malloc(bytes);
    l->rgba = malloc(bytes);
    for (int i = 0; l->panel && l->rgba && i < l->panels; i++) {
        l->shot[i] = kn_object_picture_open(left_of(l, i + 1) - left_of(l, i), l->o->height, 4, error, error_size);
        if (!l->shot[i]) return false;
    }
    return l->panel && l->rgba;
}

// Copy the pixels of a panel into the picture. The first two columns of every panel but the first become the dividing
// line.
static void paste(kn_view_panels *l, int panel)
{
    const size_t all = 4 * (size_t)l->o->width, left = 4 * (size_t)left_of(l, panel);
    const size_t wide = 4 * (size_t)left_of(l, panel + 1) - left;
    for (int y = 0; y < l->o->height; y++) {
        uint8_t *to = l->rgba + (size_t)y * all + left;
        memcpy(to, l->panel + (size_t)y * wide, wide);
        if (panel > 0) memset(to, 0xff, 8);
    }
}

// Return the colour scale of the measure of --color. If `distance` is true, return the colour scale of the distance in
// a comparison instead.
static kn_scale scale_of(const kn_view_options *o, bool distance, double most)
{
    const int measure = distance ? (int)KN_MEASURE_DISPLACEMENT : o->measure;
    // If `measure` is negative, the object has no colours.
    if (measure < 0) return (kn_scale){"", "", 1};
    const double asked = distance && o->measure >= 0 ? 0 : o->top_si;
    return (kn_scale){distance ? "distance" : kn_measure_names[measure].words, kn_measure_names[measure].unit,
                      kn_measure_scale((kn_measure)measure, asked, most)};
}

int kn_view_panels_shoot(kn_view_panels *l, const kn_view_extent *e, bool framed)
{
    char error[400];
    bool ok = open_shots(l, error, sizeof error);
    for (int i = 0; ok && i < l->panels; i++) {
        const bool distance = i >= l->count;
        const kn_scale scale = scale_of(l->o, distance, e->most[distance]);
        l->still[i].view.frame = framed ? e->box : NULL;
        l->still[i].view.follow = true;
        // Draw the legend of a colour scale in the last panel that uses the scale.
        const kn_object_picture_words words = i + 1 >= l->count ? KN_OBJECT_PICTURE_LEGEND : KN_OBJECT_PICTURE_NAMED;
        ok = kn_object_picture_take(l->shot[i], &l->still[i], distance || l->o->measure >= 0 ? &scale : NULL,
                                    l->o->plain ? KN_OBJECT_PICTURE_PLAIN : words, l->panel, error, sizeof error);
        if (ok) paste(l, i);
    }
    return ok ? KN_EXIT_OK : kn_complain("view", KN_EXIT_DEVICE, "%s", error);
}

void kn_view_panels_close(kn_view_panels *l)
{
    kn_view_panels_drop(l);
    for (int i = 0; i < l->panels; i++) kn_object_picture_close(l->shot[i]);
    for (int i = 0; i < l->count; i++) kn_view_source_close(&l->source[i]);
    kn_vertex_match_free(&l->match);
    free(l->panel);
    free(l->rgba);
    *l = (kn_view_panels){0};
}
