#ifndef KN_SERVER_SNAPSHOT_H
#define KN_SERVER_SNAPSHOT_H
// A snapshot file: all that a served object needs to go on to the bit, and whose it is.
//
//     magic | format | bytes in all | knead's version | scene's name | hash of its text | state hash
//     what was set over it at run time | generation | tick | utime |
//     bytes of the lattice | the lattice (core/snapshot.h) | the servo's own part BLAKE2b-256
//
// Little-endian. The checksum is over everything before it, in every format there will be, so that a file of a later
// version can be told from a damaged one. A file is refused with a reason: not a snapshot, truncated, checksum,
// another version, another scene, another lattice or material, a number out of its range.
//
// The scene is the same when its name and what the lattice is made of are (kn_model_hash): with another tool, device or
// point of quality the object can be gone on with. The bits of the forces need the whole text: `text_hash` tells.
#include "server/servo.h"

#define KN_SAVED_MAX ((size_t)256 << 20) // bytes of a file: a million nodes take 100 MB

typedef struct kn_saved {
    char scene[64], version[32]; // as kn_scene.name and KN_VERSION
    uint64_t text_hash, state_hash;
    kn_sets sets;       // that made the text of the one that the server was started with
    int64_t generation; // of the file, 1, 2, ...
    int64_t tick;       // the last one executed; the state is that before the next one's step
    int64_t utime;      // us since 1970, when that had been
    kn_state *state;    // kept; the caller's
    kn_servo servo;     // its plain part: safety, poses, clutches, quality, counters
} kn_saved;

size_t kn_saved_size_max(const kn_model *model);

// state, servo (its sets, too), generation, tick and utime are given; fills in the rest. Bytes written, 0: more than
// size.
size_t kn_saved_encode(const kn_scene *scene, const kn_model *model, kn_saved *saved, uint8_t *bytes, size_t size);

// Into saved, whose state is of this model and whose servo kn_servo_init has made; of a refused file they hold
// anything. False and the reason in why.
bool kn_saved_decode(const kn_scene *scene, const kn_model *model, const uint8_t *bytes, size_t size, kn_saved *saved,
                     char *why, size_t why_size);

// What was set over a scene of this name, by the head of a whole file, whatever its lattice. False: the file
// is not one of that scene.
bool kn_saved_peek(const char *scene, const uint8_t *bytes, size_t size, kn_sets *sets);

// A servo that goes on as the saved one did: its plain part; the backend's lattice is the caller's to restore.
void kn_saved_resume(const kn_saved *saved, kn_servo *servo);

#endif
