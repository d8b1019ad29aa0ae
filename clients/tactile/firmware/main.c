// Firmware of a paddle with one degree of freedom, for an ATmega328 at 16 MHz with a motor shield. It speaks the frames
// of clients/tactile/paddle_frame.h: a state frame each ms, and a force from each command frame.
//
//     timer 1, each ms:  watchdog -> gain -> current limit -> pulse width, direction;  begins a conversion
//     converter:         angle of the motor, then its current
//     receiver, sender:  one byte each
//     main loop:         bytes -> command;  new angle -> position, velocity -> state frame
//
// A broken sensor switches the motor off until a reset. If the main loop or the ms stops, the chip's own watchdog
// resets it after 15 ms, and reset makes every pin an input.
#include "clients/tactile/firmware/board.h"
#include "clients/tactile/paddle_frame.h"
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

// The Arduino motor shield's channel A: pulse width on pin 3 (PD3, OC2B), direction on 12 (PB4), brake on 9 (PB1).
enum { WIDTH = PD3, DIRECTION = PB4, BRAKE = PB1 };
enum { CURRENT_INPUT = 0, ANGLE_INPUT = 2 }; // A0, A2
enum { REFERENCE = 1 << REFS0 };             // the supply, to which the sensor's output is in proportion
enum { GAIN_ONE = 4096, FADE = GAIN_ONE / (ZERO_MS - HOLD_MS), RISE = GAIN_ONE / 200 }; // back in 200 ms

// Interrupts and the main loop share these, so the main loop touches them in atomic blocks.
static volatile bool news;               // a command has come since the last ms
static volatile bool tripped = true;     // no force until a command without `enable`
static volatile bool broken;             // the sensor was, so where the handle is now is unknown until a restart
static volatile bool enabled;            // `enable` of the last command
static volatile bool saturated;          // the force is above the limit
static volatile int16_t asked;           // force of the last command, steps of the pulse width
static volatile int16_t given;           // force of the motor, steps
static volatile int16_t gain;            // 0..GAIN_ONE
static volatile uint16_t angle, current; // newest conversions, counts
static volatile bool sampled;            // `angle` is new

// ---- each ms

// Hold, fade, trip and come back, as core/safety.h's kn_watchdog does in floating point. The last command came up to
// 1 ms before the ms that counts as its first.
static void watch(void)
{
    static uint8_t silent_ms;
    silent_ms = news ? 0 : silent_ms + 1;
    if (news) gain = gain < GAIN_ONE - RISE ? gain + RISE : GAIN_ONE;
    else if (silent_ms >= ZERO_MS - 1) tripped = true;
    else if (silent_ms > HOLD_MS) gain = gain > FADE ? gain - FADE : 0;
    news = false;
}

// Set pulse width and direction. Too large a current lowers the limit by an eighth each ms; otherwise it rises again.
static void drive(void)
{
    static int16_t limit = STEPS_MOST;
    if (current > CURRENT_MOST) limit -= (limit + 7) >> 3;
    else if (limit < STEPS_MOST) limit++;
    int16_t force = enabled && !tripped ? (int16_t)((int32_t)asked * gain >> 12) : 0;
    saturated = force > limit || force < -limit;
    if (saturated) force = force < 0 ? -limit : limit;
    given = force;
    if (force < 0) PORTB &= (uint8_t)~_BV(DIRECTION);
    else PORTB |= _BV(DIRECTION);
    OCR2B = (uint8_t)(force < 0 ? -force : force);
}

ISR(TIMER1_COMPA_vect)
{
    watch();
    drive();
    ADCSRA |= _BV(ADSC);
}

ISR(ADC_vect)
{
    const uint16_t counts = ADC; // read before the input is changed
    if ((ADMUX & 15) == ANGLE_INPUT) {
        if (counts < SENSOR_FAULT || counts > 1023 - SENSOR_FAULT) tripped = broken = true;
        else angle = counts;
        sampled = true;
        ADMUX = REFERENCE | CURRENT_INPUT;
        ADCSRA |= _BV(ADSC);
    } else {
        current = counts;
        ADMUX = REFERENCE | ANGLE_INPUT;
    }
}

// ---- the line

static volatile uint8_t ring[64], head, tail; // bytes that have come; a byte that finds no room is lost
static uint8_t frame[KN_PADDLE_FRAME_SIZE];
static volatile uint8_t sent = sizeof frame;

ISR(USART_RX_vect)
{
    const bool damaged = UCSR0A & _BV(FE0); // read before the byte
    const uint8_t byte = UDR0, next = (head + 1) % sizeof ring;
    if (damaged || next == tail) return;
    ring[head] = byte;
    head = next;
}

ISR(USART_UDRE_vect)
{
    UDR0 = frame[sent++];
    if (sent == sizeof frame) UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

// ---- the main loop

// Take a command. With `enable` only a number above the last is news, so a repeated frame keeps no motor on. Without it
// any number is taken, and a new session begins.
static void obey(const kn_paddle_frame *command)
{
    static uint16_t heard;
    const bool enable = command->flags & KN_PADDLE_FRAME_ENABLE;
    if (enable && (int16_t)(command->seq - heard) <= 0) return;
    heard = command->seq;
    int32_t steps = command->force_un / UN_PER_STEP;
    if (steps > 255) steps = 255;
    if (steps < -255) steps = -255;
    ATOMIC_BLOCK(ATOMIC_FORCEON)
    {
        news = true;
        enabled = enable;
        asked = (int16_t)steps;
        if (!enable && tripped && !broken) tripped = false, gain = GAIN_ONE; // the computer has a ramp of its own
    }
}

static void hear(void)
{
    static kn_paddle_decoder decoder = {.kind = KN_PADDLE_FRAME_COMMAND};
    kn_paddle_frame command;
    const uint8_t byte = ring[tail];
    tail = (tail + 1) % sizeof ring;
    if (kn_paddle_decoder_push(&decoder, byte, &command)) obey(&command);
}

// Return the way of the motor since the last ms, counts. The shorter way round is the right one. A conversion between
// the end of one ramp and the beginning of the next has any value, so the first that is more than an eighth of a ramp
// away (1.5 m/s at the handle) is passed over.
static int16_t way(uint16_t now)
{
    static uint16_t last;
    static bool passed_over = true; // the first conversion is where the handle is
    int16_t step = last ? (int16_t)(now - last) : 0;
    if (step > SENSOR_COUNTS / 2) step -= SENSOR_COUNTS;
    if (step < -SENSOR_COUNTS / 2) step += SENSOR_COUNTS;
    passed_over = !passed_over && (step > SENSOR_COUNTS / 8 || step < -SENSOR_COUNTS / 8);
    if (passed_over) return 0;
    last = now;
    return step;
}

// Send the state. The position counts from where the handle was at reset.
static void tell(void)
{
    static kn_paddle_frame state = {.kind = KN_PADDLE_FRAME_STATE};
    uint16_t now;
    ATOMIC_BLOCK(ATOMIC_FORCEON)
    {
        now = angle;
        sampled = false;
        state.flags = (enabled && !tripped ? KN_PADDLE_FRAME_MOTOR : 0) | (tripped ? KN_PADDLE_FRAME_TRIPPED : 0) |
                      (saturated ? KN_PADDLE_FRAME_SATURATED : 0);
        state.force_un = given * UN_PER_STEP;
    }
    const int32_t moved_nm = way(now) * NM_PER_COUNT;
    if (state.position_nm > 1000000000 || state.position_nm < -1000000000)
        tripped = broken = true; // no handle moves by 1 m
    else state.position_nm += moved_nm;
    state.velocity_um_s += (moved_nm - state.velocity_um_s) >> 1; // nm per ms; a low-pass of 110 Hz
    state.seq++;
    wdt_reset();
    if (sent < sizeof frame) return; // the line is slower than it should be: skip this one
    kn_paddle_frame_encode(&state, frame);
    sent = 0;
    UCSR0B |= _BV(UDRIE0);
}

static void begin(void)
{
    MCUSR = 0;
    wdt_enable(WDTO_15MS);
    // Motor off first. A pin that drives nothing else stays an input.
    OCR2B = 0;
    DDRD = _BV(WIDTH);
    DDRB = _BV(DIRECTION) | _BV(BRAKE);
    TCCR2A = _BV(COM2B1) | _BV(WGM20); // phase-correct pulse width, 31 kHz
    TCCR2B = _BV(CS20);
    OCR1A = F_CPU / 8 / 1000 - 1;
    TCCR1B = _BV(WGM12) | _BV(CS11);
    TIMSK1 = _BV(OCIE1A);
    ADMUX = REFERENCE | ANGLE_INPUT;
    ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1); // 250 kHz: 52 us a conversion
    UCSR0A = _BV(U2X0);
    UBRR0 = F_CPU / 8 / BAUD - 1;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
}

int main(void)
{
    begin();
    for (;;) {
        if (tail != head) hear();
        if (sampled) tell();
        // sei() lets one more instruction pass, so no interrupt comes between the question and the sleep.
        cli();
        if (tail == head && !sampled) {
            sleep_enable();
            sei();
            sleep_cpu();
            sleep_disable();
        }
        sei();
    }
}
