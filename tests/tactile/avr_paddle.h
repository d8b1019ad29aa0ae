#ifndef KN_TESTS_AVR_PADDLE_H
#define KN_TESTS_AVR_PADDLE_H
// A paddle whose firmware is clients/tactile/firmware, run instruction by instruction by simavr, with a motor, a magnetic
// sensor, a current sensor and a serial line around it. Time is the firmware's own: kn_avr_paddle_ms lets one millisecond
// of its 16 MHz pass. Registers are read where the chip's pins get their levels from, so the force is what the motor
// gets, whatever the firmware reports.
#include "clients/tactile/firmware/board.h"
#include <math.h>
#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_elf.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Bytes that the line carries in a ms. simavr gives each byte eleven bits.
#define KN_AVR_LINE_MS (BAUD / 11 / 1000)
#define KN_AVR_CLOCK 16000000

// Data addresses of the ATmega328P
enum { KN_AVR_DDRB = 0x24, KN_AVR_PORTB = 0x25, KN_AVR_DDRD = 0x2a };
enum { KN_AVR_TIMSK1 = 0x6f, KN_AVR_TCCR2A = 0xb0, KN_AVR_OCR2B = 0xb4 };

typedef struct kn_avr_paddle {
    avr_t *avr;
    avr_irq_t *rx, *adc;
    avr_cycle_count_t due;
    uint8_t said[128]; // bytes that the firmware has sent in the last ms
    size_t said_count;
    double half_turn;    // of the motor, in the last ms
    double short_factor; // current of the motor over that of a good one; 1: no fault
} kn_avr_paddle;

static inline void kn_avr_log(avr_t *avr, const int level, const char *format, va_list args)
{
    (void)avr;
    if (level <= LOG_ERROR) vfprintf(stderr, format, args);
}

static inline void kn_avr_no_sleep(avr_t *avr, avr_cycle_count_t cycles) { (void)avr, (void)cycles; }

static inline void kn_avr_on_byte(avr_irq_t *irq, uint32_t value, void *self)
{
    kn_avr_paddle *p = self;
    (void)irq;
    if (p->said_count < sizeof p->said) p->said[p->said_count++] = (uint8_t)value;
}

// A cycle timer at the end of the ms ends a sleep of the processor there.
static inline avr_cycle_count_t kn_avr_on_ms(avr_t *avr, avr_cycle_count_t when, void *self)
{
    (void)avr, (void)when, (void)self;
    return 0;
}

// Load the firmware and switch the power on. End the program if there is no firmware at `elf`.
static inline void kn_avr_paddle_init(kn_avr_paddle *p, const char *elf)
{
    static elf_firmware_t firmware;
    *p = (kn_avr_paddle){.short_factor = 1};
    avr_global_logger_set(kn_avr_log);
    p->avr = avr_make_mcu_by_name("atmega328p");
    if (elf_read_firmware(elf, &firmware) != 0 || !p->avr || avr_init(p->avr) != 0) exit(3);
    avr_load_firmware(p->avr, &firmware);
    p->avr->frequency = KN_AVR_CLOCK;
    p->avr->vcc = p->avr->avcc = p->avr->aref = 5000;
    p->avr->sleep = kn_avr_no_sleep; // the caller keeps the time
    avr_extint_set_strict_lvl_trig(p->avr, EXTINT_IRQ_OUT_INT1,
                                   0); // else simavr looks at the motor's pin in every clock
    uint32_t flags = 0;                // neither print bytes nor sleep while the firmware polls
    avr_ioctl(p->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    p->rx = avr_io_getirq(p->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    p->adc = avr_io_getirq(p->avr, AVR_IOCTL_ADC_GETIRQ, 0);
    avr_irq_register_notify(avr_io_getirq(p->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), kn_avr_on_byte, p);
}

// Return the pulse width with the sign of the direction, steps; 0 while a pin of the driver is no output.
static inline int kn_avr_paddle_steps(const kn_avr_paddle *p)
{
    const uint8_t *data = p->avr->data;
    const bool steers = (data[KN_AVR_DDRB] & 0x12) == 0x12 && !(data[KN_AVR_PORTB] & 1 << 1); // direction; brake is low
    const bool drives = steers && data[KN_AVR_DDRD] & 1 << 3 && (data[KN_AVR_TCCR2A] & 0x30) == 0x20;
    const int width = drives ? data[KN_AVR_OCR2B] : 0;
    return data[KN_AVR_PORTB] & 1 << 4 ? width : -width;
}
// Return the force of the motor on the handle, N.
static inline double kn_avr_paddle_force_n(const kn_avr_paddle *p)
{
    return 1e-6 * UN_PER_STEP * kn_avr_paddle_steps(p);
}
// Return the motor's current, A: 1 A at rest and full voltage.
static inline double kn_avr_paddle_current_a(const kn_avr_paddle *p)
{
    return abs(kn_avr_paddle_steps(p)) / 255.0 * p->short_factor;
}

// Set what the sensors see: the handle's position, m (NaN: the angle's wire is broken), and the motor's current.
static inline void kn_avr_paddle_sense(kn_avr_paddle *p, double position_m)
{
    const double turns = 0.5 + 1e9 * position_m / NM_PER_COUNT / SENSOR_COUNTS, half_turn = floor(turns);
    double counts = floor(SENSOR_LEAST + SENSOR_COUNTS * (turns - half_turn));
    if (half_turn != p->half_turn) counts = SENSOR_LEAST + SENSOR_COUNTS / 2; // the ramp begins again just now
    p->half_turn = half_turn;
    avr_raise_irq(p->adc + ADC_IRQ_ADC2, isnan(position_m) ? 0 : (uint32_t)ceil(counts * 5000 / 1023));
    avr_raise_irq(p->adc + ADC_IRQ_ADC0, (uint32_t)fmin(5000, 1650 * kn_avr_paddle_current_a(p)));
}

// Let a ms pass, in which the bytes come over the line. There may be KN_AVR_LINE_MS of them at most. Return false if
// the firmware has crashed.
static inline bool kn_avr_paddle_ms(kn_avr_paddle *p, const uint8_t *bytes, size_t count)
{
    p->said_count = 0;
    p->due += KN_AVR_CLOCK / 1000;
    avr_cycle_timer_register(p->avr, p->due - p->avr->cycle, kn_avr_on_ms, p);
    for (size_t i = 0; i < count; i++) avr_raise_irq(p->rx, bytes[i]); // simavr spreads them over the ms
    int state = cpu_Running;
    while (p->avr->cycle < p->due && state != cpu_Done && state != cpu_Crashed) state = avr_run(p->avr);
    return state != cpu_Done && state != cpu_Crashed;
}

#endif
