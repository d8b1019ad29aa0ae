#include "clients/cli/yaml_patch.h"
#include "tests/check.h"

#define NEW "quality:\n  fast: {passes: 1}\n"

TEST("a block of a YAML text is replaced, and the rest stays unchanged")
{
    static const struct {
        const char *sentence, *text, *block, *expected;
    } all[] = {
        {"a block is replaced in its place, and the rest of the text stays unchanged",
         "a: 1 # one\n\nquality:\n  fast:\n    passes: 2\n  # of it\n  balanced: {passes: 3}\n\n# of b\nb: [1,\n  2]\n",
         NEW, "a: 1 # one\n\n" NEW "\n# of b\nb: [1,\n  2]\n"},
        {"at the end of the text", "a: 1\nquality:\n  fast: {passes: 2}\n", NEW, "a: 1\n" NEW},
        {"without a final line end", "a: 1\nquality:\n  fast: {passes: 2}", NEW, "a: 1\n" NEW},
        {"a missing block is appended on a line of its own", "a: 1\n", NEW, "a: 1\n" NEW},
        {"without a final line end", "a: 1", NEW, "a: 1\n" NEW},
        {"a key of another name", "a:\n  quality: 5\n", NEW, "a:\n  quality: 5\n" NEW},
        {"a short form", "quality: fast\nb: 1\n", NEW, NEW "b: 1\n"},
        {"a quoted key", "'quality': fast # as chosen\nb: 1\n", NEW, NEW "b: 1\n"},
        {"braces over lines", "quality: {fast: {passes: 2},\n  balanced: {passes: 3}}\nb: 1\n", NEW, NEW "b: 1\n"},
        {"no value", "quality:\nb: 1\n", NEW, NEW "b: 1\n"},
        {"a literal", "quality: |\n  some\n  text\nb: 1\n", NEW, NEW "b: 1\n"},
        {"a list", "quality:\n- 1\n- 2\nb: 1\n", NEW, NEW "b: 1\n"},
        {"an empty block removes the existing block", "a: 1\nquality: fast\nb: 1\n", "", "a: 1\nb: 1\n"},
        {"no block", "a: 1\n", "", "a: 1\n"},
        {"the new block uses the line ends of the text", "a: 1\r\nquality: fast\r\nb: 1\r\n", NEW,
         "a: 1\r\nquality:\r\n  fast: {passes: 1}\r\nb: 1\r\n"},
        {"a text that is not YAML is refused", "a: [1\n", NEW, "in line 2"},
        {"one map in braces is refused", "{a: 1}\n", NEW, "in braces"},
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        char error[200] = "";
        char *out = kn_yaml_patch(all[i].text, "quality", all[i].block, error, sizeof error);
        if (out ? strcmp(out, all[i].expected) != 0 : !strstr(error, all[i].expected))
            KN_TEST_FAIL("%s: %s%s, expected %s", all[i].sentence, out ? out : "", error, all[i].expected);
        free(out);
    }
}

TESTS_MAIN
