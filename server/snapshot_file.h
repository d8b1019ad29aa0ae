#ifndef KN_SERVER_SNAPSHOT_FILE_H
#define KN_SERVER_SNAPSHOT_FILE_H
// A snapshot file holds everything that a served object needs to continue with the same bits, and identifies the scene.
//
//     magic | format | file size | knead's version | scene's name | hash of its text | state hash
//     settings made at run time | generation | tick | utime |
//     size of the lattice | the lattice (core/snapshot.h) | plain part of the servo | BLAKE2b-256
//
// Little-endian. In every format, present or future, the checksum covers everything before it. So a file of a later
// version can be distinguished from a damaged file. A file is refused with a reason: not a snapshot, truncated,
// checksum, another version, another scene, another lattice or material, a number out of its range.
//
// A snapshot fits a scene with the same name and the same lattice and material (kn_model_hash). Tools, device and
// quality point may differ. The forces have the same bits only if the whole text of the scene is the same. Compare
// `text_hash` to find out.
#include "server/servo.h"

#define KN_SAVED_MAX ((size_t)256 << 20) // largest size of a snapshot file, bytes; a million nodes take 100 MB

typedef struct kn_saved {
    char scene[64], version[32]; // `scene`: kn_scene.name; `version`: KN_VERSION of the server that saved
    uint64_t text_hash, state_hash;
    kn_settings
        settings; // settings made at run time: with them, the server's first scene becomes the scene that was saved
    int64_t generation; // generation, that is, number of the snapshot file: 1, 2, ...
    int64_t tick;       // last tick executed before the state was saved
    int64_t utime;      // time of the tick `tick`, us since 1970
    kn_state *state;    // state of the object; owned by the caller
    kn_servo servo;     // the servo without its pointers: safety, poses, clutches, quality, counters
} kn_saved;

size_t kn_saved_size_max(const kn_model *model); // return the largest size of a snapshot file of this model, bytes

// Encode a snapshot. The caller sets state, servo (with its settings), generation, tick and utime of `saved`; this
// function sets the rest. Return the number of bytes written, or 0 if `size` bytes are not enough.
size_t kn_saved_encode(const kn_scene *scene, const kn_model *model, kn_saved *saved, uint8_t *bytes, size_t size);

// Decode a snapshot into `saved`. saved->state must be a state of this model, and kn_servo_init must have initialised
// saved->servo. If the file is refused, return false and put the reason in `why`; the contents of `saved` are then
// undefined.
bool kn_saved_decode(const kn_scene *scene, const kn_model *model, const uint8_t *bytes, size_t size, kn_saved *saved,
                     char *why, size_t why_size);

// Read only the fields of a snapshot file before `generation`; the file may have any lattice. Return false if the file
// is damaged, of another version, or of a scene with another name.
bool kn_saved_peek(const char *scene, const uint8_t *bytes, size_t size, kn_saved *head);

// Copy safety, poses, clutches, quality and counters of the saved servo into `servo`, which then continues as the saved
// servo did. The caller restores the lattice of the backend.
void kn_saved_resume(const kn_saved *saved, kn_servo *servo);

#endif
