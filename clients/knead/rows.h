#ifndef KN_CLIENTS_ROWS_H
#define KN_CLIENTS_ROWS_H
// CSV table of poses and forces. It has one row per tick and live probe (a probe with a session). `knead replay`,
// `knead export` and `knead probe` write this table.
#include "server/replay.h"
#include <stdio.h>

typedef struct kn_row_of_force { // forces and pose of one probe in one tick: one row of the CSV table
    int64_t tick, execution_ns;
    double time_s;
    const char *probe;
    const double *position_m, *contact_force_n, *force_n, *torque_n_m, *proxy_position_m; // arrays of 3 numbers
    int contacts;
    double residual;
} kn_row_of_force;

// Write the header line of the CSV table.
void kn_rows_head(FILE *out);
// Write one row of the CSV table.
void kn_rows_add(FILE *out, const kn_row_of_force *row);
// Write the row of a live probe for the last tick of a replay.
void kn_rows_tick(FILE *out, const kn_replay *replay, int probe);

#endif
