#include "clients/sweep/replay_trace.h"
#include "clients/cli/command.h"
#include "clients/cli/yaml_patch.h"
#include "clients/viewer/beside.h"
#include "core/hash.h"
#include "core/lattice/lattice.h"
#include "proto/knead_event_t.h"
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Magic number at the start of a trace file: "KBEtrace". It marks the version of the format.
#define MAGIC 0x656361727445424bu
// Largest sizes that are accepted from a file: number of nodes of the largest lattice of core/scene, and number of
// ticks in 4.6 hours.
enum { NODES_MAX = 1 << 22, TICKS_MAX = 1 << 24 };

// Beginning of a trace file.
typedef struct head {
    uint64_t magic, hash;  // hash: hash of all bytes of the file after this head
    kn_replay_trace trace; // sizes and results of the trace; the pointers in `trace` are not valid in a file
} head;

typedef struct record { // a trace that is being recorded during a replay
    kn_replay_trace *trace;
    kn_replay *replay;
    int64_t room;
} record;

void kn_replay_trace_free(kn_replay_trace *t)
{
    free(t->force_n);
    free(t->us);
    free(t->shape_m);
    memset(t, 0, sizeof *t);
}

// Make room for more ticks in the arrays of the trace.
static bool grow(record *r)
{
    int64_t room = r->room ? 2 * r->room : 4096;
    size_t row = (size_t)r->trace->probes * sizeof *r->trace->force_n;
    void *us = realloc(r->trace->us, (size_t)room * sizeof *r->trace->us);
    if (us) r->trace->us = us;
    void *force = us ? realloc(r->trace->force_n, (size_t)room * row) : NULL;
    if (!force) return false;
    r->trace->force_n = force;
    r->room = room;
    return true;
}

// Record the forces of one tick, and its processor time if a tool touches the object.
static bool take_tick(record *r)
{
    kn_replay_trace *t = r->trace;
    const kn_replay_tick *tick = &r->replay->tick;
    if (t->ticks == r->room && !grow(r)) return false;
    bool touches = false;
    for (int p = 0; p < t->probes; p++) {
        memcpy(t->force_n[t->ticks * t->probes + p], tick->out.force[p].contact_force_n, sizeof *t->force_n);
        touches |= tick->out.force[p].contacts > 0;
    }
    for (int i = 0; i < tick->out.event_count; i++) t->faults += tick->out.event[i].kind == KNEAD_EVENT_T_KIND_FAULT;
    t->us[t->ticks] = touches ? 1e-3f * (float)tick->cpu_ns : 0;
    t->ticks++;
    return true;
}

static int ascending(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Compute the median and the 90th percentile of the tick times. Return false when memory is short.
static bool take_times(kn_replay_trace *t)
{
    float *sorted = malloc((size_t)t->ticks * sizeof *sorted);
    int64_t count = 0;
    if (!sorted) return false;
    for (int64_t i = 0; i < t->ticks; i++)
        if (t->us[i] > 0) sorted[count++] = t->us[i];
    qsort(sorted, (size_t)count, sizeof *sorted, ascending);
    t->median_us = count > 0 ? (double)sorted[count / 2] : 0;
    t->p90_us = count > 0 ? (double)sorted[count * 9 / 10] : 0;
    free(sorted);
    return true;
}

bool kn_replay_trace_calm(kn_replay_trace *t, const kn_replay_trace *other)
{
    for (int64_t i = 0; i < t->ticks && i < other->ticks; i++) t->us[i] = fminf(t->us[i], other->us[i]);
    return take_times(t);
}

// Record the displacements of all nodes after the last tick.
static bool take_shape(record *r)
{
    kn_replay_trace *t = r->trace;
    const kn_model *model = r->replay->model;
    const kn_state *state = kn_replay_state(r->replay);
    // A block with two resolutions is recorded at all nodes of its fine lattice.
    bool block = !model->def.mesh;
    t->nodes = block ? model->grid.nodes : model->node_count;
    t->spacing_m = model->def.spacing_m;
    for (int k = 0; k < 3 && block; k++) t->grid[k] = model->def.nodes[k];
    t->shape_m = calloc((size_t)t->nodes, sizeof *t->shape_m);
    for (int n = 0; t->shape_m && n < t->nodes; n++) {
        int at[3];
        if (block) {
            kn_grid_coords(&model->grid, n, at);
            kn_composite_displacement(model, state, at, t->shape_m[n]);
            continue;
        }
        kn_state_position(model, state, n, t->shape_m[n]);
        for (int k = 0; k < 3; k++) t->shape_m[n][k] -= model->rest_m[n][k];
    }
    t->diverged = r->replay->servo.diverged;
    t->tally = r->replay->tally;
    return t->shape_m;
}

// Replay the log to its end and record the trace. *why: reason of a failure.
static bool play(record *r, const char **why)
{
    kn_replay_trace *t = r->trace;
    *why = "not enough memory";
    while (kn_replay_step(r->replay)) {
        // Recording begins at the first tick in which a probe has a session.
        bool begun = t->ticks > 0;
        for (int p = 0; p < t->probes; p++) begun |= r->replay->tick.out.force[p].live;
        if (begun && !take_tick(r)) return false;
        if (kn_interrupted) *why = "interrupted";
        if (kn_interrupted) return false;
    }
    if (t->ticks == 0) *why = "no hand holds a tool in this log";
    if (t->ticks == 0 || !take_shape(r)) return false;
    // If no tool ever touched the object, median and 90th percentile are 0; the comparison of the forces reports this
    // case.
    return take_times(t);
}

bool kn_replay_trace_play(kn_replay_trace *t, const kn_replay_def *def, char *error, size_t error_size)
{
    const char *why = NULL;
    memset(t, 0, sizeof *t);
    record r = {.trace = t, .replay = kn_replay_create(def, error, error_size)};
    if (!r.replay) return false;
    t->probes = r.replay->model->def.probe_count;
    bool ok = play(&r, &why);
    if (!ok) snprintf(error, error_size, "%s: %s", def->log_path, why);
    if (!ok) kn_replay_trace_free(t);
    kn_replay_destroy(r.replay);
    return ok;
}

// ---- trace files

// Hash the arrays of a trace.
static uint64_t hash_of(const kn_replay_trace *t)
{
    uint64_t hash = kn_hash_bytes(KN_HASH_SEED, t->force_n, (size_t)(t->ticks * t->probes) * sizeof *t->force_n);
    hash = kn_hash_bytes(hash, t->us, (size_t)t->ticks * sizeof *t->us);
    return kn_hash_bytes(hash, t->shape_m, (size_t)t->nodes * sizeof *t->shape_m);
}

bool kn_replay_trace_save(const kn_replay_trace *t, const char *path)
{
    char error[PATH_MAX];
    kn_beside file;
    head h = {.magic = MAGIC, .hash = hash_of(t), .trace = *t};
    h.trace.force_n = h.trace.shape_m = NULL;
    h.trace.us = NULL;
    if (!kn_beside_write(&file, path)) return false;
    fwrite(&h, sizeof h, 1, file.file);
    fwrite(t->force_n, sizeof *t->force_n, (size_t)(t->ticks * t->probes), file.file);
    fwrite(t->us, sizeof *t->us, (size_t)t->ticks, file.file);
    fwrite(t->shape_m, sizeof *t->shape_m, (size_t)t->nodes, file.file);
    return kn_beside_keep(&file, error, sizeof error); // reports a failed write, too
}

// Check the sizes in the head of a trace file before memory is allocated.
static bool sensible(const kn_replay_trace *t)
{
    bool block = t->grid[0] != 0;
    for (int k = 0; k < 3; k++)
        if (block ? t->grid[k] < 1 || t->grid[k] > NODES_MAX : t->grid[k] != 0) return false;
    if (t->ticks < 1 || t->ticks > TICKS_MAX || t->probes < 1 || t->probes > KN_PROBES_MAX || t->nodes < 1)
        return false;
    double cells = (double)t->grid[0] * (double)t->grid[1] * (double)t->grid[2];
    return t->nodes <= NODES_MAX && (!block || cells == (double)t->nodes) && t->spacing_m > 0;
}

// Read the arrays of a trace file. The size of the file must agree with its head, and the hash must be right.
static bool read_body(kn_replay_trace *t, FILE *f, uint64_t hash)
{
    size_t ticks = (size_t)t->ticks, forces = ticks * (size_t)t->probes, nodes = (size_t)t->nodes;
    size_t size = sizeof(head) + forces * sizeof *t->force_n + ticks * sizeof *t->us + nodes * sizeof *t->shape_m;
    if (fseek(f, 0, SEEK_END) != 0 || ftell(f) != (long)size || fseek(f, sizeof(head), SEEK_SET) != 0) return false;
    t->force_n = malloc(forces * sizeof *t->force_n);
    t->us = malloc(ticks * sizeof *t->us);
    t->shape_m = malloc(nodes * sizeof *t->shape_m);
    return t->force_n && t->us && t->shape_m && fread(t->force_n, sizeof *t->force_n, forces, f) == forces &&
           fread(t->us, sizeof *t->us, ticks, f) == ticks && fread(t->shape_m, sizeof *t->shape_m, nodes, f) == nodes &&
           hash_of(t) == hash;
}

bool kn_replay_trace_load(kn_replay_trace *t, const char *path)
{
    head h;
    memset(t, 0, sizeof *t);
    FILE *f = fopen(path, "rb");
    if (!f) return false;
    bool whole = fread(&h, sizeof h, 1, f) == 1 && h.magic == MAGIC;
    if (whole) *t = h.trace;
    t->force_n = t->shape_m = NULL;
    t->us = NULL;
    whole = whole && sensible(t) && read_body(t, f, h.hash);
    fclose(f);
    if (!whole) kn_replay_trace_free(t);
    return whole;
}

bool kn_replay_trace_hash(const char *path, uint64_t *hash)
{
    static unsigned char bytes[1 << 16];
    FILE *f = fopen(path, "rb");
    *hash = KN_HASH_SEED;
    if (!f) return false;
    for (size_t n; (n = fread(bytes, 1, sizeof bytes, f)) > 0;) *hash = kn_hash_bytes(*hash, bytes, n);
    bool ok = !ferror(f);
    fclose(f);
    return ok;
}

// Hash a canonical scene text without its lines about small cells (accuracy, margin, reach) and about mesh paths.
static uint64_t hash_lines(const char *text)
{
    static const char *const left_out[] = {"  accuracy: ", "  margin: ", "    reach: ", "  mesh: "};
    uint64_t hash = KN_HASH_SEED;
    for (const char *line = text; *line;) {
        size_t size = strcspn(line, "\n") + (strchr(line, '\n') != NULL);
        bool out = false;
        for (int i = 0; i < 4; i++) out |= strncmp(line, left_out[i], strlen(left_out[i])) == 0;
        if (!out) hash = kn_hash_bytes(hash, line, size);
        line += size;
    }
    return hash;
}

// Hash a scene text without its blocks `quality`, `solver` and `mesh`. The block `mesh` sets only the rate and the
// contents of mesh messages. The text is parsed again first, so texts written by different versions of the program
// compare equal. `beside`: relative paths in the text start from the folder of this file. Return false if the text
// cannot be parsed.
static bool scene_hash(const char *beside, const char *name, const char *text, uint64_t *hash)
{
    static const char *const block[] = {"quality", "solver", "mesh"};
    char error[512], *rest = strdup(text);
    // Remove the top-level blocks `quality`, `solver` and `mesh` from the text, one after the other.
    for (int i = 0; i < 3 && rest; i++) {
        char *whole = rest;
        rest = kn_yaml_patch(whole, block[i], "", error, sizeof error);
        free(whole);
    }
    // Parse what is left of the text, which gives its canonical form.
    kn_scene *scene =
        rest ? kn_scene_parse_beside(beside, name, rest, strlen(rest), NULL, 0, error, sizeof error) : NULL;
    if (scene) *hash = hash_lines(scene->text);
    free(rest);
    kn_scene_destroy(scene);
    return scene;
}

// Return true if `scene` is not NULL and its hash equals `logged`.
static bool is_of(const char *path, const kn_scene *scene, uint64_t logged)
{
    uint64_t hash;
    return scene && scene_hash(path, path, scene->text, &hash) && hash == logged;
}

// Compare the scene of the log with the scene under test: first with the user's sets (`key=value` texts), then without
// them.
static bool same_scene(const kn_replay *r, const kn_replay_def *def, const char *path, const kn_scene *scene)
{
    char error[512];
    uint64_t logged;
    // A log without a scene cannot be compared and is accepted.
    if (!r->logged_text) return true;
    if (!scene_hash(def->log_path, r->logged_name, r->logged_text, &logged)) return false;
    if (is_of(path, scene, logged)) return true;
    // The user's sets (`key=value`) may be the only difference between the scenes, so load the scene file once more
    // without the sets.
    kn_scene *file = kn_scene_load(path, NULL, 0, error, sizeof error);
    bool same = is_of(path, file, logged);
    kn_scene_destroy(file);
    return same;
}

bool kn_replay_log_check(const kn_replay_def *def, const char *path, const kn_scene *scene, char *error, size_t size)
{
    const char *log = def->log_path;
    kn_replay *r = kn_replay_create(def, error, size);
    // Each reason for a refusal has a message of its own. If the replay cannot be created, `error` is already set.
    bool fit = r && !r->damage[0] && r->tally.malformed == 0 && same_scene(r, def, path, scene);
    if (r && r->damage[0]) snprintf(error, size, "%s: %s, expected a whole log of one run", log, r->damage);
    else if (r && r->tally.malformed > 0)
        snprintf(error, size, "%s: %lld malformed records, expected a whole log", log, (long long)r->tally.malformed);
    else if (r && !fit)
        snprintf(error, size, "%s: was recorded with another scene, '%s', expected one of %s", log, r->logged_name,
                 scene->name);
    kn_replay_destroy(r);
    return fit;
}
