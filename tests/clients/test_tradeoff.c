// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/cli/commands.h"
#include "clients/sweep/pareto_front.h"
#include "server/log.h"
#include "server/wire.h"
#include "tests/clients/heard.h"

#define SCENE KN_SOURCE_DIR "/core/scenes/dough-small.yaml"

// Record only the poses of a hand: half a second above the block (for the gain), then depth_m into it, and out again.
static void record(double depth_m)
{
    lcm_eventlog_t *log = lcm_eventlog_create("tradeoff.lcmlog", "w");
    for (int i = 0; log && i < 1300; i++) {
        double t = 1e-3 * i - 0.7, x = t / 0.15;
        kn_pose pose = {.session = 1, .seq = i + 1, .utime = 1000 * i, .orientation_wxyz = {1}};
        pose.position_m[2] = 0.032 - (depth_m + 0.002) * exp(-x * x);
        pose.velocity_m_s[2] = (depth_m + 0.002) * exp(-x * x) * 2 * x / 0.15;
        knead_probe_pose_t message;
        uint8_t bytes[256];
        kn_wire_pose(&message, &pose);
        int size = knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &message);
        CHECK(kn_log_write(log, 1700000000000000 + 1000 * i, "KNEAD_POSE_plate", bytes, (size_t)size));
    }
    lcm_eventlog_destroy(log);
}

// Run the command and check its exit code and words of its output. SMALL: on a block of 3 x 3 x 4 nodes.
#define SMALL "--set 'object.size=[2 cm, 2 cm, 3 cm]' "
#define RUN(code, words, ...)                                                                                          \
    KN_CALLS(code, words, kn_tradeoff_main, "knead tradeoff", SCENE " tradeoff.lcmlog " __VA_ARGS__)

// Check that the arguments are refused before any run.
#define REFUSES(code, words, ...)                                                                                      \
    do {                                                                                                               \
        RUN(code, words, __VA_ARGS__);                                                                                 \
        CHECK(!kn_said("runs "));                                                                                      \
    } while (0)

// Return an entry of the CSV, rows counted from 0, or NAN if the entry is empty.
static double cell(const char *path, const char *column, int row)
{
    char line[2000], *at, *end;
    FILE *f = fopen(path, "r");
    int index = 0;
    if (!f || !fgets(line, sizeof line, f)) return NAN;
    line[strcspn(line, "\n")] = '\0';
    for (at = line; (end = strchr(at, ',')) && strncmp(at, column, strlen(column)) != 0; at = end + 1) index++;
    for (int r = 0; r <= row; r++)
        if (!fgets(line, sizeof line, f)) return fclose(f), NAN;
    fclose(f);
    for (at = line; index > 0; index--) at = strchr(at, ',') + 1;
    double value = strtod(at, &end);
    return end == at ? NAN : value;
}

TEST("twelve iterations cost more than one and have less than half the solver error; the step error is listed beside")
{
    record(0.003);
    RUN(KN_EXIT_OK, "of which 0 were kept", SMALL "--iterations 1,12 --csv t.csv");
    CHECK(kn_said("fast") && kn_said("accurate"));
    double error[13] = {0}, cost_us[13] = {0}; // by iterations
    for (int i = 0; i < 3; i++) {
        const double median_us = cell("t.csv", "median_us", i), iterations = cell("t.csv", "iterations,", i);
        if (iterations == 1 || iterations == 12) {
            error[(int)iterations] = cell("t.csv", "force_solver", i);
            cost_us[(int)iterations] = median_us;
        }
        CHECK(cell("t.csv", "force_step", i) > 1e-4 && cell("t.csv", "force_step", i) < 0.2);
        CHECK(cell("t.csv", "force_lattice", i) == 0 && isfinite(cell("t.csv", "lag_s", i)));
        CHECK(median_us > 0 && cell("t.csv", "p90_us", i) >= median_us);
    }
    CHECK(error[12] > 0 && error[12] < 0.2 && error[1] > 2 * error[12]);
    CHECK(cost_us[12] > cost_us[1]);
}

TEST("half the time step has less step error and a reference of its own")
{
    RUN(KN_EXIT_OK, "", SMALL "--iterations 12 --dt '1 ms,0.5 ms' --csv dt.csv");
    double whole = cell("dt.csv", "force_step", 0), half = cell("dt.csv", "force_step", 2);
    CHECK(cell("dt.csv", "dt_s", 0) == 1e-3 && cell("dt.csv", "dt_s", 2) == 5e-4);
    CHECK(half > 0 && half < whole);
    CHECK(cell("dt.csv", "force_solver", 2) < cell("dt.csv", "force_solver", 0));
}

TEST("the finest lattice has no lattice error, and a coarser one has more than 1 %")
{
    RUN(KN_EXIT_OK, "", SMALL "--iterations 8 --spacing '10 mm,5 mm' --csv h.csv");
    CHECK(cell("h.csv", "nodes", 0) == 36 && cell("h.csv", "force_lattice", 0) > 0.01 &&
          cell("h.csv", "shape_lattice", 0) > 0.01);
    CHECK(cell("h.csv", "nodes", 2) == 175 && cell("h.csv", "force_lattice", 2) == 0);
}

TEST("if rk4 cannot run, the reason is printed and the other solvers run")
{
    RUN(KN_EXIT_OK, "rk4 cannot run here: ", SMALL "--iterations 8 --solver rk4,blend");
    CHECK(kn_said("blend   f32  8 "));
}

TEST("kept runs are not repeated, and those of another scene or log are not used")
{
    RUN(KN_EXIT_OK, "runs       5, of which 0 were kept", SMALL "--iterations 2,8 --resume kept");
    RUN(KN_EXIT_OK, "runs       5, of which 4 were kept", SMALL "--iterations 2,4 --resume kept");
    RUN(KN_EXIT_OK, "of which 0 were kept", SMALL "--quick --iterations 2 --set 'density=1000 kg/m^3' --resume kept");
    record(0.002);
    RUN(KN_EXIT_OK, "of which 0 were kept", SMALL "--quick --iterations 2 --resume kept");
    RUN(KN_EXIT_USAGE, "/: is not a folder of runs", SMALL "--resume /");
}

TEST("an unreachable budget gives exit code 1, and a budget that every point meets selects the most accurate")
{
    record(0.003);
    RUN(KN_EXIT_FAILED, "--budget 0.001 us: no usable point", SMALL "--iterations 8 --budget '0.001 us'");
    RUN(KN_EXIT_OK, "1e+06 us", SMALL "--iterations 1,12 --budget 1s");
    CHECK(!kn_said("iterations=1'"));
}

// Append a scene to the log: the scene that the log claims to belong to.
static void record_with(const char *file, const char *const *sets, int count)
{
    OWN(kn_scene) *scene = load_scene(file, sets, count);
    record(0.003);
    lcm_eventlog_t *log = lcm_eventlog_create("tradeoff.lcmlog", "a");
    knead_scene_t m = {.version = (char *)"0.9.0", .name = (char *)file, .text = (char *)scene->text, .text_hash = 1};
    uint8_t bytes[8192];
    int size = knead_scene_t_encode(bytes, 0, sizeof bytes, &m);
    CHECK(size > 0 && kn_log_write(log, 1700000002000000, "KNEAD_SCENE", bytes, (size_t)size));
    lcm_eventlog_destroy(log);
}

TEST("a log that is cut, of another scene or without contact is refused in one line before any run")
{
    CHECK(truncate("tradeoff.lcmlog", 90001) == 0);
    REFUSES(KN_EXIT_USAGE, "tradeoff.lcmlog: cut within a record at byte", SMALL "--iterations 8");
    CHECK(kn_said("complete records, expected a whole log of one run"));
    record_with("jelly.yaml", NULL, 0);
    REFUSES(KN_EXIT_USAGE,
            "tradeoff.lcmlog: was recorded with another scene, 'jelly.yaml', expected one of dough-small.yaml",
            SMALL "--iterations 8");
    record(-0.001);
    RUN(KN_EXIT_USAGE, "its tools never touch the object", SMALL "--iterations 8");
    // The same scene with another solver, a quality point and mesh measures for screens. Only the hand matters.
    record_with("dough-small.yaml",
                (const char *const[]){"solver.iterations=9", "quality.fast.iterations=3", "mesh.measures=both"}, 3);
    RUN(KN_EXIT_OK, "", SMALL "--quick --iterations 8");
}

TEST("an output that cannot be written is refused before any run, and existing files keep their contents")
{
    char text[100];
    record(0.003);
    REFUSES(KN_EXIT_DEVICE, "/nosuch/t.csv: No such file", SMALL "--csv /nosuch/t.csv");
    REFUSES(KN_EXIT_DEVICE, "/nosuch/t.png: ", SMALL "--png /nosuch/t.png");
    RUN(KN_EXIT_USAGE, "tradeoff.lcmlog: is being read", SMALL "--csv tradeoff.lcmlog");
    kn_write("old.csv", "mine\n", 5);
    CHECK(truncate("tradeoff.lcmlog", 90001) == 0);
    RUN(KN_EXIT_USAGE, "", SMALL "--csv new.csv");
    RUN(KN_EXIT_USAGE, "", SMALL "--csv old.csv");
    RUN(KN_EXIT_USAGE, "cut within a record", "--write");
    kn_read("old.csv", text, sizeof text);
    CHECK_STR(text, "mine\n");
    CHECK(access("new.csv", F_OK) != 0);
}

TEST("each bad option is refused")
{
    static const char *const bad[][2] = {{"--iterations 0", "expected at most 32 whole numbers"},
                                         {"--iterations 4,", "expected at most 32 whole numbers"},
                                         {"--solver euler", "expected any of blend"},
                                         {"--precision f16", "expected f32, f64"},
                                         {"--dt '0.3 ms'", "expected at most 32 times"},
                                         {"--dt 1", "expected at most 32 times"},
                                         {"--spacing '7 mm'", "is 2.8571429 spacings"},
                                         {"--tolerance 1e-3,-1", "expected at most 32 numbers"},
                                         {"--jobs -1", "expected a whole number"},
                                         {"--budget fast", "expected a time like '300 us'"},
                                         {"--slurm", "--slurm: expected --resume DIR"},
                                         {"--set solver.colour=red", "solver.colour"},
                                         {"--write", "--write: the points would be valid only with --set"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) RUN(KN_EXIT_USAGE, bad[i][1], SMALL "%s", bad[i][0]);
}

// ---- the file

TEST("a trace is read back as written, and a damaged or missing file is refused")
{
    double force[6][3] = {{1, 2, 3}, {4, 5, 6}}, shape[8][3] = {{7}};
    float us[3] = {0, 8, 9};
    kn_replay_trace t = {.ticks = 3,
                         .probes = 2,
                         .force_n = force,
                         .us = us,
                         .nodes = 8,
                         .grid = {2, 2, 2},
                         .spacing_m = 0.01,
                         .shape_m = shape,
                         .faults = 1,
                         .median_us = 5,
                         .p90_us = 6},
                    back;
    CHECK(kn_replay_trace_save(&t, "one.trace"));
    CHECK(kn_replay_trace_load(&back, "one.trace") && back.ticks == 3 && back.p90_us == 6);
    CHECK(!memcmp(back.force_n, force, sizeof force) && !memcmp(back.shape_m, shape, sizeof shape));
    CHECK(!memcmp(back.us, us, sizeof us));
    kn_replay_trace_free(&back);
    CHECK(!kn_replay_trace_load(&back, "no.trace"));
    for (long at = 0; at < 600; at += 40) { // any changed byte is noticed, and no size is trusted
        CHECK(kn_replay_trace_save(&t, "bad.trace"));
        FILE *f = fopen("bad.trace", "r+");
        fseek(f, at, SEEK_SET);
        fputc(0xa5, f);
        fclose(f);
        bool found = kn_replay_trace_load(&back, "bad.trace");
        kn_replay_trace_free(&back);
        bool number = at >= 16 && at < 16 + (long)sizeof t; // numbers in the header: a wrong cost cannot be noticed
        CHECK(number || !found);
    }
    CHECK(truncate("one.trace", 300) == 0 && !kn_replay_trace_load(&back, "one.trace"));
}

TEST("the smaller of two times counts for each tick, which removes disturbances")
{
    float one[20] = {0}, two[20] = {0};
    for (int i = 5; i < 20; i++) one[i] = two[i] = 10;
    for (int i = 5; i < 11; i++) one[i] = 90, two[i + 6] = 80;
    kn_replay_trace t = {.ticks = 20, .us = one}, other = {.ticks = 20, .us = two};
    CHECK(kn_replay_trace_calm(&t, &other) && t.median_us == 10 && t.p90_us == 10);
    one[7] = one[8] = two[7] = 30; // expensive in both traces
    one[8] = two[8] = 40;
    CHECK(kn_replay_trace_calm(&t, &other) && t.median_us == 10 && t.p90_us == 30 && one[0] == 0);
}

// ---- the rules

// Points of the scene's own lattice, step and precision. Each has a number of iterations per step and a maximum.
static kn_scene scene;
static kn_sweep_plan plan = {.scene = &scene};
static kn_sweep_run run[8];
static kn_pareto_front front;
static const kn_pareto_row *named[KN_QUALITY_OWN];

static void begin(double budget_s)
{
    scene.model = kn_model_def_default();
    scene.budget_s = budget_s;
    front.count = 0;
}

static kn_pareto_row *add(int iterations, int most, double us, double solver)
{
    const int i = front.count++;
    run[i] = (kn_sweep_run){.spacing_m = scene.model.spacing_m,
                            .dt_s = scene.model.solver.dt_s,
                            .passes = 1,
                            .precision = scene.model.solver.precision,
                            .iterations = iterations,
                            .iterations_max = most};
    front.row[i] = (kn_pareto_row){.run = &run[i],
                                   .median_us = us,
                                   .p90_us = 1.2 * us,
                                   .jump_n = 1,
                                   .same_jump_n = 1,
                                   .force = {.solver = solver, .all = solver},
                                   .shape = {.solver = solver, .all = solver}};
    return &front.row[i];
}

static void name(void) { kn_pareto_front_name(&front, &plan, named); }

TEST("the budget limits the p90 time, and points that chatter or latch are never picked")
{
    begin(8e-4);
    add(1, 1, 100, 0.03);
    add(1, 1, 200, 0.01);
    add(1, 1, 50, 0.001)->chatters = true;
    add(1, 1, 50, 0.001)->latched = true;
    CHECK(kn_pareto_front_pick(&front, 240) == &front.row[1]);
    CHECK(kn_pareto_front_pick(&front, 239) == &front.row[0]);
    CHECK(!kn_pareto_front_pick(&front, 60));
}

TEST("the named points are the cheapest with enough accuracy, at the scene's own spacing, time step and precision")
{
#define FIVE "2 2 10 1e-4 1 2; 4 12 60 .02 1 1; 8 24 90 .004 1 1; 12 36 80 .02 1 1; 16 48 300 5e-4 1 1;"
    static const struct {
        const char *sentence;
        double budget_s;
        const char *points;           // iterations, maximum, us, error, jump (converged: 1), spacing (of the scene: 1)
        int fast, balanced, accurate; // index of the point, -1: none
        double excess;                // of the accurate point
    } all[] = {{"a budget that every point meets", 8e-4, FIVE, 1, 2, 4, 1 / KN_PARETO_JUMP},
               {"no point is accurate enough: the nearest, and less work for the others", 2e-4, FIVE, 1, 2, 2, 4},
               {"more work and less accurate: no use for a name", 2e-4,
                "4 12 60 .02 1 1; 8 24 90 .5 1 1; 12 36 80 .02 1 1;", 0, 0, 0, 20},
               {"no point meets the budget", 1e-5, "4 12 60 .02 1 1;", -1, -1, -1, 0},
               {"each point needs at least as many iterations, usual and maximum, as the point below it", 8e-4,
                "2 24 20 .02 1 1; 4 4 30 .003 1 1; 4 24 90 .002 1 1;", 0, 2, 2, 2},
               {"the accurate point meets its bound even if a cheaper point fits the lower names better", 8e-4,
                "4 4 30 .004 1 1; 4 48 90 9e-4 1 1; 16 16 50 .002 1 1;", 0, 0, 1, 0.9},
               {"a point is not named if its force jumps by more than 1.5 times the converged jump", 8e-4,
                "2 2 20 .01 1.6 1; 3 3 40 .009 1 1;", 1, 1, 1, 9},
               {"a point is named if its force jumps by less", 8e-4, "2 2 20 .01 1.4 1; 3 3 40 .009 1 1;", 0, 1, 1, 9}};
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        const int expected[] = {all[k].fast, all[k].balanced, all[k].accurate};
        int iterations, most, end = 0;
        double us, solver, jump_n, spacing;
        begin(all[k].budget_s);
        for (const char *at = all[k].points; *at; at += end) {
            CHECK(sscanf(at, "%d %d %lf %lf %lf %lf;%n", &iterations, &most, &us, &solver, &jump_n, &spacing, &end) ==
                  6);
            add(iterations, most, us, solver)->jump_n = jump_n;
            run[front.count - 1].spacing_m *= spacing;
        }
        name();
        for (int q = 0; q < 3; q++)
            if (named[q] != (expected[q] < 0 ? NULL : &front.row[expected[q]]))
                KN_TEST_FAIL("%s: quality point %d", all[k].sentence, q);
        if (named[2]) CHECK_NEAR(kn_pareto_front_excess(named[2], KN_QUALITY_ACCURATE), all[k].excess, 1e-9);
    }
}

TEST("timing noise of up to 24 % does not change the named points")
{
    static const double us[] = {20, 30, 50, 20, 30}, solver[] = {0.02, 0.004, 0.0005, 0.02, 0.004};
    unsigned seed = 1;
    begin(8e-4);
    for (int i = 0; i < 5; i++) add(2 << i % 3, i < 3 ? 2 << i : 24, us[i], solver[i]);
    for (int round = 0; round < 200; round++) {
        for (int i = 0; i < front.count; i++) {
            seed = 1664525 * seed + 1013904223;
            front.row[i].p90_us = us[i] * (1 + 0.24 * (seed >> 8) / (1 << 24)); // up to KN_PARETO_NOISE
        }
        name();
        for (int q = 0; q < 3; q++) CHECK(named[q] == &front.row[q]);
    }
}

TEST("the chart shows a point that chatters differently")
{
    if (system("command -v gnuplot >/dev/null") != 0) {
        puts("no gnuplot here: no picture");
        return;
    }
    static char picture[2][1 << 20];
    size_t size[2];
    begin(8e-4);
    strcpy(scene.name, "picture");
    add(2, 2, 20, 0.02);
    kn_pareto_row *second = add(4, 4, 30, 0.004);
    name();
    for (int i = 0; i < 2; i++) {
        second->chatters = i;
        CHECK(kn_pareto_chart_draw(&front, &plan, named, "chart.png") == KN_EXIT_OK);
        size[i] = kn_read("chart.png", picture[i], sizeof picture[i]);
    }
    CHECK(size[0] > 0 && (size[0] != size[1] || memcmp(picture[0], picture[1], size[0]) != 0));
}

TEST("a better point of another lattice is reported if it meets the budget and the accuracy")
{
    begin(8e-4);
    add(4, 4, 30, 0.004);
    kn_pareto_row *fine = add(4, 4, 200, 0.002);
    run[1].spacing_m /= 2;
    name();
    CHECK(named[0] == &front.row[0] && kn_pareto_front_elsewhere(&front, &plan, named) == fine);
    fine->p90_us = 900; // over the budget
    CHECK(!kn_pareto_front_elsewhere(&front, &plan, named));
    fine->p90_us = 200, fine->force.all = 0.005;
    CHECK(!kn_pareto_front_elsewhere(&front, &plan, named));
}

TESTS_MAIN
