#ifndef KN_CLIENTS_VITALS_H
#define KN_CLIENTS_VITALS_H
// How kneadd is, by what it says on the bus: KNEAD_STATUS, KNEAD_HEALTH, the energies of KNEAD_EVENT, and what a tool
// touches where kneadd --touch tells. The newest of each; a message that is not what its channel says is left out.
#include "clients/knead/join.h"
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "proto/knead_touch_patch_t.h"
#include <stdbool.h>

typedef struct kn_vitals {
    int64_t status_ms, health_ms, energy_ms, touch_ms; // CLOCK_MONOTONIC of the newest, 0: none yet
    knead_status_t status;
    knead_health_t health;
    double stored_j, work_j; // of the last audit: energy in the object, work of all tools since it was new
    knead_touch_patch_t touch;
    int64_t mesh_bytes;     // of KNEAD_MESH_UPDATE, all of them
    char touch_channel[80]; // private
} kn_vitals;

// Subscribes on buses that somebody else listens to and ends. False: too many.
bool kn_vitals_open(kn_vitals *vitals, kn_join *bus, kn_join *mesh_bus);
void kn_vitals_touch(kn_vitals *vitals, const char *probe); // whose patch is listened to; NULL: none's

// us below which that share of the ticks took, 2^n; 0: none yet.
int64_t kn_vitals_share_us(const int64_t histogram[32], double share);

#endif
