#include "clients/tactile/haply.h"
#include "core/algebra/algebra.h"
#include "server/clock.h"
#include <errno.h>
#include <jansson.h>
#include <libwebsockets.h>
#include <math.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

// ---- messages

// Limits of a plausible position and velocity. Every arm of Haply's has a shorter reach than farthest_m, so no valid
// position is rejected.
static const double farthest_m = 1.0, fastest_m_s = 100.0;

bool kn_haply_id_known(const char *id)
{
    size_t n = strspn(id, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-");
    return n > 0 && n < KN_HAPLY_ID && !id[n];
}

// Read numbers from a JSON object. Each letter of `names` is the name of one number. Return false if a number is
// missing, or if its magnitude is above `most`.
static bool numbers(const json_t *object, const char *names, double most, double *value)
{
    for (; *names; names++, value++) {
        const json_t *n = json_object_get(object, (char[]){*names, 0});
        if (!json_is_number(n)) return false;
        *value = json_number_value(n);
        if (!(fabs(*value) <= most)) return false;
    }
    return true;
}

// Read a quaternion and normalise it. Return false if its length is not close to 1.
static bool orientation(const json_t *object, double wxyz[4])
{
    double q[4];
    if (!numbers(object, "wxyz", 1.1, q)) return false;
    double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(size - 1.0) < 0.1)) return false; // tolerate rounding errors: the service sends four digits
    kn_turn_unit(q, wxyz);
    return true;
}

// Read the grip. A wireless grip takes precedence over a wired one. A grip without a valid orientation is ignored.
static void read_grip(const json_t *root, kn_haply_state *s)
{
    const char *const kinds[] = {"wireless_verse_grip", "verse_grip"};
    for (int i = 0; i < 2 && !s->grip; i++) {
        const json_t *grip = json_object_get(json_array_get(json_object_get(root, kinds[i]), 0), "state");
        const json_t *buttons = json_object_get(grip, "buttons");
        s->grip = orientation(json_object_get(grip, "orientation"), s->pose.orientation_wxyz);
        for (int b = 0; s->grip && b < 3; b++)
            if (json_is_true(json_object_get(buttons, (const char *[]){"a", "b", "c"}[b]))) s->pose.buttons |= 1 << b;
        // Some grips have a single button, in the field "button" instead of "buttons".
        if (s->grip && json_is_true(json_object_get(grip, "button"))) s->pose.buttons |= 1;
    }
}

// Return the arm with this id. If device_id is "", return the first arm with a valid id.
static const json_t *find(const json_t *arms, const char *device_id)
{
    for (size_t i = 0; i < json_array_size(arms); i++) {
        const json_t *arm = json_array_get(arms, i);
        const char *id = json_string_value(json_object_get(arm, "device_id"));
        if (id && kn_haply_id_known(id) && (!*device_id || !strcmp(id, device_id))) return arm;
    }
    return NULL;
}

// Check and read the arm's part of a message. The message must have position and velocity. All other fields have
// defaults.
static kn_haply_heard read_arm(const json_t *root, const char *device_id, kn_haply_state *s, char *error, size_t size)
{
    const json_t *arms = json_object_get(root, "inverse3"), *arm = find(arms, device_id);
    const json_t *state = json_object_get(arm, "state");
    *s = (kn_haply_state){.pose.orientation_wxyz = {1.0}};
    if (!json_is_object(root) || (arms && !json_is_array(arms))) {
        snprintf(error, size, "expected an object with an array inverse3");
        return KN_HAPLY_MALFORMED;
    }
    if (!arm) return KN_HAPLY_ABSENT;
    strcpy(s->device_id, json_string_value(json_object_get(arm, "device_id")));
    if (!numbers(json_object_get(state, "cursor_position"), "xyz", farthest_m, s->pose.position_m)) {
        snprintf(error, size, "expected cursor_position x, y, z within 1 m");
        return KN_HAPLY_MALFORMED;
    }
    if (!numbers(json_object_get(state, "cursor_velocity"), "xyz", fastest_m_s, s->pose.velocity_m_s)) {
        snprintf(error, size, "expected cursor_velocity x, y, z within 100 m/s");
        return KN_HAPLY_MALFORMED;
    }
    // A message without control_mode counts as not idle, so that the watchdog test cannot pass by accident.
    const char *mode = json_string_value(json_object_get(state, "control_mode"));
    s->idle = mode && !strcmp(mode, "idle");
    s->calibrated = !json_is_false(json_object_get(json_object_get(arm, "status"), "calibrated"));
    read_grip(root, s);
    return KN_HAPLY_STATE;
}

kn_haply_heard kn_haply_read(const char *text, size_t size, const char *device_id, kn_haply_state *state, char *error,
                             size_t error_size)
{
    json_error_t why;
    json_t *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why);
    if (!root) {
        // Do not use jansson's error text, because it quotes the received bytes.
        snprintf(error, error_size, "no JSON at byte %d", why.position);
        return KN_HAPLY_MALFORMED;
    }
    kn_haply_heard heard = read_arm(root, device_id, state, error, error_size);
    json_decref(root);
    return heard;
}

int kn_haply_greet(char text[KN_HAPLY_MESSAGE], const char *device_id, const char *preset)
{
    return snprintf(text, KN_HAPLY_MESSAGE,
                    "{\"session\":{\"configure\":{\"profile\":{\"name\":\"knead\"},"
                    "\"basis\":{\"permutation\":\"XYZ\"}}},"
                    "\"inverse3\":[{\"device_id\":\"%s\",\"configure\":{\"preset\":{\"preset\":\"%s\"}},"
                    "\"commands\":{\"set_cursor_force\":{\"vector\":{\"x\":0.0,\"y\":0.0,\"z\":0.0}}}}]}",
                    device_id, preset);
}

int kn_haply_push(char text[KN_HAPLY_MESSAGE], const char *device_id, const double force_n[3])
{
    return snprintf(text, KN_HAPLY_MESSAGE,
                    "{\"inverse3\":[{\"device_id\":\"%s\",\"commands\":{\"set_cursor_force\":{\"vector\":"
                    "{\"x\":%.5f,\"y\":%.5f,\"z\":%.5f}}}}]}",
                    device_id, force_n[0], force_n[1], force_n[2]);
}

int kn_haply_ask(char text[KN_HAPLY_MESSAGE])
{
    return snprintf(text, KN_HAPLY_MESSAGE, "{\"session\":{\"force_render_full_state\":{}}}");
}

// ---- connection

// largest message, bytes; the inventory of many devices has only a few thousand bytes
static const size_t largest = 1 << 18;
static const int patience_ms = 1000; // longest wait for an answer of the service before the service counts as lost
static const int inventory_ms = 500; // interval at which the inventory is requested while the wanted arm is missing
static const int asks_ms = 100;      // silence after which the state of the arm is requested
static const struct timeval reach = {.tv_usec = 300000}; // longest wait until the service accepts a connection

bool kn_haply_url(const char *url, char host[KN_HAPLY_HOST], int *port)
{
    char end;
    int n = sscanf(url, "ws://%63[A-Za-z0-9.-]:%5d%c", host, port, &end);
    return (n == 2 || (n == 3 && end == '/' && !strchr(url + 5, '/')[1])) && *port > 0 && *port < 65536;
}

bool kn_haply_reach(const char *host, int port, char *error, size_t error_size)
{
    char service[8];
    bool ok = false;
    struct addrinfo *list = NULL, like = {.ai_socktype = SOCK_STREAM};
    snprintf(service, sizeof service, "%d", port);
    // Try each address of the host in turn, and keep the errno of the last attempt for the message.
    int code = getaddrinfo(host, service, &like, &list);
    errno = 0;
    for (struct addrinfo *a = list; a && !ok; a = a->ai_next) {
        int fd = socket(a->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (fd < 0) continue;
        setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &reach, sizeof reach);
        ok = connect(fd, a->ai_addr, a->ai_addrlen) == 0;
        int why = errno == EINPROGRESS ? ETIMEDOUT : errno;
        close(fd);
        errno = why;
    }
    if (!ok)
        snprintf(error, error_size, "the Inverse Service does not answer at %s:%d: %s", host, port,
                 code ? gai_strerror(code) : strerror(errno));
    if (list) freeaddrinfo(list);
    return ok;
}

// ---- conversation with the service

// Request a write to the service. Do nothing if an answer of the service is pending.
static void send_next(kn_haply *h)
{
    if (!h->connected || h->in_flight || !h->wsi) return;
    // Mark the message as sent now. Otherwise a second write could be requested before libwebsockets calls back for the
    // first one.
    h->in_flight = true;
    lws_callback_on_writable(h->wsi);
}

static int write_message(kn_haply *h)
{
    char buffer[LWS_PRE + KN_HAPLY_MESSAGE], *text = buffer + LWS_PRE;
    if (!h->in_flight) return 0;
    // Ask for the inventory if no arm is known. Ask for the state after 100 ms of silence, in a test of the service's
    // watchdog. Send the greeting to a new arm. Otherwise send the force.
    const bool asks = h->greeted && h->base.watchdog == KN_OWN_UNPROVED && h->silent_ms >= asks_ms;
    int size = !*h->device_id || asks ? kn_haply_ask(text)
               : h->greeted           ? kn_haply_push(text, h->device_id, h->force_n)
                                      : kn_haply_greet(text, h->device_id, h->preset);
    h->greeted = *h->device_id;
    h->wanted_force = false;
    return lws_write(h->wsi, (unsigned char *)text, (size_t)size, LWS_WRITE_TEXT) < size ? -1 : 0;
}

// Handle one complete message of the service.
static void take(kn_haply *h)
{
    char error[80];
    kn_haply_state s;
    bool known = *h->device_id;
    h->in_flight = false;
    h->silent_ms = 0;
    switch (kn_haply_read(h->message, h->length, known ? h->device_id : h->wanted, &s, error, sizeof error)) {
    case KN_HAPLY_MALFORMED: kn_tactile_bad(&h->base, "%s", error); break;
    case KN_HAPLY_ABSENT:
        if (known) kn_bridge_lost(h->bridge, "the Inverse Service no longer has arm %s", h->device_id);
        else snprintf(h->base.state, sizeof h->base.state, "the Inverse Service has no arm %s", h->wanted);
        return;
    case KN_HAPLY_STATE:
        // The first message that contains the arm is the inventory. Answer the inventory with the greeting.
        if (!known) strcpy(h->device_id, s.device_id), h->wanted_force = true;
        h->base.messages++;
        snprintf(h->base.state, sizeof h->base.state, "arm %s%s%s", s.device_id, s.grip ? " with a grip" : "",
                 s.calibrated ? "" : ", not calibrated: put the arm's grip on its rest");
        h->base.motors = !s.idle;
        // Do not pass on the position in the inventory, because it was measured before the preset was selected.
        if (known && s.calibrated) kn_bridge_moved(h->bridge, &s.pose);
    }
    // If a force has come while the answer to a message was pending, send the force now.
    if (*h->device_id && h->wanted_force) send_next(h);
}

// Collect the fragments of one message.
static int receive(kn_haply *h, struct lws *wsi, const void *bytes, size_t size)
{
    if (lws_is_first_fragment(wsi)) h->length = 0;
    if (size > largest - h->length) {
        kn_bridge_lost(h->bridge, "the Inverse Service sent more than %zu bytes at once", largest);
        return -1;
    }
    memcpy(h->message + h->length, bytes, size);
    h->length += size;
    if (lws_is_final_fragment(wsi) && lws_remaining_packet_payload(wsi) == 0) take(h);
    return 0;
}

static int on_event(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t size)
{
    kn_haply *h = lws_context_user(lws_get_context(wsi));
    // Ignore events that a closed connection still delivers.
    bool ours = wsi == h->wsi;
    switch ((int)reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        h->connected = ours;
        h->silent_ms = 0;
        return ours ? 0 : -1;
    case LWS_CALLBACK_CLIENT_RECEIVE: return ours ? receive(h, wsi, in, size) : -1;
    case LWS_CALLBACK_CLIENT_WRITEABLE: return ours ? write_message(h) : -1;
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
    case LWS_CALLBACK_CLIENT_CLOSED:
        if (!ours) return 0;
        kn_bridge_lost(h->bridge, "the Inverse Service at %s:%d hung up", h->host, h->port);
        h->wsi = NULL;
        return 0;
    default: return lws_callback_http_dummy(wsi, reason, user, in, size);
    }
}

// ---- driver interface

// Start libwebsockets on the bridge's libev loop when the device is first opened. The context of libwebsockets stays in
// use when a connection is lost.
static bool start_library(kn_haply *h)
{
    static const struct lws_protocols protocols[] = {{"haply", on_event, 0, 1 << 16, 0, NULL, 0},
                                                     {NULL, NULL, 0, 0, 0, NULL, 0}};
    void *loops[1] = {h->bridge->ev};
    struct lws_context_creation_info info = {.port = CONTEXT_PORT_NO_LISTEN,
                                             .protocols = protocols,
                                             .user = h,
                                             .foreign_loops = loops,
                                             .options = LWS_SERVER_OPTION_LIBEV};
    if (h->context) return true;
    lws_set_log_level(LLL_ERR, NULL);
    h->message = malloc(largest);
    h->context = h->message ? lws_create_context(&info) : NULL;
    return h->context != NULL;
}

static bool open_haply(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_haply *h = (kn_haply *)device;
    h->bridge = bridge;
    if (!kn_haply_reach(h->host, h->port, error, error_size)) return false;
    // Before each step that may fail, write its error message to `error`.
    snprintf(error, error_size, "libwebsockets does not start on libev: install the package libwebsockets-evlib-ev");
    if (!start_library(h)) return false;
    // Reset the state of the previous connection, and test the service's watchdog again.
    h->connected = h->greeted = h->in_flight = h->wanted_force = false;
    h->length = 0;
    h->silent_ms = 0;
    *h->device_id = 0;
    device->watchdog = device->unwatched ? KN_OWN_TRUSTED : KN_OWN_UNPROVED;
    struct lws_client_connect_info to = {.context = h->context,
                                         .address = h->host,
                                         .port = h->port,
                                         .path = "/",
                                         .host = h->host,
                                         .ietf_version_or_minus_one = -1,
                                         .pwsi = &h->wsi,
                                         .local_protocol_name = "haply"};
    snprintf(error, error_size, "the Inverse Service at %s:%d accepts no connection", h->host, h->port);
    return lws_client_connect_via_info(&to) != NULL;
}

static void close_haply(kn_tactile *device)
{
    kn_haply *h = (kn_haply *)device;
    struct lws *wsi = h->wsi;
    // From here on, ignore events of the old connection.
    h->wsi = NULL;
    h->connected = false;
    if (wsi) lws_set_timeout(wsi, PENDING_TIMEOUT_CLOSE_SEND, LWS_TO_KILL_ASYNC);
}

static void destroy_haply(kn_tactile *device)
{
    kn_haply *h = (kn_haply *)device;
    if (h->context) lws_context_destroy(h->context);
    free(h->message);
}

static void give(kn_tactile *device, const double force_n[3], bool live)
{
    kn_haply *h = (kn_haply *)device;
    for (int i = 0; i < 3; i++) h->force_n[i] = live ? force_n[i] : 0.0;
    h->wanted_force = true;
    if (*h->device_id) send_next(h);
}

static void tick(kn_tactile *device, int elapsed_ms)
{
    kn_haply *h = (kn_haply *)device;
    h->silent_ms += elapsed_ms;
    // Ask for the inventory while the wanted arm is missing, and for the state in a test of the service's watchdog.
    int ask_ms = !*h->device_id ? inventory_ms : h->base.watchdog == KN_OWN_UNPROVED ? asks_ms : patience_ms;
    if (h->connected && h->silent_ms >= ask_ms) send_next(h);
    if (h->silent_ms >= patience_ms) kn_bridge_lost(h->bridge, "the Inverse Service has not answered for 1 s");
}

void kn_haply_init(kn_haply *h, const char *host, int port, const char *device_id, const char *preset)
{
    *h = (kn_haply){.base = {.name = "haply",
                             .open = open_haply,
                             .close = close_haply,
                             .destroy = destroy_haply,
                             .tick = tick,
                             .give = give,
                             .answers = true},
                    .port = port,
                    .preset = preset};
    snprintf(h->host, sizeof h->host, "%s", host);
    snprintf(h->wanted, sizeof h->wanted, "%s", device_id);
}
