#include "clients/knead/commands.h"
#include "clients/knead/front.h"
#include "server/log.h"
#include "server/wire.h"
#include "tests/check.h"
#include <fcntl.h>
#include <unistd.h>

#define SCENE KN_SOURCE_DIR "/core/scenes/dough-small.yaml"

// A hand whose poses are all that was recorded: half a second above the block (for the gain), 3 mm into it, out again.
static void record(const char *path, double depth_m)
{
    lcm_eventlog_t *log = lcm_eventlog_create(path, "w");
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

// The command on a block of 3 x 3 x 4 nodes; arguments end with NULL. Its words go into the file `said`.
static int tradeoff(const char *const *arguments)
{
    char *argv[40] = {"knead tradeoff", SCENE, "tradeoff.lcmlog"};
    int argc = 3;
    for (; *arguments; arguments++) argv[argc++] = (char *)*arguments;
    fflush(stdout), fflush(stderr);
    int out = dup(1), err = dup(2), file = open("said", O_WRONLY | O_CREAT | O_TRUNC, 0666);
    dup2(file, 1), dup2(file, 2);
    int code = kn_tradeoff_main(argc, argv);
    fflush(stdout), fflush(stderr);
    dup2(out, 1), dup2(err, 2);
    close(file), close(out), close(err);
    return code;
}

#define SMALL "--set", "object.size=[2 cm, 2 cm, 3 cm]"
#define RUN(...) tradeoff((const char *const[]){__VA_ARGS__, NULL})

static bool said(const char *what)
{
    static char text[20000];
    FILE *f = fopen("said", "r");
    size_t n = f ? fread(text, 1, sizeof text - 1, f) : 0;
    text[n] = '\0';
    if (f) fclose(f);
    return strstr(text, what);
}

// A column of the CSV, of row 0, 1, ...; NAN where it is empty.
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

TEST("more iterations cost more and err less, and the error of the step is told beside that of the solver")
{
    record("tradeoff.lcmlog", 0.003);
    CHECK(RUN(SMALL, "--iterations", "1,12", "--csv", "t.csv") == KN_EXIT_OK);
    CHECK(said("fast") && said("accurate") && said("of which 0 were kept"));
    double one = -1, twelve = -1;
    for (int i = 0; i < 3; i++) {
        if (cell("t.csv", "iterations,", i) == 1) one = cell("t.csv", "force_solver", i);
        if (cell("t.csv", "iterations,", i) == 12) twelve = cell("t.csv", "force_solver", i);
        CHECK(cell("t.csv", "force_step", i) > 1e-4 && cell("t.csv", "force_step", i) < 0.2);
        CHECK(cell("t.csv", "force_lattice", i) == 0);
        CHECK(cell("t.csv", "median_us", i) > 0 && cell("t.csv", "p90_us", i) >= cell("t.csv", "median_us", i));
        CHECK(isfinite(cell("t.csv", "lag_s", i)));
    }
    CHECK(twelve > 0 && twelve < 0.2 && one > 2 * twelve);
}

TEST("half the step has less of the step's error, and its own reference")
{
    CHECK(RUN(SMALL, "--iterations", "12", "--dt", "1 ms,0.5 ms", "--csv", "dt.csv") == KN_EXIT_OK);
    double whole = cell("dt.csv", "force_step", 0), half = cell("dt.csv", "force_step", 2);
    CHECK(cell("dt.csv", "dt_s", 0) == 1e-3 && cell("dt.csv", "dt_s", 2) == 5e-4);
    CHECK(half > 0 && half < whole);
    CHECK(cell("dt.csv", "force_solver", 2) < cell("dt.csv", "force_solver", 0));
}

TEST("the finest lattice has no error of the lattice, a coarser one has")
{
    CHECK(RUN(SMALL, "--iterations", "8", "--spacing", "10 mm,5 mm", "--csv", "h.csv") == KN_EXIT_OK);
    CHECK(cell("h.csv", "nodes", 0) == 36 && cell("h.csv", "force_lattice", 0) > 0.01 &&
          cell("h.csv", "shape_lattice", 0) > 0.01);
    CHECK(cell("h.csv", "nodes", 2) == 175 && cell("h.csv", "force_lattice", 2) == 0);
}

TEST("Runge-Kutta that cannot run says why, and the rest runs")
{
    CHECK(RUN(SMALL, "--iterations", "8", "--solver", "rk4,blend") == KN_EXIT_OK);
    CHECK(said("rk4 cannot run here: ") && said("blend   f32  8 "));
}

TEST("what is kept is not played again; another log, or other sets, are refused by name")
{
    CHECK(system("rm -rf kept") == 0);
    CHECK(RUN(SMALL, "--iterations", "2,8", "--csv", "a.csv", "--resume", "kept") == KN_EXIT_OK);
    CHECK(RUN(SMALL, "--iterations", "2,8", "--csv", "b.csv", "--resume", "kept") == KN_EXIT_OK);
    CHECK(said("runs       5, of which 5 were kept"));
    CHECK(system("cmp -s a.csv b.csv") == 0);
    CHECK(RUN(SMALL, "--iterations", "2,4", "--resume", "kept") == KN_EXIT_OK);
    CHECK(said("runs       5, of which 4 were kept"));
    CHECK(RUN(SMALL, "--set", "density=1000 kg/m^3", "--resume", "kept") == KN_EXIT_USAGE);
    CHECK(said("kept: its runs are of another scene, expected"));
    record("tradeoff.lcmlog", 0.002);
    CHECK(RUN(SMALL, "--resume", "kept") == KN_EXIT_USAGE && said("of another log, expected"));
    CHECK(RUN(SMALL, "--resume", "/") == KN_EXIT_USAGE && said("/: is not a sweep's, expected an empty folder"));
}

TEST("a budget that nothing meets is told by the exit code, one that all meet takes the nearest")
{
    record("tradeoff.lcmlog", 0.003);
    CHECK(RUN(SMALL, "--iterations", "8", "--budget-us", "0.001") == KN_EXIT_FAILED &&
          said("--budget-us 0.001: no point"));
    CHECK(RUN(SMALL, "--iterations", "1,12", "--budget-us", "1e6") == KN_EXIT_OK && said("1e+06 us"));
    CHECK(!said("iterations=1'"));
}

TEST("a log whose tool stays above the object has nothing to compare")
{
    record("tradeoff.lcmlog", -0.001);
    CHECK(RUN(SMALL, "--iterations", "8") == KN_EXIT_USAGE && said("its tools never touch the object"));
}

TEST("bad options are refused")
{
    static const char *const bad[][3] = {{"--iterations", "0", "expected at most 32 whole numbers"},
                                         {"--iterations", "4,", "expected at most 32 whole numbers"},
                                         {"--solver", "euler", "expected of blend"},
                                         {"--precision", "f16", "expected f32, f64"},
                                         {"--dt", "0.3 ms", "expected at most 32 times"},
                                         {"--dt", "1", "expected at most 32 times"},
                                         {"--spacing", "7 mm", "is 2.8571429 spacings"},
                                         {"--tolerance", "1e-3,-1", "expected at most 32 numbers"},
                                         {"--jobs", "-1", "expected a whole number"},
                                         {"--budget-us", "fast", "expected a number of microseconds"},
                                         {"--set", "solver.colour=red", "solver.colour"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        CHECK(RUN(SMALL, bad[i][0], bad[i][1]) == KN_EXIT_USAGE);
        if (!said(bad[i][2])) KN_TEST_FAIL("%s %s", bad[i][0], bad[i][1]);
    }
    CHECK(RUN("--write", SMALL) == KN_EXIT_USAGE && said("--write: the points would be of the scene with --set"));
}

// ---- the file

TEST("a trace comes back as it was; damaged, foreign and missing ones are told apart")
{
    double force[6][3] = {{1, 2, 3}, {4, 5, 6}}, shape[8][3] = {{7}};
    kn_trace t = {.ticks = 3, .probes = 2, .force_n = force, .nodes = 8, .grid = {2, 2, 2}, .spacing_m = 0.01,
                  .shape_m = shape, .faults = 1, .median_us = 5, .p90_us = 6}, back;
    CHECK(kn_trace_save(&t, "one.trace", 77));
    CHECK(kn_trace_load(&back, "one.trace", 77) == KN_TRACE_FOUND && back.ticks == 3 && back.p90_us == 6);
    CHECK(!memcmp(back.force_n, force, sizeof force) && !memcmp(back.shape_m, shape, sizeof shape));
    kn_trace_free(&back);
    CHECK(kn_trace_load(&back, "one.trace", 78) == KN_TRACE_FOREIGN);
    CHECK(kn_trace_load(&back, "no.trace", 77) == KN_TRACE_MISSING);
    for (long at = 0; at < 600; at += 40) { // no byte of it may change, and no size is believed
        CHECK(kn_trace_save(&t, "bad.trace", 77));
        FILE *f = fopen("bad.trace", "r+");
        fseek(f, at, SEEK_SET);
        fputc(0xa5, f);
        fclose(f);
        kn_trace_found found = kn_trace_load(&back, "bad.trace", 77);
        kn_trace_free(&back);
        bool number = at >= 24 && at < 24 + (long)sizeof t; // of the head: a wrong cost cannot be seen
        CHECK(number || found == KN_TRACE_DAMAGED || found == KN_TRACE_FOREIGN);
    }
    CHECK(truncate("one.trace", 300) == 0 && kn_trace_load(&back, "one.trace", 77) == KN_TRACE_DAMAGED);
}

// ---- the rules

static kn_row point(const kn_run *run, double us, double solver, double all)
{
    return (kn_row){.run = run, .median_us = us, .p90_us = 1.2 * us, .force = {.solver = solver, .all = all},
                    .shape = {.solver = solver, .all = all}};
}

TEST("the budget is the p90's, and what chatters or latches is never picked")
{
    static kn_front front;
    kn_run run = {.spacing_m = 0.01};
    front.count = 4;
    front.row[0] = point(&run, 100, 0.03, 0.03);
    front.row[1] = point(&run, 200, 0.01, 0.01);
    front.row[2] = point(&run, 50, 0.001, 0.001);
    front.row[3] = point(&run, 50, 0.001, 0.001);
    front.row[2].chatters = front.row[3].latched = true;
    CHECK(kn_front_pick(&front, 240) == &front.row[1]);
    CHECK(kn_front_pick(&front, 239) == &front.row[0]);
    CHECK(!kn_front_pick(&front, 60));
}

TEST("the named points are the cheapest that are accurate enough, on the scene's own lattice, step and precision")
{
    static kn_front front;
    kn_scene scene = {.model = kn_model_def_default(), .budget_s = 8e-4};
    kn_plan *plan = calloc(1, sizeof *plan);
    plan->scene = &scene;
    kn_run run[5];
    for (int i = 0; i < 5; i++)
        run[i] = (kn_run){.spacing_m = scene.model.spacing_m, .dt_s = scene.model.solver.dt_s, .passes = 1,
                          .precision = scene.model.solver.precision, .iterations = 4 * i, .iterations_max = 12 * i};
    run[0].spacing_m *= 2;
    front.count = 5;
    front.row[0] = point(&run[0], 10, 0.0001, 0.2);
    front.row[1] = point(&run[1], 60, 0.02, 0.02);
    front.row[2] = point(&run[2], 90, 0.004, 0.004);
    front.row[3] = point(&run[3], 80, 0.02, 0.02);
    front.row[4] = point(&run[4], 300, 0.0005, 0.0005);
    const kn_row *named[KN_QUALITY_OWN];
    kn_front_name(&front, plan, named);
    CHECK(named[KN_QUALITY_FAST] == &front.row[1]);
    CHECK(named[KN_QUALITY_BALANCED] == &front.row[2]);
    CHECK(named[KN_QUALITY_ACCURATE] == &front.row[4]);
    scene.budget_s = 2e-4; // none is that accurate: the nearest, and the others less work than that
    kn_front_name(&front, plan, named);
    CHECK(named[KN_QUALITY_ACCURATE] == &front.row[2]);
    CHECK(named[KN_QUALITY_BALANCED] == &front.row[2] && named[KN_QUALITY_FAST] == &front.row[1]);
    front.row[2].force.solver = 0.5; // more work, and worse: nothing for a name
    kn_front_name(&front, plan, named);
    CHECK(named[KN_QUALITY_BALANCED] == &front.row[1] && named[KN_QUALITY_ACCURATE] == &front.row[1]);
    scene.budget_s = 1e-5;
    kn_front_name(&front, plan, named);
    CHECK(!named[KN_QUALITY_FAST] && !named[KN_QUALITY_ACCURATE]);
    free(plan);
}

TESTS_MAIN
