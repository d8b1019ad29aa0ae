#ifndef KN_SERVER_BACKEND_CIRCUIT_DEVICE_H
#define KN_SERVER_BACKEND_CIRCUIT_DEVICE_H
// A circuit behind a link, which steps a lattice of core/fixed.h. This module performs the operations load, step and
// read on the circuit's registers (hdl/registers.h). A kn_fixed that is stepped in parallel on the processor has the
// same bits.
//
//     CLOSED -open-> CLOSED -identify-> IDENTIFIED -load-> LOADING -> SYNCED  submit, wait, submit, wait ...
//                                 ^                                              |
//                                 '------------------------------- LOST <--------' 3 misses, 5 ms, or not its own state
//
// A request without an answer within link.miss_ns (1.6 ms unless its URI says otherwise, plus the time on the wire) is
// a miss and is sent again. A request whose answer arrived damaged is sent again at once. The device is LOST after
// three misses, or after three times link.miss_ns. A tick is executed once, however often its request is sent. For this
// purpose each request writes its own number to the circuit's doorbell register. The answer counts only if the
// circuit's numbers of requests and ticks are the expected ones. When the device is lost during a step, the circuit may
// have executed the step or not, and is loaded anew.
//
// Only open allocates memory, and identify when it must open the link again. submit, wait and moves are real-time
// safe if the link is, and return by their deadline (CLOCK_MONOTONIC, ns). load and read compute a checksum of the
// whole state, which takes milliseconds, too long for the servo loop. A call that returns LATE has not ended its work.
// Repeating the same call continues the work; kn_device_identify drops the work. Not thread-safe.
#include "core/fixed.h"
#include "server/backend/link.h"
#include "server/backend/loss.h"

typedef enum kn_device_state {
    KN_DEVICE_CLOSED, // it is not known whether a circuit is at the other end of the link
    KN_DEVICE_IDENTIFIED,
    KN_DEVICE_LOADING,
    KN_DEVICE_SYNCED, // the circuit has the loaded state and can step
    KN_DEVICE_LOST
} kn_device_state;

typedef struct kn_device kn_device;

typedef struct kn_device_caps {
    // Largest numbers of nodes, edges and bounds (nodes under tools) that the circuit accepts.
    int32_t nodes, edges, bounds;
} kn_device_caps;

typedef struct kn_device_result { // result of one tick
    uint32_t tick;                // number of the tick since the state was loaded; the first tick is 1
    uint32_t flags;               // KN_FIXED_SAT_* bits set since the state was loaded
    int64_t residual;             // residual of the step, in the circuit's force unit phi
    int count;
    // [count] reactions in the order of the bounds, in the circuit's force unit phi; valid until the next submit.
    const int64_t (*reaction)[3];
} kn_device_result;

typedef struct kn_device_stats {
    kn_link_counts link;
    int64_t steps;    // number of results returned to the caller
    int64_t retries;  // number of requests that were sent again
    int64_t timeouts; // number of requests that were not answered in time
    int64_t lost;     // number of times that the device was lost
    // Median, 99th percentile and maximum of the time from submit to result, ns; accurate to 9 %.
    int64_t p50_ns, p99_ns, max_ns;
} kn_device_stats;

// Open the link. Nothing is sent to the circuit yet. Return NULL on failure; `why` is then one line.
kn_device *kn_device_open(const char *uri, char why[KN_LINK_WHY]);
void kn_device_close(kn_device *device); // `device` may be NULL

kn_device_state kn_device_state_of(const kn_device *device);
const char *kn_device_why(const kn_device *device); // reason of the last refusal or loss, one line
// Reason of the last refusal or loss as an enum; KN_LOSS_COUNT: there was none.
kn_loss kn_device_loss(const kn_device *device);

// Check that the other end is a circuit of exactly this register map. Works in every state and drops unfinished work.
// Return PROTOCOL if the other end is no circuit, or a circuit with another register map; kn_device_why gives the
// reason.
kn_link_status kn_device_identify(kn_device *device, int64_t deadline_ns);
const kn_device_caps *kn_device_caps_of(const kn_device *device);
const kn_link *kn_device_link(const kn_device *device); // the options of its URI; valid while the device is open

// Load an image and a state (positions x, displacements u in the last tick, and spring forces h; see core/fixed.h).
// Both are borrowed until the load has ended. The device must be IDENTIFIED or SYNCED; it ends SYNCED at tick 0 with
// flags cleared. `state` NULL: load only the unchanging part of the image, so that a later load only has to send the
// state; the device ends IDENTIFIED. Return PROTOCOL if kn_fixed_check refuses the image, if the image does not fit, or
// if the circuit did not receive the bytes that were sent. The unchanging part of the image is sent first, but not to a
// circuit that is known to have this part.
kn_link_status kn_device_load(kn_device *device, const kn_fixed_image *image, const kn_fixed *state,
                              int64_t deadline_ns);

// Return the time that sending a state takes, ns, estimated from the bytes and times of earlier loads; 0: nothing was
// loaded yet.
int64_t kn_device_load_ns(const kn_device *device, const kn_fixed_image *image);

// Let the requests of a step and of kn_device_identify take ten times link.miss_ns before they count as a miss. The
// requests of a load always may take that long. For callers without a deadline.
void kn_device_be_patient(kn_device *device, bool patient);

// Make the next load send the whole object, whatever parts the circuit reports to have. For callers that got a wrong
// result from the circuit.
void kn_device_distrust(kn_device *device);

// Begin a tick. The device must be SYNCED. The bounds are copied; `count` is 0 .. caps.bounds. Return LATE if the last
// tick has not ended yet.
kn_link_status kn_device_submit(kn_device *device, const kn_fixed_bound *bound, int count);
// Get the result. Return OK if `result` is that of the submitted tick, and LATE if the tick has not ended yet. After
// any other return value the device is LOST.
kn_link_status kn_device_wait(kn_device *device, int64_t deadline_ns, kn_device_result *result);

// For a SYNCED device between two ticks. kn_device_crc gets the checksum (kn_fixed_crc) of the circuit's state.
// kn_device_read gets the state itself (x, u, h), checked against this checksum.
kn_link_status kn_device_crc(kn_device *device, int64_t deadline_ns, uint32_t *crc);
kn_link_status kn_device_read(kn_device *device, kn_fixed *into, int64_t deadline_ns);
// Get the displacements u of all nodes in the last tick, [nodes][3], which costs 3 words a node. The device is the same
// as for kn_device_crc.
kn_link_status kn_device_moves(kn_device *device, int32_t *u, int64_t deadline_ns);

// Return true, and mark the device as LOST, if it is being removed. Between two ticks, for an object that takes none.
bool kn_device_gone(kn_device *device);

void kn_device_stats_of(const kn_device *device, kn_device_stats *stats);

#endif
