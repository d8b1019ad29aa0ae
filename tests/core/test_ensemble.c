#include "core/ensemble.h"
#include "tests/lattice.h"

OWNS(kn_ensemble, kn_ensemble_destroy)

enum { STATES = 7, ROUNDS = 9, STEPS = 20 };

// Hand i comes down at its own place and speed, and hand 3 never touches the object.
static void hands(kn_input in[STATES], int round)
{
    for (int i = 0; i < STATES; i++) {
        kn_probe_input *p = &in[i].probe[0];
        p->attached = i != 3;
        if (round == 0) memcpy(p->position_m, (double[]){2e-3 * i, -1e-3 * i, 0.045}, sizeof p->position_m);
        else
            for (int k = 0; k < 3; k++) p->position_m[k] += STEPS * 1e-3 * p->velocity_m_s[k];
        memcpy(p->velocity_m_s, (double[]){1e-3 * i, 0, -0.02 - 2e-3 * i}, sizeof p->velocity_m_s);
    }
}

TEST("the states of an ensemble have the bits of states that are stepped alone, for any number of threads")
{
    LATTICE l = lattice_of(kn_model_def_default());
    kn_output alone[STATES], out[STATES];
    kn_touch felt[STATES], touch[STATES][KN_PROBES_MAX];
    uint64_t hash[STATES];
    for (int threads = 0; threads <= 3; threads++) { // 0: with kn_step
        kn_input in[STATES] = {0};
        OWN(kn_ensemble) *e = kn_ensemble_create(l.model, STATES, threads ? threads : 1);
        if (!e) abort();
        for (int r = 0; r < ROUNDS; r++) {
            hands(in, r);
            if (threads) CHECK(kn_ensemble_step(e, STEPS, in, out, touch) == KN_OK);
            for (int i = 0; i < STATES && !threads; i++) {
                kn_input now = in[i];
                for (int s = 0; s < STEPS; s++) {
                    CHECK(kn_step(l.model, kn_ensemble_state(e, i), l.scratch, &now, &alone[i]) == KN_OK);
                    for (int k = 0; k < 3; k++) now.probe[0].position_m[k] += 1e-3 * now.probe[0].velocity_m_s[k];
                }
                CHECK(kn_touch_read(l.model, kn_ensemble_state(e, i), l.scratch, 0, &felt[i]));
            }
            if (r + 1 < ROUNDS) continue; // judge the last round, in contact
            for (int i = 0; i < STATES; i++) {
                const uint64_t now = kn_state_hash(l.model, kn_ensemble_state(e, i));
                if (!threads) hash[i] = now;
                CHECK(now == hash[i]);
                CHECK(!threads || memcmp(&out[i], &alone[i], sizeof out[i]) == 0);
                CHECK(!threads || memcmp(&touch[i][0], &felt[i], sizeof felt[i]) == 0);
                CHECK((alone[i].probe[0].force_n[2] > 1) == (i != 3));
            }
        }
    }
}

TEST("an ensemble refuses an unknown probe without a step, and one state that diverges leaves the others alone")
{
    LATTICE l = lattice_of(kn_model_def_default());
    OWN(kn_ensemble) *e = kn_ensemble_create(l.model, STATES, 2);
    kn_input in[STATES] = {0};
    kn_output out[STATES];
    in[2].probe[1].attached = true;
    CHECK(kn_ensemble_step(e, 1, in, out, NULL) == KN_BAD_INPUT && kn_ensemble_state(e, 0)->tick == 0);
    in[2].probe[1].attached = false;
    kn_real_set(l.model, kn_ensemble_state(e, 4)->velocity, l.model->offset[l.model->node_count - 1], NAN);
    CHECK(kn_ensemble_step(e, 50, in, out, NULL) == KN_DIVERGED);
    for (int i = 0; i < STATES; i++) {
        CHECK(kn_ensemble_state(e, i)->bad == (i == 4));
        CHECK(i == 4 ||
              kn_state_hash(l.model, kn_ensemble_state(e, i)) == kn_state_hash(l.model, kn_ensemble_state(e, 0)));
    }
    kn_state_reset(l.model, kn_ensemble_state(e, 4));
    CHECK(kn_ensemble_step(e, 1, in, out, NULL) == KN_OK);
    CHECK(!kn_ensemble_create(l.model, 0, 1) && !kn_ensemble_create(l.model, 1, 0));
}
