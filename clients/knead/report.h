#ifndef KN_CLIENTS_REPORT_H
#define KN_CLIENTS_REPORT_H
// What came of a session: the force table, the count of echoes, the CSV. Pure: from what was heard and the hand did.
#include "clients/knead/hand.h"
#include "clients/knead/record.h"

typedef struct kn_report {
    // of the last try, times along its path; contact is while nodes or samples carry load
    double contact_from_s, contact_s; // contact_s 0: it never touched
    double peak_n, peak_s;            // |contact_force_n|, largest
    double hold_end_n;                // at the path's hold_end_s; NAN: the path has no hold
    double given_peak_n;              // |force_n|, largest
    double gain_min;                  // while the path was played; below 1 poses were missing in between
    double residual_m;                // depth of the dent, for the caller to fill in; NAN: not known
    // of all tries
    int64_t sent, forces;
    int64_t matched; // forces that echo a pose this hand sent
    int64_t strange; // forces that echo anything else
    int64_t stale;   // matched, but no new pose had arrived for that tick, though one was sent after it
    int64_t lost;    // ticks of a session without a record: tick - last tick > 1 + missed_cycles
    int64_t missed;  // cycles that kneadd skipped
    double round_trip_p50_ms, round_trip_p99_ms; // of forces that are not stale; NAN: none
} kn_report;

void kn_report_make(kn_report *report, const kn_hand *hand, const kn_record *record);

// The table that `knead probe` ends with. clamp_n: contact at which the device is at its limit.
void kn_report_print(FILE *out, const kn_report *report, const kn_hand *hand, double clamp_n);

// One row per force, in order: the columns of `knead replay --csv`, from the echoes of this hand's own poses.
void kn_report_csv(FILE *out, const kn_hand *hand, const kn_record *record, const char *probe);

#endif
