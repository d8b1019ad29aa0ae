#ifndef KN_TESTS_CHECK_H
#define KN_TESTS_CHECK_H
// A test program is a list of tests, each named by a sentence:
//
//     TEST("the damper flows faster under more stress")
//     {
//         CHECK(kn_material_flow(&m, 2.0) > kn_material_flow(&m, 1.0));
//     }
//
// This header has the program's main(), so one source file of a program includes it. A failed CHECK prints file:line
// and its values, and the program goes on. The exit code is 1 if any CHECK failed, and 77 after SKIP.
#include "tests/built.h"
#include "tests/owned.h"
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct kn_test_case {
    const char *sentence;
    void (*run)(void);
    bool at_night; // run only when tests/run --all asks for it (KN_NIGHT=1)
    struct kn_test_case *next;
} kn_test_case;

static kn_test_case *kn_test_first, **kn_test_last = &kn_test_first;
static int kn_test_failures;

static inline void kn_test_add(kn_test_case *t)
{
    *kn_test_last = t;
    kn_test_last = &t->next;
}

#define KN_TEST_CAT2(a, b) a##b
#define KN_TEST_CAT(a, b) KN_TEST_CAT2(a, b)
#define TEST(sentence_) KN_TEST_DEFINE(sentence_, __LINE__, false)
#define NIGHT_TEST(sentence_) KN_TEST_DEFINE(sentence_, __LINE__, true)
#define KN_TEST_DEFINE(sentence_, line, night)                                                                         \
    static void KN_TEST_CAT(kn_test_run_, line)(void);                                                                 \
    __attribute__((constructor)) static void KN_TEST_CAT(kn_test_register_, line)(void)                                \
    {                                                                                                                  \
        static kn_test_case t = {sentence_, KN_TEST_CAT(kn_test_run_, line), night, NULL};                             \
        kn_test_add(&t);                                                                                               \
    }                                                                                                                  \
    static void KN_TEST_CAT(kn_test_run_, line)(void)

#define KN_TEST_FAIL(...)                                                                                              \
    do {                                                                                                               \
        fprintf(stderr, "%s:%d: ", __FILE__, __LINE__);                                                                \
        fprintf(stderr, __VA_ARGS__);                                                                                  \
        fputc('\n', stderr);                                                                                           \
        kn_test_failures++;                                                                                            \
    } while (0)
#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) KN_TEST_FAIL("not true: %s", #condition);                                                    \
    } while (0)
// Check |value - expected| <= bound. A NaN fails.
#define CHECK_NEAR(value, expected, bound)                                                                             \
    do {                                                                                                               \
        double kn_v = (double)(value), kn_e = (double)(expected), kn_b = (double)(bound);                              \
        if (!(fabs(kn_v - kn_e) <= kn_b))                                                                              \
            KN_TEST_FAIL("%s is %.9g, expected %.9g within %.3g", #value, kn_v, kn_e, kn_b);                           \
    } while (0)
#define CHECK_STR(value, expected)                                                                                     \
    do {                                                                                                               \
        const char *kn_v = (value), *kn_e = (expected);                                                                \
        if (!kn_v || strcmp(kn_v, kn_e) != 0)                                                                          \
            KN_TEST_FAIL("%s is \"%s\", expected \"%s\"", #value, kn_v ? kn_v : "(null)", kn_e);                       \
    } while (0)
#define COUNT(table) ((int)(sizeof(table) / sizeof *(table))) // number of elements of an array
// Choose how often a test repeats something, or how many variants it tries. The three values are for the gate's
// sanitized build, the gate's release build, and the night (tests/run --all).
#if defined(KN_SANITIZED)
#define KN_LENGTH(sanitized, release, night) (kn_is_night() ? (night) : (sanitized))
#else
#define KN_LENGTH(sanitized, release, night) (kn_is_night() ? (night) : (release))
#endif
static inline int kn_is_night(void) { return getenv("KN_NIGHT") != NULL; }
#define SKIP(...)                                                                                                      \
    do {                                                                                                               \
        printf("skipped: " __VA_ARGS__);                                                                               \
        putchar('\n');                                                                                                 \
        exit(77);                                                                                                      \
    } while (0)

#ifndef KN_TEST_MAIN // a folder's common program defines this as kn_test_law etc.
#define KN_TEST_MAIN main
#endif
int KN_TEST_MAIN(void)
{
    int failed = 0, count = 0;
    for (kn_test_case *t = kn_test_first; t; t = t->next) {
        int before = kn_test_failures;
        if (t->at_night && !getenv("KN_NIGHT")) continue;
        count++;
        t->run();
        printf("%s %s\n", kn_test_failures == before ? "ok  " : "FAIL", t->sentence);
        fflush(stdout);
        failed += kn_test_failures != before;
    }
    printf("%d passed, %d failed\n", count - failed, failed);
    return failed != 0;
}
#define TESTS_MAIN // older tests end with it

#endif
