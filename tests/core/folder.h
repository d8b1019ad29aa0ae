#ifndef KN_TESTS_CORE_FOLDER_H
#define KN_TESTS_CORE_FOLDER_H
// Create a folder for one test. At the end remove the files in it by name.
#include "tests/check.h"

#include <unistd.h>

static char folder[64];

static const char *in_folder(const char *name)
{
    static char path[4][256];
    static int turn;
    if (!*folder) {
        snprintf(folder, sizeof folder, "%s", "/tmp/knead-test-XXXXXX");
        if (!mkdtemp(folder)) SKIP("no folder for files");
    }
    turn = (turn + 1) % 4;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

#endif
