#ifndef KN_CLIENTS_LATENCY_H
#define KN_CLIENTS_LATENCY_H
// The parts of `knead latency`, which measures the time from a pose to the force that answers it. A bare echo shows
// what a message and its answer cost without kneadd.
//
//     every ms   0 ms   pose ---------> kneadd ---------> force        messages of the same sizes,
//              0.5 ms   pose ---------> echo ----------> force         received by the same thread
//
// The pose to kneadd and the pose to the echo alternate within each millisecond. Thus any other work of the machine
// affects both alike, and only their difference within one run is judged. The hand's clock runs KN_LATENCY_DRIFT_PPM
// slower than the server's clock, like two different quartz crystals. Thus the poses of one run arrive at every phase
// of the server's free-running tick.
#include "clients/hand/tool_path.h"
#include "server/bus.h"
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define KN_LATENCY_DRIFT_PPM 100
#define KN_LATENCY_URL_SIZE 64

typedef struct kn_flight { // a pose and its answer; times by CLOCK_MONOTONIC, 0: never
    int64_t session, seq, sent_ns;
    // Time at which the receiving thread had decoded the answer to this pose.
    int64_t back_ns;
    // Time of the first answer to this pose or to a later pose of the same session.
    int64_t newer_ns;
    // Duration of the tick that used the pose, as reported in the answer.
    int64_t execution_ns;
    // Times from kneadd's trace: pose arrived, tick began, lattice stepped, output stage done.
    int64_t arrived_ns, woke_ns, stepped_ns, guarded_ns;
    int32_t contacts;
    bool counts; // true: the pose belongs to the measurement, because it was sent during the piece `work`
} kn_flight;

typedef struct kn_flights { // list of poses with their answers, in the order of sending
    kn_flight *list;
    int count, capacity;
} kn_flights;

enum { KN_LATENCY_POSE, KN_LATENCY_ECHO, KN_LATENCY_PATHS };

typedef struct kn_latency {
    // Settings of the measurement.
    const char *url;                    // bus of the measured kneadd
    char echo_url[KN_LATENCY_URL_SIZE]; // bus of the bare echo
    const char *probe;
    const kn_tool_path *path; // path that the hand plays
    const char *work;         // name of the piece of the path whose poses are measured
    int seconds;              // duration of the measurement, counted only while the piece `work` is played, s
    double drift_ppm;
    // Results of the measurement.
    kn_flights flights[KN_LATENCY_PATHS];
    int missed_ms;   // number of 1 ms cycles that the hand's own thread missed
    int interrupted; // number of times that the hand had to lift the tool and start the path again
    bool real_time;  // true: the hand's thread had real-time priority
    char error[256];
} kn_latency;

// Move the hand until the piece `work` has taken `seconds`, or until `*stop` is set. Return false with one line in
// error if nobody answers or memory is short.
bool kn_latency_run(kn_latency *l, const volatile int *stop);
void kn_latency_free(kn_latency *l);

// A kneadd process started by this program. It ends when this program ends, even if this program is killed.
typedef struct kn_latency_served {
    int pid, trace; // pid: process id of kneadd, 0: none; trace: file descriptor of kneadd's trace, -1: none
    FILE *said;     // stream that reads the standard output of kneadd
    char url[KN_LATENCY_URL_SIZE], mesh_url[KN_LATENCY_URL_SIZE];
    char greeting[512]; // first line of kneadd's output
} kn_latency_served;

// Choose URLs of buses that only this process uses, on LCM's multicast group. Store the URLs for kneadd in `s` and the
// URL for the echo in `echo_url`.
void kn_latency_served_urls(kn_latency_served *s, char echo_url[KN_LATENCY_URL_SIZE]);
// Start kneadd and wait until it serves the scene. Use the executable in the folder of this program. If the folder has
// none, search PATH. Return an exit code. On failure kneadd or this program has printed the reason on stderr.
int kn_latency_served_start(kn_latency_served *s, const char *scene, const char *phase);
// Stop kneadd and copy the times of the stages from its trace into `poses`. Return false if kneadd ended with an error.
bool kn_latency_served_stop(kn_latency_served *s, kn_flights *poses);

// Series of measured times, in microseconds. If a newer pose replaces a pose before kneadd has used it, the older pose
// gets no answer of its own and counts as missed. For the percentiles, its latency is measured to the first answer to a
// later pose. The latency is infinite if no later pose was answered.
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
typedef struct kn_series { // times of one stage for all poses, sorted
    double *us;
    int count, missed;
} kn_series;
typedef struct kn_latency_report {
    const char *scene; // name of the measured scene
    int nodes;
    // Phase of kneadd's tick relative to the poses, "lock" or "free"; NULL: unknown, because kneadd ran already.
    const char *phase;
    // Latency contract: [0] for p50, [1] for p99, us. The percentile of the series `pose` may exceed the sum of the
    // percentiles of `echo` and `execution` by at most this time. < 0: no limit.
    double contract_us[2];
    kn_series series[KN_SERIES_COUNT];
} kn_latency_report;

// Sort the values of a measurement into the series of the report. Return false if out of memory.
bool kn_latency_sort(kn_latency_report *r, const kn_latency *l);
void kn_latency_report_free(kn_latency_report *r);
// Return the value at the given share of the sorted series, by nearest rank; the share 0.5 gives the median. Return NAN
// if the series is empty.
double kn_series_at(const kn_series *s, double share);
// Print the table of the latencies. Return true if the latency contract is kept.
bool kn_latency_print(const kn_latency_report *r, const kn_latency *l);
// Return true if the contract of one percentile is kept: p50 if `which` is 0, p99 if it is 1. Store the measured
// latency in `*is_us` and the allowed latency in `*allowed_us`.
bool kn_latency_kept(const kn_latency_report *r, int which, double *is_us, double *allowed_us);
// Add the results to those of --json.
void kn_latency_json(const kn_latency_report *r, const kn_latency *l);
// Draw the results as a picture. Return an exit code.
int kn_latency_plot(const kn_latency_report *r, const char *path);

#endif
