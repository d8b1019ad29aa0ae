// One program for all tests of a folder: `test_core law` runs the tests of core/test_law.c. KN_TESTS is a file that
// lists the tests, one line TEST_MAIN(law) for each.
#include <stdio.h>
#include <string.h>

#define TEST_MAIN(name) int kn_test_##name(void);
#include KN_TESTS
#undef TEST_MAIN

int main(int argc, char **argv)
{
#define TEST_MAIN(name)                                                                                                \
    if (argc == 2 && strcmp(argv[1], #name) == 0) return kn_test_##name();
#include KN_TESTS
    return fprintf(stderr, "%s: expected the name of a test\n", argv[0]), 2;
}
