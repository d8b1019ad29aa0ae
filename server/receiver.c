#include "server/receiver.h"
#include "proto/knead_probe_pose_t.h"
#include "server/wire.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

#define LC02 0x4c433032u
#define LC03 0x4c433033u
#define HEADER_SIZE 8  // magic, sequence
#define CHANNEL_MAX 64 // with its NUL, LCM's own limit
#define CHANNEL_PREFIX "KNEAD_POSE_"

#define QUATERNION_BOUND 1e-3 // of a device that sends floats; worse is not a rotation
#define WORKSPACE_M 1.0       // no haptic device reaches further
#define SPEED_MAX_M_S 5.0     // no hand on a device is faster; from 1.2 m/s on the servo only damps
#define SPEED_WINDOW_US                                                                                                \
    1000 // the servo looks once per ms, so a step below 5 mm is no jump however close its stamps are
#define SILENCE_NS 1000000000
#define LATE_NS 1000000         // a tick's
#define CLOCK_APART_US 60000000 // two machines' clocks
#define COST_NS 200000      // of one pose: 5 kHz
#define CREDIT_NS 200000000 // 1 000 poses at once: a 1 kHz sender that was held up for as long as its session may live

const char *kn_verdict_name(kn_verdict verdict)
{
    static const char *const names[] = {
#define KN_REJECT(name, text, meaning) text,
        KN_REJECTS(KN_REJECT)
#undef KN_REJECT
    };
    return verdict == KN_ACCEPTED ? "accepted" : names[verdict];
}

_Static_assert(KN_REJECT_COUNT <= 24, "status_t.rejected has 24 places");

void kn_receiver_init(kn_receiver *r, const kn_model_def *def)
{
    memset(r, 0, sizeof *r);
    r->probes = def->probe_count;
    for (int p = 0; p < r->probes; p++)
        snprintf(r->channel[p], sizeof r->channel[p], CHANNEL_PREFIX "%s", def->probe[p].name);
}

static uint32_t big_endian_32(const unsigned char *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

static int64_t big_endian_64(const unsigned char *bytes)
{
    return (int64_t)((uint64_t)big_endian_32(bytes) << 32 | big_endian_32(bytes + 4));
}

static bool known(const kn_receiver *r, struct in_addr from)
{
    int i = 0;
    while (i < r->peers && r->peer[i].s_addr != from.s_addr) i++;
    return r->peers == 0 || i < r->peers;
}

// The bounds, before any field is looked at.
static kn_verdict unpack(const kn_receiver *r, const kn_datagram *datagram, int *probe, knead_probe_pose_t *message)
{
    const unsigned char *bytes = datagram->bytes;
    if (!datagram->here) return KN_REJECT_INTERFACE;
    if (!known(r, datagram->from)) return KN_REJECT_PEER;
    if (datagram->size < HEADER_SIZE) return KN_REJECT_RUNT;
    uint32_t magic = big_endian_32(bytes);
    if (magic != LC02) return magic == LC03 ? KN_REJECT_FRAGMENT : KN_REJECT_MAGIC;

    const char *channel = (const char *)bytes + HEADER_SIZE;
    size_t left = datagram->size - HEADER_SIZE;
    const char *end = memchr(channel, 0, left < CHANNEL_MAX ? left : CHANNEL_MAX);
    if (!end) return KN_REJECT_CHANNEL_END;
    if (strncmp(channel, CHANNEL_PREFIX, strlen(CHANNEL_PREFIX)) != 0) return KN_REJECT_CHANNEL;
    for (*probe = 0; *probe < r->probes && strcmp(channel, r->channel[*probe]) != 0;) ++*probe;
    if (*probe == r->probes) return KN_REJECT_PROBE;

    const unsigned char *payload = (const unsigned char *)end + 1;
    size_t size = datagram->size - (size_t)(payload - bytes);
    size_t wanted = (size_t)knead_probe_pose_t_encoded_size(message);
    if (datagram->truncated || (size != wanted && size != wanted + KN_WIRE_MAC)) return KN_REJECT_LENGTH;
    if (r->auth && (size == wanted || !kn_auth_check(r->auth, channel, payload, size))) return KN_REJECT_MAC;
    size = wanted;
    if (big_endian_64(payload) != __knead_probe_pose_t_get_hash()) return KN_REJECT_TYPE;
    return knead_probe_pose_t_decode(payload, 0, (int)size, message) == (int)size ? KN_ACCEPTED : KN_REJECT_LENGTH;
}

static bool all_finite(const double *value, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(value[i])) return false;
    return true;
}

static double length(const double *value, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += value[i] * value[i];
    return sqrt(sum); // of huge values infinite, and so out of every bound
}

static kn_verdict check_fields(const knead_probe_pose_t *m)
{
    if (m->frame != KNEAD_PROBE_POSE_T_FRAME_SCENE) return KN_REJECT_FRAME;
    if (!all_finite(m->position_m, 3) || !all_finite(m->orientation_wxyz, 4) || !all_finite(m->velocity_m_s, 3))
        return KN_REJECT_NONFINITE;
    if (fabs(length(m->orientation_wxyz, 4) - 1) > QUATERNION_BOUND) return KN_REJECT_QUATERNION;
    if (length(m->position_m, 3) > WORKSPACE_M) return KN_REJECT_WORKSPACE;
    if (m->session == 0) return KN_REJECT_SESSION_ZERO;
    return KN_ACCEPTED;
}

// Against what the session sent before. A rejected jump does not become the new place to measure from, but the time
// since the old one grows, so that a tool that really is elsewhere is believed once its way there could have been
// walked.
static kn_verdict check_motion(const kn_source *source, const knead_probe_pose_t *m)
{
    bool goes_on = source->last.session != 0;
    const kn_pose *last = &source->last;
    if (goes_on && (m->seq <= last->seq || last->buttons & KN_BUTTON_LEAVING)) return KN_REJECT_STALE;
    if (!goes_on && m->buttons & KN_BUTTON_LEAVING) return KN_REJECT_STALE; // of a session that has ended by itself
    if (length(m->velocity_m_s, 3) > SPEED_MAX_M_S) return KN_REJECT_JUMP;
    if (!goes_on) return KN_ACCEPTED;
    if (m->utime < source->last.utime) return KN_REJECT_CLOCK;

    double way_m[3];
    for (int i = 0; i < 3; i++) way_m[i] = m->position_m[i] - source->reference.position_m[i];
    // not signed: stamps may lie further apart than an int64_t reaches
    uint64_t elapsed_us = (uint64_t)m->utime - (uint64_t)source->reference.utime;
    if (elapsed_us < SPEED_WINDOW_US) elapsed_us = SPEED_WINDOW_US;
    return length(way_m, 3) > SPEED_MAX_M_S * 1e-6 * (double)elapsed_us ? KN_REJECT_JUMP : KN_ACCEPTED;
}

static bool afford(kn_source *source, int64_t now_ns)
{
    int64_t credit_ns = source->heard_ns == 0 ? CREDIT_NS : source->credit_ns + (now_ns - source->heard_ns);
    if (credit_ns > CREDIT_NS) credit_ns = CREDIT_NS;
    if (credit_ns < COST_NS) return false;
    source->credit_ns = credit_ns - COST_NS;
    return true;
}

// An authentic message proves its sender, not its time.
static bool is_of_now(const kn_receiver *r, const knead_probe_pose_t *m, int64_t now_ns)
{
    int64_t now_us = r->epoch_us + now_ns / 1000;
    return m->utime >= now_us - CLOCK_APART_US && m->utime <= now_us + CLOCK_APART_US;
}

// Where a session that opens is written down; NULL: it has been here before, or too many have.
static struct kn_ended *place_of(kn_source *source, int64_t session, int64_t now_ns)
{
    struct kn_ended *place = NULL;
    for (int i = 0; i < KN_ENDED_MAX; i++) {
        struct kn_ended *e = &source->ended[i];
        if (e->session == session && e->until_ns > now_ns) return NULL;
        if (e->until_ns <= now_ns) place = e;
    }
    return place;
}

static bool expired(const kn_source *source, int64_t now_ns)
{
    return source->last.session != 0 && now_ns - source->heard_ns >= SILENCE_NS;
}

// --- what became of a session's numbers: seen goes back from the last pose, refused ahead of it ----------------------

static int ones(uint64_t bits)
{
    int count = 0;
    for (; bits; bits &= bits - 1) count++;
    return count;
}

// Not newer than the last one: come again, or overtaken.
static void count_stale(kn_source *source, const knead_probe_pose_t *m)
{
    if (m->session != source->last.session || m->seq > source->last.seq) return; // sent after its session's last pose
    kn_packets *n = &source->packets;
    uint64_t behind = (uint64_t)source->last.seq - (uint64_t)m->seq, bit = behind < 64 ? UINT64_C(1) << behind : 0;
    if (bit == 0 || source->seen & bit) {
        n->duplicate++;
        return;
    }
    source->seen |= bit;
    n->reordered++;
    n->lost -= n->lost > 0;
}

// Newer, and not taken: it has come, so it is not lost.
static void count_refused(kn_source *source, const knead_probe_pose_t *m)
{
    uint64_t ahead = (uint64_t)m->seq - (uint64_t)source->last.seq - 1;
    if (source->last.session == m->session && m->seq > source->last.seq && ahead < 64)
        source->refused |= UINT64_C(1) << ahead;
}

// To be the last one, of a session that goes on or opens.
static void count_new(kn_source *source, const knead_probe_pose_t *m, int64_t now_ns)
{
    const kn_pose *last = &source->last;
    kn_packets *n = &source->packets;
    n->accepted++;
    uint64_t between = (uint64_t)m->seq - (uint64_t)last->seq - 1; // numbers
    if (last->session == 0 || between > (uint64_t)(64 + (now_ns - source->heard_ns) / COST_NS)) {
        source->seen = 1; // more than could have been taken in that time: a sender that begins its numbers anew
    } else {
        uint64_t come = between < 64 ? source->refused & ((UINT64_C(1) << between) - 1) : source->refused;
        int64_t lost = (int64_t)between - ones(come);
        n->lost += lost;
        if (lost > n->lost_in_a_row_max) n->lost_in_a_row_max = lost;
        double sent_ns = 1e3 * (double)((uint64_t)m->utime - (uint64_t)last->utime);
        n->late += (double)(now_ns - source->heard_ns) - sent_ns >= LATE_NS;
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

static kn_verdict admit(kn_source *source, const knead_probe_pose_t *m, int64_t now_ns, kn_pose *pose)
{
    if (expired(source, now_ns)) source->last.session = 0;
    if (source->last.session != 0 && source->last.session != m->session) return KN_REJECT_SESSION;
    kn_verdict verdict = check_motion(source, m);
    if (verdict == KN_ACCEPTED && !afford(source, now_ns)) verdict = KN_REJECT_RATE;
    if (verdict == KN_REJECT_STALE) count_stale(source, m);
    else if (verdict != KN_ACCEPTED) count_refused(source, m);
    if (verdict != KN_ACCEPTED) return verdict;

    count_new(source, m, now_ns);
    *pose = pose_of(m);
    if (source->last.session == 0 || (uint64_t)m->utime - (uint64_t)source->reference.utime >= SPEED_WINDOW_US)
        source->reference = *pose;
    source->last = *pose;
    source->heard_ns = now_ns;
    return KN_ACCEPTED;
}

// Without a key: what a session sends after its last pose is refused until it has sent nothing for a second.
static kn_verdict admit_anybody(kn_source *source, const knead_probe_pose_t *m, int64_t now_ns, kn_pose *pose)
{
    struct kn_ended *place = source->ended; // its own, or that which is forgotten first
    for (int i = 1; i < KN_ENDED_MAX && place->session != m->session; i++) {
        struct kn_ended *e = &source->ended[i];
        if (e->session == m->session || e->until_ns < place->until_ns) place = e;
    }
    if (place->session == m->session && place->until_ns > now_ns) {
        place->until_ns = now_ns + SILENCE_NS;
        count_stale(source, m);
        return KN_REJECT_STALE;
    }
    kn_verdict verdict = admit(source, m, now_ns, pose);
    if (verdict == KN_ACCEPTED && m->buttons & KN_BUTTON_LEAVING)
        *place = (struct kn_ended){m->session, now_ns + SILENCE_NS};
    return verdict;
}

static kn_verdict admit_authentic(const kn_receiver *r, kn_source *source, const knead_probe_pose_t *m, int64_t now_ns,
                                  kn_pose *pose)
{
    if (!is_of_now(r, m, now_ns)) return KN_REJECT_REPLAYED;
    bool goes_on = source->last.session == m->session && !expired(source, now_ns);
    struct kn_ended *place = goes_on ? NULL : place_of(source, m->session, now_ns);
    if (!goes_on && !place) return KN_REJECT_REPLAYED;
    kn_verdict verdict = admit(source, m, now_ns, pose);
    if (verdict != KN_ACCEPTED) return verdict;
    for (int i = 0; i < KN_ENDED_MAX && goes_on; i++)
        if (source->ended[i].session == m->session) place = &source->ended[i];
    if (place) *place = (struct kn_ended){m->session, now_ns + INT64_C(2000) * CLOCK_APART_US}; // its poses are too old then
    return KN_ACCEPTED;
}

kn_verdict kn_receiver_judge(kn_receiver *r, const kn_datagram *datagram, int64_t now_ns, int *probe, kn_pose *pose)
{
    knead_probe_pose_t message = {0};
    kn_verdict verdict = unpack(r, datagram, probe, &message);
    if (verdict == KN_ACCEPTED && (verdict = check_fields(&message)) != KN_ACCEPTED)
        count_refused(&r->source[*probe], &message);
    if (verdict == KN_ACCEPTED && r->auth) verdict = admit_authentic(r, &r->source[*probe], &message, now_ns, pose);
    else if (verdict == KN_ACCEPTED) verdict = admit_anybody(&r->source[*probe], &message, now_ns, pose);
    r->received++;
    if (verdict == KN_ACCEPTED)
        r->accepted++;
    else
        r->rejected[verdict]++;
    return verdict;
}

kn_verdict kn_receiver_read(const kn_receiver *r, const kn_datagram *datagram, int *probe, kn_pose *pose)
{
    knead_probe_pose_t message = {0};
    kn_verdict verdict = unpack(r, datagram, probe, &message);
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
    kn_source *source = &r->source[probe];
    if (source->last.session != session || !(source->last.buttons & KN_BUTTON_LEAVING)) return false;
    source->last.session = 0;
    return true;
}
