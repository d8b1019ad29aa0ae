#include "clients/knead/report.h"
#include "clients/knead/rows.h"
#include "core/algebra.h"
#include <math.h>
#include <stdlib.h>

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// Return the try (one run of the path) to whose pose this force belongs, or NULL.
static const kn_attempt *attempt_of(const kn_hand *hand, const knead_contact_force_t *f)
{
    for (int i = 0; i < hand->tries; i++) {
        const kn_attempt *t = &hand->attempt[i];
        if (f->session == t->session && f->seq >= 1 && f->seq <= t->sent + 1)
            // The last pose of a try has the number sent + 1. It only announces that the hand leaves, and belongs to no
            // path.
            return t;
    }
    return NULL;
}

// Return the time along the path of the pose that the force echoes, s. The path begins with play_seq and has 1 ms per
// pose.
static double path_time(const kn_attempt *t, const knead_contact_force_t *f)
{
    return 1e-3 * (double)(f->seq - t->play_seq);
}

// Add one force of the last try to the table. Forces from before and after the path are left out.
static void add_to_table(kn_report *r, const kn_hand *hand, const kn_attempt *t, const knead_contact_force_t *f)
{
    double s = path_time(t, f), contact_n = norm(f->contact_force_n);
    bool after = f->seq > t->sent || (f->seq == t->sent && f->flags & KN_FLAG_STALE);
    if (!t->play_seq || s < 0.0 || after) return;
    r->gain_min = fmin(r->gain_min, f->gain);
    r->given_peak_n = fmax(r->given_peak_n, norm(f->force_n));
    // The value at the end of the hold is that of the last force up to then.
    if (s <= hand->def.path->hold_end_s) r->hold_end_n = contact_n;
    if (!f->contacts) return;
    // Contact lasts from the first tick with a loaded contact to the last one.
    if (r->contact_s == 0.0) r->contact_from_s = s;
    r->contact_s = s - r->contact_from_s + 1e-3;
    if (contact_n > r->peak_n) r->peak_n = contact_n, r->peak_s = s;
}

void kn_report_make(kn_report *r, const kn_hand *hand, const kn_record *record)
{
    const kn_attempt *last = &hand->attempt[hand->tries - 1];
    int64_t *trip_ns = malloc(sizeof *trip_ns * ((size_t)record->force_count + 1)), trips = 0;
    *r = (kn_report){.gain_min = 1.0, .hold_end_n = NAN, .residual_m = NAN};
    r->round_trip_p50_ms = r->round_trip_p99_ms = NAN;
    for (int i = 0; i < hand->tries; i++) r->sent += hand->attempt[i].sent;
    for (int i = 0; i < record->force_count; i++) {
        const knead_contact_force_t *f = &record->force[i].force;
        const knead_contact_force_t *before = i > 0 ? &record->force[i - 1].force : NULL;
        const kn_attempt *t = attempt_of(hand, f);
        r->forces++;
        r->matched += t != NULL;
        r->strange += t == NULL;
        r->missed += f->missed_cycles;
        // If the tick is smaller than the last one, kneadd was restarted.
        bool goes_on = before && before->session == f->session && f->tick > before->tick;
        if (goes_on) r->lost += f->tick - before->tick - 1 - f->missed_cycles;
        if (!t) continue;
        // A stale force counts only if a newer pose had been sent. Round trips are taken from forces that are not
        // stale.
        if (f->flags & KN_FLAG_STALE) r->stale += f->seq < t->sent;
        else if (trip_ns) trip_ns[trips++] = record->force[i].arrived_ns - f->sent_ns;
        if (t == last) add_to_table(r, hand, t, f);
    }
    // A path without a hold has no force at the end of a hold.
    if (hand->def.path->hold_end_s == 0.0) r->hold_end_n = NAN;
    if (trips > 0) {
        qsort(trip_ns, (size_t)trips, sizeof *trip_ns, kn_ascending_i64);
        r->round_trip_p50_ms = 1e-6 * (double)trip_ns[trips / 2];
        r->round_trip_p99_ms = 1e-6 * (double)trip_ns[trips * 99 / 100];
    }
    free(trip_ns);
}

void kn_report_print(FILE *out, const kn_report *r, const kn_hand *hand, double clamp_n)
{
    if (hand->tries > 1)
        fprintf(out, "  try %d: the object keeps the deformation of the interrupted tries\n", hand->tries);
    if (r->contact_s > 0.0) {
        fprintf(out, "  contact         %8.2f s    from %.2f s on\n", r->contact_s, r->contact_from_s);
        fprintf(out, "  peak            %8.2f N    %.2f s after touch\n", r->peak_n, r->peak_s - r->contact_from_s);
    } else {
        fprintf(out, "  contact             none\n");
    }
    if (!isnan(r->hold_end_n)) fprintf(out, "  end of hold     %8.2f N\n", r->hold_end_n);
    if (!isnan(r->residual_m)) fprintf(out, "  residual depth  %8.2f mm   1 s after withdrawal\n", 1e3 * r->residual_m);
    if (r->peak_n > clamp_n) fprintf(out, "  given to hand   %8.2f N    the device's limit\n", r->given_peak_n);
    if (r->gain_min < 1.0)
        fprintf(out, "  poses were late: the force on the hand faded to %.0f %%\n", 100.0 * r->gain_min);
    fprintf(out, "  poses sent      %8lld\n  forces received %8lld      %lld lost\n", (long long)r->sent,
            (long long)r->forces, (long long)r->lost);
    fprintf(out, "  echoes matched  %8lld      %lld of them an older pose again, %lld forces answer another hand\n",
            (long long)r->matched, (long long)r->stale, (long long)r->strange);
    fprintf(out, "  round trip      %8.2f ms   median; p99 %.2f ms\n", r->round_trip_p50_ms, r->round_trip_p99_ms);
}

// Compare two poses by session and then by number, for sorting.
static int by_number(const void *a, const void *b)
{
    const knead_probe_pose_t *x = a, *y = b;
    if (x->session != y->session) return x->session < y->session ? -1 : 1;
    return (x->seq > y->seq) - (x->seq < y->seq);
}

void kn_report_csv(FILE *out, const kn_hand *hand, const kn_record *record, const char *probe)
{
    kn_rows_head(out);
    // Poses come in order within a try, but tries are not in order of their session numbers.
    qsort(record->pose, (size_t)record->pose_count, sizeof *record->pose, by_number);
    int64_t first_tick = record->force_count ? record->force[0].force.tick : 0;
    for (int i = 0; i < record->force_count; i++) {
        const knead_contact_force_t *f = &record->force[i].force;
        // Find the pose that the force echoes.
        knead_probe_pose_t key = {.session = f->session, .seq = f->seq};
        const knead_probe_pose_t *pose =
            bsearch(&key, record->pose, (size_t)record->pose_count, sizeof *record->pose, by_number);
        if (!attempt_of(hand, f) || !pose) continue;
        kn_rows_add(out, &(kn_row_of_force){f->tick, f->execution_ns, 1e-3 * (double)(f->tick - first_tick), probe,
                                            pose->position_m, f->contact_force_n, f->force_n, f->torque_n_m,
                                            f->proxy_position_m, f->contacts, f->residual});
    }
}
