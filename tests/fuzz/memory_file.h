#ifndef KN_TESTS_MEMORY_FILE_H
#define KN_TESTS_MEMORY_FILE_H
// The fuzzer's input as a file that exists in memory only.
#include "tests/fuzz/fuzz.h"
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

// Return the file's path, valid until the next call.
static inline const char *memory_file(const uint8_t *data, size_t size)
{
    static int fd = -1;
    static char path[32];
    if (fd < 0) fd = memfd_create("log", 0);
    require(fd >= 0 && ftruncate(fd, 0) == 0 && pwrite(fd, data, size, 0) == (ssize_t)size);
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
    return path;
}

#endif
