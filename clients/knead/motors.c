#include "clients/knead/motors.h"
#include <stdlib.h>
#include <string.h>

bool kn_motors_open(kn_motors *m, int room)
{
    *m = (kn_motors){.row = malloc(sizeof *m->row * (size_t)room), .room = room};
    // Write to all memory pages now, so that no page fault delays the thread of the device.
    if (m->row) memset(m->row, 0, sizeof *m->row * (size_t)room);
    return m->row != NULL;
}

void kn_motors_close(kn_motors *m)
{
    free(m->row);
    *m = (kn_motors){0};
}

void kn_motors_add(kn_motors *m, const kn_hand *h, const double position_m[3], const double force_n[3], int elapsed_ms)
{
    m->ms += elapsed_ms;
    // If the list is full, drop the new row but continue to count the time.
    if (m->count == m->room) return;
    kn_motors_row *row = &m->row[m->count++];
    *row = (kn_motors_row){.ms = m->ms,
                           .tick = h->force.tick,
                           .doing = h->mode == KN_HAND_SILENT ? "silent" : h->piece,
                           .attempt = h->tries,
                           .contacts = h->force.contacts,
                           .silent_ms = h->watchdog.silent_ms};
    memcpy(row->position_m, position_m, sizeof row->position_m);
    memcpy(row->force_n, force_n, sizeof row->force_n);
}

void kn_motors_csv(FILE *out, const kn_motors *m)
{
    fprintf(out, "time_s,try,doing,x_m,y_m,z_m,fx_n,fy_n,fz_n,contacts,silent_ms,tick\n");
    for (int i = 0; i < m->count; i++) {
        const kn_motors_row *r = &m->row[i];
        const double *x = r->position_m, *f = r->force_n;
        fprintf(out, "%.3f,%d,%s,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d,%d,%lld\n", 1e-3 * (double)r->ms, r->attempt,
                r->doing, x[0], x[1], x[2], f[0], f[1], f[2], r->contacts, r->silent_ms, (long long)r->tick);
    }
}
