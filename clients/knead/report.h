#ifndef KN_CLIENTS_REPORT_H
#define KN_CLIENTS_REPORT_H
// Summary of a session of `knead probe`: the table of forces, the counts of echoes and the CSV file. A force echoes the
// session and number of the pose that it answers. Pure functions of the hand and the record of its messages.
#include "clients/knead/hand.h"
#include "clients/knead/record.h"

typedef struct kn_report {
    // Results of the last try (the last time the path was played). Times count from the begin of the path. A contact
    // lasts while nodes or samples of the contact carry load.
    double contact_from_s, contact_s; // time at which the contact begins, and its duration; contact_s 0: no contact
    double peak_n, peak_s;            // largest magnitude of contact_force_n, and the time at which it occurs
    // Contact force when the path's piece "hold" ends; NAN: the path has no such piece.
    double hold_end_n;
    double given_peak_n; // largest magnitude of force_n, the force given to the hand
    double gain_min;     // smallest gain of kneadd while the path was played; below 1: kneadd missed poses
    double residual_m;   // depth of the dent left in the object, set by the caller; NAN: not known
    // Counts of messages in all tries (runs of the path) together.
    int64_t sent, forces; // number of poses sent, and of forces received
    int64_t matched;      // number of forces that answer a pose of this hand
    int64_t strange;      // number of forces that answer a pose of another hand
    // Number of forces that kneadd computed once more from an old pose of this hand, although a newer pose had been
    // sent.
    int64_t stale;
    // Number of ticks whose force was not received. A loss shows as tick - last tick > 1 + missed_cycles.
    int64_t lost;
    int64_t missed; // number of cycles of the servo loop that kneadd skipped
    // Median and 99th percentile of the time from a pose to the force that answers it, without stale forces; NAN: no
    // forces.
    double round_trip_p50_ms, round_trip_p99_ms;
} kn_report;

// Compute the report of a session. The field residual_m is set to NAN.
void kn_report_make(kn_report *report, const kn_hand *hand, const kn_record *record);

// Print the table at the end of `knead probe`. clamp_n: contact force at which the device reaches its limit.
void kn_report_print(FILE *out, const kn_report *report, const kn_hand *hand, double clamp_n);

// Write one CSV row per force, in order of arrival, with the columns of `knead replay --csv`. Forces that do not echo a
// pose of this hand are left out.
void kn_report_csv(FILE *out, const kn_hand *hand, const kn_record *record, const char *probe);

#endif
