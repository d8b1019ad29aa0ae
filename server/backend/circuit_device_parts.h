#ifndef KN_SERVER_BACKEND_CIRCUIT_DEVICE_PARTS_H
#define KN_SERVER_BACKEND_CIRCUIT_DEVICE_PARTS_H
// Private to circuit_device.c and circuit_device_build.c: a device in the middle of its work. A job consists of
// requests, each of which may be sent again; building one changes only the fields that belong to the request itself.
#include "server/backend/circuit_device.h"

enum {
    KN_DEVICE_TALE = 8, // number of register words read after the reactions, from TICK to RESULT_FLAGS
    // Number of histogram buckets for round-trip times: eight buckets per doubling of the time, from 256 ns up.
    KN_DEVICE_BUCKETS = 25 * 8
};

typedef enum job { IDLE, IDENTIFY, LOAD, STEP, MOVES, CRC, READ } job;

struct kn_device {
    char uri[KN_LINK_URI], why[KN_LINK_WHY];
    bool linked;
    kn_link link;
    kn_device_state state;
    kn_link_status last; // status with which the device was lost
    // Reason of the last loss as an enum; also the reason why the device was not identified or not loaded.
    kn_loss loss;
    kn_device_caps caps;
    // Number, taken from the clock, of the last loaded image, stored in the circuit's SCRATCH register to recognise the
    // image; see kn_device_kept.
    uint32_t nonce;
    uint32_t seq, tick;   // the circuit's numbers of requests and of ticks, valid while no step is under way
    int32_t nodes, edges; // numbers of nodes and edges of the loaded image
    uint16_t limit;       // repetition limit of a WAIT for the end of a tick

    job job;
    bool out, again;   // `out`: a request is under way; `again`: the request was sent before
    int misses, tries; // numbers of misses and of sendings of the present request
    bool broken;       // true if the link must be opened again
    uint16_t tag;
    int64_t first_ns, sent_ns;
    kn_request request;
    int words;    // number of words or records that the present request writes or reads
    int position; // number of words or records of the job that are done

    // A step.
    kn_fixed_bound bound[KN_FIXED_LIST_MAX];
    // `count`: number of bounds of the step; `written`: bounds that the circuit has; `wrote`: bounds in the present
    // request.
    int count, written, wrote;
    // `rung`: the doorbell register of this step has been written; `rings`: the present request writes the doorbell
    // register
    bool rung, rings;
    int64_t reaction[KN_FIXED_LIST_MAX][3], began_ns;
    kn_device_result result;

    const kn_fixed_image *image; // image to be loaded
    const kn_fixed *from;
    uint32_t image_crc;
    bool shaped;                 // true if the circuit has the unchanging part of the image
    bool arrived;                // true if the circuit has all of the state `from`, according to its register STATE_CRC
    int64_t load_bytes, load_ns; // total number of bytes of all loads, in both directions, and their total time
    bool patient;
    void *into; // READ: a kn_fixed; MOVES: displacements
    uint32_t crc;

    kn_device_stats stats;
    int64_t bucket[KN_DEVICE_BUCKETS];
};

void kn_device_build(kn_device *device); // build the next request of the job, with a new tag
// Return true if the request begins with a WAIT; its reply then begins with the word that the WAIT read.
bool kn_device_waits(const kn_device *device);

// Return the value of the SCRATCH register of a circuit that has the unchanging part of the image but no state. SCRATCH
// is ~nonce if the circuit has neither of the two, and nonce if it has both.
uint32_t kn_device_kept(const kn_device *device);

#endif
