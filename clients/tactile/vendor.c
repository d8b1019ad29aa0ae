#include "clients/tactile/vendor.h"
#include "core/algebra/algebra.h"
#include "core/safety.h"
#include "server/clock.h"
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

// ---- the libraries' functions, after the makers' public documentation

#define DHD_FUNCTIONS(F)                                                                                               \
    F(int, dhdOpen, (void))                                                                                            \
    F(int, dhdClose, (char id))                                                                                        \
    F(const char *, dhdErrorGetLastStr, (void))                                                                        \
    F(const char *, dhdGetSystemName, (char id))                                                                       \
    F(int, dhdEnableExpertMode, (void))                                                                                \
    F(int, dhdDisableExpertMode, (void))                                                                               \
    F(int, dhdSetWatchdog, (unsigned char periods, char id))                                                           \
    F(int, dhdGetStatus, (int *status, char id))                                                                       \
    F(int, dhdEnableForce, (unsigned char on, char id))                                                                \
    F(int, dhdSetForce, (double x_n, double y_n, double z_n, char id))                                                 \
    F(int, dhdGetPosition, (double *x_m, double *y_m, double *z_m, char id))                                           \
    F(int, dhdGetOrientationFrame, (double frame[3][3], char id))                                                      \
    F(int, dhdGetLinearVelocity, (double *x_m_s, double *y_m_s, double *z_m_s, char id))                               \
    F(unsigned, dhdGetButtonMask, (char id))

typedef struct hd_error {
    unsigned code;
    int internal;
    unsigned device;
} hd_error;

#define HD_FUNCTIONS(F)                                                                                                \
    F(unsigned, hdInitDevice, (const char *name))                                                                      \
    F(void, hdDisableDevice, (unsigned device))                                                                        \
    F(hd_error, hdGetError, (void))                                                                                    \
    F(const char *, hdGetErrorString, (unsigned code))                                                                 \
    F(void, hdEnable, (unsigned what))                                                                                 \
    F(void, hdDisable, (unsigned what))                                                                                \
    F(void, hdStartScheduler, (void))                                                                                  \
    F(void, hdStopScheduler, (void))                                                                                   \
    F(unsigned long, hdScheduleAsynchronous, (unsigned (*task)(void *), void *self, unsigned short priority))          \
    F(void, hdUnschedule, (unsigned long task))                                                                        \
    F(void, hdBeginFrame, (unsigned device))                                                                           \
    F(void, hdEndFrame, (unsigned device))                                                                             \
    F(unsigned, hdCheckCalibration, (void))                                                                            \
    F(unsigned, hdCheckCalibrationStyle, (void))                                                                       \
    F(void, hdUpdateCalibration, (unsigned style))                                                                     \
    F(void, hdGetDoublev, (unsigned what, double *values))                                                             \
    F(void, hdGetIntegerv, (unsigned what, int *values))                                                               \
    F(void, hdSetDoublev, (unsigned what, const double *values))

#define POINTER(result, name, arguments) result(*name) arguments;
#define NAME(result, name, arguments) #name,
static struct {
    DHD_FUNCTIONS(POINTER)
} dhd;
static struct {
    HD_FUNCTIONS(POINTER)
} hd;
static const char *const dhd_names[] = {DHD_FUNCTIONS(NAME)}, *const hd_names[] = {HD_FUNCTIONS(NAME)};

static const struct {
    const char *file[2], *maker; // file: names under which the library is installed
    const char *const *name;
    size_t count;
    void *functions;
} libraries[] = {
    {{"libdhd.so.3", "libdhd.so"}, "the Force Dimension SDK", dhd_names, sizeof dhd_names / sizeof *dhd_names, &dhd},
    {{"libHD.so", "libHD.so.3.4"}, "OpenHaptics", hd_names, sizeof hd_names / sizeof *hd_names, &hd},
};

bool kn_vendor_load(kn_vendor_kind kind, char *error, size_t error_size)
{
    static bool loaded[2];
    const char *const *file = libraries[kind].file;
    void *library = loaded[kind] ? NULL : dlopen(file[0], RTLD_LAZY);
    // Keep the reason for the first name, which may tell of a missing dependency.
    if (!library && !loaded[kind]) {
        snprintf(error, error_size, "%s: install %s, with its folder in LD_LIBRARY_PATH", dlerror(),
                 libraries[kind].maker);
        library = dlopen(file[1], RTLD_LAZY);
    }
    for (size_t i = 0; library && i < libraries[kind].count; i++) {
        void *function = dlsym(library, libraries[kind].name[i]);
        memcpy((char *)libraries[kind].functions + i * sizeof function, &function, sizeof function);
        if (function) continue;
        snprintf(error, error_size, "%s has no function %s: install %s", file[0], libraries[kind].name[i],
                 libraries[kind].maker);
        return false;
    }
    loaded[kind] |= library != NULL;
    if (loaded[kind]) *error = 0;
    return loaded[kind];
}

// ---- frames

// Axes of the scene in the device's frame: x to the right, y forward, z up. axis: the device's axis, sign: its
// direction.
static const struct {
    int axis[3];
    double sign[3];
} frames[] = {{{1, 0, 2}, {1, -1, 1}}, {{0, 2, 1}, {1, -1, 1}}};

static void turn(kn_vendor_kind kind, const double from[3], double scale, double to[3])
{
    for (int i = 0; i < 3; i++) to[i] = scale * frames[kind].sign[i] * from[frames[kind].axis[i]];
}

// Turn a vector back into the device's frame.
static void turn_back(kn_vendor_kind kind, const double from[3], double to[3])
{
    for (int i = 0; i < 3; i++) to[frames[kind].axis[i]] = frames[kind].sign[i] * from[i];
}

// Compute the quaternion of a rotation given in the device's frame.
static void turn_orientation(kn_vendor_kind kind, double device[3][3], double q[4])
{
    double m[3][3], square[4], unscaled[4];
    const int *axis = frames[kind].axis;
    const double *sign = frames[kind].sign;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) m[i][j] = sign[i] * sign[j] * device[axis[i]][axis[j]];
    // The squares of w, x, y, z, times 4. The largest of them gives the others without a loss of digits.
    square[0] = 1 + m[0][0] + m[1][1] + m[2][2];
    for (int i = 0; i < 3; i++) square[1 + i] = 2 + 2 * m[i][i] - square[0];
    int most = 0;
    for (int i = 1; i < 4; i++) most = square[i] > square[most] ? i : most;
    const double product[4][4] = {{square[0], m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]},
                                  {m[2][1] - m[1][2], square[1], m[0][1] + m[1][0], m[0][2] + m[2][0]},
                                  {m[0][2] - m[2][0], m[0][1] + m[1][0], square[2], m[1][2] + m[2][1]},
                                  {m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], square[3]}};
    for (int i = 0; i < 4; i++) unscaled[i] = product[most][i];
    kn_turn_unit(unscaled, q);
}

// ---- libdhd: the bridge's thread reads a pose every ms, and writes each force

#define DHD_STATUS_ROOM 32 // the library writes 16 numbers, or 17 by its newer versions
#define DHD_STATUS_FORCE 5
#define DHD_WATCHDOG 160 // 20 ms in periods of 125 us: the firmware drops a force that is not renewed
#define DHD_LOOK_MS 10   // interval at which a running device is asked whether its force is on

static void lose_dhd(kn_vendor *v) { kn_bridge_lost(v->bridge, "libdhd: %s", dhd.dhdErrorGetLastStr()); }

static bool open_dhd(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_vendor *v = (kn_vendor *)device;
    v->bridge = bridge;
    if (!kn_vendor_load(v->kind, error, error_size)) return false;
    v->id = dhd.dhdOpen();
    const char id = (char)v->id, *why = dhd.dhdErrorGetLastStr();
    if (v->id < 0) {
        snprintf(error, error_size, "libdhd: %s; see knead devices", why);
        return false;
    }
    dhd.dhdEnableForce(0, id);
    v->enabled = false;
    dhd.dhdEnableExpertMode();
    const bool watched = dhd.dhdSetWatchdog(DHD_WATCHDOG, id) >= 0;
    dhd.dhdDisableExpertMode();
    if (!watched && !device->unwatched) {
        dhd.dhdClose(id);
        snprintf(error, error_size, "libdhd cannot set the device's watchdog; --no-watchdog gives force without it");
        return false;
    }
    const char *name = dhd.dhdGetSystemName(id);
    snprintf(device->state, sizeof device->state, "%.60s", name ? name : "");
    device->watchdog = device->unwatched ? KN_OWN_TRUSTED : KN_OWN_UNPROVED;
    return true;
}

static void close_dhd(kn_tactile *device)
{
    const char id = (char)((kn_vendor *)device)->id;
    dhd.dhdEnableForce(0, id);
    dhd.dhdClose(id);
}

static void tick_dhd(kn_tactile *device, int elapsed_ms)
{
    kn_vendor *v = (kn_vendor *)device;
    const char id = (char)v->id;
    kn_tactile_pose pose;
    double x[3], speed[3] = {0}, frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    int status[DHD_STATUS_ROOM] = {0};
    bool ok = dhd.dhdGetPosition(x, x + 1, x + 2, id) >= 0;
    if (device->watchdog == KN_OWN_UNPROVED || (v->look_ms += elapsed_ms) >= DHD_LOOK_MS) {
        ok &= dhd.dhdGetStatus(status, id) >= 0;
        v->look_ms = 0;
        device->motors = status[DHD_STATUS_FORCE];
        // The firmware, or the device's button, has switched the force off. Opened again, the device begins at 0 N.
        if (ok && device->watchdog == KN_OWN_TRUSTED && v->enabled && !device->motors)
            kn_bridge_lost(v->bridge, "it has switched its force off");
        if (device->watchdog == KN_OWN_UNPROVED) v->enabled = device->motors;
    }
    if (!ok) {
        lose_dhd(v);
        return;
    }
    // A speed needs two positions, so it is missing at first. A device without a wrist has no orientation.
    dhd.dhdGetLinearVelocity(speed, speed + 1, speed + 2, id);
    dhd.dhdGetOrientationFrame(frame, id);
    turn(v->kind, x, 1, pose.position_m);
    turn(v->kind, speed, 1, pose.velocity_m_s);
    turn_orientation(v->kind, frame, pose.orientation_wxyz);
    pose.buttons = (int32_t)dhd.dhdGetButtonMask(id);
    device->messages++;
    kn_bridge_moved(v->bridge, &pose);
}

static void give_dhd(kn_tactile *device, const double force_n[3], bool live)
{
    kn_vendor *v = (kn_vendor *)device;
    double f[3];
    turn_back(v->kind, force_n, f);
    bool ok = true;
    if (live != v->enabled) {
        ok = dhd.dhdEnableForce(live, (char)v->id) >= 0;
        v->look_ms = 0; // the status follows after a while
    }
    v->enabled = live;
    if (live) ok &= dhd.dhdSetForce(f[0], f[1], f[2], (char)v->id) >= 0;
    if (!ok) lose_dhd(v);
}

// ---- libHD: its thread reads a pose and writes a force in each of its periods

#define HD_BUTTONS 0x2000
#define HD_VELOCITY 0x2051
#define HD_TRANSFORM 0x2052
#define HD_FORCE 0x2700
#define HD_FORCE_OUTPUT 0x4000
#define HD_CALIBRATED 0x5000
#define HD_CALIBRATION_OLD 0x5001
#define HD_CALIBRATION_AUTO 4u
#define HD_CALIBRATION_INKWELL 2u
#define HD_NO_DEVICE 0xffffffffu
#define HD_PRIORITY 32767
#define HD_GOES_ON 1u
#define HD_STANDSTILL_MS 20                       // longest time without a period after which a force may go on
#define HD_REFUSES_FORCE(code) ((code) >> 8 == 2) // the arm is well, but its motors are warm, or a force was too large

// Return the oldest error of libHD, and remove all.
static unsigned take_error(void)
{
    unsigned first = 0, code;
    for (int i = 0; i < 100 && (code = hd.hdGetError().code); i++) first = code;
    return first; // libHD returns the newest error first
}

// Read the arm, in a frame of libHD. Return whether the arm is calibrated. `calm`: the motors are off, so a new
// calibration is allowed.
static bool read_arm(kn_vendor_kind kind, bool calm, kn_tactile_pose *pose)
{
    double speed[3] = {0}, frame[16] = {0}, rotation[3][3];
    const unsigned calibration = hd.hdCheckCalibration();
    if (calibration == HD_CALIBRATION_OLD && calm) {
        const unsigned styles = hd.hdCheckCalibrationStyle();
        if (styles & HD_CALIBRATION_AUTO) hd.hdUpdateCalibration(HD_CALIBRATION_AUTO);
        else if (styles & HD_CALIBRATION_INKWELL) hd.hdUpdateCalibration(HD_CALIBRATION_INKWELL);
    }
    hd.hdGetDoublev(HD_TRANSFORM, frame); // column by column; the last column is the position
    hd.hdGetDoublev(HD_VELOCITY, speed);
    hd.hdGetIntegerv(HD_BUTTONS, &pose->buttons);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) rotation[i][j] = frame[4 * j + i];
    turn(kind, frame + 12, 1e-3, pose->position_m);
    turn(kind, speed, 1e-3, pose->velocity_m_s);
    turn_orientation(kind, rotation, pose->orientation_wxyz);
    return calibration == HD_CALIBRATED;
}

// Write a force, in a frame of libHD. live false: switch the motors off.
static void write_arm(kn_vendor *v, const double force_n[3], bool live)
{
    if (live != v->enabled) (live ? hd.hdEnable : hd.hdDisable)(HD_FORCE_OUTPUT);
    v->enabled = live;
    hd.hdSetDoublev(HD_FORCE, force_n);
}

static unsigned serve_hd(void *self)
{
    kn_vendor *v = self;
    kn_tactile_pose pose = {0};
    double force[3];
    const int64_t now_ns = kn_now_ns(), elapsed_ms = (now_ns - v->served_ns + 500000) / 1000000;
    v->served_ns = now_ns;
    hd.hdBeginFrame((unsigned)v->id);
    const bool warm = read_arm(v->kind, !v->enabled, &pose);
    const unsigned read_error = take_error();

    // Exchange pose and force with the bridge. The watchdog fades the force if the bridge's thread, or the whole
    // program, stands still. A force of before a standstill is not given any more.
    pthread_mutex_lock(&v->lock);
    if (!read_error) v->pose = pose, v->fresh_pose = true;
    if (read_error) v->error = read_error;
    v->cold = !warm;
    v->dropped = v->live && (v->dropped || !warm || read_error || elapsed_ms >= HD_STANDSTILL_MS);
    const bool live = v->live && !v->dropped;
    if (!v->live) kn_watchdog_rearm(&v->watchdog);
    const double factor = kn_watchdog_tick(&v->watchdog, v->fresh_force, elapsed_ms < 1000 ? (int)elapsed_ms : 1000);
    v->fresh_force = false;
    turn_back(v->kind, v->force_n, force);
    pthread_mutex_unlock(&v->lock);

    for (int i = 0; i < 3; i++) force[i] *= live ? factor : 0;
    write_arm(v, force, live);
    hd.hdEndFrame((unsigned)v->id);
    const unsigned write_error = take_error();
    pthread_mutex_lock(&v->lock);
    if (write_error) v->error = write_error;
    pthread_mutex_unlock(&v->lock);
    return HD_GOES_ON;
}

// Stop libHD's thread, then switch the motors off in a last frame.
static void close_hd(kn_tactile *device)
{
    kn_vendor *v = (kn_vendor *)device;
    hd.hdStopScheduler();
    hd.hdUnschedule(v->task);
    hd.hdBeginFrame((unsigned)v->id);
    write_arm(v, (double[3]){0}, false);
    hd.hdEndFrame((unsigned)v->id);
    hd.hdDisableDevice((unsigned)v->id);
}

static bool open_hd(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_vendor *v = (kn_vendor *)device;
    v->bridge = bridge;
    if (!kn_vendor_load(v->kind, error, error_size)) return false;
    take_error(); // of the time before a loss
    const unsigned id = hd.hdInitDevice(v->device);
    unsigned why = take_error();
    if (id != HD_NO_DEVICE && !why) {
        v->id = (int)id;
        v->enabled = v->live = v->fresh_pose = v->dropped = false;
        v->error = 0;
        v->served_ns = kn_now_ns();
        kn_watchdog_init(&v->watchdog, 0, 0);
        v->task = hd.hdScheduleAsynchronous(serve_hd, v, HD_PRIORITY);
        hd.hdStartScheduler();
        device->watchdog = device->unwatched ? KN_OWN_TRUSTED : KN_OWN_MISSING;
        return true;
    }
    if (id != HD_NO_DEVICE) hd.hdDisableDevice(id);
    snprintf(error, error_size, "libHD: %s (0x%04x); see knead devices", hd.hdGetErrorString(why), why);
    return false;
}

static void tick_hd(kn_tactile *device, int elapsed_ms)
{
    kn_vendor *v = (kn_vendor *)device;
    (void)elapsed_ms;
    pthread_mutex_lock(&v->lock);
    const kn_tactile_pose pose = v->pose;
    const bool fresh = v->fresh_pose, cold = v->cold;
    const unsigned error = v->error;
    v->fresh_pose = false;
    v->error = 0;
    pthread_mutex_unlock(&v->lock);
    if (HD_REFUSES_FORCE(error)) kn_tactile_bad(device, "libHD: %s", hd.hdGetErrorString(error));
    else if (error) kn_bridge_lost(v->bridge, "libHD: %s", hd.hdGetErrorString(error));
    snprintf(device->state, sizeof device->state, "%s", cold ? "not calibrated: put the stylus into its inkwell" : "");
    if (!fresh || cold) return;
    device->messages++;
    kn_bridge_moved(v->bridge, &pose);
}

static void give_hd(kn_tactile *device, const double force_n[3], bool live)
{
    kn_vendor *v = (kn_vendor *)device;
    pthread_mutex_lock(&v->lock);
    memcpy(v->force_n, force_n, sizeof v->force_n);
    v->live = live;
    v->fresh_force = true;
    pthread_mutex_unlock(&v->lock);
}

void kn_vendor_init(kn_vendor *v, kn_vendor_kind kind, const char *device)
{
    static const kn_tactile drivers[] = {
        {.name = "forcedimension", .open = open_dhd, .close = close_dhd, .tick = tick_dhd, .give = give_dhd},
        {.name = "touch", .open = open_hd, .close = close_hd, .tick = tick_hd, .give = give_hd}};
    *v = (kn_vendor){.base = drivers[kind], .kind = kind, .device = device};
    // libHD's thread may have a lower priority than the bridge's, which must not wait for it.
    pthread_mutexattr_t inherits;
    pthread_mutexattr_init(&inherits);
    pthread_mutexattr_setprotocol(&inherits, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&v->lock, &inherits);
    pthread_mutexattr_destroy(&inherits);
}
