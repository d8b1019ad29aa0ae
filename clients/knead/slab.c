#include "clients/knead/slab.h"
#include <stdio.h>
#include <string.h>

// Find the first tool of the scene that can be coupled to a device. A plate cannot be coupled. Return NULL if the scene
// has no such tool.
static const kn_probe_def *find(const kn_model_def *def, const char *name)
{
    for (int i = 0; i < def->probe_count; i++) {
        bool coupled = def->probe[i].shape != KN_PROBE_PLATE;
        if (coupled && (!name || !strcmp(name, def->probe[i].name))) return &def->probe[i];
    }
    return NULL;
}

// Find the height at which the tool first touches the object, by bisection between a point far above the object and the
// object's middle.
static double touch_height(const kn_slab *slab, const kn_model_def *def)
{
    double extent_m[3], at_m[3] = {0.0};
    const double level[4] = {1.0, 0.0, 0.0, 0.0};
    kn_model_def_extent(def, extent_m);
    double inside_m = 0.5 * extent_m[2], clear_m = extent_m[2] + 1.0;
    for (int i = 0; i < 40; i++) {
        at_m[2] = 0.5 * (inside_m + clear_m);
        if (kn_clearance(slab->model, slab->state, 0, at_m, level) > 0.0) clear_m = at_m[2];
        else inside_m = at_m[2];
    }
    return clear_m;
}

bool kn_slab_open(kn_slab *slab, const kn_scene *scene, const char *tool, const kn_coupling *coupling, char *error,
                  size_t error_size)
{
    kn_model_def def = scene->model;
    const kn_probe_def *probe = find(&scene->model, tool);
    memset(slab, 0, sizeof *slab);
    if (!probe) {
        snprintf(error, error_size, "%s has no tool%s%s that can be coupled to a device", scene->name, tool ? " " : "",
                 tool ? tool : "");
        return false;
    }
    // The model gets this tool alone, with the coupling under test.
    def.probe[0] = *probe;
    def.probe[0].coupling_n_m = coupling->stiffness_n_m;
    def.probe[0].coupling_n_s_m = coupling->damping_n_s_m;
    def.probe_count = 1;
    slab->model = kn_model_build(&def, error, error_size);
    slab->state = slab->model ? kn_state_create(slab->model) : NULL;
    if (!slab->state) {
        if (slab->model) snprintf(error, error_size, "out of memory");
        kn_slab_close(slab);
        return false;
    }
    slab->touch_m = touch_height(slab, &def);
    slab->input.probe[0].attached = true;
    slab->input.probe[0].orientation_wxyz[0] = 1.0;
    return true;
}

void kn_slab_close(kn_slab *slab)
{
    kn_state_destroy(slab->state);
    kn_model_destroy(slab->model);
    slab->state = NULL;
    slab->model = NULL;
}

double kn_slab_touch(void *self, const double position_m[3], const double velocity_m_s[3], double force_n[3])
{
    kn_slab *slab = self;
    kn_probe_input *in = &slab->input.probe[0];
    memcpy(in->position_m, position_m, sizeof in->position_m);
    memcpy(in->velocity_m_s, velocity_m_s, sizeof in->velocity_m_s);
    // z = 0 of the rig is the height of first contact.
    in->position_m[2] += slab->touch_m;
    slab->diverged |= kn_step(slab->model, slab->state, &slab->input, &slab->output) != KN_OK;
    memcpy(force_n, slab->output.probe[0].force_n, sizeof slab->output.probe[0].force_n);
    return -1.0;
}
