// gate in release: arithmetic, ten times slower with the sanitizers
#include "clients/cli/commands.h"
#include "clients/sweep/pareto_front.h"
#include "server/log.h"
#include "server/wire.h"
#include "tests/check.h"
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#define SCENE KN_SOURCE_DIR "/core/scenes/dough-small.yaml"

// Record only the poses of a hand: half a second above the block (for the gain), then depth_m into it, and out again.
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

// Run the command on a block of 3 x 3 x 4 nodes. The arguments end with NULL. The output goes into the file `said`.
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

TEST("twelve iterations have less than half the solver error of one, and the step error is listed beside it")
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

TEST("half the time step has less step error and a reference of its own")
{
    CHECK(RUN(SMALL, "--iterations", "12", "--dt", "1 ms,0.5 ms", "--csv", "dt.csv") == KN_EXIT_OK);
    double whole = cell("dt.csv", "force_step", 0), half = cell("dt.csv", "force_step", 2);
    CHECK(cell("dt.csv", "dt_s", 0) == 1e-3 && cell("dt.csv", "dt_s", 2) == 5e-4);
    CHECK(half > 0 && half < whole);
    CHECK(cell("dt.csv", "force_solver", 2) < cell("dt.csv", "force_solver", 0));
}

TEST("the finest lattice has no lattice error, and a coarser one has more than 1 %")
{
    CHECK(RUN(SMALL, "--iterations", "8", "--spacing", "10 mm,5 mm", "--csv", "h.csv") == KN_EXIT_OK);
    CHECK(cell("h.csv", "nodes", 0) == 36 && cell("h.csv", "force_lattice", 0) > 0.01 &&
          cell("h.csv", "shape_lattice", 0) > 0.01);
    CHECK(cell("h.csv", "nodes", 2) == 175 && cell("h.csv", "force_lattice", 2) == 0);
}

TEST("if rk4 cannot run, the reason is printed and the other solvers run")
{
    CHECK(RUN(SMALL, "--iterations", "8", "--solver", "rk4,blend") == KN_EXIT_OK);
    CHECK(said("rk4 cannot run here: ") && said("blend   f32  8 "));
}

TEST("kept runs are not repeated, and a kept folder of another scene or log is refused")
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
    CHECK(RUN(SMALL, "--resume", "/") == KN_EXIT_USAGE && said("/: is not a folder of knead tradeoff --resume"));
}

TEST("an unreachable budget gives exit code 1, and a budget that every point meets selects the most accurate")
{
    record("tradeoff.lcmlog", 0.003);
    CHECK(RUN(SMALL, "--iterations", "8", "--budget-us", "0.001") == KN_EXIT_FAILED &&
          said("--budget-us 0.001: no usable point"));
    CHECK(RUN(SMALL, "--iterations", "1,12", "--budget-us", "1e6") == KN_EXIT_OK && said("1e+06 us"));
    CHECK(!said("iterations=1'"));
}

TEST("a log without contact is refused")
{
    record("tradeoff.lcmlog", -0.001);
    CHECK(RUN(SMALL, "--iterations", "8") == KN_EXIT_USAGE && said("its tools never touch the object"));
}

static void copy_part(const char *from, const char *to, long size)
{
    static char bytes[1 << 20];
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    size_t n = fread(bytes, 1, size ? (size_t)size : sizeof bytes, in);
    fwrite(bytes, 1, n, out);
    fclose(in), fclose(out);
}

// Append a scene to the log: the scene that the log claims to belong to.
static void record_with(const char *path, const char *name, const char *text)
{
    lcm_eventlog_t *log = lcm_eventlog_create(path, "a");
    knead_scene_t m = {.version = (char *)"0.1.0", .name = (char *)name, .text = (char *)text, .text_hash = 1};
    uint8_t bytes[8192];
    int size = knead_scene_t_encode(bytes, 0, sizeof bytes, &m);
    CHECK(size > 0 && kn_log_write(log, 1700000002000000, "KNEAD_SCENE", bytes, (size_t)size));
    lcm_eventlog_destroy(log);
}

TEST("a log that is cut or of another scene is refused in one line before any run")
{
    record("tradeoff.lcmlog", 0.003);
    copy_part("tradeoff.lcmlog", "whole", 0);
    copy_part("whole", "tradeoff.lcmlog", 90001);
    CHECK(RUN(SMALL, "--iterations", "8") == KN_EXIT_USAGE && said("tradeoff.lcmlog: cut within a record at byte"));
    CHECK(said("complete records, expected a whole log of one run") && !said("runs "));

    OWN(kn_scene) *jelly = load_scene("jelly.yaml", NULL, 0);
    record("tradeoff.lcmlog", 0.003);
    record_with("tradeoff.lcmlog", "jelly.yaml", jelly->text);
    CHECK(RUN(SMALL, "--iterations", "8") == KN_EXIT_USAGE && !said("runs "));
    CHECK(said("tradeoff.lcmlog: was recorded with another scene, 'jelly.yaml', expected one of dough-small.yaml"));

    // The same scene with another solver, a quality point and mesh measures for screens. Only the hand matters.
    const char *const sets[] = {"solver.iterations=9", "quality.fast.iterations=3", "mesh.measures=both"};
    OWN(kn_scene) *dough = load_scene("dough-small.yaml", sets, 3);
    record("tradeoff.lcmlog", 0.003);
    record_with("tradeoff.lcmlog", "dough-small.yaml", dough->text);
    CHECK(RUN(SMALL, "--quick", "--iterations", "8") == KN_EXIT_OK);
}

TEST("an output that cannot be written is refused before any run, and existing files keep their contents")
{
    record("tradeoff.lcmlog", 0.003);
    CHECK(RUN(SMALL, "--csv", "/nosuch/t.csv") == KN_EXIT_DEVICE && said("/nosuch/t.csv: No such file") &&
          !said("runs"));
    CHECK(RUN(SMALL, "--plot", "/nosuch/t.png") == KN_EXIT_DEVICE && said("/nosuch/t.png: ") && !said("runs"));
    CHECK(RUN(SMALL, "--csv", "tradeoff.lcmlog") == KN_EXIT_USAGE && said("tradeoff.lcmlog: is being read"));
    CHECK(system("rm -f new.csv && echo mine >old.csv && cp tradeoff.lcmlog whole && head -c 90001 whole "
                 ">tradeoff.lcmlog") == 0);
    CHECK(RUN(SMALL, "--csv", "new.csv") == KN_EXIT_USAGE && access("new.csv", F_OK) != 0);
    CHECK(RUN(SMALL, "--csv", "old.csv") == KN_EXIT_USAGE && system("grep -qx mine old.csv") == 0);
    CHECK(RUN("--write") == KN_EXIT_USAGE && said("cut within a record"));
    record("tradeoff.lcmlog", 0.003);
}

TEST("a sweep removes the temporary folders of killed sweeps, and keeps folders in use and folders of --resume")
{
    CHECK(system("rm -rf tmp && mkdir -p tmp/knead-sweep-killed tmp/knead-sweep-atwork tmp/knead-sweep-kept") == 0);
    static const char *const sweep = "knead sweep 1\nprogram 1\nscene 2\nlog 3\n";
    char text[200];
    static const char *const folders[] = {"killed", "atwork", "kept"};
    for (int i = 0; i < 3; i++) {
        snprintf(text, sizeof text, "tmp/knead-sweep-%s/sweep", folders[i]);
        FILE *f = fopen(text, "w");
        fprintf(f, "%s%s", sweep, i < 2 ? "temporary\n" : "");
        fclose(f);
    }
    CHECK(system("touch tmp/knead-sweep-killed/0.trace") == 0);
    int busy = open("tmp/knead-sweep-atwork/sweep", O_RDONLY | O_CLOEXEC);
    CHECK(flock(busy, LOCK_EX) == 0);
    setenv("TMPDIR", "tmp", 1);
    CHECK(RUN(SMALL, "--quick", "--iterations", "8") == KN_EXIT_OK);
    unsetenv("TMPDIR");
    close(busy);
    CHECK(access("tmp/knead-sweep-killed", F_OK) != 0);
    CHECK(access("tmp/knead-sweep-atwork/sweep", F_OK) == 0 && access("tmp/knead-sweep-kept/sweep", F_OK) == 0);
    CHECK(system("[ $(ls tmp | wc -l) = 2 ]") == 0);
}

TEST("each bad option is refused")
{
    static const char *const bad[][3] = {{"--iterations", "0", "expected at most 32 whole numbers"},
                                         {"--iterations", "4,", "expected at most 32 whole numbers"},
                                         {"--solver", "euler", "expected any of blend"},
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

TEST("a trace is read back as written, and damaged, foreign and missing files are told apart")
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
    CHECK(kn_replay_trace_save(&t, "one.trace", 77));
    CHECK(kn_replay_trace_load(&back, "one.trace", 77) == KN_REPLAY_TRACE_FOUND && back.ticks == 3 && back.p90_us == 6);
    CHECK(!memcmp(back.force_n, force, sizeof force) && !memcmp(back.shape_m, shape, sizeof shape));
    CHECK(!memcmp(back.us, us, sizeof us));
    kn_replay_trace_free(&back);
    CHECK(kn_replay_trace_load(&back, "one.trace", 78) == KN_REPLAY_TRACE_FOREIGN);
    CHECK(kn_replay_trace_load(&back, "no.trace", 77) == KN_REPLAY_TRACE_MISSING);
    for (long at = 0; at < 600; at += 40) { // any changed byte is noticed, and no size is trusted
        CHECK(kn_replay_trace_save(&t, "bad.trace", 77));
        FILE *f = fopen("bad.trace", "r+");
        fseek(f, at, SEEK_SET);
        fputc(0xa5, f);
        fclose(f);
        kn_replay_trace_found found = kn_replay_trace_load(&back, "bad.trace", 77);
        kn_replay_trace_free(&back);
        bool number = at >= 24 && at < 24 + (long)sizeof t; // numbers in the header: a wrong cost cannot be noticed
        CHECK(number || found == KN_REPLAY_TRACE_DAMAGED || found == KN_REPLAY_TRACE_FOREIGN);
    }
    CHECK(truncate("one.trace", 300) == 0 && kn_replay_trace_load(&back, "one.trace", 77) == KN_REPLAY_TRACE_DAMAGED);
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

static kn_pareto_row point(const kn_sweep_run *run, double us, double solver, double all)
{
    return (kn_pareto_row){.run = run,
                           .median_us = us,
                           .p90_us = 1.2 * us,
                           .force = {.solver = solver, .all = all},
                           .shape = {.solver = solver, .all = all}};
}

TEST("the budget limits the p90 time, and points that chatter or latch are never picked")
{
    static kn_pareto_front front;
    kn_sweep_run run = {.spacing_m = 0.01};
    front.count = 4;
    front.row[0] = point(&run, 100, 0.03, 0.03);
    front.row[1] = point(&run, 200, 0.01, 0.01);
    front.row[2] = point(&run, 50, 0.001, 0.001);
    front.row[3] = point(&run, 50, 0.001, 0.001);
    front.row[2].chatters = front.row[3].latched = true;
    CHECK(kn_pareto_front_pick(&front, 240) == &front.row[1]);
    CHECK(kn_pareto_front_pick(&front, 239) == &front.row[0]);
    CHECK(!kn_pareto_front_pick(&front, 60));
}

// Points of the scene's own lattice, step and precision. Each has a number of iterations per step and a maximum.
typedef struct naming {
    kn_scene scene;
    kn_sweep_plan *plan;
    kn_sweep_run run[8];
    kn_pareto_front front;
    const kn_pareto_row *named[KN_QUALITY_OWN];
} naming;

static void begin(naming *n)
{
    memset(n, 0, sizeof *n);
    n->scene.model = kn_model_def_default();
    n->scene.budget_s = 8e-4;
    n->plan = calloc(1, sizeof *n->plan);
    n->plan->scene = &n->scene;
}

static kn_pareto_row *add(naming *n, int iterations, int most, double us, double solver)
{
    kn_sweep_run *run = &n->run[n->front.count];
    kn_pareto_row *row = &n->front.row[n->front.count++];
    *run = (kn_sweep_run){.spacing_m = n->scene.model.spacing_m,
                          .dt_s = n->scene.model.solver.dt_s,
                          .passes = 1,
                          .precision = n->scene.model.solver.precision,
                          .iterations = iterations,
                          .iterations_max = most};
    *row = point(run, us, solver, solver);
    row->jump_n = row->same_jump_n = 1;
    return row;
}

static void name(naming *n) { kn_pareto_front_name(&n->front, n->plan, n->named); }

TEST("the named points are the cheapest with enough accuracy, at the scene's own spacing, time step and precision")
{
    static naming n;
    begin(&n);
    add(&n, 2, 2, 10, 0.0001);
    n.run[0].spacing_m *= 2;
    const kn_pareto_row *one = add(&n, 4, 12, 60, 0.02), *two = add(&n, 8, 24, 90, 0.004);
    add(&n, 12, 36, 80, 0.02);
    const kn_pareto_row *four = add(&n, 16, 48, 300, 0.0005);
    name(&n);
    CHECK(n.named[0] == one && n.named[1] == two && n.named[2] == four);
    CHECK(kn_pareto_front_excess(four, KN_QUALITY_ACCURATE) <= 1);
    n.scene.budget_s = 2e-4; // no point is accurate enough: take the nearest, and for the other names less work
    name(&n);
    CHECK(n.named[0] == one && n.named[1] == two && n.named[2] == two);
    CHECK(kn_pareto_front_excess(two, KN_QUALITY_ACCURATE) == 4);
    n.front.row[2].force.solver = 0.5; // more work and less accurate: no use for a name
    name(&n);
    CHECK(n.named[1] == one && n.named[2] == one);
    n.scene.budget_s = 1e-5;
    name(&n);
    CHECK(!n.named[0] && !n.named[2]);
    free(n.plan);
}

TEST("timing noise of up to 24 % does not change the named points")
{
    static naming n;
    begin(&n);
    const kn_pareto_row *two = add(&n, 2, 2, 20, 0.02), *four = add(&n, 4, 4, 30, 0.004),
                        *many = add(&n, 8, 8, 50, 0.0005);
    add(&n, 2, 24, 20, 0.02);
    add(&n, 4, 24, 30, 0.004);
    unsigned seed = 1;
    for (int round = 0; round < 200; round++) {
        for (int i = 0; i < n.front.count; i++) {
            seed = 1664525 * seed + 1013904223;
            double us = (n.run[i].iterations == 2 ? 20 : n.run[i].iterations == 4 ? 30 : 50);
            n.front.row[i].p90_us = us * (1 + 0.24 * (seed >> 8) / (1 << 24)); // up to KN_PARETO_NOISE
        }
        name(&n);
        CHECK(n.named[0] == two && n.named[1] == four && n.named[2] == many);
    }
    free(n.plan);
}

TEST("each named point needs at least as many iterations, usual and maximum, as the point below it")
{
    static naming n;
    begin(&n);
    const kn_pareto_row *loose = add(&n, 2, 24, 20, 0.02);
    add(&n, 4, 4, 30, 0.003); // more accurate than loose, but its maximum of iterations is lower
    const kn_pareto_row *tight = add(&n, 4, 24, 90, 0.002);
    name(&n);
    CHECK(n.named[0] == loose && n.named[1] == tight && n.named[2] == tight);
    free(n.plan);
}

TEST("the accurate point meets its error bound even if a cheaper point fits the lower names better")
{
    static naming n;
    begin(&n);
    const kn_pareto_row *one = add(&n, 4, 4, 30, 0.004), *two = add(&n, 4, 48, 90, 0.0009);
    add(&n, 16, 16, 50, 0.002); // more work than one, and more accurate; but two is not more work than this point
    name(&n);
    CHECK(n.named[0] == one && n.named[2] == two && kn_pareto_front_excess(n.named[1], KN_QUALITY_BALANCED) <= 1);
    free(n.plan);
}

TEST("a point is not named if its force jumps by more than 1.5 times the converged jump")
{
    static naming n;
    begin(&n);
    kn_pareto_row *rough = add(&n, 2, 2, 20, 0.01);
    const kn_pareto_row *smooth = add(&n, 3, 3, 40, 0.009);
    rough->jump_n = 1.6;
    name(&n);
    CHECK(n.named[0] == smooth);
    rough->jump_n = 1.4;
    name(&n);
    CHECK(n.named[0] == rough);
    free(n.plan);
}

TEST("the chart is drawn when a point chatters")
{
    if (system("command -v gnuplot >/dev/null") != 0) {
        puts("no gnuplot here: no picture");
        return;
    }
    static naming n;
    begin(&n);
    strcpy(n.scene.name, "picture");
    add(&n, 2, 2, 20, 0.02);
    add(&n, 4, 4, 30, 0.004)->chatters = true;
    name(&n);
    CHECK(kn_pareto_chart_draw(&n.front, n.plan, n.named, "chatters.png") == KN_EXIT_OK);
    free(n.plan);
}

TEST("a better point of another lattice is reported if it meets the budget and the accuracy")
{
    static naming n;
    begin(&n);
    add(&n, 4, 4, 30, 0.004);
    kn_pareto_row *fine = add(&n, 4, 4, 200, 0.002);
    n.run[1].spacing_m /= 2;
    name(&n);
    CHECK(n.named[0] == &n.front.row[0] && kn_pareto_front_elsewhere(&n.front, n.plan, n.named) == fine);
    fine->p90_us = 900; // over the budget
    CHECK(!kn_pareto_front_elsewhere(&n.front, n.plan, n.named));
    fine->p90_us = 200, fine->force.all = 0.005;
    CHECK(!kn_pareto_front_elsewhere(&n.front, n.plan, n.named));
    free(n.plan);
}

TESTS_MAIN
