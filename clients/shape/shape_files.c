#include "clients/shape/shape_files.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/output.h"
#include "clients/knead/plot.h"
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <yaml.h>

static const char me[] = "identify shape";

enum { INPUTS = KN_PRESS_MOMENTS + 5, OUTPUTS = 3 };

typedef struct named {
    const char *option, *path; // path NULL: not requested
} named;

// Return whether a word of a scene is a file and is this output: a material, a device, a mesh. A word without a dot or
// a folder is a built-in name.
static bool is_output(const char *folder, int folder_length, const char *word, const char *output)
{
    char path[2 * PATH_MAX];
    struct stat there;
    if (!strpbrk(word, "./")) return false;
    snprintf(path, sizeof path, "%.*s%s", *word == '/' ? 0 : folder_length, folder, word);
    return stat(path, &there) == 0 && S_ISREG(there.st_mode) && kn_output_same(path, output);
}

// Return whether the YAML text names this output, as far as it can be parsed.
static bool parser_names(yaml_parser_t *parser, const char *folder, int folder_length, const char *output)
{
    yaml_event_t e;
    bool found = false;
    for (bool done = false; !done && yaml_parser_parse(parser, &e); yaml_event_delete(&e)) {
        done = e.type == YAML_STREAM_END_EVENT;
        if (e.type == YAML_SCALAR_EVENT)
            found |= is_output(folder, folder_length, (const char *)e.data.scalar.value, output);
    }
    return found;
}

// Return whether the scene file names this output.
static bool scene_names(const char *scene, const char *output)
{
    yaml_parser_t parser;
    const char *slash = strrchr(scene, '/');
    FILE *f = fopen(scene, "rb");
    if (!f) return false; // kn_scene_load complains about the file later
    bool found = false;
    if (yaml_parser_initialize(&parser)) {
        yaml_parser_set_input_file(&parser, f);
        found = parser_names(&parser, scene, slash ? (int)(slash - scene) + 1 : 0, output);
        yaml_parser_delete(&parser);
    }
    fclose(f);
    return found;
}

// Return whether the value of a --set names this output.
static bool set_names(const char *set, const char *output)
{
    yaml_parser_t parser;
    const char *value = strchr(set, '=');
    if (!value || !yaml_parser_initialize(&parser)) return false;
    yaml_parser_set_input_string(&parser, (const unsigned char *)value + 1, strlen(value + 1));
    const bool found = parser_names(&parser, "", 0, output);
    yaml_parser_delete(&parser);
    return found;
}

// Refuse an output that is an input or that the scene or a --set names.
static int try_output(const kn_shape_options *o, const named *out)
{
    const named in[INPUTS] = {{"the scene", o->scene.scene_path},
                              {"--mesh", o->scene.mesh},
                              {"--points", o->points},
                              {"--force", o->force},
                              {"--log", o->log},
                              {"--depth", o->depth[0]},
                              {"--depth", o->depth[1]},
                              {"--depth", o->depth[2]},
                              {"--depth", o->depth[3]}};
    for (int i = 0; i < INPUTS; i++)
        if (kn_output_same(in[i].path, out->path))
            return kn_complain(me, KN_EXIT_USAGE, "%s %s: is being read, as %s %s, expected another file to write",
                               out->option, out->path, in[i].option, in[i].path);
    if (scene_names(o->scene.scene_path, out->path))
        return kn_complain(me, KN_EXIT_USAGE, "%s %s: is being read, %s names it, expected another file to write",
                           out->option, out->path, o->scene.scene_path);
    for (int i = 0; i < o->scene.set_count; i++)
        if (set_names(o->scene.sets[i], out->path))
            return kn_complain(me, KN_EXIT_USAGE,
                               "%s %s: is being read, --set %s names it, expected another file to write", out->option,
                               out->path, o->scene.sets[i]);
    return KN_EXIT_OK;
}

int kn_shape_files_try(const kn_shape_options *o)
{
    const named out[OUTPUTS] = {{"--out", o->out}, {"--out-depth", o->out_depth}, {"--png", o->png}};
    int code = KN_EXIT_OK;
    for (int i = 0; i < OUTPUTS && code == KN_EXIT_OK; i++) code = out[i].path ? try_output(o, &out[i]) : code;
    for (int i = 0; i < OUTPUTS && code == KN_EXIT_OK; i++)
        for (int k = 0; k < i; k++)
            if (kn_output_same(out[i].path, out[k].path))
                return kn_complain(me, KN_EXIT_USAGE, "%s %s, %s %s: are one file, expected a file for each",
                                   out[k].option, out[k].path, out[i].option, out[i].path);
    if (code == KN_EXIT_OK && o->out) code = kn_output_try(me, o->out);
    if (code == KN_EXIT_OK && o->out_depth) code = kn_output_try(me, o->out_depth);
    return code == KN_EXIT_OK && o->png ? kn_plot_try(me, o->png) : code;
}
