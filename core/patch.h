#ifndef KN_CORE_PATCH_H
#define KN_CORE_PATCH_H
// Which nodes of the skin that a tool presses belong together: patches that lie apart, each of which is a contact.
//
//     o o o o o o o o o     Two pressed nodes are one patch when they are neighbours, on a face also across a corner.
//     o # # o o o 2 2 o     Patches are apart, then, where a node between them carries nothing, 1 to 2 spacings.
//     o # # # o o 2 2 o     A patch keeps its number while its nodes are pressed on. Of two that have grown together
//     o o # o o o o 2 o     one goes on; of one that has broken in two the part that has more of its load.
//
// There are KN_PATCHES_MAX numbers for each tool. Of more patches the strongest have one of their own, the rest share
// one. Work is bounded by the pressed nodes, 8 neighbours each.
#include "core/model.h"

#define KN_PATCHES_MAX 8

typedef struct kn_patches kn_patches;

kn_patches *kn_patches_create(const kn_model *model); // NULL: no memory, or an object without a skin
void kn_patches_destroy(kn_patches *patches);         // NULL is fine
void kn_patches_reset(kn_patches *patches);           // no tool has any

// A round for probe p: begin, press every node that carries load, end. Real-time safe, like all below.
void kn_patches_begin(kn_patches *patches, int p);
void kn_patches_press(kn_patches *patches, int node, double force_n);

// Bit i of the answer: number i is in use. share[i][j]: how much of what j carried i has taken over, of its nodes that
// are still pressed, by their load now; 0 for a j that was not in use.
unsigned kn_patches_end(kn_patches *patches, double share[KN_PATCHES_MAX][KN_PATCHES_MAX]);

// The number that a node had at the end of the last round of p, -1 none.
int kn_patches_at(const kn_patches *patches, int p, int node);

// The neighbours of a node, whatever is pressed.
const int *kn_patches_near(const kn_patches *patches, int node, int *count);

#endif
