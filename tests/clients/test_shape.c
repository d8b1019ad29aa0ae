// knead identify shape: find structures and inside pressures again from range images and forces. The measurements are
// synthetic, with noise on both.
//
// The blind cases draw structure, P0 (0.2 .. 3 atm) and gamma (0.7 .. 1.4 of its own) at random. The block of
// dough-small.yaml is pressed as in the first paper. At the end of the hold its range image gets noise of 1 % of its
// height on every pixel, and the force noise of 1 % of its largest. The command gets these two files and the scene as
// it is.
//
// By default one case is run, at night two, held for 1 s. KN_CASES=10 runs that many, held for 30 s. KN_HOLD sets
// another time, KN_SCENE another scene, KN_PARETO_NOISE another noise.
// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/shape/shape_command.h"
#include "clients/viewer/image.h"
#include "clients/viewer/range.h"
#include "tests/clients/heard.h"
#include "tests/clients/recorded_press.h"
#include "tests/dice.h"
#include <jansson.h>

enum { PIXELS = 320 };

static uint64_t seed = 20261123; // seed of the blind cases

typedef struct lump {                                           // construction and measurement of an object
    const char *scene, *structure, *set;                        // scene NULL: the small block of dough
    double pressure_pa, area_factor, noise, hold_s, shift_m[2]; // area_factor, noise, hold_s 0: 1, 0.01, 1 s
    // share of the pixels without a reading; a twentieth of that share are stray readings beside the object
    double lost;
    bool at_end; // the image is taken after the withdrawal
} lump;

static void write_force(const kn_press *press, const kn_pressed *pressed, double noise)
{
    double most_n = 0;
    FILE *f = fopen("force.csv", "w");
    must(f, "force.csv cannot be written");
    for (int64_t t = 0; t < pressed->ticks; t++) most_n = fmax(most_n, pressed->force_n[t]);
    fputs("time_s,force_n\n", f);
    for (int64_t t = 0; t < pressed->ticks; t += 5)
        fprintf(f, "%.4f,%.6g\n", press->time_s[t], pressed->force_n[t] + noise * most_n * kn_dice_normal(&seed));
    fclose(f);
}

static void write_image(const kn_surface *s, const float (*rest_m)[3], const float (*now_m)[3], const lump *l)
{
    static uint16_t level[PIXELS * PIXELS];
    double tall_m = 0;
    for (int v = 0; v < s->vertex_count; v++) tall_m = fmax(tall_m, rest_m[v][2]);
    kn_range r = kn_range_frame(PIXELS, PIXELS, s->vertex_count, rest_m, now_m);
    kn_range_draw(&r, now_m, s->triangle_count, (const int(*)[3])s->triangle, level);
    for (int i = 0; i < PIXELS * PIXELS; i++) {
        const double noisy = level[i] + l->noise * tall_m / r.step_m * kn_dice_normal(&seed);
        if (level[i] > 0) level[i] = (uint16_t)fmin(fmax(round(noisy), 1), 65535);
        else if (l->lost > 0 && kn_dice(&seed) < l->lost / 20) level[i] = 15000;
        if (l->lost > 0 && kn_dice(&seed) < l->lost) level[i] = 0;
    }
    r.left_m -= l->shift_m[0]; // the image states another position
    r.top_m -= l->shift_m[1];
    must(kn_range_save("depth.png", &r, "measured", level, error, sizeof error), error);
}

// Write every vertex of the surface, with noise of a tenth of a millimetre.
static void write_points(const kn_surface *s, const float (*now_m)[3])
{
    FILE *f = fopen("points.csv", "w");
    must(f, "points.csv cannot be written");
    fputs("x [mm];y [mm];z [mm]\n", f);
    for (int i = 0; i < 3 * s->vertex_count; i++)
        fprintf(f, "%.4f%c", 1e3 * now_m[i / 3][i % 3] + 0.1 * kn_dice_normal(&seed), ";;\n"[i % 3]);
    fclose(f);
}

// Press the object and write depth.png, points.csv and force.csv.
static void measure(lump l)
{
    kn_candidate c[KN_CANDIDATES];
    AT_END(kn_press_free) kn_press press = {0};
    AT_END(kn_pressed_free) kn_pressed pressed = {0};
    if (l.noise == 0) l.noise = 0.01;
    open_candidate(c, l.scene ? l.scene : SMALL, l.structure, &l.set);
    must(kn_press_path(&press, c->scene, &(kn_press_def){.hold_s = l.hold_s > 0 ? l.hold_s : 1}, error, sizeof error),
         error);
    const kn_model_def object = kn_candidate_model(c, l.pressure_pa, l.area_factor > 0 ? l.area_factor : 1);
    OWN(kn_model) *model = kn_model_build(&object, error, sizeof error);
    must(model, error);
    const double at_s = l.at_end ? press.end_s : press.hold_end_s;
    const kn_press_play play = {
        .model = model, .surface = c->surface.mesh, .moments = 1, .moment_s = &at_s, .until_s = at_s};
    must(kn_press_run(&press, &play, &pressed), "the press diverges");
    write_force(&press, &pressed, l.noise);
    write_image(c->surface.mesh, (const float(*)[3])c->surface.rest_m, (const float(*)[3])pressed.shape_m[0], &l);
    write_points(c->surface.mesh, (const float(*)[3])pressed.shape_m[0]);
    kn_candidate_free(c);
}

#define IDENTIFY(...) kn_call(kn_identify_shape_main, "knead identify shape", __VA_ARGS__)

static json_t *root; // the results of the last find

// Check that the command ends with 0, and load its results.
#define FIND(...)                                                                                                      \
    do {                                                                                                               \
        KN_CALLS(0, "", kn_identify_shape_main, "knead identify shape", "--json --force force.csv " __VA_ARGS__);      \
        json_decref(root);                                                                                             \
        root = json_loads(kn_out, 0, NULL);                                                                            \
    } while (0)

static json_t *structure(const char *name)
{
    size_t i;
    json_t *one;
    json_array_foreach(json_object_get(root, "structures"), i,
                       one) if (!strcmp(json_string_value(json_object_get(one, "structure")), name)) return one;
    return NULL;
}

static double number_of(const json_t *one, const char *key) { return json_number_value(json_object_get(one, key)); }

static double pressure_of(const char *name)
{
    return number_of(json_object_get(structure(name), "inside_pressure"), "value");
}

static const char *text_of(const char *key)
{
    const char *text = json_string_value(json_object_get(root, key));
    return text ? text : "";
}

static void write_text(const char *path, const char *text) // with rows as of kn_rows
{
    FILE *f = fopen(path, "w");
    must(f, path);
    kn_rows(f, text);
    fclose(f);
}

// Check that these arguments are refused in one line that contains the words.
static void refuses(const char *words, const char *arguments)
{
    const int code = IDENTIFY("%s", arguments);
    if (code != KN_EXIT_USAGE || !kn_refused(words))
        KN_TEST_FAIL("%s: exit %d, expected 2 and one line with: %s\n%s%s", arguments, code, words, kn_out, kn_err);
}

// ---- tests

static bool blind_case(int number, const char *scene, double hold_s, double noise)
{
    static const char *const names[] = {"diagonals", "pressure", "both"};
    const lump l = {.scene = scene,
                    .structure = names[(int)(3 * kn_dice(&seed))],
                    .noise = noise,
                    .hold_s = hold_s,
                    .pressure_pa = 101325 * 0.2 * pow(15, kn_dice(&seed)),
                    .area_factor = 0.7 * pow(2, kn_dice(&seed))};
    measure(l);
    FIND("%s --depth depth.png --hold %g", scene, hold_s);
    const char *name = text_of("best");
    const double off = strcmp(l.structure, "diagonals") != 0 ? pressure_of(name) / l.pressure_pa - 1 : 0;
    printf("  case %d: %s, P0 %.3f atm, gamma x %.3f -> %s, P0 %+.2f %%, gamma %+.2f %%; %.2f noises off; rival '%s'\n",
           number, l.structure, l.pressure_pa / 101325, l.area_factor, name, 100 * off,
           100 * (number_of(structure(name), "gamma_factor") / l.area_factor - 1), number_of(structure(name), "off"),
           text_of("rival"));
    fflush(stdout);
    return !strcmp(name, l.structure) && fabs(off) < 0.1;
}

TEST("a blind case gives the structure, and P0 within 10 %, from image and force with 1 % noise; of many, nine in ten")
{
    const char *cases = getenv("KN_CASES"), *scene = getenv("KN_SCENE"), *noise = getenv("KN_PARETO_NOISE"),
               *hold = getenv("KN_HOLD");
    const int count = cases ? atoi(cases) : KN_LENGTH(1, 1, 2);
    int good = 0;
    for (int i = 0; i < count; i++)
        good += blind_case(i + 1, scene ? scene : SMALL,
                           hold    ? atof(hold)
                           : cases ? 30
                                   : 1,
                           noise ? atof(noise) : 0.01);
    printf("  %d of %d\n", good, count);
    CHECK(good * 10 >= count * 9);
}

NIGHT_TEST(
    "an object of finer cells than the model is reported as unexplained, and is explained by a model of these cells")
{
    seed = 20261123; // the same object after any number of blind cases
    measure((lump){.structure = "both", .set = "object.spacing=5 mm", .pressure_pa = 101325});
    FIND(SMALL " --depth depth.png --hold 1 --finer");
    const json_t *best = structure(text_of("best")), *halved = json_object_get(root, "halved_cells");
    printf("  in cells of 1 cm: %s, P0 %.3f atm; %.1f noises off, halved cells %.1f\n", text_of("best"),
           pressure_of(text_of("best")) / 101325, number_of(best, "off"), number_of(halved, "off"));
    CHECK(number_of(halved, "moved") > 0.5 * number_of(best, "off"));
    CHECK(json_is_false(json_object_get(root, "explained")));
    CHECK(json_is_true(json_object_get(structure("diagonals"), "stopped_early")));
    CHECK(strstr(text_of("words"), "None of the structures explains the measurements"));
    FIND(SMALL " --set 'object.spacing=5 mm' --only both --depth depth.png --hold 1");
    CHECK(json_is_true(json_object_get(root, "explained")));
    CHECK_NEAR(pressure_of("both"), 101325, 0.02 * 101325);
}

static kn_range load_range(const char *path, uint16_t **level)
{
    kn_range r = {0};
    must(kn_range_load(path, &(kn_range_given){NAN, NAN, NAN, NAN}, &r, level, error, sizeof error), error);
    return r;
}

// Return the rms difference of the heights where both range images have a reading.
static double apart_m(const char *one, const char *other, int *both)
{
    double squares = 0;
    uint16_t *was = NULL, *is = NULL;
    const kn_range a = load_range(one, &was), b = load_range(other, &is);
    CHECK(a.left_m == b.left_m && a.top_m == b.top_m && a.pixel_m == b.pixel_m);
    *both = 0;
    for (int i = 0; i < PIXELS * PIXELS; i++)
        if (was[i] > 0 && is[i] > 0) squares += pow(was[i] * a.step_m - is[i] * b.step_m, 2), ++*both;
    free(was);
    free(is);
    return sqrt(squares / *both);
}

TEST("a shifted image with lost and stray pixels is aligned within a fifth of a pixel")
{
    const double shift_m[2] = {0.00013, -0.00031};
    measure((lump){.structure = "both", .pressure_pa = 5e4, .shift_m = {shift_m[0], shift_m[1]}, .lost = 0.05});
    FIND(SMALL " --depth depth.png --hold 1 --only both --align --out-depth model.png");
    int both;
    for (int k = 0; k < 2; k++)
        CHECK_NEAR(number_of(structure("both"), k ? "shift_y_m" : "shift_x_m"), shift_m[k], 4e-5);
    CHECK_NEAR(apart_m("depth.png", "model.png", &both), 0.01 * 0.03, 2e-5); // drawn pixel on pixel: only the noise
    CHECK_NEAR(pressure_of("both"), 5e4, 2.5e3);
}

TEST("points of a scanned surface, sides included, give the structure, and P0 within 10 %")
{
    measure((lump){.structure = "pressure", .pressure_pa = 1.5e5, .area_factor = 0.9, .at_end = true});
    FIND(SMALL " --points points.csv --at end --hold 1");
    CHECK_STR(text_of("best"), "pressure");
    CHECK_NEAR(pressure_of("pressure"), 1.5e5, 1.5e4);
}

TEST("an object of tetrahedra with gas is told from one without, and P0 is found within 10 %")
{
#define BUN KN_SOURCE_DIR "/core/scenes/bun.yaml"
    measure((lump){.scene = BUN, .structure = "mesh-pressure", .pressure_pa = 6e4, .area_factor = 1.1});
    FIND(BUN " --depth depth.png --hold 1");
    CHECK_STR(text_of("best"), "mesh-pressure");
    CHECK(json_array_size(json_object_get(root, "structures")) == 2);
    CHECK_NEAR(pressure_of("mesh-pressure"), 6e4, 6e3);
    json_decref(root);
    root = NULL;
}

TEST("the written scene loads with the fitted parameters, and the written range image differs by the noise only")
{
    measure((lump){.structure = "pressure", .pressure_pa = 2e5, .area_factor = 1.2, .at_end = true});
    CHECK(IDENTIFY(SMALL " --depth depth.png --at end --force force.csv --hold 1 --only pressure,both --out found.yaml "
                         "--out-depth model.png") == 0);
    OWN(kn_scene) *scene = kn_scene_load("found.yaml", NULL, 0, error, sizeof error);
    CHECK(scene);
    if (!scene) return;
    CHECK_NEAR(scene->model.inside_pressure_pa, 2e5, 2e4);
    CHECK_NEAR(scene->model.diagonal_stiffness, 0.02, 1e-12);
    CHECK(scene->model.pressure == KN_PRESSURE_CELLS);
    CHECK_NEAR(scene->model.material.p1_pa, 1.2 * 80 * 98.0665, 0.03 * 80 * 98.0665);
    int both;
    CHECK_NEAR(apart_m("depth.png", "model.png", &both), 0.01 * 0.03, 0.00005); // only the noise remains
    CHECK(both > 5000);
}

TEST("a stress area s times as large stretches the damper law: T'(s b) = s T(b)")
{
    kn_candidate c[KN_CANDIDATES];
    open_candidate(c, SMALL, "diagonals", NULL);
    const double s = 1.7;
    kn_law as_is, stretched;
    kn_law_build(&as_is, &c[0].scene->model.material, 1e-3, true);
    const kn_model_def def = kn_candidate_model(&c[0], 0, s);
    kn_law_build(&stretched, &def.material, 1e-3, true);
    for (double b = 10; b < 1e6; b *= 1.3)
        CHECK_NEAR(kn_law_stress(&stretched, s * b), s * kn_law_stress(&as_is, b), 1e-9 * s * b);
    kn_candidate_free(c);
}

TEST("the distance to a surface is exact outside, and negative inside")
{
    const float x[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const int triangle[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    const double known[5][4] = {
        {0.2, 0.2, -0.5, 0.5}, {0.2, 0.2, 0.1, -0.1}, {1, 1, 1, 2 / sqrt(3)}, {-3, -4, 0, 5}, {2, 0, 0, 1}};
    for (int i = 0; i < 5; i++) // positions are float
        CHECK_NEAR(kn_surface_residual_distance(known[i], x, 4, triangle), known[i][3], i == 2 ? 1e-7 : 1e-12);
}

TEST("the verdict names the nearest structure if none explains the data, otherwise the one with the fewest parameters")
{
    kn_structure_verdict v;
    const kn_measurement e = {.readings = 1000};
    kn_candidate c[3] = {
        {.name = "diagonals", .words = "D", .found = true, .unknowns = 1, .independent = 12, .settled = true},
        {.name = "pressure", .words = "P", .found = true, .unknowns = 2, .independent = 12, .settled = true},
        {.name = "both", .words = "B", .found = true, .unknowns = 2, .independent = 12, .settled = true}};
    const double off[3] = {10.5, 10.2, 10};
    for (int i = 0; i < 3; i++) c[i].sum = off[i] * off[i] * e.readings;
    c[1].no_gas_left = true;
    kn_structure_verdict_make(&v, 3, c, &e);
    CHECK(v.best == 2 && v.rival == 0 && !v.explained && v.delta[0] < v.delta[2]);
    CHECK(strstr(v.words, "both comes nearest and is off by 10.0 times") &&
          strstr(v.words, "diagonals is nearly as close, 10.5"));
    for (int i = 0; i < 3; i++) c[i].sum = 0.01 * off[i] * off[i] * e.readings;
    kn_structure_verdict_make(&v, 3, c, &e);
    CHECK(v.best == 0 && v.rival == 2 && v.explained); // the fewest numbers that explain the data
}

// ---- forces

// Make a press of 2 s at 500 Hz, up to 4 N, with some spoilt readings, and read its force curve.
static kn_force_residual spoilt(const kn_press *press, double from_s, double spike_n, int spikes)
{
    enum { READINGS = 1000 };
    kn_force_residual p = {.count = READINGS};
    double *time_s = p.time_s = calloc(READINGS, sizeof *time_s);
    double *force_n = p.force_n = calloc(READINGS, sizeof *force_n);
    for (int i = 0; i < READINGS; i++) {
        const double t = time_s[i] = 2e-3 * i;
        force_n[i] = 4 * fmin(t, 1) * exp(-fmax(t - 1, 0)) + 0.01 * kn_dice_normal(&seed);
        if (t >= from_s && spikes-- > 0) force_n[i] = spike_n;
    }
    must(kn_force_residual_make(&p, press, error, sizeof error), error);
    return p;
}

TEST("stray force readings are left out and do not change the largest force")
{
    kn_candidate c[KN_CANDIDATES];
    AT_END(kn_press_free) kn_press press = {0};
    open_candidate(c, SMALL, "diagonals", NULL);
    must(kn_press_path(&press, c->scene, &(kn_press_def){.hold_s = 1}, error, sizeof error), error);
    const double spikes[] = {5000, 1e300, -1e300, 30};
    for (int i = 0; i < 4; i++)
        for (int many = 0; many < 3; many++) {
            AT_END(kn_force_residual_free) kn_force_residual p = spoilt(&press, i == 3 ? 0 : 0.7, spikes[i], many);
            CHECK(p.outliers == many && p.count == 1000 - many && !p.turned);
            CHECK(many == 0 || p.outlier_n == spikes[i]);
            CHECK_NEAR(p.most_n, 4, 0.05);
            for (int b = 0; b < p.spans; b++)
                CHECK_NEAR(p.span_n[b], 4 * fmin(p.span_s[b], 1) * exp(-fmax(p.span_s[b] - 1, 0)), 0.05);
        }
    kn_candidate_free(c);
}

TEST("points without a coordinate are left out with a message, and a force whose time falls is refused")
{
    kn_candidate c[KN_CANDIDATES];
    kn_measurement e;
    open_candidate(c, SMALL, "diagonals", NULL);
    write_text("lacking.csv", "x [mm],y [mm],z [mm]\n1,1,\n1,,1\n@60 0+.3,0+.2,10\n");
    write_text("disorder.csv", "time [s],force [N]\n@100 0+.02,0+.04\n");
    const kn_shape_options o = {
        .points = "lacking.csv", .force = "disorder.csv", .at_s = {INFINITY}, .press = {.hold_s = 1}};
    kn_hear();
    const int code = kn_shape_measured(&e, &o, c);
    kn_hear_end();
    CHECK(code == 0 && kn_said("left out: 2 points without all coordinates, the first in line 2"));
    if (code == 0) kn_measurement_free(&e);
    write_text("disorder.csv", "time [s],force [N]\n@100 0+.02,0+.04\n@100 0+.02,4+.04\n");
    kn_hear();
    CHECK(kn_shape_measured(&e, &o, c) == KN_EXIT_USAGE);
    kn_hear_end();
    CHECK(kn_said("disorder.csv:102:1: time falls, expected one press per file"));
    kn_candidate_free(c);
}

TEST("several force columns are refused, and rows of the pressing probe are selected and reported")
{
    measure((lump){.structure = "diagonals", .pressure_pa = 1e5});
    write_text("three.csv", "time [s],fx [N],fy [N],fz [N]\n0,0,0,1\n1,0,0,2\n");
    refuses("three.csv:1:10: 'fx', 'fy', 'fz': 3 columns of a force, expected one",
            SMALL " --depth depth.png --force three.csv");
    must(system("awk -F, 'BEGIN { print \"tick,time_s,probe,fz_n,contact_fz_n\" } NR > 1 { print NR \",\" $1 "
                "\",finger,0,-7\"; "
                "print NR \",\" $1 \",plate,0,\" $2 }' force.csv >rows.csv") == 0,
         "no awk");
    CHECK(IDENTIFY(SMALL
                   " --depth depth.png --force rows.csv --hold 1 --only diagonals --set object.pressure=object") == 0);
    CHECK(kn_said("rows.csv, 'contact_fz' over 'time' of plate: ") && kn_said("diagonals explains the measurements"));
    CHECK(kn_said("note       the scene's object.pressure=object is ignored"));
    write_text("other.csv", "time_s,probe,force_n\n0,thumb,1\n1,thumb,2\n");
    refuses("other.csv:1:8: none of the 2 rows has the probe 'plate', expected rows with it",
            SMALL " --depth depth.png --force other.csv");
}

// ---- bad input: one line each, exit 2

static void gray(const char *path, int width, int height, int value, bool texts)
{
    uint16_t *level = calloc((size_t)width * (size_t)height, sizeof *level);
    for (int i = 0; i < width * height; i++) level[i] = (uint16_t)value;
    const kn_image_text words[] = {{"step_mm", "0.001"}, {"pixel_mm", "0.2"}, {"left_mm", "-32"}, {"top_mm", "x"}};
    must(kn_image_write_gray16(path, width, height, level, 0, texts ? 4 : 0, words, error, sizeof error), error);
    free(level);
}

TEST("each unusable image is refused in one line")
{
    const uint8_t rgba[4 * 4 * 4] = {0};
    char bytes[3000];
    write_text("words.png", "this is text");
    kn_image_write_png("color.png", 4, 4, rgba, error, sizeof error);
    gray("bare.png", 64, 64, 7, false);
    gray("odd.png", 64, 64, 7, true);
    gray("wide.png", 9000, 2, 7, false);
    gray("nothing.png", 64, 64, 0, false);
    gray("full.png", 320, 320, 20001, false);
    kn_write("half.png", bytes, kn_read("odd.png", bytes, sizeof bytes) * 2 / 3);
#define IMAGE SMALL " --depth "
    refuses("nosuch.png: No such file", IMAGE "nosuch.png");
    refuses("words.png: is not a PNG, expected a range image", IMAGE "words.png");
    refuses("color.png: 8 bits of colour, expected 16 bits of grey", IMAGE "color.png");
    refuses("bare.png: has no text step_mm, expected a range image of knead view --depth, or the option --step",
            IMAGE "bare.png");
    refuses("bare.png: has no text top_mm, expected a range image of knead view --depth, or the option --top",
            IMAGE "bare.png --step '1 um' --pixel '0.2 mm' --left '0 mm'");
    refuses("odd.png: top_mm is x, expected a place in mm", IMAGE "odd.png");
    refuses("wide.png: 9000 x 2 pixels, expected at most 8192 on a side", IMAGE "wide.png");
    refuses("half.png: ", IMAGE "half.png");
    refuses("nothing.png: every pixel is 0, expected an object",
            IMAGE "nothing.png --step '1 um' --pixel '0.2 mm' --left '-6 mm' --top '6 mm'");
    refuses("full.png: shows an extent of 12",
            IMAGE "full.png --step '1 um' --pixel '0.04 mm' --left '-6 mm' --top '6 mm'");
    refuses("full.png: shows a height of 200 mm, expected about the object's 30 mm",
            IMAGE "full.png --step '10 um' --pixel '0.2 mm' --left '-32 mm' --top '32 mm'");
    refuses("/: ", IMAGE "/");
}

TEST("each impossible request is refused in one line")
{
    measure((lump){.structure = "both", .pressure_pa = 1e5});
    record_press();
    write_text("nounit.csv", "time,force\n0,1\n");
    write_text("late.csv", "time_s,force_n\n100,1\n101,2\n");
    write_text("back.csv", "time_s,force_n\n0,1\n1,2\n0.5,1\n");
    write_text("far.csv", "x_m,y_m,z_m\n5,5,5\n6,6,6\n");
    write_text("few.csv", "x_mm,y_mm,z_mm\n20,20,30\n");
    write_text("flat.csv", "x_mm,y_mm\n20,20\n");
#define DEPTH SMALL " --depth depth.png "
    refuses("expected one scene", "--depth depth.png");
    refuses("expected a shape: --depth IMAGE.png or --points FILE.csv", SMALL);
    refuses("--nonsense: unknown option", SMALL " --nonsense");
    refuses("--at x: expected hold, end, or seconds", DEPTH "--at x");
    refuses("--at 99: the press ends at", DEPTH "--at 99");
    refuses("--at: 2 times for 1 surfaces, expected one for each", DEPTH "--at hold,end");
    refuses("--pixel 0.2: expected a length above 0", DEPTH "--pixel 0.2");
    refuses("--down 5 m: expected a depth", DEPTH "--down '5 m'");
    refuses("a press of 28 mm, expected at most 24 mm", DEPTH "--down '28 mm'");
    refuses("--only diagonal: unknown structure 'diagonal'", DEPTH "--only diagonal");
    refuses("--only mesh: dough-small.yaml has no such structure without --mesh", DEPTH "--only mesh");
    refuses("--mesh: expected --mesh-unit", DEPTH "--mesh x.msh");
    refuses("--mesh nosuch.msh: no such file", DEPTH "--mesh nosuch.msh --mesh-unit mm");
    refuses("--probe thumb: the scene has no probe of that name", DEPTH "--probe thumb");
    refuses("depth.png: is also the input --depth", DEPTH "--out-depth depth.png");
    refuses("--hold: expected no --log", DEPTH "--hold 3 --log x.lcmlog");
    refuses("x.lcmlog: No such file", DEPTH "--log x.lcmlog");
    refuses("nosuch.yaml:1:1: No such file", "nosuch.yaml --depth depth.png");
    refuses("no column of", DEPTH "--force nounit.csv");
    refuses("late.csv: 0 readings between", DEPTH "--force late.csv");
    refuses("back.csv:4:1: time falls", DEPTH "--force back.csv");
    refuses("far.csv: 2 of 2 points are farther", SMALL " --points far.csv");
    refuses("few.csv: 1 points on the surface", SMALL " --points few.csv");
    refuses("no column z", SMALL " --points flat.csv");
    refuses("missed.lcmlog: the finger never touches the object in this log",
            DEPTH "--log missed.lcmlog --probe finger --force force.csv");
    refuses("bun.msh: the mesh is 60 x 60 x 24 mm, expected the object's 50 x 50 x 30 mm within 10 %; is --mesh-unit "
            "mm right?",
            DEPTH "--mesh " KN_SOURCE_DIR "/core/scenes/meshes/bun.msh --mesh-unit mm");
    refuses("--png p.png: expected --depth or a force, because points are not drawn",
            SMALL " --points points.csv --png p.png --out early.yaml");
    CHECK(access("early.yaml", F_OK) != 0);
    refuses("--finer: mesh is a mesh, expected a block", BUN " --depth depth.png --finer");
}

TEST("an output must not replace an input, a file that the scene names, or another output")
{
    static const char material[] = "elements: {k1: 80 gf/cm^2}\n";
    char text[100];
    write_text("blk.msh", "$MeshFormat\n");
    write_text("sub.yaml", material);
    write_text("named.yaml", "version: 1\nmaterial: sub.yaml\n");
    refuses("--out blk.msh: is also the input --mesh ./blk.msh, expected another",
            DEPTH "--mesh ./blk.msh --mesh-unit mm --out blk.msh");
    refuses("--out ./sub.yaml: is also an input, which named.yaml names",
            "named.yaml --depth depth.png --out ./sub.yaml");
    refuses("--png sub.yaml: is also an input, which --set material=sub.yaml names",
            DEPTH "--set material=sub.yaml --png sub.yaml");
    refuses("--out same and --out-depth ./same are one file", DEPTH "--out same --out-depth ./same");
    refuses("--out same and --png same are one file", DEPTH "--out same --png same");
    refuses("--out force.csv: is also the input --force force.csv", DEPTH "--force force.csv --out force.csv");
    kn_read("blk.msh", text, sizeof text);
    CHECK_STR(text, "$MeshFormat\n");
    kn_read("sub.yaml", text, sizeof text);
    CHECK_STR(text, material);
    CHECK(access("same", F_OK) != 0);
}

TESTS_MAIN
