// Results of knead latency: table, contract, JSON, picture.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/knead/latency.h"
#include "core/algebra/algebra.h"
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Columns of the table: percentiles of the latency, as shares of the poses. The share 1 gives the maximum.
static const double shares[] = {0.5, 0.9, 0.99, 0.999, 1.0};
static const char *const share_names[] = {"p50_us", "p90_us", "p99_us", "p99_9_us", "max_us"};
enum { SHARES = 5 };

static const struct {
    const char *name, *key, *meaning;
} series[KN_SERIES_COUNT] = {
    [KN_SERIES_ECHO] = {"LCM echo", "lcm_echo", "the same messages to a bare echo and back, without kneadd"},
    [KN_SERIES_POSE] = {"pose to force", "pose_to_force", "from the hand's stamp until the hand has the force"},
    [KN_SERIES_RECEIVE] = {"  receive", "receive", "until the pose is in its mailbox"},
    [KN_SERIES_WAIT] = {"  wait", "wait", "until the tick that uses the pose begins"},
    [KN_SERIES_STEP] = {"  step", "step", "the lattice"},
    [KN_SERIES_GUARD] = {"  guard", "guard", "the output stage"},
    [KN_SERIES_PUBLISH] = {"  publish", "publish", "until the hand has the force"},
    [KN_SERIES_EXECUTION] = {"execution", "execution", "the tick, as kneadd reports: read, step, guard"},
};

// Return the list of poses that a series is computed from.
static const kn_flights *flights_of(const kn_latency *l, int which)
{
    return &l->flights[which == KN_SERIES_ECHO ? KN_LATENCY_ECHO : KN_LATENCY_POSE];
}

// Return the value of one pose in a series, us. NAN: the pose has no such value. INFINITY: no answer ever came.
static double value_us(const kn_flight *f, int which)
{
    // For the series echo and pose, the time lasts until the first answer to this pose or to a later pose.
    bool whole = which <= KN_SERIES_POSE;
    if (whole) return f->newer_ns ? 1e-3 * (double)(f->newer_ns - f->sent_ns) : INFINITY;
    // The times of the stages are known only for poses that were answered and that are in kneadd's trace.
    if (f->back_ns == 0) return NAN;
    if (f->woke_ns == 0 && which != KN_SERIES_EXECUTION) return NAN;
    switch (which) {
    case KN_SERIES_RECEIVE: return 1e-3 * (double)(f->arrived_ns - f->sent_ns);
    case KN_SERIES_WAIT: return 1e-3 * (double)(f->woke_ns - f->arrived_ns);
    case KN_SERIES_STEP: return 1e-3 * (double)(f->stepped_ns - f->woke_ns);
    case KN_SERIES_GUARD: return 1e-3 * (double)(f->guarded_ns - f->stepped_ns);
    case KN_SERIES_PUBLISH: return 1e-3 * (double)(f->back_ns - f->guarded_ns);
    default: return 1e-3 * (double)f->execution_ns;
    }
}

// Collect and sort the values of all series. Leave out poses that were sent outside the piece `work` of
// the hand's path.
bool kn_latency_sort(kn_latency_report *r, const kn_latency *l)
{
    for (int w = 0; w < KN_SERIES_COUNT; w++) {
        const kn_flights *f = flights_of(l, w);
        kn_series *s = &r->series[w];
        s->us = malloc((size_t)(f->count + 1) * sizeof *s->us);
        if (!s->us) return false;
        for (int i = 0; i < f->count; i++) {
            double us = f->list[i].counts ? value_us(&f->list[i], w) : NAN;
            if (isnan(us)) continue;
            s->us[s->count++] = us;
            s->missed += f->list[i].back_ns == 0;
        }
        qsort(s->us, (size_t)s->count, sizeof *s->us, kn_ascending);
    }
    return true;
}

void kn_latency_report_free(kn_latency_report *r)
{
    for (int w = 0; w < KN_SERIES_COUNT; w++) free(r->series[w].us);
}

double kn_series_at(const kn_series *s, double share)
{
    // Compute the index of the nearest rank, counted from 0.
    int rank = (int)ceil(share * s->count) - 1;
    return s->count ? s->us[rank < 0 ? 0 : rank] : NAN;
}

bool kn_latency_kept(const kn_latency_report *r, int n, double *is_us, double *allowed_us)
{
    // The first contract (`which` = 0) concerns p50, the second (1) p99.
    double share = n ? 0.99 : 0.5;
    *is_us = kn_series_at(&r->series[KN_SERIES_POSE], share);
    *allowed_us = kn_series_at(&r->series[KN_SERIES_ECHO], share) +
                  kn_series_at(&r->series[KN_SERIES_EXECUTION], share) + r->contract_us[n];
    return *is_us <= *allowed_us;
}

static void print_us(double us)
{
    if (isnan(us)) printf(" %8s", "-");
    else if (isinf(us)) printf(" %8s", "never");
    else printf(" %8.1f", us);
}

static void print_row(const kn_latency_report *r, int w)
{
    const kn_series *s = &r->series[w];
    printf("%-14s", series[w].name);
    for (int n = 0; n < SHARES; n++) print_us(kn_series_at(s, shares[n]));
    if (w <= KN_SERIES_POSE) printf(" %8d", s->missed);
    else printf(" %8s", "");
    printf("   %s\n", series[w].meaning);
}

bool kn_latency_print(const kn_latency_report *r, const kn_latency *l)
{
    // Print the load average, because it shows if the machine had other work.
    double load[1] = {NAN};
    getloadavg(load, 1);
    printf("%s, %d nodes, tool %s, %d poses of a 1 kHz hand%s%s%s; load average %.1f\n\n", r->scene, r->nodes, l->probe,
           r->series[KN_SERIES_POSE].count, r->phase ? ", phase " : "", r->phase ? r->phase : "",
           l->real_time ? "" : ", normal priority", load[0]);
    printf("%-14s %8s %8s %8s %8s %8s %8s\n", "us", "p50", "p90", "p99", "p99.9", "max", "missed");
    for (int w = 0; w < KN_SERIES_COUNT; w++) print_row(r, w);
    // Count the poses in which the tool touched the object, because the step takes less time without contact.
    int contacts = 0;
    for (int i = 0; i < l->flights[KN_LATENCY_POSE].count; i++)
        contacts += l->flights[KN_LATENCY_POSE].list[i].counts && l->flights[KN_LATENCY_POSE].list[i].contacts > 0;
    printf("\nthe tool touched in %d of these poses; the hand missed %d of its 1 ms cycles and restarted %d times\n",
           contacts, l->missed_ms, l->interrupted);
    bool kept = true;
    for (int n = 0; n < 2; n++) {
        double is_us, allowed_us;
        if (r->contract_us[n] < 0) continue;
        bool good = kn_latency_kept(r, n, &is_us, &allowed_us);
        printf("contract: %s %.1f us, LCM echo + execution + %.0f us is %.1f: %s\n", n ? "p99" : "p50", is_us,
               r->contract_us[n], allowed_us, good ? "kept" : "missed");
        kept &= good;
    }
    return kept;
}

void kn_latency_json(const kn_latency_report *r, const kn_latency *l)
{
    json_t *to = kn_result(), *all = json_object();
    kn_result_text(to, "scene", r->scene);
    kn_result_integer(to, "nodes", r->nodes);
    if (r->phase) kn_result_text(to, "phase", r->phase);
    kn_result_bool(to, "real_time", l->real_time);
    kn_result_number(to, "drift_ppm", l->drift_ppm);
    for (int w = 0; w < KN_SERIES_COUNT; w++) {
        const kn_series *s = &r->series[w];
        json_t *one = json_object();
        kn_result_integer(one, "count", s->count);
        kn_result_integer(one, "missed", s->missed);
        for (int n = 0; n < SHARES; n++) kn_result_number(one, share_names[n], kn_series_at(s, shares[n]));
        json_object_set_new(all, series[w].key, one);
    }
    json_object_set_new(to, "series", all);
    for (int n = 0; n < 2; n++) {
        double is_us, allowed_us;
        if (r->contract_us[n] < 0) continue;
        json_t *one = kn_result_add("contract");
        kn_result_text(one, "of", share_names[n ? 2 : 0]);
        kn_result_bool(one, "kept", kn_latency_kept(r, n, &is_us, &allowed_us));
        kn_result_number(one, "is_us", is_us);
        kn_result_number(one, "allowed_us", allowed_us);
    }
}

// Draw the share of the poses that were answered within a time, against this time. The axis of the share is in nines
// (90 %, 99 %, 99.9 %), so that a tail of one pose a second is visible.
int kn_latency_plot(const kn_latency_report *r, const char *path)
{
    static const int drawn[] = {KN_SERIES_ECHO, KN_SERIES_EXECUTION, KN_SERIES_POSE};
    // Gnuplot line types: the measured latency in colour, the two series to compare with in black.
    static const int order[] = {3, 2, 1};
    int code;
    FILE *f = kn_plot_open("latency", path, 900, 560, &code);
    if (!f) return code;
    fputs("set logscale x\nset key bottom right\nset rmargin 4\nset xrange [5:*]\n"
          "set xlabel 'time, µs'\nset ylabel 'share of the poses'\nset yrange [0:4.2]\n"
          "set ytics ('0' 0, '50 %%' 0.30103, '90 %%' 1, '99 %%' 2, '99.9 %%' 3, '99.99 %%' 4)\n",
          f);
    char title[256];
    snprintf(title, sizeof title, "pose to force, %s, %d nodes", r->scene, r->nodes);
    kn_plot_label(f, "title", title);
    fputs("plot ", f);
    for (int d = 0; d < 3; d++)
        fprintf(f, "%s'-' with lines lt %d lw %g title '%s'", d ? ", " : "", order[d],
                drawn[d] == KN_SERIES_POSE ? 3.0 : 2.0, series[drawn[d]].name);
    fputc('\n', f);
    for (int d = 0; d < 3; d++) {
        const kn_series *s = &r->series[drawn[d]];
        // Leave out a share if it is so close to 1 that less than one pose was slower.
        for (double nines = 0; nines <= 4.2 && s->count; nines += 0.01) {
            double share = 1 - pow(10, -nines), us = kn_series_at(s, share);
            if (isfinite(us) && us > 0 && (1 - share) * s->count >= 1) fprintf(f, "%.2f %.4f\n", us, nines);
        }
        fputs("e\n", f);
    }
    return kn_plot_close(f, "latency", path);
}
