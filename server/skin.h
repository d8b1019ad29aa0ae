#ifndef KN_SERVER_SKIN_H
#define KN_SERVER_SKIN_H
// The skin (surface mesh) of the object, published as KNEAD_MESH_INIT and KNEAD_MESH_UPDATE on the mesh bus, an LCM bus
// of its own.
//
// At the mesh rate the servo copies the vertex positions into a mailbox. It copies the whole state as well if the
// scene's mesh.measures ask for stress or residual strain. Measuring, encoding and sending happen in the mesh thread.
// The mesh thread may be late, and then sends only the latest skin. The mesh bus has its own port, so that large meshes
// never fill the socket buffers of poses and forces.
#include "core/lattice/measure.h"
#include "core/scene/scene.h"
#include "core/surface.h"
#include "server/auth.h"
#include "server/mailbox.h"
#include <lcm/lcm.h>
#include <stdint.h>

// Bytes of the vertices in one chunk, 12 to 20 per vertex. A chunk with its header stays below 60 kB, so that LCM does
// not split the message.
#define KN_SKIN_BYTES 58800

typedef struct kn_skin_frame { // copy of the object's skin that the servo hands to the mesh thread
    int64_t tick;
    int32_t generation;
    const kn_model *model; // model to which `state` belongs
    kn_state *state;       // state of the object; NULL: nothing is measured
    float xyz_m[];         // array [vertex_count][3]: positions of the vertices, m
} kn_skin_frame;

typedef struct kn_skin_gauge { // measures (stress, residual strain) of the latest frame, for the mesh thread
    kn_gauge *gauge;
    const kn_model *model; // model for which the gauge was created
    // Arrays [node_count]: value of each measure at each node; NULL: the scene does not ask for the measure.
    double *node_value[KN_MEASURES];
    float *vertex_value[KN_MEASURES]; // arrays [vertex_count]: value of each measure at each vertex
    double *memory;
} kn_skin_gauge;

typedef struct kn_skin {
    const kn_model *model; // model at the start; later models have the same lattice
    const kn_auth *auth;   // key that signs every message; NULL: messages are not signed
    int64_t signed_us;     // age stamp of the last signed message: time since the life of kneadd began (auth.h), us
    kn_surface *surface;
    int period_ticks;  // number of ticks from one frame to the next
    int64_t next_tick; // tick of the next frame; used by the servo thread
    kn_mailbox frames;
    void *memory;
    int measures;                   // KN_MESH_* bits of the measures that the scene asks for (mesh.measures)
    kn_skin_gauge measured;         // used by the mesh thread only
    _Atomic(const kn_model *) told; // model of the frame that the mesh thread took last; read by other threads
    lcm_t *lcm;                     // transmits only: such an lcm_t has no thread and receives nothing
    int64_t mesh_id, topology_hash;
    int topology_size;
    uint8_t *topology; // buffer with room for the encoded message KNEAD_MESH_INIT and its trailer
    uint8_t update[64 * 1024];
} kn_skin;

// Open the mesh bus. The scene gives mesh.rate and mesh.measures. The scene's text_hash is part of mesh_id, so that two
// scenes never share a mesh_id. Borrows `model`. On failure return false and put one line in error.
bool kn_skin_open(kn_skin *skin, const char *url, const kn_scene *scene, const kn_model *model, char *error,
                  size_t error_size);
void kn_skin_close(kn_skin *skin);
// Return the number of bytes of memory that measuring needs; 0 if nothing is measured.
size_t kn_skin_bytes(const kn_scene *scene, const kn_model *model);

// Copy a frame if one is due. Called by the servo thread in every tick. `model`: the model being served, which has the
// same lattice as the model at the start. `generation`: kn_servo.generation, by which a viewer distinguishes the skins
// before and after a reset. Real-time safe.
void kn_skin_capture(kn_skin *skin, const kn_model *model, const kn_state *state, int64_t tick, int32_t generation);

// Return true if the mesh thread no longer uses any model earlier than `model`. If the scene asks for measures, the
// answer is true as soon as the mesh thread has taken a frame of `model`. Any thread may call this.
bool kn_skin_follows(const kn_skin *skin, const kn_model *model);

// Publish the topology, or the latest frame. The mesh thread calls both functions.
void kn_skin_publish_topology(kn_skin *skin, int64_t utime);
bool kn_skin_publish(kn_skin *skin, int64_t utime); // return false if there is no new frame

#endif
