// knead web: shows the object in a browser and lets the user move a tool. There are three threads. The main thread runs
// libev and handles messages, the device's thread makes poses at 1 kHz, and the painter's thread draws pictures.
#include "clients/knead/ask.h"
#include "clients/knead/commands.h"
#include "clients/web/web.h"
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

// Largest size of a message without its picture, bytes: `about`, 16 answers of 200 characters of at most 6 bytes each,
// and the traces.
#define ROOM (KN_WEB_ABOUT + 40960)
// Longest TMPDIR, including NUL. w->folder has room for TMPDIR and the name of this run's folder.
#define FOLDER_MAX 40
#define MOVES_MS 200 // the pointer counts as moving for this time after a pointer event

static const char help[] =
    "usage: knead web [OPTION]...\n"
    "       knead web [--port N] --bind COMMAND...\n\n"
    "Serve a page that shows the object of a running kneadd and presses it with the pointer. Print its address, and "
    "run\n"
    "until SIGINT or SIGTERM. Only this machine can open the page (from another one: ssh -L N:127.0.0.1:N), and only "
    "with\n"
    "the token in the address. --address opens the page to a network, encrypted; the browser then warns of an unknown\n"
    "certificate, whose fingerprint is printed with the address.\n\n"
    "  --probe NAME       tool in hand (default: the scene's first round one, else its first probe)\n"
    "  --address HOST     IPv4 address of this machine to serve the page at (default: 127.0.0.1)\n"
    "  --port N           port of the page, 0 to 65535; 0 chooses a free one (default: 0)\n"
    "  --rate HZ          pictures per second, 5 to 60, at most the scene's mesh.rate (default: 30)\n"
    "  --size WxH         size of a picture, 160 to 1920 pixels each (default: 800x450)\n"
    "  --control PATH     control socket of kneadd, its --control, for the buttons of an operator (default: none)\n"
    "  --scenes DIR       folder whose *.yaml can be loaded from the page (default: none)\n"
    "  --lcm-url URL      bus of poses, forces and scene (default: $LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL     bus of meshes (default: " KN_MESH_URL ")\n"
    "  --bind COMMAND...  open the page's socket as descriptor 3 and run COMMAND in its place, whose knead web "
    "--listen-fd 3\n"
    "                     serves the page, e.g. inside a network namespace that no browser outside can reach\n"
    "  --listen-fd N      descriptor of a listening socket, see --bind\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no bus, no socket or no OpenGL.\n";

static int fail(int code, const char *what) { return fprintf(stderr, "knead web: %s\n", what), code; }

// ---- pictures

// Update the painter's still to the newest mesh. Return false if the mesh does not belong to the scene that was heard.
// The matching KNEAD_SCENE then comes within a second.
static bool fill_still(kn_web *w)
{
    kn_still *s = &w->painter.still;
    char error[400];
    // If the mesh has the same topology as the still, only move the vertices.
    if (w->mesh_id == w->live.mesh.mesh_id) return kn_still_update(s, &w->live), true;
    kn_view_scene view = s->view;
    kn_still_free(s);
    s->view = view;
    s->view.value = NULL; // clear the pointer to values of the old still
    w->mesh_id = 0;
    if (!kn_still_live(s, &w->live, error, sizeof error) || error[0]) return false;
    w->mesh_id = w->live.mesh.mesh_id;
    return w->painter.fresh = true;
}

// Return whether the meshes contain the values of this measure. Displacement follows from the vertices alone.
bool kn_web_measured(const kn_web *w, int measure)
{
    return measure == KN_MEASURE_DISPLACEMENT || (measure == KN_MEASURE_STRESS && w->live.mesh.stress_pa) ||
           (measure == KN_MEASURE_RESIDUAL && w->live.mesh.residual_strain);
}

// Colour the still by the chosen measure. The scale follows the largest value with hysteresis, so that it does not
// flicker.
static void color(kn_web *w)
{
    // Smallest value at the top of the colour scale for each measure, in SI units. Smaller values are rounding errors.
    static const double least[KN_MEASURES] = {1e-3, 100, 0.01};
    kn_still *s = &w->painter.still;
    s->view.value = NULL;
    if (w->measure < 0 || !kn_still_told(s, &w->live, (kn_measure)w->measure)) return;
    const double top = kn_scale_round(fmax(kn_still_most(s), least[w->measure]));
    // Raise the top of the scale at once, but lower it only if the largest value is below 30 % of the top.
    if (top > w->top || top < 0.3 * w->top) w->top = top;
    kn_still_scale(s, w->top);
}

void kn_web_png_path(const kn_web *w, char path[128]) { snprintf(path, 128, "%s/picture.png", w->folder); }

// Prepare the label of a picture, and request a PNG copy of the picture if a page waits for one.
static void label(kn_web *w)
{
    static char path[128], caption[160];
    static kn_scale scale;
    kn_painter *p = &w->painter;
    kn_web_png_path(w, path);
    snprintf(caption, sizeof caption, "%s, %.3f s", w->live.scene->name, 1e-3 * (double)w->live.mesh.tick);
    p->png = w->png_page >= 0 && !w->png_there ? path : NULL;
    p->label = (kn_label){.caption = caption};
    if (w->measure < 0) return;
    scale = (kn_scale){kn_measure_names[w->measure].words, kn_measure_names[w->measure].unit, w->top};
    p->label.scale = &scale;
}

// Tell the page that asked for the PNG that it is ready, or why it failed.
static void tell_png(kn_web *w)
{
    if (w->png_page < 0 || w->png_there || !w->painter.png) return;
    const char *why = w->painter.size > 0 ? w->painter.png_error : "The picture could not be drawn.";
    kn_web_answer_page(w, w->png_page, w->png_id, !*why, "%s", *why ? why : "The picture is ready.");
    w->png_there = !*why;
    w->png_page = -1;
}

// Return the newest pointer event that kneadd had answered by the tick of this mesh.
static int32_t answered(const kn_web *w)
{
    for (int32_t n = w->wish.event; n > w->painting && n > w->wish.event - KN_WEB_EVENTS; n--)
        if (w->event[n % KN_WEB_EVENTS].tick <= w->live.mesh.tick) return n;
    return w->painting;
}

// Draw the next picture if one is due. Pictures can be late, because meshes come at times of their own. After a late
// picture the next one is due earlier, which keeps the average rate. While the pointer moves, a picture that shows no
// new pointer event is delayed a little, so that the painter is free when the mesh with the effect of the event comes.
static void paint(kn_web *w)
{
    if (!w->live.scene || !kn_gateway_wants(&w->gateway) || w->drawing) return;
    kn_web_take_samples(w);
    int64_t now_ms = kn_live_now_ms();
    int32_t newest = answered(w);
    bool moves = w->owner >= 0 && now_ms - w->gateway.page[w->owner].pointed_ms < MOVES_MS && newest == w->painting;
    const double period_ms = 1000.0 / w->rate_hz;
    // A mesh that comes up to a tenth of a period early is drawn and not skipped.
    if ((double)now_ms < w->due_ms + (moves ? 0.4 : -0.1) * period_ms || !fill_still(w)) return;
    kn_view_scene *view = &w->painter.still.view;
    view->azimuth_deg = w->look.azimuth_deg;
    view->elevation_deg = w->look.elevation_deg;
    view->zoom = w->look.zoom;
    view->style = w->look.style;
    color(w);
    label(w);
    w->frame_ms = now_ms;
    // Compensate for a late picture by at most one period.
    w->due_ms = fmax(w->due_ms, (double)now_ms - period_ms) + period_ms;
    w->painting = newest;
    w->drawing = true;
    kn_painter_draw(&w->painter);
}

// Wake the main thread. Runs in the painter's thread, where only ev_async_send is safe.
static void call_back(void *self) { ev_async_send(((kn_web *)self)->ev, &((kn_web *)self)->painted); }

// Take the finished picture from the painter and send it to the pages.
static void on_painted(struct ev_loop *ev, ev_async *a, int events)
{
    (void)ev, (void)events;
    kn_web *w = a->data;
    if (!kn_painter_drawn(&w->painter)) return;
    w->jpeg_size = w->painter.size;
    w->bar_m = w->painter.bar_m;
    memcpy(w->jpeg, w->painter.jpeg, w->jpeg_size);
    w->shown = w->painting;
    w->drawing = false;
    w->pictures++;
    tell_png(w);
    kn_web_take_samples(w);
    kn_gateway_news(&w->gateway);
}

// Handle bus messages. A new mesh moves the tool's hovering height and may start a picture.
static void on_readable(struct ev_loop *ev, ev_io *io, int events)
{
    (void)ev, (void)events;
    kn_web *w = io->data;
    kn_live_listen(&w->live, 0);
    kn_web_take_scene(w);
    if (w->live.meshes == w->meshes) return;
    w->meshes = w->live.meshes;
    w->mesh_ms = kn_live_now_ms();
    if (w->moving && kn_reach_fits(&w->reach, &w->live.mesh)) kn_reach_hover(&w->reach, &w->live.mesh, &w->wish);
    kn_web_post_wish(w);
    paint(w);
}

// Update the rate of mesh messages and the lists that change seldom. This function is called once a second.
static void count(kn_web *w, int64_t now_ms)
{
    const int64_t meshes = w->live.meshes - w->counted_meshes, bytes = w->vitals.mesh_bytes - w->counted_bytes;
    w->meshes_hz = 1e3 * (double)meshes / (double)(now_ms - w->counted_ms);
    if (meshes > 0) w->mesh_bytes = round((double)bytes / (double)meshes);
    w->counted_ms = now_ms;
    w->counted_meshes = w->live.meshes;
    w->counted_bytes = w->vitals.mesh_bytes;
    if (kn_gateway_pages(&w->gateway) > 0) kn_web_list_scenes(w);
    kn_web_refresh(w);
}

// Do the periodic work of the main thread. This function is called ten times a second, even when no message arrives.
static void on_due(struct ev_loop *ev, ev_timer *t, int events)
{
    (void)ev, (void)events;
    kn_web *w = t->data;
    int64_t now_ms = kn_live_now_ms();
    kn_web_take_samples(w);
    // If a page presses and sends nothing for KN_WEB_LET_GO_MS, lift the tool. The page can press again only after the
    // button has been released.
    bool silent = w->owner >= 0 && now_ms - w->gateway.page[w->owner].pointed_ms > KN_WEB_LET_GO_MS;
    if (silent && w->button != KN_BUTTON_UP) w->button = KN_BUTTON_BARRED;
    kn_web_post_wish(w);
    kn_web_ask_status(w);
    kn_web_turn(w);
    if (now_ms - w->counted_ms >= 1000) count(w, now_ms);
    // Send the status to the pages, even if there is no new picture.
    if (now_ms - w->frame_ms > 200) kn_gateway_news(&w->gateway);
}

static void on_stop(struct ev_loop *ev, ev_signal *s, int events)
{
    (void)s, (void)events;
    ev_break(ev, EVBREAK_ALL);
}

// ---- start and stop

static void watch(kn_web *w)
{
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP};
    ev_io_init(&w->bus_readable, on_readable, kn_join_fd(w->live.bus), EV_READ);
    ev_io_init(&w->mesh_readable, on_readable, kn_join_fd(w->live.mesh_bus), EV_READ);
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

// Make this run's folder for recordings and pictures. Without a folder, the page works but cannot save.
static void make_folder(kn_web *w)
{
    const char *wanted = getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp";
    const bool fits = strlen(wanted) < FOLDER_MAX;
    if (!fits)
        fprintf(stderr, "knead web: TMPDIR %s: expected at most %d characters; using /tmp\n", wanted, FOLDER_MAX - 1);
    snprintf(w->folder, sizeof w->folder, "%s/knead-web.XXXXXX", fits ? wanted : "/tmp");
    if (mkdtemp(w->folder)) return;
    fprintf(stderr, "knead web: %s: %s: recordings and pictures cannot be saved\n", w->folder, strerror(errno));
    w->folder[0] = 0;
}

// Return true if a page keeps its place, because it has the tool or gave the last order.
static bool stays(void *self, int page)
{
    return page == ((kn_web *)self)->owner || page == ((kn_web *)self)->ordered_by;
}

// Open all parts of `knead web`. On failure, w->error has the reason, and the caller calls close_all to free the parts.
static bool open_all(kn_web *w)
{
    size_t largest = kn_painter_largest(w->width, w->height);
    w->ev = ev_default_loop(EVFLAG_AUTO);
    w->jpeg = malloc(largest);
    w->painter.still.view = w->look = kn_view_scene_default();
    w->look.turns = w->painter.still.view.turns = true;
    w->painter.still.view.hands = true;
    make_folder(w);
    kn_web_list_scenes(w);
    kn_mailbox_init(&w->wishes, w->wish_slots, sizeof *w->wish_slots);
    snprintf(w->error, sizeof w->error, "out of memory");
    if (!w->ev || !w->jpeg || !kn_ring_init(&w->samples, 1024, sizeof(kn_web_sample))) return false;
    ev_async_init(&w->painted, on_painted);
    w->painted.data = w;
    ev_async_start(w->ev, &w->painted);
    w->gateway.on_message = kn_web_on_message;
    w->gateway.on_request = kn_web_on_request;
    w->gateway.on_gone = kn_web_on_gone;
    w->gateway.stays = stays;
    w->gateway.fetch = kn_web_fetch;
    w->gateway.write = kn_web_write;
    w->asker.path = w->control;
    w->asker.answered = kn_web_on_answered;
    w->gateway.arg = w->asker.arg = w;
    kn_asker_open(&w->asker, w->ev);
    w->takes = (kn_takes){.folder = w->folder, .url = w->url, .ev = w->ev, .done = kn_web_on_replayed, .arg = w};
    // The painter and the gateway come last, so that nothing is served before the rest works.
    return kn_live_open(&w->live, w->url, w->mesh_url, w->error, sizeof w->error) &&
           kn_vitals_open(&w->vitals, w->live.bus, w->live.mesh_bus) &&
           kn_painter_open(&w->painter, w->width, w->height, call_back, w, w->error, sizeof w->error) &&
           kn_gateway_open(&w->gateway, w->ev, w->host, w->port, w->listen_fd, largest + ROOM, w->error,
                           sizeof w->error);
}

static void close_all(kn_web *w)
{
    // Closing the gateway ends all pages, so no page has the tool any more.
    kn_gateway_close(&w->gateway);
    kn_web_post_wish(w);
    for (int i = 0; w->moving && i < 50 && w->news.mode != KN_POINTER_ABSENT; i++)
        usleep(10000), kn_web_take_samples(w); // wait while the hand lifts the tool
    if (w->moving) kn_device_stop(&w->device);
    kn_asker_close(&w->asker);
    json_decref(w->status);
    free(w->about);
    kn_painter_close(&w->painter);
    kn_live_close(&w->live);
    kn_reach_close(&w->reach);
    kn_ring_free(&w->samples);
    free(w->jpeg);
    char path[128];
    kn_takes_close(&w->takes);
    kn_web_png_path(w, path);
    if (w->folder[0]) unlink(path), rmdir(w->folder);
}

// Open the socket as descriptor 3 and replace this program by the command. A socket keeps the network namespace in
// which it was opened.
static int bind_and_become(const kn_web *w, char **command)
{
    char error[256];
    int fd = kn_gateway_listen(w->host, w->port, error, sizeof error);
    if (fd < 0) return fail(KN_EXIT_DEVICE, error);
    // dup2 clears the close-on-exec flag. If the descriptor is 3 already, the flag is cleared by hand.
    if (fd == 3 ? fcntl(3, F_SETFD, 0) < 0 : dup2(fd, 3) < 0) return fail(KN_EXIT_DEVICE, strerror(errno));
    execvp(command[0], command);
    fprintf(stderr, "knead web: --bind %s: %s\n", command[0], strerror(errno));
    return KN_EXIT_USAGE;
}

// Parse a decimal number without sign within low..high.
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

// Parse the number of a descriptor that is a listening socket.
static bool listening(const char *word, int *fd)
{
    int yes = 0;
    socklen_t size = sizeof yes;
    return integer(word, 0, 1 << 20, fd) && getsockopt(*fd, SOL_SOCKET, SO_ACCEPTCONN, &yes, &size) == 0 && yes;
}

static bool is_directory(const char *path)
{
    struct stat it;
    return stat(path, &it) == 0 && S_ISDIR(it.st_mode);
}

// Store one option of the command line. Return NULL, or a text that says what was expected.
static const char *take(kn_web *w, int option, const char *text)
{
    struct in_addr host;
    switch (option) {
    case 'a': return kn_gateway_host(w->host = text, &host) ? NULL : "an IPv4 address of this machine";
    case 'h': w->help = true; return NULL;
    case 'b': w->bind = true; return NULL;
    case 'P': w->probe = text; return NULL;
    case 'l': w->url = text; return NULL;
    case 'm': w->mesh_url = text; return NULL;
    case 'p': return integer(text, 0, 65535, &w->port) ? NULL : "a port, 0..65535";
    case 'r': return integer(text, 5, 60, &w->rate_hz) ? NULL : "pictures per second, 5..60";
    case 's': return pixels(text, &w->width, &w->height) ? NULL : "WxH, 160..1920 pixels on each side, e.g. 960x540";
    case 'c': return (w->control = text), *text ? NULL : "a path";
    case 'S': return (w->scenes = text), is_directory(text) ? NULL : "a directory";
    default: return listening(text, &w->listen_fd) ? NULL : "a listening socket";
    }
}

static int parse(kn_web *w, int argc, char **argv)
{
    static const struct option names[] = {
        {"address", 1, NULL, 'a'},  {"probe", 1, NULL, 'P'}, {"port", 1, NULL, 'p'},      {"rate", 1, NULL, 'r'},
        {"size", 1, NULL, 's'},     {"bind", 0, NULL, 'b'},  {"control", 1, NULL, 'c'},   {"lcm-url", 1, NULL, 'l'},
        {"mesh-url", 1, NULL, 'm'}, {"help", 0, NULL, 'h'},  {"listen-fd", 1, NULL, 'f'}, {"scenes", 1, NULL, 'S'},
        {NULL, 0, NULL, 0}};
    opterr = 0; // this file prints its own messages
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
    static kn_web w = {.width = 800,
                       .height = 450,
                       .listen_fd = -1,
                       .rate_hz = 30,
                       .owner = -1,
                       .ordered_by = -1,
                       .measure = -1,
                       .png_page = -1,
                       .replayed.page = -1,
                       .gateway.fd = -1,
                       .host = "127.0.0.1"};
    int code = parse(&w, argc, argv);
    if (code == KN_EXIT_OK && w.help) return fputs(help, stdout), KN_EXIT_OK;
    if (code != KN_EXIT_OK) return code;
    if (w.bind) return bind_and_become(&w, argv + optind);
    code = open_all(&w) ? KN_EXIT_OK : fail(KN_EXIT_DEVICE, w.error);
    if (code == KN_EXIT_OK) {
        printf("knead web: open %s\n", w.gateway.address);
        if (w.gateway.fingerprint[0])
            printf("knead web: the browser warns of an unknown certificate; go on if its SHA-256 fingerprint is\n%s\n",
                   w.gateway.fingerprint);
        // Nobody can open the page without the printed address, so the program ends if the print fails.
        if (fflush(stdout) != 0)
            code = fail(KN_EXIT_DEVICE, "cannot print the page's address: standard output is broken");
    }
    if (code == KN_EXIT_OK) {
        watch(&w);
        ev_run(w.ev, 0);
    }
    close_all(&w);
    return code;
}
