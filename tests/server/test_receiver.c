#include "server/receiver.h"
#include "server/wire.h"
#include "tests/check.h"
#include "tests/server/datagram.h"
#include "tests/tactile/rules.h"

#define MS INT64_C(1000000)
#define START_NS (5 * 1000 * MS)

static kn_receiver receiver;
static int64_t now_ns;

static void start(void)
{
    kn_model_def def = {.probe_count = 2, .probe = {{.name = "hand"}, {.name = "thumb"}}};
    kn_receiver_init(&receiver, &def);
    now_ns = START_NS;
}

static knead_probe_pose_t good_pose(int64_t session, int64_t seq) // one per ms, at rest
{
    return (knead_probe_pose_t){.utime = 1000 * seq,
                                .session = session,
                                .seq = seq,
                                .sent_ns = 7,
                                .position_m = {0, 0, 0.1},
                                .orientation_wxyz = {1, 0, 0, 0},
                                .buttons = 3};
}

static kn_pose_verdict judge(const kn_datagram *datagram)
{
    int probe;
    kn_pose pose;
    return kn_receiver_judge(&receiver, datagram, now_ns, &probe, &pose);
}

static kn_datagram datagram_of(const char *channel, const knead_probe_pose_t *pose)
{
    kn_datagram datagram = {.here = true};
    datagram.size = kn_pose_datagram(datagram.bytes, sizeof datagram.bytes, channel, pose);
    return datagram;
}

static kn_pose_verdict send_pose(knead_probe_pose_t pose)
{
    kn_datagram datagram = datagram_of("KNEAD_POSE_hand", &pose);
    return judge(&datagram);
}

#define CHECK_VERDICT(value, expected) CHECK_STR(kn_pose_verdict_name(value), kn_pose_verdict_name(expected))

TEST("a valid pose is accepted with every field as sent")
{
    start();
    knead_probe_pose_t sent = good_pose(42, 1);
    sent.velocity_m_s[1] = -0.5;
    kn_datagram datagram = datagram_of("KNEAD_POSE_thumb", &sent);
    int probe = -1;
    kn_pose pose;
    CHECK_VERDICT(kn_receiver_judge(&receiver, &datagram, now_ns, &probe, &pose), KN_ACCEPTED);
    CHECK(probe == 1 && pose.session == 42 && pose.seq == 1 && pose.utime == 1000 && pose.sent_ns == 7 &&
          pose.buttons == 3);
    CHECK(pose.position_m[2] == 0.1 && pose.orientation_wxyz[0] == 1 && pose.velocity_m_s[1] == -0.5);
    CHECK(receiver.received == 1 && receiver.accepted == 1);
}

TEST("a datagram that is not a pose message is rejected with its own reason")
{
    static const struct {
        const char *channel;
        size_t size; // 0: the pose's own
        int at;      // this byte is replaced by `byte`; -1: none
        unsigned char byte;
        bool away; // not over lo
        kn_pose_verdict verdict;
    } bad[] = {{"KNEAD_POSE_hand", 0, -1, 0, true, KN_REJECT_INTERFACE},
               {"KNEAD_POSE_hand", 7, -1, 0, false, KN_REJECT_RUNT},
               {"KNEAD_POSE_hand", 0, 0, 'l', false, KN_REJECT_MAGIC},
               {"KNEAD_POSE_hand", 0, 3, '3', false, KN_REJECT_FRAGMENT},
               {"KNEAD_FORCE_hand", 0, -1, 0, false, KN_REJECT_CHANNEL},
               {"KNEAD_POSE_foot", 0, -1, 0, false, KN_REJECT_PROBE},
               {"KNEAD_POSE_hand2", 0, -1, 0, false, KN_REJECT_PROBE},
               {"KNEAD_POSE_hand", 0, 8 + sizeof "KNEAD_POSE_hand", 0xff, false, KN_REJECT_TYPE},
               {"KNEAD_POSE_hand", 8, -1, 0, false, KN_REJECT_CHANNEL_END},
               {"KNEAD_POSE_hand", 8 + 12, -1, 0, false, KN_REJECT_CHANNEL_END}}; // the NUL would be behind the end
    start();
    knead_probe_pose_t pose = good_pose(1, 1);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        kn_datagram d = datagram_of(bad[i].channel, &pose);
        d.here = !bad[i].away;
        if (bad[i].size) d.size = bad[i].size;
        if (bad[i].at >= 0) d.bytes[bad[i].at] = bad[i].byte;
        CHECK_VERDICT(judge(&d), bad[i].verdict);
    }
    kn_datagram d = {.here = true};
    CHECK_VERDICT(judge(&d), KN_REJECT_RUNT);
    d = datagram_of("KNEAD_POSE_hand", &pose);
    memset(d.bytes + 8, 'K', sizeof d.bytes - 8); // a name without an end, and one of 63 bytes
    d.size = sizeof d.bytes;
    CHECK_VERDICT(judge(&d), KN_REJECT_CHANNEL_END);
    d.bytes[8 + 63] = 0;
    CHECK_VERDICT(judge(&d), KN_REJECT_CHANNEL);
}

TEST("only the exact length of a pose is accepted, with or without a trailer")
{
    start();
    for (size_t size = 8 + sizeof "KNEAD_POSE_hand"; size <= KN_DATAGRAM_MAX; size++) {
        knead_probe_pose_t pose = good_pose(1, (int64_t)size);
        kn_datagram d = datagram_of("KNEAD_POSE_hand", &pose);
        bool fits = size == d.size || size == d.size + KN_AUTH_TRAILER;
        d.size = size;
        CHECK_VERDICT(judge(&d), fits ? KN_ACCEPTED : KN_REJECT_LENGTH);
    }
    CHECK(receiver.accepted == 2);
}

static kn_auth key;

static kn_auth_stamp stamp_of_now(void) { return (kn_auth_stamp){key.life, (now_ns - key.born_ns) / 1000}; }

// Sign a pose as a holder of the key does, now.
static kn_datagram signed_pose(const kn_auth *auth, const char *channel, const knead_probe_pose_t *pose)
{
    kn_datagram d = datagram_of(channel, pose);
    d.size = kn_sign_datagram(d.bytes, d.size, channel, auth, stamp_of_now());
    return d;
}

static kn_pose_verdict send_signed(knead_probe_pose_t pose)
{
    kn_datagram d = signed_pose(&key, "KNEAD_POSE_hand", &pose);
    return judge(&d);
}

static void start_keyed(void)
{
    start();
    for (int i = 0; i < KN_AUTH_KEY; i++) key.key[i] = (unsigned char)(7 * i + 1);
    key.life = 4711;
    key.born_ns = START_NS - 3000 * MS;
    receiver.auth = &key;
}

TEST("with a key only its holders' poses of now are accepted: another key, channel, life or time or a flipped bit is "
     "rejected")
{
    static const kn_auth_stamp others[] = {{1, 0}, {0, -KN_AUTH_BEHIND_US - 1000}, {0, KN_AUTH_AHEAD_US + 1000}};
    start_keyed();
    knead_probe_pose_t pose = good_pose(1, 1);
    kn_datagram good = signed_pose(&key, "KNEAD_POSE_hand", &pose), bad = datagram_of("KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    for (int i = 0; i < 3; i++) {
        kn_datagram d = bad;
        kn_auth_stamp now = stamp_of_now();
        now.life += others[i].life, now.age_us += others[i].age_us;
        d.size = kn_sign_datagram(d.bytes, d.size, "KNEAD_POSE_hand", &key, now);
        CHECK_VERDICT(judge(&d), KN_REJECT_REPLAYED);
    }
    kn_datagram moved = signed_pose(&key, "KNEAD_POSE_thumb", &pose); // signed for another tool, sent as this tool's
    memcpy(bad.bytes + bad.size, moved.bytes + moved.size - KN_AUTH_TRAILER, KN_AUTH_TRAILER);
    bad.size += KN_AUTH_TRAILER;
    CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    for (size_t bit = 0; bit < 8 * KN_AUTH_KEY; bit++) {
        kn_auth other = key;
        other.key[bit / 8] ^= (unsigned char)(1 << bit % 8);
        bad = signed_pose(&other, "KNEAD_POSE_hand", &pose);
        CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    }
    for (size_t bit = 8 * (8 + sizeof "KNEAD_POSE_hand"); bit < 8 * good.size; bit++) {
        bad = good;
        bad.bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
        CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    }
    CHECK(receiver.accepted == 0);
    CHECK_VERDICT(judge(&good), KN_ACCEPTED);
    receiver.auth = NULL; // a receiver without a key ignores the tag
    start();
    CHECK_VERDICT(send_signed(pose), KN_ACCEPTED);
}

TEST("without a key a flipped bit may still be a pose, but at most at 5 m/s and within 5 m/s of its position")
{
    int taken = 0, bits = 0, first = 8 * (8 + (int)sizeof "KNEAD_POSE_hand");
    start();
    knead_probe_pose_t pose = good_pose(1, 1), next = good_pose(1, 2);
    const double at_m[3] = {0.0123, -0.0045, 0.0381};
    memcpy(pose.position_m, at_m, sizeof at_m);
    memcpy(next.position_m, at_m, sizeof at_m);
    next.utime = pose.utime + 1000;
    kn_datagram d = datagram_of("KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&d), KN_ACCEPTED);
    kn_receiver before = receiver;
    d = datagram_of("KNEAD_POSE_hand", &next);
    for (int bit = first; bit < 8 * (int)d.size; bit++, bits++) {
        kn_datagram bad = d;
        int probe;
        kn_pose got;
        receiver = before;
        bad.bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
        if (kn_receiver_judge(&receiver, &bad, now_ns, &probe, &got) != KN_ACCEPTED) continue;
        taken++;
        // A later stamp allows a longer way.
        double most_m = 5.0 * 1e-6 * fmax(1000.0, (double)(got.utime - pose.utime));
        CHECK(kn_rules_between(got.position_m, at_m) <= most_m);
        CHECK(kn_rules_between(got.velocity_m_s, (double[3]){0}) <= 5.0);
    }
    printf("%d of %d bits\n", taken, bits);
    CHECK(taken < bits);
}

TEST("a recorded signed pose is never accepted again, neither after its session nor after a restart")
{
    start_keyed();
    enum { COUNT = 1000 };
    static kn_datagram recorded[COUNT];
    for (int i = 0; i < COUNT; i++, now_ns += MS) {
        knead_probe_pose_t pose = good_pose(1, 1 + i);
        if (i == COUNT - 1) pose.buttons = KN_BUTTON_LEAVING;
        recorded[i] = signed_pose(&key, "KNEAD_POSE_hand", &pose);
        CHECK_VERDICT(judge(&recorded[i]), KN_ACCEPTED);
    }
    kn_receiver before = receiver;
    kn_receiver_leave(&receiver, 0, 1);
    for (int turn = 0; turn < 30; turn++, now_ns += 100 * MS) // after a session that left
        for (int i = 0; i < COUNT; i++) CHECK(judge(&recorded[i]) != KN_ACCEPTED);
    CHECK(receiver.rejected[KN_REJECT_STALE] > 0 && receiver.rejected[KN_REJECT_REPLAYED] > 20 * COUNT);
    receiver = before; // after a session that fell silent
    receiver.source[0].last.buttons = 0;
    now_ns -= 3000 * MS;
    for (int turn = 0; turn < 300; turn++, now_ns += 10 * MS) {
        kn_receiver_expire(&receiver, now_ns);
        for (int i = 0; i < COUNT; i++) CHECK(judge(&recorded[i]) != KN_ACCEPTED);
    }
    CHECK_VERDICT(send_signed(good_pose(1, 1)), KN_ACCEPTED); // the holder comes back
    start_keyed();
    key.life = 4712; // a restart at the time of the recording
    for (int i = 0; i < COUNT; i++, now_ns += MS) CHECK_VERDICT(judge(&recorded[i]), KN_REJECT_REPLAYED);
}

TEST("a signed hello is passed on to be answered, at most ten thousand times a second")
{
    unsigned char payload[KN_AUTH_NONCE + KN_AUTH_TRAILER + 1] = "a nonce";
    start_keyed();
    kn_datagram hello = {.here = true}, bad;
    hello.size = kn_lc02(hello.bytes, sizeof hello.bytes, KN_HELLO_CHANNEL, payload, KN_AUTH_NONCE);
    CHECK_VERDICT(judge(&hello), KN_REJECT_CHANNEL);
    hello.size = kn_sign_datagram(hello.bytes, hello.size, KN_HELLO_CHANNEL, &key, (kn_auth_stamp){0, 0});
    bad = hello, bad.bytes[bad.size - 1] ^= 1;
    CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    CHECK_VERDICT(judge(&hello), KN_REJECT_HELLO);
    CHECK(memcmp(receiver.nonce, "a nonce", sizeof receiver.nonce) == 0);
    int answered = 0;
    for (int i = 0; i < 100000; i++, now_ns += MS / 100) answered += judge(&hello) == KN_REJECT_HELLO;
    CHECK(answered == 9999 || answered == 10000);
    receiver.auth = NULL;
    now_ns += MS;
    CHECK_VERDICT(judge(&hello), KN_REJECT_CHANNEL);
}

TEST("a second hand with the key does not disturb the owner of the tool, whatever its clock says")
{
    start_keyed();
    for (int i = 0; i < 1500; i++, now_ns += MS) {
        knead_probe_pose_t other = good_pose(8, 1 + i);
        other.utime += 40000000;
        if (i < 500) CHECK_VERDICT(send_signed(good_pose(7, 1 + i)), KN_ACCEPTED);
        if (i == 1000) now_ns += 1100 * MS; // the first hand has gone: the other hand may take the tool
        CHECK_VERDICT(send_signed(other), i < 1000 ? KN_REJECT_SESSION : KN_ACCEPTED);
    }
    now_ns += 1100 * MS;
    CHECK_VERDICT(send_signed(good_pose(9, 1)), KN_ACCEPTED); // and later the first one comes back
}

TEST("with a list of peers a pose is accepted only from their addresses")
{
    start();
    receiver.peer[0].s_addr = 0x0a000001, receiver.peer[1].s_addr = 0x0a000002;
    receiver.peers = 2;
    for (unsigned from = 0x0a000000; from < 0x0a000004; from++) {
        knead_probe_pose_t pose = good_pose(1, from & 3 ? from & 3 : 9);
        kn_datagram d = datagram_of("KNEAD_POSE_hand", &pose);
        d.from.s_addr = from;
        bool peer = from == 0x0a000001 || from == 0x0a000002;
        CHECK_VERDICT(judge(&d), peer ? KN_ACCEPTED : KN_REJECT_PEER);
    }
}

// Number i of the ten numbers of a pose.
static double *number_of(knead_probe_pose_t *p, int i)
{
    return i < 3 ? &p->position_m[i] : i < 7 ? &p->orientation_wxyz[i - 3] : &p->velocity_m_s[i - 7];
}

TEST("a pose with an invalid field is rejected with the reason")
{
    static const struct {
        int number;
        double value;
        kn_pose_verdict verdict;
    } bad[] = {{3, 1.0011, KN_REJECT_QUATERNION},
               {3, 0, KN_REJECT_QUATERNION},
               {2, 1.001, KN_REJECT_WORKSPACE},
               {1, -1e308, KN_REJECT_WORKSPACE}};
    const double poison[] = {NAN, INFINITY, -INFINITY};
    start();
    for (int i = 0; i < 30 + 4; i++) {
        knead_probe_pose_t pose = good_pose(1, 1);
        *number_of(&pose, i < 30 ? i / 3 : bad[i - 30].number) = i < 30 ? poison[i % 3] : bad[i - 30].value;
        CHECK_VERDICT(send_pose(pose), i < 30 ? KN_REJECT_NONFINITE : bad[i - 30].verdict);
    }
    knead_probe_pose_t pose = good_pose(1, 1);
    pose.frame = 1;
    CHECK_VERDICT(send_pose(pose), KN_REJECT_FRAME);
    CHECK_VERDICT(send_pose(good_pose(0, 1)), KN_REJECT_SESSION_ZERO);
    CHECK(receiver.accepted == 0 && receiver.source[0].last.session == 0);
}

TEST("late, repeated and replayed poses are stale, and a clock that runs backwards is refused")
{
    start();
    CHECK_VERDICT(send_pose(good_pose(1, 10)), KN_ACCEPTED);
    CHECK_VERDICT(send_pose(good_pose(1, 10)), KN_REJECT_STALE);
    CHECK_VERDICT(send_pose(good_pose(1, 9)), KN_REJECT_STALE);
    knead_probe_pose_t pose = good_pose(1, 12);
    pose.seq = INT64_MIN;
    CHECK_VERDICT(send_pose(pose), KN_REJECT_STALE);
    pose = good_pose(1, 12), pose.utime = 9999;
    CHECK_VERDICT(send_pose(pose), KN_REJECT_CLOCK);
    pose.utime = 10000; // the same microsecond is accepted
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED);
    CHECK_VERDICT(send_pose(good_pose(1, 14)), KN_ACCEPTED); // a gap in seq is accepted
}

TEST("the first session owns its probe until it is silent for a second; other probes are free")
{
    start();
    CHECK_VERDICT(send_pose(good_pose(1, 100)), KN_ACCEPTED);
    CHECK_VERDICT(send_pose(good_pose(2, 101)), KN_REJECT_SESSION);
    knead_probe_pose_t pose = good_pose(2, 1);
    kn_datagram other = datagram_of("KNEAD_POSE_thumb", &pose);
    CHECK_VERDICT(judge(&other), KN_ACCEPTED);

    now_ns += 600 * MS;
    CHECK_VERDICT(send_pose(good_pose(1, 700)), KN_ACCEPTED);
    now_ns += 999 * MS;
    CHECK(kn_receiver_expire(&receiver, now_ns) == 2); // thumb only
    CHECK_VERDICT(send_pose(good_pose(2, 1)), KN_REJECT_SESSION);
    now_ns += 1 * MS;
    CHECK(kn_receiver_expire(&receiver, now_ns) == 1);
    CHECK(kn_receiver_expire(&receiver, now_ns) == 0);
    // the same session number from the start: a log played again
    CHECK_VERDICT(send_pose(good_pose(1, 1)), KN_ACCEPTED);
    now_ns += 1000 * MS;
    CHECK_VERDICT(send_pose(good_pose(2, 1)), KN_ACCEPTED); // decided at arrival, even if expire was not called
}

TEST("a session that announced its end is stale for a second, and over when the servo says so")
{
    start();
    knead_probe_pose_t last = good_pose(1, 7);
    CHECK_VERDICT(send_pose(good_pose(1, 6)), KN_ACCEPTED);
    CHECK(!kn_receiver_leave(&receiver, 0, 1)); // the session has not announced its end
    last.buttons = KN_BUTTON_LEAVING;
    CHECK_VERDICT(send_pose(last), KN_ACCEPTED);
    CHECK_VERDICT(send_pose(good_pose(1, 8)), KN_REJECT_STALE);
    CHECK_VERDICT(send_pose(good_pose(2, 1)), KN_REJECT_SESSION);
    CHECK(!kn_receiver_leave(&receiver, 0, 2));
    CHECK(kn_receiver_leave(&receiver, 0, 1));
    CHECK(!kn_receiver_leave(&receiver, 0, 1));
    CHECK_VERDICT(send_pose(good_pose(1, 9)), KN_REJECT_STALE);
    CHECK_VERDICT(send_pose(good_pose(2, 1)), KN_ACCEPTED);
    CHECK_VERDICT(send_pose(good_pose(1, 10)), KN_REJECT_STALE);
    const kn_packets *n = &receiver.source[0].packets;
    CHECK(n->duplicate == 0 && n->reordered == 0 && n->lost == 0); // a session that is over is not counted
    last = good_pose(2, 2), last.buttons = KN_BUTTON_LEAVING;
    CHECK_VERDICT(send_pose(last), KN_ACCEPTED);
    CHECK(kn_receiver_leave(&receiver, 0, 2));
    for (int i = 0; i < 3; i++, now_ns += 600 * MS) CHECK_VERDICT(send_pose(good_pose(1, 11 + i)), KN_REJECT_STALE);
    last = good_pose(3, 1), last.buttons = KN_BUTTON_LEAVING;
    CHECK_VERDICT(send_pose(last), KN_REJECT_STALE); // a session that was never opened
    now_ns += 1000 * MS;
    CHECK_VERDICT(send_pose(good_pose(2, 1)), KN_ACCEPTED); // a log played again
}

TEST("rejected poses do not keep a session alive")
{
    start();
    CHECK_VERDICT(send_pose(good_pose(1, 5)), KN_ACCEPTED);
    for (int i = 0; i < 9; i++, now_ns += 100 * MS) CHECK_VERDICT(send_pose(good_pose(1, 5)), KN_REJECT_STALE);
    now_ns += 100 * MS;
    CHECK(kn_receiver_expire(&receiver, now_ns) == 1);
}

TEST("a jump above 5 m/s by the pose's own velocity or by its distance is rejected")
{
    start();
    knead_probe_pose_t pose = good_pose(1, 1);
    pose.velocity_m_s[0] = 5.001;
    CHECK_VERDICT(send_pose(pose), KN_REJECT_JUMP);
    pose.velocity_m_s[0] = 4.999;
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED);
    pose = good_pose(1, 2), pose.position_m[0] = 0.0051;
    CHECK_VERDICT(send_pose(pose), KN_REJECT_JUMP);
    pose = good_pose(1, 3), pose.position_m[0] = 0.0099; // 2 ms after the last accepted pose
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED);
    pose = good_pose(1, 4), pose.position_m[0] = 0.3;
    for (; pose.seq < 62; pose.seq++, pose.utime += 1000) CHECK_VERDICT(send_pose(pose), KN_REJECT_JUMP);
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED); // 0.29 m in 59 ms is possible
    pose = good_pose(1, 63), pose.utime = INT64_MAX;
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED);
}

TEST("one small step between poses close in time is accepted, and many steps are rejected")
{
    start();
    knead_probe_pose_t pose = good_pose(1, 1);
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED);
    // a sender that catches up after a delay: 100 m/s by its stamps
    pose.seq++, pose.utime += 10, pose.position_m[0] = 0.001;
    CHECK_VERDICT(send_pose(pose), KN_ACCEPTED);
    int accepted = 0;
    for (int i = 0; i < 50; i++) {
        pose.seq++, pose.utime += 10, pose.position_m[0] += 0.003;
        accepted += send_pose(pose) == KN_ACCEPTED;
    }
    CHECK(accepted == 1); // no more than 5 mm within the millisecond
}

TEST("a probe accepts 5 000 poses per second and a burst of a late sender; a flood by others costs its owner nothing")
{
    start();
    int64_t seq = 0;
    int burst = 0, second = 0;
    while (burst < 10000 && send_pose(good_pose(1, ++seq)) == KN_ACCEPTED) burst++;
    CHECK(burst == 1000);
    for (int i = 0; i < 100000; i++) { // 100 kHz for 1 s
        now_ns += MS / 100;
        send_pose(good_pose(2, ++seq));
        second += send_pose(good_pose(1, seq)) == KN_ACCEPTED;
    }
    CHECK(second == 5000);
    CHECK(receiver.rejected[KN_REJECT_SESSION] == 100000);
    CHECK(receiver.rejected[KN_REJECT_RATE] == 1 + 95000);
}

TEST("lost, repeated, reordered and late poses of a probe are each counted, and a rejected pose counts as arrived")
{
    static const struct {
        int64_t seq;
        double late_ms; // added to its interval from the pose before
        int number;     // this number of the pose is `value`; -1: the pose is good
        double value;
        kn_pose_verdict verdict;
        kn_packets is; // the counts afterwards
    } poses[] = {
        {10, 0, -1, 0, KN_ACCEPTED, {1, 0, 0, 0, 0, 0}},
        {14, 0, -1, 0, KN_ACCEPTED, {2, 3, 0, 0, 0, 3}}, // 11, 12, 13 are missing
        {12, 0.5, -1, 0, KN_REJECT_STALE, {2, 2, 0, 0, 1, 3}},
        {12, 0, -1, 0, KN_REJECT_STALE, {2, 2, 0, 1, 1, 3}},
        {14, 0, -1, 0, KN_REJECT_STALE, {2, 2, 0, 2, 1, 3}},
        {15, 0.4, -1, 0, KN_ACCEPTED, {3, 2, 0, 2, 1, 3}}, // with the 0.5 ms above: 0.9 ms behind
        {16, 1.1, -1, 0, KN_ACCEPTED, {4, 2, 1, 2, 1, 3}},
        {17, -1, -1, 0, KN_ACCEPTED, {5, 2, 1, 2, 1, 3}}, // in a burst
        {18, 0, 0, NAN, KN_REJECT_NONFINITE, {5, 2, 1, 2, 1, 3}},
        {19, 0, 0, 99, KN_REJECT_WORKSPACE, {5, 2, 1, 2, 1, 3}},
        {20, 0, -1, 0, KN_ACCEPTED, {6, 2, 1, 2, 1, 3}},
        {21, 0, 7, 9, KN_REJECT_JUMP, {6, 2, 1, 2, 1, 3}},
        {21, 0, 7, 9, KN_REJECT_JUMP, {6, 2, 1, 2, 1, 3}},
        {23, 0, -1, 0, KN_ACCEPTED, {7, 3, 1, 2, 1, 3}}, // 22 is missing
        {21, 0, 7, 9, KN_REJECT_STALE, {7, 3, 1, 3, 1, 3}},
        {22, 0, -1, 0, KN_REJECT_STALE, {7, 2, 1, 3, 2, 3}},
        {123, 0, -1, 0, KN_ACCEPTED, {8, 2 + 99, 1, 3, 2, 99}},
        {24, 0, -1, 0, KN_REJECT_STALE, {8, 2 + 99, 1, 4, 2, 99}}, // too far behind to be told from a duplicate
        {124, 0, 0, NAN, KN_REJECT_NONFINITE, {8, 2 + 99, 1, 4, 2, 99}},
        {200, 0, 0, NAN, KN_REJECT_NONFINITE, {8, 2 + 99, 1, 4, 2, 99}}, // too far ahead to be remembered
        {201, 0, -1, 0, KN_ACCEPTED, {9, 2 + 99 + 76, 1, 4, 2, 99}}};
    int64_t last = 0;
    start();
    for (size_t i = 0; i < sizeof poses / sizeof *poses; i++) {
        knead_probe_pose_t pose = good_pose(9, poses[i].seq);
        now_ns += (int64_t)(1e6 * poses[i].late_ms) + (pose.seq > last ? pose.seq - last : 0) * MS;
        if (pose.seq > last) last = pose.seq;
        if (poses[i].number >= 0) *number_of(&pose, poses[i].number) = poses[i].value;
        CHECK_VERDICT(send_pose(pose), poses[i].verdict);
        if (memcmp(&receiver.source[0].packets, &poses[i].is, sizeof poses[i].is))
            KN_TEST_FAIL("pose %zu of seq %d is counted wrong", i, (int)pose.seq);
    }
    CHECK(receiver.rejected[KN_REJECT_STALE] == 4 + 2 && receiver.source[1].packets.accepted == 0);
}

TEST("the start of a session does not count as lost, and the largest numbers do no harm")
{
    start();
    const kn_packets *n = &receiver.source[0].packets;
    knead_probe_pose_t other = good_pose(2, 2);
    other.position_m[0] = NAN;
    CHECK_VERDICT(send_pose(good_pose(1, 1)), KN_ACCEPTED);
    CHECK_VERDICT(send_pose(other), KN_REJECT_NONFINITE);
    CHECK_VERDICT(send_pose(good_pose(1, 3)), KN_ACCEPTED); // 2 is lost: that pose was another session's
    now_ns += 1100 * MS;
    CHECK(kn_receiver_expire(&receiver, now_ns) == 1);
    CHECK_VERDICT(send_pose(good_pose(2, 1000)), KN_ACCEPTED);
    CHECK(n->lost == 1 && n->accepted == 3);
    for (int64_t i = 3; i >= 0; i--) {
        knead_probe_pose_t far = good_pose(2, 1);
        far.seq = INT64_MAX - i;
        far.utime = INT64_MAX;
        CHECK_VERDICT(send_pose(far), KN_ACCEPTED);
    }
    CHECK(n->lost == 1 && n->lost_in_a_row_max == 1); // the numbers began anew; 2^62 poses are not lost
}

TESTS_MAIN
