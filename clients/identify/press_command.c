// The command `knead identify press`: find the material of a lattice from presses with a tool.
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/curve_table.h"
#include "clients/cli/result.h"
#include "clients/cli/yaml_patch.h"
#include "core/hash.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify press FILE... --object SCENE --tool TOOL [OPTION]...\n\n"
    "Fit the material of a virtual object to presses with a tool, as a force gauge on a moving stage records them.\n"
    "The lattice of the scene is pressed as the real object was, with one material after another, until its force\n"
    "agrees with the measured force.\n\n"
    "A file is a table of time, force and depth of one press, with a name and a unit above each column. It may\n"
    "include the withdrawal. The place of touch is fitted, so depth may count from anywhere. The force is 0 without\n"
    "touch, and the tool presses in the middle of the object, straight down. A file with the notes '# height: 1 cm'\n"
    "and '# area: 1 cm^2' is of a specimen of the same material, not of the object: a cylinder or prism between a\n"
    "table without friction and a plate, as in a relaxation or a texture profile.\n\n"
    "the readings:\n"
    "  --object SCENE         scene of the pressed object: a block, its cells, structure and support\n"
    "  --tool TOOL            the tool: the name of one of the scene's probes, or a file (with a . or / in its name),\n"
    "                         whose first probe it is:\n"
    "                             probes:\n"
    "                               - {name: ball, shape: sphere, radius: 1 cm}\n"
    "                         A line '# tool: TOOL' in a file of readings names another tool for this press\n"
    "  --creep FILE           creep of a specimen, fitted together with the presses; may be repeated. Load and size\n"
    "                         are notes in the file, or --load, --stress, --height, --area, --release, as for\n"
    "                         identify creep\n"
    "  --held FILE            a press that is predicted, not fitted, as a test of the fit; may be repeated\n"
    "  --compliance C         how far frame and gauge give way, e.g. '0.01 mm/N' or '0 mm/N' (default: fitted).\n"
    "                         The heights of specimens must be those between the plates\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. time=s,force=N,depth=mm\n"
    KN_IDENTIFY_COLUMN_HELP
    "\n"
    "results:\n"
    "  --anyway               write the scene even if it misses a record by more than 15 % of its largest value\n"
    "  --out FILE             the scene with the fitted material; its label states the misfit\n"
    "  --density D            density of the material (default: that of the scene)\n"
    "  --report DIR           folder for a page, DIR/index.html, with all results, the plot and the scene\n"
    "  --png FILE             plot of measured, fitted and predicted forces with their 95 % bands (needs gnuplot)\n"
    "  --csv FILE             table of readings and fit\n"
    "  --json                 print the results as JSON\n\n"
    "With one press, the 95 % intervals come from the noise. With several presses of the object, they also cover the\n"
    "differences between the presses. If a fit with --out is killed, run the same command again: it continues from\n"
    "FILE.fit.\n\n"
    "Examples:\n"
    "    knead identify press gauge.csv --object dough-small --tool finger --compliance '0 mm/N' --out twin.yaml\n\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

// ---- object and tools

// Read a text file. Return NULL with one line in `error` if this fails.
static char *read_text(const char *path, char *error, size_t error_size)
{
    char *text = NULL, part[4096];
    size_t size = 0, n;
    FILE *f = fopen(path, "rb"), *to = f ? open_memstream(&text, &size) : NULL;
    while (to && (n = fread(part, 1, sizeof part, f)) > 0) fwrite(part, 1, n, to);
    const bool good = to && !ferror(f);
    if (to) fclose(to);
    if (f) fclose(f);
    if (good) return text;
    snprintf(error, error_size, "%s:1:1: cannot be read, expected a file with the tool", path);
    free(text);
    return NULL;
}

// Load the file of a tool. The keys that make it a whole scene are added, with the spacing of the pressed object.
static kn_scene *load_tool(const char *path, const kn_scene *object, char *error, size_t error_size)
{
    char why[500];
    size_t begin, end, size = 0;
    char *text = read_text(path, error, error_size), *all = NULL;
    FILE *f = text ? open_memstream(&all, &size) : NULL;
    if (!f) {
        free(text);
        return NULL;
    }
    const double h = object->model.spacing_m;
    static const char *const keys[][2] = {
        {"version", "1"}, {"material", "dough"}, {"support", "bonded"}, {"device", "bench"}};
    fprintf(f, "%s\n", text);
    // what is missing is added; in a text that cannot be read, the parser finds the mistake
    for (int i = 0; i < 4; i++)
        if (kn_yaml_patch_find(text, keys[i][0], &begin, &end, why, sizeof why) && begin == end)
            fprintf(f, "%s: %s\n", keys[i][0], keys[i][1]);
    if (kn_yaml_patch_find(text, "object", &begin, &end, why, sizeof why) && begin == end)
        fprintf(f, "object: {size: [%.9g m, %.9g m, %.9g m], spacing: %.9g m}\n", 4 * h, 4 * h, 4 * h, h);
    fclose(f);
    kn_scene *scene = all ? kn_scene_parse(path, all, size, NULL, 0, why, sizeof why) : NULL;
    int lines = 1, line = 0, skip = 0;
    for (const char *c = text; *c; c++) lines += *c == '\n';
    // a mistake that shows in the added lines, such as a tool too small for the cells, is one of the file
    const char *place = !scene && strstr(why, path) == why ? why + strlen(path) : "";
    const bool added = sscanf(place, ":%d:%*d: %n", &line, &skip) == 1 && skip > 0 && line > lines;
    if (added) snprintf(error, error_size, "%s:1:1: %s", path, place + skip);
    else snprintf(error, error_size, "%s", why);
    free(all);
    free(text);
    if (!scene || scene->model.probe_count > 0) return scene;
    snprintf(error, error_size, "%s:1:1: has no probe, expected the tool under the key probes", path);
    kn_scene_destroy(scene);
    return NULL;
}

// Cut the specimen of a record. Its lattice has the structure of the object, and whole cells as near to the object's size
// as 2 to KN_SERVED_CELLS_MAX along each side allow.
static int cut_specimen(kn_identification *w, const kn_model_def *object, int press)
{
    kn_press_record *p = &w->press.press[press];
    const char *sub = w->opt.subcommand;
    kn_curve c = w->curve[press];
    const bool creep = c.kind == KN_CURVE_CREEP;
    if (!creep && (c.height_m > 0) != (c.area_m2 > 0))
        return kn_complain(sub, KN_EXIT_USAGE,
                           "%s: the note '# %s:' stands alone, expected height and area of a specimen, or "
                           "neither",
                           c.file, c.height_m > 0 ? "height" : "area");
    if (!creep && !(c.height_m > 0)) return KN_EXIT_OK;
    if (creep && c.unknown_stress)
        return kn_complain(sub, KN_EXIT_USAGE,
                           "%s: the stress of this compliance is not known, expected a line '# stress: "
                           "1 kPa' or --stress '1 kPa'",
                           c.file);
    // strains do not depend on the size, so a specimen of unknown size is a cube of any size
    if (!(c.height_m > 0)) c.height_m = 2 * object->spacing_m;
    const double wide_m = c.area_m2 > 0 ? sqrt(c.area_m2) : c.height_m;
    const double most_m = 0.5 * fmin(wide_m, c.height_m), least_m = fmax(wide_m, c.height_m) / KN_SERVED_CELLS_MAX;
    p->specimen.object = object;
    p->specimen.structure = kn_affine_structure_of(object);
    if (!kn_served_lattice_cut(&p->specimen, &c, fmin(fmax(object->spacing_m, 1.01 * least_m), most_m)))
        return kn_complain(sub, KN_EXIT_USAGE,
                           "%s: a specimen of %.3g mm width and %.3g mm height, expected one that is "
                           "between 3 times as wide as high and 3 times as high as wide",
                           c.file, 1e3 * wide_m, 1e3 * c.height_m);
    printf("%s: a specimen, pressed as %d x %d x %d cells of %.3g mm\n", c.name, p->specimen.cells[0],
           p->specimen.cells[0], p->specimen.cells[1], 1e3 * p->specimen.spacing_m);
    return KN_EXIT_OK;
}

// Find the tool of one press: a probe of the object's scene, or the first probe of a file.
static int find_tool(kn_identification *w, int press, const char *name)
{
    char error[600];
    const kn_scene *object = w->scene[0];
    kn_press_record *p = &w->press.press[press];
    for (int i = 0; i < press && !p->tool; i++) {
        if (w->curve[i].kind == KN_CURVE_CREEP) continue;
        const char *other = *w->curve[i].tool ? w->curve[i].tool : w->opt.tool;
        if (!strcmp(other, name)) p->tool = w->press.press[i].tool;
    }
    for (int i = 0; i < object->model.probe_count && !p->tool; i++)
        if (!strcmp(object->model.probe[i].name, name)) p->tool = &object->model.probe[i];
    if (p->tool) return KN_EXIT_OK;
    if (!strpbrk(name, "./"))
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "%s: the tool '%s' is no probe of %s, expected one of its probes, or a file",
                           *w->curve[press].tool ? w->curve[press].file : "--tool", name, w->opt.object);
    const char *const outputs[] = {w->opt.out, w->opt.png, w->opt.csv, w->opt.report};
    for (int i = 0; i < 4; i++)
        if (kn_output_same(outputs[i], name))
            return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                               "%s: is the tool and an output, expected another output", name);
    kn_scene *scene = w->scene[1 + press] = load_tool(name, object, error, sizeof error);
    if (!scene) return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s", error);
    p->tool = &scene->model.probe[0];
    return KN_EXIT_OK;
}

static int load_object(kn_identification *w)
{
    char error[600];
    const char *path = w->opt.object;
    if (!path)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "expected --object SCENE, the scene of the object that was pressed");
    kn_scene *scene = w->scene[0] = kn_scene_load(path, NULL, 0, error, sizeof error);
    if (!scene) return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s", error);
    if (scene->model.mesh || scene->model.thickness_m > 0)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s: the object is %s, expected a block", path,
                           scene->model.mesh ? "a mesh" : "flat");
    if (scene->model.support == KN_SUPPORT_NONE || scene->model.support == KN_SUPPORT_FRICTION)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "%s: the support holds no object in place, expected bonded or frictionless", path);
    if (scene->model.solver.kind != KN_SOLVER_IMPLICIT)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s:%d:%d: solver.kind is not implicit, which press needs",
                           path, scene->solver_line, scene->solver_col);
    return KN_EXIT_OK;
}

// ---- the scene of the result

// Return the text of the object's scene without material and density, with this label, and with the tools that came from
// files. Return NULL with a sentence in `error` on failure. The caller frees the text.
static char *scene_text(const kn_identification *w, const char *label, char *error, size_t error_size)
{
    char *text = strdup(w->scene[0]->text), *probes = NULL;
    size_t begin = 0, end = 0, size = 0;
    bool more = false;
    FILE *f = text ? open_memstream(&probes, &size) : NULL;
    for (int k = 0; k <= w->curves && f; k++) {
        const char *from = w->scene[k] ? w->scene[k]->text : NULL;
        if (k > 0 && kn_press_of_specimen(&w->press.press[k - 1])) continue; // its plate never touched the object
        if (!from || !kn_yaml_patch_find(from, "probes", &begin, &end, error, error_size) || begin == end) continue;
        const char *items = strchr(from + begin, '\n') + 1; // the lines below `probes:`
        fprintf(f, "%s%.*s", size == 0 && ftell(f) == 0 ? "probes:\n" : "", (int)(from + end - items), items);
        more |= k > 0;
    }
    if (f) fclose(f);
    const char *const patch[][2] = {
        {"label", label}, {"material", ""}, {"density", ""}, {"probes", more ? probes : NULL}};
    for (int i = 0; i < 4 && text; i++) {
        if (!patch[i][1]) continue;
        char *next = kn_yaml_patch(text, patch[i][0], patch[i][1], error, error_size);
        free(text);
        text = next;
    }
    free(probes);
    return text;
}

// Check before the fit that the scene of the result will load.
static int try_scene(const kn_identification *w)
{
    char error[600], *whole = NULL, *text = scene_text(w, "label: x\n", error, sizeof error);
    size_t size = 0;
    FILE *f = text ? open_memstream(&whole, &size) : NULL;
    if (f) fprintf(f, "%smaterial: dough\ndensity: 1200 kg/m^3\n", text);
    if (f) fclose(f);
    kn_scene *scene = whole ? kn_scene_parse("scene", whole, size, NULL, 0, error, sizeof error) : NULL;
    const bool good = scene;
    kn_scene_destroy(scene);
    free(whole);
    free(text);
    if (good) return KN_EXIT_OK;
    return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s with this tool is no scene: %s", w->opt.object, error);
}

// ---- the fit

// Check that the file that keeps an interrupted fit is not somebody else's.
static int try_kept(const kn_identification *w, const char *kept)
{
    char begin[sizeof KN_PRESS_FIT_MARK] = "";
    FILE *f = *kept ? fopen(kept, "r") : NULL;
    const bool ours = !f || (fread(begin, 1, sizeof begin - 1, f) > 0 && !strcmp(begin, KN_PRESS_FIT_MARK));
    if (f) fclose(f);
    if (ours) return KN_EXIT_OK;
    return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                       "%s: is needed for a fit that is interrupted, but was not written by knead identify press",
                       kept);
}

// Refuse a press that is too deep, and a specimen that is not pressed as a whole.
static int try_press(const kn_identification *w, int press)
{
    const kn_press_record *p = &w->press.press[press];
    const kn_curve *c = p->curve;
    double extent_m[3], deepest = -INFINITY;
    kn_model_def_extent(&w->scene[0]->model, extent_m);
    if (kn_press_of_specimen(p)) extent_m[2] = c->height_m;
    for (int i = 0; i < c->count; i++) deepest = fmax(deepest, c->other[i]);
    const double depth_m = deepest - c->other[kn_curve_touch(c)], most_m = 0.8 * extent_m[2];
    if (depth_m > most_m)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "%s: a press of %.3g mm, expected at most %.3g mm (0.8 of the height)", c->file,
                           1e3 * depth_m, 1e3 * most_m);
    const double side_m = sqrt(c->area_m2);
    if (!kn_press_of_specimen(p) ||
        (p->tool->shape == KN_PROBE_PLATE && p->tool->size_m[0] >= side_m && p->tool->size_m[1] >= side_m))
        return KN_EXIT_OK;
    return kn_complain(
        w->opt.subcommand, KN_EXIT_USAGE,
        "%s: has the height and area of a specimen, but the tool '%s' is no plate as wide as that; expected "
        "such a plate, or no such notes",
        c->file, p->tool->name);
}

static void hash_record(kn_press_fit *f, const kn_curve *c)
{
    const double *const each[] = {c->time_s, c->value, c->other}, size[] = {c->height_m, c->area_m2};
    for (int i = 0; i < 3 && each[i]; i++)
        f->inputs = kn_hash_bytes(f->inputs, each[i], (size_t)c->count * sizeof **each);
    for (int i = 0; i < c->steps; i++) {
        const double step[] = {c->step[i].time_s, c->step[i].stress_pa};
        f->inputs = kn_hash_bytes(f->inputs, step, sizeof step);
    }
    f->inputs = kn_hash_bytes(f->inputs, size, sizeof size);
}

static int fit(kn_identification *w)
{
    static const kn_probe_def weight = {.name = "weight", .shape = KN_PROBE_PLATE};
    static char kept[PATH_MAX];
    static kn_model_def object;
    kn_press_fit *f = &w->press;
    const kn_curve_options *o = &w->opt.curve;
    if (w->opt.creeps == 0 &&
        fmax(fmax(o->height_m, o->area_m2), fmax(o->load_n, fmax(o->stress_pa, o->release_s))) > 0)
        return kn_complain(
            w->opt.subcommand, KN_EXIT_USAGE,
            "--load, --stress, --height, --area and --release are of creep: expected --creep FILE with them; "
            "a press of a specimen needs notes '# height:' and '# area:' in its file");
    int code = load_object(w);
    if (code != KN_EXIT_OK) return code;
    object = w->scene[0]->model;
    // A material whose damper does not depend on the stress says nothing about P0 and P1, and one without a spring nothing
    // about k1, so begin with the dough.
    if (object.material.damper != KN_DAMPER_EXPONENTIAL || !(object.material.k1_pa > 0))
        object.material = kn_model_def_default().material;
    if (w->opt.density_kg_m3 > 0) object.density_kg_m3 = w->opt.density_kg_m3;
    f->presses = w->curves, f->fitted = w->curves - w->opt.helds; // a file of creep may have several curves
    f->inputs = kn_hash_bytes(KN_HASH_SEED, w->scene[0]->text, strlen(w->scene[0]->text));
    for (int k = 0; k < w->curves && code == KN_EXIT_OK; k++) {
        const kn_curve *c = &w->curve[k];
        const char *name = *c->tool ? c->tool : w->opt.tool;
        f->press[k].curve = c;
        code = cut_specimen(w, &object, k);
        hash_record(f, c);
        if (c->kind == KN_CURVE_CREEP) f->press[k].tool = &weight;
        if (code != KN_EXIT_OK || c->kind == KN_CURVE_CREEP) continue;
        if (!name)
            return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                               "%s: the tool is not known, expected --tool, or a line '# tool: NAME' in the file",
                               c->file);
        code = find_tool(w, k, name);
        const char *from = w->scene[1 + k] ? w->scene[1 + k]->text : name;
        f->inputs = kn_hash_bytes(f->inputs, from, strlen(from));
        if (code == KN_EXIT_OK) code = try_press(w, k);
    }
    if (code != KN_EXIT_OK) return code;
    f->subcommand = w->opt.subcommand, f->object = &object, f->compliance_m_n = w->opt.compliance_m_n;
    const double more[] = {f->compliance_m_n, object.density_kg_m3, f->fitted};
    f->inputs = kn_hash_bytes(f->inputs, more, sizeof more);
    snprintf(kept, sizeof kept, "%s%s", w->opt.out ? w->opt.out : "", w->opt.out ? ".fit" : "");
    f->resume = kept;
    code = try_kept(w, kept);
    if (code == KN_EXIT_OK) code = try_scene(w);
    return code == KN_EXIT_OK ? kn_press_fit_run(f) : code;
}

static double worst_left(const kn_press_fit *f)
{
    double worst = 0;
    for (int k = 0; k < f->fitted; k++)
        if (!(f->press[k].left <= worst)) worst = f->press[k].left; // not fmax, which would hide a NaN
    return worst;
}

// ---- results

static void doubt(kn_identification *w)
{
    const kn_press_fit *f = &w->press;
    if (f->resumed) kn_identify_note(w, "the fit went on where an earlier one was interrupted");
    if (!(worst_left(f) <= KN_IDENTIFY_FOLLOWS))
        kn_identify_note(
            w,
            "this lattice cannot follow the records: up to %.0f %% of the largest value of one are left; try another "
            "structure of the object: gas in its cells, or other diagonals",
            100 * worst_left(f));
    for (int k = 0; k < f->presses; k++) {
        const kn_press_record *p = &f->press[k];
        if (p->pull_n_s > 0)
            kn_identify_note(
                w,
                "%s: a pull of %.3g N s is left out, since the tool has no adhesion; if the object sticks, give the "
                "probe an adhesion",
                p->curve->name, p->pull_n_s);
        if (k >= f->fitted && !(p->left <= KN_IDENTIFY_FOLLOWS))
            kn_identify_note(w, "%s: the law does not predict this press: %.0f %% of its largest force are left",
                             p->curve->name, 100 * p->left);
    }
    if (f->replicates < 2)
        kn_identify_note(w, "%s: the intervals cover noise only, not the differences between objects; press another",
                         f->replicates ? "one press of the object" : "no press of the object");
    else if (f->replicates < f->fitted)
        kn_identify_note(w, "the intervals cover the differences between objects, but not those between specimens");
}

// Describe how well presses are predicted that are not in the fit.
static void predicted(const kn_press_fit *f, char *text, size_t size)
{
    int used = 0;
    *text = 0;
    for (int k = f->fitted; k < f->presses && used < (int)size - 120; k++)
        used += snprintf(text + used, size - (size_t)used, "%s %s %.2g",
                         k > f->fitted ? "," : "Predicted, not fitted, left %:", f->press[k].curve->name,
                         100 * f->press[k].left);
    const char *before = used > 0 ? ". Left out in turn, left %:" : "Left out in turn and predicted, left %:";
    for (int k = 0; k < f->fitted && used < (int)size - 120; k++) {
        if (isnan(f->press[k].lone)) continue;
        used += snprintf(text + used, size - (size_t)used, "%s %.2g", before, 100 * f->press[k].lone);
        before = ",";
    }
    if (used == 0) used = snprintf(text, size, "No other press was predicted");
    const kn_probe_def *first = NULL;
    bool one = true; // all tools that pressed the object have one shape
    for (int k = 0; k < f->presses; k++) {
        if (kn_press_of_specimen(&f->press[k])) continue;
        if (!first) first = f->press[k].tool;
        one &= f->press[k].tool->shape == first->shape;
    }
    if (one)
        snprintf(text + used, size - (size_t)used,
                 ". All tools had one shape: the force on another shape may be 15 %% off");
}

// Return the mean half width of the 95 % band of a press, as a share of its largest force.
static double band_of(const kn_press_record *p)
{
    double sum = 0;
    for (int i = 0; i < p->curve->count; i++) sum += p->band_n[i];
    return sum / p->curve->count / kn_curve_largest(p->curve);
}

static void tell(kn_identification *w)
{
    const kn_press_fit *f = &w->press;
    char text[400];
    printf("\n%-7s %s\n", "", "best value and 95 % interval");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) kn_identify_print_number(&f->number[i], 7, 44, "");
    if (f->compliance.name) kn_identify_print_number(&f->compliance, 7, 44, "  frame and gauge give way");
    printf("\n%-20s %12s %12s %12s %16s\n", "press", "touch, mm", "left, %", "band, %", "left out, %");
    for (int k = 0; k < f->presses; k++) {
        const kn_press_record *p = &f->press[k];
        char lone[20] = "-";
        if (k < f->fitted && !isnan(p->lone)) snprintf(lone, sizeof lone, "%.2g", 100 * p->lone);
        const bool creep = p->curve->kind == KN_CURVE_CREEP;
        char touch[20] = "-";
        if (!creep) snprintf(touch, sizeof touch, "%.4g", 1e3 * p->touch_m);
        printf("%-20s %12s %12.2g %12.2g %16s%s\n", p->curve->name, touch, 100 * p->left, 100 * band_of(p), lone,
               creep           ? "   creep"
               : k < f->fitted ? ""
                               : "   predicted, not fitted");
        json_t *row = kn_result_add("presses");
        kn_result_text(row, "name", p->curve->name);
        kn_result_text(row, "kind", creep ? "creep" : kn_press_of_specimen(p) ? "specimen" : "press");
        if (!creep) kn_result_text(row, "tool", p->tool->name);
        if (!creep) kn_result_number(row, "touch_m", p->touch_m);
        kn_result_number(row, "left", p->left);
        kn_result_number(row, "band", band_of(p));
        kn_result_number(row, "left_when_left_out", p->lone);
        kn_result_number(row, "pull_left_out_n_s", p->pull_n_s);
        kn_result_text(row, "role", k < f->fitted ? "fitted" : "predicted");
    }
    printf("left: rms difference of the forces, %% of the largest, as kneadd steps the lattice; of the strains for "
           "creep,\n"
           "in steps of 30 ms.\n"
           "band: half of the 95 %% band, on average: of noise and of uncertain numbers; what the law cannot do is not "
           "in it.\n"
           "left out: the same as left, for a fit without this press\n");
    predicted(f, text, sizeof text);
    printf("%s\nthe lattice was pressed %d times\n\n", text, f->runs);
    doubt(w);
    kn_identify_tell_numbers(KN_ESTIMATE_NUMBERS, f->number);
    if (f->compliance.name) kn_identify_tell_numbers(1, &f->compliance);
}

static bool csv_rows(const kn_identification *w, FILE *out)
{
    for (int k = 0; k < w->press.presses; k++) {
        const kn_press_record *p = &w->press.press[k];
        const kn_curve *c = p->curve;
        for (int i = 0; i < c->count; i++) {
            kn_table_text(c->name, out);
            if (c->kind == KN_CURVE_CREEP)
                fprintf(out, ",%.9g,,,,,%.9g,%.9g,%.9g,%.9g\n", c->time_s[i], c->weight[i], c->value[i], p->model_n[i],
                        p->band_n[i]);
            else
                fprintf(out, ",%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,,,\n", c->time_s[i], c->other[i], c->value[i],
                        p->model_n[i], p->band_n[i], c->weight[i]);
        }
    }
    return true;
}

static int draw(kn_identification *w, const char *path)
{
    static kn_figure_panel p[3];
    const kn_press_fit *f = &w->press;
    int all = 0;
    for (int k = 0; k < f->presses; k++) all += f->press[k].curve->count;
    double *edge = calloc(2 * (size_t)all, sizeof *edge), *at = edge;
    if (!edge) return kn_complain(w->opt.subcommand, KN_EXIT_DEVICE, "out of memory");
    p[0] = (kn_figure_panel){.title = "force over time, with 95 % band", .x_label = "time, s", .y_label = "force, N"};
    p[1] = (kn_figure_panel){.title = "force over depth", .x_label = "depth reading, mm", .y_label = "force, N"};
    p[2] = (kn_figure_panel){.title = "creep, with 95 % band", .x_label = "time, s", .y_label = "strain"};
    for (int k = 0; k < f->presses && 4 * k + 4 <= KN_FIGURE_SERIES; k++) {
        const kn_press_record *r = &f->press[k];
        const kn_curve *c = r->curve;
        const kn_figure_look look = k < f->fitted ? KN_FIGURE_LINE : KN_FIGURE_DASHES;
        for (int i = 0; i < c->count; i++)
            at[i] = r->model_n[i] - r->band_n[i], at[c->count + i] = r->model_n[i] + r->band_n[i];
        const int begin = c->kind == KN_CURVE_CREEP ? 2 : 0, end = begin + (begin ? 1 : 2);
        for (int q = begin; q < end; q++) {
            const double *x = q == 1 ? c->other : c->time_s, scale = q == 1 ? 1e3 : 1;
            kn_figure_add(&p[q], (kn_figure_series){c->name, c->count, x, c->value, scale, 1, KN_FIGURE_POINTS, k + 1});
            kn_figure_add(&p[q], (kn_figure_series){k < f->fitted ? "fitted" : "predicted", c->count, x, r->model_n,
                                                    scale, 1, look, k ? k + 1 : 0});
        }
        for (int q = 0; q < 2; q++)
            kn_figure_add(&p[begin], (kn_figure_series){NULL, c->count, c->time_s, at + q * c->count, 1, 1,
                                                        KN_FIGURE_DASHES, k + 1});
        at += 2 * c->count;
    }
    const int panels = w->opt.creeps > 0 ? 3 : 2;
    const int code = kn_figure_draw(w->opt.subcommand, path, "presses, and the lattice", p, panels, 2);
    free(edge);
    return code;
}

// Write the object's scene with the fitted material, its tools and its label.
static int write_scene(const kn_identification *w, const char *path)
{
    const kn_press_fit *f = &w->press;
    char origin[600], source[KN_SOURCE_MAX], told[400], label[1400], error[600];
    kn_material_source(w->opt.file[0], f->fitted, source);
    if (!(worst_left(f) <= KN_IDENTIFY_FOLLOWS) && !w->opt.anyway)
        return kn_complain(
            w->opt.subcommand, KN_EXIT_FAILED,
            "--out %s: not written, the lattice leaves up to %.0f %% of a record's largest value; expected another "
            "structure, or --anyway",
            path, 100 * worst_left(f));
    predicted(f, told, sizeof told);
    int used =
        snprintf(label, sizeof label,
                 "label: >-\n  fitted to presses with %s, %s: cells of %.3g mm. Left on the %s, rms, in %% of the "
                 "largest:",
                 f->press[0].tool->name, source, 1e3 * f->object->spacing_m,
                 w->opt.creeps > 0 ? "forces, and on the strains of creep" : "forces");
    for (int k = 0; k < f->fitted && k < 12; k++)
        used += snprintf(label + used, sizeof label - (size_t)used, "%s %.2g", k ? "," : "", 100 * f->press[k].left);
    snprintf(label + used, sizeof label - (size_t)used, "%s. %s.\n",
             !(worst_left(f) <= KN_IDENTIFY_FOLLOWS) ? ": too much" : "", told);
    snprintf(origin, sizeof origin, "press from %s: %d record%s.", source, f->fitted, f->fitted > 1 ? "s" : "");
    char *text = scene_text(w, label, error, sizeof error);
    if (!text) return kn_complain(w->opt.subcommand, KN_EXIT_INTERNAL, "%s: %s", path, error);
    const int code = kn_material_file_write(w->opt.subcommand, path, origin, text, &f->material,
                                            f->object->density_kg_m3, KN_ESTIMATE_NUMBERS, f->number);
    free(text);
    if (code == KN_EXIT_OK && *f->resume && path == w->opt.out) remove(f->resume);
    return code;
}

static int report(kn_identification *w, kn_document *d)
{
    char path[PATH_MAX], text[400];
    const kn_press_fit *f = &w->press;
    kn_document_section(d, "The material");
    kn_document_table(d, "Parameters of the lattice's edges", "lrl", "parameter\tbest value and 95 % interval\tremark");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) kn_identify_page_number(d, &f->number[i]);
    if (f->compliance.name) kn_identify_page_number(d, &f->compliance);
    kn_document_table(d, "Records: what is left, in % of the largest force, or strain of creep", "lrr",
                      "press\tfitted, or predicted\tleft out of the fit");
    for (int k = 0; k < f->presses; k++) {
        char lone[20] = "-";
        if (!isnan(f->press[k].lone)) snprintf(lone, sizeof lone, "%.2g", 100 * f->press[k].lone);
        kn_document_row(d, "%s%s\t%.2g\t%s", f->press[k].curve->name, k < f->fitted ? "" : " (predicted)",
                        100 * f->press[k].left, lone);
    }
    predicted(f, text, sizeof text);
    kn_document_text(d, "%s.", text);
    for (int i = 0; i < w->notes; i++) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", w->note[i]);
    const int code = draw(w, kn_document_file(d, "fit.png", path));
    if (code != KN_EXIT_OK) return code;
    kn_document_picture(d, "fit.png",
                        "Force over time and over depth of every press, and creep, with what the lattice does",
                        "Points: measured. Lines: fitted. Dashes: predicted, and the 95 % bands.");
    int done = kn_identify_page_files(w, d, "readings.csv", "readings and fit", false);
    if (done != KN_EXIT_OK || !(worst_left(f) <= KN_IDENTIFY_FOLLOWS || w->opt.anyway)) return done;
    kn_document_link(d, "scene.yaml", "the scene with the fitted material, for kneadd");
    return write_scene(w, kn_document_file(d, "scene.yaml", path));
}

const kn_identify_experiment kn_identify_press = {.subcommand = "identify press",
                                                  .title = "Material from presses",
                                                  .help = help,
                                                  .letter = 'p',
                                                  .kind = KN_CURVE_PRESS,
                                                  .fit = fit,
                                                  .tell = tell,
                                                  .csv_head =
                                                      "press,time_s,depth_m,force_n,fit_n,band_n,readings,strain,"
                                                      "fit_strain,band_strain",
                                                  .csv_rows = csv_rows,
                                                  .draw = draw,
                                                  .report = report,
                                                  .write_material = write_scene};
