#include "core/solve/tool.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

// --- shape ----------------------------------------------------------------------------------------------------------

// Return NULL, or the reason why the sizes of a box or cross are wrong.
static const char *unfit_box(const kn_probe_def *p, double spacing_m)
{
    for (int k = 0; k < 3; k++)
        if (!(p->size_m[k] > 2 * p->edge_m && p->edge_m >= 0 && isfinite(p->size_m[k])))
            return "a box's sizes must be positive and more than twice the radius of its edges";
    for (int k = 0; k < 3; k++)
        if (p->size_m[k] < spacing_m) return "a box must be at least a lattice spacing wide and high";
    return NULL;
}

// A shape smaller than the lattice's spacing is refused, because it would fall between the nodes.
const char *kn_tool_unfit(const kn_probe_def *p, double spacing_m)
{
    const bool cylinder = p->shape == KN_PROBE_CYLINDER, long_one = cylinder || p->shape == KN_PROBE_CAPSULE;
    if (p->shape == KN_PROBE_BOX || p->shape == KN_PROBE_CROSS) return unfit_box(p, spacing_m);
    const bool of_parts = p->shape == KN_PROBE_UNION || p->shape == KN_PROBE_MESH;
    if (of_parts && !p->parts) return "a union or mesh needs its parts";
    if (of_parts && !(2 * p->parts->fine_m >= spacing_m))
        return "every part of a tool must be at least a lattice spacing wide and high";
    if (long_one && !(p->length_m > 0 && isfinite(p->length_m))) return "a capsule or cylinder needs a positive length";
    if (cylinder && !(p->edge_m >= 0 && p->edge_m <= p->radius_m && 2 * p->edge_m <= p->length_m))
        return "a cylinder's edge radius must be at most its radius and half its length";
    if (p->shape == KN_PROBE_PLATE && !(p->size_m[0] > 0 && p->size_m[1] > 0 && isfinite(p->size_m[0] + p->size_m[1])))
        return "a plate needs two positive sizes";
    if ((long_one || p->shape == KN_PROBE_SPHERE) && !(p->radius_m >= spacing_m && isfinite(p->radius_m)))
        return "a tool's radius must be at least the lattice spacing, or it falls between the nodes";
    return NULL;
}

// Add the two boxes of a cross.
static bool add_cross(kn_shape *shape, const kn_probe_def *def)
{
    const double along[3] = {def->size_m[0], def->size_m[1], def->size_m[2]};
    const double across[3] = {def->size_m[1], def->size_m[0], def->size_m[2]};
    const kn_solid arms[2] = {kn_solid_box(along, def->edge_m), kn_solid_box(across, def->edge_m)};
    return kn_shape_add(shape, &arms[0]) && kn_shape_add(shape, &arms[1]);
}

bool kn_tool_shape(const kn_probe_def *def, kn_shape *shape)
{
    kn_solid part;
    switch (def->shape) {
    case KN_PROBE_PLATE: return true;
    case KN_PROBE_CROSS: return add_cross(shape, def);
    case KN_PROBE_UNION:
    case KN_PROBE_MESH: return *shape = *def->parts, true;
    case KN_PROBE_SPHERE: part = kn_solid_sphere(def->radius_m); break;
    case KN_PROBE_CAPSULE: part = kn_solid_capsule(def->radius_m, def->length_m); break;
    case KN_PROBE_CYLINDER: part = kn_solid_cylinder(def->radius_m, def->length_m, def->edge_m); break;
    default: part = kn_solid_box(def->size_m, def->edge_m);
    }
    return kn_shape_add(shape, &part);
}

// --- orientation ----------------------------------------------------------------------------------------------------

// Compute the shortest rotation vector from one orientation to another.
static void turn_between(const double from[4], const double to[4], double turn[3])
{
    double d[4];
    kn_turn_between(from, to, d);
    double sine = sqrt(d[1] * d[1] + d[2] * d[2] + d[3] * d[3]), sign = d[0] < 0 ? -1 : 1;
    double scale = sine > 1e-12 ? 2 * atan2(sine, fabs(d[0])) / sine : 2;
    for (int k = 0; k < 3; k++) turn[k] = sign * scale * d[k + 1];
}

// Turn an orientation by a rotation vector, in the scene's frame.
static void turn_by(double q[4], const double turn[3])
{
    double angle = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    double scale = angle > 1e-12 ? sin(0.5 * angle) / angle : 0.5;
    double d[4] = {cos(0.5 * angle), scale * turn[0], scale * turn[1], scale * turn[2]}, out[4];
    kn_turn_multiply(d, q, out);
    kn_turn_unit(out, q);
}

void kn_tool_matrix(const double orientation_wxyz[4], double turn[3][3])
{
    double q[4];
    kn_turn_unit(orientation_wxyz, q);
    kn_turn_matrix(q, turn);
}

// --- motion ---------------------------------------------------------------------------------------------------------

bool kn_tool_turns(const kn_probe_def *def)
{
    if (def->shape == KN_PROBE_PLATE) return false;
    return def->shape != KN_PROBE_SPHERE || def->friction > 0 || def->adhesion_pa > 0 || def->grip_n > 0;
}

// Attach a probe at its input pose, or detach it and clear its state.
static void attach(const kn_model *m, kn_state *state, int p, const kn_probe_input *in)
{
    kn_probe_state *probe = &state->probe[p];
    if (!in->attached) {
        *probe = (kn_probe_state){0};
        state->tool[p] = (kn_tool_state){0};
        return;
    }
    if (probe->attached) return;
    *probe = (kn_probe_state){.attached = 1};
    memcpy(probe->position_m, in->position_m, sizeof probe->position_m);
    if (kn_tool_turns(&m->def.probe[p])) kn_turn_unit(in->orientation_wxyz, state->tool[p].orientation_wxyz);
}

// Update the grip. A grip begins when the button goes down and ends when the button goes up. If a grip was torn loose,
// the button must be pressed again.
static void take_grip(const kn_probe_def *def, const kn_probe_input *in, kn_tool_state *tool)
{
    if (!in->grip) tool->grip_n = 0;
    else if (tool->grip_n == 0) tool->grip_n = def->grip_n;
}

void kn_tool_begin(const kn_model *m, kn_state *state, int p, const kn_probe_input *in, kn_tool_step *tool)
{
    const kn_probe_def *def = &m->def.probe[p];
    kn_probe_state *probe = &state->probe[p];
    kn_tool_state *own = &state->tool[p];
    double dt = m->def.solver.dt_s, catch_up = fmax(KN_FOLLOW_S, dt), turn[3] = {0};
    const bool turns = kn_tool_turns(def);
    *tool = (kn_tool_step){.turn = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    attach(m, state, p, in);
    if (!probe->attached) return;
    tool->coupled = def->coupling_n_m > 0;
    take_grip(def, in, own);
    // a tool that was attached inside the object grows back at KN_RELIEF_M_S, or less in the last step
    tool->growth_m_s = fmin(KN_RELIEF_M_S, own->relief_m / dt);
    own->relief_m = fmax(0, own->relief_m - KN_RELIEF_M_S * dt);
    tool->turned = turns;
    // turn: rotation vector from the tool's orientation to the orientation of the pose
    if (turns) {
        double wanted[4];
        kn_turn_unit(in->orientation_wxyz, wanted);
        turn_between(own->orientation_wxyz, wanted, turn);
        kn_turn_matrix(own->orientation_wxyz, tool->turn);
    }
    // A rigid tool follows the velocity of its pose, and its distance to the pose decays with the time constant
    // catch_up. A step longer than KN_FOLLOW_S closes the distance in one step and never passes the pose.
    if (!tool->coupled) {
        for (int k = 0; k < 3; k++) {
            probe->velocity_m_s[k] = in->velocity_m_s[k] + (in->position_m[k] - probe->position_m[k]) / catch_up;
            own->turn_rad_s[k] = turns ? turn[k] / catch_up : 0;
        }
    }
    // the coupling's part of the tool's 6 x 6 system; stiffness and damping of rotations contain the factor l^2
    const double k_n_m = def->coupling_n_m, b_n_s_m = def->coupling_n_s_m, l2 = KN_COUPLING_ARM_M * KN_COUPLING_ARM_M;
    tool->give[0] = dt * k_n_m + b_n_s_m;
    tool->give[1] = l2 * tool->give[0];
    for (int k = 0; k < 3; k++) {
        tool->drive[k] = k_n_m * (in->position_m[k] - probe->position_m[k]) + b_n_s_m * in->velocity_m_s[k];
        tool->drive[3 + k] = l2 * k_n_m * turn[k];
        tool->velocity[k] = probe->velocity_m_s[k];
        tool->velocity[3 + k] = own->turn_rad_s[k];
    }
}

void kn_tool_advance(const kn_model *m, kn_state *state, int p, const kn_tool_step *tool)
{
    double dt = m->def.solver.dt_s, turn[3];
    kn_probe_state *probe = &state->probe[p];
    for (int k = 0; k < 3; k++) {
        probe->velocity_m_s[k] = tool->velocity[k];
        probe->position_m[k] += dt * probe->velocity_m_s[k];
    }
    if (!kn_tool_turns(&m->def.probe[p])) return;
    for (int k = 0; k < 3; k++) {
        state->tool[p].turn_rad_s[k] = tool->velocity[3 + k];
        turn[k] = dt * tool->velocity[3 + k];
    }
    turn_by(state->tool[p].orientation_wxyz, turn);
}
