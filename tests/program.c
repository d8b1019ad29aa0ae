// The program of a folder's tests: `test_core law` runs those of core/test_law.c. KN_TESTS lists them, a line TEST_MAIN(law) each.
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
