#include "server/receiver.h"
#include "server/wire.h"
#include "tests/check.h"
#include "tests/server/datagram.h"

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
    start();
    knead_probe_pose_t pose = good_pose(1, 1);
    kn_datagram good = datagram_of("KNEAD_POSE_hand", &pose), bad = good;
    bad.here = false;
    CHECK_VERDICT(judge(&bad), KN_REJECT_INTERFACE);
    bad = good, bad.size = 7;
    CHECK_VERDICT(judge(&bad), KN_REJECT_RUNT);
    bad = good, bad.size = 0;
    CHECK_VERDICT(judge(&bad), KN_REJECT_RUNT);
    bad = good, bad.bytes[0] = 'l';
    CHECK_VERDICT(judge(&bad), KN_REJECT_MAGIC);
    bad = good, bad.bytes[3] = '3';
    CHECK_VERDICT(judge(&bad), KN_REJECT_FRAGMENT);
    bad = datagram_of("KNEAD_FORCE_hand", &pose);
    CHECK_VERDICT(judge(&bad), KN_REJECT_CHANNEL);
    bad = datagram_of("KNEAD_POSE_foot", &pose);
    CHECK_VERDICT(judge(&bad), KN_REJECT_PROBE);
    bad = datagram_of("KNEAD_POSE_hand2", &pose);
    CHECK_VERDICT(judge(&bad), KN_REJECT_PROBE);
    bad = good, bad.bytes[8 + sizeof "KNEAD_POSE_hand"] ^= 1;
    CHECK_VERDICT(judge(&bad), KN_REJECT_TYPE);
}

TEST("a channel name must end inside the datagram and within 64 bytes")
{
    start();
    kn_datagram d = {.here = true, .size = 8 + 12};
    memcpy(d.bytes, "LC02\0\0\0\0KNEAD_POSE_h", 20); // the NUL would be the next byte
    CHECK_VERDICT(judge(&d), KN_REJECT_CHANNEL_END);
    d.size = 8;
    CHECK_VERDICT(judge(&d), KN_REJECT_CHANNEL_END);
    memset(d.bytes + 8, 'K', sizeof d.bytes - 8);
    d.size = sizeof d.bytes;
    CHECK_VERDICT(judge(&d), KN_REJECT_CHANNEL_END);
    d.bytes[8 + 63] = 0;
    CHECK_VERDICT(judge(&d), KN_REJECT_CHANNEL);
}

TEST("only the exact length of a pose is accepted")
{
    start();
    knead_probe_pose_t pose = good_pose(1, 1);
    kn_datagram good = datagram_of("KNEAD_POSE_hand", &pose), bad = good;
    for (bad.size = 8 + sizeof "KNEAD_POSE_hand"; bad.size <= KN_DATAGRAM_MAX; bad.size++)
        if (bad.size != good.size && bad.size != good.size + KN_AUTH_TAG && bad.size != good.size + KN_AUTH_TRAILER)
            CHECK_VERDICT(judge(&bad), KN_REJECT_LENGTH);
    CHECK_VERDICT(judge(&good), KN_ACCEPTED);
}

static kn_auth key;

static kn_auth_stamp stamp_of_now(void) { return (kn_auth_stamp){key.life, (now_ns - key.born_ns) / 1000}; }

// Sign a pose as a holder of the key does.
static kn_datagram signed_pose(const kn_auth *auth, const char *channel, const knead_probe_pose_t *pose)
{
    kn_datagram d = datagram_of(channel, pose);
    d.size = kn_sign_datagram(d.bytes, d.size, channel, auth, stamp_of_now());
    return d;
}

static void start_keyed(void)
{
    start();
    for (int i = 0; i < KN_AUTH_KEY; i++) key.key[i] = (unsigned char)(7 * i + 1);
    key.life = 4711;
    key.born_ns = START_NS - 3000 * MS;
    receiver.auth = &key;
}

TEST("with a key only its holders' poses are accepted: another key, another channel or a flipped bit is rejected")
{
    start_keyed();
    knead_probe_pose_t pose = good_pose(1, 1);
    kn_datagram good = signed_pose(&key, "KNEAD_POSE_hand", &pose), bad = datagram_of("KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    kn_auth other = key;
    other.key[31] ^= 1;
    bad = signed_pose(&other, "KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    bad = signed_pose(&key, "KNEAD_POSE_thumb", &pose); // signed for another tool, sent as this tool's
    kn_datagram moved = datagram_of("KNEAD_POSE_hand", &pose);
    memcpy(moved.bytes + moved.size, bad.bytes + bad.size - KN_AUTH_TRAILER, KN_AUTH_TRAILER);
    moved.size += KN_AUTH_TRAILER;
    CHECK_VERDICT(judge(&moved), KN_REJECT_MAC);
    for (size_t bit = 8 * (8 + sizeof "KNEAD_POSE_hand"); bit < 8 * good.size; bit++) {
        bad = good;
        bad.bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
        CHECK_VERDICT(judge(&bad), KN_REJECT_MAC);
    }
    CHECK(receiver.accepted == 0);
    CHECK_VERDICT(judge(&good), KN_ACCEPTED);
    receiver.auth = NULL; // a receiver without a key ignores the tag
    start();
    good = signed_pose(&key, "KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&good), KN_ACCEPTED);
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
        double way_m = 0, speed_m_s = 0;
        for (int i = 0; i < 3; i++) {
            way_m += (got.position_m[i] - at_m[i]) * (got.position_m[i] - at_m[i]);
            speed_m_s += got.velocity_m_s[i] * got.velocity_m_s[i];
        }
        CHECK(sqrt(speed_m_s) <= 5.0);
        // A later stamp allows a longer distance.
        CHECK(sqrt(way_m) <= 5.0 * 1e-6 * fmax(1000.0, (double)(got.utime - pose.utime)));
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
    knead_probe_pose_t pose = good_pose(1, 1); // the holder comes back
    kn_datagram next = signed_pose(&key, "KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&next), KN_ACCEPTED);
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

// KN_FORGED=1000000: number of messages.
TEST("no forged message is accepted: wrong keys, tools and times, flipped bits and recordings")
{
    enum { RECORDED = 1000 };
    static kn_datagram recorded[RECORDED];
    const char *wanted = getenv("KN_FORGED");
    const int64_t count = wanted ? atoll(wanted) : 100000;
    start_keyed();
    for (int i = 0; i < RECORDED; i++, now_ns += MS) {
        knead_probe_pose_t pose = good_pose(7, 1 + i);
        recorded[i] = signed_pose(&key, "KNEAD_POSE_hand", &pose);
        CHECK_VERDICT(judge(&recorded[i]), KN_ACCEPTED);
    }
    now_ns += 1100 * MS; // the tool is free again
    kn_receiver_expire(&receiver, now_ns);
    uint64_t random = 1;
    for (int64_t n = 0; n < count; n++, now_ns += MS / 10) {
        unsigned char bytes[KN_TEST_DATAGRAM];
        const kn_datagram *r = &recorded[n % RECORDED];
        knead_probe_pose_t pose = good_pose(1000 + n, n);
        kn_datagram d = {.here = true};
        d.size = kn_forged_datagram(bytes, &random, "KNEAD_POSE_hand", pose, &key, stamp_of_now(), r->bytes, r->size);
        memcpy(d.bytes, bytes, d.size);
        if (judge(&d) == KN_ACCEPTED) KN_TEST_FAIL("number %lld is accepted", (long long)n);
    }
    printf("%lld forged messages: %lld without the key's tag, %lld not of now, %lld accepted\n", (long long)count,
           (long long)receiver.rejected[KN_REJECT_MAC], (long long)receiver.rejected[KN_REJECT_REPLAYED],
           (long long)receiver.accepted - RECORDED);
    CHECK(receiver.rejected[KN_REJECT_MAC] + receiver.rejected[KN_REJECT_REPLAYED] == count);
}

TEST("a second hand with the key does not disturb the owner of the tool, whatever its clock says")
{
    start_keyed();
    for (int i = 0; i < 500; i++, now_ns += MS) {
        knead_probe_pose_t pose = good_pose(7, 1 + i), other = good_pose(8, 1 + i);
        other.utime += 40000000;
        kn_datagram mine = signed_pose(&key, "KNEAD_POSE_hand", &pose),
                    his = signed_pose(&key, "KNEAD_POSE_hand", &other);
        CHECK_VERDICT(judge(&mine), KN_ACCEPTED);
        CHECK_VERDICT(judge(&his), KN_REJECT_SESSION);
    }
    now_ns += 1100 * MS;
    for (int i = 0; i < 500;
         // after the first hand has gone, the other hand may take the tool, and later the first one comes back
         i++, now_ns += MS) {
        knead_probe_pose_t pose = good_pose(8, 1000 + i);
        pose.utime += 40000000;
        kn_datagram d = signed_pose(&key, "KNEAD_POSE_hand", &pose);
        CHECK_VERDICT(judge(&d), KN_ACCEPTED);
    }
    now_ns += 1100 * MS;
    knead_probe_pose_t pose = good_pose(9, 1);
    kn_datagram d = signed_pose(&key, "KNEAD_POSE_hand", &pose);
    CHECK_VERDICT(judge(&d), KN_ACCEPTED);
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

TEST("a pose with an invalid field is rejected with the reason")
{
    start();
    knead_probe_pose_t bad;
    bad = good_pose(1, 1), bad.frame = 1;
    CHECK_VERDICT(send_pose(bad), KN_REJECT_FRAME);
    const double poison[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            bad = good_pose(1, 1), bad.position_m[i] = poison[k];
            CHECK_VERDICT(send_pose(bad), KN_REJECT_NONFINITE);
            bad = good_pose(1, 1), bad.velocity_m_s[i] = poison[k];
            CHECK_VERDICT(send_pose(bad), KN_REJECT_NONFINITE);
        }
        for (int i = 0; i < 4; i++) {
            bad = good_pose(1, 1), bad.orientation_wxyz[i] = poison[k];
            CHECK_VERDICT(send_pose(bad), KN_REJECT_NONFINITE);
        }
    }
    bad = good_pose(1, 1), bad.orientation_wxyz[0] = 1.0011;
    CHECK_VERDICT(send_pose(bad), KN_REJECT_QUATERNION);
    bad = good_pose(1, 1), bad.orientation_wxyz[0] = 0;
    CHECK_VERDICT(send_pose(bad), KN_REJECT_QUATERNION);
    bad = good_pose(1, 1), bad.position_m[2] = 1.001;
    CHECK_VERDICT(send_pose(bad), KN_REJECT_WORKSPACE);
    bad = good_pose(1, 1), bad.position_m[1] = -1e308;
    CHECK_VERDICT(send_pose(bad), KN_REJECT_WORKSPACE);
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

static double norm(const double *v, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) sum += v[i] * v[i];
    return sqrt(sum);
}

TEST("every random datagram ends in exactly one counter, and every accepted one is a valid pose")
{
    start();
    enum { COUNT = 300000 };
    uint64_t random = 1;
    for (int64_t n = 0; n < COUNT; n++, now_ns += MS / 10) {
        if (n % 500 == 0)
            now_ns += 1000 * MS; // the sender starts anew, since one accepted seq far ahead makes all later ones stale
        unsigned char bytes[KN_TEST_DATAGRAM];
        size_t size = kn_random_datagram(bytes, &random, n % 8 ? "KNEAD_POSE_hand" : "KNEAD_POSE_thumb",
                                         good_pose(n % 64 ? 1 : 2, n % 500));
        kn_datagram d = {.size = size < sizeof d.bytes ? size : sizeof d.bytes, .here = n % 32 != 5};
        memcpy(d.bytes, bytes, d.size);
        int probe = -1;
        kn_pose pose;
        memset(&pose, 0xff, sizeof pose); // all fields NaN
        if (kn_receiver_judge(&receiver, &d, now_ns, &probe, &pose) != KN_ACCEPTED) continue;
        CHECK(fabs(norm(pose.orientation_wxyz, 4) - 1) <= 1e-3);
        CHECK(norm(pose.position_m, 3) <= 1 && norm(pose.velocity_m_s, 3) <= 5);
        CHECK(pose.session != 0 && (probe == 0 || probe == 1));
    }
    int64_t sum = receiver.accepted;
    for (int i = 0; i < KN_REJECT_COUNT; i++) sum += receiver.rejected[i];
    CHECK(receiver.received == COUNT && sum == COUNT);
    CHECK(receiver.accepted > COUNT / 20);
    for (int i = 0; i < KN_REJECT_COUNT;
         i++) // the mix reaches every reason; rate and the later reasons have their own tests
        if (i != KN_REJECT_RATE && i < KN_REJECT_PEER && receiver.rejected[i] == 0)
            KN_TEST_FAIL("the mix never reached '%s'", kn_pose_verdict_name((kn_pose_verdict)i));
}

// Send a pose with this seq. late_ms: delay added to its interval from the pose before.
static void arrive(int64_t seq, double late_ms)
{
    static int64_t last;
    now_ns += (int64_t)((double)(seq > last ? seq - last : 0) * 1e6 + late_ms * 1e6);
    if (seq > last) last = seq;
    send_pose(good_pose(9, seq));
}

TEST("lost, repeated, reordered and late poses of a probe are each counted")
{
    start();
    const kn_packets *n = &receiver.source[0].packets;
    for (int64_t seq = 1; seq <= 10; seq++) arrive(seq, 0);
    CHECK(n->accepted == 10 && n->lost == 0 && n->late == 0 && n->lost_in_a_row_max == 0);
    arrive(14, 0); // 11, 12, 13 are missing
    CHECK(n->lost == 3 && n->lost_in_a_row_max == 3 && n->late == 0);
    arrive(12, 0.5);
    CHECK(n->lost == 2 && n->reordered == 1 && n->duplicate == 0);
    arrive(12, 0);
    arrive(14, 0);
    CHECK(n->lost == 2 && n->reordered == 1 && n->duplicate == 2);
    arrive(15, 0.4); // with the 0.5 ms above: 0.9 ms behind
    CHECK(n->late == 0);
    arrive(16, 1.1);
    CHECK(n->late == 1);
    arrive(17, -1); // in a burst
    CHECK(n->late == 1);
    arrive(117, 0);
    arrive(18, 0); // too far behind to be told from a duplicate
    CHECK(n->lost == 2 + 99 && n->lost_in_a_row_max == 99 && n->duplicate == 3 && n->reordered == 1);
    CHECK(receiver.rejected[KN_REJECT_STALE] == n->duplicate + n->reordered &&
          receiver.source[1].packets.accepted == 0);
}

TEST("rejected poses and the start of a session do not count as lost, and the largest numbers do no harm")
{
    start();
    const kn_packets *n = &receiver.source[0].packets;
    CHECK_VERDICT(send_pose(good_pose(1, 1)), KN_ACCEPTED);
    knead_probe_pose_t wild = good_pose(1, 2);
    wild.velocity_m_s[0] = 9;
    CHECK_VERDICT(send_pose(wild), KN_REJECT_JUMP);
    CHECK_VERDICT(send_pose(good_pose(1, 4)), KN_ACCEPTED);
    CHECK(n->lost == 1 && n->lost_in_a_row_max == 1);
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

TEST("a rejected pose counts as arrived, for every reason and every repetition")
{
    start();
    const kn_packets *n = &receiver.source[0].packets;
    CHECK_VERDICT(send_pose(good_pose(1, 1)), KN_ACCEPTED);
    knead_probe_pose_t wild = good_pose(1, 2);
    wild.position_m[0] = NAN;
    CHECK_VERDICT(send_pose(wild), KN_REJECT_NONFINITE);
    wild = good_pose(1, 3);
    wild.position_m[0] = 99;
    CHECK_VERDICT(send_pose(wild), KN_REJECT_WORKSPACE);
    CHECK_VERDICT(send_pose(good_pose(1, 4)), KN_ACCEPTED);
    CHECK(n->lost == 0);
    wild = good_pose(1, 5);
    wild.velocity_m_s[0] = 9;
    CHECK_VERDICT(send_pose(wild), KN_REJECT_JUMP);
    CHECK_VERDICT(send_pose(wild), KN_REJECT_JUMP);
    CHECK_VERDICT(send_pose(good_pose(1, 7)), KN_ACCEPTED);
    CHECK(n->lost == 1); // seq 6
    CHECK_VERDICT(send_pose(wild), KN_REJECT_STALE);
    CHECK(n->lost == 1 && n->reordered == 0 && n->duplicate == 1);
    CHECK_VERDICT(send_pose(good_pose(1, 6)), KN_REJECT_STALE);
    CHECK(n->lost == 0 && n->reordered == 1 && n->duplicate == 1);
    CHECK(n->duplicate + n->reordered == receiver.rejected[KN_REJECT_STALE]);
}

TEST("proto/README.md lists every reject reason with its index in status_t.rejected")
{
    static char text[100000];
    FILE *file = fopen(KN_SOURCE_DIR "/proto/README.md", "r");
    CHECK(file && fread(text, 1, sizeof text - 1, file) > 0);
    if (file) fclose(file);
    for (int i = 0; i < KN_REJECT_COUNT; i++) {
        char row[64];
        snprintf(row, sizeof row, "| %d | %s |", i, kn_pose_verdict_name((kn_pose_verdict)i));
        if (!strstr(text, row)) KN_TEST_FAIL("not in proto/README.md: %s", row);
    }
}

TESTS_MAIN
