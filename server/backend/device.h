#ifndef KN_SERVER_BACKEND_DEVICE_H
#define KN_SERVER_BACKEND_DEVICE_H
// A circuit behind a link, which steps a lattice of core/fixed.h. This file turns its registers (hdl/registers.h) into
// load, step and read. A kn_fixed that is stepped in parallel has the same bits.
//
//     CLOSED -open-> CLOSED -identify-> IDENTIFIED -load-> LOADING -> SYNCED  submit, wait, submit, wait ...
//                                 ^          '----resume----------------^        |
//                                 '------------------------------- LOST <--------' 3 misses, 5 ms, or not its own state
//
// A request without an answer within link.miss_ns (1.6 ms unless its URI says otherwise, plus the time on the wire) is
// a miss and is sent again. A request whose answer came broken is sent again at once. The device is LOST after three
// misses or after three times that long. A tick is taken once, however often its request is sent: the request rings the
// doorbell with a number of its own, and the answer counts only if the circuit's numbers of requests and ticks are the
// expected ones. A step that was under way when the device was lost may have been taken or not; resume tells.
//
// Only open allocates memory, and identify when it must open the link again. submit, poll and wait are real-time safe
// if the link is, and return by their deadline (CLOCK_MONOTONIC, ns). load, resume and read compute a checksum of the
// whole state: milliseconds, too long for the servo loop. A call that returns LATE has not ended its work: the same
// call goes on with it, and identify drops it. Not thread-safe.
#include "core/fixed.h"
#include "server/backend/link.h"
#include "server/backend/loss.h"

typedef enum kn_device_state {
    KN_DEVICE_CLOSED, // nothing is known of the other end
    KN_DEVICE_IDENTIFIED,
    KN_DEVICE_LOADING,
    KN_DEVICE_SYNCED, // it has the loaded state and steps
    KN_DEVICE_LOST
} kn_device_state;

typedef struct kn_device kn_device;

typedef struct kn_device_caps {
    uint32_t version;
    int32_t nodes, edges, bounds; // largest numbers that it takes
} kn_device_caps;

typedef struct kn_device_result { // result of one tick
    uint32_t tick;                // ticks since it was loaded: 1 is the first
    uint32_t cycles;              // clocks of the tick
    uint32_t flags;               // KN_FIXED_SAT_*, since it was loaded
    int64_t residual;             // phi
    int count;
    const int64_t (*reaction)[3]; // [count], in the order of the bounds, phi; valid until the next submit
} kn_device_result;

typedef struct kn_device_stats {
    kn_link_counts link;
    int64_t steps;                  // results given
    int64_t requests;               // requests answered
    int64_t retries;                // requests sent again
    int64_t timeouts;               // misses
    int64_t refused;                // answered with an error
    int64_t late;                   // waits that ended at their deadline
    int64_t lost, resyncs, loads;   // times LOST; times identified after that; times loaded
    int64_t p50_ns, p99_ns, max_ns; // from submit to result; within 9 %
} kn_device_stats;

// Open the link. Nothing is sent to the circuit yet. Return NULL on failure; why is then one line.
kn_device *kn_device_open(const char *uri, char why[KN_LINK_WHY]);
void kn_device_close(kn_device *device); // NULL: does nothing

kn_device_state kn_device_state_of(const kn_device *device);
const char *kn_device_why(const kn_device *device); // reason of the last refusal or loss, one line
kn_loss kn_device_loss(const kn_device *device);    // the same reason by name; KN_LOSS_COUNT: there was none

// Check that the other end is a circuit of exactly this register map. Works in every state and drops a job under way.
// PROTOCOL: it is no circuit, or one of another map; see why.
kn_link_status kn_device_identify(kn_device *device, int64_t deadline_ns);
const kn_device_caps *kn_device_caps_of(const kn_device *device);

// Load image and state (x, u, h of that image), which are borrowed until the load has ended. The device must be
// IDENTIFIED or SYNCED; it ends SYNCED at tick 0 with flags cleared. PROTOCOL: kn_fixed_check refuses the image, it
// does not fit, or the circuit did not receive what was sent. The unchanging part of the image is sent first, and it is
// not sent again to a circuit that is known to have it.
kn_link_status kn_device_load(kn_device *device, const kn_fixed_image *image, const kn_fixed *state,
                              int64_t deadline_ns);

// Load only the unchanging part of the image, so that a later load only has to send the state. Ends IDENTIFIED.
kn_link_status kn_device_prepare(kn_device *device, const kn_fixed_image *image, int64_t deadline_ns);

// Return the time that sending a state takes, ns, from the bytes and times so far; 0: nothing was loaded yet.
int64_t kn_device_load_ns(const kn_device *device, const kn_fixed_image *image);

// Let a step and an identify take ten times link.miss_ns before they are a miss, as the requests of a load always may.
// For callers without a deadline.
void kn_device_be_patient(kn_device *device, bool patient);

// Make the next load send the whole object, whatever the circuit says that it has. For callers that got a wrong number.
void kn_device_distrust(kn_device *device);

// After LOST and identify: become SYNCED again if the circuit still has what this device loaded, and this state.
// PROTOCOL: it has not; load it.
kn_link_status kn_device_resume(kn_device *device, const kn_fixed *state, int64_t deadline_ns);

// Begin a tick. The device must be SYNCED; the bounds are copied, 0 .. caps.bounds of them. LATE: the last tick is
// still under way.
kn_link_status kn_device_submit(kn_device *device, const kn_fixed_bound *bound, int count);
// Get the result. OK: result is that of the submitted tick. LATE: the tick is still under way. Otherwise: LOST.
kn_link_status kn_device_poll(kn_device *device, kn_device_result *result);
kn_link_status kn_device_wait(kn_device *device, int64_t deadline_ns, kn_device_result *result);

// For a SYNCED device between two ticks: get kn_fixed_crc of its state, or its x, u, h, checked against that CRC.
kn_link_status kn_device_crc(kn_device *device, int64_t deadline_ns, uint32_t *crc);
kn_link_status kn_device_read(kn_device *device, kn_fixed *into, int64_t deadline_ns);

void kn_device_stats_of(const kn_device *device, kn_device_stats *stats);

#endif
