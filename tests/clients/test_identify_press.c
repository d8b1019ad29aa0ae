// knead identify press: find a material again from presses of a lattice, with what a laboratory does not know: the place of
// touch, the frame's compliance, readings before a trigger. The lattice is kneadd's own, stepped apart from the command.
// gate in release: arithmetic, ten times slower with the sanitizers; at night the refusals run with them, but no fit
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "clients/hand/tool_height.h"
#include "clients/identify/measured_curve.h"
#include "core/scene/scene.h"
#include "core/step.h"
#include "tests/clients/heard.h"
#include "tests/dice.h"
#include "tests/owned.h"
#include <jansson.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>

#define OBJECT                                                                                                         \
    "version: 1\nobject: {size: [2 cm, 2 cm, 2 cm], spacing: 1 cm, diagonal_stiffness: %g, pressure: cells, "          \
    "inside_pressure: %g atm}\nsupport: bonded\ngravity: 0 m/s^2\ndevice: bench\nprobes:\n"                            \
    "  - {name: ball, shape: sphere, radius: 1 cm}\n  - {name: plate, shape: plate, size: [3 cm, 3 cm]}\n"

#if defined(KN_SANITIZED)
#define LEFT_OUT(line) __attribute__((unused)) static void KN_TEST_CAT(left_out_, line)(void)
#define FIT_TEST(sentence) LEFT_OUT(__LINE__)
#define NIGHT_FIT_TEST(sentence) LEFT_OUT(__LINE__)
#else
#define FIT_TEST TEST
#define NIGHT_FIT_TEST NIGHT_TEST
#endif

static const double common[] = {20000, 150000, 3e6, 2e-3, 500, 4000}; // k1, c1, alpha, beta, P0, P1
static double truth[6];
static const char *const name[] = {"k1", "c1", "alpha", "beta", "P0", "P1"};
static double diagonal = 0.08, gas_atm = 1; // structure of the block

static char error[600];
static uint64_t seed = 20261128;

typedef struct stage { // how the block is pressed and measured
    int probe;
    double depth_mm, speed_mm_s, hold_s;
    double above_mm;       // way of the stage before it touches
    double compliance_m_n; // of frame and gauge
    double trigger_n;      // the record begins with this force, depth and time at 0
    double noise;          // of the force, share of the largest
    const char *head;      // first line of the file
} stage;

static kn_model *make_block(int probe, double compliance_m_n)
{
    if (truth[0] == 0) memcpy(truth, common, sizeof truth);
    char text[2000];
    snprintf(
        text, sizeof text,
        OBJECT
        "density: 1200 kg/m^3\nmaterial: {k1: %g Pa, c1: %g Pa*s, damper: exponential, alpha: %g Pa*s, beta: %g 1/Pa, "
        "p0: %g Pa, p1: %g Pa}\n",
        diagonal, gas_atm, truth[0], truth[1], truth[2], truth[3], truth[4], truth[5]);
    OWN(kn_scene) *scene = kn_scene_parse("block", text, strlen(text), NULL, 0, error, sizeof error);
    if (!scene) fprintf(stderr, "%s\n", error), exit(1);
    scene->model.probe[0] = scene->model.probe[probe], scene->model.probe_count = 1;
    if (compliance_m_n > 0) scene->model.probe[0].coupling_n_m = 1 / compliance_m_n;
    return kn_model_build(&scene->model, error, sizeof error);
}

// Press the block and write time, force and depth of the stage, every fifth tick.
static void measure(const char *path, stage s)
{
    OWN(kn_model) *model = make_block(s.probe, s.compliance_m_n);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_scratch) *scratch = kn_scratch_create(model);
    kn_input in = {.probe[0].attached = true};
    kn_output out;
    enum { ROWS = 4000 };
    static double row[ROWS][3];
    double most_n = 0;
    int rows = 0;
    FILE *f = fopen(path, "w");
    if (!model || !state || !f) exit(1);
    const double dt = model->def.solver.dt_s, z_m = 0.02 + kn_tool_height_m(&model->def.probe[0]);
    const double down_s = (s.depth_mm + s.above_mm) / s.speed_mm_s, turn_s = down_s + s.hold_s;
    double before_m = -1e-3 * s.above_mm, begin_s = s.trigger_n > 0 ? NAN : 0, begin_m = 0;
    fprintf(f, "%stime_s,force_N,depth_mm\n", s.head ? s.head : "");
    for (int tick = 1; tick * dt < turn_s + down_s; tick++) {
        const double t = tick * dt, way_s = t < down_s ? t : t < turn_s ? down_s : down_s + turn_s - t;
        const double stage_m = 1e-3 * s.speed_mm_s * way_s, depth_m = stage_m - 1e-3 * s.above_mm;
        in.probe[0].position_m[2] = z_m - before_m;
        in.probe[0].velocity_m_s[2] = (before_m - depth_m) / dt;
        CHECK(kn_step(model, state, scratch, &in, &out) == KN_OK);
        const double force_n = out.probe[0].force_n[2];
        before_m = depth_m;
        if (isnan(begin_s) && force_n > s.trigger_n) begin_s = t, begin_m = stage_m;
        if (tick % 5 != 0 || isnan(begin_s) || rows == ROWS) continue;
        row[rows][0] = t - begin_s, row[rows][1] = force_n, row[rows++][2] = 1e3 * (stage_m - begin_m);
        most_n = fmax(most_n, force_n);
    }
    for (int i = 0; i < rows; i++)
        fprintf(f, "%.5g,%.6g,%.6g\n", row[i][0], row[i][1] + s.noise * most_n * kn_dice_normal(&seed), row[i][2]);
    fclose(f);
}

static void write_text(const char *path, const char *text)
{
    FILE *f = fopen(path, "w");
    kn_rows(f, text);
    fclose(f);
}

static int identify(int argc, char **argv)
{
    const int code = kn_identify_main(argc, argv);
    kn_result_close(code);
    return code;
}

#define PRESS(code, said, ...) KN_CALLS(code, said, identify, "knead identify", "press " __VA_ARGS__)

static json_t *root; // results of the last call with --json

static json_t *number_of(const char *key) { return json_object_get(json_object_get(root, "numbers"), key); }
static double part_of(const json_t *of, const char *key) { return json_number_value(json_object_get(of, key)); }
static const json_t *press_of(int k) { return json_array_get(json_object_get(root, "presses"), (size_t)k); }

static void load_results(void)
{
    const char *text = strchr(kn_out, '{');
    json_decref(root);
    root = json_loads(text ? text : "", 0, NULL);
    CHECK(root);
}

static void write_object(void) // the block as the command knows it: with another material
{
    char text[1000];
    snprintf(text, sizeof text, OBJECT "material: dough\n", diagonal, gas_atm);
    write_text("block.yaml", text);
}

__attribute__((constructor)) static void write_scenes(void)
{
    write_object();
    write_text("ball.yaml", "probes:\n  - {name: nine, shape: sphere, radius: 1 cm}\n");
}

FIT_TEST("one press with noise gives the material, and predicts another speed and another tool to 3 % of the force")
{
    // with a hold of 0.8 s two of nine such noises showed k1, with 2 s four of four
    measure("slow.csv", (stage){.depth_mm = 5, .speed_mm_s = 10, .hold_s = 2, .above_mm = 0.5, .noise = 0.0015});
    measure("fast.csv", (stage){.depth_mm = 4, .speed_mm_s = 40, .hold_s = 0.4, .trigger_n = 0.02, .noise = 0.0015});
    measure("flat.csv", (stage){1, 4, 20, 0.4, 0.7, .noise = 0.0015, .head = "# tool: plate\n"});
    PRESS(0, "",
          "slow.csv --held fast.csv --held flat.csv --object block.yaml --tool ball --compliance '0 mm/N' --out "
          "mine.yaml --json");
    load_results();
    int known = 0;
    for (int i = 0; i < 6; i++) {
        const json_t *n = number_of(name[i]);
        if (strcmp(json_string_value(json_object_get(n, "known")), "known") != 0) continue;
        printf("  %s %.3g [%.3g .. %.3g] of the true one\n", name[i], part_of(n, "value") / truth[i],
               part_of(n, "low") / truth[i], part_of(n, "high") / truth[i]);
        CHECK(part_of(n, "low") < truth[i] && part_of(n, "high") > truth[i]);
        known++;
    }
    CHECK(known >= 4);
    for (int k = 0; k < 3; k++) {
        printf("  press %d: %.2f %% left, touch at %.3f mm\n", k, 100 * part_of(press_of(k), "left"),
               1e3 * part_of(press_of(k), "touch_m"));
        CHECK(part_of(press_of(k), "left") < 0.03);
    }
    CHECK_NEAR(part_of(press_of(0), "touch_m"), 5e-4, 5e-5);
    CHECK(part_of(press_of(1), "touch_m") < 0); // it touched before the record
    OWN(kn_scene) *mine = kn_scene_load("mine.yaml", NULL, 0, error, sizeof error);
    CHECK(mine && strstr(mine->label, "fitted to presses with ball, slow.csv: cells of 10 mm") &&
          strstr(mine->label, "Predicted, not fitted, left %: fast "));
    CHECK(access("mine.yaml.fit", F_OK) != 0);
}

NIGHT_FIT_TEST("the compliance of the frame is found, and intervals of replicates come from their spread")
{
    const stage s = {
        .depth_mm = 5, .speed_mm_s = 20, .hold_s = 0.3, .above_mm = 0.5, .compliance_m_n = 4e-4, .noise = 0.0015};
    measure("one.csv", s);
    measure("two.csv", s);
    measure("three.csv", s);
    PRESS(0, "", "one.csv two.csv three.csv --object block.yaml --tool ball.yaml --json --out nine.yaml");
    load_results();
    const json_t *frame = number_of("frame");
    printf("  frame %.3g m/N [%.3g .. %.3g]\n", part_of(frame, "value"), part_of(frame, "low"), part_of(frame, "high"));
    CHECK_NEAR(part_of(frame, "value"), 4e-4, 4e-5);
    for (int k = 0; k < 3; k++) CHECK(part_of(press_of(k), "left_when_left_out") < 0.02);
    OWN(kn_scene) *nine = kn_scene_load("nine.yaml", NULL, 0, error, sizeof error); // has the tool of the file
    CHECK(nine && nine->model.probe_count == 3 && !strcmp(nine->model.probe[2].name, "nine"));
}

// KN_CASES=60 presses that many lumps.
NIGHT_FIT_TEST(
    "lumps of hidden numbers, structures and tools: of the intervals that are told, 85 % hold the true number")
{
    static const double structure[][2] = {{0.08, 1}, {1, 1}, {0.5, 0.3}};
    const int count = getenv("KN_CASES") ? atoi(getenv("KN_CASES")) : 4;
    int told[6] = {0}, held[6] = {0}, all = 0, good = 0;
    double wide = 0; // sum of the logarithms of high/low
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < 6; k++) truth[k] = common[k] * pow(4, kn_dice(&seed) - 0.5);
        const int kind = (int)(3 * kn_dice(&seed));
        diagonal = structure[kind][0], gas_atm = structure[kind][1];
        write_object();
        const stage s = {.probe = kn_dice(&seed) < 0.3,
                         .depth_mm = 3 + 3 * kn_dice(&seed),
                         .speed_mm_s = 5 * pow(8, kn_dice(&seed)),
                         .hold_s = 0.3 + kn_dice(&seed),
                         .above_mm = 0.3,
                         .noise = 0.01};
        measure("lump.csv", s);
        PRESS(0, "", "lump.csv --object block.yaml --tool %s --compliance '0 mm/N' --json", s.probe ? "plate" : "ball");
        load_results();
        for (int k = 0; k < 6; k++) {
            const json_t *n = number_of(name[k]);
            if (strcmp(json_string_value(json_object_get(n, "known")), "known") != 0) continue;
            const bool in = part_of(n, "low") <= truth[k] && truth[k] <= part_of(n, "high");
            told[k]++, held[k] += in;
            wide += log(part_of(n, "high") / part_of(n, "low"));
            if (!in)
                printf("  lump %d: %s %.3g [%.3g .. %.3g] of the true one\n", i, name[k],
                       part_of(n, "value") / truth[k], part_of(n, "low") / truth[k], part_of(n, "high") / truth[k]);
        }
    }
    for (int k = 0; k < 6; k++) {
        printf("  %s: %d of %d told intervals hold it\n", name[k], held[k], told[k]);
        all += told[k], good += held[k];
    }
    printf("  from end to end of an interval: a factor of %.2g (geometric mean)\n", exp(wide / all));
    CHECK(all > 0 && good >= 0.85 * all && exp(wide / all) < 20);
    diagonal = 0.08, gas_atm = 1;
    write_object();
    memcpy(truth, common, sizeof truth);
}

NIGHT_FIT_TEST("a fit that was killed goes on where it was")
{
    measure("slow.csv", (stage){.depth_mm = 4, .speed_mm_s = 30, .hold_s = 0.2, .above_mm = 0.5, .noise = 0.0015});
    const pid_t child = fork();
    if (child == 0) {
        kn_call(identify, "knead identify", "press slow.csv --object block.yaml --tool ball --out killed.yaml");
        _exit(0);
    }
    for (int i = 0; i < 3000 && access("killed.yaml.fit", F_OK) != 0; i++)
        nanosleep(&(struct timespec){0, 10000000}, NULL);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    CHECK(access("killed.yaml.fit", F_OK) == 0 && access("killed.yaml", F_OK) != 0);
    PRESS(0, "note: the fit went on where an earlier one was interrupted",
          "slow.csv --object block.yaml --tool ball --out killed.yaml");
    CHECK(access("killed.yaml.fit", F_OK) != 0 && access("killed.yaml", F_OK) == 0);
}

TEST("noise during a long approach is not taken for a touch, and hardly any air is left")
{
    static kn_curve curve[KN_CURVES_MAX];
    int count = 0;
    measure("far.csv", (stage){.depth_mm = 5, .speed_mm_s = 10, .hold_s = 0.2, .above_mm = 60, .noise = 0.01});
    const kn_curve_options options = {.subcommand = "identify press"};
    kn_hear();
    const int code = kn_curve_load(curve, &count, KN_CURVE_PRESS, "far.csv", &options);
    kn_hear_end();
    CHECK(code == KN_EXIT_OK && count == 1 && kn_said("long before the touch, left out"));
    if (count == 0) return;
    const int touch = kn_curve_touch(&curve[0]);
    CHECK_NEAR(curve[0].other[touch], 60.3e-3, 0.4e-3); // the ball's force grows slowly
    CHECK_NEAR(curve[0].time_s[touch] - curve[0].time_s[0], 0.1, 0.05);
    kn_curve_free(&curve[0]);
}

FIT_TEST("a press that no such lattice gives is told, and written only if the user insists")
{
    // the force jumps to and fro while the tool stands still
    write_text("odd.csv", "time_s,force_N,depth_mm\n0,0,0\n0.1,0.1,1\n0.2,0.2,2\n@20 0.3+0.1,1+0,3\n@20 "
                          "2.3+0.1,4+0,3\n@20 4.3+0.1,1+0,3\n");
    PRESS(1, "not written, the lattice leaves up to ",
          "odd.csv --object block.yaml --tool ball --compliance '0 mm/N' --out odd.yaml");
    CHECK(access("odd.yaml", F_OK) != 0);
}

// Test a cube of the block's material and structure with 2 cells along each side by `command`, and write what a cube of 2 cm
// shows: strains do not depend on the size. `row`: format of time, strain and, if `press`, force in the command's table.
static void measure_cube(int (*command)(int, char **), const char *options, const char *row, bool press,
                         const char *path, const char *head)
{
    char text[1000], line[200];
    snprintf(text, sizeof text,
             OBJECT "density: 1200 kg/m^3\nmaterial: {k1: %g Pa, c1: %g Pa*s, damper: exponential, alpha: %g Pa*s, "
                    "beta: %g 1/Pa, p0: %g Pa, p1: %g Pa}\n",
             diagonal, gas_atm, truth[0], truth[1], truth[2], truth[3], truth[4], truth[5]);
    write_text("true.yaml", text);
    KN_CALLS(0, "", command, "knead", "true.yaml --lattice 2x2x2 --csv all.csv %s", options);
    FILE *from = fopen("all.csv", "r"), *to = fopen(path, "w");
    double time_s = 0, strain, force_n = 0, before_s = 0;
    bool lattice = false; // its rows follow the element's
    fprintf(to, "# height: 2 cm\n# area: 4 cm^2\n%s\n", head);
    for (; from && to && fgets(line, sizeof line, from); before_s = time_s) {
        if (sscanf(line, row, &time_s, &strain, &force_n) < 2) continue;
        lattice |= time_s < before_s;
        const double noise = 0.0015 * kn_dice_normal(&seed);
        if (lattice && press) fprintf(to, "%g,%g,%g\n", time_s, 20 * strain, 4 * force_n);
        if (lattice && !press && time_s > 0) fprintf(to, "%g,%g\n", time_s, strain + noise);
    }
    if (from) fclose(from);
    if (to) fclose(to);
}

NIGHT_FIT_TEST(
    "creep of a specimen is fitted together with a press of the object, and a plate on the specimen is predicted")
{
    measure("slow.csv", (stage){.depth_mm = 5, .speed_mm_s = 10, .hold_s = 0.8, .above_mm = 0.5, .noise = 0.0015});
    measure_cube(kn_creep_main, "--load 20gf --hold 20 --rest 10", "%*g,%lg,%lg", false, "creep.csv",
                 "# load: 80 gf\n# release: 20 s\ntime_s,strain");
    measure_cube(kn_relax_main, "--strain 30% --ramp 20%/s --hold 3", "%lg,%*g,%lg,%*g,%*g,%lg", true, "relax.csv",
                 "# tool: plate\ntime_s,depth_mm,force_N");
    PRESS(0, "",
          "slow.csv --creep creep.csv --held relax.csv --object block.yaml --tool ball --compliance '0 mm/N' "
          "--out both.yaml --csv both.csv --png both.png --json");
    load_results();
    for (int i = 0; i < 6; i++) {
        const json_t *n = number_of(name[i]);
        const bool known = !strcmp(json_string_value(json_object_get(n, "known")), "known");
        printf("  %s %s %.3g [%.3g .. %.3g] of the true one\n", name[i], known ? "known" : "open",
               part_of(n, "value") / truth[i], part_of(n, "low") / truth[i], part_of(n, "high") / truth[i]);
        CHECK(!known || (part_of(n, "low") < truth[i] && part_of(n, "high") > truth[i]));
        // a second of a press does not show the spring, half a minute of creep does
        CHECK(i != 0 || (known && part_of(n, "high") < 2 * part_of(n, "low")));
    }
    for (int k = 0; k < 3; k++) {
        printf("  record %d: %.2f %% left\n", k, 100 * part_of(press_of(k), "left"));
        CHECK(part_of(press_of(k), "left") < 0.03);
    }
    OWN(kn_scene) *both = kn_scene_load("both.yaml", NULL, 0, error, sizeof error);
    CHECK(both && strstr(both->label, "and on the strains of creep"));
}

TEST("bad input is refused in one line that says what to do")
{
    measure("slow.csv", (stage){.depth_mm = 5, .speed_mm_s = 10, .hold_s = 0.2, .above_mm = 0.5});
    write_text("forceless.csv", "time_s,depth_mm\n@20 0+1,1+1\n");
    write_text("twice.csv", "time_s,force_N,depth_mm\n@20 0+1,1+1,1+1\n@20 0+1,1+1,1+1\n");
    write_text("still.csv", "time_s,force_N,depth_mm\n@20 0+1,1+1,3\n");
    write_text("rises.csv", "time_s,force_N,height_mm\n@20 0+1,1+1,3+1\n");
    write_text("toolless.yaml", "probes: []\n");
    write_text("specimen.csv", "# height: 2 cm\n# area: 4 cm^2\ntime_s,force_N,depth_mm\n@20 0+1,1+1,0.1+0.1\n");
    write_text("alone.csv", "# height: 2 cm\ntime_s,force_N,depth_mm\n@20 0+1,1+1,1+1\n");
    write_text("own.csv", "# tool: ball\ntime_s,force_N,depth_mm\n@20 0+1,1+1,0.1+0.1\n");
    write_text("slip.csv", "# load: 10 gf\n# height: 2 cm\n# area: 4 mm^2\ntime_s,strain\n@20 1+1,0.1+0.01\n");
    write_text("sized.csv", "# stress: 1 kPa\ntime_s,strain\n@20 1+1,0.1+0.01\n");
    write_text("compliance.csv", "time_s,compliance_1/Pa\n@20 1+1,0.001+0.0001\n");
    write_text("small.yaml", "probes:\n  - {name: pea, shape: sphere, radius: 2 mm}\n");
    const char *const bad[][2] = {
        {"expected --object SCENE, the scene of the object that was pressed", "slow.csv --tool ball"},
        {"slow.csv: the tool is not known, expected --tool, or a line '# tool: NAME' in the file",
         "slow.csv --object block.yaml"},
        {"--tool: the tool 'fist' is no probe of block.yaml, expected one of its probes, or a file",
         "slow.csv --object block.yaml --tool fist"},
        {"none.yaml:1:1: cannot be read", "slow.csv --object block.yaml --tool none.yaml"},
        {"small.yaml:1:1: probes.pea.radius is 0.002 m, expected at least object.spacing, 0.01 m",
         "slow.csv --object block.yaml --tool small.yaml"},
        {"forceless.csv:1:1: no column of force, expected one", "forceless.csv --object block.yaml --tool ball"},
        {"twice.csv:22:1: time falls, expected one press per file", "twice.csv --object block.yaml --tool ball"},
        {"still.csv:2:", "still.csv --object block.yaml --tool ball"},
        {"rises.csv:21:1: the height rises as the force does, expected one that falls, or a column named depth",
         "rises.csv --object block.yaml --tool ball"},
        {"specimen.csv: has the height and area of a specimen, but the tool 'ball' is no plate as wide as that",
         "specimen.csv --object block.yaml --tool ball"},
        {"alone.csv: the note '# height:' stands alone, expected height and area of a specimen, or neither",
         "alone.csv --object block.yaml --tool plate"},
        {"slip.csv: a specimen of 2 mm width and 20 mm height, expected one that is between 3 times as wide as high",
         "slow.csv --creep slip.csv --object block.yaml --tool ball"},
        {"compliance.csv: the stress of this compliance is not known",
         "slow.csv --creep compliance.csv --object block.yaml "
         "--tool ball"},
        {"--load, --stress, --height, --area and --release are of creep: expected --creep FILE with them",
         "slow.csv --object block.yaml --tool ball --height 2cm"},
        {"expected a press beside --creep", "--creep slip.csv --object block.yaml --tool ball"},
        {"specimen.csv: the tool is not known", "own.csv --creep sized.csv --held specimen.csv --object block.yaml"},
        {"expected a file of readings", "--held slow.csv --object block.yaml --tool ball"},
        {"slow.csv and slow.csv are one file", "slow.csv --held slow.csv --object block.yaml --tool ball"},
        {"bun.yaml: the object is a mesh, expected a block",
         "slow.csv --tool ball --object " KN_SOURCE_DIR "/core/scenes/bun.yaml"},
        {"--compliance 3: expected a compliance like '0.01 mm/N'",
         "slow.csv --object block.yaml --tool ball --compliance 3"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        const int code = kn_call(identify, "knead identify", "press %s", bad[i][1]);
        if (code != KN_EXIT_USAGE || !kn_refused(bad[i][0]))
            KN_TEST_FAIL("press %s: exit %d, expected 2 and one line with: %s\n%s", bad[i][1], code, bad[i][0], kn_err);
    }
    json_decref(root);
    root = NULL;
}
