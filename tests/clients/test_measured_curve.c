// Measured curves: converted to SI, sorted by time, thinned, with messages about each correction.
#include "clients/identify/measured_curve.h"
#include "clients/cli/commands.h"
#include "tests/check.h"
#include "tests/clients/heard.h"
#include "tests/dice.h"
#include <stdarg.h>
#include <stdint.h>

#define SIZE "# area: 1 cm^2\n# height: 1 cm\n"
#define NOTES "# load: 50 gf\n# release: 20 s\n" SIZE
#define PRESSED NOTES "time_s,displacement_mm\n" // the readings begin in line 6
#define LOADED SIZE "time_s;displacement_mm;load_gf\n"
#define HELD "# strain: 10 %\ntime_s,stress_kPa\n" // the readings begin in line 3

static kn_curve curve[KN_CURVES_MAX];
static int curves;
static kn_curve_options none = {.subcommand = "identify creep"}, options;

static char *text; // contents of the file being written
static size_t length;
static FILE *out;

static void begin(const char *head)
{
    free(text);
    out = open_memstream(&text, &length);
    fputs(head, out);
    options = none;
}

__attribute__((format(printf, 1, 2))) static void row(const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vfprintf(out, format, args);
    va_end(args);
}

static int load(kn_curve_kind kind)
{
    while (curves > 0) kn_curve_free(&curve[--curves]);
    fclose(out);
    kn_write("a.csv", text, length);
    kn_hear();
    int code = kn_curve_load(curve, &curves, kind, "a.csv", &options);
    kn_hear_end();
    return code;
}

static bool loads(kn_curve_kind kind) { return load(kind) == KN_EXIT_OK; }

// Check that the file is refused in one line with these words. line: the line of the file.
static void refused(kn_curve_kind kind, int line, const char *words)
{
    char place[20];
    snprintf(place, sizeof place, "a.csv:%d:", line);
    if (load(kind) != KN_EXIT_USAGE || curves > 0 || *kn_out || !kn_refused(words) || !kn_said(place))
        KN_TEST_FAIL("%s%s, expected: %s %s", kn_out, kn_err, place, words);
}

// Return a simple creep curve: 1 - exp(-t/10) mm under the load. After 20 s the value decays by exp(-(t-20)/10).
static double crept_mm(double t)
{
    if (t < 0) return 0;
    return t <= 20 ? 1 - exp(-t / 10) : (1 - exp(-2.0)) * exp(-(t - 20) / 10);
}

static void crept(int count, double every_s)
{
    for (int i = 0; i < count; i++) row("%.9g,%.9g\n", every_s * i, crept_mm(every_s * i));
}

// Return the i-th of rows in order after one of them was moved.
static int moved(int i, int from, int to)
{
    if (i == to) return from;
    return i + (from <= i && i < to) - (to < i && i <= from);
}

static uint64_t seed = 1;

// --- creep

TEST("displacement divided by height becomes strain, and load divided by area becomes stress")
{
    begin(PRESSED);
    crept(81, 0.5);
    CHECK(loads(KN_CURVE_CREEP) && curves == 1);
    CHECK(curve->count == 81 && curve->steps == 2 && !curve->constant_area);
    CHECK_NEAR(curve->step[0].stress_pa, 4903.325, 1e-9);
    CHECK(curve->step[1].time_s == 20 && curve->step[1].stress_pa == 0 && curve->step[1].early_s == 20);
    CHECK_NEAR(curve->value[40], 0.1 * (1 - exp(-2.0)), 1e-9);
    CHECK(curve->line[40] == 46 && curve->weight[40] == 1 && curve->height_m == 0.01 && curve->area_m2 == 1e-4);
    CHECK_STR(curve->name, "a");
    CHECK(kn_said("81 readings of displacement, 4.903 kPa of nominal stress, taken off at 20 s"));
}

TEST("with a recorded load, time and height count from the load, and the release is found")
{
    begin("# area: 1 cm^2\ntime_s;height_mm;load_gf\n");
    for (int i = 0; i <= 100; i++) {
        const double t = 0.5 * i - 4.75; // the load comes between two readings
        row("%g;%.12g;%g\n", t + 4.75, 12 - crept_mm(t), t > 0 && t <= 20 ? 50.0 : 0);
    }
    CHECK(loads(KN_CURVE_CREEP) && curve->steps == 2 && curve->count == 91);
    CHECK(kn_said("initial height 12 mm, from the readings before the load"));
    CHECK(kn_said("10 readings before the load, left out"));
    CHECK_NEAR(curve->step[1].time_s, 20, 0.05);
    CHECK(curve->step[1].early_s > 19.5 && curve->step[1].late_s < 20.5);
    CHECK_NEAR(curve->time_s[0], 0.25, 0.05);
    CHECK_NEAR(curve->value[0], crept_mm(0.25) / 12, 1e-9);
    CHECK_NEAR(curve->height_m, 0.012, 1e-12);
}

TEST("if noise hides when the load was taken off, the release time is midway between two readings")
{
    begin(LOADED);
    for (int i = 0; i <= 80; i++)
        row("%g;%.9g;%g\n", 0.5 * i, crept_mm(0.5 * i) + 0.05 * kn_dice_normal(&seed), i <= 40 ? 50.0 : 0);
    CHECK(loads(KN_CURVE_CREEP) && curve->step[0].time_s == 0 && curve->step[1].time_s == 20.25);
}

TEST("a noisy load becomes one step, and readings while the load changes are left out")
{
    begin(LOADED);
    for (int i = 0; i <= 80; i++) {
        const double way = i == 9 || i == 10 ? 20.0 * (i - 8)
                           : i > 10          ? 50 + 0.5 * kn_dice_normal(&seed)
                                             : 0.3 * kn_dice_normal(&seed);
        row("%g;%.9g;%g\n", 0.5 * i, crept_mm(0.5 * i - 5), way);
    }
    CHECK(loads(KN_CURVE_CREEP) && curve->steps == 1);
    CHECK(kn_said("2 readings while the load changed, left out") && kn_said("never taken off"));
    CHECK_NEAR(curve->step[0].stress_pa, 4903, 20);
}

TEST("loads that rise in stairs make one curve with one step per load")
{
    begin(LOADED);
    for (int i = 0; i < 90; i++) row("%d;%.9g;%d\n", i, 0.01 * i, i < 30 ? 10 : i < 60 ? 20 : 30);
    CHECK(loads(KN_CURVE_CREEP) && curve->steps == 3 && kn_said("in steps"));
    CHECK_NEAR(curve->step[2].stress_pa, 30 * 98.0665, 1e-6);
    CHECK_NEAR(curve->step[2].time_s, 59.5, 0.5);
}

TEST("each column with a load in its name is a curve of its own, and the lengths may differ")
{
    begin(SIZE "time_s\tdisplacement_mm 10 gf\tx (0.1 N) [mm]\t50 gf [mm]\n");
    for (int i = 0; i < 20; i++) row(i < 12 ? "%d\t%g\t%g\t%g\n" : "%d\t%g\t%g\t\n", i, 0.01 * i, 0.02 * i, 0.1 * i);
    CHECK(loads(KN_CURVE_CREEP) && curves == 3);
    CHECK(curve[0].count == 20 && curve[1].count == 20 && curve[2].count == 12);
    CHECK_STR(curve[2].name, "a 50 gf");
    CHECK_NEAR(curve[0].step[0].stress_pa, 980.665, 1e-9);
    CHECK_NEAR(curve[1].step[0].stress_pa, 1000, 1e-9);
    CHECK_NEAR(curve[2].value[11], 0.11, 1e-12);
}

TEST("a restart of the time with another load begins a new curve, which may have eight readings only")
{
    for (int count = 8; count <= 20; count += 12) {
        begin("# area: 1 cm^2\nload_gf,time_s,height_mm\n");
        for (int k = 1; k <= 5; k++)
            for (int i = 0; i < count; i++) row("%d,%d,%g\n", 10 * k, i, 10 + k - 0.01 * k * i);
        CHECK(loads(KN_CURVE_CREEP) && curves == 5 && curve[4].count == count);
        CHECK_STR(curve[2].name, "a 30 gf");
        for (int k = 1; k <= 5; k++) CHECK_NEAR(curve[k - 1].height_m, 0.01 + 1e-3 * k, 1e-12); // each has its own
        CHECK(curve[1].line[0] == 3 + count && curve[1].step[0].time_s == 0);
    }
}

// A first table of `count` readings, of which one was moved, and a second table every `step` s.
static void check_second_table(int count, int from, int to, int step)
{
    begin(PRESSED); // the same load
    for (int i = 0; i < count; i++) row("%d,%g\n", moved(i, from, to), 0.01 * i);
    for (int i = 0; i < count; i++) row("%d,%g\n", i * step, 0.01 * i);
    refused(KN_CURVE_CREEP, 6 + count, "time restarts, as in a second table");
}

TEST("a second table under the same load is refused at its first line, even behind a misplaced row")
{
    check_second_table(20, 0, 0, 1);
    check_second_table(40, 3, 20, 9);
    check_second_table(40, 2, 1, 1);
    check_second_table(40, 27, 20, 1);
    check_second_table(12, 3, 9, 1);
    begin(HELD);
    for (int i = 0; i < 40; i++) row("%d,%g\n", i % 20, exp(-(i % 20) / 20.0));
    refused(KN_CURVE_RELAX, 23, "time restarts");
}

TEST("a misplaced row is sorted into its place and counted as one moved row")
{
    for (int to = 30; to <= 80; to += 50) { // moved to the middle, to the end
        begin(PRESSED);
        for (int i = 0; i <= 80; i++) row("%g,%.9g\n", 0.5 * moved(i, 9, to), crept_mm(0.5 * moved(i, 9, to)));
        CHECK(loads(KN_CURVE_CREEP) && curves == 1 && curve->count == 81);
        CHECK(kn_said("not in the order of time: 1 moved") && curve->time_s[9] == 4.5);
    }
}

TEST("an interval with larger steps is recognised as a second one, wherever its times meet those of the first")
{
    for (int k = 2; k <= 30; k++) {
        check_second_table(40, 0, 0, k);
        begin(SIZE "time_s,displacement_mm,load_gf\n"); // the recovery of that load
        for (int i = 1; i <= 60; i++) row("%d,%.9g,50\n", i, crept_mm(i));
        for (int i = 1; i <= 60; i++) row("%d,%.9g,0\n", k * i, crept_mm(60 + k * i));
        CHECK(loads(KN_CURVE_CREEP) && curves == 1 && curve->count == 120 && curve->steps == 2);
        CHECK(kn_said("without load: read as the recovery, which begins at 60 s") && curve->time_s[119] == 60 + 60 * k);
    }
}

TEST("a misplaced reading among readings evenly spaced in log time is sorted into its place")
{
    for (int each = 4; each <= 20; each++)
        for (int from = 0; from < each; from++) {
            begin(HELD);
            for (int i = 0; i <= 3 * each; i++) {
                const double t = pow(10, (double)moved(i, from, 3 * each - 3) / each);
                row("%.9g,%.9g\n", t, pow(t, -0.1));
            }
            CHECK(loads(KN_CURVE_RELAX) && curve->count == 3 * each + 1);
        }
}

TEST("rows in any order are sorted by time")
{
    for (int k = 0; k < 2; k++) {
        begin(PRESSED);
        for (int i = 0; i < 397; i++) {
            const double t = 0.1 * (k ? 396 - i : i * 151 % 397);
            row("%g,%.9g\n", t, crept_mm(t));
        }
        CHECK(loads(KN_CURVE_CREEP) && curves == 1 && curve->count == 397);
    }
}

TEST("a time that jumps to 1,000 in a file with decimal commas is refused, with a hint at thousands separators")
{
    begin(NOTES "time [s];displacement [um]\n");
    for (int i = 0; i < 20; i++) row("%d;%d,5\n", 980 + i, 100 + i);
    for (int i = 0; i < 20; i++) row("1,%03d;%d,5\n", i, 120 + i);
    refused(KN_CURVE_CREEP, 26, "without thousands separators");
}

TEST("an interval without load whose time restarts is read as the recovery of the interval before it")
{
    begin("Project:;Dough\nInterval and data points:;2;20;20\n"); // in the format of RheoCompass
    for (int k = 0; k < 2; k++) {
        row("Interval data:;Point No.;Time;Shear Strain;Shear Stress;Status\n;[];[s];[%%];[Pa];[]\n");
        for (int i = 1; i <= 20; i++)
            row(";%d;%d;%.9g;%s;Dy_auto\n", i, i, 100 * crept_mm(k ? 20 + i : i), k ? "0,01" : "100,00");
        if (k == 0) row("\nInterval and data points:;2\n");
    }
    for (char *p = (fflush(out), text); *p; p++) // decimal commas, as in that format
        if (*p == '.' && p[1] >= '0' && p[1] <= '9') *p = ',';
    CHECK(loads(KN_CURVE_CREEP) && curves == 1 && curve->steps == 2 && curve->constant_area);
    CHECK(kn_said("time restarts in line 29 without load: read as the recovery, which begins at 20 s"));
    CHECK(curve->count == 40 && curve->time_s[39] == 40 && curve->step[0].stress_pa == 100);
    CHECK_NEAR(curve->step[1].time_s, 20.5, 0.5);
}

TEST("a rheometer file yields the time, shear strain and shear stress, and the strain may exceed 1")
{
    begin("Action Name;Time (sequence)(s);Time (action)(s);Shear stress(Pa);Shear rate(s-\xc2\xb9);Shear strain(%);"
          "Normal force(N);Frequency(Hz);Gap(mm)\n"); // in the format of rSpace
    for (int i = 0; i <= 20; i++) row("Creep;%d,5;%d;30,54;47,57;%d,7E+001;0,2;;9,15\n", 112 + i, i % 5, 10 * i);
    CHECK(loads(KN_CURVE_CREEP) && curve->count == 21 && curve->constant_area);
    CHECK_NEAR(curve->value[20], 20.07, 0.01);
    CHECK_NEAR(curve->step[0].stress_pa, 30.54, 1e-9);
    CHECK(curve->time_s[20] == 20 && kn_said("time does not begin near 0"));
}

TEST("a stress column without values is ignored, and the stress of the note is used")
{
    begin("# stress: 10 Pa\nt\tstrain\tstress\tT\ns\t-\tPa\tC\n"); // in the format of RepTate's files
    for (int i = 0; i <= 20; i++) row("%d\t%g\n", i, 1e-4 * i);
    CHECK(loads(KN_CURVE_CREEP) && curve->count == 21 && curve->step[0].stress_pa == 10);
}

TEST("a stress that falls as the section grows means constant load; an unchanging stress means constant stress")
{
    for (int same = 0; same < 2; same++) {
        begin("time_s,strain,stress_pa\n");
        for (int i = 0; i <= 40; i++) row("%d,%.9g,%.9g\n", i, 0.01 * i, same ? 5000 : 5000 * (1 - 0.01 * i));
        CHECK(loads(KN_CURVE_CREEP) && curve->constant_area == same);
        CHECK_NEAR(curve->step[0].stress_pa, 5000, same ? 0 : 1e-3);
    }
}

TEST("a column x without a unit is used as the strain only if no strain or displacement column has a unit, and a "
     "strain rate is never used")
{
    static const char fraction[] = "' has no unit and is read as a fraction of the height";
    static const struct {
        const char *columns, *before, *after; // the cells before and after the strain, in each row
        double factor;
        const char *words; // NULL: nothing is said about a unit
    } creeps[] = {{"x,displacement_mm", "dry,", "", 1, "is used, not 'x', which has no unit"},
                  {"compression,displacement_mm", "7,", "", 1, "is used, not 'compression', which has no unit"},
                  {"deformation,displacement_mm", "7,", "", 1, "is used, not 'deformation', which has no unit"},
                  {"x,strain [%]", "7,", "", 10, NULL},
                  {"x", "", "", 0.1, fraction},
                  {"gamma,strain rate", "", ",7", 0.1, fraction},
                  {"x [%],x", "", ",7", 10, NULL},
                  {"x,x [%]", "7,", "", 10, NULL}};
    static const struct {
        const char *head, *cells;
        double strain;
        const char *words;
    } holds[] = {{SIZE "time [s],load [gf],x,displacement [mm]\n", "7,1", 0.1, NULL},
                 {"# area: 1 cm^2\ntime [s],load [gf],x\n", "0.1", 0.1, fraction},
                 {"time [s],G(t) [Pa],gamma,gap [mm]\n", "0.01,1", 0.01, fraction}}; // the gap of a rheometer
    for (size_t k = 0; k < sizeof creeps / sizeof *creeps; k++) {
        begin(NOTES "time_s,");
        row("%s\n", creeps[k].columns);
        for (int i = 0; i <= 40; i++)
            row("%d,%s%.9g%s\n", i, creeps[k].before, creeps[k].factor * crept_mm(i), creeps[k].after);
        CHECK(loads(KN_CURVE_CREEP) && (creeps[k].words ? kn_said(creeps[k].words) : !kn_said("has no unit")));
        CHECK_NEAR(curve->value[10], crept_mm(10) / 10, 1e-9);
    }
    for (size_t k = 0; k < sizeof holds / sizeof *holds; k++) {
        begin(holds[k].head);
        for (int i = 0; i <= 40; i++) row("%d,%g,%s\n", i, 50 * exp(-i / 20.0), holds[k].cells);
        CHECK(loads(KN_CURVE_RELAX) && (!holds[k].words || kn_said(holds[k].words)));
        CHECK_NEAR(curve->strain, holds[k].strain, 1e-9);
    }
}

TEST("a compliance becomes a strain under the known stress, or under 1 Pa if the stress is unknown")
{
    for (int known = 0; known < 2; known++) {
        begin(known ? "# stress: 2 kPa\n" : "");
        row("Time [min]\tCreep Compliance [1/kPa]\n");
        for (int i = 0; i < 10; i++) row("%d\t%g\n", i, 0.002 * i);
        CHECK(loads(KN_CURVE_CREEP) && curve->constant_area && curve->time_s[9] == 540);
        CHECK(curve->step[0].stress_pa == (known ? 2000 : 1) && kn_said("stress unknown") == !known);
        CHECK_NEAR(curve->value[9], known ? 0.036 : 0.018e-3, known ? 1e-15 : 1e-18);
    }
}

TEST("a negative compression changes its sign, and a message says so")
{
    begin(PRESSED);
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", i, -crept_mm(i));
    CHECK(loads(KN_CURVE_CREEP) && kn_said("its sign is changed") && curve->value[10] > 0);
}

TEST("notes in the file override the command-line options, and options replace missing notes")
{
    begin(PRESSED);
    crept(41, 1);
    options.load_n = 9;
    options.release_s = 5;
    CHECK(loads(KN_CURVE_CREEP) && curve->step[1].time_s == 20);
    CHECK_NEAR(curve->step[0].stress_pa, 4903.325, 1e-9);
    begin("time_s,displacement_mm\n");
    crept(41, 1);
    options = (kn_curve_options){
        .subcommand = "identify creep", .load_n = 1, .area_m2 = 1e-3, .height_m = 0.02, .release_s = 5};
    CHECK(loads(KN_CURVE_CREEP) && curve->step[1].time_s == 5 && curve->step[0].stress_pa == 1000);
    CHECK_NEAR(curve->value[20], crept_mm(20) / 20, 1e-9);
}

TEST("a noted release time overrides the readings if both agree; otherwise a message reports the conflict")
{
    for (int k = 0; k < 2; k++) {
        begin(k ? "# release: 20.1 s\n" LOADED : "# release: 25 s\n" LOADED);
        for (int i = 0; i <= 80; i++) row("%g;%.9g;%g\n", 0.5 * i, crept_mm(0.5 * i), i <= 40 ? 50.0 : 0);
        CHECK(loads(KN_CURVE_CREEP) && curve->steps == 2);
        if (k) CHECK(curve->step[1].time_s == 20.1 && curve->step[1].early_s == 20.1);
        else CHECK(kn_said("the noted time of 25 s is not used") && curve->step[1].time_s < 20.5);
    }
}

TEST("missing, unsorted and simultaneous readings are repaired, and messages count them")
{
    begin(PRESSED);
    for (int i = 40; i >= 0; i--) row("%d,%.9g\n", i, crept_mm(i));
    row("7,%.9g\n50,\n51,nan\n", crept_mm(7));
    CHECK(loads(KN_CURVE_CREEP) && curve->count == 41);
    CHECK(kn_said("2 readings of displacement missing, left out; the first in line 48"));
    CHECK(kn_said("not in the order of time") && kn_said("1 reading has the time of another: averaged"));
    CHECK(curve->time_s[7] == 7 && curve->weight[7] == 2 && curve->weight[8] == 1);
    CHECK_NEAR(curve->value[7], crept_mm(7) / 10, 1e-9);
}

TEST("a clock that starts far from 0 is reported, and time counts from the first reading")
{
    begin("# load: 50 gf\n" SIZE "time_s,displacement_mm\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", 100000 + i, crept_mm(i));
    CHECK(loads(KN_CURVE_CREEP) && kn_said("time does not begin near 0") && curve->time_s[40] == 40);
}

TEST("a strain that begins long after the noted load is reported, with or without readings before it")
{
    for (int k = 0; k < 6; k++) {
        const double noise = k & 1 ? 0.01 : 0;
        begin(k == 4 ? "# begin: 5 s\n" : "# load: 50 gf\n");
        row("# load: 50 gf\n# release: 25 s\n" SIZE "time_s,displacement_mm\n");
        for (int i = k / 2 == 1 ? 26 : 0; i <= 200; i++) // no readings before it
            row("%g,%.9g\n", 0.2 * i, crept_mm(0.2 * i - (k == 5 ? 0 : 5)) + noise * kn_dice_normal(&seed));
        CHECK(loads(KN_CURVE_CREEP) && curve->step[1].time_s == (k == 4 ? 20 : 25));
        CHECK(kn_said("the strain begins at") == (k < 4));
    }
}

TEST("a height measured from the first reading is not reported as a late strain")
{
    begin("# load: 50 gf\n# area: 1 cm^2\ntime_s,height_mm\n");
    for (int i = 1; i <= 80; i++) row("%g,%.9g\n", 0.5 * i, 10 - crept_mm(0.5 * i));
    CHECK(loads(KN_CURVE_CREEP) && !kn_said("the strain begins at"));
}

TEST("each missing, unusable or impossible quantity is refused in one line with its place and the remedy")
{
#define TWO "0,1\n1,2\n2,3\n3,4\n4,5\n5,6\n6,7\n7,7.5\n8,8\n"
#define THREE "1,1,1\n2,2,2\n3,3,3\n4,4,4\n5,5,5\n6,6,6\n7,7,7\n8,8,8\n9,9,9\n"
    static const struct {
        kn_curve_kind kind;
        const char *text;
        int line;
        const char *words;
    } bad[] = {
        {KN_CURVE_CREEP, "time_s,displacement_mm\n" TWO, 1, "--height"},
        {KN_CURVE_CREEP, "# height: 1 cm\ntime_s,displacement_mm\n" TWO, 2, "--load"},
        {KN_CURVE_CREEP, "# height: 1 cm\n# load: 1 N\ntime_s,displacement_mm\n" TWO, 3, "--area"},
        {KN_CURVE_CREEP, "time,displacement_mm\n" TWO, 1, "--units 'time=s'"},
        {KN_CURVE_CREEP, "time_s,displacement\n" TWO, 1, "--units 'displacement=m'"},
        {KN_CURVE_CREEP, "time_s,displacement_s\n" TWO, 1, "expected a displacement"},
        {KN_CURVE_CREEP, "time_mm,displacement_mm\n" TWO, 1, "expected a time"},
        {KN_CURVE_CREEP, "time_s,colour\n" TWO, 1, "no column of height, displacement, strain or compliance"},
        {KN_CURVE_CREEP, "instant_s,displacement_mm\n" TWO, 1, "no time"},
        {KN_CURVE_CREEP, "# height: -1 cm\ntime_s,displacement_mm\n" TWO, 1, "above 0"},
        {KN_CURVE_CREEP, "# height: 1 s\ntime_s,displacement_mm\n" TWO, 1, "not in units of m"},
        {KN_CURVE_CREEP, PRESSED "0,0\n1,1\n2,2\n3,3\n4,4\n5,12\n6,5\n7,6\n30,6\n", 11,
         ":11:3: strain of 1.2, more than the whole height"},
        {KN_CURVE_CREEP, NOTES "time_s,height_mm\n0,9\n1,8\n2,7\n3,6\n4,-4\n5,3\n6,3\n7,2\n30,2\n", 10,
         "height of -0.004 m"},
        {KN_CURVE_CREEP, NOTES "time_s,height_mm\n0,10\n1,11\n2,12\n3,13\n4,14\n5,15\n6,16\n7,17\n", 6,
         "expected compression"},
        {KN_CURVE_CREEP, PRESSED "0,0\n1,0\n2,0\n3,0\n4,0\n5,0\n6,0\n7,0\n30,0\n", 6, "is 0 in all readings"},
        {KN_CURVE_CREEP, PRESSED "0,0\n1,1\n2,2\n30,3\n", 6, "4 usable readings of displacement"},
        {KN_CURVE_CREEP,
         NOTES "time_s,displacement_mm,load_gf\n0,0,0\n1,1,0\n2,2,0\n3,3,0\n4,4,0\n5,4,0\n6,5,0\n7,6,0\n", 6,
         "the load is 0 in all readings"},
        {KN_CURVE_CREEP, PRESSED TWO, 2, "released at 20 s"},
        {KN_CURVE_RELAX, "# area: 2 cm^2\ntime_s;force_N\n1;1\n2;0.9\n3;0.8\n4;0.7\n5;0.6\n6;0.5\n7;0.4\n8;0.3\n", 2,
         "--strain"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa,loss_pa\n0,1,1\n" THREE, 2, "frequency of 0 Hz"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa,loss_pa\n0.5,1,-4\n" THREE, 2, "expected both above 0"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa,loss_pa\n0.5,0,1\n" THREE, 2, "expected both above 0"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa\n" TWO, 1, "no storage and loss modulus"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        begin(bad[i].text);
        refused(bad[i].kind, bad[i].line, bad[i].words);
    }
}

TEST("a file beyond the 32nd curve is refused, and the curves before stay")
{
    int code = KN_EXIT_OK;
    begin(PRESSED);
    crept(41, 1);
    CHECK(loads(KN_CURVE_CREEP));
    kn_hear();
    for (int i = 1; i <= KN_CURVES_MAX && code == KN_EXIT_OK; i++)
        code = kn_curve_load(curve, &curves, KN_CURVE_CREEP, "a.csv", &none);
    kn_hear_end();
    CHECK(code == KN_EXIT_USAGE && curves == KN_CURVES_MAX && kn_said("more than 32 curves"));
}

// --- thinning

TEST("100 000 readings are thinned to 400 to 600 means that lie on the curve, and no mean crosses the release")
{
    enum { MANY = 100000 };
    begin(PRESSED);
    for (int i = 0; i <= MANY; i++) row("%.9g,%.12g\n", 40.0 * i / MANY, crept_mm(40.0 * i / MANY));
    CHECK(loads(KN_CURVE_CREEP) && kn_said("readings thinned to"));
    CHECK(curve->count > 400 && curve->count <= KN_CURVE_READINGS);
    double readings = 0, worst = 0;
    bool rising = true, single = curve->weight[0] == 1 && curve->weight[1] == 1;
    for (int i = 0; i < curve->count; i++) {
        readings += curve->weight[i];
        worst = fmax(worst, fabs(curve->value[i] - crept_mm(curve->time_s[i]) / 10));
        if (i > 0) rising &= curve->time_s[i] > curve->time_s[i - 1];
        if (curve->time_s[i] > 20 && curve->time_s[i] < 20.0009) single &= curve->weight[i] == 1;
    }
    CHECK(readings == MANY + 1 && rising && single);
    CHECK(worst < 2e-7); // plain means of 5 % wide bins are off by 1.5e-5
}

TEST("the error of a mean agrees with its weight")
{
    enum { MANY = 50000 };
    begin("# load: 50 gf\n" SIZE "time_s,displacement_mm\n");
    for (int i = 0; i <= MANY; i++) {
        const double t = 20.0 * i / MANY;
        row("%.9g,%.9g\n", t, crept_mm(t) + 0.02 * kn_dice_normal(&seed));
    }
    CHECK(loads(KN_CURVE_CREEP));
    CHECK_NEAR(curve->noise, 0.002, 0.0001);
    double sum = 0;
    for (int i = 0; i < curve->count; i++) {
        const double off = curve->value[i] - crept_mm(curve->time_s[i]) / 10;
        sum += off * off * curve->weight[i] / (curve->noise * curve->noise);
    }
    CHECK_NEAR(sum / curve->count, 1, 0.2);
}

// --- noise

TEST("the noise of a smooth curve is estimated within 7 %, despite jumps, outliers and two sampling rates")
{
    enum { N = 3000 };
    static double t[N], y[N];
    for (int i = 0; i < N; i++) {
        t[i] = i < 1000 ? 0.01 * i : 10 + 0.1 * (i - 1000); // two sampling rates
        y[i] = 5 * exp(-t[i] / 30) + (t[i] > 50 ? 3 : 0) + 0.01 * kn_dice_normal(&seed) + (i % 397 == 0 ? 2 : 0);
    }
    CHECK_NEAR(kn_curve_noise(N, t, y), 0.01, 0.0007);
}

TEST("the noise of a coarse gauge is its step divided by the square root of 12, and never 0")
{
    enum { N = 1000 };
    static double t[N], y[N];
    for (int i = 0; i < N; i++) t[i] = i, y[i] = 0.01 * floor(i / 20.0);
    CHECK_NEAR(kn_curve_noise(N, t, y), 0.01 / sqrt(12), 1e-9);
    for (int i = 0; i < N; i++) y[i] = 3;
    CHECK_NEAR(kn_curve_noise(N, t, y), 3e-6, 1e-12);
    CHECK(kn_curve_noise(2, t, (double[]){0, 0}) > 0);
}

// --- relaxation

TEST("a modulus stays a modulus if the strain is unknown and becomes a stress if the strain is noted")
{
    for (int k = 0; k < 2; k++) {
        begin(k ? "# strain: 10 %\n" : "");
        row("Time\tRelaxation Modulus\n");
        for (int i = 1; i <= 20; i++) row("%d\t%g\n", i, 1000 * exp(-i / 5.0));
        options.units = "time=s,modulus=kPa";
        CHECK(loads(KN_CURVE_RELAX) && curve->count == 20 && curve->begin_s == 0);
        CHECK(curve->strain == (k ? 0.1 : 0) && !curve->other);
        CHECK_NEAR(curve->value[4], (k ? 1e5 : 1e6) * exp(-1), 1);
    }
}

TEST("a force is divided by the section at the strain, or by the initial area if the section is constant")
{
    static const char *const notes[] = {"# strain: 20 %\n", "# strain: 20 %\n# section: constant\n",
                                        "# section: constant\n"};
    for (int k = 0; k < 3; k++) {
        begin(notes[k]);
        row("# area: 2 cm^2\ntime_s;force_N\n");
        for (int i = 1; i <= 20; i++) row("%d;%g\n", i, -exp(-i / 5.0));
        CHECK(loads(KN_CURVE_RELAX) && kn_said("its sign is changed"));
        CHECK_NEAR(curve->value[4], (k ? 1 : 0.8) * exp(-1) / 2e-4, 0.01);
    }
}

TEST("a recorded ramp ends where its line reaches the held strain, and its readings stay in the curve")
{
    begin("# height: 1 cm\ntime_s,displacement_mm,stress_kPa\n");
    for (int i = -10; i <= 300; i++) {
        const double t = 0.1 * i, strain = t < 0 ? 0 : t < 2 ? 0.05 * t : t < 25 ? 0.1 : 0;
        row("%.9g,%.9g,%.9g\n", t, 10 * strain, t < 0 ? 0 : t < 2 ? 5 * t : t < 25 ? 10 * exp(-(t - 2) / 10) : 0);
    }
    CHECK(loads(KN_CURVE_RELAX));
    CHECK_NEAR(curve->begin_s, 2, 0.02);
    CHECK_NEAR(curve->strain, 0.1, 1e-9);
    CHECK(curve->other && kn_said("10 readings before the strain") &&
          kn_said("51 readings after the strain was released"));
    CHECK_NEAR(curve->other[10], 0.05, 1e-6);
}

TEST("a stress that rises at first counts as held from its peak on")
{
    begin(HELD);
    for (int i = 0; i <= 100; i++) row("%d,%g\n", i, i < 10 ? i : 10 * exp(-(i - 10) / 20.0));
    CHECK(loads(KN_CURVE_RELAX) && curve->begin_s == 10 && curve->count == 91 && kn_said("rises until 10 s"));
}

TEST("both readings of a jump at one time are kept")
{
    begin(HELD "0,100\n");
    for (int i = 0; i <= 20; i++) row("%d,%g\n", i, 40 * exp(-i / 20.0));
    CHECK(loads(KN_CURVE_RELAX) && curve->count == 22 && curve->value[0] == 100e3 && curve->value[1] == 40e3);
}

// --- sweeps

TEST("frequency in Hz or rad/s and modulus as parts, tan delta or phase angle give the same sweep")
{
    static const struct {
        const char *head;
        double per_hz, parts[2]; // what the first and second part of each modulus is divided by; 0: size and other[k]
        double angle;
    } all[] = {{"frequency_hz,storage_pa,loss_pa\n", 1, {1, 1}, 0},
               {"omega [rad/s],G' (kPa),G\" [Pa]\n", 2 * M_PI, {1e3, 1}, 0},
               {"f [Hz],|G*| [Pa],tan delta\n", 1, {0}, 0.3},
               {"Angular frequency (1/s),|E*| [Pa],phase angle (\xc2\xb0)\n", 2 * M_PI, {0}, 16.699244233993621}};
    for (int k = 0; k < 4; k++) {
        begin(all[k].head);
        for (int i = 10; i >= 1; i--) {
            const double storage = 1000.0 * i, loss = 300.0 * i;
            row("%.12g,", 0.1 * i * all[k].per_hz);
            if (all[k].angle > 0) row("%.12g,%.12g\n", hypot(storage, loss), all[k].angle);
            else row("%.12g,%.12g\n", storage / all[k].parts[0], loss / all[k].parts[1]);
        }
        CHECK(loads(KN_CURVE_SWEEP) && curve->count == 10);
        CHECK_NEAR(curve->time_s[4], 0.5, 1e-9);
        CHECK_NEAR(curve->value[4], 5000, 1e-6);
        CHECK_NEAR(curve->other[4], 1500, 1e-6);
    }
}

TEST("the noise of a sweep is relative, and a repeated frequency has weight 2")
{
    begin("f_hz,storage_pa,loss_pa\n");
    for (int i = 0; i < 800; i++) {
        const double hz = 0.01 * exp(i % 400 * 0.02);
        row("%.9g,%.9g,%.9g\n", hz, 1e3 * hz * (1 + 0.02 * kn_dice_normal(&seed)),
            1e4 * sqrt(hz) * (1 + 0.02 * kn_dice_normal(&seed)));
    }
    CHECK(loads(KN_CURVE_SWEEP) && curve->count == 400 && curve->weight[200] == 2);
    CHECK_NEAR(curve->noise, 0.02, 0.002); // noise of one reading
    free(text);
    text = NULL;
}

TESTS_MAIN
