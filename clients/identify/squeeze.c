#include "clients/identify/squeeze.h"
#include "clients/shape/press_protocol.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/progress.h"
#include "clients/knead/shot.h"
#include "clients/viewer/image.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDE = 560, HIGH = 400 }; // width and height of a picture [pixels]

typedef struct bar {
    kn_progress progress;
    int64_t done;
} bar;

static void told(void *of, int64_t ticks)
{
    bar *b = of;
    kn_progress_step(&b->progress, (double)(b->done += ticks));
}

// Return the depth of the dent: how far the lowest of the vertices that formed the top at rest is below the top at
// rest.
static double dent(const kn_model *model, const kn_surface *s, const float (*now)[3])
{
    double top = -INFINITY, deepest = 0, rest[3];
    for (int v = 0; v < s->vertex_count; v++) {
        kn_surface_rest(s, model, v, rest);
        top = fmax(top, rest[2]);
    }
    for (int v = 0; v < s->vertex_count; v++) {
        kn_surface_rest(s, model, v, rest);
        if (rest[2] > top - 1e-9) deepest = fmax(deepest, top - now[v][2]);
    }
    return deepest;
}

// Draw the block at one moment. The tool is drawn only at the end of the hold.
static int draw(const char *subcommand, const kn_model *model, const kn_state *rest, const kn_press *press,
                const kn_pressed *done, int moment, const char *png)
{
    char error[200] = "out of memory";
    uint8_t *rgba = malloc((size_t)4 * WIDE * HIGH);
    kn_still still = {.view = kn_view_scene_default()};
    kn_shot *shot = rgba ? kn_shot_open(WIDE, HIGH, 4, error, sizeof error) : NULL;
    bool ok = shot && kn_still_state(&still, model, rest) && still.vertex_count == done->vertex_count;
    if (ok) memcpy(still.now, done->shape_m[moment], (size_t)still.vertex_count * sizeof *still.now);
    if (ok && moment == 0) {
        const int64_t tick = kn_press_tick(press, press->hold_end_s);
        const kn_probe_input *in = &press->input[tick * press->probes + press->probe];
        kn_still_probe(&still, &model->def.probe[press->probe], in->position_m, in->orientation_wxyz,
                       (const double[3]){0, 0, done->force_n[tick]}, 1);
    }
    ok = ok && kn_shot_take(shot, &still, NULL, KN_SHOT_PLAIN, rgba, error, sizeof error) &&
         kn_image_write_png(png, WIDE, HIGH, rgba, error, sizeof error);
    kn_still_free(&still);
    kn_shot_close(shot);
    free(rgba);
    return ok ? KN_EXIT_OK : kn_complain(subcommand, KN_EXIT_DEVICE, "%s: %s", png, error);
}

// Copy time and force, and find the largest force and that at the end of the hold.
static bool keep(kn_squeeze *q, const kn_press *press, const kn_pressed *done)
{
    q->ticks = done->ticks;
    q->time_s = calloc(2 * (size_t)done->ticks + 1, sizeof *q->time_s);
    if (!q->time_s) return false;
    q->force_n = q->time_s + done->ticks;
    for (int64_t t = 0; t < done->ticks; t++) {
        q->time_s[t] = press->time_s[t];
        q->force_n[t] = done->force_n[t];
        q->peak_n = fmax(q->peak_n, done->force_n[t]);
        if (q->time_s[t] <= press->hold_end_s) q->held_n = done->force_n[t];
    }
    return true;
}

// Press the block, keep the force, draw both moments and measure the dents.
static int play(kn_squeeze *q, const char *subcommand, const kn_scene *scene, const kn_model *model,
                const char *const png[2])
{
    char error[300];
    kn_press press = {0};
    kn_pressed done = {0};
    kn_surface *surface = kn_surface_create(model);
    kn_state *rest = kn_state_create(model);
    int code = KN_EXIT_OK;
    if (!surface || !rest || !kn_press_path(&press, scene, &(kn_press_def){0}, error, sizeof error))
        code = kn_complain(subcommand, KN_EXIT_USAGE, "%s", surface && rest ? error : "out of memory");
    if (code == KN_EXIT_OK) {
        bar b = {.progress = kn_progress_open("press", (double)press.ticks)};
        const double moment[2] = {press.hold_end_s, press.end_s};
        const kn_press_play how = {model, surface, 2, moment, press.end_s, told, &b};
        bool ok = kn_press_run(&press, &how, &done) && keep(q, &press, &done);
        kn_progress_close(&b.progress);
        if (!ok) code = kn_complain(subcommand, KN_EXIT_FAILED, "the block of this material came apart under a plate");
    }
    for (int m = 0; m < 2 && code == KN_EXIT_OK; m++) code = draw(subcommand, model, rest, &press, &done, m, png[m]);
    if (code == KN_EXIT_OK) {
        q->pressed_m = dent(model, surface, (const float(*)[3])done.shape_m[0]);
        q->left_m = dent(model, surface, (const float(*)[3])done.shape_m[1]);
    }
    kn_pressed_free(&done);
    kn_press_free(&press);
    kn_state_destroy(rest);
    kn_surface_destroy(surface);
    return code;
}

int kn_squeeze_run(kn_squeeze *q, const char *subcommand, const char *path, const char *const png[2])
{
    char error[512];
    *q = (kn_squeeze){.ticks = 0};
    kn_scene *scene = kn_scene_load(path, NULL, 0, error, sizeof error);
    kn_model *model = scene ? kn_model_build(&scene->model, error, sizeof error) : NULL;
    int code = model ? play(q, subcommand, scene, model, png) : kn_complain(subcommand, KN_EXIT_USAGE, "%s", error);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return code;
}

void kn_squeeze_free(kn_squeeze *q)
{
    free(q->time_s);
    *q = (kn_squeeze){.ticks = 0};
}
