#include "server/clutch.h"
#include "core/algebra.h"
#include <string.h>

void kn_clutch_open(kn_clutch *clutch) { *clutch = (kn_clutch){.turn_wxyz = {1, 0, 0, 0}}; }

// Compute the offset from the device's pose to the pose at which the tool stays. The translation is in the axes of the
// room. The rotation is in the device's own axes. When the device later turns about an axis of the room, the tool turns
// about the same axis.
static void take_offset(kn_clutch *clutch, const kn_pose *device)
{
    for (int k = 0; k < 3; k++) clutch->offset_m[k] = clutch->stays_m[k] - device->position_m[k];
    const double *q = device->orientation_wxyz, back[4] = {q[0], -q[1], -q[2], -q[3]};
    kn_turn_multiply(back, clutch->stays_wxyz, clutch->turn_wxyz);
}

void kn_clutch_move(kn_clutch *clutch, const kn_pose *device, kn_pose *tool)
{
    bool held = device->buttons & KN_BUTTON_CLUTCH;
    // The clutch was released, so from now on the tool follows the device with the new offset.
    if (!held && clutch->held) take_offset(clutch, device);
    *tool = *device;
    for (int k = 0; k < 3; k++) tool->position_m[k] += clutch->offset_m[k];
    double turned[4];
    kn_turn_multiply(device->orientation_wxyz, clutch->turn_wxyz, turned);
    kn_turn_unit(turned, tool->orientation_wxyz);
    // The clutch was pressed, so remember the tool's pose.
    if (held && !clutch->held) {
        memcpy(clutch->stays_m, tool->position_m, sizeof clutch->stays_m);
        memcpy(clutch->stays_wxyz, tool->orientation_wxyz, sizeof clutch->stays_wxyz);
    }
    clutch->held = held;
    if (!held) return;
    // While the clutch is held, keep the tool at the remembered pose.
    memcpy(tool->position_m, clutch->stays_m, sizeof tool->position_m);
    memcpy(tool->orientation_wxyz, clutch->stays_wxyz, sizeof tool->orientation_wxyz);
    memset(tool->velocity_m_s, 0, sizeof tool->velocity_m_s);
}
