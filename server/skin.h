#ifndef KN_SERVER_SKIN_H
#define KN_SERVER_SKIN_H
// The object's surface on its way to the screens: KNEAD_MESH_INIT and KNEAD_MESH_UPDATE on the mesh bus. The servo
// copies positions into a mailbox at the mesh rate; encoding and sending happen in the mesh thread, which may be late
// and then shows the latest surface only. Meshes have a port of their own, so that their bulk never fills the socket
// buffers in which poses and forces wait.
#include "core/surface.h"
#include "server/auth.h"
#include "server/mailbox.h"
#include <lcm/lcm.h>
#include <stdint.h>

#define KN_SKIN_CHUNK 4900 // vertices: 12 B each and a header stay below 60 kB, one datagram that LCM does not split

typedef struct kn_skin_frame {
    int64_t tick;
    int32_t generation;
    float xyz_m[]; // [vertex_count][3]
} kn_skin_frame;

typedef struct kn_skin {
    const kn_model *model;
    const kn_auth *auth; // signs every message; NULL: nobody does
    kn_surface *surface;
    int period_ticks;
    int64_t next_tick; // the servo's
    kn_mailbox frames;
    void *memory;
    lcm_t *lcm; // transmits only: such an lcm_t has no thread and hears nothing
    int64_t mesh_id, topology_hash;
    int topology_size;
    uint8_t *topology; // encoded once but for its utime
    uint8_t update[64 * 1024];
} kn_skin;

// text_hash tells scenes apart, so that a mesh_id never means two things. False and one line in error.
bool kn_skin_open(kn_skin *skin, const char *url, const kn_model *model, double mesh_hz, uint64_t text_hash,
                  char *error, size_t error_size);
void kn_skin_close(kn_skin *skin);

// Servo thread, every tick; copies when a frame is due. generation is the servo's: it tells the surfaces before and
// after a reset apart. Real-time safe.
void kn_skin_capture(kn_skin *skin, const kn_state *state, int64_t tick, int32_t generation);

// Mesh thread.
void kn_skin_publish_topology(kn_skin *skin, int64_t utime);
bool kn_skin_publish(kn_skin *skin, int64_t utime); // false: no new frame is there

#endif
