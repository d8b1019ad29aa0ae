#ifndef KN_CLIENTS_MOTORS_H
#define KN_CLIENTS_MOTORS_H
// Recording of the forces of a device's motors, one row every millisecond of the device's clock, with or without a new
// force. The recording is needed because no message shows how the watchdog fades the force when messages stop.
#include "clients/knead/hand.h"
#include <stdio.h>

typedef struct kn_motors_row {
    int64_t ms, tick; // ms: time of the device's clock; tick: tick number of kneadd's newest force
    const char *doing;
    double position_m[3], force_n[3];
    int attempt, contacts, silent_ms;
} kn_motors_row;

typedef struct kn_motors { // list of recorded rows; if all fields are zero, nothing is recorded
    kn_motors_row *row;
    int count, room; // room: largest number of rows; when the list is full, later rows are dropped
    int64_t ms;
} kn_motors;

bool kn_motors_open(kn_motors *motors, int room); // reserve memory for `room` rows; return false if out of memory
void kn_motors_close(kn_motors *motors);

// Add a row for the time `elapsed_ms` after the last row. No memory is allocated.
void kn_motors_add(kn_motors *motors, const kn_hand *hand, const double position_m[3], const double force_n[3],
                   int elapsed_ms);

// Write the columns time_s,try,doing,x_m,y_m,z_m,fx_n,fy_n,fz_n,contacts,silent_ms,tick. The column `doing` has the
// name of a piece of the path, "engage" or "silent".
void kn_motors_csv(FILE *out, const kn_motors *motors);

#endif
