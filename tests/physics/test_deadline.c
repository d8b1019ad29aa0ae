// Steps that end by their deadline: their cost, and the effect on the force.
#include "core/solve/step_effort.h"
#include "tests/lattice.h"

enum { TICKS = 160, TURN = 40 };

typedef struct stroke { // a tool at 10 cm/s, 4 mm in and out
    double force_n[TICKS][3];
    int64_t units, over; // largest cost of a step; number of steps over their limit
    int capped;
    bool cap[TICKS];
    uint64_t hash;
} stroke;

static stroke struck(kn_model_def def, int64_t deadline)
{
    LATTICE l = lattice_of(def);
    OWN(kn_state) *beside = kn_state_create(l.model);
    stroke s = {0};
    put(&l, 0, 0, 0, l.model->rest_m[l.model->top[0]][2] + def.probe[0].radius_m);
    for (int i = 0; i < TICKS; i++) {
        double speed_m_s = i < TURN ? -0.1 : i < 2 * TURN ? 0.1 : 0;
        kn_input least = l.in;
        kn_output shortest = {0};
        least.deadline = 1, l.in.deadline = deadline;
        least.probe[0].velocity_m_s[2] = speed_m_s;
        if (deadline > 0)
            kn_state_copy(l.model, beside, l.state), kn_step(l.model, beside, l.scratch, &least, &shortest);
        move(&l, 0, 0, 0, speed_m_s, 1);
        s.over += deadline > 0 && l.out.units > (deadline > shortest.units ? deadline : shortest.units);
        if (l.out.units > s.units) s.units = l.out.units;
        s.capped += s.cap[i] = l.out.capped;
        memcpy(s.force_n[i], l.out.probe[0].force_n, sizeof s.force_n[i]);
    }
    s.hash = hash_of(&l);
    return s;
}

static double size(const double a[3], const double b[3]) { return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]); }

TEST("no step exceeds its deadline in units of work, unless the shortest step already does")
{
    const kn_model_def def[2] = {press_def(1), ball_def(1)};
    for (int d = 0; d < 2; d++) {
        int64_t whole = struck(def[d], 0).units;
        for (int share = 1; share <= 8; share++) {
            stroke s = struck(def[d], share * whole / 8);
            CHECK(s.over == 0);
            CHECK(share > 1 || s.capped > 0);
        }
    }
}

enum {
    REST = 38000,
    GUESS = 42000
}; // costs for the plate: one linearisation and five iterations; a guess before them and one more linearisation

TEST("a generous deadline changes no bit, and a tight one gives the same bits on every instruction set")
{
    kn_model_def defs[2] = {press_def(1), ball_def(1)};
    for (int d = 0; d < 2; d++) {
        kn_model_def def = defs[d];
        stroke free = struck(def, 0), wide = struck(def, 1000000000);
        CHECK(wide.hash == free.hash && memcmp(wide.force_n, free.force_n, sizeof wide.force_n) == 0);
        def.solver.isa = KN_ISA_BASE;
        const int64_t deadline = d == 0 ? GUESS : free.units / 3;
        stroke base = struck(def, deadline);
        CHECK(base.capped > 10 && base.hash != free.hash);
        for (int isa = KN_ISA_AVX2; isa <= KN_ISA_AVX512; isa++) {
            def.solver.isa = (kn_isa)isa;
            if (!kn_isa_supported(def.solver.isa)) continue;
            stroke s = struck(def, deadline);
            CHECK(s.hash == base.hash && s.units == base.units && s.capped == base.capped);
        }
    }
}

TEST("a ball with a third of the full time per step is felt within 3 % of the converged force, without an extra jump")
{
    kn_model_def def = ball_def(1), best = converged(def);
    best.solver.passes = 20;
    stroke s = struck(def, struck(def, 0).units / 3), x = struck(best, 0);
    double peak_n = 0, off_n = 0, jump_n = 0;
    static const double none[3] = {0};
    for (int i = 0; i < TICKS; i++) peak_n = fmax(peak_n, size(x.force_n[i], none));
    for (int i = 2; i < TICKS; i++) {
        double step_n = fmax(size(x.force_n[i], x.force_n[i - 1]), size(x.force_n[i - 1], x.force_n[i - 2]));
        if (s.cap[i]) off_n = fmax(off_n, size(s.force_n[i], x.force_n[i]));
        jump_n = fmax(jump_n, size(s.force_n[i], s.force_n[i - 1]) - step_n);
    }
    printf("     %d ticks capped; %.2f %% of %.1f N, %.3f N\n", s.capped, 100 * off_n / peak_n, peak_n, jump_n);
    CHECK(s.capped > 20 && peak_n > 5 && off_n < 0.03 * peak_n && jump_n < 0.3);
}

TEST("one linearisation from rest doubles a plate's impact force; from a guess the force is within 10 %, and later "
     "within 3 %")
{
    kn_model_def def = press_def(1), best = converged(def);
    best.solver.passes = 20;
    stroke rest = struck(def, REST), s = struck(def, GUESS), x = struck(best, 0);
    printf("     %.1f N from rest, %.1f N from a guess, %.1f N converged\n", rest.force_n[0][2], s.force_n[0][2],
           x.force_n[0][2]);
    CHECK(rest.force_n[0][2] > 2 * x.force_n[0][2]);
    CHECK(s.capped > 20);
    CHECK(size(s.force_n[0], x.force_n[0]) < 0.1 * x.force_n[0][2]);
    CHECK_NEAR(s.force_n[TURN - 1][2] / x.force_n[TURN - 1][2], 1, 0.03);
}
