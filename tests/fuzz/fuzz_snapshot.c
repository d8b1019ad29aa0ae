// libFuzzer target: any bytes as a snapshot, sealed with the correct length, hash and checksum, since otherwise those
// would refuse all. The result is a reason in one line, or an object and a servo that go on. Input that does not
// begin as a snapshot modifies a valid one: every three bytes are an offset and a byte, and any rest cuts off the
// end.
#include "core/snapshot.h"
#include "server/snapshot_file.h"
#include "tests/fuzz/fuzz.h"
#include <sodium.h>
#include <string.h>

static const char text[] =
    "version: 1\nobject: {size: [1 cm, 1 cm, 1 cm], spacing: 1 cm}\nmaterial: dough\nsupport: bonded\ndevice: touch\n"
    "probes:\n  - {name: ball, shape: sphere, radius: 1 cm, friction: 0.5}\n"
    "  - {name: plate, shape: plate, size: [1 cm, 1 cm]}\n";
static kn_scene *scene;
static kn_model *model;
static kn_backend backend;
static kn_saved saved, found;
static kn_tick_in in = {.tick = -1};
static uint8_t *good, *bytes;
static size_t good_size, lattice, room;

static void press(kn_servo *servo, int ticks)
{
    static kn_pose pose = {.session = 7, .orientation_wxyz = {1}, .position_m = {0, 0, 0.022}};
    static kn_tick_out out;
    for (int i = 0; i < ticks; i++) {
        in.tick++;
        pose.seq++;
        if (in.tick > 450) pose.position_m[2] -= 2e-5;
        in.pose[0] = &pose;
        in.fresh[0] = true;
        kn_servo_tick(servo, &in, &out);
    }
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc, (void)argv;
    char error[300] = "";
    scene = kn_scene_parse("fuzz.yaml", text, sizeof text - 1, NULL, 0, error, sizeof error);
    model = scene ? kn_model_build(&scene->model, error, sizeof error) : NULL;
    require(model && kn_backend_cpu(&backend, model));
    room = kn_saved_size_max(model) + 64;
    require((good = malloc(room)) && (bytes = malloc(room)));
    require((saved.state = kn_state_create(model)) && (found.state = kn_state_create(model)));
    kn_servo_init(&saved.servo, scene, model, &backend);
    press(&saved.servo, 700);
    kn_state_copy(model, saved.state, backend.state(backend.self));
    require(saved.state->anchor_count > 0);
    saved.generation = 3;
    saved.tick = 699;
    good_size = kn_saved_encode(scene, model, &saved, good, room);
    require(good_size > 0);
    lattice = kn_snapshot_size(model, saved.state);
    return 0;
}

// offsets in a file, and the size of its checksum at the end
enum { WHOLE = 16, HASH = 128, LATTICE = 160 + KN_SETTINGS_BYTES, DIGEST = 32 };

static void put(size_t at, uint64_t value)
{
    for (int i = 0; i < 8; i++) bytes[at + (size_t)i] = (uint8_t)(value >> 8 * i);
}

static size_t seal(size_t size)
{
    size_t from = LATTICE + 8;
    size = size < 24 + DIGEST ? 24 + DIGEST : size;
    put(WHOLE, size);
    if (size == good_size && kn_snapshot_read(model, bytes + from, lattice, found.state) == KN_SNAPSHOT_FITS)
        put(HASH, kn_state_hash(model, found.state));
    crypto_generichash(bytes + size - DIGEST, DIGEST, bytes, size - DIGEST, NULL, 0);
    return size;
}

static void judge(size_t size)
{
    static uint8_t again[1 << 20];
    char why[200] = "";
    kn_servo_init(&found.servo, scene, model, &backend);
    if (!kn_saved_decode(scene, model, bytes, size, &found, why, sizeof why)) {
        require(*why && !strchr(why, '\n'));
        return;
    }
    uint64_t hash = found.state_hash;
    size_t same = kn_saved_encode(scene, model, &found, again, sizeof again);
    require(same == size && found.state_hash == hash && kn_state_hash(model, found.state) == hash);
    kn_servo servo;
    kn_servo_init(&servo, scene, model, &backend);
    kn_saved_resume(&found, &servo);
    backend.restore(backend.self, found.state);
    press(&servo, 1);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    memset(bytes, 0, 64);
    if (size >= 8 && memcmp(data, good, 8) == 0 && size <= room) {
        memcpy(bytes, data, size);
        judge(seal(size));
        return 0;
    }
    memcpy(bytes, good, good_size);
    for (size_t i = 0; i + 2 < size; i += 3) bytes[(data[i] | (size_t)data[i + 1] << 8) % good_size] = data[i + 2];
    judge(seal(good_size - size % 3));
    return 0;
}
