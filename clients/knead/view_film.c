#include "clients/knead/view_film.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/film.h"
#include "clients/knead/interrupt.h"
#include "clients/knead/lineup.h"
#include "clients/knead/output.h"
#include "clients/knead/progress.h"
#include <math.h>
#include <stdio.h>

typedef struct film { // state of a film that is being written
    const kn_view_options *o;
    bool live;
    // Number of pictures of the film; 0: not known before the first pass over the recordings.
    int pictures;
    kn_extent extent; // range of values and places over all pictures, if known before the film is drawn
    kn_lineup lineup;
    kn_film *out;
} film;

// Return the time of a picture in the recording, s.
static double moment(const kn_view_options *o, int picture) { return o->from_s + picture * o->speed / o->fps; }

// Return the number of ticks of all recordings together, for the progress bar. `all`: all ticks; otherwise the ticks
// stepped so far.
static double ticks(const kn_lineup *l, bool all)
{
    double sum = 0;
    for (int i = 0; i < l->count; i++)
        if (l->source[i].replay) {
            const kn_replay_tally *t = &l->source[i].replay->tally;
            sum += (double)(all ? t->ticks_total : t->ticks);
        }
    return sum;
}

// Report an error if all recordings end before --from.
static int check_from(const film *f)
{
    double last_s = -INFINITY;
    for (int i = 0; i < f->lineup.count; i++)
        if (f->lineup.source[i].kind == KN_VIEW_LOG) last_s = fmax(last_s, f->lineup.source[i].time_s);
    if (last_s >= f->o->from_s) return KN_EXIT_OK;
    return kn_complain("view", KN_EXIT_USAGE, "--from %g: %s ends at %.3f s", f->o->from_s,
                       f->lineup.count > 1 ? "the last of the recordings" : f->o->file[0], last_s);
}

// Step through the recordings for the first time: count the pictures and measure the extent.
static int survey(film *f)
{
    kn_lineup *l = &f->lineup;
    int code = kn_lineup_open(l, f->o);
    kn_progress bar = kn_progress_open("looking through", code == KN_EXIT_OK ? ticks(l, true) : 1);
    while (code == KN_EXIT_OK && moment(f->o, f->pictures) <= f->o->to_s) {
        code = kn_lineup_to(l, moment(f->o, f->pictures));
        if (code != KN_EXIT_OK || kn_lineup_ended(l)) break; // no recording reaches the time of this picture
        code = kn_lineup_stills(l, &f->extent);
        kn_lineup_drop(l);
        kn_progress_step(&bar, ticks(l, false));
        f->pictures++;
    }
    kn_progress_close(&bar);
    if (code == KN_EXIT_OK && f->pictures == 0) code = check_from(f);
    // A recording of one tick begins and ends at the same time, so its film has one picture.
    if (code == KN_EXIT_OK && f->pictures == 0) {
        f->pictures = 1;
        code = kn_lineup_stills(l, &f->extent);
    }
    kn_lineup_close(l);
    return code;
}

// Draw all pictures and pass them to the film.
static int shoot(film *f)
{
    const kn_view_options *o = f->o;
    kn_lineup *l = &f->lineup;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("film", f->pictures);
    for (int picture = 0; code == KN_EXIT_OK && picture < f->pictures && !kn_interrupted; picture++) {
        kn_extent now = f->extent;
        code = kn_lineup_to(l, moment(o, picture));
        // A live object does not wait for a slow picture. For each picture time that was missed, the previous picture
        // is repeated.
        const bool late = f->live && picture > 0 && l->source[0].time_s > moment(o, picture + 1);
        if (code == KN_EXIT_OK && !late) code = kn_lineup_stills(l, &now);
        if (code == KN_EXIT_OK && !late) code = kn_lineup_shoot(l, f->live ? &now : &f->extent, !f->live);
        kn_lineup_drop(l);
        // kn_film_keep reports the reason of the failure.
        if (code == KN_EXIT_OK && !kn_film_add(f->out, l->rgba)) break;
        kn_progress_step(&bar, picture + 1);
    }
    kn_progress_close(&bar);
    return code;
}

// Open the film, draw the pictures, and keep the file if the film is complete.
static int develop(film *f)
{
    char error[400];
    const kn_view_options *o = f->o;
    f->out = kn_film_open(o->video, o->width, o->height, o->fps, &kn_interrupted, error, sizeof error);
    if (!f->out) return kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    const int code = shoot(f);
    if (code != KN_EXIT_OK || kn_interrupted) return kn_film_drop(f->out), code;
    if (!kn_film_keep(f->out, error, sizeof error))
        return kn_interrupted ? KN_EXIT_OK : kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    printf("%s: %d x %d, %d pictures, %.1f s\n", o->video, o->width, o->height, f->pictures, f->pictures / o->fps);
    return code;
}

int kn_view_film(const kn_view_options *o)
{
    char error[200];
    film f = {.o = o, .live = o->file_count == 0, .extent = kn_extent_none};
    if (o->seconds > 0) f.pictures = (int)ceil(o->seconds * o->fps); // otherwise the first pass counts the pictures
    int code = kn_output_try("view", o->video);
    if (code == KN_EXIT_OK && !kn_film_ready(error, sizeof error))
        code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    if (code == KN_EXIT_OK && !f.live) code = survey(&f);
    if (code == KN_EXIT_OK) code = kn_lineup_open(&f.lineup, o);
    // Reopen the recordings for the second pass.
    if (code == KN_EXIT_OK && !f.live) code = kn_lineup_to(&f.lineup, o->from_s);
    if (code == KN_EXIT_OK) {
        kn_interrupt_watch(); // from here on an interrupt must clear away the unfinished film
        code = develop(&f);
    }
    kn_lineup_close(&f.lineup);
    kn_interrupt_die();
    return code;
}
