// knead latency: measures the time from a pose to its force through LCM on a real kneadd. This file has the options and
// the sequence of the measurement. latency_run.c has the threads and the processes, latency_report.c the results.
#include "clients/knead/latency.h"
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/hand/bus_client.h"
#include "clients/hand/session_record.h"
#include "clients/hand/tool_height.h"
#include "core/lattice/lattice.h"
#include "core/scene/scene.h"
#include "server/option_table.h"
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: knead latency [SCENE] [OPTION]...\n\n"
    "Measure the time from a pose to the force that answers it. A hand presses the scene's first tool into the\n"
    "object and sends 1000 poses a second to a kneadd that is started for the measurement. In the same milliseconds\n"
    "an LCM echo, without kneadd, answers the same messages for comparison. If a newer pose replaces a pose before\n"
    "kneadd has used it, the older pose is missed. Its latency is measured to the first answer to a later pose.\n\n"
    "  SCENE             scene to serve, a file or a name (default: dough, 847 nodes)\n"
    "  --seconds TIME    measure for this time, whole seconds up to 1 h (default: 10 s)\n"
    "  --phase MODE      lock or free: kneadd's --phase (default: lock)\n"
    "  --lcm-url URL     measure the kneadd that already serves URL, with the tool in the air 5 cm above the object.\n"
    "                    The stages are not measured, because only a kneadd started by this program reports them\n"
    "  --contract A,B    two times, or none (default: '60 us,150 us').\n"
    "                    The p50 may be at most the LCM echo's p50 + the tick's p50 + A.\n"
    "                    The p99 may be at most the LCM echo's p99 + the tick's p99 + B\n"
    "  --drift PPM       how much slower the hand's clock runs than kneadd's (default: 100)\n"
    "  --json            print the results as JSON\n"
    "  --png FILE        draw the distributions (needs gnuplot)\n\n"
    "Examples:\n"
    "    knead latency\n"
    "    knead latency dough-small --seconds 2 --contract none --json\n"
    "    knead latency --phase free --seconds 2 --contract none --png latency.png\n\n"
    "Exit codes: 0 ok, 1 the contract is not met, 2 bad input, 3 kneadd or the bus is not available.\n";

// above_m: height of the tool above the object, m. years_s: duration of a path in which the tool stands still, s;
// longer than any measurement.
static const double above_m = 0.05, years_s = 1e8;
static const double deep = 0.3; // depth of the press as a share of the object's height

typedef struct options {
    const char *scene, *phase, *url, *png;
    double seconds; // duration of the measurement, s; a whole number
    double drift_ppm, contract_us[2];
} options;

static volatile int interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

// Read the two tolerances of a latency contract (for p50 and p99), us. The text "none" is stored as -1.
static const char *take_contract(void *to, const char *text)
{
    double *us = to;
    char p50[32], p99[32], rest;
    if (!strcmp(text, "none")) return us[0] = us[1] = -1, NULL;
    if (sscanf(text, "%31[^,],%31[^,]%c", p50, p99, &rest) == 2 &&
        kn_quantity_read(p50, "us", false, 0, 1e12, &us[0]) && kn_quantity_read(p99, "us", false, 0, 1e12, &us[1]))
        return NULL;
    return "two times, like '60 us,150 us', or none";
}

// Read the command-line options and check that they can be combined.
static int parse(options *o, int argc, char **argv)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("seconds", QUANTITY, AT(seconds), .unit = "s", KN_RANGE(1, 3600),
                  .expected = "a time from 1 to 3600 s"),
        KN_OPTION("phase", TEXT, AT(phase)),
        KN_OPTION("lcm-url", TEXT, AT(url)),
        KN_OPTION("contract", SPECIAL, AT(contract_us), .take = take_contract),
        KN_OPTION("drift", NUMBER, AT(drift_ppm), KN_RANGE(-1000, 1000)),
        KN_OPTION("json", CALL, .call = kn_result_open),
        KN_OPTION("png", TEXT, AT(png)),
        KN_OPTION("plot", RENAMED, .expected = "--png FILE"),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    char error[256];
    *o = (options){.seconds = 10, .drift_ppm = KN_LATENCY_DRIFT_PPM, .contract_us = {60, 150}};
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (o->seconds != trunc(o->seconds))
        return kn_complain("latency", KN_EXIT_USAGE, "--seconds %g: expected whole seconds", o->seconds);
    // The only argument that is not an option is the scene.
    if (optind < argc && kn_command_scene("latency", &o->scene, argv[optind++]) != KN_EXIT_OK) return KN_EXIT_USAGE;
    if (optind < argc) return kn_complain("latency", KN_EXIT_USAGE, "`%s`: expected one SCENE", argv[optind]);
    if (o->phase && strcmp(o->phase, "lock") && strcmp(o->phase, "free"))
        return kn_complain("latency", KN_EXIT_USAGE, "--phase %s: expected lock or free", o->phase);
    if (o->url && (o->scene || o->phase))
        return kn_complain(
            "latency", KN_EXIT_USAGE,
            "--lcm-url: expected neither SCENE nor --phase, because the running kneadd already has both");
    if (o->url && !kn_bus_client_check(o->url, KN_FORCE_URL, error, sizeof error))
        return kn_complain("latency", KN_EXIT_USAGE, "%s", error);
    return code;
}

// Receive the scene from a kneadd that is already running.
static kn_scene *ask_scene(const char *url, char *error, size_t size)
{
    kn_session_record *record = kn_session_record_open(url, error, size);
    kn_scene *scene = NULL;
    if (!record) return NULL;
    if (!kn_session_record_scene(record, 4000))
        snprintf(error, size, "no KNEAD_SCENE for 4 s: %s", kn_bus_client_why("is kneadd running on this bus?"));
    else
        scene =
            kn_scene_parse(record->scene_name, record->scene_text, strlen(record->scene_text), NULL, 0, error, size);
    kn_session_record_destroy(record);
    return scene;
}

// Create the path of the hand. If this program has started kneadd, the tool presses slowly into the object during the
// whole measurement, so that the tool always touches the object. If kneadd was already running, the tool stays above
// the object.
static kn_tool_path *make_path(const kn_scene *scene, const options *o, const char **work)
{
    const kn_probe_def *tool = &scene->model.probe[0];
    double extent_m[3];
    kn_model_def_extent(&scene->model, extent_m);
    // Compute the height of the tool at which it touches the top of the object.
    double touch_m = extent_m[2] + kn_tool_height_m(tool);
    *work = "press";
    // Choose the speed of the press such that it lasts a little longer than the measurement.
    double depth_m = deep * extent_m[2], speed_m_s = depth_m / (1 + 1.2 * o->seconds);
    if (!o->url)
        return kn_tool_path_press(
            &(kn_tool_path_def){.touch_z_m = touch_m, .depth_m = depth_m, .speed_m_s = speed_m_s});
    // Without a press, the path has a single piece in which the tool stands still.
    kn_tool_path *path = calloc(1, sizeof *path + sizeof(kn_tool_path_piece));
    if (!path) return NULL;
    kn_tool_path_point there = {.position_m = {0, 0, touch_m + above_m}, .orientation_wxyz = {1}};
    path->piece = (kn_tool_path_piece *)(path + 1);
    path->count = 1;
    path->duration_s = years_s;
    path->piece[0] = (kn_tool_path_piece){KN_TOOL_PATH_PIECE_STAND, *work, 0, years_s, there, there, 0};
    return path;
}

// Evaluate the measurement and write all outputs. Return KN_EXIT_FAILED if the latency contract is not kept.
static int report(const options *o, const kn_scene *scene, const kn_latency *l)
{
    kn_latency_report r = {.scene = scene->name};
    if (!o->url) r.phase = o->phase ? o->phase : "lock";
    memcpy(r.contract_us, o->contract_us, sizeof r.contract_us);
    // Build the model of the scene only to count its nodes for the report.
    char error[256];
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    r.nodes = model ? model->node_count - kn_composite_tied(model) : 0;
    kn_model_destroy(model);
    int code = KN_EXIT_INTERNAL;
    if (kn_latency_sort(&r, l)) {
        bool kept = kn_latency_print(&r, l);
        kn_latency_json(&r, l);
        code = o->png ? kn_latency_plot(&r, o->png) : KN_EXIT_OK;
        if (code == KN_EXIT_OK && !kept) code = KN_EXIT_FAILED;
    }
    kn_latency_report_free(&r);
    return code;
}

// Start kneadd if necessary, run the measurement, stop kneadd and report.
static int measure(const options *o, const char *path, const kn_scene *scene, kn_latency_served *served)
{
    kn_latency l = {.seconds = (int)o->seconds, .drift_ppm = o->drift_ppm, .probe = scene->model.probe[0].name};
    // The echo always gets a bus of its own, even if a running kneadd is measured.
    kn_latency_served_urls(served, l.echo_url);
    l.url = o->url ? o->url : served->url;
    kn_tool_path *way = make_path(scene, o, &l.work);
    l.path = way;
    int code = way ? KN_EXIT_OK : KN_EXIT_INTERNAL;
    if (code == KN_EXIT_OK && !o->url) code = kn_latency_served_start(served, path, o->phase ? o->phase : "lock");
    if (code == KN_EXIT_OK && !kn_latency_run(&l, &interrupted))
        code = kn_complain("latency", KN_EXIT_DEVICE, "%s", l.error);
    // Stop kneadd in every case. Its trace has the times of the stages of each pose.
    bool ended = kn_latency_served_stop(served, &l.flights[KN_LATENCY_POSE]);
    if (code == KN_EXIT_OK && !ended) code = kn_complain("latency", KN_EXIT_DEVICE, "kneadd ended with an error");
    if (code == KN_EXIT_OK) code = report(o, scene, &l);
    kn_latency_free(&l);
    kn_tool_path_destroy(way);
    return code;
}

int kn_latency_main(int argc, char **argv)
{
    options o;
    int code = parse(&o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    // Check first that the output files can be written, because a measurement may take an hour.
    if (o.png && (code = kn_plot_try("latency", o.png)) != KN_EXIT_OK) return code;
    char error[512] = "";
    const char *path = o.scene;
    if (!path && kn_command_scene("latency", &path, "dough") != KN_EXIT_OK) return KN_EXIT_USAGE;
    kn_scene *scene = o.url ? ask_scene(o.url, error, sizeof error) : kn_scene_load(path, NULL, 0, error, sizeof error);
    if (!scene) return kn_complain("latency", o.url ? KN_EXIT_DEVICE : KN_EXIT_USAGE, "%s", error);
    if (scene->model.probe_count > 0) {
        signal(SIGINT, on_signal);
        signal(SIGTERM, on_signal);
        kn_latency_served served = {.trace = -1};
        code = measure(&o, path, scene, &served);
    } else {
        code = kn_complain("latency", KN_EXIT_USAGE, "%s: has no probe, expected a tool to measure with", scene->name);
    }
    kn_scene_destroy(scene);
    return code;
}
