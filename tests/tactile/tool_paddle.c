// A simulated paddle: mass, friction, encoder, motor and a person behind a pty. Its firmware is like the one that
// clients/tactile/README.md asks for. For tests, and for users without a paddle.
//
//     paddle LINK SECONDS [EVENT=MS[:MS]]...     LINK becomes the name of its tty; times since the first command came
//
// The person comes down 35 mm in 1 s, rests, and lifts, every 4 s. CSV on stdout, one row per ms, reports the
// firmware. In the time that this process could not run, the person and the mass move on, and the firmware misses
// that time.
//     garbage=MS      from then on 7 random bytes before every tenth frame
//     flip=MS         from then on one bit of every tenth frame is wrong
//     mute=MS:MS      from then on, for so long, no frames are sent
//     hangup=MS:MS    from then on, for so long, the line is gone
//     unwatched=0     there is no watchdog
#include "clients/hand/haptic_loop.h"
#include "clients/hand/bus_client.h"
#include "clients/tactile/paddle.h"
#include "core/safety.h"
#include "server/clock.h"
#include "tests/tactile/person.h"
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

typedef struct span {
    int from_ms, for_ms; // for_ms 0: for ever
} span;

typedef struct paddle {
    const char *link;
    int fd, keep; // master; slave, held open so that a leaving computer does not hang up the line
    span garbage, flip, mute, hangup, unwatched;
    kn_held_device arm;
    kn_paddle_decoder deframer;
    kn_watchdog watchdog;
    double asked_n, given_n;
    bool enabled;
    uint16_t seq, heard; // seq of its own frames; seq of the newest command
    unsigned random;
} paddle;

static bool in(const span *s, int ms)
{
    return s->from_ms >= 0 && ms >= s->from_ms && (s->for_ms == 0 || ms < s->from_ms + s->for_ms);
}

static bool plug_in(paddle *p)
{
    struct termios t;
    char name[64];
    p->fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (p->fd < 0 || grantpt(p->fd) || unlockpt(p->fd) || ptsname_r(p->fd, name, sizeof name)) return false;
    p->keep = open(name, O_RDWR | O_NOCTTY);
    if (p->keep < 0 || tcgetattr(p->keep, &t)) return false;
    cfmakeraw(&t);
    unlink(p->link);
    return tcsetattr(p->keep, TCSANOW, &t) == 0 && symlink(name, p->link) == 0;
}

static void plug_out(paddle *p)
{
    unlink(p->link);
    close(p->keep);
    close(p->fd);
    p->fd = -1;
}

// ---- the firmware

static void listen_to_computer(paddle *p, int elapsed_ms)
{
    uint8_t bytes[512];
    kn_paddle_frame f;
    bool fresh = false;
    ssize_t size = p->fd < 0 ? 0 : read(p->fd, bytes, sizeof bytes);
    for (ssize_t i = 0; i < size; i++) {
        if (!kn_paddle_decoder_push(&p->deframer, bytes[i], &f)) continue;
        bool enable = f.flags & KN_PADDLE_FRAME_ENABLE, newer = (int16_t)(f.seq - p->heard) > 0;
        if (enable && !newer) continue; // repeated, or of another run: no sign of life
        fresh = true;
        p->heard = f.seq;
        p->enabled = enable;
        p->asked_n = 1e-6 * f.force_un;
        if (!p->enabled && p->watchdog.tripped) kn_watchdog_rearm(&p->watchdog);
    }
    double factor = kn_watchdog_tick(&p->watchdog, fresh || in(&p->unwatched, 0), elapsed_ms);
    p->given_n = p->enabled ? factor * p->asked_n : 0.0;
}

static void tell_computer(paddle *p, int ms)
{
    uint8_t bytes[7 + KN_PADDLE_FRAME_SIZE];
    bool tenth = p->seq % 10 == 0, tripped = p->watchdog.tripped;
    int flags = (p->enabled && !tripped ? KN_PADDLE_FRAME_MOTOR : 0) | (tripped ? KN_PADDLE_FRAME_TRIPPED : 0);
    size_t before = tenth && in(&p->garbage, ms) ? 7 : 0;
    for (size_t i = 0; i < before; i++) bytes[i] = (uint8_t)(rand_r(&p->random) >> 7);
    kn_paddle_frame_encode(&(kn_paddle_frame){.kind = KN_PADDLE_FRAME_STATE,
                                              .seq = p->seq++,
                                              .flags = (uint8_t)flags,
                                              .position_nm = kn_paddle_frame_number(p->arm.position_m[2], 1e-9),
                                              .velocity_um_s = kn_paddle_frame_number(p->arm.velocity_m_s[2], 1e-6),
                                              .force_un = kn_paddle_frame_number(p->given_n, 1e-6)},
                           bytes + before);
    if (tenth && in(&p->flip, ms)) bytes[before + p->seq / 10 % KN_PADDLE_FRAME_SIZE] ^= (uint8_t)(1 << ms / 200 % 8);
    if (p->fd < 0 || in(&p->mute, ms)) return;
    if (write(p->fd, bytes, before + KN_PADDLE_FRAME_SIZE) < 0) return; // the line is full because no program reads
}

static bool option(paddle *p, const char *text)
{
    const struct {
        const char *name;
        span *span;
    } known[] = {{"garbage", &p->garbage},
                 {"flip", &p->flip},
                 {"mute", &p->mute},
                 {"hangup", &p->hangup},
                 {"unwatched", &p->unwatched}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        size_t n = strlen(known[i].name);
        if (!strncmp(text, known[i].name, n) && text[n] == '=')
            return sscanf(text + n, "=%d:%d", &known[i].span->from_ms, &known[i].span->for_ms) >= 1;
    }
    return false;
}

int main(int argc, char **argv)
{
    const span never = {-1, 0};
    paddle p = {.garbage = never,
                .flip = never,
                .mute = never,
                .hangup = never,
                .unwatched = never,
                .fd = -1,
                .random = 1,
                .deframer.kind = KN_PADDLE_FRAME_COMMAND};
    // A Hapkit at the handle: some 40 g felt, little friction, an encoder step of 15 um, 5 N at most.
    const kn_held_device_def def = {.mass_kg = 0.04,
                                    .damping_n_s_m = 0.1,
                                    .coulomb_n = 0.05,
                                    .encoder_m = 15e-6,
                                    .force_limit_n = 5.0,
                                    .axes = 1,
                                    .grip = KN_GRIP_NORMAL};
    int seconds = argc > 2 ? atoi(argv[2]) : 0;
    for (int i = 3; i < argc; i++)
        if (!option(&p, argv[i])) return fprintf(stderr, "paddle: %s?\n", argv[i]), 2;
    if (seconds <= 0) return fprintf(stderr, "usage: paddle LINK SECONDS [EVENT=MS[:MS]]...\n"), 2;
    p.link = argv[1];
    if (!plug_in(&p)) return fprintf(stderr, "paddle: no pty\n"), 3;
    kn_held_device_init(&p.arm, &def, (double[3]){0});
    kn_watchdog_init(&p.watchdog, 0, 0);

    kn_clock clock;
    kn_bus_client_priority(
        60); // a microcontroller has no other work; without priority the paddle is as late as any process
    kn_clock_start(&clock, kn_now_ns());
    setvbuf(stdout, NULL, _IOLBF, 0); // a reader sees each ms at once
    printf("ms,z_m,asked_n,given_n,enabled,tripped,commands,bad,skipped\n");
    for (int ms = 0; ms < 1000 * seconds;) {
        int elapsed_ms = 1 + kn_clock_wait(&clock).missed;
        if (in(&p.hangup, ms) && p.fd >= 0) plug_out(&p);
        if (!in(&p.hangup, ms) && p.fd < 0 && !plug_in(&p)) return 3;
        listen_to_computer(&p, elapsed_ms);
        for (int n = 0; n<elapsed_ms; n++, ms += p.deframer.frames> 0) {
            double path_m[3] = {0}, path_m_s[3] = {0};
            path_m[2] = kn_person_z(ms, &path_m_s[2]);
            kn_held_device_tick(&p.arm, (double[3]){0, 0, p.given_n}, path_m, path_m_s);
        }
        tell_computer(&p, ms);
        const kn_paddle_decoder *d = &p.deframer;
        printf("%d,%.6f,%.4f,%.4f,%d,%d,%lld,%lld,%lld\n", ms, p.arm.position_m[2], p.asked_n, p.given_n, p.enabled,
               p.watchdog.tripped, (long long)d->frames, (long long)d->bad, (long long)d->skipped);
    }
    if (p.fd >= 0) plug_out(&p);
    return 0;
}
