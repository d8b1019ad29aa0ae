#include "server/skin.h"
#include "core/hash.h"
#include "proto/knead_mesh_init_t.h"
#include "proto/knead_mesh_update_t.h"
#include "proto/knead_probe_pose_t.h"
#include "server/clock.h"
#include "server/console.h"
#include "server/wire.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static knead_mesh_init_t topology_message(const kn_skin *skin, int64_t utime)
{
    const kn_surface *s = skin->surface;
    return (knead_mesh_init_t){.utime = utime,
                               .mesh_id = skin->mesh_id,
                               .topology_hash = skin->topology_hash,
                               .vertex_count = s->vertex_count,
                               .triangle_count = s->triangle_count,
                               .index_count = 3 * s->triangle_count,
                               .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE,
                               .triangles = s->triangle};
}

// Return the number of bytes of memory that measuring needs. If the scene asks for measures (stress, residual strain),
// this memory holds one state per mailbox slot, the kn_gauge that computes the measures, and two values for each node
// and vertex.
size_t kn_skin_bytes(const kn_scene *scene, const kn_model *model)
{
    const size_t values = 2 * (sizeof(double) + sizeof(float)) * (size_t)model->node_count;
    return scene->mesh_measures ? 3 * kn_state_size(model) + kn_gauge_bytes(model) + values : 0;
}

// Allocate the three frames of the mailbox, each on its own cache lines.
static bool open_frames(kn_skin *skin)
{
    size_t bytes = sizeof(kn_skin_frame) + 3 * sizeof(float) * (size_t)skin->surface->vertex_count;
    bytes = (bytes + 63) / 64 * 64;
    skin->memory = calloc(3, bytes);
    if (!skin->memory) return false;
    kn_mailbox_init(&skin->frames, skin->memory, bytes);
    for (int i = 0; skin->measures && i < 3; i++) {
        kn_skin_frame *frame = skin->frames.slot[i];
        frame->state = kn_state_create(skin->model);
        if (!frame->state) return false;
    }
    return true;
}

// Allocate the values of the measures that the scene asks for, in one block.
static bool open_measures(kn_skin *skin)
{
    static const struct {
        int bit;
        kn_measure what;
    } asked[2] = {{KN_MESH_STRESS, KN_MEASURE_STRESS}, {KN_MESH_RESIDUAL, KN_MEASURE_RESIDUAL}};
    kn_skin_gauge *g = &skin->measured;
    size_t nodes = (size_t)skin->model->node_count, vertices = (size_t)skin->surface->vertex_count;
    if (!skin->measures) return true;
    g->memory = calloc(2, nodes * sizeof(double) + vertices * sizeof(float));
    for (int i = 0; g->memory && i < 2; i++) {
        if (!(skin->measures & asked[i].bit)) continue;
        g->node_value[asked[i].what] = g->memory + (size_t)i * nodes;
        g->vertex_value[asked[i].what] = (float *)(g->memory + 2 * nodes) + (size_t)i * vertices;
    }
    return g->memory;
}

// Hash the topology, and allocate room for its message, which is sent every second.
static bool open_topology(kn_skin *skin, uint64_t text_hash)
{
    const kn_surface *s = skin->surface;
    // mesh_id depends on the topology and on the scene's text
    uint64_t hash = kn_hash_bytes(KN_HASH_SEED, s->triangle, 3 * sizeof(int) * (size_t)s->triangle_count);
    skin->topology_hash = (int64_t)hash;
    skin->mesh_id = (int64_t)kn_hash_bytes(hash, &text_hash, sizeof text_hash);
    knead_mesh_init_t message = topology_message(skin, 0);
    skin->topology_size = knead_mesh_init_t_encoded_size(&message);
    skin->topology = malloc((size_t)skin->topology_size + KN_AUTH_TRAILER);
    return skin->topology;
}

bool kn_skin_open(kn_skin *skin, const char *url, const kn_scene *scene, const kn_model *model, char *error,
                  size_t error_size)
{
    *skin = (kn_skin){.model = model, .measures = scene->mesh_measures};
    skin->period_ticks = (int)(1000.0 / scene->mesh_hz + 0.5);
    skin->surface = kn_surface_create(model);
    // allocate everything before any thread runs, because the servo copies into this memory and must not allocate
    bool fits = skin->surface && open_frames(skin) && open_measures(skin) && open_topology(skin, scene->text_hash);
    if (fits) skin->lcm = lcm_create(url);
    if (skin->lcm) return true;
    snprintf(error, error_size, "%s: %s", url, fits ? "LCM refused this URL" : "out of memory");
    kn_skin_close(skin);
    return false;
}

void kn_skin_close(kn_skin *skin)
{
    if (skin->lcm) lcm_destroy(skin->lcm);
    for (int i = 0; skin->memory && i < 3; i++) kn_state_destroy(((kn_skin_frame *)skin->frames.slot[i])->state);
    kn_gauge_destroy(skin->measured.gauge);
    free(skin->measured.memory);
    free(skin->topology);
    free(skin->memory);
    kn_surface_destroy(skin->surface);
    memset(skin, 0, sizeof *skin);
}

void kn_skin_capture(kn_skin *skin, const kn_model *model, const kn_state *state, int64_t tick, int32_t generation)
{
    if (tick < skin->next_tick) return;
    skin->next_tick = tick + skin->period_ticks;
    // fill the back slot of the mailbox; a frame that the mesh thread has not taken yet is overwritten
    kn_skin_frame *frame = kn_mailbox_back(&skin->frames);
    frame->tick = tick;
    frame->generation = generation;
    frame->model = model;
    if (frame->state) kn_state_copy(model, frame->state, state);
    kn_surface_positions(skin->surface, skin->model, state, frame->xyz_m);
    kn_mailbox_post(&skin->frames);
}

bool kn_skin_follows(const kn_skin *skin, const kn_model *model)
{
    // without measures the mesh thread uses no model at all
    return !skin->measures || atomic_load(&skin->told) == model;
}

void kn_skin_publish_topology(kn_skin *skin, int64_t utime)
{
    knead_mesh_init_t message = topology_message(skin, utime);
    // encode the message again each time, because utime differs
    int size = knead_mesh_init_t_encode(skin->topology, 0, skin->topology_size, &message);
    kn_wire_send(skin->lcm, skin->auth, &skin->signed_us, "KNEAD_MESH_INIT", skin->topology, size);
}

// Measure a frame's state at the nodes, and copy the values to the vertices. Return false if no measure is asked for,
// memory is short, or a value is not finite; then only positions are published.
static bool measure(kn_skin *skin, const kn_skin_frame *frame)
{
    kn_skin_gauge *g = &skin->measured;
    if (!frame->state) return false;
    // kn_gauge computes the measures for one model, so create a new one after a change of the scene
    if (g->model != frame->model) {
        kn_gauge_destroy(g->gauge);
        g->gauge = kn_gauge_create(frame->model);
        g->model = frame->model;
        if (!g->gauge) kn_console_err("kneadd: not enough memory for mesh.measures: meshes carry positions only");
    }
    if (!g->gauge) return false;
    kn_gauge_read_all(g->gauge, frame->state, g->node_value);
    // check the values, because an object with non-finite numbers may have finite positions but no finite stress
    bool finite = true;
    for (int m = 0; m < KN_MEASURES; m++)
        for (int v = 0; g->node_value[m] && v < skin->surface->vertex_count; v++) {
            g->vertex_value[m][v] = (float)g->node_value[m][skin->surface->node[v]];
            finite &= isfinite(g->vertex_value[m][v]) != 0;
        }
    return finite;
}

// Encode chunk number `chunk`: at most `size` vertices, from vertex chunk * size on. Return the size of the message,
// bytes.
static int encode_chunk(kn_skin *skin, const kn_skin_frame *frame, int64_t utime, int chunk, int size, bool measured)
{
    int vertices = skin->surface->vertex_count, first = chunk * size;
    int count = vertices - first < size ? vertices - first : size;
    float *strain = measured ? skin->measured.vertex_value[KN_MEASURE_RESIDUAL] : NULL,
          *stress = measured ? skin->measured.vertex_value[KN_MEASURE_STRESS] : NULL;
    knead_mesh_update_t message = {.utime = utime,
                                   .mesh_id = skin->mesh_id,
                                   .tick = frame->tick,
                                   .generation = frame->generation,
                                   .chunk = chunk,
                                   .chunks = (vertices + size - 1) / size,
                                   .first = first,
                                   .count = count,
                                   .position_count = 3 * count,
                                   .strain_count = strain ? count : 0,
                                   .stress_count = stress ? count : 0,
                                   .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE,
                                   // cast: lcm-gen's arrays are not const, although encoding only reads them
                                   .positions_m = (float *)frame->xyz_m + 3 * first,
                                   .residual_strain = strain ? strain + first : NULL,
                                   .stress_pa = stress ? stress + first : NULL};
    return knead_mesh_update_t_encode(skin->update, 0, sizeof skin->update - KN_AUTH_TRAILER, &message);
}

bool kn_skin_publish(kn_skin *skin, int64_t utime)
{
    bool fresh;
    const kn_skin_frame *frame = kn_mailbox_latest(&skin->frames, &fresh);
    if (!fresh) return false;
    // announce that the mesh thread uses no older model from here on
    atomic_store(&skin->told, frame->model);
    bool measured = measure(skin, frame);
    int told = measured ? __builtin_popcount((unsigned)skin->measures) : 0;
    int size = KN_SKIN_BYTES / (12 + 4 * told); // number of vertices in one chunk of the message
    for (int i = 0; i * size < skin->surface->vertex_count; i++) {
        // pause 1 ms: without pauses, large meshes would overflow the usual 208 kB receive buffer of a viewer
        if (i > 0) kn_clock_sleep(kn_now_ns() + 1000000);
        kn_wire_send(skin->lcm, skin->auth, &skin->signed_us, "KNEAD_MESH_UPDATE", skin->update,
                     encode_chunk(skin, frame, utime, i, size, measured));
    }
    return true;
}
