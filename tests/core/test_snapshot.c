#include "core/snapshot.h"
#include "core/algebra/bytes.h"
#include "core/lattice/lattice.h"
#include "core/scene/scene.h"
#include "core/step.h"
#include "tests/check.h"

// Every kind of object that a scene can declare, under every kind of tool.
typedef struct kind {
    const char *what, *scene, *sets[2];
    double depth_m;
} kind;
static const kind kinds[] = {
    {"dough in f32", "dough-small.yaml", {NULL, NULL}, 6e-3},
    {"dough in f64", "dough-small.yaml", {"solver.precision=f64", NULL}, 6e-3},
    {"viscoelastic jelly", "jelly.yaml", {NULL, NULL}, 6e-3},
    {"gas in cells", "dough-pressure.yaml", {NULL, NULL}, 5e-3},
    {"gas in the whole object", "dough-pressure.yaml", {"object.pressure=object", NULL}, 5e-3},
    {"two resolutions", "dough-fine.yaml", {NULL, NULL}, 2e-3},
    {"a mesh", "bun.yaml", {NULL, NULL}, 5e-3},
    {"a mesh in f64", "bun.yaml", {"solver.precision=f64", NULL}, 5e-3},
    {"coupled tools that stick, on a table with friction", "pinch.yaml", {NULL, NULL}, 4e-3},
    {"a tool of parts", "rolling-pin.yaml", {NULL, NULL}, 4e-3},
    {"Runge-Kutta", "dough-small.yaml", {"solver={kind: rk4, mass_scale: 1e7}", NULL}, 1e-3},
};
#define KINDS (int)(sizeof kinds / sizeof *kinds)

typedef struct object {
    kn_scene *scene;
    kn_model *model;
} object;

static object object_of(const kind *k)
{
    object o = {.scene = load_scene(k->scene, k->sets, k->sets[0] ? 1 : 0)};
    o.model = build(&o.scene->model);
    return o;
}

static void object_free(object *o)
{
    kn_model_destroy(o->model);
    kn_scene_destroy(o->scene);
}

// Move the tools by the state's tick: they come down on the object side by side while they drift and turn, hold, and
// go up again.
static void step(const object *o, const kind *k, kn_state *state)
{
    kn_input in = {0};
    kn_output out;
    double extent[3], t = (double)state->tick;
    kn_model_def_extent(&o->model->def, extent);
    for (int p = 0; p < o->model->def.probe_count; p++) {
        double way = t < 150   ? t / 150
                     : t < 190 ? 1
                               : 1 - (t - 190) / 60,
               side = p - 0.5 * (o->model->def.probe_count - 1);
        double turn = 1e-3 * t;
        bool ball = o->model->def.probe[p].shape == KN_PROBE_SPHERE;
        in.probe[p] = (kn_probe_input){
            .attached = t > 5 && t<245,
                                   .position_m = {0.3 * extent[0] * side + 1e-5 * t, 1e-5 * t,
                                                  extent[2] + (ball ? o->model->def.probe[p].radius_m : 0) + 1e-3 -
                                                      (k->depth_m + 1e-3) * way},
                                   .velocity_m_s = {1e-2, 1e-2,
                                                    t < 150   ? -(k->depth_m + 1e-3) / 0.15
                                                    : t < 190 ? 0
                                                              : (k->depth_m + 1e-3) / 0.06},
                                   .orientation_wxyz = {cos(turn), 0, 0, sin(turn)}, .grip = t> 160};
    }
    if (!strcmp(k->scene, "pinch.yaml"))
        for (int p = 0; p < 2; p++) in.probe[p].position_m[2] += o->model->def.probe[p].radius_m;
    CHECK(kn_step(o->model, state, &in, &out) == KN_OK);
}

TEST("for every kind of object a restored snapshot continues with the same bits as the original, also during a press")
{
    for (int i = 0; i < KINDS; i++) {
        AT_END(object_free) object o = object_of(&kinds[i]);
        size_t room = kn_snapshot_size_max(o.model), size = 0;
        uint8_t *bytes = malloc(room), *again = malloc(room);
        OWN(kn_state) *straight = kn_state_create(o.model), *read = kn_state_create(o.model);
        OWN(kn_state) *kept = kn_state_keep(o.model);
        int contacts = 0, anchors = 0;
        for (int at = 0; at < 300;
             at += KN_LENGTH(150, 60, 60)) { // before the press, on the way down, holding, on the way up, afterwards
            while (straight->tick < at) step(&o, &kinds[i], straight);
            for (int p = 0; p < KN_PROBES_MAX; p++) contacts += straight->probe[p].contacts;
            anchors += straight->anchor_count;
            size = kn_snapshot_write(o.model, straight, bytes, room);
            CHECK(size > 0 && size == kn_snapshot_size(o.model, straight));
            CHECK(kn_snapshot_read(o.model, bytes, size, kept) == KN_SNAPSHOT_FITS);
            CHECK(kn_state_hash(o.model, kept) == kn_state_hash(o.model, straight) && kept->tick == straight->tick);
            CHECK(kn_snapshot_write(o.model, kept, again, room) == size && memcmp(bytes, again, size) == 0);
            kn_state_reset(o.model, read); // a state whose scratch has stepped something else
            kn_state_copy(o.model, read, kept);
            OWN(kn_state) *fresh = kn_state_create(o.model);
            kn_state_copy(o.model, fresh, kept);
            for (int n = 0; n < KN_LENGTH(15, 40, 40); n++)
                step(&o, &kinds[i], read), step(&o, &kinds[i], fresh), step(&o, &kinds[i], straight);
            bool same = kn_state_hash(o.model, read) == kn_state_hash(o.model, straight) &&
                        kn_state_hash(o.model, fresh) == kn_state_hash(o.model, straight);
            if (!same) fprintf(stderr, "%s, at step %d\n", kinds[i].what, at);
            CHECK(same);
        }
        printf("     %s: %zu bytes, at most %zu; a state takes %zu, a kept one %zu\n", kinds[i].what, size, room,
               o.model->state_bytes, kn_state_kept(o.model));
        CHECK(contacts > 0 && kn_state_kept(o.model) < o.model->state_bytes);
        CHECK((anchors > 0) == (straight->anchor != NULL));
        free(bytes), free(again);
    }
}

TEST("a snapshot is refused by another lattice or material; tools, device and quality may differ")
{
    static const struct {
        kind other;
        kn_snapshot_fit fit;
    } table[] = {
        {{"", "dough-small.yaml", {"object.spacing=5 mm"}, 0}, KN_SNAPSHOT_LATTICE},
        {{"", "dough-small.yaml", {"solver.precision=f64"}, 0}, KN_SNAPSHOT_LATTICE},
        {{"", "jelly.yaml", {NULL}, 0}, KN_SNAPSHOT_LATTICE},
        {{"", "bun.yaml", {NULL}, 0}, KN_SNAPSHOT_LATTICE},
        {{"", "dough-small.yaml", {"material.k1=300 gf/cm^3"}, 0}, KN_SNAPSHOT_MATERIAL},
        {{"", "dough-small.yaml", {"solver.dt=500 us"}, 0}, KN_SNAPSHOT_MATERIAL},
        {{"", "dough-small.yaml", {"support=frictionless"}, 0}, KN_SNAPSHOT_MATERIAL},
        {{"", "dough-small.yaml", {"probes.finger.radius=2 cm"}, 0}, KN_SNAPSHOT_FITS},
        {{"", "dough-small.yaml", {"device=touch"}, 0}, KN_SNAPSHOT_FITS},
        {{"", "dough-small.yaml", {"solver.iterations=20"}, 0}, KN_SNAPSHOT_FITS},
    };
    AT_END(object_free) object o = object_of(&kinds[0]);
    OWN(kn_state) *state = kn_state_create(o.model);
    while (state->tick < 100) step(&o, &kinds[0], state);
    size_t size = kn_snapshot_size(o.model, state);
    uint8_t *bytes = malloc(size);
    CHECK(kn_snapshot_write(o.model, state, bytes, size - 1) == 0);
    CHECK(kn_snapshot_write(o.model, state, bytes, size) == size);
    for (size_t t = 0; t < sizeof table / sizeof *table; t++) {
        AT_END(object_free) object other = object_of(&table[t].other);
        OWN(kn_state) *into = kn_state_keep(other.model);
        kn_snapshot_fit fit = kn_snapshot_read(other.model, bytes, size, into);
        if (fit != table[t].fit) fprintf(stderr, "%s: %s\n", table[t].other.sets[0], kn_snapshot_fit_name(fit));
        CHECK(fit == table[t].fit);
    }
    free(bytes);
}

TEST("a truncated snapshot is refused; a changed byte gives a refusal or a valid state")
{
    AT_END(object_free) object o = object_of(&kinds[8]); // an object with anchors
    OWN(kn_state) *state = kn_state_create(o.model), *into = kn_state_keep(o.model);
    while (state->tick < 170) step(&o, &kinds[8], state);
    CHECK(state->anchor_count > 0);
    size_t size = kn_snapshot_size(o.model, state);
    uint8_t *bytes = malloc(size + 1);
    CHECK(kn_snapshot_write(o.model, state, bytes, size) == size);
    const size_t whole = (size_t)KN_LENGTH(400, 4000, 4000); // number of bytes at either end that are all tried
    for (size_t n = 0; n < size; n += n < whole / 2 ? 1 : 97)
        CHECK(kn_snapshot_read(o.model, bytes, n, into) == KN_SNAPSHOT_SHORT);
    CHECK(kn_snapshot_read(o.model, bytes, size + 1, into) == KN_SNAPSHOT_SHORT);
    long refused = 0, taken = 0;
    for (size_t n = 0; n < size; n += n < whole || n + whole > size ? 1 : (size_t)KN_LENGTH(311, 31, 31)) {
        bytes[n] ^= 0xff;
        bool fits = kn_snapshot_read(o.model, bytes, size, into) == KN_SNAPSHOT_FITS;
        if (fits)
            CHECK(kn_snapshot_size(o.model, into) == size && !into->bad && into->anchor_count == state->anchor_count);
        *(fits ? &taken : &refused) += 1;
        bytes[n] ^= 0xff;
    }
    CHECK(refused > 100 && taken > 100); // the other changes are refused by the file's checksum
    CHECK(kn_snapshot_read(o.model, bytes, size, into) == KN_SNAPSHOT_FITS);
    CHECK(kn_state_hash(o.model, into) == kn_state_hash(o.model, state));
    free(bytes);
}

TEST("a snapshot with a diverged state, a number out of range or duplicate anchors is refused")
{
    AT_END(object_free) object o = object_of(&kinds[8]);
    OWN(kn_state) *state = kn_state_create(o.model), *worse = kn_state_keep(o.model), *into = kn_state_keep(o.model);
    while (state->tick < 170) step(&o, &kinds[8], state);
    size_t room = kn_snapshot_size_max(o.model);
    uint8_t *bytes = malloc(room);
    for (int t = 0; t < 8; t++) {
        kn_state_copy(o.model, worse, state);
        switch (t) {
        case 0: worse->bad = 1; break;
        case 1: ((float *)worse->displacement)[7] = NAN; break;
        case 2: worse->probe[1].work_j = INFINITY; break;
        case 3: worse->anchor[1].key = worse->anchor[0].key; break;
        case 4: worse->anchor[0].flags = 4; break;
        case 5: worse->secant_steps = KN_SECANT_REST + 1; break;
        case 6: worse->held[3] = 2; break;
        case 7: worse->probe[0].attached = 2; break;
        }
        size_t size = kn_snapshot_write(o.model, worse, bytes, room);
        kn_snapshot_fit fit = kn_snapshot_read(o.model, bytes, size, into);
        if (fit != KN_SNAPSHOT_VALUE) fprintf(stderr, "case %d: %s\n", t, kn_snapshot_fit_name(fit));
        CHECK(size > 0 && fit == KN_SNAPSHOT_VALUE);
    }
    free(bytes);
}

TEST("an object counts as moved if a node or an edge's strain moves by the limit, not if a tool moves above it")
{
    for (int i = 0; i < 2; i++) {
        AT_END(object_free) object o = object_of(&kinds[i]);
        OWN(kn_state) *state = kn_state_create(o.model), *before = kn_state_keep(o.model);
        while (state->tick < 10) step(&o, &kinds[i], state); // in air
        CHECK(state->probe[0].attached && !kn_state_moved(o.model, state, before, 1e-6));
        while (state->tick < 100) step(&o, &kinds[i], state);
        CHECK(kn_state_moved(o.model, state, before, 1e-6) && !kn_state_moved(o.model, state, before, 1));
        kn_state_copy(o.model, before, state);
        CHECK(!kn_state_moved(o.model, state, before, 0));
        size_t last = o.model->edge_reals - 1;
        if (i) ((double *)state->strain)[last] += 2e-6 / o.model->def.spacing_m;
        else ((float *)state->strain)[last] += (float)(2e-6 / o.model->def.spacing_m);
        CHECK(kn_state_moved(o.model, state, before, 1e-6) && !kn_state_moved(o.model, state, before, 3e-6));
    }
}

TESTS_MAIN
