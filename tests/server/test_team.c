#include "core/scene/scene.h"
#include "server/team.h"
#include "tests/check.h"
#include "tests/lattice.h"
#include <glob.h>
#include <unistd.h>

OWNS(kn_helper, kn_helper_destroy)

// Press all tools into the object at 5 cm/s, as kneadd does at its start.
static void strike(const kn_model *m, int tick, kn_input *in)
{
    double extent[3];
    kn_model_def_extent(&m->def, extent);
    for (int p = 0; p < m->def.probe_count; p++) {
        in->probe[p] = (kn_probe_input){.attached = true, .velocity_m_s = {0, 0, -0.05}, .orientation_wxyz = {1}};
        in->probe[p].position_m[2] = extent[2] + m->def.probe[p].radius_m - 1e-3 - 5e-5 * tick;
    }
}

// Compare `ticks` steps of one thread with those of two. In every third tick the helper sleeps.
static void compare(const char *name, const kn_model *m, kn_helper *helper, int ticks)
{
    OWN(kn_state) *one = kn_state_create(m), *two = kn_state_create(m);
    OWN(kn_scratch) *scratch = kn_scratch_create(m), *beside = kn_scratch_create(m);
    for (int i = 0; i < ticks; i++) {
        kn_input in = {0};
        kn_output out, other;
        strike(m, i, &in);
        CHECK(kn_step(m, one, scratch, &in, &out) == KN_OK);
        kn_scratch_team(m, beside, kn_helper_wake(helper));
        if (i % 3 == 0) kn_helper_rest(helper);
        CHECK(kn_step(m, two, beside, &in, &other) == KN_OK);
        kn_helper_rest(helper);
        CHECK(memcmp(&out, &other, sizeof out) == 0);
    }
    if (kn_state_hash(m, one) != kn_state_hash(m, two)) KN_TEST_FAIL("%s: other bits with two threads", name);
}

// Return a helper on another processor than this thread, or end the program with 77 on a machine that has only one.
static kn_helper *helper_of(void)
{
    char why[64];
    kn_helper *helper = kn_helper_create(why, sizeof why);
    if (helper) return kn_rt_move(KN_RT_CPU_SERVO), helper;
    printf("skipped: no second thread: %s\n", why);
    exit(77);
}

TEST("every shipped scene has the same bits with one thread and with two, of which the second is now and then absent")
{
    OWN(kn_helper) *helper = helper_of();
    glob_t scenes;
    char error[400];
    CHECK(glob(KN_SOURCE_DIR "/core/scenes/*.yaml", 0, NULL, &scenes) == 0 && scenes.gl_pathc > 5);
    for (size_t i = 0; i < scenes.gl_pathc; i++) {
        OWN(kn_scene) *scene = kn_scene_load(scenes.gl_pathv[i], NULL, 0, error, sizeof error);
        OWN(kn_model) *model = scene ? kn_model_build(&scene->model, error, sizeof error) : NULL;
        if (!model) KN_TEST_FAIL("%s", error);
        else compare(scenes.gl_pathv[i], model, helper, KN_LENGTH(6, 24, 150));
    }
    globfree(&scenes);
    CHECK(kn_helper_share(helper) > 0);
    kn_rt_move(KN_RT_CPU_ANY);
}

TEST(
    "a block of 2 560 nodes with gas has the same bits with one thread and with two; a helper that sleeps does nothing")
{
    OWN(kn_helper) *helper = helper_of();
    kn_model_def def = kn_model_def_default();
    def.nodes[0] = def.nodes[1] = 16, def.nodes[2] = 10;
    def.spacing_m = 0.05 / 15;
    def.pressure = KN_PRESSURE_CELLS;
    def.inside_pressure_pa = 101325;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_scratch) *scratch = kn_scratch_create(model);
    kn_output out;
    CHECK(kn_scratch_team(model, scratch, kn_helper_wake(helper)));
    kn_helper_rest(helper);
    usleep(20000); // by now it sleeps
    CHECK(kn_step(model, state, scratch, &(kn_input){0}, &out) == KN_OK && kn_helper_share(helper) == 0);
    compare("gas", model, helper, KN_LENGTH(12, 60, 300));
    kn_helper_wake(helper); // it is destroyed awake
    kn_rt_move(KN_RT_CPU_ANY);
}
