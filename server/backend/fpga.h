#ifndef KN_SERVER_BACKEND_FPGA_H
#define KN_SERVER_BACKEND_FPGA_H
// The lattice on a circuit, in step with its twin on this processor: the same integers (core/fixed.h), so whoever gives
// the force, it is the same to the bit, and a circuit that is lost is lost without a jump.
//
//     submit   twin finds who touches what -> circuit begins; twin computes the tick meanwhile
//     wait     circuit's reactions, residual and flags by the deadline, equal to the twin's          -> OK
//              late, lost, or another number: the twin's stand                                       -> SHADOWED
//
//     a tick that was late stays in a queue, and the circuit catches up; one that is lost, or differs, is identified,
//     loaded with a copy of the twin's state, led through the queue, and hands forces again when that is empty. All
//     that is a thread's work beside the servo; it begins anew where the object is replaced.
//
//     what never changes of an object goes first; only while its state is on the way have ticks to be kept
//
//     prepare ------------> copy of the state --> load ------------> catch up ---> in step
//     no tick is kept       the queue begins      it grows by 1 a ms  it shrinks
//
// The queue is made for half as much again as that load takes, by the bytes that went over the link so far, and never
// for less than 1024 ticks; it is made anew where the link has become slower.
#include "server/backend/backend.h"
#include "server/backend/device.h"

#define KN_FPGA_LINE (KN_LINK_WHY + 200)

typedef struct kn_fpga_counts {
    bool there;         // a circuit; else all of this is 0
    int64_t on_circuit; // ticks that it computed, each equal to the twin's
    int64_t shadowed;   // ticks given by the twin alone
    int64_t losses;     // times that it was lost
    int64_t different;  // times that it gave another number
    int64_t loads;      // whole states that it was given
    int64_t queue;      // ticks that may wait for it
    int64_t load_ns;    // that bringing it a state takes
    bool in_step;       // now
    kn_loss last;       // the latest reason why it was not, KN_LOSS_COUNT: it always was
    // Times that it was out of step for this reason: those of losses, and what then kept it from coming back. What
    // stays the reason for a while is one.
    int64_t because[KN_LOSS_COUNT];
    int64_t reasons;    // all of those
    bool behind;        // it has the object, and catches up
    int64_t timeouts, crc; // requests without an answer in time, broken frames: as of some ticks ago, as the next
    int64_t p50_ns, p99_ns, max_ns; // from submit to result
} kn_fpga_counts;

// Opens the device (link.h says the URIs), identifies and loads it. Borrows a model of KN_SOLVER_FIXED, in steps of
// 1 ms. room: bytes that its queue may have; all of them are touched here. False: why is one line; device: it is the
// device's, not the scene's.
bool kn_backend_fpga(kn_backend *backend, const kn_model *model, const char *uri, size_t room, char why[KN_LINK_WHY],
                     bool *device);

// Where a lattice is stepped: by that circuit, or, uri NULL, on this processor. A replay is at leisure: a circuit that
// is simulated takes as long as it takes, so an answer is missed later than a servo would. False as kn_backend_fpga.
bool kn_backend_place(kn_backend *backend, const kn_model *model, const char *uri, bool at_leisure, size_t room,
                      char why[KN_LINK_WHY], bool *device);

// False for any other backend. From any thread.
bool kn_backend_fpga_counts(const kn_backend *backend, kn_fpga_counts *counts);

// What there is to say of a loss: one line, without kneadd's name. False: nothing since the last one. Of one thread.
bool kn_backend_fpga_news(kn_backend *backend, char line[KN_FPGA_LINE]);

// Nobody steps it any more: is the circuit in step, and its whole state the twin's, by their checksums? False: why.
// Also the device's own counters.
bool kn_backend_fpga_agrees(kn_backend *backend, char why[KN_LINK_WHY], kn_device_stats *stats);

// Whether a --backend is a device's URI.
bool kn_backend_is_device(const char *name);

#endif
