// Requests of a page. Some are orders for kneadd, sent over its control socket; the others concern the picture and the
// recordings. Every request gets one answer, but answers are dropped if a page does not read them.
#include "clients/web/web.h"
#include "core/scene/scene.h"
#include <dirent.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Tags of requests that this program makes by itself: kneadd's status, and a snapshot for a recording.
#define STATUS_TAG KN_ASKER_CALLS
#define SAVE_TAG (KN_ASKER_CALLS + 1)
#define PICTURE_MS 5000 // longest wait for a requested PNG of the next picture
#define LEAVING_MS 300  // time in which kneadd ends the session of the page's hand, before another hand takes the tool

// Append an answer to the list of answers that wait for a page.
void kn_web_answer_page(kn_web *w, int page, uint32_t id, bool ok, const char *format, ...)
{
    // drop the answer: there is no page, or the page does not read its answers.
    if (page < 0 || w->waiting[page].count == KN_WEB_ANSWERS) return;
    kn_web_answer *a = &w->waiting[page].answer[w->waiting[page].count++];
    va_list args;
    va_start(args, format);
    vsnprintf(a->words, sizeof a->words, format, args);
    va_end(args);
    a->id = id;
    a->ok = ok;
    kn_gateway_news(&w->gateway);
}

// ---- scenes that may be loaded

static int by_name(const struct dirent **a, const struct dirent **b) { return strcmp((*a)->d_name, (*b)->d_name); }

// Return true for a file name *.yaml that is not hidden.
static int is_scene(const struct dirent *e)
{
    const size_t size = strlen(e->d_name);
    return size > 5 && *e->d_name != '.' && strcmp(e->d_name + size - 5, ".yaml") == 0;
}

// Read the list of scenes again. Names that a request may not contain are only counted, not listed.
void kn_web_list_scenes(kn_web *w)
{
    struct dirent **found = NULL;
    const int count = w->scenes ? scandir(w->scenes, &found, is_scene, by_name) : 0;
    w->scene_files = w->scenes_unlisted = 0;
    for (int i = 0; i < count; i++) {
        if (w->scene_files < KN_WEB_SCENES && kn_request_is_name(found[i]->d_name))
            strcpy(w->scene_file[w->scene_files++], found[i]->d_name);
        else w->scenes_unlisted++;
        free(found[i]);
    }
    free(found);
}

// Return the path of a listed scene. A page's name is only compared with the list and never used as a path.
static json_t *scene_path(const kn_web *w, const char *name)
{
    char path[4096];
    for (int i = 0; i < w->scene_files; i++) {
        if (strcmp(w->scene_file[i], name) != 0) continue;
        snprintf(path, sizeof path, "%s/%s", w->scenes, w->scene_file[i]);
        // kneadd may run in another directory, so the path must be absolute.
        char *whole = realpath(path, NULL);
        json_t *text = json_string(whole ? whole : path);
        free(whole);
        return text;
    }
    return NULL;
}

// ---- requests in kneadd's form

// Set one number of the material. Only the listed keys are allowed, each in its SI unit.
static json_t *set_request(const kn_request *r)
{
    static const struct {
        const char *name, *unit;
    } keys[] = {{"k1", "Pa"},      {"c1", "Pa*s"},    {"c2", "Pa*s"}, {"alpha", "Pa*s"}, {"beta", "1/Pa"},
                {"c_max", "Pa*s"}, {"c_min", "Pa*s"}, {"p0", "Pa"},   {"p1", "Pa"}};
    char text[96];
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (strcmp(keys[i].name, r->name) != 0) continue;
        snprintf(text, sizeof text, "material.%s=%.6g %s", keys[i].name, r->value, keys[i].unit);
        return json_pack("{s:s, s:[s]}", "command", "set", "values", text);
    }
    return NULL;
}

// Replace the material by a named material of the library.
static json_t *material_request(const kn_request *r)
{
    char text[96];
    for (const kn_library_entry *e = kn_library; e->name; e++) {
        if (strcmp(e->name, r->name) != 0) continue;
        snprintf(text, sizeof text, "material=%s", e->name);
        return json_pack("{s:s, s:[s]}", "command", "set", "values", text);
    }
    return NULL;
}

// Identify the scene and directory that snapshot generations belong to. Generations are numbered by scene, in one
// directory.
static void of_what(const kn_web *w, char text[sizeof w->snapshot_of])
{
    const char *folder = json_string_value(json_object_get(json_object_get(w->status, "state"), "directory"));
    snprintf(text, sizeof w->snapshot_of, "%s/%s", w->live.scene ? w->live.scene->name : "", folder ? folder : "");
}

// Restore the last snapshot that a page asked for. Without one, restore kneadd's newest, which kneadd saves by itself,
// at most every 0.5 s.
static json_t *restore_request(const kn_web *w)
{
    char now[sizeof w->snapshot_of];
    of_what(w, now);
    if (!w->snapshot || strcmp(w->snapshot_of, now) != 0) return json_pack("{s:s}", "command", "restore");
    return json_pack("{s:s, s:I}", "command", "restore", "generation", (json_int_t)w->snapshot);
}

// Return kneadd's form of a page's request, or NULL if the request contains an unknown name.
static json_t *request_of(const kn_web *w, const kn_request *r)
{
    switch (r->verb) {
    case KN_VERB_SET: return set_request(r);
    case KN_VERB_MATERIAL: return material_request(r);
    case KN_VERB_QUALITY: return json_pack("{s:s, s:s}", "command", "quality", "name", r->name);
    case KN_VERB_SCENE: {
        json_t *path = scene_path(w, r->name);
        return path ? json_pack("{s:s, s:o}", "command", "load", "scene", path) : NULL;
    }
    case KN_VERB_RESTORE: return restore_request(w);
    default: return json_pack("{s:s}", "command", kn_verb_word(r->verb));
    }
}

// Send an order to kneadd and store the page that gave it. An emergency stop is urgent, so it may use the reserved
// place of the asker.
static void order(kn_web *w, int page, const kn_request *r)
{
    char error[300];
    int tag = 0;
    while (tag < KN_ASKER_CALLS && w->asked[tag].id) tag++;
    json_t *request = request_of(w, r);
    if (!request) {
        kn_web_answer_page(w, page, r->id, false, "%s %s: unknown name", kn_verb_word(r->verb), r->name);
        return;
    }
    if (tag < KN_ASKER_CALLS && kn_asker_ask(&w->asker, tag, request, r->verb == KN_VERB_ESTOP, error, sizeof error)) {
        w->asked[tag].page = page;
        w->asked[tag].id = r->id;
        w->asked[tag].verb = r->verb;
    } else
        kn_web_answer_page(w, page, r->id, false, "%s", tag < KN_ASKER_CALLS ? error : "too many requests are waiting");
    json_decref(request);
}

// ---- answers of kneadd

// Tell a page that its order was carried out.
static void tell_done(kn_web *w, int page, uint32_t id, kn_verb verb, const json_t *answer)
{
    const long long generation = json_integer_value(json_object_get(answer, "generation"));
    const json_t *after = json_object_get(answer, "stored_after_j"),
                 *before = json_object_get(answer, "stored_before_j");
#define DONE(...) kn_web_answer_page(w, page, id, true, __VA_ARGS__)
    switch (verb) {
    case KN_VERB_RESET: DONE("The object is as new."); break;
    case KN_VERB_UNDO: DONE("Undone: the object is as before the last press, reset or restore."); break;
    case KN_VERB_SNAPSHOT:
        w->snapshot = generation;
        of_what(w, w->snapshot_of);
        DONE("Snapshot %lld is on disk.", generation);
        break;
    case KN_VERB_RESTORE: DONE("The object is as in snapshot %lld.", generation); break;
    case KN_VERB_ESTOP: DONE("Stopped: every force is zero until Recover."); break;
    case KN_VERB_RECOVER: DONE("Recovered: the tool engages once it is clear of the object."); break;
    case KN_VERB_SCENE: DONE("Loading."); break;
    case KN_VERB_QUALITY: DONE("Quality set."); break;
    default:
        if (after)
            DONE("Set: the object stores %.3g mJ, %.3g mJ before.", 1e3 * json_number_value(after),
                 1e3 * json_number_value(before));
        else DONE("Taken.");
    }
#undef DONE
}

// Keep kneadd's status, or the reason why there is none.
static void take_status(kn_web *w, const json_t *answer)
{
    const char *error = json_string_value(json_object_get(answer, "error"));
    json_decref(w->status);
    w->status = error ? NULL : json_deep_copy(answer);
    snprintf(w->control_error, sizeof w->control_error, "%s", error ? error : "");
    kn_web_refresh(w);
}

void kn_web_on_answered(void *self, int tag, const json_t *answer)
{
    kn_web *w = self;
    if (tag == STATUS_TAG) take_status(w, answer);
    // kneadd refused the snapshot for the recording, so request the snapshot once more later.
    if (tag == SAVE_TAG && !json_is_true(json_object_get(answer, "ok"))) w->saved_of = 0;
    // No page waits for the answer to a request of the program itself.
    if (tag >= STATUS_TAG) return;
    const int page = w->asked[tag].page;
    const uint32_t id = w->asked[tag].id;
    const char *error = json_string_value(json_object_get(answer, "error"));
    w->asked[tag].id = 0;
    if (error) kn_web_answer_page(w, page, id, false, "%s", error);
    else tell_done(w, page, id, w->asked[tag].verb, answer);
    // The order has changed kneadd's status, so request the status at once.
    w->status_ms = 0;
    kn_web_ask_status(w);
}

// Ask kneadd for its status, at most once a second and only while a page is open.
void kn_web_ask_status(kn_web *w)
{
    int64_t now_ms = kn_live_now_ms();
    if (!w->control || kn_gateway_pages(&w->gateway) == 0 || now_ms - w->status_ms < 1000) return;
    json_t *request = json_pack("{s:s}", "command", "status");
    char error[sizeof w->control_error];
    w->status_ms = now_ms;
    if (request && !kn_asker_ask(&w->asker, STATUS_TAG, request, false, error, sizeof error)) {
        json_t *none = json_pack("{s:s}", "error", error);
        take_status(w, none);
        json_decref(none);
    }
    json_decref(request);
}

// ---- picture

// Set the style of the picture. Return whether the name is known.
static bool take_style(kn_web *w, const char *name)
{
    static const char *const names[] = {"lined", "solid", "wire"};
    for (int i = 0; i < 3; i++)
        if (strcmp(names[i], name) == 0) return w->look.style = (kn_view_style)i, true;
    return false;
}

// Turn the view. If the user presses meanwhile, the pointer does not move the tool sideways until the press ends,
// because the pointer's place in the new view stands for another point of the object.
static void look(kn_web *w, const kn_request *r)
{
    w->look.azimuth_deg = r->azimuth_deg;
    w->look.elevation_deg = r->elevation_deg;
    w->look.zoom = r->zoom;
    w->turned = true;
    const kn_camera_view view = kn_web_camera(w);
    // Turn the view of the pointer as well, even while a recording moves the tool.
    if (w->reach.top) kn_reach_look(&w->reach, &view);
}

// Colour the object by a measure, if the mesh messages contain the measure. Reset the top of the colour scale to 0.
static void take_measure(kn_web *w, int page, const kn_request *r)
{
    int measure = strcmp(r->name, "none") == 0 ? -1 : KN_MEASURES;
    for (int i = 0; i < KN_MEASURES; i++)
        if (strcmp(r->name, kn_measure_names[i].name) == 0) measure = i;
    const bool is = measure < 0 || kn_web_measured(w, measure);
    if (is) w->measure = measure, w->top = 0;
    kn_web_answer_page(w, page, r->id, is,
                       is ? "Coloured." : "The meshes do not contain it: see the scene's mesh.measures.");
}

// Request a PNG of the next picture. The answer comes when the PNG is ready.
static void take_picture(kn_web *w, int page, const kn_request *r)
{
    const bool now = w->png_page < 0 && w->folder[0];
    if (!now)
        kn_web_answer_page(w, page, r->id, false, "%s",
                           w->folder[0] ? "Another picture is being saved." : "There is no folder to save it in.");
    if (!now) return;
    w->png_page = page;
    w->png_id = r->id;
    w->png_ms = kn_live_now_ms();
    w->png_there = false;
}

// ---- recordings

// Return kneadd's snapshot directory; NULL: none.
static const char *snapshots(const kn_web *w)
{
    return json_string_value(json_object_get(json_object_get(w->status, "state"), "directory"));
}

static void record(kn_web *w, int page, const kn_request *r)
{
    char error[200];
    if (!w->tool || w->lent) kn_web_answer_page(w, page, r->id, false, "There is no tool in hand.");
    else if (!kn_takes_begin(&w->takes, w->tool->name, error, sizeof error))
        kn_web_answer_page(w, page, r->id, false, "%s", error);
    else kn_web_answer_page(w, page, r->id, true, "It begins with the scene, which comes every second.");
}

static void verify(kn_web *w, int page, const kn_request *r)
{
    char error[200] = "Another recording is being replayed.";
    if (w->lent || !kn_takes_verify(&w->takes, (int)r->value, snapshots(w), error, sizeof error)) {
        kn_web_answer_page(w, page, r->id, false, "%s", error);
        return;
    }
    w->replayed.page = page, w->replayed.id = r->id;
}

// Play a recording. First stop the page's own hand, so that kneadd ends its session and the child can take the tool.
static void play(kn_web *w, int page, const kn_request *r)
{
    const char *why = !kn_takes_find(&w->takes, (int)r->value) ? "There is no such recording."
                      : w->lent || w->takes.child_pid          ? "Another recording is being replayed."
                      : !w->moving                             ? "There is no tool in hand."
                                                               : NULL;
    if (why) {
        kn_web_answer_page(w, page, r->id, false, "%s", why);
        return;
    }
    kn_web_let_go(w);
    w->lent = (int)r->value;
    w->lent_ms = kn_live_now_ms();
    w->replayed.page = page, w->replayed.id = r->id;
}

// Answer the page that requested the replay of the recording, once.
static void tell_replayed(kn_web *w, bool ok, const char *words)
{
    kn_web_answer_page(w, w->replayed.page, w->replayed.id, ok, "%s", words);
    w->replayed.page = -1;
}

// Give the tool back to the page's own hand.
static void give_back(kn_web *w)
{
    w->lent = 0;
    if (w->tool && w->reach.top) kn_web_take_up(w);
}

void kn_web_on_replayed(void *self, int number, bool ok, const char *words)
{
    kn_web *w = self;
    (void)number;
    if (w->lent) give_back(w);
    tell_replayed(w, ok, words);
    kn_web_refresh(w);
}

// Stop a recording, its verification or its playing.
static void end_take(kn_web *w, int page, const kn_request *r)
{
    const int number = (int)r->value;
    bool any = kn_takes_end(&w->takes, number);
    if (w->lent == number && w->lent_ms) { // the child process that plays the recording has not started yet
        give_back(w);
        tell_replayed(w, false, "Stopped.");
        any = true;
    }
    kn_web_answer_page(w, page, r->id, any, any ? "Stopped." : "That recording is neither running nor replayed.");
}

// Give up a requested PNG that was not drawn in time, because no mesh arrives or no page can take a picture.
static void give_up_picture(kn_web *w)
{
    if (w->png_page < 0 || w->png_there || w->drawing || kn_live_now_ms() - w->png_ms < PICTURE_MS) return;
    kn_web_answer_page(w, w->png_page, w->png_id, false, "No picture has been drawn for 5 s: is kneadd serving?");
    w->png_page = -1;
}

// Continue all work that waits until a time has passed. This function is called ten times a second.
void kn_web_turn(kn_web *w)
{
    char error[200];
    give_up_picture(w);
    if (kn_takes_tidy(&w->takes)) kn_web_refresh(w);
    // Save the object at the first force of a recording, so that a replay can start from this state.
    kn_take *one = w->takes.now;
    const bool feels = one && atomic_load(&one->felt) && atomic_load(&one->state) == KN_TAKE_RUNS;
    if (feels && one->number != w->saved_of && snapshots(w) && kn_live_now_ms() - w->saved_ms >= 200) {
        json_t *request = json_pack("{s:s}", "command", "snapshot");
        const bool asked = request && kn_asker_ask(&w->asker, SAVE_TAG, request, false, error, sizeof error);
        if (asked) w->saved_of = one->number;
        w->saved_ms = kn_live_now_ms();
        json_decref(request);
    }
    // Start the child process that plays the recording, once kneadd has ended the session of the page's hand.
    if (!w->lent || !w->lent_ms || kn_live_now_ms() - w->lent_ms < LEAVING_MS) return;
    w->lent_ms = 0;
    if (w->tool && kn_takes_play(&w->takes, w->lent, w->tool->name, error, sizeof error)) return;
    give_back(w);
    tell_replayed(w, false, w->tool ? error : "There is no such tool.");
}

// Requests for the picture and the recordings are handled here. All others go to kneadd.
void kn_web_on_request(void *self, int page, const kn_request *r)
{
    kn_web *w = self;
    switch (r->verb) {
    case KN_VERB_VIEW:
        look(w, r);
        kn_web_answer_page(w, page, r->id, true, "View changed.");
        break;
    case KN_VERB_STYLE: kn_web_answer_page(w, page, r->id, take_style(w, r->name), "%s", r->name); break;
    case KN_VERB_MEASURE: take_measure(w, page, r); break;
    case KN_VERB_PICTURE: take_picture(w, page, r); break;
    case KN_VERB_RECORD: record(w, page, r); break;
    case KN_VERB_STOP: end_take(w, page, r); break;
    case KN_VERB_VERIFY: verify(w, page, r); break;
    case KN_VERB_PLAY: play(w, page, r); break;
    default:
        w->ordered_by = page;
        order(w, page, r);
        return;
    }
    kn_web_refresh(w);
}
