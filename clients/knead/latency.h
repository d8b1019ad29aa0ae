#ifndef KN_CLIENTS_LATENCY_H
#define KN_CLIENTS_LATENCY_H
// The parts of `knead latency`, which measures the time from a pose to the force that answers it. A bare echo shows
// what a message and its answer cost with nothing in between.
//
//     every ms   0 ms   pose ---------> kneadd ---------> force        of the same sizes, through the same
//              0.5 ms   pose ---------> echo ----------> force         receivers, into the same thread
//
// The two take turns within each millisecond. Any other work of the machine affects both alike, and only their
// difference within one run is judged. The hand's clock runs KN_LATENCY_DRIFT_PPM slower than the server's, as two
// crystals differ. Thus a run meets every phase of a free-running tick.
#include "clients/knead/path.h"
#include "server/bus.h"
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define KN_LATENCY_DRIFT_PPM 100
#define KN_LATENCY_URL_SIZE 64

typedef struct kn_flight { // a pose and its answer; times by CLOCK_MONOTONIC, 0: never
    int64_t session, seq, sent_ns;
    int64_t back_ns;                                     // time at which the waiting thread had decoded the answer
    int64_t newer_ns;                                    // time of the first answer to this or a later pose of session
    int64_t execution_ns;                                // duration of the tick, as reported by the answer
    int64_t arrived_ns, woke_ns, stepped_ns, guarded_ns; // from kneadd's trace
    int32_t contacts;
    bool counts; // sent while the piece `work` was played
} kn_flight;

typedef struct kn_flights { // in the order of sending
    kn_flight *list;
    int count, capacity;
} kn_flights;

enum { KN_LATENCY_POSE, KN_LATENCY_ECHO, KN_LATENCY_PATHS };

typedef struct kn_latency {
    // Settings.
    const char *url;                    // of the measured kneadd
    char echo_url[KN_LATENCY_URL_SIZE]; // of the bare echo
    const char *probe;
    const kn_path *path; // of the hand
    const char *work;    // name of the path's piece that counts
    int seconds;         // time of `work` to measure
    double drift_ppm;
    // Results.
    kn_flights flights[KN_LATENCY_PATHS];
    int missed_ms;   // milliseconds that the hand's own thread missed
    int interrupted; // number of times that the hand had to lift and start again
    bool real_time;  // the hand's thread had real-time priority
    char error[256];
} kn_latency;

// Move the hand until the piece `work` has taken `seconds`, or until `*stop` is set. Return false with one line in
// error if nobody answers or memory is short.
bool kn_latency_run(kn_latency *l, const volatile int *stop);
void kn_latency_free(kn_latency *l);

// A kneadd started by this program. It ends with this process, however the process ends.
typedef struct kn_latency_served {
    int pid, trace; // process id, 0: none; descriptor of kneadd's trace, -1: none
    FILE *said;     // standard output of kneadd
    char url[KN_LATENCY_URL_SIZE], mesh_url[KN_LATENCY_URL_SIZE];
    char greeting[512]; // first line of kneadd's output
} kn_latency_served;

// Choose buses for this process alone, on LCM's multicast group: the URLs in `s`, and one for the echo.
void kn_latency_served_urls(kn_latency_served *s, char echo_url[KN_LATENCY_URL_SIZE]);
// Start the kneadd beside this program, else the one in PATH, and wait until kneadd serves. Return an exit code. On
// failure kneadd or this program has given the reason on stderr.
int kn_latency_served_start(kn_latency_served *s, const char *scene, const char *phase);
// Stop kneadd and fill in the stages of the poses. Return false if kneadd ended with an error.
bool kn_latency_served_stop(kn_latency_served *s, kn_flights *poses);

// Results, in microseconds. A pose that a newer pose replaced before kneadd used it has no answer of its own and counts
// as missed. In the percentiles its latency lasts until the first answer to a later pose, or is infinite if no later
// pose was answered.
enum {
    KN_SERIES_ECHO,
    KN_SERIES_POSE,
    KN_SERIES_RECEIVE,
    KN_SERIES_WAIT,
    KN_SERIES_STEP,
    KN_SERIES_GUARD,
    KN_SERIES_PUBLISH,
    KN_SERIES_EXECUTION,
    KN_SERIES_COUNT
};
typedef struct kn_series { // sorted
    double *us;
    int count, missed;
} kn_series;
typedef struct kn_latency_report {
    const char *scene; // name of the scene
    int nodes;
    const char *phase; // "lock", "free"; NULL: kneadd ran already, phase unknown
    // Contract: allowed excess of p50 and p99 of the pose series over the sum of echo and execution, us; < 0: none.
    double contract_us[2];
    kn_series series[KN_SERIES_COUNT];
} kn_latency_report;

// Sort the values of a measurement into the series of the report. Return false if out of memory.
bool kn_latency_sort(kn_latency_report *r, const kn_latency *l);
void kn_latency_report_free(kn_latency_report *r);
// Return the value at the given share (0.5: median) of the sorted series, by nearest rank. NAN for an empty series.
double kn_series_at(const kn_series *s, double share);
// Print the table. Return true if the contract is kept.
bool kn_latency_print(const kn_latency_report *r, const kn_latency *l);
// Return true if a contract is kept (which = 0: p50, 1: p99). Store the measured and the allowed latency.
bool kn_latency_kept(const kn_latency_report *r, int which, double *is_us, double *allowed_us);
// Write the results as JSON, or draw them as a picture. Return an exit code.
int kn_latency_json(const kn_latency_report *r, const kn_latency *l, const char *path);
int kn_latency_plot(const kn_latency_report *r, const char *path);

#endif
