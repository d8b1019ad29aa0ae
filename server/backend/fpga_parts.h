#ifndef KN_SERVER_BACKEND_FPGA_PARTS_H
#define KN_SERVER_BACKEND_FPGA_PARTS_H
// Private to fpga.c and fpga_offload.c: the backend of a circuit, and the circuit that computes alone.
#include "core/solver_fixed.h"
#include "server/backend/fpga.h"
#include <pthread.h>
#include <stdatomic.h>

// Time left before the deadline for the output stage, publishing and the rest of the tick, ns.
#define KN_FPGA_SPARE_NS 400000
#define KN_FPGA_ANSWER_NS 200000000     // longest time that the thread waits for one answer, ns
#define KN_FPGA_PATIENCE_NS 10000000000 // longest time for one tick in a replay, which has no clock, ns
#define KN_FPGA_LATE_MOST 3             // ticks that may wait for a circuit that computes alone; the last one loses it

typedef struct slot { // one tick of the twin that the circuit still has to compute
    int count;
    kn_fixed_bound *bound;  // [bounds] nodes under tools in this tick
    int64_t (*reaction)[3]; // [bounds] the twin's reaction at each of these nodes
    int64_t residual;
    uint32_t flags;
} slot;

// Queue of ticks that the circuit still has to compute. The servo adds ticks; the thread that uses the device removes
// them.
typedef struct queue {
    uint32_t length; // number of slots, a power of two, so that the counts may wrap
    slot *slot;      // [length] the queued ticks
} queue;

enum { SERVO, THREAD }; // thread that uses the device at present
// State of the copy of the twin's state.
enum { NOTHING, WANTED, TAKEN };

// A circuit that computes alone (fpga.h).
typedef struct offload {
    bool on;         // the circuit computes alone now
    bool still;      // the object stands still in this tick, because the circuit is not in step
    kn_state *whole; // newest whole state
    int age;         // number of ticks that the object has taken since `whole`
    bool reading;    // the circuit is being asked for a whole state
    kn_input input[KN_FPGA_LATE_MOST];
    int waiting; // number of entries of `input` whose ticks have not been computed, the oldest first
    int64_t until_ns, began_ns, sleep_ns; // `sleep_ns`: sleep from the submission of a tick until the first look
    kn_device_result result;
    bool answered; // `result` is that of the oldest waiting tick
    bool checks;   // the processor computes the next tick as well, from f->copy
    bool late;     // the circuit has not answered in the time of this tick
    kn_loss wrong; // reason of a loss in the present tick; KN_LOSS_COUNT: none
    bool clock;    // the latest caller of `wait` has a clock
    bool fell;     // the object went back to `whole`, and `wait` has not yet returned LOST for it
    int32_t *moves;
    slot expected; // what the processor has computed for a checked tick
    kn_output output;
    atomic_int back; // number of ticks by which the object went back at the latest loss; -1: it was replaced since
} offload;

typedef struct fpga {
    kn_backend twin;
    const kn_model *model;
    kn_device *device;
    queue queue;
    int bounds; // number of bounds (nodes under tools) that a slot can hold
    // `made`: number of ticks queued by the servo; `done`: number removed by the thread that uses the device
    _Atomic uint32_t made, done;
    slot *current; // slot of the present tick; NULL: the present tick is not queued
    bool fits;     // true if the present tick has no more nodes under tools than the circuit accepts
    // true if the circuit is computing the oldest queued tick; for the thread that uses the device
    bool flying;
    // all saturation flags since the circuit was loaded; for the thread that uses the device
    uint32_t flags;
    atomic_int speaker, copy_is;
    atomic_bool following; // true while ticks are queued for the circuit
    atomic_bool stop;
    kn_fixed copy;
    void *copy_memory;
    int wake; // eventfd that wakes the thread
    pthread_t thread;
    bool runs;
    _Atomic int64_t on_circuit, shadowed, losses, different, loads;
    _Atomic int64_t load_ns;
    _Atomic int64_t because[KN_LOSS_COUNT];
    // `out`: reason (kn_loss) why the circuit is out of step, KN_LOSS_COUNT: in step; `last`: the latest such reason
    atomic_int out, last;
    const char *notice; // notice of the link
    int told;           // the last loss that was written into `line`; used by the thread only
    atomic_bool news;   // true if `line` holds a message and belongs to its reader
    char line[KN_FPGA_LINE];
    // copies of the device's counters, which other threads may read
    _Atomic int64_t timeouts, crc, p50_ns, p99_ns, max_ns;
    // number of ticks since the device's counters were copied; used by the servo only
    int ticks;
    kn_shadow shadow;
    bool goes_on; // without a full shadow: the processor computes the ticks while the circuit is lost
    offload off;
} fpga;

// --- fpga.c
static inline bool kn_fpga_empty(const fpga *f) { return atomic_load(&f->done) == atomic_load(&f->made); }
// Return the reason of a failed call. Only for the thread that uses the device.
kn_loss kn_fpga_cause(const fpga *f, kn_link_status status);
void kn_fpga_lose(fpga *f, kn_loss loss); // record a loss and hand the device to the thread
// Return true if the circuit's reactions and residual equal the twin's.
bool kn_fpga_equal(const slot *s, const kn_device_result *r);
void kn_fpga_watch(fpga *f); // let the twin's steps call the backend; drops a step that the circuit was late for

// --- fpga_offload.c
bool kn_offload_open(fpga *f);
void kn_offload_close(fpga *f);
// Check that the processor need not compute every tick: that the circuit and its link give a tick's displacements, and
// now and then a whole state, in the time that a tick leaves for them. The circuit must be loaded, and has to be loaded
// again afterwards. Return LATE, and the times in `why`, if they do not.
kn_link_status kn_offload_check(fpga *f, const char *uri, char why[KN_LINK_WHY]);
// Take the input of a tick. Return false if the twin has to compute it.
bool kn_offload_submit(fpga *f, const kn_input *input);
// Return true if kn_offload_wait has the result of the tick, and not the twin.
bool kn_offload_has(const fpga *f);
// `clock`: the caller is a servo loop, which must not wait long for a state either.
kn_backend_status kn_offload_wait(fpga *f, bool clock, int64_t until_ns, kn_output *output);
bool kn_offload_still(const fpga *f); // return true if the object stands still because the circuit is not in step
// Let the circuit compute the tick. Store the new positions and displacements in `engine`, as the circuit does.
kn_fixed_where kn_offload_tick(fpga *f, const kn_fixed_bound *bound, int count, kn_fixed *engine,
                               int64_t (*reaction)[3], kn_fixed_result *result);
void kn_offload_afterwards(fpga *f);
const kn_state *kn_offload_state(fpga *f);
void kn_offload_lose(fpga *f, kn_loss loss); // the circuit is lost between two ticks
void kn_offload_end(fpga *f);                // the object is replaced

#endif
