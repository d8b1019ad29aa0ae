// Measured curves: converted to SI, sorted by time, thinned, with messages about each correction.
#include "clients/identify/measured_curve.h"
#include "clients/cli/commands.h"
#include "tests/check.h"
#include "tests/clients/heard.h"
#include "tests/dice.h"
#include <stdarg.h>
#include <stdint.h>

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
    kn_hear();
    int code = kn_curve_load(curve, &curves, kind, kn_write(text, length), &options);
    kn_hear_end();
    return code;
}

static bool said(const char *words) { return strstr(kn_heard, words) != NULL; }

// Check that the file was refused in one line with these words. line: the line of the file, or 0 for the file as a
// whole.
static bool refused(int line, const char *words)
{
    char place[100], *end = strchr(kn_heard, '\n');
    snprintf(place, sizeof place, ":%d:", line);
    if (line == 0) *place = 0;
    return curves == 0 && end && !end[1] && strstr(kn_heard, place) && strstr(kn_heard, words) &&
           strstr(kn_heard, kn_written);
}

// Return a simple creep curve: 1 - exp(-t/10) mm under the load. After 20 s the value decays by exp(-(t-20)/10).
static double crept_mm(double t)
{
    if (t < 0) return 0;
    return t <= 20 ? 1 - exp(-t / 10) : (1 - exp(-2.0)) * exp(-(t - 20) / 10);
}

static uint64_t seed = 1;

static const char notes[] = "# load: 50 gf\n# area: 1 cm^2\n# height: 1 cm\n# release: 20 s\n";

// --- creep

TEST("displacement divided by height becomes strain, and load divided by area becomes stress")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i <= 80; i++) row("%g,%.9g\n", 0.5 * i, crept_mm(0.5 * i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 1);
    CHECK(curve->count == 81 && curve->steps == 2 && !curve->constant_area);
    CHECK_NEAR(curve->step[0].stress_pa, 4903.325, 1e-9);
    CHECK(curve->step[1].time_s == 20 && curve->step[1].stress_pa == 0 && curve->step[1].early_s == 20);
    CHECK_NEAR(curve->value[40], 0.1 * (1 - exp(-2.0)), 1e-9);
    CHECK(curve->line[40] == 46 && curve->weight[40] == 1 && curve->height_m == 0.01 && curve->area_m2 == 1e-4);
    CHECK_STR(curve->name, "a");
    CHECK(said("81 readings of displacement, 4.903 kPa of nominal stress, taken off at 20 s"));
}

TEST("with a recorded load, time and height count from the load, and the release is found")
{
    begin("# area: 1 cm^2\ntime_s;height_mm;load_gf\n");
    for (int i = 0; i <= 100; i++) {
        const double t = 0.5 * i - 4.75; // the load comes between two readings
        row("%g;%.12g;%g\n", t + 4.75, 12 - crept_mm(t), t > 0 && t <= 20 ? 50.0 : 0);
    }
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->steps == 2);
    CHECK(said("initial height 12 mm, from the readings before the load"));
    CHECK(said("10 readings before the load, left out"));
    CHECK(curve->count == 91);
    CHECK_NEAR(curve->step[1].time_s, 20, 0.05);
    CHECK(curve->step[1].early_s > 19.5 && curve->step[1].late_s < 20.5);
    CHECK_NEAR(curve->time_s[0], 0.25, 0.05);
    CHECK_NEAR(curve->value[0], crept_mm(0.25) / 12, 1e-9);
    CHECK_NEAR(curve->height_m, 0.012, 1e-12);
}

TEST("if noise hides when the load was taken off, the release time is midway between two readings")
{
    begin("# area: 1 cm^2\n# height: 1 cm\ntime_s;displacement_mm;load_gf\n");
    for (int i = 0; i <= 80; i++)
        row("%g;%.9g;%g\n", 0.5 * i, crept_mm(0.5 * i) + 0.05 * kn_dice_normal(&seed), i <= 40 ? 50.0 : 0);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK);
    CHECK(curve->step[0].time_s == 0 && curve->step[1].time_s == 20.25);
}

TEST("a noisy load becomes one step, and readings while the load changes are left out")
{
    begin("# area: 1 cm^2\n# height: 1 cm\ntime_s;displacement_mm;load_gf\n");
    for (int i = 0; i <= 80; i++) {
        const double way = i == 9 || i == 10 ? 20.0 * (i - 8)
                           : i > 10          ? 50 + 0.5 * kn_dice_normal(&seed)
                                             : 0.3 * kn_dice_normal(&seed);
        row("%g;%.9g;%g\n", 0.5 * i, crept_mm(0.5 * i - 5), way);
    }
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK);
    CHECK(curve->steps == 1 && said("2 readings while the load changed, left out") && said("never taken off"));
    CHECK_NEAR(curve->step[0].stress_pa, 4903, 20);
}

TEST("loads that rise in stairs make one curve with one step per load")
{
    begin("# area: 1 cm^2\n# height: 1 cm\ntime_s;displacement_mm;load_gf\n");
    for (int i = 0; i < 90; i++) row("%d;%.9g;%d\n", i, 0.01 * i, i < 30 ? 10 : i < 60 ? 20 : 30);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->steps == 3);
    CHECK_NEAR(curve->step[2].stress_pa, 30 * 98.0665, 1e-6);
    CHECK(curve->step[2].time_s >= 59 && curve->step[2].time_s <= 60 && said("in steps"));
}

TEST("each column with a load in its name is a curve of its own, and the lengths may differ")
{
    begin("# height: 1 cm\n# area: 1 cm^2\ntime_s\tdisplacement_mm 10 gf\t50 gf [mm]\tx (0.1 N) [mm]\n");
    for (int i = 0; i < 20; i++) {
        if (i < 12) row("%d\t%g\t%g\t%g\n", i, 0.01 * i, 0.1 * i, 0.02 * i);
        else row("%d\t%g\t\t%g\n", i, 0.01 * i, 0.02 * i);
    }
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 3);
    CHECK(curve[0].count == 20 && curve[1].count == 12 && curve[2].count == 20);
    CHECK_STR(curve[1].name, "a 50 gf");
    CHECK_NEAR(curve[0].step[0].stress_pa, 980.665, 1e-9);
    CHECK_NEAR(curve[2].step[0].stress_pa, 1000, 1e-9);
    CHECK_NEAR(curve[1].value[11], 0.11, 1e-12);
}

TEST("a restart of the time with another load begins a new curve")
{
    begin("# area: 1 cm^2\nload_gf,time_s,height_mm\n");
    for (int k = 1; k <= 3; k++)
        for (int i = 0; i < 20; i++) row("%d,%d,%g\n", 10 * k, i, 10 + k - 0.01 * k * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 3);
    CHECK_STR(curve[2].name, "a 30 gf");
    CHECK_NEAR(curve[1].height_m, 0.012, 1e-12); // each curve has its own height
    CHECK_NEAR(curve[2].height_m, 0.013, 1e-12);
    CHECK(curve[1].line[0] == 23 && curve[1].step[0].time_s == 0);
}

TEST("a restart of the time under the same load is refused with the line of the restart")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 20; i++) row("%d,%g\n", i, 0.01 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(26, "time restarts"));
}

TEST("a misplaced row is sorted into its place and counted as one moved row")
{
    for (int at = 30; at <= 80; at += 50) { // moved to the middle, to the end
        begin(notes);
        row("time_s,displacement_mm\n");
        for (int i = 0; i <= 80; i++) {
            if (i != 9) row("%g,%.9g\n", 0.5 * i, crept_mm(0.5 * i));
            if (i == at) row("4.5,%.9g\n", crept_mm(4.5));
        }
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 1 && curve->count == 81);
        CHECK(said("not in the order of time: 1 moved") && curve->time_s[9] == 4.5);
    }
}

TEST("a second table with larger steps is refused at its first line, even behind a misplaced row")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 40; i++) row("%d,%g\n", k == 0 && i == 20 ? 3 : i * (k ? 9 : 1), 0.01 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(46, "time restarts, as in a second table"));
}

TEST("an interval with larger steps is recognised as a second one, wherever its times meet those of the first")
{
    for (int k = 2; k <= 30; k++) {
        begin(notes); // the same load
        row("time_s,displacement_mm\n");
        for (int i = 0; i < 40; i++) row("%d,%g\n", i, 0.01 * i);
        for (int i = 0; i < 40; i++) row("%d,%g\n", i * k, 0.01 * i);
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(46, "time restarts"));
        begin("# area: 1 cm^2\n# height: 1 cm\ntime_s,displacement_mm,load_gf\n"); // the recovery of that load
        for (int i = 1; i <= 60; i++) row("%d,%.9g,50\n", i, crept_mm(i));
        for (int i = 1; i <= 60; i++) row("%d,%.9g,0\n", k * i, crept_mm(60 + k * i));
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 1 && curve->count == 120 && curve->steps == 2);
        CHECK(said("without load: read as the recovery, which begins at 60 s") && curve->time_s[119] == 60 + 60 * k);
    }
}

TEST("five loads of eight readings make five curves, and a second table is found behind misplaced rows")
{
    begin("# area: 1 cm^2\n# height: 1 cm\nload_gf,time_s,displacement_mm\n");
    for (int k = 1; k <= 5; k++)
        for (int i = 0; i < 8; i++) row("%d,%d,%g\n", 10 * k, i, 0.01 * k * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 5 && curve[4].count == 8);
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 40; i++) row("%d,%g\n", k == 0 && (i == 1 || i == 2) ? 3 - i : i, 0.01 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(46, "time restarts"));
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int k = 0; k < 2; k++) // one reading stands twenty rows too early
        for (int i = 0; i < 40; i++) row("%d,%g\n", k || i < 20 || i > 27 ? i : i == 20 ? 27 : i - 1, 0.01 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(46, "time restarts"));
    static const int few[] = {0, 1, 2, 4, 5, 6, 7, 8, 9, 3, 10, 11};
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i < 24; i++) row("%d,%g\n", i < 12 ? few[i] : i - 12, 0.01 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(18, "time restarts"));
}

TEST("a misplaced reading among readings evenly spaced in log time is sorted into its place")
{
    for (int each = 4; each <= 20; each++)
        for (int row_s = 0; row_s < each; row_s++) {
            begin("# strain: 10 %\ntime_s,stress_kPa\n");
            for (int i = 0; i <= 3 * each; i++) {
                const double t = pow(10, (double)i / each), moved = pow(10, (double)row_s / each);
                if (i != row_s) row("%.9g,%.9g\n", t, pow(t, -0.1));
                if (i == 3 * each - 3) row("%.9g,%.9g\n", moved, pow(moved, -0.1));
            }
            CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && curve->count == 3 * each + 1);
        }
}

TEST("rows in any order are sorted by time")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i < 397; i++) row("%g,%.9g\n", 0.1 * (i * 151 % 397), crept_mm(0.1 * (i * 151 % 397)));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 1 && curve->count == 397);
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 396; i >= 0; i--) row("%g,%.9g\n", 0.1 * i, crept_mm(0.1 * i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 1 && curve->count == 397);
}

TEST("a time that jumps to 1,000 in a file with decimal commas is refused, with a hint at thousands separators")
{
    begin(notes);
    row("time [s];displacement [um]\n");
    for (int i = 0; i < 20; i++) row("%d;%d,5\n", 980 + i, 100 + i);
    for (int i = 0; i < 20; i++) row("1,%03d;%d,5\n", i, 120 + i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(26, "without thousands separators"));
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
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curves == 1 && curve->steps == 2 && curve->constant_area);
    CHECK(said("time restarts in line 29 without load: read as the recovery, which begins at 20 s"));
    CHECK(curve->count == 40 && curve->time_s[39] == 40 && curve->step[0].stress_pa == 100);
    CHECK(curve->step[1].time_s >= 20 && curve->step[1].time_s <= 21);
}

TEST("a rheometer file yields the time, shear strain and shear stress, and the strain may exceed 1")
{
    begin("Action Name;Time (sequence)(s);Time (action)(s);Shear stress(Pa);Shear rate(s-\xc2\xb9);Shear strain(%);"
          "Normal force(N);Frequency(Hz);Gap(mm)\n"); // in the format of rSpace
    for (int i = 0; i <= 20; i++) row("Creep;%d,5;%d;30,54;47,57;%d,7E+001;0,2;;9,15\n", 112 + i, i % 5, 10 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->count == 21 && curve->constant_area);
    CHECK_NEAR(curve->value[20], 20.07, 0.01);
    CHECK_NEAR(curve->step[0].stress_pa, 30.54, 1e-9);
    CHECK(curve->time_s[20] == 20 && said("time does not begin near 0"));
}

TEST("a stress column without values is ignored, and the stress of the note is used")
{
    begin("# stress: 10 Pa\nt\tstrain\tstress\tT\ns\t-\tPa\tC\n"); // in the format of RepTate's files
    for (int i = 0; i <= 20; i++) row("%d\t%g\n", i, 1e-4 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->count == 21 && curve->step[0].stress_pa == 10);
}

TEST("a stress that falls as the section grows means constant load; an unchanging stress means constant stress")
{
    begin("time_s,strain,stress_pa\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g,%.9g\n", i, 0.01 * i, 5000 * (1 - 0.01 * i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && !curve->constant_area);
    CHECK_NEAR(curve->step[0].stress_pa, 5000, 1e-3);
    begin("time_s,strain,stress_pa\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g,5000\n", i, 0.01 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->constant_area && curve->step[0].stress_pa == 5000);
}

TEST("a column x without a unit is used as the strain only if no strain or displacement column has a unit")
{
    static const char *const bare[] = {"x", "compression", "deformation"};
    for (int k = 0; k < 3; k++) {
        begin(notes);
        row("time_s,%s,displacement_mm\n", bare[k]);
        for (int i = 0; i <= 40; i++) row("%d,%s,%.9g\n", i, k ? "7" : "dry", crept_mm(i));
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && said("is used, not '") && said("which has no unit"));
        CHECK_NEAR(curve->value[10], crept_mm(10) / 10, 1e-9);
    }
    begin(notes);
    row("time_s,x,strain [%%]\n");
    for (int i = 0; i <= 40; i++) row("%d,7,%.9g\n", i, 10 * crept_mm(i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && !said("has no unit"));
    CHECK_NEAR(curve->value[10], crept_mm(10) / 10, 1e-9);
    begin(notes);
    row("time_s,x\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", i, 0.1 * crept_mm(i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && said("'x' has no unit and is read as a fraction of the height"));
    begin("# area: 1 cm^2\n# height: 1 cm\ntime [s],load [gf],x,displacement [mm]\n"); // relaxation has the same rule
    for (int i = 0; i <= 40; i++) row("%d,%g,7,1\n", i, 50 * exp(-i / 20.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK);
    CHECK_NEAR(curve->strain, 0.1, 1e-9);
    begin("# area: 1 cm^2\ntime [s],load [gf],x\n");
    for (int i = 0; i <= 40; i++) row("%d,%g,0.1\n", i, 50 * exp(-i / 20.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && said("'x' has no unit and is read as a fraction of the height"));
    begin("time [s],gamma,gap [mm],G(t) [Pa]\n"); // gamma is a strain, even beside a rheometer's gap
    for (int i = 0; i <= 40; i++) row("%d,0.01,1,%g\n", i, 50 * exp(-i / 20.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && said("'gamma' has no unit"));
    CHECK_NEAR(curve->strain, 0.01, 1e-9);
}

TEST("a strain rate is not taken for a strain, and a strain column with a unit is preferred to one without")
{
    static const char *const heads[] = {"time_s,gamma,strain rate\n", "time_s,x [%],x\n", "time_s,x,x [%]\n"};
    for (int k = 0; k < 3; k++) {
        begin(notes);
        row("%s", heads[k]);
        for (int i = 0; i <= 40; i++) {
            const double strain = 0.1 * crept_mm(i);
            row("%d,%.9g,%.9g\n", i, k == 2 ? 7 : k ? 100 * strain : strain, k == 2 ? 100 * strain : 7);
        }
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK);
        CHECK_NEAR(curve->value[10], 0.1 * crept_mm(10), 1e-9);
    }
}

TEST("a compliance becomes a strain under the known stress, or under 1 Pa if the stress is unknown")
{
    begin("Time [min]\tCreep Compliance [1/kPa]\n");
    for (int i = 0; i < 10; i++) row("%d\t%g\n", i, 0.002 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK);
    CHECK(curve->constant_area && curve->step[0].stress_pa == 1 && said("stress unknown"));
    CHECK_NEAR(curve->value[9], 0.018e-3, 1e-18);
    CHECK(curve->time_s[9] == 540);
    begin("# stress: 2 kPa\nTime [min]\tCreep Compliance [1/kPa]\n");
    for (int i = 0; i < 10; i++) row("%d\t%g\n", i, 0.002 * i);
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->step[0].stress_pa == 2000);
    CHECK_NEAR(curve->value[9], 0.036, 1e-15);
}

TEST("a negative compression changes its sign, and a message says so")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", i, -crept_mm(i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && said("its sign is changed") && curve->value[10] > 0);
}

TEST("notes in the file override the command-line options, and options replace missing notes")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", i, crept_mm(i));
    options.load_n = 9;
    options.release_s = 5;
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->step[1].time_s == 20);
    CHECK_NEAR(curve->step[0].stress_pa, 4903.325, 1e-9);
    begin("time_s,displacement_mm\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", i, crept_mm(i));
    options = (kn_curve_options){
        .subcommand = "identify creep", .load_n = 1, .area_m2 = 1e-3, .height_m = 0.02, .release_s = 5};
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->step[1].time_s == 5 && curve->step[0].stress_pa == 1000);
    CHECK_NEAR(curve->value[20], crept_mm(20) / 20, 1e-9);
}

TEST("a noted release time overrides the readings if both agree; otherwise a message reports the conflict")
{
    for (int k = 0; k < 2; k++) {
        begin(k ? "# release: 20.1 s\n" : "# release: 25 s\n");
        row("# area: 1 cm^2\n# height: 1 cm\ntime_s;displacement_mm;load_gf\n");
        for (int i = 0; i <= 80; i++) row("%g;%.9g;%g\n", 0.5 * i, crept_mm(0.5 * i), i <= 40 ? 50.0 : 0);
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->steps == 2);
        if (k) CHECK(curve->step[1].time_s == 20.1 && curve->step[1].early_s == 20.1);
        else CHECK(said("the noted time of 25 s is not used") && curve->step[1].time_s < 20.5);
    }
}

TEST("missing, unsorted and simultaneous readings are repaired, and messages count them")
{
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 40; i >= 0; i--) row("%d,%.9g\n", i, crept_mm(i));
    row("7,%.9g\n50,\n51,nan\n", crept_mm(7));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->count == 41);
    CHECK(said("2 readings of displacement missing, left out; the first in line 48"));
    CHECK(said("not in the order of time") && said("1 reading has the time of another: averaged"));
    CHECK(curve->time_s[7] == 7 && curve->weight[7] == 2 && curve->weight[8] == 1);
    CHECK_NEAR(curve->value[7], crept_mm(7) / 10, 1e-9);
}

TEST("a clock that starts far from 0 is reported, and time counts from the first reading")
{
    begin("# load: 50 gf\n# area: 1 cm^2\n# height: 1 cm\ntime_s,displacement_mm\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", 100000 + i, crept_mm(i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && said("time does not begin near 0") && curve->time_s[40] == 40);
}

TEST("a strain that begins long after the noted load is reported, with or without readings before it")
{
    for (int k = 0; k < 6; k++) {
        const double noise = k & 1 ? 0.01 : 0;
        begin(k == 4 ? "# begin: 5 s\n" : "# load: 50 gf\n");
        row("# load: 50 gf\n# area: 1 cm^2\n# height: 1 cm\n# release: 25 s\ntime_s,displacement_mm\n");
        for (int i = k / 2 == 1 ? 26 : 0; i <= 200; i++) // no readings before it
            row("%g,%.9g\n", 0.2 * i, crept_mm(0.2 * i - (k == 5 ? 0 : 5)) + noise * kn_dice_normal(&seed));
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && curve->step[1].time_s == (k == 4 ? 20 : 25));
        CHECK(said("the strain begins at") == (k < 4));
    }
}

TEST("a height measured from the first reading is not reported as a late strain")
{
    begin("# load: 50 gf\n# area: 1 cm^2\ntime_s,height_mm\n");
    for (int i = 1; i <= 80; i++) row("%g,%.9g\n", 0.5 * i, 10 - crept_mm(0.5 * i));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && !said("the strain begins at"));
}

TEST("each missing or unusable quantity is reported in one line with the remedy")
{
    const char rows[] = "0,1\n1,2\n2,3\n3,4\n4,5\n5,6\n6,7\n7,7.5\n8,8\n";
    static const struct {
        const char *head;
        int line;
        const char *words;
    } all[] = {{"time_s,displacement_mm\n", 1, "--height"},
               {"# height: 1 cm\ntime_s,displacement_mm\n", 2, "--load"},
               {"# height: 1 cm\n# load: 1 N\ntime_s,displacement_mm\n", 3, "--area"},
               {"time,displacement_mm\n", 1, "--units 'time=s'"},
               {"time_s,displacement\n", 1, "--units 'displacement=m'"},
               {"time_s,displacement_s\n", 1, "expected a displacement"},
               {"time_mm,displacement_mm\n", 1, "expected a time"},
               {"time_s,colour\n", 1, "no column of height, displacement, strain or compliance"},
               {"instant_s,displacement_mm\n", 1, "no time"},
               {"# height: -1 cm\ntime_s,displacement_mm\n", 1, "above 0"},
               {"# height: 1 s\ntime_s,displacement_mm\n", 1, "not in units of m"}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        begin(all[i].head);
        row("%s", rows);
        CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(all[i].line, all[i].words));
    }
}

TEST("each impossible strain, height or load is refused with its line")
{
    begin(notes);
    row("time_s,displacement_mm\n0,0\n1,1\n2,2\n3,3\n4,4\n5,12\n6,5\n7,6\n30,6\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(11, ":11:3: strain of 1.2, more than the whole height"));
    begin(notes);
    row("time_s,height_mm\n0,9\n1,8\n2,7\n3,6\n4,-4\n5,3\n6,3\n7,2\n30,2\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(10, "height of -0.004 m"));
    begin(notes);
    row("time_s,height_mm\n0,10\n1,11\n2,12\n3,13\n4,14\n5,15\n6,16\n7,17\n30,18\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(6, "expected compression"));
    begin(notes);
    row("time_s,displacement_mm\n0,0\n1,0\n2,0\n3,0\n4,0\n5,0\n6,0\n7,0\n30,0\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(6, "is 0 in all readings"));
    begin(notes);
    row("time_s,displacement_mm\n0,0\n1,1\n2,2\n30,3\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(6, "4 usable readings of displacement"));
    begin(notes);
    row("time_s,displacement_mm,load_gf\n0,0,0\n1,1,0\n2,2,0\n3,3,0\n4,4,0\n5,4,0\n6,5,0\n7,6,0\n30,6,0\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(6, "the load is 0 in all readings"));
    begin(notes);
    row("time_s,displacement_mm\n0,0\n1,1\n2,2\n3,3\n4,4\n5,4.1\n6,5\n7,6\n8,6\n");
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_USAGE && refused(4, "released at 20 s"));
}

TEST("a file beyond the 32nd curve is refused, and the curves before stay")
{
    while (curves > 0) kn_curve_free(&curve[--curves]);
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i <= 40; i++) row("%d,%.9g\n", i, crept_mm(i));
    fclose(out);
    int code = KN_EXIT_OK;
    kn_hear();
    for (int i = 0; i <= KN_CURVES_MAX && code == KN_EXIT_OK; i++)
        code = kn_curve_load(curve, &curves, KN_CURVE_CREEP, kn_write(text, length), &none);
    kn_hear_end();
    CHECK(code == KN_EXIT_USAGE && curves == KN_CURVES_MAX && said("more than 32 curves"));
}

// --- thinning

TEST("100 000 readings are thinned to 400 to 600 means that lie on the curve, and no mean crosses the release")
{
    enum { MANY = 100000 };
    begin(notes);
    row("time_s,displacement_mm\n");
    for (int i = 0; i <= MANY; i++) row("%.9g,%.12g\n", 40.0 * i / MANY, crept_mm(40.0 * i / MANY));
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK && said("readings thinned to"));
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
    begin("# load: 50 gf\n# area: 1 cm^2\n# height: 1 cm\ntime_s,displacement_mm\n");
    for (int i = 0; i <= MANY; i++) {
        const double t = 20.0 * i / MANY;
        row("%.9g,%.9g\n", t, crept_mm(t) + 0.02 * kn_dice_normal(&seed));
    }
    CHECK(load(KN_CURVE_CREEP) == KN_EXIT_OK);
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
        CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && curve->count == 20 && curve->begin_s == 0);
        CHECK(curve->strain == (k ? 0.1 : 0) && !curve->other);
        CHECK_NEAR(curve->value[4], (k ? 1e5 : 1e6) * exp(-1), 1);
    }
}

TEST("a force is divided by the section at the strain, or by the initial area if the section is constant")
{
    for (int k = 0; k < 3; k++) {
        begin("# area: 2 cm^2\n");
        if (k < 2) row("# strain: 20 %%\n");
        if (k > 0) row("# section: constant\n");
        row("time_s;force_N\n");
        for (int i = 1; i <= 20; i++) row("%d;%g\n", i, -exp(-i / 5.0));
        CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && said("its sign is changed"));
        CHECK_NEAR(curve->value[4], (k ? 1 : 0.8) * exp(-1) / 2e-4, 0.01);
    }
    begin("# area: 2 cm^2\ntime_s;force_N\n");
    for (int i = 1; i <= 20; i++) row("%d;%g\n", i, exp(-i / 5.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_USAGE && refused(2, "--strain"));
}

TEST("a recorded ramp ends where its line reaches the held strain, and its readings stay in the curve")
{
    begin("# height: 1 cm\ntime_s,displacement_mm,stress_kPa\n");
    for (int i = -10; i <= 300; i++) {
        const double t = 0.1 * i, strain = t < 0 ? 0 : t < 2 ? 0.05 * t : t < 25 ? 0.1 : 0;
        row("%.9g,%.9g,%.9g\n", t, 10 * strain, t < 0 ? 0 : t < 2 ? 5 * t : t < 25 ? 10 * exp(-(t - 2) / 10) : 0);
    }
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK);
    CHECK_NEAR(curve->begin_s, 2, 0.02);
    CHECK_NEAR(curve->strain, 0.1, 1e-9);
    CHECK(curve->other && said("10 readings before the strain") && said("51 readings after the strain was released"));
    CHECK_NEAR(curve->other[10], 0.05, 1e-6);
}

TEST("a stress that rises at first counts as held from its peak on")
{
    begin("# strain: 10 %\ntime_s,stress_kPa\n");
    for (int i = 0; i <= 100; i++) row("%d,%g\n", i, i < 10 ? i : 10 * exp(-(i - 10) / 20.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && curve->begin_s == 10 && curve->count == 91 && said("rises until 10 s"));
}

TEST("a second relaxation in one file is refused at its first line")
{
    begin("# strain: 10 %\ntime_s,stress_kPa\n");
    for (int i = 0; i < 40; i++) row("%d,%g\n", i % 20, exp(-(i % 20) / 20.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_USAGE && refused(23, "time restarts"));
}

TEST("both readings of a jump at one time are kept")
{
    begin("# strain: 10 %\ntime_s,stress_kPa\n0,100\n0,40\n");
    for (int i = 1; i <= 20; i++) row("%d,%g\n", i, 40 * exp(-i / 20.0));
    CHECK(load(KN_CURVE_RELAX) == KN_EXIT_OK && curve->count == 22 && curve->value[0] == 100e3 &&
          curve->value[1] == 40e3);
}

// --- sweeps

TEST("frequency in Hz or rad/s and modulus as parts, tan delta or phase angle give the same sweep")
{
    static const char *const heads[] = {"frequency_hz,storage_pa,loss_pa\n", "omega [rad/s],G' (kPa),G\" [Pa]\n",
                                        "f [Hz],|G*| [Pa],tan delta\n",
                                        "Angular frequency (1/s),|E*| [Pa],phase angle (\xc2\xb0)\n"};
    for (int k = 0; k < 4; k++) {
        begin(heads[k]);
        for (int i = 10; i >= 1; i--) {
            const double hz = 0.1 * i, storage = 1000.0 * i, loss = 300.0 * i, size = hypot(storage, loss);
            if (k == 0) row("%.12g,%.12g,%.12g\n", hz, storage, loss);
            if (k == 1) row("%.12g,%.12g,%.12g\n", 2 * M_PI * hz, storage / 1e3, loss);
            if (k == 2) row("%.12g,%.12g,%.12g\n", hz, size, 0.3);
            if (k == 3) row("%.12g,%.12g,%.12g\n", 2 * M_PI * hz, size, atan(0.3) * 180 / M_PI);
        }
        CHECK(load(KN_CURVE_SWEEP) == KN_EXIT_OK && curve->count == 10);
        CHECK_NEAR(curve->time_s[4], 0.5, 1e-9);
        CHECK_NEAR(curve->value[4], 5000, 1e-6);
        CHECK_NEAR(curve->other[4], 1500, 1e-6);
    }
}

TEST("the noise of a sweep is relative, and a repeated frequency has weight 2")
{
    begin("f_hz,storage_pa,loss_pa\n");
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 400; i++) {
            const double hz = 0.01 * exp(i * 0.02);
            row("%.9g,%.9g,%.9g\n", hz, 1e3 * hz * (1 + 0.02 * kn_dice_normal(&seed)),
                1e4 * sqrt(hz) * (1 + 0.02 * kn_dice_normal(&seed)));
        }
    CHECK(load(KN_CURVE_SWEEP) == KN_EXIT_OK && curve->count == 400 && curve->weight[200] == 2);
    CHECK_NEAR(curve->noise, 0.02, 0.002); // noise of one reading
}

TEST("a frequency of 0, a modulus below 0 and a missing loss modulus are refused with their line")
{
    begin("f_hz,storage_pa,loss_pa\n0,1,1\n");
    for (int i = 1; i <= 10; i++) row("%d,%d,1\n", i, i);
    CHECK(load(KN_CURVE_SWEEP) == KN_EXIT_USAGE && refused(2, "frequency of 0 Hz"));
    begin("f_hz,storage_pa,loss_pa\n");
    for (int i = 1; i <= 10; i++) row("%d,%d,%d\n", i, i, i - 5);
    CHECK(load(KN_CURVE_SWEEP) == KN_EXIT_USAGE && refused(2, "expected both above 0"));
    begin("f_hz,storage_pa\n");
    for (int i = 1; i <= 10; i++) row("%d,%d\n", i, i);
    CHECK(load(KN_CURVE_SWEEP) == KN_EXIT_USAGE && refused(1, "no storage and loss modulus"));
    free(text);
    text = NULL;
}

TESTS_MAIN
