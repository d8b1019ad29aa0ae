#ifndef KN_CORE_SNAPSHOT_H
#define KN_CORE_SNAPSHOT_H
// A state as bytes and back: all that the next step depends on, so that a state that was written, read and stepped has
// the same bits as the one that went on. Field by field in the order of state.h, little-endian, without padding:
//
//     layout 1 | kind of lattice: hashes, nodes, reals of an edge field, precision, plate nodes
//     tick | 4 probes | chatter watch | 4 tools | fields, each with its count | held | anchors
//
// The bytes fit one kind of lattice: nodes, edges, support, structure, gas, material, step and precision are in its
// hash, what only tools, quality or the device say is not, for a restored object has no tool in it.
//
// Whoever reads has been given the bytes by somebody: sizes are compared with the model's before anything is read,
// every real is finite, every count and flag in its range. A checksum is the file's (server/snapshot.h).
#include "core/state.h"

typedef enum kn_snapshot_fit {
    KN_SNAPSHOT_FITS,
    KN_SNAPSHOT_LAYOUT,   // of another version of this file
    KN_SNAPSHOT_LATTICE,  // other nodes, edges or precision
    KN_SNAPSHOT_MATERIAL, // the same nodes in another material, structure, support, gas or step
    KN_SNAPSHOT_SHORT,    // ends too early, or goes on
    KN_SNAPSHOT_VALUE     // a number that no state has
} kn_snapshot_fit;

const char *kn_snapshot_fit_name(kn_snapshot_fit fit); // "another lattice"

// Identity of what a state belongs to, as above; equal on every machine.
uint64_t kn_model_hash(const kn_model *model);

// Bytes of a state, and of the largest that this model can have (anchors come and go).
size_t kn_snapshot_size(const kn_model *model, const kn_state *state);
size_t kn_snapshot_size_max(const kn_model *model);

// Returns the bytes written, 0 when size is less than kn_snapshot_size. A state gone bad is written, but not read.
size_t kn_snapshot_write(const kn_model *model, const kn_state *state, uint8_t *bytes, size_t size);

// Into a state of this model, one that is only kept, too. Of bytes that do not fit it holds anything: reset it.
// Real-time safe.
kn_snapshot_fit kn_snapshot_read(const kn_model *model, const uint8_t *bytes, size_t size, kn_state *state);

// Whether two states of a model differ: a node by more than by_m, or an edge's strain by more than by_m over the mean
// spacing. Far cheaper than a look at every edge's length, and what a probe alone does to a state is not seen.
// Real-time safe: reads both fields once.
bool kn_state_moved(const kn_model *model, const kn_state *a, const kn_state *b, double by_m);

#endif
