// knead check: reads a scene as the server does and reports its properties, its cost and its problems.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/identify/affine_block.h"
#include "clients/sweep/replay_trace.h"
#include "clients/sweep/tick_cost.h"
#include "core/field.h"
#include "core/lattice/lattice.h"
#include "core/scene/scene.h"
#include "core/shape.h"
#include "core/solve/coarse.h"
#include "core/solve/kernel.h"
#include "core/solve/step_effort.h"
#include "core/solve/tool.h"
#include "core/solver_fixed.h"
#include "server/option_table.h"
#include "server/scene_change.h"
#include "server/served_object.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const char usage[] =
    "usage: knead check SCENE [OPTION]...\n"
    "       knead check --keys\n\n"
    "Describe a scene: size, cost, warnings. SCENE is a file, or the name of a scene that comes with Knead. An\n"
    "unusable scene is reported in one line, file:line:col: what is wrong, what was expected, with exit code 2.\n\n"
    "  --set KEY=VALUE   set a key of the scene\n"
    "  --quality NAME    describe the scene at its quality point NAME\n"
    "  --log LOG         for a scene with object.accuracy: replay a log with its wider cells and without them; exit 1\n"
    "                    if the forces differ by more than the scene's object.accuracy\n"
    "  --text            print the scene with every value written out, in SI units\n"
    "  --json            print the main figures and all warnings as JSON\n"
    "  --keys            list every key of a scene: unit, range, default, meaning\n\n"
    "Examples:\n"
    "    knead check dough\n"
    "    knead check bun --set material=clay --json\n"
    "    knead check dough --text >copy.yaml && knead check copy.yaml\n\n"
    "Exit codes: 0 ok, 1 the object.accuracy is missed, 2 bad input.\n";

// Print a warning and add it to the JSON list `warnings`.
__attribute__((format(printf, 1, 2))) static void warn(const char *format, ...)
{
    char text[300];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    printf("warning   %s\n", text);
    kn_result_text(kn_result_add("warnings"), "text", text);
}

// Print the size of a mesh and its elastic constants. The constants were measured on the mesh when the model was built.
// They show how the network of springs differs from the material.
static void print_net(const kn_model *model)
{
    const kn_simplices *mesh = model->def.mesh;
    const kn_net_moduli *own = &model->moduli;
    bool flat = mesh->dimension == 2;
    // The shear modulus is printed relative to the shear modulus of an isotropic body, E/(2(1 + nu)).
    double extent_m[3], isotropic = 1 / (2 * (1 + own->poisson));
    kn_model_def_extent(&model->def, extent_m);
    printf("object    %g x %g x %g mm, mean edge %.3g mm: %d nodes, %d %s, %d edges, %.4g kg\n", 1e3 * extent_m[0],
           1e3 * extent_m[1], 1e3 * extent_m[2], 1e3 * model->def.spacing_m, model->node_count, mesh->element_count,
           flat ? "triangles" : "tetrahedra", model->edge_count, kn_model_mass(model));
    printf("springs   E %.3f %.3f", own->young[0], own->young[flat ? 2 : 1]);
    if (!flat) printf(" %.3f", own->young[2]);
    printf(" times k1 along %s, nu %.3f, G %.2f times an isotropic body's; creep at a medium stress %+.1f %% off the "
           "material's\n",
           flat ? "x z" : "x y z", own->poisson, own->shear / isotropic, 100 * model->creep_error);
    if (model->def.pressure != KN_PRESSURE_NONE)
        printf("pressure  %d elements, %s, at rest %.6g Pa inside and outside; "
               "tetrahedra lock, so a press is a third too stiff\n",
               mesh->element_count,
               model->def.pressure == KN_PRESSURE_CELLS ? "each closed" : "one skin around all of them",
               model->def.inside_pressure_pa);
    // Warn about unwanted elastic properties that the geometry of the mesh causes.
    if (own->shear < 0.7 * isotropic) warn("the mesh is soft in shear, because of the directions of its edges");
    if (fabs(model->creep_error) > 0.1)
        warn("the creep of the mesh differs from the material's, whatever the stress area gamma is");
    if (model->top_count == 0) warn("no surface faces up: a plate would not touch the object");
}

// Print the box with the finer cells of a lattice with two resolutions. If the lattice is uniform, print the reason.
static void print_composite(const kn_scene *scene, const kn_model *model)
{
    const kn_model_def *def = &model->def;
    if (!model->composite) {
        printf("accuracy  %s: uniform\n",
               def->probe_count > 0 ? "the tools reach the whole object" : "there is no tool");
        return;
    }
    printf("accuracy  %g %% of the force: fine cells in the box", 100 * scene->accuracy);
    for (int k = 0; k < 3; k++) {
        // Subtract `origin`: node numbers start at a corner, but the scene's origin is at the centre of the base.
        double origin = k < 2 ? 0.5 * (def->nodes[k] - 1) : 0, h = 1e3 * def->spacing_m;
        printf(" %c %.3g..%.3g", "xyz"[k], h * (def->fine[0][k] - origin), h * (def->fine[1][k] - origin));
    }
    printf(" mm, cells of twice the size outside: %d nodes, %d edges\n", model->node_count - kn_composite_tied(model),
           kn_composite_edges(model));
    printf(
        "          knead check SCENE --log LOG replays a press on both lattices and prints the error and the time\n");
}

static void print_block(const kn_scene *scene, const kn_model *model)
{
    const kn_model_def *def = &scene->model;
    static const char *const structure[] = {"diagonals", "axis"};
    double h = def->spacing_m;
    const int *n = def->nodes;
    if (model->grid.flat)
        printf("object    flat, %g x %g mm, %g mm thick, spacing %g mm: %d x %d", 1e3 * h * (n[0] - 1),
               1e3 * h * (n[2] - 1), 1e3 * def->thickness_m, 1e3 * h, n[0], n[2]);
    else
        printf("object    %g x %g x %g mm, spacing %g mm: %d x %d x %d", 1e3 * h * (n[0] - 1), 1e3 * h * (n[1] - 1),
               1e3 * h * (n[2] - 1), 1e3 * h, n[0], n[1], n[2]);
    printf(" = %d nodes, %d edges (%s", model->grid.nodes, kn_grid_edges(&model->grid, NULL),
           structure[def->structure]);
    if (model->grid.diagonal > 0 && model->grid.diagonal < 1)
        printf(", %g times as stiff as the sides", model->grid.diagonal);
    printf("), %.4g kg\n", kn_model_mass(model));
    if (scene->accuracy > 0) print_composite(scene, model);
    if (def->pressure != KN_PRESSURE_NONE)
        printf("pressure  %d cells, %s, at rest %.6g Pa inside and outside\n", kn_grid_cells(&model->grid, NULL),
               def->pressure == KN_PRESSURE_CELLS ? "each closed" : "one skin around all of them",
               def->inside_pressure_pa);
}

// Print the elastic constants of a block's lattice: the spring k1 in every edge, between plates without friction.
static void print_springs(const kn_model *model)
{
    const kn_model_def *def = &model->def;
    if (def->mesh || def->nodes[1] == 1 || def->structure != KN_STRUCTURE_DIAGONALS || !(def->material.k1_pa > 0))
        return;
    const kn_material spring = {.k1_pa = def->material.k1_pa, .damper = KN_DAMPER_NONE};
    const kn_affine_structure structure = kn_affine_structure_of(def);
    const double stress_pa = 1e-3 * spring.k1_pa;
    kn_affine_block block;
    kn_affine_block_init(&block, &spring, &structure);
    if (!kn_affine_block_load(&block, 1, stress_pa)) return;
    const double strain = 1 - block.height;
    printf("springs   E %.3f times k1, nu %.3f, along the axes of the block\n",
           def->force_factor * stress_pa / strain / spring.k1_pa, (block.width - 1) / strain);
}

static void print_object(const kn_scene *scene, const kn_model *model)
{
    const kn_model_def *def = &scene->model;
    static const char *const support[] = {"bonded", "frictionless", "none", "a table with friction"};
    if (def->mesh) print_net(model);
    else print_block(scene, model);
    print_springs(model);
    if (def->force_factor != 1) printf("forces    of edges and gas are multiplied by %g\n", def->force_factor);
    printf("frame     scene: right-handed, z up, metres, origin at the centre of the object's base\n");
    printf("support   %s", support[def->support]);
    if (def->support == KN_SUPPORT_FRICTION) printf(" %g", def->support_friction);
    int held = 0;
    for (int i = 0; i < model->node_count && def->mesh; i++) held += model->support[i] & 4;
    if (held > 0) printf(", which holds %d of %d nodes", held / 4, model->node_count);
    printf("; gravity %g m/s^2 along -z\n", def->gravity_m_s2);
    if (held / 4 == model->node_count) printf("          note: the object cannot move; expected less support_depth\n");
}

// Print how a material without a spring acts. The damper c1 of the Voigt element and the force-dependent damper c2 are
// in series and act as one damper c = c1 c2/(c1 + c2) (second paper, equations 6 and 8). If c1 is much larger than c2,
// c1 hardly matters. The difference c/c2 - 1 = -c2/(c1 + c2) is largest where c2 is largest, that is at rest.
static void print_plastic(const kn_material *m)
{
    double c2 = kn_material_c2(m, 0), share = m->c1_pa_s / (m->c1_pa_s + c2), off = 1 - share;
    printf("plastic   no spring: all deformation remains; c1 and c2 act as one damper of %.4g Pa s at rest",
           c2 * share);
    bool depends = kn_material_thinning(m, m->p0_pa) > 0;
    printf(depends ? ", equal to c2 within %.2g %% at every stress\n" : "\n", 100 * off);
    if (depends && off > 0.05)
        warn("c1 and c2 in series differ from c2 by up to %.2g %%, above 5 %%: "
             "c1 is not much larger than c2 at rest and hides how c2 depends on the stress",
             100 * off);
}

static void print_material(const kn_model *model)
{
    static const char *const law[] = {"voigt, no state per edge", "linear", "table", "exact"};
    const kn_material *m = &model->law.mat;
    printf("material  k1 %.4g Pa, c1 %.4g Pa s", m->k1_pa, m->c1_pa_s);
    if (m->k1_pa > 0) printf(" (c1/k1 = %.3g s)", m->c1_pa_s / m->k1_pa);
    // A damper cannot move if its two stops coincide. The material then keeps no residual deformation.
    double in, out;
    bool rigid = kn_material_stroke(m, &in, &out);
    if (m->damper == KN_DAMPER_NONE) printf("; no damper: no deformation remains\n");
    else if (rigid) printf("; a damper without stroke: no deformation remains\n");
    else
        printf("; c2 %.4g Pa s at rest, %.4g Pa s from %.4g Pa on\n", kn_material_c2(m, 0), kn_material_c2(m, m->p1_pa),
               m->p1_pa);
    if (!rigid && m->stroke[1] > 0)
        printf("stroke    Voigt part a = %g to %g of an edge's length, %.3g when new: "
               "without load an edge has %.4g to %.4g times its original length\n",
               m->stroke[0], m->stroke[1], m->ratio, 1 + in, 1 + out);
    if (!rigid && m->k1_pa == 0) print_plastic(m);
    printf("law       %s", law[model->law.kind]);
    if (model->law.kind == KN_LAW_TABLE)
        printf(" of the damper in %d segments, error at most %.1e", KN_LAW_SEGMENTS, model->law.table_error);
    printf("\nlattice   inner edges along an axis have the stiffness kappa k1, kappa = %.4g m, "
           "and the stress area gamma kappa L0, gamma = %.2g\n",
           model->kappa_m, model->gamma);
}

// Return the memory that the model needs with its tables, bytes.
static size_t model_bytes(const kn_model *model)
{
    size_t bytes =
        sizeof *model + (size_t)model->node_count * sizeof(double) + (size_t)model->edge_count * sizeof(kn_edge);
    return bytes + (model->tables ? model->kernels->tables_size(model) : 0) + kn_composite_bytes(model) +
           kn_coarse_bytes(model);
}

// Print the predicted computing time of a tick, first for each part of the scene and then in total.
static void print_cost(const kn_model *model)
{
    const kn_solver_def *s = &model->def.solver;
    kn_tick_cost_part part[KN_TICK_COST_PARTS];
    int count = kn_tick_cost_parts(model, part);
    printf("cost      predicted, one core                  us  each CG iteration\n");
    for (int i = 0; i < count; i++)
        printf("          %-32s %7.1f %18.1f\n", part[i].name, part[i].once_us, part[i].iteration_us);
    // Solver settings of the scene itself, without a named quality such as fast.
    const kn_effort own = {s->iterations, s->iterations_max, s->tolerance, s->passes, s->linearization};
    double us = kn_tick_cost_us(model, &own, false);
    printf("          with one probe pressing: usually %.0f us, %.0f us at the cap of iterations; step %g us\n", us,
           kn_tick_cost_us(model, &own, true), 1e6 * s->dt_s);
    // An impact is a sudden change of the forces, for which the time step is solved again
    // (core/solve/step_effort.h). The time of such a step is printed separately.
    double blow = kn_tick_cost_blow_us(model, &own);
    if (blow > 0)
        printf("          in an impact a step is solved up to %d times: %.0f us at the cap of iterations\n",
               KN_IMPACT_PASSES, blow);
    if (kn_tick_cost_newton(model))
        warn("each edge is solved by Newton's method alone, about 40 times slower than edges in SIMD lanes");
    if (us > 1e6 * s->dt_s) warn("a step takes longer than real time");
}

// Print how much of its height the object loses under its own weight. The stress used is the mean over a column,
// because the stress is rho g H at the base and zero at the top. A bonded base multiplies the sag by 0.85, or by 0.58
// if the object contains gas. Both factors were measured on the block of dough.
static void print_sag(const kn_model_def *def)
{
    static const double seconds = 300, earth_m_s2 = 9.81;
    // If the scene has no gravity, predict the sag that the object would have under the earth's gravity.
    double g = def->gravity_m_s2 > 0 ? def->gravity_m_s2 : earth_m_s2, base = 1;
    if (def->support == KN_SUPPORT_BONDED) base = def->pressure == KN_PRESSURE_NONE ? 0.85 : 0.58;
    double extent_m[3];
    kn_model_def_extent(def, extent_m);
    const double height_m = extent_m[2] - (def->mesh ? fmin(def->support_depth_m, extent_m[2]) : 0); // what can sag
    double weight_pa = def->density_kg_m3 * g * height_m;
    double sag = base * 0.5 * weight_pa * kn_material_compliance(&def->material, seconds) * height_m / extent_m[2];
    // A lattice without diagonals collapses and an object without support falls, so there is no sag to predict.
    if (def->structure == KN_STRUCTURE_AXIS || def->support == KN_SUPPORT_NONE) return;
    // `flown` is the share of the height that the object loses after the first second.
    double flown = sag - base * 0.5 * weight_pa * kn_material_compliance(&def->material, 1) * height_m / extent_m[2];
    printf("sag       %s%.2g %% of its height in %g s under %.3g m/s^2%s\n", sag < 0.2 ? "about " : "more than ",
           100 * fmin(sag, 0.2), seconds, g, def->gravity_m_s2 > 0 ? "" : ", although the scene has no gravity");
    if (flown > 0.02 && def->gravity_m_s2 > 0)
        warn("the object does not keep its shape: the damper at rest is too soft for its weight");
}

static void print_solver(const kn_model *model)
{
    static const char *const how[] = {"blend", "secant", "tangent"};
    const kn_solver_def *s = &model->def.solver;
    const char *precision = s->precision == KN_PRECISION_F64 ? "f64" : "f32";
    if (s->kind == KN_SOLVER_RK4) {
        printf("solver    rk4 %s, dt %g s, mass scale %g; stable up to %.3g s\n", precision, s->dt_s, s->mass_scale,
               model->rk4_limit_s);
    } else if (s->kind == KN_SOLVER_FIXED) {
        const kn_fixed_model *f = model->fixed;
        printf("solver    fixed, dt %g s, %d passes of %d iterations; a node moves at %.3g m/s at most, an edge bears "
               "%.3g N\n",
               s->dt_s, s->passes, s->iterations, ldexp(f->lambda_m, KN_FIXED_U - 1) / s->dt_s,
               ldexp(f->phi_n, KN_FIXED_T - 1));
        printf("%s   %.2g %% of the force is left unsolved %d ms into a press that starts abruptly at 1 cm/s\n",
               f->error > KN_FIXED_ERROR ? "warning" : "error  ", 100 * f->error, KN_FIXED_TRIAL);
    } else {
        printf("solver    implicit %s, dt %g s, %s, %d to %d CG iterations (tolerance %g), %d pass%s\n", precision,
               s->dt_s, how[s->linearization], s->iterations, s->iterations_max, s->tolerance, s->passes,
               s->passes > 1 ? "es" : "");
        printf("kernels   %s\n", model->kernels->name);
        print_cost(model);
        if (model->isa == KN_ISA_BASE)
            warn("this processor has no fused multiply-add: "
                 "software computes it with the same bits, but far slower than real time");
    }
    // State, scratch and model must fit into memory together. Warn if their sum exceeds the memory of this machine.
    const size_t state = kn_state_size(model), scratch = kn_scratch_size(model);
    double bytes = (double)state + (double)scratch + (double)model_bytes(model);
    printf("memory    state %zu bytes, scratch %zu bytes, model %zu bytes\n", state, scratch, model_bytes(model));
    if (bytes > (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE))
        warn("the object needs more memory than this machine has");
}

// Print what a second thread would bring on this machine.
static void print_threads(kn_backend *b, const kn_model *model, double one_ms)
{
    char why[64];
    kn_helper *helper = kn_helper_create(why, sizeof why);
    if (!helper || !kn_helper_join(helper, b, model)) {
        printf("threads   one: %s\n", helper ? "the object is too small for a second one" : why);
        kn_helper_destroy(helper);
        return;
    }
    const double two_ms = 1e-6 * (double)kn_served_object_worst(b, helper, model, 0);
    printf("threads   with solver.threads 2 that worst tick takes %.2g ms instead of %.2g ms; the second thread was in "
           "time for %.0f %% of its work\n",
           two_ms, one_ms, 100 * kn_helper_share(helper));
    kn_result_number(kn_result(), "worst_two_threads_us", 1e3 * two_ms);
    kn_helper_destroy(helper);
}

// Print the deadline in units of work (core/solve/step_effort.h) and the time of the worst tick. The worst tick is
// computed on this machine, because the prediction does not know how often an impact repeats a part of the
// step.
static void print_deadline(const kn_scene *scene, const kn_model *model)
{
    kn_backend b;
    if (model->def.solver.kind != KN_SOLVER_IMPLICIT || model->def.probe_count == 0 || !kn_backend_cpu(&b, model))
        return;
    // Compare the worst tick under the deadline with the worst tick without one.
    const int64_t units = kn_served_object_deadline(&b, NULL, model, scene->budget_s);
    const double by_ms = 1e-6 * (double)kn_served_object_worst(&b, NULL, model, units),
                 free_ms = 1e-6 * (double)kn_served_object_worst(&b, NULL, model, 0);
    printf("deadline  %lld units of work, %.2g ns each here: "
           "the worst tick of a stroke at 5 cm/s takes %.2g ms, and %.2g ms without a deadline\n",
           (long long)units, 1e9 * KN_STEP_SHARE * scene->budget_s / (double)units, by_ms, free_ms);
    kn_result_integer(kn_result(), "deadline_units", units);
    kn_result_number(kn_result(), "worst_us", 1e3 * by_ms);
    kn_result_number(kn_result(), "worst_free_us", 1e3 * free_ms);
    print_threads(&b, model, free_ms);
    b.destroy(b.self);
    if (by_ms > 1) warn("the shortest step takes longer than 1 ms here: kneadd takes every force to zero");
}

// Print the named qualities (fast, balanced, accurate) that the scene defines.
static void print_quality(const kn_scene *scene, const kn_model *model)
{
    for (int q = 0; q < KN_QUALITY_OWN; q++) {
        const kn_effort *e = &scene->point[q].effort;
        if (!scene->point[q].defined) continue;
        printf("quality   %s: %d to %d CG iterations, %d pass%s", kn_quality_name((kn_quality)q), e->iterations,
               e->iterations_max, e->passes, e->passes > 1 ? "es" : "");
        if (scene->point[q].live) printf(", estimate %.0f us", kn_tick_cost_us(model, e, false));
        else printf(", another lattice or precision: cannot be selected while kneadd runs");
        printf(scene->quality == (kn_quality)q ? "; in force\n" : "\n");
    }
}

// Print the virtual coupling on the hand's side, and the scale between the force on the object and the force on the
// hand. Warn if the coupling is above the stability bound.
static void print_coupling(const kn_scene *scene)
{
    const kn_device_def *d = &scene->device;
    // Stability bound of the virtual coupling for this device, at 1 kHz and with the delay of the device.
    double bound = kn_coupling_delayed(d->damping_n_s_m, 1e-3, d->round_trip_s, d->hand.damping_n_s_m);
    printf("          coupling %g N/m, %g N s/m at a round trip of %g ms", d->hand.stiffness_n_m, d->hand.damping_n_s_m,
           1e3 * d->round_trip_s);
    if (d->force_scale != 1.0 || d->scale != 1.0)
        printf("; in the scene %g N/m, %g N s/m", d->coupling_n_m, d->coupling_n_s_m);
    printf("\n");
    if (d->force_scale != 1.0)
        printf("          the hand feels %g times the object's force; the object's force is clamped at %g N\n",
               d->force_scale, d->force_limit_n / d->force_scale);
    if (d->hand.stiffness_n_m > bound)
        warn("the coupling is above %.3g N/m, the limit of stability of this device: it will buzz at a wall", bound);
}

static void print_device(const kn_scene *scene)
{
    const kn_safety_limits *l = &scene->limits;
    printf("device    %s: clamp %g N and %g N m, guard %g N/ms, brake above %g m/s with %g N s/m\n", scene->device.name,
           l->clamp_n, l->torque_clamp_n_m, l->guard_n_per_ms, l->brake_m_s, l->brake_n_s_per_m);
    const double rate_hz = scene->rate_hz > 0 ? scene->rate_hz : 1000;
    if (rate_hz < 120) warn("at %g Hz a pose that comes half a period late lets the force fade", rate_hz);
    if (l->zero_ms - l->hold_ms < 17)
        printf("          poses at %g Hz: held for %d ms, which leaves %d ms to fade, so the clamp is at most %.3g N\n",
               rate_hz, l->hold_ms, l->zero_ms - l->hold_ms, fmax(l->clamp_n, 0.5 * (l->zero_ms - l->hold_ms)));
    printf(
        "          poses stop: force held for %d ms, zero after %d ms; poses back for %d ms: full force %g ms later\n",
        l->hold_ms, l->zero_ms, l->flow_ms, l->ramp_up_ms * fmax(1, 1e3 / rate_hz));
    print_coupling(scene);
    // Names of the measures in mesh messages, indexed by the bits of mesh_measures.
    static const char *const told[] = {"", ", stress", ", residual strain", ", stress, residual strain"};
    printf("mesh      %g Hz: positions%s\n", scene->mesh_hz, told[scene->mesh_measures]);
}

static void print_field(const kn_field *f)
{
    printf("mesh of %d triangles, %.4g x %.4g x %.4g mm, sampled on a grid of %.3g mm, %.2g MB", f->triangle_count,
           1e3 * (f->box_m[1][0] - f->box_m[0][0]), 1e3 * (f->box_m[1][1] - f->box_m[0][1]),
           1e3 * (f->box_m[1][2] - f->box_m[0][2]), 1e3 * f->cell_m, 4e-6 * f->n[0] * f->n[1] * f->n[2]);
}

// Print the shape and size of a tool.
static void print_size(const kn_probe_def *p)
{
    const double *size = p->size_m, r = 1e3 * p->radius_m, l = 1e3 * p->length_m;
    switch (p->shape) {
    case KN_PROBE_PLATE: printf("plate %g x %g mm", 1e3 * size[0], 1e3 * size[1]); return;
    case KN_PROBE_SPHERE: printf("sphere of radius %g mm", r); return;
    case KN_PROBE_CAPSULE: printf("capsule of radius %g mm, axis %g mm", r, l); return;
    case KN_PROBE_CYLINDER: printf("cylinder of radius %g mm, %g mm high", r, l); return;
    case KN_PROBE_MESH: print_field(p->parts->part[0].field); return;
    case KN_PROBE_UNION:
        printf("union of %d part%s, %.4g x %.4g x %.4g mm", p->parts->part_count, p->parts->part_count > 1 ? "s" : "",
               1e3 * kn_shape_span(p->parts, 0), 1e3 * kn_shape_span(p->parts, 1), 1e3 * kn_shape_span(p->parts, 2));
        return;
    default:
        printf("%s %g x %g x %g mm", p->shape == KN_PROBE_BOX ? "box" : "cross", 1e3 * size[0], 1e3 * size[1],
               1e3 * size[2]);
    }
}

// Print the contact parameters of a tool.
static void print_touch(const kn_probe_def *p)
{
    printf(", foundation %g N/m^3", p->foundation_n_m3);
    if (p->friction > 0) printf(", friction %g", p->friction);
    if (p->adhesion_pa > 0) printf(", adhesion %g Pa", p->adhesion_pa);
    if (p->grip_n > 0) printf(", grip up to %g N", p->grip_n);
    if (p->coupling_n_m > 0)
        printf("\n          coupled to its pose by %g N/m and %g N s/m, in rotation by %g N m/rad", p->coupling_n_m,
               p->coupling_n_s_m, KN_COUPLING_ARM_M * KN_COUPLING_ARM_M * p->coupling_n_m);
    else printf(", follows its pose rigidly");
}

// Return the largest radius of curvature among the parts of a tool. For a tool from a file it is the radius of the
// largest inner ball. Return infinity if the tool has a flat face.
static double roundest_m(const kn_shape *shape)
{
    double most_m = 0;
    for (int i = 0; i < shape->part_count; i++) {
        const kn_solid *s = &shape->part[i];
        if (s->kind == KN_SOLID_FIELD) most_m = fmax(most_m, s->field->fine_m);
        else if (s->kind == KN_SOLID_CYLINDER) most_m = fmax(most_m, s->half_m[0] + s->radius_m);
        else if (s->kind == KN_SOLID_BOX) return INFINITY;
        else most_m = fmax(most_m, s->radius_m);
    }
    return most_m;
}

static void print_probe(const kn_model *model, int index)
{
    const kn_probe_def *p = &model->def.probe[index];
    double h = model->def.spacing_m;
    printf("probe     %s: ", p->name);
    print_size(p);
    if (p->shape != KN_PROBE_PLATE) print_touch(p);
    else if (p->surface == KN_PLATE_SLIDES) printf(", slides without friction");
    if (p->shape == KN_PROBE_PLATE && p->adhesion_pa > 0) printf(", adhesion %g Pa", p->adhesion_pa);
    printf("\n");
    // Warn about a small tool: a narrow tool may pass between nodes, and with a small ball the hand feels single cells.
    if (p->shape == KN_PROBE_PLATE ? p->size_m[0] < h || p->size_m[1] < h : model->shape[index].fine_m < 0.5 * h)
        warn("%s is narrower than the spacing: it may pass between nodes", p->name);
    else if (p->shape != KN_PROBE_PLATE && roundest_m(&model->shape[index]) < 1.5 * h * (1 - 1e-9))
        warn("%s is smaller than 1.5 spacings (%g mm): the hand feels single cells", p->name, 1.5e3 * h);
}

// Warn about coarse cells. Measured with a plate and a ball pressed in by 5 mm: the forces of blocks of three cells of
// 1 cm are 8 to 50 % off those of cells of 2.5 mm, the forces of cells of 5 mm 3 to 10 %.
static void print_coarse(const kn_model_def *def)
{
    const int cells = def->nodes[2] - 1;
    if (!def->mesh && def->structure == KN_STRUCTURE_DIAGONALS && cells < 5 && def->force_factor == 1)
        warn("%d cells along z are few: forces may be 8 to 50 %% off; knead tradeoff --spacing measures by how much, "
             "and "
             "object.force_factor corrects them",
             cells);
}

// Warn about a lattice that does not resist shear. If only the sides of the cells and gas carry the load, the cells
// lean to one side. Rounding errors decide to which side, so the shape of the object depends on them. Measured: if
// diagonal_stiffness is below 0.003, moving the nodes by 2 % of the spacing halves the bulge beside a press. From 0.01
// on, moving the nodes makes no difference.
static void print_shear(const kn_model_def *def)
{
    bool axis = def->structure == KN_STRUCTURE_AXIS, gas = def->pressure != KN_PRESSURE_NONE;
    if (axis) warn("a lattice without diagonals cannot keep its shape; once folded it may swing for ever");
    if (gas && !def->mesh && (axis || def->diagonal_stiffness < 0.01))
        warn("gas does not resist shear: below a diagonal_stiffness of 0.01 rounding errors decide the shape");
    if (def->pressure == KN_PRESSURE_OBJECT)
        warn("one pressure for the object does not keep single cells from turning inside out");
}

// Fill the JSON result with the properties of scene and model.
static void tell_result(const kn_scene *scene, const kn_model *model)
{
    const kn_solver_def *s = &model->def.solver;
    const kn_effort own = {s->iterations, s->iterations_max, s->tolerance, s->passes, s->linearization};
    // Computing times are predicted for the implicit solver only, so leave them out for other solvers.
    const bool stepped = s->kind == KN_SOLVER_IMPLICIT;
    json_t *to = kn_result();
    char hash[24];
    double extent_m[3];
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)scene->text_hash);
    kn_model_def_extent(&scene->model, extent_m);
    kn_result_text(to, "scene", scene->name);
    if (*scene->label) kn_result_text(to, "label", scene->label);
    kn_result_text(to, "hash", hash);
    for (int k = 0; k < 3; k++) kn_result_number(to, (const char *[]){"x_m", "y_m", "z_m"}[k], extent_m[k]);
    // Nodes whose motion is interpolated from other nodes are not counted.
    kn_result_integer(to, "nodes", model->node_count - (model->composite ? kn_composite_tied(model) : 0));
    kn_result_integer(to, "edges",
                      model->def.mesh    ? model->edge_count
                      : model->composite ? kn_composite_edges(model)
                                         : kn_grid_edges(&model->grid, NULL));
    kn_result_number(to, "mass_kg", kn_model_mass(model));
    kn_result_number(to, "k1_pa", model->law.mat.k1_pa);
    kn_result_number(to, "c1_pa_s", model->law.mat.c1_pa_s);
    kn_result_number(to, "dt_s", s->dt_s);
    kn_result_number(to, "usual_us", stepped ? kn_tick_cost_us(model, &own, false) : NAN);
    kn_result_number(to, "cap_us", stepped ? kn_tick_cost_us(model, &own, true) : NAN);
    kn_result_integer(to, "state_bytes", (int64_t)kn_state_size(model));
    kn_result_integer(to, "scratch_bytes", (int64_t)kn_scratch_size(model));
    kn_result_integer(to, "model_bytes", (int64_t)model_bytes(model));
    kn_result_text(to, "device", scene->device.name);
    kn_result_number(to, "mesh_hz", scene->mesh_hz);
    for (int p = 0; p < scene->model.probe_count; p++)
        kn_result_text(kn_result_add("probes"), "name", scene->model.probe[p].name);
}

// Print the label in lines of at most 120 columns, broken between words.
static void print_label(const char *label)
{
    const size_t most = 110;
    label += strspn(label, " ");
    for (const char *name = "label"; *label; name = "") {
        size_t n = strlen(label);
        if (n > most)
            for (n = most; n > 0 && label[n] != ' '; n--) continue;
        if (n == 0) n = strcspn(label, " "); // a word longer than a line
        printf("%-9s %.*s\n", name, (int)n, label);
        label += n + strspn(label + n, " ");
    }
}

static void print_scene(const kn_scene *scene, const kn_model *model)
{
    const kn_model_def *def = &scene->model;
    tell_result(scene, model);
    printf("scene     %s, version %d, hash %016llx\n", scene->name, scene->version,
           (unsigned long long)scene->text_hash);
    print_label(scene->label);
    print_object(scene, model);
    print_material(model);
    print_sag(def);
    kn_state *settled = kn_scene_settle(model);
    const char *sinks = kn_scene_sinks(model, settled);
    if (sinks) warn("%s", sinks);
    kn_state_destroy(settled);
    print_solver(model);
    print_deadline(scene, model);
    print_quality(scene, model);
    print_device(scene);
    for (int p = 0; p < def->probe_count; p++) print_probe(model, p);
    if (def->probe_count == 0) warn("no probe: nothing can touch the object");
    if (def->support == KN_SUPPORT_NONE && def->gravity_m_s2 > 0) warn("nothing holds the object: it falls");
    print_shear(def);
    print_coarse(def);
}

static int check(const char *path, const char *const *sets, int count, bool text)
{
    char error[512];
    kn_scene *scene = kn_scene_load(path, sets, count, error, sizeof error);
    if (!scene) return kn_complain("check", KN_EXIT_USAGE, "%s", error);
    // If the model cannot be built, the message names the line of the solver in the scene, because no better place is
    // known.
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    if (!model) kn_complain("check", KN_EXIT_USAGE, "%s:%d:%d: %s", path, scene->solver_line, scene->solver_col, error);
    else if (text) fputs(scene->text, stdout);
    else print_scene(scene, model);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return model ? KN_EXIT_OK : KN_EXIT_USAGE;
}

// ---- a log on the scene and on its uniform lattice

// Print the differences of force and shape between the scene and the scene with a uniform lattice. Return
// KN_EXIT_FAILED if the stated accuracy is missed.
static int say(const kn_replay_trace *own, const kn_replay_trace *uniform, const kn_scene *scene)
{
    const kn_replay_tally *t = &own->tally;
    double asked = scene->accuracy, force = kn_contact_force_error(own, uniform),
           shape = kn_contact_shape_error(own, uniform);
    bool keeps = force <= asked;
    if (own->diverged || uniform->diverged)
        return kn_complain("check", KN_EXIT_FAILED, "%s diverged: there is no force to compare",
                           own->diverged ? "the scene" : "its uniform lattice");
    if (isnan(force)) return kn_complain("check", KN_EXIT_USAGE, "the log contains no contact, expected a press");
    printf("accuracy  force %.2g %% off the uniform lattice, %g %% asked: %s; peak %.4g N, uniform %.4g N\n",
           100 * force, 100 * asked, keeps ? "kept" : "missed", kn_contact_force_peak(own),
           kn_contact_force_peak(uniform));
    printf("          shape %.2g %% off; a tick takes %.0f us, uniform %.0f us, ratio %.2f\n", 100 * shape,
           own->median_us, uniform->median_us, own->median_us / uniform->median_us);
    // If a tool outside the box of fine cells presses coarse cells, the log says little about the accuracy, so print a
    // warning.
    if (t->outside)
        printf("warning   %s pressed up to %.2g mm outside its reach, for %lld ms in all, where the cells are coarse\n",
               scene->model.probe[t->outside_probe].name, 1e3 * t->outside_m, (long long)t->outside);
    if (keeps) return KN_EXIT_OK;
    printf("          a larger object.margin may help, or a probes.NAME.reach that contains all places of the probe\n");
    return KN_EXIT_FAILED;
}

// Check if a scene with two lattice resolutions keeps its stated object.accuracy. A log is replayed on the scene itself
// and on the same scene with a uniform lattice of cells of object.spacing. Print the result and return an exit code: 1
// if the accuracy is missed. `sets` holds the `count` arguments of the option --set and must have room for one more.
static int check_log(const char *path, const char *log, const char **sets, int count)
{
    char error[512], set[64];
    kn_replay_trace own = {0}, uniform = {0};
    kn_replay_def def = {.log_path = log, .scene_path = path, .sets = sets, .set_count = count + 1, .afresh = true};
    kn_scene *scene = kn_scene_load(path, sets, count, error, sizeof error);
    if (!scene) return kn_complain("check", KN_EXIT_USAGE, "%s", error);
    // Replay the log twice: with the stated accuracy, and with a uniform lattice. The last entry of `sets` selects one
    // of the two.
    snprintf(set, sizeof set, "object.accuracy=%.17g", scene->accuracy);
    sets[count] = set;
    bool stated = scene->accuracy > 0;
    bool played = stated && kn_replay_log_check(&def, path, scene, error, sizeof error) &&
                  kn_replay_trace_play(&own, &def, error, sizeof error);
    sets[count] = "object.accuracy=0";
    played = played && kn_replay_trace_play(&uniform, &def, error, sizeof error);
    if (!stated) snprintf(error, sizeof error, "%s: has no object.accuracy, which --log needs", path);
    int code = played ? say(&own, &uniform, scene) : kn_complain("check", KN_EXIT_USAGE, "%s", error);
    kn_scene_destroy(scene);
    kn_replay_trace_free(&own);
    kn_replay_trace_free(&uniform);
    return code;
}

typedef struct options {
    const char **sets, *log; // sets: settings of the scene, from --set and --quality
    int count;
    bool text, json;
} options;

static void print_keys(void)
{
    for (const char *const *line = kn_scene_keys(); *line; line++) puts(*line);
}

static int run(options *o, int argc, char **argv)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("keys", ANSWER, .call = print_keys),
        KN_OPTION("text", FLAG, AT(text)),
        KN_OPTION("set", LIST, AT(sets), .count = offsetof(options, count)),
        KN_OPTION("quality", LIST, AT(sets), .count = offsetof(options, count), .map = kn_quality_set,
                  .expected = kn_quality_names),
        KN_OPTION("log", TEXT, AT(log)),
        KN_OPTION("json", FLAG, AT(json)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = usage};
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind != 1) return kn_complain("check", KN_EXIT_USAGE, "expected one scene file; see --help");
    if (o->json && (o->log || o->text))
        return kn_complain("check", KN_EXIT_USAGE, "--json: expected neither --log nor --text with it");
    if (o->json) kn_result_open();
    const char *path;
    if (kn_command_scene("check", &path, argv[optind]) != KN_EXIT_OK) return KN_EXIT_USAGE;
    return o->log ? check_log(path, o->log, o->sets, o->count) : check(path, o->sets, o->count, o->text);
}

int kn_check_main(int argc, char **argv)
{
    // check_log appends one setting, so allocate one entry more than the command line can give.
    options o = {.sets = calloc((size_t)argc + 1, sizeof *o.sets)};
    const int code = o.sets ? run(&o, argc, argv) : KN_EXIT_INTERNAL;
    free(o.sets);
    return code;
}
