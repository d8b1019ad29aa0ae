#ifndef KN_CORE_SCENE_LIBRARY_H
#define KN_CORE_SCENE_LIBRARY_H
// Named materials: the files of core/scenes/materials, compiled in, so that `material: dough` means the same in every
// scene wherever it lies and whatever is installed. Each file holds a material and its density, with the source of
// every number. In the same way device profiles: the files of core/devices.
//
// The numbers are those of a rheological object; variants follow from them by the second paper's rules:
//     viscoelastic  stroke [1, 1]: the damper cannot move, the deformation is lost wholly
//     plastic       k1 = 0; c1 = c2 = 2 c2 when c2 is constant, c1 = 25 c2(0) when it depends on the stress: then the
//                   pair is the damper alone within 1/26 (equation 8)
// material.variant says which; a file may have one as its default, and the name takes it as a suffix: dough-plastic.
#include "core/scene/draft.h"

typedef struct kn_library_entry {
    const char *name; // "dough"
    const char *text; // of its file
} kn_library_entry;

extern const kn_library_entry kn_library[]; // in alphabetical order, ends with name NULL
extern const kn_library_entry kn_devices[]; // the files of core/devices: one for each word of device.profile

// The entry that a name means, with the suffix cut off; NULL if there is none. *variant: number of the suffix in the
// words of material.variant, -1: none.
const kn_library_entry *kn_library_find(const char *name, int *variant);

// "clay, dough, ...".
const char *kn_library_names(char text[KN_LINE_MAX]);

// Takes material and density out of the draft of a material's file, all at the mark where the scene names it. A density
// that the scene itself has stays. False after a complaint about anything else in that file.
bool kn_library_take(kn_draft *draft, const kn_draft *from, int variant, kn_mark mark);

// Turns the numbers, complete and in SI, into those of the variant that the draft asks for. False after a complaint.
bool kn_library_vary(kn_draft *draft);

#endif
