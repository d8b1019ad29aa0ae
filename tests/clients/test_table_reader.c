// Tables in the formats of instruments and spreadsheets.
#include "clients/identify/table_reader.h"
#include "clients/cli/commands.h"
#include "tests/clients/heard.h"
#include <fnmatch.h>

static kn_table_reader s;

// Open a file and read its first `columns` columns.
static int read_file(const char *file, const char *units, int columns)
{
    kn_table_reader_close(&s);
    kn_hear();
    int code = kn_table_reader_open(&s, file, units, NULL, "identify creep");
    if (code == KN_EXIT_OK && s.columns < columns) code = KN_EXIT_INTERNAL;
    if (code == KN_EXIT_OK) code = kn_table_reader_read(&s, columns, (int[]){0, 1, 2, 3});
    kn_hear_end();
    return code;
}

static int read_bytes(const void *bytes, size_t size)
{
    kn_write("a.csv", bytes, size);
    return read_file("a.csv", NULL, 2);
}

static double at(int column, int row) { return row < s.rows ? s.column[column].value[row] : -999; }

// Return the words of the columns that were read, then each row with its line in the file.
static const char *contents(int columns)
{
    static char text[1000];
    int n = 0;
    for (int k = 0; k < columns; k++)
        n += snprintf(text + n, sizeof text - (size_t)n, &", %s"[k ? 0 : 2], s.column[k].heading.word);
    for (int i = 0; i < s.rows && n < 900; i++) {
        n += snprintf(text + n, sizeof text - (size_t)n, " | %d:", s.line[i]);
        for (int k = 0; k < columns; k++) n += snprintf(text + n, sizeof text - (size_t)n, " %.15g", at(k, i));
    }
    return text;
}

// ---- headings

TEST("a heading has its unit after an underscore, in brackets, or after a slash, a comma or a blank; loads and other "
     "text in brackets belong to the name")
{
    static const struct {
        const char *text, *word, *unit;
        double si_of_5;
    } all[] = {{"time_s", "time", "s", 5},
               {"Time (s)", "time", "s", 5},
               {"Time [s]", "time", "s", 5},
               {"t / s", "t", "s", 5},
               {"Time, s", "time", "s", 5},
               {"  Strain %", "strain", "%", 0.05},
               {"height_mm", "height", "mm", 0.005},
               {"Relaxation Modulus [Pa]", "relaxation modulus", "Pa", 5},
               {"G' (kPa)", "g'", "kPa", 5000},
               {"G\" [Pa]", "g''", "Pa", 5},
               {"G\xe2\x80\xb3/kPa", "g''", "kPa", 5000},
               {"freq. [Hz]", "freq", "Hz", 5},
               {"\xcf\x89 [rad/s]", "omega", "rad/s", 5},
               {"load (gf)", "load", "gf", 5 * 9.80665 / 1000},
               {"Time (min)", "time", "min", 300},
               {"displacement [\xc2\xb5m]", "displacement", "\xc2\xb5m", 5e-6},
               {"displacement [\xce\xbcm]", "displacement", "\xce\xbcm", 5e-6},
               {"stress_pa", "stress", "Pa", 5}, // in small letters after an underscore
               {"load_n", "load", "N", 5},
               {"stress_mpa", "stress", "MPa", 5e6},
               {"omega_rad_s", "omega", "rad/s", 5}, // two units form a quotient
               {"compliance_per_pa", "compliance", "1/Pa", 5},
               {"frequency_hz", "frequency", "Hz", 5},
               {"displacement_mm 10 gf", "displacement 10 gf", "mm", 0.005},
               {"10 gf [mm]", "10 gf", "mm", 0.005},
               {"10 gf", "10 gf", "", 0},
               {"G(t) [Pa]", "g(t)", "Pa", 5},
               {"J(t)", "j(t)", "", 0},
               {"Time [s] (step)", "time (step)", "s", 5}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        kn_heading h;
        kn_heading_read(&h, all[i].text);
        CHECK_STR(h.word, all[i].word);
        CHECK_STR(h.unit_text, all[i].unit);
        CHECK(!*all[i].unit || (h.has_unit && kn_column_unit_si(&h.unit, 5) == all[i].si_of_5));
    }
}

TEST("a unit in another spelling has the same factor, and an unknown unit is refused")
{
    static const char *const text[] = {
        "cm2",     "cm\xc2\xb2", "cm^2", "mPa", "Pa.s", "Pa\xc2\xb7s",           "gf/cm2", "h",
        "percent", "-",          "1",    "bar", "kN",   "s\xe2\x81\xbb\xc2\xb9", "GPa"};
    static const double si[] = {1e-4, 1e-4, 1e-4, 1e-3, 1, 1, 98.0665, 3600, 0.01, 1, 1, 1e5, 1e3, 1, 1e9};
    kn_column_unit m;
    for (size_t i = 0; i < sizeof si / sizeof *si; i++) {
        CHECK(kn_column_unit_parse(&m, text[i], NULL, 0));
        CHECK_NEAR(kn_column_unit_si(&m, 1) / si[i], 1, 1e-15);
    }
    CHECK(!kn_column_unit_parse(&m, "furlong", NULL, 0));
}

TEST("a quantity in a note needs a unit, a mass counts as a weight, and a share may be a bare number")
{
    static const struct {
        const char *text, *unit;
        double si; // NAN: refused
    } all[] = {{"50 gf", "N", 0.4903325}, {"50 g", "N", 0.4903325}, {"0,5 cm", "m", 0.005},
               {"10 %", "1", 0.1},        {"0.1", "1", 0.1},        {"50", "N", NAN},
               {"50 mm", "N", NAN},       {"heavy", "N", NAN},      {"1e999 N", "N", NAN}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        double value = 0;
        char error[120] = "";
        const bool good = kn_heading_quantity(all[i].text, all[i].unit, &value, error, sizeof error);
        CHECK(good ? fabs(value - all[i].si) < 1e-12 : isnan(all[i].si));
        CHECK(strcmp(all[i].text, "50") != 0 || strstr(error, "no unit"));
    }
}

// ---- separators, marks, encodings, the position of the table, cells

#define SAME "time, height | 2: 0 0.01 | 3: 1.5 0.0095" // the readings of the first tables

TEST("tables in the formats of instruments and spreadsheets are read, and others are refused in one line")
{
    static const struct {
        const char *sentence, *text, *outcome; // outcome: the contents, or a pattern of the message
    } all[] = {
        {"commas, semicolons, tabs and blanks separate columns in the line of names and in the rows",
         "time_s,height_mm\n0,10\n1.5,9.5\n", SAME},
        {"", "time_s;height_mm\n0;10\n1.5;9.5\n", SAME},
        {"", "time_s\theight_mm\n0\t10\n1.5\t9.5\n", SAME},
        {"", "time_s height_mm\n0 10\n  1.5   9.5\n", SAME},
        {"", "Time (s)  Height (mm)\n0 10\n1.5 9.5\n", SAME},
        {"", "Time, s\tHeight, mm\n0\t10\n1.5\t9.5\n", SAME},
        {"a comma in a number is a decimal mark if the separator is another character or the number is quoted",
         "time_s;height_mm\n0,5;9,75\n1;1,5e1\n", "time, height | 2: 0.5 0.00975 | 3: 1 0.015"},
        {"", "time_s,height_mm\n\"0,5\",\"9,75\"\n", "time, height | 2: 0.5 0.00975"},
        {"two decimal marks in one file and thousands separators are refused with line and column",
         "time_s;height_mm\n0.5;9\n1,5;8\n", "a.csv:3:1: *decimal*"},
        {"", "time_s;stress_pa\n1;1.234,5\n", "a.csv:2:3: '1.234,5'*thousands*"},
        {"BOM, CR LF, lone CR, quotes, trailing separators and blank lines do not change the readings",
         "\xef\xbb\xbftime_s,height_mm\r\n0,10\r\n1.5,9.5\r\n\r\n", SAME},
        {"", "time_s,height_mm\r0,10\r1.5,9.5\r", SAME},
        {"", "\"time_s\",\"height_mm\"\n\"0\",\"10\"\n\n1.5,9.5", "time, height | 2: 0 0.01 | 4: 1.5 0.0095"},
        {"", "time_s,height_mm,\n0,10,\n1.5,9.5,\n,,\n", SAME},
        {"", "time_s,height_mm\n 0 , 10 \n\t1.5,9.5\n", SAME},
        {"a doubled quote inside quotes is read as one quote", "\"freq. [Hz]\",\"G' [Pa]\",\"G\"\" [Pa]\"\n1,2,3\n",
         "freq, g', g'' | 2: 1 2 3"},
        {"units may stand in a row of their own, with or without brackets", "Time;Height;Force\ns;mm;mN\n0;10;1\n",
         "time, height, force | 3: 0 0.01 0.001"},
        {"",
         "Amplitude sweep - 1\nStorage modulus\tTan(delta)\tTemp\n[kPa]\t\t[\xc2\xb0"
         "C]\n2\t0.1\t25\n",
         "storage modulus, tan(delta) | 4: 2000 0.1"},
        {"a leading tab is an empty cell, and a blank row may stand above the units",
         "Test:\tHold\n\nInterval data:\tTime\tHeight\tStatus\n\t\t\t\n\t[s]\t[mm]\t\n\t0\t10\tM\n\t1.5\t9.5\tM\n",
         "interval data, time, height | 6: nan 0 0.01 | 7: nan 1.5 0.0095"},
        {"rows that are all shorter than the line of names are refused", "point\ttime_s\theight_mm\n0\t10\n1\t9\n",
         "a.csv:2:1: no row has more than 2 cells below 3 names*shifted*"},
        {"a row of units in brackets may hold unknown ones; a unit may follow the word in, and stand before the name",
         "omega;eta;G';G''\n[rad/s];[mPa s];[Pa];[Pa]\n1;2;3;4\n", "omega, eta, g' | 3: 1 2 3"},
        {"", "t in s;Weg in mm;% strain\n1;2;3\n", "t, weg, strain | 2: 1 0.002 0.03"},
        {"a factor in a name is no part of a known unit", "time_s;Stress (x10^3) [Pa]\n1;2\n", "time, stress | 2: 1 2"},
        {"where blanks separate, a row with a cell too few is refused", "time_s height_mm x\n0 10 1\n1 9\n",
         "a.csv:3:1: 2 cells below 3 names*write nan*"},
        {"rows of statistics are left out", "n;time_s;height_mm\n1;0;10\n2;1;9\nMean;0.5;9.5\nStd. dev.;0.7;0.7\n",
         "n, time, height | 2: 1 0 0.01 | 3: 2 1 0.009"},
        {"commas, or points between semicolons, that all stand before three digits may separate thousands: refused",
         "time_s;stress_pa\n1;254,000\n2;12,500\n", "a.csv:2:1: every comma stands before three digits*"},
        {"", "time_s;stress_pa\n1;254.000\n2;12.500\n", "a.csv:2:1: every point stands before three digits*"},
        {"", "time_s;stress_pa\n0,500;254,000\n", "time, stress | 2: 0.5 254"},
        {"a second table with other columns or units is refused",
         "time_s;height_mm;x;y\n0;10;1;2\ntime_s;height_mm;y;x\n1;9;1;2\n",
         "a.csv:3:1: a second table with other columns*"},
        {"", "Time;Height\ns;mm\n0;10\nTime;Height\ns;cm\n2;8\n",
         "a.csv:5:1: a second table with other columns or units*"},
        {"any lines before the table are skipped",
         "sep=;\nProject;Dough\nDiameter;25\nDate;2026-11-22\n\nTime [s];Height [mm]\n0;10\n1;9\n",
         "time, height | 7: 0 0.01 | 8: 1 0.009"},
        {"the names may stand in a comment line, as numpy writes them",
         "# creep of dough: the third\n# time_s height_mm\n0 10\n1 9\n", "time, height | 3: 0 0.01 | 4: 1 0.009"},
        {"a repeated line of names and its units are skipped", "Time;Height\ns;mm\n0;10\n1;9\nTime;Height\ns;mm\n2;8\n",
         "time, height | 3: 0 0.01 | 4: 1 0.009 | 7: 2 0.008"},
        {"text between two intervals is skipped if the same names follow; otherwise it is refused",
         "Time;Height;Status\ns;mm;[]\n0;10;M\n1;9;M\n\nInterval;2\nResult: "
         "again\nTime;Height;Status\ns;mm;[]\n2;8;M\n",
         "time, height | 3: 0 0.01 | 4: 1 0.009 | 10: 2 0.008"},
        {"", "Time\tHeight\ns\tmm\n0\t10\n1\t9\n[step]\nPeak hold - 2\nTime\tViscosity\ns\tPa.s\n2\t8\n",
         "a.csv:5:1: '\\[step]' and more text*expected one table in a file*"},
        {"", "time_s,height_mm\n0,10\nend of it\n", "a.csv:3:1: 'end of it' for time*"},
        {"names separated by tabs may stand above numbers separated by blanks",
         "T=0;Mw=13.5;chem=PI;\nw\tG'\tTemp\nrad/s\tPa\t\xc2\xb0"
         "C\n   100    1988.3    0.1\n   68.1   910.8   0.1\n",
         "w, g' | 4: 100 1988.3 | 5: 68.1 910.8"},
        {"an unused column may hold any text", "time_s,height_mm,status\n0,10,M-\n1,9,\"a, b\"\n",
         "time, height | 2: 0 0.01 | 3: 1 0.009"},
        {"an empty cell, nan, NaN, #N/A, - and a short row are missing readings",
         "time_s,height_mm\n0,10\n1,\n2,nan\n3,NaN\n4,#N/A\n5,-\n6\n",
         "time, height | 2: 0 0.01 | 3: 1 nan | 4: 2 nan | 5: 3 nan | 6: 4 nan | 7: 5 nan | 8: 6 nan"},
        {"any other text in a cell is refused with line, column and name", "time_s,height_mm\n0,10\n1,ten\n",
         "a.csv:3:3: 'ten' for height, expected a number*"},
        {"", "time_s,height_mm\n0,1O\n1,10\n2,9\n", "a.csv:2:3: '1O'*"},
        {"", "time_s,height_mm\n0,10\n1,inf\n", "a.csv:3:3: 'inf'*"},
        {"", "time_s,height_mm\n0,10\n1,1e999\n", "a.csv:3:3: '1e999'*"},
        {"", "time_s,height_mm\n0,10\n1,0x10\n", "a.csv:3:3: '0x10'*"},
        {"a row with more cells than names is refused, with a hint at decimal commas",
         "time_s,height_mm\n0,10\n0,5,9\n", "a.csv:3:5: more cells than the 2 names*decimal commas?*"},
        {"a file without a table is refused", "", "*is empty*"},
        {"", "1,2\n3,4\n", "a.csv:1:1: no table*expected a line of names*"},
        {"", "time_s,height_mm\n", "a.csv:1:1: names without numbers*"},
        {"", "time_s,height_mm,c\n,,1\n,,2\n", "a.csv:1:1: no numbers below the name time*"},
        {"", "one\ntwo\n", "a.csv:1:1: no table*"},
    };
    const char *sentence = NULL;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        const int columns = strstr(all[i].outcome, " | ") && strchr(strchr(all[i].outcome, ',') + 1, ',') ? 3 : 2;
        if (*all[i].sentence) sentence = all[i].sentence;
        kn_write("a.csv", all[i].text, strlen(all[i].text));
        const int code = read_file("a.csv", NULL, columns);
        const char *outcome = code == KN_EXIT_OK ? contents(columns) : kn_err;
        if (fnmatch(all[i].outcome, outcome, 0) != 0 ||
            (code != KN_EXIT_OK && !(code == KN_EXIT_USAGE && kn_refused("") && !*kn_out)))
            KN_TEST_FAIL("%s: exit %d, %s\nexpected %s", sentence, code, outcome, all[i].outcome);
    }
}

TEST("--units gives units to columns without one, and a wrong --units is refused")
{
    static const char text[] = "Time\tRelaxation Modulus\n0\t10\n1\t9\n";
    kn_write("a.csv", text, sizeof text - 1);
    CHECK(read_file("a.csv", "time=min,modulus=kPa", 2) == KN_EXIT_OK);
    CHECK_STR(contents(2), "time, relaxation modulus | 2: 0 10000 | 3: 60 9000");
    CHECK(read_file("a.csv", "time=min,height=mm", 2) == KN_EXIT_USAGE && kn_refused("a.csv:1:1: no column 'height'"));
    CHECK(read_file("a.csv", "time=parsec", 2) == KN_EXIT_USAGE && kn_refused("parsec"));
    CHECK(read_file("a.csv", "time", 2) == KN_EXIT_USAGE && kn_refused("time=s"));
}

TEST("UTF-16 is read in both byte orders")
{
    const char *text = "time_s\theight_mm\n0\t10\n1,5\t9,5\n";
    char wide[200];
    size_t n = strlen(text);
    for (int big = 0; big < 2; big++) {
        memcpy(wide, big ? "\xfe\xff" : "\xff\xfe", 2);
        for (size_t i = 0; i < n; i++) {
            wide[2 + 2 * i + (size_t)!big] = 0;
            wide[2 + 2 * i + (size_t)big] = text[i];
        }
        CHECK(read_bytes(wide, 2 + 2 * n) == KN_EXIT_OK);
        CHECK_STR(contents(2), SAME);
    }
}

TEST("notes are read above, within and below the table, unknown notes are ignored, and a wrong unit is refused")
{
    static const char text[] =
        "# load: 50 gf\n# Height = 1 cm\n# measured by: somebody: else\n"
        "# this is a sentence that says: nothing\ntime_s,strain\n0,0\n# release: 1 min;;\n1,0.1\n";
    double load = -1, release = -1, height = -1;
    CHECK(read_bytes(text, sizeof text - 1) == KN_EXIT_OK && s.rows == 2);
    CHECK(kn_table_reader_note(&s, "load", "N", &load) == KN_EXIT_OK && fabs(load - 0.4903325) < 1e-12);
    CHECK(kn_table_reader_note(&s, "height", "m", &height) == KN_EXIT_OK && height == 0.01);
    CHECK(kn_table_reader_note(&s, "release", "s", &release) == KN_EXIT_OK && release == 60);
    CHECK(kn_table_reader_note(&s, "area", "m^2", &load) == KN_EXIT_OK && fabs(load - 0.4903325) < 1e-12);
    kn_hear();
    const int code = kn_table_reader_note(&s, "load", "m", &load);
    kn_hear_end();
    CHECK(code == KN_EXIT_USAGE && kn_refused("a.csv:1:9: load: "));
}

TEST("a long line, a zero byte, more than 128 columns, a missing file and a folder are refused")
{
    static char text[3000000] = "time_s,height_mm\n0,1\n1,";
    const size_t n = strlen(text);
    memset(text + n, '1', sizeof text - n);
    CHECK(read_bytes(text, n + 70000) == KN_EXIT_USAGE && kn_refused("a.csv:3:1: a line of more"));
    CHECK(read_bytes(text + n, sizeof text - n) == KN_EXIT_USAGE && kn_refused("a.csv:1:1: a line of more than"));
    CHECK(read_bytes("a\0b", 3) == KN_EXIT_USAGE && kn_refused("a.csv:1:1: a byte 0"));
    CHECK(read_bytes("time_s,height_mm\n0,1\n1,\0\n", 25) == KN_EXIT_USAGE && kn_refused("a.csv:3:1: a byte 0"));
    for (int i = 0; i < 400; i += 2) memcpy(text + i, "a,", 2);
    memcpy(text + 400, "\n1,1\n", 5);
    CHECK(read_bytes(text, 405) == KN_EXIT_USAGE && kn_refused("a.csv:1:1: more than 128 columns"));
    CHECK(read_file("/nowhere/at/all.csv", NULL, 2) == KN_EXIT_USAGE);
    CHECK_STR(kn_err, "knead identify creep: /nowhere/at/all.csv: No such file or directory\n");
    CHECK(read_file("/tmp", NULL, 2) == KN_EXIT_USAGE);
    CHECK_STR(kn_err, "knead identify creep: /tmp: is a folder, expected a file\n");
}

TEST("a file larger than the read buffer keeps its values and line numbers")
{
    static char text[4000000];
    int n = snprintf(text, sizeof text, "time_s,height_mm\n");
    for (int i = 0; i < 200000; i++) n += snprintf(text + n, sizeof text - (size_t)n, "%d,%d.5\r\n", i, i % 100);
    CHECK(read_bytes(text, (size_t)n) == KN_EXIT_OK && s.rows == 200000);
    bool same = true;
    for (int i = 0; i < s.rows; i++) same &= at(0, i) == i && at(1, i) == (i % 100 + 0.5) / 1000 && s.line[i] == i + 2;
    CHECK(same);
    kn_table_reader_close(&s);
}

TESTS_MAIN
