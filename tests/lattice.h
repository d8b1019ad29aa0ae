#ifndef KN_TESTS_LATTICE_H
#define KN_TESTS_LATTICE_H
// An object with its state, and with the input and the output of its last step:
//
//     LATTICE l = lattice_of(press_def(1));              destroyed at the end of the block
//     press_until(&l, &(press){.depth_m = 0.004}, 200);  the first 200 steps of a press
//     double f = l.out.probe[0].force_n[2];
#include "tests/check.h"
#include "tests/physics/press.h"

typedef struct lattice {
    kn_scene *scene; // NULL if the object comes from no scene
    kn_model *model;
    kn_state *state;
    kn_scratch *scratch;
    kn_input in;
    kn_output out;
} lattice;

static inline lattice lattice_of(kn_model_def def)
{
    lattice l = {.model = build(&def)};
    l.state = kn_state_create(l.model);
    l.scratch = kn_scratch_create(l.model);
    if (!l.state || !l.scratch) abort();
    return l;
}

static inline lattice lattice_of_scene(kn_scene *scene) // takes ownership of the scene
{
    lattice l = lattice_of(scene->model);
    l.scene = scene;
    return l;
}

// Return the object of a scene in core/scenes, with one --set or none.
static inline lattice object_of(const char *scene, const char *set)
{
    return lattice_of_scene(load_scene(scene, &set, set ? 1 : 0));
}

static inline void lattice_end(lattice *l)
{
    kn_state_destroy(l->state);
    kn_scratch_destroy(l->scratch);
    kn_model_destroy(l->model);
    kn_scene_destroy(l->scene);
}
#define LATTICE AT_END(lattice_end) lattice

static inline void step(lattice *l) { CHECK(kn_step(l->model, l->state, l->scratch, &l->in, &l->out) == KN_OK); }

static inline void steps(lattice *l, int count)
{
    for (int i = 0; i < count; i++) step(l);
}

// Attach tool p at a place, at rest.
static inline void put(lattice *l, int p, double x, double y, double z)
{
    l->in.probe[p] = (kn_probe_input){.attached = true, .position_m = {x, y, z}};
}

// Move tool p with a velocity for a number of steps. After them the hand rests.
static inline void move(lattice *l, int p, double vx, double vy, double vz, int count)
{
    kn_probe_input *in = &l->in.probe[p];
    for (int i = 0; i < count; i++) {
        memcpy(in->velocity_m_s, (double[]){vx, vy, vz}, sizeof in->velocity_m_s);
        step(l);
        for (int k = 0; k < 3; k++) in->position_m[k] += l->model->def.solver.dt_s * in->velocity_m_s[k];
    }
    memset(in->velocity_m_s, 0, sizeof in->velocity_m_s);
}

static inline void press_step(lattice *l, const press *p) // the next step of a press
{
    l->in = press_input(l->model, p, (double)(l->state->tick + 1) * l->model->def.solver.dt_s);
    step(l);
}

static inline void press_until(lattice *l, const press *p, int64_t tick)
{
    while (l->state->tick < tick) press_step(l, p);
}

static inline uint64_t hash_of(const lattice *l) { return kn_state_hash(l->model, l->state); }

// Check that the model cannot be built, for this reason.
static inline void refused(kn_model_def def, const char *why)
{
    char error[256] = "";
    OWN(kn_model) *model = kn_model_build(&def, error, sizeof error);
    if (model || !strstr(error, why)) KN_TEST_FAIL("%s, expected: %s", model ? "built" : error, why);
}

// Return the f64 settings in which the solver stops at a tolerance.
static inline kn_model_def tight(kn_model_def def, double tolerance)
{
    def.solver.precision = KN_PRECISION_F64;
    def.solver.tolerance = tolerance;
    def.solver.iterations_max = 500;
    return def;
}

#endif
