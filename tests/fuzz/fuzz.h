#ifndef KN_TESTS_FUZZ_H
#define KN_TESTS_FUZZ_H
// libFuzzer's entry points, and require().
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static inline void require(int condition)
{
    if (!condition) abort();
}

#endif
