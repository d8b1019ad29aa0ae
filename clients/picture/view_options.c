#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/hand/bus_client.h"
#include "clients/picture/object_still.h"
#include "clients/picture/video_file.h"
#include "clients/picture/view_panels.h"
#include "clients/viewer/offscreen.h"
#include "core/scene/keys.h"
#include "server/scene_name.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead view --png FILE [OPTION]... [OBJECT]...\n"
    "       knead view --png FILE --compare A B\n"
    "       knead view --video FILE [OPTION]... [OBJECT]...\n"
    "       knead view --depth FILE [OPTION]... [OBJECT]\n\n"
    "Draw the object, its tools and the force on the hand, without a screen. Up to 4 objects stand side by side.\n"
    "Without OBJECT the picture shows what a running kneadd serves.\n\n"
    "  OBJECT             a log, stepped to its end or to --at; a scene at rest, a file or a name; or a snapshot of a\n"
    "                     kneadd state directory, with --scene\n"
    "  --png FILE         draw a picture\n"
    "  --compare          also draw the distance between the surfaces of two objects, at points that coincide at\n"
    "                     rest. If the meshes differ, each vertex of B is compared with the nearest vertex of A\n"
    "  --at TIME|end      time in the recording, counted from the beginning of its first session; 1,3,end: three\n"
    "                     pictures side by side (default: end)\n"
    "  --scene SCENE      scene of the snapshot; without a snapshot: draw the scene at rest\n"
    "  --size WxH         pixels, 16..4096 on each side; even numbers for a film. Several objects share the width,\n"
    "                     16 pixels or more for each (default: 1280x720 for one object; 640x480 for each of several,\n"
    "                     at most 1920x480 for all; 640x640 for a range image)\n"
    "  --wait TIME        longest wait for the messages of kneadd, up to 1 h (default: 6 s)\n"
    "  --lcm-url URL      bus of poses and forces (default: LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL     bus of meshes (default: " KN_MESH_URL ")\n\n"
    "camera and colours. For an object of 2 to 20 cm, the squares on the table have sides of 1 cm, and the black bar\n"
    "is 1 cm long. The arrow is as long as one square for each 5 N of force:\n"
    "  --camera FROM      front, back, left, right, top or corner: sets azimuth and elevation, which the two options\n"
    "                     below may change (default: corner, azimuth 28, elevation 27)\n"
    "  --azimuth DEG      direction of the camera, -360..360: 0 from the front, 90 from the right\n"
    "  --elevation DEG    height of the camera: 0 level .. 90 from above\n"
    "  --zoom X           magnification, 0.2..20; 2 shows half the width and height (default: 1)\n"
    "  --color WHAT       displacement, stress (von Mises) or residual (permanent strain) (default: none);\n"
    "                     for a served object, stress and residual need mesh.measures in the scene\n"
    "  --top QUANTITY     upper end of the colour scale, e.g. '5 kPa', '2 mm', 0.1 (default: the maximum in the\n"
    "                     picture or in the whole film); with --compare and without --color: upper end of the scale\n"
    "                     of distances\n"
    "  --style STYLE      lined, solid, wire (lines alone) or edges (every edge of the lattice) (default: lined)\n"
    "  --plain            draw no text\n\n"
    "films, by the program ffmpeg:\n"
    "  --video FILE       .mp4, .mov or .mkv (H.264), .webm (VP9) or .gif\n"
    "  --from TIME, --to TIME\n"
    "                     part of the recording to film (default: from 0 to the end)\n"
    "  --seconds TIME     duration of a film of the served object, 0.1 s to 1 h\n"
    "  --fps N            pictures per second, 1..120 (default: 30)\n"
    "  --speed X          speed of a recording, 0.01..1000; 2 is twice as fast (default: 1)\n\n"
    "range images, as a range finder above the object sees it:\n"
    "  --depth FILE       16-bit grey PNG of the object without its tools, straight from above, x to the right, y\n"
    "                     up. The value 0 means no object. Every other value gives the height above the table:\n"
    "                     (value - 1) times a step, 1 um for an object of up to 5 cm. The step and the size of a\n"
    "                     pixel, in mm, are printed and are in the text chunks of the file\n\n"
    "KNEAD_GL=osmesa or egl in the environment selects the renderer (default: the first that is available).\n\n"
    "Examples:\n"
    "    knead view --png now.png\n"
    "    knead view dough liver --png rest.png\n"
    "    knead view press.lcmlog --at 1,3,end --color stress --png press.png\n"
    "    knead view press.lcmlog --video press.mp4 --size 320x240 --fps 10\n"
    "    knead view press.lcmlog --at 4 --depth dent.png\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no message, no OpenGL, no ffmpeg, or the picture cannot be written.\n";

static const char *take_size(void *options, const char *text)
{
    kn_view_options *o = options;
    int end = 0;
    const bool good = !text[strspn(text, "0123456789x")] &&
                      sscanf(text, "%5dx%5d%n", &o->width, &o->height, &end) == 2 && !text[end] &&
                      o->width >= KN_OFFSCREEN_MIN && o->width <= KN_OFFSCREEN_MAX && o->height >= KN_OFFSCREEN_MIN &&
                      o->height <= KN_OFFSCREEN_MAX;
    return good ? NULL : "WxH, 16..4096 pixels on each side, e.g. 1280x720";
}

// Set azimuth and elevation from the name of a camera. The options --azimuth and --elevation may change the two angles
// later.
static const char *take_camera(void *options, const char *text)
{
    static const struct {
        double azimuth_deg, elevation_deg;
    } from[] = {{0, 14}, {180, 14}, {270, 14}, {90, 14}, {0, 90}, {28, 27}};
    kn_view_options *o = options;
    const int i = kn_choice_of("front|back|left|right|top|corner", text);
    if (i < 0) return "front, back, left, right, top or corner";
    o->look.azimuth_deg = from[i].azimuth_deg;
    o->look.elevation_deg = from[i].elevation_deg;
    return NULL;
}

static const char *take_video(void *path, const char *text)
{
    *(const char **)path = text;
    return kn_video_file_knows(text) ? NULL : KN_VIDEO_FILE_NAMES;
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
        REFUSE("--scene %s: expected a snapshot of this scene, or no other file; a log contains its own scene",
               o->scene);
    for (int i = 0; i < o->file_count; i++)
        if (o->kind[i] == KN_VIEW_SNAPSHOT && !o->scene)
            REFUSE("%s: is a snapshot, expected --scene SCENE with its scene", o->file[i]);
    // --scene alone shows the scene at rest.
    if (o->scene && o->file_count == 0) o->file[o->file_count] = o->scene, o->kind[o->file_count++] = KN_VIEW_SCENE;
    return KN_EXIT_OK;
}

// ---- checks of all options together

// Assign the moments of --at to the objects. One recording at several moments counts as several objects. A single
// moment applies to all objects.
static int share_out(kn_view_options *o)
{
    if (o->moments == 0) return KN_EXIT_OK;
    if (!kn_view_has(o, KN_VIEW_LOG)) REFUSE("--at: expected a log to step");
    if (o->video) REFUSE("--at: expected --from and --to for a film");
    for (int i = 1; o->moments == 1 && i < o->file_count; i++) o->at_s[i] = o->at_s[0];
    // If there is only one file, repeat it once for each moment of --at.
    while (o->moments > o->file_count && o->file[o->file_count - 1] == o->file[0]) {
        o->file[o->file_count] = o->file[0];
        o->kind[o->file_count++] = o->kind[0];
    }
    if (o->moments > 1 && o->moments != o->file_count)
        REFUSE("--at: %d moments of %d objects, expected one moment, one moment for each object, or one recording",
               o->moments, o->file_count);
    return KN_EXIT_OK;
}

// Check the options of a film. A recording and a live object allow different options.
static int check_film(const kn_view_options *o)
{
    const bool recorded = kn_view_has(o, KN_VIEW_LOG), live = o->file_count == 0;
    if (!recorded && !live)
        REFUSE("--video: expected a log among the files; an object at rest does not move by itself");
    if (recorded && o->seconds > 0)
        REFUSE("--seconds: only for films of the served object, expected --from and --to for a log");
    if (live && !(o->seconds > 0)) REFUSE("--video: expected a log, or --seconds N for the served object");
    if (live && o->speed != 1) REFUSE("--speed %g: expected a log; a served object is filmed in real time", o->speed);
    if (live && (isfinite(o->to_s) || o->from_s != 0)) REFUSE("--from and --to: expected a log");
    if (live && o->measure >= 0 && !o->top)
        REFUSE("--color: expected --top as well, because the range is not known in advance");
    if (o->to_s <= o->from_s) REFUSE("--to %g: expected more than --from %g", o->to_s, o->from_s);
    if (o->width % 2 || o->height % 2) REFUSE("--size %dx%d: expected even numbers for a film", o->width, o->height);
    return KN_OPTIONS_READ;
}

// Check the options of a range image, which has one object and a fixed camera.
static int check_depth(const kn_view_options *o)
{
    const kn_view_scene usual = kn_view_scene_default();
    if (o->file_count > 1) REFUSE("--depth: expected one object");
    if (o->measure >= 0 || o->compare)
        REFUSE("--depth: expected neither --color nor --compare; the grey levels are heights");
    if (isfinite(o->azimuth_deg) || isfinite(o->elevation_deg) || o->look.azimuth_deg != usual.azimuth_deg ||
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

// Set the default size. Two or three panels side by side have 640 x 480 pixels each. Four panels share a width of 1920
// pixels, so that the picture fits on a screen.
static void default_size(kn_view_options *o)
{
    const int panels = o->file_count + o->compare;
    if (o->depth) o->width = o->height = 640;
    if (panels < 2) return;
    o->width = panels < 4 ? 640 * panels : 1920;
    o->height = 480;
}

// Check all options together.
static int check(kn_view_options *o)
{
    const char *out = o->video ? o->video : o->depth ? o->depth : o->png;
    const char *option = o->video ? "video" : o->depth ? "depth" : "png";
    if (!out) REFUSE("expected --png FILE, --video FILE or --depth FILE");
    if (!!o->png + !!o->video + !!o->depth > 1) REFUSE("--png, --video and --depth: expected one of them");
    int code = check_scale(o);
    if (code == KN_EXIT_OK) code = check_files(o, out, option);
    if (code != KN_EXIT_OK) return code;
    if ((code = share_out(o)) != KN_EXIT_OK) return code;
    if (o->compare && o->file_count != 2) REFUSE("--compare: expected two objects, there are %d", o->file_count);
    if (!o->sized) default_size(o);
    const int panels = o->file_count + o->compare;
    if (panels > 1 && o->width / panels < KN_OFFSCREEN_MIN)
        REFUSE("--size %dx%d: expected at least %d pixels for each of %d pictures side by side", o->width, o->height,
               KN_OFFSCREEN_MIN, panels);
    const char *gl = getenv("KNEAD_GL");
    if (gl && *gl && !kn_offscreen_knows(gl)) REFUSE("KNEAD_GL=%s: expected osmesa or egl", gl);
    if (o->depth && (code = check_depth(o)) != KN_EXIT_OK) return code;
    // The options --azimuth and --elevation override the angles of --camera.
    if (isfinite(o->azimuth_deg)) o->look.azimuth_deg = o->azimuth_deg;
    if (isfinite(o->elevation_deg)) o->look.elevation_deg = o->elevation_deg;
    if (o->video) return check_film(o);
    if (o->seconds > 0 || o->speed != 1 || isfinite(o->to_s) || o->from_s != 0 || o->fps != 30)
        REFUSE("--from, --to, --seconds, --fps and --speed: expected --video");
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(kn_view_options, member)
static const kn_option rows[] = {
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("at", SPECIAL, AT(at_s), .take = kn_moment_take, .items = KN_VIEW_FILES_MAX,
              .count = offsetof(kn_view_options, moments),
              .expected = "1 to 4 times separated by commas, like '2 s' or end"),
    KN_OPTION("size", SPECIAL, .take = take_size, .given = offsetof(kn_view_options, sized)),
    KN_OPTION("azimuth", NUMBER, AT(azimuth_deg), KN_RANGE(-360, 360), .expected = "degrees, -360..360"),
    KN_OPTION("elevation", NUMBER, AT(elevation_deg), KN_RANGE(0, 90), .expected = "degrees, 0..90"),
    KN_OPTION("no-lines", RENAMED, .expected = "--style solid"),
    KN_OPTION("scene", SPECIAL, AT(scene), .take = kn_scene_take),
    KN_OPTION("wait", QUANTITY, AT(wait_s), .unit = "s", KN_RANGE(0, 3600), .expected = "a time from 0 to 3600 s"),
    KN_OPTION("lcm-url", TEXT, AT(url)),
    KN_OPTION("mesh-url", TEXT, AT(mesh_url)),
    KN_OPTION("color", CHOICE, AT(measure), .unit = KN_MEASURE_WORDS),
    KN_OPTION("top", TEXT, AT(top)),
    KN_OPTION("style", CHOICE, AT(look.style), .unit = "lined|solid|wire|edges"),
    KN_OPTION("plain", FLAG, AT(plain)),
    KN_OPTION("video", SPECIAL, AT(video), .take = take_video),
    KN_OPTION("from", QUANTITY, AT(from_s), .unit = "s", KN_RANGE(-1e9, 1e9), .expected = "a time like '2 s'"),
    KN_OPTION("to", QUANTITY, AT(to_s), .unit = "s", KN_RANGE(-1e9, 1e9), .expected = "a time like '4 s'"),
    KN_OPTION("seconds", QUANTITY, AT(seconds), .unit = "s", KN_RANGE(0.1, 3600),
              .expected = "a time from 0.1 to 3600 s"),
    KN_OPTION("fps", NUMBER, AT(fps), KN_RANGE(1, 120), .expected = "pictures per second, 1..120"),
    KN_OPTION("speed", NUMBER, AT(speed), KN_RANGE(0.01, 1000), .expected = "a factor, 0.01..1000; 2 is twice as fast"),
    KN_OPTION("depth", TEXT, AT(depth)),
    KN_OPTION("compare", FLAG, AT(compare)),
    KN_OPTION("camera", SPECIAL, .take = take_camera),
    KN_OPTION("zoom", NUMBER, AT(look.zoom), KN_RANGE(0.2, 20), .expected = "0.2..20"),
};

int kn_view_parse(int argc, char **argv, kn_view_options *o)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    *o = (kn_view_options){.measure = -1,
                           .at_s = {INFINITY, INFINITY, INFINITY, INFINITY},
                           .to_s = INFINITY,
                           .wait_s = 6,
                           .fps = 30,
                           .speed = 1,
                           .width = 1280,
                           .height = 720,
                           .azimuth_deg = NAN,
                           .elevation_deg = NAN,
                           .look = kn_view_scene_default()};
    o->look.hands = true;
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    for (; optind < argc; optind++) {
        if (o->file_count == KN_VIEW_FILES_MAX)
            REFUSE("%s: expected %d objects at most", argv[optind], KN_VIEW_FILES_MAX);
        // A name that is no scene is kept: the first bytes of a file tell its kind.
        kn_scene_take(&o->file[o->file_count++], argv[optind]);
    }
    return check(o);
}
