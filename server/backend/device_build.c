// What a device is asked: the words of an image and the requests of each job.
#include "hdl/registers.h"
#include "server/backend/device_job.h"
#include <string.h>

enum { READ_OP = 5, WRITE_OP = 5, WAIT_OP = 14 }; // bytes of heads

// ---- words of an image, in the order in which they are sent

static uint32_t low(int64_t v)
{
    return (uint32_t)v;
}
static uint32_t high(int64_t v)
{
    return (uint32_t)(v >> 32);
}

typedef uint32_t source(const kn_device *d, int word);

static uint32_t config_word(const kn_device *d, int word)
{
    const kn_fixed_config *c = &d->image->config;
    const int32_t words[] = {c->node_count, c->edge_count,   c->passes, c->iterations, c->d_shift,
                             c->kv_shift,   c->octave & 127, c->beta,   c->beta_shift, c->relax};
    return (uint32_t)words[word];
}

static uint32_t omega_word(const kn_device *d, int word)
{
    return word < d->image->config.iterations ? (uint32_t)d->image->config.omega[word] : 0;
}

static uint32_t table_word(const kn_device *d, int word)
{
    return (uint32_t)d->image->table[word];
}

static uint32_t node_word(const kn_device *d, int word)
{
    int node = word / 16, w = word % 16;
    const kn_fixed_node *rest = &d->image->node[node];
    if (w < 6) return (w % 2 ? high : low)(d->from->x[3 * node + w / 2]);
    if (w < 7) return rest->held;
    if (w < 10) return (uint32_t)d->from->u[3 * node + w - 7];
    return w < 13 ? (uint32_t)rest->load[w - 10] : 0;
}

static uint32_t rest_word(const kn_device *d, int word)
{
    int w = word % 8;
    return w < 6 ? (w % 2 ? high : low)(d->image->node[word / 8].x[w / 2]) : 0;
}

static uint32_t edge_word(const kn_device *d, int word)
{
    int edge = word / 8;
    const kn_fixed_edge *e = &d->image->edge[edge];
    switch (word % 8) {
    case 0:
        return (uint32_t)e->i | (uint32_t)e->j << 16;
    case 1:
        return (uint32_t)e->kv;
    case 2:
        return (uint32_t)e->ia;
    case 3:
        return low(d->from->h[edge]);
    case 4:
        return high(d->from->h[edge]);
    default:
        return 0;
    }
}

typedef struct segment {
    uint32_t address;
    int words;
    source *source;
} segment;

enum { SEGMENTS = 6 };

static void segments(const kn_device *d, segment s[SEGMENTS])
{
    const segment all[SEGMENTS] = {{KN_REG_NODE_COUNT, 10, config_word},
                                   {KN_REG_OMEGA, KN_FIXED_ITERATIONS_MAX, omega_word},
                                   {KN_WINDOW_TABLE, KN_FIXED_SEGMENTS + 1, table_word},
                                   {KN_WINDOW_NODES, 16 * d->nodes, node_word},
                                   {KN_WINDOW_REST, 8 * d->nodes, rest_word},
                                   {KN_WINDOW_EDGES, 8 * d->edges, edge_word}};
    memcpy(s, all, sizeof all);
}

// ---- requests: what the next one of a job asks for

static bool write_word(kn_device *d, uint32_t address, uint32_t word)
{
    return kn_request_write(&d->request, address, &word, 1);
}

static bool idle(kn_device *d, int64_t clocks) // a WAIT for it
{
    int64_t limit = clocks / 256 + 16;
    return kn_request_wait(&d->request, KN_REG_STATUS, KN_STATUS_BUSY, 0, (uint16_t)(limit < 65535 ? limit : 65535));
}

static bool fits_bytes(const kn_device *d, int bytes)
{
    return d->request.size + bytes <= KN_FRAMER_PAYLOAD;
}

static int room(const kn_device *d) // words that a WRITE can still bring
{
    return fits_bytes(d, WRITE_OP) ? (KN_FRAMER_PAYLOAD - d->request.size - WRITE_OP) / 4 : 0;
}

static int64_t clocks_of_state(const kn_device *d)
{
    return 64 * (7 * (int64_t)d->nodes + d->edges);
}

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

// Where all words are there: the circuit takes them for a state, and says what it has.
static void build_load_end(kn_device *d)
{
    write_word(d, KN_REG_CONTROL, KN_CONTROL_LOADED);
    idle(d, clocks_of_state(d));
    write_word(d, KN_REG_CONTROL, KN_CONTROL_CLEAR);
    write_word(d, KN_REG_STATUS, KN_STATUS_SEQ | KN_STATUS_EMPTY);
    build_checksum(d);
}

static void build_load(kn_device *d)
{
    segment s[SEGMENTS];
    uint32_t words[KN_REQUEST_WRITE_MOST];
    int at = 0, next = d->position;
    segments(d, s);
    if (next == 0) write_word(d, KN_REG_SCRATCH, ~d->nonce); // of a load that has begun
    for (int i = 0; i < SEGMENTS; at += s[i++].words) {
        int offset = next - at, left = s[i].words - offset, fit = room(d);
        if (offset < 0 || left <= 0 || fit <= 0) continue;
        if (left > fit) left = fit;
        for (int w = 0; w < left; w++) words[w] = s[i].source(d, offset + w);
        kn_request_write(&d->request, s[i].address + (uint32_t)offset, words, (uint32_t)left);
        next += left;
    }
    d->words = next - d->position;
    if (d->words > 0) return;
    if (!d->arrived) {
        build_load_end(d);
        return;
    }
    write_word(d, KN_REG_SCRATCH, d->nonce); // of one that has arrived, which resume asks for
    kn_request_read(&d->request, KN_REG_SCRATCH, 1);
}

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

// As much as fits: bounds that are missing, the bell behind the last of them, reactions, and the circuit's own numbers.
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

// A circuit at work refuses windows, and a card cannot say so: such a request begins by waiting. A step need not, the
// one before it is over.
bool kn_device_waits(const kn_device *d)
{
    return d->job != IDENTIFY && (d->again || d->job != STEP);
}

void kn_device_build(kn_device *d)
{
    kn_request_begin(&d->request, ++d->tag);
    if (kn_device_waits(d)) idle(d, clocks_of_state(d) + (int64_t)d->limit * 256);
    switch (d->job) {
    case IDENTIFY:
        build_identify(d);
        break;
    case LOAD:
        build_load(d);
        break;
    case STEP:
        build_step(d);
        break;
    case READ:
        build_read(d);
        break;
    default:
        build_checksum(d);
        break;
    }
}
