#include "core/snapshot.h"
#include "core/touch.h"
#include "core/lattice/lattice.h"
#include "tests/lattice.h"

// Every kind of object that a scene can declare, under every kind of tool.
typedef struct kind {
    const char *what, *scene, *set;
    double depth_m;
} kind;
static const kind kinds[] = {
    {"dough in f32", "dough-small.yaml", NULL, 6e-3},
    {"dough in f64", "dough-small.yaml", "solver.precision=f64", 6e-3},
    {"viscoelastic jelly", "jelly.yaml", NULL, 6e-3},
    {"gas in cells", "dough.yaml", NULL, 5e-3},
    {"gas in the whole object", "dough.yaml", "object.pressure=object", 5e-3},
    {"two resolutions", "dough-fine.yaml", NULL, 2e-3},
    {"a mesh", "bun.yaml", NULL, 5e-3},
    {"a mesh in f64", "bun.yaml", "solver.precision=f64", 5e-3},
    {"coupled tools that stick, on a table with friction", "pinch.yaml", NULL, 4e-3},
    {"a tool of parts", "rolling-pin.yaml", NULL, 4e-3},
    {"Runge-Kutta", "dough-small.yaml", "solver={kind: rk4, mass_scale: 1e7}", 1e-3},
    {"integers", "dough-small.yaml", "solver={kind: fixed, precision: f64, iterations: 8, passes: 2}", 6e-3},
};
#define PINCH (&kinds[8])

// Move the tools by the state's tick: they come down on the object side by side while they drift and turn, hold, and
// go up again.
static void press_to(lattice *l, const kind *k, int64_t tick)
{
    const kn_model_def *def = &l->model->def;
    const double way_m = k->depth_m + 1e-3;
    double extent[3];
    kn_model_def_extent(def, extent);
    while (l->state->tick < tick) {
        double t = (double)l->state->tick, way = t < 150 ? t / 150 : t < 190 ? 1 : 1 - (t - 190) / 60;
        double speed = t < 150 ? -way_m / 0.15 : t < 190 ? 0 : way_m / 0.06;
        for (int p = 0; p < def->probe_count; p++) {
            const kn_probe_def *tool = &def->probe[p];
            double side = p - 0.5 * (def->probe_count - 1), above = tool->shape == KN_PROBE_SPHERE ? tool->radius_m : 0;
            if (k == PINCH) above += tool->radius_m;
            put(l, p, 0.3 * extent[0] * side + 1e-5 * t, 1e-5 * t, extent[2] + above + 1e-3 - way_m * way);
            kn_probe_input *in = &l->in.probe[p];
            memcpy(in->velocity_m_s, (double[]){1e-2, 1e-2, speed}, sizeof in->velocity_m_s);
            memcpy(in->orientation_wxyz, (double[]){cos(1e-3 * t), 0, 0, sin(1e-3 * t)}, sizeof in->orientation_wxyz);
            in->attached = t > 5 && t<245, in->grip = t> 160;
        }
        step(l);
    }
}

// Step another state of the same model with the same scratch, and return its hash.
static uint64_t hash_after(const lattice *l, const kind *k, kn_state *state, int64_t tick)
{
    lattice other = *l;
    other.state = state;
    press_to(&other, k, tick);
    return hash_of(&other);
}

TEST("for every kind of object a restored snapshot continues with the same bits as the original, also during a press")
{
    for (const kind *k = kinds; k < kinds + COUNT(kinds); k++) {
        LATTICE l = object_of(k->scene, k->set);
        size_t room = kn_snapshot_size_max(l.model), size = 0;
        uint8_t *bytes = malloc(room), *again = malloc(room);
        OWN(kn_state) *read = kn_state_create(l.model), *kept = kn_state_create(l.model);
        int contacts = 0, anchors = 0;
        for (int at = 0; at < 300;
             at += KN_LENGTH(150, 60, 60)) { // before the press, on the way down, holding, on the way up, afterwards
            press_to(&l, k, at);
            for (int p = 0; p < KN_PROBES_MAX; p++) contacts += l.state->probe[p].contacts;
            anchors += l.state->anchor_count;
            size = kn_snapshot_write(l.model, l.state, bytes, room);
            CHECK(size > 0 && size == kn_snapshot_size(l.model, l.state));
            CHECK(kn_snapshot_read(l.model, bytes, size, kept) == KN_SNAPSHOT_FITS);
            CHECK(kn_state_hash(l.model, kept) == hash_of(&l) && kept->tick == l.state->tick);
            CHECK(kn_snapshot_write(l.model, kept, again, room) == size && memcmp(bytes, again, size) == 0);
            OWN(kn_state) *fresh = kn_state_create(l.model);
            kn_state_copy(l.model, read, kept);
            kn_state_copy(l.model, fresh, kept);
            const int64_t until = l.state->tick + KN_LENGTH(15, 40, 40);
            press_to(&l, k, until);
            if (hash_after(&l, k, read, until) != hash_of(&l) || hash_after(&l, k, fresh, until) != hash_of(&l))
                KN_TEST_FAIL("%s, at step %d", k->what, at);
        }
        printf("     %s: %zu bytes, at most %zu; a state takes %zu, a scratch %zu\n", k->what, size, room,
               kn_state_size(l.model), kn_scratch_size(l.model));
        CHECK(contacts > 0);
        CHECK((anchors > 0) == (l.state->anchor != NULL));
        free(bytes), free(again);
    }
}

TEST("states that share a scratch have the bits of states with their own, also beside one that diverges")
{
    enum { STATES = 2, TICKS = 120 };
    for (const kind *k = kinds; k < kinds + COUNT(kinds); k++) {
        LATTICE l = object_of(k->scene, k->set);
        lattice alone[STATES], shared[STATES];
        uint64_t hash = 0;
        kn_touch touch;
        for (int i = 0; i < STATES; i++) alone[i] = shared[i] = l;
        for (int i = 0; i < STATES; i++) {
            alone[i].state = kn_state_create(l.model), shared[i].state = kn_state_create(l.model);
            alone[i].scratch = kn_scratch_create(l.model);
        }
        OWN(kn_state) *bad = kn_state_create(l.model);
        for (int t = 1; t < TICKS; t++) {
            for (int i = 0; i < STATES; i++) {
                press_to(&alone[i], k, t - 40 * i);
                press_to(&shared[i], k, t - 40 * i);
            }
            if (t % 30 != 0 || t <= 40 * STATES) continue;
            const int p = k == PINCH;
            CHECK(kn_touch_read(l.model, shared[STATES - 1].state, l.scratch, p, &touch));
            CHECK(!kn_touch_read(l.model, shared[0].state, l.scratch, p, &touch) && touch.area_m2 == 0);
            const double work_j = shared[STATES - 1].state->probe[p].work_j;
            shared[STATES - 1].state->probe[p].work_j += 1; // another object in the same place
            CHECK(!kn_touch_read(l.model, shared[STATES - 1].state, l.scratch, p, &touch));
            shared[STATES - 1].state->probe[p].work_j = work_j;
            kn_state_copy(l.model, bad, shared[0].state);
            kn_real_set(l.model, bad->velocity, l.model->offset[l.model->node_count - 1], NAN);
            for (int i = 0; i < 3; i++) kn_step(l.model, bad, l.scratch, &shared[0].in, &l.out);
            CHECK(!kn_touch_read(l.model, bad, l.scratch, p, &touch) == bad->bad);
            CHECK(bad->bad || l.model->fixed); // integers know no NaN
        }
        for (int i = 0; i < STATES; i++) {
            if (hash_of(&shared[i]) != hash_of(&alone[i])) KN_TEST_FAIL("%s, state %d", k->what, i);
            CHECK(hash_of(&shared[i]) != hash);
            hash = hash_of(&shared[i]);
            kn_state_destroy(alone[i].state), kn_state_destroy(shared[i].state);
            kn_scratch_destroy(alone[i].scratch);
        }
    }
}

TEST("a snapshot is refused by another lattice or material; tools, device and quality may differ")
{
    static const struct {
        const char *scene, *set;
        kn_snapshot_fit fit;
    } table[] = {
        {"dough-small.yaml", "object.spacing=5 mm", KN_SNAPSHOT_LATTICE},
        {"dough-small.yaml", "solver.precision=f64", KN_SNAPSHOT_LATTICE},
        {"jelly.yaml", NULL, KN_SNAPSHOT_LATTICE},
        {"bun.yaml", NULL, KN_SNAPSHOT_LATTICE},
        {"dough-small.yaml", "material.k1=300 gf/cm^3", KN_SNAPSHOT_MATERIAL},
        {"dough-small.yaml", "solver.dt=500 us", KN_SNAPSHOT_MATERIAL},
        {"dough-small.yaml", "support=frictionless", KN_SNAPSHOT_MATERIAL},
        {"dough-small.yaml", "probes.finger.radius=2 cm", KN_SNAPSHOT_FITS},
        {"dough-small.yaml", "device=touch", KN_SNAPSHOT_FITS},
        {"dough-small.yaml", "solver.iterations=20", KN_SNAPSHOT_FITS},
    };
    LATTICE l = object_of("dough-small.yaml", NULL);
    press_to(&l, kinds, 100);
    size_t size = kn_snapshot_size(l.model, l.state);
    uint8_t *bytes = malloc(size);
    CHECK(kn_snapshot_write(l.model, l.state, bytes, size - 1) == 0);
    CHECK(kn_snapshot_write(l.model, l.state, bytes, size) == size);
    for (int t = 0; t < COUNT(table); t++) {
        LATTICE other = object_of(table[t].scene, table[t].set);
        OWN(kn_state) *into = kn_state_create(other.model);
        kn_snapshot_fit fit = kn_snapshot_read(other.model, bytes, size, into);
        if (fit != table[t].fit) KN_TEST_FAIL("%s: %s", table[t].set, kn_snapshot_fit_name(fit));
    }
    free(bytes);
}

TEST("a truncated snapshot is refused; a changed byte gives a refusal or a valid state")
{
    LATTICE l = object_of(PINCH->scene, NULL); // an object with anchors
    OWN(kn_state) *into = kn_state_create(l.model);
    press_to(&l, PINCH, 170);
    CHECK(l.state->anchor_count > 0);
    size_t size = kn_snapshot_size(l.model, l.state);
    uint8_t *bytes = malloc(size + 1);
    CHECK(kn_snapshot_write(l.model, l.state, bytes, size) == size);
    const size_t whole = (size_t)KN_LENGTH(400, 4000, 4000); // number of bytes at either end that are all tried
    for (size_t n = 0; n < size; n += n < whole / 2 ? 1 : 97)
        CHECK(kn_snapshot_read(l.model, bytes, n, into) == KN_SNAPSHOT_SHORT);
    CHECK(kn_snapshot_read(l.model, bytes, size + 1, into) == KN_SNAPSHOT_SHORT);
    long refusals = 0, taken = 0;
    for (size_t n = 0; n < size; n += n < whole || n + whole > size ? 1 : (size_t)KN_LENGTH(311, 31, 31)) {
        bytes[n] ^= 0xff;
        bool fits = kn_snapshot_read(l.model, bytes, size, into) == KN_SNAPSHOT_FITS;
        if (fits)
            CHECK(kn_snapshot_size(l.model, into) == size && !into->bad && into->anchor_count == l.state->anchor_count);
        *(fits ? &taken : &refusals) += 1;
        bytes[n] ^= 0xff;
    }
    CHECK(refusals > 100 && taken > 100); // the other changes are refused by the file's checksum
    CHECK(kn_snapshot_read(l.model, bytes, size, into) == KN_SNAPSHOT_FITS);
    CHECK(kn_state_hash(l.model, into) == hash_of(&l));
    free(bytes);
}

TEST("a snapshot with a diverged state, a number out of range or duplicate anchors is refused")
{
    LATTICE l = object_of(PINCH->scene, NULL);
    OWN(kn_state) *worse = kn_state_create(l.model), *into = kn_state_create(l.model);
    press_to(&l, PINCH, 170);
    size_t room = kn_snapshot_size_max(l.model);
    uint8_t *bytes = malloc(room);
    for (int t = 0; t < 8; t++) {
        kn_state_copy(l.model, worse, l.state);
        if (t == 0) worse->bad = 1;
        if (t == 1) ((float *)worse->displacement)[7] = NAN;
        if (t == 2) worse->probe[1].work_j = INFINITY;
        if (t == 3) worse->anchor[1].key = worse->anchor[0].key;
        if (t == 4) worse->anchor[0].flags = 4;
        if (t == 5) worse->secant_steps = KN_SECANT_REST + 1;
        if (t == 6) worse->held[3] = 2;
        if (t == 7) worse->probe[0].attached = 2;
        size_t size = kn_snapshot_write(l.model, worse, bytes, room);
        kn_snapshot_fit fit = kn_snapshot_read(l.model, bytes, size, into);
        if (size == 0 || fit != KN_SNAPSHOT_VALUE) KN_TEST_FAIL("case %d: %s", t, kn_snapshot_fit_name(fit));
    }
    free(bytes);
}

TEST("an object counts as moved if a node or an edge's strain moves by the limit, not if a tool moves above it")
{
    for (int i = 0; i < 2; i++) {
        LATTICE l = object_of(kinds[i].scene, kinds[i].set);
        OWN(kn_state) *before = kn_state_create(l.model);
        press_to(&l, &kinds[i], 10); // in air
        CHECK(l.state->probe[0].attached && !kn_state_moved(l.model, l.state, before, 1e-6));
        press_to(&l, &kinds[i], 100);
        CHECK(kn_state_moved(l.model, l.state, before, 1e-6) && !kn_state_moved(l.model, l.state, before, 1));
        kn_state_copy(l.model, before, l.state);
        CHECK(!kn_state_moved(l.model, l.state, before, 0));
        size_t last = l.model->edge_reals - 1;
        double strain = kn_real_get(l.model, l.state->strain, last);
        kn_real_set(l.model, l.state->strain, last, strain + 2e-6 / l.model->def.spacing_m);
        CHECK(kn_state_moved(l.model, l.state, before, 1e-6) && !kn_state_moved(l.model, l.state, before, 3e-6));
    }
}
