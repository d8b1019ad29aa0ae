// knead export: writes the states of an object over time to files for other programs: ParaView and VTK, MeshLab and
// Open3D, Foxglove, tables.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/hand/session_record.h"
#include "clients/picture/mcap_file.h"
#include "clients/picture/object_still.h"
#include "clients/picture/paraview.h"
#include "clients/viewer/beside.h"
#include "core/algebra/algebra.h"
#include "server/option_table.h"
#include "server/scene_name.h"
#include "server/log_replay.h"
#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOMENTS_MAX 100000 // largest number of moments, because file names have five digits for the moment's index

static const char help[] =
    "usage: knead export LOG [OPTION]...\n"
    "       knead export --scene SCENE [OPTION]...\n\n"
    "Write an object as files for other programs, in SI units: a recording, stepped through the daemon's servo, or\n"
    "the object of a scene at rest. The name of each quantity ends with its unit. At least one output is required.\n"
    "Either all outputs appear, complete, or none of them.\n\n"
    "outputs:\n"
    "  --vtk DIR          files for ParaView and VTK, in a new folder. object.pvd has the volume of every cell, the\n"
    "                     tools and their forces, and at every node displacement, velocity, von Mises stress,\n"
    "                     residual strain and contact force. edges.pvd has stress, strain and residual strain of\n"
    "                     every edge\n"
    "  --ply PATH         files for MeshLab and Open3D: the surface with its normals. Each vertex has the quantity of\n"
    "                     --color as a colour and as a number named quality. With --at or --scene, PATH is a file.\n"
    "                     Otherwise PATH is a folder with one file per moment\n"
    "  --csv FILE         a row for each tick and live probe, with the columns of knead replay --csv\n"
    "  --mcap FILE        file for Foxglove and other readers of MCAP: poses and forces of every tick, and the\n"
    "                     surface with the tools at every moment, as JSON with schemas\n\n"
    "options:\n"
    "  --scene SCENE      export this scene: a file or a name\n"
    "  --from TIME, --to TIME\n"
    "                     part of the recording, from the start of its first session (default: all of it)\n"
    "  --every TIME       interval between two exported moments, 1 ms or more (default: 100 ms)\n"
    "  --at TIME|end      export this moment only\n"
    "  --color WHAT       displacement, stress (von Mises) or residual: quantity in --ply (default: displacement)\n"
    "  --top QUANTITY     upper end of the colour scale, e.g. '5 kPa', '2 mm', 0.1 (default: maximum in the file).\n"
    "                     Required for a folder, so that a colour means the same value in all files\n"
    "  --snapshot PATH    as in knead replay: snapshot of the run, if the log begins on a kneaded object\n\n"
    "Examples:\n"
    "    knead export press.lcmlog --vtk frames --every '500 ms'\n"
    "    knead export press.lcmlog --at end --ply end.ply --color stress\n"
    "    knead export --scene bun --vtk bun\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";

typedef struct options {
    const char *log, *scene, *snapshot, *vtk, *ply, *csv, *mcap;
    // to_s: INFINITY means up to the end of the recording. at_s: NAN means to export a series of moments, INFINITY to
    // export the last moment only.
    double from_s, to_s, every_s, at_s;
    bool spaced; // true: at least one of --from, --to and --every was given
    int measure;
    const char *top;
    double top_si; // end of the colour scale, SI; 0: chosen from the values in the file
} options;

typedef struct run {
    const options *o;
    kn_output_folder vtk, plys;
    kn_beside ply, csv, mcap;
    kn_paraview *paraview;
    kn_mcap *messages; // writer of `mcap`
    kn_gauge *gauge;
    int gauged; // number of the model (kn_moment.models) that `gauge` was made for; the gauge computes stresses
    int moments;
    double first_s, last_s; // times of the first and the last exported moment
} run;

#define REFUSE(...) return kn_complain("export", KN_EXIT_USAGE, __VA_ARGS__)
#define FAIL(...) return kn_complain("export", KN_EXIT_DEVICE, __VA_ARGS__)

// ---- PLY files

typedef struct __attribute__((packed)) vertex { // one vertex in the layout that the header of the PLY file declares
    float xyz[3], normal[3], quality;
    uint8_t rgb[3];
} vertex;

typedef struct __attribute__((packed)) face {
    uint8_t count;
    int32_t vertex[3];
} face;

// Add the contribution of one corner of a triangle to the normal of the corner's vertex: the triangle's unit normal
// times the corner's angle. The weighting makes the result independent of how a quad is cut into triangles.
static void add_corner(const float at[3], const float next[3], const float last[3], float normal[3])
{
    double a[3], b[3], across[3];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)next[k] - (double)at[k];
        b[k] = (double)last[k] - (double)at[k];
    }
    kn_cross(a, b, across);
    const double size = sqrt(kn_dot(across, across)), angle = atan2(size, kn_dot(a, b));
    for (int k = 0; k < 3 && size > 0; k++) normal[k] += (float)(angle * across[k] / size);
}

// Compute unit normals of all vertices. A vertex without triangles gets 0.
static void add_normals(const kn_object_still *s, vertex *v)
{
    for (int t = 0; t < s->triangle_count; t++)
        for (int i = 0; i < 3; i++) {
            const int *c = s->triangle[t], at = c[i];
            float normal[3]; // a copy: members of a packed struct cannot be passed by pointer
            memcpy(normal, v[at].normal, sizeof normal);
            add_corner(s->now[at], s->now[c[(i + 1) % 3]], s->now[c[(i + 2) % 3]], normal);
            memcpy(v[at].normal, normal, sizeof normal);
        }
    // Scale the summed normal of each vertex to unit length.
    for (int i = 0; i < s->vertex_count; i++) {
        float n[3];
        memcpy(n, v[i].normal, sizeof n);
        const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int k = 0; k < 3 && length > 0; k++) v[i].normal[k] = n[k] / length;
    }
}

// Write the surface of `still` to `file` as PLY, binary little-endian: position in m, normal, value of a measure and
// colour of each vertex. The value is named `quality`, as in MeshLab. The vertices have the same colours as in the
// pictures of `knead view`. Neighbouring triangles share vertices. what: the measure whose values are in still->value.
// top: value at the end of the colour scale, > 0, in the unit of the measure. about: one line of text for the header of
// the file. Return false when memory is short. Write errors are not checked here. The caller checks the stream.
static bool write_surface(FILE *f, const kn_object_still *s, kn_measure what, double top, const char *about)
{
    const kn_measure_name *name = &kn_measure_names[what];
    vertex *v = calloc((size_t)s->vertex_count + 1, sizeof *v);
    if (!v) return false;
    // Fill in position, value of the measure and colour of every vertex.
    for (int i = 0; i < s->vertex_count; i++) {
        float srgb[3];
        memcpy(v[i].xyz, s->now[i], sizeof v[i].xyz);
        v[i].quality = s->value[i];
        kn_scale_at((double)s->value[i] / top, srgb);
        for (int k = 0; k < 3; k++) v[i].rgb[k] = (uint8_t)lroundf(255 * srgb[k]);
    }
    add_normals(s, v);
    fprintf(f,
            "ply\nformat binary_little_endian 1.0\ncomment knead: %s; metres\ncomment quality: %s%s%s, colours to %g\n",
            about, name->words, *name->unit ? ", " : "", name->unit, top);
    fprintf(f,
            "element vertex %d\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
            "property float ny\nproperty float nz\nproperty float quality\nproperty uchar red\n"
            "property uchar green\nproperty uchar blue\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n",
            s->vertex_count, s->triangle_count);
    fwrite(v, sizeof *v, (size_t)s->vertex_count, f);
    // The faces follow the vertices: a count and three indices each.
    for (int t = 0; t < s->triangle_count; t++) {
        face c = {.count = 3};
        memcpy(c.vertex, s->triangle[t], sizeof c.vertex);
        fwrite(&c, sizeof c, 1, f);
    }
    free(v);
    return true;
}

// ---- options

// Check that no output file replaces an input file, and that no output lies inside the folder of another output.
static int check_outputs(const options *o)
{
    // The PLY output is one file if one moment is exported, otherwise a folder of files.
    const bool one = !isnan(o->at_s) || o->scene;
    const char *files[] = {o->csv, o->mcap, one ? o->ply : NULL};
    for (int i = 0; i < 3; i++)
        if (kn_output_same(o->log, files[i]) || kn_output_same(o->scene, files[i]) ||
            kn_output_same(o->snapshot, files[i]))
            REFUSE("%s: is being read, expected another file to write", files[i]);
    const char *all[] = {o->vtk, o->ply, o->csv, o->mcap};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < i; k++)
            if (all[i] && all[k] && (kn_output_holds(all[i], all[k]) || kn_output_holds(all[k], all[i])))
                REFUSE("%s: expected a separate path for each output, none inside another", all[i]);
    // A series of PLY files needs a fixed colour scale, so that a colour means the same value in all files.
    if (o->ply && !one && !o->top) REFUSE("--ply %s: expected --top as well, or --at for one moment", o->ply);
    return KN_OPTIONS_READ;
}

// Check that the given options can be combined.
static int check(options *o)
{
    if (!o->log && !o->scene) REFUSE("expected a LOG or --scene SCENE; see knead export --help");
    if (o->log && o->scene)
        REFUSE("--scene %s: expected either a log or a scene, because a log contains its scene", o->scene);
    if (!o->vtk && !o->ply && !o->csv && !o->mcap) REFUSE("expected --vtk DIR, --ply PATH, --csv FILE or --mcap FILE");
    if (o->scene && (o->csv || o->mcap || o->spaced || !isnan(o->at_s) || o->snapshot))
        REFUSE("--csv, --mcap, --from, --to, --every, --at and --snapshot: expected a log, because a scene at rest "
               "does not change");
    if (!isnan(o->at_s) && o->spaced) REFUSE("--at: expected no --from, --to or --every with it");
    if (o->to_s < o->from_s) REFUSE("--to %g: expected no less than --from %g", o->to_s, o->from_s);
    if (o->top && !o->ply) REFUSE("--top %s: expected --ply as well", o->top);
    if (o->top && (o->top_si = kn_measure_top((kn_measure)o->measure, o->top)) == 0)
        REFUSE("--top %s: expected a %s above 0, e.g. %s", o->top, kn_measure_names[o->measure].words,
               kn_measure_top_example((kn_measure)o->measure));
    return check_outputs(o);
}

static int parse(int argc, char **argv, options *o)
{
#define AT(member) .offset = offsetof(options, member)
#define SPACED .given = offsetof(options, spaced)
    static const kn_option rows[] = {
        KN_OPTION("vtk", TEXT, AT(vtk)),
        KN_OPTION("ply", TEXT, AT(ply)),
        KN_OPTION("csv", TEXT, AT(csv)),
        KN_OPTION("mcap", TEXT, AT(mcap)),
        KN_OPTION("scene", SPECIAL, AT(scene), .take = kn_scene_take),
        KN_OPTION("from", QUANTITY, AT(from_s), .unit = "s", KN_RANGE(-1e9, 1e9), .expected = "a time like '2 s'",
                  SPACED),
        KN_OPTION("to", QUANTITY, AT(to_s), .unit = "s", KN_RANGE(-1e9, 1e9), .expected = "a time like '4 s'", SPACED),
        KN_OPTION("every", QUANTITY, AT(every_s), .unit = "s", KN_RANGE(0.001, 1e9), SPACED,
                  .expected = "a time of 1 ms or more: a tick is a millisecond"),
        KN_OPTION("at", SPECIAL, AT(at_s), .take = kn_moment_take),
        KN_OPTION("color", CHOICE, AT(measure), .unit = KN_MEASURE_WORDS),
        KN_OPTION("top", TEXT, AT(top)),
        KN_OPTION("snapshot", TEXT, AT(snapshot)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) o->log = argv[optind++];
    if (optind < argc) REFUSE("%s: expected one log", argv[optind]);
    return check(o);
}

// ---- outputs

// Create an output folder that appears only when it is complete. Do nothing if `path` is NULL.
static int open_folder(kn_output_folder *batch, const char *path)
{
    char error[PATH_MAX];
    bool taken;
    if (!path || kn_output_folder_open(batch, path, &taken, error, sizeof error)) return KN_EXIT_OK;
    return kn_complain("export", taken ? KN_EXIT_USAGE : KN_EXIT_DEVICE, "%s", error);
}

// Open all outputs under temporary names.
static int open_outputs(run *r)
{
    const options *o = r->o;
    const bool one = !isnan(o->at_s) || o->scene;
    char error[PATH_MAX];
    int code = open_folder(&r->vtk, o->vtk);
    if (code == KN_EXIT_OK) code = open_folder(&r->plys, one ? NULL : o->ply);
    if (code != KN_EXIT_OK) return code;
    if (o->ply && one && !kn_beside_open(&r->ply, o->ply, error, sizeof error)) FAIL("%s", error);
    if (o->csv && !kn_beside_open(&r->csv, o->csv, error, sizeof error)) FAIL("%s", error);
    if (o->mcap && !kn_beside_open(&r->mcap, o->mcap, error, sizeof error)) FAIL("%s", error);
    if (o->vtk && !(r->paraview = kn_paraview_open(r->vtk.folder, error, sizeof error))) FAIL("%s", error);
    if (o->csv) kn_rows_head(r->csv.file);
    return KN_EXIT_OK;
}

// Give all outputs their final names.
static int keep_outputs(run *r)
{
    char error[PATH_MAX];
    kn_paraview *paraview = r->paraview;
    r->paraview = NULL;
    if (paraview && !kn_paraview_close(paraview, error, sizeof error)) FAIL("%s", error);
    kn_mcap *messages = r->messages;
    r->messages = NULL;
    if (!kn_mcap_close(messages)) FAIL("out of memory");
    // Flush the files first, so that a full disk is reported before the first output appears.
    kn_beside *files[] = {&r->csv, &r->ply, &r->mcap};
    for (int i = 0; i < 3; i++)
        if (files[i]->file && (fflush(files[i]->file) != 0 || ferror(files[i]->file)))
            FAIL("%s: %s", files[i]->path, strerror(errno));
    for (int i = 0; i < 3; i++)
        if (files[i]->file && !kn_beside_keep(files[i], error, sizeof error)) FAIL("%s", error);
    if (!kn_output_folder_keep(&r->plys, error, sizeof error)) FAIL("%s", error);
    if (!kn_output_folder_keep(&r->vtk, error, sizeof error)) FAIL("%s", error);
    return KN_EXIT_OK;
}

// Remove the outputs that were not given their final names.
static void drop_outputs(run *r)
{
    char error[1];
    if (r->paraview) kn_paraview_close(r->paraview, error, 0);
    kn_mcap_close(r->messages);
    kn_beside *files[] = {&r->csv, &r->ply, &r->mcap};
    for (int i = 0; i < 3; i++)
        if (files[i]->file) kn_beside_drop(files[i]);
    kn_output_folder_drop(&r->plys);
    kn_output_folder_drop(&r->vtk);
    kn_gauge_destroy(r->gauge);
}

// ---- moments

// Return false if the position of any node is not finite.
static bool whole(const kn_moment *m)
{
    for (int i = 0; i < m->model->node_count; i++) {
        double x[3];
        kn_state_position(m->model, m->state, i, x);
        if (!isfinite(x[0] + x[1] + x[2])) return false;
    }
    return true;
}

// Write a description of a moment for the header of a PLY file: name of the scene, and time. A scene's name may contain
// any character, but the header must contain printable characters only.
static void say_of(const char *scene, double time_s, char *about, size_t size)
{
    snprintf(about, size, "%s at %.3f s", scene, time_s);
    for (char *c = about; *c; c++)
        if (!isprint((unsigned char)*c)) *c = '_';
}

static bool write_ply(run *r, FILE *file, const kn_moment *m, const char *scene)
{
    const kn_measure what = (kn_measure)r->o->measure;
    kn_object_still still = {0};
    char about[128];
    // A gauge (which computes stresses) is valid for one model only. A `set` command in the recording may have changed
    // the model, so create a new gauge.
    if (!r->gauge || r->gauged != m->models) {
        kn_gauge_destroy(r->gauge);
        r->gauge = kn_gauge_create(m->model);
        r->gauged = m->models;
    }
    say_of(scene, m->time_s, about, sizeof about);
    bool ok =
        r->gauge && kn_object_still_state(&still, m->model, m->state) &&
        kn_object_still_measure(&still, m->model, m->state, r->gauge, what, false) &&
        write_surface(file, &still, what, kn_measure_scale(what, r->o->top_si, kn_object_still_most(&still)), about);
    kn_object_still_free(&still);
    return ok;
}

// Write the surface at one moment, into the single PLY file or as a new PLY file of the folder.
static int add_surface(run *r, const kn_moment *m, const char *scene)
{
    char path[PATH_MAX], error[PATH_MAX];
    kn_beside file;
    if (r->ply.file && !write_ply(r, r->ply.file, m, scene)) FAIL("out of memory");
    if (!r->plys.folder[0]) return KN_EXIT_OK;
    snprintf(path, sizeof path, "%s/surface_%05d.ply", r->plys.folder, r->moments);
    if (!kn_beside_open(&file, path, error, sizeof error)) FAIL("%s", error);
    if (!write_ply(r, file.file, m, scene)) {
        kn_beside_drop(&file);
        FAIL("out of memory");
    }
    if (!kn_beside_keep(&file, error, sizeof error)) FAIL("%s", error);
    return KN_EXIT_OK;
}

// Write the object at one moment to all outputs.
static int add_moment(run *r, const kn_moment *m, const char *scene)
{
    char error[PATH_MAX];
    // Refuse a diverged object, because its node positions are not finite.
    if (!whole(m))
        REFUSE("%s: the shape is not finite at %.3f s because the object diverged, expected --to before that",
               r->o->log, m->time_s);
    if (r->paraview && !kn_paraview_add(r->paraview, m, error, sizeof error)) FAIL("%s", error);
    if (r->messages) kn_mcap_moment(r->messages, m);
    if (r->moments == 0) r->first_s = m->time_s;
    r->last_s = m->time_s;
    int code = add_surface(r, m, scene);
    r->moments++;
    return code;
}

// Create a moment (kn_moment) from the present state of the replay and the forces on the tools.
static kn_moment moment_of(kn_replay *r)
{
    const kn_backend *backend = r->servo.backend;
    kn_moment m = {.model = kn_replay_model(r),
                   .models = r->changes,
                   .state = kn_replay_state(r),
                   .scratch = backend->scratch(backend->self),
                   .time_s = r->tick.time_s};
    for (int p = 0; p < r->tick.out.probes; p++)
        if (r->tick.out.force[p].live) m.tool[p] = &r->tick.out.force[p];
    return m;
}

// ---- the two sources: a recording, or a scene at rest

// Add a row for each live probe to the CSV table, and the poses and forces to the MCAP file.
static void add_rows(run *r, const kn_replay *replay)
{
    if (r->messages) kn_mcap_tick(r->messages, replay->model, &replay->tick);
    for (int p = 0; r->csv.file && p < replay->tick.out.probes; p++)
        if (replay->tick.out.force[p].live) kn_rows_tick(r->csv.file, replay, p);
}

// Handle one tick of the recording. Write table rows at every tick. Write the object if the next moment to export is
// due.
static int take_tick(run *r, kn_replay *replay, double *next_s)
{
    const options *o = r->o;
    const double t = replay->tick.time_s;
    const bool one = !isnan(o->at_s);
    // Time 0 of the recording on the wall clock. Every part of a recording gives the same value.
    if (o->mcap && !r->messages &&
        !(r->messages = kn_mcap_open(r->mcap.file, replay->model, replay->tick.utime - llround(1e6 * t))))
        FAIL("out of memory");
    // A margin of half a tick absorbs rounding errors of the times.
    if (t < (one ? o->at_s : o->from_s) - KN_REPLAY_HALF_TICK_S) return KN_EXIT_OK;
    add_rows(r, replay);
    if (t < *next_s - KN_REPLAY_HALF_TICK_S) return KN_EXIT_OK;
    // Find the time of the next moment to export. A gap in the recording may skip several such times.
    const double due_s = t + KN_REPLAY_HALF_TICK_S;
    while (!one && *next_s <= due_s) *next_s += o->every_s * fmax(1, floor((due_s - *next_s) / o->every_s));
    const kn_moment m = moment_of(replay);
    return add_moment(r, &m, replay->scene->name);
}

// Check that the number of moments is not too large, before the first moment is written.
static int check_moments(const options *o, const kn_replay *replay)
{
    const double end_s = kn_replay_end_s(replay), begin_s = end_s - 1e-3 * (double)(replay->tally.ticks_total - 1);
    const double span_s = fmin(o->to_s, end_s) - fmax(o->from_s, begin_s) + KN_REPLAY_HALF_TICK_S;
    const double moments = floor(span_s / o->every_s) + 1;
    if (!isnan(o->at_s) || !(o->vtk || o->ply) || moments <= MOMENTS_MAX) return KN_EXIT_OK;
    REFUSE("--every %g: expected at most %d moments, but %s would give %.0f", o->every_s, MOMENTS_MAX, o->log, moments);
}

// Replay the recording step by step and write the moments to export.
static int step_through(run *r, kn_replay *replay)
{
    const options *o = r->o;
    const bool one = !isnan(o->at_s);
    const double end_s = one ? o->at_s : o->to_s;
    double next_s = one ? o->at_s : o->from_s, last_s = -INFINITY;
    int code = KN_EXIT_OK;
    kn_progress bar = kn_progress_open("export", fmin((double)replay->tally.ticks_total, fmax(1, 1e3 * end_s)));
    while (code == KN_EXIT_OK && !kn_interrupted && last_s < end_s - KN_REPLAY_HALF_TICK_S && kn_replay_step(replay)) {
        last_s = replay->tick.time_s;
        // If ticks are missing in the recording, the first tick after the gap may be later than --to. Do not export
        // this tick. With --at, however, export this tick in place of the missing one.
        if (!one && last_s > end_s + KN_REPLAY_HALF_TICK_S) break;
        code = take_tick(r, replay, &next_s);
        kn_progress_step(&bar, (double)replay->tally.ticks);
    }
    kn_progress_close(&bar);
    if (code != KN_EXIT_OK) return code;
    if (kn_interrupted) FAIL("interrupted: nothing is written");
    if (isinf(last_s)) REFUSE("%s: contains no tick, expected a recorded session", o->log);
    // With --at end, export the present state: the end of the recording is known only now.
    if (one && isinf(end_s)) {
        add_rows(r, replay);
        const kn_moment m = moment_of(replay);
        return add_moment(r, &m, replay->scene->name);
    }
    if (r->moments == 0)
        REFUSE("--%s %g: %s ends at %.3f s", one ? "at" : "from", one ? o->at_s : o->from_s, o->log, last_s);
    return KN_EXIT_OK;
}

// Export the states of an object in a recording.
static int of_log(run *r)
{
    char error[512];
    const options *o = r->o;
    const kn_replay_def def = {.log_path = o->log, .snapshot_path = o->snapshot};
    kn_replay *replay = kn_replay_create(&def, error, sizeof error);
    if (!replay) REFUSE("%s", error);
    int code = check_moments(o, replay);
    if (code == KN_EXIT_OK) code = open_outputs(r);
    if (code == KN_EXIT_OK) code = step_through(r, replay);
    // A damaged log is exported up to the damage, and a message reports the damage.
    if (code == KN_EXIT_OK && replay->damage[0])
        kn_complain("export", KN_EXIT_OK, "%s: %s: only the log before this point was used", o->log, replay->damage);
    kn_replay_destroy(replay);
    return code;
}

// Export the object of a scene at rest.
static int of_scene(run *r)
{
    char error[512];
    kn_scene *scene = kn_scene_load(r->o->scene, NULL, 0, error, sizeof error);
    if (!scene) REFUSE("%s", error);
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    kn_state *state = model ? kn_state_create(model) : NULL;
    int code = state ? open_outputs(r)
                     : kn_complain("export", model ? KN_EXIT_DEVICE : KN_EXIT_USAGE, "%s: %s", r->o->scene,
                                   model ? "out of memory" : error);
    if (code == KN_EXIT_OK) code = add_moment(r, &(kn_moment){.model = model, .state = state}, scene->name);
    kn_state_destroy(state);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return code;
}

static void tell(const run *r)
{
    const options *o = r->o;
    const char *moments = r->moments == 1 ? "moment" : "moments";
    if (o->vtk) printf("%s/object.pvd: %d %s, %.3f .. %.3f s\n", o->vtk, r->moments, moments, r->first_s, r->last_s);
    if (o->ply) printf("%s: %d %s\n", o->ply, r->moments, moments);
    if (o->csv) printf("%s\n", o->csv);
    if (o->mcap) printf("%s: %d %s\n", o->mcap, r->moments, moments);
}

int kn_export_main(int argc, char **argv)
{
    options o = {.to_s = INFINITY, .every_s = 0.1, .at_s = NAN, .measure = KN_MEASURE_DISPLACEMENT};
    int code = parse(argc, argv, &o);
    if (code != KN_OPTIONS_READ) return code;
    kn_interrupt_watch();
    run r = {.o = &o};
    code = o.scene ? of_scene(&r) : of_log(&r);
    if (code == KN_EXIT_OK) code = keep_outputs(&r);
    if (code == KN_EXIT_OK) tell(&r);
    drop_outputs(&r);
    // End this process by a received signal only if the export failed. If the outputs were complete before the signal,
    // they are kept and the signal is ignored.
    if (code != KN_EXIT_OK) kn_interrupt_die();
    return code;
}
