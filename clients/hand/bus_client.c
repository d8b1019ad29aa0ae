#include "clients/hand/bus_client.h"
#include "server/auth.h"
#include "server/bus.h"
#include "server/clock.h"
#include "server/daemon.h"
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Largest number of channels to which one connection can listen.
#define HEARD_MAX 16
#define DATAGRAM_MAX 65536     // largest size of a datagram, bytes; limit of UDP
#define BUFFER_BYTES (4 << 20) // size of the receive buffer, bytes; holds the mesh messages of 1 s
#define HELLO_NS 50000000      // interval of hello messages while the life (present run) of kneadd is not known, ns
// If no authentic and fresh message arrives for this time [ns], a hello message asks kneadd again for the number of its
// life (present run).
#define SILENCE_NS 250000000
#define NONCE_NS 1000000000 // longest wait for the answer to a hello, ns; after that a new nonce is used
#define LAG_US 200          // largest amount by which one message reduces the estimated age of kneadd, us
// Largest allowed difference between the stamp of a message and this machine's wall clock, for a listener that sends
// nothing (KNEAD_MUTE), us.
#define APART_US 5000000
// The names of the channels of poses begin with this text. The messages on these channels are signed by clients, not by
// kneadd.
#define POSES "KNEAD_POSE_"

// A channel to which a connection listens.
typedef struct heard {
    char channel[KN_CHANNEL_MAX];
    size_t prefix;  // length of the channel name before '*'; 0: the name has no '*'
    size_t largest; // largest accepted size of a message on this channel, bytes
    lcm_msg_handler_t handler;
    void *user;
} heard;

struct kn_bus_client {
    kn_bus bus;
    lcm_t *lcm;  // LCM instance that sends messages; with KN_MEMORY_URL it also receives them
    int fd;      // descriptor of the receiving socket; -1 with KN_MEMORY_URL
    bool trusts; // true: messages of this connection are neither signed nor checked
    bool hails;  // true: sends hello messages, because kneadd listens to the bus of this connection
    heard heard[HEARD_MAX];
    int count, handed;
    kn_auth_stamp last; // stamp of the newest message of kneadd that was accepted on this connection
    int64_t last_us;    // utime (wall clock) of the newest accepted message, used only with KNEAD_MUTE
    struct {            // message that is being assembled from its parts
        char channel[KN_CHANNEL_MAX];
        uint32_t sequence, whole, got, room;
        uint16_t part;
        unsigned char *bytes;
    } long_message;
    unsigned char datagram[DATAGRAM_MAX];
};

// State that all connections of this process share: the key, and the life (present run) of the kneadd that uses this
// key.
static struct {
    kn_auth auth;
    bool keyed, mute;
    _Atomic int64_t nonce;    // nonce of the hello message that has not been answered yet; 0: none
    _Atomic int64_t life;     // number of the present life (run) of kneadd; 0: not known yet
    _Atomic int64_t floor_us; // age of kneadd (time since its start) in its first answer of this life, us
    // Estimated difference between the age of kneadd and this machine's monotonic clock, us.
    _Atomic int64_t ahead_us;
    _Atomic int64_t believed_ns; // time at which the last accepted message arrived
    _Atomic int64_t asked_ns;    // time at which the present nonce was created
    _Atomic int64_t said_ns;     // time at which the last hello message was sent
    // forged_ns: time of the last message without a valid tag. old_ns: time of the last message that had a valid tag
    // but was not fresh.
    _Atomic int64_t forged_ns, old_ns;
} own;

// --- open and close -------------------------------------------------------------------------------------------------

// Return the network interface to use, or NULL for lo.
static const char *lan(void)
{
    const char *name = getenv("KNEAD_LAN");
    return name && *name ? name : NULL;
}

// Choose the URL of the bus. The variable LCM_DEFAULT_URL sets the URL of the force bus only.
static const char *choose(const char *url, const char *otherwise)
{
    bool meshes = strcmp(otherwise, KN_FORCE_URL) != 0;
    const char *set = meshes ? NULL : getenv("LCM_DEFAULT_URL");
    if (!url) url = set && *set ? set : lan() ? meshes ? KN_MESH_LAN_URL : KN_LCM_LAN_URL : otherwise;
    return url;
}

// Load the key from the file KNEAD_KEY, once per process.
static bool take_key(char *error, size_t error_size)
{
    const char *key = getenv("KNEAD_KEY"), *mute = getenv("KNEAD_MUTE");
    bool muted = mute && *mute;
    if (muted && (!key || !*key || strcmp(mute, "1") != 0))
        return snprintf(error, error_size, "KNEAD_MUTE=%s: expected 1, together with KNEAD_KEY", mute), false;
    if (!key || !*key || own.keyed) return true;
    if (!kn_auth_load(&own.auth, key, error, error_size)) return false;
    own.mute = muted;
    if (own.mute)
        fprintf(stderr,
                "knead: KNEAD_MUTE=1: no hello is sent; messages are accepted if they are stamped within %d s "
                "of this machine's clock\n",
                APART_US / 1000000);
    return own.keyed = true;
}

static bool parse(kn_bus *bus, const char *url, char *error, size_t error_size)
{
    return take_key(error, error_size) && kn_bus_parse(bus, url, lan(), error, error_size);
}

bool kn_bus_client_check(const char *url, const char *otherwise, char *error, size_t error_size)
{
    return parse(&(kn_bus){0}, choose(url, otherwise), error, error_size);
}

static int deliver(kn_bus_client *j, const char *channel, const unsigned char *bytes, size_t size);

static void on_memory(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    kn_bus_client *j = self;
    j->handed += deliver(j, channel, buf->data, buf->data_size);
}

// Open an LCM queue in memory and subscribe to all channels of the queue.
static bool open_memory(kn_bus_client *j, char *error, size_t error_size)
{
    if (!take_key(error, error_size)) return false;
    j->lcm = lcm_create(KN_MEMORY_URL);
    lcm_subscription_t *all = j->lcm ? lcm_subscribe(j->lcm, ".*", on_memory, j) : NULL;
    if (all) lcm_subscription_set_queue_capacity(all, KN_BUS_CLIENT_TURN);
    return all;
}

// Open the receiving socket, and an LCM instance for sending.
static bool open_socket(kn_bus_client *j, const char *url, char *error, size_t error_size)
{
    if (!parse(&j->bus, url, error, error_size) || !kn_bus_check_route(&j->bus, error, error_size)) return false;
    j->fd = kn_bus_listen(&j->bus, BUFFER_BYTES, error, error_size);
    if (j->fd >= 0) j->lcm = lcm_create(url);
    return j->lcm;
}

kn_bus_client *kn_bus_client_open(const char *url, const char *otherwise, char *error, size_t error_size)
{
    kn_bus_client *j = calloc(1, sizeof *j);
    url = choose(url, otherwise);
    snprintf(error, error_size, "%s", j ? "" : "out of memory");
    if (!j) return NULL;
    j->fd = -1;
    j->hails = strcmp(otherwise, KN_MESH_URL) != 0;
    if (strcmp(url, KN_MEMORY_URL) ? open_socket(j, url, error, error_size) : open_memory(j, error, error_size))
        return j;
    if (!*error) snprintf(error, error_size, "%s: LCM refuses this URL", url);
    kn_bus_client_close(j);
    return NULL;
}

void kn_bus_client_close(kn_bus_client *j)
{
    if (!j) return;
    if (j->lcm) lcm_destroy(j->lcm);
    if (j->fd >= 0) close(j->fd);
    free(j->long_message.bytes);
    free(j);
}

// Return the largest accepted size of a message on a channel, bytes. The limit is small for force and contact messages,
// which the thread of a device receives. Checking the tag of a large forged message would take this thread a
// millisecond.
static size_t largest_of(const char *channel)
{
    if (!strcmp(channel, "KNEAD_MESH_INIT")) return KN_BUS_CLIENT_LARGEST;
    if (!strcmp(channel, "KNEAD_SCENE")) return 2 << 20; // more than the largest scene file (1 MiB)
    return strcmp(channel, "KNEAD_MESH_UPDATE") ? 4096 : DATAGRAM_MAX;
}

bool kn_bus_client_hear(kn_bus_client *j, const char *channel, lcm_msg_handler_t handler, void *user)
{
    size_t size = strlen(channel);
    if (j->count == HEARD_MAX || size >= KN_CHANNEL_MAX) return false;
    heard *h = &j->heard[j->count++];
    *h = (heard){.largest = largest_of(channel), .handler = handler, .user = user};
    memcpy(h->channel, channel, size);
    if (size > 0 && channel[size - 1] == '*') h->prefix = size - 1;
    return true;
}

int kn_bus_client_fd(const kn_bus_client *j) { return j->fd >= 0 ? j->fd : lcm_get_fileno(j->lcm); }

lcm_t *kn_bus_client_memory(kn_bus_client *j) { return j->lcm; }

bool kn_bus_client_speaks(char *error, size_t error_size)
{
    if (own.mute) snprintf(error, error_size, "KNEAD_MUTE=1: not allowed for a hand, which has to send");
    return !own.mute;
}

void kn_bus_client_trust(kn_bus_client *j) { j->trusts = true; }

// --- signatures and freshness of messages ---------------------------------------------------------------------------

static int64_t now_us(void) { return kn_now_ns() / 1000; }

// Return true if the messages of this connection are signed and checked.
static bool signs(const kn_bus_client *j) { return own.keyed && !j->trusts; }

// Send a hello message if one is due. kneadd answers with the number of its present life. All later messages of kneadd
// carry this number.
static void say_hello(kn_bus_client *j)
{
    uint8_t bytes[KN_AUTH_NONCE + KN_AUTH_TRAILER];
    int64_t now_ns = kn_now_ns(), life = atomic_load(&own.life), said_ns = atomic_load(&own.said_ns);
    // While the life of kneadd is not known, send a hello every HELLO_NS. Once the life is known, send a hello only
    // when no message has come for SILENCE_NS.
    bool due = life ? now_ns - atomic_load(&own.believed_ns) >= SILENCE_NS && now_ns - said_ns >= SILENCE_NS
                    : now_ns - said_ns >= HELLO_NS || said_ns == 0;
    if (!signs(j) || own.mute || !j->hails || !due) return;
    int64_t nonce = atomic_load(&own.nonce);
    // Create a new nonce only if kneadd has answered the old nonce, or if no answer has come for NONCE_NS.
    if (nonce == 0 || now_ns - atomic_load(&own.asked_ns) > NONCE_NS) {
        nonce = kn_auth_random();
        atomic_store(&own.asked_ns, now_ns);
        atomic_store(&own.nonce, nonce);
    }
    atomic_store(&own.said_ns, now_ns);
    memcpy(bytes, &nonce, sizeof nonce);
    size_t size = kn_auth_sign(&own.auth, KN_HELLO_CHANNEL, bytes, sizeof nonce, (kn_auth_stamp){0});
    lcm_publish(j->lcm, KN_HELLO_CHANNEL, bytes, (unsigned)size);
}

// Update the estimate of kneadd's age (time since its start) from the age in a message. A message that has waited in a
// buffer gives too low an age, so the estimate may fall only slowly.
static void note_age(int64_t age_us, bool answer)
{
    int64_t ahead_us = age_us - now_us(), before_us = atomic_load(&own.ahead_us) - LAG_US;
    atomic_store(&own.ahead_us, answer || ahead_us > before_us ? ahead_us : before_us);
    atomic_store(&own.believed_ns, kn_now_ns());
}

// Handle the answer of kneadd to a hello of this process. An answer to each nonce is accepted only once.
static void hear_life(const unsigned char *bytes, size_t size, kn_auth_stamp stamp)
{
    int64_t nonce;
    if (size != sizeof nonce || stamp.life == 0) return;
    memcpy(&nonce, bytes, sizeof nonce);
    if (nonce == 0 || !atomic_compare_exchange_strong(&own.nonce, &nonce, 0)) return;
    // If this is the first answer of a new life of kneadd, refuse all messages that kneadd sent before this answer.
    bool same = atomic_load(&own.life) == stamp.life;
    if (!same) atomic_store(&own.floor_us, stamp.age_us);
    note_age(stamp.age_us, true);
    atomic_store(&own.life, stamp.life);
}

// Return true if a message is fresh by the wall clock. This check is for a process that sends no hello (KNEAD_MUTE).
// The time of the message is read from its bytes 8 to 15: every message type of this project begins with a hash and
// utime, 8 bytes each.
static bool is_recent(kn_bus_client *j, const unsigned char *payload, size_t size, kn_auth_stamp stamp)
{
    if (size < 16) return false;
    int64_t utime = kn_bytes_64(payload + 8), apart_us = (int64_t)((uint64_t)utime - (uint64_t)kn_wall_us());
    // Each message must be newer than the last accepted one. If both belong to one life of kneadd, compare the ages in
    // their stamps, otherwise their utimes.
    bool newer = stamp.life == j->last.life ? stamp.age_us > j->last.age_us : utime > j->last_us;
    if (!newer || apart_us < -APART_US || apart_us > APART_US) return false;
    j->last = stamp;
    j->last_us = utime;
    atomic_store(&own.believed_ns, kn_now_ns());
    return true;
}

// Return true if a message is fresh according to its stamp. The stamp contains the number of kneadd's run (its life)
// and the time since this run began (its age).
static bool is_fresh(kn_bus_client *j, const char *channel, kn_auth_stamp stamp)
{
    int64_t life = atomic_load(&own.life);
    if (stamp.life != life || life == 0) return false;
    // A pose message comes from another client, so the age in its stamp cannot be compared with the ages in kneadd's
    // messages. The age must agree with the estimated age of kneadd.
    if (!strncmp(channel, POSES, strlen(POSES))) {
        int64_t apart_us = stamp.age_us - (now_us() + atomic_load(&own.ahead_us));
        return apart_us >= -KN_AUTH_BEHIND_US && apart_us <= KN_AUTH_BEHIND_US;
    }
    // The first message of a new life on this connection must be newer than the answer to the hello, and at most
    // KN_AUTH_BEHIND_US old.
    if (j->last.life != life) {
        int64_t floor_us = atomic_load(&own.floor_us),
                opened_us = now_us() + atomic_load(&own.ahead_us) - KN_AUTH_BEHIND_US;
        j->last = (kn_auth_stamp){life, opened_us > floor_us ? opened_us : floor_us};
    }
    if (stamp.age_us <= j->last.age_us) return false;
    j->last = stamp;
    note_age(stamp.age_us, false);
    return true;
}

// Return true if a message is authentic and fresh, so that it may be passed to handlers. `*size` becomes the size of
// the payload without the trailer.
static bool believe(kn_bus_client *j, const char *channel, const unsigned char *bytes, size_t *size)
{
    kn_auth_stamp stamp;
    if (!signs(j)) return true;
    // Check the tag first: nothing else in the message can be trusted before.
    if (!kn_auth_check(&own.auth, channel, bytes, *size, &stamp))
        return atomic_store(&own.forged_ns, kn_now_ns()), false;
    *size -= KN_AUTH_TRAILER;
    if (!strcmp(channel, KN_LIFE_CHANNEL)) return hear_life(bytes, *size, stamp), false;
    bool fresh = own.mute ? is_recent(j, bytes, *size, stamp) : is_fresh(j, channel, stamp);
    if (!fresh && stamp.life) atomic_store(&own.old_ns, kn_now_ns());
    return fresh;
}

const char *kn_bus_client_why(const char *otherwise)
{
    int64_t believed_ns = atomic_load(&own.believed_ns), old_ns = atomic_load(&own.old_ns);
    if (!own.keyed) return otherwise;
    if (old_ns > believed_ns && own.mute)
        return "messages arrive, but they are not stamped within 5 s of this machine's clock";
    if (old_ns > believed_ns)
        return "messages arrive with this KNEAD_KEY, but are old: no kneadd with this key answers our hello";
    return atomic_load(&own.forged_ns) > believed_ns ? "messages arrive, but not signed with this KNEAD_KEY"
                                                     : otherwise;
}

// --- hear -----------------------------------------------------------------------------------------------------------

// Return true if a channel name matches the subscription. '*' stands for a tool's name, [a-z0-9_]+.
static bool matches(const heard *h, const char *channel)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyz0123456789_";
    if (!h->prefix) return !strcmp(h->channel, channel);
    if (strncmp(h->channel, channel, h->prefix) != 0) return false;
    const char *name = channel + h->prefix;
    return *name && !name[strspn(name, letters)];
}

// Return true if a handler is registered for this channel and accepts a message of this size.
static bool wanted(const kn_bus_client *j, const char *channel, size_t size)
{
    bool any = signs(j) && !strcmp(channel, KN_LIFE_CHANNEL) && size == KN_AUTH_NONCE + KN_AUTH_TRAILER;
    for (int i = 0; i < j->count && !any; i++) any = size <= j->heard[i].largest && matches(&j->heard[i], channel);
    return any;
}

// Check a complete message and call the handlers of its channel. Return the number of handlers called.
static int deliver(kn_bus_client *j, const char *channel, const unsigned char *bytes, size_t size)
{
    int handed = 0;
    if (!wanted(j, channel, size) || !believe(j, channel, bytes, &size)) return 0;
    const lcm_recv_buf_t buf = {
        .data = (void *)bytes, .data_size = (uint32_t)size, .recv_utime = kn_stamp_us(), .lcm = j->lcm};
    for (int i = 0; i < j->count; i++) {
        if (!matches(&j->heard[i], channel)) continue;
        j->heard[i].handler(&buf, channel, j->heard[i].user);
        handed++;
    }
    return handed;
}

// Add the next part to the message that is being assembled. Part 0 of a new message discards the unfinished message.
static int take_part(kn_bus_client *j, const kn_packet *p)
{
    typeof(j->long_message) *m = &j->long_message;
    if (p->part == 0) {
        m->whole = 0;
        if (p->parts < 2 || !wanted(j, p->channel, p->whole)) return 0;
        // Allocate a larger buffer only if the buffer of earlier messages is too small.
        if (p->whole > m->room) {
            unsigned char *bytes = realloc(m->bytes, p->whole);
            if (!bytes) return 0;
            m->bytes = bytes;
            m->room = p->whole;
        }
        snprintf(m->channel, sizeof m->channel, "%s", p->channel);
        m->sequence = p->sequence, m->whole = p->whole, m->got = 0, m->part = 0;
    }
    // Accept a part only if it follows the previous part of the same message without a gap.
    bool next = m->whole && p->sequence == m->sequence && p->whole == m->whole && p->part == m->part &&
                p->offset == m->got && p->size <= m->whole - m->got;
    if (!next) return 0;
    memcpy(m->bytes + m->got, p->payload, p->size);
    m->got += (uint32_t)p->size;
    m->part++;
    // If this part is not the last one, or if bytes are missing, wait for more parts.
    if (m->part < p->parts || m->got < m->whole) return 0;
    size_t size = m->whole;
    m->whole = 0;
    return deliver(j, m->channel, m->bytes, size);
}

int kn_bus_client_take(kn_bus_client *j, const void *datagram, size_t size)
{
    kn_packet p;
    if (kn_bus_unpack(datagram, size, &p) != KN_FRAMED) return 0;
    return p.split ? take_part(j, &p) : deliver(j, p.channel, p.payload, p.size);
}

// Process the waiting datagrams, at most KN_BUS_CLIENT_TURN, so that a flood of datagrams does not block the caller.
static int take_waiting(kn_bus_client *j)
{
    int handed = 0;
    bool here;
    for (int n = 0; n < KN_BUS_CLIENT_TURN && j->fd >= 0; n++) {
        // `here` becomes true if the datagram was sent to the address of this bus.
        ssize_t size = kn_bus_take(&j->bus, j->fd, j->datagram, sizeof j->datagram, &here);
        if (size < 0) break;
        if (here) handed += kn_bus_client_take(j, j->datagram, (size_t)size);
    }
    if (j->fd >= 0) return handed;
    j->handed = 0;
    for (int n = 0; n < KN_BUS_CLIENT_TURN && lcm_handle_timeout(j->lcm, 0) > 0; n++)
        ;
    return j->handed;
}

int kn_bus_client_handle(kn_bus_client *j, int timeout_ms)
{
    int64_t end_ns = kn_now_ns() + timeout_ms * INT64_C(1000000);
    for (;;) {
        say_hello(j);
        int handed = take_waiting(j);
        // Round the remaining time up to milliseconds, so that the loop does not poll without waiting in the last
        // millisecond.
        int64_t left_ms = (end_ns - kn_now_ns() + 999999) / 1000000;
        if (handed > 0 || left_ms <= 0) return handed;
        // Limit each wait to the interval of hellos, so that a hello is sent in time.
        int slice_ms = left_ms < HELLO_NS / 1000000 ? (int)left_ms : HELLO_NS / 1000000;
        poll(&(struct pollfd){.fd = kn_bus_client_fd(j), .events = POLLIN}, 1, slice_ms);
    }
}

void kn_bus_client_send(kn_bus_client *j, const char *channel, uint8_t *bytes, int size)
{
    int64_t life = atomic_load(&own.life);
    say_hello(j);
    // kneadd accepts a message only if the stamp has the number of kneadd's present life. Send nothing while this
    // number is not known.
    if (signs(j) && (life == 0 || own.mute)) return;
    if (signs(j)) {
        kn_auth_stamp stamp = {life, now_us() + atomic_load(&own.ahead_us)};
        size = (int)kn_auth_sign(&own.auth, channel, bytes, (size_t)size, stamp);
    }
    lcm_publish(j->lcm, channel, bytes, (unsigned)size);
}

int kn_bus_client_priority(int priority)
{
    return pthread_setschedparam(pthread_self(), priority > 0 ? SCHED_FIFO : SCHED_OTHER,
                                 &(struct sched_param){.sched_priority = priority});
}
