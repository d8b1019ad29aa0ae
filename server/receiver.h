#ifndef KN_SERVER_RECEIVER_H
#define KN_SERVER_RECEIVER_H
// Bytes of a datagram -> a pose the servo may trust, or the reason why not. Pure: the socket is bus.h's, the time
// comes in.
//
// Any LCM sender works unchanged: one LC02 message per datagram, which is
//     "LC02" | sequence u32 | channel, NUL | type hash i64 | fields of probe_pose_t, big-endian
// We do not receive through liblcm: its reassembly and its variable-length decoders write out of bounds on datagrams
// made for it (1.3.1 and 1.5 alike), and multicast on lo is open to every user of the machine. Here the bounds come
// first, every type has a fixed size, fragments are refused, and nothing is allocated. Each datagram ends in exactly
// one counter:
//     received = accepted + sum(rejected)
//
// A probe belongs to the first session that sends it a good pose, until that session has been silent for 1 s; then any
// session may come, the same number with a new seq included. sent_ns is never judged: a played log is old.
//
// A session may say that a pose is its last (KN_BUTTON_LEAVING). Whatever it sends after that is stale until it has been
// silent for 1 s. The probe is free as soon as the servo says that the session has left.
//
// With a key, a pose must be authentic, of this life and of now (auth.h): anybody can record a pose and send it again. A
// KNEAD_HELLO is no pose either; the caller answers it.
// Real-time safe.
#include "server/auth.h"
#include "server/bus.h"
#include "server/servo.h"

// One per line of status_t.rejected, same order; they stand in proto/README.md too. Append only: logs hold the indices.
#define KN_REJECTS(X)                                                                                                  \
    X(INTERFACE, "interface", "did not arrive over lo, or --lan's interface")                                          \
    X(RUNT, "runt", "shorter than an LCM header")                                                                      \
    X(MAGIC, "magic", "neither LC02 nor LC03")                                                                         \
    X(FRAGMENT, "fragment", "LC03: part of a larger message")                                                          \
    X(CHANNEL_END, "channel_end", "channel name without its NUL within 64 bytes")                                      \
    X(CHANNEL, "channel", "not a pose: our own forces and everyone else's traffic")                                    \
    X(PROBE, "probe", "KNEAD_POSE_ of a probe the scene does not have")                                                \
    X(LENGTH, "length", "not the length of probe_pose_t")                                                              \
    X(TYPE, "type", "the type hash of something else")                                                                 \
    X(FRAME, "frame", "a frame other than the scene's")                                                                \
    X(NONFINITE, "nonfinite", "a NaN or an infinity")                                                                  \
    X(QUATERNION, "quaternion", "orientation not of length 1 +- 0.001")                                                \
    X(WORKSPACE, "workspace", "further than 1 m from the origin")                                                      \
    X(SESSION_ZERO, "session_zero", "session 0, which means none")                                                     \
    X(SESSION, "session", "another session owns the probe: a second publisher")                                        \
    X(STALE, "stale", "seq not above the last one: late, repeated or played again")                                    \
    X(CLOCK, "clock", "utime before the last one's")                                                                   \
    X(JUMP, "jump", "faster than 5 m/s, by its own velocity or by its way since the last pose")                        \
    X(RATE, "rate", "more than 5 000 per second")                                                                      \
    X(PEER, "peer", "from an address that --peer does not name")                                                       \
    X(MAC, "mac", "without the key's authentication code, or with a wrong one")                                        \
    X(REPLAYED, "replayed", "authentic, but of another life of kneadd, or not of now")                                 \
    X(HELLO, "hello", "not a pose: a listener asks for this life's number, and is answered")

typedef enum kn_verdict {
#define KN_REJECT(name, text, meaning) KN_REJECT_##name,
    KN_REJECTS(KN_REJECT)
#undef KN_REJECT
        KN_REJECT_COUNT,
    KN_ACCEPTED = -1
} kn_verdict;

const char *kn_verdict_name(kn_verdict verdict);    // "stale"; "accepted"
const char *kn_verdict_meaning(kn_verdict verdict); // of a rejection, in words

#define KN_ENDED_MAX 16 // sessions that left within a second

typedef struct kn_packets { // of one probe's sessions, as health_t has them
    int64_t accepted, lost, late, duplicate, reordered, lost_in_a_row_max;
} kn_packets;

typedef struct kn_source { // who moves one probe
    kn_pose last;          // accepted; session 0: nobody owns the probe
    kn_pose reference;     // accepted; speeds are measured from here. Moves on to last when that is >= 1 ms newer
    int64_t heard_ns;      // when last was accepted
    struct kn_ended {      // sessions that left, remembered until then
        int64_t session, until_ns;
    } ended[KN_ENDED_MAX];
    int64_t credit_ns; // time not yet spent on poses, each of which costs 0.2 ms
    kn_packets packets;
    uint64_t seen;    // bit n: last.seq - n has come
    uint64_t refused; // bit n: last.seq + 1 + n has come, and was not taken
} kn_source;

#define KN_PEERS_MAX 16

typedef struct kn_receiver {
    int probes;
    char channel[KN_PROBES_MAX][64]; // KNEAD_POSE_<probe>
    kn_source source[KN_PROBES_MAX];
    const kn_auth *auth;                // borrowed; NULL: no key
    unsigned char nonce[KN_AUTH_NONCE]; // of the last KN_REJECT_HELLO
    int64_t greeted_ns;                 // when that came
    struct in_addr peer[KN_PEERS_MAX];  // whom poses are taken from
    int peers;                          // 0: anybody
    int64_t received, accepted, rejected[KN_REJECT_COUNT];
} kn_receiver;

void kn_receiver_init(kn_receiver *r, const kn_model_def *def);

// Judge and count one datagram that arrived at now_ns (monotonic). When accepted, *probe and *pose say what it was. After
// KN_REJECT_HELLO the caller answers r->nonce.
kn_verdict kn_receiver_judge(kn_receiver *r, const kn_datagram *datagram, int64_t now_ns, int *probe, kn_pose *pose);

// The same by its bytes alone, whatever came before it: KN_ACCEPTED, it is a pose. Counts nothing.
kn_verdict kn_receiver_read(const kn_receiver *r, const kn_datagram *datagram, int *probe, kn_pose *pose);

// Ends sessions that have been silent for 1 s; returns a bit per probe whose session ended by this call.
unsigned kn_receiver_expire(kn_receiver *r, int64_t now_ns);

// Ends a session of which kn_force.left is told. Returns whether it had the probe until now.
bool kn_receiver_leave(kn_receiver *r, int probe, int64_t session);

#endif
