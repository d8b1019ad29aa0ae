#ifndef KN_CLIENTS_LIVE_H
#define KN_CLIENTS_LIVE_H
// The served object as an observer needs it: the scene, the newest whole mesh, the probes and the forces on their
// hands. The size of every message is checked first.
//
//     kn_live_open -> kn_live_listen, as often as there is time -> read the fields -> kn_live_close
#include "clients/knead/join.h"
#include "clients/knead_mesh.h"
#include "core/scene/scene.h"

typedef struct kn_live_probe {
    char name[KN_NAME_MAX];
    double position_m[3], orientation_wxyz[4];           // pose of the model's tool
    double force_n[3];                                   // force given to the hand
    double gain;                                         // 0: the tool is not in the model
    int64_t heard_ms;                                    // time of the last force, CLOCK_MONOTONIC
    double hand_position_m[3], hand_orientation_wxyz[4]; // pose of the device that holds the tool
    int64_t hand_ms;                                     // time of the last pose; 0: none
} kn_live_probe;

typedef struct kn_live {
    kn_join *bus, *mesh_bus;
    kn_mesh mesh;          // mesh.whole: all positions are known
    kn_scene *scene;       // NULL until heard
    char scene_error[300]; // "", or why the last scene cannot be used
    int probe_count;
    kn_live_probe probe[KN_PROBES_MAX];
    int64_t heard[2]; // messages taken on the bus, on the mesh bus
    int64_t meshes;   // number of whole meshes
} kn_live;

// Join the buses. URLs as for kn_join_open; NULL is allowed. Return false with one line in error.
bool kn_live_open(kn_live *live, const char *url, const char *mesh_url, char *error, size_t error_size);

// Take messages for up to `timeout_ms`. Return early once a message has been taken.
void kn_live_listen(kn_live *live, int timeout_ms);

// Return the probe of that name. Return NULL if no force of the probe was heard in the last 200 ms, which means that
// nobody holds the probe.
const kn_live_probe *kn_live_find(const kn_live *live, const char *name);

// Return true if a pose of the hand that holds the probe was heard in the last 200 ms.
bool kn_live_held(const kn_live_probe *probe);

void kn_live_close(kn_live *live);

int64_t kn_live_now_ms(void); // CLOCK_MONOTONIC

#endif
