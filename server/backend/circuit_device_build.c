// Requests to a device: the words of an image, and the requests of each job.
#include "hdl/registers.h"
#include "server/backend/circuit_device_parts.h"
#include <string.h>

enum { READ_OP = 5, WRITE_OP = 5, WAIT_OP = 14 }; // length of an operation without its words, bytes

// ---- words of an image, in the order in which they are sent

static uint32_t low(int64_t v) { return (uint32_t)v; }
static uint32_t high(int64_t v) { return (uint32_t)(v >> 32); }

// Segments of an image: series of records. Those before NODE_STATE never change.
enum { CONFIG, OMEGA, TABLE, NODE, REST, EDGE, NODE_STATE, EDGE_STATE, SEGMENTS };

static uint32_t config_word(const kn_fixed_config *c, int word)
{
    const int32_t words[] = {c->node_count, c->edge_count,   c->passes, c->iterations, c->d_shift,
                             c->kv_shift,   c->octave & 127, c->beta,   c->beta_shift, c->relax};
    return (uint32_t)words[word];
}

// Words: held, u (0), load.
static uint32_t node_word(const kn_fixed_node *n, int word)
{
    return word == 0 ? n->held : word < 4 ? 0 : (uint32_t)n->load[word - 4];
}

static uint32_t edge_word(const kn_fixed_edge *e, int word)
{
    return word == 0 ? (uint32_t)e->i | (uint32_t)e->j << 16 : (uint32_t)(word == 1 ? e->kv : e->ia);
}

// Words: x, held, u.
static uint32_t node_state_word(const kn_device *d, int node, int word)
{
    if (word < 6) return (word % 2 ? high : low)(d->from->x[3 * node + word / 2]);
    return word == 6 ? d->image->node[node].held : (uint32_t)d->from->u[3 * node + word - 7];
}

// Return a word of a record.
static uint32_t word_of(const kn_device *d, int segment, int record, int word)
{
    const kn_fixed_image *image = d->image;
    switch (segment) {
    case CONFIG: return config_word(&image->config, word);
    case OMEGA: return word < image->config.iterations ? (uint32_t)image->config.omega[word] : 0;
    case TABLE: return (uint32_t)image->table[word];
    case NODE: return node_word(&image->node[record], word);
    case REST: return (word % 2 ? high : low)(image->node[record].x[word / 2]);
    case EDGE: return edge_word(&image->edge[record], word);
    case NODE_STATE: return node_state_word(d, record, word);
    default: return (word ? high : low)(d->from->h[record]);
    }
}

typedef struct segment {
    uint32_t address;
    int records, words, stride; // words of a record; distance from one record to the next
} segment;

static segment segment_of(const kn_device *d, int which)
{
    const int table = KN_FIXED_SEGMENTS + 1, k = KN_FIXED_ITERATIONS_MAX;
    const segment all[SEGMENTS] = {
        [CONFIG] = {KN_REG_NODE_COUNT, 1, 10, 10},          [OMEGA] = {KN_REG_OMEGA, 1, k, k},
        [TABLE] = {KN_WINDOW_TABLE, 1, table, table},       [NODE] = {KN_WINDOW_NODES + 6, d->nodes, 7, 16},
        [REST] = {KN_WINDOW_REST, d->nodes, 6, 8},          [EDGE] = {KN_WINDOW_EDGES, d->edges, 3, 8},
        [NODE_STATE] = {KN_WINDOW_NODES, d->nodes, 10, 16}, [EDGE_STATE] = {KN_WINDOW_EDGES + 3, d->edges, 2, 8},
    };
    return all[which];
}

int64_t kn_device_load_ns(const kn_device *d, const kn_fixed_image *image)
{
    int64_t bytes = image->config.node_count * (WRITE_OP + 40LL) + image->config.edge_count * (WRITE_OP + 8LL);
    bytes += bytes / (KN_FRAMER_PAYLOAD - 64) * 40; // the bytes of frames and replies
    return d->load_bytes > 0 ? (int64_t)((double)bytes * (double)d->load_ns / (double)d->load_bytes) : 0;
}

// ---- the next request of each job

static bool write_word(kn_device *d, uint32_t address, uint32_t word)
{
    return kn_request_write(&d->request, address, &word, 1);
}

// Add a WAIT until the circuit is not busy, with a limit of at least `clocks` clock cycles.
static bool idle(kn_device *d, int64_t clocks)
{
    int64_t limit = clocks / 256 + 16;
    return kn_request_wait(&d->request, KN_REG_STATUS, KN_STATUS_BUSY, 0, (uint16_t)(limit < 65535 ? limit : 65535));
}

static bool fits_bytes(const kn_device *d, int bytes) { return d->request.size + bytes <= KN_FRAMER_PAYLOAD; }

// Return the number of words that a WRITE can still carry.
static int room(const kn_device *d)
{
    return fits_bytes(d, WRITE_OP) ? (KN_FRAMER_PAYLOAD - d->request.size - WRITE_OP) / 4 : 0;
}

// Return an upper limit of the clock cycles that the circuit takes for a checksum.
static int64_t clocks_of_state(const kn_device *d) { return 64 * (7 * (int64_t)d->nodes + d->edges); }

static void build_checksum(kn_device *d)
{
    write_word(d, KN_REG_CONTROL, KN_CONTROL_CRC);
    idle(d, clocks_of_state(d));
    kn_request_read(&d->request, KN_REG_STATUS, KN_REG_STATE_CRC - KN_REG_STATUS + 1);
}

static void build_identify(kn_device *d)
{
    kn_request_read(&d->request, KN_REG_ID, 4);
    kn_request_read(&d->request, KN_REG_STATUS, 5);
}

// All words have been sent: declare the state loaded, clear flags and status, and read the circuit's own checksum.
static void build_load_end(kn_device *d)
{
    write_word(d, KN_REG_CONTROL, KN_CONTROL_LOADED);
    idle(d, clocks_of_state(d));
    write_word(d, KN_REG_CONTROL, KN_CONTROL_CLEAR);
    write_word(d, KN_REG_STATUS, KN_STATUS_SEQ | KN_STATUS_EMPTY);
    build_checksum(d);
}

// Add a write of as many words of a segment as fit into the request, from an offset on. Return the number of words.
static int write_segment(kn_device *d, int which, const segment *s, int offset)
{
    uint32_t words[KN_REQUEST_WRITE_MOST];
    int done = 0;
    for (int fit; offset + done < s->records * s->words && (fit = room(d)) > 0;) {
        int record = (offset + done) / s->words, word = (offset + done) % s->words, count = s->words - word;
        if (count > fit) count = fit;
        for (int w = 0; w < count; w++) words[w] = word_of(d, which, record, word + w);
        kn_request_write(&d->request, s->address + (uint32_t)(record * s->stride + word), words, (uint32_t)count);
        done += count;
    }
    return done;
}

uint32_t kn_device_kept(const kn_device *d)
{
    return d->nonce ^ 0x5a5a5a5a; // this number is odd like the nonce, and so differs from ~nonce, which is even
}

// Fill the request with words of the shape or of the state, from d->position on. SCRATCH tells which parts the circuit
// has, so that an interrupted load is recognised. The last request of a part sets SCRATCH to the new value.
static void build_load(kn_device *d)
{
    int at = 0, next = d->position;
    if (next == 0) write_word(d, KN_REG_SCRATCH, d->shaped ? kn_device_kept(d) : ~d->nonce);
    for (int i = d->shaped ? NODE_STATE : 0; i < (d->shaped ? SEGMENTS : NODE_STATE); i++) {
        const segment s = segment_of(d, i);
        if (next >= at) next += write_segment(d, i, &s, next - at);
        at += s.records * s.words;
    }
    d->words = next - d->position;
    if (d->words > 0) return;
    if (d->shaped && !d->arrived) {
        build_load_end(d);
        return;
    }
    write_word(d, KN_REG_SCRATCH, d->shaped ? d->nonce : kn_device_kept(d));
    kn_request_read(&d->request, KN_REG_SCRATCH, 1);
}

// Add a write of as many boundary records as fit into the request.
static void build_bounds(kn_device *d)
{
    uint32_t words[KN_REQUEST_WRITE_MOST];
    int left = d->count - d->written, fit = room(d) / 4;
    d->wrote = left < fit ? left : fit;
    for (int i = 0; i < d->wrote; i++) {
        const kn_fixed_bound *b = &d->bound[d->written + i];
        words[4 * i] = b->node | (uint32_t)b->holds << 31;
        for (int k = 0; k < 3; k++) words[4 * i + 1 + k] = (uint32_t)b->value[k];
    }
    if (d->wrote > 0)
        kn_request_write(&d->request, KN_WINDOW_BOUNDS + 4 * (uint32_t)d->written, words, 4 * (uint32_t)d->wrote);
}

// Add as many operations of a step as fit into the request, in this order: write the missing bounds, write the doorbell
// register after the last bound, read the reactions, and read the circuit's own numbers.
static void build_step(kn_device *d)
{
    d->wrote = d->words = 0;
    d->rings = false;
    if (!d->rung) {
        build_bounds(d);
        if (d->written + d->wrote < d->count || !fits_bytes(d, 2 * (WRITE_OP + 4) + WAIT_OP + READ_OP)) return;
        d->rings = true;
        write_word(d, KN_REG_BOUND_COUNT, (uint32_t)d->count);
        write_word(d, KN_REG_STEP_SEQ, d->seq + 1);
        kn_request_wait(&d->request, KN_REG_STATUS, KN_STATUS_BUSY, 0, d->limit);
    }
    int fit = (KN_REQUEST_READ_MOST - d->request.words - KN_DEVICE_TALE) / 6, left = d->count - d->position;
    if (!fits_bytes(d, 2 * READ_OP)) fit = 0;
    d->words = left < fit ? left : fit;
    if (d->words > 0)
        kn_request_read(&d->request, KN_WINDOW_REACTIONS + 6 * (uint32_t)d->position, 6 * (uint32_t)d->words);
    kn_request_read(&d->request, KN_REG_TICK, KN_DEVICE_TALE);
}

// Read the checksum first, then as many nodes and edges as one reply holds.
static void build_read(kn_device *d)
{
    int total = d->nodes + d->edges;
    d->words = 0;
    if (d->position < 0) {
        build_checksum(d);
        return;
    }
    for (int at = d->position; at < total; at++, d->words++) {
        bool node = at < d->nodes;
        uint32_t address =
            node ? KN_WINDOW_NODES + 16 * (uint32_t)at : KN_WINDOW_EDGES + 8 * (uint32_t)(at - d->nodes) + 3;
        if (!kn_request_read(&d->request, address, node ? 10 : 2)) break;
    }
}

// Read the displacements of as many nodes as one reply holds, then the circuit's numbers of ticks and requests.
static void build_moves(kn_device *d)
{
    const int fit = (KN_REQUEST_READ_MOST - d->request.words - 2) / 3, left = d->nodes - d->position;
    d->words = left < fit ? left : fit;
    for (int at = d->position; at < d->position + d->words; at++)
        kn_request_read(&d->request, KN_WINDOW_NODES + 16 * (uint32_t)at + 7, 3);
    kn_request_read(&d->request, KN_REG_TICK, 2);
}

// A busy circuit refuses access to its memory windows, and a PCI card cannot report a refusal. A request that accesses
// a window therefore begins with a WAIT. The first request of a step needs no WAIT, because the step before has ended.
bool kn_device_waits(const kn_device *d) { return d->job != IDENTIFY && (d->again || d->job != STEP); }

void kn_device_build(kn_device *d)
{
    kn_request_begin(&d->request, ++d->tag);
    if (kn_device_waits(d)) idle(d, clocks_of_state(d) + (int64_t)d->limit * 256);
    switch (d->job) {
    case IDENTIFY: build_identify(d); break;
    case LOAD: build_load(d); break;
    case STEP: build_step(d); break;
    case MOVES: build_moves(d); break;
    case READ: build_read(d); break;
    default: build_checksum(d); break;
    }
}
