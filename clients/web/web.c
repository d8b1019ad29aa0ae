// knead web: the object in a browser, and a tool in the visitor's hand. Three threads: this one, on libev, for
// messages; the device's, 1 kHz, for poses; the painter's.
#include "clients/knead/ask.h"
#include "clients/knead/commands.h"
#include "clients/knead/device.h"
#include "clients/knead/foot.h"
#include "clients/knead/reach.h"
#include "clients/web/gateway.h"
#include "clients/web/painter.h"
#include "server/mailbox.h"
#include "server/ring.h"
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#define TRACE 256       // ms of force that wait for a page
#define EVENTS 64       // of the pointer, on their way through kneadd
#define LET_GO_MS 400   // a pressing page that is silent this long is gone: it speaks every 50 ms; so is this thread
#define RESET_MS 250    // resets come no faster
#define MOVES_MS 200    // a pointer that was heard of so recently
#define IDLE_MS 2000    // after so long another page may take the tool
#define UNHEARD_MS 1000 // without a mesh: nobody serves

static const char help[] =
    "usage: knead web [OPTION]...\n"
    "       knead web [--port N] --bind COMMAND...\n\n"
    "Serves a page that shows what a running kneadd serves, and on which the pointer presses. Prints its address, and "
    "runs\n"
    "until SIGINT or SIGTERM. Only this machine reaches it (another one: ssh -L N:127.0.0.1:N), and only with the "
    "token in\n"
    "the address.\n\n"
    "  --probe NAME       the tool in hand (the scene's first round one, else its first probe)\n"
    "  --port N           0..65535; 0: a free one (0)\n"
    "  --rate HZ          pictures per second, 5..60, at most the scene's mesh.rate (30)\n"
    "  --size WxH         of a picture, 160..1920 pixels each (800x450)\n"
    "  --control PATH     kneadd's --control, for Reset (none: no Reset)\n"
    "  --lcm-url URL      poses, forces, scene ($LCM_DEFAULT_URL, " KN_FORCE_URL ")\n"
    "  --mesh-url URL     meshes (" KN_MESH_URL ")\n"
    "  --bind COMMAND...  opens the page's socket as descriptor 3 and becomes COMMAND, whose knead web --listen-fd 3 "
    "serves\n"
    "                     it: from inside a network namespace, which no browser outside reaches\n"
    "  --listen-fd N      see --bind\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no bus, no socket or no OpenGL.\n";

typedef enum button { UP, PRESSES, BESIDE, BARRED } button; // BESIDE: where nothing is; BARRED: it must come up first

typedef struct web {
    const char *probe, *url, *mesh_url, *control;
    int port, width, height, listen_fd, rate_hz;
    bool bind, help;
    struct ev_loop *ev;
    ev_io bus_readable, mesh_readable;
    ev_timer due;
    ev_async painted;
    ev_signal stops[3];
    kn_gateway gateway;
    kn_painter painter;
    kn_live live;
    int64_t meshes, mesh_ms; // seen; when the last came
    int64_t mesh_id;         // of the painter's still
    int64_t frame_ms;        // when the last drawing began
    uint64_t scene_hash;                        // of the scene that tool and reach are of
    const kn_probe_def *tool;
    kn_reach reach;
    kn_device device;
    bool moving;           // the device's thread runs
    kn_pointer pointer;    // that thread's
    kn_mailbox wishes;     // to it
    kn_pointer_wish wish, wish_slots[3];
    kn_ring samples;       // from it: kn_pointer_news
    kn_pointer_news news;  // the newest of them
    float trace_n[TRACE];
    uint64_t traced;
    uint8_t *jpeg;         // the newest picture: the painter is at the next one
    size_t jpeg_size;
    uint32_t pictures;
    int owner;             // the page that has the tool, -1: none
    button button;         // of that page
    int64_t reset_ms;      // the last reset
    struct { uint32_t number; int page; int64_t tick; } event[EVENTS]; // tick of kneadd's answer, INT64_MAX: not yet
    int32_t painting, shown; // newest event in the picture that is being drawn, that was drawn
    bool drawing;            // from the painter's begin until its picture has been taken
    int stale_ms;            // the device thread's: since the last wish
    char error[512];
} web;

static int fail(int code, const char *what) { return fprintf(stderr, "knead web: %s\n", what), code; }

// ---- the tool

static kn_hand_out move(void *self, const kn_hand_force *force, int elapsed_ms) // in the device's thread
{
    web *w = self;
    bool fresh;
    kn_pointer_wish wish = *(const kn_pointer_wish *)kn_mailbox_latest(&w->wishes, &fresh);
    w->stale_ms =
        fresh ? 0 : w->stale_ms + elapsed_ms; // a wish comes every 100 ms, unless the main thread stands still
    wish.stale = w->stale_ms > LET_GO_MS;
    kn_hand_out out = kn_pointer_tick(&w->pointer, &wish, force, elapsed_ms);
    kn_ring_push(&w->samples, &w->pointer.news); // a full one loses trace, nothing else
    return out;
}

static void post_wish(web *w)
{
    w->wish.held = kn_gateway_pages(&w->gateway) > 0 && w->moving && w->wish.hover_z_m > 0;
    w->wish.pressed = w->button == PRESSES;
    *(kn_pointer_wish *)kn_mailbox_back(&w->wishes) = w->wish;
    kn_mailbox_post(&w->wishes);
}

static void take_samples(web *w)
{
    for (const kn_pointer_news *n; (n = kn_ring_front(&w->samples)); kn_ring_pop(&w->samples)) {
        if (n->event && n->event != w->news.event) w->event[n->event % EVENTS].tick = n->tick;
        w->news = *n;
        w->trace_n[w->traced++ % TRACE] = (float)n->force_n;
    }
}

static const kn_probe_def *choose_tool(const web *w)
{
    const kn_model_def *def = &w->live.scene->model;
    for (int i = 0; i < def->probe_count; i++)
        if (w->probe ? !strcmp(def->probe[i].name, w->probe) : !kn_foot_flat(def->probe[i].shape))
            return &def->probe[i];
    return w->probe || def->probe_count == 0 ? NULL : &def->probe[0];
}

// Another scene: another tool, perhaps, and a hand that begins anew.
static void take_scene(web *w)
{
    int64_t session = 0;
    const kn_view_scene *view = &w->painter.still.view;
    if (!w->live.scene || w->live.scene->text_hash == w->scene_hash) return;
    if (w->moving) kn_device_stop(&w->device);
    kn_reach_close(&w->reach);
    w->moving = false;
    if (w->button != UP) w->button = BARRED;
    w->wish = (kn_pointer_wish){
        .event = w->wish.event}; // nothing of the old object is true of this one; no hover_z_m: no tool
    post_wish(w);
    w->scene_hash = w->live.scene->text_hash;
    w->mesh_id = 0;
    w->tool = choose_tool(w);
    snprintf(w->error, sizeof w->error, "out of memory");
    if (!w->tool || !kn_reach_open(&w->reach, &w->live.scene->model, w->tool, view->azimuth_deg, view->elevation_deg,
                                   (float)w->width / (float)w->height))
        return;
    if (getrandom(&session, 7, 0) < 0) session = kn_live_now_ms();
    kn_pointer_init(&w->pointer, w->tool->shape, session);
    memset(&w->device, 0, sizeof w->device);
    w->moving = kn_device_start(&w->device, move, w, w->url, w->tool->name, w->error, sizeof w->error);
}

// ---- what a page wants

static void point(web *w, int page, const kn_web_message *m)
{
    kn_web_page *p = &w->gateway.page[page];
    int64_t now_ms = kn_live_now_ms();
    if (w->owner >= 0 && w->owner != page && now_ms - w->gateway.page[w->owner].pointed_ms <= IDLE_MS) return;
    if (w->owner != page) w->button = UP;
    w->owner = page;
    p->pointed_ms = now_ms;
    if (!w->moving || !kn_reach_fits(&w->reach, &w->live.mesh)) {
        if (m->pressed) w->button = BARRED;
        return;
    }
    if (w->button == UP) kn_reach_aim(&w->reach, m->u, m->v, &w->wish);
    if (!m->pressed) w->button = UP;
    else if (w->button == UP) w->button = kn_reach_touch(&w->reach, &w->live.mesh, &w->wish) ? PRESSES : BESIDE;
    w->wish.pressed = w->button == PRESSES;
    w->wish.depth_m = fmin(m->depth_m, kn_reach_deepest(&w->reach, &w->wish));
    if (m->number != p->event) {
        int32_t n = ++w->wish.event % EVENTS;
        w->event[n].number = p->event = m->number;
        w->event[n].page = page;
        w->event[n].tick = INT64_MAX;
    }
    post_wish(w);
}

static void reset(web *w)
{
    int64_t now_ms = kn_live_now_ms();
    if (!w->control || now_ms - w->reset_ms < RESET_MS) return;
    w->reset_ms = now_ms;
    if (!kn_ask_blindly(w->control, "reset"))
        fprintf(stderr, "knead web: --control %s: nobody serves there\n", w->control);
}

static void on_message(void *self, int page, const kn_web_message *m)
{
    web *w = self;
    if (m->kind == KN_WEB_POINTER) point(w, page, m);
    else reset(w);
}

static void on_gone(void *self, int page)
{
    web *w = self;
    for (int i = 0; i < EVENTS; i++)
        if (w->event[i].page == page) w->event[i].page = -1; // not the next one's in that place
    if (w->owner != page) return;
    w->owner = -1;
    w->button = UP;
    post_wish(w);
}

// ---- what a page is told

// In words; returns "ok", "wait" or "fault".
static const char *status(const web *w, int page, char *words, size_t size)
{
    const kn_pointer_news *n = &w->news;
#define SAY(level, ...) return snprintf(words, size, __VA_ARGS__), level
    if (w->live.scene_error[0]) SAY("fault", "the scene that is served cannot be read: %s", w->live.scene_error);
    if (kn_live_now_ms() - w->mesh_ms > UNHEARD_MS) SAY("wait", "waiting for kneadd: nothing is served");
    if (!w->live.scene) SAY("wait", "waiting for the scene");
    if (!w->tool) SAY("fault", "the scene has no probe%s%s", w->probe ? " " : "", w->probe ? w->probe : "");
    if (!w->moving) SAY("fault", "no device: %.300s", w->error);
    if (!kn_reach_fits(&w->reach, &w->live.mesh)) SAY("wait", "waiting for the mesh of this scene");
    if (w->owner >= 0 && w->owner != page) SAY("wait", "another page holds the tool");
    if (n->mode == KN_POINTER_SILENT) SAY("fault", "force is zero; a new session begins in a moment");
    if (n->fault > KN_FAULT_IMPULSE)
        SAY("fault", "force taken to zero: %s. Way back: %s", kn_fault_name((kn_fault)n->fault),
            kn_fault_remedy((kn_fault)n->fault));
    if (n->fault || n->mode == KN_POINTER_LET_GO)
        SAY("fault", "force taken to zero: %s. The tool lifts; let go, then press again",
            n->fault ? kn_fault_name((kn_fault)n->fault) : "none came for 20 ms");
    if (!n->heard && n->mode == KN_POINTER_FOLLOW)
        SAY("wait", "no force from kneadd: does another hand hold %s?", w->tool->name);
    if (!n->released || w->button == BARRED) SAY("wait", "let go, then press again");
    if (!(n->flags & KN_FLAG_ENGAGED))
        SAY("wait", n->contact ? "poses were late: the force fades and returns" : "taking hold");
    if (w->button == BESIDE) SAY("wait", "nothing is under the tool here");
    if (n->flags & KN_FLAG_CLAMPED) SAY("ok", "in contact; the force is at the device's limit");
    if (n->contact) SAY("ok", "in contact");
    SAY("ok", w->button == UP  ? "ready: press on the object"
              : n->depth_m > 0 ? "held: nothing pushes back"
                               : "coming down");
#undef SAY
}

typedef struct json { char *at, *end; } json;

__attribute__((format(printf, 2, 3))) static void put(json *t, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    int n = vsnprintf(t->at, (size_t)(t->end - t->at), format, args);
    va_end(args);
    t->at = n < t->end - t->at ? t->at + n : t->end - 1;
}

static void put_words(json *t, const char *name, const char *words) // as JSON has them
{
    put(t, ",\"%s\":\"", name);
    for (; *words; words++)
        put(t, (unsigned char)*words < ' ' || *words == '"' || *words == '\\' ? "\\u%04x" : "%c", *words);
    put(t, "\"");
}

static size_t write_page(void *self, int page, uint8_t *bytes, size_t size)
{
    web *w = self;
    kn_web_page *p = &w->gateway.page[page];
    char words[400], *begin = (char *)bytes + 4;
    json t = {begin, (char *)bytes + size - w->jpeg_size};
    const char *level = status(w, page, words, sizeof words);
    bool own = w->shown > w->wish.event - EVENTS && w->event[w->shown % EVENTS].page == page;
    uint32_t event = own ? w->event[w->shown % EVENTS].number : 0;
    put(&t,
        "{\"frame\":%u,\"event\":%u,\"tick\":%" PRId64
        ",\"force_n\":%.3f,\"depth_mm\":%.2f,\"deepest_mm\":%.1f,\"contact\":%s,"
        "\"mine\":%s,\"resets\":%s,\"level\":\"%s\"",
        p->sent, event, w->live.mesh.tick, w->news.force_n, 1e3 * w->news.depth_m,
        w->moving ? 1e3 * kn_reach_deepest(&w->reach, &w->wish) : 0, w->news.contact ? "true" : "false",
        w->owner == page ? "true" : "false", w->control ? "true" : "false", level);
    put_words(&t, "status", words);
    put_words(&t, "scene", w->live.scene ? w->live.scene->name : "");
    put_words(&t, "tool", w->tool ? w->tool->name : "");
    put(&t, ",\"trace\":[");
    if (w->traced - p->told > TRACE) p->told = w->traced < TRACE ? 0 : w->traced - TRACE;
    for (const char *comma = ""; p->told < w->traced; p->told++, comma = ",")
        put(&t, "%s%.2f", comma, (double)w->trace_n[p->told % TRACE]);
    put(&t, "]}");
    uint32_t length = (uint32_t)(t.at - begin);
    memcpy(bytes, &length, 4); // little endian, as every machine this runs on
    size_t picture = p->picture == w->pictures ? 0 : w->jpeg_size;
    p->picture = w->pictures;
    memcpy(t.at, w->jpeg, picture);
    return 4 + length + picture;
}

// ---- pictures

// The painter's still becomes the newest mesh. False: the mesh is not of the scene that was heard; that comes every 5
// s.
static bool fill_still(web *w)
{
    kn_still *s = &w->painter.still;
    char error[400];
    if (w->mesh_id == w->live.mesh.mesh_id) return kn_still_update(s, &w->live), true;
    kn_view_scene view = s->view;
    kn_still_free(s);
    s->view = view;
    w->mesh_id = 0;
    if (!kn_still_live(s, &w->live, error, sizeof error) || error[0]) return false;
    w->mesh_id = w->live.mesh.mesh_id;
    return w->painter.fresh = true;
}

// The newest event that kneadd had answered when this mesh was.
static int32_t answered(const web *w)
{
    for (int32_t n = w->wish.event; n > w->painting && n > w->wish.event - EVENTS; n--)
        if (w->event[n % EVENTS].tick <= w->live.mesh.tick) return n;
    return w->painting;
}

// Pictures come at the asked rate. While a pointer moves, one that shows nothing new of it comes later, at two thirds
// of that rate, so that the painter is free when something does.
static void paint(web *w)
{
    if (!w->live.scene || !kn_gateway_wants(&w->gateway) || w->drawing) return;
    take_samples(w);
    int64_t now_ms = kn_live_now_ms();
    int32_t newest = answered(w);
    bool moves = w->owner >= 0 && now_ms - w->gateway.page[w->owner].pointed_ms < MOVES_MS && newest == w->painting;
    // a tenth of a period early is not skipped
    if ((double)(now_ms - w->frame_ms) * w->rate_hz < (moves ? 1400 : 900) || !fill_still(w)) return;
    w->frame_ms = now_ms;
    w->painting = newest;
    w->drawing = true;
    kn_painter_draw(&w->painter);
}

static void call_back(void *self)
{
    ev_async_send(((web *)self)->ev, &((web *)self)->painted);
} // in the painter's thread

static void on_painted(struct ev_loop *ev, ev_async *a, int events)
{
    (void)ev, (void)events;
    web *w = a->data;
    if (!kn_painter_drawn(&w->painter)) return;
    w->jpeg_size = w->painter.size;
    memcpy(w->jpeg, w->painter.jpeg, w->jpeg_size);
    w->shown = w->painting;
    w->drawing = false;
    w->pictures++;
    take_samples(w);
    kn_gateway_news(&w->gateway);
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
    if (w->moving && kn_reach_fits(&w->reach, &w->live.mesh)) kn_reach_hover(&w->reach, &w->live.mesh, &w->wish);
    post_wish(w);
    paint(w);
}

static void on_due(struct ev_loop *ev, ev_timer *t, int events) // ten times a second, whatever else happens
{
    (void)ev, (void)events;
    web *w = t->data;
    int64_t now_ms = kn_live_now_ms();
    take_samples(w);
    bool silent = w->owner >= 0 && now_ms - w->gateway.page[w->owner].pointed_ms > LET_GO_MS;
    if (silent && w->button != UP) w->button = BARRED;
    post_wish(w);
    if (now_ms - w->frame_ms > 200) kn_gateway_news(&w->gateway);
}

static void on_stop(struct ev_loop *ev, ev_signal *s, int events)
{
    (void)s, (void)events;
    ev_break(ev, EVBREAK_ALL);
}

// ---- start and stop

static void watch(web *w)
{
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP};
    ev_io_init(&w->bus_readable, on_readable, lcm_get_fileno(w->live.bus), EV_READ);
    ev_io_init(&w->mesh_readable, on_readable, lcm_get_fileno(w->live.mesh_bus), EV_READ);
    ev_timer_init(&w->due, on_due, 0, 0.1);
    w->bus_readable.data = w->mesh_readable.data = w->due.data = w;
    ev_io_start(w->ev, &w->bus_readable);
    ev_io_start(w->ev, &w->mesh_readable);
    ev_timer_start(w->ev, &w->due);
    for (int i = 0; i < 3; i++) {
        ev_signal_init(&w->stops[i], on_stop, signals[i]);
        ev_signal_start(w->ev, &w->stops[i]);
    }
}

static bool open_all(web *w)
{
    size_t largest = kn_painter_largest(w->width, w->height);
    w->ev = ev_default_loop(EVFLAG_AUTO);
    w->jpeg = malloc(largest);
    w->painter.still.view = kn_view_scene_default();
    kn_mailbox_init(&w->wishes, w->wish_slots, sizeof *w->wish_slots);
    snprintf(w->error, sizeof w->error, "out of memory");
    if (!w->ev || !w->jpeg || !kn_ring_init(&w->samples, 1024, sizeof(kn_pointer_news))) return false;
    ev_async_init(&w->painted, on_painted);
    w->painted.data = w;
    ev_async_start(w->ev, &w->painted);
    w->gateway.on_message = on_message;
    w->gateway.on_gone = on_gone;
    w->gateway.write = write_page;
    w->gateway.arg = w;
    return kn_live_open(&w->live, w->url, w->mesh_url, w->error, sizeof w->error) &&
           kn_painter_open(&w->painter, w->width, w->height, call_back, w, w->error, sizeof w->error) &&
           kn_gateway_open(&w->gateway, w->ev, w->port, w->listen_fd, largest + 8192, w->error, sizeof w->error);
}

static void close_all(web *w)
{
    kn_gateway_close(&w->gateway); // and with it the pages: nobody holds the tool any more
    post_wish(w);
    for (int i = 0; w->moving && i < 50 && w->news.mode != KN_POINTER_ABSENT; i++)
        usleep(10000), take_samples(w); // it lifts
    if (w->moving) kn_device_stop(&w->device);
    kn_painter_close(&w->painter);
    kn_live_close(&w->live);
    kn_reach_close(&w->reach);
    kn_ring_free(&w->samples);
    free(w->jpeg);
}

static int bind_and_become(const web *w, char **command)
{
    char error[256];
    int fd = kn_gateway_listen(w->port, error, sizeof error);
    if (fd < 0) return fail(KN_EXIT_DEVICE, error);
    if (fd == 3 ? fcntl(3, F_SETFD, 0) < 0 : dup2(fd, 3) < 0) return fail(KN_EXIT_DEVICE, strerror(errno));
    execvp(command[0], command);
    fprintf(stderr, "knead web: --bind %s: %s\n", command[0], strerror(errno));
    return KN_EXIT_USAGE;
}

static bool integer(const char *word, int low, int high, int *value)
{
    char end = 0;
    return *word >= '0' && *word <= '9' && sscanf(word, "%7d%c", value, &end) == 1 && *value >= low && *value <= high;
}

static bool pixels(const char *word, int *width, int *height)
{
    char end = 0;
    return *word >= '0' && *word <= '9' && sscanf(word, "%4dx%4d%c", width, height, &end) == 2 && *width >= 160 &&
           *width <= 1920 && *height >= 160 && *height <= 1920;
}

static bool listening(const char *word, int *fd) // the number of a socket that listens
{
    int yes = 0;
    socklen_t size = sizeof yes;
    return integer(word, 0, 1 << 20, fd) && getsockopt(*fd, SOL_SOCKET, SO_ACCEPTCONN, &yes, &size) == 0 && yes;
}

static const char *take(web *w, int option, const char *text) // NULL, or what was expected
{
    switch (option) {
    case 'h': w->help = true; return NULL;
    case 'b': w->bind = true; return NULL;
    case 'P': w->probe = text; return NULL;
    case 'l': w->url = text; return NULL;
    case 'm': w->mesh_url = text; return NULL;
    case 'p': return integer(text, 0, 65535, &w->port) ? NULL : "a port, 0..65535";
    case 'r': return integer(text, 5, 60, &w->rate_hz) ? NULL : "pictures per second, 5..60";
    case 's': return pixels(text, &w->width, &w->height) ? NULL : "WxH, 160..1920 pixels on each side, e.g. 960x540";
    case 'c': return (w->control = text), *text ? NULL : "a path";
    default: return listening(text, &w->listen_fd) ? NULL : "a socket that listens";
    }
}

static int parse(web *w, int argc, char **argv)
{
    static const struct option names[] = {
        {"probe", 1, NULL, 'P'}, {"port", 1, NULL, 'p'},       {"rate", 1, NULL, 'r'},     {"size", 1, NULL, 's'},
        {"bind", 0, NULL, 'b'},  {"control", 1, NULL, 'c'}, {"lcm-url", 1, NULL, 'l'},  {"mesh-url", 1, NULL, 'm'},
        {"help", 0, NULL, 'h'},  {"listen-fd", 1, NULL, 'f'},  {NULL, 0, NULL, 0}};
    opterr = 0; // our own words
    for (int option, which = 0; (option = getopt_long(argc, argv, "+:h", names, &which)) != -1;) {
        const char *word = argv[optind - 1], *expected = option == ':' ? "a value" : "an option of knead web --help";
        if (option == ':' || option == '?')
            return fprintf(stderr, "knead web: %s: expected %s\n", word, expected), KN_EXIT_USAGE;
        if ((expected = take(w, option, optarg)))
            return fprintf(stderr, "knead web: --%s %s: expected %s\n", names[which].name, optarg, expected),
                   KN_EXIT_USAGE;
    }
    if (w->help) return KN_EXIT_OK;
    if (w->bind && optind == argc) return fail(KN_EXIT_USAGE, "--bind: expected a command");
    if (!w->bind && optind < argc)
        return fprintf(stderr, "knead web: %s: expected an option\n", argv[optind]), KN_EXIT_USAGE;
    if (!kn_join_check(w->url, KN_FORCE_URL, w->error, sizeof w->error) ||
        !kn_join_check(w->mesh_url, KN_MESH_URL, w->error, sizeof w->error))
        return fail(KN_EXIT_USAGE, w->error);
    return KN_EXIT_OK;
}

int kn_web_main(int argc, char **argv)
{
    static web w = {.width = 800, .height = 450, .listen_fd = -1, .rate_hz = 30, .owner = -1,
                    .gateway.fd = -1};
    int code = parse(&w, argc, argv);
    if (code == KN_EXIT_OK && w.help) return fputs(help, stdout), KN_EXIT_OK;
    if (code != KN_EXIT_OK) return code;
    if (w.bind) return bind_and_become(&w, argv + optind);
    code = open_all(&w) ? KN_EXIT_OK : fail(KN_EXIT_DEVICE, w.error);
    if (code == KN_EXIT_OK) {
        printf("knead web: open %s\n", w.gateway.address);
        if (fflush(stdout) != 0)
            code = fail(KN_EXIT_DEVICE, "nobody can read the page's address: standard output is broken");
    }
    if (code == KN_EXIT_OK) {
        watch(&w);
        ev_run(w.ev, 0);
    }
    close_all(&w);
    return code;
}
