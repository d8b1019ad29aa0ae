#include "core/solve/contact.h"
#include "core/shape.h"
#include "tests/core/scene_text.h"

#define SCENES KN_SOURCE_DIR "/core/scenes/"
static const char *const scenes[] = {"dough-diagonals.yaml", "dough-small.yaml", "jelly.yaml", "clay.yaml",
                                     "dough.yaml",           "pinch.yaml"};

static kn_scene *dough_with(const char *set) { return load_scene(scenes[0], &set, set != NULL); }

static kn_scene *parse(const char *text, const char *const *sets) { return scene_of("test.yaml", text, sets); }

// Return the error message for dough-diagonals.yaml with that --set.
static const char *complaint(const char *set)
{
    static char error[512];
    error[0] = '\0';
    kn_scene_destroy(kn_scene_load(SCENES "dough-diagonals.yaml", &set, 1, error, sizeof error));
    return error;
}

static int same(const kn_scene *a, const kn_scene *b)
{
    return strcmp(a->text, b->text) == 0 && a->text_hash == b->text_hash &&
           memcmp(&a->model, &b->model, sizeof a->model) == 0 &&
           memcmp(&a->limits, &b->limits, sizeof a->limits) == 0 && a->mesh_hz == b->mesh_hz &&
           memcmp(&a->device, &b->device, sizeof a->device) == 0 && a->version == b->version;
}

TEST("every block scene can be built, and its canonical text gives the same scene and the same text")
{
    for (int i = 0; i < COUNT(scenes); i++) {
        OWN(kn_scene) *scene = load_scene(scenes[i], NULL, 0), *again = parse(scene->text, NULL);
        OWN(kn_model) *model = build(&scene->model);
        CHECK_STR(scene->name, scenes[i]);
        CHECK(same(scene, again) && model->def.probe_count == 2);
    }
}

TEST("dough is the identified material of the first paper per centimetre of specimen")
{
    OWN(kn_scene) *scene = dough_with(NULL), *small = load_scene(scenes[1], NULL, 0);
    const kn_model_def *def = &scene->model;
    const kn_model_def paper = kn_model_def_default();
    CHECK_NEAR(def->material.k1_pa / paper.material.k1_pa, 1, 1e-15);
    CHECK_NEAR(def->material.c1_pa_s / paper.material.c1_pa_s, 1, 1e-15);
    CHECK_NEAR(def->material.alpha_pa_s / paper.material.alpha_pa_s, 1, 1e-15);
    CHECK_NEAR(def->material.beta_per_pa / paper.material.beta_per_pa, 1, 1e-15);
    CHECK_NEAR(def->material.p0_pa / paper.material.p0_pa, 1, 1e-15);
    CHECK_NEAR(def->material.p1_pa / paper.material.p1_pa, 1, 1e-15);
    CHECK(def->nodes[0] * def->nodes[1] * def->nodes[2] == 847);
    CHECK(def->density_kg_m3 == 1200 && def->gravity_m_s2 == 0 && def->support == KN_SUPPORT_BONDED);
    CHECK(scene->limits.clamp_n == 40 && strcmp(scene->device.name, "bench") == 0);
    CHECK(small->model.nodes[0] * small->model.nodes[1] * small->model.nodes[2] == 144);
}

static const char in_cm[] = "version: 1\n"
                            "object: {size: [5 cm, 5 cm, 3 cm], spacing: 5 mm}\n"
                            "material: {k1: 5 kPa, c1: 0.05 kPa s, damper: constant, c2: 2e3 Pa s}\n"
                            "density: 1.05 g/cm^3\nsupport: none\n"
                            "device: {profile: touch, guard: 3 N/ms}\n"
                            "probes: [{name: ball, shape: sphere, radius: 12 mm, foundation: 20 N/cm^3}]\n";
static const char in_si[] = "version: 1\n"
                            "object: {size: [0.05 m, 0.05 m, 0.03 m], spacing: 0.005 m}\n"
                            "material: {k1: 5000 Pa, c1: 50 Pa s, damper: constant, c2: 2000 Pa s}\n"
                            "density: 1050 kg/m^3\nsupport: none\n"
                            "device: {profile: touch, guard: 3000 N/s}\n"
                            "probes: [{name: ball, shape: sphere, radius: 0.012 m, foundation: 2e7 N/m^3}]\n";

TEST(
    "a scene in centimetres and the same scene in metres give the same bits; missing settings have the core's defaults")
{
    OWN(kn_scene) *a = parse(in_cm, NULL), *b = parse(in_si, NULL);
    OWN(kn_scene) *told = parse(in_cm, SETS("probes.ball.foundation=2.5e7 N/m^3"));
    const kn_solver_def core = kn_model_def_default().solver;
    kn_safety safety;
    kn_safety_init(&safety, &(kn_safety_limits){.guard_n_per_ms = 3});
    CHECK(same(a, b) && a->limits.guard_n_per_ms == 3);
    CHECK(memcmp(&a->model.solver, &core, sizeof core) == 0);
    CHECK(memcmp(&a->limits, &safety.limits, sizeof safety.limits) == 0);
    CHECK(told->model.probe[0].foundation_n_m3 == KN_FOUNDATION_N_M3);
}

TEST("--set changes keys of every group, and the text shows the new values")
{
    char lines[] =
        "version=1\nobject.size=[6 cm, 4 cm, 2 cm]\nobject.spacing=1 cm\nobject.structure=axis\n"
        "material.k1=1 Pa\nmaterial.c1=2 Pa s\nmaterial.damper=exponential\nmaterial.alpha=3 Pa s\n"
        "material.beta=0.5 1/MPa\nmaterial.p0=5 Pa\nmaterial.p1=6 Pa\nmaterial.specimen_height=2 cm\n"
        "density=7 kg/m^3\ngravity=8 m/s^2\nsupport=frictionless\n"
        "device.profile=bench\ndevice.clamp=9 N\ndevice.torque_clamp=0.1 N*m\ndevice.guard=1.5 N/ms\n"
        "device.brake_speed=1 m/s\ndevice.brake_damping=2 N*s/m\ndevice.hold=2 ms\ndevice.zero=15 ms\n"
        "device.ramp=0.3 s\ndevice.flow=250 ms\nsolver.kind=rk4\nsolver.precision=f64\n"
        "solver.linearization=secant\nsolver.isa=base\nsolver.dt=2 ms\nsolver.iterations=5\n"
        "solver.iterations_max=50\nsolver.tolerance=0\nsolver.passes=3\nsolver.mass_scale=1e3\nmesh.rate=60 Hz\n"
        "probes.ball.shape=plate\nprobes.ball.size=[1 cm, 2 cm]\nprobes.ball.name=slab\n";
    const char *set[64] = {NULL};
    int count = 0;
    for (char *line = strtok(lines, "\n"); line; line = strtok(NULL, "\n")) set[count++] = line;
    OWN(kn_scene) *scene = parse(in_cm, set);
    CHECK_STR(scene->text,
              "version: 1\n"
              "object:\n  size: [0.06 m, 0.04 m, 0.02 m]\n  spacing: 0.01 m\n  structure: axis\n"
              "  pressure: none\n"
              "material:\n  k1: 1 Pa\n  c1: 2 Pa*s\n  damper: exponential\n  alpha: 3 Pa*s\n  beta: 5e-07 1/Pa\n"
              "  p0: 5 Pa\n  p1: 6 Pa\n  specimen_height: 0.02 m\n"
              "density: 7 kg/m^3\ngravity: 8 m/s^2\nsupport: frictionless\n"
              "device:\n  profile: bench\n  clamp: 9 N\n  torque_clamp: 0.1 N*m\n  guard: 1.5 N/ms\n"
              "  brake_speed: 1 m/s\n  brake_damping: 2 N*s/m\n  hold: 2 ms\n  zero: 15 ms\n  ramp: 300 ms\n"
              "  flow: 250 ms\n"
              "solver:\n  kind: rk4\n  precision: f64\n  linearization: secant\n  isa: base\n  dt: 0.002 s\n"
              "  iterations: 5\n  iterations_max: 50\n  tolerance: 0\n  passes: 3\n  mass_scale: 1000\n"
              "mesh:\n  rate: 60 Hz\n"
              "probes:\n  - name: slab\n    shape: plate\n    size: [0.01 m, 0.02 m]\n");
    CHECK(scene->model.material.c2_pa_s == 0 &&
          scene->model.probe[0].radius_m == 0); // keys of the former damper and the former shape
}

static const char points[] =
    "quality={fast: {iterations: 5, iterations_max: 9}, balanced: {spacing: 1 cm, precision: f64}, "
    "accurate: {passes: 2, tolerance: 1e-4, linearization: secant}}";

TEST("a chosen quality point overrides the solver's keys, but no --set, in either order, and is part of the text and "
     "its "
     "hash")
{
    OWN(kn_scene) *none = parse(in_cm, NULL), *own = parse(in_cm, SETS(points));
    OWN(kn_scene) *fast = parse(in_cm, SETS(points, kn_quality_set("fast"), "solver.tolerance=0.01"));
    CHECK(memcmp(&none->model, &own->model, sizeof own->model) == 0 && own->quality == KN_QUALITY_OWN);
    CHECK(fast->model.solver.iterations == 5 && fast->model.solver.iterations_max == 9);
    CHECK(fast->model.solver.tolerance == 0.01 && fast->model.solver.passes == 1);
    CHECK(has(fast, "  iterations: 4\n") && has(fast, "\nquality:\n  chosen: fast\n  fast:\n    iterations: 5\n"));
    OWN(kn_scene) *again = parse(fast->text, NULL), *back = parse(fast->text, SETS("quality=own"));
    OWN(kn_scene) *set =
        parse(in_cm, SETS(points, "solver.iterations=7", "quality=fast", "quality.fast.iterations_max=8"));
    OWN(kn_scene) *set_again = parse(set->text, NULL);
    CHECK(set->model.solver.iterations == 7 && set->model.solver.iterations_max == 8);
    CHECK(same(again, fast) && same(set, set_again));
    CHECK(back->model.solver.iterations == 4 && !has(back, "chosen"));
}

TEST("only quality points with the lattice and precision of the chosen one can be switched to later")
{
    OWN(kn_scene) *own = parse(in_cm, SETS(points)), *balanced = parse(in_cm, SETS(points, "quality=balanced"));
    CHECK(balanced->model.nodes[0] == 6 && balanced->model.solver.precision == KN_PRECISION_F64);
    for (int q = 0; q < KN_QUALITIES; q++) {
        CHECK(own->point[q].defined && own->point[q].live == (q != KN_QUALITY_BALANCED));
        CHECK(balanced->point[q].defined && balanced->point[q].live == (q == KN_QUALITY_BALANCED));
    }
    const kn_effort *e = &own->point[KN_QUALITY_ACCURATE].effort;
    CHECK(e->passes == 2 && e->tolerance == 1e-4 && e->linearization == KN_LINEARIZATION_SECANT && e->iterations == 4);
}

TEST("a factor on the forces is that of one spacing: another one, set later or by a quality point, has no factor")
{
    OWN(kn_scene) *own = parse(in_cm, SETS(points, "object.force_factor=0.9"));
    OWN(kn_scene) *finer = parse(own->text, SETS("object.spacing=5 mm"));
    OWN(kn_scene) *both = parse(own->text, SETS("object.spacing=5 mm", "object.force_factor=0.95"));
    OWN(kn_scene) *balanced = parse(own->text, SETS("quality=balanced"));
    CHECK(own->model.force_factor == 0.9 && has(own, "  force_factor: 0.9\n"));
    CHECK(finer->model.force_factor == 1 && !has(finer, "force_factor"));
    OWN(kn_scene) *first = parse(own->text, SETS("object.force_factor=0.95", "object.spacing=5 mm"));
    CHECK(both->model.force_factor == 0.95 && first->model.force_factor == 0.95 && balanced->model.force_factor == 1);
}

TEST(
    "an exponential damper given by its ends equals the one by alpha and beta, also in the text; a ramp keeps its ends")
{
    static const char ends[] = "material={k1: 470 gf/cm^3, c1: 2500 gf s/cm^3, damper: exponential, c_max: 39187 gf "
                               "s/cm^3, c_min: 120.25 gf s/cm^3, p0: 9 gf/cm^2, p1: 80 gf/cm^2}";
    static const char height[] = "material.specimen_height=1 cm";
    OWN(kn_scene) *dough = dough_with(NULL), *same = parse(in_cm, SETS(ends, height));
    OWN(kn_scene) *ramp = parse(in_cm, SETS(ends, height, "material.damper=ramp")), *again = parse(ramp->text, NULL);
    const kn_material *a = &dough->model.material, *b = &same->model.material;
    for (double s = 100; s < 1e4; s += 100) CHECK_NEAR(kn_material_c2(b, s) / kn_material_c2(a, s), 1, 1e-3);
    CHECK(has(same, "alpha: ") && !has(same, "c_max"));
    CHECK_NEAR(ramp->model.material.c_max_pa_s, 39187 * 98.0665, 1e-6);
    CHECK(ramp->model.material.alpha_pa_s == 0 && has(ramp, "damper: ramp\n  c_max: ") && !has(ramp, "beta"));
    CHECK_STR(again->text, ramp->text);
}

TEST("the ratio of a stroke is 0.2, the stroke itself if it leaves no way, or c2/(c1 + c2) without a spring")
{
    OWN(kn_scene) *scene = parse(in_cm, SETS("material.stroke=[0.02, 0.98]")), *again = parse(scene->text, NULL);
    CHECK(scene->model.material.ratio == 0.2 && has(scene, "stroke: [0.02, 0.98]\n  ratio: 0.2\n"));
    CHECK_STR(again->text, scene->text);
    OWN(kn_scene) *stuck = parse(in_cm, SETS("material.stroke=[1, 1]"));
    CHECK(stuck->model.material.ratio == 1);
    OWN(kn_scene) *plastic =
        parse(in_cm, SETS("material={k1: 0 Pa, c1: 30 kPa s, damper: constant, c2: 10 kPa s, stroke: [0, 1]}"));
    CHECK_NEAR(plastic->model.material.ratio, 0.25, 1e-15);
    OWN(kn_scene) *told = parse(in_cm, SETS("material.stroke=[0.3, 0.7]", "material.ratio=0.5"));
    CHECK(told->model.material.ratio == 0.5 && told->model.material.stroke[1] == 0.7);
    OWN(kn_scene) *without = parse(in_cm, NULL);
    CHECK(!has(without, "stroke") && !has(without, " ratio"));
}

TEST("a named material sets the density and is written out in the canonical text; the scene's own values override")
{
#define DOUGH_CUBE(density)                                                                                            \
    "version: 1\nobject: {size: [2 cm, 2 cm, 2 cm], spacing: 1 cm}\n" density                                          \
    "material: dough\nsupport: bonded\ndevice: touch\n"
    OWN(kn_scene) *a = parse(DOUGH_CUBE(""), NULL), *again = parse(a->text, NULL), *dough = dough_with(NULL);
    CHECK(memcmp(&a->model.material, &dough->model.material, sizeof a->model.material) == 0);
    CHECK(a->model.density_kg_m3 == 1200 && has(a, "material:\n  k1: 46091."));
    CHECK_STR(again->text, a->text);
    OWN(kn_scene) *heavy = parse(DOUGH_CUBE("density: 2 g/cm^3\n"), NULL);
    OWN(kn_scene) *softer = parse(DOUGH_CUBE(""), SETS("material.k1=300 gf/cm^3"));
    OWN(kn_scene) *clay = parse(DOUGH_CUBE(""), SETS("material.k1=1 Pa", "material=clay"));
    CHECK(heavy->model.density_kg_m3 == 2000 && heavy->model.material.k1_pa == a->model.material.k1_pa);
    CHECK_NEAR(softer->model.material.k1_pa, 300 * 98.0665, 1e-9);
    CHECK(clay->model.material.k1_pa == 0 && clay->model.density_kg_m3 == 1800 && !has(clay, "alpha"));
}

static kn_material variant(const char *name, const char *which)
{
    char set[80];
    snprintf(set, sizeof set, "material=%s%s", name, which);
    OWN(kn_scene) *scene = parse(in_cm, SETS(set));
    kn_material mat = scene->model.material;
    return mat;
}

TEST("every named material has its three variants by the rules of the second paper")
{
    int count = 0;
    for (const kn_library_entry *e = kn_library; e->name; e++, count++) {
        double in, out;
        kn_material r = variant(e->name, "-rheological"), v = variant(e->name, "-viscoelastic");
        kn_material p = variant(e->name, "-plastic"), own = variant(e->name, "");
        CHECK(!kn_material_check(&r) && !kn_material_check(&v) && !kn_material_check(&p));
        CHECK(r.k1_pa > 0 && r.c1_pa_s > 0 && !kn_material_stroke(&r, &in, &out));
        CHECK(v.k1_pa == r.k1_pa && v.ratio == 1 && kn_material_stroke(&v, &in, &out));
        CHECK(p.k1_pa == 0 && !kn_material_stroke(&p, &in, &out));
        for (double s = 0; s < 1e4; s += 100) { // the dampers in series equal the damper of the rheological variant
            double c2 = kn_material_c2(&p, s), c = p.c1_pa_s * c2 / (p.c1_pa_s + c2);
            CHECK_NEAR(c / kn_material_c2(&r, s), 1, p.damper == KN_DAMPER_CONSTANT ? 1e-12 : 0.05);
        }
        // the material's own name stands for one of the three variants
        CHECK(own.k1_pa == 0 || own.ratio == 1 || own.stroke[1] == 0);
    }
    CHECK(count == 7);
}

TEST("the structure and pressure keys can be set; a size of two values with a thickness makes a flat object")
{
    OWN(kn_scene) *dough = dough_with(NULL);
    OWN(kn_scene) *scene =
        parse(dough->text, SETS("object.size=[6 cm, 3 cm]", "object.thickness=2 cm", "object.diagonal_stiffness=0.02",
                                "object.pressure=object", "object.inside_pressure=0.5 atm"));
    CHECK(has(scene, "object:\n  size: [0.06 m, 0.03 m]\n  spacing: 0.005 m\n  thickness: 0.02 m\n"
                     "  structure: diagonals\n  diagonal_stiffness: 0.02\n  pressure: object\n"
                     "  inside_pressure: 50662.5 Pa\n"));
    CHECK(scene->model.nodes[0] == 13 && scene->model.nodes[1] == 1 && scene->model.nodes[2] == 7);
    CHECK(scene->model.thickness_m == 0.02 && scene->model.pressure == KN_PRESSURE_OBJECT);
    // Parse the text again: the scene is the same. With --set to a block the thickness disappears, and with sides
    // only the diagonals disappear.
    OWN(kn_scene) *again = parse(scene->text, NULL);
    OWN(kn_scene) *block =
        parse(scene->text, SETS("object.size=[6 cm, 4 cm, 3 cm]", "object.structure=axis", "object.pressure=none"));
    CHECK(again->text_hash == scene->text_hash);
    CHECK(block->model.nodes[1] == 9 && block->model.thickness_m == 0);
    CHECK(block->model.diagonal_stiffness == 0 && block->model.inside_pressure_pa == 0);
}

TEST("moduli per height are multiplied by the specimen's height, also if set later")
{
    OWN(kn_scene) *scene = parse(in_cm, SETS("material.k1=470 gf/cm^3", "material.specimen_height=2 cm"));
    CHECK_NEAR(scene->model.material.k1_pa, 470 * 9806.65 * 0.02, 1e-10);
    CHECK(scene->model.material.c1_pa_s == 50); // a plain modulus is unchanged
    // the canonical text still contains the height
    OWN(kn_scene) *dough = dough_with(NULL), *softer = parse(dough->text, SETS("material.k1=300 gf/cm^3"));
    CHECK_NEAR(softer->model.material.k1_pa, 300 * 98.0665, 1e-10);
    CHECK(softer->text_hash != dough->text_hash);
}

TEST("--set accepts mappings and the short form of device, and the last of two values counts")
{
    OWN(kn_scene) *scene =
        parse(in_cm, SETS("device=bench", "device={clamp: 7 N, hold: 1 ms}", "material.k1=1 Pa", "material.k1=2 Pa"));
    CHECK(scene->limits.clamp_n == 7 && scene->limits.hold_ms == 1 && strcmp(scene->device.name, "bench") == 0);
    CHECK(scene->model.material.k1_pa == 2);
}

TEST("the rate of a device fixes the hold, and the clamp is lowered so that the force falls no faster")
{
    static const struct {
        const char *rate;
        int hold_ms;
        double clamp_n; // of 12 N
    } all[] = {{"4000 Hz", 3, 12},
               {"1000 Hz", 3, 12},
               {"500 Hz", 4, 12 * 16 / 17.0},
               {"250 Hz", 8, 12 * 12 / 17.0},
               {"200 Hz", 10, 12 * 10 / 17.0},
               {"125 Hz", 15, 12 * 5 / 17.0},
               {"66.7 Hz", 15, 12 * 5 / 17.0}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        char set[40];
        snprintf(set, sizeof set, "device.rate=%s", all[i].rate);
        OWN(kn_scene) *scene = parse(in_cm, SETS("device.profile=omega", set)), *again = parse(scene->text, NULL);
        CHECK(scene->limits.hold_ms == all[i].hold_ms && scene->limits.zero_ms == 20);
        CHECK_NEAR(scene->limits.clamp_n, all[i].clamp_n, 1e-12);
        CHECK_NEAR(scene->limits.torque_clamp_n_m, 0.05 * all[i].clamp_n, 1e-12);
        CHECK(same(scene, again) && again->limits.clamp_n == scene->limits.clamp_n); // the text has the clamp before
    }
    CHECK(strstr(complaint("device={profile: touch, rate: 100 Hz, hold: 3 ms}"), "expected 10 to 15 ms"));
    CHECK_STR(complaint("device.hold=8 ms"),
              "--set device.hold: 8 ms is longer than poses at 1000 Hz need, expected at most 3 ms, or device.rate");
    CHECK_STR(complaint("device.rate=60 Hz"),
              "--set device.rate: 60 Hz is out of range, expected a number from 66.7 to 5000 Hz");
}

TEST("a size is a whole number of spacings to within a millionth, and only the grid counts")
{
    OWN(kn_scene) *third = dough_with("object.spacing=3.3333333333333333 mm"), *again = parse(third->text, NULL);
    CHECK(third->model.nodes[0] == 16 && third->model.nodes[1] == 16 && third->model.nodes[2] == 10);
    CHECK(same(third, again));
    OWN(kn_scene) *dough = dough_with(NULL), *nearly = dough_with("object.size=[50.000001 mm, 5 cm, 3 cm]");
    CHECK(dough->text_hash == nearly->text_hash);
    CHECK_STR(complaint("object.spacing=3.333 mm"),
              "--set object.spacing: object.size along x, 0.05 m, is 15.0015 spacings of 0.003333 m, "
              "expected a whole number, e.g. with a spacing of 0.003333333333 m");
}

TEST("an error in a --set names its key") // errors that a file can have, too: clients.bad_scenes
{
    static const char *const bad[][2] = {
        {"material.k1=300", "'300' has no unit, expected a number from 0 to 1e+09 Pa (or Pa/m with a specimen_height)"},
        {"material.k1=", "no value, expected key=value"},
        {"material.k9=1 Pa", "unknown key, did you mean material.k1?"},
        {"material.damper=constant",
         "material.c2 is missing, expected a number from 1e-06 to 1e+12 Pa*s (or Pa*s/m with a specimen_height)"},
        {"material.c_max=1 Pa s", "material.c_min is missing, expected it beside material.c_max"},
        {"material={c_max: 3 Pa s, c_min: 2 Pa s, beta: 1 1/MPa}",
         "material.beta is given beside c_max and c_min, expected only one of the pairs"},
        {"material={damper: ramp, c_max: 1 Pa s, c_min: 2 Pa s}",
         "material.c_min is 2 Pa s, expected at most c_max, 1 Pa s"},
        {"material={damper: constant, c2: 1 Pa s, c_max: 1 Pa s}",
         "material.c_max means nothing with 'damper: constant', expected it left out"},
        {"material={k1: 1 Pa, c1: 1 Pa s, damper: none, variant: plastic}",
         "material.variant is plastic, expected a damper that can move"},
        {"material.ratio=0.5", "material.ratio means nothing without a stroke, expected it left out"},
        {"material.stroke=[0, 0]", "material.stroke ends at 0, expected [a_min, a_max] with a_max above 0"},
        {"material.stroke=[0.5, 1.5]", "1.5 is out of range, expected a list of 2, each from 0 to 1"},
        {"probes.plum.size=1 cm", "no probe 'plum', expected one that the scene has"},
        {"probes.plate.name=finger", "probe 'finger' exists already, expected another name"},
        {"object={size: [6 cm, 6 cm, 4 cm], spacing: 2 cm}",
         "probes.finger.radius is 0.015 m, expected at least object.spacing, 0.02 m"},
        {"probes=[]", "expected one key of one probe, e.g. probes.plate.size"},
        {"quality.slow.passes=1", "unknown key, did you mean quality.fast.passes?"},
        {"K1=3", "expected key=value, e.g. material.k1='300 gf/cm^3'"},
        {"density", "expected key=value, e.g. material.k1='300 gf/cm^3'"},
    };
    for (int i = 0; i < COUNT(bad); i++) {
        char expected[512];
        snprintf(expected, sizeof expected, "--set %.*s: %s", (int)strcspn(bad[i][0], "="), bad[i][0], bad[i][1]);
        CHECK_STR(complaint(bad[i][0]), expected);
    }
}

TEST("--quality with an unknown quality point is refused, with the points of the scene")
{
    CHECK_STR(complaint("quality=quick"),
              "--quality quick: quality.chosen: 'quick' is unknown, expected fast|balanced|accurate|own");
    CHECK_STR(refusal("test.yaml", in_cm, SETS("quality.balanced.passes=2", "quality=fast")),
              "--quality fast: the scene has no quality.fast, expected balanced, or own");
    CHECK_STR(refusal("test.yaml", in_cm, SETS("quality=fast")),
              "--quality fast: the scene has no quality points, expected this left out");
    CHECK(!kn_quality_set("quick"));
}

TEST("the default skin is the spline and not in the text; a chosen skin is in the text and is read back")
{
    OWN(kn_scene) *none = parse(in_cm, NULL), *chosen = parse(in_cm, SETS("object.skin=bilinear"));
    OWN(kn_scene) *again = parse(chosen->text, NULL);
    CHECK(none->model.skin == KN_SKIN_SPLINE && !has(none, "skin"));
    CHECK(chosen->model.skin == KN_SKIN_BILINEAR && has(chosen, "  skin: bilinear\n") && same(chosen, again));
}

static const char hammer[] =
    "version: 1\nobject: {size: [5 cm, 5 cm, 3 cm], spacing: 5 mm}\nmaterial: dough\nsupport: bonded\ndevice: bench\n"
    "probes:\n  - name: hammer\n    shape: union\n    reach: [-1 cm, 1 cm, 0 m, 0 m]\n    parts:\n"
    "      - {shape: cylinder, radius: 5 mm, length: 6 cm, edge: 1 mm}\n"
    "      - {shape: cross, extent: [4 cm, 1 cm, 2 cm], at: [1 mm, 2 mm, 6 cm], turn: [90 deg, 0 deg, 30 deg]}\n";

TEST("a union has the shape of its parts, each turned about x, then y, then z, and moved to its place")
{
    OWN(kn_scene) *scene = parse(hammer, NULL);
    const kn_shape *tool = scene->model.probe[0].parts;
    CHECK(tool && tool == scene->tool[0] && tool->part_count == 3);
    CHECK_NEAR(tool->fine_m, 0.005, 1e-15);
    // The cross's z axis is -y after the first turn, and then turns by 30 degrees about z. Its arms lie in the plane
    // across that axis.
    const double c = sqrt(0.75), along[3] = {0.5, -c, 0};
    double way[3];
    for (int k = 0; k < 3; k++) CHECK_NEAR(tool->part[1].turn[k][2], along[k], 1e-15);
    double at[3] = {0.001 + 0.018 * c, 0.002 + 0.018 * 0.5, 0.06}; // on an arm, 2 mm from its end
    for (int k = 0; k < 3; k++) at[k] += 0.001 * along[k];
    CHECK_NEAR(kn_shape_distance(tool, at, way), -0.001, 1e-15);
}

TEST("the text of a scene with a union gives the same scene; --set changes a key of one part, and another shape drops "
     "the parts")
{
    OWN(kn_scene) *scene =
        parse(hammer, SETS("probes.hammer.parts.1.radius=6 mm", "probes.hammer.parts.2.turn=[1.5 rad, 0 rad, 0 rad]"));
    OWN(kn_scene) *again = parse(scene->text, NULL);
    const kn_shape *one = scene->tool[0], *other = again->tool[0];
    CHECK(has(scene, "        radius: 0.006 m\n") && has(scene, "turn: [1.5 rad, 0 rad, 0 rad]"));
    CHECK_STR(again->text, scene->text);
    CHECK(scene->text_hash == again->text_hash && other->part_count == one->part_count &&
          other->bound_m == one->bound_m && other->fine_m == one->fine_m);
    for (int i = 0; i < one->part_count; i++) { // compare field by field, since padding may differ
        const kn_solid *a = &one->part[i], *b = &other->part[i];
        CHECK(a->kind == b->kind && a->radius_m == b->radius_m && a->length_m == b->length_m && a->turned == b->turned);
        CHECK(memcmp(a->half_m, b->half_m, sizeof a->half_m) == 0 && memcmp(a->at_m, b->at_m, sizeof a->at_m) == 0 &&
              memcmp(a->turn, b->turn, sizeof a->turn) == 0);
    }
    OWN(kn_scene) *whole = parse(hammer, SETS("probes.hammer.shape=sphere", "probes.hammer.radius=1 cm"));
    CHECK(!whole->model.probe[0].parts && !has(whole, "parts"));
    CHECK_STR(refusal("x", hammer, SETS("probes.hammer.parts.3.radius=6 mm")),
              "--set probes.hammer.parts.3.radius: no part '3', expected 1 to 2");
    CHECK_STR(refusal("x", hammer, SETS("probes.hammer.parts=[]")),
              "--set probes.hammer.parts: expected one key of one part, e.g. probes.pin.parts.1.radius");
    CHECK_STR(refusal("x", hammer, SETS("object.spacing=1 cm")),
              "--set object.spacing: probes.hammer.parts.1: a tool's radius must be at least the lattice "
              "spacing, or it falls between the nodes (spacing 0.01 m)");
    OWN(kn_scene) *rolling = load_scene("rolling-pin.yaml", NULL, 0);
    CHECK(rolling->tool[0] && rolling->tool[0]->part_count == 3);
}

TEST("KEYS.md lists every key exactly as knead check --keys")
{
    static char readme[1 << 16];
    FILE *file = fopen(SCENES "KEYS.md", "r");
    if (!file) KN_TEST_FAIL("no KEYS.md");
    if (!file) return;
    readme[fread(readme, 1, sizeof readme - 1, file)] = '\0';
    fclose(file);
    int lines = 0;
    for (const char *const *line = kn_scene_keys(); *line; line++, lines++)
        if (!strstr(readme, *line)) KN_TEST_FAIL("not in KEYS.md: %s", *line);
    CHECK(lines > 40);
}
