#include "server/backend/circuit_device.h"
#include "hdl/knead_hash.h"
#include "hdl/registers.h"
#include "server/backend/circuit_device_parts.h"
#include "server/clock.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

// Number of misses (unanswered requests) after which a device is lost; factor by which jobs other than STEP and
// IDENTIFY may take longer before they count as a miss.
enum { MISSES = 3, PATIENCE = 10 };

// ---- errors and statistics

// Store the reason as one line for kn_device_why, and return `status`.
__attribute__((format(printf, 3, 4))) static kn_link_status refuse(kn_device *d, kn_link_status status,
                                                                   const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(d->why, sizeof d->why, format, arguments);
    va_end(arguments);
    return status;
}

// Mark the device as LOST and drop its job.
static kn_link_status lose(kn_device *d, kn_loss loss, kn_link_status status)
{
    d->loss = loss;
    d->stats.lost += d->state != KN_DEVICE_LOST;
    d->state = KN_DEVICE_LOST;
    d->job = IDLE;
    d->out = false;
    return d->last = status;
}

// Return the histogram bucket of a duration. There are eight buckets per doubling of the duration, from 256 ns up.
static int bucket_of(int64_t ns)
{
    if (ns < 256) return 0;
    int octave = 63 - __builtin_clzll((uint64_t)ns), bucket = 8 * (octave - 8) + (int)(ns >> (octave - 3) & 7);
    return bucket < KN_DEVICE_BUCKETS ? bucket : KN_DEVICE_BUCKETS - 1;
}

static void remember(kn_device *d, int64_t ns)
{
    d->bucket[bucket_of(ns)]++;
    d->stats.steps++;
    if (ns > d->stats.max_ns) d->stats.max_ns = ns;
}

// Return the lower end of the bucket in which the quantile lies; 0 before the first step.
static int64_t quantile(const kn_device *d, double share)
{
    int64_t seen = 0;
    for (int i = 0; i < KN_DEVICE_BUCKETS && d->stats.steps; i++)
        if ((double)(seen += d->bucket[i]) >= share * (double)d->stats.steps)
            return (int64_t)(8 + i % 8) << (8 + i / 8) >> 3;
    return 0;
}

// ---- replies: their words are the requested ones, in order

// Return the signed number in the lowest bits of two words; bits above it are ignored.
static int64_t wide(uint32_t lo, uint32_t hi, int bits)
{
    uint64_t v = (uint64_t)hi << 32 | lo;
    return (int64_t)(v << (64 - bits)) >> (64 - bits);
}

// Indices of the eight words from register STATUS to register STATE_CRC.
enum { AT_STATUS, AT_FLAGS, AT_SCRATCH, AT_TICK, AT_SEQ, AT_CYCLES, AT_CYCLES_MAX, AT_CRC };

// Store the circuit's numbers of requests and ticks (STEP_SEQ, TICK). Return true if the circuit is loaded and its
// register SCRATCH has the expected value.
static bool accept_numbers(kn_device *d, const uint32_t *words, uint32_t scratch)
{
    d->seq = words[AT_SEQ];
    d->tick = words[AT_TICK];
    return words[AT_STATUS] & KN_STATUS_LOADED && words[AT_SCRATCH] == scratch;
}

// Return 2^log2, at most 2^24.
static int32_t power(uint32_t log2) { return 1 << ((log2 & 0xff) < 24 ? log2 & 0xff : 24); }

// Accept a circuit only if it has the ID, major version and hash of this build.
static kn_link_status accept_identify(kn_device *d, const uint32_t *words)
{
    d->job = IDLE;
    if (words[0] != KN_ENGINE_ID)
        return refuse(d, KN_LINK_PROTOCOL, "%s: ID is 0x%08x: expected 0x%08x, a circuit of Knead", d->uri, words[0],
                      (unsigned)KN_ENGINE_ID);
    if (words[1] >> 16 != KN_ENGINE_VERSION >> 16)
        return refuse(d, KN_LINK_PROTOCOL, "%s: VERSION is %u: expected %u", d->uri, words[1] >> 16,
                      (unsigned)KN_ENGINE_VERSION >> 16);
    if (words[2] != KN_BUILD_HASH)
        return refuse(d, KN_LINK_PROTOCOL,
                      "%s: BUILD_HASH is 0x%08x: expected 0x%08x, a circuit built with these formats and registers",
                      d->uri, words[2], (unsigned)KN_BUILD_HASH);
    d->broken = false;
    if (d->state == KN_DEVICE_LOST) d->load_bytes = d->load_ns = 0; // the link may be slower or faster than before
    d->caps = (kn_device_caps){power(words[3]), power(words[3] >> 8), power(words[3] >> 16) - 1};
    if (d->caps.bounds > KN_FIXED_LIST_MAX) d->caps.bounds = KN_FIXED_LIST_MAX;
    d->seq = words[8];
    // A circuit whose register SCRATCH has the number of the loaded image still has the unchanging part of this image.
    d->shaped = d->shaped && (words[4 + AT_SCRATCH] == d->nonce || words[4 + AT_SCRATCH] == kn_device_kept(d));
    d->state = KN_DEVICE_IDENTIFIED;
    return KN_LINK_OK;
}

// A load runs in two parts: first what never changes of an image (the shape), then the state. Each reply advances the
// position. When all words have been sent, the circuit's checksum decides whether the load succeeded.
static kn_link_status accept_load(kn_device *d, const uint32_t *words)
{
    if (d->words > 0) {
        d->position += d->words;
        return KN_LINK_OK;
    }
    if (!d->shaped) {
        d->shaped = true;
        d->position = 0;
        if (!d->from) d->job = IDLE, d->state = KN_DEVICE_IDENTIFIED;
        return KN_LINK_OK;
    }
    if (d->arrived) {
        d->job = IDLE;
        d->state = KN_DEVICE_SYNCED;
        return KN_LINK_OK;
    }
    words += 2; // skip the words of the two WAITs
    d->arrived = accept_numbers(d, words, kn_device_kept(d)) && d->tick == 0 && words[AT_CRC] == d->crc;
    if (d->arrived) return KN_LINK_OK;
    d->job = IDLE;
    d->state = KN_DEVICE_IDENTIFIED;
    // SCRATCH says that the circuit has the shape, but the checksum is wrong, so the circuit has something else.
    d->shaped = false;
    d->loss = words[AT_STATUS] & KN_STATUS_LOADED ? KN_LOSS_LOAD : KN_LOSS_BLANK;
    return refuse(d, KN_LINK_PROTOCOL, "%s: STATE_CRC is 0x%08x: expected 0x%08x, that of the loaded state", d->uri,
                  words[AT_CRC], d->crc);
}

// Read the checksum. The circuit's numbers of ticks and requests must be unchanged.
static kn_link_status accept_crc(kn_device *d, const uint32_t *words)
{
    d->job = IDLE;
    d->crc = words[1 + AT_CRC];
    uint32_t seq = d->seq, tick = d->tick;
    bool loaded = accept_numbers(d, words + 1, d->nonce);
    if (loaded && d->seq == seq && d->tick == tick) return KN_LINK_OK;
    refuse(d, KN_LINK_PROTOCOL, "%s: the circuit is at another tick, or has lost its state", d->uri);
    return lose(d, loaded ? KN_LOSS_SEQ_GAP : KN_LOSS_BLANK, KN_LINK_PROTOCOL);
}

// Accept a part of a step's reply. The circuit's numbers of ticks and requests must have increased by one. Then store
// the reactions of the reply, and after the last reaction the result.
static kn_link_status accept_step(kn_device *d, const uint32_t *words)
{
    d->written += d->wrote;
    if (!d->rung && !d->rings) return KN_LINK_OK;
    // Only a request that writes the doorbell register gets a reply that begins with the word of a WAIT.
    uint32_t status = d->rings ? *words++ : KN_STATUS_LOADED;
    const uint32_t *tale =
        words + 6 * d->words; // TICK, STEP_SEQ, CYCLES, CYCLES_MAX, STATE_CRC, RESIDUAL, RESULT_FLAGS
    if ((status & (KN_STATUS_LOADED | KN_STATUS_SEQ | KN_STATUS_EMPTY)) != KN_STATUS_LOADED || tale[0] != d->tick + 1 ||
        tale[1] != d->seq + 1) {
        refuse(d, KN_LINK_PROTOCOL, "%s: tick %u of request %u, status 0x%x: expected tick %u of request %u", d->uri,
               tale[0], tale[1], status, d->tick + 1, d->seq + 1);
        bool blank = !(status & KN_STATUS_LOADED) || status & KN_STATUS_EMPTY;
        return lose(d, blank ? KN_LOSS_BLANK : KN_LOSS_SEQ_GAP, KN_LINK_PROTOCOL);
    }
    d->rung = true;
    for (int i = 0; i < 3 * d->words; i++)
        d->reaction[d->position + i / 3][i % 3] = wide(words[2 * i], words[2 * i + 1], KN_FIXED_ACC);
    d->position += d->words;
    if (d->position < d->count) return KN_LINK_OK;
    d->result = (kn_device_result){.tick = tale[0],
                                   .flags = tale[7],
                                   .count = d->count,
                                   .residual = (int64_t)((uint64_t)tale[6] << 32 | tale[5]),
                                   .reaction = d->reaction};
    d->tick++;
    d->seq++;
    d->job = IDLE;
    remember(d, kn_now_ns() - d->began_ns);
    return KN_LINK_OK;
}

// Accept the displacements of some nodes. The circuit must not have taken a further tick.
static kn_link_status accept_moves(kn_device *d, const uint32_t *words)
{
    const uint32_t *tale = words + 3 * d->words; // TICK, STEP_SEQ
    if (tale[0] != d->tick || tale[1] != d->seq) {
        refuse(d, KN_LINK_PROTOCOL, "%s: tick %u of request %u: expected tick %u of request %u", d->uri, tale[0],
               tale[1], d->tick, d->seq);
        return lose(d, KN_LOSS_SEQ_GAP, KN_LINK_PROTOCOL);
    }
    int32_t *moves = d->into;
    for (int i = 0; i < 3 * d->words; i++) moves[3 * d->position + i] = (int32_t)wide(words[i], 0, KN_FIXED_U);
    d->position += d->words;
    if (d->position == d->nodes) d->job = IDLE;
    return KN_LINK_OK;
}

// Accept a part of the state: first the checksum (position -1), then nodes and edges, which are checked against the
// checksum at the end.
static kn_link_status accept_read(kn_device *d, const uint32_t *words)
{
    kn_fixed *into = d->into;
    if (d->position < 0) {
        kn_link_status status = accept_crc(d, words);
        if (status != KN_LINK_OK) return status;
        d->job = READ;
        d->position = 0;
        return KN_LINK_OK;
    }
    for (int end = d->position + d->words; d->position < end; d->position++) {
        int at = d->position, edge = at - d->nodes;
        if (edge >= 0) into->h[edge] = wide(words[0], words[1], KN_FIXED_H);
        for (int k = 0; k < 3 && edge < 0; k++) {
            into->x[3 * at + k] = wide(words[2 * k], words[2 * k + 1], KN_FIXED_X);
            into->u[3 * at + k] = (int32_t)wide(words[7 + k], 0, KN_FIXED_U);
        }
        words += edge >= 0 ? 2 : 10;
    }
    if (d->position < d->nodes + d->edges) return KN_LINK_OK;
    d->job = IDLE;
    if (kn_fixed_crc(into) == d->crc) return KN_LINK_OK;
    return refuse(d, KN_LINK_PROTOCOL, "%s: the state that was read does not match its STATE_CRC", d->uri);
}

// Pass a good reply to the job that asked for it, without the word of a leading WAIT.
static kn_link_status accept(kn_device *d, const kn_reply *reply)
{
    const uint32_t *words = reply->words + kn_device_waits(d);
    switch (d->job) {
    case IDENTIFY: {
        kn_link_status status = accept_identify(d, words);
        if (status != KN_LINK_OK) d->loss = KN_LOSS_WRONG_HASH;
        return status;
    }
    case LOAD: return accept_load(d, words);
    case STEP: return accept_step(d, words);
    case MOVES: return accept_moves(d, words);
    case READ: return accept_read(d, words);
    default: return accept_crc(d, words);
    }
}

// ---- the exchange

// Return the time after which an unanswered request counts as a miss: the link's miss time plus the time of the bytes
// on the wire.
static int64_t miss_ns(const kn_device *d)
{
    bool short_one = !d->patient && (d->job == STEP || d->job == MOVES || d->job == IDENTIFY);
    int64_t patience = short_one ? 1 : PATIENCE; // allow more time for jobs in which the circuit computes a checksum
    return patience * d->link.miss_ns + d->link.byte_ns * (d->request.size + 4 * d->request.words + 32);
}

// The link itself is broken: mark the device as LOST, and open the link again at the next identify.
static kn_link_status broken(kn_device *d, kn_link_status status)
{
    d->broken = true;
    refuse(d, status, "%s: %s", d->uri, kn_link_words(status));
    return lose(d, status == KN_LINK_GONE ? KN_LOSS_REMOVED : KN_LOSS_IO, status);
}

// Build and send the next request of the job. first_ns is kept when a request is sent again.
static kn_link_status send(kn_device *d)
{
    kn_device_build(d);
    d->sent_ns = kn_now_ns();
    if (!d->again) d->first_ns = d->sent_ns, d->tries = 1;
    d->out = true;
    return d->link.submit(d->link.self, &d->request);
}

// A request failed. Send the request again. After MISSES misses, or after MISSES times the time of a miss, mark the
// device as LOST. A damaged frame is no miss, since its request is sent again at once.
static kn_link_status repeat(kn_device *d, kn_link_status status)
{
    d->misses += status != KN_LINK_CRC;
    d->stats.timeouts += status == KN_LINK_IO;
    if (d->misses >= MISSES || kn_now_ns() - d->first_ns >= MISSES * miss_ns(d)) {
        kn_loss loss = status == KN_LINK_IO ? KN_LOSS_TIMEOUT : status == KN_LINK_CRC ? KN_LOSS_CRC : KN_LOSS_REFUSED;
        refuse(d, status, "%s: %s, asked %d time%s", d->uri, kn_link_words(status), d->tries, d->tries == 1 ? "" : "s");
        return lose(d, loss, status);
    }
    d->stats.retries++;
    d->tries++;
    d->out = false;
    d->again = true;
    return KN_LINK_OK;
}

// Handle a reply. A request that was answered with an error is repeated like a missed one. A load's bytes and time are
// added up for kn_device_load_ns.
static kn_link_status answered(kn_device *d, const kn_reply *reply)
{
    // the circuit refused the request, or was busy for longer than the WAIT lasts
    if (reply->status != KN_REPLY_OK) return repeat(d, KN_LINK_PROTOCOL);
    if (d->job == LOAD) {
        d->load_bytes += d->request.size + 4 * reply->count + 16;
        d->load_ns += kn_now_ns() - d->sent_ns;
    }
    kn_link_status status = accept(d, reply);
    d->out = d->again = false;
    d->misses = 0;
    return status;
}

// Send a request if none is under way, then wait for its reply until the deadline or until it is a miss.
static kn_link_status exchange(kn_device *d, int64_t deadline_ns)
{
    kn_reply reply;
    kn_link_status status = d->out ? KN_LINK_OK : send(d);
    if (status == KN_LINK_OK) {
        int64_t miss_at_ns = d->sent_ns + miss_ns(d);
        status = d->link.wait(d->link.self, deadline_ns < miss_at_ns ? deadline_ns : miss_at_ns, &reply);
        if (status == KN_LINK_OK) return answered(d, &reply);
        if (status == KN_LINK_CRC) return repeat(d, status);
        if (status == KN_LINK_LATE) return kn_now_ns() < miss_at_ns ? KN_LINK_LATE : repeat(d, KN_LINK_IO);
    }
    return broken(d, status);
}

// Exchange requests until the job ends, fails or the deadline is over.
static kn_link_status drive(kn_device *d, int64_t deadline_ns)
{
    kn_link_status status = KN_LINK_OK;
    while (d->job != IDLE && status == KN_LINK_OK) {
        status = exchange(d, deadline_ns);
        if (status == KN_LINK_OK && d->job != IDLE && kn_now_ns() >= deadline_ns) status = KN_LINK_LATE;
    }
    return status;
}

// Start a job at a position.
static void begin(kn_device *d, job next, int position)
{
    d->job = next;
    d->position = position;
    d->out = d->again = false;
    d->misses = 0;
}

// ---- functions of circuit_device.h

kn_device *kn_device_open(const char *uri, char why[KN_LINK_WHY])
{
    kn_device *d = calloc(1, sizeof *d);
    if (!d) snprintf(why, KN_LINK_WHY, "%.100s: not enough memory", uri);
    if (!d || !(d->linked = kn_link_open(&d->link, uri, "/sys", why))) {
        free(d);
        return NULL;
    }
    d->loss = KN_LOSS_COUNT;
    memcpy(d->uri, uri, strlen(uri) + 1); // the URI fits, because kn_link_open has refused a longer one
    return d;
}

// Add the counters of the open link to a sum.
static void add_counts(const kn_device *d, kn_link_counts *sum)
{
    const kn_link_counts *now = d->linked ? d->link.counts : NULL;
    if (!now) return;
    sum->crc += now->crc;
    sum->coding += now->coding;
    sum->stray += now->stray;
}

static void shut(kn_device *d)
{
    add_counts(d, &d->stats.link);
    if (d->linked) d->link.close(d->link.self);
    d->linked = false;
}

void kn_device_close(kn_device *device)
{
    if (!device) return;
    shut(device);
    free(device);
}

kn_device_state kn_device_state_of(const kn_device *device) { return device->state; }
const char *kn_device_why(const kn_device *device) { return device->why; }
kn_loss kn_device_loss(const kn_device *device) { return device->loss; }
const kn_device_caps *kn_device_caps_of(const kn_device *device) { return &device->caps; }
const kn_link *kn_device_link(const kn_device *device) { return &device->link; }

kn_link_status kn_device_identify(kn_device *d, int64_t deadline_ns)
{
    if (d->job == IDENTIFY) return drive(d, deadline_ns);
    if (d->broken) shut(d);
    // Treat the link as broken until it has answered, because its name may now lead to another device, as with the
    // number of a pseudo-terminal.
    d->broken = true;
    if (!d->linked && !(d->linked = kn_link_open(&d->link, d->uri, "/sys", d->why)))
        return lose(d, KN_LOSS_REMOVED, KN_LINK_GONE);
    d->link.forget(d->link.self);
    if (d->state != KN_DEVICE_LOST) d->state = KN_DEVICE_CLOSED;
    begin(d, IDENTIFY, 0);
    return drive(d, deadline_ns);
}

static kn_link_status fits(kn_device *d, const kn_fixed_image *image)
{
    const char *wrong = kn_fixed_check(image);
    if (wrong) return refuse(d, KN_LINK_PROTOCOL, "%s: %s", d->uri, wrong);
    if (image->config.node_count > d->caps.nodes || image->config.edge_count > d->caps.edges)
        return refuse(d, KN_LINK_PROTOCOL, "%s: %d nodes and %d edges: expected at most %d and %d", d->uri,
                      image->config.node_count, image->config.edge_count, d->caps.nodes, d->caps.edges);
    return KN_LINK_OK;
}

// Return the limit of a WAIT for a tick, in 256 reads: more reads than a tick has clock cycles, since the circuit reads
// at most once per clock cycle.
static uint16_t limit_of(const kn_fixed_config *c)
{
    const uint32_t clocks = kn_engine_clocks((uint32_t)c->node_count, (uint32_t)c->edge_count, KN_FIXED_LIST_MAX,
                                             (uint32_t)c->passes, (uint32_t)c->iterations);
    return (uint16_t)(clocks / 256 < 65535 ? clocks / 256 + 1 : 65535);
}

// Return a checksum of the unchanging part of an image.
static uint32_t crc_of(const kn_fixed_image *image)
{
    const kn_fixed_config *c = &image->config;
    uLong crc = crc32(0, (const Bytef *)c, sizeof *c);
    crc = crc32(crc, (const Bytef *)image->table, sizeof image->table);
    crc = crc32(crc, (const Bytef *)image->node, (uInt)((size_t)c->node_count * sizeof *image->node));
    return (uint32_t)crc32(crc, (const Bytef *)image->edge, (uInt)((size_t)c->edge_count * sizeof *image->edge));
}

kn_link_status kn_device_load(kn_device *d, const kn_fixed_image *image, const kn_fixed *state, int64_t deadline_ns)
{
    if (d->job == LOAD && d->image == image && d->from == state) return drive(d, deadline_ns);
    if (d->state == KN_DEVICE_CLOSED || d->state == KN_DEVICE_LOST)
        return refuse(d, KN_LINK_PROTOCOL, "%s: expected identify before load", d->uri);
    kn_link_status fit = fits(d, image);
    if (fit != KN_LINK_OK) {
        d->loss = KN_LOSS_LOAD;
        return fit;
    }
    // Skip the shape if the circuit has it. Otherwise choose a new odd number for SCRATCH.
    const uint32_t crc = crc_of(image);
    d->shaped = d->shaped && d->image_crc == crc;
    if (!d->shaped) d->nonce = (uint32_t)kn_now_ns() | 1;
    if (!state && d->shaped) return KN_LINK_OK;
    d->image_crc = crc;
    d->image = image;
    d->from = state;
    d->nodes = image->config.node_count;
    d->edges = image->config.edge_count;
    d->limit = limit_of(&image->config);
    if (state) d->crc = kn_fixed_crc(state);
    d->arrived = false;
    d->state = KN_DEVICE_LOADING;
    begin(d, LOAD, 0);
    return drive(d, deadline_ns);
}

void kn_device_distrust(kn_device *d) { d->shaped = false; }

void kn_device_be_patient(kn_device *d, bool patient) { d->patient = patient; }

static bool ready(kn_device *d) { return d->state == KN_DEVICE_SYNCED && d->job == IDLE; }

kn_link_status kn_device_submit(kn_device *d, const kn_fixed_bound *bound, int count)
{
    if (d->state == KN_DEVICE_SYNCED && d->job == STEP) return KN_LINK_LATE;
    if (d->state == KN_DEVICE_LOST) return d->last;
    if (!ready(d)) return refuse(d, KN_LINK_PROTOCOL, "%s: expected a circuit that is loaded", d->uri);
    if (count < 0 || count > d->caps.bounds)
        return refuse(d, KN_LINK_PROTOCOL, "%s: %d nodes under tools: expected 0 to %d", d->uri, count, d->caps.bounds);
    // Copy the list of bounds, since parts of the list may be sent later or again.
    if (count > 0) memcpy(d->bound, bound, (size_t)count * sizeof *bound);
    d->count = count;
    d->written = 0;
    d->rung = false;
    d->began_ns = kn_now_ns();
    begin(d, STEP, 0);
    // Send the first request here, so that circuit and caller work at the same time.
    kn_link_status status = send(d);
    if (status == KN_LINK_OK) return KN_LINK_OK;
    return broken(d, status);
}

kn_link_status kn_device_wait(kn_device *d, int64_t deadline_ns, kn_device_result *result)
{
    if (d->state == KN_DEVICE_LOST) return d->last;
    if (d->job != STEP) return refuse(d, KN_LINK_PROTOCOL, "%s: expected a step under way", d->uri);
    kn_link_status status = drive(d, deadline_ns);
    if (status == KN_LINK_OK) *result = d->result;
    return status;
}

// Read from the circuit between two ticks.
static kn_link_status fetch(kn_device *d, job next, int position, void *into, int64_t deadline_ns)
{
    if (d->job != next || d->into != into) {
        if (!ready(d)) return refuse(d, KN_LINK_PROTOCOL, "%s: expected a loaded circuit between two ticks", d->uri);
        d->into = into;
        begin(d, next, position);
    }
    return drive(d, deadline_ns);
}

kn_link_status kn_device_moves(kn_device *d, int32_t *u, int64_t deadline_ns)
{
    return fetch(d, MOVES, 0, u, deadline_ns);
}

kn_link_status kn_device_crc(kn_device *d, int64_t deadline_ns, uint32_t *crc)
{
    kn_link_status status = fetch(d, CRC, 0, NULL, deadline_ns);
    if (status == KN_LINK_OK) *crc = d->crc;
    return status;
}

kn_link_status kn_device_read(kn_device *d, kn_fixed *into, int64_t deadline_ns)
{
    return fetch(d, READ, -1, into, deadline_ns);
}

bool kn_device_gone(kn_device *d)
{
    const bool gone = ready(d) && d->link.gone && d->link.gone(d->link.self);
    if (gone) broken(d, KN_LINK_GONE);
    return gone;
}

void kn_device_stats_of(const kn_device *d, kn_device_stats *stats)
{
    *stats = d->stats;
    add_counts(d, &stats->link);
    stats->p50_ns = quantile(d, 0.50);
    stats->p99_ns = quantile(d, 0.99);
}
