#ifndef KN_CLIENTS_PROFILE_H
#define KN_CLIENTS_PROFILE_H
// Reader of a device profile without a scene. Sets (`device.KEY=VALUE` texts of --set) can override the profile's
// values.
#include "core/device.h"
#include <stddef.h>

// Load a profile, apply the sets and write the result to `device`. name: name of a profile, or path of its file. Return
// 0, or print an error message that begins with the name of the subcommand and return an exit code.
int kn_profile_load(kn_device_def *device, const char *subcommand, const char *name, const char *const *sets,
                    int set_count);

#endif
