#include "clients/identify/parameter_estimate.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/output.h"
#include "clients/knead/result.h"
#include "clients/viewer/beside.h"
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

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

// Return the parameter of this name, or NULL.
static const kn_parameter_estimate *find(int count, const kn_parameter_estimate *number, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(number[i].name, name)) return &number[i];
    return NULL;
}

// Write one parameter with its interval, or with the reason why it is not known.
static void line(FILE *f, const char *key, double value, const char *unit, const kn_parameter_estimate *n)
{
    char text[120], said[200];
    snprintf(text, sizeof text, "  %s: %.9g %s", key, value, unit);
    fprintf(f, "%-32s", text);
    if (n && n->known == KN_KNOWN) fprintf(f, " # %.5g .. %.5g", n->interval.low, n->interval.high);
    else if (n) {
        kn_parameter_estimate_text(n, said, sizeof said);
        fprintf(f, " # %s%s%s", said, *n->words ? ": " : "", n->words);
    }
    fprintf(f, "\n");
}

// Write the damper of the material, by its kind.
static void damper(FILE *f, const kn_material *m, int count, const kn_parameter_estimate *number)
{
    switch (m->damper) {
    case KN_DAMPER_NONE: fprintf(f, "  damper: none\n"); break;
    case KN_DAMPER_CONSTANT:
        fprintf(f, "  damper: constant\n");
        line(f, "c2", m->c2_pa_s, "Pa*s", find(count, number, "c2"));
        break;
    case KN_DAMPER_EXPONENTIAL:
        fprintf(f, "  damper: exponential\n");
        line(f, "alpha", m->alpha_pa_s, "Pa*s", find(count, number, "alpha"));
        line(f, "beta", m->beta_per_pa, "1/Pa", find(count, number, "beta"));
        line(f, "p0", m->p0_pa, "Pa", find(count, number, "P0"));
        line(f, "p1", m->p1_pa, "Pa", find(count, number, "P1"));
        break;
    case KN_DAMPER_RAMP:
        fprintf(f, "  damper: ramp\n");
        line(f, "c_max", m->c_max_pa_s, "Pa*s", find(count, number, "c_max"));
        line(f, "c_min", m->c_min_pa_s, "Pa*s", find(count, number, "c_min"));
        line(f, "p0", m->p0_pa, "Pa", find(count, number, "P0"));
        line(f, "p1", m->p1_pa, "Pa", find(count, number, "P1"));
        break;
    }
}

int kn_material_file_try(const char *subcommand, const char *path)
{
    struct stat there;
    // kn_beside_open refuses these files, too. Check before a link is followed.
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

static void print_material(FILE *f, const kn_material *m, int count, const kn_parameter_estimate *number)
{
    fprintf(f, "material:\n");
    line(f, "k1", m->k1_pa, "Pa", find(count, number, "k1"));
    line(f, "c1", m->c1_pa_s, "Pa*s", find(count, number, "c1"));
    damper(f, m, count, number);
}

bool kn_material_served(const kn_material *material, char *why, size_t why_size)
{
    char *text = NULL, error[512];
    size_t size = 0;
    // Parse a scene around the material, so that the limits are those of scenes.
    FILE *f = open_memstream(&text, &size);
    snprintf(why, why_size, "out of memory");
    if (!f) return false;
    fprintf(f,
            "version: 1\nobject: {size: [1 cm, 1 cm, 1 cm], spacing: 1 cm}\ndensity: %d kg/m^3\nsupport: bonded\n"
            "device: bench\n",
            DOUGH_KG_M3);
    print_material(f, material, 0, NULL);
    kn_scene *scene = fclose(f) == 0 ? kn_scene_parse("scene", text, size, NULL, 0, error, sizeof error) : NULL;
    // From the parser's complaint, drop the position in this internal text, and drop the alternative notation at the
    // end.
    if (!scene && size) {
        const char *words = strstr(error, ": ") ? strstr(error, ": ") + 2 : error, *end = strstr(words, " (or ");
        snprintf(why, why_size, "%.*s", end ? (int)(end - words) : (int)strlen(words), words);
    }
    const bool served = scene;
    kn_scene_destroy(scene);
    free(text);
    return served;
}

int kn_material_file_write(const char *subcommand, const char *path, const char *origin, const kn_material *material,
                           double density_kg_m3, int count, const kn_parameter_estimate *number)
{
    char why[512];
    kn_beside out;
    int code = may_write(subcommand, path);
    if (code != KN_EXIT_OK) return code;
    if (!kn_material_served(material, why, sizeof why))
        return kn_complain(subcommand, KN_EXIT_FAILED, "--out %s: not written, no scene accepts it: %s", path, why);
    // Write to a file beside the path and rename it once it is complete.
    if (!kn_beside_open(&out, path, why, sizeof why)) return kn_complain(subcommand, KN_EXIT_DEVICE, "%s", why);
    FILE *f = out.file;
    fprintf(f,
            "%s %s\n"
            "# 95 %% intervals, valid if the model is right and the noise is independent.\n",
            mark, origin);
    print_material(f, material, count, number);
    if (density_kg_m3 > 0) fprintf(f, "density: %.6g kg/m^3\n", density_kg_m3);
    else fprintf(f, "density: %d kg/m^3  # not measured: the density of dough; --density sets another\n", DOUGH_KG_M3);
    return kn_beside_keep(&out, why, sizeof why) ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s", why);
}
