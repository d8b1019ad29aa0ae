#include "server/keeper.h"
#include "core/snapshot.h"
#include "server/console.h"
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

// Interval at which the keeper thread and the operator's thread poll, ns. They poll because the servo makes no system
// call to wake them.
static const int64_t poll_ns = 2000000;
static const int64_t copy_ns = 400000000; // longest wait for a copy of the object, ns: a recording waits for it

static void rest(void) { kn_clock_sleep(kn_now_ns() + poll_ns); }

// --- open and close -------------------------------------------------------------------------------------------------

size_t kn_keeper_bytes(const kn_model *model, bool saves)
{
    return kn_undo_bytes(model) + (saves ? 4 : 1) * kn_state_size(model) + (saves ? kn_saved_size_max(model) : 0);
}

int kn_keeper_open(kn_keeper *keeper, const char *directory, const kn_scene *scene, const kn_model *model, char *error,
                   size_t error_size)
{
    kn_keeper *k = keeper;
    *k = (kn_keeper){.model = model, .store = {.dir = -1}};
    pthread_mutex_init(&k->answering, NULL);
    int code = directory ? kn_store_open(&k->store, directory, scene, model, error, error_size) : 0;
    if (code != 0) return code;
    // Allocate all memory now: the undo points, a copy, two slots and the snapshot to restore.
    bool fits = kn_undo_init(&k->undo, model);
    kn_saved *saved[] = {&k->outgoing, &k->slot[0].saved, &k->slot[1].saved, &k->incoming};
    for (int i = 0; i < (directory ? 4 : 1); i++) fits &= (saved[i]->state = kn_state_create(model)) != NULL;
    if (fits) return 0;
    snprintf(error, error_size, "not enough memory for undo points and snapshots");
    return 3;
}

void kn_keeper_close(kn_keeper *keeper)
{
    kn_store_close(&keeper->store);
    kn_undo_free(&keeper->undo);
    kn_state_destroy(keeper->slot[0].saved.state);
    kn_state_destroy(keeper->slot[1].saved.state);
    kn_state_destroy(keeper->incoming.state);
    kn_state_destroy(keeper->outgoing.state);
}

// --- the servo's side -----------------------------------------------------------------------------------------------

// Copy the object and the servo's state. k->model describes the object also after a scene change, because the changed
// model has the same layout.
static void copy_object(const kn_keeper *k, kn_saved *to, const kn_servo *servo, int64_t tick, int64_t utime)
{
    kn_state_copy(k->model, to->state, servo->backend->state(servo->backend->self));
    to->servo = *servo;
    to->tick = tick;
    to->utime = utime;
}

// Copy the object and the servo's state into a slot.
static void copy_to(kn_keeper *k, kn_kept *slot, const kn_servo *servo, int64_t tick, int64_t utime)
{
    copy_object(k, &slot->saved, servo, tick, utime);
    k->last_hash = servo->scene->text_hash;
    atomic_store(&slot->of, servo->model);
    atomic_store_explicit(&slot->saved_whole, false, memory_order_relaxed);
}

// Return true if the object has moved since the last copy, or if the settings of its scene have changed.
static bool moved(const kn_keeper *k, const kn_servo *servo, const kn_state *now)
{
    const kn_state *last = k->slot[k->last].saved.state;
    return k->last_hash != servo->scene->text_hash || kn_state_moved(k->model, now, last, KN_KEEPER_MOVED_M);
}

// Record that the object still equals the last copy. If this copy has been saved, the newest file equals the object
// now.
static void confirm(kn_keeper *k, int64_t now_ns)
{
    if (atomic_load(&k->as_of_ns) && atomic_load(&k->slot[k->last].saved_whole)) atomic_store(&k->as_of_ns, now_ns);
}

// Return true while a new force limit is pending, because it takes effect only when a force has faded. A snapshot file
// cannot hold a pending limit, so no copy is made meanwhile.
static bool relimiting(const kn_servo *servo)
{
    bool any = false;
    for (int p = 0; p < servo->model->def.probe_count; p++) any |= servo->safety[p].relimiting;
    return any;
}

void kn_keeper_tick(kn_keeper *keeper, const kn_servo *servo, const kn_wake *wake, int64_t utime)
{
    kn_keeper *k = keeper;
    const kn_state *now = kn_backend_shape(servo->backend);
    // one copy a tick, and none in a tick in which the energy audit copies
    if (atomic_load(&k->copying) && wake->tick % 1000 != 0 && !now->bad && !relimiting(servo)) {
        copy_object(k, &k->outgoing, servo, wake->tick, utime);
        atomic_store(&k->copying, false);
        return;
    }
    if (k->store.dir < 0) return;
    int64_t number =
        // The energy audit copies the state in ticks that are multiples of 1000, so compare the object midway between
        // two such ticks.
        (wake->tick + KN_KEEPER_TICKS / 2) / KN_KEEPER_TICKS;
    int64_t asked = atomic_load(&k->asked);
    k->due |= number != k->looked;
    k->looked = number;
    kn_kept *slot = &k->slot[!k->last];
    // Go on only if a copy is due or requested, and can be made. A copy can be made if a slot is free, the state is
    // finite, and no force limit is pending.
    if ((!k->due && asked == k->asked_served) || now->bad || atomic_load(&slot->full) || relimiting(servo)) return;
    // Copy if a snapshot was requested, the last save failed, or the object has moved.
    k->due = false;
    if (asked == k->asked_served && !atomic_exchange(&k->again, false) &&
        !moved(k, servo, servo->backend->state(servo->backend->self))) {
        confirm(k, wake->now_ns);
        return;
    }
    // Fill the free slot and hand it to the keeper thread.
    copy_to(k, slot, servo, wake->tick, utime);
    slot->now_ns = wake->now_ns;
    slot->asked = k->asked_served = asked;
    k->last = !k->last;
    atomic_store(&slot->full, true);
}

// --- the thread -----------------------------------------------------------------------------------------------------

// Print an error message, but not the same message twice within a second. Each message gives the number of saves that
// failed since the previous message, so that all messages together report every failure.
static void complain(kn_keeper *k, const char *why, int64_t now_ns)
{
    k->untold++;
    if (strcmp(why, k->told) == 0 && now_ns - k->told_ns < 1000000000) return;
    kn_console_err("kneadd: snapshot %" PRId64 " was not saved: %s/%s (%" PRId64 " failed)", k->store.generation + 1,
                   k->store.path, why, k->untold);
    snprintf(k->told, sizeof k->told, "%s", why);
    k->told_ns = now_ns;
    k->untold = 0;
}

// If an error message was printed before, print that saving works again.
static void tell_rest(kn_keeper *k)
{
    if (*k->told)
        kn_console_err("kneadd: snapshots are saved again in %s (%" PRId64 " more failed)", k->store.path, k->untold);
    *k->told = 0;
    k->untold = 0;
}

// Write a slot to a file, measure the time and count the result.
static bool save(kn_keeper *k, kn_saved *saved, bool stays, kn_answer *answer)
{
    int64_t from_ns = kn_now_ns();
    *answer = (kn_answer){.tick = saved->tick};
    answer->ok = kn_store_save(&k->store, saved, stays, answer->error, sizeof answer->error);
    answer->generation = saved->generation;
    answer->state_hash = saved->state_hash;
    int64_t now_ns = kn_now_ns(), us = (now_ns - from_ns) / 1000;
    atomic_store(&k->last_us, us);
    if (us > atomic_load(&k->most_us)) atomic_store(&k->most_us, us);
    atomic_fetch_add(answer->ok ? &k->saves : &k->errors, 1);
    if (answer->ok) {
        atomic_store(&k->generation, answer->generation);
        tell_rest(k);
    } else {
        complain(k, answer->error, now_ns);
    }
    return answer->ok;
}

// Save the copy in a slot, answer the operator who requested the copy, and free the slot.
static void serve(kn_keeper *k, kn_kept *slot)
{
    kn_answer answer;
    if (save(k, &slot->saved, slot->asked > k->answered, &answer)) {
        atomic_store(&slot->saved_whole, true);
        atomic_store(&k->as_of_ns, slot->now_ns);
    } else {
        atomic_store(&k->again, true);
    }
    pthread_mutex_lock(&k->answering);
    if (slot->asked > k->answered) k->answer = answer; // an operator requested this copy and waits for the answer
    k->answered = slot->asked;
    pthread_mutex_unlock(&k->answering);
    atomic_store(&slot->full, false);
}

// Return the full slot with the older copy; both slots may be full if the disk is slow.
static kn_kept *next_full(kn_keeper *k)
{
    kn_kept *a = &k->slot[0], *b = &k->slot[1];
    bool full_a = atomic_load(&a->full), full_b = atomic_load(&b->full);
    if (full_a && full_b) return a->saved.tick < b->saved.tick ? a : b;
    return full_a ? a : full_b ? b : NULL;
}

// Write the newest order about the emergency stop to disk.
static void mark(kn_keeper *k)
{
    char why[sizeof k->unmarked] = "";
    int64_t marks = atomic_load(&k->marks);
    if (marks == k->marked) return;
    kn_store_estop(&k->store, marks & 1, why, sizeof why);
    pthread_mutex_lock(&k->answering);
    k->marked = marks;
    memcpy(k->unmarked, why, sizeof why);
    pthread_mutex_unlock(&k->answering);
}

void *kn_keeper_run(void *keeper)
{
    kn_keeper *k = keeper;
    for (bool ending = false; !ending;) {
        // read `ending` before the slots, so that copies left before `ending` was set are still saved
        ending = atomic_load(&k->ending);
        mark(k);
        for (kn_kept *slot; (slot = next_full(k)); mark(k)) serve(k, slot);
        if (!ending) rest();
    }
    return NULL;
}

bool kn_keeper_finish(kn_keeper *keeper, const kn_servo *servo, int64_t tick)
{
    kn_keeper *k = keeper;
    kn_answer answer;
    const kn_state *now = servo->backend->state(servo->backend->self);
    if (k->store.dir < 0 || now->bad) return true;
    if (!moved(k, servo, now) && atomic_load(&k->slot[k->last].saved_whole)) return true;
    copy_to(k, &k->slot[!k->last], servo, tick, kn_wall_us());
    k->told_ns = 0; // report all failures now, even if the last line is recent
    if (!save(k, &k->slot[!k->last].saved, false, &answer)) return false;
    k->last = !k->last;
    return true;
}

int64_t kn_keeper_age_ms(const kn_keeper *keeper)
{
    int64_t as_of_ns = atomic_load(&keeper->as_of_ns);
    return as_of_ns ? (kn_now_ns() - as_of_ns) / 1000000 : -1;
}

bool kn_keeper_writes(const kn_keeper *keeper, const kn_model *model)
{
    bool any = false;
    for (int i = 0; i < 2; i++) {
        const kn_kept *slot = &keeper->slot[i];
        any |= atomic_load(&slot->full) && atomic_load(&slot->of) == model;
    }
    return any;
}

// --- start ----------------------------------------------------------------------------------------------------------

// Write an age as text, in seconds, minutes, hours or days.
static void write_age(double age_s, char *text, size_t size)
{
    if (age_s < 120) snprintf(text, size, "%.1f s", fmax(0, age_s));
    else if (age_s < 7200) snprintf(text, size, "%.0f min", age_s / 60);
    else if (age_s < 172800) snprintf(text, size, "%.0f h", age_s / 3600);
    else snprintf(text, size, "%.0f days", age_s / 86400);
}

// Load the newest snapshot that fits, and print a line for each newer snapshot that does not fit.
static bool load_newest(kn_keeper *k, char *name)
{
    char why[200], *told = NULL;
    size_t size;
    FILE *refused = open_memstream(&told, &size);
    bool fits = kn_store_load(&k->store, 0, &k->incoming, name, refused, why, sizeof why);
    if (refused) fclose(refused);
    if (told) kn_console_lines(STDERR_FILENO, told);
    free(told);
    return fits;
}

// Order the next tick to restore the snapshot in k->incoming, and keep the snapshot's file.
static void order_restore(kn_keeper *k, kn_orders *orders)
{
    orders->restore = &k->incoming;
    kn_store_pin(&k->store, k->incoming.generation);
    k->incoming_order = kn_orders_give(orders, KN_ORDER_RESTORE, 0);
}

void kn_keeper_start(kn_keeper *keeper, kn_servo *servo, kn_orders *orders)
{
    kn_keeper *k = keeper;
    char name[256], age[32];
    servo->undo = &k->undo;
    if (k->store.dir < 0) return;
    kn_backend *backend = servo->backend;
    // Until a snapshot is restored, compare the object with the initial object, so that an untouched object is not
    // saved.
    kn_state_copy(k->model, k->slot[0].saved.state, backend->state(backend->self)); // copy the initial object
    k->last_hash = servo->scene->text_hash;
    atomic_store(&k->slot[0].saved_whole, true);
    k->incoming.servo.scene = servo->scene;
    k->incoming.servo.model = k->model;
    if (!load_newest(k, name)) {
        kn_console_out("kneadd: nothing to restore from %s: the object starts as new", k->store.path);
        return;
    }
    kn_state_copy(k->model, k->slot[0].saved.state, k->incoming.state);
    atomic_store(&k->as_of_ns, kn_now_ns());
    atomic_store(&k->generation, k->incoming.generation);
    order_restore(k, orders);
    write_age(1e-6 * (double)(kn_wall_us() - k->incoming.utime), age, sizeof age);
    kn_console_out("kneadd: restored %s/%s, %s old, state 0x%016" PRIx64, k->store.path, name, age,
                   k->incoming.state_hash);
}

// --- the operator's side --------------------------------------------------------------------------------------------

// Return the answer to a request that failed, with the reason.
static kn_answer refusal(const char *format, ...) __attribute__((format(printf, 1, 2)));
static kn_answer refusal(const char *format, ...)
{
    kn_answer a = {0};
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(a.error, sizeof a.error, format, arguments);
    va_end(arguments);
    return a;
}

static int64_t deadline(void) { return kn_now_ns() + KN_KEEPER_PATIENCE_MS * INT64_C(1000000); }

kn_answer kn_keeper_snapshot(kn_keeper *keeper)
{
    kn_keeper *k = keeper;
    if (k->store.dir < 0)
        return refusal("snapshot: there is no directory of snapshots, expected kneadd --state-dir DIR");
    // Give the request a number. The servo makes a copy for it, and the keeper thread saves the copy and stores the
    // answer.
    int64_t number = atomic_fetch_add(&k->asked, 1) + 1;
    for (int64_t end_ns = deadline(); kn_now_ns() < end_ns; rest()) {
        pthread_mutex_lock(&k->answering);
        kn_answer answer = k->answer;
        bool served = k->answered >= number;
        pthread_mutex_unlock(&k->answering);
        if (served) return answer;
    }
    return refusal(
        "snapshot: not saved within %d ms, but it may be saved later: the disk is slow, or the object's state is not "
        "finite",
        KN_KEEPER_PATIENCE_MS);
}

kn_answer kn_keeper_copy(kn_keeper *keeper, int *fd)
{
    kn_keeper *k = keeper;
    atomic_store(&k->copying, true);
    for (int64_t end_ns = kn_now_ns() + copy_ns; atomic_load(&k->copying) && kn_now_ns() < end_ns;) rest();
    if (atomic_load(&k->copying))
        return refusal(
            "copy: no tick has copied the object: no tick ran, its state is not finite, or a new force limit "
            "waits for the force to fade");
    kn_saved *saved = &k->outgoing;
    saved->generation = 1;
    size_t room = kn_saved_size_max(k->model);
    uint8_t *bytes = malloc(room);
    size_t size = bytes ? kn_saved_encode(saved->servo.scene, saved->servo.model, saved, bytes, room) : 0;
    *fd = size ? memfd_create("knead-object", MFD_CLOEXEC) : -1;
    bool whole = *fd >= 0 && write(*fd, bytes, size) == (ssize_t)size && lseek(*fd, 0, SEEK_SET) == 0;
    const int why = errno;
    free(bytes);
    if (whole) return (kn_answer){.ok = true, .tick = saved->tick, .state_hash = saved->state_hash};
    if (*fd >= 0) close(*fd);
    return refusal("copy: %s", strerror(why));
}

bool kn_keeper_mark(kn_keeper *keeper, bool estopped, char *why, size_t why_size)
{
    kn_keeper *k = keeper;
    if (k->store.dir < 0) return true;
    // In one atomic step, increase the number of orders in `marks`, and set the lowest bit of `marks` to the new state
    // of the emergency stop.
    int64_t before = atomic_load(&k->marks), marks;
    do marks = (((before >> 1) + 1) << 1) | estopped;
    while (!atomic_compare_exchange_weak(&k->marks, &before, marks));
    for (int64_t end_ns = deadline(); kn_now_ns() < end_ns; rest()) {
        pthread_mutex_lock(&k->answering);
        bool done = k->marked >= marks;
        snprintf(why, why_size, "%s", done ? k->unmarked : "");
        pthread_mutex_unlock(&k->answering);
        if (done) return !*why;
    }
    return kn_refuse(why, why_size, "%s: the disk did not answer for %d ms", k->store.path, KN_KEEPER_PATIENCE_MS);
}

// Wait until a tick of the servo has carried out an order.
static kn_answer await(const kn_orders *orders, int64_t number, int64_t generation)
{
    kn_answer a = {.ok = true, .generation = generation};
    if (!kn_orders_await(orders, number, KN_KEEPER_PATIENCE_MS, &a.tick))
        return refusal("no tick ran for %d ms", KN_KEEPER_PATIENCE_MS);
    a.state_hash = atomic_load(&orders->restored);
    return a.state_hash ? a : refusal("undo: nothing to undo, the object is unchanged since the start");
}

kn_answer kn_keeper_restore(kn_keeper *keeper, kn_orders *orders, const kn_scene *scene, const kn_model *model,
                            int64_t generation)
{
    kn_keeper *k = keeper;
    char name[256], why[160];
    int64_t tick;
    if (k->store.dir < 0)
        return refusal("restore: there is no directory of snapshots, expected kneadd --state-dir DIR");
    if (k->incoming_order && !kn_orders_obeyed(orders, k->incoming_order, &tick))
        return refusal("restore: the previous restore has not been carried out yet");
    k->incoming.servo.scene = scene;
    k->incoming.servo.model = model;
    if (!kn_store_load(&k->store, generation, &k->incoming, name, NULL, why, sizeof why)) {
        if (generation > 0 && generation % KN_STORE_OWN == 0)
            return refusal("restore: snapshot %" PRId64 ": %s", generation / KN_STORE_OWN, why);
        if (generation > 0) return refusal("restore: generation %" PRId64 ": %s", generation, why);
        return refusal("restore: %s", why);
    }
    order_restore(k, orders);
    return await(orders, k->incoming_order, k->incoming.generation);
}

kn_answer kn_keeper_undo(kn_orders *orders) { return await(orders, kn_orders_give(orders, KN_ORDER_UNDO, 0), 0); }
