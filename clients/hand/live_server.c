#include "clients/hand/live_server.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "proto/knead_scene_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

// A probe counts as not held if its last message is older than this time, ms. Force messages of a held probe arrive
// every millisecond.
#define FORGET_MS 200
// Beginnings of the channel names; the name of a tool follows.
#define FORCE "KNEAD_FORCE_"
#define POSE "KNEAD_POSE_"

int64_t kn_live_server_now_ms(void) { return kn_now_ns() / 1000000; }

// Handle a scene message. Parse the scene only if its text is new.
static void on_scene(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live_server *live = user;
    knead_scene_t message;
    (void)channel;
    // Check the size of the message first, because the decoder trusts the lengths in a message.
    if (!kn_wire_scene_fits(buffer->data, buffer->data_size)) return;
    if (knead_scene_t_decode(buffer->data, 0, (int)buffer->data_size, &message) < 0) return;
    live->heard[0]++;
    kn_scene *scene = NULL;
    if (!live->scene || strcmp(live->scene->text, message.text) != 0)
        scene = kn_scene_parse(message.name, message.text, strlen(message.text), NULL, 0, live->scene_error,
                               sizeof live->scene_error);
    else live->scene_error[0] = 0; // the message has the known scene, so an error of an earlier message is obsolete
    knead_scene_t_decode_cleanup(&message);
    if (!scene) return;
    live->scene_error[0] = 0;
    live->probe_count = 0; // the names of the probes may differ in the new scene
    kn_scene_destroy(live->scene);
    live->scene = scene;
}

static kn_live_server_probe *find(kn_live_server *live, const char *name)
{
    for (int i = 0; i < live->probe_count; i++)
        if (strcmp(live->probe[i].name, name) == 0) return &live->probe[i];
    return NULL;
}

// Find a probe by its name, or add a probe with this name to the list.
static kn_live_server_probe *slot(kn_live_server *live, const char *name)
{
    kn_live_server_probe *known = find(live, name);
    if (known) return known;
    if (live->probe_count == KN_PROBES_MAX || strlen(name) >= KN_NAME_MAX) return NULL;
    kn_live_server_probe *p = &live->probe[live->probe_count++];
    strcpy(p->name, name);
    return p;
}

// Handle a force message, which contains the pose of the tool. The first force message adds the probe to the list.
static void on_force(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live_server *live = user;
    knead_contact_force_t force;
    if (knead_contact_force_t_decode(buffer->data, 0, (int)buffer->data_size, &force) < 0) return;
    live->heard[0]++;
    kn_live_server_probe *p = slot(live, channel + strlen(FORCE));
    if (!p) return;
    memcpy(p->position_m, force.proxy_position_m, sizeof p->position_m);
    memcpy(p->orientation_wxyz, force.proxy_orientation_wxyz, sizeof p->orientation_wxyz);
    memcpy(p->force_n, force.force_n, sizeof p->force_n);
    p->gain = force.gain;
    p->heard_ms = kn_live_server_now_ms();
}

// Handle a pose message, which contains the pose of the hand that holds a tool.
static void on_pose(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    knead_probe_pose_t pose;
    if (knead_probe_pose_t_decode(buffer->data, 0, (int)buffer->data_size, &pose) < 0) return;
    // Ignore the pose of a tool for which the server has sent no force.
    kn_live_server_probe *p = find(user, channel + strlen(POSE));
    if (!p) return;
    memcpy(p->hand_position_m, pose.position_m, sizeof p->hand_position_m);
    memcpy(p->hand_orientation_wxyz, pose.orientation_wxyz, sizeof p->hand_orientation_wxyz);
    p->hand_ms = kn_live_server_now_ms();
}

// Handle a message with the topology of the mesh.
static void on_mesh_init(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live_server *live = user;
    (void)channel;
    live->heard[1]++;
    kn_mesh_init(&live->mesh, buffer->data, buffer->data_size);
}

// Handle a message with a part of the new vertex positions. Count a mesh when all parts of one tick have arrived.
static void on_mesh_update(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live_server *live = user;
    (void)channel;
    live->heard[1]++;
    live->meshes += kn_mesh_update(&live->mesh, buffer->data, buffer->data_size);
}

bool kn_live_server_open(kn_live_server *live, const char *url, const char *mesh_url, char *error, size_t error_size)
{
    *live = (kn_live_server){.bus = kn_bus_client_open(url, KN_FORCE_URL, error, error_size)};
    if (live->bus) live->mesh_bus = kn_bus_client_open(mesh_url, KN_MESH_URL, error, error_size);
    if (!live->mesh_bus) {
        kn_live_server_close(live);
        return false;
    }
    kn_bus_client_hear(live->bus, "KNEAD_SCENE", on_scene, live);
    kn_bus_client_hear(live->bus, FORCE "*", on_force, live);
    kn_bus_client_hear(live->bus, POSE "*", on_pose, live);
    kn_bus_client_hear(live->mesh_bus, "KNEAD_MESH_INIT", on_mesh_init, live);
    kn_bus_client_hear(live->mesh_bus, "KNEAD_MESH_UPDATE", on_mesh_update, live);
    return true;
}

void kn_live_server_listen(kn_live_server *live, int timeout_ms)
{
    int64_t end_ms = kn_live_server_now_ms() + timeout_ms, left_ms = timeout_ms;
    // Handle the waiting messages of both buses. If there are none, sleep until a message arrives on either bus.
    while (kn_bus_client_handle(live->bus, 0) + kn_bus_client_handle(live->mesh_bus, 0) == 0 && left_ms > 0) {
        struct pollfd wait[2] = {{.fd = kn_bus_client_fd(live->bus), .events = POLLIN},
                                 {.fd = kn_bus_client_fd(live->mesh_bus), .events = POLLIN}};
        // Wake up after at most 50 ms, because a hello message may be due.
        poll(wait, 2, left_ms < 50 ? (int)left_ms : 50);
        left_ms = end_ms - kn_live_server_now_ms();
    }
}

// Return NULL for a probe without a recent message. Such a probe keeps its place in the list.
const kn_live_server_probe *kn_live_server_find(const kn_live_server *live, const char *name)
{
    for (int i = 0; i < live->probe_count; i++)
        if (strcmp(live->probe[i].name, name) == 0 && kn_live_server_now_ms() - live->probe[i].heard_ms <= FORGET_MS)
            return &live->probe[i];
    return NULL;
}

bool kn_live_server_held(const kn_live_server_probe *p)
{
    return p->hand_ms > 0 && kn_live_server_now_ms() - p->hand_ms <= FORGET_MS;
}

void kn_live_server_close(kn_live_server *live)
{
    kn_bus_client_close(live->bus);
    kn_bus_client_close(live->mesh_bus);
    kn_mesh_free(&live->mesh);
    kn_scene_destroy(live->scene);
    *live = (kn_live_server){0};
}

// Longest wait for an answer from kneadd, s. kneadd answers in milliseconds, except if it must first build an object
// for the request.
#define PATIENCE_S 10
// Longest wait for a copy of the object, us. Messages for a recording wait in a buffer meanwhile.
#define COPY_US 500000
// Largest size of an answer from kneadd, bytes.
#define ANSWER_MAX (1 << 20)

int kn_live_server_dial(const char *path, int flags)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof at.sun_path) return errno = ENAMETOOLONG, -1;
    strcpy(at.sun_path, path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | flags, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&at, sizeof at) == 0) return fd;
    int why = errno;
    if (fd >= 0) close(fd);
    errno = why;
    return -1;
}

// Send the request over the socket as one line. Return false if not all bytes were sent.
static bool send_line(int fd, const json_t *request, int flags)
{
    char *text = json_dumps(request, JSON_COMPACT);
    size_t size = text ? strlen(text) : 0;
    if (text) text[size++] = '\n'; // the newline replaces the NUL at the end of the text
    bool sent = text && send(fd, text, size, MSG_NOSIGNAL | flags) == (ssize_t)size;
    free(text);
    return sent;
}

static void tell_absence(const char *path, char *error, size_t error_size)
{
    snprintf(error, error_size, "%s: %s: is kneadd running with --control %s?", path, strerror(errno), path);
}

json_t *kn_ask_read(const char *text, size_t size)
{
    json_error_t why;
    return size > 0 && text[size - 1] == '\n' ? json_loadb(text, size, JSON_REJECT_DUPLICATES, &why) : NULL;
}

const char *kn_live_server_control(void)
{
    const char *path = getenv("KNEAD_CONTROL");
    return path && *path ? path : KN_LIVE_SERVER_CONTROL;
}

// Receive a part of an answer. If a descriptor comes with it, put the descriptor in *handed, or close it if `handed` is
// NULL or used.
static ssize_t receive(int fd, char *text, size_t size, int *handed)
{
    int got_fd;
    _Alignas(struct cmsghdr) char room[CMSG_SPACE(sizeof got_fd)];
    struct iovec part = {text, size};
    // room for one descriptor only: the kernel closes others
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = room, .msg_controllen = CMSG_LEN(sizeof got_fd)};
    ssize_t got = recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
    const struct cmsghdr *rights = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    if (!rights || rights->cmsg_level != SOL_SOCKET || rights->cmsg_type != SCM_RIGHTS ||
        rights->cmsg_len != CMSG_LEN(sizeof got_fd))
        return got;
    memcpy(&got_fd, CMSG_DATA(rights), sizeof got_fd);
    if (handed && *handed < 0) *handed = got_fd;
    else close(got_fd);
    return got;
}

// kn_live_server_ask, which also receives a descriptor, and waits no longer than `patience`.
static json_t *ask(const char *path, const json_t *request, struct timeval patience, int *handed, char *error,
                   size_t error_size)
{
    int fd = kn_live_server_dial(path, 0);
    if (fd < 0) {
        tell_absence(path, error, error_size);
        return NULL;
    }
    // Limit the wait, so that a server that hangs does not make this client hang.
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    char *text = malloc(ANSWER_MAX);
    size_t size = 0;
    // Read until the newline that ends the answer, an error, or the end of the connection.
    ssize_t got = text && send_line(fd, request, 0) ? 1 : -1;
    while (got > 0 && size < ANSWER_MAX && !(size > 0 && text[size - 1] == '\n')) {
        got = receive(fd, text + size, ANSWER_MAX - size, handed);
        if (got > 0) size += (size_t)got;
    }
    json_t *answer = got >= 0 ? kn_ask_read(text, size) : NULL;
    // Distinguish a program that is not kneadd, a server that does not answer, and a server that closes the connection.
    if (!answer)
        snprintf(error, error_size, "%s: %s", path,
                 size > 0                                               ? "the program that answers there is not kneadd"
                 : got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK) ? "no answer in time"
                                                                        : "closed the connection without an answer");
    free(text);
    close(fd);
    return answer;
}

json_t *kn_live_server_ask(const char *path, const json_t *request, char *error, size_t error_size)
{
    return ask(path, request, (struct timeval){.tv_sec = PATIENCE_S}, NULL, error, error_size);
}

int kn_live_server_copy(const char *path, uint64_t scene, char *error, size_t error_size)
{
    int fd = -1;
    json_t *request = json_pack("{s:s}", "command", "copy");
    json_t *answer = ask(path, request, (struct timeval){.tv_usec = COPY_US}, &fd, error, error_size);
    const char *of = json_string_value(json_object_get(answer, "scene"));
    const char *why = json_string_value(json_object_get(answer, "error"));
    const bool good = fd >= 0 && of && strtoull(of, NULL, 16) == scene;
    if (answer && !good)
        snprintf(error, error_size, "%s: %s", path,
                 why             ? why
                 : fd < 0 || !of ? "the answer holds no object"
                                 : "that kneadd serves another bus, or its scene has just changed");
    if (fd >= 0 && !good) close(fd);
    json_decref(answer);
    json_decref(request);
    return good ? fd : -1;
}

int kn_ask_begin(const char *path, const json_t *request, char *error, size_t error_size)
{
    int fd = kn_live_server_dial(path, SOCK_NONBLOCK);
    if (fd < 0) tell_absence(path, error, error_size);
    else if (!send_line(fd, request, MSG_DONTWAIT)) {
        snprintf(error, error_size, "%s: %s", path, strerror(errno));
        close(fd);
        fd = -1;
    }
    return fd;
}
