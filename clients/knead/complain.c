#include "clients/knead/complain.h"
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

// Return true if the message contains a place in a file, like "scene.yaml:14:9: ".
static bool has_place(const char *text)
{
    for (const char *at = text; (at = strchr(at, ':')); at++) {
        int length = 0;
        // sscanf sets length only if the whole pattern matched.
        if (sscanf(at, ":%*[0-9]:%*[0-9]:%n", &length) == 0 && length > 0 && at[length] == ' ') return true;
    }
    return false;
}

int kn_complain(const char *subcommand, int code, const char *format, ...)
{
    char text[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    // Print a message that begins with a place in a file without a prefix, so that the place stays at the beginning of
    // the line.
    if (has_place(text)) fprintf(stderr, "%s\n", text);
    else fprintf(stderr, "knead %s: %s\n", subcommand, text);
    return code;
}
