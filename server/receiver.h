#ifndef KN_SERVER_RECEIVER_H
#define KN_SERVER_RECEIVER_H
// The receiver: turn the bytes of a datagram into a pose that the servo may trust, or return the reason for a
// rejection. The receiver is pure: bus.h owns the socket, and the caller passes the time in.
//
// Any LCM sender works unchanged. A datagram is one LC02 message:
//     "LC02" | sequence u32 | channel, NUL | type hash i64 | fields of probe_pose_t, big-endian
// kneadd does not receive through liblcm, whose reassembly and variable-length decoders write out of bounds on crafted
// datagrams (in 1.3.1 and in 1.5), and multicast on lo is open to every user of the machine. Here the bounds are
// checked first, every type has a fixed size, fragments are refused, and nothing is allocated. Each datagram ends in
// exactly one counter:
//     received = accepted + sum(rejected)
//
// A probe belongs to the first session that sends it a good pose, until that session has been silent for 1 s. After
// this silence any session may take the probe, also one with the old session number and a new seq. sent_ns is never
// judged, because the times in a played log are old.
//
// A session may say that a pose is its last (KN_BUTTON_LEAVING). All later poses of that session are stale until the
// session has been silent for 1 s. The probe is free for another session as soon as the servo reports that the session
// has ended.
//
// With a key, a pose must be authentic and recent, and must belong to this life (run) of kneadd, see auth.h. Otherwise
// anybody could record a pose and send it again. KNEAD_HELLO is not a pose: the caller answers this message. Real-time
// safe.
#include "server/auth.h"
#include "server/bus.h"
#include "server/servo.h"

// Reasons of rejection, in the order of status_t.rejected and of the table in proto/REFERENCE.md. Append only: logs
// hold the indices.
#define KN_REJECTS(X)                                                                                                  \
    X(INTERFACE, "interface", "arrived over neither the loopback interface nor the interface of --lan")                \
    X(RUNT, "runt", "the datagram is shorter than an LCM header")                                                      \
    X(MAGIC, "magic", "neither LC02 nor LC03")                                                                         \
    X(FRAGMENT, "fragment", "an LC03 datagram: one part of a larger message")                                          \
    X(CHANNEL_END, "channel_end", "no NUL ends the channel name within 64 bytes")                                      \
    X(CHANNEL, "channel", "not the channel of a pose: kneadd's own messages, or other traffic")                        \
    X(PROBE, "probe", "KNEAD_POSE_<probe> of a probe that the scene does not have")                                    \
    X(LENGTH, "length", "the payload does not have the length of probe_pose_t")                                        \
    X(TYPE, "type", "the type hash is not that of probe_pose_t")                                                       \
    X(FRAME, "frame", "the frame is not FRAME_SCENE")                                                                  \
    X(NONFINITE, "nonfinite", "a value is NaN or infinite")                                                            \
    X(QUATERNION, "quaternion", "the orientation quaternion does not have length 1 +- 0.001")                          \
    X(WORKSPACE, "workspace", "the position is further than 1 m from the origin")                                      \
    X(SESSION_ZERO, "session_zero", "the session is 0, which means no session")                                        \
    X(SESSION, "session", "another session owns the probe")                                                            \
    X(STALE, "stale", "seq is not above that of the last pose: late, repeated or played again")                        \
    X(CLOCK, "clock", "utime is before that of the last pose")                                                         \
    X(JUMP, "jump", "the tool is faster than 5 m/s, by its velocity or by its distance from an earlier pose")          \
    X(RATE, "rate", "more than 5 000 poses per second")                                                                \
    X(PEER, "peer", "the sender's address is not named by --peer")                                                     \
    X(MAC, "mac", "the authentication tag of the key is missing or wrong")                                             \
    X(REPLAYED, "replayed", "authentic, but made for another run of kneadd, or not recent")                            \
    X(HELLO, "hello", "not a pose: a listener asks for the life (run) of kneadd, and gets an answer")

typedef enum kn_pose_verdict {
#define KN_REJECT(name, text, meaning) KN_REJECT_##name,
    KN_REJECTS(KN_REJECT)
#undef KN_REJECT
        KN_REJECT_COUNT,
    KN_ACCEPTED = -1
} kn_pose_verdict;

// Return the name of a verdict, for example "stale"; "accepted" for KN_ACCEPTED.
const char *kn_pose_verdict_name(kn_pose_verdict verdict);
// Return the reason of the rejection in words; must not be called for KN_ACCEPTED.
const char *kn_pose_verdict_meaning(kn_pose_verdict verdict);

#define KN_ENDED_MAX 16 // largest number of ended sessions that are remembered, each until it has been silent for 1 s

typedef struct kn_packets { // link counters of one probe, over all its sessions; defined as in the message health_t
    int64_t accepted, lost, late, duplicate, reordered, lost_in_a_row_max;
} kn_packets;

typedef struct kn_pose_sender { // state of the sender that moves one probe
    kn_pose last;               // last accepted pose; session 0: nobody owns the probe
    // Accepted pose from which speeds are measured; replaced by `last` when `last` is at least 1 ms newer.
    kn_pose reference;
    int64_t heard_ns; // time at which `last` was accepted
    // Sessions that sent their last pose; their further poses are rejected as stale until the time until_ns.
    struct kn_ended {
        int64_t session, until_ns;
    } ended[KN_ENDED_MAX];
    int64_t credit_ns; // rate limit: time credit that grows with time, ns; each pose uses up 0.2 ms of the credit
    kn_packets packets;
    uint64_t seen;    // bit n: the pose with number last.seq - n has arrived
    uint64_t refused; // bit n: the pose with number last.seq + 1 + n has arrived and was rejected
} kn_pose_sender;

#define KN_PEERS_MAX 16

typedef struct kn_receiver {
    int probes;
    char channel[KN_PROBES_MAX][64]; // LCM channel of each probe's poses: KNEAD_POSE_<probe>
    kn_pose_sender source[KN_PROBES_MAX];
    const kn_auth *auth;                // key with which poses are authenticated, borrowed; NULL: no key
    unsigned char nonce[KN_AUTH_NONCE]; // nonce of the last hello message (KN_REJECT_HELLO)
    int64_t greeted_ns;                 // time at which the last hello message arrived, ns
    struct in_addr peer[KN_PEERS_MAX];  // addresses from which poses are accepted
    int peers;                          // number of entries in `peer`; 0: any address is accepted
    int64_t received, accepted, rejected[KN_REJECT_COUNT];
} kn_receiver;

void kn_receiver_init(kn_receiver *r, const kn_model_def *def);

// Judge and count one datagram that arrived at now_ns (monotonic). If the datagram is accepted, set *probe and *pose.
// After KN_REJECT_HELLO the caller must answer with the nonce in r->nonce.
kn_pose_verdict kn_receiver_judge(kn_receiver *r, const kn_datagram *datagram, int64_t now_ns, int *probe,
                                  kn_pose *pose);

// Judge a datagram by its bytes alone, without the checks of session, motion and rate. Return KN_ACCEPTED if it is a
// pose, and set *probe and *pose. The datagram is not counted.
kn_pose_verdict kn_receiver_read(const kn_receiver *r, const kn_datagram *datagram, int *probe, kn_pose *pose);

// End sessions that have been silent for 1 s. Return the probes whose sessions have ended in this call, one bit per
// probe.
unsigned kn_receiver_expire(kn_receiver *r, int64_t now_ns);

// End a session that has left (kn_force.left). Return whether the session owned the probe until now.
bool kn_receiver_leave(kn_receiver *r, int probe, int64_t session);

#endif
