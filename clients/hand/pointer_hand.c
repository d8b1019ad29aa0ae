#include "clients/hand/pointer_hand.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Largest vertical and sideways speeds of the tool in the air, like those of a calm hand.
static const double air_m_s = 0.15, sideways_m_s = 0.4;
static const double air_m_s2 = 3.0, sideways_m_s2 = 6.0;
static const double press_m_s[2] = {0.03, 0.01};   // speed of a press into the object: of a round tool, of a flat tool
static const double stroke_m_s[2] = {0.03, 0.004}; // sideways speed in the object: of a round tool, of a flat tool
// Speed at the first touch of the object: of a round tool, of a flat tool (see add_landing in tool_path.c).
static const double touch_m_s[2] = {0.03, 1e-4};
// Acceleration in the object: 0 to 1 cm/s in 50 ms. At this acceleration, the force of dough (1 kN s/m) rises by 0.2
// N/ms.
static const double object_m_s2 = 0.2;
// Speed of a flat tool from its first touch until it lies flat on the object.
static const double flushing_m_s = 5e-4;
// landing_m: distance to the object at which a flat tool begins to move slowly. landing_m_s2: deceleration of the tool
// over this distance. The tool takes one second for this last millimetre.
static const double landing_m = 1e-3, landing_m_s2 = 2e-3;
// clear_m: largest distance below the hover height at which the tool counts as lifted. there_m: largest sideways
// distance from the goal at which the tool counts as above its goal.
static const double clear_m = 1e-3, there_m = 2e-4;
// Time that kneadd gets to clear a fault after the tool is lifted. kneadd needs 200 ms of poses; the rest is a margin.
static const int clear_ms = 300;
static const int leaving_ms = 100; // time without poses in which the force fades and kneadd frees the tool

void kn_pointer_hand_init(kn_pointer_hand *p, kn_probe_shape shape, int64_t session)
{
    *p = (kn_pointer_hand){.flat = kn_tool_height_flat(shape), .session = session, .mode_ms = leaving_ms};
    p->point.orientation_wxyz[0] = 1.0;
    kn_watchdog_init(&p->watchdog, 0, 0);
}

static void enter(kn_pointer_hand *p, kn_pointer_hand_mode mode)
{
    p->mode = mode;
    p->mode_ms = 0;
}

// Begin a new session: reset the pose number, the newest force and the watchdog.
static void open_session(kn_pointer_hand *p)
{
    p->session++;
    p->seq = 0;
    p->asked_event = 0;
    p->force = (kn_hand_force){.session = p->session, .tick = -1};
    kn_watchdog_rearm(&p->watchdog);
}

// Check the newest force, advance the watchdog, and update p->news, the state for the caller.
static void feel(kn_pointer_hand *p, const kn_hand_force *force, int elapsed_ms)
{
    kn_pointer_hand_news *n = &p->news;
    bool sane = force && isfinite(force->force_n[0] + force->force_n[1] + force->force_n[2]);
    // Accept a force only if it is finite, belongs to this session and is newer than the last one. Accept no force
    // while no poses are sent.
    bool fresh = sane && force->session == p->session && force->tick > p->force.tick &&
                 p->mode != KN_POINTER_HAND_ABSENT && p->mode != KN_POINTER_HAND_SILENT;
    if (fresh) p->force = *force;
    // The watchdog fades the force while no new force arrives.
    double factor = kn_watchdog_tick(&p->watchdog, fresh, elapsed_ms), *f = p->force.force_n;
    // A force that answers pose asked_seq or a later pose also answers the wish that came with pose asked_seq.
    if (fresh && p->asked_event && force->seq >= p->asked_seq) {
        n->event = p->asked_event;
        n->tick = force->tick;
        p->asked_event = 0;
    }
    n->heard = p->watchdog.armed && p->watchdog.silent_ms < p->watchdog.zero_ms;
    n->flags = n->heard ? p->force.flags : 0;
    n->fault = n->heard ? p->force.fault : 0;
    n->contact = n->heard && p->force.contacts > 0;
    n->force_n = factor * sqrt(kn_dot(f, f));
}

// Return true if the tool is at its hover height.
static bool lifted(const kn_pointer_hand *p) { return p->point.position_m[2] >= p->wish.hover_z_m - clear_m; }

// Change the mode of the hand if necessary. pointer_hand.h has a drawing of the modes.
static void decide(kn_pointer_hand *p)
{
    bool trouble = p->watchdog.tripped || (p->force.flags & KN_FLAG_LATCHED);
    switch (p->mode) {
    case KN_POINTER_HAND_ABSENT:
        if (!p->wish.held || p->mode_ms < leaving_ms) break;
        open_session(p);
        enter(p, KN_POINTER_HAND_FOLLOW);
        break;
    // After a fault in a press, the tool cannot press again until the button is released.
    case KN_POINTER_HAND_FOLLOW:
        if (trouble) p->barred = p->wish.pressed, enter(p, KN_POINTER_HAND_LET_GO);
        else if (!p->wish.held && lifted(p)) enter(p, KN_POINTER_HAND_ABSENT);
        break;
    // Wait until the tool is lifted, and then until kneadd clears the fault. If kneadd does not clear the fault within
    // clear_ms, end the session.
    case KN_POINTER_HAND_LET_GO:
        if (!lifted(p)) p->mode_ms = 0;
        else if (!trouble) enter(p, KN_POINTER_HAND_FOLLOW);
        else if (p->mode_ms >= clear_ms) enter(p, KN_POINTER_HAND_SILENT);
        break;
    case KN_POINTER_HAND_SILENT:
        if (p->mode_ms < leaving_ms) break;
        open_session(p);
        enter(p, p->wish.held ? KN_POINTER_HAND_FOLLOW : KN_POINTER_HAND_ABSENT);
        break;
    }
    // After a stale wish (a wish that is too old) the tool does not press before the button is released.
    p->barred = (p->barred || p->wish.stale) && p->wish.pressed;
}

// Return the largest speed from which the tool can brake to the speed end_m_s within the distance way_m. a_m_s2:
// deceleration.
static double braking(double way_m, double a_m_s2, double end_m_s)
{
    return sqrt(end_m_s * end_m_s + 2.0 * a_m_s2 * fmax(0.0, way_m));
}

// Change `speed` towards the speed `wanted`, by `most` or less, and return the new speed.
static double toward(double speed, double wanted, double most)
{
    return speed + fmin(fmax(wanted - speed, -most), most);
}

// Move down towards goal_m: fast in the air, slower near the object, so that the touch is gentle, and at press speed
// inside the object.
static void move_down(kn_pointer_hand *p, double goal_m, double dt_s)
{
    double *z = &p->point.position_m[2], *v = &p->point.velocity_m_s[2], above_m = *z - p->ground_m;
    bool inside = above_m <= 0.0 || p->news.contact;
    // Slow down so that the tool comes to rest at the goal. Plan with half of the acceleration, so that the tool can
    // keep up with the planned speed.
    double speed = braking(*z - goal_m, 0.5 * object_m_s2, 0.0);
    if (inside) {
        // Use the press speed. A flat tool that touches the object only in part sinks slowly until it lies flat.
        speed = fmin(speed, p->flat && *z > p->wish.flush_z_m ? flushing_m_s : press_m_s[p->flat]);
    } else if (p->flat && above_m < landing_m) {
        // In the last millimetre above the object a flat tool brakes to its touch speed.
        speed = fmin(speed, braking(above_m, landing_m_s2, touch_m_s[1]));
    } else {
        // Higher above the object, brake in time. A round tool must reach its touch speed at the object. A flat tool
        // must reach, 1 mm above the object, the speed with which it starts the last millimetre.
        double end_m_s = p->flat ? braking(landing_m, landing_m_s2, touch_m_s[1]) : touch_m_s[0];
        speed = fmin(speed, fmin(air_m_s, braking(above_m - p->flat * landing_m, 0.5 * air_m_s2, end_m_s)));
    }
    *v = toward(*v, -speed, (inside ? object_m_s2 : air_m_s2) * dt_s);
    *z = fmax(*z + *v * dt_s, goal_m);
    if (*z == goal_m) *v = 0.0;
}

// Move up or down to the hover height. Inside the object the tool moves at the speed of a press.
static void move_up(kn_pointer_hand *p, double goal_m, double dt_s)
{
    double *z = &p->point.position_m[2], *v = &p->point.velocity_m_s[2], way_m = goal_m - *z;
    bool inside = p->news.contact;
    double most = inside ? press_m_s[p->flat] : air_m_s,
           speed = fmin(most, braking(fabs(way_m), 0.5 * object_m_s2, 0.0));
    *v = toward(*v, copysign(speed, way_m), (inside ? object_m_s2 : air_m_s2) * dt_s);
    // Set the tool exactly to its goal if it is slow and at most 10 um away.
    if (fabs(way_m) < 1e-5 && fabs(*v) < 1e-2) *z = goal_m, *v = 0.0;
    *z += *v * dt_s;
}

// Move the tool sideways towards at_m. The tool moves sideways only when it is lifted, or in a press when it is below
// the surface (a stroke).
static void move_sideways(kn_pointer_hand *p, bool press, double dt_s)
{
    double way[2], far_m, *v = p->point.velocity_m_s;
    for (int i = 0; i < 2; i++) way[i] = p->wish.at_m[i] - p->point.position_m[i];
    far_m = hypot(way[0], way[1]);
    bool down = press && p->point.position_m[2] < p->wish.touch_z_m, free = !down && !p->news.contact;
    bool moves = down || lifted(p);
    double a_m_s2 = free ? sideways_m_s2 : object_m_s2, most_m_s = free ? sideways_m_s : stroke_m_s[p->flat];
    // Plan with half of the acceleration, so that the tool can keep up with the planned speed.
    double speed = moves ? fmin(most_m_s, braking(far_m, 0.5 * a_m_s2, 0.0)) : 0.0;
    for (int i = 0; i < 2; i++) {
        v[i] = toward(v[i], far_m > 0.0 ? speed * way[i] / far_m : 0.0, a_m_s2 * dt_s);
        if (far_m < 1e-5 && moves) p->point.position_m[i] = p->wish.at_m[i], v[i] = 0.0;
        p->point.position_m[i] += v[i] * dt_s;
    }
}

// Compute the pose of this millisecond.
static void follow(kn_pointer_hand *p)
{
    const double dt_s = 1e-3; // one period per pose sent, so a stall of this process never causes a jump
    double *x = p->point.position_m;
    // The very first pose is at the hover height above the goal.
    if (!p->placed) memcpy(x, (double[]){p->wish.at_m[0], p->wish.at_m[1], p->wish.hover_z_m}, 3 * sizeof *x);
    p->placed = true;
    // A press begins only when the tool is above its goal.
    bool over = hypot(p->wish.at_m[0] - x[0], p->wish.at_m[1] - x[1]) < there_m || isfinite(p->ground_m);
    bool engaged = p->news.flags & KN_FLAG_ENGAGED;
    bool press = p->mode == KN_POINTER_HAND_FOLLOW && p->wish.held && p->wish.pressed && !p->barred && engaged && over;
    double goal_m = press ? p->wish.touch_z_m - p->wish.depth_m : p->wish.hover_z_m;
    // The ground is the lowest height that the tool has reached in this press. The object has been pushed down to the
    // ground, so the tool needs to move slowly only below the ground.
    p->ground_m = press ? fmin(fmin(p->ground_m, p->wish.touch_z_m), x[2]) : INFINITY;
    move_sideways(p, press, dt_s);
    if (press && x[2] > goal_m) move_down(p, goal_m, dt_s);
    else move_up(p, goal_m, dt_s);
    p->news.depth_m = press ? fmax(0.0, p->wish.touch_z_m - x[2]) : 0.0;
}

kn_hand_out kn_pointer_hand_tick(kn_pointer_hand *p, const kn_pointer_hand_wish *wish, const kn_hand_force *force,
                                 int elapsed_ms)
{
    // If the number of the press has changed, a new press begins. Forget the lowest height that the tool reached in the
    // previous press (ground_m). The new press is allowed even if the previous press was barred.
    if (wish->press != p->wish.press) p->ground_m = INFINITY, p->barred = false;
    p->wish = *wish;
    feel(p, force, elapsed_ms);
    decide(p);
    p->mode_ms += elapsed_ms;
    p->news.mode = p->mode;
    p->news.released = !p->barred;
    if (p->mode == KN_POINTER_HAND_ABSENT || p->mode == KN_POINTER_HAND_SILENT) return (kn_hand_out){.leaves = true};
    follow(p);
    p->seq++;
    // Store the number of the first pose that follows this wish. A force that answers this pose answers the wish.
    if (!p->asked_event && wish->event != p->news.event) p->asked_event = wish->event, p->asked_seq = p->seq;
    return (kn_hand_out){.send = true, .session = p->session, .seq = p->seq, .point = p->point};
}

static const double hover_m = 0.004; // height of the hovering tool above the highest point of the object
// When the pointer is outside the object, the tool follows it up to this distance from the object's edge.
static const double beside_m = 0.02;
static const double uneven_m = 2e-3; // largest unevenness of the top that a flat tool levels slowly before a press
// Fraction of the object's height that must remain under the tool, because thinner cells turn inside out.
static const double thinnest = 0.5;

bool kn_pointer_hand_reach_open(kn_pointer_hand_reach *r, const kn_model_def *def, const kn_probe_def *tool)
{
    *r = (kn_pointer_hand_reach){.def = def, .tool = tool};
    r->top = kn_tool_height_top(def, &r->vertices);
    kn_model_def_extent(def, r->extent_m);
    return r->top != NULL;
}

void kn_pointer_hand_reach_close(kn_pointer_hand_reach *r)
{
    free(r->top);
    memset(r, 0, sizeof *r);
}

bool kn_pointer_hand_reach_fits(const kn_pointer_hand_reach *r, const kn_mesh *mesh)
{
    return mesh->whole && r->top && mesh->vertex_count == r->vertices;
}

void kn_pointer_hand_reach_hover(const kn_pointer_hand_reach *r, const kn_mesh *mesh, kn_pointer_hand_wish *wish)
{
    double highest_m = 0;
    for (int v = 0; v < mesh->vertex_count; v++) highest_m = fmax(highest_m, mesh->positions_m[3 * v + 2]);
    wish->hover_z_m = highest_m + kn_tool_height_m(r->tool) + hover_m;
}

void kn_pointer_hand_reach_aim(const kn_pointer_hand_reach *r, const float eye_m[3], const float sight[3],
                               kn_pointer_hand_wish *wish)
{
    // Distance to the plane of the top along the line, in lengths of `sight`. Not finite: the line is parallel to it.
    const double far = (r->extent_m[2] - (double)eye_m[2]) / (double)sight[2];
    if (!(far > 0) || !isfinite(far)) return;
    // Keep the point under the pointer near the object.
    for (int i = 0; i < 2; i++) {
        double most_m = 0.5 * r->extent_m[i] + beside_m;
        wish->at_m[i] = fmin(fmax((double)eye_m[i] + far * (double)sight[i], -most_m), most_m);
    }
}

bool kn_pointer_hand_reach_touch(const kn_pointer_hand_reach *r, const kn_mesh *mesh, kn_pointer_hand_wish *wish)
{
    if (!kn_tool_height_touch(mesh, r->top, r->def->spacing_m, r->tool, wish->at_m[0], wish->at_m[1], &wish->touch_z_m,
                              &wish->flush_z_m))
        return false;
    wish->flush_z_m = fmax(wish->flush_z_m, wish->touch_z_m - uneven_m);
    return true;
}

double kn_pointer_hand_reach_deepest(const kn_pointer_hand_reach *r, const kn_pointer_hand_wish *wish)
{
    double from_m = wish->pressed ? wish->touch_z_m - kn_tool_height_m(r->tool) : r->extent_m[2];
    // A round tool must not sink deeper than its radius.
    double most_m = fmax(0, from_m - thinnest * r->extent_m[2]);
    return kn_tool_height_flat(r->tool->shape) ? most_m : fmin(most_m, kn_tool_height_m(r->tool));
}
