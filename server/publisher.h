#ifndef KN_SERVER_PUBLISHER_H
#define KN_SERVER_PUBLISHER_H
// The publisher: forces, events, scene, status and health on the bus on which poses arrive. The publisher belongs to
// one thread and has one lcm_t, which only transmits (liblcm must not receive from the bus, see receiver.h). Messages
// are encoded into the publisher's own memory. The X_publish functions of lcm-gen would allocate for each message.
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "server/auth.h"
#include "server/loop.h"
#include <lcm/lcm.h>

typedef struct kn_publisher {
    lcm_t *lcm;
    const kn_scene *scene;
    const kn_auth *auth; // key that signs every message; NULL: messages are not signed
    int64_t signed_us;   // age stamp of the last signed message: time since the life of kneadd began (auth.h), us
    uint64_t initial_hash;
    char force_channel[KN_PROBES_MAX][64]; // LCM channel of each probe's forces: KNEAD_FORCE_<probe>
    char contact_channel[KN_PROBES_MAX][64];
    char touch_channel[KN_PROBES_MAX][64];
    uint8_t *bytes; // buffer of `room` bytes for the largest message (the scene) and its KN_AUTH_TRAILER bytes
    int room;
    int64_t published; // datagrams handed to LCM
    int64_t failed;    // messages that could not be encoded, or that LCM refused
} kn_publisher;

// Open the bus at an LCM URL. initial_hash: state hash of the object before anything touched it. Borrows `scene`. On
// failure return false and put one line in error.
bool kn_publisher_open(kn_publisher *p, const char *url, const kn_scene *scene, uint64_t initial_hash, char *error,
                       size_t error_size);
void kn_publisher_close(kn_publisher *p);

// From now on publish `scene`, which must have the same probes. Borrows `scene`. May allocate. If memory is short,
// return false and keep publishing the previous scene.
bool kn_publisher_go_over(kn_publisher *p, const kn_scene *scene);

// Answer a listener's KNEAD_HELLO with KNEAD_LIFE. Needs auth.
void kn_publisher_answer(kn_publisher *p, const unsigned char nonce[KN_AUTH_NONCE]);

// Publish a tick: its events in the order they were applied, then the force of every probe that has a session. If local
// contact models are identified, the probe's contact model (KNEAD_CONTACT) follows its force.
void kn_publisher_record(kn_publisher *p, const kn_record *record);
void kn_publisher_touch(kn_publisher *p, const kn_touched *touched);
void kn_publisher_scene(kn_publisher *p, int64_t utime);
void kn_publisher_status(kn_publisher *p, const knead_status_t *status);
void kn_publisher_health(kn_publisher *p, const knead_health_t *health);

#endif
