// An Inverse Service without an arm: its WebSocket, its JSON and its behaviour, after Haply's documentation of
// version 3.5. A simulated arm and a person are behind the service. For tests, and for users without an Inverse3.
//
//     haply PORT SECONDS      since the first client; CSV on stdout, one row per ms
//
// A line TROUBLE 1 on stdin begins a trouble, and TROUBLE 0 ends it:
//     malformed   answers are not JSON         mute   no answers                   hangup   all clients are closed
//     gone        the arm is not in the list   cold   the arm is not calibrated    sticky   the last force is kept
//
// Rows: ms, position, force that the arm gives, messages, wrong messages (no JSON, no force, another arm's),
// greetings.
#include "clients/hand/haptic_loop.h"
#include "clients/hand/bus_client.h"
#include "tests/tactile/person.h"
#include <ev.h>
#include <jansson.h>
#include <libwebsockets.h>
#include <stdlib.h>
#include <sys/timerfd.h>
#include <unistd.h>

enum { MALFORMED, MUTE, HANGUP, GONE, COLD, STICKY, TROUBLES, FORGET_MS = 20 };
static const char *const trouble[TROUBLES] = {"malformed", "mute", "hangup", "gone", "cold", "sticky"};
static int in[TROUBLES];

static kn_held_device arm;
static double force_n[3];
static int now_ms, force_age_ms, seconds, timer_fd, clients;
static long long messages, wrong, greetings;

static json_t *vec3(const double v[3]) { return json_pack("{s:f,s:f,s:f}", "x", v[0], "y", v[1], "z", v[2]); }

static char *state(int all)
{
    static const double none[3];
    json_t *one = json_pack("{s:s, s:{s:o,s:o,s:{s:f,s:f,s:f,s:f},s:o,s:s,s:s}, s:{s:b,s:b,s:b}}", "device_id", "049D",
                            "state", "cursor_position", vec3(arm.position_m), "cursor_velocity", vec3(arm.velocity_m_s),
                            "body_orientation", "w", 1.0, "x", 0.0, "y", 0.0, "z", 0.0, "current_cursor_force",
                            vec3(all ? none : arm.force_n), "control_domain", "cartesian", "control_mode",
                            force_age_ms < FORGET_MS ? "force" : "idle", "status", "calibrated", !in[COLD], "ready", 1,
                            "in_use", 1);
    json_t *grip = json_pack("{s:s, s:{s:{s:f,s:f,s:f,s:f},s:{s:b,s:b,s:b},s:i}}", "device_id", "61548", "state",
                             "orientation", "w", 0.70711, "x", 0.0, "y", 0.0, "z", 0.70711, "buttons", "a", 0, "b",
                             now_ms % 4000 > 2000, "c", 0, "hall", 0);
    if (all) json_object_set_new(one, "config", json_pack("{s:s,s:s}", "type", "inverse3", "preset", "defaults"));
    json_t *root =
        json_pack("{s:i, s:[], s:[o], s:[]}", "session_id", 7, "inverse3", "wireless_verse_grip", grip, "verse_grip");
    if (in[GONE]) json_decref(one);
    else json_array_append_new(json_object_get(root, "inverse3"), one);
    char *text = json_dumps(root, JSON_COMPACT);
    json_decref(root);
    return text;
}

static int say(struct lws *wsi, int all)
{
    char *text = in[MALFORMED] ? strdup("{\"inverse3\": [{\"device_id\": \"049D\", \"state\"") : state(all);
    size_t size = strlen(text);
    unsigned char *buffer = malloc(LWS_PRE + size);
    memcpy(buffer + LWS_PRE, text, size);
    int n = lws_write(wsi, buffer + LWS_PRE, size, LWS_WRITE_TEXT);
    free(buffer);
    free(text);
    return n < (int)size ? -1 : 0;
}

static void hear(const char *text, size_t size)
{
    json_t *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL);
    json_t *to = json_array_get(json_object_get(root, "inverse3"), 0), *session = json_object_get(root, "session");
    json_t *push = json_object_get(json_object_get(to, "commands"), "set_cursor_force");
    const char *id = json_string_value(json_object_get(to, "device_id"));
    double f[3];
    messages++;
    greetings += json_object_get(json_object_get(to, "configure"), "preset") != NULL;
    if (push && id && !strcmp(id, "049D") &&
        !json_unpack(push, "{s:{s:F,s:F,s:F!}!}", "vector", "x", f, "y", f + 1, "z", f + 2)) {
        memcpy(force_n, f, sizeof f);
        force_age_ms = 0;
    } else if (!json_object_get(session, "force_render_full_state")) {
        wrong++;
    }
    json_decref(root);
}

typedef struct peer {
    int owed; // states still to be sent
    int all;
} peer;

static int on_event(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *data, size_t size)
{
    peer *p = user;
    switch ((int)reason) {
    case LWS_CALLBACK_FILTER_NETWORK_CONNECTION: return in[HANGUP] ? -1 : 0;
    case LWS_CALLBACK_ESTABLISHED:
        clients++;
        *p = (peer){.owed = 1, .all = 1};
        lws_callback_on_writable(wsi);
        return 0;
    case LWS_CALLBACK_CLOSED: return clients--, 0;
    case LWS_CALLBACK_RECEIVE:
        if (in[HANGUP]) return -1;
        hear(data, size);
        p->owed += !in[MUTE];
        lws_callback_on_writable(wsi);
        return 0;
    case LWS_CALLBACK_SERVER_WRITEABLE:
        if (in[HANGUP]) return -1;
        if (p->owed == 0) return 0;
        p->owed--;
        if (p->owed) lws_callback_on_writable(wsi);
        int all = p->all;
        p->all = 0;
        return say(wsi, all);
    default: return lws_callback_http_dummy(wsi, reason, user, data, size);
    }
}

static const struct lws_protocols protocols[] = {{"http", on_event, sizeof(peer), 1 << 16, 0, NULL, 0},
                                                 {NULL, NULL, 0, 0, 0, NULL, 0}};

static void on_timer(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)events;
    uint64_t times = 1;
    if (read(timer_fd, &times, sizeof times) != sizeof times) return;
    static int begun;
    begun |= clients > 0;
    for (uint64_t n = 0; n < times; n++) { // person and mass also move in the time that this process missed
        double path_m[3] = {0}, path_m_s[3] = {0};
        force_age_ms += !in[STICKY];
        if (begun) path_m[2] = kn_person_z(now_ms, &path_m_s[2]);
        kn_held_device_tick(&arm, force_age_ms <= FORGET_MS ? force_n : (double[3]){0}, path_m, path_m_s);
        now_ms += begun;
    }
    if (in[HANGUP]) lws_callback_on_writable_all_protocol(watcher->data, &protocols[0]);
    const double *x = arm.position_m, *f = arm.force_n;
    if (begun)
        printf("%d,%.6f,%.6f,%.6f,%.4f,%.4f,%.4f,%lld,%lld,%lld\n", now_ms, x[0], x[1], x[2], f[0], f[1], f[2],
               messages, wrong, greetings);
    if (now_ms >= 1000 * seconds) ev_break(ev, EVBREAK_ALL);
}

static void on_line(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)events;
    char text[40] = {0};
    for (size_t i = 0; i + 1 < sizeof text && read(STDIN_FILENO, text + i, 1) == 1 && text[i] != '\n';) i++;
    if (!*text) ev_io_stop(ev, watcher); // end of input
    int known = !*text;
    for (int i = 0; i < TROUBLES; i++) {
        size_t n = strlen(trouble[i]);
        if (strncmp(text, trouble[i], n) != 0) continue;
        in[i] = text[n + 1] == '1';
        known = 1;
    }
    if (!known) fprintf(stderr, "haply: %s?\n", text), exit(2);
}

int main(int argc, char **argv)
{
    // An Inverse3 as felt at its cursor: 0.1 kg, little friction, 10 N at most.
    const kn_held_device_def def = {.mass_kg = 0.1,
                                    .damping_n_s_m = 0.2,
                                    .coulomb_n = 0.05,
                                    .encoder_m = 20e-6,
                                    .force_limit_n = 10.0,
                                    .axes = 3,
                                    .grip = KN_GRIP_NORMAL};
    const struct itimerspec every = {{0, 1000000}, {0, 1000000}};
    struct ev_loop *ev = ev_default_loop(0);
    void *loops[1] = {ev};
    ev_io timer, line;
    struct lws_context_creation_info info = {.port = argc > 2 ? atoi(argv[1]) : 0,
                                             .protocols = protocols,
                                             .iface = "lo",
                                             .foreign_loops = loops,
                                             .options = LWS_SERVER_OPTION_LIBEV};
    seconds = argc > 2 ? atoi(argv[2]) : 0;
    if (seconds <= 0 || info.port <= 0) return fprintf(stderr, "usage: haply PORT SECONDS\n"), 2;
    lws_set_log_level(LLL_ERR, NULL);
    setvbuf(stdout, NULL, _IOLBF, 0);
    kn_bus_client_priority(60);
    kn_held_device_init(&arm, &def, (double[3]){0});
    struct lws_context *context = lws_create_context(&info);
    timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK);
    if (!context || timer_fd < 0 || timerfd_settime(timer_fd, 0, &every, NULL)) return 3;
    ev_io_init(&timer, on_timer, timer_fd, EV_READ);
    timer.data = context;
    ev_io_start(ev, &timer);
    ev_io_init(&line, on_line, STDIN_FILENO, EV_READ);
    ev_io_start(ev, &line);
    puts("ms,x_m,y_m,z_m,fx_n,fy_n,fz_n,messages,wrong,greetings");
    ev_run(ev, 0);
    lws_context_destroy(context);
    return 0;
}
