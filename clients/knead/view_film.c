#include "clients/knead/view_film.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/film.h"
#include "clients/knead/output.h"
#include "clients/knead/progress.h"
#include "clients/knead/shot.h"
#include "clients/knead/view.h"
#include "clients/knead/view_source.h"
#include <math.h>
#include <stdlib.h>

typedef struct whole { // what all pictures have in common
    int pictures;
    double most;       // of the measure
    float box[2][3];   // low, high
} whole;

static volatile sig_atomic_t stopped;
static void on_signal(int number) { stopped = number; }

static double moment(const kn_view_options *o, int picture) { return o->from_s + picture * o->speed / o->fps; }

// The object's place at rest, and beyond it only what it comes to.
static void take_in(whole *w, const kn_still *s)
{
    for (int v = 0; v < s->vertex_count; v++)
        for (int i = 0; i < 3; i++)
            for (int when = 0; when < 2; when++) {
                const float x = when ? s->now[v][i] : s->rest[v][i];
                if (!isfinite(x)) continue;
                w->box[0][i] = fminf(w->box[0][i], x);
                w->box[1][i] = fmaxf(w->box[1][i], x);
            }
    w->most = fmax(w->most, kn_still_most(s));
}

static int survey(const kn_view_options *o, whole *w)
{
    kn_source source;
    int code = kn_source_open(&source, o->log, o);
    const double ticks = code == KN_EXIT_OK ? (double)source.replay->tally.ticks_total : 1;
    kn_progress bar = kn_progress_open("looking through", ticks);
    for (; code == KN_EXIT_OK && !source.ended && moment(o, w->pictures) <= o->to_s; w->pictures++) {
        kn_still still = {.view = o->look};
        code = kn_source_to(&source, moment(o, w->pictures));
        if (code == KN_EXIT_OK && source.ended && w->pictures > 0) break; // that moment is not in it
        if (code == KN_EXIT_OK) code = kn_source_still(&source, o, &still);
        if (code == KN_EXIT_OK) take_in(w, &still);
        kn_still_free(&still);
        kn_progress_step(&bar, (double)source.replay->tally.ticks);
    }
    kn_progress_close(&bar);
    if (code == KN_EXIT_OK && source.time_s < o->from_s)
        code = kn_complain("view", KN_EXIT_USAGE, "--from %g: %s ends at %.3f s", o->from_s, o->log, source.time_s);
    kn_source_close(&source);
    return code;
}

typedef struct camera { // at work
    const kn_view_options *o;
    const whole *w;
    kn_shot *shot;
    kn_film *film;
    uint8_t *rgba;
    char error[400];
} camera;

static bool take(camera *c, kn_still *still, int picture)
{
    const kn_view_options *o = c->o;
    const kn_scale scale = kn_view_scale(o, c->w->most);
    still->view.azimuth_deg += o->orbit_deg_s * picture / o->fps;
    still->view.turns = o->orbit_deg_s != 0;
    return kn_shot_take(c->shot, still, o->measure >= 0 ? &scale : NULL, o->plain, c->rgba, c->error, sizeof c->error);
}

static int shoot(camera *c, kn_source *source)
{
    const kn_view_options *o = c->o;
    const bool live = source->kind == KN_SOURCE_BUS;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("film", c->w->pictures);
    for (int picture = 0; code == KN_EXIT_OK && picture < c->w->pictures && !stopped; picture++) {
        kn_still still = {.view = o->look};
        still.view.follow = live;
        still.view.frame = live ? NULL : (const float(*)[3])c->w->box;
        code = kn_source_to(source, moment(o, picture));
        // what is live does not wait for a picture that takes long: the one before stands for those that were missed
        const bool late = live && picture > 0 && source->time_s > moment(o, picture + 1);
        if (code == KN_EXIT_OK && !late) code = kn_source_still(source, o, &still);
        if (code == KN_EXIT_OK && !late && !take(c, &still, picture))
            code = kn_complain("view", KN_EXIT_DEVICE, "%s", c->error);
        kn_still_free(&still);
        if (code == KN_EXIT_OK && !kn_film_add(c->film, c->rgba)) break; // kn_film_keep says why
        kn_progress_step(&bar, picture + 1);
    }
    kn_progress_close(&bar);
    return code;
}

static int develop(camera *c, kn_source *source)
{
    const kn_view_options *o = c->o;
    c->shot = kn_shot_open(o->width, o->height, 4, c->error, sizeof c->error);
    c->rgba = malloc(4 * (size_t)o->width * (size_t)o->height);
    if (c->shot && c->rgba) c->film = kn_film_open(o->video, o->width, o->height, o->fps, &stopped, c->error, sizeof c->error);
    if (!c->film) return kn_complain("view", KN_EXIT_DEVICE, "%s", c->shot && !c->rgba ? "out of memory" : c->error);
    const int code = shoot(c, source);
    if (code != KN_EXIT_OK || stopped) return kn_film_drop(c->film), code;
    if (!kn_film_keep(c->film, c->error, sizeof c->error))
        return stopped ? KN_EXIT_OK : kn_complain("view", KN_EXIT_DEVICE, "%s", c->error);
    printf("%s: %d x %d, %d pictures, %.1f s\n", o->video, o->width, o->height, c->w->pictures,
           c->w->pictures / o->fps);
    return code;
}

static void watch_signals(void)
{
    static const int deadly[] = {SIGINT, SIGTERM, SIGHUP};
    for (int i = 0; i < 3; i++) sigaction(deadly[i], &(struct sigaction){.sa_handler = on_signal}, NULL);
}

// Dies of the signal that came, if one did: whoever started us sees what ended us.
static void die_of_it(void)
{
    if (!stopped) return;
    signal((int)stopped, SIG_DFL);
    raise((int)stopped);
}

int kn_view_film(const kn_view_options *o)
{
    static const float nowhere[3] = {INFINITY, INFINITY, INFINITY};
    whole w = {.pictures = o->log ? 0 : (int)ceil(o->seconds * o->fps)};
    kn_source source = {0};
    for (int i = 0; i < 3; i++) w.box[0][i] = nowhere[i], w.box[1][i] = -nowhere[i];
    char error[200];
    int code = kn_output_try("view", o->video);
    if (code == KN_EXIT_OK && !kn_film_ready(error, sizeof error)) code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    if (code == KN_EXIT_OK && o->log) code = survey(o, &w);
    if (code == KN_EXIT_OK) code = kn_source_open(&source, o->log, o);
    if (code == KN_EXIT_OK && o->log) code = kn_source_to(&source, o->from_s);
    if (code == KN_EXIT_OK) {
        camera c = {.o = o, .w = &w};
        watch_signals(); // from here on there is something to clear away
        code = develop(&c, &source);
        kn_shot_close(c.shot);
        free(c.rgba);
    }
    kn_source_close(&source);
    die_of_it();
    return code;
}
