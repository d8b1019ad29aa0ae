#ifndef KN_CLIENTS_VITALS_H
#define KN_CLIENTS_VITALS_H
// Vitals: the state of kneadd as reported on the bus. It consists of KNEAD_STATUS, KNEAD_HEALTH, the energies in
// KNEAD_EVENT, and, if kneadd runs with --touch, the contact patch of a tool. The newest message of each kind is kept.
// A message that cannot be decoded is ignored.
#include "clients/knead/join.h"
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "proto/knead_touch_patch_t.h"
#include <stdbool.h>

typedef struct kn_vitals {
    // Arrival times (CLOCK_MONOTONIC) of the newest message of each kind; 0: none yet.
    int64_t status_ms, health_ms, energy_ms, touch_ms;
    knead_status_t status;
    knead_health_t health;
    // Result of kneadd's last energy audit: energy stored in the object, and work of all tools since the object was
    // undeformed.
    double stored_j, work_j;
    knead_touch_patch_t touch;
    int64_t mesh_bytes;     // total size of all KNEAD_MESH_UPDATE messages so far
    char touch_channel[80]; // channel of the contact patches of the chosen probe (private)
} kn_vitals;

// Subscribe to the messages on two buses, which the caller reads and closes. Return false if a bus has too many
// subscriptions.
bool kn_vitals_open(kn_vitals *vitals, kn_join *bus, kn_join *mesh_bus);
// Sets the probe whose contact patch is kept; NULL: keep none.
void kn_vitals_touch(kn_vitals *vitals, const char *probe);

// Return the smallest power of two [us] such that at least the fraction `share` of the tick times is smaller. Return 0
// if no ticks have been counted yet. histogram[n]: number of ticks shorter than 2^n us and not counted in a lower
// bucket.
int64_t kn_vitals_share_us(const int64_t histogram[32], double share);

#endif
