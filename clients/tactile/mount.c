#include "clients/tactile/mount.h"
#include <stdio.h>
#include <string.h>

void kn_mount_init(kn_device_def *d)
{
    *d = (kn_device_def){.basis = {1, 2, 3}, .rotation_wxyz = {1.0}, .scale = 1.0, .force_scale = 1.0};
}

bool kn_mount_basis(kn_device_def *d, const char *text, char *error, size_t error_size)
{
    kn_device_def turned = *d;
    const char *at = text, *wrong = NULL;
    // Read one optional sign and one letter per axis. Axes count from 1, and 0 marks an unknown letter.
    for (int i = 0; i < 3; i++) {
        double sign = *at == '-' ? -1.0 : 1.0;
        at += *at == '-' || *at == '+';
        const char *letter = *at ? strchr("XYZxyz", *at) : NULL;
        turned.basis[i] = letter ? sign * (double)((letter - "XYZxyz") % 3 + 1) : 0.0;
        at += letter != NULL;
    }
    // kn_device_check refuses unknown letters, repeated axes and left-handed bases.
    wrong = *at ? "more than three axes, expected something like XYZ or Y-XZ" : kn_device_check(&turned);
    if (!wrong) memcpy(d->basis, turned.basis, sizeof d->basis);
    else snprintf(error, error_size, "%s", wrong);
    return !wrong;
}

void kn_mount_orientation(const kn_device_def *d, const double device_wxyz[4], double scene_wxyz[4])
{
    double a[3][3];
    kn_device_axes(d, a);
    scene_wxyz[0] = device_wxyz[0]; // A rotates the axis of the rotation and leaves its angle unchanged
    for (int i = 0; i < 3; i++)
        scene_wxyz[1 + i] = a[i][0] * device_wxyz[1] + a[i][1] * device_wxyz[2] + a[i][2] * device_wxyz[3];
}
