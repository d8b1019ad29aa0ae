#ifndef KN_SERVER_PUBLISHER_H
#define KN_SERVER_PUBLISHER_H
// What leaves on the bus of poses: forces, events, the scene, the status. One thread, one lcm_t, which only transmits
// (liblcm's receiving half is not to be trusted with the bus, see receiver.h). Messages are encoded into memory of
// our own; lcm-gen's X_publish would allocate for each.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/auth.h"
#include "server/loop.h"
#include <lcm/lcm.h>

typedef struct kn_publisher {
    lcm_t *lcm;
    const kn_scene *scene;
    const kn_auth *auth; // signs every message; NULL: nobody does
    int64_t signed_us;   // age of the last one
    uint64_t initial_hash;
    char force_channel[KN_PROBES_MAX][64]; // KNEAD_FORCE_<probe>
    char contact_channel[KN_PROBES_MAX][64];
    char touch_channel[KN_PROBES_MAX][64];
    uint8_t *bytes;    // room for the largest message, which is the scene
    int room;          // and KN_AUTH_TRAILER bytes more
    int64_t published; // datagrams handed to LCM
    int64_t failed;    // refused by it
} kn_publisher;

// initial_hash: of the object before anything touched it. Borrows scene. False and one line in error.
bool kn_publisher_open(kn_publisher *p, const char *url, const kn_scene *scene, uint64_t initial_hash, char *error,
                       size_t error_size);
void kn_publisher_close(kn_publisher *p);

// Another scene with the same probes, told from now on. Borrows it. May allocate; false: there is no memory for it, and
// it is not told.
bool kn_publisher_go_over(kn_publisher *p, const kn_scene *scene);

// Answer a listener's KNEAD_HELLO. Needs auth.
void kn_publisher_answer(kn_publisher *p, const unsigned char nonce[KN_AUTH_NONCE]);

// A tick: its events, in the order they were applied, then of every probe that has a session the force and, where they
// are identified, the local model.
void kn_publisher_record(kn_publisher *p, const kn_record *record);
void kn_publisher_touch(kn_publisher *p, const kn_touched *touched);
void kn_publisher_scene(kn_publisher *p, int64_t utime);
void kn_publisher_status(kn_publisher *p, const knead_status_t *status);
void kn_publisher_health(kn_publisher *p, const knead_health_t *health);

#endif
