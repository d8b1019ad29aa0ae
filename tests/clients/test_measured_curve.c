// Measured curves: converted to SI, sorted by time, thinned, with messages about each correction.
#include "clients/identify/measured_curve.h"
#include "clients/cli/commands.h"
#include "tests/clients/heard.h"
#include "tests/dice.h"
#include <fnmatch.h>

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

static void begin(const char *lines)
{
    free(text);
    out = open_memstream(&text, &length);
    options = none;
    kn_rows(out, lines);
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

static uint64_t seed = 1;

// Return what the curves are: their readings, the size of the specimen, loads and held strain.
static const char *contents(void)
{
    static char dump[1000];
    FILE *to = fmemopen(dump, sizeof dump, "w");
    for (const kn_curve *c = curve; c < curve + curves; c++) {
        const int last = c->count - 1;
        fprintf(to, "%s%s: %d readings, %.4g..%.4g s, %.4g..%.4g", c > curve ? "; " : "", c->name, c->count,
                c->time_s[0], c->time_s[last], c->value[0], c->value[last]);
        for (int i = 0; c->kind == KN_CURVE_CREEP && i < c->steps; i++)
            fprintf(to, ", %.4g Pa at %.4g s", c->step[i].stress_pa, c->step[i].time_s);
        if (c->kind == KN_CURVE_RELAX) fprintf(to, ", strain %.4g from %.4g s", c->strain, c->begin_s);
        if (c->kind == KN_CURVE_SWEEP) fprintf(to, ", loss %.4g..%.4g", c->other[0], c->other[last]);
        fputs(c->constant_area ? ", constant stress" : "", to);
    }
    fclose(to);
    return dump;
}

TEST("files of instruments give creeps, relaxations and sweeps in SI units, with a message about each correction")
{
#define LOAD "# load: 50 gf\n"
#define RHEOCOMPASS "Interval data:;Point No.;Time;Shear Strain;Shear Stress;Status\n;[];[s];[%];[Pa];[]\n"
#define STRAINED "a: 9 readings, 0..8 s, 0..0.08, 4903 Pa at 0 s"
#define FRACTION " has no unit and is read as a fraction of the height"
#define MODULUS "a: 8 readings, 1..8 s, 8000..1000"
#define SWEPT "a: 10 readings, 0.1..1 s, 1000..1e+04, loss 300..3000"
    static const struct {
        const char *sentence;
        kn_curve_kind kind;
        const char *text, *outcome, *said; // said: a pattern; "": not a word about a unit
    } all[] = {
        {"displacement divided by height becomes strain, and load divided by area becomes stress", KN_CURVE_CREEP,
         LOAD SIZE "# release: 5 s\ntime_s,displacement_mm\n@9 0+1,0+.1\n", STRAINED ", 0 Pa at 5 s",
         "9 readings of displacement, 4.903 kPa of nominal stress, taken off at 5 s"},
        {"loads that rise in stairs make one curve with one step per load", KN_CURVE_CREEP,
         LOADED "@30 0+1;0+.01;10\n@30 30+1;0.3+.01;20\n@30 60+1;0.6+.01;30\n",
         "a: 90 readings, 0..89 s, 0..0.089, 980.7 Pa at 0 s, 1961 Pa at 29.5 s, 2942 Pa at 59.5 s", "in steps"},
        {"each column with a load in its name is a curve of its own, and the lengths may differ", KN_CURVE_CREEP,
         SIZE "time_s\tdisplacement_mm 10 gf\tx (0.1 N) [mm]\t50 gf [mm]\n@12 0+1\t0+.1\t0+.2\t0+.3\n@8 "
              "12+1\t1.2+.1\t2.4+.2\t\n",
         "a 10 gf: 20 readings, 0..19 s, 0..0.19, 980.7 Pa at 0 s; a 10.2 gf: 20 readings, 0..19 s, 0..0.38, 1000 Pa "
         "at 0 s; "
         "a 50 gf: 12 readings, 0..11 s, 0..0.33, 4903 Pa at 0 s",
         ""},
        {"a restart of the time with another load begins a new curve, which has its own height", KN_CURVE_CREEP,
         "# area: 1 cm^2\nload_gf,time_s,height_mm\n@8 10,0+1,10-1\n@8 20,0+1,20-1\n@9 30,0+1,40-1\n",
         "a 10 gf: 8 readings, 0..7 s, 0..0.7, 980.7 Pa at 0 s; a 20 gf: 8 readings, 0..7 s, 0..0.35, 1961 Pa at 0 s; "
         "a 30 gf: 9 readings, 0..8 s, 0..0.2, 2942 Pa at 0 s",
         ""},
        {"an interval without load whose time restarts is the recovery of the interval before it", KN_CURVE_CREEP,
         "Project:;Dough\nInterval and data points:;2;20;20\n" RHEOCOMPASS "@20 ;1+1;1+1;1+1;100,00;Dy_auto\n\n"
         "Interval and data points:;2\n" RHEOCOMPASS "@20 ;1+1;1+1;20-1;0,01;Dy_auto\n",
         "a: 40 readings, 1..40 s, 0.005774..0.005774, 173.2 Pa at 0 s, 0 Pa at 20.5 s, constant stress",
         "time falls in line 29, without load: read as the recovery, which begins at 20 s"},
        {"missing and simultaneous readings are repaired", KN_CURVE_CREEP,
         LOAD SIZE "time_s,displacement_mm\n@9 0+1,0+.1\n8,.8\n50,\n51,nan\n", STRAINED,
         "2 readings of displacement missing, left out; the first in line 15*1 reading has the time of another: "
         "averaged"},
        {"a noted release time overrides the readings if both agree", KN_CURVE_CREEP,
         "# release: 20.1 s\n" LOADED "@41 0+.5;0+.01;50\n@40 20.5+.5;0.4-.01;0\n",
         "a: 81 readings, 0..40 s, 0..0.001, 4903 Pa at 0 s, 0 Pa at 20.1 s", ""},
        {"a noted release time is reported if the readings have another", KN_CURVE_CREEP,
         "# release: 25 s\n" LOADED "@41 0+.5;0+.01;50\n@40 20.5+.5;0.4-.01;0\n",
         "a: 81 readings, 0..40 s, 0..0.001, 4903 Pa at 0 s, 0 Pa at 20.25 s", "the noted time of 25 s is not used"},
        {"a rheometer's time, shear strain and shear stress are used, and the strain may exceed 1", KN_CURVE_CREEP,
         "Action Name;Time (sequence)(s);Time (action)(s);Shear stress(Pa);Shear rate(s-\xc2\xb9);Shear "
         "strain(%);Gap(mm)\n"
         "@21 Creep;112+1,5;3;30,54;47,57;0+10,7E+001;9,15\n", // as rSpace writes
         "a: 21 readings, 0..20 s, 0.04041..11.59, 52.9 Pa at 0 s, constant stress", "time does not begin near 0"},
        {"a stress column without values is ignored, and the stress of the note is used", KN_CURVE_CREEP, // RepTate
         "# stress: 10 Pa\nt\tstrain\tstress\tT\ns\t-\tPa\tC\n@8 0+1\t0+.1\t\t\n",
         "a: 8 readings, 0..7 s, 0..0.7, 10 Pa at 0 s", ""},
        {"a nominal stress is the load over the initial section", KN_CURVE_CREEP,
         "time_s,strain,nominal stress_pa\n@41 0+1,0+.01,5000\n", "a: 41 readings, 0..40 s, 0..0.4, 5000 Pa at 0 s",
         "'strain'" FRACTION},
        {"an unchanging stress means a constant stress", KN_CURVE_CREEP,
         "time_s,strain,stress_pa\n@41 0+1,0+.01,5000\n",
         "a: 41 readings, 0..40 s, 0..0.4, 5000 Pa at 0 s, constant stress", "'strain'" FRACTION},
        {"a column that could be two quantities, without a unit, is not used beside one with a unit", KN_CURVE_CREEP,
         LOAD SIZE "time_s,x,displacement_mm\n@9 0+1,dry,0+.1\n", STRAINED, ""},
        {"", KN_CURVE_CREEP, LOAD SIZE "time_s,compression,displacement_mm\n@9 0+1,7,0+.1\n", STRAINED, ""},
        {"", KN_CURVE_CREEP, LOAD SIZE "time_s,deformation,displacement_mm\n@9 0+1,7,0+.1\n", STRAINED, ""},
        {"", KN_CURVE_CREEP, LOAD SIZE "time_s,x,strain [%]\n@9 0+1,7,0+1\n", STRAINED, ""},
        {"a strain rate is not taken for a strain", KN_CURVE_CREEP,
         LOAD SIZE "time_s,gamma,strain rate\n@9 0+1,0+.01,7\n", STRAINED, "'gamma'" FRACTION},
        {"relaxation has the same rule", KN_CURVE_RELAX,
         SIZE "time [s],load [gf],x,displacement [mm]\n@8 1+1,8-1,7,1\n",
         "a: 8 readings, 1..8 s, 706.1..88.26, strain 0.1 from 0 s", ""},
        {"gamma is a strain, even beside a rheometer's gap", KN_CURVE_RELAX,
         "time [s],gamma,gap [mm],G(t) [Pa]\n@8 1+1,.01,1,8-1\n",
         "a: 8 readings, 1..8 s, 0.08..0.01, strain 0.01 from 0 s", "'gamma'" FRACTION},
        {"a compliance becomes a strain under the known stress, or under 1 Pa if the stress is unknown", KN_CURVE_CREEP,
         "Time [min]\tCreep Compliance [1/kPa]\n@10 0+1\t0+.002\n",
         "a: 10 readings, 0..540 s, 0..1.8e-05, 1 Pa at 0 s, constant stress", "stress unknown"},
        {"", KN_CURVE_CREEP, "# stress: 2 kPa\nTime [min]\tCreep Compliance [1/kPa]\n@10 0+1\t0+.002\n",
         "a: 10 readings, 0..540 s, 0..0.036, 2000 Pa at 0 s, constant stress", ""},
        {"a negative compression changes its sign", KN_CURVE_CREEP, LOAD SIZE "time_s,displacement_mm\n@9 0+1,0-.1\n",
         "a: 9 readings, 0..8 s, -0..0.08, 4903 Pa at 0 s", "its sign is changed"},
        {"a clock that starts far from 0 is reported, and time counts from the first reading", KN_CURVE_CREEP,
         LOAD SIZE "time_s,displacement_mm\n@9 100000+1,0+.1\n", STRAINED, "time does not begin near 0"},
        {"a modulus stays a modulus if the strain is unknown and becomes a stress if the strain is noted",
         KN_CURVE_RELAX, "Time [s]\tRelaxation Modulus [kPa]\n@8 1+1\t8-1\n", MODULUS ", strain 0 from 0 s", ""},
        {"", KN_CURVE_RELAX, "# strain: 10 %\nTime [s]\tRelaxation Modulus [kPa]\n@8 1+1\t8-1\n",
         "a: 8 readings, 1..8 s, 800..100, strain 0.1 from 0 s", ""},
        {"a force is divided by the section at the strain, or by the initial area if the section is constant",
         KN_CURVE_RELAX, "# strain: 20 %\n# area: 2 cm^2\ntime_s;force_N\n@8 1+1;-1.6-.2\n",
         "a: 8 readings, 1..8 s, 6400..800, strain 0.2 from 0 s", "its sign is changed"},
        {"", KN_CURVE_RELAX, "# strain: 20 %\n# section: constant\n# area: 2 cm^2\ntime_s;force_N\n@8 1+1;1.6-.2\n",
         MODULUS ", strain 0.2 from 0 s, constant stress", ""},
        {"", KN_CURVE_RELAX, "# section: constant\n# area: 2 cm^2\ntime_s;force_N\n@8 1+1;1.6-.2\n",
         MODULUS ", strain 0 from 0 s, constant stress", ""},
        {"a stress that rises at first counts as held from its peak on", KN_CURVE_RELAX,
         HELD "@10 0+1,0+1\n@91 10+1,10-.1\n", "a: 91 readings, 10..100 s, 1e+04..1000, strain 0.1 from 10 s",
         "rises until 10 s"},
        {"both readings of a jump at one time are kept", KN_CURVE_RELAX, HELD "0,100\n@21 0+1,40-1\n",
         "a: 22 readings, 0..20 s, 1e+05..2e+04, strain 0.1 from 0 s", ""},
        {"frequency in Hz or rad/s and modulus as parts, tan delta or phase angle give the same sweep", KN_CURVE_SWEEP,
         "frequency_hz,storage_pa,loss_pa\n@10 1-.1,10000-1000,3000-300\n", SWEPT, ""},
        {"", KN_CURVE_SWEEP, "omega [rad/s],G' (kPa),G\" [Pa]\n@10 6.28318530718-.628318530718,10-1,3000-300\n", SWEPT,
         ""},
        {"", KN_CURVE_SWEEP, "f [Hz],|G*| [Pa],tan delta\n@10 1-.1,10440.30650891-1044.030650891,.3\n", SWEPT, ""},
        {"", KN_CURVE_SWEEP,
         "Angular frequency (1/s),|E*| [Pa],phase angle (\xc2\xb0)\n"
         "@10 6.28318530718-.628318530718,10440.30650891-1044.030650891,16.699244234\n",
         SWEPT, ""},
        {"a compliance in shear takes its stress, and its release, from the column of stress; the gap is no height",
         KN_CURVE_CREEP,
         "Time [s];Shear Stress [Pa];Creep Compliance [1/Pa];Gap [mm]\n@10 0+1;50;0+.001;1\n"
         "@9 10+1;0;.005;1\n",
         "a: 19 readings, 0..18 s, 0..0.1443, 86.6 Pa at 0 s, 0 Pa at 9 s, constant stress", "taken off at 9 s"},
        {"a name of shear anywhere in a sweep makes it one of shear", KN_CURVE_SWEEP,
         "omega [rad/s],Shear Strain [%],G' [Pa],G\" [Pa]\n"
         "@10 6.28318530718-.628318530718,1,10000-1000,3000-300\n",
         "a: 10 readings, 0.1..1 s, 3000..3e+04, loss 900..9000, constant stress", "is of shear*E = 3 G"},
        {"a normal force beside a shear stress is not the load", KN_CURVE_CREEP,
         "Time [s];Shear Stress [Pa];Shear Strain [%];Normal Force [N]\n@10 0+1;50;0+.1;.1\n",
         "a: 10 readings, 0..9 s, 0..0.005196, 86.6 Pa at 0 s, constant stress", "is of shear"},
        {"a nominal stress of a relaxation counts on the initial section, and a logarithmic strain becomes a change of "
         "height",
         KN_CURVE_RELAX, "# strain: 20 %\ntime_s;nominal stress_pa\n@8 1+1;8000-1000\n",
         "a: 8 readings, 1..8 s, 6400..800, strain 0.2 from 0 s", "load over the initial section"},
        {"", KN_CURVE_RELAX, "time_s;true strain;stress_pa\n@8 1+1;.2231435513;8000-1000\n",
         "a: 8 readings, 1..8 s, 8000..1000, strain 0.2 from 0 s", "logarithm of the height"},
        {"a strain counts from where the load begins, after the tool's way through the air", KN_CURVE_RELAX,
         SIZE "time_s;displacement_mm;force_N\n@5 0+1;0+.5;0\n@5 5+1;2.4+.1;0+.2\n@20 10+1;2.8;1-.01\n",
         "a: 25 readings, 5..29 s, 0..7776, strain 0.04 from 9 s", "the load begins at a strain of 24 %"},
        {"a hold whose clock begins late is told", KN_CURVE_RELAX,
         "# strain: 10 %\ntime_s;stress_pa\n@60 30+1;1000-10\n",
         "a: 60 readings, 30..89 s, 1000..410, strain 0.1 from 0 s", "30 s before the first reading"},
        {"an interval of rest before the load is left out", KN_CURVE_CREEP,
         SIZE "time_s;load_gf;displacement_mm\n@4 0+1;0;0\n@10 0+1;10;0+.1\n",
         "a 10 gf: 10 readings, 0..9 s, 0..0.09, 980.7 Pa at 0 s", "4 readings before the load"},
        {"a table of a rheometer may have leading tabs, a blank row and a row of units", KN_CURVE_RELAX,
         "Project:\tHold\n\nInterval and data points:\t1\t8\n"
         "Interval data:\tPoint No.\tTime\tShear Strain\tShear Stress\tTorque\tStatus\n\t\t\t\t\t\t\n"
         "\t\t[s]\t[%]\t[Pa]\t[mN\xc2\xb7m]\t\n@8 \t1+1\t1+1\t3\t80-10\t1\tDy_auto\n",
         "a: 8 readings, 1..8 s, 138.6..17.32, strain 0.01732 from 0 s, constant stress", "is of shear*E = 3 G"},
        {"the rows may begin with a label, and the row of units may be short", KN_CURVE_SWEEP,
         "Filename\tx.tri\nVariables\tAngular Frequency\tStorage Modulus\tLoss Modulus\tStep\n\trad/s\tPa\tPa\n"
         "@10 Data\t6.28318530718-.628318530718\t10000-1000\t3000-300\t1\n",
         SWEPT, "'Loss Modulus' does not say whether it is of shear"},
        {"the columns of a testing machine, in English and German", KN_CURVE_RELAX,
         SIZE "\"Speed\",\"60\",\"mm/min\"\n\n\"Results Table 1\"\n\n\"Time\",\"Compressive extension\",\"Compressive "
              "load\"\n\"(s)\",\"(mm)\",\"(N)\"\n@8 1+1,1,1.6-.2\n",
         "a: 8 readings, 1..8 s, 1.44e+04..1800, strain 0.1 from 0 s", ""},
        {"", KN_CURVE_RELAX,
         SIZE "Pr\xc3\xbc"
              "fzeit;Standardweg;Standardkraft\ns;mm;N\n@8 1+1;1;1.6-.2\n",
         "a: 8 readings, 1..8 s, 1.44e+04..1800, strain 0.1 from 0 s", ""},
        {"repeated names with a leading tab begin the next interval", KN_CURVE_CREEP,
         "Interval data:\tPoint\tTime\tStrain\tStress\n\t\t[s]\t[%]\t[Pa]\n@20 \t1+1\t1+1\t1+1\t100\n\nResult:\t2\n"
         "Interval data:\tPoint\tTime\tStrain\tStress\n\t\t[s]\t[%]\t[Pa]\n@20 \t1+1\t1+1\t20-1\t0.01\n",
         "a: 40 readings, 1..40 s, 0.01..0.01, 100 Pa at 0 s, 0 Pa at 20.5 s, constant stress", "the present section"},
        {"a normal force beside a shear stress is not the load", KN_CURVE_CREEP,
         "Time [s];Shear Stress [Pa];Shear Strain [%];Normal Force [N]\n@9 1+1;20;1+1;.3\n",
         "a: 9 readings, 1..9 s, 0.005774..0.05196, 34.64 Pa at 0 s, constant stress", "of shear"},
        {"of several clocks, the one that begins with the load is used", KN_CURVE_CREEP,
         "# stress: 10 Pa\ntime [s];step time [s];point time [s];strain [1]\n@9 112+1;0+1;1;0+.01\n",
         "a: 9 readings, 0..8 s, 0..0.08, 10 Pa at 0 s", "of 3 clocks, 'step time' is used"},
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        char pattern[300];
        begin(all[i].text);
        const bool good = loads(all[i].kind) && !strcmp(contents(), all[i].outcome);
        snprintf(pattern, sizeof pattern, "*%s*", all[i].said);
        if (!good || fnmatch(pattern, kn_out, 0) != 0 || (!*all[i].said && kn_said("unit")))
            KN_TEST_FAIL("case %d, %s: %s\nexpected %s, %s\n%s%s", (int)i, all[i].sentence, contents(), all[i].outcome,
                         all[i].said, kn_out, kn_err);
    }
}

// --- creep

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

TEST("where time falls another interval begins: the recovery without load, or under the same load a refusal")
{
    for (int k = 1; k <= 30; k++) {
        begin(PRESSED "@20 0+1,0+.1\n");
        for (int i = 0; i < 20; i++) row("%d,%g\n", i * k, 0.01 * i);
        refused(KN_CURVE_CREEP, 26, "time falls");
        begin(SIZE "time_s,displacement_mm,load_gf\n");
        for (int i = 1; i <= 60; i++) row("%d,%.9g,50\n", i, crept_mm(i));
        for (int i = 1; i <= 60; i++) row("%d,%.9g,0\n", k * i, crept_mm(60 + k * i));
        CHECK(loads(KN_CURVE_CREEP) && curves == 1 && curve->count == 120 && curve->steps == 2);
        CHECK(kn_said("without load: read as the recovery, which begins at 60 s") && curve->time_s[119] == 60 + 60 * k);
    }
    begin(HELD "@20 0+1,20-1\n7,7\n");
    refused(KN_CURVE_RELAX, 23, "time falls");
}

TEST("notes in the file override the command-line options, and options replace missing notes")
{
    begin(PRESSED "@41 0+1,0+.01\n");
    options.load_n = 9;
    options.release_s = 5;
    CHECK(loads(KN_CURVE_CREEP) && curve->step[1].time_s == 20);
    CHECK_NEAR(curve->step[0].stress_pa, 4903.325, 1e-9);
    begin("time_s,displacement_mm\n@41 0+1,0+.01\n");
    options = (kn_curve_options){
        .subcommand = "identify creep", .load_n = 1, .area_m2 = 1e-3, .height_m = 0.02, .release_s = 5};
    CHECK(loads(KN_CURVE_CREEP) && curve->step[1].time_s == 5 && curve->step[0].stress_pa == 1000);
    CHECK_NEAR(curve->value[20], 0.01, 1e-9);
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

TEST("each missing, unusable or impossible quantity is refused in one line with its place and the remedy")
{
#define TWO "@9 0+1,1+1\n"
#define THREE "@9 1+1,1+1,1+1\n"
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
        {KN_CURVE_CREEP, "time_s,colour\n" TWO, 1,
         "strain or compliance, expected one, e.g. 'height_mm'; not known: 'colour'"},
        {KN_CURVE_CREEP, "instant_s,displacement_mm\n" TWO, 1, "no column of time"},
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
        {KN_CURVE_CREEP, PRESSED TWO, 2, "release of 20 s"},
        {KN_CURVE_RELAX, "# area: 2 cm^2\ntime_s;force_N\n1;1\n2;0.9\n3;0.8\n4;0.7\n5;0.6\n6;0.5\n7;0.4\n8;0.3\n", 2,
         "--strain"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa,loss_pa\n0,1,1\n" THREE, 2, "frequency of 0 Hz"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa,loss_pa\n0.5,1,-4\n" THREE, 2, "expected both above 0"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa,loss_pa\n0.5,0,1\n" THREE, 2, "expected both above 0"},
        {KN_CURVE_SWEEP, "f_hz,storage_pa\n" TWO, 1, "no column of storage and loss modulus"},
        {KN_CURVE_CREEP, SIZE "time_s\tx 10 gf [mm]\ty 20 gf [mm]\n@9 0+1\t0+.1\t0+.2\n@9 0+1\t0+.1\t0+.2\n", 13,
         "time falls"},
        {KN_CURVE_RELAX, "time_s,torque [mN m],deflection angle [mrad]\n" THREE, 1,
         "export shear stress and shear strain"},
        {KN_CURVE_RELAX, "time_s,shear strain [%],normal force [N]\n" THREE, 1, "'normal force' is no load of shear"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        begin(bad[i].text);
        refused(bad[i].kind, bad[i].line, bad[i].words);
    }
}

TEST("shear becomes compression with E = 2 (1 + nu) G, --compression keeps the numbers, and --column names a quantity")
{
#define SHEARED "# stress: 20 Pa\ntime [s],shear strain [%]\n@9 1+1,60+10\n"
    static const struct {
        kn_curve_kind kind;
        const char *text;
        bool shear, compression;
        double poisson;
        const char *roles, *outcome;
    } all[] = {
        {KN_CURVE_CREEP, SHEARED, 0, 0, 0, NULL,
         "a: 9 readings, 1..9 s, 0.3464..0.8083, 34.64 Pa at 0 s, constant stress"},
        {KN_CURVE_CREEP, SHEARED, 0, 0, 0.25, NULL,
         "a: 9 readings, 1..9 s, 0.4157..0.9699, 34.64 Pa at 0 s, constant stress"},
        {KN_CURVE_CREEP, "Time [s]\tJ [1/Pa]\n@10 0+1\t0+.003\n", 1, 0, 0, NULL,
         "a: 10 readings, 0..9 s, 0..0.009, 1 Pa at 0 s, constant stress"},
        {KN_CURVE_RELAX, "Time [s]\tShear Relaxation Modulus [Pa]\n@8 1+1\t8-1\n", 0, 0, 0, NULL,
         "a: 8 readings, 1..8 s, 24..3, strain 0 from 0 s, constant stress"},
        {KN_CURVE_RELAX, "Time [s]\tShear Relaxation Modulus [Pa]\n@8 1+1\t8-1\n", 0, 1, 0, NULL,
         "a: 8 readings, 1..8 s, 8..1, strain 0 from 0 s"},
        {KN_CURVE_SWEEP, "f [Hz],G' [Pa],G\" [Pa]\n@10 1-.1,10000-1000,3000-300\n", 1, 0, 0, NULL,
         "a: 10 readings, 0.1..1 s, 3000..3e+04, loss 900..9000, constant stress"},
        {KN_CURVE_CREEP, LOAD SIZE "time_s,x\n@9 0+1,0+.01\n", 0, 0, 0, "x=strain", STRAINED},
        {KN_CURVE_CREEP, LOAD SIZE "time_s,strain [%],x [mm]\n@9 0+1,7,0+.1\n", 0, 0, 0, "strain=phase,x=displacement",
         STRAINED},
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        begin(all[i].text);
        options.shear = all[i].shear;
        options.compression = all[i].compression;
        options.poisson = all[i].poisson;
        options.roles = all[i].roles;
        if (!loads(all[i].kind) || strcmp(contents(), all[i].outcome) != 0)
            KN_TEST_FAIL("case %d: %s, expected %s\n%s%s", (int)i, contents(), all[i].outcome, kn_out, kn_err);
    }
    begin(SHEARED);
    options.compression = true;
    refused(KN_CURVE_CREEP, 7, "more than the whole height");
    begin(LOAD SIZE "time_s,x\n@9 0+1,0+.01\n");
    options.roles = "y=strain";
    refused(KN_CURVE_CREEP, 4, "no column 'y'");
}

TEST("a file beyond the 32nd curve is refused, and the curves before stay")
{
    int code = KN_EXIT_OK;
    begin(PRESSED "@41 0+1,0+.01\n");
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

// --- sweeps

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
