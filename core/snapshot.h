#ifndef KN_CORE_SNAPSHOT_H
#define KN_CORE_SNAPSHOT_H
// A snapshot: a state written as bytes, and read back. A state can also be carried over to another material. The bytes
// hold everything that the next step depends on. So a state that was read back steps to the same bits as the original.
// The bytes hold field after field in the order of state.h, little-endian, without padding:
//
//     layout 1 | kind of lattice: hashes, nodes, reals of an edge field, precision, plate nodes
//     tick | 4 probes | chatter watch | 4 tools | fields, each with its count | held | anchors
//
// The bytes fit one kind of lattice only. The hash of the kind covers nodes, edges, support, structure, gas, material,
// step and precision. It does not cover tools, quality and device, because a restored object may meet other tools.
//
// The reader does not trust the bytes. It compares the sizes with the model's before it reads anything, and checks that
// every real is finite and that every count and flag is in its range. The file has a checksum (server/snapshot_file.h).
#include "core/state.h"

typedef enum kn_snapshot_fit {
    KN_SNAPSHOT_FITS,
    KN_SNAPSHOT_LAYOUT,   // written by another version of this module
    KN_SNAPSHOT_LATTICE,  // nodes, edges or precision differ from the model's
    KN_SNAPSHOT_MATERIAL, // nodes agree, but material, structure, support, gas or step differ from the model's
    KN_SNAPSHOT_SHORT,    // the snapshot has too few or too many bytes
    KN_SNAPSHOT_VALUE     // a value is outside its range
} kn_snapshot_fit;

const char *kn_snapshot_fit_name(kn_snapshot_fit fit); // static text for users, e.g. "another lattice"

// Return the hash of a model's kind of lattice: nodes, edges, support, structure, gas, material, step and precision.
// The hash is equal on every machine.
uint64_t kn_model_hash(const kn_model *model);

// Return the number of bytes of the snapshot of a state. The size depends on the number of anchors in the state.
// kn_snapshot_size_max returns an upper bound for all states of the model.
size_t kn_snapshot_size(const kn_model *model, const kn_state *state);
size_t kn_snapshot_size_max(const kn_model *model);

// Write a state to the caller's memory bytes[size]. Return the number of bytes written, or 0 if size is less than
// kn_snapshot_size. A state with non-finite values can be written, but kn_snapshot_read refuses the bytes. Real-time
// safe.
size_t kn_snapshot_write(const kn_model *model, const kn_state *state, uint8_t *bytes, size_t size);

// Read a snapshot into a state of this model. If the result is not KN_SNAPSHOT_FITS, the contents of the state are
// undefined, and the state must be reset. Real-time safe.
kn_snapshot_fit kn_snapshot_read(const kn_model *model, const uint8_t *bytes, size_t size, kn_state *state);

// Return true if two states of a model differ: a component of a node's position by more than by_m, or an edge's strain
// by more than by_m divided by the spacing. Probes are not compared. Real-time safe: reads displacements and strains of
// both states once.
bool kn_state_moved(const kn_model *model, const kn_state *a, const kn_state *b, double by_m);

// --- another material -----------------------------------------------------------------------------------------------

// Change of an object's material: turn the state of one model into a state of another model with the same lattice.
//
// Positions, velocities, held nodes, anchors and the flow that the dampers have gone through stay the same. The
// extension p - p0 = u gamma L0 of each Voigt part also stays the same, where p0 is the part's natural length. The
// stored strain u belongs to the beginning of the last step (law.h), so u at the end of that step follows from the new
// material. Forces and the stored energy jump. To find the jump of the energy, call kn_energy_of (measure.h) for both
// states. The new density and gravity act from the next step on.

// Return NULL if a state of the model `from` can become a state of `to`, else the reason as a static text, e.g.
// "another lattice". The two models must agree in nodes, edges, skin, solver, precision, support, kind of gas pressure,
// tools and stops of the damper. If one of them has a damper or contact that sticks, so must the other. Both must have
// room for equally many samples; adhesion and grip need more room.
const char *kn_carry_misfit(const kn_model *from, const kn_model *to);

// Convert the state `now` of the model `from` into the state `then` of the model `to`. Real-time safe: reads and writes
// each state once.
void kn_carry(const kn_model *from, const kn_state *now, const kn_model *to, kn_state *then);

#endif
