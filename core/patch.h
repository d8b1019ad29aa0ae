#ifndef KN_CORE_PATCH_H
#define KN_CORE_PATCH_H
// Patches: groups of skin nodes that a tool presses. Patches lie apart, and each is one contact.
//
//     o o o o o o o o o     Two pressed nodes belong to one patch if they are neighbours; on a face, also diagonally.
//     o # # o o o 2 2 o     So two patches are apart if a node between them carries no load: 1 to 2 spacings.
//     o # # # o o 2 2 o     A patch keeps its number while its nodes stay pressed. If two patches grow together, one
//     o o # o o o o 2 o     number goes on. If a patch breaks in two, the part with more of its load keeps the number.
//
// Each tool has KN_PATCHES_MAX numbers. If there are more patches, the strongest have their own numbers and the others
// share the last one. The work is bounded by the pressed nodes, with 8 neighbours each.
#include "core/model.h"

#define KN_PATCHES_MAX 8

typedef struct kn_patches kn_patches;

kn_patches *kn_patches_create(const kn_model *model); // NULL: memory is short, or the object has no skin
void kn_patches_destroy(kn_patches *patches);         // does nothing if `patches` is NULL
void kn_patches_reset(kn_patches *patches);           // forget all patches of all tools

// Group the nodes under probe `p` (a round): call begin once, press for every node that carries load, then end.
// These and the functions below are real-time safe.
void kn_patches_begin(kn_patches *patches, int p);
void kn_patches_press(kn_patches *patches, int node, double force_n);

// End the grouping. Bit i of the result is set if patch number i is in use. share[i][j]: the share of the old patch j
// that patch i has taken over. Only those nodes of j that are still pressed count, by their present load. The share is
// 0 if j was not in use.
unsigned kn_patches_end(kn_patches *patches, double share[KN_PATCHES_MAX][KN_PATCHES_MAX]);

// Return the number of the patch that a node belongs to since the last kn_patches_end for probe p, -1: none.
int kn_patches_at(const kn_patches *patches, int p, int node);

// Return the neighbours of a node, pressed or not, and store their count.
const int *kn_patches_near(const kn_patches *patches, int node, int *count);

#endif
