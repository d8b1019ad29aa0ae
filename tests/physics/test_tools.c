// Tools of any shape: friction, adhesion, the virtual coupling in the solve, a table that can be left, two fingers
// that lift.
#include "core/algebra/algebra.h"
#include "core/shape.h"
#include "core/solve/solver.h"
#include "tests/core/surface_of.h"
#include "tests/lattice.h"

static const double g = 9.81;

static kn_model_def with_tool(kn_model_def def, kn_probe_def tool)
{
    def.probe_count = 1;
    def.probe[0] = tool;
    return def;
}

static kn_probe_def coupled(kn_probe_def tool, double friction, double n_m, double n_s_m)
{
    tool.friction = friction, tool.coupling_n_m = n_m, tool.coupling_n_s_m = n_s_m;
    return tool;
}

static kn_probe_def ball(double friction)
{
    return (kn_probe_def){.name = "ball", .shape = KN_PROBE_SPHERE, .radius_m = 0.01, .friction = friction};
}

static kn_probe_def finger(double friction)
{
    kn_probe_def tool = {.name = "finger", .shape = KN_PROBE_CAPSULE, .radius_m = 0.008, .length_m = 0.03};
    return coupled(tool, friction, 600, 1.5);
}

static const kn_probe_output *tool(const lattice *l) { return &l->out.probe[0]; }
static double up(const lattice *l) { return tool(l)->force_n[2]; }

static void centre(const lattice *l, double c[3])
{
    double x[3];
    c[0] = c[1] = c[2] = 0;
    for (int i = 0; i < l->model->node_count; i++) {
        kn_state_position(l->model, l->state, i, x);
        for (int k = 0; k < 3; k++) c[k] += l->model->node_mass_kg[i] * x[k] / kn_model_mass(l->model);
    }
}

static double lowest(const lattice *l)
{
    double low = INFINITY, x[3];
    for (int i = 0; i < l->model->node_count; i++) {
        kn_state_position(l->model, l->state, i, x);
        low = fmin(low, x[2]);
    }
    return low;
}

TEST("a box on a stiff coupling presses within 1 % of a rigid box, and a rigid box within 10 % of a plate")
{
    const press p = {.depth_m = 0.005, .hold_s = 0.3};
    kn_probe_def tool = {.name = "box", .shape = KN_PROBE_BOX, .size_m = {0.01, 0.06, 0.02}, .foundation_n_m3 = 1e9};
    kn_model_def plate = press_def(2), box = with_tool(press_def(2), coupled(tool, 10, 0, 0));
    AT_END(run_free) run a = press_run(&plate, &p, 0.8, 0.001), rigid = press_run(&box, &p, 0.8, 0.001);
    box.probe[0] = coupled(tool, 10, 1e7, 2e5); // 20 ms, the time in which a rigid tool catches up
    AT_END(run_free) run soft = press_run(&box, &p, 0.8, 0.001);
    printf("     force %.2f %% from the rigid box, of %.2f N at most where a plate's is %.2f N; worst residual %.1e\n",
           100 * force_error(&soft, &rigid), peak_n(&rigid), peak_n(&a), soft.worst_residual);
    CHECK(force_error(&soft, &rigid) < 0.01);
    CHECK(fabs(peak_n(&rigid) / peak_n(&a) - 1) < 0.1); // the plate holds nodes, the box meets a smooth skin
}

TEST("the object's force on a coupled tool equals the coupling's force, to rounding")
{
    LATTICE l = lattice_of(with_tool(press_def(2), finger(0.5)));
    put(&l, 0, 0, 0, 0.030 + 0.008);
    double worst = 0, before[3];
    for (int i = 0; i < 400; i++) {
        memcpy(before, l.state->probe[0].position_m, sizeof before);
        kn_probe_input hand = l.in.probe[0];
        move(&l, 0, 0.005, 0, -0.01, 1);
        for (int k = 0; k < 3 && i > 0; k++) {
            double v = (tool(&l)->position_m[k] - before[k]) / 1e-3, speed = (const double[]){0.005, 0, -0.01}[k];
            double spring = 600 * (hand.position_m[k] - tool(&l)->position_m[k]) + 1.5 * (speed - v);
            worst = fmax(worst, fabs(spring + tool(&l)->force_n[k]));
        }
    }
    CHECK(up(&l) > 0.5);
    CHECK(worst < 1e-9 * up(&l));
}

// A mallet: a box, and a tilted capsule across it.
static kn_probe_def mallet(kn_shape *parts)
{
    const double c = cos(0.4), s = sin(0.4), turn[3][3] = {{c, 0, s}, {0, 1, 0}, {-s, 0, c}};
    const kn_solid head = kn_solid_box((double[]){0.02, 0.014, 0.02}, 0.002);
    kn_solid handle = kn_solid_capsule(0.006, 0.02);
    handle.at_m[0] = 0.004, handle.at_m[2] = 0.004, handle.turned = true;
    memcpy(handle.turn, turn, sizeof turn);
    *parts = (kn_shape){0};
    CHECK(kn_shape_add(parts, &head) && kn_shape_add(parts, &handle));
    return coupled((kn_probe_def){.name = "mallet", .shape = KN_PROBE_UNION, .parts = parts}, 0.4, 900, 3);
}

static kn_probe_def of_surface(surface_of s, double cell_m, kn_shape *parts)
{
    const kn_solid solid = kn_solid_field(surface_field(s, cell_m));
    *parts = (kn_shape){0};
    CHECK(kn_shape_add(parts, &solid));
    return (kn_probe_def){.name = "mesh", .shape = KN_PROBE_MESH, .parts = parts};
}

// A tilted egg of triangles, with its origin where a box has its own.
static kn_probe_def egg(kn_shape *parts)
{
    surface_of s = surface_ball(1, 16);
    for (int i = 0; i < s.vertices; i++) {
        double *x = s.x_m[i], leaned = 0.3 * x[2];
        x[0] = 0.012 * (x[0] + leaned), x[1] *= 0.008, x[2] = 0.010 * (x[2] + 1);
    }
    return coupled(of_surface(s, 0.0006, parts), 0.4, 900, 3);
}

// Add the momentum of a state over dt, and the moment about `at`.
static void add_momentum(const lattice *l, const kn_state *places, const kn_state *speeds, double sign,
                         const double at[3], double sum[6])
{
    for (int n = 0; n < l->model->node_count; n++) {
        double x[3], v[3], arm[3];
        kn_state_position(l->model, places, n, x);
        kn_state_velocity(l->model, speeds, n, v);
        for (int k = 0; k < 3; k++) arm[k] = x[k] - at[k], v[k] *= l->model->node_mass_kg[n] / 1e-3;
        kn_six_wrench(arm, v, sign, sum);
    }
}

// Check Newton's third law with a tool whose lowest point starts above_m over a free block.
static void third_law(kn_probe_def tool, double above_m, kn_skin_form skin)
{
    kn_model_def def = with_tool(converged(press_def(2)), tool);
    def.skin = skin;
    for (int k = 0; k < 3; k++) def.nodes[k] = 5;
    def.support = KN_SUPPORT_NONE;
    def.solver.tolerance = 1e-13;
    LATTICE l = lattice_of(def);
    OWN(kn_state) *old = kn_state_create(l.model);
    const kn_probe_output *out = &l.out.probe[0];
    put(&l, 0, 0.006, 0, 0.020 + above_m);
    double worst = 0, spin = 0, peak = 0;
    for (int i = 0; i < 200; i++) {
        double gain[6] = {0};
        kn_state_copy(l.model, old, l.state);
        move(&l, 0, 0.02, 0, -0.03, 1);
        // about the tool's former position, which the step uses for its moments
        const double *at = old->probe[0].attached ? old->probe[0].position_m : out->position_m;
        add_momentum(&l, old, l.state, 1, at, gain);
        add_momentum(&l, old, old, -1, at, gain);
        for (int k = 0; k < 3; k++) {
            worst = fmax(worst, fabs(gain[k] + out->force_n[k]));
            if (i > 0) spin = fmax(spin, fabs(gain[3 + k] + out->torque_n_m[k]));
            peak = fmax(peak, fabs(out->force_n[k]));
        }
    }
    printf("     %s, of %.2f N: force %.1e N, moment %.1e N m\n", tool.name, peak, worst, spin);
    CHECK(peak > 0.01 && worst < 1e-9 * peak && spin < 1e-9 * peak * 0.01);
}

TEST("Newton's third law holds to rounding: the object gains the momentum and the spin that the tool loses")
{
    AT_END(kn_shape_drop) kn_shape parts = {0};
    third_law(finger(0.5), 0.008, KN_SKIN_SPLINE);
    third_law(finger(0.5), 0.008, KN_SKIN_BILINEAR);
    third_law(mallet(&parts), 0.002, KN_SKIN_SPLINE);
    third_law(egg(&parts), 0, KN_SKIN_SPLINE);
}

static kn_model_def on_jelly(kn_probe_def tool)
{
    kn_model_def def = with_tool(press_def(2), tool);
    def.material = jelly();
    return def;
}

static double sideways(const lattice *l) { return -tool(l)->force_n[0] / up(l); }

TEST("a sliding ball feels its friction times the normal force, and a sticking ball less")
{
    double first[2], last[2];
    for (int rough = 0; rough < 2; rough++) {
        LATTICE l = lattice_of(on_jelly(ball(rough ? 0.3 : 0)));
        put(&l, 0, -0.006, 0, 0.030 + 0.01);
        move(&l, 0, 0, 0, -0.01, 200);
        move(&l, 0, 0.01, 0, 0, 20);
        first[rough] = sideways(&l);
        move(&l, 0, 0.01, 0, 0, 1200);
        last[rough] = sideways(&l);
    }
    printf("     sideways over normal: %.3f sticking, %.3f sliding at mu 0.3; %.3f, %.3f smooth\n", first[1], last[1],
           first[0], last[0]);
    CHECK(fabs(last[0]) < 0.1); // the slope of the dent itself
    CHECK(last[1] - last[0] > 0.27 && last[1] - last[0] < 0.36 * 1.05);
    CHECK(first[1] < 0.9 * last[1] && first[1] > 0);
}

TEST("a tool that sticks at up to 0.6 of the normal force at mu 0.8 does not creep")
{
    LATTICE l = lattice_of(on_jelly(finger(0.8)));
    put(&l, 0, 0, 0, 0.030 + 0.008);
    move(&l, 0, 0, 0, -0.01, 300);
    move(&l, 0, 0.005, 0, 0, 100);
    move(&l, 0, 0, 0, 0, 500);
    double early = tool(&l)->position_m[0], ratio = sideways(&l);
    move(&l, 0, 0, 0, 0, 2000);
    printf("     at %.2f of what it presses with: %.2g mm in 2 s\n", ratio, 1e3 * (tool(&l)->position_m[0] - early));
    CHECK(ratio > 0.1 && ratio < 0.6);
    CHECK_NEAR(tool(&l)->position_m[0], early, 1e-6);
}

TEST("an adhesive tool pulls up to its adhesion times the touched area, lets go later and takes work")
{
    static const double adhesion_pa[3] = {0, 200, 800}, foot_m2 = 0.015 * 0.015;
    double pull[3] = {0}, left_m[3], work_j[3]; // largest pull on the way up; where it lets go
    for (int i = 0; i < 3; i++) {
        kn_probe_def foot = {.name = "foot", .shape = KN_PROBE_BOX, .size_m = {0.015, 0.015, 0.02}, .edge_m = 0.001};
        foot.adhesion_pa = adhesion_pa[i];
        LATTICE l = lattice_of(on_jelly(foot));
        put(&l, 0, 0, 0, 0.030);
        move(&l, 0, 0, 0, -0.01, 100);
        move(&l, 0, 0, 0, 0, 300);
        for (int t = 0; t < 1500; t++) { // slower than the recovery of jelly
            move(&l, 0, 0, 0, 0.002, 1);
            pull[i] = fmax(pull[i], -up(&l));
            if (tool(&l)->contacts > 0) left_m[i] = l.in.probe[0].position_m[2] - 0.03;
        }
        work_j[i] = tool(&l)->work_j;
        CHECK(tool(&l)->contacts == 0 && up(&l) == 0);
        printf("     %.0f Pa: pulls %.4f N, lets go at %.2f mm, %.3f mJ\n", adhesion_pa[i], pull[i], 1e3 * left_m[i],
               1e3 * work_j[i]);
        CHECK(pull[i] <= 1.05 * adhesion_pa[i] * foot_m2);
        CHECK(i == 0 || (left_m[i] > left_m[i - 1] && work_j[i] > work_j[i - 1]));
    }
    CHECK(pull[1] > 0.3 * adhesion_pa[1] * foot_m2 && pull[2] > 2 * pull[1]); // the skin peels from the rim inwards
}

static kn_model_def block_on_table(double friction)
{
    kn_model_def def = press_def(2);
    for (int k = 0; k < 3; k++) def.nodes[k] = 7;
    def.gravity_m_s2 = g;
    def.support = KN_SUPPORT_FRICTION;
    def.support_friction = friction;
    return def;
}

TEST("a block on a table with friction stays under a weak push, slides under a strong one and does not tilt")
{
    kn_model_def def = with_tool(block_on_table(0.5), finger(0));
    def.material = jelly();
    LATTICE l = lattice_of(def);
    double weight = kn_model_mass(l.model) * g, c[3], from[3];
    put(&l, 0, -0.015 - 0.008 - 1e-4, 0, 0.004); // low, so that the block slides rather than falls over
    move(&l, 0, 0, 0, 0, 300);
    centre(&l, from);
    CHECK_NEAR(lowest(&l), 0, 2e-4);
    move(&l, 0, 0.002, 0, 0, 300);
    centre(&l, c);
    double push_n = -tool(&l)->force_n[0], stays_m = c[0] - from[0];
    move(&l, 0, 0.01, 0, 0, 500);
    centre(&l, c);
    double slides_n = -tool(&l)->force_n[0];
    printf("     weight %.3f N; pushed by %.3f N it moves %.3f mm, then slides at %.3f N by %.2f mm\n", weight, push_n,
           1e3 * stays_m, slides_n, 1e3 * (c[0] - from[0]));
    CHECK(push_n > 0.2 * weight && push_n < 0.5 * weight && stays_m < 3e-4);
    CHECK(slides_n > 0.45 * weight && slides_n < 0.65 * weight && c[0] - from[0] > 3e-3);
    CHECK(fabs(c[1]) < 1e-5 && lowest(&l) > -3e-4);
}

// Close two fingers on a block by 3 mm a side, raise them by 3 cm in 2 s, and hold.
static lattice pinch_and_lift(double squeeze_m, double friction, double grip_n)
{
    kn_model_def def = block_on_table(0.5);
    def.probe_count = 2;
    def.probe[0] = finger(friction);
    def.probe[0].grip_n = grip_n;
    def.probe[1] = def.probe[0];
    lattice l = lattice_of(def);
    for (int i = 0; i < 4500; i++) {
        double t = 1e-3 * (i + 1), closing = fmin(1, t / 1.5), rising = fmin(1, fmax(0, (t - 1.7) / 2));
        for (int p = 0; p < 2; p++) {
            double sign = p ? -1 : 1, way = 0.003 + squeeze_m;
            put(&l, p, sign * (0.015 + 0.008 + 0.003 - closing * way), 0, 0.015 + 0.03 * rising);
            l.in.probe[p].velocity_m_s[0] = closing < 1 ? -sign * way / 1.5 : 0;
            l.in.probe[p].velocity_m_s[2] = rising > 0 && rising < 1 ? 0.015 : 0;
            l.in.probe[p].grip = grip_n > 0;
        }
        step(&l);
    }
    return l;
}

TEST("two fingers lift a block of dough: each carries half, the block stays level and keeps the finger marks")
{
    LATTICE l = pinch_and_lift(0.006, 0.8, 0);
    double weight = kn_model_mass(l.model) * g, c[3], its = 0, low;
    for (int i = 0; i < 500; i++) step(&l), its += l.out.iterations / 500.0;
    centre(&l, c);
    low = lowest(&l);
    printf("     weight %.4f N: %.4f and %.4f N, centre at %.2f %.2f %.2f mm, lowest %.2f mm, %.1f iterations\n",
           weight, up(&l), l.out.probe[1].force_n[2], 1e3 * c[0], 1e3 * c[1], 1e3 * c[2], 1e3 * low, its);
    for (int p = 0; p < 2; p++) CHECK_NEAR(l.out.probe[p].force_n[2], -0.5 * weight, 0.01 * weight);
    CHECK(low > 0.027 && c[2] > 0.042 && fabs(c[0]) < 1e-4 && fabs(c[1]) < 1e-4);
    // only the fingers hold the block: without rigid motions in the preconditioner 24 iterations are not enough
    CHECK(its < 8);
    for (int p = 0; p < 2; p++) l.in.probe[p].attached = false;
    steps(&l, 1000);
    double mark = 0, u[3];
    for (int i = 0; i < l.model->node_count; i++) {
        const double *rest = l.model->rest_m[i];
        displacement(l.model, l.state, i, u);
        if (rest[0] == 0.015 && fabs(rest[1]) < 1e-9) mark = fmax(mark, -u[0]);
    }
    printf("     dropped, it lies at %.2f mm with marks %.2f mm deep\n", 1e3 * lowest(&l), 1e3 * mark);
    CHECK_NEAR(lowest(&l), 0, 5e-4);
    CHECK(mark > 5e-4);
}

NIGHT_TEST("smooth fingers lift a block only with enough grip; a block heavier than the grip slips")
{
    static const double grip_n[] = {0, 5, 0.02};
    for (int i = 0; i < 3; i++) {
        LATTICE l = pinch_and_lift(0.0035, 0, grip_n[i]);
        CHECK(i == 1 ? lowest(&l) > 0.025 : lowest(&l) < 0.001);
    }
}

TEST("a stiff tool thrown at a thin block at 1 m/s does not pass through")
{
    static const char *const names[3] = {"dough", "jelly", "clay"};
    const kn_material materials[3] = {dough, jelly(), clay()};
    for (int i = 0; i < 6; i++) {
        kn_model_def def = with_tool(press_def(2), coupled(ball(0), 0.3, 2000, 4));
        def.nodes[2] = 3; // 1 cm
        def.material = materials[i % 3];
        if (i >= 3) def.support = KN_SUPPORT_FRICTION, def.support_friction = 0.5;
        LATTICE l = lattice_of(def);
        put(&l, 0, 0, 0, 0.01 + 0.01 + 0.005);
        double deepest = INFINITY;
        for (int k = 0; k < 225; k++) { // the hand goes on to the table's level
            move(&l, 0, 0, 0, k < 25 ? -1 : 0, 1);
            deepest = fmin(deepest, tool(&l)->position_m[2]);
        }
        printf("     %s%s: ball's centre down to %.1f mm, feels %.1f N\n", names[i % 3], i >= 3 ? " on a table" : "",
               1e3 * deepest, up(&l));
        CHECK(deepest > 0.002); // the ball's centre never reaches the table
        CHECK(up(&l) > 1);
    }
}

// Record the force on a rigid tool, in N, in a slide of 1.2 s at 10 mm/s, 2 mm deep.
enum { SLIDE = 1200 };
static void slide_along(kn_probe_def tool, double force_n[SLIDE])
{
    LATTICE l = lattice_of(with_tool(press_def(2), tool));
    put(&l, 0, -0.006, 0.0013, 0.030 + 0.01);
    move(&l, 0, 0, 0, -0.01, 200);
    for (int i = 0; i < SLIDE; i++) {
        move(&l, 0, 0.01, 0, 0, 1);
        force_n[i] = up(&l);
    }
}

TEST("a ball of triangles slides within 1 % of the exact ball's force, with jumps per millisecond at most 10 % larger")
{
    static double exact[SLIDE], own[SLIDE];
    AT_END(kn_shape_drop) kn_shape parts = {0};
    double mean = 0, off = 0, jump[2] = {0};
    slide_along(ball(0), exact);
    slide_along(of_surface(surface_ball(0.01, 40), 0.005 / 8, &parts), own);
    for (int i = 0; i < SLIDE; i++) mean += exact[i] / SLIDE;
    for (int i = 0; i < SLIDE; i++) {
        off = fmax(off, fabs(own[i] - exact[i]) / mean);
        if (i < 200) continue; // leave out the start of the slide
        jump[0] = fmax(jump[0], fabs(exact[i] - exact[i - 1]) / mean);
        jump[1] = fmax(jump[1], fabs(own[i] - own[i - 1]) / mean);
    }
    printf("     mean %.3f N, at most %.2f %% apart; jumps per ms: %.3f %% of the ball, %.3f %% of the triangles\n",
           mean, 100 * off, 100 * jump[0], 100 * jump[1]);
    CHECK(mean > 0.1 && off < 0.01);
    CHECK(jump[1] < 1.1 * jump[0] && jump[1] < 0.005);
}

// The edges are round: pressed along nodes, a sharp box that is 0.1 um wider feels 3 % more force.
TEST("a box of triangles presses within 1 % of the exact box's force")
{
    const double size[3] = {0.02, 0.02, 0.015};
    const press p = {.depth_m = 0.004, .hold_s = 0.2};
    AT_END(kn_shape_drop) kn_shape parts = {0};
    kn_probe_def box = {.name = "box", .shape = KN_PROBE_BOX, .size_m = {size[0], size[1], size[2]}, .edge_m = 0.003};
    kn_model_def def = with_tool(press_def(2), box);
    AT_END(run_free) run exact = press_run(&def, &p, 0.7, 0.001);
    def.probe[0] = of_surface(surface_box(size, box.edge_m, 40), 0.005 / 8, &parts);
    AT_END(run_free) run own = press_run(&def, &p, 0.7, 0.001);
    printf("     %.2f %% apart, of %.2f N\n", 100 * force_error(&own, &exact), peak_n(&exact));
    CHECK(peak_n(&exact) > 1 && force_error(&own, &exact) < 0.01);
}

// Rotate by a quarter turn about z.
static void quarter(const double in[3], double out[3]) { out[0] = -in[1], out[1] = in[0], out[2] = in[2]; }

static void turned_by_a_quarter(kn_probe_def tool, kn_skin_form skin)
{
    const double half = sqrt(0.5), turn[4] = {half, 0, 0, half};
    kn_model_def def = with_tool(converged(press_def(2)), tool), turned;
    def.skin = skin;
    def.solver.tolerance = 1e-11;
    turned = def;
    def.nodes[0] = turned.nodes[1] = 9;
    def.nodes[1] = turned.nodes[0] = 7;
    def.nodes[2] = turned.nodes[2] = 5;
    LATTICE a = lattice_of(def), b = lattice_of(turned);
    kn_probe_input *in = a.in.probe, *there = b.in.probe;
    double worst = 0, peak = 0, twist = 0;
    for (int i = 0; i < 250; i++) {
        double t = 1e-3 * i, force[3], torque[3];
        *in = (kn_probe_input){.attached = true,
                               .position_m = {0.003 + 0.01 * t, -0.002, 0.02 - 0.008 * t + 0.0005},
                               .velocity_m_s = {0.01, 0, -0.008},
                               .orientation_wxyz = {cos(0.2 * t), sin(0.2 * t) * 0.6, sin(0.2 * t) * 0.8, 0}};
        there->attached = true;
        quarter(in->position_m, there->position_m);
        quarter(in->velocity_m_s, there->velocity_m_s);
        kn_turn_multiply(turn, in->orientation_wxyz, there->orientation_wxyz);
        step(&a), step(&b);
        quarter(a.out.probe[0].force_n, force);
        quarter(a.out.probe[0].torque_n_m, torque);
        for (int k = 0; k < 3; k++) {
            worst = fmax(worst, fabs(force[k] - b.out.probe[0].force_n[k]));
            twist = fmax(twist, fabs(torque[k] - b.out.probe[0].torque_n_m[k]));
            peak = fmax(peak, fabs(force[k]));
        }
    }
    printf("     %s, of %.2f N: %.1e N, %.1e N m\n", tool.name, peak, worst, twist);
    CHECK(peak > 0.3 && worst < 1e-8 * peak && twist < 1e-9 * peak);
}

TEST("turning the whole scene and the hand by 90 degrees turns forces and torques, to rounding")
{
    AT_END(kn_shape_drop) kn_shape parts = {0};
    kn_probe_def box = {.name = "box", .shape = KN_PROBE_BOX, .size_m = {0.02, 0.014, 0.02}, .edge_m = 0.002};
    turned_by_a_quarter(coupled(box, 0.4, 900, 3), KN_SKIN_SPLINE);
    turned_by_a_quarter(mallet(&parts), KN_SKIN_BILINEAR);
    if (!getenv("KN_NIGHT")) return;
    turned_by_a_quarter(mallet(&parts), KN_SKIN_SPLINE);
    turned_by_a_quarter(egg(&parts), KN_SKIN_SPLINE);
}
