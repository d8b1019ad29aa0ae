#include "clients/knead/live.h"
#include "clients/knead/join.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_probe_pose_t.h"
#include "proto/knead_scene_t.h"
#include "server/clock.h"
#include "server/wire.h"
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>

// A probe counts as not held if its last message is older than this time, ms. Force messages of a held probe arrive
// every millisecond.
#define FORGET_MS 200
// Beginnings of the channel names; the name of a tool follows.
#define FORCE "KNEAD_FORCE_"
#define POSE "KNEAD_POSE_"

int64_t kn_live_now_ms(void) { return kn_now_ns() / 1000000; }

// Handle a scene message. Parse the scene only if its text is new.
static void on_scene(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live *live = user;
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

static kn_live_probe *find(kn_live *live, const char *name)
{
    for (int i = 0; i < live->probe_count; i++)
        if (strcmp(live->probe[i].name, name) == 0) return &live->probe[i];
    return NULL;
}

// Find a probe by its name, or add a probe with this name to the list.
static kn_live_probe *slot(kn_live *live, const char *name)
{
    kn_live_probe *known = find(live, name);
    if (known) return known;
    if (live->probe_count == KN_PROBES_MAX || strlen(name) >= KN_NAME_MAX) return NULL;
    kn_live_probe *p = &live->probe[live->probe_count++];
    strcpy(p->name, name);
    return p;
}

// Handle a force message. It shows that the server knows the probe, and it has the pose of the probe's tool.
static void on_force(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live *live = user;
    knead_contact_force_t force;
    if (knead_contact_force_t_decode(buffer->data, 0, (int)buffer->data_size, &force) < 0) return;
    live->heard[0]++;
    kn_live_probe *p = slot(live, channel + strlen(FORCE));
    if (!p) return;
    memcpy(p->position_m, force.proxy_position_m, sizeof p->position_m);
    memcpy(p->orientation_wxyz, force.proxy_orientation_wxyz, sizeof p->orientation_wxyz);
    memcpy(p->force_n, force.force_n, sizeof p->force_n);
    p->gain = force.gain;
    p->heard_ms = kn_live_now_ms();
}

// Handle a pose message, which has the pose of the hand that holds a tool.
static void on_pose(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    knead_probe_pose_t pose;
    if (knead_probe_pose_t_decode(buffer->data, 0, (int)buffer->data_size, &pose) < 0) return;
    // Ignore the pose of a tool for which the server has sent no force.
    kn_live_probe *p = find(user, channel + strlen(POSE));
    if (!p) return;
    memcpy(p->hand_position_m, pose.position_m, sizeof p->hand_position_m);
    memcpy(p->hand_orientation_wxyz, pose.orientation_wxyz, sizeof p->hand_orientation_wxyz);
    p->hand_ms = kn_live_now_ms();
}

// Handle a message with the topology of the mesh.
static void on_mesh_init(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live *live = user;
    (void)channel;
    live->heard[1]++;
    kn_mesh_init(&live->mesh, buffer->data, buffer->data_size);
}

// Handle a message with a part of the new vertex positions. Count a mesh when all parts of one tick have arrived.
static void on_mesh_update(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    kn_live *live = user;
    (void)channel;
    live->heard[1]++;
    live->meshes += kn_mesh_update(&live->mesh, buffer->data, buffer->data_size);
}

bool kn_live_open(kn_live *live, const char *url, const char *mesh_url, char *error, size_t error_size)
{
    *live = (kn_live){.bus = kn_join_open(url, KN_FORCE_URL, error, error_size)};
    if (live->bus) live->mesh_bus = kn_join_open(mesh_url, KN_MESH_URL, error, error_size);
    if (!live->mesh_bus) {
        kn_live_close(live);
        return false;
    }
    kn_join_hear(live->bus, "KNEAD_SCENE", on_scene, live);
    kn_join_hear(live->bus, FORCE "*", on_force, live);
    kn_join_hear(live->bus, POSE "*", on_pose, live);
    kn_join_hear(live->mesh_bus, "KNEAD_MESH_INIT", on_mesh_init, live);
    kn_join_hear(live->mesh_bus, "KNEAD_MESH_UPDATE", on_mesh_update, live);
    return true;
}

void kn_live_listen(kn_live *live, int timeout_ms)
{
    int64_t end_ms = kn_live_now_ms() + timeout_ms, left_ms = timeout_ms;
    // Handle the waiting messages of both buses. Sleep only while no message is waiting on either bus.
    while (kn_join_handle(live->bus, 0) + kn_join_handle(live->mesh_bus, 0) == 0 && left_ms > 0) {
        struct pollfd wait[2] = {{.fd = kn_join_fd(live->bus), .events = POLLIN},
                                 {.fd = kn_join_fd(live->mesh_bus), .events = POLLIN}};
        // Wake up after at most 50 ms, because a hello message may be due.
        poll(wait, 2, left_ms < 50 ? (int)left_ms : 50);
        left_ms = end_ms - kn_live_now_ms();
    }
}

// Return NULL for a probe without a recent message. Such a probe keeps its place in the list.
const kn_live_probe *kn_live_find(const kn_live *live, const char *name)
{
    for (int i = 0; i < live->probe_count; i++)
        if (strcmp(live->probe[i].name, name) == 0 && kn_live_now_ms() - live->probe[i].heard_ms <= FORGET_MS)
            return &live->probe[i];
    return NULL;
}

bool kn_live_held(const kn_live_probe *p) { return p->hand_ms > 0 && kn_live_now_ms() - p->hand_ms <= FORGET_MS; }

void kn_live_close(kn_live *live)
{
    kn_join_close(live->bus);
    kn_join_close(live->mesh_bus);
    kn_mesh_free(&live->mesh);
    kn_scene_destroy(live->scene);
    *live = (kn_live){0};
}
