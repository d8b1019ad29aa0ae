#ifndef KN_TESTS_ALLOCATIONS_H
#define KN_TESTS_ALLOCATIONS_H
// Count the calls of malloc and related functions while a thread is armed. Exactly one source file of a program
// includes this header.
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

static _Thread_local bool armed;
static atomic_long allocations;

#if defined(KN_SANITIZED)
#define INTERPOSED 0 // the sanitizers replace malloc themselves
#else
#define INTERPOSED 1
void *__libc_malloc(size_t size); // glibc's own functions, under the names that it keeps for interposers
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *memory);

void *malloc(size_t size)
{
    allocations += armed;
    return __libc_malloc(size);
}
void *calloc(size_t count, size_t size)
{
    allocations += armed;
    return __libc_calloc(count, size);
}
void *realloc(void *memory, size_t size)
{
    allocations += armed;
    return __libc_realloc(memory, size);
}
void *aligned_alloc(size_t alignment, size_t size)
{
    allocations += armed;
    return __libc_memalign(alignment, size);
}
void free(void *memory)
{
    allocations += armed;
    __libc_free(memory);
}
#endif

#endif
