// The circuit computes alone: shadow=off or checked (fpga.h).
#include "server/backend/fpga_parts.h"
#include "server/clock.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WHOLE_TICKS 50 // number of ticks between two whole states
// Longest time for a tick, and for reading a whole state after a tick, ns.
#define TRIES_NS 500000000 // longest time of the trials at the start, ns
#define MOST_NS (KN_PERIOD_NS - KN_FPGA_SPARE_NS)

// Submit the tick to the circuit, unless the circuit has it already. If the tick is to be checked, compute it here, too.
static kn_link_status begin(fpga *f, const kn_fixed_bound *bound, int count)
{
    offload *o = &f->off;
    if (f->flying) return KN_LINK_OK;
    const kn_link_status status = kn_device_submit(f->device, bound, count);
    f->flying = status == KN_LINK_OK;
    o->answered = false;
    o->began_ns = kn_now_ns();
    if (!f->flying || !o->checks) return status;
    kn_fixed_result result;
    f->copy.flags = 0;
    kn_fixed_tick(&f->copy, bound, count, o->expected.reaction, &result);
    o->expected.count = count;
    o->expected.residual = result.residual;
    o->expected.flags = result.flags;
    return status;
}

// Wait for the circuit's result. Each sleep between two looks costs time of the processor, so sleep once until the
// result is there in most ticks. If it was, sleep a little less in the next tick, otherwise more.
static kn_link_status await(fpga *f)
{
    offload *o = &f->off;
    if (o->answered) return KN_LINK_OK;
    // no longer than a tick may take, and shorter when the tick began late
    if (o->sleep_ns > MOST_NS || o->began_ns + o->sleep_ns >= o->until_ns) o->sleep_ns /= 2;
    kn_clock_sleep(o->began_ns + o->sleep_ns);
    kn_link_status status = kn_device_wait(f->device, 0, &o->result);
    if (status == KN_LINK_LATE) {
        o->sleep_ns += 1000 + o->sleep_ns / 64;
        status = kn_device_wait(f->device, o->until_ns, &o->result);
    } else {
        o->sleep_ns -= o->sleep_ns / 256;
    }
    o->answered = status == KN_LINK_OK;
    return status;
}

// Return true unless the tick was checked and differs from the circuit's. A flag that the circuit raised in an earlier
// tick since its load stays raised and cannot be compared.
static bool agrees(fpga *f)
{
    offload *o = &f->off;
    const bool same =
        !o->checks ||
        (kn_fpga_equal(&o->expected, &o->result) && (o->expected.flags & ~f->flags) == (o->result.flags & ~f->flags) &&
         memcmp(o->moves, f->copy.u, 3 * (size_t)f->model->node_count * sizeof *o->moves) == 0);
    o->checks = false;
    return same;
}

kn_fixed_where kn_offload_tick(fpga *f, const kn_fixed_bound *bound, int count, kn_fixed *engine,
                               int64_t (*reaction)[3], kn_fixed_result *result)
{
    offload *o = &f->off;
    kn_link_status status = count <= f->bounds ? begin(f, bound, count) : KN_LINK_PROTOCOL;
    if (status == KN_LINK_OK) status = await(f);
    if (status == KN_LINK_OK) status = kn_device_moves(f->device, o->moves, o->until_ns);
    o->late = status == KN_LINK_LATE;
    if (status != KN_LINK_OK) {
        if (!o->late) o->wrong = count <= f->bounds ? kn_fpga_cause(f, status) : KN_LOSS_BOUNDS;
        return KN_FIXED_LATE;
    }
    f->flying = false;
    if (!agrees(f)) {
        atomic_fetch_add(&f->different, 1);
        o->wrong = KN_LOSS_TWIN;
        return KN_FIXED_LATE;
    }
    const int64_t most = ((int64_t)1 << (KN_FIXED_X - 1)) - 1;
    for (int c = 0; c < 3 * f->model->node_count; c++) {
        const int64_t x = engine->x[c] + o->moves[c];
        engine->u[c] = o->moves[c];
        engine->x[c] = x > most ? most : x < -most - 1 ? -most - 1 : x;
    }
    if (count > 0) memcpy(reaction, o->result.reaction, (size_t)count * sizeof *reaction);
    *result = (kn_fixed_result){o->result.residual, o->result.flags & ~f->flags};
    f->flags = o->result.flags;
    return KN_FIXED_THERE;
}

// End the circuit's work. The caller then replaces the state of the object.
static void stop(fpga *f)
{
    f->off.on = f->off.reading = f->off.checks = false;
    f->off.age = f->off.waiting = 0;
    f->flying = false;
    kn_fpga_watch(f); // drops a step that the circuit was late for
}

// Lose the circuit, and let the object go back to its newest whole state.
static void fall(fpga *f, kn_loss loss)
{
    atomic_store(&f->off.back, f->off.age + f->off.waiting);
    stop(f);
    f->twin.restore(f->twin.self, f->off.whole);
    f->off.fell = true;
    kn_fpga_lose(f, loss);
}

// Read the whole state from the circuit. If it does not come in time, the next call continues. Lose the circuit if its
// displacements differ from the sums of those that it has given after each tick.
static void make_whole(fpga *f, int64_t until_ns)
{
    offload *o = &f->off;
    const kn_link_status status = kn_device_read(f->device, &f->copy, until_ns);
    o->reading = status == KN_LINK_LATE;
    if (o->reading) return;
    if (status != KN_LINK_OK) {
        fall(f, kn_fpga_cause(f, status));
        return;
    }
    const kn_state *now = f->twin.state(f->twin.self);
    kn_state_copy(f->model, o->whole, now);
    kn_fixed_write(f->model, &f->copy, o->whole);
    const bool same =
        memcmp(o->whole->displacement, now->displacement, kn_model_field(f->model, 3) * sizeof(double)) == 0;
    o->age = 0;
    if (!same) {
        atomic_fetch_add(&f->different, 1);
        fall(f, KN_LOSS_TWIN);
        return;
    }
    f->twin.restore(f->twin.self, o->whole);
    o->checks = f->shadow == KN_SHADOW_CHECKED;
}

// Let the circuit compute the waiting ticks, the oldest first, until the time is over or the circuit is lost.
static kn_backend_status drain(fpga *f, int64_t until_ns)
{
    offload *o = &f->off;
    kn_backend_status status = KN_BACKEND_OK;
    o->until_ns = until_ns;
    o->wrong = KN_LOSS_COUNT;
    if (o->reading) make_whole(f, until_ns);
    while (o->on && !o->reading && o->waiting > 0 && kn_now_ns() < until_ns) {
        // if every tick is late, the circuit is never idle in kn_offload_afterwards
        if (!f->flying && o->age > WHOLE_TICKS) {
            make_whole(f, until_ns);
            continue;
        }
        f->twin.submit(f->twin.self, &o->input[0]);
        if (o->wrong != KN_LOSS_COUNT) fall(f, o->wrong);
        if (!o->on || o->late) break;
        status = f->twin.wait(f->twin.self, 0, &o->output);
        memmove(o->input, o->input + 1, (size_t)--o->waiting * sizeof *o->input);
        o->age++;
        atomic_fetch_add(&f->on_circuit, 1);
    }
    return status;
}

// Return true if the circuit computes this tick alone. It begins to do so as soon as it is in step.
static bool offloads(fpga *f)
{
    offload *o = &f->off;
    if (o->on || f->shadow == KN_SHADOW_FULL) return o->on;
    o->on = atomic_load(&f->speaker) == SERVO && atomic_load(&f->following) && kn_fpga_empty(f) && !f->flying;
    if (o->on) kn_state_copy(f->model, o->whole, f->twin.state(f->twin.self));
    return o->on;
}

bool kn_offload_still(const fpga *f)
{
    return f->shadow != KN_SHADOW_FULL && !f->goes_on &&
           (atomic_load(&f->speaker) != SERVO || !atomic_load(&f->following));
}

bool kn_offload_submit(fpga *f, const kn_input *input)
{
    offload *o = &f->off;
    o->still = kn_offload_still(f);
    if (o->fell || o->still) return true;
    if (!offloads(f)) return false;
    o->input[o->waiting++] = *input;
    return true;
}

bool kn_offload_has(const fpga *f) { return f->off.on || f->off.fell || f->off.still; }

kn_backend_status kn_offload_wait(fpga *f, bool clock, int64_t until_ns, kn_output *output)
{
    offload *o = &f->off;
    if (o->still && !o->fell) {
        *output = (kn_output){0};
        return KN_BACKEND_STILL;
    }
    o->clock = clock;
    if (o->fell) atomic_fetch_add(&o->back, 1); // it was lost before this tick, whose input nobody has taken
    kn_backend_status status = o->fell ? KN_BACKEND_OK : drain(f, until_ns);
    if (o->on && o->waiting == KN_FPGA_LATE_MOST) fall(f, KN_LOSS_LATE);
    *output = o->output;
    if (o->fell) status = KN_BACKEND_LOST;
    else if (o->waiting > 0 && status == KN_BACKEND_OK) status = KN_BACKEND_LATE;
    o->fell = false;
    return status;
}

void kn_offload_afterwards(fpga *f)
{
    const offload *o = &f->off;
    if (o->on && o->waiting == 0 && o->age >= WHOLE_TICKS) make_whole(f, kn_now_ns() + MOST_NS);
}

// If the circuit does not give its state in time, it is lost.
const kn_state *kn_offload_state(fpga *f)
{
    offload *o = &f->off;
    const int64_t until_ns = kn_now_ns() + (o->clock ? 2 * KN_PERIOD_NS : KN_FPGA_PATIENCE_NS);
    if (o->on && o->waiting > 0) drain(f, until_ns);
    if (o->on && o->waiting == 0 && o->age > 0) make_whole(f, until_ns);
    if (o->on && o->age > 0) fall(f, KN_LOSS_LATE);
    return f->twin.state(f->twin.self);
}

void kn_offload_lose(fpga *f, kn_loss loss)
{
    if (f->off.on) fall(f, loss);
    else kn_fpga_lose(f, loss);
}

void kn_offload_end(fpga *f)
{
    if (f->off.on) stop(f);
    f->off.fell = false;
    atomic_store(&f->off.back, -1);
}

// --- opening ---------------------------------------------------------------------------------------------------------

bool kn_offload_open(fpga *f)
{
    offload *o = &f->off;
    atomic_init(&o->back, -1);
    o->whole = kn_state_create(f->model);
    o->moves = calloc(3 * (size_t)f->model->node_count, sizeof *o->moves);
    o->expected.reaction = calloc((size_t)f->bounds, sizeof *o->expected.reaction);
    return o->whole && o->moves && o->expected.reaction;
}

void kn_offload_close(fpga *f)
{
    kn_state_destroy(f->off.whole);
    free(f->off.moves);
    free(f->off.expected.reaction);
}

// Return the least time of some ticks with nothing in contact, or, if `whole`, of some readings of the state; -1: the
// circuit failed. Other programs can only lengthen these times, so go on for TRIES_NS until one is short enough.
static int64_t least_ns(fpga *f, bool whole)
{
    int64_t least = INT64_MAX;
    kn_device_result result;
    for (const int64_t end_ns = kn_now_ns() + TRIES_NS; least > MOST_NS && kn_now_ns() < end_ns;) {
        const int64_t from_ns = kn_now_ns(), until_ns = from_ns + KN_FPGA_ANSWER_NS;
        kn_link_status status = whole ? kn_device_read(f->device, &f->copy, until_ns) : KN_LINK_OK;
        if (!whole) status = kn_device_submit(f->device, NULL, 0);
        if (!whole && status == KN_LINK_OK) status = kn_device_wait(f->device, until_ns, &result);
        if (!whole && status == KN_LINK_OK) status = kn_device_moves(f->device, f->off.moves, until_ns);
        if (status != KN_LINK_OK) return -1;
        const int64_t took_ns = kn_now_ns() - from_ns;
        if (took_ns < least) least = took_ns;
    }
    return least;
}

kn_link_status kn_offload_check(fpga *f, const char *uri, char why[KN_LINK_WHY])
{
    const int64_t tick_ns = least_ns(f, false), whole_ns = tick_ns < 0 ? -1 : least_ns(f, true);
    if (whole_ns < 0) return KN_LINK_PROTOCOL;
    if (tick_ns <= MOST_NS && whole_ns <= MOST_NS) return KN_LINK_OK;
    snprintf(
        why, KN_LINK_WHY,
        "%.100s: a tick with all displacements takes %.2f ms and reading a whole state %.2f ms: expected at most %g "
        "ms each for shadow=%s; shadow=full has no such limit",
        uri, 1e-6 * (double)tick_ns, 1e-6 * (double)whole_ns, 1e-6 * MOST_NS,
        f->shadow == KN_SHADOW_OFF ? "off" : "checked");
    return KN_LINK_LATE;
}
