#ifndef KN_SERVER_BACKEND_FPGA_H
#define KN_SERVER_BACKEND_FPGA_H
// The lattice on a circuit, in step with its twin on this processor. Both compute the same integers (core/fixed.h), so
// the force has the same bits whether it comes from the circuit or from the twin. Losing the circuit therefore causes
// no jump of the force.
//
//     submit   twin finds which tool touches which node -> circuit begins; twin computes the tick meanwhile
//     wait     circuit's reactions, residual and flags by the deadline, equal to the twin's          -> OK
//              late, lost, or another number: the twin's result is used                              -> SHADOWED
//
// A tick that the circuit answered late stays in a queue, and the circuit catches up with the twin. A circuit that was
// lost or gave wrong numbers is identified, loaded with a copy of the twin's state, and steps all ticks in the queue.
// The circuit is in step again when the queue is empty. A separate thread does this work, and starts the work again
// when the object is replaced.
//
// The unchanging part of an object is loaded first. Ticks must be queued only while the state is being loaded.
//
//     prepare ------------> copy of the state --> load ------------> catch up ---> in step
//     no tick is kept       the queue begins      it grows by 1 a ms  it shrinks
//
// With the option shadow=off or checked, the circuit computes alone while it is in step. The twin only finds the contact,
// and takes over the displacements that the circuit gives after each tick. A whole state, which has the strains too, is
// read every 50 ticks, and whenever `state` of the backend is called. With `checked`, the twin also computes the tick
// that follows a whole state. The input of a late tick waits, and its tick is computed before the next one, so the object
// is the same to the bit. The third late tick in a row loses the circuit, and so does any other loss. The object then
// goes back to its newest whole state (LOST). It stands still (STILL) until the circuit is in step, or with lost=go-on
// the twin computes it. The circuit does not clear its flags of saturation, so only the tick that raises a flag has it.
//
// The queue holds 1.5 times the ticks that pass while the state is loaded, and at least 1024 ticks. The loading time is
// estimated from the bytes sent over the link so far. A link that becomes slower later does not get a longer queue.
#include "server/backend/backend.h"
#include "server/backend/circuit_device.h"

#define KN_FPGA_LINE (KN_LINK_WHY + 200)

typedef struct kn_fpga_counts {
    bool there; // true if a circuit is configured; otherwise all fields are 0
    // Number of ticks whose result the circuit computed. If the twin computed the tick as well, the results are equal.
    int64_t on_circuit;
    int64_t shadowed;  // number of ticks whose result came from the twin alone
    int64_t losses;    // number of times that the circuit was lost
    int64_t different; // number of times that the circuit's result differed from the twin's
    int64_t loads;     // number of times that a whole state was loaded into the circuit
    int64_t queue;     // largest number of ticks that may wait in the queue for the circuit
    int64_t load_ns;   // time that loading a state takes, ns
    bool in_step;      // true if the circuit is in step now
    kn_loss last;      // latest reason why the circuit was out of step; KN_LOSS_COUNT: never out of step
    // Number of times that the circuit was out of step, for each reason. Counted are losses, and reasons that kept the
    // circuit from coming back into step. A reason that lasts is counted once.
    int64_t because[KN_LOSS_COUNT];
    int64_t reasons; // sum of the array `because`
    bool behind;     // true if the circuit has the object's state and is catching up with the twin
    // Numbers of unanswered requests and of damaged frames; this line and the next are some ticks old.
    int64_t timeouts, crc;
    int64_t p50_ns, p99_ns, max_ns; // median, 99th percentile and maximum of the time from submit to result, ns
    const char *notice;             // one line on what the link costs (link.h); NULL: none
} kn_fpga_counts;

// Create the backend of a lattice: this processor if `uri` is NULL, or the circuit at `uri` (link.h), which is
// identified and loaded. Borrows `model`, which for a circuit must use the solver KN_SOLVER_FIXED with steps of 1 ms.
// `at_leisure`: true for a replay, in which a simulated circuit may be slow; a request then counts as missed later than
// in a servo loop. `room`: number of bytes that the queue of ticks may take; all of them are touched here. On failure
// put one line in `why`, set *device to true if the device and not the scene is the cause, and return false.
bool kn_backend_place(kn_backend *backend, const kn_model *model, const char *uri, bool at_leisure, size_t room,
                      char why[KN_LINK_WHY], bool *device);

// Get the counts of a circuit's backend. Return false for any other backend. May be called from any thread.
bool kn_backend_fpga_counts(const kn_backend *backend, kn_fpga_counts *counts);

// Get one line about the latest loss of the circuit, without the prefix "kneadd: ". Return false if the circuit was not
// lost since the last call. Call from one thread only.
bool kn_backend_fpga_news(kn_backend *backend, char line[KN_FPGA_LINE]);

// Check that the circuit is in step and that its whole state has the same checksum as the twin's. Call this when no
// thread steps the backend any more. If the check fails, put the reason in `why` and return false. Fill in the device's
// own counters in `stats`.
bool kn_backend_fpga_agrees(kn_backend *backend, char why[KN_LINK_WHY], kn_device_stats *stats);

#endif
