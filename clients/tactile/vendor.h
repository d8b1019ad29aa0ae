#ifndef KN_CLIENTS_VENDOR_H
#define KN_CLIENTS_VENDOR_H
// Drivers of devices that their makers' own libraries serve: Force Dimension (omega, delta, sigma) through libdhd of
// the Force Dimension SDK 3, and 3D Systems (Touch, Phantom) through libHD of OpenHaptics 3. knead is built without
// them, and loads a library when its device is opened. The drivers have not been tested on hardware.
// tests/tactile/vendor_library.c has the same functions over a simulated device.
//
//                  libdhd                                    libHD
//     frame        x to the user, y to the right, z up       x to the right, y up, z to the user
//     units        m, N                                      mm, N
//     thread       the bridge's: a pose every ms             its own: a pose and a force in each of its periods
//     watchdog     the firmware's, set to 20 ms and tested   not reported by libHD: no test
//
// Both drivers turn the frame to x to the right, y forward, z up.
#include "clients/tactile/bridge.h"

typedef enum kn_vendor_kind { KN_VENDOR_FORCEDIMENSION, KN_VENDOR_TOUCH } kn_vendor_kind;

typedef struct kn_vendor {
    kn_tactile base;
    kn_vendor_kind kind;
    const char *device; // touch: name of the arm in the maker's setup program; NULL: the default arm
    // The fields below are used by vendor.c only.
    kn_bridge *bridge;
    int id;       // device's handle in its library
    bool enabled; // the last command switched the motors on
    int look_ms;  // libdhd: time since the status was read or the motors were switched
    // State that libHD's thread shares with the bridge's, guarded by `lock`. cold: the arm is not calibrated. dropped:
    // the force was dropped, and stays 0 until the bridge has switched the motors off.
    pthread_mutex_t lock;
    kn_tactile_pose pose;
    bool fresh_pose, fresh_force, live, cold, dropped;
    double force_n[3];
    unsigned error; // newest error of libHD, 0: none
    // The fields below are used by libHD's thread only.
    kn_watchdog watchdog; // over the bridge's thread
    int64_t served_ns;    // time of the last period
    unsigned long task;
} kn_vendor;

// Prepare the driver without loading the library. device: see kn_vendor; the text must outlive the driver. A touch
// gives force only if base.unwatched is true.
void kn_vendor_init(kn_vendor *vendor, kn_vendor_kind kind, const char *device);

// Load the maker's library. Return false and one line in `error` if the library or one of its functions is missing.
bool kn_vendor_load(kn_vendor_kind kind, char *error, size_t error_size);

#endif
