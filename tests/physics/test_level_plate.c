// A weight on a level plate, and the ways in which a plate holds the top: sticking, sliding, with adhesion.
#include "core/level_plate.h"
#include "core/network.h"
#include "tests/lattice.h"

// A cube of 1 cm with n cells along each side, under a plate that is wider than it, on a table without friction.
static kn_model_def cube_def(int n, kn_plate_surface surface)
{
    kn_model_def def = kn_model_def_default();
    def.material = dough;
    def.spacing_m = 0.01 / n;
    for (int k = 0; k < 3; k++) def.nodes[k] = n + 1;
    def.support = surface == KN_PLATE_SLIDES ? KN_SUPPORT_FRICTIONLESS : KN_SUPPORT_BONDED;
    def.probe_count = 1;
    def.probe[0] = (kn_probe_def){.name = "plate", .shape = KN_PROBE_PLATE, .size_m = {0.1, 0.1}, .surface = surface};
    def.solver = (kn_solver_def){.precision = KN_PRECISION_F64,
                                 .dt_s = 1e-2,
                                 .iterations = 4,
                                 .iterations_max = 1000,
                                 .tolerance = 1e-7,
                                 .passes = 12,
                                 .mass_scale = 1};
    return def;
}

// Put a weight on the cube for a time. Return the height of the plate.
static double carry(lattice *l, kn_level_plate *plate, double load_n, double seconds)
{
    kn_state *trial = kn_state_create(l->model);
    kn_level_plate_lower(plate, l->model, l->state);
    for (int i = 0; i < (int)lround(seconds / l->model->def.solver.dt_s); i++) {
        CHECK(kn_level_plate_step(plate, l->model, l->state, trial, l->scratch, load_n, &l->in, &l->out) ==
              KN_PLATE_CARRIED);
        CHECK_NEAR(l->out.probe[0].force_n[2], load_n, KN_LEVEL_PLATE_TOLERANCE * load_n);
    }
    kn_state_destroy(trial);
    return plate->height_m;
}

TEST("a plate carries a weight in every step, and the top is where the plate is")
{
    for (int surface = KN_PLATE_STICKS; surface <= KN_PLATE_SLIDES; surface++) {
        LATTICE l = lattice_of(cube_def(2, (kn_plate_surface)surface));
        kn_level_plate plate = {0};
        carry(&l, &plate, 20 * GF_N, 2);
        const double lighter = carry(&l, &plate, 5 * GF_N, 1), heavier = carry(&l, &plate, 25 * GF_N, 1);
        CHECK(heavier < lighter);
        for (int t = 0; t < l.model->top_count; t++) {
            double x[3];
            kn_state_position(l.model, l.state, l.model->top[t], x);
            CHECK_NEAR(x[2], plate.height_m, 1e-9);
        }
        double lower = heavier;
        kn_level_plate_lower(&plate, l.model, l.state);
        CHECK_NEAR(plate.height_m, lower, 1e-9);
    }
}

TEST("one edge under a weight on a plate creeps like the element under a constant stress")
{
    kn_model_def def = cube_def(1, KN_PLATE_SLIDES);
    def.nodes[0] = def.nodes[1] = 1;
    def.structure = KN_STRUCTURE_AXIS;
    def.support = KN_SUPPORT_BONDED;
    LATTICE l = lattice_of(def);
    kn_level_plate plate = {0};
    kn_network net = kn_network_of(&dough);
    kn_network_state state = {0};
    const kn_drive drive = {.kind = KN_DRIVE_STRESS, .value = 20 * GF_CM2};
    const double height = carry(&l, &plate, 20 * GF_N, 20);
    CHECK(kn_network_jump(&net, &state, &drive));
    CHECK(kn_network_advance(&net, &state, &drive, 20, 1e-9));
    CHECK_NEAR(height, 0.01 * (1 - state.strain), 1e-3 * height);
}

TEST("between plates without friction a block deforms affinely: the number of its cells does not matter")
{
    for (int gas = 0; gas <= 1; gas++) {
        double height[3], width[3];
        for (int i = 0; i < 3; i++) {
            kn_model_def def = cube_def(1 << i, KN_PLATE_SLIDES);
            if (gas) def.pressure = KN_PRESSURE_CELLS;
            def.density_kg_m3 = 1; // the lumped mass is the only thing that depends on the cells
            LATTICE l = lattice_of(def);
            kn_level_plate plate = {0};
            double first[3], last[3];
            height[i] = carry(&l, &plate, 20 * GF_N, 10);
            kn_state_position(l.model, l.state, 0, first);
            kn_state_position(l.model, l.state, l.model->node_count - 1, last);
            width[i] = last[0] - first[0];
            CHECK(width[i] > 0.0101);
            CHECK_NEAR(height[i], height[0], 1e-5 * height[0]);
            CHECK_NEAR(width[i], width[0], 1e-5 * width[0]);
        }
    }
}

// Press the cube to 8 mm, then raise the plate slowly. Return the largest force with which the plate pulls.
static double pull(kn_model_def def)
{
    LATTICE l = lattice_of(def);
    double most = 0;
    put(&l, 0, 0, 0, 0.01);
    move(&l, 0, 0, 0, -1e-3, 200);
    for (int i = 0; i < 400; i++) {
        move(&l, 0, 0, 0, 1e-3, 1);
        most = fmax(most, -l.out.probe[0].force_n[2]);
    }
    CHECK(l.out.probe[0].contacts == 0);
    return most;
}

TEST("a plate pulls up to its adhesion times the area of the top, and without adhesion it does not pull")
{
    kn_model_def def = cube_def(3, KN_PLATE_SLIDES);
    def.material = jelly();
    CHECK(pull(def) == 0);
    def.probe[0].adhesion_pa = 100;
    const double some = pull(def);
    def.probe[0].adhesion_pa = 200;
    const double more = pull(def);
    CHECK(some <= 100 * 1e-4 * (1 + 1e-9));
    CHECK(more <= 200 * 1e-4 * (1 + 1e-9));
    CHECK_NEAR(some, 100 * 1e-4, 0.1 * 100 * 1e-4); // reached within one step of the rising pull
    CHECK_NEAR(more, 200 * 1e-4, 0.1 * 200 * 1e-4);
}

TEST("a weight that squeezes the block flat is reported, and the state stays that of the last step")
{
    LATTICE l = lattice_of(cube_def(2, KN_PLATE_SLIDES));
    kn_state *trial = kn_state_create(l.model);
    kn_level_plate plate = {0};
    kn_plate_status status = KN_PLATE_CARRIED;
    kn_level_plate_lower(&plate, l.model, l.state);
    int steps = 0;
    uint64_t before = 0;
    for (; steps < 1000 && status == KN_PLATE_CARRIED; steps++) {
        before = kn_state_hash(l.model, l.state);
        status = kn_level_plate_step(&plate, l.model, l.state, trial, l.scratch, 90 * GF_N, &l.in, &l.out);
    }
    printf("     %d steps, %.3g mm\n", steps, 1e3 * plate.height_m);
    CHECK(status == KN_PLATE_FLAT && plate.height_m > 0 && plate.height_m < 2e-3);
    CHECK(kn_state_hash(l.model, l.state) == before);
    kn_state_destroy(trial);
}

TEST("a plate that slides is refused by the solver of the circuit, and another shape cannot slide")
{
    char error[256];
    kn_model_def def = cube_def(2, KN_PLATE_SLIDES);
    def.solver.kind = KN_SOLVER_FIXED;
    CHECK(!kn_model_build(&def, error, sizeof error) && strstr(error, "slides"));
    def = cube_def(2, KN_PLATE_STICKS);
    def.probe[0] = (kn_probe_def){.shape = KN_PROBE_SPHERE, .radius_m = 0.01, .surface = KN_PLATE_SLIDES};
    CHECK(!kn_model_build(&def, error, sizeof error) && strstr(error, "slides"));
}

TEST("a sliding plate that moves off the block leaves it, as a sticking one does")
{
    kn_model_def def = cube_def(2, KN_PLATE_SLIDES);
    def.probe[0].size_m[0] = def.probe[0].size_m[1] = 0.012;
    def.support = KN_SUPPORT_BONDED;
    LATTICE l = lattice_of(def);
    put(&l, 0, 0, 0, 0.01);
    move(&l, 0, 0, 0, -1e-3, 100);
    CHECK(l.out.probe[0].contacts == 9);
    move(&l, 0, 0.01, 0, 0, 300);
    CHECK(l.out.probe[0].contacts == 0 && l.out.probe[0].force_n[2] == 0);
}

TEST("a plate follows a weight up and down, also where its nodes come off together")
{
    static const double load_n[] = {1, 3, 0.3, 3, 0.01};
    for (int single = 0; single <= 1; single++) {
        kn_model_def def = press_def(1);
        def.material = jelly();
        def.probe[0].size_m[0] = 0.06;
        def.solver.precision = single ? KN_PRECISION_F32 : KN_PRECISION_F64;
        LATTICE l = lattice_of(def);
        kn_state *trial = kn_state_create(l.model);
        kn_level_plate plate = {0};
        kn_level_plate_lower(&plate, l.model, l.state);
        for (int i = 0; i < 5; i++)
            for (int s = 0; s < 100; s++)
                CHECK(kn_level_plate_step(&plate, l.model, l.state, trial, l.scratch, load_n[i], &l.in, &l.out) ==
                      KN_PLATE_CARRIED);
        kn_state_destroy(trial);
    }
}
