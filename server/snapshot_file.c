#include "server/snapshot_file.h"
#include "core/algebra/bytes.h"
#include "core/snapshot.h"
#include <assert.h>
#include <sodium.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#define FORMAT 3  // version of the file layout; change it with every change of the layout
#define DIGEST 32 // length of the checksum, bytes
#define HEAD 24   // length of the fields magic, format and total size, bytes
static const uint8_t magic[8] = {0x89, 'K', 'N', 'E', 'A', 'D', '\r', '\n'};

// --- plain part of the servo -----------------------------------------------------------------------------------------

// A new field of kn_safety, kn_pose or kn_clutch must be saved as well, and FORMAT must change. Otherwise a replay that
// continues from a snapshot does not give the same bits. Counters that affect nothing (slewed and the fields after it)
// need not be saved.
static_assert(offsetof(kn_safety, slewed) == 312 && sizeof(kn_pose) == 120 && sizeof(kn_clutch) == 120,
              "the functions below save all fields");

// Each put_ function measures, writes or reads, depending on the codec. So one description of the layout serves all
// three purposes.
static void put_counter(kn_codec *c, int64_t *value) { kn_codec_i64(c, value, 0, INT64_MAX); }
static void put_int(kn_codec *c, int *value) { kn_codec_i32(c, value, INT32_MIN, INT32_MAX); }

static void put_safety(kn_codec *c, kn_safety *s)
{
    int32_t fault = (int32_t)s->fault;
    kn_codec_f64(c, &s->gain, 1);
    kn_codec_f64(c, &s->gain_drop, 1);
    kn_codec_f64(c, s->force_n, 3);
    kn_codec_f64(c, s->torque_n_m, 3);
    kn_codec_f64(c, s->brake_n, 3);
    kn_codec_f64(c, s->guard.step_n, 3);
    put_int(c, &s->guard.age[0]);
    put_int(c, &s->guard.age[1]);
    put_int(c, &s->silent_ms);
    put_int(c, &s->flowing_ms);
    put_int(c, &s->gap_ms);
    kn_codec_bool(c, &s->attached);
    kn_codec_bool(c, &s->latched);
    kn_codec_bool(c, &s->braking);
    kn_codec_bool(c, &s->yielding);
    kn_codec_bool(c, &s->rejoining);
    kn_codec_bool(c, &s->nonfinite);
    kn_codec_i32(c, &fault, KN_FAULT_NONE, KN_FAULTS - 1);
    s->fault = (kn_fault)fault;
    put_counter(c, &s->clamps);
    put_counter(c, &s->guards);
    put_counter(c, &s->faults);
}

static void put_pose(kn_codec *c, kn_pose *p)
{
    int64_t *number[] = {&p->session, &p->seq, &p->sent_ns, &p->utime};
    for (int i = 0; i < 4; i++) kn_codec_i64(c, number[i], INT64_MIN, INT64_MAX);
    kn_codec_f64(c, p->position_m, 3);
    kn_codec_f64(c, p->orientation_wxyz, 4);
    kn_codec_f64(c, p->velocity_m_s, 3);
    put_int(c, &p->buttons);
}

static void put_clutch(kn_codec *c, kn_clutch *l)
{
    kn_codec_bool(c, &l->held);
    kn_codec_f64(c, l->offset_m, 3);
    kn_codec_f64(c, l->turn_wxyz, 4);
    kn_codec_f64(c, l->stays_m, 3);
    kn_codec_f64(c, l->stays_wxyz, 4);
}

// Measure, write or read the plain part of the servo. Pointers, deadline, overload and `estopped` are not part of a
// snapshot.
static void put_servo(kn_codec *c, kn_servo *s)
{
    int32_t quality = (int32_t)s->quality, asked = (int32_t)s->asked;
    for (int p = 0; p < KN_PROBES_MAX; p++) {
        put_safety(c, &s->safety[p]);
        put_pose(c, &s->last[p]);
        put_pose(c, &s->tool[p]);
        put_clutch(c, &s->clutch[p]);
    }
    put_counter(c, &s->ticks);
    put_counter(c, &s->capped);
    put_counter(c, &s->late);
    put_counter(c, &s->diverged);
    put_int(c, &s->generation);
    kn_codec_i32(c, &quality, 0, KN_QUALITIES - 1);
    kn_codec_i32(c, &asked, 0, KN_QUALITIES - 1);
    s->quality = (kn_quality)quality;
    s->asked = (kn_quality)asked;
    put_int(c, &s->over);
    kn_codec_bool(c, &s->exhausted);
    kn_codec_bool(c, &s->stopping);
}

void kn_saved_resume(const kn_saved *saved, kn_servo *servo)
{
    const kn_servo *from = &saved->servo;
    // take over the poses and clutches of the sessions that were open
    memcpy(servo->last, from->last, sizeof servo->last);
    memcpy(servo->tool, from->tool, sizeof servo->tool);
    memcpy(servo->clutch, from->clutch, sizeof servo->clutch);
    for (int p = 0; p < KN_PROBES_MAX; p++) {
        kn_safety *s = &servo->safety[p];
        // the safety limits come from the scene being served now, not from the file
        kn_safety_limits limits = s->limits;
        double guard = s->guard.most_n_per_ms;
        *s = from->safety[p];
        s->limits = limits;
        s->relimiting = false; // no new limits are pending, because no snapshot is made while they are
        s->guard.most_n_per_ms = guard;
    }
    // copy counters and quality; keep the pointers of `servo`
    servo->ticks = from->ticks;
    servo->capped = from->capped;
    servo->late = from->late;
    servo->diverged = from->diverged;
    servo->generation = from->generation;
    servo->quality = from->quality;
    servo->asked = from->asked;
    servo->over = from->over;
    servo->exhausted = from->exhausted;
    servo->stopping = from->stopping;
}

// --- the file -------------------------------------------------------------------------------------------------------

// Compute the checksum of some bytes.
static void digest(const uint8_t *bytes, size_t size, uint8_t out[DIGEST])
{
    // Initialise libsodium; sodium_init may be called more than once. If the library fails, use a checksum of zeros, so
    // that no file is accepted.
    if (sodium_init() < 0) memset(out, 0, DIGEST);
    else crypto_generichash(out, DIGEST, bytes, size, NULL, 0);
}

// Measure, write or read the head of the file: identity, settings and time. No field of the head depends on the model.
static void put_head(kn_codec *c, kn_saved *s)
{
    kn_codec_bytes(c, (uint8_t *)s->version, sizeof s->version);
    kn_codec_bytes(c, (uint8_t *)s->scene, sizeof s->scene);
    kn_codec_u64(c, &s->text_hash);
    kn_codec_u64(c, &s->state_hash);
    kn_codec_bytes(c, (uint8_t *)s->settings.text, sizeof s->settings.text);
    kn_codec_i64(c, &s->generation, 1, INT64_MAX - 1);
    kn_codec_i64(c, &s->tick, 0, INT64_MAX / 2);
    kn_codec_i64(c, &s->utime, 0, INT64_MAX / 2);
}

size_t kn_saved_size_max(const kn_model *model)
{
    // a codec without memory only measures; the head and the servo's part have fixed sizes
    kn_codec c = {0};
    kn_saved none = {0};
    put_head(&c, &none);
    put_servo(&c, &none.servo);
    return HEAD + c.at + 8 + kn_snapshot_size_max(model) + DIGEST;
}

size_t kn_saved_encode(const kn_scene *scene, const kn_model *model, kn_saved *saved, uint8_t *bytes, size_t size)
{
    kn_codec c = {.to = bytes, .size = size};
    uint64_t format = FORMAT, whole = 0, lattice = kn_snapshot_size(model, saved->state);
    uint8_t start[8];
    // fill in identity and hashes
    memset(saved->scene, 0, sizeof saved->scene);
    memset(saved->version, 0, sizeof saved->version);
    snprintf(saved->scene, sizeof saved->scene, "%s", scene->name);
    snprintf(saved->version, sizeof saved->version, "%s", KN_VERSION);
    saved->text_hash = scene->text_hash;
    saved->settings = saved->servo.settings ? *saved->servo.settings : (kn_settings){0};
    saved->state_hash = kn_state_hash(model, saved->state);
    // write the parts of the file in order, with 0 as total size, which is not known yet
    memcpy(start, magic, sizeof start);
    kn_codec_bytes(&c, start, sizeof start);
    kn_codec_u64(&c, &format);
    kn_codec_u64(&c, &whole);
    put_head(&c, saved);
    kn_codec_u64(&c, &lattice);
    if (c.ended || lattice > size - c.at) return 0;
    c.at += kn_snapshot_write(model, saved->state, bytes + c.at, lattice);
    put_servo(&c, &saved->servo);
    if (c.ended || DIGEST > size - c.at) return 0;
    // put the total size into its place in the head, then append the checksum over everything before it
    whole = c.at + DIGEST;
    kn_codec again = {.to = bytes + HEAD - 8, .size = 8};
    kn_codec_u64(&again, &whole);
    digest(bytes, c.at, bytes + c.at);
    return whole;
}

// Check magic, size and checksum; this needs no scene. Return NULL if the bytes are as they were written; otherwise
// return the reason for the refusal.
static const char *damage(const uint8_t *bytes, size_t size, uint64_t *format, char *text, size_t text_size)
{
    uint64_t whole = 0;
    uint8_t found[DIGEST];
    kn_codec c = {.from = bytes, .size = size, .at = sizeof magic};
    if (size == 0) return "truncated: empty";
    if (memcmp(bytes, magic, size < sizeof magic ? size : sizeof magic) != 0) return "not a snapshot";
    if (size < HEAD) return "truncated: within its header";
    kn_codec_u64(&c, format);
    kn_codec_u64(&c, &whole);
    if (whole != size || size < HEAD + DIGEST) {
        snprintf(text, text_size, "%s: %zu bytes of %llu", size < whole ? "truncated" : "too long", size,
                 (unsigned long long)whole);
        return text;
    }
    digest(bytes, size - DIGEST, found);
    return memcmp(found, bytes + size - DIGEST, DIGEST) == 0 ? NULL : "checksum: damaged since it was written";
}

// Check a text that messages may show: it has a NUL, and no control characters, except newlines if `lines` is true.
static bool legible(const char *text, size_t size, bool lines)
{
    size_t n = strnlen(text, size);
    for (size_t i = 0; i < n; i++)
        if (((unsigned char)text[i] < ' ' && !(lines && text[i] == '\n')) || text[i] == 0x7f) return false;
    return n < size;
}

static bool head_legible(const kn_saved *s)
{
    return legible(s->scene, sizeof s->scene, false) && legible(s->version, sizeof s->version, false) &&
           legible(s->settings.text, sizeof s->settings.text, true);
}

// Decode everything after magic, format and size. Return NULL on success; otherwise return the reason why the file does
// not fit scene and model.
static const char *misfit(const kn_scene *scene, const kn_model *model, kn_codec *c, kn_saved *s, char *text,
                          size_t text_size)
{
    static const char range[] = "a number out of its range";
    uint64_t lattice = 0;
    put_head(c, s);
    kn_codec_u64(c, &lattice);
    if (c->wrong || !head_legible(s)) return range;
    // check version and scene of the file
    if (strcmp(s->version, KN_VERSION) != 0) {
        snprintf(text, text_size, "another version: knead %s, expected %s", s->version, KN_VERSION);
        return text;
    }
    if (strcmp(s->scene, scene->name) != 0) {
        snprintf(text, text_size, "another scene: %s, expected %s", s->scene, scene->name);
        return text;
    }
    // decode the lattice, which core checks, then the servo, up to the last byte
    if (lattice > c->size - c->at) return "truncated: within the lattice";
    kn_snapshot_fit fit = kn_snapshot_read(model, c->from + c->at, lattice, s->state);
    if (fit != KN_SNAPSHOT_FITS) return kn_snapshot_fit_name(fit);
    c->at += lattice;
    put_servo(c, &s->servo);
    if (c->wrong || c->at != c->size) return range;
    return kn_state_hash(model, s->state) == s->state_hash ? NULL : "state hash: does not match the lattice";
}

bool kn_saved_decode(const kn_scene *scene, const kn_model *model, const uint8_t *bytes, size_t size, kn_saved *saved,
                     char *why, size_t why_size)
{
    // check size and checksum first, so that a damaged file is not reported as one of another scene
    char text[160];
    uint64_t format = 0;
    const char *reason = damage(bytes, size, &format, text, sizeof text);
    if (!reason && format != FORMAT) {
        snprintf(text, sizeof text, "another version: format %llu, expected %d", (unsigned long long)format, FORMAT);
        reason = text;
    }
    if (!reason) {
        kn_codec c = {.from = bytes, .size = size - DIGEST, .at = HEAD};
        reason = misfit(scene, model, &c, saved, text, sizeof text);
    }
    if (reason) snprintf(why, why_size, "%s", reason);
    return !reason;
}

bool kn_saved_peek(const char *scene, const uint8_t *bytes, size_t size, kn_saved *head)
{
    char text[160];
    uint64_t format = 0;
    *head = (kn_saved){0};
    if (damage(bytes, size, &format, text, sizeof text) || format != FORMAT) return false;
    kn_codec c = {.from = bytes, .size = size - DIGEST, .at = HEAD};
    put_head(&c, head);
    return !c.wrong && head_legible(head) && strcmp(head->version, KN_VERSION) == 0 && strcmp(head->scene, scene) == 0;
}
