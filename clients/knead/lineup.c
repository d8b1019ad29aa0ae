#include "clients/knead/lineup.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/measure_option.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const kn_extent kn_extent_none = {.box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}};

int kn_lineup_open(kn_lineup *l, const kn_view_options *o)
{
    int code = KN_EXIT_OK;
    *l = (kn_lineup){.o = o, .count = o->file_count > 0 ? o->file_count : 1};
    // The option --compare adds one panel to those of the objects.
    l->panels = l->count + o->compare;
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) code = kn_source_open(&l->source[i], o, i);
    return code;
}

int kn_lineup_to(kn_lineup *l, double at_s)
{
    int code = KN_EXIT_OK;
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) code = kn_source_to(&l->source[i], at_s);
    return code;
}

bool kn_lineup_ended(const kn_lineup *l)
{
    int ended = 0;
    for (int i = 0; i < l->count; i++) ended += l->source[i].ended;
    return ended == l->count;
}

// Copy the skin (surface mesh) of a still, with room for one value per vertex.
static bool copy(kn_still *to, const kn_still *from)
{
    to->vertex_count = from->vertex_count;
    to->triangle_count = from->triangle_count;
    to->rest = malloc((size_t)from->vertex_count * sizeof *to->rest);
    to->now = malloc((size_t)from->vertex_count * sizeof *to->now);
    to->triangle = malloc((size_t)from->triangle_count * sizeof *to->triangle);
    to->value = malloc((size_t)from->vertex_count * sizeof *to->value);
    if (!to->rest || !to->now || !to->triangle || !to->value) return false;
    memcpy(to->rest, from->rest, (size_t)from->vertex_count * sizeof *to->rest);
    memcpy(to->now, from->now, (size_t)from->vertex_count * sizeof *to->now);
    memcpy(to->triangle, from->triangle, (size_t)from->triangle_count * sizeof *to->triangle);
    return true;
}

// Create the still of the last panel, which shows the comparison of two objects. Only the skins are compared, because
// the lattice edges are inside the objects.
static int compare(kn_lineup *l)
{
    char error[300];
    kn_still *s = &l->still[2];
    // Use the last match of vertices again as long as it fits the two meshes.
    const bool known = kn_match_fits(&l->match, &l->still[0], &l->still[1]);
    if (!known) kn_match_free(&l->match);
    if (!known && !kn_match_make(&l->match, &l->still[0], &l->still[1], error, sizeof error))
        return kn_complain("view", KN_EXIT_USAGE, "--compare: %s", error);
    if (!copy(s, &l->still[1])) return kn_complain("view", KN_EXIT_DEVICE, "out of memory");
    if (s->view.style == KN_VIEW_EDGES) s->view.style = KN_VIEW_LINED;
    kn_match_distance(&l->match, &l->still[0], &l->still[1], s->value);
    snprintf(s->caption, sizeof s->caption,
             l->match.same ? "the second, by its distance from the first"
                           : "the second, by its distance from the first, another mesh");
    return KN_EXIT_OK;
}

// Widen the extent so that it contains an object at rest and at the present time. A position that is not finite is left
// out.
static void take_in(kn_extent *e, const kn_still *s, int scale)
{
    for (int v = 0; v < s->vertex_count; v++)
        for (int i = 0; i < 6; i++) {
            const float x = i < 3 ? s->now[v][i % 3] : s->rest[v][i % 3];
            if (!isfinite(x)) continue;
            e->box[0][i % 3] = fminf(e->box[0][i % 3], x);
            e->box[1][i % 3] = fmaxf(e->box[1][i % 3], x);
        }
    e->most[scale] = fmax(e->most[scale], kn_still_most(s));
}

int kn_lineup_stills(kn_lineup *l, kn_extent *e)
{
    int code = KN_EXIT_OK;
    // Reset the view of each panel to the look that the options give, at each moment.
    for (int i = 0; i < l->panels; i++) l->still[i].view = l->o->look;
    for (int i = 0; code == KN_EXIT_OK && i < l->count; i++) code = kn_source_still(&l->source[i], l->o, &l->still[i]);
    if (code == KN_EXIT_OK && l->o->compare) code = compare(l);
    for (int i = 0; code == KN_EXIT_OK && i < l->panels; i++) take_in(e, &l->still[i], i >= l->count);
    return code;
}

void kn_lineup_drop(kn_lineup *l)
{
    for (int i = 0; i < l->panels; i++) kn_still_free(&l->still[i]);
}

// ---- pictures

// Return the first pixel column of a panel. The widths of the panels differ by one pixel if the picture cannot be
// divided evenly.
static int left_of(const kn_lineup *l, int panel) { return l->o->width * panel / l->panels; }

// Open one renderer per panel when the first picture is drawn.
static bool open_shots(kn_lineup *l, char *error, size_t error_size)
{
    const size_t bytes = 4 * (size_t)l->o->width * (size_t)l->o->height;
    if (l->rgba) return true;
    snprintf(error, error_size, "out of memory");
    l->panel = malloc(bytes);
    l->rgba = malloc(bytes);
    for (int i = 0; l->panel && l->rgba && i < l->panels; i++) {
        l->shot[i] = kn_shot_open(left_of(l, i + 1) - left_of(l, i), l->o->height, 4, error, error_size);
        if (!l->shot[i]) return false;
    }
    return l->panel && l->rgba;
}

// Copy the pixels of a panel into the picture. The first two columns of every panel but the first become the dividing
// line.
static void paste(kn_lineup *l, int panel)
{
    const size_t all = 4 * (size_t)l->o->width, left = 4 * (size_t)left_of(l, panel);
    const size_t wide = 4 * (size_t)left_of(l, panel + 1) - left;
    for (int y = 0; y < l->o->height; y++) {
        uint8_t *to = l->rgba + (size_t)y * all + left;
        memcpy(to, l->panel + (size_t)y * wide, wide);
        if (panel > 0) memset(to, 0xff, 8);
    }
}

// Return the colour scale of the measure of --color. If `distance` is true, return the colour scale of the distance in
// a comparison instead.
static kn_scale scale_of(const kn_view_options *o, bool distance, double most)
{
    const int measure = distance ? (int)KN_MEASURE_DISPLACEMENT : o->measure;
    // A negative measure means that the object has no colours.
    if (measure < 0) return (kn_scale){"", "", 1};
    const double asked = distance && o->measure >= 0 ? 0 : o->top_si;
    return (kn_scale){distance ? "distance" : kn_measure_names[measure].words, kn_measure_names[measure].unit,
                      kn_measure_scale((kn_measure)measure, asked, most)};
}

int kn_lineup_shoot(kn_lineup *l, const kn_extent *e, bool framed)
{
    char error[400];
    bool ok = open_shots(l, error, sizeof error);
    for (int i = 0; ok && i < l->panels; i++) {
        const bool distance = i >= l->count;
        const kn_scale scale = scale_of(l->o, distance, e->most[distance]);
        l->still[i].view.frame = framed ? e->box : NULL;
        l->still[i].view.follow = true;
        // Draw the legend of a colour scale in the last panel with this scale.
        const kn_shot_words words = i + 1 >= l->count ? KN_SHOT_LEGEND : KN_SHOT_NAMED;
        ok = kn_shot_take(l->shot[i], &l->still[i], distance || l->o->measure >= 0 ? &scale : NULL,
                          l->o->plain ? KN_SHOT_PLAIN : words, l->panel, error, sizeof error);
        if (ok) paste(l, i);
    }
    return ok ? KN_EXIT_OK : kn_complain("view", KN_EXIT_DEVICE, "%s", error);
}

void kn_lineup_close(kn_lineup *l)
{
    kn_lineup_drop(l);
    for (int i = 0; i < l->panels; i++) kn_shot_close(l->shot[i]);
    for (int i = 0; i < l->count; i++) kn_source_close(&l->source[i]);
    kn_match_free(&l->match);
    free(l->panel);
    free(l->rgba);
    *l = (kn_lineup){0};
}
