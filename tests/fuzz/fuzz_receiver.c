// libFuzzer target: for any sequence of datagrams, each ends in one counter, and every accepted one is a valid pose.
// A record of the input is a control byte, then a datagram. The datagram is used as it is, or as bytes that overwrite
// a valid pose, since chance alone finds neither the type hash nor a quaternion of length one.
#include "server/receiver.h"
#include "tests/server/datagram.h"
#include "tests/fuzz/fuzz.h"
#include <math.h>

static double norm(const double *v, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += v[i] * v[i];
    return sqrt(sum);
}

typedef struct reader {
    const uint8_t *at, *end;
} reader;

static unsigned take(reader *in) { return in->at < in->end ? *in->at++ : 0; }

// Control byte: bits 0-1 kind, 2 over lo, 3 the other probe, 4-7 time since the datagram before.
static kn_datagram next_datagram(reader *in, unsigned control, int64_t seq)
{
    kn_datagram d = {.here = control & 4};
    if ((control & 3) == 0) {
        size_t wanted = take(in) | (take(in) & 1) << 8, left = (size_t)(in->end - in->at);
        d.size = wanted < left ? wanted : left;
        memcpy(d.bytes, in->at, d.size);
        in->at += d.size;
        return d;
    }
    knead_probe_pose_t pose = {.utime = 1000 * seq, .session = 1, .seq = seq, .orientation_wxyz = {1, 0, 0, 0}};
    d.size = kn_pose_datagram(d.bytes, sizeof d.bytes, control & 8 ? "KNEAD_POSE_hand" : "KNEAD_POSE_thumb", &pose);
    for (unsigned n = control & 3; n > 1; n--) {
        size_t at = take(in), run = 1 + take(in) % 8;
        for (size_t i = at; i < at + run && i < d.size; i++) d.bytes[i] = (unsigned char)take(in);
    }
    return d;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    kn_model_def def = {.probe_count = 2, .probe = {{.name = "hand"}, {.name = "thumb"}}};
    kn_receiver receiver;
    reader in = {data, data + size};
    int64_t now_ns = 1, count = 0, sum = 0;
    kn_receiver_init(&receiver, &def);
    for (; in.at < in.end; count++) {
        unsigned control = take(&in);
        kn_datagram d = next_datagram(&in, control, count);
        now_ns += INT64_C(1000) << (control >> 3 & 30); // 1 us .. 1 000 s
        int probe = -1;
        kn_pose pose;
        if (kn_receiver_judge(&receiver, &d, now_ns, &probe, &pose) != KN_ACCEPTED) continue;
        require(probe == 0 || probe == 1);
        require(pose.session != 0 && fabs(norm(pose.orientation_wxyz, 4) - 1) <= 1e-3);
        require(norm(pose.position_m, 3) <= 1 && norm(pose.velocity_m_s, 3) <= 5);
        if (control & 64) kn_receiver_leave(&receiver, probe, pose.session);
        if (control & 128) kn_receiver_expire(&receiver, now_ns);
    }
    for (int i = 0; i < KN_REJECT_COUNT; i++) sum += receiver.rejected[i];
    require(receiver.received == count && receiver.accepted + sum == count);
    return 0;
}
