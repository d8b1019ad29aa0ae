#include "server/backend/fpga.h"
#include "server/backend/fpga_parts.h"
#include "server/clock.h"
#include "server/rt.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#define QUEUE_LEAST 1024 // smallest length of the queue, ticks; every length is a power of two
#define QUEUE_MOST 65536
#define AGAIN_NS 20000000 // time between two attempts to find the circuit, ns
#define LOOK_NS 100000
#define LAST_NS 1000000000 // longest time to get in step once more when the server ends, ns
#define TELL_TICKS 256     // number of ticks between two copies of the device's counters

// --- reasons of a loss -----------------------------------------------------------------------------------------------

// Record why the circuit is out of step. A reason that is already current is not counted again.
static void blame(fpga *f, kn_loss loss)
{
    if (atomic_exchange(&f->out, (int)loss) == (int)loss) return;
    atomic_store(&f->last, (int)loss);
    atomic_fetch_add(&f->because[loss], 1);
}

kn_loss kn_fpga_cause(const fpga *f, kn_link_status status)
{
    const kn_loss loss = kn_device_loss(f->device);
    return status == KN_LINK_LATE ? KN_LOSS_TIMEOUT : loss == KN_LOSS_COUNT ? KN_LOSS_REFUSED : loss;
}

// Write the line for kn_backend_fpga_news if the reason of the loss has changed and the last line was read. Called by
// the thread while it uses the device.
static void tell(fpga *f)
{
    const int loss = atomic_load(&f->out);
    if (loss == f->told || atomic_load(&f->news)) return;
    f->told = loss;
    if (loss == KN_LOSS_COUNT) return;
    char numbers[100];
    const char *why = kn_device_loss(f->device) == (kn_loss)loss ? kn_device_why(f->device) : "";
    // For the reason BEHIND, describe the queue, because its numbers explain more than the device's own message.
    if (loss == KN_LOSS_BEHIND) {
        snprintf(numbers, sizeof numbers, "%lld ticks; loading takes %.1f s", (long long)f->queue.length,
                 1e-9 * (double)atomic_load(&f->load_ns));
        why = numbers;
    }
    char then[160] = "its twin goes on", age[60] = "the object ";
    const int back = atomic_load(&f->off.back);
    if (back >= 0) snprintf(age, sizeof age, "the object went back by %d ms and ", back);
    if (f->shadow != KN_SHADOW_FULL)
        snprintf(then, sizeof then, "%s%s", age,
                 f->goes_on ? "is computed by the processor" : "stands still until the circuit is back");
    snprintf(f->line, sizeof f->line, "%s: %s%s%s; %s", kn_loss_word((kn_loss)loss), kn_loss_means((kn_loss)loss),
             *why ? ": " : "", why, then);
    atomic_store(&f->news, true);
}

// --- the queue -------------------------------------------------------------------------------------------------------

static slot *oldest(fpga *f) { return &f->queue.slot[atomic_load(&f->done) % f->queue.length]; }

bool kn_fpga_equal(const slot *s, const kn_device_result *r)
{
    return r->count == s->count && r->residual == s->residual &&
           memcmp(r->reaction, s->reaction, (size_t)s->count * sizeof *s->reaction) == 0;
}

// Run the oldest queued tick on the circuit. OK: the tick has ended and left the queue. PROTOCOL: also if the circuit's
// numbers differ from the twin's. `why` is set if the status is neither OK nor LATE.
static kn_link_status advance(fpga *f, int64_t deadline_ns, kn_loss *why)
{
    slot *s = oldest(f);
    kn_device_result result;
    kn_link_status status = KN_LINK_OK;
    if (!f->flying) status = kn_device_submit(f->device, s->bound, s->count);
    f->flying |= status == KN_LINK_OK;
    if (status == KN_LINK_OK) status = kn_device_wait(f->device, deadline_ns, &result);
    *why = kn_fpga_cause(f, status);
    if (status != KN_LINK_OK) return status;
    f->flying = false;
    // The circuit keeps every flag set until it is loaded again, so compare its flags with all flags of the twin since
    // the load.
    f->flags |= s->flags;
    if (!kn_fpga_equal(s, &result) || result.flags != f->flags) {
        *why = kn_fpga_equal(s, &result) ? KN_LOSS_SATURATED : KN_LOSS_TWIN;
        atomic_fetch_add(&f->different, 1);
        return KN_LINK_PROTOCOL;
    }
    atomic_fetch_add(&f->on_circuit, 1);
    atomic_fetch_add(&f->done, 1);
    return KN_LINK_OK;
}

// Copy the device's counters. Only for the thread that uses the device.
static void tell_stats(fpga *f)
{
    kn_device_stats stats;
    kn_device_stats_of(f->device, &stats);
    atomic_store(&f->timeouts, stats.timeouts);
    atomic_store(&f->crc, stats.link.crc + stats.link.coding);
    atomic_store(&f->p50_ns, stats.p50_ns);
    atomic_store(&f->p99_ns, stats.p99_ns);
    atomic_store(&f->max_ns, stats.max_ns);
    atomic_store(&f->load_ns, kn_device_load_ns(f->device, &f->model->fixed->image));
}

// Wake the thread that brings the circuit back. This is the only system call that the servo makes for the circuit's
// thread.
static void wake(fpga *f)
{
    const uint64_t one = 1;
    // this write cannot block, because the eventfd's counter never becomes full
    const ssize_t written = write(f->wake, &one, sizeof one);
    (void)written;
}

// Hand the device to the thread, until the circuit is in step again.
static void leave(fpga *f)
{
    atomic_store(&f->following, false);
    if (atomic_load(&f->speaker) != SERVO) return;
    atomic_store(&f->speaker, THREAD);
    wake(f);
}

void kn_fpga_lose(fpga *f, kn_loss loss)
{
    blame(f, loss);
    atomic_fetch_add(&f->losses, 1);
    leave(f);
}

// --- the twin's tick -------------------------------------------------------------------------------------------------

// Queue a tick whose nodes under tools the twin has found, and submit the tick if the circuit is in step and idle.
static void enqueue(fpga *f, const kn_fixed_bound *bound, int count)
{
    f->current = NULL;
    f->fits = count <= f->bounds;
    if (!atomic_load(&f->following)) return;
    // If the queue is full, or the list of bounds is too long for the circuit, give up staying in step.
    if (!f->fits || atomic_load(&f->made) - atomic_load(&f->done) == f->queue.length) {
        kn_fpga_lose(f, f->fits ? KN_LOSS_BEHIND : KN_LOSS_BOUNDS);
        return;
    }
    // The slot is complete, and `made` counts it, only when the twin has computed the tick.
    f->current = &f->queue.slot[atomic_load(&f->made) % f->queue.length];
    f->current->count = count;
    if (count > 0) memcpy(f->current->bound, bound, (size_t)count * sizeof *bound);
    // Submit at once only if nothing older waits; otherwise fpga_wait or the thread submits the tick later, in order.
    if (atomic_load(&f->speaker) != SERVO || f->flying || !kn_fpga_empty(f)) return;
    kn_link_status status = kn_device_submit(f->device, bound, count);
    f->flying = status == KN_LINK_OK;
    if (!f->flying) kn_fpga_lose(f, kn_fpga_cause(f, status));
}

// Called when the twin has computed the tick: add the twin's results to the slot, and count the slot as queued.
static void end(void *self, const int64_t (*reaction)[3], const kn_fixed_result *result)
{
    fpga *f = self;
    if (!f->current || !atomic_load(&f->following)) return;
    f->current->residual = result->residual;
    f->current->flags = result->flags;
    if (f->current->count > 0) memcpy(f->current->reaction, reaction, (size_t)f->current->count * sizeof *reaction);
    atomic_fetch_add(&f->made, 1);
}

// Called when the step has found the nodes under tools.
static kn_fixed_where begin(void *self, const kn_fixed_bound *bound, int count, kn_fixed *engine,
                            int64_t (*reaction)[3], kn_fixed_result *result)
{
    fpga *f = self;
    if (f->off.on) return kn_offload_tick(f, bound, count, engine, reaction, result);
    enqueue(f, bound, count);
    return KN_FIXED_HERE;
}

void kn_fpga_watch(fpga *f) { kn_backend_cpu_watch(&f->twin, (kn_fixed_watch){f, begin, end}); }

// --- the backend's functions -----------------------------------------------------------------------------------------

static void fpga_submit(void *self, const kn_input *input)
{
    fpga *f = self;
    if (!kn_offload_submit(f, input)) f->twin.submit(f->twin.self, input);
}

// Give the thread a copy of the twin's state; ticks are queued from then on. Postpone the copy while a tick has more
// nodes under tools than the circuit accepts.
static void take_copy(fpga *f)
{
    if (!f->fits || atomic_load(&f->copy_is) != WANTED) return;
    kn_fixed_read(f->model, f->twin.state(f->twin.self), &f->copy);
    atomic_store(&f->done, atomic_load(&f->made));
    atomic_store(&f->following, true);
    atomic_store(&f->copy_is, TAKEN);
}

// Without a clock (a replay), give the copy at once and wait while the thread lets the circuit catch up.
static void await_thread(fpga *f)
{
    int64_t until_ns = kn_now_ns() + KN_FPGA_PATIENCE_NS;
    take_copy(f);
    while (atomic_load(&f->speaker) == THREAD && atomic_load(&f->following) && !kn_fpga_empty(f) &&
           kn_now_ns() < until_ns)
        kn_clock_sleep(kn_now_ns() + LOOK_NS);
}

// Wait for the twin, then let the circuit compute the queued ticks. The result returned is the twin's. If the queue is
// empty, the circuit has confirmed the result.
static kn_backend_status fpga_wait(void *self, int64_t deadline_ns, kn_output *output)
{
    fpga *f = self;
    const bool clock = deadline_ns != 0;
    kn_loss why;
    const int64_t until_ns = clock ? deadline_ns - KN_FPGA_SPARE_NS : kn_now_ns() + KN_FPGA_PATIENCE_NS;
    if (kn_offload_has(f)) return kn_offload_wait(f, clock, clock ? until_ns + KN_FPGA_SPARE_NS / 2 : until_ns, output);
    kn_backend_status status = f->twin.wait(f->twin.self, deadline_ns, output);
    while (atomic_load(&f->speaker) == SERVO && !kn_fpga_empty(f)) {
        kn_link_status link = advance(f, until_ns, &why);
        if (link == KN_LINK_LATE && clock) break;
        if (link != KN_LINK_OK) kn_fpga_lose(f, why);
    }
    if (!clock) await_thread(f);
    bool in_step = atomic_load(&f->speaker) == SERVO && atomic_load(&f->following) && kn_fpga_empty(f);
    if (!in_step) atomic_fetch_add(&f->shadowed, 1);
    return status == KN_BACKEND_OK && !in_step ? KN_BACKEND_SHADOWED : status;
}

// After the forces have been sent: give the copy that the thread waits for, and get a whole state and copy counters now
// and then.
static void fpga_afterwards(void *self)
{
    fpga *f = self;
    take_copy(f);
    kn_offload_afterwards(f);
    if (++f->ticks < TELL_TICKS || atomic_load(&f->speaker) != SERVO) return;
    f->ticks = 0;
    tell_stats(f);
    // an object that no tool has touched takes no ticks, and its card must not keep an operator from removing it
    if (kn_device_gone(f->device)) kn_offload_lose(f, KN_LOSS_REMOVED);
}

static const kn_state *fpga_shape(void *self) { return ((fpga *)self)->twin.state(((fpga *)self)->twin.self); }
static const kn_state *fpga_state(void *self) { return kn_offload_state(self); }
static bool fpga_still(void *self) { return kn_offload_still(self); }
static int fpga_back(void *self) { return atomic_load(&((fpga *)self)->off.back); }
static const kn_scratch *fpga_scratch(void *self) { return ((fpga *)self)->twin.scratch(((fpga *)self)->twin.self); }

// The object is replaced: the circuit has another one from now on.
static void depart(fpga *f)
{
    kn_offload_end(f);
    leave(f);
}

static void fpga_reset(void *self)
{
    fpga *f = self;
    depart(f);
    f->twin.reset(f->twin.self);
}

static void fpga_restore(void *self, const kn_state *state)
{
    fpga *f = self;
    depart(f);
    f->twin.restore(f->twin.self, state);
}

// --- the thread ------------------------------------------------------------------------------------------------------

// Return true while loading and catching up still make sense.
static bool goes_on(fpga *f) { return !atomic_load(&f->stop) && atomic_load(&f->following); }

// Load the unchanging part first, while no ticks need to be queued.
static bool prepare(fpga *f)
{
    kn_link_status status = KN_LINK_LATE;
    while (!atomic_load(&f->stop) && status == KN_LINK_LATE)
        status = kn_device_load(f->device, &f->model->fixed->image, NULL, kn_now_ns() + KN_FPGA_ANSWER_NS);
    if (status != KN_LINK_OK && status != KN_LINK_LATE) blame(f, kn_fpga_cause(f, status));
    return status == KN_LINK_OK;
}

// Load the copy of the state into the circuit, as long as ticks are queued for the circuit.
static bool load(fpga *f)
{
    kn_link_status status = KN_LINK_LATE;
    while (goes_on(f) && status == KN_LINK_LATE)
        status = kn_device_load(f->device, &f->model->fixed->image, &f->copy, kn_now_ns() + KN_FPGA_ANSWER_NS);
    f->flying = false;
    f->flags = 0;
    if (status == KN_LINK_OK) atomic_fetch_add(&f->loads, 1);
    else if (status != KN_LINK_LATE) blame(f, kn_fpga_cause(f, status));
    return status == KN_LINK_OK;
}

// Run the queued ticks on the circuit until none is left.
static bool catch_up(fpga *f)
{
    kn_loss why;
    while (goes_on(f)) {
        if (kn_fpga_empty(f)) return true;
        kn_link_status status = advance(f, kn_now_ns() + KN_FPGA_ANSWER_NS, &why);
        if (status == KN_LINK_OK || status == KN_LINK_LATE) continue;
        blame(f, why);
        return false;
    }
    return false;
}

// Find the circuit, load it with a copy of the twin's state and let it catch up. Return true when it is in step.
static bool get_in_step(fpga *f)
{
    kn_device_be_patient(f->device, true);
    const int out = atomic_load(&f->out);
    // A circuit that gave wrong numbers may hold another object than the one loaded, and the checksum of its state does
    // not cover the object. Send it the whole object, after a pause, since the next attempt may fail as quickly.
    if (out == KN_LOSS_TWIN || out == KN_LOSS_SATURATED) {
        kn_device_distrust(f->device);
        kn_clock_sleep(kn_now_ns() + AGAIN_NS);
    }
    const kn_link_status status = kn_device_identify(f->device, kn_now_ns() + KN_FPGA_ANSWER_NS);
    if (status != KN_LINK_OK) blame(f, kn_fpga_cause(f, status));
    if (status != KN_LINK_OK || !prepare(f)) return false;
    // Ask the servo for a copy and wait until it has taken one; ticks are queued from that moment on.
    atomic_store(&f->copy_is, WANTED);
    while (!atomic_load(&f->stop) && atomic_load(&f->copy_is) == WANTED) kn_clock_sleep(kn_now_ns() + LOOK_NS);
    if (load(f) && catch_up(f)) {
        kn_device_be_patient(f->device, false);
        return true;
    }
    atomic_store(&f->following, false);
    return false;
}

// Body of the thread: sleep until the servo hands over the device, then try until the circuit is in step again.
static void *thread_main(void *arg)
{
    fpga *f = arg;
    for (;;) {
        uint64_t count;
        while (read(f->wake, &count, sizeof count) < 0 && errno == EINTR) continue;
        while (!atomic_load(&f->stop) && atomic_load(&f->speaker) == THREAD) {
            tell(f);
            bool in_step = get_in_step(f);
            tell_stats(f);
            if (!in_step) {
                tell(f);
                kn_clock_sleep(kn_now_ns() + AGAIN_NS);
                continue;
            }
            atomic_store(&f->out, KN_LOSS_COUNT);
            f->told = KN_LOSS_COUNT;
            atomic_store(&f->speaker, SERVO);
            // If the object was replaced at this moment, the circuit is not in step, so take the device back.
            int servo = SERVO;
            if (!atomic_load(&f->following)) atomic_compare_exchange_strong(&f->speaker, &servo, THREAD);
        }
        if (atomic_load(&f->stop)) return NULL;
    }
}

// --- creation and destruction ----------------------------------------------------------------------------------------

static void fpga_destroy(void *self)
{
    fpga *f = self;
    atomic_store(&f->stop, true);
    if (f->runs) {
        wake(f);
        pthread_join(f->thread, NULL);
    }
    if (f->wake >= 0) close(f->wake);
    kn_device_close(f->device);
    if (f->twin.destroy) f->twin.destroy(f->twin.self);
    free(f->copy_memory);
    kn_offload_close(f);
    free(f->queue.slot);
    free(f);
}

// Identify the circuit and load the unchanging part. A slot of the queue needs no more bounds than the circuit accepts.
static kn_link_status shape(fpga *f)
{
    kn_link_status status = kn_device_identify(f->device, kn_now_ns() + 5 * KN_FPGA_ANSWER_NS);
    if (status != KN_LINK_OK) return status;
    if (kn_device_caps_of(f->device)->bounds < f->bounds) f->bounds = kn_device_caps_of(f->device)->bounds;
    return prepare(f) ? KN_LINK_OK : KN_LINK_PROTOCOL;
}

// Allocate the queue, 1.5 times the ticks that a load takes, or report why it cannot be as long as the link requires.
static bool allocate(fpga *f, size_t room, const char *uri, char why[KN_LINK_WHY])
{
    tell_stats(f);
    const int64_t load_ns = atomic_load(&f->load_ns);
    int64_t length = QUEUE_LEAST;
    while (length < QUEUE_LEAST / 4 + load_ns / 1000000 * 3 / 2) length *= 2;
    // One block holds the slots first, then the reactions and bounds of each slot.
    const size_t reactions = (size_t)f->bounds * sizeof(int64_t[3]),
                 each = reactions + (size_t)f->bounds * sizeof(kn_fixed_bound),
                 bytes = (size_t)length * (sizeof(slot) + each);
    if (length > QUEUE_MOST || bytes > room) {
        snprintf(
            why, KN_LINK_WHY,
            "%.100s: loading takes %.1f s, which needs a queue of %lld ticks, %zu MiB: expected at most %d ticks and "
            "%zu MiB, with a faster link or fewer nodes",
            uri, 1e-9 * (double)load_ns, (long long)length, (bytes >> 20) + 1, QUEUE_MOST, room >> 20);
        return false;
    }
    f->queue = (queue){(uint32_t)length, aligned_alloc(64, (bytes + 63) / 64 * 64)};
    if (!f->queue.slot) return false;
    memset(f->queue.slot, 0, bytes); // touch every page, so that the servo has no page fault
    char *at = (char *)(f->queue.slot + length);
    for (slot *s = f->queue.slot; s < f->queue.slot + length; s++, at += each) {
        s->reaction = (void *)at;
        s->bound = (void *)(at + reactions);
    }
    return true;
}

// Open the circuit, and load the present state of the object into it.
static bool attach(fpga *f, const char *uri, size_t room, char why[KN_LINK_WHY], bool *device)
{
    f->device = kn_device_open(uri, why);
    *device = true;
    if (!f->device) return false;
    const kn_link *link = kn_device_link(f->device);
    f->notice = link->notice;
    f->shadow = link->shadow;
    f->goes_on = link->goes_on;
    if (f->shadow != KN_SHADOW_FULL && !kn_offload_open(f)) return *device = false;
    kn_device_be_patient(f->device, true);
    kn_link_status status = shape(f);
    if (status == KN_LINK_OK && f->model->cell_count > 0 && f->model->node_count > f->bounds) {
        snprintf(why, KN_LINK_WHY,
                 "%.100s: gas loads all %d nodes, but the circuit takes at most %d loaded nodes a tick", uri,
                 f->model->node_count, f->bounds);
        return false;
    }
    if (status == KN_LINK_OK) {
        if (!allocate(f, room, uri, why)) return *device = false;
        kn_fixed_read(f->model, f->twin.state(f->twin.self), &f->copy);
        atomic_store(&f->following, true);
        bool loaded = load(f);
        if (loaded && f->shadow != KN_SHADOW_FULL) {
            const kn_link_status fast = kn_offload_check(f, uri, why);
            if (fast == KN_LINK_LATE) return false;
            // the circuit has taken ticks that the object has not
            kn_fixed_read(f->model, f->twin.state(f->twin.self), &f->copy);
            loaded = fast == KN_LINK_OK && load(f);
        }
        kn_device_be_patient(f->device, false);
        if (loaded) return true;
        status = KN_LINK_PROTOCOL;
    }
    const char *said = kn_device_why(f->device); // reason of the failure, a line that begins with the device's URI
    if (*said) snprintf(why, KN_LINK_WHY, "%s", said);
    else snprintf(why, KN_LINK_WHY, "%.100s: %s", uri, kn_link_words(status));
    return false;
}

// Watch the twin's steps and start the thread.
static bool start(fpga *f)
{
    kn_fpga_watch(f); // the twin calls begin and end around each of its ticks
    f->wake = eventfd(0, EFD_CLOEXEC);
    f->runs = f->wake >= 0 &&
              kn_rt_thread(&(kn_rt){0}, &f->thread, "circuit", KN_RT_NORMAL, KN_RT_CPU_ANY, thread_main, f) == 0;
    return f->runs;
}

static bool create(kn_backend *backend, const kn_model *model, const char *uri, size_t room, char why[KN_LINK_WHY],
                   bool *device)
{
    snprintf(why, KN_LINK_WHY, "not enough memory");
    if (kn_backend_steps(model->def.solver.dt_s) != 1) {
        snprintf(why, KN_LINK_WHY, "a circuit takes one step a tick: expected solver.dt 1 ms");
        return false;
    }
    fpga *f = calloc(1, sizeof *f);
    if (!f) return false;
    f->model = model;
    f->wake = -1;
    f->told = KN_LOSS_COUNT;
    f->fits = true;
    atomic_init(&f->out, KN_LOSS_COUNT);
    atomic_init(&f->last, KN_LOSS_COUNT);
    // A slot must hold a bound for every node, up to the longest list, because tools can touch every node.
    f->bounds = model->node_count < KN_FIXED_LIST_MAX ? model->node_count : KN_FIXED_LIST_MAX;
    f->copy_memory = aligned_alloc(64, kn_fixed_bytes(&model->fixed->image));
    if (f->copy_memory) kn_fixed_init(&f->copy, &model->fixed->image, f->copy_memory);
    bool fits = kn_backend_cpu(&f->twin, model) && f->copy_memory && attach(f, uri, room, why, device);
    if (!fits || !start(f)) {
        fpga_destroy(f);
        return false;
    }
    *backend = (kn_backend){.name = "fpga",
                            .self = f,
                            .submit = fpga_submit,
                            .wait = fpga_wait,
                            .state = fpga_state,
                            .shape = fpga_shape,
                            .back = fpga_back,
                            .still = fpga_still,
                            .scratch = fpga_scratch,
                            .reset = fpga_reset,
                            .restore = fpga_restore,
                            .afterwards = fpga_afterwards,
                            .destroy = fpga_destroy};
    return true;
}

bool kn_backend_place(kn_backend *backend, const kn_model *model, const char *uri, bool at_leisure, size_t room,
                      char why[KN_LINK_WHY], bool *device)
{
    char patient[KN_LINK_URI];
    *device = false;
    snprintf(why, KN_LINK_WHY, "not enough memory for the object's %zu bytes",
             kn_state_size(model) + kn_scratch_size(model));
    if (!uri) return kn_backend_cpu(backend, model);
    if (at_leisure && strstr(uri, "shadow=") && !strstr(uri, "shadow=full")) {
        snprintf(why, KN_LINK_WHY, "%.100s: a replay compares every tick: expected shadow=full or no shadow=", uri);
        return false;
    }
    if (at_leisure && !strstr(uri, "miss=") &&
        snprintf(patient, sizeof patient, "%s%cmiss=500", uri, strchr(uri, '?') ? '&' : '?') < (int)sizeof patient)
        uri = patient;
    return create(backend, model, uri, room, why, device);
}

// Return the backend as an fpga; NULL if it is another one.
static fpga *of(const kn_backend *backend) { return backend->destroy == fpga_destroy ? backend->self : NULL; }

bool kn_backend_fpga_counts(const kn_backend *backend, kn_fpga_counts *counts)
{
    fpga *f = of(backend);
    *counts = (kn_fpga_counts){0};
    if (!f) return false;
    *counts = (kn_fpga_counts){.there = true,
                               .on_circuit = atomic_load(&f->on_circuit),
                               .shadowed = atomic_load(&f->shadowed),
                               .losses = atomic_load(&f->losses),
                               .different = atomic_load(&f->different),
                               .loads = atomic_load(&f->loads),
                               .queue = f->queue.length,
                               .load_ns = atomic_load(&f->load_ns),
                               .in_step = atomic_load(&f->speaker) == SERVO,
                               .behind = atomic_load(&f->following),
                               .timeouts = atomic_load(&f->timeouts),
                               .crc = atomic_load(&f->crc),
                               .notice = f->notice,
                               .p50_ns = atomic_load(&f->p50_ns),
                               .p99_ns = atomic_load(&f->p99_ns),
                               .max_ns = atomic_load(&f->max_ns),
                               .last = (kn_loss)atomic_load(&f->last)};
    for (int i = 0; i < KN_LOSS_COUNT; i++) {
        counts->because[i] = atomic_load(&f->because[i]);
        counts->reasons += counts->because[i];
    }
    return true;
}

bool kn_backend_fpga_news(kn_backend *backend, char line[KN_FPGA_LINE])
{
    fpga *f = of(backend);
    if (!f || !atomic_load(&f->news)) return false;
    snprintf(line, KN_FPGA_LINE, "%s", f->line);
    atomic_store(&f->news, false);
    return true;
}

bool kn_backend_fpga_agrees(kn_backend *backend, char why[KN_LINK_WHY], kn_device_stats *stats)
{
    fpga *f = of(backend);
    uint32_t circuit = 0;
    kn_loss lost;
    int64_t until_ns = kn_now_ns() + LAST_NS;
    // No thread calls submit any more, so let the circuit catch up here.
    while (kn_now_ns() < until_ns && (atomic_load(&f->speaker) == THREAD || !kn_fpga_empty(f))) {
        take_copy(f);
        if (atomic_load(&f->speaker) == THREAD) kn_clock_sleep(kn_now_ns() + LOOK_NS);
        else if (advance(f, until_ns, &lost) != KN_LINK_OK) kn_fpga_lose(f, lost);
    }
    if (atomic_load(&f->speaker) != SERVO) {
        snprintf(why, KN_LINK_WHY, "the circuit is not in step");
        return false;
    }
    kn_device_stats_of(f->device, stats);
    if (kn_device_crc(f->device, kn_now_ns() + KN_FPGA_PATIENCE_NS, &circuit) != KN_LINK_OK) {
        snprintf(why, KN_LINK_WHY, "no checksum of its state: %.300s", kn_device_why(f->device));
        return false;
    }
    kn_fixed_read(f->model, fpga_state(f), &f->copy);
    const uint32_t own = kn_fixed_crc(&f->copy);
    if (own == circuit) return true;
    snprintf(why, KN_LINK_WHY, "its state has the checksum %08x, the twin's %08x", circuit, own);
    return false;
}
