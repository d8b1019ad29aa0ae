#include "server/daemon.h"
#include "core/lattice.h"
#include "core/solver_fixed.h"
#include "proto/knead_status_t.h"
#include "server/backend/fpga.h"
#include "server/bus.h"
#include "server/control.h"
#include "server/exchange.h"
#include "server/health.h"
#include "server/keeper.h"
#include "server/operator.h"
#include "server/say.h"
#include <ev.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

// largest number of datagrams read per tick (256 kHz); at 1-2 us each, a flood of datagrams takes at most half of every
// millisecond
#define DATAGRAMS_PER_TICK 256
// time from the start of the threads to tick 0, ns; by then every thread has left the start barrier and sleeps
#define START_DELAY_NS 20000000
// A second signal counts as a request of its own only after this time. timeout(1) and shells send the first signal
// twice, and a stop takes 100 ms at most.
#define PATIENCE_NS 300000000
#define SIGNALS 3
#define BUFFER_BYTES (1 << 20) // receive buffer of the socket, bytes: about 1 300 poses
#define SCENE_S 1              // period of the scene message, s; a new client waits for a scene at most this long
// longest wait of the control thread for requests, ms; a stop is delayed by at most this time
#define CONTROL_TURN_MS 20
// longest acceptable tick without contact, ns; a tick with contact takes twice as long, and may take 1 ms
#define REST_TICK_NS 500000

typedef struct server {
    kn_served on;    // the scene being served
    int64_t rest_ns; // time of a tick while nothing touches the object, ns
    kn_bus bus, mesh_bus;
    int claim, mesh_claim, fd; // descriptors: the claims on the two buses; the socket of the first bus
    kn_exchange exchange;      // used by the main thread
    kn_auth auth;              // key and life of kneadd, used if a key file was given
    kn_batch batch;
    kn_skin skin;
    kn_control *control; // control socket; NULL: none
    kn_operator operator;
    kn_trace trace;
    kn_loop loop;
    kn_keeper keeper;
    kn_sentinel sentinel;
    kn_rt rt;
    pthread_t servo_thread, sentinel_thread, mesh_thread, control_thread, worker_thread, keeper_thread;
    pthread_barrier_t go; // threads wait here until their stacks are locked with all other memory
    atomic_bool ending;   // set to end the threads of normal priority; the keeper has a flag of its own
    struct ev_loop *ev;
    ev_io readable;
    ev_async ticked, asked, leave, load;
    char *next, *next_text; // path and text of the scene to load next; used by the worker until all threads end
    char next_name[sizeof((kn_scene *)0)->name];
    atomic_bool goes_on; // true: serve the scene `next` after the present scene has ended
    bool stuck;          // true if the worker thread did not end in time
    bool estopped;       // true if an emergency stop is in force from the first tick on
    ev_timer status_due, scene_due;
    ev_signal signals[SIGNALS];
    int64_t stop_ns;   // time of the first signal to end, ns; 0: none yet
    unsigned refusals; // reasons of rejected poses that have been reported already, one bit per kn_verdict
    int budget;        // datagrams that may still be read before the next tick
    int64_t start_ns;
    int32_t mode_told;
    kn_checkup checkup;
} server;

// --- main thread ---

// Read at most `limit` datagrams and pass them to the exchange.
static void take_datagrams(server *d, int limit)
{
    kn_bus_read(&d->bus, d->fd, limit < KN_BATCH ? limit : KN_BATCH, &d->batch);
    kn_exchange_hear(&d->exchange, &d->batch);
}

// Read no more datagrams than d->budget allows before the next tick, so that a flood of datagrams cannot delay the
// forces.
static void on_readable(struct ev_loop *ev, ev_io *w, int events)
{
    (void)events;
    server *d = w->data;
    take_datagrams(d, d->budget);
    d->budget -= d->batch.count;
    if (d->budget <= 0) ev_io_stop(ev, w); // pause reading until the next tick
}

// Report each reason for which every message of a sender is refused. Each reason is reported once.
static void tell_refusals(server *d)
{
    static const kn_verdict told[] = {KN_REJECT_PEER, KN_REJECT_MAC, KN_REJECT_REPLAYED, KN_REJECT_CLOCK,
                                      KN_REJECT_TYPE};
    for (size_t i = 0; i < sizeof told / sizeof *told; i++) {
        if (d->exchange.receiver.rejected[told[i]] == 0 || d->refusals >> told[i] & 1) continue;
        d->refusals |= 1u << told[i];
        kn_say("kneadd: a message was refused as %s: %s; 'knead ctl status' shows the counts", kn_verdict_name(told[i]),
               kn_verdict_meaning(told[i]));
    }
}

// Publish the status and the health.
static void tell_status(server *d)
{
    kn_health health;
    kn_checkup_tell(&d->checkup, &health);
    d->mode_told = health.status.mode;
    kn_publisher_status(&d->exchange.publisher, &health.status);
    kn_publisher_health(&d->exchange.publisher, &health.more);
}

// Called after each tick of the servo: publish its records, and read datagrams again. Publish the status at once when
// the mode has changed. End the main loop after the last tick.
static void on_ticked(struct ev_loop *ev, ev_async *w, int events)
{
    (void)events;
    server *d = w->data;
    bool done = kn_exchange_ticked(&d->exchange);
    atomic_store(&d->operator.told, d->exchange.told);
    d->budget = DATAGRAMS_PER_TICK;
    if (!ev_is_active(&d->readable)) ev_io_start(ev, &d->readable);
    if (atomic_load_explicit(&d->loop.account.mode, memory_order_relaxed) != d->mode_told) tell_status(d);
    if (done) ev_break(ev, EVBREAK_ALL);
}

// Every second: publish the status, and report refused senders.
static void on_status_due(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)ev, (void)events;
    tell_status(w->data);
    tell_refusals(w->data);
}

static void on_scene_due(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    kn_publisher_scene(&d->exchange.publisher, kn_stamp_us());
}

// Ask the servo to ramp the forces to zero and stop. systemd is told whether a reload or an end follows.
static void stop(server *d)
{
    atomic_store(&d->loop.stop, true);
    if (d->goes_on) sd_notifyf(0, "RELOADING=1\nMONOTONIC_USEC=%" PRId64, kn_now_ns() / 1000);
    else sd_notify(0, "STOPPING=1");
}

// Post a health report to the operator module, which has requested one.
static void on_asked(struct ev_loop *ev, ev_async *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    kn_health *health = kn_mailbox_back(&d->operator.health);
    kn_checkup_now(&d->checkup, health);
    memcpy(health->force, d->exchange.force, sizeof health->force);
    kn_mailbox_post(&d->operator.health);
}

// The operator has requested the end: stop, and load no other scene.
static void on_leave(struct ev_loop *ev, ev_async *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    d->goes_on = false;
    stop(d);
}

// The operator has requested another scene: stop, and then serve the new scene.
static void on_load(struct ev_loop *ev, ev_async *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    // an end has already been requested, so ignore the request for another scene
    if (atomic_load(&d->loop.stop)) return;
    d->goes_on = true;
    stop(d);
}

// Ask the main thread to post the health. Runs in the control thread, as do goes_on() and leave().
static void ask(void *arg)
{
    server *d = arg;
    ev_async_send(d->ev, &d->asked);
}

// Lock the memory that a change has allocated. Runs in the worker thread, as does load_next().
static void lock(void *arg)
{
    server *d = arg;
    kn_rt_lock_more(&d->rt);
}

// Keep a copy of the text that was checked, so that a later change of the file has no effect.
static void load_next(void *arg, const char *path, const kn_scene *scene)
{
    server *d = arg;
    char *copy = strdup(path), *text = strdup(scene->text);
    free(d->next);
    free(d->next_text);
    d->next = copy;
    d->next_text = text;
    snprintf(d->next_name, sizeof d->next_name, "%s", scene->name);
    if (copy && text) ev_async_send(d->ev, &d->load);
}

static bool goes_on(void *arg)
{
    server *d = arg;
    return d->goes_on && !d->stuck;
}

static void leave(void *arg)
{
    server *d = arg;
    ev_async_send(d->ev, &d->leave);
}

// Handle SIGINT, SIGTERM and SIGHUP: stop, and do not load another scene afterwards.
static void on_signal(struct ev_loop *ev, ev_signal *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    int64_t now_ns = kn_now_ns();
    d->goes_on = false;
    // this is a deliberate second signal, so end at once, as without a handler
    if (d->stop_ns && now_ns - d->stop_ns > PATIENCE_NS) {
        signal(w->signum, SIG_DFL);
        raise(w->signum);
    }
    if (!d->stop_ns) d->stop_ns = now_ns;
    stop(d);
}

// Wake the main thread. Runs in the servo thread: one write to an eventfd, and none while one is pending.
static void notify(void *arg)
{
    server *d = arg;
    ev_async_send(d->ev, &d->ticked);
}

// Register the events of the main loop.
static bool watch_events(server *d)
{
    static const int signals[SIGNALS] = {SIGINT, SIGTERM, SIGHUP};
    d->ev = ev_default_loop(EVFLAG_AUTO);
    if (!d->ev) return false;
    ev_io_init(&d->readable, on_readable, d->fd, EV_READ);
    ev_async_init(&d->ticked, on_ticked);
    ev_async_init(&d->asked, on_asked);
    ev_async_init(&d->leave, on_leave);
    ev_async_init(&d->load, on_load);
    ev_timer_init(&d->status_due, on_status_due, 1, 1);
    ev_timer_init(&d->scene_due, on_scene_due, 0, SCENE_S);
    d->readable.data = d->ticked.data = d->asked.data = d->leave.data = d->load.data = d->status_due.data =
        d->scene_due.data = d;
    ev_set_priority(&d->ticked, EV_MAXPRI); // publish forces before handling any other event
    ev_async_start(d->ev, &d->ticked);
    ev_async_start(d->ev, &d->asked);
    ev_async_start(d->ev, &d->leave);
    ev_async_start(d->ev, &d->load);
    ev_io_start(d->ev, &d->readable);
    ev_timer_start(d->ev, &d->status_due);
    ev_timer_start(d->ev, &d->scene_due);
    for (int i = 0; i < SIGNALS; i++) {
        ev_signal_init(&d->signals[i], on_signal, signals[i]);
        d->signals[i].data = d;
        ev_signal_start(d->ev, &d->signals[i]);
    }
    return true;
}

// --- other threads ---

static void *servo_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    return kn_loop_run(&d->loop);
}

static void *sentinel_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    return kn_sentinel_run(&d->sentinel);
}

// Report missed cycles with the wording of ros2_control, which operators and their scripts know. Print at most one line
// a second, with the number of misses since the last line.
static void tell_overruns(server *d, int64_t *told)
{
    int64_t missed = atomic_load_explicit(&d->loop.account.missed, memory_order_relaxed);
    if (missed == *told) return;
    double loop_ms = 1e-6 * (double)atomic_load_explicit(&d->loop.account.late_loop_ns, memory_order_relaxed);
    kn_say("Overrun detected! The servo loop missed its desired rate of 1000 Hz. The loop took %.3f ms "
           "(missed cycles : %" PRId64 ").",
           loop_ms, missed - *told);
    *told = missed;
}

// Report that the object created energy. The simulation went wrong, but the hand did not feel it, because the passivity
// controller of each client keeps the force on the hand passive.
static void tell_audit(server *d, int64_t *told)
{
    int64_t created = atomic_load_explicit(&d->loop.account.created, memory_order_relaxed);
    if (created != *told)
        kn_say("kneadd: in %" PRId64
               " s the object created energy: it gave more than it had and received, by over %g %% of the work",
               created - *told, 100 * KN_AUDIT_SHARE);
    *told = created;
}

// Report to the systemd watchdog of kneadd.service once a second, if the servo ticks and the main thread takes the
// servo's records.
static void tell_alive(server *d, int64_t *tick, int64_t *unpublished)
{
    const kn_account *a = &d->loop.account;
    int64_t now = atomic_load_explicit(&a->tick, memory_order_relaxed);
    int64_t lost = atomic_load_explicit(&a->unpublished, memory_order_relaxed);
    if (now > *tick && lost == *unpublished) sd_notify(0, "WATCHDOG=1");
    *tick = now;
    *unpublished = lost;
}

// Report that the quality has changed, or that no lower quality is left. A log has the same information from
// KNEAD_EVENT.
static void tell_quality(server *d, kn_quality *told, bool *told_exhausted)
{
    kn_account *a = &d->loop.account;
    kn_quality now = (kn_quality)atomic_load_explicit(&a->quality, memory_order_relaxed),
               asked = (kn_quality)atomic_load_explicit(&a->asked, memory_order_relaxed);
    bool exhausted = atomic_load_explicit(&a->exhausted, memory_order_relaxed);
    double budget_ms = 1e3 * atomic_load_explicit(&a->budget_s, memory_order_relaxed);
    const char *before = kn_quality_name(*told), *name = kn_quality_name(now);
    if (now != *told && now == asked) kn_say("kneadd: quality %s -> %s, as commanded", before, name);
    else if (now != *told)
        kn_say("kneadd: quality %s -> %s: %d consecutive ticks took more than %g ms; 'knead ctl quality %s' goes back",
               before, name, KN_OVER_TICKS, budget_ms, kn_quality_name(asked));
    if (exhausted && !*told_exhausted)
        kn_say("kneadd: %d consecutive ticks took more than %g ms; the scene has no quality point below %s",
               KN_OVER_TICKS, budget_ms, name);
    *told = now;
    *told_exhausted = exhausted;
}

// Report that the circuit was lost or is in step again, at most one line a second. If the circuit was lost and came
// back within this second, one line reports both, with the number of losses.
static void tell_losses(server *d, bool *told_lost)
{
    char line[KN_FPGA_LINE];
    kn_fpga_counts n;
    if (!kn_backend_fpga_counts(&d->on.backend, &n)) return;
    bool lost = kn_backend_fpga_news(&d->on.backend, line);
    if (lost)
        kn_say("kneadd: circuit lost, %lld times so far: %s%s", (long long)n.reasons, line,
               n.in_step ? ", and in step again" : "");
    else if (*told_lost && n.in_step)
        kn_say("kneadd: circuit in step again, loaded %lld times so far", (long long)n.loads);
    *told_lost = (lost || *told_lost) && !n.in_step;
}

// The mesh thread: publish surface meshes, and report once a second what the real-time threads have counted.
static void *mesh_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    const int64_t rest_ns = (d->skin.period_ticks - 1) * (int64_t)KN_PERIOD_NS;
    int64_t second_ns = 0, missed_told = 0, created_told = 0, tick_told = -1, unpublished_told = 0;
    kn_quality quality_told = d->on.scene->quality;
    bool exhausted_told = false, lost_told = false;
    while (!atomic_load_explicit(&d->ending, memory_order_relaxed)) {
        if (kn_now_ns() - second_ns >= 1000000000) {
            second_ns = kn_now_ns();
            kn_skin_publish_topology(&d->skin, kn_stamp_us());
            tell_alive(d, &tick_told, &unpublished_told);
            tell_losses(d, &lost_told);
            tell_overruns(d, &missed_told);
            tell_audit(d, &created_told);
            tell_quality(d, &quality_told, &exhausted_told);
        }
        kn_trace_drain(&d->trace);
        // Sleep until just before the next frame is due, however long this frame took to measure. Then look for the
        // frame every millisecond. With a fixed sleep period the thread could be late by a whole period.
        const int64_t taken_ns = kn_now_ns();
        bool published = kn_skin_publish(&d->skin, kn_stamp_us());
        kn_clock_sleep(taken_ns + (published ? rest_ns : KN_PERIOD_NS));
    }
    return NULL;
}

static void *control_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    while (!atomic_load_explicit(&d->ending, memory_order_relaxed)) kn_control_turn(d->control, CONTROL_TURN_MS);
    return NULL;
}

static void *worker_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    kn_control_work(d->control);
    return NULL;
}

static void *keeper_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    return kn_keeper_run(&d->keeper);
}

// --- start and stop ---

// Parse the two URLs, and load the key if there is one.
static bool choose_buses(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    // without an option, take the URL from the environment, as every LCM client does
    const char *url = def->lcm_url ? def->lcm_url : getenv("LCM_DEFAULT_URL");
    const char *own = def->lan ? KN_LCM_LAN_URL : KN_LCM_URL, *own_mesh = def->lan ? KN_MESH_LAN_URL : KN_MESH_URL;
    if (!kn_bus_parse(&d->bus, url && *url ? url : own, def->lan, error, error_size) ||
        !kn_bus_parse(&d->mesh_bus, def->mesh_url ? def->mesh_url : own_mesh, def->lan, error, error_size) ||
        (def->key && !kn_auth_load(&d->auth, def->key, error, error_size)))
        return false;
    return true;
}

// Claim and open both buses, then set up the modules that use them.
static bool open_buses(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    if (!kn_bus_check_route(&d->bus, error, error_size) || !kn_bus_check_route(&d->mesh_bus, error, error_size))
        return false;
    d->claim = kn_bus_claim(&d->bus, "--lcm-url", error, error_size);
    if (d->claim < 0) return false;
    // Two URLs with the same group and port are one bus, which is claimed once.
    bool own = !kn_bus_same(&d->bus, &d->mesh_bus);
    if (own && (d->mesh_claim = kn_bus_claim(&d->mesh_bus, "--mesh-url", error, error_size)) < 0) return false;
    d->fd = kn_bus_listen(&d->bus, BUFFER_BYTES, error, error_size);
    if (d->fd < 0) return false;
    uint64_t hash = kn_state_hash(d->on.model, d->on.backend.state(d->on.backend.self));
    kn_exchange *x = &d->exchange;
    // Set up the exchange: receiver, publisher and mesh publisher, with the key if there is one.
    *x = (kn_exchange){.loop = &d->loop, .trace = &d->trace, .sentinel = &d->sentinel};
    kn_receiver_init(&x->receiver, &d->on.model->def);
    memcpy(x->receiver.peer, def->peer, sizeof def->peer);
    x->receiver.peers = def->peers;
    x->receiver.auth = def->key ? &d->auth : NULL;
    if (def->key) kn_auth_begin(&d->auth);
    if (!kn_publisher_open(&x->publisher, d->bus.url, d->on.scene, hash, error, error_size) ||
        !kn_skin_open(&d->skin, d->mesh_bus.url, d->on.scene, d->on.model, error, error_size))
        return false;
    x->publisher.auth = d->skin.auth = x->receiver.auth;
    if (kn_loop_init(&d->loop, d->on.scene, d->on.model, &d->on.backend, &d->skin, d->on.audit) &&
        (!def->touch || kn_loop_touch(&d->loop)) && kn_sentinel_init(&d->sentinel) && watch_events(d)) {
        // Set up the loop, the restored state and an emergency stop that is still in force.
        d->loop.servo.sets = &d->on.sets;
        kn_keeper_start(&d->keeper, &d->loop);
        bool kept = d->keeper.store.dir >= 0 && kn_store_estopped(&d->keeper.store);
        d->estopped = def->estopped || kept;
        if (d->estopped) { // tick 0 takes the order and publishes an event for the log
            kn_loop_order(&d->loop, KN_ORDER_ESTOP, 0);
            atomic_store(&d->loop.account.mode, KNEAD_STATUS_T_MODE_ESTOP);
        }
        d->checkup = (kn_checkup){.served = &d->on,
                                  .loop = &d->loop,
                                  .receiver = &x->receiver,
                                  .publisher = &x->publisher,
                                  .keeper = &d->keeper,
                                  .sentinel = &d->sentinel,
                                  .rt = &d->rt,
                                  .fd = d->fd};
        return true;
    }
    snprintf(error, error_size, "out of memory or file descriptors");
    return false;
}

// Set up the operator, and open the control socket if there is one.
static bool open_control(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    kn_operated on = {.served = &d->on,
                      .def = &def->object,
                      .limits = def->limits ? def->limits : &d->on.base->limits,
                      .loop = &d->loop,
                      .keeper = &d->keeper,
                      .skin = &d->skin,
                      .ask = ask,
                      .goes_on = goes_on,
                      .stop = leave,
                      .load = load_next,
                      .built = lock,
                      .arg = d};
    kn_operator_init(&d->operator, & on);
    kn_control_def control = kn_operator_control(&d->operator);
    if (def->control) d->control = kn_control_open(def->control, &control, error, error_size);
    return !def->control || d->control;
}

// Measure the object, create the threads, lock the memory and let the threads run.
static bool start_threads(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    d->loop.deadline = kn_served_deadline(&d->on.backend, d->on.model, d->on.scene->budget_s);
    // Enter real-time priority only now, because building a scene takes longer than LimitRTTIME allows a real-time
    // thread to run.
    kn_rt_enter(&d->rt, def->realtime);
    d->rest_ns = kn_served_measure(&d->on.backend, NULL);
    d->operator.served_ns = kn_served_measure(&d->on.backend, d->on.model);
    d->loop.free = def->free;
    d->loop.notify = notify;
    d->loop.notify_arg = d;
    bool keeps = d->keeper.store.dir >= 0;
    // The barrier's count: main, servo, sentinel and mesh; control and worker; keeper.
    pthread_barrier_init(&d->go, NULL, 4u + 2u * !!d->control + keeps);
    int failed = kn_rt_thread(&d->rt, &d->servo_thread, "servo", KN_RT_SERVO, true, servo_main, d);
    if (!failed) failed = kn_rt_thread(&d->rt, &d->sentinel_thread, "sentinel", KN_RT_SENTINEL, true, sentinel_main, d);
    if (!failed) failed = kn_rt_thread(&d->rt, &d->mesh_thread, "mesh", KN_RT_NORMAL, false, mesh_main, d);
    if (!failed && d->control)
        failed = kn_rt_thread(&d->rt, &d->control_thread, "control", KN_RT_NORMAL, false, control_main, d);
    if (!failed && d->control)
        failed = kn_rt_thread(&d->rt, &d->worker_thread, "worker", KN_RT_NORMAL, false, worker_main, d);
    if (!failed && keeps)
        failed = kn_rt_thread(&d->rt, &d->keeper_thread, "keeper", KN_RT_NORMAL, false, keeper_main, d);
    // Lock the memory now that all stacks exist and no thread runs yet.
    if (!failed) kn_rt_lock_memory(&d->rt);
    if (failed) snprintf(error, error_size, "cannot start a thread: %s", strerror(failed));
    else if (d->rt.mode == KN_RT_REQUIRE && *d->rt.missing)
        snprintf(error, error_size, "not real time: %s", d->rt.missing);
    else {
        // Start the grids of servo and sentinel, then release the threads.
        d->start_ns = d->checkup.start_ns = kn_now_ns() + START_DELAY_NS;
        kn_loop_start(&d->loop, d->start_ns);
        d->sentinel.beside = &d->loop.start_ns;
        d->sentinel.busy = &d->loop.busy;
        kn_clock_start(&d->sentinel.clock, d->start_ns + KN_SENTINEL_OFFSET_NS);
        d->budget = DATAGRAMS_PER_TICK;
        pthread_barrier_wait(&d->go);
        return true;
    }
    return false; // give up; the threads that wait at the barrier end with the process
}

// Print the settings that were restored from the last run.
static void tell_sets(FILE *out, const kn_sets *sets)
{
    char room[KN_SETS_BYTES];
    const char *list[KN_SETS_MAX];
    int count = kn_sets_list(sets, room, list);
    for (int i = 0; i < count; i++) fprintf(out, "%s%s", i == 0 ? "kneadd: settings restored: " : ", ", list[i]);
    if (count > 0) fputc('\n', out);
}

// Print what is being served, and everything that prevents real-time operation, accuracy or authentication.
static void tell_ready(server *d, FILE *out)
{
    fprintf(out, "kneadd: serving %s, %d nodes", d->on.scene->name,
            d->on.model->node_count - kn_composite_tied(d->on.model));
    for (int p = 0; p < d->on.model->def.probe_count; p++) fprintf(out, ", probe %s", d->on.model->def.probe[p].name);
    fprintf(out, ", on %s, meshes on %s; %s, %s\n", d->bus.url, d->mesh_bus.url,
            d->rt.fifo ? "SCHED_FIFO" : "normal priority", d->rt.locked ? "memory locked" : "memory not locked");
    tell_sets(out, &d->on.sets);
    if (d->estopped)
        fprintf(out, "kneadd: an emergency stop is in force: every force stays 0 until %sknead ctl recover\n",
                d->control ? "" : "a start with --control and ");
    if (*d->rt.missing) fprintf(out, "kneadd: not real time: %s\n", d->rt.missing);
    if (d->exchange.receiver.auth)
        fprintf(out, "kneadd: poses must be signed with the key, forces are signed with it\n");
    else if (d->exchange.receiver.peers > 0)
        fprintf(
            out,
            "kneadd: poses are accepted from %d addresses; this is no authentication, since an address can be forged\n",
            d->exchange.receiver.peers);
    if (d->on.model->isa == KN_ISA_BASE) fprintf(out, "kneadd: not real time: fused multiply-add in software\n");
    // The servo is already running and may lower the deadline, so print the deadline of the start.
    if (d->loop.priced > 0)
        fprintf(out, "kneadd: a step ends by its deadline of %" PRId64 " units of work\n", d->loop.priced);
    const kn_fixed_model *fixed = d->on.model->fixed;
    if (fixed && fixed->error > KN_FIXED_ERROR)
        fprintf(out,
                "kneadd: not accurate: %d passes of %d iterations leave %.2g %% of the force of a press unsolved, "
                "expected %g %% at most\n",
                d->on.model->def.solver.passes, d->on.model->def.solver.iterations, 100 * fixed->error,
                100 * KN_FIXED_ERROR);
    kn_fpga_counts circuit;
    if (kn_backend_fpga_counts(&d->on.backend, &circuit)) {
        fprintf(out,
                "kneadd: on a circuit: a tick without contact takes %.2g ms there and back, a state takes %.2g s "
                "to load; the queue holds %lld ticks\n",
                1e-6 * (double)d->rest_ns, 1e-9 * (double)circuit.load_ns, (long long)circuit.queue);
        if (d->rest_ns > REST_TICK_NS)
            fprintf(out,
                    "kneadd: expected %g ms at most: the circuit will fall behind, and its twin computes the object\n",
                    1e-6 * REST_TICK_NS);
    } else if (d->rest_ns > REST_TICK_NS)
        fprintf(
            out,
            "kneadd: not real time: a tick takes %.2g ms here without contact, expected %g ms at most; ticks will be "
            "missed and counted\n",
            1e-6 * (double)d->rest_ns, 1e-6 * REST_TICK_NS);
}

// Print the counters of the circuit. The circuit's final state is compared with its twin's.
static void tell_circuit(server *d)
{
    kn_fpga_counts n;
    kn_device_stats link;
    char why[KN_LINK_WHY];
    if (!kn_backend_fpga_counts(&d->on.backend, &n)) return;
    bool agrees = kn_backend_fpga_agrees(&d->on.backend, why, &link);
    kn_say("kneadd: %lld ticks on the circuit, each equal to its twin's; %lld by the twin alone; lost %lld times, "
           "different %lld, loaded %lld; at the end %s%s",
           (long long)n.on_circuit, (long long)n.shadowed, (long long)n.losses, (long long)n.different,
           (long long)n.loads, agrees ? "its state equals the twin's" : "", agrees ? "" : why);
    if (agrees)
        kn_say("kneadd: circuit answered in p50 %.0f us, p99 %.0f us; %lld requests sent again, %lld frames "
               "broken",
               1e-3 * (double)link.p50_ns, 1e-3 * (double)link.p99_ns, (long long)link.retries,
               (long long)(link.link.crc + link.link.coding));
}

// Print the totals of the run.
static void tell_summary(server *d, FILE *out)
{
    kn_account *a = &d->loop.account;
    const kn_receiver *r = &d->exchange.receiver;
    fprintf(out,
            "kneadd: stopped after %" PRId64 " ticks, %" PRId64 " missed (%" PRId64
            " explained by the machine), %" PRId64 " overruns; %" PRId64 " published, %" PRId64 " not queued\n",
            a->ticks, a->missed, kn_sentinel_judge(&d->sentinel, INT64_MAX), a->overruns,
            d->exchange.publisher.published, a->unpublished);
    const kn_sentinel *s = &d->sentinel;
    fprintf(out,
            "kneadd: woken 1 ms late or more %" PRId64 " times (%" PRId64 " explained), 0.5 ms %" PRId64 " (%" PRId64
            "); its sentinel %" PRId64 " and %" PRId64 " times in %" PRId64 " wakes\n",
            s->whole.count, s->whole.explained, s->half.count, s->half.explained, s->later, s->late, s->wakes);
    fprintf(out, "kneadd: %" PRId64 " datagrams: %" PRId64 " accepted", r->received, r->accepted);
    for (int i = 0; i < KN_REJECT_COUNT; i++)
        if (r->rejected[i]) fprintf(out, ", %" PRId64 " %s", r->rejected[i], kn_verdict_name((kn_verdict)i));
    fprintf(out, "; %" PRId64 " dropped by the kernel\n", kn_checkup_drops(&d->checkup));
    const kn_audit_news *audit = d->loop.audit ? kn_audit_read(d->loop.audit) : NULL;
    if (audit && audit->windows)
        fprintf(out,
                "kneadd: %" PRId64 " s audited, energy created in %" PRId64 " of them, %.3g mJ at most; at last %.3g mJ"
                " stored of %.3g mJ of work\n",
                audit->windows, audit->created, 1e3 * audit->most_j, 1e3 * kn_energy_sum(&audit->stored),
                1e3 * audit->work_j);
    kn_keeper *k = &d->keeper;
    if (k->store.dir >= 0)
        fprintf(out,
                "kneadd: %" PRId64 " snapshots, the last generation %" PRId64 ", %.1f ms at most; %" PRId64 " errors\n",
                k->saves, k->store.generation, 1e-3 * (double)k->most_us, k->errors);
    if (d->trace.lost) fprintf(out, "kneadd: %" PRId64 " rows of the trace lost\n", d->trace.lost);
    if (d->loop.phase.driven)
        fprintf(out,
                "kneadd: %" PRId64 " ticks with a tool to follow, in step with its poses in %" PRId64
                ", held back for one in %" PRId64 "\n",
                d->loop.phase.driven, d->loop.phase.followed, d->loop.phase.held);
}

// Print a text in whole lines, even if tell() writes a line in several pieces.
static void say_all(server *d, void (*tell)(server *, FILE *))
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    if (!out) return;
    tell(d, out);
    fclose(out);
    kn_say_lines(STDOUT_FILENO, text ? text : "");
    free(text);
}

// time after which a further signal ends the process, as in on_signal, ns; 0: no signal yet
static int64_t stopping_ns;
// set by a signal that came after the end of one life and before the next (life: see auth.h)
static volatile sig_atomic_t told_to_end;

// Signal handler from the end of one life to the start of the next, when libev's handlers are not installed.
static void end_at_once(int number)
{
    told_to_end = 1;
    if (kn_now_ns() - stopping_ns <= PATIENCE_NS) return;
    signal(number, SIG_DFL);
    raise(number);
}

// Wait at most 2 s for the worker to end. A request that hangs on a disk or a file must not prevent the final save.
static void join_worker(server *d)
{
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += 2;
    d->stuck = pthread_timedjoin_np(d->worker_thread, NULL, &until) != 0;
    if (d->stuck) kn_say("kneadd: stops without an answer to a request that takes too long");
}

// Stop all threads and save the object. Return false if the object could not be saved.
static bool stop_threads(server *d)
{
    stopping_ns = d->stop_ns ? d->stop_ns : kn_now_ns();
    for (int i = 0; i < SIGNALS; i++) { // libev's signal handlers have no effect any more, so replace them
        int number = d->signals[i].signum;
        ev_signal_stop(d->ev, &d->signals[i]);
        signal(number, end_at_once);
    }
    if (d->control) kn_control_end(d->control);
    atomic_store(&d->ending, true);
    atomic_store(&d->sentinel.stop, true);
    pthread_join(d->servo_thread, NULL);
    pthread_join(d->sentinel_thread, NULL);
    pthread_join(d->mesh_thread, NULL);
    if (d->control) {
        pthread_join(d->control_thread, NULL);
        join_worker(d);
        kn_control_drain(d->control);
    }
    // The keeper ends last, because control and worker may ask it for snapshots.
    atomic_store(&d->keeper.ending, true);
    if (d->keeper.store.dir >= 0) pthread_join(d->keeper_thread, NULL);
    bool kept = kn_keeper_finish(&d->keeper, &d->loop.servo, d->loop.clock.tick);
    pthread_barrier_destroy(&d->go);
    // Publish the final counters. Then read the remaining datagrams, so that the counts add up.
    tell_status(d);
    for (int i = 0; i < 1000 && (i == 0 || d->batch.count > 0); i++) take_datagrams(d, KN_BATCH);
    return kept;
}

// Release everything that one life (run) of the server has allocated. Parts that were never opened are skipped.
static void free_all(server *d)
{
    if (d->ev) ev_loop_destroy(d->ev);
    kn_sentinel_free(&d->sentinel);
    kn_loop_free(&d->loop);
    kn_skin_close(&d->skin);
    kn_publisher_close(&d->exchange.publisher);
    if (d->fd >= 0) close(d->fd);
    if (d->claim >= 0) close(d->claim);
    if (d->mesh_claim >= 0) close(d->mesh_claim);
    kn_control_close(d->control);
    kn_trace_close(&d->trace);
    kn_keeper_close(&d->keeper);
    kn_operator_free(&d->operator);
    kn_served_free(&d->on);
}

// Run one life of the server, from loading a scene to the end of its threads. Afterwards d->goes_on tells whether
// another life follows, with the scene d->next.
static int serve(server *d, const kn_daemon_def *def)
{
    char error[512];
    *d = (server){.claim = -1, .mesh_claim = -1, .fd = -1, .keeper.store.dir = -1};
    // Load the scene, then the snapshots. Bad input (exit code 2) is found before anything is opened.
    bool heard = choose_buses(d, def, error, sizeof error);
    int code = heard ? kn_served_load(&d->on, &def->object, error, sizeof error) : 2;
    if (code == 0)
        code = kn_keeper_open(&d->keeper, def->object.state_dir, d->on.scene, d->on.model, error, sizeof error);
    if (code == 0) {
        code = 3;
        if (open_buses(d, def, error, sizeof error) && open_control(d, def, error, sizeof error) &&
            kn_trace_open(&d->trace, def->trace, def->later, error, sizeof error) &&
            start_threads(d, def, error, sizeof error)) {
            say_all(d, tell_ready);
            sd_notifyf(0, "READY=1\nSTATUS=serving %s", d->on.scene->name);
            // A signal that came between two lives of the server still ends the process.
            if (told_to_end) stop(d);
            ev_run(d->ev, 0);
            code = stop_threads(d) ? 0 : 3;
            kn_rt_leave(&d->rt);
            tell_circuit(d);
            say_all(d, tell_summary);
            if (code)
                snprintf(error, sizeof error, "--state-dir %s: the last state of the object was not saved",
                         def->object.state_dir);
            if (!kn_trace_close(&d->trace)) {
                snprintf(error, sizeof error, "--trace %s: could not be written completely", def->trace);
                code = 3;
            }
        }
    }
    // print the error; for bad input (code 2) the line already begins with its file or URL
    if (code) kn_say("%s%s", code == 2 ? "" : "kneadd: ", error);
    return code;
}

int kn_daemon_run(const kn_daemon_def *def)
{
    static server d;
    static char name[sizeof d.next_name];
    kn_daemon_def life = *def;
    kn_safety_limits limits;
    // path and text of the scene being served; NULL in the first life (run) of the server
    char *path = NULL, *text = NULL;
    kn_say_start();
    for (;;) {
        int code = serve(&d, &life);
        bool goes_on = code == 0 && d.goes_on && !told_to_end;
        // return without a cleanup, because the worker thread is stuck and ends with the process
        if (d.stuck) return code;
        // take the safety limits of the first life, because no later life may exceed them
        if (d.on.base && !life.limits) {
            limits = d.on.base->limits;
            life.limits = &limits;
        }
        free(path);
        free(text);
        // The next life serves the scene that was loaded. An emergency stop that is in force is kept.
        memcpy(name, d.next_name, sizeof name);
        life.object.scene_path = path = d.next;
        life.object.text = text = d.next_text;
        life.object.name = name;
        life.later = true;
        life.estopped = kn_loop_estopped(&d.loop);
        free_all(&d);
        if (!goes_on) return free(path), free(text), code;
        kn_say_out("kneadd: loading %s", path);
        stopping_ns = kn_now_ns();
    }
}
