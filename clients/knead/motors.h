#ifndef KN_CLIENTS_MOTORS_H
#define KN_CLIENTS_MOTORS_H
// What a device's motors gave, every millisecond of its own clock, whether a force came or not: what its watchdog made
// of a silence stands in no message.
#include "clients/knead/hand.h"
#include <stdio.h>

typedef struct kn_motors_row {
    int64_t ms, tick; // of the device, of kneadd's newest force
    const char *doing;
    double position_m[3], force_n[3];
    int attempt, contacts, silent_ms;
} kn_motors_row;

typedef struct kn_motors { // zeroed: writes nothing
    kn_motors_row *row;
    int count, room; // full: the first room of them stay
    int64_t ms;
} kn_motors;

bool kn_motors_open(kn_motors *motors, int room); // false: memory is short
void kn_motors_close(kn_motors *motors);

// elapsed_ms after the last one. No allocation.
void kn_motors_add(kn_motors *motors, const kn_hand *hand, const double position_m[3], const double force_n[3],
                   int elapsed_ms);

// time_s,try,doing,x_m,y_m,z_m,fx_n,fy_n,fz_n,contacts,silent_ms,tick; doing: a path's piece, "engage" or "silent"
void kn_motors_csv(FILE *out, const kn_motors *motors);

#endif
