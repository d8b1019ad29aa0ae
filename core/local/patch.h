#ifndef KN_CORE_LOCAL_PATCH_H
#define KN_CORE_LOCAL_PATCH_H
// Contact of one tool as a client sees it: patches that the tool presses, places that it will touch next, and the
// impedance of the object there.
#include "core/state.h"

// --- patches --------------------------------------------------------------------------------------------------------

// Patches: groups of skin nodes that a tool presses. Patches lie apart, and each is one contact.
//
//     o o o o o o o o o     Two pressed nodes belong to one patch if they are neighbours; on a face, also diagonally.
//     o # # o o o 2 2 o     So two patches are apart if a node between them carries no load: 1 to 2 spacings.
//     o # # # o o 2 2 o     A patch keeps its number while its nodes stay pressed. If two patches grow together, one
//     o o # o o o o 2 o     number goes on. If a patch breaks in two, the part with more of its load keeps the number.
//
// Each tool has KN_PATCHES_MAX numbers. If there are more patches, the strongest have their own numbers and the others
// share the last one. The work is bounded by the pressed nodes, with 8 neighbours each.

#define KN_PATCHES_MAX 8

typedef struct kn_patches kn_patches;

kn_patches *kn_patches_create(const kn_model *model); // NULL: memory is short, or the object has no skin
void kn_patches_destroy(kn_patches *patches);         // does nothing if `patches` is NULL
void kn_patches_reset(kn_patches *patches);           // forget all patches of all tools

// Group the nodes that probe `p` presses: call begin once, press for every node that carries load, then end. These and
// the functions below are real-time safe.
void kn_patches_begin(kn_patches *patches, int p);
void kn_patches_press(kn_patches *patches, int node, double force_n);

// End the grouping. Bit i of the result is set if patch number i is in use. share[i][j] tells which share of the old
// patch j the new patch i has taken over. It is the present load on the nodes of j that are now in i, divided by the
// present load on all nodes of j that are still pressed. If number j was not in use, share[i][j] is 0.
unsigned kn_patches_end(kn_patches *patches, double share[KN_PATCHES_MAX][KN_PATCHES_MAX]);

// Return the number of the patch of probe p to which a node belongs, or -1 if it belongs to none. The patches are those
// of the last kn_patches_end for this probe.
int kn_patches_at(const kn_patches *patches, int p, int node);

// Return the neighbours of a node on the skin, pressed or not, and store their count. The list belongs to `patches`.
const int *kn_patches_near(const kn_patches *patches, int node, int *count);

// --- next places ----------------------------------------------------------------------------------------------------

// Search for the places of the skin that a tool will touch next. It serves tools of several parts and tools whose shape
// is a surface file. The tool may already press other places. (A tool of one convex part has only one such place, see
// kn_clearance.)
//
// A sweep visits every node of the skin. It is spread over several ticks. A node becomes a place if it is nearer to the
// tool than all neighbours of the node, and if no pressed patch is next to the node. The places stay the same until the
// next sweep is complete.
//
// kn_ahead_places computes the exact point, distance and direction of a place. To find the point, the function starts
// at the node and moves along the skin by (d + r) times the tangential part of the distance gradient, where d is the
// distance at the node and r the tool's smallest half width. If the tool's surface near the place is a ball of radius
// r, the result is the nearest point.

typedef struct kn_place {
    int node;         // node of the skin at which the sweep found the place
    double gap_m;     // distance from the tool to the skin, positive without contact
    double normal[3]; // unit normal of the skin, out of the object
    double arm_m[3];  // vector from the tool's position to the point of the tool that will touch [m]
} kn_place;

typedef struct kn_ahead kn_ahead;

// Create the search for tool `p`. `model` and `patches` must outlive the search. Places farther away than reach_m are
// not reported. Return NULL if memory is short, or if tool p is a plate or has one convex part.
kn_ahead *kn_ahead_create(const kn_model *model, const kn_patches *patches, int p, double reach_m);
void kn_ahead_destroy(kn_ahead *ahead); // does nothing if `ahead` is NULL
void kn_ahead_reset(kn_ahead *ahead);   // forget the places found so far and begin a new sweep

// Continue the sweep: visit some of the skin's nodes in search of places that the tool will touch. Call once per tick.
// Real-time safe.
void kn_ahead_look(kn_ahead *ahead, const kn_state *state);

// Store up to `most` places of the last sweep in place[], with their present distances. Return the number of places
// that are within the tool's reach and not touched yet. Real-time safe.
int kn_ahead_places(const kn_ahead *ahead, const kn_state *state, int most, kn_place place[]);

// --- impedance ------------------------------------------------------------------------------------------------------

// Impedance of the object at a contact: the velocity of the contact's points under the contact's own pattern of forces.
//
//     (M/(S dt) + A n n' over all edges) z = b,   |b| = 1 N in sum,   Y = b'z,   impedance A_c = 1/Y   [N s/m]
//
// The matrix is that of the step with two changes. First, the dampers c2 do not yield: edges answer with A = c1 + dt k1
// alone, which is a lasting property of object and contact. Second, inertia is S times smaller. A client's unit has no
// mass, so it must answer like the object over S dt = 30 ms, not over one step. All edges have one material, so k1/A at
// the contact is the same as in an edge.
//
// The solver is conjugate gradients with a warm start. A pattern changes little between two rounds, so a round of a few
// iterations, spread over several ticks, follows it. The lattice is taken as undeformed. A compression by a fifth
// changes A_c by about a fifth.

typedef struct kn_mobility kn_mobility;

// Create a mobility solver. It allocates all its memory here, including a state of the model. Return NULL if memory is
// short or the solver is not the implicit one.
kn_mobility *kn_mobility_create(const kn_model *model);
void kn_mobility_destroy(kn_mobility *m); // does nothing if `m` is NULL

// A round computes the impedance at the contact of probe `p`. Call begin, then load for every force of the pattern,
// then start. Then call iterate until it returns true. `offset`: entry of model->offset for the node on which the force
// acts. These and the functions below are real-time safe.
void kn_mobility_begin(kn_mobility *m, int p);
void kn_mobility_load(kn_mobility *m, size_t offset, const double force_n[3]);
void kn_mobility_start(kn_mobility *m);

// Do one iteration of the round, which takes about 20 ns per node. Return true when the round is complete. Then
// *a_n_s_per_m is the new impedance, or 0 if the round failed.
bool kn_mobility_iterate(kn_mobility *m, double *a_n_s_per_m);

// Return the scalar product of force_n and the velocity of a node, W. This velocity is the response of the object to
// the whole pattern of forces, whose sum is 1 N. It comes from the last successful round for probe p.
double kn_mobility_rate(const kn_mobility *m, int p, size_t offset, const double force_n[3]);

#endif
