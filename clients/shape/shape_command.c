// The command `knead identify shape`: find the structure whose model behaves like a measured lump that was pressed (the
// first paper's section 5 and outlook).
#include "clients/shape/shape_command.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/viewer/beside.h"
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <yaml.h>

static const char me[] = "identify shape";

// ---- checking the output files

enum { INPUTS = KN_PRESS_MOMENTS + 5, OUTPUTS = 3 };

typedef struct named {
    // input or output file: its path, and the option that names it; path NULL: the file was not requested
    const char *option, *path;
} named;

// Return whether a word in a scene is the path of this output. The output must already exist as a file: a scene can
// then use it as a material, a device or a mesh. A word without a dot or a slash is a built-in name, not a path.
static bool is_output(const char *folder, int folder_length, const char *word, const char *output)
{
    char path[2 * PATH_MAX];
    struct stat there;
    if (!strpbrk(word, "./")) return false;
    snprintf(path, sizeof path, "%.*s%s", *word == '/' ? 0 : folder_length, folder, word);
    return stat(path, &there) == 0 && S_ISREG(there.st_mode) && kn_output_same(path, output);
}

// Return whether a YAML file names this output. If `file` is NULL, search the YAML text `text`. Only the part that can
// be parsed is searched.
static bool names(FILE *file, const char *text, const char *folder, int folder_length, const char *output)
{
    yaml_parser_t parser;
    yaml_event_t e;
    bool found = false;
    if (!yaml_parser_initialize(&parser)) return false;
    if (file) yaml_parser_set_input_file(&parser, file);
    else yaml_parser_set_input_string(&parser, (const unsigned char *)text, text ? strlen(text) : 0);
    for (bool done = false; !done && yaml_parser_parse(&parser, &e); yaml_event_delete(&e)) {
        done = e.type == YAML_STREAM_END_EVENT;
        if (e.type == YAML_SCALAR_EVENT)
            found |= is_output(folder, folder_length, (const char *)e.data.scalar.value, output);
    }
    yaml_parser_delete(&parser);
    return found;
}

// Return whether the scene file names this output.
static bool scene_names(const char *scene, const char *output)
{
    const char *slash = strrchr(scene, '/');
    FILE *f = fopen(scene, "rb");
    // kn_scene_load reports the missing file later
    if (!f) return false;
    const bool found = names(f, NULL, scene, slash ? (int)(slash - scene) + 1 : 0, output);
    fclose(f);
    return found;
}

// Refuse an output that is also an input. Inputs are the files that options name and the files that the scene or a
// --set option names.
static int try_output(const kn_shape_options *o, const named *out)
{
    const named in[INPUTS] = {{"the scene", o->scene.scene_path},
                              {"--mesh", o->scene.mesh},
                              {"--points", o->points},
                              {"--force", o->force},
                              {"--log", o->log},
                              {"--depth", o->depth[0]},
                              {"--depth", o->depth[1]},
                              {"--depth", o->depth[2]},
                              {"--depth", o->depth[3]}};
    for (int i = 0; i < INPUTS; i++)
        if (kn_output_same(in[i].path, out->path))
            return kn_complain(me, KN_EXIT_USAGE, "%s %s: is also the input %s %s, expected another file to write",
                               out->option, out->path, in[i].option, in[i].path);
    if (scene_names(o->scene.scene_path, out->path))
        return kn_complain(me, KN_EXIT_USAGE, "%s %s: is also an input, which %s names, expected another file to write",
                           out->option, out->path, o->scene.scene_path);
    for (int i = 0; i < o->scene.set_count; i++) {
        const char *value = strchr(o->scene.sets[i], '=');
        if (value && names(NULL, value + 1, "", 0, out->path))
            return kn_complain(me, KN_EXIT_USAGE,
                               "%s %s: is also an input, which --set %s names, expected another file to write",
                               out->option, out->path, o->scene.sets[i]);
    }
    return KN_EXIT_OK;
}

// Check before the fits that the outputs can be written. No output may be an input or a file that the scene names. All
// outputs must be different files.
static int try_outputs(const kn_shape_options *o)
{
    const named out[OUTPUTS] = {{"--out", o->out}, {"--out-depth", o->out_depth}, {"--png", o->png}};
    int code = KN_EXIT_OK;
    for (int i = 0; i < OUTPUTS && code == KN_EXIT_OK; i++)
        if (out[i].path) code = try_output(o, &out[i]);
    for (int i = 0; i < OUTPUTS && code == KN_EXIT_OK; i++)
        for (int k = 0; k < i; k++)
            if (kn_output_same(out[i].path, out[k].path))
                return kn_complain(me, KN_EXIT_USAGE, "%s %s and %s %s are one file, expected a file for each",
                                   out[k].option, out[k].path, out[i].option, out[i].path);
    if (code == KN_EXIT_OK && o->out) code = kn_output_try(me, o->out);
    if (code == KN_EXIT_OK && o->out_depth) code = kn_output_try(me, o->out_depth);
    return code == KN_EXIT_OK && o->png ? kn_plot_try(me, o->png) : code;
}

// ---- the fits, several in parallel

typedef struct fit_queue {
    kn_candidate *candidate;
    const kn_measurement *measurement;
    int count, next;
    bool short_of_memory;
    kn_progress bar;
    double done, total; // done: number of ticks simulated so far; total: number of ticks expected in all fits
    pthread_mutex_t lock;
} fit_queue;

// Advance the progress bar. All threads call this function.
static void advance(void *of, int64_t ticks)
{
    fit_queue *q = of;
    pthread_mutex_lock(&q->lock);
    q->done += (double)ticks;
    // the fits need more presses than expected, so raise the expected total
    if (q->done > 0.95 * q->total) q->total = q->done / 0.95;
    q->bar.total = q->total;
    kn_progress_step(&q->bar, q->done);
    pthread_mutex_unlock(&q->lock);
}

// Thread function: fit the next candidate until all candidates are fitted.
static void *fit_next(void *of)
{
    fit_queue *q = of;
    for (;;) {
        pthread_mutex_lock(&q->lock);
        const int mine = q->next++;
        pthread_mutex_unlock(&q->lock);
        if (mine >= q->count) return NULL;
        if (!kn_candidate_fit(&q->candidate[mine], q->measurement, advance, q)) q->short_of_memory = true;
    }
}

// Fit all candidates with a thread per processor, including the calling thread.
static int fit_all(kn_candidate *candidate, int count, const kn_measurement *m)
{
    const long jobs = sysconf(_SC_NPROCESSORS_ONLN);
    pthread_t thread[KN_CANDIDATES];
    fit_queue q = {.candidate = candidate, .measurement = m, .count = count};
    int started = 0;
    for (int i = 0; i < count; i++) q.total += kn_candidate_work(&candidate[i], m);
    pthread_mutex_init(&q.lock, NULL);
    q.bar = kn_progress_open("presses", q.total);
    while (started < jobs - 1 && started < count - 1 && pthread_create(&thread[started], NULL, fit_next, &q) == 0)
        started++;
    fit_next(&q);
    for (int i = 0; i < started; i++) pthread_join(thread[i], NULL);
    kn_progress_close(&q.bar);
    pthread_mutex_destroy(&q.lock);
    return q.short_of_memory ? kn_complain(me, KN_EXIT_INTERNAL, "out of memory") : KN_EXIT_OK;
}

// ---- writing the files

// Write the scene of the best structure, with the verdict as a comment.
static int write_scene(const kn_shape_options *o, const kn_candidate *best, const kn_structure_verdict *v)
{
    char error[600];
    kn_beside out;
    char *text = kn_candidate_scene(best, &o->scene, error, sizeof error);
    bool ok = text;
    if (ok && (ok = kn_beside_open(&out, o->out, error, sizeof error))) {
        fprintf(out.file, "# Structure identified by knead identify shape from %s: %s.\n# %s\n%s",
                o->depths ? o->depth[0] : o->points, best->words, v->words, text);
        ok = kn_beside_keep(&out, error, sizeof error);
    }
    free(text);
    return ok ? KN_EXIT_OK : kn_complain(me, KN_EXIT_DEVICE, "%s", error);
}

// Write the range image of the best structure in the frame of the first image, so that its pixels match those of the
// measured image.
static int write_depth(const kn_shape_options *o, const kn_measurement *m, const kn_candidate *best)
{
    char error[600], title[100];
    const kn_range *frame = &m->surface[0].frame;
    uint16_t *level = malloc((size_t)frame->width * (size_t)frame->height * sizeof *level);
    if (!level) return kn_complain(me, KN_EXIT_INTERNAL, "out of memory");
    kn_shape_draw_range(best, *frame, level);
    snprintf(title, sizeof title, "%s at %.3f s", best->name, m->moment_s[0]);
    const bool ok = kn_range_save(o->out_depth, frame, title, level, error, sizeof error);
    free(level);
    return ok ? KN_EXIT_OK : kn_complain(me, KN_EXIT_DEVICE, "%s", error);
}

static int write_files(const kn_shape_options *o, const kn_measurement *m, const kn_candidate *best,
                       const kn_structure_verdict *v)
{
    int code = o->out ? write_scene(o, best, v) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && o->out_depth) code = write_depth(o, m, best);
    return code == KN_EXIT_OK && o->png ? kn_shape_draw(o, m, best) : code;
}

// ---- the command knead identify shape

// Press the best structure once more in cells of half the width, and report the change.
static int press_finer(const kn_shape_options *o, const kn_measurement *m, const kn_candidate *best)
{
    char error[600];
    kn_candidate finer;
    // the cells of a mesh cannot be halved, so only print a remark
    if (best->scene->model.mesh) {
        printf("\n%s is a mesh, so it was not pressed again with halved cells.\n", best->name);
        return KN_EXIT_OK;
    }
    if (!kn_candidate_finer(&finer, best, &o->scene, error, sizeof error))
        return kn_complain(me, KN_EXIT_USAGE, "--finer: %s", error);
    const int code = fit_all(&finer, 1, m);
    if (code == KN_EXIT_OK) kn_shape_print_finer(m, best, &finer);
    kn_candidate_free(&finer);
    return code;
}

// Check before the fits for errors that would otherwise appear only after the fits. Blocks come first in the list of
// candidates, so if the first candidate is a mesh, all candidates are meshes.
static int check_wanted(const kn_shape_options *o, const kn_candidate *candidate)
{
    if (candidate[0].scene->model.thickness_m > 0)
        return kn_complain(me, KN_EXIT_USAGE, "%s: the object is flat, expected three dimensions", o->scene.scene_path);
    if (o->finer && candidate[0].scene->model.mesh)
        return kn_complain(me, KN_EXIT_USAGE, "--finer: %s is a mesh, expected a block among the structures",
                           candidate[0].name);
    if (o->png && o->depths == 0 && !o->force && !o->log)
        return kn_complain(me, KN_EXIT_USAGE, "--png %s: expected --depth or a force, because points are not drawn",
                           o->png);
    return KN_EXIT_OK;
}

static int identify(const kn_shape_options *o, kn_candidate *candidate, int count)
{
    kn_measurement m;
    kn_structure_verdict v;
    int code = check_wanted(o, candidate);
    if (code != KN_EXIT_OK) return code;
    kn_shape_print_object(o, candidate);
    code = kn_shape_measured(&m, o, &candidate[0]);
    if (code != KN_EXIT_OK) return code;
    // Check --png only now, because the measurements that were just read show whether the log has forces.
    if (o->png && o->depths == 0 && !m.has_force)
        code = kn_complain(me, KN_EXIT_USAGE,
                           "--png %s: expected --depth or a force: %s has no force, and points are not drawn", o->png,
                           o->log);
    if (code == KN_EXIT_OK) code = fit_all(candidate, count, &m);
    if (code == KN_EXIT_OK) {
        kn_structure_verdict_make(&v, count, candidate, &m);
        kn_shape_print(&m, candidate, count, &v);
        if (v.best < 0) code = kn_complain(me, KN_EXIT_USAGE, "%s", v.words);
        else code = write_files(o, &m, &candidate[v.best], &v);
        if (code == KN_EXIT_OK && o->finer) code = press_finer(o, &m, &candidate[v.best]);
    }
    kn_measurement_free(&m);
    return code;
}

static int run(const kn_shape_options *o)
{
    char error[700];
    kn_candidate candidate[KN_CANDIDATES] = {0};
    int code = try_outputs(o);
    if (code != KN_EXIT_OK) return code;
    const int count = kn_candidates_open(candidate, &o->scene, o->only, error, sizeof error);
    if (count == 0) return kn_complain(me, KN_EXIT_USAGE, "%s", error);
    code = identify(o, candidate, count);
    for (int i = 0; i < count; i++) kn_candidate_free(&candidate[i]);
    return code;
}

int kn_identify_shape_main(int argc, char **argv)
{
    kn_shape_options o;
    int code = kn_shape_options_parse(&o, argc, argv);
    if (code == KN_OPTIONS_READ) code = run(&o);
    kn_shape_options_free(&o);
    kn_result_close(code);
    return code;
}
