#ifndef KN_CLIENTS_LATENCY_H
#define KN_CLIENTS_LATENCY_H
// The parts of `knead latency`: how long it takes from a pose to the force that answers it, beside what a message and
// its answer cost without anything in between.
//
//     every ms   0 ms   pose ---------> kneadd ---------> force        of the same sizes, through the same
//              0.5 ms   pose ---------> echo ----------> force         receivers, into the same thread
//
// The two take turns within each millisecond, so that whatever else the machine does hits both alike, and only their
// difference in one run is judged. The hand's clock is not the server's: it runs KN_LATENCY_DRIFT_PPM slow, as
// one crystal does beside another, so that a run meets every phase of a free grid.
#include "clients/knead/path.h"
#include "server/bus.h"
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define KN_LATENCY_DRIFT_PPM 100
#define KN_LATENCY_URL_SIZE 64

typedef struct kn_flight { // a pose and its answer; CLOCK_MONOTONIC, 0: never
    int64_t session, seq, sent_ns;
    int64_t back_ns;                                     // the thread that waited for it had decoded the answer
    int64_t newer_ns;                                    // the first answer to it or to a later one of its session
    int64_t execution_ns;                                // as the answer tells
    int64_t arrived_ns, woke_ns, stepped_ns, guarded_ns; // from kneadd's trace
    int32_t contacts;
    bool counts; // the hand was at work
} kn_flight;

typedef struct kn_flights { // in the order of sending
    kn_flight *list;
    int count, capacity;
} kn_flights;

enum { KN_LATENCY_POSE, KN_LATENCY_ECHO, KN_LATENCY_PATHS };

typedef struct kn_latency {
    // asked for
    const char *url;                    // of the kneadd that is measured
    char echo_url[KN_LATENCY_URL_SIZE]; // for the bare echo
    const char *probe;
    const kn_path *path; // of the hand
    const char *work;    // the piece of it that counts
    int seconds;         // of it
    double drift_ppm;
    // measured
    kn_flights flights[KN_LATENCY_PATHS];
    int missed_ms;   // that the hand's own thread came too late for
    int interrupted; // times that the hand had to lift and begin anew
    bool real_time;  // it had its priority
    char error[256];
} kn_latency;

// Moves the hand until its work has taken seconds, or *stop. False and one line in error: nobody answers, or memory.
bool kn_latency_run(kn_latency *l, const volatile int *stop);
void kn_latency_free(kn_latency *l);

// A kneadd of our own; it ends with this process, however that does.
typedef struct kn_latency_served {
    int pid, trace; // 0, -1: none
    FILE *said;     // what kneadd writes on its standard output
    char url[KN_LATENCY_URL_SIZE], mesh_url[KN_LATENCY_URL_SIZE];
    char greeting[512]; // its first line
} kn_latency_served;

// Buses of this process's own, on LCM's group: the URLs of served, and one for the echo.
void kn_latency_served_urls(kn_latency_served *s, char echo_url[KN_LATENCY_URL_SIZE]);
// Starts the kneadd beside this program, else that of PATH, and waits until it serves. An exit code, after a complaint
// of its own or of ours.
int kn_latency_served_start(kn_latency_served *s, const char *scene, const char *phase);
// And gives the poses their stages; false: kneadd ended badly.
bool kn_latency_served_stop(kn_latency_served *s, kn_flights *poses);

// What is said about it. Microseconds. A pose that the next one overtook has no answer of its own and is missed; in the
// percentiles it is as late as the answer to the next, infinitely when there is none.
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
    const char *scene; // its name
    int nodes;
    const char *phase;     // "lock", "free", NULL: not ours to say
    double contract_us[2]; // p50 and p99 may be this much above echo and execution; < 0: none is stated
    kn_series series[KN_SERIES_COUNT];
} kn_latency_report;

bool kn_latency_sort(kn_latency_report *r, const kn_latency *l); // false when memory is short
void kn_latency_report_free(kn_latency_report *r);
double kn_series_at(const kn_series *s, double share);                  // nearest rank; NAN of none
bool kn_latency_print(const kn_latency_report *r, const kn_latency *l); // the table; whether the contract is kept
bool kn_latency_kept(const kn_latency_report *r, int which, double *is_us, double *allowed_us);
int kn_latency_json(const kn_latency_report *r, const kn_latency *l, const char *path); // an exit code
int kn_latency_plot(const kn_latency_report *r, const char *path);

#endif
