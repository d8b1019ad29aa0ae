// knead view: draws an object from the bus, a recording or a snapshot, or a scene at rest.
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/lineup.h"
#include "clients/knead/view_film.h"
#include "clients/viewer/image.h"
#include "clients/viewer/range.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// Move the source of each object to the time to draw, and make the object's still.
static int look(kn_lineup *l, const kn_view_options *o, kn_extent *e)
{
    int code = kn_lineup_open(l, o);
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) {
        kn_source *s = &l->source[i];
        if (s->kind != KN_VIEW_LOG) continue;
        code = kn_source_to(s, o->at_s[i]);
        if (code == KN_EXIT_OK && s->ended && isfinite(o->at_s[i]))
            code = kn_complain("view", KN_EXIT_USAGE, "--at %g: %s ends at %.3f s", o->at_s[i], s->path, s->time_s);
    }
    return code == KN_EXIT_OK ? kn_lineup_stills(l, e) : code;
}

// Draw one picture of all objects.
static int picture(const kn_view_options *o)
{
    char error[400];
    kn_lineup l;
    kn_extent e = kn_extent_none;
    int code = look(&l, o, &e);
    if (code == KN_EXIT_OK) code = kn_lineup_shoot(&l, &e, l.panels > 1);
    if (code == KN_EXIT_OK && !kn_image_write_png(o->png, o->width, o->height, l.rgba, error, sizeof error))
        code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    if (code == KN_EXIT_OK) printf("%s: %d x %d", o->png, o->width, o->height);
    for (int i = 0; code == KN_EXIT_OK && i < l.count; i++) printf("%s %s", i > 0 ? ";" : ",", l.still[i].caption);
    if (code == KN_EXIT_OK && o->compare) printf("; up to %.3g mm apart", 1e3 * e.most[1]);
    if (code == KN_EXIT_OK) putchar('\n');
    kn_lineup_close(&l);
    return code;
}

// ---- a range image

// Write the heights of the first object above the table as an image of 16 bits.
static int range_image(const kn_view_options *o)
{
    char error[400];
    kn_lineup l;
    kn_extent e = kn_extent_none;
    int code = look(&l, o, &e);
    const kn_still *s = &l.still[0];
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
    kn_lineup_close(&l);
    return code;
}

int kn_view_main(int argc, char **argv)
{
    kn_view_options o;
    int code = kn_view_parse(argc, argv, &o);
    if (code != KN_OPTIONS_READ) return code;
    return o.video ? kn_view_film(&o) : o.depth ? range_image(&o) : picture(&o);
}
