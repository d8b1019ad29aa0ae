#ifndef KN_SERVER_BACKEND_DEVICE_JOB_H
#define KN_SERVER_BACKEND_DEVICE_JOB_H
// Private to device.c and device_build.c: a device in the middle of its work. A job consists of requests, each of which
// may be sent again; building one changes only the fields that belong to the request itself.
#include "server/backend/device.h"

enum {
    KN_DEVICE_TALE = 8,        // words read after the reactions: TICK to RESULT_FLAGS
    KN_DEVICE_BUCKETS = 25 * 8 // buckets of round trips: eight to an octave, from 256 ns
};

typedef enum job { IDLE, IDENTIFY, LOAD, RESUME, STEP, CRC, READ } job;

struct kn_device {
    char uri[KN_LINK_URI], why[KN_LINK_WHY];
    bool linked;
    kn_link link;
    kn_device_state state;
    kn_link_status last; // the reason of LOST
    kn_loss loss;        // the same by name; also why it was not identified or loaded
    kn_device_caps caps;
    uint32_t nonce;       // number of our last image, kept in SCRATCH to recognise it; see kn_device_kept
    uint32_t seq, tick;   // the circuit's, while no step is under way
    int32_t nodes, edges; // of the loaded image
    uint16_t limit;       // limit of a WAIT for a tick

    job job;
    bool out, again;   // a request is under way; it was sent before
    int misses, tries; // of this request
    bool broken;       // the link must be opened again
    uint16_t tag;
    int64_t first_ns, sent_ns;
    kn_request request;
    int words;    // words or records that this request writes or reads
    int position; // words or records of the job that are done

    // a step
    kn_fixed_bound bound[KN_FIXED_LIST_MAX];
    int count, written, wrote; // bounds of the step; bounds that the circuit has; bounds in this request
    // rung: the doorbell was rung; rings: this request rings it
    bool rung, rings;
    int64_t reaction[KN_FIXED_LIST_MAX][3], began_ns;
    kn_device_result result;

    const kn_fixed_image *image; // to be loaded
    const kn_fixed *from;
    uint32_t image_crc;
    bool shaped;                 // the circuit has the unchanging part of the image
    bool arrived;                // the circuit has all of `from`, as STATE_CRC says
    int64_t load_bytes, load_ns; // bytes of loads, both ways, and their time
    bool patient;
    kn_fixed *into;
    uint32_t crc;

    kn_device_stats stats;
    int64_t bucket[KN_DEVICE_BUCKETS];
};

void kn_device_build(kn_device *device);       // build the next request of the job, under a new tag
bool kn_device_waits(const kn_device *device); // the request begins with a WAIT, so its reply begins with that word

// SCRATCH of a circuit that has the unchanging part of the image but no state. ~nonce: it has neither; nonce: both.
uint32_t kn_device_kept(const kn_device *device);
int64_t kn_device_state_bytes(int32_t nodes, int32_t edges); // bytes on the line of a load's second part

#endif
