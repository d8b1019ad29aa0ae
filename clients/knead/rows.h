#ifndef KN_CLIENTS_ROWS_H
#define KN_CLIENTS_ROWS_H
// Poses and forces as CSV, a row per tick and live probe: the table of `knead replay`, `knead export` and `knead probe`.
#include "server/replay.h"
#include <stdio.h>

typedef struct kn_row_of_force { // one row
    int64_t tick, execution_ns;
    double time_s;
    const char *probe;
    const double *position_m, *contact_force_n, *force_n, *torque_n_m, *proxy_position_m; // [3] each
    int contacts;
    double residual;
} kn_row_of_force;

void kn_rows_head(FILE *out);
void kn_rows_add(FILE *out, const kn_row_of_force *row);
void kn_rows_tick(FILE *out, const kn_replay *replay, int probe); // of the last tick of a probe that is live

#endif
