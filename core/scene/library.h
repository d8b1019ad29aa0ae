#ifndef KN_CORE_SCENE_LIBRARY_H
#define KN_CORE_SCENE_LIBRARY_H
// Named materials: the files of core/scenes/materials, compiled in. So `material: dough` means the same material in
// every scene, wherever the scene is and whatever is installed. Each file holds a material and its density, with the
// source of every number. Device profiles, the files of core/devices, are compiled in the same way.
//
// The numbers are those of a rheological object. Variants follow from them by the second paper's rules:
//     viscoelastic  stroke [1, 1]: the damper cannot move, so all of the deformation is lost
//     plastic       k1 = 0; c1 = c2 = 2 c2 if c2 is constant; c1 = 25 c2(0) if c2 depends on the stress: then the pair
//                   equals the damper alone to within 1/26 (equation 8)
// material.variant chooses the variant. A material's file may set its default variant. In a scene, the name of a
// material may have the variant as a suffix: dough-plastic.
#include "core/scene/draft.h"

typedef struct kn_library_entry {
    const char *name; // name of the material or device, e.g. "dough"
    const char *text; // text of the file
} kn_library_entry;

extern const kn_library_entry kn_library[]; // in alphabetical order; the last entry has the name NULL
extern const kn_library_entry kn_devices[]; // the files of core/devices: one for each word of device.profile

// Return the entry of a name without its suffix, or NULL if there is none. *variant becomes the number of the suffix in
// the words of material.variant, or -1.
const kn_library_entry *kn_library_find(const char *name, int *variant);

// Print the names of all materials into `text` and return it: "clay, dough, ...".
const char *kn_library_names(char text[KN_LINE_MAX]);

// Copy material and density from the draft of a material's file. Every value is marked with the place where the scene
// names the material. A density in the scene itself takes precedence. Return false with an error about any other key in
// the file.
bool kn_library_take(kn_draft *draft, const kn_draft *from, int variant, kn_mark mark);

// Replace the complete numbers, in SI, by those of the draft's variant. Return false after an error.
bool kn_library_vary(kn_draft *draft);

#endif
