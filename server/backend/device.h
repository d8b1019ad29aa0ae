#ifndef KN_SERVER_BACKEND_DEVICE_H
#define KN_SERVER_BACKEND_DEVICE_H
// A circuit that steps a lattice of core/fixed.h, behind a link: its registers (hdl/registers.h) made into load, step,
// read. Whoever steps a kn_fixed beside it has the same bits.
//
//     CLOSED -open-> CLOSED -identify-> IDENTIFIED -load-> LOADING -> SYNCED  submit, wait, submit, wait ...
//                                 ^          '----resume----------------^        |
//                                 '------------------------------- LOST <--------' 3 misses, 5 ms, or not its own state
//
// A request that is not answered within link.miss_ns (1.6 ms unless its URI says otherwise, and the time on the wire)
// is a miss and sent again; what was broken on the way is sent again at once; after three of those times the device is
// LOST. Sent again or not, a tick is taken once: its request rings with a number of its own, and what comes back is
// taken for its result only when the circuit's numbers of requests and of ticks are what they have to be. A step that
// was under way when the device was lost may have been taken or not: resume tells.
//
// Nothing is allocated but by open, and by identify where the link was gone and is opened again. submit, poll and wait
// are real-time safe as the link is, and return by their deadline (CLOCK_MONOTONIC, ns). load, resume and read compute
// a checksum of the whole state: milliseconds, not for the servo. A call that ends LATE has not ended its work: the
// same call goes on with it, identify drops it. Not thread-safe.
#include "core/fixed.h"
#include "server/backend/link.h"
#include "server/backend/loss.h"

typedef enum kn_device_state {
    KN_DEVICE_CLOSED, // nothing is known of the other end
    KN_DEVICE_IDENTIFIED,
    KN_DEVICE_LOADING,
    KN_DEVICE_SYNCED, // it has the state of whoever loaded it, and steps
    KN_DEVICE_LOST
} kn_device_state;

typedef struct kn_device kn_device;

typedef struct kn_device_caps {
    uint32_t version;
    int32_t nodes, edges, bounds; // most that it takes
} kn_device_caps;

typedef struct kn_device_result { // of one tick
    uint32_t tick;                // since it was loaded: 1 is the first
    uint32_t cycles;              // clocks that it took
    uint32_t flags;               // KN_FIXED_SAT_*, since it was loaded
    int64_t residual;             // phi
    int count;
    const int64_t (*reaction)[3]; // [count], of the bounds in their order, phi; the device's until the next submit
} kn_device_result;

typedef struct kn_device_stats {
    kn_link_counts link;
    int64_t steps;                  // results given
    int64_t requests;               // answered
    int64_t retries;                // requests sent again
    int64_t timeouts;               // misses
    int64_t refused;                // answered with an error
    int64_t late;                   // waits that ended at their deadline
    int64_t lost, resyncs, loads;   // times LOST; identified after it; loaded
    int64_t p50_ns, p99_ns, max_ns; // from submit to result; within 9 %
} kn_device_stats;

// NULL: why says it in a line. Opens the link and says nothing to the circuit yet.
kn_device *kn_device_open(const char *uri, char why[KN_LINK_WHY]);
void kn_device_close(kn_device *device); // NULL: nothing

kn_device_state kn_device_state_of(const kn_device *device);
const char *kn_device_why(const kn_device *device); // what the last refusal or loss was about, one line
kn_loss kn_device_loss(const kn_device *device);    // the same, by its name; KN_LOSS_COUNT: there was none

// Is it a circuit of this very register map? From every state; what was under way is dropped. PROTOCOL: it is none, or
// another one, see why.
kn_link_status kn_device_identify(kn_device *device, int64_t deadline_ns);
const kn_device_caps *kn_device_caps_of(const kn_device *device);

// Borrows image and state (its x, u, h; of that image) until it has ended. Wants IDENTIFIED or SYNCED; ends SYNCED at
// tick 0, flags cleared. PROTOCOL: kn_fixed_check refuses the image, it does not fit, or what arrived is not what was
// sent. What never changes of an image goes first, and not again to a circuit that is known to have it still.
kn_link_status kn_device_load(kn_device *device, const kn_fixed_image *image, const kn_fixed *state,
                              int64_t deadline_ns);

// What never changes of it alone, so that a load has only the state left to bring; then IDENTIFIED.
kn_link_status kn_device_prepare(kn_device *device, const kn_fixed_image *image, int64_t deadline_ns);

// ns that the state's part of a load takes, by what went there and back so far; 0: nothing was loaded yet.
int64_t kn_device_load_ns(const kn_device *device, const kn_fixed_image *image);

// Ten times link.miss_ns before a step or an identify is a miss, as of a load's requests: for who is in no hurry.
void kn_device_be_patient(kn_device *device, bool patient);

// Whatever it says, the next load brings all of the object anew: for who has had a wrong number from it.
void kn_device_distrust(kn_device *device);

// IDENTIFIED after LOST: SYNCED again when the circuit still has what this device loaded and its state is this one.
// PROTOCOL: it is not, load it.
kn_link_status kn_device_resume(kn_device *device, const kn_fixed *state, int64_t deadline_ns);

// Begins a tick. Wants SYNCED; copies the bounds, 0 .. caps.bounds of them. LATE: the last one is still under way.
kn_link_status kn_device_submit(kn_device *device, const kn_fixed_bound *bound, int count);
// OK: result is of the tick submitted. LATE: it is still under way. Else: LOST.
kn_link_status kn_device_poll(kn_device *device, kn_device_result *result);
kn_link_status kn_device_wait(kn_device *device, int64_t deadline_ns, kn_device_result *result);

// Of a SYNCED device between two ticks: kn_fixed_crc of its state; its x, u, h, checked by it.
kn_link_status kn_device_crc(kn_device *device, int64_t deadline_ns, uint32_t *crc);
kn_link_status kn_device_read(kn_device *device, kn_fixed *into, int64_t deadline_ns);

void kn_device_stats_of(const kn_device *device, kn_device_stats *stats);

#endif
