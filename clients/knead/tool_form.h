#ifndef KN_CLIENTS_TOOL_FORM_H
#define KN_CLIENTS_TOOL_FORM_H
// Surface of a tool as triangles, for export to files. The surface is the one that the contact computation uses
// (core/shape.h). A round tool is divided in steps of 7.5 degrees. The contact computation gives a plate no thickness;
// here a plate is 2 mm thick, as in the pictures.
#include "core/model.h"
#include <stdint.h>

// Surface of a tool, in the tool's own coordinates. Point 0 is the origin of these coordinates and belongs to no
// triangle.
typedef struct kn_tool_form {
    int point_count, triangle_count;
    float (*xyz)[3];
    int32_t (*triangle)[3]; // three indices in `xyz` per triangle, counter-clockwise as seen from outside
} kn_tool_form;

// Make the surface of a tool. Return false when memory is short.
bool kn_tool_form_make(kn_tool_form *form, const kn_model *model, int probe);
// Free the surface of a tool. A zeroed struct is allowed.
void kn_tool_form_free(kn_tool_form *form);

// Move the surface of a tool to a pose and write its points to out[point_count][3] [m]. orientation_wxyz: unit
// quaternion; four zeros mean a level tool. A plate is always level.
void kn_tool_form_place(const kn_tool_form *form, const kn_probe_def *def, const double position_m[3],
                        const double orientation_wxyz[4], float (*out)[3]);

#endif
