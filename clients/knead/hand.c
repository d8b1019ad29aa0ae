#include "clients/knead/hand.h"
#include <assert.h>
#include <math.h>
#include <string.h>

// Longest wait until the server engages the tool; usually 200 ms of poses and 200 ms of ramp are needed.
static const int answer_ms = 3000;
static const int clear_ms = 1000; // time that the server has to clear a fault after the tool was lifted
// Time without poses between two attempts; the server ends a session after 1 s without poses.
static const int silence_ms = 1200;
// Return the record of the present attempt to play the path.
static kn_attempt *current(kn_hand *h) { return &h->attempt[h->tries - 1]; }

static void enter(kn_hand *h, kn_hand_mode mode)
{
    h->mode = mode;
    h->mode_ms = 0;
}

// Start an attempt to play the path: open a new session at the beginning of the path.
static void open_attempt(kn_hand *h)
{
    h->tries++;
    current(h)->session = h->def.session + h->tries - 1;
    h->force = (kn_hand_force){.session = current(h)->session, .tick = -1};
    h->engaged_n = 0.0;
    h->refusal = NULL;
    h->path_s = 0.0;
    h->piece = "engage";
    kn_path_at(h->def.path, 0.0, &h->point);
    kn_watchdog_rearm(&h->watchdog);
    enter(h, KN_HAND_ENGAGE);
}

void kn_hand_init(kn_hand *h, const kn_hand_def *def)
{
    memset(h, 0, sizeof *h);
    h->def = *def;
    if (h->def.tries <= 0 || h->def.tries > KN_HAND_TRIES) h->def.tries = KN_HAND_TRIES;
    kn_watchdog_init(&h->watchdog, h->def.hold_ms, h->def.zero_ms);
    open_attempt(h);
}

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static void give_up(kn_hand *h, kn_hand_trouble trouble)
{
    h->trouble = trouble;
    enter(h, KN_HAND_GAVE_UP);
}

// Record the cause of a trip and start the retreat from the present pose.
static void trip(kn_hand *h, int elapsed_ms)
{
    kn_path_point home;
    h->trip[h->trips++] = (kn_trip){
        .piece = h->piece,
        .time_s = h->path_s,
        .force_n = h->engaged_n,
        .refusal = h->refusal,
        .own = h->watchdog.tripped,
        .silent_ms = h->watchdog.silent_ms,
        .stalled_ms = elapsed_ms - 1,
        .fault = (kn_fault)h->force.fault,
    };
    // Plan the retreat: lift the tool first, then move it to the place where the path begins.
    kn_path_at(h->def.path, 0.0, &home);
    kn_path_retreat(&h->way_out, h->way_out_piece, &h->point, h->def.clear_z_m, &home);
    h->path_s = 0.0;
    enter(h, KN_HAND_RETREAT);
}

// Process a force message for the device, in every mode of the hand. A message resets the watchdog only if its tick is
// newer.
static void feel(kn_hand *h, const kn_hand_force *force, int elapsed_ms)
{
    bool fresh = force && force->session == current(h)->session && force->tick > h->force.tick;
    if (fresh) h->force = *force;
    if (fresh && (force->flags & KN_FLAG_ENGAGED)) h->engaged_n = norm(force->force_n);
    double factor = kn_watchdog_tick(&h->watchdog, fresh, elapsed_ms);
    // If messages stop, the watchdog reduces the factor of the last force to zero.
    for (int i = 0; i < 3; i++) h->given_n[i] = factor * h->force.force_n[i];
}

// Start the path when the server has engaged the tool. Give up if the server does not engage the tool in time.
static void engage(kn_hand *h)
{
    if (h->force.flags & KN_FLAG_ENGAGED) {
        current(h)->play_seq = current(h)->sent + 1;
        enter(h, KN_HAND_PLAY);
    } else if (h->mode_ms >= answer_ms) {
        // If the watchdog is armed, force messages have arrived: the server answers but has not engaged the tool.
        give_up(h, h->watchdog.armed ? KN_HAND_NOT_ENGAGED : KN_HAND_NO_ANSWER);
    }
}

// Wait until the tool is lifted and the server has had time to clear its fault.
static void retreat(kn_hand *h)
{
    bool latched = h->force.flags & KN_FLAG_LATCHED;
    double wait_ms = 1e3 * h->way_out.duration_s + (latched ? clear_ms : 0);
    if (h->mode_ms < wait_ms) return;
    h->trip[h->trips - 1].cleared = !h->watchdog.tripped && !latched;
    if (h->trips == h->def.tries) give_up(h, KN_HAND_SPOILT);
    else enter(h, KN_HAND_SILENT);
}

// Change the mode of the hand if necessary, before the pose of this millisecond is sent.
static void decide(kn_hand *h, int elapsed_ms)
{
    bool playing = h->mode == KN_HAND_ENGAGE || h->mode == KN_HAND_PLAY;
    bool latched = h->force.flags & KN_FLAG_LATCHED;
    if (playing && (h->watchdog.tripped || latched || h->refusal)) trip(h, elapsed_ms);
    if (h->mode == KN_HAND_ENGAGE) engage(h);
    else if (h->mode == KN_HAND_RETREAT) retreat(h);
    else if (h->mode == KN_HAND_SILENT && h->mode_ms >= silence_ms) open_attempt(h);
    if (h->mode == KN_HAND_PLAY && h->path_s > h->def.path->duration_s) enter(h, KN_HAND_DONE);
}

void kn_hand_refuse(kn_hand *h, const char *refusal, bool again)
{
    if (h->refusal || (h->mode != KN_HAND_ENGAGE && h->mode != KN_HAND_PLAY)) return;
    h->refusal = refusal;
    // If a further attempt is useless, make the present attempt the last one.
    if (!again) h->def.tries = h->tries;
}

void kn_hand_take_path(kn_hand *h, const kn_path *path)
{
    assert(h->mode == KN_HAND_SILENT);
    h->def.path = path;
}

// Fault injection: return true while poses are suppressed.
static bool dropping(kn_hand *h)
{
    bool drop = h->mode == KN_HAND_PLAY && h->tries == 1 && h->dropped_ms < h->def.drop_ms &&
                h->path_s >= 1e-3 * h->def.drop_at_ms;
    h->dropped_ms += drop;
    return drop;
}

kn_hand_out kn_hand_tick(kn_hand *h, const kn_hand_force *force, int elapsed_ms)
{
    feel(h, force, elapsed_ms);
    decide(h, elapsed_ms);
    h->mode_ms++;
    bool end = h->mode == KN_HAND_DONE || h->mode == KN_HAND_GAVE_UP;
    // Send no pose while the hand is silent, at the end, or during the gap of the fault injection.
    if (h->mode == KN_HAND_SILENT || end || dropping(h)) return (kn_hand_out){.end = end};
    // Advance on the path, unless the hand is still engaging: it then stays at the first point.
    if (h->mode != KN_HAND_ENGAGE) {
        const kn_path *path = h->mode == KN_HAND_PLAY ? h->def.path : &h->way_out;
        h->piece = kn_path_at(path, h->path_s, &h->point)->name;
        h->path_s += 1e-3;
    }
    return (kn_hand_out){.send = true, .session = current(h)->session, .seq = ++current(h)->sent, .point = h->point};
}
