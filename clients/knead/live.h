#ifndef KN_CLIENTS_LIVE_H
#define KN_CLIENTS_LIVE_H
// What is being served right now, as somebody who looks on needs it: the scene, the newest whole mesh, where the probes
// are and what their hands are given. Every message is held against its size first.
//
//     kn_live_open -> kn_live_listen, as often as there is time -> look at the fields -> kn_live_close
#include "clients/knead/join.h"
#include "clients/knead_mesh.h"
#include "core/scene/scene.h"

typedef struct kn_live_probe {
    char name[KN_NAME_MAX];
    double position_m[3], orientation_wxyz[4];           // of the model's tool
    double force_n[3];                                   // what the hand is given
    double gain;                                         // 0: not in the model
    int64_t heard_ms;                                    // CLOCK_MONOTONIC
    double hand_position_m[3], hand_orientation_wxyz[4]; // of the device that holds it
    int64_t hand_ms;                                     // heard last
} kn_live_probe;

typedef struct kn_live {
    kn_join *bus, *mesh_bus;
    kn_mesh mesh;          // .whole: positions are known
    kn_scene *scene;       // NULL until heard
    char scene_error[300]; // "" or why the scene that was heard cannot be used
    int probe_count;
    kn_live_probe probe[KN_PROBES_MAX];
    int64_t heard[2]; // messages of ours on the bus, on the mesh bus
    int64_t meshes;   // whole ones
} kn_live;

// URLs as kn_join_open takes them, NULL is fine. False and one line in error.
bool kn_live_open(kn_live *live, const char *url, const char *mesh_url, char *error, size_t error_size);

// Takes what comes in the next timeout_ms, and returns early once something of ours has been taken.
void kn_live_listen(kn_live *live, int timeout_ms);

// The probe of that name, or NULL when it was not heard in the last 200 ms: nobody holds it.
const kn_live_probe *kn_live_find(const kn_live *live, const char *name);

bool kn_live_held(const kn_live_probe *probe); // a pose was heard in the last 200 ms

void kn_live_close(kn_live *live);

int64_t kn_live_now_ms(void); // CLOCK_MONOTONIC

#endif
