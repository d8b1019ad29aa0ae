// Nothing that a program gives to libknead makes it abort, and each refusal has a sentence.
#include "core/step.h"
#include "tests/lattice.h"

TEST("a definition whose choices are none of their enums is refused in a sentence, and NULL is the default one")
{
    char error[200];
    for (int i = 0; i < 22; i++) {
        kn_model_def def = kn_model_def_default();
        int *const choice[] = {(int *)&def.solver.kind,
                               (int *)&def.solver.precision,
                               (int *)&def.solver.linearization,
                               (int *)&def.solver.isa,
                               (int *)&def.structure,
                               (int *)&def.pressure,
                               (int *)&def.support,
                               (int *)&def.skin,
                               (int *)&def.probe[0].shape,
                               (int *)&def.probe[0].surface,
                               (int *)&def.material.damper};
        *choice[i / 2] = i % 2 ? -1 : 77;
        error[0] = '\0';
        kn_model *model = kn_model_build(&def, error, sizeof error);
        CHECK(!model && strstr(error, "none of its enum"));
        kn_model_destroy(model);
    }
    OWN(kn_model) *standard = kn_model_build(NULL, error, sizeof error);
    CHECK(standard && standard->node_count == 144 && standard->def.probe_count == 1);
}

TEST("a step with an unknown probe or an effort out of range is refused, and leaves the state as it was")
{
    LATTICE l = lattice_of(kn_model_def_default());
    const uint64_t before = hash_of(&l);
    const kn_effort fair = {4, 24, 1e-3, 1, KN_LINEARIZATION_BLEND};
    for (int i = 0; i < 8; i++) {
        kn_input in = {.effort = fair};
        switch (i) {
        case 0: in.probe[1].attached = true; break;
        case 1: in.effort.iterations = -1; break;
        case 2: in.effort.iterations_max = 3; break;
        case 3: in.effort.tolerance = NAN; break;
        case 4: in.effort.passes = 0; break;
        case 5: in.effort.passes = 101; break;
        case 6: in.effort.linearization = (kn_linearization)7; break;
        default: in.effort.iterations_max = 1 << 30; break;
        }
        CHECK(kn_step(l.model, l.state, l.scratch, &in, &l.out) == KN_BAD_INPUT && l.state->tick == 0);
        CHECK(hash_of(&l) == before);
    }
    CHECK(kn_step(l.model, l.state, l.scratch, &(kn_input){.effort = fair}, &l.out) == KN_OK);
    kn_input loose = {.effort = fair};
    loose.effort.tolerance = 1; // as a quality point of a scene may have it
    CHECK(kn_step(l.model, l.state, l.scratch, &loose, &l.out) == KN_OK);
    CHECK(strstr(kn_status_text(KN_BAD_INPUT), "effort") && strstr(kn_status_text((kn_status)9), "unknown"));
    CHECK(strcmp(kn_version(), KN_VERSION) == 0);
}
