// knead view: a picture of an object, from the bus, from a recording, or at rest.
#include "clients/knead/commands.h"
#include "clients/knead/still.h"
#include "clients/viewer/image.h"
#include "clients/viewer/label.h"
#include "clients/viewer/offscreen.h"
#include "clients/viewer/renderer.h"
#include "core/scene/units.h"
#include "server/replay.h"
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define SETTLE_MS 50 // after the first whole mesh: the probes' forces, and a mesh that is not older than they are

static const char help[] =
    "usage: knead view --png FILE [OPTION]...             what a running kneadd serves\n"
    "       knead view --png FILE [OPTION]... LOG         a recording, stepped to its end or to --at\n"
    "       knead view --png FILE [OPTION]... --scene F   a scene's object at rest\n\n"
    "Draws the object, its tools and the force on the hand, without a screen.\n\n"
    "  --at SECONDS|end   moment of the recording, since its first session began (end)\n"
    "  --size WxH         pixels, 16..4096 each (1280x720)\n"
    "  --azimuth DEG      where from: 0 the front, 90 the right (28)\n"
    "  --elevation DEG    0 level .. 90 from above (27)\n"
    "  --color WHAT       displacement, stress (von Mises) or residual: strain that nothing brings back (none)\n"
    "  --top QUANTITY     end of the colour scale, e.g. '5 kPa', '2 mm', 0.1 (what the most of the picture needs)\n"
    "  --style STYLE      lined, solid, wire: lines alone, or edges: every edge of the lattice (lined)\n"
    "  --no-lines         as --style solid\n"
    "  --plain            nothing written on it\n"
    "  --wait SECONDS     how long to listen for the server, 0..3600 (6: its scene comes every 5)\n"
    "  --lcm-url URL      poses, forces, scene ($LCM_DEFAULT_URL, " KN_FORCE_URL ")\n"
    "  --mesh-url URL     meshes (" KN_MESH_URL ")\n\n"
    "Squares on the table, and the black bar: 1 cm, for an object of 2 to 20 cm. Arrow: one square per 5 N.\n"
    "Exit codes: 0 ok, 2 bad input, 3 nothing heard, no OpenGL, or the picture cannot be written.\n";

typedef struct options {
    const char *png, *log, *scene, *url, *mesh_url;
    double at_s; // INFINITY: end
    double wait_s;
    int width, height;
    kn_view_scene look; // azimuth, elevation, style
    int measure;        // kn_measure; -1: none
    const char *top;    // as asked for
    double top_si;      // 0: what the picture needs
    bool plain, help;
} options;

__attribute__((format(printf, 2, 3))) static int fail(int code, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fputs("knead view: ", stderr);
    vfprintf(stderr, format, args);
    fputc('\n', stderr);
    va_end(args);
    return code;
}

// ---- options

static bool number(const char *text, double low, double high, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return end != text && !*end && *value >= low && *value <= high;
}

static bool size(const char *text, options *o)
{
    char end = 0;
    return sscanf(text, "%5dx%5d%c", &o->width, &o->height, &end) == 2 && o->width >= KN_OFFSCREEN_MIN &&
           o->width <= KN_OFFSCREEN_MAX && o->height >= KN_OFFSCREEN_MIN && o->height <= KN_OFFSCREEN_MAX;
}

static bool style(const char *text, options *o)
{
    static const char *const name[] = {
        [KN_VIEW_LINED] = "lined", [KN_VIEW_SOLID] = "solid", [KN_VIEW_WIRE] = "wire", [KN_VIEW_EDGES] = "edges"};
    int i = 0;
    while (i < 4 && strcmp(name[i], text) != 0) i++;
    o->look.style = (kn_view_style)(i & 3);
    return i < 4;
}

static bool measure(const char *text, options *o)
{
    o->measure = KN_MEASURES - 1;
    while (o->measure >= 0 && strcmp(kn_measure_names[o->measure].name, text) != 0) o->measure--;
    return o->measure >= 0;
}

static const char *take(options *o, char option, const char *text) // NULL, or what was expected
{
    switch (option) {
    case 'c': return measure(text, o) ? NULL : "displacement, stress or residual";
    case 'T': o->top = text; return NULL;
    case 'y': return style(text, o) ? NULL : "lined, solid, wire or edges";
    case 'P': o->plain = true; return NULL;
    case 'p': o->png = text; return NULL;
    case 'S': o->scene = text; return NULL;
    case 'l': o->url = text; return NULL;
    case 'm': o->mesh_url = text; return NULL;
    case 'n': o->look.style = KN_VIEW_SOLID; return NULL;
    case 't': return strcmp(text, "end") == 0 || number(text, -1e9, 1e9, &o->at_s) ? NULL : "seconds, or end";
    case 's': return size(text, o) ? NULL : "WxH, 16..4096 pixels on each side, e.g. 1280x720";
    case 'a': return number(text, -360, 360, &o->look.azimuth_deg) ? NULL : "degrees, -360..360";
    case 'e': return number(text, 0, 90, &o->look.elevation_deg) ? NULL : "degrees, 0..90";
    default: return number(text, 0, 3600, &o->wait_s) ? NULL : "seconds, 0..3600";
    }
}

// --top in the measure's unit.
static bool top(options *o)
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

static bool same_file(const char *a, const char *b)
{
    struct stat x, y;
    return a && stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

static int parse(int argc, char **argv, options *o)
{
    static const struct option names[] = {
        {"png", 1, NULL, 'p'},       {"at", 1, NULL, 't'},       {"size", 1, NULL, 's'},    {"azimuth", 1, NULL, 'a'},
        {"elevation", 1, NULL, 'e'}, {"no-lines", 0, NULL, 'n'}, {"scene", 1, NULL, 'S'},   {"wait", 1, NULL, 'w'},
        {"lcm-url", 1, NULL, 'l'},   {"mesh-url", 1, NULL, 'm'}, {"help", 0, NULL, 'h'},
        {"color", 1, NULL, 'c'},     {"top", 1, NULL, 'T'},      {"style", 1, NULL, 'y'},   {"plain", 0, NULL, 'P'},
        {NULL, 0, NULL, 0}};
    int option, which = 0;
    opterr = 0; // our own words
    while ((option = getopt_long(argc, argv, ":h", names, &which)) != -1) {
        const char *word = argv[optind - 1];
        if (option == ':') return fail(KN_EXIT_USAGE, "%s: expected a value", word);
        if (option == '?') return fail(KN_EXIT_USAGE, "%s: no such option; knead view --help lists them", word);
        if (option == 'h') return o->help = true, KN_EXIT_OK;
        const char *expected = take(o, (char)option, optarg);
        if (expected) return fail(KN_EXIT_USAGE, "--%s %s: expected %s", names[which].name, optarg, expected);
    }
    if (optind < argc) o->log = argv[optind++];
    if (optind < argc) return fail(KN_EXIT_USAGE, "%s: expected one log", argv[optind]);
    if (!o->png) return fail(KN_EXIT_USAGE, "expected --png FILE");
    if (o->top && o->measure < 0) return fail(KN_EXIT_USAGE, "--top %s: expected --color as well", o->top);
    if (o->top && !top(o))
        return fail(KN_EXIT_USAGE, "--top %s: expected a %s above 0, e.g. %s", o->top,
                    kn_measure_names[o->measure].words, (const char *[]){"'2 mm'", "'5 kPa'", "0.1"}[o->measure]);
    if (same_file(o->log, o->png) || same_file(o->scene, o->png))
        return fail(KN_EXIT_USAGE, "--png %s: is being read, expected another file to write", o->png);
    if (o->log && o->scene)
        return fail(KN_EXIT_USAGE, "--scene %s: expected a log or a scene; a log holds its own", o->scene);
    if (!o->log && isfinite(o->at_s)) return fail(KN_EXIT_USAGE, "--at: expected a log to step");
    return KN_EXIT_OK;
}

// ---- at rest

// What --color and --style need of a state.
static bool measured(const options *o, kn_still *s, const kn_model *model, const kn_state *state)
{
    const bool edges = o->look.style == KN_VIEW_EDGES;
    if (o->measure < 0 && !edges) return true;
    kn_gauge *gauge = o->measure >= 0 ? kn_gauge_create(model) : NULL;
    const kn_measure what = o->measure >= 0 ? (kn_measure)o->measure : KN_MEASURE_DISPLACEMENT;
    bool ok = (gauge || o->measure < 0) && kn_still_measure(s, model, state, gauge, what, edges);
    kn_gauge_destroy(gauge);
    return ok;
}

static int from_scene(const options *o, kn_still *s)
{
    char error[400];
    kn_scene *scene = kn_scene_load(o->scene, NULL, 0, error, sizeof error);
    if (!scene) return fprintf(stderr, "%s\n", error), KN_EXIT_USAGE;
    int code = KN_EXIT_OK;
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    kn_state *state = model ? kn_state_create(model) : NULL;
    if (!model) code = fail(KN_EXIT_USAGE, "%s: %s", o->scene, error);
    else if (!state || !kn_still_state(s, model, state) || !measured(o, s, model, state))
        code = fail(KN_EXIT_DEVICE, "out of memory");
    snprintf(s->caption, sizeof s->caption, "%s at rest", scene->name);
    kn_state_destroy(state);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return code;
}

// ---- a recording

static int step_to(kn_replay *r, const options *o)
{
    double last_s = -INFINITY;
    while (kn_replay_step(r)) {
        last_s = r->tick.time_s;
        if (last_s >= o->at_s - 0.0005) return KN_EXIT_OK; // the tick nearest to it
    }
    if (isinf(last_s)) return fail(KN_EXIT_USAGE, "%s: not one tick in it, expected a recorded session", o->log);
    if (isinf(o->at_s)) return KN_EXIT_OK;
    return fail(KN_EXIT_USAGE, "--at %g: %s ends at %.3f s", o->at_s, o->log, last_s);
}

static int from_log(const options *o, kn_still *s)
{
    char error[400];
    kn_replay *r = kn_replay_create(&(kn_replay_def){.log_path = o->log}, error, sizeof error);
    if (!r) return fail(KN_EXIT_USAGE, "%s", error);
    int code = step_to(r, o);
    if (code == KN_EXIT_OK &&
        (!kn_still_state(s, r->model, kn_replay_state(r)) || !measured(o, s, r->model, kn_replay_state(r))))
        code = fail(KN_EXIT_DEVICE, "out of memory");
    for (int i = 0; code == KN_EXIT_OK && i < r->tick.out.probes; i++) {
        const kn_force *f = &r->tick.out.force[i];
        if (!f->live) continue;
        kn_still_probe(s, &r->model->def.probe[i], f->proxy_position_m, f->proxy_orientation_wxyz, f->force_n, f->gain);
    }
    snprintf(s->caption, sizeof s->caption, "%s at %.3f s", r->scene->name, r->tick.time_s);
    if (r->damage[0]) fprintf(stderr, "knead view: %s: %s; what stands before it was used\n", o->log, r->damage);
    kn_replay_destroy(r);
    return code;
}

// ---- the bus

static int unheard(const options *o, const kn_live *live)
{
    const char *what = live->heard[0] ? "a server, but no mesh" : live->heard[1] ? "no whole mesh" : "nothing";
    return fail(KN_EXIT_DEVICE,
                "heard %s in %g s: is kneadd running, in this network namespace, with these --lcm-url and --mesh-url?",
                what, o->wait_s);
}

static int from_bus(const options *o, kn_still *s)
{
    char error[400];
    kn_live live;
    if (o->look.style == KN_VIEW_EDGES)
        return fail(KN_EXIT_USAGE, "--style edges: what is served is the surface alone, expected a log or --scene");
    if (!kn_join_check(o->url, KN_FORCE_URL, error, sizeof error) ||
        !kn_join_check(o->mesh_url, KN_MESH_URL, error, sizeof error))
        return fail(KN_EXIT_USAGE, "%s", error);
    if (!kn_live_open(&live, o->url, o->mesh_url, error, sizeof error)) return fail(KN_EXIT_DEVICE, "%s", error);
    int64_t end_ms = kn_live_now_ms() + (int64_t)(o->wait_s * 1000), now_ms;
    bool settling = false;
    while ((now_ms = kn_live_now_ms()) < end_ms) {
        kn_live_listen(&live, (int)(end_ms - now_ms));
        if (settling || !live.mesh.whole || !live.scene) continue;
        settling = true;
        end_ms = kn_live_now_ms() + SETTLE_MS;
    }
    int code = KN_EXIT_OK;
    if (!live.mesh.whole) code = unheard(o, &live);
    else if (!kn_still_live(s, &live, error, sizeof error)) code = fail(KN_EXIT_DEVICE, "%s", error);
    else if (o->measure >= 0 && !error[0] && !kn_still_told(s, &live, (kn_measure)o->measure))
        code = fail(KN_EXIT_USAGE, "--color %s: the scene that is served has no such mesh.measures, expected a start with it",
                    kn_measure_names[o->measure].name);
    else if (error[0])
        fprintf(stderr, "knead view: %s; drawn without probes and colours, with the edges of the shape as it is\n", error);
    snprintf(s->caption, sizeof s->caption, "%s live, tick %" PRId64, live.scene ? live.scene->name : "an object",
             live.mesh.tick);
    kn_live_close(&live);
    return code;
}

// ---- the picture

// Caption, bar, legend.
static bool write_on(const options *o, const kn_still *s, const kn_renderer *r, double top_si, uint8_t *rgba,
                     char *error, size_t error_size)
{
    char bar[32];
    const kn_scale scale = {o->measure < 0 ? NULL : kn_measure_names[o->measure].words,
                            o->measure < 0 ? NULL : kn_measure_names[o->measure].unit, top_si};
    kn_label label = {.caption = s->caption, .scale = s->view.value ? &scale : NULL, .bar = bar};
    const double bar_cm = 100 * kn_renderer_bar(r, label.bar_at);
    const bool mm = bar_cm < 0.99; // a float's 1 cm is a little less
    snprintf(bar, sizeof bar, "%.4g %s", mm ? 10 * bar_cm : bar_cm, mm ? "mm" : "cm");
    return o->plain || kn_label_draw(&label, o->width, o->height, rgba, error, error_size);
}

static int draw(const options *o, kn_still *s)
{
    char error[400];
    static const double least[KN_MEASURES] = {1e-5, 1, 1e-3}; // of an object at rest: rounding is not made a picture of
    const double floor_si = o->measure >= 0 ? least[o->measure] : 1;
    const double top_si = o->top_si > 0 ? o->top_si : kn_scale_round(fmax(kn_still_most(s), floor_si));
    kn_still_scale(s, top_si);
    kn_renderer *r = kn_renderer_open(o->width, o->height, 4, error, sizeof error);
    if (!r) return fail(KN_EXIT_DEVICE, "%s", error);
    uint8_t *rgba = malloc((size_t)o->width * (size_t)o->height * 4);
    int code = KN_EXIT_OK;
    s->view.xyz = (const float(*)[3])s->now;
    if (!rgba) code = fail(KN_EXIT_DEVICE, "out of memory");
    else if (!kn_renderer_mesh(r, s->vertex_count, (const float(*)[3])s->rest, s->triangle_count,
                               (const int(*)[3])s->triangle))
        code = fail(KN_EXIT_DEVICE, "a mesh of %d vertices and %d triangles cannot be drawn", s->vertex_count,
                    s->triangle_count);
    else {
        kn_renderer_draw(r, &s->view, rgba);
        if (!write_on(o, s, r, top_si, rgba, error, sizeof error) ||
            !kn_image_write_png(o->png, o->width, o->height, rgba, error, sizeof error))
            code = fail(KN_EXIT_DEVICE, "%s", error);
        else printf("%s: %d x %d, %s\n", o->png, o->width, o->height, s->caption);
    }
    free(rgba);
    kn_renderer_close(r);
    return code;
}

int kn_view_main(int argc, char **argv)
{
    options o = {.measure = -1, .at_s = INFINITY, .wait_s = 6, .width = 1280, .height = 720, .look = kn_view_scene_default()};
    int code = parse(argc, argv, &o);
    if (o.help) fputs(help, stdout);
    if (o.help || code != KN_EXIT_OK) return code;
    kn_still s = {.view = o.look};
    s.view.follow = true;
    code = o.scene ? from_scene(&o, &s) : o.log ? from_log(&o, &s) : from_bus(&o, &s);
    if (code == KN_EXIT_OK) code = draw(&o, &s);
    kn_still_free(&s);
    return code;
}
