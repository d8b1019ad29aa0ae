#ifndef KN_CLIENTS_FIRMWARE_BOARD_H
#define KN_CLIENTS_FIRMWARE_BOARD_H
// Numbers of the paddle that README.md of this folder describes. The firmware and its simulation
// (tests/tactile/avr_paddle.h) read them here. Measure your own paddle, and change them.

#define BAUD 500000L // exact at 16 MHz; 1 kHz of 20-byte frames takes 40 % of the line in each direction

// The magnetic sensor (KMA210) gives a ramp from 5 to 95 % of its supply for each half turn of the motor's shaft. The
// converter has 1024 counts for the supply. Below 2.5 % and above 97.5 % the sensor or its wire is taken for broken.
#define SENSOR_LEAST 51
#define SENSOR_COUNTS 921
#define SENSOR_FAULT 25 // counts from either end
// In a half turn the handle moves by pi * 4.191 mm / 73.152 mm * 65.659 mm = 11.82 mm (pulley, sector, handle).
#define NM_PER_COUNT 12831L

// Force on the handle for each of the 255 steps of the pulse width: 8 N with the motor at rest and the full voltage.
#define UN_PER_STEP 31250L
#define STEPS_MOST 160 // 5 N, the largest force ever given

// The motor shield's current sensor gives 1.65 V per ampere, 338 counts.
#define COUNTS_PER_AMPERE 338
#define CURRENT_MOST (COUNTS_PER_AMPERE * 8 / 10) // the motor's rated current, 0.8 A

// Watchdog: the last force is held for HOLD_MS after the last news, and is zero at most ZERO_MS after it.
#define HOLD_MS 3
#define ZERO_MS 20

#endif
