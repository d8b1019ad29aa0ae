#ifndef KN_SERVER_BACKEND_DEVICE_JOB_H
#define KN_SERVER_BACKEND_DEVICE_JOB_H
// Private to device.c and device_build.c: a device amid its work. A job is made of requests, each of which may be sent
// again; building one changes only what the request itself asks for.
#include "server/backend/device.h"

enum {
    KN_DEVICE_TALE = 8,        // words behind the reactions: TICK to RESULT_FLAGS
    KN_DEVICE_BUCKETS = 25 * 8 // of the round trips, eight to an octave, from 256 ns
};

typedef enum job { IDLE, IDENTIFY, LOAD, RESUME, STEP, CRC, READ } job;

struct kn_device {
    char uri[KN_LINK_URI], why[KN_LINK_WHY];
    bool linked;
    kn_link link;
    kn_device_state state;
    kn_link_status last; // why it is LOST
    kn_loss loss;        // the same; also why it was not identified or loaded
    kn_device_caps caps;
    uint32_t nonce;       // of our last image, in SCRATCH, by which it is known again: see kn_device_kept
    uint32_t seq, tick;   // the circuit's, when no step is under way
    int32_t nodes, edges; // of what is loaded
    uint16_t limit;       // of a WAIT for a tick

    job job;
    bool out, again;   // a request is under way; one that was sent before
    int misses, tries; // of this request
    bool broken;       // the link is to be opened again
    uint16_t tag;
    int64_t first_ns, sent_ns;
    kn_request request;
    int words;    // words or records that this request brings or reads
    int position; // of the job: those that are done

    // a step
    kn_fixed_bound bound[KN_FIXED_LIST_MAX];
    int count, written, wrote; // bounds there are; the circuit has; this request brings
    bool rung, rings;
    int64_t reaction[KN_FIXED_LIST_MAX][3], began_ns;
    kn_device_result result;

    const kn_fixed_image *image; // to load
    const kn_fixed *from;
    uint32_t image_crc;
    bool shaped;                 // the circuit has what never changes of image
    bool arrived;                // all of from, as STATE_CRC says
    int64_t load_bytes, load_ns; // that went there and back, and how long it took
    bool patient;
    kn_fixed *into;
    uint32_t crc;

    kn_device_stats stats;
    int64_t bucket[KN_DEVICE_BUCKETS];
};

void kn_device_build(kn_device *device);       // the next request of its job, under a new tag
bool kn_device_waits(const kn_device *device); // it begins by waiting, and its reply with that word

// SCRATCH of a circuit that has what never changes of the image, but no state. ~nonce: not even that, nonce: both.
uint32_t kn_device_kept(const kn_device *device);
int64_t kn_device_state_bytes(int32_t nodes, int32_t edges); // of a load's second part, on a line

#endif
