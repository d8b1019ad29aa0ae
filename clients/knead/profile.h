#ifndef KN_CLIENTS_PROFILE_H
#define KN_CLIENTS_PROFILE_H
// A device profile without a scene: by its name, or the file of one, with --sets of device.* over it.
#include "core/device.h"
#include <stddef.h>

// An exit code, after a complaint in the name of the subcommand.
int kn_profile_load(kn_device_def *device, const char *subcommand, const char *name, const char *const *sets,
                    int set_count);

#endif
