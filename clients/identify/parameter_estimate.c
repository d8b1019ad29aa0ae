#include "clients/identify/parameter_estimate.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/output.h"
#include "clients/cli/result.h"
#include "clients/viewer/beside.h"
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

const char *const kn_estimate_name[KN_ESTIMATE_NUMBERS] = {"k1", "c1", "alpha", "beta", "P0", "P1"};
const char *const kn_estimate_unit[KN_ESTIMATE_NUMBERS] = {"Pa", "Pa*s", "Pa*s", "1/Pa", "Pa", "Pa"};

kn_material kn_estimate_material(const double v[KN_ESTIMATE_NUMBERS])
{
    return (kn_material){.k1_pa = v[KN_ESTIMATE_K1],
                         .c1_pa_s = v[KN_ESTIMATE_C1],
                         .damper = KN_DAMPER_EXPONENTIAL,
                         .alpha_pa_s = v[KN_ESTIMATE_ALPHA],
                         .beta_per_pa = v[KN_ESTIMATE_BETA],
                         .p0_pa = v[KN_ESTIMATE_P0],
                         .p1_pa = v[KN_ESTIMATE_P1]};
}

void kn_parameter_estimate_set(kn_parameter_estimate *n, const char *name, const char *unit, double value,
                               kn_fit_interval interval)
{
    static const kn_known known[2][2] = {{KN_KNOWN, KN_AT_LEAST}, {KN_AT_MOST, KN_UNKNOWN}};
    *n = (kn_parameter_estimate){.name = name, .unit = unit, .value = value, .interval = interval};
    n->known = known[interval.open_low][interval.open_high];
}

void kn_parameter_estimate_text(const kn_parameter_estimate *n, char *text, size_t size)
{
    const kn_fit_interval *i = &n->interval;
    switch (n->known) {
    case KN_KNOWN: snprintf(text, size, "%.5g %s  [%.5g .. %.5g]", n->value, n->unit, i->low, i->high); break;
    case KN_AT_MOST: snprintf(text, size, "<= %.4g %s", i->high, n->unit); break;
    case KN_AT_LEAST: snprintf(text, size, ">= %.4g %s", i->low, n->unit); break;
    case KN_UNKNOWN: snprintf(text, size, "unknown"); break;
    }
}

void kn_parameter_estimate_tell(json_t *to, const kn_parameter_estimate *n)
{
    static const char *const known[] = {"known", "at_most", "at_least", "unknown"};
    if (!to) return;
    json_t *row = json_object();
    json_object_set_new(to, n->name, row);
    kn_result_number(row, "value", n->value);
    kn_result_text(row, "unit", n->unit);
    kn_result_text(row, "known", known[n->known]);
    kn_result_number(row, "low", n->interval.open_low ? (double)NAN : n->interval.low);
    kn_result_number(row, "high", n->interval.open_high ? (double)NAN : n->interval.high);
    kn_result_text(row, "by", n->interval.how == KN_FIT_PROFILE ? "profile" : "curvature");
    if (*n->words) kn_result_text(row, "words", n->words);
}

enum { DOUGH_KG_M3 = 1200 };

static const char mark[] = "# Identified by knead identify";

// Check that the file may be written: it does not exist, it is empty, or this command has written it.
static int may_write(const char *subcommand, const char *path)
{
    char begin[sizeof mark] = "";
    FILE *f = fopen(path, "r");
    if (!f && errno == ENOENT) return KN_EXIT_OK;
    if (!f) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
    size_t n = fread(begin, 1, sizeof begin - 1, f);
    fclose(f);
    if (n == 0 || !strcmp(begin, mark)) return KN_EXIT_OK;
    return kn_complain(subcommand, KN_EXIT_USAGE,
                       "%s: exists and was not written by knead identify, expected another name", path);
}

// The keys of a material in a scene, in the order in which they are written. `dampers` is a bit mask of the kinds of
// damper that have the key.
enum {
    EVERY = 15,
    CONSTANT = 1 << KN_DAMPER_CONSTANT,
    THINNING = 1 << KN_DAMPER_EXPONENTIAL,
    RAMP = 1 << KN_DAMPER_RAMP
};
static const struct {
    const char *key, *unit;
    size_t at;
    unsigned dampers;
} keys[] = {{"k1", "Pa", offsetof(kn_material, k1_pa), EVERY},
            {"c1", "Pa*s", offsetof(kn_material, c1_pa_s), EVERY},
            {"c2", "Pa*s", offsetof(kn_material, c2_pa_s), CONSTANT},
            {"alpha", "Pa*s", offsetof(kn_material, alpha_pa_s), THINNING},
            {"beta", "1/Pa", offsetof(kn_material, beta_per_pa), THINNING},
            {"c_max", "Pa*s", offsetof(kn_material, c_max_pa_s), RAMP},
            {"c_min", "Pa*s", offsetof(kn_material, c_min_pa_s), RAMP},
            {"p0", "Pa", offsetof(kn_material, p0_pa), THINNING | RAMP},
            {"p1", "Pa", offsetof(kn_material, p1_pa), THINNING | RAMP}};

// Write the interval of one parameter as a comment. If the data do not determine the parameter, write the reason.
static void comment(FILE *f, const kn_parameter_estimate *n)
{
    char said[200];
    if (n->known == KN_KNOWN) fprintf(f, " # %.5g .. %.5g", n->interval.low, n->interval.high);
    else {
        kn_parameter_estimate_text(n, said, sizeof said);
        fprintf(f, " # %s%s%s", said, *n->words ? ": " : "", n->words);
    }
}

static void print_material(FILE *f, const kn_material *m, int count, const kn_parameter_estimate *number)
{
    static const char *const damper[] = {"none", "constant", "exponential", "ramp"};
    fprintf(f, "material:\n");
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++) {
        char text[120];
        if (!strcmp(keys[k].key, "c2")) fprintf(f, "  damper: %s\n", damper[m->damper]);
        if (!(keys[k].dampers & 1u << m->damper)) continue;
        const double *value = (const double *)(const void *)((const char *)m + keys[k].at);
        snprintf(text, sizeof text, "  %s: %.9g %s", keys[k].key, *value, keys[k].unit);
        fprintf(f, "%-32s", text);
        // The papers' names P0 and P1 belong to the keys p0 and p1, so ignore the case.
        for (int i = 0, found = 0; i < count && !found; i++) {
            found = !strcasecmp(number[i].name, keys[k].key);
            if (found) comment(f, &number[i]);
        }
        fprintf(f, "\n");
    }
}

int kn_material_file_try(const char *subcommand, const char *path)
{
    struct stat there;
    // kn_beside_open also refuses a path that is not a regular file. The check here comes first, since may_write would
    // follow a link.
    if (lstat(path, &there) == 0 && !S_ISREG(there.st_mode))
        return kn_complain(subcommand, KN_EXIT_DEVICE, "%s: is no regular file, expected a file that may be replaced",
                           path);
    const int code = kn_output_try(subcommand, path);
    return code == KN_EXIT_OK ? may_write(subcommand, path) : code;
}

const char *kn_material_source(const char *file, int files, char text[KN_SOURCE_MAX])
{
    const char *base = strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
    const bool plain = kn_key_quotable(base);
    // the text fits, since a file name has at most 255 bytes
    snprintf(text, KN_SOURCE_MAX, "%s%s", base, files > 1 ? " and others" : "");
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < ' ' || (!plain && (unsigned char)*c > '~')) *c = '?';
    return text;
}

bool kn_material_served(const kn_material *material, char *why, size_t why_size)
{
    char *text = NULL, error[512];
    size_t size = 0;
    // Parse a small scene with this material, so that the limits of a scene apply.
    FILE *f = open_memstream(&text, &size);
    snprintf(why, why_size, "out of memory");
    if (!f) return false;
    fprintf(f,
            "version: 1\nobject: {size: [1 cm, 1 cm, 1 cm], spacing: 1 cm}\ndensity: %d kg/m^3\nsupport: bonded\n"
            "device: bench\n",
            DOUGH_KG_M3);
    print_material(f, material, 0, NULL);
    kn_scene *scene = fclose(f) == 0 ? kn_scene_parse("scene", text, size, NULL, 0, error, sizeof error) : NULL;
    // From the parser's error, drop the position in this internal text, and the alternative notation at the end.
    if (!scene && size) {
        const char *words = strstr(error, ": ") ? strstr(error, ": ") + 2 : error, *end = strstr(words, " (or ");
        snprintf(why, why_size, "%.*s", end ? (int)(end - words) : (int)strlen(words), words);
    }
    const bool served = scene;
    kn_scene_destroy(scene);
    free(text);
    return served;
}

int kn_material_file_write(const char *subcommand, const char *path, const char *origin, const char *scene,
                           const kn_material *material, double density_kg_m3, int count,
                           const kn_parameter_estimate *number)
{
    char why[512];
    kn_beside out;
    int code = may_write(subcommand, path);
    if (code != KN_EXIT_OK) return code;
    if (!kn_material_served(material, why, sizeof why))
        return kn_complain(subcommand, KN_EXIT_FAILED, "--out %s: not written, no scene accepts it: %s", path, why);
    // Write to a temporary file beside the path, and rename it when it is complete.
    if (!kn_beside_open(&out, path, why, sizeof why)) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s", why);
    FILE *f = out.file;
    fprintf(f,
            "%s %s\n"
            "# 95 %% intervals, valid if the model is right and the noise is independent.\n",
            mark, origin);
    if (scene) fputs(scene, f);
    print_material(f, material, count, number);
    if (density_kg_m3 > 0) fprintf(f, "density: %.6g kg/m^3\n", density_kg_m3);
    else fprintf(f, "density: %d kg/m^3  # not measured: the density of dough; --density sets another\n", DOUGH_KG_M3);
    return kn_beside_keep(&out, why, sizeof why) ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s", why);
}
