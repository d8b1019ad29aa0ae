// A simulated paddle: mass, friction, motor, sensor and a person behind a pty, and the real firmware
// (clients/tactile/firmware) under simavr. For tests, and for users without a paddle.
//
//     paddle LINK SECONDS [EVENT=MS[:MS]]...     LINK becomes the name of its tty; times since the first command came
//
// The person comes down 35 mm in 1 s, rests, and lifts, every 4 s. CSV on stdout, one row per ms of the firmware: what
// was asked on the line, and the force of the motor at its pin. In the time that this process could not run, nothing
// moves, and the firmware's clock stands still.
//     garbage=MS      from then on 7 random bytes before every tenth frame
//     flip=MS         from then on one bit of every tenth frame is wrong
//     hangup=MS:MS    from then on, for so long, the line is gone
//     deaf=MS:MS      from then on, for so long, no bytes come from the computer
//     unwatched=0     a second sender keeps the watchdog quiet, as if there were none
#include "clients/hand/bus_client.h"
#include "clients/hand/haptic_loop.h"
#include "clients/tactile/paddle_frame.h"
#include "server/clock.h"
#include "tests/tactile/avr_paddle.h"
#include "tests/tactile/person.h"
#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

typedef struct span {
    int from_ms, for_ms; // for_ms 0: for ever
} span;

typedef struct paddle {
    const char *link;
    int fd, keep; // master; slave, held open so that a leaving computer does not hang up the line
    span garbage, flip, hangup, deaf, unwatched;
    kn_held_device arm;
    kn_avr_paddle board;
    kn_paddle_decoder commands, states; // what passes on the line, in both directions
    kn_paddle_frame command, state;
    int quiet_ms, sent;
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

// Take the bytes that the line brings in this ms. Return their number.
static size_t from_computer(paddle *p, int ms, uint8_t bytes[KN_AVR_LINE_MS])
{
    ssize_t size = p->fd < 0 ? 0 : read(p->fd, bytes, KN_AVR_LINE_MS);
    bool whole = false;
    if (in(&p->deaf, ms)) size = 0;
    for (ssize_t i = 0; i < size; i++) whole |= kn_paddle_decoder_push(&p->commands, bytes[i], &p->command);
    p->quiet_ms = whole ? 0 : p->quiet_ms + 1;
    if (!in(&p->unwatched, 0) || p->quiet_ms < 2 || p->commands.frames == 0) return size > 0 ? (size_t)size : 0;
    p->command.seq++; // the second sender repeats the last command as news
    kn_paddle_frame_encode(&p->command, bytes);
    return KN_PADDLE_FRAME_SIZE;
}

// Send what the firmware has said, with the faults of the line.
static void to_computer(paddle *p, int ms)
{
    uint8_t garbage[7], *said = p->board.said;
    const size_t count = p->board.said_count;
    for (size_t i = 0; i < count; i++) kn_paddle_decoder_push(&p->states, said[i], &p->state);
    if (p->fd < 0 || count == 0) return;
    const bool tenth = p->sent++ % 10 == 0;
    for (size_t i = 0; i < sizeof garbage; i++) garbage[i] = (uint8_t)(rand_r(&p->random) >> 7);
    if (tenth && in(&p->garbage, ms) && write(p->fd, garbage, sizeof garbage) < 0) return; // full: no program reads
    if (tenth && in(&p->flip, ms)) said[(size_t)p->sent / 10 % count] ^= (uint8_t)(1 << ms / 200 % 8);
    if (write(p->fd, said, count) < 0) return;
}

static bool option(paddle *p, const char *text)
{
    const struct {
        const char *name;
        span *span;
    } known[] = {{"garbage", &p->garbage},
                 {"flip", &p->flip},
                 {"hangup", &p->hangup},
                 {"deaf", &p->deaf},
                 {"unwatched", &p->unwatched}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        size_t n = strlen(known[i].name);
        if (!strncmp(text, known[i].name, n) && text[n] == '=')
            return sscanf(text + n, "=%d:%d", &known[i].span->from_ms, &known[i].span->for_ms) >= 1;
    }
    return false;
}

// One ms: bytes to the firmware, its ms, bytes from it; then the handle moves under the motor's force.
static bool live(paddle *p, int ms)
{
    uint8_t bytes[KN_AVR_LINE_MS];
    double path_m[3] = {0}, path_m_s[3] = {0};
    kn_avr_paddle_sense(&p->board, p->arm.position_m[2]);
    if (!kn_avr_paddle_ms(&p->board, bytes, from_computer(p, ms, bytes))) return false;
    to_computer(p, ms);
    path_m[2] = kn_person_z(ms, &path_m_s[2]);
    kn_held_device_tick(&p->arm, (double[3]){0, 0, kn_avr_paddle_force_n(&p->board)}, path_m, path_m_s);
    return true;
}

int main(int argc, char **argv)
{
    const span never = {-1, 0};
    static paddle p;
    p = (paddle){.garbage = never,
                 .flip = never,
                 .hangup = never,
                 .deaf = never,
                 .unwatched = never,
                 .fd = -1,
                 .random = 1,
                 .commands.kind = KN_PADDLE_FRAME_COMMAND,
                 .states.kind = KN_PADDLE_FRAME_STATE};
    // A Hapkit at the handle: some 40 g felt, little friction. The firmware sees the steps of its own sensor.
    const kn_held_device_def def = {
        .mass_kg = 0.04, .damping_n_s_m = 0.1, .coulomb_n = 0.05, .axes = 1, .grip = KN_GRIP_NORMAL};
    int seconds = argc > 2 ? atoi(argv[2]) : 0;
    for (int i = 3; i < argc; i++)
        if (!option(&p, argv[i])) return fprintf(stderr, "paddle: %s?\n", argv[i]), 2;
    if (seconds <= 0) return fprintf(stderr, "usage: paddle LINK SECONDS [EVENT=MS[:MS]]...\n"), 2;
    p.link = argv[1];
    if (!plug_in(&p)) return fprintf(stderr, "paddle: no pty\n"), 3;
    kn_held_device_init(&p.arm, &def, (double[3]){0});
    kn_avr_paddle_init(&p.board, KN_PADDLE_ELF);

    kn_clock clock;
    kn_bus_client_priority(60); // a microcontroller has no other work
    kn_clock_start(&clock, kn_now_ns());
    setvbuf(stdout, NULL, _IOLBF, 0); // a reader sees each ms at once
    printf("ms,z_m,asked_n,given_n,enabled,tripped,commands,bad,skipped\n");
    for (int ms = 0; ms<1000 * seconds; ms += p.commands.frames> 0) {
        kn_clock_wait(&clock);
        if (in(&p.hangup, ms) && p.fd >= 0) plug_out(&p);
        if (!in(&p.hangup, ms) && p.fd < 0 && !plug_in(&p)) return 3;
        if (!live(&p, ms)) return fprintf(stderr, "paddle: the firmware has crashed\n"), 1;
        const kn_paddle_decoder *d = &p.commands;
        printf("%d,%.6f,%.4f,%.4f,%d,%d,%lld,%lld,%lld\n", ms, p.arm.position_m[2], 1e-6 * p.command.force_un,
               kn_avr_paddle_force_n(&p.board), p.command.flags & KN_PADDLE_FRAME_ENABLE,
               (p.state.flags & KN_PADDLE_FRAME_TRIPPED) != 0, (long long)d->frames, (long long)d->bad,
               (long long)d->skipped);
    }
    if (p.fd >= 0) plug_out(&p);
    return 0;
}
