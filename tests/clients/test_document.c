// The report of `knead identify`: a page of plain HTML in a folder that appears as a whole.
#include "clients/report/report_page.h"
#include "clients/cli/commands.h"
#include "tests/check.h"
#include "tests/cleared.h"
#include <sys/stat.h>
#include <unistd.h>

static char folder[] = "/tmp/test_document.XXXXXX", out[64], page[200000];

static void begin(void)
{
    if (!*out && !mkdtemp(folder)) exit(1);
    snprintf(out, sizeof out, "%s/out", folder);
}

static void read_page(void)
{
    char path[100];
    snprintf(path, sizeof path, "%s/index.html", out);
    FILE *in = fopen(path, "r");
    page[in ? fread(page, 1, sizeof page - 1, in) : 0] = '\0';
    if (in) fclose(in);
}

static void clean(void)
{
    clear_directory(out, true);
    rmdir(folder);
}

static kn_document d;
static char *typed[] = {"knead identify creep", "my file.csv", "--report", "out"};

TEST("a report contains its title, sections, table headings, verdict and command line")
{
    begin();
    CHECK(kn_document_open(&d, "identify creep", out, "Dough", 4, typed) == KN_EXIT_OK);
    kn_document_section(&d, "First");
    kn_document_text(&d, "%d curves", 5);
    kn_document_section(&d, "Second");
    kn_document_table(&d, "numbers", "lr", "name\tvalue");
    kn_document_row(&d, "k1\t%.3g", 46091.0);
    kn_document_verdict(&d, KN_DOCUMENT_BEWARE, "it bends");
    kn_document_section(&d, "Third");
    CHECK(kn_document_close(&d, KN_EXIT_OK) == KN_EXIT_OK);
    read_page();
    CHECK(strstr(page, "<title>Dough</title>"));
    CHECK(strstr(page, "<code>knead identify creep 'my file.csv' --report out</code>"));
    CHECK(strstr(page, "<li><a href=\"#s1\">Second</a></li>"));
    CHECK(strstr(page, "<p>5 curves</p>"));
    CHECK(strstr(page, "<th scope=\"col\" class=\"r\">value</th>"));
    CHECK(strstr(page, "<th scope=\"row\">k1</th><td class=\"r\">4.61e+04</td>"));
    CHECK(strstr(page, "</table></div>\n<p class=\"verdict beware\"><strong>Beware.</strong> it bends</p>"));
    CHECK(!strstr(page, "<script") && !strstr(page, "http"));
}

TEST("a folder that is not empty is refused")
{
    kn_document again;
    int terminal = dup(STDERR_FILENO);
    CHECK(freopen("/dev/null", "w", stderr)); // drops the error message
    int code = kn_document_open(&again, "identify creep", out, "Dough", 0, NULL);
    fflush(stderr);
    dup2(terminal, STDERR_FILENO);
    close(terminal);
    CHECK(code == KN_EXIT_USAGE);
    CHECK(!kn_document_is_open(&again) && kn_document_close(&again, 3) == 3);
    clean();
}

TEST("HTML characters in a name are escaped, and invalid UTF-8 bytes are replaced")
{
    begin();
    if (!mkdtemp(strcpy(folder, "/tmp/test_document.XXXXXX"))) exit(1);
    snprintf(out, sizeof out, "%s/out", folder);
    CHECK(kn_document_open(&d, "identify creep", out, "<b>&\"", 0, NULL) == KN_EXIT_OK);
    kn_document_text(&d, "%s", "<script>\xff\xe2\x82 \xc3\xa9\x01");
    CHECK(kn_document_close(&d, KN_EXIT_OK) == KN_EXIT_OK);
    read_page();
    CHECK(strstr(page, "<h1>&lt;b>&amp;&quot;</h1>"));
    CHECK(strstr(page, "<p>&lt;script>\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd \xc3\xa9\xef\xbf\xbd</p>"));
    clean();
}

TEST("a failed command leaves no report and no other file")
{
    if (!mkdtemp(strcpy(folder, "/tmp/test_document.XXXXXX"))) exit(1);
    snprintf(out, sizeof out, "%s/out", folder);
    char path[PATH_MAX];
    CHECK(kn_document_open(&d, "identify creep", out, "Dough", 0, NULL) == KN_EXIT_OK);
    FILE *f = fopen(kn_document_file(&d, "a.csv", path), "w");
    CHECK(f && fclose(f) == 0);
    CHECK(kn_document_close(&d, KN_EXIT_USAGE) == KN_EXIT_USAGE);
    CHECK(access(out, F_OK) != 0 && access(path, F_OK) != 0);
    CHECK(rmdir(folder) == 0); // no other file is left beside the report
}

TEST("a check that fails keeps its report, with the reason")
{
    if (!mkdtemp(strcpy(folder, "/tmp/test_document.XXXXXX"))) exit(1);
    snprintf(out, sizeof out, "%s/out", folder);
    CHECK(kn_document_open(&d, "identify creep", out, "Dough", 0, NULL) == KN_EXIT_OK);
    kn_document_verdict(&d, KN_DOCUMENT_FAILS, "the residuals run");
    CHECK(kn_document_close(&d, KN_EXIT_FAILED) == KN_EXIT_FAILED);
    read_page();
    CHECK(strstr(page, "<strong>Does not hold.</strong> the residuals run"));
    clean();
}

TEST("a report that is switched off accepts every call and writes nothing")
{
    char path[PATH_MAX];
    CHECK(kn_document_open(&d, "identify creep", NULL, "Dough", 0, NULL) == KN_EXIT_OK);
    kn_document_section(&d, "First");
    kn_document_row(&d, "%s", "x");
    kn_document_picture(&d, "a.png", "", "");
    CHECK(!*kn_document_file(&d, "a.png", path));
    CHECK(kn_document_close(&d, KN_EXIT_OK) == KN_EXIT_OK);
}

TESTS_MAIN
