#include "clients/cli/yaml_patch.h"
#include "tests/check.h"

static char error[200];

static void grafts(const char *text, const char *block, const char *expected)
{
    char *out = kn_yaml_patch(text, "quality", block, error, sizeof error);
    if (!out) KN_TEST_FAIL("refused: %s\n%s", error, text);
    else CHECK_STR(out, expected);
    free(out);
}

#define NEW "quality:\n  fast: {passes: 1}\n"

TEST("a block is replaced in its place, and the rest of the text stays unchanged")
{
    grafts(
        "a: 1 # one\n\nquality:\n  fast:\n    passes: 2\n  # of it\n  balanced: {passes: 3}\n\n# of b\nb: [1,\n  2]\n",
        NEW, "a: 1 # one\n\n" NEW "\n# of b\nb: [1,\n  2]\n");
}

TEST("a block at the end of the text is replaced, with or without a final line end")
{
    grafts("a: 1\nquality:\n  fast: {passes: 2}\n", NEW, "a: 1\n" NEW);
    grafts("a: 1\nquality:\n  fast: {passes: 2}", NEW, "a: 1\n" NEW);
}

TEST("a missing block is appended on a line of its own")
{
    grafts("a: 1\n", NEW, "a: 1\n" NEW);
    grafts("a: 1", NEW, "a: 1\n" NEW);
    grafts("a:\n  quality: 5\n", NEW, "a:\n  quality: 5\n" NEW); // a key of another name
}

TEST("short forms, quoted keys, braces over several lines, literals and lists are replaced as blocks")
{
    grafts("quality: fast\nb: 1\n", NEW, NEW "b: 1\n");
    grafts("'quality': fast # as chosen\nb: 1\n", NEW, NEW "b: 1\n");
    grafts("quality: {fast: {passes: 2},\n  balanced: {passes: 3}}\nb: 1\n", NEW, NEW "b: 1\n");
    grafts("quality:\nb: 1\n", NEW, NEW "b: 1\n");
    grafts("quality: |\n  some\n  text\nb: 1\n", NEW, NEW "b: 1\n");
    grafts("quality:\n- 1\n- 2\nb: 1\n", NEW, NEW "b: 1\n");
}

TEST("an empty block removes the existing block")
{
    grafts("a: 1\nquality: fast\nb: 1\n", "", "a: 1\nb: 1\n");
    grafts("a: 1\n", "", "a: 1\n");
}

TEST("the new block uses the line ends of the text")
{
    grafts("a: 1\r\nquality: fast\r\nb: 1\r\n", NEW, "a: 1\r\nquality:\r\n  fast: {passes: 1}\r\nb: 1\r\n");
}

TEST("a text that is not YAML, or is one map in braces, is refused")
{
    CHECK(!kn_yaml_patch("a: [1\n", "quality", NEW, error, sizeof error));
    CHECK(strstr(error, "in line 2"));
    CHECK(!kn_yaml_patch("{a: 1}\n", "quality", NEW, error, sizeof error));
    CHECK(strstr(error, "in braces"));
}

TESTS_MAIN
