#ifndef KN_SERVER_BACKEND_FPGA_H
#define KN_SERVER_BACKEND_FPGA_H
// The lattice on a circuit, in step with its twin on this processor. Both compute the same integers (core/fixed.h), so
// the force is the same to the bit whichever of them gives it, and losing the circuit causes no jump.
//
//     submit   twin finds which tool touches which node -> circuit begins; twin computes the tick meanwhile
//     wait     circuit's reactions, residual and flags by the deadline, equal to the twin's          -> OK
//              late, lost, or another number: the twin's result is used                              -> SHADOWED
//
// A tick that was late stays in a queue, and the circuit catches up. A circuit that was lost or gave other numbers is
// identified, loaded with a copy of the twin's state, and led through the queue. It is in step again when the queue is
// empty. A thread beside the servo loop does this, and starts again when the object is replaced.
//
// The unchanging part of an object is loaded first. Ticks must be queued only while the state is being loaded.
//
//     prepare ------------> copy of the state --> load ------------> catch up ---> in step
//     no tick is kept       the queue begins      it grows by 1 a ms  it shrinks
//
// The queue is half as long again as a load of the state takes, by the bytes that went over the link so far, and never
// shorter than 1024 ticks. It is made anew when the link has become slower.
#include "server/backend/backend.h"
#include "server/backend/device.h"

#define KN_FPGA_LINE (KN_LINK_WHY + 200)

typedef struct kn_fpga_counts {
    bool there;         // there is a circuit; otherwise all fields are 0
    int64_t on_circuit; // ticks that the circuit computed, each equal to the twin's
    int64_t shadowed;   // ticks given by the twin alone
    int64_t losses;     // times that the circuit was lost
    int64_t different;  // times that it gave another number
    int64_t loads;      // whole states that it was given
    int64_t queue;      // ticks that may wait for it
    int64_t load_ns;    // time that loading a state takes
    bool in_step;       // now
    kn_loss last;       // latest reason for being out of step; KN_LOSS_COUNT: never
    // Times that it was out of step for each reason: losses, and reasons that kept it from coming back. A reason that
    // lasts is counted once.
    int64_t because[KN_LOSS_COUNT];
    int64_t reasons;                // sum of because
    bool behind;                    // it has the object and catches up
    int64_t timeouts, crc;          // unanswered requests, broken frames: as of some ticks ago, as is the line below
    int64_t p50_ns, p99_ns, max_ns; // from submit to result
} kn_fpga_counts;

// Open the device (URIs: see link.h), identify and load it. Borrows a model of KN_SOLVER_FIXED with steps of 1 ms.
// room: bytes that its queue may take; all of them are touched here. On failure return false, with one line in why;
// *device tells whether the device is to blame and not the scene.
bool kn_backend_fpga(kn_backend *backend, const kn_model *model, const char *uri, size_t room, char why[KN_LINK_WHY],
                     bool *device);

// Create the backend of a lattice: the circuit at uri or, if uri is NULL, this processor. at_leisure: a replay, in
// which a simulated circuit may take its time, so that an answer is a miss later than for a servo. Return value as of
// kn_backend_fpga.
bool kn_backend_place(kn_backend *backend, const kn_model *model, const char *uri, bool at_leisure, size_t room,
                      char why[KN_LINK_WHY], bool *device);

// Get the counts. Return false for any other backend. May be called from any thread.
bool kn_backend_fpga_counts(const kn_backend *backend, kn_fpga_counts *counts);

// Get a line about a loss, without kneadd's name. Return false if there was none since the last call. Call from one
// thread only.
bool kn_backend_fpga_news(kn_backend *backend, char line[KN_FPGA_LINE]);

// Check, when nobody steps the backend any more, that the circuit is in step and that its whole state is the twin's, by
// their checksums. Return false with the reason in why. Also gives the device's own counters.
bool kn_backend_fpga_agrees(kn_backend *backend, char why[KN_LINK_WHY], kn_device_stats *stats);

// Return true if a --backend names a device by URI.
bool kn_backend_is_device(const char *name);

#endif
