#ifndef KN_CLIENTS_TOOL_FORM_H
#define KN_CLIENTS_TOOL_FORM_H
// The surface of a tool as triangles, for files: what the contact feels (core/shape.h), a round one in steps of 7.5
// degrees. A plate, which has no thickness to the contact, is 2 mm of it as in the pictures.
#include "core/model.h"
#include <stdint.h>

typedef struct kn_tool_form { // in the tool's frame; point 0 is its origin, in no triangle
    int point_count, triangle_count;
    float (*xyz)[3];
    int32_t (*triangle)[3]; // counter-clockwise from outside
} kn_tool_form;

bool kn_tool_form_make(kn_tool_form *form, const kn_model *model, int probe); // false: memory is short
void kn_tool_form_free(kn_tool_form *form);                                   // zeroed is fine

// Where it is: out[point_count][3], m. orientation_wxyz: all 0 is level; a plate always is.
void kn_tool_form_place(const kn_tool_form *form, const kn_probe_def *def, const double position_m[3],
                        const double orientation_wxyz[4], float (*out)[3]);

#endif
