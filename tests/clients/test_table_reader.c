// Tables in the formats of instruments and spreadsheets.
#include "clients/identify/table_reader.h"
#include "clients/cli/commands.h"
#include "tests/check.h"
#include "tests/clients/heard.h"
#include <sys/stat.h>

static kn_table_reader s;

// Open a text and read its first `columns` columns.
static int read_bytes(const void *text, size_t size, const char *units, int columns)
{
    int wanted[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    kn_table_reader_close(&s);
    kn_hear();
    int code = kn_table_reader_open(&s, kn_write(text, size), units, "identify creep");
    if (code == KN_EXIT_OK && s.columns < columns) code = KN_EXIT_INTERNAL;
    if (code == KN_EXIT_OK) code = kn_table_reader_read(&s, columns, wanted);
    kn_hear_end();
    return code;
}

static int read_text(const char *text, int columns) { return read_bytes(text, strlen(text), NULL, columns); }

static double at(int column, int row) { return row < s.rows ? s.column[column].value[row] : -999; }

// Return whether the message is one line that begins with the file and this place, and contains these words.
static bool complained(const char *place, const char *words)
{
    char begin[200];
    snprintf(begin, sizeof begin, "%s%s", kn_written, place);
    const char *end = strchr(kn_heard, '\n');
    return !strncmp(kn_heard, begin, strlen(begin)) && strstr(kn_heard, words) && end && !end[1];
}

static void heading(const char *text, const char *word, const char *unit, double si_of_5)
{
    kn_heading h;
    kn_heading_read(&h, text);
    CHECK_STR(h.word, word);
    CHECK_STR(h.unit_text, unit);
    if (*unit) CHECK(h.has_unit && kn_column_unit_si(&h.unit, 5) == si_of_5);
}

// ---- headings

TEST("a heading has its unit after an underscore, in brackets, or after a slash, a comma or a blank")
{
    heading("time_s", "time", "s", 5);
    heading("Time (s)", "time", "s", 5);
    heading("Time [s]", "time", "s", 5);
    heading("t / s", "t", "s", 5);
    heading("Time, s", "time", "s", 5);
    heading("  Strain %", "strain", "%", 0.05);
    heading("height_mm", "height", "mm", 0.005);
    heading("Relaxation Modulus [Pa]", "relaxation modulus", "Pa", 5);
    heading("G' (kPa)", "g'", "kPa", 5000);
    heading("G\" [Pa]", "g''", "Pa", 5);
    heading("G\xe2\x80\xb3/kPa", "g''", "kPa", 5000);
    heading("freq. [Hz]", "freq", "Hz", 5);
    heading("\xcf\x89 [rad/s]", "omega", "rad/s", 5);
    heading("load (gf)", "load", "gf", 5 * 9.80665 / 1000);
    heading("Time (min)", "time", "min", 300);
    heading("displacement [\xc2\xb5m]", "displacement", "\xc2\xb5m", 5e-6);
    heading("displacement [\xce\xbcm]", "displacement", "\xce\xbcm", 5e-6);
}

TEST("after an underscore a unit may be in small letters, and two units form a quotient")
{
    heading("stress_pa", "stress", "Pa", 5);
    heading("load_n", "load", "N", 5);
    heading("stress_mpa", "stress", "MPa", 5e6);
    heading("omega_rad_s", "omega", "rad/s", 5);
    heading("compliance_per_pa", "compliance", "1/Pa", 5);
    heading("frequency_hz", "frequency", "Hz", 5);
}

TEST("a load in a heading is not taken for its unit")
{
    heading("displacement_mm 10 gf", "displacement 10 gf", "mm", 0.005);
    heading("10 gf [mm]", "10 gf", "mm", 0.005);
    heading("10 gf", "10 gf", "", 0);
}

TEST("text in brackets that is no unit belongs to the name")
{
    heading("G(t) [Pa]", "g(t)", "Pa", 5);
    heading("J(t)", "j(t)", "", 0);
    heading("Time [s] (step)", "time (step)", "s", 5);
}

TEST("a unit in another spelling has the same factor, and an unknown unit is refused")
{
    static const struct {
        const char *text;
        double si;
    } all[] = {{"cm2", 1e-4},
               {"cm\xc2\xb2", 1e-4},
               {"cm^2", 1e-4},
               {"mPa", 1e-3},
               {"Pa.s", 1},
               {"Pa\xc2\xb7s", 1},
               {"gf/cm2", 98.0665},
               {"h", 3600},
               {"percent", 0.01},
               {"-", 1},
               {"1", 1},
               {"bar", 1e5},
               {"s\xe2\x81\xbb\xc2\xb9", 1},
               {"kN", 1e3},
               {"GPa", 1e9}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        kn_column_unit m;
        CHECK(kn_column_unit_parse(&m, all[i].text, NULL, 0));
        CHECK_NEAR(kn_column_unit_si(&m, 1) / all[i].si, 1, 1e-15);
    }
    CHECK(!kn_column_unit_parse(&(kn_column_unit){0}, "furlong", NULL, 0));
}

TEST("a quantity in a note needs a unit, a mass counts as a weight, and a share may be a bare number")
{
    double value;
    char error[120];
    CHECK(kn_heading_quantity("50 gf", "N", &value, error, sizeof error) && fabs(value - 0.4903325) < 1e-12);
    CHECK(kn_heading_quantity("50 g", "N", &value, error, sizeof error) && fabs(value - 0.4903325) < 1e-12);
    CHECK(kn_heading_quantity("0,5 cm", "m", &value, error, sizeof error) && value == 0.005);
    CHECK(kn_heading_quantity("10 %", "1", &value, error, sizeof error) && value == 0.1);
    CHECK(kn_heading_quantity("0.1", "1", &value, error, sizeof error) && value == 0.1);
    CHECK(!kn_heading_quantity("50", "N", &value, error, sizeof error) && strstr(error, "no unit"));
    CHECK(!kn_heading_quantity("50 mm", "N", &value, error, sizeof error));
    CHECK(!kn_heading_quantity("heavy", "N", &value, error, sizeof error));
    CHECK(!kn_heading_quantity("1e999 N", "N", &value, error, sizeof error));
}

// ---- separators, marks, encodings

TEST("commas, semicolons, tabs and blanks separate columns in the line of names and in the rows")
{
    static const char *const texts[] = {
        "time_s,height_mm\n0,10\n1.5,9.5\n",      "time_s;height_mm\n0;10\n1.5;9.5\n",
        "time_s\theight_mm\n0\t10\n1.5\t9.5\n",   "time_s height_mm\n0 10\n  1.5   9.5\n",
        "Time (s)  Height (mm)\n0 10\n1.5 9.5\n", "Time, s\tHeight, mm\n0\t10\n1.5\t9.5\n"};
    for (int i = 0; i < 6; i++) {
        CHECK(read_text(texts[i], 2) == KN_EXIT_OK);
        CHECK(s.rows == 2 && s.columns == 2);
        CHECK(at(0, 1) == 1.5 && at(1, 0) == 0.01 && at(1, 1) == 0.0095);
    }
}

TEST("a comma in a number is a decimal mark if the separator is another character or the number is quoted")
{
    CHECK(read_text("time_s;height_mm\n0,5;9,75\n1;1,5e1\n", 2) == KN_EXIT_OK);
    CHECK(s.commas && at(0, 0) == 0.5 && at(1, 0) == 0.00975 && at(1, 1) == 0.015);
    CHECK(read_text("time_s,height_mm\n\"0,5\",\"9,75\"\n", 2) == KN_EXIT_OK);
    CHECK(s.commas && at(0, 0) == 0.5 && at(1, 0) == 0.00975);
}

TEST("two decimal marks in one file and thousands separators are refused with line and column")
{
    CHECK(read_text("time_s;height_mm\n0.5;9\n1,5;8\n", 2) == KN_EXIT_USAGE && complained(":3:1: ", "decimal"));
    CHECK(read_text("time_s;stress_pa\n1;1.234,5\n", 2) == KN_EXIT_USAGE && complained(":2:3: '1.234,5'", "thousands"));
}

TEST("BOM, CR LF, lone CR, quotes, trailing separators and blank lines do not change the readings")
{
    static const char *const texts[] = {
        "\xef\xbb\xbftime_s,height_mm\r\n0,10\r\n\r\n1.5,9.5\r\n", "time_s,height_mm\r0,10\r1.5,9.5\r",
        "\"time_s\",\"height_mm\"\n\"0\",\"10\"\n\n1.5,9.5", "time_s,height_mm,\n0,10,\n1.5,9.5,\n,,\n",
        "time_s,height_mm\n 0 , 10 \n\t1.5,9.5\n"};
    for (int i = 0; i < 5; i++) {
        CHECK(read_text(texts[i], 2) == KN_EXIT_OK);
        CHECK(s.rows == 2 && at(0, 1) == 1.5 && at(1, 0) == 0.01 && at(1, 1) == 0.0095);
    }
}

TEST("UTF-16 is read in both byte orders")
{
    const char *text = "time_s\theight_mm\n0\t10\n1,5\t9,5\n";
    unsigned char wide[2][200];
    size_t n = strlen(text);
    for (int big = 0; big < 2; big++) {
        memcpy(wide[big], big ? "\xfe\xff" : "\xff\xfe", 2);
        for (size_t i = 0; i < n; i++) {
            wide[big][2 + 2 * i + (size_t)!big] = 0;
            wide[big][2 + 2 * i + (size_t)big] = (unsigned char)text[i];
        }
        CHECK(read_bytes(wide[big], 2 + 2 * n, NULL, 2) == KN_EXIT_OK);
        CHECK(s.rows == 2 && at(0, 1) == 1.5 && at(1, 1) == 0.0095);
    }
}

TEST("a doubled quote inside quotes is read as one quote")
{
    CHECK(read_text("\"freq. [Hz]\",\"G' [Pa]\",\"G\"\" [Pa]\"\n1,2,3\n", 3) == KN_EXIT_OK);
    CHECK_STR(s.column[2].heading.word, "g''");
    CHECK(at(2, 0) == 3);
}

// ---- position of the table

TEST("units may stand in a row of their own, with or without brackets")
{
    CHECK(read_text("Time;Height;Force\ns;mm;mN\n0;10;1\n", 3) == KN_EXIT_OK);
    CHECK(s.rows == 1 && at(1, 0) == 0.01 && at(2, 0) == 0.001 && s.header_line == 1);
    CHECK(read_text("Amplitude sweep - 1\nStorage modulus\tTan(delta)\tTemp\n[kPa]\t\t[\xc2\xb0"
                    "C]\n2\t0.1\t25\n",
                    2) == KN_EXIT_OK);
    CHECK(s.rows == 1 && at(0, 0) == 2000 && at(1, 0) == 0.1 && s.header_line == 2);
}

TEST("any lines before the table are skipped")
{
    CHECK(read_text("sep=;\nProject;Dough\nDiameter;25\nDate;2026-11-22\n\nTime [s];Height [mm]\n0;10\n1;9\n", 2) ==
          KN_EXIT_OK);
    CHECK(s.rows == 2 && s.header_line == 6 && s.line[0] == 7);
}

TEST("the names may stand in a comment line, as numpy writes them")
{
    CHECK(read_text("# creep of dough: the third\n# time_s height_mm\n0 10\n1 9\n", 2) == KN_EXIT_OK);
    CHECK(s.rows == 2 && at(1, 1) == 0.009);
    CHECK_STR(s.column[0].heading.word, "time");
}

TEST("a repeated line of names and its units are skipped")
{
    CHECK(read_text("Time;Height\ns;mm\n0;10\n1;9\nTime;Height\ns;mm\n2;8\n", 2) == KN_EXIT_OK);
    CHECK(s.rows == 3 && at(0, 2) == 2 && s.line[2] == 7);
}

TEST("text between two intervals is skipped if the same names follow; otherwise it is refused")
{
    CHECK(read_text("Time;Height;Status\ns;mm;[]\n0;10;M\n1;9;M\n\nInterval;2\nResult: again\nTime;Height;Status\n"
                    "[s];[mm];[]\n2;8;M\n",
                    2) == KN_EXIT_OK);
    CHECK(s.rows == 3 && at(0, 2) == 2 && s.line[2] == 10);
    CHECK(read_text("Time\tHeight\ns\tmm\n0\t10\n1\t9\n[step]\nPeak hold - 2\nTime\tViscosity\ns\tPa.s\n2\t8\n", 2) ==
          KN_EXIT_USAGE);
    CHECK(complained(":5:1: '[step]' and more text", "expected one table in a file"));
    CHECK(read_text("time_s,height_mm\n0,10\nend of it\n", 2) == KN_EXIT_USAGE &&
          complained(":3:1: 'end of it' for time", ""));
}

TEST("names separated by tabs may stand above numbers separated by blanks")
{
    CHECK(read_text("T=0;Mw=13.5;chem=PI;\nw\tG'\tTemp\nrad/s\tPa\t\xc2\xb0"
                    "C\n   100    1988.3    0.1\n   68.1   910.8   0.1\n",
                    2) == KN_EXIT_OK);
    CHECK(s.rows == 2 && at(0, 0) == 100 && at(1, 1) == 910.8);
}

TEST("an unused column may hold any text")
{
    CHECK(read_text("time_s,height_mm,status\n0,10,M-\n1,9,\"a, b\"\n", 2) == KN_EXIT_OK);
    CHECK(s.rows == 2 && at(1, 1) == 0.009);
}

// ---- cells

TEST("an empty cell, nan, NaN, #N/A, - and a short row are missing readings")
{
    CHECK(read_text("time_s,height_mm\n0,10\n1,\n2,nan\n3,NaN\n4,#N/A\n5,-\n6\n", 2) == KN_EXIT_OK);
    CHECK(s.rows == 7 && at(1, 0) == 0.01);
    for (int i = 1; i < 7; i++) CHECK(at(0, i) == i && isnan(at(1, i)));
}

TEST("any other text in a cell is refused with line, column and name")
{
    CHECK(read_text("time_s,height_mm\n0,10\n1,ten\n", 2) == KN_EXIT_USAGE);
    CHECK(complained(":3:3: 'ten' for height, expected a number", ""));
    CHECK(read_text("time_s,height_mm\n0,1O\n1,10\n2,9\n", 2) == KN_EXIT_USAGE && complained(":2:3: '1O'", ""));
    CHECK(read_text("time_s,height_mm\n0,10\n1,inf\n", 2) == KN_EXIT_USAGE && complained(":3:3: 'inf'", ""));
    CHECK(read_text("time_s,height_mm\n0,10\n1,1e999\n", 2) == KN_EXIT_USAGE && complained(":3:3: '1e999'", ""));
    CHECK(read_text("time_s,height_mm\n0,10\n1,0x10\n", 2) == KN_EXIT_USAGE && complained(":3:3: '0x10'", ""));
}

TEST("a row with more cells than names is refused, with a hint at decimal commas")
{
    CHECK(read_text("time_s,height_mm\n0,10\n0,5,9\n", 2) == KN_EXIT_USAGE);
    CHECK(complained(":3:5: more cells than the 2 names", "decimal commas?"));
}

TEST("every number has the same bits as from strtod")
{
    static const char *const numbers[] = {"0",
                                          "-0.0",
                                          "1",
                                          "+2.5",
                                          ".5",
                                          "5.",
                                          "0.1",
                                          "123456789012345",
                                          "1234567890123456",
                                          "0.000000000000001",
                                          "3.14159265358979",
                                          "1e-3",
                                          "1E5",
                                          "-2.5e+3",
                                          "9007199254740993",
                                          "0.30000000000000004",
                                          "1e22",
                                          "1e-300"};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        char text[100];
        snprintf(text, sizeof text, "time_s,strain\n0,%s\n", numbers[i]);
        CHECK(read_text(text, 2) == KN_EXIT_OK);
        CHECK(at(1, 0) == strtod(numbers[i], NULL));
    }
}

// ---- notes and --units

TEST("notes are read above, within and below the table, and unknown notes are ignored")
{
    double load = -1, release = -1, height = -1;
    CHECK(read_text(
              "# load: 50 gf\n# Height = 1 cm\n# measured by: somebody: else\n# this is a sentence that says: nothing\n"
              "time_s,strain\n0,0\n# release: 1 min;;\n1,0.1\n",
              2) == KN_EXIT_OK);
    CHECK(kn_table_reader_note(&s, "load", "N", &load) == KN_EXIT_OK && fabs(load - 0.4903325) < 1e-12);
    CHECK(kn_table_reader_note(&s, "height", "m", &height) == KN_EXIT_OK && height == 0.01);
    CHECK(kn_table_reader_note(&s, "release", "s", &release) == KN_EXIT_OK && release == 60);
    CHECK(kn_table_reader_note(&s, "area", "m^2", &load) == KN_EXIT_OK && fabs(load - 0.4903325) < 1e-12);
    CHECK(s.rows == 2);
}

TEST("a note with a wrong unit is refused with its line and column")
{
    double load;
    CHECK(read_text("# load: 50 mm\ntime_s,strain\n0,0\n", 2) == KN_EXIT_OK);
    kn_hear();
    int code = kn_table_reader_note(&s, "load", "N", &load);
    kn_hear_end();
    CHECK(code == KN_EXIT_USAGE && complained(":1:9: load: ", ""));
}

TEST("--units gives units to columns without one, and a wrong --units is refused")
{
    const char *text = "Time\tRelaxation Modulus\n0\t10\n1\t9\n";
    CHECK(read_bytes(text, strlen(text), "time=min,modulus=kPa", 2) == KN_EXIT_OK);
    CHECK(at(0, 1) == 60 && at(1, 0) == 10000);
    CHECK(read_bytes(text, strlen(text), "time=min,height=mm", 2) == KN_EXIT_USAGE &&
          complained(":1:1: no column 'height'", ""));
    CHECK(read_bytes(text, strlen(text), "time=parsec", 2) == KN_EXIT_USAGE && strstr(kn_heard, "parsec"));
    CHECK(read_bytes(text, strlen(text), "time", 2) == KN_EXIT_USAGE && strstr(kn_heard, "time=s"));
}

// ---- files without a table

TEST("a file without a table is refused in one line")
{
    static char large[3000000];
    memset(large, 'a', sizeof large);
    CHECK(read_text("", 2) == KN_EXIT_USAGE && strstr(kn_heard, "is empty"));
    CHECK(read_text("1,2\n3,4\n", 2) == KN_EXIT_USAGE && complained(":1:1: no table", "expected a line of names"));
    CHECK(read_text("time_s,height_mm\n", 2) == KN_EXIT_USAGE && complained(":1:1: names without numbers", ""));
    CHECK(read_text("time_s,height_mm,c\n,,1\n,,2\n", 2) == KN_EXIT_USAGE &&
          complained(":1:1: no numbers below the name time", ""));
    CHECK(read_text("one\ntwo\n", 2) == KN_EXIT_USAGE && complained(":1:1: no table", ""));
    CHECK(read_bytes("a\0b", 3, NULL, 2) == KN_EXIT_USAGE && complained(":1:1: a byte 0", ""));
    CHECK(read_bytes(large, sizeof large, NULL, 2) == KN_EXIT_USAGE && complained(":1:1: a line of more than", ""));
    CHECK(read_text("time_s,height_mm\n0,1\n1,2\n3,4\n\n", 2) == KN_EXIT_OK && s.rows == 3);
}

TEST("a long line, a zero byte and more than 128 columns are refused with their line")
{
    static char text[100000];
    int n = snprintf(text, sizeof text, "time_s,height_mm\n0,1\n1,");
    memset(text + n, '1', 70000);
    CHECK(read_bytes(text, (size_t)n + 70000, NULL, 2) == KN_EXIT_USAGE && complained(":3:1: a line of more", ""));
    CHECK(read_bytes("time_s,height_mm\n0,1\n1,\0\n", 25, NULL, 2) == KN_EXIT_USAGE &&
          complained(":3:1: a byte 0", ""));
    for (n = 0; n < 2 * 200; n += 2) memcpy(text + n, "a,", 2);
    memcpy(text + n, "\n1,1\n", 6);
    CHECK(read_text(text, 2) == KN_EXIT_USAGE && complained(":1:1: more than 128 columns", ""));
}

TEST("a missing file and a folder are refused in one line")
{
    kn_table_reader_close(&s);
    kn_hear();
    int code = kn_table_reader_open(&s, "/nowhere/at/all.csv", NULL, "identify creep");
    CHECK(!strcmp(kn_hear_end(), "knead identify creep: /nowhere/at/all.csv: No such file or directory\n") &&
          code == KN_EXIT_USAGE);
    kn_table_reader_close(&s);
    kn_hear();
    code = kn_table_reader_open(&s, "/tmp", NULL, "identify creep");
    CHECK(!strcmp(kn_hear_end(), "knead identify creep: /tmp: is a folder, expected a file\n") &&
          code == KN_EXIT_USAGE);
    kn_table_reader_close(&s);
}

TEST("a file larger than the read buffer keeps its values and line numbers")
{
    static char text[4000000];
    int n = snprintf(text, sizeof text, "time_s,height_mm\n");
    for (int i = 0; i < 200000; i++) n += snprintf(text + n, sizeof text - (size_t)n, "%d,%d.5\r\n", i, i % 100);
    CHECK(read_bytes(text, (size_t)n, NULL, 2) == KN_EXIT_OK && s.rows == 200000);
    bool same = true;
    for (int i = 0; i < s.rows; i++) same &= at(0, i) == i && at(1, i) == (i % 100 + 0.5) / 1000 && s.line[i] == i + 2;
    CHECK(same);
    kn_table_reader_close(&s);
}

TESTS_MAIN
