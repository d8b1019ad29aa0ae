#ifndef KN_TESTS_CLIENTS_HEARD_H
#define KN_TESTS_CLIENTS_HEARD_H
// Capture the output on stdout and stderr between two calls, and write a text to a file.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static char kn_heard[20000];
static int kn_heard_terminal[2], kn_heard_file;

static inline void kn_hear(void)
{
    fflush(stdout);
    kn_heard_file = memfd_create("heard", 0);
    for (int i = 0; i < 2; i++) {
        kn_heard_terminal[i] = dup(i + 1);
        dup2(kn_heard_file, i + 1);
    }
}

static inline const char *kn_hear_end(void)
{
    fflush(stdout);
    fflush(stderr);
    for (int i = 0; i < 2; i++) {
        dup2(kn_heard_terminal[i], i + 1);
        close(kn_heard_terminal[i]);
    }
    ssize_t n = pread(kn_heard_file, kn_heard, sizeof kn_heard - 1, 0);
    kn_heard[n > 0 ? n : 0] = '\0';
    close(kn_heard_file);
    return kn_heard;
}

static char kn_written[64]; // name of that file

static inline const char *kn_write(const void *text, size_t size)
{
    if (!*kn_written) {
        char folder[] = "/tmp/kn_heard.XXXXXX";
        if (!mkdtemp(folder)) exit(1);
        snprintf(kn_written, sizeof kn_written, "%s/a.csv", folder);
    }
    FILE *out = fopen(kn_written, "w");
    if (!out || fwrite(text, 1, size, out) != size || fclose(out) != 0) exit(1);
    return kn_written;
}

__attribute__((destructor)) static void kn_written_remove(void)
{
    if (!*kn_written) return;
    unlink(kn_written);
    *strrchr(kn_written, '/') = '\0';
    rmdir(kn_written);
}

#endif
