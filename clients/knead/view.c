// knead view: pictures of an object, from the bus, from a recording, or at rest.
#include "clients/knead/view.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/shot.h"
#include "clients/knead/view_film.h"
#include "clients/knead/view_source.h"
#include "clients/viewer/image.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

kn_scale kn_view_scale(const kn_view_options *o, double most)
{
    static const double least[KN_MEASURES] = {1e-5, 1, 1e-3}; // of an object at rest: rounding is not made a picture of
    if (o->measure < 0) return (kn_scale){"", "", 1};
    const kn_measure_name *name = &kn_measure_names[o->measure];
    return (kn_scale){name->words, name->unit,
                      o->top_si > 0 ? o->top_si : kn_scale_round(fmax(most, least[o->measure]))};
}

static int draw(const kn_view_options *o, kn_still *s)
{
    char error[400];
    const kn_scale scale = kn_view_scale(o, kn_still_most(s));
    kn_shot *shot = kn_shot_open(o->width, o->height, 4, error, sizeof error);
    if (!shot) return kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    uint8_t *rgba = malloc((size_t)o->width * (size_t)o->height * 4);
    int code = KN_EXIT_OK;
    if (!rgba) code = kn_complain("view", KN_EXIT_DEVICE, "out of memory");
    else if (!kn_shot_take(shot, s, o->measure >= 0 ? &scale : NULL, o->plain, rgba, error, sizeof error) ||
             !kn_image_write_png(o->png, o->width, o->height, rgba, error, sizeof error))
        code = kn_complain("view", KN_EXIT_DEVICE, "%s", error);
    else printf("%s: %d x %d, %s\n", o->png, o->width, o->height, s->caption);
    free(rgba);
    kn_shot_close(shot);
    return code;
}

static int picture(const kn_view_options *o)
{
    kn_source source;
    kn_still still = {.view = o->look};
    still.view.follow = true;
    int code = kn_source_open(&source, o->scene ? o->scene : o->log, o);
    if (code == KN_EXIT_OK && o->log) code = kn_source_to(&source, o->at_s);
    if (code == KN_EXIT_OK && source.ended && isfinite(o->at_s))
        code = kn_complain("view", KN_EXIT_USAGE, "--at %g: %s ends at %.3f s", o->at_s, o->log, source.time_s);
    if (code == KN_EXIT_OK) code = kn_source_still(&source, o, &still);
    if (code == KN_EXIT_OK) code = draw(o, &still);
    kn_still_free(&still);
    kn_source_close(&source);
    return code;
}

int kn_view_main(int argc, char **argv)
{
    kn_view_options o;
    int code = kn_view_parse(argc, argv, &o);
    if (o.help) fputs(kn_view_help, stdout);
    if (o.help || code != KN_EXIT_OK) return code;
    return o.video ? kn_view_film(&o) : picture(&o);
}
