// End stops of the damper. One edge is driven by hand, by the reference (law.h), by every kernel and by Runge-Kutta.
// Then whole blocks.
#include "core/solve/kernel.h"
#include "core/network.h"
#include "core/scene/scene.h"
#include "core/solve/solver.h"
#include "tests/check.h"
#include "tests/physics/press.h"

// ---- one edge, 1 cm, driven 1 -> 0.5 -> 1.5 -> 1 at 0.125 of its length a second

#define CYCLE_S 16.0

static double driven_strain(double t)
{
    if (t < 4) return -0.125 * t;
    return t < 12 ? -0.5 + 0.125 * (t - 4) : 0.5 - 0.125 * (t - 12);
}

static kn_material element(double c2, double a0, double a_min, double a_max)
{
    return (kn_material){.k1_pa = 470 * GF_CM2,
                         .c1_pa_s = 2500 * GF_CM2,
                         .damper = KN_DAMPER_CONSTANT,
                         .c2_pa_s = c2 * GF_CM2,
                         .ratio = a0,
                         .stroke = {a_min, a_max}};
}

typedef struct edge_run {
    double peak_pa, missing;                // share of the work neither stored nor dissipated
    double least_rate_w;                    // smallest dissipation of a step, W per unit volume
    double shortest, longest;               // length that the edge would relax to, over its rest length
    double invariant[2];                    // smallest and largest (a - c2/(c1 + c2)) L
    int turns;                              // how often the damper stopped or came free
    double stress_pa[16001], strain[16001]; // s, u of each step
} edge_run;

// The reference: law.h (1) and (2), an edge of rest length 1 with gamma = 1.
static edge_run *drive_referee(const kn_material *mat, double dt)
{
    edge_run *r = calloc(1, sizeof *r);
    kn_law law;
    kn_law_build(&law, mat, dt, true);
    bool rigid = law.kind == KN_LAW_VOIGT, stopped = false;
    double u = 0, work = 0, spent = 0, kept = mat->c2_pa_s / (mat->c1_pa_s + mat->c2_pa_s);
    r->shortest = r->longest = 1;
    r->invariant[0] = INFINITY;
    r->invariant[1] = -INFINITY;
    for (int i = 0; i < (int)lround(CYCLE_S / dt); i++) {
        double l = driven_strain(i * dt), w = (driven_strain((i + 1) * dt) - l) / dt, z = l - u;
        double b = law.a_pa_s * w + mat->k1_pa * u, free_s = kn_law_stress(&law, b);
        double s = rigid ? b : kn_law_stop(&law, free_s, b, z - law.in, law.out - z);
        double rate = (s - mat->k1_pa * u) / law.a_pa_s, flow = w - rate;
        double lost = mat->c1_pa_s * rate * rate + s * flow;
        r->least_rate_w = fmin(r->least_rate_w, lost);
        work += dt * s * w;
        spent += dt * (lost + 0.5 * dt * mat->k1_pa * rate * rate); // loss of the spring's energy by backward Euler
        u += dt * rate;
        r->peak_pa = fmax(r->peak_pa, fabs(s));
        r->turns += i > 0 && (s != free_s) != stopped;
        stopped = s != free_s;
        double length = 1 + driven_strain((i + 1) * dt), left = length - u; // with the Voigt element relaxed
        r->shortest = fmin(r->shortest, left);
        r->longest = fmax(r->longest, left);
        double invariant = mat->ratio + u - kept * length;
        r->invariant[0] = fmin(r->invariant[0], invariant);
        r->invariant[1] = fmax(r->invariant[1], invariant);
        r->stress_pa[i] = s;
        r->strain[i] = u;
    }
    r->missing = fabs(work - 0.5 * mat->k1_pa * u * u - spent) / work;
    return r;
}

static const struct {
    double c2, a0, a_min, a_max, peak;
} cycles[] = {{8330, 0.5, 0.3, 0.7, 385}, {8330, 0.9, 0.05, 0.95, 523}, {8330, 1, 0, 1, 548}, {8330, 1, 1, 1, 548},
              {100, 0.5, 0.3, 0.7, 413},  {100, 0.5, 0.1, 0.9, 339},    {100, 1, 1, 1, 548}};

TEST("an edge with stops has the predicted peak stress, balances its energy to 1e-6 of the work and never creates "
     "energy")
{
    for (size_t i = 0; i < sizeof cycles / sizeof *cycles; i++) {
        kn_material mat = element(cycles[i].c2, cycles[i].a0, cycles[i].a_min, cycles[i].a_max);
        edge_run *r = drive_referee(&mat, 1e-3);
        printf("     c2 %.0f, a %.2f in %.2f..%.2f: peak %.0f gf/cm^2, %d turns, %.1e of the work missing\n",
               cycles[i].c2, cycles[i].a0, cycles[i].a_min, cycles[i].a_max, r->peak_pa / GF_CM2, r->turns, r->missing);
        CHECK_NEAR(r->peak_pa / GF_CM2, cycles[i].peak, 1);
        CHECK(r->missing <= 1e-6);
        CHECK(r->least_rate_w >= 0);
        CHECK(r->turns <= 4); // a stop is met and left once each way, without chatter
        free(r);
    }
}

TEST("the permanent strain stays within a0/a_max .. a0/a_min of the rest length")
{
    for (size_t i = 0; i < sizeof cycles / sizeof *cycles; i++) {
        kn_material mat = element(cycles[i].c2, cycles[i].a0, cycles[i].a_min, cycles[i].a_max);
        edge_run *r = drive_referee(&mat, 1e-3);
        CHECK(r->shortest >= cycles[i].a0 / cycles[i].a_max - 1e-9);
        CHECK(r->longest <= cycles[i].a0 / cycles[i].a_min + 1e-9);
        free(r);
    }
}

TEST("with a_min = a_max an edge equals a Voigt edge, and with a stroke of 1e-10 within 1e-6")
{
    kn_material bare = element(100, 0, 0, 0), rigid = element(100, 1, 1, 1),
                tight = element(100, 0.999, 0.999 - 1e-10, 0.999);
    bare.damper = KN_DAMPER_NONE;
    edge_run *voigt = drive_referee(&bare, 1e-3), *one = drive_referee(&rigid, 1e-3),
             *almost = drive_referee(&tight, 1e-3);
    double worst = 0;
    for (int i = 0; i < 16000; i++) {
        CHECK(one->stress_pa[i] == voigt->stress_pa[i]);
        worst = fmax(worst, fabs(almost->stress_pa[i] - voigt->stress_pa[i]) / voigt->peak_pa);
    }
    CHECK_NEAR(worst, 0, 1e-6);
    free(voigt);
    free(one);
    free(almost);
}

TEST("without a spring, (a - c2/(c1 + c2)) L is invariant")
{
    kn_material mat = element(100, 0.5, 0, 0);
    mat.k1_pa = 0;
    edge_run *r = drive_referee(&mat, 1e-3);
    CHECK_NEAR(r->invariant[0], r->invariant[1], 1e-12);
    free(r);
}

// ---- the same edge as a lattice of two nodes

static kn_model_def bar_def(const kn_material *mat, kn_precision precision, kn_isa isa)
{
    kn_model_def def = kn_model_def_default();
    def.material = *mat;
    def.nodes[0] = def.nodes[1] = 1;
    def.nodes[2] = 2;
    def.spacing_m = 0.01;
    def.structure = KN_STRUCTURE_AXIS;
    def.solver.precision = precision;
    def.solver.isa = isa;
    return def;
}

static void keep_largest(double error[3], double one)
{
    for (int k = 0; k < 3; k++)
        if (one > error[k]) {
            double smaller = error[k];
            error[k] = one;
            one = smaller;
        }
}

// Return the largest difference between a kernel's stress and the reference's, relative to the peak, leaving out the
// `but` worst steps. Positions and velocities are prescribed.
static double kernel_error(const kn_material *mat, kn_precision precision, kn_isa isa, int but)
{
    double error[3] = {0}; // the largest ones, descending
    kn_model_def def = bar_def(mat, precision, isa);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_work *work = kn_state_work(state);
    edge_run *r = drive_referee(mat, 1e-3);
    size_t top = model->offset[1] + 2 * model->stride;
    double area = model->kappa_m * def.spacing_m;
    for (int i = 0; i < 16000; i++) {
        double w = (driven_strain((i + 1) * 1e-3) - driven_strain(i * 1e-3)) / 1e-3;
        kn_real_set(model, work->guess, top, w * def.spacing_m);
        memset(work->r, 0, kn_state_field(model, 3));
        memset(work->p, 0, kn_state_field(model, 6));
        memset(work->row_moved, 1, (size_t)model->row_count);
        model->kernels->edge(model, state, KN_LINEARIZATION_BLEND, false);
        double inertia = kn_real_get(model, state->velocity, top) - kn_real_get(model, work->guess, top);
        double force = -kn_real_get(model, work->r, top) + model->node_mass_kg[1] / 1e-3 * inertia;
        keep_largest(error, fabs(force / area - r->stress_pa[i]) / r->peak_pa);
        kn_real_set(model, state->velocity, top, w * def.spacing_m);
        kn_real_set(model, state->displacement, top, driven_strain((i + 1) * 1e-3) * def.spacing_m);
    }
    free(r);
    return error[but];
}

// In f32 a stop may be met one step sooner or later, and that step's force is neither of the two values.
TEST("every kernel gives the reference force: to 1e-9 in f64, and to 1e-4 in f32 except in steps that meet a stop")
{
    kn_material flowing = dough;
    flowing.ratio = 0.9;
    flowing.stroke[0] = 0.5;
    flowing.stroke[1] = 0.95;
    for (int isa = KN_ISA_BASE; isa <= KN_ISA_AVX512; isa++) {
        if (!kn_isa_supported((kn_isa)isa)) continue;
        for (size_t i = 0; i <= sizeof cycles / sizeof *cycles; i++) {
            kn_material mat = i < sizeof cycles / sizeof *cycles
                                  ? element(cycles[i].c2, cycles[i].a0, cycles[i].a_min, cycles[i].a_max)
                                  : flowing;
            double single = kernel_error(&mat, KN_PRECISION_F32, (kn_isa)isa, 2);
            double twice = kernel_error(&mat, KN_PRECISION_F64, (kn_isa)isa, 0);
            CHECK_NEAR(kernel_error(&mat, KN_PRECISION_F32, (kn_isa)isa, 0), 0, 0.02);
            if (isa == KN_ISA_BASE) printf("     case %zu: f32 %.1e, f64 %.1e of the peak\n", i, single, twice);
            CHECK_NEAR(single, 0, 1e-4);
            CHECK_NEAR(twice, 0, 1e-9);
        }
    }
}

// The same as kernel_error, from the force that holds the lower node.
static double runge_kutta_error(const kn_material *mat, double dt, int but)
{
    kn_model_def def = bar_def(mat, KN_PRECISION_F64, KN_ISA_AUTO);
    def.solver.kind = KN_SOLVER_RK4;
    def.solver.dt_s = dt;
    def.solver.mass_scale = 1e9; // both nodes are held, so only the edge's own time constant matters
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    edge_run *r = drive_referee(mat, 1e-3);
    double error[3] = {0}, velocity[2][3] = {{0}}, reaction[2][3], area = model->kappa_m * def.spacing_m;
    uint8_t fixed[2] = {7, 7};
    kn_boundary boundary = {fixed, (const double(*)[3])velocity, NULL, reaction};
    int per = (int)lround(1e-3 / dt);
    for (int i = 0; i < 16000; i++) {
        velocity[1][2] = (driven_strain((i + 1) * 1e-3) - driven_strain(i * 1e-3)) / 1e-3 * def.spacing_m;
        for (int k = 0; k < per; k++) kn_rk4_step(model, state, &boundary, kn_state_scratch(state)->stages);
        keep_largest(error, fabs(-reaction[0][2] / area - r->stress_pa[i]) / r->peak_pa);
    }
    free(r);
    return error[but];
}

TEST("Runge-Kutta with stops matches the implicit step within 1e-3 of the peak at 1 ms and 1e-4 at 0.1 ms")
{
    for (int fine = 0; fine < 2; fine++)
        for (size_t i = 0; i < sizeof cycles / sizeof *cycles; i++) {
            kn_material mat = element(cycles[i].c2, cycles[i].a0, cycles[i].a_min, cycles[i].a_max);
            double error = runge_kutta_error(&mat, fine ? 1e-4 : 1e-3, 2);
            CHECK_NEAR(error, 0, fine ? 1e-4 : 1e-3);
        }
}

// ---- the same element on the bench

TEST("the one-dimensional integrator with stops matches the implicit step at 1 ms within 1e-4 of the peak stress")
{
    for (size_t i = 0; i < sizeof cycles / sizeof *cycles; i++) {
        kn_material mat = element(cycles[i].c2, cycles[i].a0, cycles[i].a_min, cycles[i].a_max);
        kn_network net = kn_network_of(&mat);
        kn_network_state now = {0};
        edge_run *r = drive_referee(&mat, 1e-3);
        double error[3] = {0};
        for (int leg = 0, step = 0; leg < 3; leg++) {
            int until = leg == 0 ? 4000 : leg == 1 ? 12000 : 16000;
            kn_drive drive = {.kind = KN_DRIVE_STRAIN,
                              .value = now.strain,
                              .start_s = step * 1e-3,
                              .rate_per_s = leg == 1 ? -0.125 : 0.125};
            CHECK(kn_network_jump(&net, &now, &drive));
            for (; step < until; step++) {
                CHECK(kn_network_advance(&net, &now, &drive, (step + 1) * 1e-3, 1e-9));
                keep_largest(error, fabs(-now.stress_pa - r->stress_pa[step]) / r->peak_pa);
            }
        }
        printf("     case %zu: %.1e, in %ld steps\n", i, error[2], now.steps);
        CHECK_NEAR(error[2], 0, 1e-4);
        free(r);
    }
}

// ---- blocks and meshes

// Return the force of a plate that goes 3 mm into an object and stays. The object comes from a scene, with this
// material.
static double *press_scene(const char *object, const char *material, const char *precision, int steps)
{
    char text[600], error[512];
    snprintf(text, sizeof text,
             "version: 1\nobject: %s\nmaterial: %s\ndensity: 1.2 g/cm^3\nsupport: bonded\ndevice: bench\n"
             "solver: {precision: %s, linearization: secant, passes: 5, tolerance: 1e-8, iterations_max: 1000}\n"
             "probes: [{name: plate, shape: plate, size: [1 cm, 6 cm]}]\n",
             object, material, precision);
    OWN(kn_scene) *scene =
        kn_scene_parse(KN_SOURCE_DIR "/core/scenes/pressed.yaml", text, strlen(text), NULL, 0, error, sizeof error);
    if (!scene) KN_TEST_FAIL("%s", error);
    OWN(kn_model) *model = build(&scene->model);
    OWN(kn_state) *state = kn_state_create(model);
    double *force = calloc((size_t)steps, sizeof *force), top = 0;
    for (int i = 0; i < model->node_count; i++) top = fmax(top, model->rest_m[i][2]);
    for (int i = 0; i < steps; i++) {
        double depth = fmin(0.01 * (i + 1) * 1e-3, 0.003);
        kn_input in = {0};
        kn_output out;
        in.probe[0].attached = true;
        in.probe[0].position_m[2] = top - depth;
        in.probe[0].velocity_m_s[2] = depth < 0.003 ? -0.01 : 0;
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
        force[i] = out.probe[0].force_n[2];
    }
    return force;
}

static double largest_gap(const double *a, const double *b, int steps)
{
    double gap = 0, peak = 0;
    for (int i = 0; i < steps; i++) {
        gap = fmax(gap, fabs(a[i] - b[i]));
        peak = fmax(peak, fabs(a[i]));
    }
    CHECK(peak > 0.1);
    return gap / peak;
}

TEST("blocks and meshes with no stroke, or a stroke of 1e-10 (1e-7 in f32), press back like Voigt bodies")
{
    static const char *const object[] = {"{size: [4 cm, 4 cm, 2 cm], spacing: 1 cm}",
                                         "{mesh: meshes/bun.msh, mesh_unit: mm}"};
    enum { STEPS = 400 };
    for (int o = 0; o < 2; o++)
        for (int f32 = 0; f32 < 2; f32++) {
            static const char *const tight[] = {"[0.9999999999, 1]", "[0.9999999, 1]"}, *const precision[] = {"f64",
                                                                                                              "f32"};
            char material[200];
            double *voigt = press_scene(object[o], "{k1: 46 kPa, c1: 245 kPa s, damper: none}", precision[f32], STEPS);
            double *rigid = press_scene(object[o], "dough-viscoelastic", precision[f32], STEPS);
            snprintf(material, sizeof material,
                     "{k1: 46 kPa, c1: 245 kPa s, damper: constant, c2: 10 kPa s, stroke: %s, "
                     "ratio: 1}",
                     tight[f32]);
            double *almost = press_scene(object[o], material, precision[f32], STEPS);
            double gap = largest_gap(voigt, almost, STEPS);
            printf("     %s %s: %.1e of the force\n", o ? "mesh" : "block", precision[f32], gap);
            CHECK_NEAR(gap, 0, f32 ? 1e-3 : 1e-6);
            CHECK_NEAR(largest_gap(voigt, rigid, STEPS), 0, 0.01); // of 46 compared with 46.09 kPa
            free(voigt);
            free(rigid);
            free(almost);
        }
}

TESTS_MAIN
