#include "clients/web/control_client.h"
#include "clients/hand/live_server.h"
#include "core/scene/scene.h"
#include "server/store.h"
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// Longest wait for an answer, s; kneadd answers within 2 s, except when it loads a large scene.
#define PATIENCE_S 12
#define ANSWER_MAX (1 << 18) // largest answer, bytes

// ---- connections

static void answered(kn_control_client *c, const kn_control_call *call, const json_t *answer);

// Close the connection of a request and free its place. Return the received part of the answer.
static char *hang_up(kn_control_call *call)
{
    char *text = call->text;
    ev_io_stop(call->client->ev, &call->readable);
    ev_timer_stop(call->client->ev, &call->patience);
    close(call->readable.fd);
    call->text = NULL;
    return text;
}

// End a request: close its connection, then handle its answer. If `why` is not NULL, this error is the answer.
static void end(kn_control_call *call, const char *why)
{
    // Free the request's place before the answer is handled, because the handler may make a new request.
    const kn_control_call was = *call;
    char *text = hang_up(call);
    json_t *answer = why ? NULL : kn_ask_read(text, was.size);
    if (!json_is_object(answer)) {
        json_decref(answer);
        answer = json_pack("{s:b, s:s}", "ok", 0, "error", why ? why : "the program that answers there is not kneadd");
    }
    if (answer) answered(was.client, &was, answer);
    json_decref(answer);
    free(text);
}

static void on_readable(struct ev_loop *ev, ev_io *w, int events)
{
    (void)ev, (void)events;
    kn_control_call *c = w->data;
    ssize_t got = recv(w->fd, c->text + c->size, ANSWER_MAX - c->size, 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (got > 0) c->size += (size_t)got;
    // An answer ends with a newline. Anything larger than ANSWER_MAX is not from kneadd.
    if (c->size > 0 && c->text[c->size - 1] == '\n') end(c, NULL);
    else if (got <= 0) end(c, "kneadd closed the connection without an answer");
    else if (c->size == ANSWER_MAX) end(c, "the program that answers there is not kneadd");
}

static void on_late(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)ev, (void)events;
    end(w->data, "kneadd has not answered for 12 s");
}

// Send a request; `what` is its purpose. If the request cannot be sent, return false and one line in `error`. An urgent
// request may use place 0, which is reserved for emergency stops.
static bool ask(kn_control_client *c, const kn_control_call *what, const json_t *request, bool urgent, char *error,
                size_t error_size)
{
    kn_control_call *call = NULL;
    for (int i = urgent ? 0 : 1; !call && i < KN_CONTROL_CALLS; i++)
        if (!c->call[i].text) call = &c->call[i];
    snprintf(error, error_size, "%s",
             !c->path ? "knead web has no --control" : "kneadd is still busy with earlier requests");
    if (!c->path || !call) return false;
    int fd = kn_ask_begin(c->path, request, error, error_size);
    if (fd < 0) return false;
    *call = *what;
    call->client = c;
    call->text = malloc(ANSWER_MAX);
    if (!call->text) {
        snprintf(error, error_size, "out of memory");
        close(fd);
        return false;
    }
    ev_io_init(&call->readable, on_readable, fd, EV_READ);
    ev_timer_init(&call->patience, on_late, PATIENCE_S, 0);
    call->readable.data = call->patience.data = call;
    ev_io_start(c->ev, &call->readable);
    ev_timer_start(c->ev, &call->patience);
    return true;
}

void kn_control_client_close(kn_control_client *c)
{
    for (int i = 0; i < KN_CONTROL_CALLS; i++)
        if (c->call[i].text) free(hang_up(&c->call[i]));
    json_decref(c->status);
}

// ---- scenes that may be loaded

static int by_name(const struct dirent **a, const struct dirent **b) { return strcmp((*a)->d_name, (*b)->d_name); }

// Return true for a file name *.yaml that is not hidden.
static int is_scene(const struct dirent *e)
{
    const size_t size = strlen(e->d_name);
    return size > 5 && *e->d_name != '.' && strcmp(e->d_name + size - 5, ".yaml") == 0;
}

// Read the list of scenes again. A file is only counted, and not listed, if the list is full or if a request may not
// contain the name of the file.
void kn_control_client_list_scenes(kn_control_client *c)
{
    struct dirent **found = NULL;
    const int count = c->scenes ? scandir(c->scenes, &found, is_scene, by_name) : 0;
    c->scene_files = c->scenes_unlisted = 0;
    for (int i = 0; i < count; i++) {
        if (c->scene_files < KN_CONTROL_SCENES && kn_page_request_is_name(found[i]->d_name))
            strcpy(c->scene_file[c->scene_files++], found[i]->d_name);
        else c->scenes_unlisted++;
        free(found[i]);
    }
    free(found);
}

// Return the path of a listed scene. The name that a page sent is only compared with the listed names and never used as
// a path.
static json_t *scene_path(const kn_control_client *c, const char *name)
{
    char path[4096];
    for (int i = 0; i < c->scene_files; i++) {
        if (strcmp(c->scene_file[i], name) != 0) continue;
        snprintf(path, sizeof path, "%s/%s", c->scenes, c->scene_file[i]);
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
static json_t *set_request(const kn_page_request *r)
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
static json_t *material_request(const kn_page_request *r)
{
    char text[96];
    for (const kn_library_entry *e = kn_library; e->name; e++) {
        if (strcmp(e->name, r->name) != 0) continue;
        snprintf(text, sizeof text, "material=%s", e->name);
        return json_pack("{s:s, s:[s]}", "command", "set", "values", text);
    }
    return NULL;
}

const char *kn_control_client_snapshots(const kn_control_client *c)
{
    return json_string_value(json_object_get(json_object_get(c->status, "state"), "directory"));
}

// Write the scene's name and the snapshot directory. A generation number is unique only together with both, because
// kneadd numbers the snapshots of each scene in each directory separately.
static void of_what(const kn_control_client *c, char text[sizeof c->snapshot_of])
{
    const char *folder = kn_control_client_snapshots(c);
    snprintf(text, sizeof c->snapshot_of, "%s/%s", c->live->scene ? c->live->scene->name : "", folder ? folder : "");
}

// Restore the last snapshot that a page requested. If no page has requested one, restore kneadd's newest snapshot;
// kneadd saves snapshots by itself, at most every 0.5 s.
static json_t *restore_request(const kn_control_client *c)
{
    char now[sizeof c->snapshot_of];
    of_what(c, now);
    if (!c->snapshot || strcmp(c->snapshot_of, now) != 0) return json_pack("{s:s}", "command", "restore");
    return json_pack("{s:s, s:I}", "command", "restore", "generation", (json_int_t)c->snapshot);
}

// Translate a page's request to kneadd's form. Return NULL if the request contains an unknown name.
static json_t *request_of(const kn_control_client *c, const kn_page_request *r)
{
    switch (r->verb) {
    case KN_VERB_SET: return set_request(r);
    case KN_VERB_MATERIAL: return material_request(r);
    case KN_VERB_QUALITY: return json_pack("{s:s, s:s}", "command", "quality", "name", r->name);
    case KN_VERB_SCENE: {
        json_t *path = scene_path(c, r->name);
        return path ? json_pack("{s:s, s:o}", "command", "load", "scene", path) : NULL;
    }
    case KN_VERB_RESTORE: return restore_request(c);
    default: return json_pack("{s:s}", "command", kn_page_verb_word(r->verb));
    }
}

// Send an order to kneadd.
void kn_control_client_order(kn_control_client *c, int page, const kn_page_request *r)
{
    char error[300];
    const kn_control_call what = {.purpose = KN_CONTROL_ORDER, .page = page, .id = r->id, .verb = r->verb};
    json_t *request = request_of(c, r);
    c->ordered_by = page;
    int orders = 0;
    for (int i = 0; i < KN_CONTROL_CALLS; i++) orders += c->call[i].text && c->call[i].purpose == KN_CONTROL_ORDER;
    if (!request)
        kn_gateway_answer(c->gateway, page, r->id, false, "%s %s: unknown name", kn_page_verb_word(r->verb), r->name);
    else if (orders == KN_CONTROL_CALLS)
        kn_gateway_answer(c->gateway, page, r->id, false, "too many requests are waiting");
    else if (!ask(c, &what, request, r->verb == KN_VERB_ESTOP, error, sizeof error))
        kn_gateway_answer(c->gateway, page, r->id, false, "%s", error);
    json_decref(request);
}

// ---- answers of kneadd

// Tell the page that its order was carried out.
static void tell_done(kn_control_client *c, const kn_control_call *call, const json_t *answer)
{
    const long long generation = json_integer_value(json_object_get(answer, "generation"));
#define DONE(...) kn_gateway_answer(c->gateway, call->page, call->id, true, __VA_ARGS__)
    switch (call->verb) {
    case KN_VERB_RESET: DONE("Object reset."); break;
    case KN_VERB_UNDO: DONE("Last press, reset or restore undone."); break;
    case KN_VERB_SNAPSHOT:
        c->snapshot = generation;
        of_what(c, c->snapshot_of);
        DONE("Snapshot %lld saved.", generation / KN_STORE_OWN);
        break;
    case KN_VERB_RESTORE:
        if (generation % KN_STORE_OWN) DONE("The server's newest snapshot restored.");
        else DONE("Snapshot %lld restored.", generation / KN_STORE_OWN);
        break;
    case KN_VERB_ESTOP: DONE("Stopped. All forces are zero until you press Recover."); break;
    case KN_VERB_RECOVER: DONE("Recovered. The tool acts again once it has been lifted off the object."); break;
    case KN_VERB_SCENE: DONE("Loading the scene."); break;
    case KN_VERB_QUALITY: DONE("Quality changed."); break;
    default: DONE("Changed."); break;
    }
#undef DONE
}

// Keep kneadd's status or, if the request has failed, the reason.
static void take_status(kn_control_client *c, const json_t *answer, const char *error)
{
    json_decref(c->status);
    c->status = error ? NULL : json_deep_copy(answer);
    snprintf(c->error, sizeof c->error, "%s", error ? error : "");
    c->changed(c->arg);
}

static void answered(kn_control_client *c, const kn_control_call *call, const json_t *answer)
{
    const char *error = json_string_value(json_object_get(answer, "error"));
    if (call->purpose == KN_CONTROL_STATUS) take_status(c, answer, error);
    // No page waits for the answer to a request of the program itself.
    if (call->purpose != KN_CONTROL_ORDER) return;
    if (error) kn_gateway_answer(c->gateway, call->page, call->id, false, "%s", error);
    else tell_done(c, call, answer);
    // The order has changed kneadd's status, so request the status at once.
    c->status_ms = 0;
    kn_control_client_ask_status(c);
}

void kn_control_client_ask_status(kn_control_client *c)
{
    int64_t now_ms = kn_live_server_now_ms();
    char error[sizeof c->error];
    if (!c->path || kn_gateway_pages(c->gateway) == 0 || now_ms - c->status_ms < 1000) return;
    c->status_ms = now_ms;
    json_t *request = json_pack("{s:s}", "command", "status");
    if (!ask(c, &(kn_control_call){.purpose = KN_CONTROL_STATUS}, request, false, error, sizeof error))
        take_status(c, NULL, error);
    json_decref(request);
}

void kn_control_client_gone(kn_control_client *c, int page)
{
    for (int i = 0; i < KN_CONTROL_CALLS; i++)
        if (c->call[i].page == page) c->call[i].page = -1;
    if (c->ordered_by == page) c->ordered_by = -1;
}
