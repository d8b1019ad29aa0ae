// knead web: the object in a browser, and a tool in the visitor's hand. Three threads: this one, on libev, for messages;
// the device's, 1 kHz, for poses; the painter's.
#include "clients/knead/commands.h"
#include "clients/knead/dent.h"
#include "clients/knead/pointer.h"
#include "clients/knead/device.h"
#include "clients/viewer/camera.h"
#include "clients/web/gateway.h"
#include "clients/web/painter.h"
#include "server/mailbox.h"
#include "server/ring.h"
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <turbojpeg.h>
#include <unistd.h>

#define TRACE 256          // ms of force that wait for a page
#define EVENTS 64          // of the pointer, on their way through kneadd
#define LET_GO_MS 400      // a pressing page that is silent this long is gone: it says so every 50 ms
#define IDLE_MS 2000       // after so long another page may take the tool
#define UNHEARD_MS 1000    // without a mesh: nobody serves
#define HOVER_M 0.004      // above the highest point of the object
#define BESIDE_M 0.02      // how far beside the object the tool may go
#define UNEVEN_M 2e-3      // more of a dent is not waited for
#define THINNEST 0.5       // of the block's height must stay under the tool

static const char help[] =
    "usage: knead web [OPTION]...\n"
    "       knead web --bind COMMAND...\n\n"
    "Serves a page that shows what a running kneadd serves; on it the pointer presses. Prints its address and runs until\n"
    "SIGINT or SIGTERM. Only this machine can reach it (from another: ssh -L PORT:127.0.0.1:PORT), and only who has the\n"
    "token that is part of the address.\n\n"
    "  --probe NAME       the tool in hand (the scene's first sphere, else its first probe)\n"
    "  --port N           0..65535; 0: a free one (0)\n"
    "  --rate HZ          pictures per second, 5..60; not above the scene's mesh.rate (30)\n"
    "  --size WxH         of a picture, 160..1920 pixels each (960x540)\n"
    "  --command-fd N     an open pipe to kneadd's --command-fd, for Reset (none: the button is off)\n"
    "  --lcm-url URL      poses, forces, scene ($LCM_DEFAULT_URL, " KN_FORCE_URL ")\n"
    "  --mesh-url URL     meshes (" KN_MESH_URL ")\n"
    "  --listen-fd N      the page's address is a socket that is already open\n"
    "  --bind COMMAND...  opens that socket as descriptor 3 and becomes COMMAND: for one that lives in a network\n"
    "                     namespace, which nobody outside reaches\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no bus, no socket or no OpenGL.\n";

typedef struct web {
    const char *probe, *url, *mesh_url;
    int port, width, height, listen_fd, command_fd;
    double rate_hz;

    struct ev_loop *ev;
    ev_io bus_readable, mesh_readable;
    ev_timer due;
    ev_async painted;
    ev_signal stops[3];
    kn_live live;
    kn_gateway gateway;
    kn_painter painter;
    kn_camera camera;
    int64_t meshes, mesh_ms, frame_ms; // whole meshes seen, when the last came, when the last drawing began
    uint8_t *jpeg;                     // the newest picture: the painter is at the next one
    size_t jpeg_size;
    uint32_t pictures;

    uint64_t scene_hash; // of what follows
    const kn_probe_def *tool;
    uint8_t *top;
    int64_t mesh_id;

    kn_device device;
    bool moving; // the device's thread runs
    kn_pointer pointer;                  // that thread's
    kn_mailbox wishes;                   // to it
    kn_pointer_wish wish, wish_slots[3];
    kn_ring samples;                     // from it
    kn_pointer_news news;
    float trace_n[TRACE];
    uint64_t traced;

    int owner; // the page that has the tool, -1: none
    bool beside; // it pressed where nothing is
    struct { uint32_t number; int page; int64_t tick; } event[EVENTS]; // tick: kneadd's answer, INT64_MAX: not yet
    int32_t painting, shown; // newest event in the picture that is being drawn, that was drawn
    char error[512];
} web;

static int fail(int code, const char *what) { return fprintf(stderr, "knead web: %s\n", what), code; }

// ---- the tool

static kn_hand_out move(void *self, const kn_hand_force *force, int elapsed_ms) // in the device's thread
{
    web *w = self;
    bool fresh;
    kn_hand_out out = kn_pointer_tick(&w->pointer, kn_mailbox_latest(&w->wishes, &fresh), force, elapsed_ms);
    kn_ring_push(&w->samples, &w->pointer.news); // a full one loses trace, nothing else
    return out;
}

static void post_wish(web *w)
{
    *(kn_pointer_wish *)kn_mailbox_back(&w->wishes) = w->wish;
    kn_mailbox_post(&w->wishes);
}

static const kn_probe_def *choose_tool(const web *w)
{
    const kn_model_def *def = &w->live.scene->model;
    for (int i = 0; i < def->probe_count; i++)
        if (w->probe ? !strcmp(def->probe[i].name, w->probe) : def->probe[i].shape == KN_PROBE_SPHERE) return &def->probe[i];
    return w->probe || def->probe_count == 0 ? NULL : &def->probe[0];
}

// A scene that is not the last one: another tool, perhaps, and another top.
static void take_scene(web *w)
{
    int64_t session = 0;
    int vertices;
    if (!w->live.scene || w->live.scene->text_hash == w->scene_hash) return;
    if (w->moving) kn_device_stop(&w->device);
    w->moving = false;
    w->scene_hash = w->live.scene->text_hash;
    w->mesh_id = 0;
    w->tool = choose_tool(w);
    const kn_model_def *def = &w->live.scene->model;
    float half[3];
    for (int i = 0; i < 3; i++) half[i] = (float)(0.5 * def->spacing_m * (def->nodes[i] - 1));
    kn_camera_aim(&w->camera, (float[]){-half[0], -half[1], 0}, (float[]){half[0], half[1], 2 * half[2]},
                  w->painter.still.view.azimuth_deg, w->painter.still.view.elevation_deg, (float)w->width / (float)w->height);
    free(w->top);
    w->top = kn_dent_top(def, &vertices);
    if (!w->tool || !w->top) return;
    if (getrandom(&session, 7, 0) < 0) session = kn_live_now_ms();
    kn_pointer_init(&w->pointer, w->tool->shape, session);
    memset(&w->device, 0, sizeof w->device);
    w->moving = kn_device_start(&w->device, move, w, w->url, w->tool->name, w->error, sizeof w->error);
    if (!w->moving) fail(KN_EXIT_DEVICE, w->error);
}

static double tool_radius(const web *w) { return w->tool->shape == KN_PROBE_SPHERE ? w->tool->radius_m : 0; }
static double height_of(const kn_model_def *def) { return def->spacing_m * (def->nodes[2] - 1); }

// Below where the tool touches, that it may go: thinner cells turn inside out.
static double deepest(const web *w)
{
    double height_m = height_of(&w->live.scene->model), radius_m = tool_radius(w);
    double from_m = w->wish.pressed ? w->wish.touch_z_m - radius_m : height_m;
    double most_m = fmax(0, from_m - THINNEST * height_m);
    return radius_m > 0 ? fmin(most_m, radius_m) : most_m;
}

static void take_mesh(web *w)
{
    double highest_m = 0;
    if (!w->live.scene || !w->tool) return;
    for (int v = 0; v < w->live.mesh.vertex_count; v++) highest_m = fmax(highest_m, w->live.mesh.positions_m[3 * v + 2]);
    w->wish.hover_z_m = highest_m + tool_radius(w) + HOVER_M;
    post_wish(w);
}

// ---- what the page wants

static void hold(web *w)
{
    w->wish.held = kn_gateway_pages(&w->gateway) > 0 && w->live.mesh.whole && w->tool;
    post_wish(w);
}

static void let_go(web *w)
{
    w->wish.pressed = w->beside = false;
    post_wish(w);
}

static void aim(web *w, const kn_web_message *m)
{
    const kn_model_def *def = &w->live.scene->model;
    double at_m[2];
    if (!kn_camera_pick(&w->camera, m->u, m->v, height_of(def), at_m)) return;
    for (int i = 0; i < 2; i++) {
        double most_m = 0.5 * def->spacing_m * (def->nodes[i] - 1) + BESIDE_M;
        w->wish.at_m[i] = fmin(fmax(at_m[i], -most_m), most_m);
    }
}

static void press(web *w)
{
    w->beside = !kn_dent_touch(&w->live.mesh, w->top, w->live.scene->model.spacing_m, w->tool, w->wish.at_m[0],
                               w->wish.at_m[1], &w->wish.touch_z_m, &w->wish.flush_z_m);
    w->wish.flush_z_m = fmax(w->wish.flush_z_m, w->wish.touch_z_m - UNEVEN_M);
    w->wish.pressed = !w->beside;
}

static void point(web *w, int page, const kn_web_message *m)
{
    kn_web_page *p = &w->gateway.page[page];
    int64_t now_ms = kn_live_now_ms();
    bool idle = w->owner < 0 || now_ms - w->gateway.page[w->owner].pointed_ms > IDLE_MS;
    if (w->owner != page && !idle) return;
    if (w->owner != page) let_go(w);
    w->owner = page;
    p->pointed_ms = now_ms;
    if (!w->mesh_id) return; // nothing is served
    if (!w->wish.pressed && !w->beside) aim(w, m);
    if (m->pressed && !w->wish.pressed && !w->beside) press(w);
    if (!m->pressed) w->wish.pressed = w->beside = false;
    w->wish.depth_m = fmin(m->depth_m, deepest(w));
    if (m->number != p->event) {
        int32_t n = ++w->wish.event;
        w->event[n % EVENTS].number = p->event = m->number;
        w->event[n % EVENTS].page = page;
        w->event[n % EVENTS].tick = INT64_MAX;
    }
    post_wish(w);
}

static void on_message(void *self, int page, const kn_web_message *m)
{
    web *w = self;
    if (m->kind == KN_WEB_POINTER) point(w, page, m);
    if (m->kind == KN_WEB_RESET && w->command_fd >= 0 && write(w->command_fd, "reset\n", 6) != 6)
        fail(KN_EXIT_DEVICE, "kneadd's command pipe takes nothing");
}

static void on_gone(void *self, int page)
{
    web *w = self;
    if (w->owner == page) let_go(w), w->owner = -1;
    hold(w);
}

// ---- what the page is told

static void take_samples(web *w)
{
    for (const kn_pointer_news *n; (n = kn_ring_front(&w->samples)); kn_ring_pop(&w->samples)) {
        if (n->event != w->news.event) w->event[n->event % EVENTS].tick = n->tick;
        w->news = *n;
        w->trace_n[w->traced++ % TRACE] = (float)n->force_n;
    }
}

// In words, and "ok", "wait" or "fault".
static const char *status(const web *w, int page, char *words, size_t size)
{
    const kn_pointer_news *n = &w->news;
#define SAY(level, ...) return snprintf(words, size, __VA_ARGS__), level
    if (w->live.scene_error[0]) SAY("fault", "the scene that is served cannot be read: %s", w->live.scene_error);
    if (kn_live_now_ms() - w->mesh_ms > UNHEARD_MS || !w->live.scene) SAY("wait", "waiting for kneadd: nothing is served");
    if (!w->tool) SAY("fault", "the scene has no probe%s%s", w->probe ? " " : "", w->probe ? w->probe : "");
    if (!w->moving) SAY("fault", "no device: %.300s", w->error);
    if (w->owner >= 0 && w->owner != page) SAY("wait", "another page holds the tool");
    if (n->mode == KN_POINTER_SILENT) SAY("fault", "force is zero; a new session begins in a moment");
    if (!n->heard && n->mode != KN_POINTER_ABSENT) SAY("wait", "no force from kneadd: does another hand hold %s?", w->tool->name);
    if (n->fault || n->mode == KN_POINTER_LET_GO)
        SAY("fault", "force taken to zero: %s; lifting the tool. %s",
            n->fault ? kn_fault_name((kn_fault)n->fault) : "kneadd was silent for 20 ms",
            n->fault == KN_FAULT_NONFINITE ? "Reset makes the object as new" : "Let go and press again");
    if (!n->released) SAY("fault", "let go and press again");
    if (!(n->flags & KN_FLAG_ENGAGED)) SAY("wait", "taking hold: the force comes up");
    if (w->beside) SAY("wait", "nothing is under the tool here");
    if (n->flags & KN_FLAG_CLAMPED) SAY("ok", "in contact; the force is at the device's limit");
    SAY("ok", "%s", n->contact ? "in contact" : "ready: press on the object");
#undef SAY
}

static void put(char **at, char *end, const char *format, ...) __attribute__((format(printf, 3, 4)));
static void put(char **at, char *end, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    int n = vsnprintf(*at, (size_t)(end - *at), format, args);
    va_end(args);
    *at = n < end - *at ? *at + n : end - 1;
}

static void put_text(char **at, char *end, const char *name, const char *text) // as JSON
{
    put(at, end, ",\"%s\":\"", name);
    for (; *text; text++)
        put(at, end, (unsigned char)*text < ' ' || *text == '"' || *text == '\\' ? "\\u%04x" : "%c", *text);
    put(at, end, "\"");
}

static size_t write_page(void *self, int page, uint8_t *bytes, size_t size)
{
    web *w = self;
    kn_web_page *p = &w->gateway.page[page];
    char *json = (char *)bytes + 4, *at = json, *end = json + size - 4 - w->jpeg_size, words[400];
    const char *level = status(w, page, words, sizeof words);
    bool mine = w->owner == page;
    put(&at, end, "{\"frame\":%u,\"event\":%u,\"tick\":%" PRId64 ",\"force_n\":%.3f,\"depth_mm\":%.2f,\"deepest_mm\":%.1f,"
        "\"contact\":%s,\"mine\":%s,\"resets\":%s,\"level\":\"%s\"", p->sent,
        w->shown && w->event[w->shown % EVENTS].page == page ? w->event[w->shown % EVENTS].number : 0, w->live.mesh.tick,
        w->news.force_n, 1e3 * w->news.depth_m, w->tool ? 1e3 * deepest(w) : 0.0, w->news.contact ? "true" : "false",
        mine ? "true" : "false", w->command_fd >= 0 ? "true" : "false", level);
    put_text(&at, end, "status", words);
    put_text(&at, end, "scene", w->live.scene ? w->live.scene->name : "");
    put_text(&at, end, "tool", w->tool ? w->tool->name : "");
    put(&at, end, ",\"trace\":[");
    if (w->traced - p->told > 200) p->told = w->traced - (w->traced < 200 ? w->traced : 200);
    for (; p->told < w->traced; p->told++)
        put(&at, end, "%s%.2f", at[-1] == '[' ? "" : ",", (double)w->trace_n[p->told % TRACE]);
    put(&at, end, "]}");
    uint32_t length = (uint32_t)(at - json);
    memcpy(bytes, &length, 4); // little endian, as every machine this runs on
    size_t picture = p->picture == w->pictures ? 0 : w->jpeg_size;
    p->picture = w->pictures;
    memcpy(at, w->jpeg, picture);
    return 4 + length + picture;
}

// ---- pictures

static void set_news(web *w)
{
    for (int i = 0; i < KN_GATEWAY_PAGES; i++) w->gateway.page[i].news = true;
    kn_gateway_wake(&w->gateway);
}

static bool somebody_looks(const web *w) // and has drawn what was sent
{
    for (int i = 0; i < KN_GATEWAY_PAGES; i++) {
        const kn_web_page *p = &w->gateway.page[i];
        if (p->wsi && p->sent - p->seen < KN_GATEWAY_IN_FLIGHT) return true;
    }
    return false;
}

static bool fill_still(web *w)
{
    kn_still *s = &w->painter.still;
    char error[400];
    if (w->mesh_id == w->live.mesh.mesh_id) return kn_still_update(s, &w->live), true;
    kn_view_scene view = s->view;
    kn_still_free(s);
    s->view = view;
    w->mesh_id = 0;
    if (!kn_still_live(s, &w->live, error, sizeof error) || error[0]) return false; // the scene comes every 5 s
    w->painter.fresh = true;
    w->mesh_id = w->live.mesh.mesh_id;
    return true;
}

static void paint(web *w)
{
    int64_t now_ms = kn_live_now_ms();
    if (1e-3 * (double)(now_ms - w->frame_ms) * w->rate_hz < 0.9 || !w->live.scene || !somebody_looks(w)) return;
    if (!kn_painter_idle(&w->painter) || !fill_still(w)) return;
    w->frame_ms = now_ms;
    take_samples(w);
    for (int32_t n = w->wish.event; n > w->painting && n > w->wish.event - EVENTS; n--)
        if (w->event[n % EVENTS].tick <= w->live.mesh.tick) w->painting = n;
    kn_painter_draw(&w->painter);
}

static void wake_for_picture(void *self) { ev_async_send(((web *)self)->ev, &((web *)self)->painted); }

static void on_painted(struct ev_loop *ev, ev_async *a, int events)
{
    (void)ev, (void)events;
    web *w = a->data;
    w->jpeg_size = w->painter.size;
    memcpy(w->jpeg, w->painter.jpeg, w->jpeg_size);
    w->shown = w->painting;
    w->pictures++;
    take_samples(w);
    set_news(w);
}

static void on_readable(struct ev_loop *ev, ev_io *io, int events)
{
    (void)ev, (void)events;
    web *w = io->data;
    kn_live_listen(&w->live, 0);
    take_scene(w);
    if (w->live.meshes == w->meshes) return;
    w->meshes = w->live.meshes;
    w->mesh_ms = kn_live_now_ms();
    take_mesh(w);
    paint(w);
}

static void on_due(struct ev_loop *ev, ev_timer *t, int events)
{
    (void)ev, (void)events;
    web *w = t->data;
    int64_t now_ms = kn_live_now_ms();
    take_samples(w);
    hold(w);
    if (w->owner >= 0 && w->wish.pressed && now_ms - w->gateway.page[w->owner].pointed_ms > LET_GO_MS) let_go(w);
    if (now_ms - w->frame_ms > 200) set_news(w);
}

static void on_stop(struct ev_loop *ev, ev_signal *s, int events)
{
    (void)s, (void)events;
    ev_break(ev, EVBREAK_ALL);
}

// ---- start and stop

static bool open_all(web *w)
{
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP};
    size_t largest = tjBufSize(w->width, w->height, TJSAMP_420);
    w->ev = ev_default_loop(EVFLAG_AUTO);
    w->jpeg = malloc(largest);
    w->painter.still.view = kn_view_scene_default();
    w->gateway.on_message = on_message;
    w->gateway.on_gone = on_gone;
    w->gateway.write = write_page;
    w->gateway.arg = w;
    kn_mailbox_init(&w->wishes, w->wish_slots, sizeof *w->wish_slots);
    if (!w->ev || !w->jpeg || !kn_ring_init(&w->samples, 1024, sizeof(kn_pointer_news))) {
        snprintf(w->error, sizeof w->error, "out of memory");
        return false;
    }
    ev_async_init(&w->painted, on_painted);
    ev_async_start(w->ev, &w->painted);
    if (!kn_live_open(&w->live, w->url, w->mesh_url, w->error, sizeof w->error) ||
        !kn_painter_open(&w->painter, w->width, w->height, wake_for_picture, w, w->error, sizeof w->error))
        return false;
    if (!kn_gateway_open(&w->gateway, w->ev, w->port, w->listen_fd, largest + 8192, w->error, sizeof w->error)) return false;
    ev_io_init(&w->bus_readable, on_readable, lcm_get_fileno(w->live.bus), EV_READ);
    ev_io_init(&w->mesh_readable, on_readable, lcm_get_fileno(w->live.mesh_bus), EV_READ);
    ev_timer_init(&w->due, on_due, 0, 0.1);
    w->painted.data = w->bus_readable.data = w->mesh_readable.data = w->due.data = w;
    ev_io_start(w->ev, &w->bus_readable);
    ev_io_start(w->ev, &w->mesh_readable);
    ev_timer_start(w->ev, &w->due);
    for (int i = 0; i < 3; i++) {
        ev_signal_init(&w->stops[i], on_stop, signals[i]);
        ev_signal_start(w->ev, &w->stops[i]);
    }
    return true;
}

static void close_all(web *w)
{
    w->wish.held = w->wish.pressed = false;
    post_wish(w);
    for (int i = 0; w->moving && i < 50 && w->news.mode != KN_POINTER_ABSENT; i++) usleep(10000), take_samples(w); // lifts
    if (w->moving) kn_device_stop(&w->device);
    kn_gateway_close(&w->gateway);
    kn_painter_close(&w->painter);
    kn_live_close(&w->live);
    kn_ring_free(&w->samples);
    free(w->top);
    free(w->jpeg);
}

static int bind_and_become(const web *w, char **command)
{
    char error[256];
    int fd = kn_gateway_listen(w->port, error, sizeof error);
    if (fd < 0) return fail(KN_EXIT_DEVICE, error);
    if (dup2(fd, 3) < 0 || fcntl(3, F_SETFD, 0) < 0) return fail(KN_EXIT_DEVICE, strerror(errno)); // 3 itself: not closed by exec
    execvp(command[0], command);
    fprintf(stderr, "knead web: %s: %s\n", command[0], strerror(errno));
    return KN_EXIT_USAGE;
}

static bool integer(const char *text, int low, int high, int *value)
{
    char *end;
    long n = strtol(text, &end, 10);
    if (end == text || *end || n < low || n > high) return false;
    return *value = (int)n, true;
}

static const char *take_option(web *w, int option, const char *text) // NULL, or what was expected
{
    char end = 0;
    int rate = 0;
    switch (option) {
    case 'P': w->probe = text; return NULL;
    case 'l': w->url = text; return NULL;
    case 'm': w->mesh_url = text; return NULL;
    case 'p': return integer(text, 0, 65535, &w->port) ? NULL : "a port, 0..65535";
    case 'r': return integer(text, 5, 60, &rate) ? w->rate_hz = rate, NULL : "pictures per second, 5..60";
    case 'c': return integer(text, 0, 1 << 20, &w->command_fd) && fcntl(w->command_fd, F_GETFD) >= 0 ? NULL : "an open file descriptor";
    case 'f': return integer(text, 0, 1 << 20, &w->listen_fd) && fcntl(w->listen_fd, F_GETFD) >= 0 ? NULL : "an open socket's descriptor";
    default:
        return sscanf(text, "%4dx%4d%c", &w->width, &w->height, &end) == 2 && w->width >= 160 && w->width <= 1920 &&
               w->height >= 160 && w->height <= 1920 ? NULL : "WxH, 160..1920 pixels on each side, e.g. 960x540";
    }
}

int kn_web_main(int argc, char **argv)
{
    static const struct option names[] = {
        {"probe", 1, NULL, 'P'}, {"port", 1, NULL, 'p'},       {"rate", 1, NULL, 'r'},     {"size", 1, NULL, 's'},
        {"bind", 0, NULL, 'b'},  {"command-fd", 1, NULL, 'c'}, {"lcm-url", 1, NULL, 'l'},  {"mesh-url", 1, NULL, 'm'},
        {"help", 0, NULL, 'h'},  {"listen-fd", 1, NULL, 'f'},  {NULL, 0, NULL, 0}};
    static web w = {.width = 960, .height = 540, .listen_fd = -1, .command_fd = -1, .rate_hz = 30, .owner = -1};
    bool binds = false;
    opterr = 0; // our own words
    for (int option, which = 0; (option = getopt_long(argc, argv, "+:h", names, &which)) != -1;) {
        const char *word = argv[optind - 1], *expected = NULL;
        if (option == 'h') return fputs(help, stdout), KN_EXIT_OK;
        if (option == 'b') { binds = true; continue; }
        if (option == ':') expected = "a value";
        else if (option == '?') expected = "an option of knead web --help";
        else expected = take_option(&w, option, word = optarg);
        if (expected) return fprintf(stderr, "knead web: %s: expected %s\n", word, expected), KN_EXIT_USAGE;
    }
    if (binds != (optind < argc))
        return fprintf(stderr, "knead web: %s: expected %s\n", binds ? "--bind" : argv[optind], binds ? "a command" : "an option"), KN_EXIT_USAGE;
    if (binds) return bind_and_become(&w, argv + optind);
    w.gateway.fd = -1;
    int code = KN_EXIT_OK;
    if (open_all(&w)) {
        printf("knead web: open %s\n", w.gateway.address);
        fflush(stdout);
        ev_run(w.ev, 0);
    } else {
        code = fail(KN_EXIT_DEVICE, w.error);
    }
    close_all(&w);
    return code;
}
