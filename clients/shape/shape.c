// The command `knead identify shape`: find the structure whose model behaves like a measured lump that was pressed (the
// first paper's section 5 and outlook).
#include "clients/shape/shape_files.h"
#include "clients/shape/shape_report.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/progress.h"
#include "clients/knead/result.h"
#include "clients/viewer/beside.h"
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

static const char me[] = "identify shape";

// ---- the fits, several in parallel

typedef struct crew {
    kn_candidate *candidate;
    const kn_evidence *evidence;
    int count, next;
    bool short_of_memory;
    kn_progress bar;
    double done, total; // number of ticks simulated so far, and expected in all fits
    pthread_mutex_t lock;
} crew;

// Advance the progress bar; called by all threads.
static void told(void *of, int64_t ticks)
{
    crew *w = of;
    pthread_mutex_lock(&w->lock);
    w->done += (double)ticks;
    // the fits need more presses than expected, so increase the expected total
    if (w->done > 0.95 * w->total) w->total = w->done / 0.95;
    w->bar.total = w->total;
    kn_progress_step(&w->bar, w->done);
    pthread_mutex_unlock(&w->lock);
}

// Thread function: fit the next candidate until all candidates are fitted.
static void *toil(void *of)
{
    crew *w = of;
    for (;;) {
        pthread_mutex_lock(&w->lock);
        const int mine = w->next++;
        pthread_mutex_unlock(&w->lock);
        if (mine >= w->count) return NULL;
        if (!kn_candidate_fit(&w->candidate[mine], w->evidence, told, w)) w->short_of_memory = true;
    }
}

// Fit all candidates with up to `jobs` threads, including this one.
static int fit_all(kn_candidate *candidate, int count, const kn_evidence *evidence, int jobs)
{
    pthread_t thread[KN_CANDIDATES];
    crew w = {.candidate = candidate, .evidence = evidence, .count = count};
    int started = 0;
    for (int i = 0; i < count; i++) w.total += kn_candidate_work(&candidate[i], evidence);
    pthread_mutex_init(&w.lock, NULL);
    w.bar = kn_progress_open("presses", w.total);
    while (started < jobs - 1 && started < count - 1 && pthread_create(&thread[started], NULL, toil, &w) == 0)
        started++;
    toil(&w);
    for (int i = 0; i < started; i++) pthread_join(thread[i], NULL);
    kn_progress_close(&w.bar);
    pthread_mutex_destroy(&w.lock);
    return w.short_of_memory ? kn_complain(me, KN_EXIT_INTERNAL, "out of memory") : KN_EXIT_OK;
}

// ---- files

// Write the scene of the best structure, with the verdict as a comment.
static int write_scene(const kn_shape_options *o, const kn_candidate *best, const kn_verdict *v)
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

// Write the range image of the best structure in the frame of the first image.
static int write_depth(const kn_shape_options *o, const kn_evidence *e, const kn_candidate *best)
{
    char error[600], title[100];
    const kn_surface *s = best->best.surface;
    // drawn at the shifted place but saved with the stated place, so that its pixels match those of the measured image
    kn_range frame = e->relief[0].frame;
    uint16_t *level = malloc((size_t)frame.width * (size_t)frame.height * sizeof *level);
    if (!level) return kn_complain(me, KN_EXIT_INTERNAL, "out of memory");
    frame.left_m += best->shift_m[0];
    frame.top_m += best->shift_m[1];
    kn_range_draw(&frame, (const float(*)[3])best->best.pressed.shape_m[0], s->triangle_count,
                  (const int(*)[3])s->triangle, level);
    frame.left_m = e->relief[0].frame.left_m;
    frame.top_m = e->relief[0].frame.top_m;
    snprintf(title, sizeof title, "%s at %.3f s", best->name, e->moment_s[0]);
    const bool ok = kn_range_save(o->out_depth, &frame, title, level, error, sizeof error);
    free(level);
    return ok ? KN_EXIT_OK : kn_complain(me, KN_EXIT_DEVICE, "%s", error);
}

static int write_files(const kn_shape_options *o, const kn_evidence *e, const kn_candidate *c, const kn_verdict *v)
{
    const kn_candidate *best = &c[v->best];
    int code = o->out ? write_scene(o, best, v) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && o->out_depth) code = write_depth(o, e, best);
    return code == KN_EXIT_OK && o->png ? kn_shape_draw(o, e, best) : code;
}

// ---- the command

// Press the best structure in cells of half the width and report the change.
static int press_finer(const kn_shape_options *o, const kn_evidence *e, const kn_candidate *best)
{
    char error[600];
    kn_candidate finer;
    if (best->scene->model.mesh) { // the cells of a mesh cannot be halved, so only report that
        printf("\n%s is a mesh: not pressed again with halved cells.\n", best->name);
        return KN_EXIT_OK;
    }
    if (!kn_candidate_finer(&finer, best, &o->scene, error, sizeof error))
        return kn_complain(me, KN_EXIT_USAGE, "--finer: %s", error);
    const int code = fit_all(&finer, 1, e, 1);
    if (code == KN_EXIT_OK) kn_shape_print_finer(e, best, &finer);
    kn_candidate_free(&finer);
    return code;
}

// Check before the fits for errors that would otherwise appear only after them. Structures of blocks come first among
// the candidates.
static int check_wanted(const kn_shape_options *o, const kn_candidate *candidate)
{
    if (candidate[0].scene->model.thickness_m > 0)
        return kn_complain(me, KN_EXIT_USAGE, "%s: the object is flat, expected three dimensions", o->scene.scene_path);
    if (o->finer && candidate[0].scene->model.mesh)
        return kn_complain(me, KN_EXIT_USAGE, "--finer: %s is a mesh, expected a block among the structures",
                           candidate[0].name);
    if (o->png && o->depths == 0 && !o->force && !o->log)
        return kn_complain(me, KN_EXIT_USAGE, "--png %s: expected --depth or a force, points are not drawn", o->png);
    return KN_EXIT_OK;
}

// Refuse --png if the log turned out to have no forces.
static int check_drawn(const kn_shape_options *o, const kn_evidence *e)
{
    if (!o->png || o->depths > 0 || e->pulled) return KN_EXIT_OK;
    return kn_complain(me, KN_EXIT_USAGE, "--png %s: expected --depth or a force, %s has none and points are not drawn",
                       o->png, o->log);
}

static int identify(const kn_shape_options *o, kn_candidate *candidate, int count)
{
    kn_evidence e;
    kn_verdict v;
    int code = check_wanted(o, candidate);
    if (code != KN_EXIT_OK) return code;
    kn_shape_print_object(o, candidate);
    code = kn_shape_measured(&e, o, &candidate[0]);
    if (code != KN_EXIT_OK) return code;
    code = check_drawn(o, &e);
    if (code == KN_EXIT_OK) code = fit_all(candidate, count, &e, o->jobs);
    if (code == KN_EXIT_OK) {
        kn_verdict_make(&v, count, candidate, &e);
        kn_shape_print(o, &e, candidate, count, &v);
        if (v.best < 0) code = kn_complain(me, KN_EXIT_USAGE, "%s", v.words);
        else code = write_files(o, &e, candidate, &v);
        if (code == KN_EXIT_OK && o->finer) code = press_finer(o, &e, &candidate[v.best]);
    }
    kn_evidence_free(&e);
    return code;
}

static int run(const kn_shape_options *o)
{
    char error[700];
    kn_candidate candidate[KN_CANDIDATES] = {0};
    int code = kn_shape_files_try(o);
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
    if (code == KN_EXIT_OK && !o.help) code = run(&o);
    kn_shape_options_free(&o);
    kn_result_close(code);
    return code;
}
