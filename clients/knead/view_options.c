#include "clients/knead/view_options.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/film.h"
#include "clients/knead/join.h"
#include "clients/knead/output.h"
#include "clients/viewer/offscreen.h"
#include "core/scene/units.h"
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char kn_view_help[] =
    "usage: knead view --png FILE [OPTION]...             what a running kneadd serves\n"
    "       knead view --png FILE [OPTION]... LOG         a recording, stepped to its end or to --at\n"
    "       knead view --png FILE [OPTION]... --scene F   a scene's object at rest\n"
    "       knead view --video FILE [OPTION]... LOG       a recording as a film; without LOG what is served, for --seconds\n\n"
    "Draws the object, its tools and the force on the hand, without a screen.\n\n"
    "  --at SECONDS|end   moment of the recording, since its first session began (end)\n"
    "  --size WxH         pixels, 16..4096 each, of a film even (1280x720)\n"
    "  --azimuth DEG      where from: 0 the front, 90 the right (28)\n"
    "  --elevation DEG    0 level .. 90 from above (27)\n"
    "  --color WHAT       displacement, stress (von Mises) or residual: strain that nothing brings back (none)\n"
    "  --top QUANTITY     end of the colour scale, e.g. '5 kPa', '2 mm', 0.1 (what the most of the picture, or of the\n"
    "                     whole film, needs)\n"
    "  --style STYLE      lined, solid, wire: lines alone, or edges: every edge of the lattice (lined)\n"
    "  --no-lines         as --style solid\n"
    "  --plain            nothing written on it\n"
    "  --wait SECONDS     how long to listen for the server, 0..3600 (6: its scene comes every 5)\n"
    "  --lcm-url URL      poses, forces, scene ($LCM_DEFAULT_URL, " KN_FORCE_URL ")\n"
    "  --mesh-url URL     meshes (" KN_MESH_URL ")\n\n"
    "Films (by the program ffmpeg; " KN_FILM_NAMES "):\n"
    "  --from S, --to S   part of the recording (0, its end)\n"
    "  --seconds N        how much of what is served, 0.1..3600\n"
    "  --fps N            pictures per second, 1..120 (30)\n"
    "  --speed X          of a recording: 2 is twice as fast, 0.01..1000 (1)\n"
    "  --orbit DEG        the camera goes round by so many degrees per second of the film (0)\n\n"
    "Squares on the table, and the black bar: 1 cm, for an object of 2 to 20 cm. Arrow: one square per 5 N.\n"
    "Exit codes: 0 ok, 2 bad input, 3 nothing heard, no OpenGL, no ffmpeg, or the picture cannot be written.\n";

static bool number(const char *text, double low, double high, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return end != text && !*end && *value >= low && *value <= high;
}

static bool size(const char *text, kn_view_options *o)
{
    char end = 0;
    return sscanf(text, "%5dx%5d%c", &o->width, &o->height, &end) == 2 && o->width >= KN_OFFSCREEN_MIN &&
           o->width <= KN_OFFSCREEN_MAX && o->height >= KN_OFFSCREEN_MIN && o->height <= KN_OFFSCREEN_MAX;
}

static bool style(const char *text, kn_view_options *o)
{
    static const char *const name[] = {
        [KN_VIEW_LINED] = "lined", [KN_VIEW_SOLID] = "solid", [KN_VIEW_WIRE] = "wire", [KN_VIEW_EDGES] = "edges"};
    int i = 0;
    while (i < 4 && strcmp(name[i], text) != 0) i++;
    o->look.style = (kn_view_style)(i & 3);
    return i < 4;
}

static bool measure(const char *text, kn_view_options *o)
{
    o->measure = KN_MEASURES - 1;
    while (o->measure >= 0 && strcmp(kn_measure_names[o->measure].name, text) != 0) o->measure--;
    return o->measure >= 0;
}

static const char *take(kn_view_options *o, int option, const char *text) // NULL, or what was expected
{
    switch (option) {
    case 'c': return measure(text, o) ? NULL : "displacement, stress or residual";
    case 'T': o->top = text; return NULL;
    case 'y': return style(text, o) ? NULL : "lined, solid, wire or edges";
    case 'P': o->plain = true; return NULL;
    case 'p': o->png = text; return NULL;
    case 'v': o->video = text; return kn_film_knows(text) ? NULL : KN_FILM_NAMES;
    case 'S': o->scene = text; return NULL;
    case 'l': o->url = text; return NULL;
    case 'm': o->mesh_url = text; return NULL;
    case 'n': o->look.style = KN_VIEW_SOLID; return NULL;
    case 't': return strcmp(text, "end") == 0 || number(text, -1e9, 1e9, &o->at_s) ? NULL : "seconds, or end";
    case 's': return size(text, o) ? NULL : "WxH, 16..4096 pixels on each side, e.g. 1280x720";
    case 'a': return number(text, -360, 360, &o->look.azimuth_deg) ? NULL : "degrees, -360..360";
    case 'e': return number(text, 0, 90, &o->look.elevation_deg) ? NULL : "degrees, 0..90";
    case 'F': return number(text, -1e9, 1e9, &o->from_s) ? NULL : "seconds";
    case 'G': return number(text, -1e9, 1e9, &o->to_s) ? NULL : "seconds";
    case 'N': return number(text, 0.1, 3600, &o->seconds) ? NULL : "seconds, 0.1..3600";
    case 'f': return number(text, 1, 120, &o->fps) ? NULL : "pictures per second, 1..120";
    case 'x': return number(text, 0.01, 1000, &o->speed) ? NULL : "how many times as fast, 0.01..1000";
    case 'o': return number(text, -720, 720, &o->orbit_deg_s) ? NULL : "degrees per second, -720..720";
    default: return number(text, 0, 3600, &o->wait_s) ? NULL : "seconds, 0..3600";
    }
}

// --top in the measure's unit.
static bool top(kn_view_options *o)
{
    kn_quantity q;
    kn_unit unit = {0};
    char error[100];
    const char *name = kn_measure_names[o->measure].unit;
    if (*name && !kn_unit_parse(&unit, name, error, sizeof error)) return false;
    if (!kn_quantity_parse(&q, o->top, error, sizeof error) || (*name && q.bare)) return false;
    if (!kn_unit_same_dimension(&q.unit, &unit)) return false;
    o->top_si = kn_quantity_in(&q, &unit);
    return o->top_si >= 1e-9 && o->top_si <= 1e12;
}

#define REFUSE(...) return kn_complain("view", KN_EXIT_USAGE, __VA_ARGS__)

static int check_film(const kn_view_options *o)
{
    const bool recorded = o->log != NULL;
    if (o->png) REFUSE("--png and --video: expected one of them");
    if (o->scene) REFUSE("--video: expected a log, or --seconds of what is served; a scene at rest does not move");
    if (isfinite(o->at_s)) REFUSE("--at: expected --from and --to for a film");
    if (recorded && o->seconds > 0) REFUSE("--seconds: is for what is served, expected --from and --to for a log");
    if (!recorded && !(o->seconds > 0)) REFUSE("--video: expected a log, or --seconds N of what is served");
    if (!recorded && o->speed != 1) REFUSE("--speed %g: expected a log; what is served is as fast as it is", o->speed);
    if (!recorded && (isfinite(o->to_s) || o->from_s != 0)) REFUSE("--from and --to: expected a log");
    if (!recorded && o->measure >= 0 && !o->top)
        REFUSE("--color: expected --top as well, nobody knows yet how much there will be");
    if (o->to_s <= o->from_s) REFUSE("--to %g: expected more than --from %g", o->to_s, o->from_s);
    if (o->width % 2 || o->height % 2) REFUSE("--size %dx%d: expected even numbers for a film", o->width, o->height);
    return KN_EXIT_OK;
}

static int check(kn_view_options *o)
{
    const char *out = o->video ? o->video : o->png;
    if (!out) REFUSE("expected --png FILE or --video FILE");
    if (o->top && o->measure < 0) REFUSE("--top %s: expected --color as well", o->top);
    if (o->top && !top(o))
        REFUSE("--top %s: expected a %s above 0, e.g. %s", o->top, kn_measure_names[o->measure].words,
               (const char *[]){"'2 mm'", "'5 kPa'", "0.1"}[o->measure]);
    if (kn_output_same(o->log, out) || kn_output_same(o->scene, out))
        REFUSE("--%s %s: is being read, expected another file to write", o->video ? "video" : "png", out);
    if (o->log && o->scene) REFUSE("--scene %s: expected a log or a scene; a log holds its own", o->scene);
    if (!o->log && isfinite(o->at_s)) REFUSE("--at: expected a log to step");
    if (o->video) return check_film(o);
    if (o->seconds > 0 || o->speed != 1 || o->orbit_deg_s != 0 || isfinite(o->to_s) || o->from_s != 0 || o->fps != 30)
        REFUSE("--from, --to, --seconds, --fps, --speed and --orbit: expected --video");
    return KN_EXIT_OK;
}

int kn_view_parse(int argc, char **argv, kn_view_options *o)
{
    static const struct option names[] = {
        {"png", 1, NULL, 'p'},       {"at", 1, NULL, 't'},       {"size", 1, NULL, 's'},    {"azimuth", 1, NULL, 'a'},
        {"elevation", 1, NULL, 'e'}, {"no-lines", 0, NULL, 'n'}, {"scene", 1, NULL, 'S'},   {"wait", 1, NULL, 'w'},
        {"lcm-url", 1, NULL, 'l'},   {"mesh-url", 1, NULL, 'm'}, {"help", 0, NULL, 'h'},    {"color", 1, NULL, 'c'},
        {"top", 1, NULL, 'T'},       {"style", 1, NULL, 'y'},    {"plain", 0, NULL, 'P'},   {"video", 1, NULL, 'v'},
        {"from", 1, NULL, 'F'},      {"to", 1, NULL, 'G'},       {"seconds", 1, NULL, 'N'}, {"fps", 1, NULL, 'f'},
        {"speed", 1, NULL, 'x'},     {"orbit", 1, NULL, 'o'},    {NULL, 0, NULL, 0}};
    int option, which = 0;
    *o = (kn_view_options){.measure = -1, .at_s = INFINITY, .to_s = INFINITY, .wait_s = 6, .fps = 30, .speed = 1,
                           .width = 1280, .height = 720, .look = kn_view_scene_default()};
    opterr = 0; // our own words
    while ((option = getopt_long(argc, argv, ":h", names, &which)) != -1) {
        const char *word = argv[optind - 1];
        if (option == ':') REFUSE("%s: expected a value", word);
        if (option == '?') REFUSE("%s: no such option; knead view --help lists them", word);
        if (option == 'h') return o->help = true, KN_EXIT_OK;
        const char *expected = take(o, option, optarg);
        if (expected) REFUSE("--%s %s: expected %s", names[which].name, optarg, expected);
    }
    if (optind < argc) o->log = argv[optind++];
    if (optind < argc) REFUSE("%s: expected one log", argv[optind]);
    return check(o);
}
