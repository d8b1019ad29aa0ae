#include "core/contact_model.h"
#include <math.h>
#include <string.h>

#define LEAK_S 0.050         // time constant with which the surface moves to the device while no message arrives
#define LEAK_N_PER_S 16.0    // fastest change of force during this fade; a faster change would feel like a jump
#define RETURN_M_PER_S 0.020 // speed of the surface while the force returns: the power is at most |F| times this speed
#define THERE_M 5e-6         // least depth of the device in a surface that counts as contact
// time after which a stale contact is dropped, ten times LEAK_S; if kept longer, the contact would only drag a hand in
// free air
#define FORGET_S 0.5
#define FELT_N 0.02  // least force that the hand feels; it is below the resolution of desktop devices
#define HOLD_S 0.003 // time without a pose of this client after which the force fades; the same as in the server
#define FADE_S 0.017
#define RAMP_S 0.200
#define LAW_N 0.02           // smallest force at which c2 is stored
#define LAW_STEP 1.189207115 // ratio of successive forces at which c2 is stored, 2^(1/4); the largest force is 17 N
#define FAR_M 0.1            // a contact farther than this from the client's own pose is refused
#define POSE_GAP_S 0.0005    // least time between two stored poses
#define SWEEPS 12            // Gauss-Seidel sweeps over several units; a single unit is solved at once

// --- vectors --------------------------------------------------------------------------------------------------------

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static double norm(const double v[3]) { return sqrt(dot(v, v)); }

static void add(double v[3], double share, const double w[3])
{
    for (int i = 0; i < 3; i++) v[i] += share * w[i];
}

static void shorten(double v[3], double limit)
{
    double size = norm(v);
    for (int i = 0; i < 3 && size > limit; i++) v[i] *= limit / size;
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

// Compute the rotation vector from one orientation to another (unit quaternions), the short way round.
static void turn_between(const double from[4], const double to[4], double turn[3])
{
    double w = to[0] * from[0] + to[1] * from[1] + to[2] * from[2] + to[3] * from[3], d[3];
    for (int i = 1; i < 4; i++) d[i - 1] = from[0] * to[i] - to[0] * from[i];
    d[0] += to[3] * from[2] - to[2] * from[3];
    d[1] += to[1] * from[3] - to[3] * from[1];
    d[2] += to[2] * from[1] - to[1] * from[2];
    double sine = norm(d), scale = sine > 1e-12 ? 2.0 * atan2(sine, fabs(w)) / sine : 2.0;
    for (int i = 0; i < 3; i++) turn[i] = (w < 0.0 ? -scale : scale) * d[i];
}

static bool finite3(const double v[3]) { return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]); }
static double clip(double v, double least, double most) { return fmin(fmax(v, least), most); }
static double positive_or(double v, double otherwise) { return v > 0.0 ? v : otherwise; }

// --- damping c2 as a function of the force ---------------------------------------------------------------------------

// Return the index of a force in the array of c2. A unit of a message contains c2 at one force; c2 at other forces
// comes from earlier messages.
static int bin_of(double force_n)
{
    return (int)clip(floor(0.5 + log(fmax(force_n, LAW_N) / LAW_N) / log(LAW_STEP)), 0, KN_CONTACT_LAW - 1);
}

// Fill in the flow rate force/c2 at every force of the law. Between two forces with a received c2, ln c2 is
// interpolated. Below the smallest and above the largest of these forces, c2 is constant. The flow rate never falls as
// the force rises.
static void fill(const double c2[KN_CONTACT_LAW], double flow_m_s[KN_CONTACT_LAW])
{
    double at_n = LAW_N, least = 0.0;
    for (int i = 0, low = -1, high = -1; i < KN_CONTACT_LAW; i++, at_n *= LAW_STEP) {
        if (c2[i] > 0.0) low = i;
        while (high < i && high < KN_CONTACT_LAW) high++;
        while (high < KN_CONTACT_LAW && !(c2[high] > 0.0)) high++;
        double below = low >= 0 ? c2[low] : c2[high], above = high < KN_CONTACT_LAW ? c2[high] : below;
        double share = low >= 0 && high > low ? (double)(i - low) / (high - low) : 0.0;
        least = flow_m_s[i] = fmax(least, at_n / (below * (share > 0.0 ? pow(above / below, share) : 1.0)));
    }
}

// Return c2 at a force, from the flow rate interpolated between the law's forces.
static double c2_of(const double law_m_s[KN_CONTACT_LAW], double force_n)
{
    double at_n = LAW_N, below_n = 0.0, below = 0.0;
    int i = 0;
    for (; i < KN_CONTACT_LAW - 1 && at_n < force_n; i++, at_n *= LAW_STEP) {
        below_n = at_n;
        below = law_m_s[i];
    }
    if (force_n <= LAW_N || force_n >= at_n) return at_n / law_m_s[i];
    return force_n / (below + (law_m_s[i] - below) * (force_n - below_n) / (at_n - below_n));
}

// Return the force f that solves p f + flow(f)/thick = rate, where flow(f) is the flow rate of the law law_m_s. `p`:
// compliance; `thick`: factor on the law's c2. Store flow(f)/thick in *flow_m_s.
static double root(const double law_m_s[KN_CONTACT_LAW], double thick, double p, double rate, double *flow_m_s)
{
    // find the segment between two forces of the law that contains the root, then interpolate
    double below_n = 0.0, below = 0.0, at_n = LAW_N, at = p * LAW_N + law_m_s[0] / thick;
    for (int i = 1; i < KN_CONTACT_LAW && at < rate; i++) {
        below_n = at_n;
        below = at;
        at_n *= LAW_STEP;
        at = p * at_n + law_m_s[i] / thick;
    }
    // beyond the largest stored force the flow is proportional to the force
    if (at < rate) below_n = below = 0.0;
    double force_n = below_n + (at_n - below_n) * fmax(0.0, rate - below) / (at - below);
    *flow_m_s = fmax(0.0, rate - p * force_n);
    return force_n;
}

// --- the contact: a proxy and up to 8 units -------------------------------------------------------------------------

// Force on the proxy, torque on the proxy about its position, and the proxy's compliance.
typedef struct load {
    double force_n[3], torque_n_m[3];
    // g: resistance G = b_vc + dt k_vc of the coupling to a velocity of the proxy [N s/m]. soft: angular velocity of
    // the proxy per torque, 1/(l^2 G); 0 if the proxy turns as the device does.
    double g, soft;
} load;

// Add to the load a share of a force. The force acts at the lever arm arm_m.
static void press(load *all, double share, const double force_n[3], const double arm_m[3])
{
    double torque[3];
    cross(arm_m, force_n, torque);
    add(all->force_n, share, force_n);
    add(all->torque_n_m, share, torque);
}

// Return the distance of the proxy from a surface along its normal, at the arm of its unit.
static double gap_of(const kn_contact_body *b, const kn_contact_plane *u)
{
    return dot(u->normal, b->proxy_m) + dot(u->lever_m, b->turn) - u->level_m;
}

// Compute the force of one unit that balances the coupling and the forces of the other units. Its normal part keeps the
// proxy outside the surface, or is zero if the proxy does not touch. Its tangential part holds the proxy in its place
// on the surface, or is mu times the normal part if the proxy slides.
static void meet(const kn_contact_body *b, kn_contact_plane *u, const load *others, double dt)
{
    double a = u->c1 + dt * u->k1, g = others->g, along = dot(u->normal, others->force_n), flow_m_s, across[3], way[3];
    // along the normal: compliance p_n, and the rate rate_n at which the proxy would enter the surface
    double p = 1.0 / g + 1.0 / a, turning = others->soft * dot(u->lever_m, others->torque_n_m);
    double p_n = p + others->soft * dot(u->lever_m, u->lever_m) + u->give_m_n / dt;
    double rate_n = u->h_n / a - along / g - turning - (gap_of(b, u) - u->give_m_n * u->t_n) / dt;
    double t = root(b->law_m_s, u->thick, p_n, rate_n, &flow_m_s);
    if (flow_m_s > 0.0) u->c2 = t / flow_m_s;
    // tangential: the force that stops the proxy on the surface, shortened to the friction cone
    cross(others->torque_n_m, u->arm_m, way);
    // s: tangential compliance. The effect of the arm depends on the direction; |arm|^2 is its upper limit and is used
    // for all directions.
    double s = p + 1.0 / u->c2 + others->soft * dot(u->arm_m, u->arm_m);
    for (int i = 0; i < 3; i++) {
        double rate = (others->force_n[i] - along * u->normal[i]) / g + others->soft * way[i];
        across[i] = (u->shear_n[i] / a - rate) / s;
    }
    add(across, -dot(u->normal, across), u->normal);
    shorten(across, u->mu * t);
    for (int i = 0; i < 3; i++) u->force_n[i] = t * u->normal[i] + across[i];
}

// Advance the surface and the back stresses of a unit by one step under the force on the unit.
static void yield(kn_contact_plane *u, double dt)
{
    double a = u->c1 + dt * u->k1, t = dot(u->normal, u->force_n);
    u->level_m -= dt * ((t - u->h_n) / a + t / u->c2) + u->give_m_n * (t - u->t_n);
    u->t_n = t;
    u->h_n += dt * u->k1 * (t - u->h_n) / a;
    for (int i = 0; i < 3; i++) {
        double across = u->force_n[i] - t * u->normal[i];
        u->shear_n[i] += dt * u->k1 * (across - u->shear_n[i]) / a;
    }
}

static void sum_up(kn_contact_body *b)
{
    load all = {.g = 0.0};
    for (int c = 0; c < b->count; c++) press(&all, 1.0, b->plane[c].force_n, b->plane[c].arm_m);
    memcpy(b->force_n, all.force_n, sizeof b->force_n);
    memcpy(b->torque_n_m, all.torque_n_m, sizeof b->torque_n_m);
}

// Take one backward Euler step with the device at position x and velocity v. `turn`: rotation of the device since the
// message.
static void advance(kn_contact_body *b, const double x[3], const double v[3], const double turn[3], double dt)
{
    double l2 = b->arm_m * b->arm_m;
    load all = {.g = b->b + dt * b->k};
    all.soft = b->rigid ? 0.0 : 1.0 / (l2 * all.g);
    if (b->rigid) memcpy(b->turn, turn, sizeof b->turn);
    // load of the coupling on the proxy, with the forces of the last step as a first guess
    for (int i = 0; i < 3; i++) {
        all.force_n[i] = b->k * (x[i] - b->proxy_m[i]) + b->b * v[i];
        all.torque_n_m[i] = l2 * b->k * (turn[i] - b->turn[i]);
    }
    for (int c = 0; c < b->count; c++) press(&all, 1.0, b->plane[c].force_n, b->plane[c].arm_m);
    // Gauss-Seidel: subtract one unit's force from the load, solve for this force, add the new force
    for (int sweep = 0; sweep < (b->count > 1 ? SWEEPS : 1); sweep++)
        for (int c = 0; c < b->count; c++) {
            kn_contact_plane *u = &b->plane[c];
            press(&all, -1.0, u->force_n, u->arm_m);
            meet(b, u, &all, dt);
            press(&all, 1.0, u->force_n, u->arm_m);
        }
    // move the surfaces and the proxy by these forces
    sum_up(b);
    for (int c = 0; c < b->count; c++) yield(&b->plane[c], dt);
    add(b->proxy_m, dt / all.g, all.force_n);
    add(b->turn, dt * all.soft, all.torque_n_m);
}

// Return the level to which a surface would rise without load. Its springs recover; its dampers do not.
static double rest_of(const kn_contact_plane *u) { return u->k1 > 0.0 ? u->level_m + u->h_n / u->k1 : u->level_m; }

static bool touches(const kn_contact_body *b, const kn_contact_plane *u) { return gap_of(b, u) <= 1e-9; }

// Return the depth of the device below the surfaces that touch the proxy, measured from their levels without load. If
// several surfaces touch, return the largest depth.
static double depth_of(const kn_contact_body *b, const double x[3], const double turn[3])
{
    double depth_m = 0.0;
    for (int c = 0; c < b->count; c++) {
        const kn_contact_plane *u = &b->plane[c];
        if (touches(b, u)) depth_m = fmax(depth_m, rest_of(u) - dot(u->normal, x) - dot(u->lever_m, turn));
    }
    return depth_m;
}

// Scale the contact by a share in [0, 1]. Forces, back stresses and the coupling's stretch change together, so that the
// contact still solves its own equations. Surfaces under load sink with the proxy towards the device.
static void scale(kn_contact_body *b, const double x[3], const double turn[3], double share)
{
    kn_contact_body was = *b;
    for (int i = 0; i < 3; i++) {
        b->proxy_m[i] = x[i] + share * (b->proxy_m[i] - x[i]);
        b->turn[i] = turn[i] + share * (b->turn[i] - turn[i]);
        b->force_n[i] *= share;
        b->torque_n_m[i] *= share;
    }
    for (int c = 0; c < b->count; c++) {
        kn_contact_plane *u = &b->plane[c];
        double gap_m = gap_of(b, u);
        // a surface that touched the proxy stays in touch, and no surface ends up above the proxy
        if (touches(&was, u) || gap_m < 0.0) u->level_m += gap_m;
        u->h_n *= share;
        u->t_n *= share;
        for (int i = 0; i < 3; i++) {
            u->shear_n[i] *= share;
            u->force_n[i] *= share;
        }
    }
}

// --- messages -------------------------------------------------------------------------------------------------------

// Return true if all numbers of a message are finite, the indices are valid, and the normal is a unit vector.
static bool sane(const kn_contact_unit *u)
{
    double numbers = u->force_n + u->a_n_s_per_m + u->h_n + u->c2_n_s_per_m + u->k1_n_per_m + u->k_vc_n_per_m +
                     u->b_vc_n_s_per_m + u->friction + u->valid_ms;
    if (u->contact_count < 0 || u->contact_count > KN_CONTACT_UNITS) return false;
    if (u->contact_count == 0) return isfinite(u->valid_ms);
    if (u->contact_index < 0 || u->contact_index >= u->contact_count) return false;
    return isfinite(numbers) && finite3(u->proxy_m) && finite3(u->normal) && finite3(u->friction_anchor_m) &&
           fabs(norm(u->normal) - 1.0) < 1e-3;
}

// Return the index of the newest stored pose that is not newer than `seq`, counted from the first pose ever, or -1.
static int64_t find_pose(const kn_contact_model *m, int64_t seq)
{
    int64_t oldest = m->poses > KN_CONTACT_REPLAY ? m->poses - KN_CONTACT_REPLAY : 0;
    for (int64_t i = m->poses - 1; i >= oldest; i--)
        if (m->pose[i % KN_CONTACT_REPLAY].seq <= seq) return i;
    return -1;
}

// Set the plane `u` from a unit of a message. Clip every number to its range.
static void set_plane(const kn_contact_model *m, const kn_contact_body *b, const kn_contact_unit *from,
                      kn_contact_plane *u)
{
    double size = norm(from->normal), dt = m->def.server_period_s;
    for (int i = 0; i < 3; i++) u->normal[i] = from->normal[i] / size;
    u->k1 = clip(from->k1_n_per_m, 0.0, 2.0 * b->k);
    // the A of a message is c1 + dt k1 for the server's dt; store c1, so that the client can use its own dt
    u->c1 = fmax(clip(from->a_n_s_per_m, 0.1, 1e4) - dt * u->k1, 1e-3 * b->b);
    u->c2 = clip(from->c2_n_s_per_m, 10.0, 1e5);
    // thick: ratio of the message's c2 to the stored law's c2 at the message's force
    u->thick = u->c2 / c2_of(b->law_m_s, clip(from->force_n, 0.0, 1e3));
    u->h_n = clip(from->h_n, -u->k1 * FAR_M, u->k1 * FAR_M);
    u->mu = clip(from->friction, 0.0, 3.0);
    for (int i = 0; i < 3; i++) u->force_n[i] = clip(from->force_n, 0.0, 1e3) * u->normal[i];
}

// Reduce the elastic force of a unit if this device's coupling is softer than the server's, or if the server's tool is
// rigid. With a softer coupling, the same depth of the device gives less elastic force. The unreduced force, a round
// trip late, would feed energy to the hand. The viscous part of the force needs no reduction, because the message is
// valid for a limited time only. `theirs`: compliance of the server's coupling.
static void soften(const kn_contact_body *b, double theirs, kn_contact_plane *u)
{
    double t = dot(u->normal, u->force_n), k = b->k / (1.0 + b->k * u->give_m_n);
    double share = fmin(1.0, k * (1.0 + theirs * u->k1) / (k + u->k1));
    for (int i = 0; i < 3; i++) u->force_n[i] -= (1.0 - share) * clip(u->h_n, 0.0, t) * u->normal[i];
    u->h_n *= share;
    u->t_n = dot(u->normal, u->force_n);
}

static double soft_of(const kn_contact_unit *unit) { return unit->k_vc_n_per_m > 0.0 ? 1.0 / unit->k_vc_n_per_m : 0.0; }

// Choose this device's coupling and the foundation of each unit for a message. The server has computed the message's
// forces with the coupling k_vc. If the message has one unit, this device's coupling gets the same k_vc, but at most
// m->def.stiffness_n_m, and the unit has no foundation. If the message has several units, this device's coupling gets
// m->def.stiffness_n_m. A unit's foundation then adds the compliance by which the unit's k_vc is softer than this
// coupling. Return the compliance of the server's coupling.
static double set_coupling(const kn_contact_model *m, const kn_contact_unit *unit, kn_contact_body *b)
{
    // use no coupling stiffer than this device's own, because the device would not be stable
    const double most_n_m = m->def.stiffness_n_m, most_n_s_m = m->def.damping_n_s_m;
    double theirs = soft_of(unit), k = positive_or(unit->k_vc_n_per_m, most_n_m);
    b->k = unit->contact_count > 1 ? most_n_m : fmin(k, most_n_m);
    // if this device's coupling is stiffer than k, multiply the message's damping by the square of the ratio b->k / k
    b->b = fmin(positive_or(unit->b_vc_n_s_per_m * pow(fmax(1.0, b->k / k), 2.0), most_n_s_m), most_n_s_m);
    for (int c = 0; c < b->count && b->count > 1; c++) {
        theirs = fmin(theirs, soft_of(&unit[c]));
        b->plane[c].give_m_n = fmax(0.0, soft_of(&unit[c]) - 1.0 / b->k);
    }
    return b->count > 1 ? fmin(theirs, 1.0 / b->k) : theirs;
}

// Set the level of a surface for the orientation that the tool has in the message. Also set the arm, the vector from
// the proxy to the point of contact.
static void set_place(const kn_contact_unit *from, kn_contact_plane *u)
{
    u->level_m = dot(u->normal, from->proxy_m);
    for (int i = 0; i < 3; i++) u->arm_m[i] = from->proxy_m[i] - from->friction_anchor_m[i];
    shorten(u->arm_m, FAR_M);
    cross(u->arm_m, u->normal, u->lever_m);
}

// Set the proxy for the message's pose. The proxy lies on the surfaces that it presses, where friction holds it, and
// never below a surface. If the proxy presses nothing, it is at the device's position.
static void set_proxy(const kn_contact_unit *unit, kn_contact_body *b, const double x[3])
{
    memcpy(b->proxy_m, x, sizeof b->proxy_m);
    for (int c = 0; c < b->count; c++) {
        const kn_contact_plane *u = &b->plane[c];
        bool pressed = dot(u->normal, u->force_n) > 0.0;
        double way[3];
        for (int i = 0; i < 3; i++) way[i] = unit[c].friction_anchor_m[i] - b->proxy_m[i];
        // move along the surface to the friction anchor, then onto the surface
        add(way, -dot(u->normal, way), u->normal);
        if (pressed) add(b->proxy_m, 1.0, way);
        double gap = dot(u->normal, b->proxy_m) - u->level_m;
        if (pressed || gap < 0.0) add(b->proxy_m, -gap, u->normal);
    }
}

// Set the friction force of each unit: the tangential force of the coupling, shared among the units by their normal
// forces. The message does not contain the tangential back stress. Its ratio to the friction force is therefore assumed
// to be the ratio of H to the normal force.
static void set_shear(kn_contact_body *b, const double x[3])
{
    double load_n = 0.0;
    for (int c = 0; c < b->count; c++) load_n += dot(b->plane[c].normal, b->plane[c].force_n);
    for (int c = 0; c < b->count; c++) {
        kn_contact_plane *u = &b->plane[c];
        double t = dot(u->normal, u->force_n), along = 0.0, across[3];
        for (int i = 0; i < 3; i++) along += u->normal[i] * (b->proxy_m[i] - x[i]);
        for (int i = 0; i < 3; i++) across[i] = b->k * (b->proxy_m[i] - x[i] - along * u->normal[i]);
        for (int i = 0; i < 3 && b->count > 1; i++) across[i] *= t > 0.0 ? t / load_n : 0.0;
        shorten(across, u->mu * t);
        add(u->shear_n, t > 0.0 ? clip(u->h_n / t, 0.0, 1.0) : 0.0, across);
        add(u->force_n, 1.0, across);
    }
}

// Reduce the elastic forces of the units, then shift the surfaces accordingly. The shift is the stretch of this
// device's coupling under the reduced forces, minus the stretch of the server's coupling under the forces of the
// message.
static void stretch(const kn_contact_unit *unit, double theirs, kn_contact_body *b)
{
    double told_n[3] = {0.0}, way[3];
    for (int c = 0; c < b->count; c++) {
        add(told_n, dot(b->plane[c].normal, b->plane[c].force_n), b->plane[c].normal);
        soften(b, soft_of(&unit[c]), &b->plane[c]);
    }
    sum_up(b);
    for (int i = 0; i < 3; i++) way[i] = b->force_n[i] / b->k - told_n[i] * theirs;
    for (int c = 0; c < b->count; c++) b->plane[c].level_m += dot(b->plane[c].normal, way);
}

// Set the rotation of a coupled tool's proxy since the message's pose. The torque of the contact turns the proxy. The
// coupling's damping makes the proxy lag behind a device that turns at the angular velocity rate_rad_s.
static void set_turn(kn_contact_body *b, const double rate_rad_s[3])
{
    if (b->rigid) return;
    for (int i = 0; i < 3; i++)
        b->turn[i] = b->torque_n_m[i] / (b->arm_m * b->arm_m * b->k) - b->b / b->k * rate_rad_s[i];
    shorten(b->turn, 1.0);
    for (int c = 0; c < b->count; c++) b->plane[c].level_m += dot(b->plane[c].lever_m, b->turn);
}

// Set up the contact as it was at the end of the step that used pose number `at`. Return false if the contact is too
// far from that pose.
static bool set_up(const kn_contact_model *m, int64_t at, double c2[], kn_contact_body *b)
{
    const kn_contact_unit *unit = m->unit;
    const kn_contact_pose *pose = &m->pose[at % KN_CONTACT_REPLAY];
    const kn_contact_pose *before = &m->pose[(at > 0 ? at - 1 : at) % KN_CONTACT_REPLAY];
    const double *x = pose->position_m;
    double rate[3] = {0.0};
    memset(b, 0, sizeof *b);
    b->count = unit->contact_count;
    // add the message's c2 to the law of c2
    for (int c = 0; c < b->count; c++) c2[bin_of(unit[c].force_n)] = clip(unit[c].c2_n_s_per_m, 10.0, 1e5);
    if (b->count > 0) fill(c2, b->law_m_s);
    double theirs = set_coupling(m, unit, b);
    b->arm_m = m->def.arm_m;
    b->rigid = !(unit->k_vc_n_per_m > 0.0);
    memcpy(b->from_wxyz, pose->orientation_wxyz, sizeof b->from_wxyz);
    // set the surfaces of the units, then the proxy, friction and turn that fit the surfaces
    for (int c = 0; c < b->count; c++) {
        set_plane(m, b, &unit[c], &b->plane[c]);
        set_place(&unit[c], &b->plane[c]);
    }
    stretch(unit, theirs, b);
    for (int c = 0; c < b->count; c++)
        if (fabs(dot(b->plane[c].normal, x) - b->plane[c].level_m) > FAR_M) return false;
    set_proxy(unit, b, x);
    set_shear(b, x);
    sum_up(b);
    // angular velocity of the device, from this pose and the pose before
    if (at > 0 && pose->at_s > before->at_s) turn_between(before->orientation_wxyz, pose->orientation_wxyz, rate);
    for (int i = 0; i < 3 && at > 0; i++) rate[i] /= fmax(pose->at_s - before->at_s, POSE_GAP_S);
    set_turn(b, rate);
    return true;
}

// Replay the client's own poses after the pose of the message. Each pose is held until the next pose, and the last pose
// until now.
static void replay(kn_contact_model *m, int64_t at, kn_contact_body *b)
{
    for (int64_t i = at + 1; i < m->poses; i++) {
        const kn_contact_pose *pose = &m->pose[i % KN_CONTACT_REPLAY];
        double until_s = i + 1 < m->poses ? m->pose[(i + 1) % KN_CONTACT_REPLAY].at_s : m->now_s;
        double dt = until_s - pose->at_s, turn[3];
        if (dt < 1e-6) continue;
        turn_between(b->from_wxyz, pose->orientation_wxyz, turn);
        advance(b, pose->position_m, pose->velocity_m_s, turn, fmin(dt, 0.01));
        m->replayed++;
    }
}

// Return the size of the contact force that is rendered now, before gain and force scale, N.
static double felt_n(const kn_contact_model *m) { return (1.0 - m->lost) * m->share * norm(m->body.force_n); }

// Begin to render a contact. After an outage or a change of the object, the rendered force starts at the force that the
// hand already feels, and rises. Otherwise the contact is rendered in full at once.
static void join(kn_contact_model *m, const kn_contact_body *b, const kn_contact_pose *now)
{
    double before_n = felt_n(m), turn[3];
    kn_contact_body ahead = *b; // the contact one step later, when the tool may press further surfaces
    m->returning |= m->lost > 0.0;
    m->body = *b;
    m->share = 1.0;
    m->lost = 0.0;
    if (!m->returning) return;
    turn_between(b->from_wxyz, now->orientation_wxyz, turn);
    advance(&ahead, now->position_m, now->velocity_m_s, turn, m->def.server_period_s);
    // begin with the share of the full force that the hand already feels
    double full_n = fmax(norm(b->force_n), norm(ahead.force_n));
    if (before_n < full_n) m->share = before_n / full_n;
    m->returning = m->share < 1.0;
}

// Use a complete message: set up its contact, replay the later poses, and begin to render the contact. Return
// KN_CONTACT_BAD if the contact is too far from its pose, or if a result is not finite.
static kn_contact_take complete(kn_contact_model *m, int64_t at)
{
    const kn_contact_unit *unit = m->unit;
    const kn_contact_pose *pose = &m->pose[at % KN_CONTACT_REPLAY];
    const bool other = m->taken > 0 && unit->generation != m->generation;
    kn_contact_body b;
    double c2[KN_CONTACT_LAW]; // a copy of m->c2, so that a message that is refused does not change the stored c2
    memcpy(c2, m->c2, sizeof c2);
    if (other) memset(c2, 0, sizeof c2);
    if (!set_up(m, at, c2, &b)) return KN_CONTACT_BAD;
    double taken_n = norm(b.force_n);
    replay(m, at, &b);
    if (!finite3(b.force_n) || !finite3(b.proxy_m)) return KN_CONTACT_BAD;
    memcpy(m->c2, c2, sizeof c2);
    m->returning |= other;
    // If the hand feels a contact but the message has none, let the felt contact fade. It is not dropped at once,
    // because a hand cannot leave a contact so fast.
    if (b.count == 0 && felt_n(m) > FELT_N) {
        m->lost = fmax(m->lost, 1e-9);
    } else {
        m->taken_n = taken_n;
        join(m, &b, &m->pose[(m->poses - 1) % KN_CONTACT_REPLAY]);
    }
    m->generation = unit->generation;
    m->taken_seq = unit->pose_seq;
    m->taken_s = pose->at_s;
    memcpy(m->taken_m, pose->position_m, sizeof m->taken_m);
    m->valid_s = 1e-3 * clip(unit->valid_ms, 0.0, 100.0);
    m->stale_s = 0.0;
    m->taken++;
    return KN_CONTACT_TAKEN;
}

// Check one datagram and store it. A message is used when all of its units have arrived.
static kn_contact_take take(kn_contact_model *m, const kn_contact_unit *unit)
{
    if (unit->session != m->def.session) return KN_CONTACT_FOREIGN;
    if (!sane(unit)) return KN_CONTACT_BAD;
    if (unit->utime < m->utime) return KN_CONTACT_LATE;
    // a datagram of a newer tick discards an incomplete message
    if (unit->utime > m->utime) m->have = 0;
    m->utime = unit->utime;
    m->flags = unit->flags;
    // a message must answer a pose that was sent and is still stored
    if (m->poses == 0 || unit->pose_seq > m->pose[(m->poses - 1) % KN_CONTACT_REPLAY].seq) return KN_CONTACT_BAD;
    int64_t at = find_pose(m, unit->pose_seq);
    // a second answer to the same pose counts as late: the first answer stays in use
    if (unit->pose_seq <= m->taken_seq || at < 0) return KN_CONTACT_LATE;
    const kn_contact_unit *other = &m->unit[m->first];
    if (m->have && (unit->contact_count != other->contact_count || unit->pose_seq != other->pose_seq))
        return KN_CONTACT_BAD;
    if (unit->contact_count == 0) {
        m->unit[0] = *unit;
        return complete(m, at);
    }
    m->unit[unit->contact_index] = *unit;
    if (!m->have) m->first = unit->contact_index;
    m->have |= 1u << unit->contact_index;
    return m->have == (1u << unit->contact_count) - 1u ? complete(m, at) : KN_CONTACT_WAITING;
}

kn_contact_take kn_contact_model_take(kn_contact_model *m, const kn_contact_unit *unit)
{
    kn_contact_take result = take(m, unit);
    m->refused += result >= KN_CONTACT_FOREIGN;
    if (result == KN_CONTACT_BAD) m->have = 0;
    return result;
}

// --- the device's tick ----------------------------------------------------------------------------------------------

void kn_contact_model_init(kn_contact_model *m, const kn_contact_model_def *def)
{
    memset(m, 0, sizeof *m);
    m->def = *def;
    m->def.radius_m = fmin(positive_or(def->radius_m, 0.010), 0.010);
    m->def.stiffness_n_m = positive_or(def->stiffness_n_m, 600.0);
    m->def.damping_n_s_m = positive_or(def->damping_n_s_m, 1.5);
    m->def.force_scale = positive_or(def->force_scale, 1.0);
    m->def.force_limit_n = positive_or(def->force_limit_n, 3.3);
    m->def.force_rise_n = positive_or(def->force_rise_n, 2.0);
    m->def.server_period_s = positive_or(def->server_period_s, 1e-3);
    m->def.arm_m = positive_or(def->arm_m, 0.030);
    m->orientation_wxyz[0] = 1.0;
    m->taken_seq = -1;
    m->share = 1.0;
}

void kn_contact_model_turn(kn_contact_model *m, const double orientation_wxyz[4])
{
    double size = 0.0;
    for (int i = 0; i < 4; i++) size += orientation_wxyz[i] * orientation_wxyz[i];
    if (!(size > 0.25 && size < 4.0)) return;
    for (int i = 0; i < 4; i++) m->orientation_wxyz[i] = orientation_wxyz[i] / sqrt(size);
}

void kn_contact_model_pose(kn_contact_model *m, int64_t seq, const double position_m[3], const double velocity_m_s[3])
{
    if (!finite3(position_m) || !finite3(velocity_m_s)) return;
    m->posed_s = m->now_s;
    if (m->poses > 0 && m->now_s - m->pose[(m->poses - 1) % KN_CONTACT_REPLAY].at_s < POSE_GAP_S) return;
    kn_contact_pose *pose = &m->pose[m->poses++ % KN_CONTACT_REPLAY];
    pose->seq = seq;
    pose->at_s = m->now_s;
    memcpy(pose->position_m, position_m, sizeof pose->position_m);
    memcpy(pose->velocity_m_s, velocity_m_s, sizeof pose->velocity_m_s);
    memcpy(pose->orientation_wxyz, m->orientation_wxyz, sizeof pose->orientation_wxyz);
}

// Return true if the message in use is no longer valid: since the pose of this message, the tool has moved or turned
// too far, or the force has risen too much.
static bool too_far(const kn_contact_model *m)
{
    const kn_contact_pose *now = &m->pose[(m->poses - 1) % KN_CONTACT_REPLAY];
    const double *x = now->position_m, *n = NULL;
    double most = 0.0, way[3], turn[3];
    turn_between(m->body.from_wxyz, now->orientation_wxyz, turn);
    for (int c = 0; c < m->body.count; c++) {
        double t = dot(m->body.plane[c].normal, m->body.plane[c].force_n);
        // a turn is too large if it moves the point of contact by more than half the tool's radius
        if (norm(turn) * norm(m->body.plane[c].lever_m) > 0.5 * m->def.radius_m) return true;
        if (n && t <= most) continue;
        n = m->body.plane[c].normal;
        most = t;
    }
    if (!n) return false;
    // path of the tool since the message's pose, tangential to the surface with the largest force
    for (int i = 0; i < 3; i++) way[i] = x[i] - m->taken_m[i];
    add(way, -dot(n, way), n);
    if (norm(way) > 0.5 * m->def.radius_m) return true;
    return norm(m->body.force_n) - m->taken_n > m->def.force_rise_n;
}

bool kn_contact_model_stale(const kn_contact_model *m)
{
    return m->taken_seq < 0 || m->now_s - m->taken_s > m->valid_s || too_far(m);
}

// Fade a stale contact: the surface moves towards the device. This motion acts like a damper in series, so it returns
// no energy to the hand.
static void leak(kn_contact_model *m, const double x[3], const double turn[3], double dt)
{
    double force_n = m->share * norm(m->body.force_n), share = exp(-dt / LEAK_S);
    if (force_n > 0.0) share = fmax(share, 1.0 - dt * LEAK_N_PER_S / force_n);
    if (force_n > FELT_N) m->returning = true;
    scale(&m->body, x, turn, m->share * share);
    m->share = 1.0;
    m->stale_s += dt;
    // a contact stale for too long is dropped
    if (m->stale_s < FORGET_S) return;
    m->body.count = 0;
    m->returning = true;
}

// Fade a contact that no longer exists in the server, and drop it at the end.
static void lose(kn_contact_model *m, double dt)
{
    m->lost += dt / FADE_S;
    if (m->lost < 1.0) return;
    m->body.count = 0;
    m->lost = 0.0;
    m->returning = true;
    sum_up(&m->body);
}

// Bring a contact back after an outage: raise the share of its force that is rendered. The surface could be moved back
// instead, but then the viscous part of the force would end with a jump.
static void come_back(kn_contact_model *m, const double x[3], const double turn[3], double dt)
{
    m->share = fmin(1.0, m->share + dt * RETURN_M_PER_S / fmax(depth_of(&m->body, x, turn), THERE_M));
    m->returning = m->share < 1.0;
}

// Ramp the gain up while the tool is engaged and the client sends poses; otherwise ramp the gain down.
static void ramp(kn_contact_model *m, double dt)
{
    bool stop = (m->flags & (KN_CONTACT_LATCHED | KN_CONTACT_STOPPING)) != 0;
    bool engaged = (m->flags & (KN_CONTACT_ENGAGED | KN_CONTACT_RAMPING)) != 0;
    bool posed = m->poses > 0 && m->now_s - m->posed_s <= HOLD_S;
    m->gain = clip(m->gain + (engaged && !stop && posed ? dt / RAMP_S : -dt / FADE_S), 0.0, 1.0);
}

void kn_contact_model_render(kn_contact_model *m, double dt_s, const double position_m[3], const double velocity_m_s[3],
                             double force_n[3])
{
    double dt = clip(dt_s, 1e-4, 1e-2), turn[3];
    // a position that is not finite counts as a missing pose: keep the last force
    bool read = finite3(position_m) && finite3(velocity_m_s);
    if (m->body.count > 0 && read) {
        turn_between(m->body.from_wxyz, m->orientation_wxyz, turn);
        if (kn_contact_model_stale(m)) leak(m, position_m, turn, dt);
        else if (m->returning) come_back(m, position_m, turn, dt);
        advance(&m->body, position_m, velocity_m_s, turn, dt);
        if (m->lost > 0.0) lose(m, dt);
    } else if (m->body.count == 0) {
        sum_up(&m->body);
    }
    ramp(m, dt);
    m->now_s += dt;
    // scale to the hand and clamp; the torque is cut by the same factor
    double share = m->share * (1.0 - m->lost);
    for (int i = 0; i < 3; i++) force_n[i] = m->def.force_scale * share * m->body.force_n[i];
    double asked_n = norm(force_n);
    shorten(force_n, m->def.force_limit_n);
    double limit = asked_n > m->def.force_limit_n ? m->def.force_limit_n / asked_n : 1.0;
    for (int i = 0; i < 3; i++) {
        force_n[i] *= m->gain;
        m->torque_n_m[i] = m->gain * limit * m->def.force_scale * share * m->body.torque_n_m[i];
    }
}

double kn_contact_model_energy(const kn_contact_model *m, const double position_m[3])
{
    // sum the energy of the coupling and of the units' springs
    double energy_j = 0.0;
    if (m->body.count == 0) return 0.0;
    double turn[3], l2 = m->body.arm_m * m->body.arm_m;
    turn_between(m->body.from_wxyz, m->orientation_wxyz, turn);
    for (int i = 0; i < 3; i++)
        energy_j +=
            0.5 * m->body.k * (pow(position_m[i] - m->body.proxy_m[i], 2.0) + l2 * pow(turn[i] - m->body.turn[i], 2.0));
    for (int c = 0; c < m->body.count; c++) {
        const kn_contact_plane *u = &m->body.plane[c];
        if (u->k1 > 0.0) energy_j += 0.5 * (u->h_n * u->h_n + dot(u->shear_n, u->shear_n)) / u->k1;
    }
    return (1.0 - m->lost) * m->share * energy_j;
}
