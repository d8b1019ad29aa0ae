#ifndef KN_SERVER_SKIN_H
#define KN_SERVER_SKIN_H
// The object's surface on its way to the screens: KNEAD_MESH_INIT and KNEAD_MESH_UPDATE on the mesh bus. The servo
// copies positions into a mailbox at the mesh rate, and the whole state where the scene's mesh.measures ask for what only
// that tells; measuring, encoding and sending happen in the mesh thread, which may be late and then shows the latest
// surface only. Meshes have a port of their own, so that their bulk never fills the socket
// buffers in which poses and forces wait.
#include "core/gauge.h"
#include "core/scene/scene.h"
#include "core/surface.h"
#include "server/auth.h"
#include "server/mailbox.h"
#include <lcm/lcm.h>
#include <stdint.h>

#define KN_SKIN_BYTES 58800 // of a chunk's vertices, 12 to 20 each: with a header below 60 kB, which LCM does not split

typedef struct kn_skin_frame {
    int64_t tick;
    int32_t generation;
    const kn_model *model; // that the state is of
    kn_state *state;       // NULL: nothing is measured
    float xyz_m[];         // [vertex_count][3]
} kn_skin_frame;

// What the mesh thread makes of a frame's state.
typedef struct kn_skin_gauge {
    kn_gauge *gauge;
    const kn_model *model;            // that gauge is of
    double *node_value[KN_MEASURES];  // [node_count]; NULL: not asked for
    float *vertex_value[KN_MEASURES]; // [vertex_count]
    double *memory;
} kn_skin_gauge;

typedef struct kn_skin {
    const kn_model *model; // at the start; those that come later have its lattice
    const kn_auth *auth;   // signs every message; NULL: nobody does
    int64_t signed_us;     // age of the last one
    kn_surface *surface;
    int period_ticks;
    int64_t next_tick; // the servo's
    kn_mailbox frames;
    void *memory;
    int measures;                   // mesh.measures of the scene
    kn_skin_gauge measured;         // the mesh thread's
    _Atomic(const kn_model *) told; // whose frame it took last
    lcm_t *lcm;                     // transmits only: such an lcm_t has no thread and hears nothing
    int64_t mesh_id, topology_hash;
    int topology_size;
    uint8_t *topology; // encoded once but for its utime
    uint8_t update[64 * 1024];
} kn_skin;

// scene: its mesh.rate and mesh.measures; its text_hash tells scenes apart, so that a mesh_id never means two things.
// Borrows model. False and one line in error.
bool kn_skin_open(kn_skin *skin, const char *url, const kn_scene *scene, const kn_model *model, char *error,
                  size_t error_size);
void kn_skin_close(kn_skin *skin);
size_t kn_skin_bytes(const kn_scene *scene, const kn_model *model); // memory that measuring takes

// Servo thread, every tick; copies when a frame is due. generation is the servo's: it tells the surfaces before and
// after a reset apart. model: that is served, with the lattice of the first. Real-time safe.
void kn_skin_capture(kn_skin *skin, const kn_model *model, const kn_state *state, int64_t tick, int32_t generation);

// Any thread: whether the mesh thread looks at no model before that one any more. Where something is measured that is
// when it has taken a frame of it.
bool kn_skin_follows(const kn_skin *skin, const kn_model *model);

// Mesh thread.
void kn_skin_publish_topology(kn_skin *skin, int64_t utime);
bool kn_skin_publish(kn_skin *skin, int64_t utime); // false: no new frame is there

#endif
