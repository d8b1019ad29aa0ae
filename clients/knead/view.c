// knead view: draws an object from the bus, a recording or a snapshot, or a scene at rest.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/picture/video_file.h"
#include "clients/picture/view_panels.h"
#include "clients/viewer/image.h"
#include "clients/viewer/range.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// Step the recording of each object to the time that is drawn. Then store what the picture needs of each object
// (kn_object_still).
static int look(kn_view_panels *l, const kn_view_options *o, kn_view_extent *e)
{
    int code = kn_view_panels_open(l, o);
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) {
        kn_view_source *s = &l->source[i];
        if (s->kind != KN_VIEW_LOG) continue;
        code = kn_view_source_to(s, o->at_s[i]);
        if (code == KN_EXIT_OK && s->ended && isfinite(o->at_s[i]))
            code = kn_complain("view", KN_EXIT_USAGE, "--at %g: %s ends at %.3f s", o->at_s[i], s->path, s->time_s);
    }
    return code == KN_EXIT_OK ? kn_view_panels_stills(l, e) : code;
}

// Draw one picture of all objects.
static int picture(const kn_view_options *o)
{
    char error[400];
    kn_view_panels l;
    kn_view_extent e = kn_view_extent_none;
    int code = look(&l, o, &e);
    if (code == KN_EXIT_OK) code = kn_view_panels_shoot(&l, &e, l.panels > 1);
    if (code == KN_EXIT_OK && !kn_image_write_png(o->png, o->width, o->height, l.rgba, error, sizeof error))
        code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    if (code == KN_EXIT_OK) printf("%s: %d x %d", o->png, o->width, o->height);
    for (int i = 0; code == KN_EXIT_OK && i < l.count; i++) printf("%s %s", i > 0 ? ";" : ",", l.still[i].caption);
    if (code == KN_EXIT_OK && o->compare) printf("; up to %.3g mm apart", 1e3 * e.most[1]);
    if (code == KN_EXIT_OK) putchar('\n');
    kn_view_panels_close(&l);
    return code;
}

// ---- a range image

// Write the heights of the first object above the table as an image of 16 bits.
static int range_image(const kn_view_options *o)
{
    char error[400];
    kn_view_panels l;
    kn_view_extent e = kn_view_extent_none;
    int code = look(&l, o, &e);
    const kn_object_still *s = &l.still[0];
    uint16_t *level = malloc(2 * (size_t)o->width * (size_t)o->height);
    if (code == KN_EXIT_OK && !level) code = kn_complain("view", KN_EXIT_DEVICE, "out of memory");
    if (code == KN_EXIT_OK) {
        // The frame is a box that contains the object at rest and now. It determines the size of a pixel and the height
        // of a grey level.
        const float(*rest)[3] = (const float(*)[3])s->rest, (*now)[3] = (const float(*)[3])s->now;
        kn_range r = kn_range_frame(o->width, o->height, s->vertex_count, rest, now);
        kn_range_draw(&r, now, s->triangle_count, (const int(*)[3])s->triangle, level);
        if (!kn_range_save(o->depth, &r, s->caption, level, error, sizeof error))
            code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
        else
            printf("%s: %d x %d, %s; height above the table = %g mm * (value - 1), 0: nothing there; pixel %g mm; "
                   "%.3f .. %.3f mm high\n",
                   o->depth, r.width, r.height, s->caption, 1e3 * r.step_m, 1e3 * r.pixel_m, 1e3 * r.lowest_m,
                   1e3 * r.highest_m);
    }
    free(level);
    kn_view_panels_close(&l);
    return code;
}

// ---- a film

typedef struct film { // state of a film that is being written
    const kn_view_options *o;
    bool live;
    // Number of pictures of the film; 0: not known before the first pass over the recordings.
    int pictures;
    kn_view_extent extent; // range of values and places over all pictures, if known before the film is drawn
    kn_view_panels lineup;
    kn_video_file *out;
} film;

// Return the time of a picture in the recording, s.
static double moment(const kn_view_options *o, int picture) { return o->from_s + picture * o->speed / o->fps; }

// Return the sum of the ticks of all recordings, for the progress bar: all ticks if `all` is true, otherwise the ticks
// stepped so far.
static double ticks(const kn_view_panels *l, bool all)
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
    kn_view_panels *l = &f->lineup;
    int code = kn_view_panels_open(l, f->o);
    kn_progress bar = kn_progress_open("looking through", code == KN_EXIT_OK ? ticks(l, true) : 1);
    while (code == KN_EXIT_OK && moment(f->o, f->pictures) <= f->o->to_s) {
        code = kn_view_panels_to(l, moment(f->o, f->pictures));
        if (code != KN_EXIT_OK || kn_view_panels_ended(l)) break; // no recording reaches the time of this picture
        code = kn_view_panels_stills(l, &f->extent);
        kn_view_panels_drop(l);
        kn_progress_step(&bar, ticks(l, false));
        f->pictures++;
    }
    kn_progress_close(&bar);
    if (code == KN_EXIT_OK && f->pictures == 0) code = check_from(f);
    // A recording of one tick begins and ends at the same time, so its film has one picture.
    if (code == KN_EXIT_OK && f->pictures == 0) {
        f->pictures = 1;
        code = kn_view_panels_stills(l, &f->extent);
    }
    kn_view_panels_close(l);
    return code;
}

// Draw all pictures and pass them to the film.
static int shoot(film *f)
{
    const kn_view_options *o = f->o;
    kn_view_panels *l = &f->lineup;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("film", f->pictures);
    for (int picture = 0; code == KN_EXIT_OK && picture < f->pictures && !kn_interrupted; picture++) {
        kn_view_extent now = f->extent;
        code = kn_view_panels_to(l, moment(o, picture));
        // A live object does not wait for a slow picture. For each picture time that was missed, the previous picture
        // is repeated.
        const bool late = f->live && picture > 0 && l->source[0].time_s > moment(o, picture + 1);
        if (code == KN_EXIT_OK && !late) code = kn_view_panels_stills(l, &now);
        if (code == KN_EXIT_OK && !late) code = kn_view_panels_shoot(l, f->live ? &now : &f->extent, !f->live);
        kn_view_panels_drop(l);
        // kn_video_file_keep reports the reason of the failure.
        if (code == KN_EXIT_OK && !kn_video_file_add(f->out, l->rgba)) break;
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
    f->out = kn_video_file_open(o->video, o->width, o->height, o->fps, &kn_interrupted, error, sizeof error);
    if (!f->out) return kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    const int code = shoot(f);
    if (code != KN_EXIT_OK || kn_interrupted) return kn_video_file_drop(f->out), code;
    if (!kn_video_file_keep(f->out, error, sizeof error))
        return kn_interrupted ? KN_EXIT_OK : kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    printf("%s: %d x %d, %d pictures, %.1f s\n", o->video, o->width, o->height, f->pictures, f->pictures / o->fps);
    return code;
}

// Write the film of --video. It shows a recording, or the object that a running kneadd serves. A recording is
// replayed twice. The first pass finds values that hold for the whole film: the end of the colour scale, the box of all
// places that the object reaches, and the number of pictures. So neither colours nor camera jump.
static int make_film(const kn_view_options *o)
{
    char error[200];
    film f = {.o = o, .live = o->file_count == 0, .extent = kn_view_extent_none};
    // Without a given duration, the first pass counts the pictures.
    if (o->seconds > 0) f.pictures = (int)ceil(o->seconds * o->fps);
    int code = kn_output_try("view", o->video);
    if (code == KN_EXIT_OK && !kn_video_file_ready(error, sizeof error))
        code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    if (code == KN_EXIT_OK && !f.live) code = survey(&f);
    if (code == KN_EXIT_OK) code = kn_view_panels_open(&f.lineup, o);
    // Reopen the recordings for the second pass.
    if (code == KN_EXIT_OK && !f.live) code = kn_view_panels_to(&f.lineup, o->from_s);
    if (code == KN_EXIT_OK) {
        kn_interrupt_watch(); // from here on an interrupt must clear away the unfinished film
        code = develop(&f);
    }
    kn_view_panels_close(&f.lineup);
    kn_interrupt_die();
    return code;
}

int kn_view_main(int argc, char **argv)
{
    kn_view_options o;
    int code = kn_view_parse(argc, argv, &o);
    if (code != KN_OPTIONS_READ) return code;
    return o.video ? make_film(&o) : o.depth ? range_image(&o) : picture(&o);
}
