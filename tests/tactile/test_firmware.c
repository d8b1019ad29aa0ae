// The paddle's firmware under simavr, in its own time. KN_GARBAGE=N bytes.
// a program of its own: simavr
#include "clients/tactile/paddle_frame.h"
#include "tests/check.h"
#include "tests/tactile/avr_paddle.h"

static kn_avr_paddle board;
static kn_paddle_decoder states;
static kn_paddle_frame state, last; // last command
static double position_m;
static int frames; // state frames in the last ms

// Let a ms pass, with these bytes on the line.
static void pass(const uint8_t *bytes, size_t count)
{
    kn_avr_paddle_sense(&board, position_m);
    CHECK(kn_avr_paddle_ms(&board, bytes, count));
    const int64_t before = states.frames;
    for (size_t i = 0; i < board.said_count; i++) kn_paddle_decoder_push(&states, board.said[i], &state);
    frames = (int)(states.frames - before);
}

static void repeat(void)
{
    uint8_t bytes[KN_PADDLE_FRAME_SIZE];
    kn_paddle_frame_encode(&last, bytes);
    pass(bytes, sizeof bytes);
}

// Give a command for some ms, under rising numbers.
static void command(int ms, bool enable, double force_n)
{
    last.kind = KN_PADDLE_FRAME_COMMAND;
    last.flags = enable ? KN_PADDLE_FRAME_ENABLE : 0;
    last.force_un = kn_paddle_frame_number(force_n, 1e-6);
    for (; ms > 0; ms--) last.seq++, repeat();
}

static double force_n(void) { return kn_avr_paddle_force_n(&board); }
static bool gives(double n) { return fabs(force_n() - n) <= 1.01e-6 * UN_PER_STEP; } // a step of the pulse width
static bool tripped(void) { return state.flags & KN_PADDLE_FRAME_TRIPPED; }

// Switch the power off and on, and let the first frames pass.
static void start(void)
{
    if (board.avr) avr_reset(board.avr);
    else kn_avr_paddle_init(&board, KN_PADDLE_ELF);
    board.short_factor = 1;
    states = (kn_paddle_decoder){.kind = KN_PADDLE_FRAME_STATE};
    position_m = 0;
    for (int ms = 0; ms < 5; ms++) pass(NULL, 0);
}

// Press with a force, after a command that ends the trip.
static void press(double force_n)
{
    command(2, false, 0);
    command(50, true, force_n);
    CHECK(gives(force_n) && !tripped());
}

TEST("the paddle sends a whole frame in each ms of its clock, with the position of its handle")
{
    int sent = 0;
    start();
    for (int ms = 0; ms < 2000; ms++) {
        position_m = 0.03 * sin(1e-2 * ms); // over five half turns of the motor, each of which begins the ramp again
        pass(NULL, 0);
        sent += frames;
        // the position is as old as a conversion that was passed over, and as its frame
        CHECK_NEAR(1e-9 * state.position_nm, position_m, 1e-9 * NM_PER_COUNT * 2 + 0.03 * 1e-2 * 3);
    }
    CHECK(sent >= 1999 && sent <= 2001 && states.bad == 0 && states.lost == 0);
}

TEST("the motor is off from reset until a command without enable, and then gives the force of each command")
{
    start();
    command(50, true, 3);
    CHECK(force_n() == 0 && tripped() && !(state.flags & KN_PADDLE_FRAME_MOTOR));
    command(3, false, 3);
    CHECK(force_n() == 0 && !tripped());
    for (double f = -4; f <= 4; f += 0.5) {
        command(2, true, f);
        CHECK(gives(f));
    }
    command(3, true, 100);
    CHECK(gives(1e-6 * STEPS_MOST * UN_PER_STEP) && state.flags & KN_PADDLE_FRAME_SATURATED);
}

TEST("without news the force fades to zero in 20 ms of the firmware's clock, and a repeated command is no news")
{
    for (int repeats = 0; repeats < 2; repeats++) {
        int ms = 0;
        start();
        press(3);
        for (double before = force_n(); ms < 100 && force_n() != 0; ms++, before = force_n()) {
            if (repeats) repeat();
            else pass(NULL, 0);
            CHECK(ms > HOLD_MS ? force_n() < before : gives(3));
        }
        printf("     %s: zero after %d ms\n", repeats ? "the last command repeated" : "silence", ms);
        CHECK(ms > HOLD_MS && ms <= ZERO_MS);
        command(50, true, 3);
        CHECK(force_n() == 0 && tripped());
    }
    press(3);
    for (int ms = 0; ms < 12; ms++) pass(NULL, 0);
    command(10, true, 3); // in time: the force comes back in 200 ms
    CHECK(force_n() > 0 && !gives(3));
    command(200, true, 3);
    CHECK(gives(3));
}

TEST("a motor that takes too much current gets less")
{
    double most_a = 0;
    start();
    press(4.5);
    board.short_factor = 3;
    command(200, true, 4.5);
    for (int ms = 0; ms < 200; ms++, most_a = fmax(most_a, kn_avr_paddle_current_a(&board))) command(1, true, 4.5);
    printf("     current at most %.2f A of %.2f A\n", most_a, (double)CURRENT_MOST / COUNTS_PER_AMPERE);
    CHECK(most_a < 1.2 * CURRENT_MOST / COUNTS_PER_AMPERE && most_a > 0 && state.flags & KN_PADDLE_FRAME_SATURATED);
}

TEST("a broken wire of the sensor switches the motor off until a restart")
{
    start();
    press(3);
    position_m = NAN;
    command(2, true, 3);
    CHECK(force_n() == 0 && tripped());
    position_m = 0;
    command(5, false, 0);
    command(50, true, 3);
    CHECK(force_n() == 0 && tripped());
    start();
    press(3);
}

TEST("if the ms stops, the chip resets itself, and the motor stays off")
{
    int ms = 0;
    start();
    press(3);
    board.avr->data[KN_AVR_TIMSK1] = 0;
    for (; ms < 100 && force_n() != 0; ms++) command(1, true, 3);
    printf("     off after %d ms\n", ms);
    CHECK(ms > 0 && ms <= ZERO_MS);
    command(50, true, 3);
    CHECK(force_n() == 0 && tripped() && frames == 1);
    press(3);
}

TEST("garbage switches no motor on and stops no frame, and a command behind it is obeyed")
{
    unsigned random = 1;
    int64_t sent = 0, ms = 0, armed = 0;
    const long bytes = getenv("KN_GARBAGE") ? atol(getenv("KN_GARBAGE")) : KN_LENGTH(20000, 20000, 1000000);
    start();
    for (long given = 0; given < bytes; given += KN_AVR_LINE_MS, ms++) {
        uint8_t noise[KN_AVR_LINE_MS];
        if (ms % 10 == 0) command(1, false, 0);   // the motor stays one frame away from a force
        for (size_t i = 0; i < sizeof noise; i++) // every third byte may begin a frame
            noise[i] = (uint8_t)(rand_r(&random) % 3 ? rand_r(&random) >> 5 : "KN\2\1"[rand_r(&random) % 4]);
        pass(noise, sizeof noise);
        sent += frames;
        armed += !tripped();
        CHECK(force_n() == 0);
    }
    printf("     %ld bytes: %lld frames in %lld ms\n", bytes, (long long)sent, (long long)ms);
    CHECK(sent >= ms - 1 && states.lost == 0 && armed > ms / 2);
    command(250, true, 2); // the gain comes back in 200 ms
    CHECK(gives(2));
}
