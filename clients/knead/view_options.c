#include "clients/knead/view_options.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/film.h"
#include "clients/knead/join.h"
#include "clients/knead/measure_option.h"
#include "clients/knead/number.h"
#include "clients/knead/output.h"
#include "clients/viewer/offscreen.h"
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char kn_view_help[] =
    "usage: knead view --png FILE [OPTION]...               draw the object that a running kneadd serves\n"
    "       knead view --png FILE [OPTION]... OBJECT...     draw files: a log, stepped to its end or to --at; a\n"
    "                                                       scene at rest; a snapshot of a kneadd state\n"
    "                                                       directory, with --scene\n"
    "       knead view --png FILE --compare A B             draw two, and the distance between their surfaces\n"
    "       knead view --video FILE [OPTION]... [OBJECT]... film logs, or the served object for --seconds\n"
    "       knead view --depth FILE [OPTION]... [OBJECT]    draw the heights, as a range finder above sees them\n\n"
    "Draws the object, its tools and the force on the hand, without a screen. Up to 4 objects stand side by side.\n\n"
    "  --at SECONDS|end   moment of the recording, since its first session began; 1,3,end: three side by side\n"
    "                     (default: end)\n"
    "  --scene FILE       scene of the snapshot; without a snapshot: draw the scene at rest\n"
    "  --size WxH         pixels, 16..4096 on each side; 16 or more for each of several objects; even numbers for a\n"
    "                     film (default: 1280x720; 640x480 for each of several, at most 1920x480; 640x640 for a\n"
    "                     range image)\n"
    "  --camera FROM      front, back, left, right, top or corner: start of --azimuth and --elevation (default:\n"
    "                     corner, azimuth 28, elevation 27)\n"
    "  --azimuth DEG      direction of the camera, -360..360: 0 from the front, 90 from the right\n"
    "  --elevation DEG    height of the camera: 0 level .. 90 from above\n"
    "  --zoom X           magnification, 0.2..20; 2 shows half as much of the middle (default: 1)\n"
    "  --color WHAT       displacement, stress (von Mises) or residual: permanent strain (default: none);\n"
    "                     in a live view stress and residual need mesh.measures in the scene\n"
    "  --top QUANTITY     upper end of the colour scale, e.g. '5 kPa', '2 mm', 0.1 (default: the maximum in the\n"
    "                     picture or in the whole film); with --compare and without --color: of the distance\n"
    "  --style STYLE      lined, solid, wire: lines alone, or edges: every edge of the lattice (default: lined)\n"
    "  --no-lines         same as --style solid\n"
    "  --plain            draw no text\n"
    "  --wait SECONDS     time to listen for the server, 0..3600 (default: 6; the scene is sent every 5)\n"
    "  --lcm-url URL      bus of poses, forces, scene (default: $LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL     bus of meshes (default: " KN_MESH_URL ")\n\n"
    "Films (need the program ffmpeg; names end in " KN_FILM_NAMES "):\n"
    "  --from S, --to S   part of the recording (default: 0, its end)\n"
    "  --seconds N        duration of a film of the served object, 0.1..3600\n"
    "  --fps N            pictures per second, 1..120 (default: 30)\n"
    "  --speed X          speed of a recording, 0.01..1000; 2 is twice as fast (default: 1)\n\n"
    "A range image is a 16-bit grey PNG of the object without its tools, seen straight from above, x to the right,\n"
    "y up. The value 0 means no object; else the height above the table is (value - 1) times a step, which is 1 um\n"
    "for an object of up to 5 cm. The step and the size of a pixel, in mm, are printed and are in the text chunks\n"
    "of the file.\n\n"
    "A comparison is made of points that coincide at rest: the same vertices, or the nearest ones of another mesh.\n"
    "The squares on the table and the black bar are 1 cm for an object of 2 to 20 cm. The arrow has one square per\n"
    "5 N.\n"
    "KNEAD_GL=osmesa or egl in the environment selects the renderer (default: the first that is available).\n"
    "Exit codes: 0 ok, 2 bad input, 3 no message, no OpenGL, no ffmpeg, or the picture cannot be written.\n";

static bool size(const char *text, kn_view_options *o)
{
    return kn_number_pair(text, &o->width, &o->height) && o->width >= KN_OFFSCREEN_MIN &&
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

// Set azimuth and elevation from the name of a camera. --azimuth and --elevation may change them later.
static bool camera(const char *text, kn_view_options *o)
{
    static const struct {
        const char *name;
        double azimuth_deg, elevation_deg;
    } from[] = {{"front", 0, 14},  {"right", 90, 14}, {"back", 180, 14},
                {"left", 270, 14}, {"top", 0, 90},    {"corner", 28, 27}};
    for (int i = 0; i < 6; i++) {
        if (strcmp(from[i].name, text) != 0) continue;
        o->look.azimuth_deg = from[i].azimuth_deg;
        o->look.elevation_deg = from[i].elevation_deg;
        return true;
    }
    return false;
}

typedef struct asked {                 // options that are applied after all other options are known
    double azimuth_deg, elevation_deg; // viewing angles of --azimuth and --elevation; NAN: as set by --camera
    bool sized;                        // true: the option --size was given
    int moments;                       // number of times in the list of --at; 0: --at was not given
} asked;

// Parse a list of moments such as "0.5,2,end".
static bool moments(const char *text, kn_view_options *o, asked *a)
{
    char one[32];
    for (a->moments = 0; a->moments < KN_VIEW_FILES_MAX; text++) {
        const size_t n = strcspn(text, ",");
        if (n == 0 || n >= sizeof one) return false;
        snprintf(one, sizeof one, "%.*s", (int)n, text);
        double *at_s = &o->at_s[a->moments++];
        *at_s = INFINITY;
        if (strcmp(one, "end") != 0 && !kn_number_take(one, -1e9, 1e9, at_s)) return false;
        text += n;
        if (!*text) return true;
    }
    return false;
}

// Store one option of the command line. Return NULL, or a text that describes a valid value.
static const char *take(kn_view_options *o, asked *a, int option, const char *text)
{
    switch (option) {
    case 'd': o->depth = text; return NULL;
    case 'C': o->compare = true; return NULL;
    case 'k': return camera(text, o) ? NULL : "front, back, left, right, top or corner";
    case 'z': return kn_number_take(text, 0.2, 20, &o->look.zoom) ? NULL : "0.2..20";
    case 'c': return kn_measure_take(text, &o->measure) ? NULL : KN_MEASURE_EXPECTED;
    case 'T': o->top = text; return NULL;
    case 'y': return style(text, o) ? NULL : "lined, solid, wire or edges";
    case 'P': o->plain = true; return NULL;
    case 'p': o->png = text; return NULL;
    case 'v': o->video = text; return kn_film_knows(text) ? NULL : KN_FILM_NAMES;
    case 'S': o->scene = text; return NULL;
    case 'l': o->url = text; return NULL;
    case 'm': o->mesh_url = text; return NULL;
    case 'n': o->look.style = KN_VIEW_SOLID; return NULL;
    case 't': return moments(text, o, a) ? NULL : "up to 4 times in seconds, or end, separated by commas";
    case 's': return (a->sized = size(text, o)) ? NULL : "WxH, 16..4096 pixels on each side, e.g. 1280x720";
    case 'a': return kn_number_take(text, -360, 360, &a->azimuth_deg) ? NULL : "degrees, -360..360";
    case 'e': return kn_number_take(text, 0, 90, &a->elevation_deg) ? NULL : "degrees, 0..90";
    case 'F': return kn_number_take(text, -1e9, 1e9, &o->from_s) ? NULL : "seconds";
    case 'G': return kn_number_take(text, -1e9, 1e9, &o->to_s) ? NULL : "seconds";
    case 'N': return kn_number_take(text, 0.1, 3600, &o->seconds) ? NULL : "seconds, 0.1..3600";
    case 'f': return kn_number_take(text, 1, 120, &o->fps) ? NULL : "pictures per second, 1..120";
    case 'x': return kn_number_take(text, 0.01, 1000, &o->speed) ? NULL : "how many times as fast, 0.01..1000";
    default: return kn_number_take(text, 0, 3600, &o->wait_s) ? NULL : "seconds, 0..3600";
    }
}

#define REFUSE(...) return kn_complain("view", KN_EXIT_USAGE, __VA_ARGS__)

// ---- files

bool kn_view_has(const kn_view_options *o, kn_view_kind kind)
{
    for (int i = 0; i < o->file_count; i++)
        if (o->kind[i] == kind) return true;
    return kind == KN_VIEW_BUS && o->file_count == 0;
}

// Find the kind of a file from its first bytes, not from its name. A text file is taken for a scene.
static int tell_kind(const char *path, kn_view_kind *kind)
{
    static const uint8_t log[4] = {0xed, 0xa1, 0xda, 0x01}, snapshot[6] = {0x89, 'K', 'N', 'E', 'A', 'D'};
    uint8_t start[512];
    FILE *f = fopen(path, "rb");
    const size_t n = f ? fread(start, 1, sizeof start, f) : 0;
    const bool failed = !f || ferror(f);
    const int why = errno;
    if (f) fclose(f);
    if (failed) REFUSE("%s: %s, expected an LCM event log, a snapshot or a scene", path, strerror(why));
    *kind = KN_VIEW_SCENE;
    if (n >= sizeof log && memcmp(start, log, sizeof log) == 0) *kind = KN_VIEW_LOG;
    else if (n >= sizeof snapshot && memcmp(start, snapshot, sizeof snapshot) == 0) *kind = KN_VIEW_SNAPSHOT;
    else if (memchr(start, 0, n)) REFUSE("%s: expected an LCM event log, a snapshot or a scene", path);
    return KN_EXIT_OK;
}

// Check the files against each other: no output may be an input, and --scene belongs to snapshots.
static int check_files(kn_view_options *o, const char *out, const char *option)
{
    if (kn_output_same(o->scene, out)) REFUSE("--%s %s: is being read, expected another file to write", option, out);
    for (int i = 0; i < o->file_count; i++) {
        if (kn_output_same(o->file[i], out))
            REFUSE("--%s %s: is being read, expected another file to write", option, out);
        const int code = tell_kind(o->file[i], &o->kind[i]);
        if (code != KN_EXIT_OK) return code;
    }
    if (o->scene && o->file_count > 0 && !kn_view_has(o, KN_VIEW_SNAPSHOT))
        REFUSE("--scene %s: expected a snapshot of it, or no other file; logs and scenes hold their own scene",
               o->scene);
    for (int i = 0; i < o->file_count; i++)
        if (o->kind[i] == KN_VIEW_SNAPSHOT && !o->scene)
            REFUSE("%s: is a snapshot, expected --scene FILE with its scene", o->file[i]);
    // --scene alone shows the scene at rest.
    if (o->scene && o->file_count == 0) o->file[o->file_count] = o->scene, o->kind[o->file_count++] = KN_VIEW_SCENE;
    return KN_EXIT_OK;
}

// ---- checks of all options together

// Assign the moments of --at to the objects. One recording at several moments counts as several objects. A single
// moment is for all objects.
static int share_out(kn_view_options *o, const asked *a)
{
    if (a->moments == 0) return KN_EXIT_OK;
    if (!kn_view_has(o, KN_VIEW_LOG)) REFUSE("--at: expected a log to step");
    if (o->video) REFUSE("--at: expected --from and --to for a film");
    for (int i = 1; a->moments == 1 && i < o->file_count; i++) o->at_s[i] = o->at_s[0];
    // Repeat the only file once for each time of --at.
    while (a->moments > o->file_count && o->file[o->file_count - 1] == o->file[0]) {
        o->file[o->file_count] = o->file[0];
        o->kind[o->file_count++] = o->kind[0];
    }
    if (a->moments > 1 && a->moments != o->file_count)
        REFUSE("--at: %d moments of %d objects, expected one, one of each, or one recording", a->moments,
               o->file_count);
    return KN_EXIT_OK;
}

// Check the options of a film. A recording and a live object allow different options.
static int check_film(const kn_view_options *o)
{
    const bool recorded = kn_view_has(o, KN_VIEW_LOG), live = o->file_count == 0;
    if (!recorded && !live) REFUSE("--video: expected a log among them; an object at rest does not move by itself");
    if (recorded && o->seconds > 0)
        REFUSE("--seconds: is for films without an end of their own, expected --from and --to for a log");
    if (live && !(o->seconds > 0)) REFUSE("--video: expected a log, or --seconds N for the served object");
    if (live && o->speed != 1) REFUSE("--speed %g: expected a log; a served object is filmed in real time", o->speed);
    if (live && (isfinite(o->to_s) || o->from_s != 0)) REFUSE("--from and --to: expected a log");
    if (live && o->measure >= 0 && !o->top)
        REFUSE("--color: expected --top as well, because the range is not known in advance");
    if (o->to_s <= o->from_s) REFUSE("--to %g: expected more than --from %g", o->to_s, o->from_s);
    if (o->width % 2 || o->height % 2) REFUSE("--size %dx%d: expected even numbers for a film", o->width, o->height);
    return KN_EXIT_OK;
}

// Check the options of a range image, which has one object and a fixed camera.
static int check_depth(const kn_view_options *o, const asked *a)
{
    const kn_view_scene usual = kn_view_scene_default();
    if (o->file_count > 1) REFUSE("--depth: expected one object");
    if (o->measure >= 0 || o->compare) REFUSE("--depth: expected neither --color nor --compare; its greys are heights");
    if (isfinite(a->azimuth_deg) || isfinite(a->elevation_deg) || o->look.azimuth_deg != usual.azimuth_deg ||
        o->look.elevation_deg != usual.elevation_deg || o->look.zoom > 0)
        REFUSE("--depth: the view is straight from above, expected no --camera, --azimuth, --elevation or --zoom");
    return KN_EXIT_OK;
}

// Convert --top to SI units. With --compare and without --color, the colour scale shows the distance between the
// objects.
static int check_scale(kn_view_options *o)
{
    if (!o->top) return KN_EXIT_OK;
    const bool distance = o->measure < 0 && o->compare;
    if (o->measure < 0 && !distance) REFUSE("--top %s: expected --color as well", o->top);
    const kn_measure measure = distance ? KN_MEASURE_DISPLACEMENT : (kn_measure)o->measure;
    o->top_si = kn_measure_top(measure, o->top);
    if (o->top_si > 0) return KN_EXIT_OK;
    REFUSE("--top %s: expected a %s above 0, e.g. %s", o->top, distance ? "distance" : kn_measure_names[measure].words,
           kn_measure_top_example(measure));
}

// Set the default size. Several objects stand side by side in panels of 4:3, as long as that fits on a screen.
static void default_size(kn_view_options *o)
{
    const int panels = o->file_count + o->compare;
    if (o->depth) o->width = o->height = 640;
    if (panels < 2) return;
    o->width = panels < 4 ? 640 * panels : 1920;
    o->height = 480;
}

// Check all options together.
static int check(kn_view_options *o, const asked *a)
{
    const char *out = o->video ? o->video : o->depth ? o->depth : o->png;
    const char *option = o->video ? "video" : o->depth ? "depth" : "png";
    if (!out) REFUSE("expected --png FILE, --video FILE or --depth FILE");
    if (!!o->png + !!o->video + !!o->depth > 1) REFUSE("--png, --video and --depth: expected one of them");
    int code = check_scale(o);
    if (code == KN_EXIT_OK) code = check_files(o, out, option);
    if (code != KN_EXIT_OK) return code;
    if ((code = share_out(o, a)) != KN_EXIT_OK) return code;
    if (o->compare && o->file_count != 2) REFUSE("--compare: expected two objects, there are %d", o->file_count);
    if (!a->sized) default_size(o);
    const int panels = o->file_count + o->compare;
    if (panels > 1 && o->width / panels < KN_OFFSCREEN_MIN)
        REFUSE("--size %dx%d: expected at least %d pixels for each of %d pictures side by side", o->width, o->height,
               KN_OFFSCREEN_MIN, panels);
    const char *gl = getenv("KNEAD_GL");
    if (gl && *gl && !kn_offscreen_knows(gl)) REFUSE("KNEAD_GL=%s: expected osmesa or egl", gl);
    if (o->depth && (code = check_depth(o, a)) != KN_EXIT_OK) return code;
    // --azimuth and --elevation override the camera.
    if (isfinite(a->azimuth_deg)) o->look.azimuth_deg = a->azimuth_deg;
    if (isfinite(a->elevation_deg)) o->look.elevation_deg = a->elevation_deg;
    if (o->video) return check_film(o);
    if (o->seconds > 0 || o->speed != 1 || isfinite(o->to_s) || o->from_s != 0 || o->fps != 30)
        REFUSE("--from, --to, --seconds, --fps and --speed: expected --video");
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
        {"speed", 1, NULL, 'x'},     {"depth", 1, NULL, 'd'},    {"compare", 0, NULL, 'C'}, {"camera", 1, NULL, 'k'},
        {"zoom", 1, NULL, 'z'},      {NULL, 0, NULL, 0}};
    asked a = {NAN, NAN, false, 0};
    int option, which = 0;
    *o = (kn_view_options){.measure = -1,
                           .at_s = {INFINITY, INFINITY, INFINITY, INFINITY},
                           .to_s = INFINITY,
                           .wait_s = 6,
                           .fps = 30,
                           .speed = 1,
                           .width = 1280,
                           .height = 720,
                           .look = kn_view_scene_default()};
    o->look.hands = true;
    opterr = 0; // this file writes its own messages
    while ((option = getopt_long(argc, argv, ":h", names, &which)) != -1) {
        const char *word = argv[optind - 1];
        if (option == ':') REFUSE("%s: expected a value", word);
        if (option == '?') REFUSE("%s: no such option; knead view --help lists them", word);
        if (option == 'h') return o->help = true, KN_EXIT_OK;
        if (optarg && !*optarg) REFUSE("--%s '': expected a value", names[which].name);
        const char *expected = take(o, &a, option, optarg);
        if (expected) REFUSE("--%s %s: expected %s", names[which].name, optarg, expected);
    }
    for (; optind < argc; optind++) {
        if (o->file_count == KN_VIEW_FILES_MAX)
            REFUSE("%s: expected %d objects at most", argv[optind], KN_VIEW_FILES_MAX);
        o->file[o->file_count++] = argv[optind];
    }
    return check(o, &a);
}
