// The makers' libraries libdhd and libHD over the simulated paddle of tool_paddle.c, whose tty is $KN_VENDOR_TTY: the
// functions that clients/tactile/vendor.c loads, with the frames, units and threads of the real ones. The device is
// another process with its own watchdog, so it runs on when the program is killed. A device that is not there, or that
// is unplugged, gives errors.
#include "clients/tactile/paddle.h"
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int fd = -1;
static kn_paddle_decoder decoder;
static kn_paddle_frame now;
static uint16_t seq;
static bool enabled, expert;
static int speeds; // number of speeds asked for since the device was opened

static bool hang_up(void)
{
    if (fd >= 0) close(fd);
    fd = -1;
    return false;
}

static bool write_command(bool enable, double force_n)
{
    uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    kn_paddle_frame_encode(&(kn_paddle_frame){.kind = KN_PADDLE_FRAME_COMMAND,
                                              .flags = enable ? KN_PADDLE_FRAME_ENABLE : 0,
                                              .seq = seq++,
                                              .force_un = kn_paddle_frame_number(force_n, 1e-6)},
                           bytes);
    return write(fd, bytes, sizeof bytes) == sizeof bytes || (fd >= 0 && errno == EAGAIN) || hang_up();
}

static bool read_state(void)
{
    uint8_t bytes[512];
    kn_paddle_frame f;
    ssize_t size = fd < 0 ? 0 : read(fd, bytes, sizeof bytes);
    if (size < 0 && errno == EAGAIN) return true;
    for (ssize_t i = 0; i < size; i++)
        if (kn_paddle_decoder_push(&decoder, bytes[i], &f)) now = f;
    return size > 0 || hang_up();
}

static bool plug_in(void)
{
    const char *tty = getenv("KN_VENDOR_TTY");
    hang_up();
    fd = tty ? open(tty, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC) : -1;
    decoder = (kn_paddle_decoder){.kind = KN_PADDLE_FRAME_STATE};
    now = (kn_paddle_frame){0};
    enabled = false;
    speeds = 0;
    return fd >= 0 && write_command(false, 0);
}

static double height_m(void) { return 1e-9 * now.position_nm; }

// ---- libdhd

int dhdOpen(void) { return plug_in() ? 0 : -1; }
int dhdClose(char id) { return (void)id, hang_up(), 0; }
const char *dhdErrorGetLastStr(void) { return fd < 0 ? "no device found" : "no error"; }
const char *dhdGetSystemName(char id) { return (void)id, "omega.3"; }
int dhdEnableExpertMode(void) { return expert = true, 0; }
int dhdDisableExpertMode(void) { return expert = false, 0; }
// The watchdog of the simulated device is 20 ms long and cannot be set.
int dhdSetWatchdog(unsigned char periods, char id) { return (void)id, expert && periods == 160 ? 0 : -1; }

int dhdGetStatus(int *status, char id)
{
    (void)id;
    memset(status, 0, 17 * sizeof *status);        // as newer versions do
    status[5] = now.flags & KN_PADDLE_FRAME_MOTOR; // force
    return read_state() ? 0 : -1;
}

int dhdEnableForce(unsigned char on, char id)
{
    (void)id;
    enabled = on;
    return write_command(false, 0) ? 0 : -1; // ends a trip of the watchdog
}

int dhdSetForce(double x_n, double y_n, double z_n, char id)
{
    (void)x_n, (void)y_n, (void)id;
    return write_command(enabled, z_n) ? 0 : -1;
}

// The device is 1 cm away from the user and 5 mm to the right, and turned by 90 degrees about the vertical axis.
int dhdGetPosition(double *x_m, double *y_m, double *z_m, char id)
{
    (void)id;
    *x_m = -0.01;
    *y_m = 0.005;
    *z_m = height_m();
    return read_state() ? 1 : -1; // 1: DHD_TIMEGUARD, which is no error
}

int dhdGetOrientationFrame(double frame[3][3], char id)
{
    const double turned[3][3] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
    (void)id;
    memcpy(frame, turned, sizeof turned);
    return 0;
}

int dhdGetLinearVelocity(double *x_m_s, double *y_m_s, double *z_m_s, char id)
{
    (void)id;
    if (speeds++ < 2) return -1; // not enough positions yet
    *x_m_s = *y_m_s = 0;
    *z_m_s = 1e-6 * now.velocity_um_s;
    return 0;
}

unsigned dhdGetButtonMask(char id) { return (void)id, 2; } // button 0 would be the clutch

// ---- libHD

typedef struct hd_error {
    unsigned code;
    int internal;
    unsigned device;
} hd_error;

static unsigned (*task)(void *), pending;
static void *task_self;
static double force_n[3];
static pthread_t scheduler;
static atomic_bool ending;

unsigned hdInitDevice(const char *name)
{
    if ((!name || !strcmp(name, "Right Device")) && plug_in()) return 7;
    pending = 0x0302; // HD_COMM_ERROR
    return 0xffffffffu;
}

void hdDisableDevice(unsigned device) { (void)device, hang_up(); }

hd_error hdGetError(void)
{
    const hd_error error = {pending, 0, 7};
    pending = 0;
    return error;
}

const char *hdGetErrorString(unsigned code) { return code == 0x0302 ? "HD_COMM_ERROR" : "HD_FORCE_ERROR"; }

void hdEnable(unsigned what) { enabled |= what == 0x4000; }

void hdDisable(unsigned what)
{
    if (what == 0x4000) enabled = false;
}

static void *schedule(void *none)
{
    while (!atomic_load(&ending)) {
        task(task_self);
        usleep(1000);
    }
    return none;
}

unsigned long hdScheduleAsynchronous(unsigned (*served)(void *), void *self, unsigned short priority)
{
    (void)priority;
    task = served;
    task_self = self;
    return 1;
}

void hdUnschedule(unsigned long number) { (void)number; }

void hdStartScheduler(void)
{
    atomic_store(&ending, false);
    if (pthread_create(&scheduler, NULL, schedule, NULL) != 0) abort();
}

void hdStopScheduler(void)
{
    atomic_store(&ending, true);
    pthread_join(scheduler, NULL);
}

void hdBeginFrame(unsigned device)
{
    (void)device;
    if (!read_state()) pending = 0x0302;
}

void hdEndFrame(unsigned device)
{
    (void)device;
    if (fd < 0 || !write_command(enabled, force_n[1])) pending = 0x0302; // y is up
}

unsigned hdCheckCalibration(void) { return 0x5000; }
unsigned hdCheckCalibrationStyle(void) { return 1; }
void hdUpdateCalibration(unsigned style) { (void)style; }

void hdGetDoublev(unsigned what, double *values)
{
    memset(values, 0, (what == 0x2052 ? 16 : 3) * sizeof *values);
    if (what == 0x2052) {
        const double turned[16] = {0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 5, 1e3 * height_m(), -10, 1};
        memcpy(values, turned, sizeof turned);
    } else if (what == 0x2051) {
        values[1] = 1e-3 * now.velocity_um_s;
    }
}

void hdGetIntegerv(unsigned what, int *values) { *values = what == 0x2000 ? 2 : 0; }

void hdSetDoublev(unsigned what, const double *values)
{
    if (what == 0x2700) memcpy(force_n, values, sizeof force_n);
}
