#include "server/receiver.h"
#include "proto/knead_probe_pose_t.h"
#include "server/wire.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

#define CHANNEL_PREFIX "KNEAD_POSE_"

// largest accepted | |q| - 1 | of an orientation quaternion q; rounding to float in a device causes a smaller error,
// and a larger error means that q is no rotation
#define QUATERNION_BOUND 1e-3
#define WORKSPACE_M 1.0 // largest distance of a valid pose from the origin, m; no haptic device reaches further
// largest speed of a valid pose, m/s; no hand on a device is faster. The brake speed of a scene, above which the hand
// feels only damping, is at most this speed, so no contact force is lost.
#define SPEED_MAX_M_S 5.0
// shortest time over which a speed is measured, us: one tick. So a move of less than 5 mm is never a jump, whatever the
// time stamps are.
#define SPEED_WINDOW_US 1000
#define SILENCE_NS 1000000000 // time without poses after which a session ends, ns
#define LATE_NS 1000000       // delay from which a pose counts as late, ns: one tick
#define HELLO_NS 100000       // shortest time between two answers to hello messages, ns
#define COST_NS 200000        // rate limit: time credit that one pose uses up, ns; allows 5 kHz
// rate limit: largest time credit, ns, enough for 1 000 poses: after a stall a 1 kHz sender may send the poses of 1 s
// at once
#define CREDIT_NS 200000000

const char *kn_pose_verdict_name(kn_pose_verdict verdict)
{
    static const char *const names[] = {
#define KN_REJECT(name, text, meaning) text,
        KN_REJECTS(KN_REJECT)
#undef KN_REJECT
    };
    return verdict == KN_ACCEPTED ? "accepted" : names[verdict];
}

const char *kn_pose_verdict_meaning(kn_pose_verdict verdict)
{
    static const char *const meanings[] = {
#define KN_REJECT(name, text, meaning) meaning,
        KN_REJECTS(KN_REJECT)
#undef KN_REJECT
    };
    return meanings[verdict];
}

_Static_assert(KN_REJECT_COUNT <= 24, "status_t.rejected has 24 places");

void kn_receiver_init(kn_receiver *r, const kn_model_def *def)
{
    memset(r, 0, sizeof *r);
    r->probes = def->probe_count;
    for (int p = 0; p < r->probes; p++)
        snprintf(r->channel[p], sizeof r->channel[p], CHANNEL_PREFIX "%s", def->probe[p].name);
}

// Return whether poses are accepted from this address.
static bool known(const kn_receiver *r, struct in_addr from)
{
    int i = 0;
    while (i < r->peers && r->peer[i].s_addr != from.s_addr) i++;
    return r->peers == 0 || i < r->peers;
}

// Check that the tag of a message is right, and that the message is recent and was made for the present life (run) of
// kneadd. The sender of a hello message does not know the life yet, so only the tag of a hello is checked.
static kn_pose_verdict authenticate(const kn_receiver *r, const kn_packet *packet, int64_t now_ns)
{
    kn_auth_stamp stamp;
    if (!kn_auth_check(r->auth, packet->channel, packet->payload, packet->size, &stamp)) return KN_REJECT_MAC;
    if (strcmp(packet->channel, KN_HELLO_CHANNEL) == 0) return KN_ACCEPTED;
    int64_t age_us = (now_ns - r->auth->born_ns) / 1000;
    bool now = stamp.age_us >= age_us - KN_AUTH_BEHIND_US && stamp.age_us <= age_us + KN_AUTH_AHEAD_US;
    return stamp.life == r->auth->life && now ? KN_ACCEPTED : KN_REJECT_REPLAYED;
}

// Keep a listener's nonce for the answer. Answers are limited to 10 kHz, because anybody can record a hello message and
// repeat it.
static kn_pose_verdict take_hello(kn_receiver *r, const kn_packet *packet, int64_t now_ns)
{
    if (!r->auth || packet->size != KN_AUTH_NONCE + KN_AUTH_TRAILER) return KN_REJECT_CHANNEL;
    kn_pose_verdict verdict = authenticate(r, packet, now_ns);
    if (verdict != KN_ACCEPTED) return verdict;
    if (now_ns - r->greeted_ns < HELLO_NS) return KN_REJECT_RATE;
    r->greeted_ns = now_ns;
    memcpy(r->nonce, packet->payload, sizeof r->nonce);
    return KN_REJECT_HELLO;
}

// Split a datagram into channel and payload. All bounds are checked before any field is read.
static kn_pose_verdict unpack(const kn_receiver *r, const kn_datagram *datagram, kn_packet *packet)
{
    static const kn_pose_verdict of_frame[] = {KN_ACCEPTED, KN_REJECT_RUNT, KN_REJECT_MAGIC, KN_REJECT_CHANNEL_END};
    if (!datagram->here) return KN_REJECT_INTERFACE;
    if (!known(r, datagram->from)) return KN_REJECT_PEER;
    if (datagram->size >= 4 && memcmp(datagram->bytes, "LC03", 4) == 0) return KN_REJECT_FRAGMENT;
    return of_frame[kn_bus_unpack(datagram->bytes, datagram->size, packet)];
}

// Decode the payload of a pose and find its probe. The tag is checked before any part of the payload is read.
static kn_pose_verdict decode(const kn_receiver *r, const kn_packet *packet, int64_t now_ns, int *probe,
                              knead_probe_pose_t *message)
{
    // check by channel and length whether the message can be a pose
    if (strncmp(packet->channel, CHANNEL_PREFIX, strlen(CHANNEL_PREFIX)) != 0) return KN_REJECT_CHANNEL;
    for (*probe = 0; *probe < r->probes && strcmp(packet->channel, r->channel[*probe]) != 0;) ++*probe;
    if (*probe == r->probes) return KN_REJECT_PROBE;
    int size = knead_probe_pose_t_encoded_size(message);
    if (!kn_auth_fits(packet->size, (size_t)size)) return KN_REJECT_LENGTH;
    kn_pose_verdict verdict = r->auth ? authenticate(r, packet, now_ns) : KN_ACCEPTED;
    if (verdict != KN_ACCEPTED) return verdict;
    return knead_probe_pose_t_decode(packet->payload, 0, size, message) == size ? KN_ACCEPTED : KN_REJECT_TYPE;
}

static double length(const double *value, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += value[i] * value[i];
    return sqrt(sum); // the sum of huge values overflows to infinity, which exceeds every bound
}

// Check those values of a pose that can be judged without the earlier poses of its session.
static kn_pose_verdict check_fields(const knead_probe_pose_t *m)
{
    if (m->frame != KNEAD_PROBE_POSE_T_FRAME_SCENE) return KN_REJECT_FRAME;
    if (!kn_wire_finite(m->position_m, 3) || !kn_wire_finite(m->orientation_wxyz, 4) ||
        !kn_wire_finite(m->velocity_m_s, 3))
        return KN_REJECT_NONFINITE;
    if (fabs(length(m->orientation_wxyz, 4) - 1) > QUATERNION_BOUND) return KN_REJECT_QUATERNION;
    if (length(m->position_m, 3) > WORKSPACE_M) return KN_REJECT_WORKSPACE;
    if (m->session == 0) return KN_REJECT_SESSION_ZERO;
    return KN_ACCEPTED;
}

// Check a pose against the earlier poses of its session. A pose that jumps is rejected, and the next pose is still
// compared with the old reference pose. The time since the old reference grows, so a tool that really moved is accepted
// after the time that the move takes at the largest speed.
static kn_pose_verdict check_motion(const kn_pose_sender *source, const knead_probe_pose_t *m)
{
    bool goes_on = source->last.session != 0;
    const kn_pose *last = &source->last;
    if (goes_on && (m->seq <= last->seq || last->buttons & KN_BUTTON_LEAVING)) return KN_REJECT_STALE;
    // refuse a leaving pose (KN_BUTTON_LEAVING) while nobody owns the probe: the session of the pose has already ended
    if (!goes_on && m->buttons & KN_BUTTON_LEAVING) return KN_REJECT_STALE;
    if (length(m->velocity_m_s, 3) > SPEED_MAX_M_S) return KN_REJECT_JUMP;
    if (!goes_on) return KN_ACCEPTED;
    if (m->utime < source->last.utime) return KN_REJECT_CLOCK;

    // check the mean speed since the reference pose, over a time of at least SPEED_WINDOW_US
    double way_m[3];
    for (int i = 0; i < 3; i++) way_m[i] = m->position_m[i] - source->reference.position_m[i];
    // unsigned, because the difference of two stamps may overflow an int64_t
    uint64_t elapsed_us = (uint64_t)m->utime - (uint64_t)source->reference.utime;
    if (elapsed_us < SPEED_WINDOW_US) elapsed_us = SPEED_WINDOW_US;
    return length(way_m, 3) > SPEED_MAX_M_S * 1e-6 * (double)elapsed_us ? KN_REJECT_JUMP : KN_ACCEPTED;
}

// Subtract one pose from the credit, which grows with time (a token bucket). Return false if the sender exceeds 5 kHz.
static bool afford(kn_pose_sender *source, int64_t now_ns)
{
    int64_t credit_ns = source->heard_ns == 0 ? CREDIT_NS : source->credit_ns + (now_ns - source->heard_ns);
    if (credit_ns > CREDIT_NS) credit_ns = CREDIT_NS;
    if (credit_ns < COST_NS) return false;
    source->credit_ns = credit_ns - COST_NS;
    return true;
}

// Return whether the session that owns the probe has been silent for 1 s.
static bool expired(const kn_pose_sender *source, int64_t now_ns)
{
    return source->last.session != 0 && now_ns - source->heard_ns >= SILENCE_NS;
}

// --- lost, late and reordered poses, recognised by seq; `seen`: bits up to last.seq, `refused`: later bits ---

// Count the bits that are set.
static int ones(uint64_t bits)
{
    int count = 0;
    for (; bits; bits &= bits - 1) count++;
    return count;
}

// Count a pose that is not newer than the last one. A pose that has arrived before is a duplicate; any other is
// reordered.
static void count_stale(kn_pose_sender *source, const knead_probe_pose_t *m)
{
    // a newer pose of a session that has left is neither a duplicate nor reordered
    if (m->session != source->last.session || m->seq > source->last.seq) return;
    kn_packets *n = &source->packets;
    // `seen` has bits for the last 64 pose numbers; an older pose counts as a duplicate
    uint64_t behind = (uint64_t)source->last.seq - (uint64_t)m->seq, bit = behind < 64 ? UINT64_C(1) << behind : 0;
    if (bit == 0 || source->seen & bit) {
        n->duplicate++;
        return;
    }
    // the pose was counted as lost when a later pose arrived, so subtract it from the lost poses
    source->seen |= bit;
    n->reordered++;
    n->lost -= n->lost > 0;
}

// Remember a newer pose that was refused: it arrived, so it is not lost.
static void count_refused(kn_pose_sender *source, const knead_probe_pose_t *m)
{
    uint64_t ahead = (uint64_t)m->seq - (uint64_t)source->last.seq - 1;
    if (source->last.session == m->session && m->seq > source->last.seq && ahead < 64)
        source->refused |= UINT64_C(1) << ahead;
}

// Count an accepted pose, before it becomes source->last. The pose may continue a session or begin one.
static void count_new(kn_pose_sender *source, const knead_probe_pose_t *m, int64_t now_ns)
{
    const kn_pose *last = &source->last;
    kn_packets *n = &source->packets;
    n->accepted++;
    // Number of poses missing between the last pose and this one.
    uint64_t between = (uint64_t)m->seq - (uint64_t)last->seq - 1;
    if (last->session == 0 || between > (uint64_t)(64 + (now_ns - source->heard_ns) / COST_NS)) {
        // a new session, or a gap larger than the rate limit allows: the sender has restarted its numbers
        source->seen = 1;
    } else {
        // lost poses: the pose numbers left out, except those of poses that arrived and were refused
        uint64_t come = between < 64 ? source->refused & ((UINT64_C(1) << between) - 1) : source->refused;
        int64_t lost = (int64_t)between - ones(come);
        n->lost += lost;
        if (lost > n->lost_in_a_row_max) n->lost_in_a_row_max = lost;
        // late pose: the time between the two arrivals exceeds the time between the two sendings by LATE_NS or more
        double sent_ns = 1e3 * (double)((uint64_t)m->utime - (uint64_t)last->utime);
        n->late += (double)(now_ns - source->heard_ns) - sent_ns >= LATE_NS;
        // shift the bits of `seen` to the new pose, and set the bits of the refused poses
        source->seen = between < 63 ? source->seen << (between + 1) | 1 : 1;
        for (uint64_t i = 0; i < between && i < 64; i++)
            if (come >> i & 1 && between - i < 64) source->seen |= UINT64_C(1) << (between - i);
    }
    source->refused = 0;
}

static kn_pose pose_of(const knead_probe_pose_t *m)
{
    kn_pose pose = {
        .session = m->session, .seq = m->seq, .sent_ns = m->sent_ns, .utime = m->utime, .buttons = m->buttons};
    memcpy(pose.position_m, m->position_m, sizeof pose.position_m);
    memcpy(pose.orientation_wxyz, m->orientation_wxyz, sizeof pose.orientation_wxyz);
    memcpy(pose.velocity_m_s, m->velocity_m_s, sizeof pose.velocity_m_s);
    return pose;
}

// Judge session, motion and rate of a pose whose own values are valid. If the pose is accepted, it becomes the last
// pose.
static kn_pose_verdict admit(kn_pose_sender *source, const knead_probe_pose_t *m, int64_t now_ns, kn_pose *pose)
{
    if (expired(source, now_ns)) source->last.session = 0;
    if (source->last.session != 0 && source->last.session != m->session) return KN_REJECT_SESSION;
    kn_pose_verdict verdict = check_motion(source, m);
    if (verdict == KN_ACCEPTED && !afford(source, now_ns)) verdict = KN_REJECT_RATE;
    if (verdict == KN_REJECT_STALE) count_stale(source, m);
    else if (verdict != KN_ACCEPTED) count_refused(source, m);
    if (verdict != KN_ACCEPTED) return verdict;

    // replace the reference pose, from which speeds are measured, only after SPEED_WINDOW_US, so that many small steps
    // count together
    count_new(source, m, now_ns);
    *pose = pose_of(m);
    if (source->last.session == 0 || (uint64_t)m->utime - (uint64_t)source->reference.utime >= SPEED_WINDOW_US)
        source->reference = *pose;
    source->last = *pose;
    source->heard_ns = now_ns;
    return KN_ACCEPTED;
}

// Judge a pose, but refuse all poses of a session that has left, until that session has sent nothing for a second.
static kn_pose_verdict admit_present(kn_pose_sender *source, const knead_probe_pose_t *m, int64_t now_ns, kn_pose *pose)
{
    // choose the entry of this session; if there is none, choose the entry that expires first
    struct kn_ended *place = source->ended;
    for (int i = 1; i < KN_ENDED_MAX && place->session != m->session; i++) {
        struct kn_ended *e = &source->ended[i];
        if (e->session == m->session || e->until_ns < place->until_ns) place = e;
    }
    if (place->session == m->session && place->until_ns > now_ns) {
        place->until_ns = now_ns + SILENCE_NS;
        count_stale(source, m);
        return KN_REJECT_STALE;
    }
    kn_pose_verdict verdict = admit(source, m, now_ns, pose);
    if (verdict == KN_ACCEPTED && m->buttons & KN_BUTTON_LEAVING)
        *place = (struct kn_ended){m->session, now_ns + SILENCE_NS};
    return verdict;
}

kn_pose_verdict kn_receiver_judge(kn_receiver *r, const kn_datagram *datagram, int64_t now_ns, int *probe,
                                  kn_pose *pose)
{
    knead_probe_pose_t message = {0};
    kn_packet packet;
    kn_pose_verdict verdict = unpack(r, datagram, &packet);
    if (verdict == KN_ACCEPTED && strcmp(packet.channel, KN_HELLO_CHANNEL) == 0)
        verdict = take_hello(r, &packet, now_ns);
    else if (verdict == KN_ACCEPTED) {
        verdict = decode(r, &packet, now_ns, probe, &message);
        if (verdict == KN_ACCEPTED && (verdict = check_fields(&message)) != KN_ACCEPTED)
            count_refused(&r->source[*probe], &message);
        if (verdict == KN_ACCEPTED) verdict = admit_present(&r->source[*probe], &message, now_ns, pose);
    }
    // count each datagram in exactly one counter
    r->received++;
    if (verdict == KN_ACCEPTED) r->accepted++;
    else r->rejected[verdict]++;
    return verdict;
}

kn_pose_verdict kn_receiver_read(const kn_receiver *r, const kn_datagram *datagram, int *probe, kn_pose *pose)
{
    knead_probe_pose_t message = {0};
    kn_packet packet;
    kn_pose_verdict verdict = unpack(r, datagram, &packet);
    if (verdict == KN_ACCEPTED) verdict = decode(r, &packet, 0, probe, &message);
    if (verdict == KN_ACCEPTED) verdict = check_fields(&message);
    if (verdict == KN_ACCEPTED) *pose = pose_of(&message);
    return verdict;
}

unsigned kn_receiver_expire(kn_receiver *r, int64_t now_ns)
{
    unsigned ended = 0;
    for (int p = 0; p < r->probes; p++) {
        if (!expired(&r->source[p], now_ns)) continue;
        r->source[p].last.session = 0;
        ended |= 1u << p;
    }
    return ended;
}

bool kn_receiver_leave(kn_receiver *r, int probe, int64_t session)
{
    kn_pose_sender *source = &r->source[probe];
    if (source->last.session != session || !(source->last.buttons & KN_BUTTON_LEAVING)) return false;
    source->last.session = 0;
    return true;
}
