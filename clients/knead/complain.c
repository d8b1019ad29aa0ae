#include "clients/knead/complain.h"
#include "server/option_table.h"
#include <stdio.h>

int kn_complain(const char *subcommand, int code, const char *format, ...)
{
    char program[64];
    va_list args;
    snprintf(program, sizeof program, "knead %s", subcommand);
    va_start(args, format);
    kn_message_print(program, false, format, args);
    va_end(args);
    return code;
}
