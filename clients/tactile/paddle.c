#include "clients/tactile/paddle.h"
#include "server/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

// ---- frames

static const uint8_t frame_begin[2] = {'K', 'N'};

uint16_t kn_paddle_frame_crc(const uint8_t *bytes, size_t size)
{
    // Compute the CRC bit by bit, because a table would save at most 2 us in each ms.
    unsigned crc = 0xffff;
    for (size_t i = 0; i < size; i++) {
        crc ^= (unsigned)bytes[i] << 8;
        for (int bit = 0; bit < 8; bit++) crc = (crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1) & 0xffff;
    }
    return (uint16_t)crc;
}

// Clamp instead of casting directly: casting a NaN or an out-of-range double is undefined in C.
int32_t kn_paddle_frame_number(double value, double unit)
{
    double n = rint(value / unit);
    if (isnan(n)) return 0;
    return n >= INT32_MAX ? INT32_MAX : n <= INT32_MIN ? INT32_MIN : (int32_t)n;
}

// Write and read single bytes, so that the code does not depend on the host's byte order.
static void put32(uint8_t *at, int32_t value)
{
    for (int i = 0; i < 4; i++) at[i] = (uint8_t)((uint32_t)value >> 8 * i);
}

static void put16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static uint16_t get16(const uint8_t *at) { return (uint16_t)(at[0] | at[1] << 8); }

static int32_t get32(const uint8_t *at) { return (int32_t)((uint32_t)get16(at) | (uint32_t)get16(at + 2) << 16); }

void kn_paddle_frame_encode(const kn_paddle_frame *frame, uint8_t bytes[KN_PADDLE_FRAME_SIZE])
{
    memcpy(bytes, frame_begin, sizeof frame_begin);
    bytes[2] = (uint8_t)frame->kind;
    bytes[3] = frame->flags;
    put16(bytes + 4, frame->seq);
    put32(bytes + 6, frame->position_nm);
    put32(bytes + 10, frame->velocity_um_s);
    put32(bytes + 14, frame->force_un);
    put16(bytes + 18, kn_paddle_frame_crc(bytes, 18));
}

// Drop the first byte of the buffer and all following bytes that cannot begin a frame.
static void skip(kn_paddle_decoder *d)
{
    int at = 1;
    while (at < d->count &&
           (d->bytes[at] != frame_begin[0] || (at + 1 < d->count && d->bytes[at + 1] != frame_begin[1])))
        at++;
    d->skipped += at;
    d->count -= at;
    memmove(d->bytes, d->bytes + at, (size_t)d->count);
}

bool kn_paddle_decoder_push(kn_paddle_decoder *d, uint8_t byte, kn_paddle_frame *frame)
{
    const uint8_t *b = d->bytes;
    d->bytes[d->count++] = byte;
    // The buffer must begin with the letters K N, or with K if it has one byte. skip() drops all other bytes.
    if (b[0] != frame_begin[0] || (d->count > 1 && b[1] != frame_begin[1])) skip(d);
    if (d->count < KN_PADDLE_FRAME_SIZE) return false;
    // If checksum or kind is wrong, search for the next frame inside the bytes already read.
    if (get16(b + 18) != kn_paddle_frame_crc(b, 18) || b[2] != d->kind) {
        d->bad++;
        skip(d);
        return false;
    }
    *frame = (kn_paddle_frame){.kind = d->kind,
                               .flags = b[3],
                               .seq = get16(b + 4),
                               .position_nm = get32(b + 6),
                               .velocity_um_s = get32(b + 10),
                               .force_un = get32(b + 14)};
    d->count = 0;
    uint16_t gap = (uint16_t)(frame->seq - d->seq - 1);
    // If seq jumps by half its range or more, the sender has restarted its counter, so count no lost frames.
    if (d->frames++ > 0 && gap < 0x8000) d->lost += gap;
    d->seq = frame->seq;
    return true;
}

// ---- driver

// Largest number of bytes that may wait in the serial line when a command is sent. With more waiting bytes, the command
// would reach the motor too late.
static const int waiting_most = 2 * KN_PADDLE_FRAME_SIZE;

static const struct {
    int baud;
    speed_t speed;
} speeds[] = {{230400, B230400},   {460800, B460800},   {500000, B500000},   {576000, B576000},   {921600, B921600},
              {1000000, B1000000}, {1500000, B1500000}, {2000000, B2000000}, {3000000, B3000000}, {4000000, B4000000}};

static speed_t speed_of(int baud)
{
    for (size_t i = 0; i < sizeof speeds / sizeof *speeds; i++)
        if (speeds[i].baud == baud) return speeds[i].speed;
    return B0;
}

bool kn_paddle_baud_known(int baud) { return speed_of(baud) != B0; }

// Proof: a test of the paddle's own watchdog. Times count from the opening of the line:
//
//     0 ms    send commands without enable
//     10 ms   send commands with enable, 0 N
//     30 ms   send nothing; the paddle's watchdog should trip by 50 ms
//     130 ms  the paddle must have reported the trip
//
// The test (proof) starts again if this thread was late, or if the paddle never reported that its motor was on.
#define ENABLED_NS 10000000
#define SILENT_NS 30000000  // time at which the commands of the watchdog test end and its silence begins
#define JUDGED_NS 130000000 // latest time at which the paddle must have reported the trip of its watchdog
#define LATE_NS 5000000     // largest gap between two commands of a watchdog test; a longer gap restarts the test
#define PROOFS 5            // number of attempts of the test before the watchdog is judged missing

static void begin_proof(kn_paddle *p)
{
    p->armed = false;
    p->proofs++;
    p->begun_ns = p->given_ns = kn_now_ns();
}

// Advance the watchdog test (proof) with a state frame of the paddle.
static void judge_watchdog(kn_paddle *p, const kn_paddle_frame *f)
{
    bool tripped = f->flags & KN_PADDLE_FRAME_TRIPPED;
    int64_t age_ns = kn_now_ns() - p->begun_ns;
    // When the watchdog test (proof) has succeeded, `armed` stays set until a command without enable has cleared the
    // trip.
    p->armed &= tripped || p->base.watchdog == KN_OWN_UNPROVED;
    if (p->base.watchdog != KN_OWN_UNPROVED) return;
    // If the paddle reports a trip during the silence, its watchdog is proved. If the paddle reports no trip by
    // JUDGED_NS, it has no watchdog. If the paddle never reported that its motor was on, start the test again. After
    // PROOFS tests, judge that the paddle has no watchdog.
    if (age_ns > ENABLED_NS && age_ns <= SILENT_NS && !tripped && f->flags & KN_PADDLE_FRAME_MOTOR) p->armed = true;
    if (age_ns > SILENT_NS && p->armed && tripped) p->base.watchdog = KN_OWN_TRUSTED;
    else if (age_ns > JUDGED_NS && (p->armed || p->proofs == PROOFS)) p->base.watchdog = KN_OWN_MISSING;
    else if (age_ns > JUDGED_NS) begin_proof(p);
}

// Return true if the watchdog test (proof) needs a command now. Set *live if this command must have the flag enable.
static bool prove(kn_paddle *p, bool *live)
{
    int64_t now_ns = kn_now_ns(), age_ns = now_ns - p->begun_ns;
    // If this thread was late with its last command, the result of the test would mean nothing, so begin the test
    // again.
    if (age_ns <= SILENT_NS && now_ns - p->given_ns > LATE_NS) begin_proof(p), age_ns = 0;
    p->given_ns = now_ns;
    *live = age_ns > ENABLED_NS;
    return age_ns <= SILENT_NS;
}

// Pass a state frame to the bridge as a pose, and describe the state of the paddle in words for the user.
static void take(kn_paddle *p, const kn_paddle_frame *f)
{
    judge_watchdog(p, f);
    kn_tactile_pose pose = {.orientation_wxyz = {1.0}, .buttons = f->flags >> 4};
    pose.position_m[2] = 1e-9 * f->position_nm;
    pose.velocity_m_s[2] = 1e-6 * f->velocity_um_s;
    p->base.messages++;
    snprintf(p->base.state, sizeof p->base.state, "motor %s%s%s%s", f->flags & KN_PADDLE_FRAME_MOTOR ? "on" : "off",
             f->flags & KN_PADDLE_FRAME_TRIPPED ? ", paddle's watchdog tripped" : "",
             f->flags & KN_PADDLE_FRAME_SATURATED ? ", saturated" : "", p->held_back ? ", serial line too slow" : "");
    kn_bridge_moved(p->bridge, &pose);
}

static void on_readable(struct ev_loop *ev, ev_io *watcher, int events)
{
    (void)ev, (void)events;
    kn_paddle *p = watcher->data;
    uint8_t bytes[256];
    kn_paddle_frame frame, newest = {0};
    // Read waiting bytes, at most 256 at a time. An error or the end of the file means that the serial line is gone.
    ssize_t size = read(p->fd, bytes, sizeof bytes);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (size <= 0) {
        ev_io_stop(ev, watcher);
        kn_bridge_lost(p->bridge, "%s: %s", p->tty, size < 0 ? strerror(errno) : "hung up");
        return;
    }
    kn_paddle_decoder *d = &p->deframer;
    int64_t skipped = d->skipped;
    for (ssize_t i = 0; i < size; i++)
        // Keep the newest frame only, because older frames are out of date after a stall.
        if (kn_paddle_decoder_push(d, bytes[i], &frame)) newest = frame;
    if (d->skipped != skipped)
        kn_tactile_bad(&p->base, "%lld bytes that are not part of a frame, %lld wrong checksums so far",
                       (long long)d->skipped, (long long)d->bad);
    p->base.lost = d->lost;
    if (newest.kind) take(p, &newest);
}

// Set the line to raw 8N1 without flow control, with low latency. Return false if this fails; errno then has the
// reason.
static bool setup(int fd, int baud)
{
    struct termios t;
    if (tcgetattr(fd, &t) != 0) return false;
    cfmakeraw(&t);
    // Clear HUPCL, which would reset many boards whenever a program closes the line.
    t.c_cflag &= (tcflag_t) ~(CSTOPB | PARENB | CRTSCTS | HUPCL);
    t.c_cflag |= CS8 | CLOCAL | CREAD;
    if (cfsetspeed(&t, speed_of(baud)) != 0 || tcsetattr(fd, TCSANOW, &t) != 0) return false;
    // Request low latency, because USB adapters otherwise collect bytes for up to 16 ms. Ignore a failure: a line that
    // rejects the request does not collect bytes.
    struct serial_struct line;
    if (ioctl(fd, TIOCGSERIAL, &line) == 0) {
        line.flags = (int)((unsigned)line.flags | ASYNC_LOW_LATENCY);
        ioctl(fd, TIOCSSERIAL, &line);
    }
    return tcflush(fd, TCIOFLUSH) == 0;
}

static bool open_paddle(kn_tactile *device, kn_bridge *bridge, char *error, size_t error_size)
{
    kn_paddle *p = (kn_paddle *)device;
    p->bridge = bridge;
    p->fd = open(p->tty, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    // TIOCEXCL: no second program may open the line while this program drives the motor.
    if (p->fd < 0 || ioctl(p->fd, TIOCEXCL) != 0 || !setup(p->fd, p->baud)) {
        snprintf(error, error_size, "%s: %s%s; knead devices lists the serial lines", p->tty,
                 errno == ENOTTY ? "no serial line" : strerror(errno),
                 errno == EACCES ? ", join the group dialout" : "");
        if (p->fd >= 0) close(p->fd);
        return false;
    }
    // After each opening, empty the decoder and begin a watchdog test.
    p->deframer.count = 0;
    p->base.watchdog = p->unwatched ? KN_OWN_TRUSTED : KN_OWN_UNPROVED;
    p->proofs = 0;
    begin_proof(p);
    ev_io_init(&p->readable, on_readable, p->fd, EV_READ);
    p->readable.data = p;
    ev_io_start(bridge->ev, &p->readable);
    return true;
}

static void close_paddle(kn_tactile *device)
{
    kn_paddle *p = (kn_paddle *)device;
    ev_io_stop(p->bridge->ev, &p->readable);
    close(p->fd);
}

// Send a force command, or the next command of the watchdog test (proof).
static void give(kn_tactile *device, const double force_n[3], bool live)
{
    kn_paddle *p = (kn_paddle *)device;
    uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    int waiting = 0;
    // During the watchdog test (proof), send only the commands of the test, with 0 N. After the test, do not set the
    // flag enable in any command until the trip is cleared.
    if (p->base.watchdog != KN_OWN_UNPROVED) live &= !p->armed;
    else if (!prove(p, &live)) return;
    else force_n = (double[3]){0};
    // Skip this command if too many bytes wait in the serial line, because a waiting command would reach the motor
    // late.
    if (ioctl(p->fd, TIOCOUTQ, &waiting) == 0 && waiting > waiting_most) {
        p->held_back++;
        return;
    }
    kn_paddle_frame_encode(&(kn_paddle_frame){.kind = KN_PADDLE_FRAME_COMMAND,
                                              .flags = live ? KN_PADDLE_FRAME_ENABLE : 0,
                                              .seq = p->seq++,
                                              .force_un = kn_paddle_frame_number(force_n[2], 1e-6)},
                           bytes);
    if (write(p->fd, bytes, sizeof bytes) < 0 && errno != EAGAIN && errno != EINTR)
        kn_bridge_lost(p->bridge, "%s: %s", p->tty, strerror(errno));
}

void kn_paddle_init(kn_paddle *p, const char *tty, int baud, bool unwatched)
{
    *p = (kn_paddle){.base = {.name = "paddle", .open = open_paddle, .close = close_paddle, .give = give},
                     .tty = tty,
                     .baud = baud,
                     .unwatched = unwatched,
                     .fd = -1,
                     .deframer.kind = KN_PADDLE_FRAME_STATE};
}
