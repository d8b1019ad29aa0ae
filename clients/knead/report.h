#ifndef KN_CLIENTS_REPORT_H
#define KN_CLIENTS_REPORT_H
// Summary of a session of `knead probe`: the table of forces, the counts of echoes and the CSV file. A force echoes the
// session and number of the pose that it answers. Pure functions of the hand and the record of its messages.
#include "clients/knead/hand.h"
#include "clients/knead/record.h"

typedef struct kn_report {
    // Results of the last try (the last time the path was played). Times count from the begin of the path. A contact
    // lasts while nodes or samples of the contact carry load.
    double contact_from_s, contact_s; // begin and length of the contact; contact_s 0: no contact
    double peak_n, peak_s;            // largest |contact_force_n|, and its time
    double hold_end_n;                // contact force at the path's hold_end_s; NAN: the path has no hold
    double given_peak_n;              // largest |force_n|
    double gain_min;                  // least gain while the path was played; below 1: kneadd missed poses
    double residual_m;                // depth of the dent left in the object, set by the caller; NAN: not known
    // Counts of all tries together.
    int64_t sent, forces; // poses sent, forces received
    int64_t matched;      // forces that echo a pose of this hand
    int64_t strange;      // forces that echo any other pose
    // Matched forces that kneadd computed once more from an old pose, although a newer pose had been sent.
    int64_t stale;
    int64_t lost;   // ticks whose force was not received: tick - last tick > 1 + missed_cycles
    int64_t missed; // cycles that kneadd skipped
    // Round trip of the forces that are not stale; NAN: none.
    double round_trip_p50_ms, round_trip_p99_ms;
} kn_report;

// Compute the report. residual_m stays NAN.
void kn_report_make(kn_report *report, const kn_hand *hand, const kn_record *record);

// Print the table at the end of `knead probe`. clamp_n: contact force at which the device reaches its limit.
void kn_report_print(FILE *out, const kn_report *report, const kn_hand *hand, double clamp_n);

// Write one CSV row per force, in order of arrival, with the columns of `knead replay --csv`. Forces that do not echo a
// pose of this hand are left out.
void kn_report_csv(FILE *out, const kn_hand *hand, const kn_record *record, const char *probe);

#endif
