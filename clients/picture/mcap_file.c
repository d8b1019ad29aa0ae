#include "clients/picture/mcap_file.h"
#include "core/algebra/algebra.h"
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

// An MCAP file is a sequence of records: one byte for the kind, 8 bytes for the length, the content. Messages lie in
// chunks. Each chunk is followed by an index of its messages for each channel, and the file ends with an index of all
// chunks. Numbers are little-endian.
#define MAGIC "\x89MCAP0\r\n"
#define ROOT "World" // frame of the scene; names of tools have small letters
enum { HEADER = 1, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, CHUNK_INDEX, STATISTICS = 11, DATA_END = 15 };

// The schemas of the messages, in the language of JSON Schema.
#define OBJECT_OF(members) "{\"type\":\"object\",\"properties\":{" members "}}"
#define IS(name, type) "\"" name "\":" type
#define LIST(name, type) IS(name, "{\"type\":\"array\",\"items\":" type "}")
#define NUMBER "{\"type\":\"number\"}"
#define INTEGER "{\"type\":\"integer\"}"
#define TEXT "{\"type\":\"string\"}"
#define TIME OBJECT_OF(IS("sec", INTEGER) "," IS("nsec", INTEGER))
#define VECTOR OBJECT_OF(IS("x", NUMBER) "," IS("y", NUMBER) "," IS("z", NUMBER))
#define TURN OBJECT_OF(IS("x", NUMBER) "," IS("y", NUMBER) "," IS("z", NUMBER) "," IS("w", NUMBER))
#define COLOR OBJECT_OF(IS("r", NUMBER) "," IS("g", NUMBER) "," IS("b", NUMBER) "," IS("a", NUMBER))
#define POSE OBJECT_OF(IS("position", VECTOR) "," IS("orientation", TURN))
#define ROD(part) IS(part "_length", NUMBER) "," IS(part "_diameter", NUMBER)
#define ARROW OBJECT_OF(IS("pose", POSE) "," ROD("shaft") "," ROD("head") "," IS("color", COLOR))
#define TRIANGLES                                                                                                      \
    OBJECT_OF(IS("pose", POSE) "," LIST("points", VECTOR) "," LIST("indices", INTEGER) "," IS("color", COLOR))
#define STAMP IS("timestamp", TIME)
#define NAMES IS("frame_id", TEXT) "," IS("id", TEXT) "," IS("lifetime", TIME)
#define ENTITY OBJECT_OF(STAMP "," NAMES "," LIST("arrows", ARROW) "," LIST("triangles", TRIANGLES))
#define FRAMES IS("parent_frame_id", TEXT) "," IS("child_frame_id", TEXT)
#define FORCES IS("contact_force_n", VECTOR) "," IS("force_n", VECTOR) "," IS("torque_n_m", VECTOR)
static const char *const schemas[][2] = {
    {"foxglove.FrameTransform", OBJECT_OF(STAMP "," FRAMES "," IS("translation", VECTOR) "," IS("rotation", TURN))},
    {"foxglove.SceneUpdate", OBJECT_OF(LIST("deletions", OBJECT_OF(IS("id", TEXT))) "," LIST("entities", ENTITY))},
    {"knead.Force", OBJECT_OF(STAMP "," IS("tick", INTEGER) "," IS("position_m", VECTOR) "," FORCES)},
};
enum { TF, SCENE, FORCE, CHANNELS = FORCE + KN_PROBES_MAX };

typedef struct bytes { // a growing array
    uint8_t *at;
    size_t count, room;
} bytes;

struct kn_mcap {
    FILE *file;
    int64_t epoch_us;
    uint64_t written; // bytes written to the file
    // head: records of the schemas and channels. chunk: messages of the present chunk. index: for each channel, time
    // and place of its messages in the present chunk. chunks: records of the index of chunks.
    bytes head, chunk, index[CHANNELS], chunks;
    uint64_t chunk_ns[2], all_ns[2]; // first and last time of the messages in the present chunk, and in the file
    uint64_t channels, chunk_count, messages, count[CHANNELS]; // count: messages of each channel
    bool failed;                                               // memory was short
};

static void put(kn_mcap *m, bytes *b, const void *data, size_t size)
{
    if (b->count + size > b->room) {
        const size_t room = 2 * (b->count + size);
        uint8_t *more = realloc(b->at, room);
        m->failed |= !more;
        if (more) b->at = more, b->room = room;
    }
    if (m->failed || size == 0) return;
    memcpy(b->at + b->count, data, size);
    b->count += size;
}

static void put_number(kn_mcap *m, bytes *b, uint64_t x, int size)
{
    for (int i = 0; i < size; i++) put(m, b, &(uint8_t){(uint8_t)(x >> 8 * i)}, 1);
}

// Append a record. Each letter of the format stands for one part of its content: 2, 4, 8: a uint64_t in so many bytes;
// t: a text after its length; b: a `const bytes *` after its length in 4 bytes; r: one without its length.
static void record(kn_mcap *m, bytes *to, int kind, const char *format, ...)
{
    bytes content = {0};
    va_list part;
    va_start(part, format);
    for (; *format; format++) {
        const char *text = *format == 't' ? va_arg(part, const char *) : NULL;
        const bytes *raw = *format == 'b' || *format == 'r' ? va_arg(part, const bytes *) : NULL;
        const size_t size = text ? strlen(text) : raw ? raw->count : 0;
        if (text || *format == 'b') put_number(m, &content, size, 4);
        if (text || raw) put(m, &content, text ? (const void *)text : raw->at, size);
        else put_number(m, &content, va_arg(part, uint64_t), *format - '0');
    }
    va_end(part);
    put_number(m, to, (uint64_t)kind, 1), put_number(m, to, content.count, 8);
    put(m, to, content.at, content.count);
    free(content.at);
}
#define U(x) ((uint64_t)(x))

static void write_out(kn_mcap *m, bytes *b)
{
    m->written += fwrite(b->at, 1, b->count, m->file);
    free(b->at);
}

// Write the present chunk, the index of its messages, and its entry in the index of chunks.
static void end_chunk(kn_mcap *m)
{
    bytes out = {0}, places = {0};
    const uint64_t first = m->chunk_ns[0], last = m->chunk_ns[1], size = m->chunk.count;
    if (size == 0) return;
    record(m, &out, CHUNK, "8884t8r", first, last, size, U(crc32(0, m->chunk.at, (uInt)size)), "", size, &m->chunk);
    const uint64_t length = out.count;
    for (uint64_t c = 0; c < m->channels; c++) {
        if (m->index[c].count == 0) continue;
        put_number(m, &places, c, 2), put_number(m, &places, m->written + out.count, 8);
        record(m, &out, INDEX, "2b", c, &m->index[c]);
        m->index[c].count = 0;
    }
    record(m, &m->chunks, CHUNK_INDEX, "8888b8t88", first, last, m->written, length, &places, out.count - length, "",
           size, size);
    m->chunk_count++, m->chunk.count = 0;
    write_out(m, &out);
    free(places.at);
}

// Add a message to the present chunk, and release `value`, which is NULL if memory was short.
static void add(kn_mcap *m, uint64_t channel, uint64_t ns, json_t *value)
{
    char *text = json_dumps(value, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(value);
    m->failed |= !text;
    if (m->chunk.count == 0) m->chunk_ns[0] = ns;
    if (m->messages == 0) m->all_ns[0] = ns;
    m->chunk_ns[1] = m->all_ns[1] = ns;
    put_number(m, &m->index[channel], ns, 8), put_number(m, &m->index[channel], m->chunk.count, 8);
    const bytes content = {(uint8_t *)text, text ? strlen(text) : 0, 0};
    record(m, &m->chunk, MESSAGE, "2488r", channel, m->count[channel]++, ns, ns, &content);
    free(text);
    m->messages++;
    if (m->chunk.count > 1000000) end_chunk(m);
}

kn_mcap *kn_mcap_open(FILE *file, const kn_model *model, int64_t epoch_us)
{
    bytes out = {0};
    char topic[KN_NAME_MAX + 16];
    static const char *const fixed[] = {"/tf", "/scene"};
    kn_mcap *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    *m = (kn_mcap){.file = file, .epoch_us = epoch_us, .channels = FORCE + U(model->def.probe_count)};
    for (uint64_t i = 0; i < 3; i++)
        record(m, &m->head, SCHEMA, "2ttt", i + 1, schemas[i][0], "jsonschema", schemas[i][1]);
    for (uint64_t c = 0; c < m->channels; c++) {
        snprintf(topic, sizeof topic, "/%s/force", c < FORCE ? "" : model->def.probe[c - FORCE].name);
        record(m, &m->head, CHANNEL, "22tt4", c, U(c < FORCE ? c + 1 : 3), c < FORCE ? fixed[c] : topic, "json", U(0));
    }
    put(m, &out, MAGIC, 8);
    record(m, &out, HEADER, "tt", "", "knead");
    put(m, &out, m->head.at, m->head.count);
    write_out(m, &out);
    return m;
}

static json_t *vector(const double v[3])
{
    json_t *number[3];
    for (int k = 0; k < 3; k++) number[k] = isfinite(v[k]) ? json_real(v[k]) : json_null();
    return json_pack("{s:o,s:o,s:o}", "x", number[0], "y", number[1], "z", number[2]);
}

// Four zeros mean no rotation.
static json_t *turn_of(const double wxyz[4])
{
    double unit[4];
    kn_turn_unit(wxyz, unit);
    return json_pack("{s:f,s:f,s:f,s:f}", "x", unit[1], "y", unit[2], "z", unit[3], "w", unit[0]);
}

static json_t *stamp(uint64_t ns)
{
    return json_pack("{s:I,s:I}", "sec", (json_int_t)(ns / 1000000000), "nsec", (json_int_t)(ns % 1000000000));
}

static json_t *color(const float rgb[3])
{
    return json_pack("{s:f,s:f,s:f,s:i}", "r", (double)rgb[0], "g", (double)rgb[1], "b", (double)rgb[2], "a", 1);
}

static uint64_t when(const kn_mcap *m, double time_s) { return 1000 * U(m->epoch_us + llround(1e6 * time_s)); }

void kn_mcap_tick(kn_mcap *m, const kn_model *model, const kn_replay_tick *t)
{
    const uint64_t ns = when(m, t->time_s);
    for (int p = 0; p < t->out.probes; p++) {
        const kn_force *f = &t->out.force[p];
        const kn_probe_def *def = &model->def.probe[p];
        if (!f->live) continue;
        // A plate is always level.
        const double *turn = def->shape == KN_PROBE_PLATE ? (double[4]){1} : f->proxy_orientation_wxyz;
        add(m, TF, ns,
            json_pack("{s:o,s:s,s:s,s:o,s:o}", "timestamp", stamp(ns), "parent_frame_id", ROOT, "child_frame_id",
                      def->name, "translation", vector(f->proxy_position_m), "rotation", turn_of(turn)));
        add(m, FORCE + U(p), ns,
            json_pack("{s:o,s:I,s:o,s:o,s:o,s:o}", "timestamp", stamp(ns), "tick", (json_int_t)t->out.tick,
                      "position_m", vector(t->pose[p].position_m), "contact_force_n", vector(f->contact_force_n),
                      "force_n", vector(f->force_n), "torque_n_m", vector(f->torque_n_m)));
    }
}

static void append(kn_mcap *m, json_t *list, json_t *value) { m->failed |= json_array_append_new(list, value) != 0; }

// An entity: a surface in a frame, and arrows in the same frame; takes `arrows`.
static json_t *entity(kn_mcap *m, uint64_t ns, const char *frame, int points, const float (*xyz)[3], int triangles,
                      const int (*corner)[3], const float rgb[3], json_t *arrows)
{
    json_t *place = json_array(), *index = json_array();
    for (int i = 0; i < points; i++)
        append(m, place, vector((double[]){(double)xyz[i][0], (double)xyz[i][1], (double)xyz[i][2]}));
    for (int i = 0; i < 3 * triangles; i++) append(m, index, json_integer(corner[i / 3][i % 3]));
    return json_pack("{s:o,s:s,s:s,s:o,s:b,s:[],s:o,s:[],s:[],s:[],s:[],s:[{s:{s:o,s:o},s:o,s:[],s:o,s:o}],s:[],s:[]}",
                     "timestamp", stamp(ns), "frame_id", frame, "id", frame, "lifetime", stamp(0), "frame_locked", 1,
                     "metadata", "arrows", arrows, "cubes", "spheres", "cylinders", "lines", "triangles", "pose",
                     "position", vector((double[3]){0}), "orientation", turn_of((double[4]){0}), "points", place,
                     "colors", "indices", index, "color", color(rgb), "texts", "models");
}

// Append an arrow for a force, unless there is none. An arrow points along x in its own frame.
static void append_arrow(kn_mcap *m, json_t *arrows, const kn_force *f)
{
    const double *c = f->contact_force_n, size = sqrt(kn_dot(c, c)), x = c[0] / size, y = c[1] / size, z = c[2] / size;
    if (!(size > 0)) return;
    const double *turn = x >= 0 ? (double[4]){1 + x, 0, -z, y} : (double[4]){y, z, 0, 1 - x};
    append(m, arrows,
           json_pack("{s:{s:o,s:o},s:f,s:f,s:f,s:f,s:o}", "pose", "position", vector(f->proxy_position_m),
                     "orientation", turn_of(turn), "shaft_length", 0.01 * size, "shaft_diameter", 0.001, "head_length",
                     0.003, "head_diameter", 0.003, "color", color((float[]){0.8F, 0.2F, 0.1F})));
}

void kn_mcap_moment(kn_mcap *m, const kn_moment *moment)
{
    const uint64_t ns = when(m, moment->time_s);
    json_t *arrows = json_array(), *entities = json_array();
    kn_object_still still = {0};
    kn_tool_form f;
    for (int p = 0; p < moment->model->def.probe_count; p++) {
        if (!moment->tool[p]) continue;
        append_arrow(m, arrows, moment->tool[p]);
        m->failed |= !kn_tool_form_make(&f, moment->model, p);
        append(m, entities,
               entity(m, ns, moment->model->def.probe[p].name, f.point_count, f.xyz, f.triangle_count, f.triangle,
                      (float[]){0.6F, 0.6F, 0.65F}, json_array()));
        kn_tool_form_free(&f);
    }
    m->failed |= !kn_object_still_state(&still, moment->model, moment->state);
    append(m, entities,
           entity(m, ns, ROOT, still.vertex_count, still.now, still.triangle_count, still.triangle, still.view.color,
                  arrows));
    kn_object_still_free(&still);
    add(m, SCENE, ns,
        json_pack("{s:[{s:o,s:i,s:s}],s:o}", "deletions", "timestamp", stamp(ns), "type", 1, "id", "", "entities",
                  entities)); // type 1: in place of all that was shown
}

bool kn_mcap_close(kn_mcap *m)
{
    bytes out = {0};
    if (!m) return true;
    end_chunk(m);
    record(m, &out, DATA_END, "4", U(0)); // no checksum
    const uint64_t summary = m->written + out.count;
    put(m, &out, m->head.at, m->head.count);
    record(m, &out, STATISTICS, "824444884", m->messages, U(3), m->channels, U(0), U(0), m->chunk_count, m->all_ns[0],
           m->all_ns[1], U(0)); // no attachments, no metadata, no counts of channels
    put(m, &out, m->chunks.at, m->chunks.count);
    record(m, &out, FOOTER, "884", summary, U(0), U(0)); // no offsets in the summary, no checksum
    put(m, &out, MAGIC, 8);
    write_out(m, &out);
    const bool fits = !m->failed;
    for (int c = 0; c < CHANNELS; c++) free(m->index[c].at);
    free(m->head.at), free(m->chunk.at), free(m->chunks.at);
    free(m);
    return fits;
}
