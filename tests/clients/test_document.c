// The report of `knead identify`: a page of plain HTML in a folder that appears as a whole.
#include "clients/report/report_page.h"
#include "clients/cli/commands.h"
#include "tests/clients/heard.h"

static kn_document d;
static char page[200000], path[PATH_MAX];
static char *typed[] = {"knead identify creep", "my file.csv", "--report", "out"};

static void begin(const char *folder, const char *title)
{
    CHECK(kn_document_open(&d, "identify creep", folder, title, 4, typed) == KN_EXIT_OK);
}

// End the report with this exit code, and read its page.
static void end(const char *folder, int code)
{
    CHECK(kn_document_close(&d, code) == code);
    snprintf(path, sizeof path, "%s/index.html", folder);
    kn_read(path, page, sizeof page);
}

TEST("a report contains its title, sections, table headings, verdict and command line; a folder that is not empty is "
     "refused")
{
    begin("out", "Dough");
    kn_document_section(&d, "First");
    kn_document_text(&d, "%d curves", 5);
    kn_document_section(&d, "Second");
    kn_document_table(&d, "numbers", "lr", "name\tvalue");
    kn_document_row(&d, "k1\t%.3g", 46091.0);
    kn_document_verdict(&d, KN_DOCUMENT_BEWARE, "it bends");
    kn_document_section(&d, "Third");
    end("out", KN_EXIT_OK);
    CHECK(strstr(page, "<title>Dough</title>"));
    CHECK(strstr(page, "<code>knead identify creep 'my file.csv' --report out</code>"));
    CHECK(strstr(page, "<li><a href=\"#s1\">Second</a></li>"));
    CHECK(strstr(page, "<p>5 curves</p>"));
    CHECK(strstr(page, "<th scope=\"col\" class=\"r\">value</th>"));
    CHECK(strstr(page, "<th scope=\"row\">k1</th><td class=\"r\">4.61e+04</td>"));
    CHECK(strstr(page, "</table></div>\n<p class=\"verdict beware\"><strong>Beware.</strong> it bends</p>"));
    CHECK(!strstr(page, "<script") && !strstr(page, "http"));
    kn_hear();
    const int code = kn_document_open(&d, "identify creep", "out", "Dough", 0, NULL);
    kn_hear_end();
    CHECK(code == KN_EXIT_USAGE && kn_refused("out: is not empty, expected a new folder"));
    CHECK(!kn_document_is_open(&d) && kn_document_close(&d, 3) == 3);
}

TEST("HTML characters in a name are escaped, and invalid UTF-8 bytes are replaced")
{
    begin("odd", "<b>&\"");
    kn_document_text(&d, "%s", "<script>\xff\xe2\x82 \xc3\xa9\x01");
    end("odd", KN_EXIT_OK);
    CHECK(strstr(page, "<h1>&lt;b>&amp;&quot;</h1>"));
    CHECK(strstr(page, "<p>&lt;script>\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd \xc3\xa9\xef\xbf\xbd</p>"));
}

TEST("a failed command leaves no report and no other file; a check that fails keeps its report, with the reason")
{
    begin("failed", "Dough");
    FILE *f = fopen(kn_document_file(&d, "a.csv", path), "w");
    CHECK(f && fclose(f) == 0);
    CHECK(kn_document_close(&d, KN_EXIT_USAGE) == KN_EXIT_USAGE);
    CHECK(access(path, F_OK) != 0 && system("ls -d failed* >/dev/null 2>&1") != 0);
    begin("kept", "Dough");
    kn_document_verdict(&d, KN_DOCUMENT_FAILS, "the residuals run");
    end("kept", KN_EXIT_FAILED);
    CHECK(strstr(page, "<strong>Does not hold.</strong> the residuals run"));
}

TEST("a report that is switched off accepts every call and writes nothing")
{
    begin(NULL, "Dough");
    kn_document_section(&d, "First");
    kn_document_row(&d, "%s", "x");
    kn_document_picture(&d, "a.png", "", "");
    CHECK(!*kn_document_file(&d, "a.csv", path) && kn_document_close(&d, KN_EXIT_OK) == KN_EXIT_OK);
}

TESTS_MAIN
