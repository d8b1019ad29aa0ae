#ifndef KN_SERVER_BACKEND_FPGA_PARTS_H
#define KN_SERVER_BACKEND_FPGA_PARTS_H
// Private to fpga.c and fpga_offload.c: the backend of a circuit, and the circuit that computes alone.
#include "core/solver_fixed.h"
#include "server/backend/fpga.h"
#include <pthread.h>
#include <stdatomic.h>

// Time left before the deadline for the output stage, publishing and the rest of the tick, ns.
#define KN_FPGA_SPARE_NS 400000
#define KN_FPGA_ANSWER_NS 200000000 // longest time that waits for one answer outside of the servo, ns
#define KN_FPGA_LATE_MOST 3         // ticks that may wait for a circuit that computes alone; the last one loses it

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
    void *memory;
} queue;

enum { SERVO, THREAD }; // thread that uses the device at present
// State of the copy of the twin's state.
enum { NOTHING, WANTED, TAKEN };

// Without a full shadow, the circuit alone computes the ticks while it is in step. After each tick it gives the
// displacements of the nodes, so that contact is found where the nodes are. The strains follow now and then, and
// whenever somebody asks for the state.
typedef struct offload {
    bool on;         // the circuit alone computes the ticks
    bool still;      // the object stands still in this tick, because the circuit is not in step
    kn_state *whole; // newest state with the strains of its own tick
    int age;         // number of ticks since `whole`
    bool reading;    // a whole state is being read
    kn_input input[KN_FPGA_LATE_MOST];
    int waiting;                          // number of `input` whose ticks have not been computed, the oldest first
    int64_t until_ns, began_ns, sleep_ns; // `sleep_ns`: sleep from the submission of a tick until the first look
    kn_device_result result;
    bool answered; // `result` is that of the oldest waiting tick
    bool checks;   // the processor computes the next tick as well, from f->copy
    bool late;     // the circuit has not answered in the time of this tick
    kn_loss wrong; // why the circuit is lost in the present tick; KN_LOSS_COUNT: it is not
    bool fell;     // the circuit is lost, the object went back to `whole`, and no tick has told so yet
    int32_t *moves;
    slot expected; // what the processor has computed for a checked tick
    kn_output output;
    atomic_int back; // age of the object that was taken up after the last loss, ticks
} offload;

typedef struct fpga {
    kn_backend twin;
    const kn_model *model;
    kn_device *device;
    // `longer`: a longer queue made by the thread, until the servo adopts it together with a copy of the state
    queue queue, longer;
    size_t room; // largest size of a queue, bytes
    int bounds;  // number of bounds (nodes under tools) that a slot can hold
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
    _Atomic int64_t queue_length, load_ns;
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
kn_loss kn_fpga_cause(const fpga *f, kn_link_status status); // return the reason of a failed call
void kn_fpga_lose(fpga *f, kn_loss loss);                    // record a loss and hand the device to the thread
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
kn_backend_status kn_offload_wait(fpga *f, int64_t until_ns, kn_output *output);
// Let the circuit compute the tick. Store the new positions and displacements in `engine`, as the circuit does.
kn_fixed_where kn_offload_tick(fpga *f, const kn_fixed_bound *bound, int count, kn_fixed *engine,
                               int64_t (*reaction)[3], kn_fixed_result *result);
void kn_offload_afterwards(fpga *f);
const kn_state *kn_offload_state(fpga *f);
void kn_offload_end(fpga *f); // the object is replaced

#endif
