// libFuzzer target: any bytes as a table of creep, relaxation, a sweep or a press give curves that a fit accepts, or one line
// of error.
#include "clients/identify/measured_curve.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "tests/fuzz/memory_file.h"
#include <math.h>
#include <stdarg.h>
#include <string.h>

static int complaints; // replaces kn_complain of clients/cli/command.c

int kn_complain(const char *subcommand, int code, const char *format, ...)
{
    char text[2000];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    require(*subcommand && *text);
    for (const char *c = text; *c; c++) require((unsigned char)*c >= ' ' && *c != 0x7f);
    complaints++;
    return code;
}

static void judge_curve(const kn_curve *c)
{
    require(c->count >= KN_CURVE_LEAST && c->noise > 0 && isfinite(c->noise));
    for (int i = 0; i < c->count; i++) {
        require(isfinite(c->time_s[i]) && isfinite(c->value[i]) && c->weight[i] >= 1 && c->line[i] > 0);
        require(i == 0 || c->time_s[i - 1] <= c->time_s[i]);
        require(!c->other || isfinite(c->other[i]));
        if (c->kind == KN_CURVE_SWEEP) require(c->time_s[i] > 0 && c->value[i] > 0 && c->other[i] > 0);
        if (c->kind == KN_CURVE_CREEP) require(c->time_s[i] >= 0);
        if (c->kind == KN_CURVE_PRESS) require(c->other != NULL);
    }
    if (c->kind == KN_CURVE_RELAX) require(c->strain >= 0 && c->strain < 1 && isfinite(c->begin_s));
    if (c->kind != KN_CURVE_CREEP) return;
    require(c->steps > 0 && c->steps <= KN_CURVE_STEPS && c->step[0].time_s == 0 && c->step[0].stress_pa > 0);
    for (int i = 0; i < c->steps; i++) {
        const kn_curve_step *s = &c->step[i];
        require(isfinite(s->stress_pa) && s->stress_pa >= 0 && s->early_s <= s->time_s && s->time_s <= s->late_s);
        require(i == 0 || s->time_s >= s[-1].time_s);
    }
}

static void judge(kn_curve_kind kind, const char *file, const char *units)
{
    static kn_curve curve[KN_CURVES_MAX];
    const kn_curve_options options = {.height_m = units ? 0.01 : 0,
                                      .area_m2 = units ? 1e-4 : 0,
                                      .load_n = units ? 0.5 : 0,
                                      .shear = units != NULL,
                                      .units = units,
                                      .subcommand = "identify creep"};
    int count = 0;
    complaints = 0;
    int code = kn_curve_load(curve, &count, kind, file, &options);
    require(code == KN_EXIT_OK ? count > 0 && complaints == 0 : code == KN_EXIT_USAGE && count == 0 && complaints == 1);
    for (int i = 0; i < count; i++) {
        judge_curve(&curve[i]);
        kn_curve_free(&curve[i]);
    }
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
    require(freopen("/dev/null", "w", stdout) != NULL); // drops the messages about corrected readings
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *file = memory_file(data, size);
    for (kn_curve_kind k = KN_CURVE_CREEP; k <= KN_CURVE_PRESS; k++) judge(k, file, NULL);
    judge(KN_CURVE_CREEP, file, "time=s,height=mm");
    return 0;
}
