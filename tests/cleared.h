#ifndef KN_TESTS_CLEARED_H
#define KN_TESTS_CLEARED_H
#include <dirent.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// Remove the files of a folder. Remove the folder too if `itself` is true.
static inline void clear_directory(const char *path, bool itself)
{
    char name[600];
    DIR *d = opendir(path);
    for (struct dirent *e; d && (e = readdir(d));) {
        snprintf(name, sizeof name, "%s/%s", path, e->d_name);
        if (strcmp(e->d_name, ".") && strcmp(e->d_name, "..")) unlink(name);
    }
    if (d) closedir(d);
    if (itself) rmdir(path);
}

#endif
