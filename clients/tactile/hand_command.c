// knead hand: connect a real device to a running kneadd. The device's thread is in bridge.h. This file finds where the
// tool begins, starts the bridge, and reports on both.
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/hand/tool_height.h"
#include "clients/hand/live_server.h"
#include "clients/tactile/hand_options.h"
#include "clients/tactile/paddle.h"
#include "server/clock.h"
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

static const int scene_wait_ms = 4000; // longest wait for KNEAD_SCENE, which comes every 1 s
static const int look_ms = 50;         // interval at which the state of the bridge is read
static const int answer_ms = 3000;     // time without a force after which the missing answer is reported
// Length of a tick from which on this process itself counts as having stood still.
static const int stalled_ms = 10;
// Shortest time between two reports of bad messages, so that they cannot fill a terminal.
static const int bad_ms = 10000;
static const double above_m = 0.02; // height of the tool above the object at the start
// Force limit used instead of that of the profile `bench`, which describes a virtual hand. It is the smallest limit of
// the common devices.
static const double cautious_n = 3.3;
static const double thinnest = 0.5; // fraction of the object's height that must remain under a tool steered by a puck

// State of the reports, so that each event is reported once.
typedef struct told {
    kn_bridge_news last; // state of the bridge at the last report
    // bad_ms, far_ms: times of the last reports of bad messages and of a slow link; answer_ms: time since when forces
    // are missing.
    int64_t bad_ms, far_ms, answer_ms;
    int64_t model_ms; // time since when contact messages are missing although forces arrive
    int64_t foreign;  // number of forces for other clients when a force of this session last arrived
    bool unanswered, modelless;
} told;

typedef struct hand {
    kn_hand_options opt;
    char probe[KN_NAME_MAX], error[512];
    kn_haptic_render_def render;
    kn_bridge bridge;
    union {
        kn_tactile base;
        kn_paddle paddle;
        kn_spacenav spacenav;
        kn_haply haply;
    } device;
    told told;
} hand;

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static int complain(int code, const char *what) { return kn_complain("hand", code, "%s", what); }

// Set up the renderer from the scene's device and the tool. Options of the command line take precedence.
static void mount(hand *h, const kn_scene *scene, const kn_probe_def *tool)
{
    kn_device_def *d = &h->render.device;
    const kn_hand_options *o = &h->opt;
    double extent_m[3], *at_m = d->position_m, axes[3][3];
    h->render = (kn_haptic_render_def){.device = scene->device,
                                       .coupling_n_m = tool->coupling_n_m,
                                       .coupling_n_s_m = tool->coupling_n_s_m,
                                       .radius_m = tool->radius_m,
                                       .level = tool->shape == KN_PROBE_PLATE,
                                       .guard_n_per_ms = scene->limits.guard_n_per_ms,
                                       .local = o->local,
                                       // A puck has no motors, so a late force can do no harm.
                                       .held = o->kind == KN_HAND_SPACENAV};
    kn_model_def_extent(&scene->model, extent_m);
    // Zero of the device: set by the option or by the scene, otherwise above the middle of the object.
    if (o->origin) memcpy(at_m, o->origin_m, sizeof d->position_m);
    else if (at_m[0] == 0.0 && at_m[1] == 0.0 && at_m[2] == 0.0)
        at_m[2] = extent_m[2] + kn_tool_height_m(tool) + above_m;
    // Apply the option --basis. Its text was checked when the options were parsed.
    if (o->basis) kn_mount_basis(d, o->basis, h->error, sizeof h->error);
    // The bench profile allows more force than real devices bear, so its limit is replaced.
    if (o->scale > 0.0) d->scale = o->scale;
    if (o->force_limit_n > 0.0) d->force_limit_n = o->force_limit_n;
    else if (!strcmp(d->name, "bench")) d->force_limit_n = cautious_n;
    kn_device_axes(d, axes);
    // Limit how deep a steered tool can go. With a tilted mount only its reach limits the tool, because the device's z
    // is not the height.
    bool upright = axes[2][2] > 0.999;
    h->opt.puck.floor_m = upright ? (thinnest * extent_m[2] + kn_tool_height_m(tool) - at_m[2]) / d->scale : -INFINITY;
}

static int use_scene(hand *h, const kn_scene *scene)
{
    const kn_probe_def *tool = kn_tool_height_choose_tool(&scene->model, h->opt.probe);
    if (!tool)
        return kn_complain("hand", KN_EXIT_USAGE, "%s has no probe %s", scene->name, h->opt.probe ? h->opt.probe : "");
    strcpy(h->probe, tool->name);
    mount(h, scene, tool);
    return KN_EXIT_OK;
}

// Find the tool, the object's height and the device's settings in the scene that kneadd serves.
static int look_at_scene(hand *h)
{
    kn_live_server live;
    if (!kn_live_server_open(&live, h->opt.lcm_url, h->opt.mesh_url, h->error, sizeof h->error))
        return complain(KN_EXIT_DEVICE, h->error);
    for (int64_t end_ms = kn_live_server_now_ms() + scene_wait_ms;
         !live.scene && kn_live_server_now_ms() < end_ms && !interrupted;)
        kn_live_server_listen(&live, look_ms);
    int code = live.scene          ? use_scene(h, live.scene)
               : *live.scene_error ? complain(KN_EXIT_USAGE, live.scene_error)
                                   : kn_complain("hand", KN_EXIT_DEVICE, "no KNEAD_SCENE for 4 s: %s",
                                                 kn_bus_client_why(KN_BUS_CLIENT_ASK));
    kn_live_server_close(&live);
    return code;
}

// ---- reports: each event once, bad messages at most every 10 s

// Report losses, arrivals and bad messages of the device.
static void tell_device(told *t, const kn_bridge_news *n, const char *name, int64_t now_ms)
{
    const kn_bridge_news *last = &t->last;
    if (n->losses > last->losses)
        fprintf(stderr, "knead hand: %s lost: %s; 0 N, tried again twice a second\n", name, n->why);
    if (n->arrivals > last->arrivals && last->arrivals > 0) fprintf(stderr, "knead hand: %s is back\n", name);
    if (n->bad <= last->bad || (last->bad > 0 && now_ms - t->bad_ms < bad_ms)) return;
    fprintf(stderr, "knead hand: %s: %s\n", name, n->bad_why);
    t->bad_ms = now_ms;
}

// Report stops of the renderer: the impulse guard, a link that is too slow, and missing contacts.
static void tell_stop(told *t, const kn_device_session *r, const char *then, int64_t now_ms)
{
    const kn_haptic_render *n = &r->render, *last = &t->last.session.render;
    if (n->reflexes > last->reflexes)
        fprintf(stderr, "knead hand: %s: %s\n", kn_haptic_render_why(KN_HAPTIC_RENDER_REFLEX), then);
    if (n->refusals > last->refusals && (last->refusals == 0 || now_ms - t->far_ms >= bad_ms)) {
        fprintf(stderr, "knead hand: %s\n", kn_haptic_render_why(KN_HAPTIC_RENDER_FAR));
        t->far_ms = now_ms;
    }
    // The local model needs contacts. Forces without contacts mean that kneadd does not send them.
    bool misses = n->def.local && r->heard > t->last.session.heard && n->model.taken == last->model.taken;
    if (!misses) t->model_ms = now_ms, t->modelless = false;
    if (t->modelless || now_ms - t->model_ms < answer_ms) return;
    t->modelless = true;
    fprintf(stderr, "knead hand: forces, but no contact for 3 s: 0 N; start kneadd with --local-model\n");
}

// Report watchdog trips, faults of kneadd, and missing forces.
static void tell_session(told *t, const kn_bridge_news *n, const char *name, int64_t now_ms)
{
    const kn_device_session *r = &n->session, *last = &t->last.session;
    const char *then = "0 N; 1.2 s of silence, then a new session";
    bool force = r->forces.trips > last->forces.trips, pose = r->poses.trips > last->poses.trips;
    // If the tick lasted 10 ms or more, this process itself stood still, so neither the device nor kneadd caused the
    // trip.
    if ((force || pose) && r->stalled_ms >= stalled_ms)
        fprintf(stderr, "knead hand: this program did not run for %d ms: %s\n", r->stalled_ms, then);
    else if (force) fprintf(stderr, "knead hand: no force from kneadd for 20 ms: %s\n", then);
    else if (pose && n->there) fprintf(stderr, "knead hand: nothing from the %s for 20 ms: %s\n", name, then);
    if (r->faults > last->faults) fprintf(stderr, "knead hand: kneadd's impulse guard has tripped: %s\n", then);
    tell_stop(t, r, then, now_ms);

    // Report a latched fault of kneadd once, with its remedy.
    if (r->flags & KN_FLAG_LATCHED && !(last->flags & KN_FLAG_LATCHED))
        fprintf(stderr, "knead hand: kneadd: %s: %s\n", kn_fault_name((kn_fault)r->fault),
                kn_fault_remedy((kn_fault)r->fault));
    // The loss of the device was already reported, so do not report missing forces.
    bool away = !n->there && n->arrivals > 0;
    if (r->heard > last->heard || away) t->answer_ms = now_ms, t->unanswered = false, t->foreign = r->foreign;
    if (t->unanswered || now_ms - t->answer_ms < answer_ms) return;
    t->unanswered = true;
    // Report the likely cause of missing forces: another client holds the tool, kneadd does not run, or the device has
    // not given a pose yet.
    fprintf(stderr, "knead hand: no force for 3 s: %s\n",
            r->foreign > t->foreign ? "another client holds the tool"
            : n->there              ? kn_bus_client_why("is kneadd running, and does it serve this probe?")
            : *n->state             ? n->state
                                    : "the device has not sent a position yet");
}

// Overwrite one terminal line with the tool's position, its force and the state of the link.
static void tell_tool(const kn_bridge_news *n)
{
    const double *x = n->position_m, *f = n->session.render.given_n;
    printf("\r%6.1f %6.1f %6.1f mm  %6.2f %6.2f %6.2f N  %-28s", 1e3 * x[0], 1e3 * x[1], 1e3 * x[2], f[0], f[1], f[2],
           !n->there                                        ? "no device"
           : n->session.mode == KN_SESSION_SILENT           ? "silent"
           : n->session.render.stop == KN_HAPTIC_RENDER_FAR ? "round trip above 5 ms: 0 N"
           : n->session.flags & KN_FLAG_REENGAGE_LIFT       ? "lift the tool"
           : n->session.flags & KN_FLAG_ENGAGED ? n->session.render.def.local ? "in the model, local" : "in the model"
                                                : n->state);
    fflush(stdout);
}

// Print the counters of the whole run.
static void summarise(const kn_bridge_news *n, const char *name, bool motors)
{
    const kn_device_session *t = &n->session;
    printf("knead hand: %" PRId64 " poses, %" PRId64 " forces, largest %.3g N, clamped %" PRId64 "\n", t->sent,
           t->heard, t->render.largest_n, t->render.clamped);
    if (motors)
        printf("knead hand: energy given to the hand %.3g mJ, damped because of it in %" PRId64
               " periods; impulse guard hit "
               "%" PRId64 ", tripped %" PRId64 "; round trip %.1f ms%s\n",
               1e3 * t->render.passivity.given_j, t->render.passivity.acted, t->render.guards, t->render.reflexes,
               1e3 * t->render.round_trip_s, t->render.refusals ? ", refused" : "");
    if (t->render.def.local)
        printf("knead hand: local model, %" PRId64 " messages in the last session, rejected %" PRId64 "\n",
               t->render.model.taken, t->render.model.refused);
    printf("knead hand: tripped by silence of kneadd %" PRId64 ", of the device %" PRId64 ", by faults %" PRId64
           "; forces for other clients %" PRId64 "\n",
           t->forces.trips, t->poses.trips, t->faults, t->foreign);
    printf("knead hand: %s: %" PRId64 " messages, bad %" PRId64 ", missing %" PRId64 ", lost %" PRId64
           ", there %" PRId64 ", late %" PRId64 " ms%s%s%s%s\n",
           name, n->messages, n->bad, n->lost, n->losses, n->arrivals, n->late, *n->bad_why ? "; last bad: " : "",
           n->bad_why, *n->state ? "; " : "", n->state);
}

// Report changes of the bridge's state until the end. Return KN_EXIT_DEVICE if the device would keep a force that this
// program no longer renews.
static int watch(hand *h)
{
    const char *name = h->device.base.name;
    bool follow = !h->opt.quiet && isatty(STDOUT_FILENO);
    int64_t begin_ms = kn_live_server_now_ms(), now_ms = begin_ms;
    h->told.answer_ms = begin_ms;
    while (!interrupted && (h->opt.seconds == 0.0 || 1e-3 * (double)(now_ms - begin_ms) < h->opt.seconds)) {
        kn_clock_sleep(kn_now_ns() + look_ms * 1000000);
        const kn_bridge_news *n = kn_bridge_latest(&h->bridge);
        now_ms = kn_live_server_now_ms();
        // The test of the device's own watchdog has failed, so it would not be safe to continue.
        if (n->watchdog == KN_OWN_MISSING)
            return kn_complain("hand", KN_EXIT_DEVICE,
                               "the %s kept its motor on during 100 ms of silence: if this program dies, the force "
                               "stays. --no-watchdog accepts that",
                               name);
        tell_session(&h->told, n, name, now_ms);
        tell_device(&h->told, n, name, now_ms);
        h->told.last = *n;
        if (follow) tell_tool(n);
    }
    if (follow) putchar('\n');
    return KN_EXIT_OK;
}

// Start the driver and the bridge, report their state until the end, and print the summary.
static int run(hand *h)
{
    const kn_device_def *d = &h->render.device;
    kn_bridge_def def = {.url = h->opt.lcm_url, .probe = h->probe, .render = h->render};
    uint32_t random;
    if (h->opt.kind == KN_HAND_PADDLE) kn_paddle_init(&h->device.paddle, h->opt.tty, h->opt.baud, h->opt.unwatched);
    else if (h->opt.kind == KN_HAND_SPACENAV) kn_spacenav_init(&h->device.spacenav, &h->opt.puck);
    else kn_haply_init(&h->device.haply, h->opt.host, h->opt.port, h->opt.device_id, h->opt.preset, h->opt.unwatched);
    if (getrandom(&random, sizeof random, 0) != sizeof random) return complain(KN_EXIT_DEVICE, "no random number");
    // The number of the first session is random except for its low 20 bits, which leave room for the numbers of later
    // sessions to count up.
    def.session = 1 + ((int64_t)random << 20);
    if (!kn_bridge_start(&h->bridge, &def, &h->device.base, h->error, sizeof h->error))
        return complain(KN_EXIT_DEVICE, h->error);
    if (kn_bridge_priority_error(&h->bridge))
        fprintf(stderr, "knead hand: no real-time priority (%s): poses and forces may be late\n",
                strerror(kn_bridge_priority_error(&h->bridge)));
    printf("knead hand: %s on probe %s as device %s, its zero at %g, %g, %g mm, at most %g N; untested on hardware\n",
           h->device.base.name, h->probe, d->name, 1e3 * d->position_m[0], 1e3 * d->position_m[1],
           1e3 * d->position_m[2], d->force_limit_n);
    fflush(stdout);
    int code = watch(h);
    kn_bridge_stop(&h->bridge);
    summarise(kn_bridge_latest(&h->bridge), h->device.base.name, h->device.base.give != NULL);
    return code;
}

int kn_hand_main(int argc, char **argv)
{
    struct sigaction stop = {.sa_handler = on_signal};
    hand *h = calloc(1, sizeof *h);
    if (!h) return complain(KN_EXIT_INTERNAL, "out of memory");
    int code = kn_hand_options_parse(&h->opt, argc, argv);
    if (code == KN_OPTIONS_READ) {
        // libspnav and sockets raise SIGPIPE when a device is gone. The bridge handles the loss.
        signal(SIGPIPE, SIG_IGN);
        sigaction(SIGINT, &stop, NULL);
        sigaction(SIGTERM, &stop, NULL);
        code = look_at_scene(h);
        if (code == KN_EXIT_OK && !interrupted) code = run(h);
    }
    free(h);
    return code;
}
