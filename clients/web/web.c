// knead web: shows the object in a browser and lets the user move tools. The main thread runs libev and handles
// messages. A thread for each tool makes poses at 1 kHz. The thread of picture.c draws pictures, if a page wants any.
#include "clients/hand/live_server.h"
#include "clients/cli/commands.h"
#include "clients/web/web.h"
#include "server/option_table.h"
#include "server/scene_name.h"
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define REST_S 0.004 // see on_readable
// Longest TMPDIR, including NUL. w->folder has room for TMPDIR and the name of this run's folder.
#define FOLDER_MAX 40

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead web [OPTION]...\n"
    "       knead web [--port N] --bind COMMAND...\n\n"
    "Serve a page that shows the object of a running kneadd and presses it with the pointer. Print its address, and\n"
    "run until SIGINT or SIGTERM. Only this machine can open the page (from another one: ssh -L N:127.0.0.1:N), and\n"
    "only with the token in the address. --address opens the page to a network, encrypted; the browser then warns of\n"
    "an unknown certificate, whose fingerprint is printed with the address.\n\n"
    "  --probe NAME       tool that the pointer moves (default: the scene's first round probe; if none, its first)\n"
    "  --address HOST     IPv4 address of this machine to serve the page at (default: 127.0.0.1)\n"
    "  --port N           port of the page, 0 to 65535; 0 chooses a free one (default: 0)\n"
    "  --control PATH     control socket of kneadd (its --control), needed for the operator's buttons, and for\n"
    "                     recordings of a kneaded object (default: none)\n"
    "  --scenes DIR       folder whose *.yaml can be loaded from the page (default: the scenes of Knead)\n"
    "  --lcm-url URL      bus of poses and forces (default: LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL     bus of meshes (default: " KN_MESH_URL ")\n"
    "  --bind COMMAND...  open the page's socket as descriptor 3 and run COMMAND instead of serving the page; COMMAND\n"
    "                     starts knead web --listen-fd 3, e.g. in a network namespace that browsers cannot reach\n"
    "  --listen-fd N      serve the page on descriptor N, a listening socket that --bind has opened\n\n"
    "Examples:\n"
    "    knead web --control control\n"
    "    knead web --port 8080 --probe finger\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no bus or no socket.\n";
// clang-format on

// Return the largest size of a message, bytes.
static size_t largest(const kn_web *w)
{
    const size_t mesh = kn_page_mesh_largest(&w->mesh), picture = kn_picture_largest();
    return KN_PAGE_STATE_JSON + (mesh > picture ? mesh : picture);
}

static int fail(int code, const char *what) { return fprintf(stderr, "knead web: %s\n", what), code; }

// ---- downloads of a page, made from the served state; no name from a page is used as a file name

// Find the block of a scene's text that begins with `head` and ends before the next top-level key. Return the length of
// the block, including the last newline, or 0 if the text has no such block.
static size_t block_of(const char *text, const char *head, const char **begin)
{
    *begin = strncmp(text, head, strlen(head)) == 0 ? text : NULL;
    if (!*begin) {
        char after_newline[64];
        snprintf(after_newline, sizeof after_newline, "\n%s", head);
        *begin = strstr(text, after_newline);
        if (!*begin) return 0;
        ++*begin;
    }
    const char *end = strchr(*begin, '\n');
    // Indented lines and comment lines that follow belong to the block.
    while (end && (end[1] == ' ' || end[1] == '#')) end = strchr(end + 1, '\n');
    return end ? (size_t)(end + 1 - *begin) : strlen(*begin);
}

// Make a name from the bus safe for a YAML comment. Any line break in the name, ASCII or not, would end the comment.
static void plain(const char *name, char *to, size_t size)
{
    snprintf(to, size, "%s", name);
    for (; *to; to++)
        if (*to < ' ' || *to > '~') *to = '?';
}

// Make a file with the material and density of the served scene. Another scene can name this file in its key
// `material`.
static bool material(const kn_web *w, kn_web_file *file)
{
    const char *text = w->live.scene ? w->live.scene->text : NULL, *part, *weight;
    size_t size = text ? block_of(text, "material:", &part) : 0, more = text ? block_of(text, "density:", &weight) : 0;
    if (size == 0 || more == 0) return false;
    char name[128];
    plain(w->live.scene->name, name, sizeof name);
    int n = asprintf(&file->bytes,
                     "# As served in %s. In a scene: `material: FILE.yaml`, with this file beside it.\n%.*s%.*s", name,
                     (int)size, part, (int)more, weight);
    file->type = "application/yaml; charset=utf-8";
    file->size = (size_t)n;
    return n >= 0;
}

static bool scene(const kn_web *w, kn_web_file *file)
{
    file->type = "application/yaml; charset=utf-8";
    file->bytes = w->live.scene ? strdup(w->live.scene->text) : NULL;
    file->size = file->bytes ? strlen(file->bytes) : 0;
    return file->bytes;
}

// Find the path of a recording's file. The CSV file exists only after the recording was verified.
static bool recording(kn_web *w, int number, const char *kind, kn_web_file *file)
{
    const kn_recording *one = kn_recordings_find(&w->recordings, number);
    const bool csv = strcmp(kind, "csv") == 0;
    if (!one || (csv ? !one->csv : strcmp(kind, "lcmlog") != 0)) return false;
    if (csv) file->type = "text/csv; charset=utf-8";
    kn_recordings_path(&w->recordings, number, kind, file->path);
    return true;
}

static bool fetch(void *self, const char *name, kn_web_file *file)
{
    kn_web *w = self;
    int number;
    char kind[8], end;
    if (strcmp(name, "material.yaml") == 0) return material(w, file);
    if (sscanf(name, "tool-%1d%c", &number, &end) == 1) return kn_page_mesh_tool(&w->mesh, number, file);
    // Take only the number of a recording and the kind of a file from the name that the page sent.
    if (sscanf(name, "recording/%6d.%7[a-z]%c", &number, kind, &end) == 2) return recording(w, number, kind, file);
    if (strcmp(name, "scene.yaml") == 0) return scene(w, file);
    return false;
}

// ---- events of pages

static void on_message(void *self, int page, const kn_web_message *m)
{
    kn_web *w = self;
    kn_page_tool_point(&w->tool, page, m);
}

// Pass a request to the module that handles it. After an order to kneadd, control_client.c asks for the new status, and
// `about` is updated with it. After any other request, update `about` at once.
static void on_request(void *self, int page, const kn_page_request *r)
{
    kn_web *w = self;
    switch (r->verb) {
    case KN_VERB_DRAW:
    case KN_VERB_VIEW:
    case KN_VERB_MEASURE: kn_picture_request(&w->picture, page, r); break;
    case KN_VERB_RECORD:
    case KN_VERB_STOP:
    case KN_VERB_VERIFY:
    case KN_VERB_PLAY: kn_recordings_request(&w->recordings, page, r); break;
    default: kn_control_client_order(&w->client, page, r); return;
    }
    kn_page_state_refresh(w);
}

// Forget a page in all pending work, because its place may be given to another page.
static void on_gone(void *self, int page)
{
    kn_web *w = self;
    kn_recordings_gone(&w->recordings, page);
    kn_control_client_gone(&w->client, page);
    kn_page_tool_gone(&w->tool, page);
}

// Return true if a page keeps its place, because it has the tool or gave the last order.
static bool stays(void *self, int page)
{
    const kn_web *w = self;
    return page == w->tool.owner || page == w->client.ordered_by;
}

// ---- events of the bus and of the clock

// If a new scene has come, adapt the tool, the pictures and the state to it.
static void take_scene(kn_web *w)
{
    if (!kn_page_tool_scene(&w->tool)) return;
    kn_page_mesh_forget(&w->mesh);
    w->picture.mesh_id = 0;
    kn_page_state_scene(w);
    kn_page_state_refresh(w);
}

// Send news to the pages.
static void tell(kn_web *w)
{
    w->told_ms = kn_live_server_now_ms();
    kn_gateway_news(&w->gateway);
}

// Take a new mesh: the tools hover at another height, and each page gets the mesh or a picture of it.
static void take_mesh(kn_web *w)
{
    const int64_t surface = w->mesh.surface;
    w->state.meshes = w->live.meshes;
    w->state.mesh_ms = kn_live_server_now_ms();
    kn_page_tool_mesh(&w->tool);
    kn_page_tool_listen(&w->tool); // which pointer events the mesh shows, and the traces up to now
    if (kn_gateway_pages(&w->gateway) == 0) return;
    const bool taken = kn_page_mesh_take(&w->mesh) && kn_gateway_reserve(&w->gateway, largest(w));
    if (w->mesh.surface != surface) kn_page_state_refresh(w);
    if (taken && kn_gateway_wants(&w->gateway, KN_WEB_MESH)) tell(w);
    kn_picture_paint(&w->picture);
}

// Handle bus messages. Poses and forces come 1000 times a second each, and need not be read one by one: after each
// reading, their bus rests for REST_S, which halves the processor time. A mesh wakes the program at any time.
static void on_readable(struct ev_loop *ev, ev_io *io, int events)
{
    (void)events;
    kn_web *w = io->data;
    kn_live_server_listen(&w->live, 0);
    ev_io_stop(ev, &w->bus_readable);
    if (!ev_is_active(&w->rest)) {
        ev_timer_set(&w->rest, REST_S, 0.);
        ev_timer_start(ev, &w->rest);
    }
    take_scene(w);
    if (w->live.meshes == w->state.meshes) return;
    take_mesh(w);
}

static void on_rested(struct ev_loop *ev, ev_timer *t, int events)
{
    (void)events;
    ev_io_start(ev, &((kn_web *)t->data)->bus_readable);
}

// Do the periodic work of the main thread. This function is called ten times a second, even when no message arrives.
static void on_due(struct ev_loop *ev, ev_timer *t, int events)
{
    (void)ev, (void)events;
    kn_web *w = t->data;
    int64_t now_ms = kn_live_server_now_ms();
    kn_page_tool_turn(&w->tool);
    kn_control_client_ask_status(&w->client);
    if (kn_recordings_turn(&w->recordings)) kn_page_state_refresh(w);
    // Once a second, update the rate of mesh messages and the lists that change seldom.
    if (now_ms - w->state.counted_ms >= 1000) {
        kn_page_state_count(w, now_ms);
        if (kn_gateway_pages(&w->gateway) > 0) kn_control_client_list_scenes(&w->client);
        kn_page_state_refresh(w);
    }
    // Send the status to the pages, even if there is no new mesh.
    if (now_ms - w->told_ms > 200) tell(w);
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
    ev_io_init(&w->bus_readable, on_readable, kn_bus_client_fd(w->live.bus), EV_READ);
    ev_io_init(&w->mesh_readable, on_readable, kn_bus_client_fd(w->live.mesh_bus), EV_READ);
    ev_timer_init(&w->due, on_due, 0, 0.1);
    ev_timer_init(&w->rest, on_rested, REST_S, 0);
    w->bus_readable.data = w->mesh_readable.data = w->due.data = w->rest.data = w;
    ev_io_start(w->ev, &w->bus_readable);
    ev_io_start(w->ev, &w->mesh_readable);
    ev_timer_start(w->ev, &w->due);
    for (int i = 0; i < 3; i++) {
        ev_signal_init(&w->stops[i], on_stop, signals[i]);
        ev_signal_start(w->ev, &w->stops[i]);
    }
}

// Make this run's folder for recordings. Without a folder, the page works but cannot save.
static void make_folder(kn_web *w)
{
    const char *wanted = getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp";
    const bool fits = strlen(wanted) < FOLDER_MAX;
    if (!fits)
        fprintf(stderr, "knead web: TMPDIR %s: expected at most %d characters; using /tmp\n", wanted, FOLDER_MAX - 1);
    snprintf(w->folder, sizeof w->folder, "%s/knead-web.XXXXXX", fits ? wanted : "/tmp");
    if (mkdtemp(w->folder)) return;
    fprintf(stderr, "knead web: %s: %s: nothing can be recorded\n", w->folder, strerror(errno));
    w->folder[0] = 0;
}

// Open all parts of `knead web`. On failure, w->error has the reason, and the caller calls close_all to free the parts.
static bool open_all(kn_web *w)
{
    make_folder(w);
    w->ev = w->client.ev = w->picture.ev = w->recordings.ev = ev_default_loop(EVFLAG_AUTO);
    w->client.gateway = w->tool.gateway = w->picture.gateway = w->recordings.gateway = &w->gateway;
    w->client.live = w->tool.live = w->mesh.live = w->picture.live = &w->live;
    w->picture.tool = w->recordings.tool = &w->tool;
    w->recordings.client = &w->client;
    w->client.path = w->control;
    w->client.scenes = w->scenes ? w->scenes : kn_scene_folder();
    w->client.changed = w->recordings.changed = kn_page_state_refresh;
    w->client.arg = w->recordings.arg = w->gateway.arg = w;
    w->tool.probe = w->probe;
    w->tool.url = w->recordings.url = w->url;
    w->recordings.folder = w->folder;
    w->gateway.on_message = on_message;
    w->gateway.on_request = on_request;
    w->gateway.on_gone = on_gone;
    w->gateway.stays = stays;
    w->gateway.fetch = fetch;
    w->gateway.write = kn_page_state_write;
    w->gateway.fd = w->client.ordered_by = w->recordings.page = -1;
    kn_control_client_list_scenes(&w->client);
    snprintf(w->error, sizeof w->error, "out of memory");
    // Open the gateway last, so that no page is served before all other parts work.
    return kn_page_tool_open(&w->tool) && w->ev &&
           kn_live_server_open(&w->live, w->url, w->mesh_url, w->error, sizeof w->error) && kn_page_state_open(w) &&
           kn_picture_open(&w->picture) && kn_gateway_reserve(&w->gateway, largest(w)) &&
           kn_gateway_open(&w->gateway, w->ev, w->host, w->port, w->listen_fd, w->error, sizeof w->error);
}

static void close_all(kn_web *w)
{
    // Closing the gateway ends all pages, so no page has the tool any more.
    kn_gateway_close(&w->gateway);
    kn_page_tool_close(&w->tool);
    kn_page_mesh_close(&w->mesh);
    kn_control_client_close(&w->client);
    kn_picture_close(&w->picture);
    kn_live_server_close(&w->live);
    kn_recordings_close(&w->recordings);
    free(w->state.about);
    if (w->folder[0]) rmdir(w->folder);
}

// Open the socket as descriptor 3 and replace this program by the command. The socket stays in the present network
// namespace, even if the command enters another one.
static int bind_and_become(const kn_web *w, char **command)
{
    char error[256];
    int fd = kn_gateway_listen(w->host, w->port, error, sizeof error);
    if (fd < 0) return fail(KN_EXIT_DEVICE, error);
    // dup2 clears the close-on-exec flag. If the socket is descriptor 3 already, dup2 does nothing, so fcntl clears the
    // flag.
    if (fd == 3 ? fcntl(3, F_SETFD, 0) < 0 : dup2(fd, 3) < 0) return fail(KN_EXIT_DEVICE, strerror(errno));
    execvp(command[0], command);
    fprintf(stderr, "knead web: --bind %s: %s\n", command[0], strerror(errno));
    return KN_EXIT_USAGE;
}

static const char *take_address(void *host, const char *text)
{
    struct in_addr address;
    return kn_gateway_host(*(const char **)host = text, &address) ? NULL : "an IPv4 address of this machine";
}

static const char *take_directory(void *path, const char *text)
{
    struct stat it;
    *(const char **)path = text;
    return stat(text, &it) == 0 && S_ISDIR(it.st_mode) ? NULL : "a directory";
}

// Parse the number of a descriptor that is a listening socket.
static const char *take_socket(void *fd, const char *word)
{
    double number = -1;
    int yes = 0;
    socklen_t size = sizeof yes;
    const bool good = strspn(word, "0123456789") == strlen(word) && kn_number_take(word, 0, 1 << 20, &number);
    *(int *)fd = (int)number;
    return good && getsockopt(*(int *)fd, SOL_SOCKET, SO_ACCEPTCONN, &yes, &size) == 0 && yes ? NULL
                                                                                              : "a listening socket";
}

static int parse(kn_web *w, int argc, char **argv)
{
#define AT(member) .offset = offsetof(kn_web, member)
    static const kn_option rows[] = {
        KN_OPTION("address", SPECIAL, AT(host), .take = take_address),
        KN_OPTION("probe", TEXT, AT(probe)),
        KN_OPTION("port", INTEGER, AT(port), KN_RANGE(0, 65535), .expected = "a port, 0..65535"),
        KN_OPTION("bind", FLAG, AT(bind)),
        KN_OPTION("control", TEXT, AT(control), .expected = "a path"),
        KN_OPTION("lcm-url", TEXT, AT(url)),
        KN_OPTION("mesh-url", TEXT, AT(mesh_url)),
        KN_OPTION("listen-fd", SPECIAL, AT(listen_fd), .take = take_socket),
        KN_OPTION("scenes", SPECIAL, AT(scenes), .take = take_directory),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .options_first = true};
    const int code = kn_options_read(&table, w, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (w->bind && optind == argc) return fail(KN_EXIT_USAGE, "--bind: expected a command");
    if (!w->bind && optind < argc)
        return fprintf(stderr, "knead web: %s: expected an option\n", argv[optind]), KN_EXIT_USAGE;
    if (!kn_bus_client_check(w->url, KN_FORCE_URL, w->error, sizeof w->error) ||
        !kn_bus_client_check(w->mesh_url, KN_MESH_URL, w->error, sizeof w->error))
        return fail(KN_EXIT_USAGE, w->error);
    return code;
}

int kn_web_main(int argc, char **argv)
{
    static kn_web w = {.listen_fd = -1, .host = "127.0.0.1"};
    int code = parse(&w, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
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
