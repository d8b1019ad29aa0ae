#include "server/daemon.h"
#include "proto/knead_status_t.h"
#include "server/bus.h"
#include "server/control.h"
#include "server/exchange.h"
#include "server/health_report.h"
#include "server/keeper.h"
#include "server/operator.h"
#include "server/console.h"
#include <ev.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

// largest number of datagrams read per tick, that is, 256 000 a second; reading a datagram takes 1-2 us, so a flood of
// datagrams takes at most half of every millisecond
#define DATAGRAMS_PER_TICK 256
// time from the start of the threads to tick 0, ns; by then every thread has left the start barrier and sleeps
#define START_DELAY_NS 20000000
// A second signal ends the process at once if it arrives later than this after the first signal, ns. An earlier second
// signal is ignored, because timeout(1) and shells send the first signal twice. A normal stop takes 100 ms at most.
#define PATIENCE_NS 300000000
#define SIGNALS 3
#define BUFFER_BYTES (1 << 20) // receive buffer of the socket, bytes: about 1 300 poses
#define SCENE_S 1              // period of the scene message, s; a new client waits for a scene at most this long
// longest wait of the control thread for requests, ms; a stop is delayed by at most this time
#define CONTROL_TURN_MS 20

enum { SERVO, SENTINEL, MESH, CONTROL, WORKER, KEEPER, THREADS }; // threads beside the main thread

typedef struct server {
    kn_served_object on; // the scene being served
    kn_bus bus, mesh_bus;
    int claim, mesh_claim; // descriptors of the lock files that claim the bus and the mesh bus
    int fd;                // socket of the bus
    kn_exchange exchange;  // receiver and publisher; used by the main thread only
    kn_auth auth;          // key and life (run) of kneadd, used if a key file was given
    kn_datagram_batch batch;
    kn_skin skin;
    kn_control *control; // control socket; NULL: none
    kn_operator operator;
    kn_tick_trace trace;
    kn_loop loop;
    kn_keeper keeper;
    kn_sentinel sentinel;
    kn_rt rt;
    pthread_t thread[THREADS];
    pthread_barrier_t go; // threads wait here until their stacks are locked with all other memory
    // true: all threads of normal priority except the keeper must end; the keeper has a flag of its own
    atomic_bool ending;
    struct ev_loop *ev;
    ev_io readable;
    ev_async ticked, asked, leave, load;
    char *next, *next_text; // path and text of the scene to load next; used by the worker until all threads end
    char next_name[sizeof((kn_scene *)0)->name];
    atomic_bool goes_on; // true: serve the scene `next` after the present scene has ended
    bool stuck;          // true if the worker thread did not end in time
    ev_timer status_due, scene_due;
    ev_signal signals[SIGNALS];
    int64_t stop_ns; // time of the first SIGINT, SIGTERM or SIGHUP, ns; 0: none yet
    int budget;      // number of datagrams that may still be read before the next tick
    int32_t mode_told;
    kn_health_check check;
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
    if (d->budget > 0) return;
    ev_io_stop(ev, w); // pause reading until the next tick
    atomic_store_explicit(&d->loop.paused, true, memory_order_relaxed);
}

// Publish KNEAD_STATUS and KNEAD_HEALTH.
static void tell_status(server *d)
{
    kn_health health;
    kn_health_publication(&d->check, &health);
    d->mode_told = health.status.mode;
    kn_publisher_status(&d->exchange.publisher, &health.status);
    kn_publisher_health(&d->exchange.publisher, &health.more);
}

// Called when the servo has ticked (notify in loop.h). Publish the records, and allow datagrams to be read again.
// Publish the status if the mode has changed. End the main loop after the last tick.
static void on_ticked(struct ev_loop *ev, ev_async *w, int events)
{
    (void)events;
    server *d = w->data;
    bool done = kn_exchange_ticked(&d->exchange);
    atomic_store(&d->operator.told, d->exchange.told);
    d->budget = DATAGRAMS_PER_TICK;
    if (!ev_is_active(&d->readable)) ev_io_start(ev, &d->readable);
    atomic_store_explicit(&d->loop.paused, false, memory_order_relaxed);
    if (atomic_load_explicit(&d->loop.account.mode, memory_order_relaxed) != d->mode_told) tell_status(d);
    if (done) ev_break(ev, EVBREAK_ALL);
}

// Every second: publish the status, and report refused senders.
static void on_status_due(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)ev, (void)events;
    tell_status(w->data);
    kn_health_report_refusals(&((server *)w->data)->check);
}

static void on_scene_due(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    kn_publisher_scene(&d->exchange.publisher, kn_stamp_us());
}

// Ask the servo to ramp the forces to zero and stop. Tell systemd whether kneadd reloads a scene or ends.
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
    kn_health_now(&d->check, health);
    memcpy(health->force, d->exchange.force, sizeof health->force);
    kn_mailbox_post(&d->operator.health);
}

// An operator's command has requested the end: stop, and load no other scene.
static void on_leave(struct ev_loop *ev, ev_async *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    d->goes_on = false;
    stop(d);
}

// An operator's command has requested another scene: stop, and then serve the new scene.
static void on_load(struct ev_loop *ev, ev_async *w, int events)
{
    (void)ev, (void)events;
    server *d = w->data;
    // if an end has already been requested, ignore the request for another scene
    if (atomic_load(&d->loop.stop)) return;
    d->goes_on = true;
    stop(d);
}

// Ask the main thread to post a health report. The control thread runs ask(), goes_on() and leave().
static void ask(void *arg)
{
    server *d = arg;
    ev_async_send(d->ev, &d->asked);
}

// Keep the path and the checked text of the scene to load next, so that a later change of the file has no effect. Runs
// in the worker thread.
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
    // a second signal more than PATIENCE_NS after the first ends the process at once, as without a handler
    if (d->stop_ns && now_ns - d->stop_ns > PATIENCE_NS) {
        signal(w->signum, SIG_DFL);
        raise(w->signum);
    }
    if (!d->stop_ns) d->stop_ns = now_ns;
    stop(d);
}

// Wake the main thread. Runs in the servo thread: one write to an eventfd, or none while an earlier wake-up is still
// pending.
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

// The mesh thread: publish surface meshes. Once a second, report the counters of the real-time threads.
static void *mesh_main(void *arg)
{
    server *d = arg;
    pthread_barrier_wait(&d->go);
    const int64_t rest_ns = (d->skin.period_ticks - 1) * (int64_t)KN_PERIOD_NS;
    int64_t second_ns = 0;
    while (!atomic_load_explicit(&d->ending, memory_order_relaxed)) {
        if (kn_now_ns() - second_ns >= 1000000000) {
            second_ns = kn_now_ns();
            kn_skin_publish_topology(&d->skin, kn_stamp_us());
            kn_health_report_second(&d->check);
        }
        kn_tick_trace_drain(&d->trace);
        // After a published frame, sleep until just before the next frame is due, however long this frame took to
        // measure. Then look for a new frame every millisecond. A sleep of fixed length could make the thread late by a
        // whole frame period.
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

static const struct {
    const char *name;
    int priority;
    kn_rt_cpu cpu;
    void *(*run)(void *server);
} threads[THREADS] = {[SERVO] = {"servo", KN_RT_SERVO, KN_RT_CPU_SERVO, servo_main},
                      [SENTINEL] = {"sentinel", KN_RT_SENTINEL, KN_RT_CPU_SERVO, sentinel_main},
                      [MESH] = {"mesh", KN_RT_NORMAL, KN_RT_CPU_ANY, mesh_main},
                      [CONTROL] = {"control", KN_RT_NORMAL, KN_RT_CPU_ANY, control_main},
                      [WORKER] = {"worker", KN_RT_NORMAL, KN_RT_CPU_ANY, worker_main},
                      [KEEPER] = {"keeper", KN_RT_NORMAL, KN_RT_CPU_ANY, keeper_main}};

// Return whether this run of the server needs a thread: control and worker need a control socket, the keeper needs a
// directory of snapshots.
static bool needs(const server *d, int thread)
{
    if (thread == KEEPER) return d->keeper.store.dir >= 0;
    return d->control || (thread != CONTROL && thread != WORKER);
}

// --- start and stop ---

// Parse the two URLs, and load the key if a key file was given.
static bool choose_buses(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    // without --lcm-url, take the URL from the environment, as every LCM client does
    const char *url = def->lcm_url ? def->lcm_url : getenv("LCM_DEFAULT_URL");
    const char *own = def->lan ? KN_LCM_LAN_URL : KN_LCM_URL, *own_mesh = def->lan ? KN_MESH_LAN_URL : KN_MESH_URL;
    return kn_bus_parse(&d->bus, url && *url ? url : own, def->lan, error, error_size) &&
           kn_bus_parse(&d->mesh_bus, def->mesh_url ? def->mesh_url : own_mesh, def->lan, error, error_size) &&
           (!def->key || kn_auth_load(&d->auth, def->key, error, error_size));
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
    // Set up the exchange: receiver, publisher and mesh publisher, with the key if a key file was given.
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
        d->loop.servo.settings = &d->on.settings;
        d->loop.keeper = &d->keeper;
        kn_servo_begin(&d->loop.servo, d->on.settled);
        kn_keeper_start(&d->keeper, &d->loop.servo, &d->loop.orders);
        bool kept = d->keeper.store.dir >= 0 && kn_store_estopped(&d->keeper.store);
        bool estopped = def->estopped || kept;
        if (estopped) { // order an emergency stop, which tick 0 carries out and records as an event for the log
            kn_orders_give(&d->loop.orders, KN_ORDER_ESTOP, 0);
            atomic_store(&d->loop.account.mode, KNEAD_STATUS_T_MODE_ESTOP);
        }
        d->check = (kn_health_check){.served = &d->on,
                                     .loop = &d->loop,
                                     .exchange = x,
                                     .keeper = &d->keeper,
                                     .rt = &d->rt,
                                     .bus = &d->bus,
                                     .mesh_bus = &d->mesh_bus,
                                     .fd = d->fd,
                                     .estopped = estopped,
                                     .has_control = def->control,
                                     .tick_told = -1,
                                     .quality_told = d->on.scene->quality};
        return true;
    }
    return kn_refuse(error, error_size, "out of memory or file descriptors");
}

// Set up the operator, and open the control socket if --control was given.
static bool open_control(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    kn_operator_def on = {.served = &d->on,
                          .def = &def->object,
                          .limits = def->limits ? def->limits : &d->on.base->limits,
                          .loop = &d->loop,
                          .keeper = &d->keeper,
                          .rt = &d->rt,
                          .skin = &d->skin,
                          .ask = ask,
                          .goes_on = goes_on,
                          .stop = leave,
                          .load = load_next,
                          .arg = d};
    kn_operator_init(&d->operator, & on);
    kn_control_def control = kn_operator_control(&d->operator);
    if (def->control) d->control = kn_control_open(def->control, &control, error, error_size);
    return !def->control || d->control;
}

// Measure the object, create the threads, lock the memory and let the threads run.
static bool start_threads(server *d, const kn_daemon_def *def, char *error, size_t error_size)
{
    kn_served_object_help(&d->on);
    d->loop.servo.helper = d->on.helper;
    d->loop.deadline = kn_served_object_deadline(&d->on.backend, d->on.helper, d->on.model, d->on.scene->budget_s);
    // Enter real-time priority only now, because building a scene takes longer than LimitRTTIME allows a real-time
    // thread to run.
    kn_rt_enter(&d->rt, def->realtime);
    kn_helper_raise(d->on.helper, &d->rt);
    d->check.rest_ns = kn_served_object_measure(&d->on.backend, NULL);
    d->operator.served_ns = kn_served_object_measure(&d->on.backend, d->on.model);
    kn_servo_begin(&d->loop.servo, d->on.settled);
    d->loop.free = def->free;
    d->loop.notify = notify;
    d->loop.notify_arg = d;
    // Number of threads that meet at the barrier: the main thread, and the threads created below.
    unsigned count = 1;
    for (int i = 0; i < THREADS; i++) count += needs(d, i);
    pthread_barrier_init(&d->go, NULL, count);
    int failed = 0;
    for (int i = 0; i < THREADS && !failed; i++)
        if (needs(d, i))
            failed = kn_rt_thread(&d->rt, &d->thread[i], threads[i].name, threads[i].priority, threads[i].cpu,
                                  threads[i].run, d);
    // Lock the memory now that all stacks exist and no thread runs yet.
    if (!failed) kn_rt_lock_memory(&d->rt);
    // On failure, the threads that wait at the barrier end with the process.
    if (failed) return kn_refuse(error, error_size, "cannot start a thread: %s", strerror(failed));
    if (d->rt.mode == KN_RT_REQUIRE && *d->rt.missing)
        return kn_refuse(error, error_size, "not real time: %s", d->rt.missing);
    // Start the tick grids of servo and sentinel, then release the threads.
    const int64_t start_ns = d->check.start_ns = kn_now_ns() + START_DELAY_NS;
    kn_loop_start(&d->loop, start_ns);
    d->sentinel.beside = &d->loop.start_ns;
    d->sentinel.busy = &d->loop.busy;
    kn_clock_start(&d->sentinel.clock, start_ns + KN_SENTINEL_OFFSET_NS);
    d->budget = DATAGRAMS_PER_TICK;
    pthread_barrier_wait(&d->go);
    return true;
}

// Time at which the stop began, ns: the first signal, or the end of the previous life (run, see auth.h) if there was no
// signal. A signal that arrives more than PATIENCE_NS later ends the process at once.
static int64_t stopping_ns;
// set by a signal that arrived between the end of one life (run) of the server and the start of the next
static volatile sig_atomic_t told_to_end;

// Handle signals from the end of one life (run) of the server to the start of the next, when libev's handlers are not
// installed.
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
    d->stuck = pthread_timedjoin_np(d->thread[WORKER], NULL, &until) != 0;
    if (d->stuck) kn_console_err("kneadd: stopping without an answer to a control request that takes too long");
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
    for (int i = SERVO; i <= MESH; i++) pthread_join(d->thread[i], NULL);
    if (d->control) {
        pthread_join(d->thread[CONTROL], NULL);
        join_worker(d);
        kn_control_drain(d->control);
    }
    // The keeper ends last, because the control and worker threads may ask the keeper for snapshots.
    atomic_store(&d->keeper.ending, true);
    if (needs(d, KEEPER)) pthread_join(d->thread[KEEPER], NULL);
    bool kept = kn_keeper_finish(&d->keeper, &d->loop.servo, d->loop.clock.tick);
    pthread_barrier_destroy(&d->go);
    // Publish the status for the last time. Then read the remaining datagrams, so that the totals in the summary count
    // every datagram.
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
    kn_tick_trace_close(&d->trace);
    kn_keeper_close(&d->keeper);
    kn_operator_free(&d->operator);
    kn_served_object_free(&d->on);
}

// Run one life of the server, from loading a scene to the end of its threads. Afterwards d->goes_on tells whether
// another life follows, with the scene d->next.
static int serve(server *d, const kn_daemon_def *def)
{
    char error[512];
    *d = (server){.claim = -1, .mesh_claim = -1, .fd = -1, .keeper.store.dir = -1};
    // Load the scene, then open the snapshot directory. Bad input (exit code 2) is found before any bus is opened.
    bool heard = choose_buses(d, def, error, sizeof error);
    int code = heard ? kn_served_object_load(&d->on, &def->object, error, sizeof error) : 2;
    if (code == 0)
        code = kn_keeper_open(&d->keeper, def->object.state_dir, d->on.scene, d->on.model, error, sizeof error);
    if (code == 0) {
        code = 3;
        if (open_buses(d, def, error, sizeof error) && open_control(d, def, error, sizeof error) &&
            kn_tick_trace_open(&d->trace, def->trace, def->later, error, sizeof error) &&
            start_threads(d, def, error, sizeof error)) {
            kn_health_report_start(&d->check);
            sd_notifyf(0, "READY=1\nSTATUS=serving %s", d->on.scene->name);
            // A signal that arrived between two lives (runs) of the server still ends the process.
            if (told_to_end) stop(d);
            ev_run(d->ev, 0);
            code = stop_threads(d) ? 0 : 3;
            kn_rt_leave(&d->rt);
            kn_health_report_end(&d->check);
            if (code)
                snprintf(error, sizeof error, "--state-dir %s: the last state of the object was not saved",
                         def->object.state_dir);
            if (!kn_tick_trace_close(&d->trace)) {
                snprintf(error, sizeof error, "--trace %s: could not be written completely", def->trace);
                code = 3;
            }
        }
    }
    // print the error; for bad input (code 2) the line already begins with its file or URL
    if (code) kn_console_err("%s%s", code == 2 ? "" : "kneadd: ", error);
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
    kn_console_start();
    for (;;) {
        int code = serve(&d, &life);
        bool goes_on = code == 0 && d.goes_on && !told_to_end;
        // return without a cleanup, because the worker thread is stuck; the thread ends with the process
        if (d.stuck) return code;
        // take the safety limits of the first life (run), because no later life may exceed them
        if (d.on.base && !life.limits) {
            limits = d.on.base->limits;
            life.limits = &limits;
        }
        free(path);
        free(text);
        // The next life (run) serves the scene that was loaded. An emergency stop that is in force is kept.
        memcpy(name, d.next_name, sizeof name);
        life.object.scene_path = path = d.next;
        life.object.text = text = d.next_text;
        life.object.name = name;
        life.later = true;
        life.estopped = kn_loop_estopped(&d.loop);
        free_all(&d);
        if (!goes_on) return free(path), free(text), code;
        kn_console_out("kneadd: loading %s", path);
        stopping_ns = kn_now_ns();
    }
}
