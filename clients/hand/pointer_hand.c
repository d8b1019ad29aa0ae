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
// turn_rad_s: speed at which a tool lies down or stands up. grip_m_s: sideways speed of a lying tool; at a higher speed
// its touch trips the impulse guard. open_m: largest way of a lying tool out of the object before it rises.
static const double turn_rad_s = 2.0, grip_m_s = 0.015, open_m = 0.02;
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
        else if (!p->wish.held && lifted(p) && p->tilt == 0.0) enter(p, KN_POINTER_HAND_ABSENT);
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

// Move the tool sideways towards at_m. The tool moves sideways only when it is lifted, in a press when it is below the
// surface (a stroke), or when a lying tool leaves the object (opens).
static void move_sideways(kn_pointer_hand *p, bool press, bool opens, double dt_s)
{
    double way[2], far_m, *v = p->point.velocity_m_s;
    for (int i = 0; i < 2; i++) way[i] = opens ? open_m * p->axis[i] : p->wish.at_m[i] - p->point.position_m[i];
    far_m = hypot(way[0], way[1]);
    bool down = press && p->point.position_m[2] < p->wish.touch_z_m, free = !down && !p->news.contact;
    bool moves = down || opens || lifted(p);
    double a_m_s2 = free ? sideways_m_s2 : object_m_s2, most_m_s = free ? sideways_m_s : stroke_m_s[p->flat];
    if (p->tilt > 0.0 && !free) most_m_s = grip_m_s;
    // Plan with half of the acceleration, so that the tool can keep up with the planned speed.
    double speed = moves ? fmin(most_m_s, braking(far_m, 0.5 * a_m_s2, 0.0)) : 0.0;
    for (int i = 0; i < 2; i++) {
        v[i] = toward(v[i], far_m > 0.0 ? speed * way[i] / far_m : 0.0, a_m_s2 * dt_s);
        if (far_m < 1e-5 && moves) p->point.position_m[i] = p->wish.at_m[i], v[i] = 0.0;
        p->point.position_m[i] += v[i] * dt_s;
    }
    p->opened_m = opens ? p->opened_m + dt_s * hypot(v[0], v[1]) : press || lifted(p) ? 0.0 : p->opened_m;
}

// Turn the tool towards the axis of the wish, above the object only. Return true if the tool has turned.
static bool turn(kn_pointer_hand *p, double dt_s)
{
    const bool lies = p->wish.pressed && (p->wish.axis[0] != 0.0 || p->wish.axis[1] != 0.0);
    if (lies && p->tilt == 0.0) memcpy(p->axis, p->wish.axis, sizeof p->axis);
    // A tool that lies in another direction stands up first.
    const double goal = lies && memcmp(p->axis, p->wish.axis, sizeof p->axis) == 0 ? M_PI_2 : 0.0;
    if (lifted(p)) p->tilt = toward(p->tilt, goal, turn_rad_s * dt_s);
    // The axis of the rotation is horizontal and perpendicular to the tool's axis.
    const double s = sin(0.5 * p->tilt), turned[4] = {cos(0.5 * p->tilt), -s * p->axis[1], s * p->axis[0], 0.0};
    memcpy(p->point.orientation_wxyz, turned, sizeof turned);
    return lies == (goal > 0.0) && fabs(p->tilt - goal) < 1e-9;
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
    // When poses were a few ms late, the force to the hand fades and returns. A lying tool stays meanwhile, so that it
    // does not drop the object.
    bool engaged = p->news.flags & (KN_FLAG_ENGAGED | (p->tilt > 0.0 ? KN_FLAG_RAMPING : 0));
    bool turned = turn(p, dt_s);
    bool press =
        p->mode == KN_POINTER_HAND_FOLLOW && p->wish.held && p->wish.pressed && !p->barred && engaged && over && turned;
    // A lying tool leaves the object along its axis, so that the object falls off, and then rises.
    bool opens = !press && p->tilt > 0.0 && p->news.contact && p->opened_m < open_m;
    double goal_m = press ? p->wish.touch_z_m - p->wish.depth_m : p->wish.hover_z_m;
    // The ground is the lowest height that the tool has reached in this press. The object has been pushed down to the
    // ground, so the tool needs to move slowly only below the ground.
    p->ground_m = press ? fmin(fmin(p->ground_m, p->wish.touch_z_m), x[2]) : INFINITY;
    move_sideways(p, press, opens, dt_s);
    if (press && x[2] > goal_m) move_down(p, goal_m, dt_s);
    else if (opens)
        x[2] += dt_s * (p->point.velocity_m_s[2] = toward(p->point.velocity_m_s[2], 0.0, object_m_s2 * dt_s));
    else move_up(p, goal_m, dt_s);
    p->news.depth_m = press && p->tilt == 0.0 ? fmax(0.0, p->wish.touch_z_m - x[2]) : 0.0;
    p->news.presses = press;
    p->news.there = press && p->wish.depth_m > 0.0 && fabs(x[2] - goal_m) < clear_m;
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
    p->news.press = wish->press;
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
// aside_m: distance from the object at which the tools of a grip come down. above_table_m: least distance of a lying
// tool from the table. steepest: largest slope of a line of sight that sees a side of the object.
static const double aside_m = 0.005, above_table_m = 1e-3, steepest = 2.0;
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

bool kn_pointer_hand_grip_begin(kn_pointer_hand_grip *g, const kn_mesh *mesh, const float sight[2][3])
{
    double low_m[2] = {INFINITY, INFINITY}, high_m[2] = {-INFINITY, -INFINITY}, line[2][3], ahead[3];
    for (int v = 0; v < mesh->vertex_count; v++)
        for (int i = 0; i < 2; i++) {
            low_m[i] = fmin(low_m[i], mesh->positions_m[3 * v + i]);
            high_m[i] = fmax(high_m[i], mesh->positions_m[3 * v + i]);
        }
    for (int i = 0; i < 2; i++) g->middle_m[i] = 0.5 * (low_m[i] + high_m[i]);
    for (int k = 0; k < 2; k++) {
        const double far = hypot(hypot((double)sight[k][0], (double)sight[k][1]), (double)sight[k][2]);
        for (int i = 0; i < 3; i++) line[k][i] = (double)sight[k][i] / far;
    }
    for (int i = 0; i < 3; i++) ahead[i] = line[0][i] + line[1][i];
    const double flat = hypot(ahead[0], ahead[1]);
    if (!(fabs(ahead[2]) < steepest * flat)) return false;
    const bool mirrored = line[0][1] * ahead[0] - line[0][0] * ahead[1] > line[1][1] * ahead[0] - line[1][0] * ahead[1];
    g->axis[0] = (mirrored ? ahead[1] : -ahead[1]) / flat;
    g->axis[1] = (mirrored ? -ahead[0] : ahead[0]) / flat;
    g->closes = false;
    g->lowest_m[0] = g->lowest_m[1] = 0;
    return true;
}

void kn_pointer_hand_grip_aim(const kn_pointer_hand_grip *g, const kn_pointer_hand_reach *const r[2],
                              const kn_mesh *mesh, const float eye_m[3], const float sight[2][3],
                              kn_pointer_hand_wish *const wish[2])
{
    const double *a = g->axis, eye[2] = {(double)eye_m[0] - g->middle_m[0], (double)eye_m[1] - g->middle_m[1]};
    const double tip_m[2] = {kn_tool_height_m(r[0]->tool), kn_tool_height_m(r[1]->tool)};
    // The object's width along the axis at rest, and its ends along the axis now, from the middle of the grip.
    const double width_m = fabs(a[0]) * r[0]->extent_m[0] + fabs(a[1]) * r[0]->extent_m[1];
    double low_m = INFINITY, high_m = -INFINITY, top_m = 0, side_m[2], z_m[2];
    for (int v = 0; v < mesh->vertex_count; v++) {
        const float *x = mesh->positions_m + 3 * v;
        const double s_m = a[0] * ((double)x[0] - g->middle_m[0]) + a[1] * ((double)x[1] - g->middle_m[1]);
        low_m = fmin(low_m, s_m), high_m = fmax(high_m, s_m), top_m = fmax(top_m, (double)x[2]);
    }
    for (int k = 0; k < 2; k++) {
        const double sx = (double)sight[k][0], sy = (double)sight[k][1];
        const double far = (eye[0] * a[1] - eye[1] * a[0]) / (sy * a[0] - sx * a[1]);
        side_m[k] = a[0] * (eye[0] + far * sx) + a[1] * (eye[1] + far * sy);
        z_m[k] = (double)eye_m[2] + far * (double)sight[k][2];
        if (!(far > 0) || !isfinite(side_m[k]) || !isfinite(z_m[k])) return;
        const double most_m = 0.5 * width_m + beside_m + tip_m[k];
        side_m[k] = fmin(fmax(side_m[k], -most_m), most_m);
    }
    if (g->closes) {
        const double lack_m = thinnest * width_m + tip_m[0] + tip_m[1] - (side_m[1] - side_m[0]);
        side_m[0] -= 0.5 * fmax(0, lack_m), side_m[1] += 0.5 * fmax(0, lack_m);
    } else side_m[0] = low_m - tip_m[0] - aside_m, side_m[1] = high_m + tip_m[1] + aside_m;
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 2; i++) {
            wish[k]->axis[i] = k ? a[i] : -a[i];
            wish[k]->at_m[i] = g->middle_m[i] + side_m[k] * a[i];
        }
        // The tools come down to a side of the object, so that they cannot close above it.
        const double most_m = g->closes ? top_m : top_m - tip_m[k],
                     least_m = fmax(tip_m[k] + above_table_m, g->lowest_m[k]);
        wish[k]->touch_z_m = wish[k]->flush_z_m = wish[k]->hover_z_m;
        wish[k]->depth_m = fmax(0, wish[k]->hover_z_m - fmax(fmin(z_m[k], most_m), least_m));
    }
}
