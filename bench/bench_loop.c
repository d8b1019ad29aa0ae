// Closed loops of hand, device and lattice in simulated time: every class of devices, in every grip of a hand, on every
// material. The tools are a ball, a flat box, a plate without a virtual coupling, and two balls with a device each. The
// bench answers three questions: does the loop buzz, does it give energy to the hand, and how much of the object's
// stiffness remains behind the virtual coupling.
//
//     bench_loop [--quick]     847 nodes, ten minutes; --quick: 144 nodes, five minutes
//
// The device moves along three axes. clients/hand/haptic_loop.h defines when a loop buzzes: by its force above 10 Hz,
// and in a tap by the number of reversals of its force. The motion "lean", of a device that no hand holds, is left out
// for two balls, because the second hand would move the object. The exit code is 1 if a loop with a coupled tool
// buzzes, if one stroke gives the hand more than 1 mJ, or if the rendered stiffness differs by more than 10 % from that
// of the object and the coupling in series.
#include "bench/bench.h"
#include "clients/hand/haptic_loop.h"
#include "core/scene/scene.h"
#include "core/step.h"
#include <math.h>
#include <string.h>

enum { CLASSES = 4, MATERIALS = 3, BALL = 0, BOX, PAIR, RIGID, TOOLS };
static const char *const classes[CLASSES] = {"touch", "falcon", "omega", "unknown"};
static const char *const materials[MATERIALS] = {"dough", "clay", "jelly"};
static const char *const tools[TOOLS] = {"ball", "box", "two balls", "plate, rigid"};
static const char *const motions[] = {"lean", "press", "tap", "slide"};
static const double apart_m = 0.0125; // distance of each ball from the middle of the object, m

// --- object ---------------------------------------------------------------------------------------------------------

typedef struct block { // object of a closed loop: a lattice under one tool or two, and the device of the second hand
    kn_model *model;
    kn_state *state;
    kn_scratch *scratch;
    kn_input input;
    kn_output output;
    double touch_m; // height of the first tool at which it just touches the object, m
    bool two;
    // Simulated device of the second hand. It gets the force of a tick one tick later, as a device of kneadd does.
    kn_held_device other;
    kn_turns turns;
    long tick;
    bool diverged;
} block;

static kn_probe_def tool_of(int tool, const kn_coupling *coupling)
{
    kn_probe_def def = {.name = "first",
                        .coupling_n_m = coupling->stiffness_n_m,
                        .coupling_n_s_m = coupling->damping_n_s_m,
                        .shape = KN_PROBE_SPHERE,
                        .radius_m = 0.015};
    if (tool == BOX) def.shape = KN_PROBE_BOX, def.size_m[0] = def.size_m[1] = 0.02, def.size_m[2] = 0.01;
    if (tool == BOX) def.edge_m = 0.001, def.radius_m = 0;
    if (tool == PAIR) def.radius_m = 0.012;
    if (tool == RIGID) def = (kn_probe_def){.name = "first", .shape = KN_PROBE_PLATE, .size_m = {0.02, 0.02}};
    return def;
}

static double touch_height(const block *b, double x_m)
{
    double extent_m[3], at_m[3] = {x_m, 0, 0};
    kn_model_def_extent(&b->model->def, extent_m);
    double inside_m = 0.5 * extent_m[2], clear_m = extent_m[2] + 0.1;
    for (int i = 0; i < 40; i++) {
        at_m[2] = 0.5 * (inside_m + clear_m);
        if (kn_clearance(b->model, b->state, 0, at_m, (double[]){1, 0, 0, 0}) > 0) clear_m = at_m[2];
        else inside_m = at_m[2];
    }
    return clear_m;
}

static void block_open(block *b, const char *material, bool quick, int tool, const kn_coupling *coupling)
{
    char path[300], error[300], set[64];
    snprintf(path, sizeof path, KN_SOURCE_DIR "/core/scenes/dough%s.yaml", quick ? "-small" : "");
    snprintf(set, sizeof set, "material=%s", material);
    const char *sets[] = {set};
    kn_scene *scene = kn_scene_load(path, sets, 1, error, sizeof error);
    memset(b, 0, sizeof *b);
    if (scene) {
        kn_model_def def = scene->model;
        b->two = tool == PAIR;
        def.probe_count = b->two ? 2 : 1;
        def.probe[0] = def.probe[1] = tool_of(tool, coupling);
        strcpy(def.probe[1].name, "second");
        b->model = kn_model_build(&def, error, sizeof error);
        b->state = b->model ? kn_state_create(b->model) : NULL;
        b->scratch = b->model ? kn_scratch_create(b->model) : NULL;
        kn_scene_destroy(scene);
    }
    if (!b->state || !b->scratch) fprintf(stderr, "bench_loop: %s\n", error), exit(3);
    b->touch_m = touch_height(b, b->two ? -apart_m : 0);
    for (int p = 0; p < 2; p++) {
        b->input.probe[p] = (kn_probe_input){.attached = p == 0 || b->two, .orientation_wxyz = {1}};
    }
}

static void block_close(block *b)
{
    kn_state_destroy(b->state);
    kn_scratch_destroy(b->scratch);
    kn_model_destroy(b->model);
}

static void put(kn_probe_input *in, const double position_m[3], const double velocity_m_s[3], double x_m, double up_m)
{
    memcpy(in->position_m, position_m, sizeof in->position_m);
    memcpy(in->velocity_m_s, velocity_m_s, sizeof in->velocity_m_s);
    in->position_m[0] += x_m;
    in->position_m[2] += up_m;
}

// Let the second hand press and lift once every two seconds, whatever the first hand does.
static void move_other(block *b, const double force_n[3])
{
    double w = 3.141592653589793, t = 1e-3 * (double)b->tick++, path_m[3] = {0, 0, 0.006 * cos(w * t)};
    double path_m_s[3] = {0, 0, -0.006 * w * sin(w * t)};
    kn_held_device_tick(&b->other, force_n, path_m, path_m_s);
    kn_turns_add(&b->turns, b->other.force_n[2]);
}

static double touch(void *self, const double position_m[3], const double velocity_m_s[3], double force_n[3])
{
    block *b = self;
    put(&b->input.probe[0], position_m, velocity_m_s, b->two ? -apart_m : 0, b->touch_m);
    if (b->two) put(&b->input.probe[1], b->other.position_m, b->other.velocity_m_s, apart_m, b->touch_m);
    b->diverged |= kn_step(b->model, b->state, b->scratch, &b->input, &b->output) != KN_OK;
    memcpy(force_n, b->output.probe[0].force_n, sizeof b->output.probe[0].force_n);
    if (b->two) move_other(b, b->output.probe[1].force_n);
    return -1;
}

// --- grid -----------------------------------------------------------------------------------------------------------

typedef struct tally {
    // runs: number of runs of one tool. buzzes: number of runs whose force oscillates (haptic_loop.h). gave: number of
    // runs in which one stroke gave the hand more than 1 mJ.
    int runs, buzzes, gave;
    // Largest values of all runs. "rms force above 10 Hz" is the rms value of the part of the force that oscillates
    // faster than 10 Hz. loudest_n: rms force above 10 Hz. floors: rms force above 10 Hz in the motions "lean" and
    // "press", divided by the resolution of the force. returned_j: energy given to the hand in one stroke. turns:
    // number of reversals of the force, per stroke of a tap or per second of a slide.
    double loudest_n, floors, returned_j, turns;
    char worst[80]; // name of the loudest run that buzzes, or of the loudest run if none buzzes
    double worst_n;
} tally;

static kn_haptic_loop_def rig_of(const kn_device_def *device, kn_coupling coupling, int trip_ms, kn_grip grip,
                                 kn_haptic_loop_motion motion)
{
    kn_haptic_loop_def def = {.arm = kn_held_device_of(device),
                              .coupling = coupling,
                              .trip_ms = trip_ms,
                              .passivity = true,
                              .motion = motion};
    def.arm.grip = grip;
    return def;
}

static void add(tally *t, const kn_haptic_loop_result *r, bool buzzes, kn_haptic_loop_motion motion, const char *what)
{
    double loud = r->force_rms_n + (buzzes ? 1e3 : 0);
    t->runs++;
    t->buzzes += buzzes;
    t->gave += r->returned_j > 1e-3;
    t->loudest_n = fmax(t->loudest_n, r->force_rms_n);
    bool held = motion == KN_HAPTIC_LOOP_LEAN || motion == KN_HAPTIC_LOOP_PRESS;
    if (held) t->floors = fmax(t->floors, r->force_rms_n / r->resolution_n);
    t->returned_j = fmax(t->returned_j, r->returned_j);
    if (motion >= KN_HAPTIC_LOOP_TAP) t->turns = fmax(t->turns, r->turns);
    if (loud > t->worst_n) t->worst_n = loud, snprintf(t->worst, sizeof t->worst, "%s", what);
}

static void run(tally *t, const kn_device_def *device, const char *material, bool quick, int tool, int trip_ms,
                kn_grip grip, kn_haptic_loop_motion motion)
{
    block b;
    kn_coupling coupling =
        kn_coupling_default(device->mass_kg, device->damping_n_s_m, 1e-3, 1e-3 * trip_ms, device->hand);
    kn_haptic_loop_def def = rig_of(device, coupling, trip_ms, grip, motion);
    block_open(&b, material, quick, tool, &coupling);
    kn_held_device_def other = def.arm;
    other.grip = KN_GRIP_NORMAL;
    kn_held_device_init(&b.other, &other, (double[]){0, 0, 0.006});
    b.turns.hysteresis = 2 * (1.5 * device->encoder_m * coupling.stiffness_n_m + 2e-3);
    kn_haptic_loop_result r = kn_haptic_loop_run(&def, touch, &b);
    char what[80];
    snprintf(what, sizeof what, "%s, %s, %s hand on %s, %d ms", motions[motion], device->name, kn_grip_name(grip),
             material, trip_ms);
    // KN_HAPTIC_LOOP_TURNS is the largest allowed number of force reversals in one stroke. The second hand makes two
    // strokes in a run, so twice as many are allowed.
    bool other_buzzes = b.two && b.turns.count > 2 * KN_HAPTIC_LOOP_TURNS;
    add(t, &r, r.buzzes || other_buzzes || b.diverged, motion, what);
    block_close(&b);
}

static bool grid_of(int tool, bool quick)
{
    tally t = {0};
    for (int c = 0; c < CLASSES; c++) {
        kn_device_def device;
        if (kn_device_profile_load(&device, "bench_loop", classes[c], NULL, 0) != 0) exit(3);
        for (int trip = 0; trip <= 1; trip++)
            for (int m = 0; m < MATERIALS; m++) {
                if (tool != PAIR) run(&t, &device, materials[m], quick, tool, trip, KN_GRIP_NONE, KN_HAPTIC_LOOP_LEAN);
                for (int g = KN_GRIP_LIGHT; g <= KN_GRIP_FIRM; g++)
                    for (int how = KN_HAPTIC_LOOP_PRESS;
                         how <= (tool == PAIR ? KN_HAPTIC_LOOP_TAP : KN_HAPTIC_LOOP_SLIDE); how++)
                        run(&t, &device, materials[m], quick, tool, trip, (kn_grip)g, (kn_haptic_loop_motion)how);
            }
    }
    printf("| %-12s | %4d | %6d | %7.3f | %6.2f | %6.1f | %8.2f | %6d | %s\n", tools[tool], t.runs, t.buzzes,
           t.loudest_n, t.floors, t.turns, 1e3 * t.returned_j, t.gave, t.worst);
    fflush(stdout);
    return t.buzzes == 0 && t.gave == 0;
}

// --- stiffness ------------------------------------------------------------------------------------------------------

// Press the tool down at 1 mm/s, from the depth from_m to the depth to_m. Wait at least 2 s and return the vertical
// force, N.
static double settled(block *b, double from_m, double to_m)
{
    double f[3] = {0}, way_m = 0;
    for (int n = 0; n < 2000 || way_m < to_m - from_m; n++) {
        bool goes = way_m < to_m - from_m;
        touch(b, (double[]){0, 0, -from_m - way_m}, (double[]){0, 0, goes ? -1e-3 : 0}, f);
        way_m += goes ? 1e-6 : 0;
    }
    for (int n = 0; n < 2000; n++) touch(b, (double[]){0, 0, -to_m}, (double[]){0, 0, 0}, f);
    return f[2];
}

// Return the stiffness of jelly under a ball, N/m, from the forces at the depths of 2 and 3 mm.
static double stiffness(const kn_coupling *coupling, bool quick)
{
    block b;
    block_open(&b, "jelly", quick, BALL, coupling);
    double first_n = settled(&b, 0, 2e-3), second_n = settled(&b, 2e-3, 3e-3);
    block_close(&b);
    return (second_n - first_n) / 1e-3;
}

static bool rendered(bool quick)
{
    double object = stiffness(&(kn_coupling){0}, quick);
    bool met = true;
    printf("\n| class   | coupling N/m | object N/m | in series | rendered | off %% |\n"
           "|---------|-------------:|-----------:|----------:|---------:|------:|\n");
    for (int c = 0; c < CLASSES; c++) {
        kn_device_def device;
        if (kn_device_profile_load(&device, "bench_loop", classes[c], NULL, 0) != 0) exit(3);
        double k = device.hand.stiffness_n_m, series = k * object / (k + object), felt = stiffness(&device.hand, quick);
        printf("| %-7s | %12.0f | %10.0f | %9.0f | %8.0f | %+5.1f |\n", classes[c], k, object, series, felt,
               100 * (felt / series - 1));
        met &= fabs(felt / series - 1) < 0.1;
    }
    return met;
}

int main(int argc, char **argv)
{
    bool quick = argc == 2 && !strcmp(argv[1], "--quick"), met = true;
    if (argc == 2 && !strcmp(argv[1], "--help"))
        return printf(
                   "usage: bench_loop [--quick]\nSimulate closed loops on 847 nodes, in ten minutes; --quick: on 144 "
                   "nodes, in five minutes. bench/FIGURES.md explains the tables.\n"),
               0;
    if (argc > 1 && !quick) return fprintf(stderr, "bench_loop: %s: expected --quick, --help or nothing\n", argv[1]), 2;
    print_machine();
    printf("\nRound trips of 0 and 1 ms. floors: force above 10 Hz of a held tool / resolution of the force; turns: "
           "reversals of the force per stroke of a tap or second of a slide.\n\n"
           "| tool         | runs | buzzes | >10Hz N | floors | turns  | given mJ | > 1 mJ | loudest\n"
           "|--------------|-----:|-------:|--------:|-------:|-------:|---------:|-------:|--------\n");
    for (int tool = 0; tool < TOOLS; tool++) met &= grid_of(tool, quick) || tool == RIGID;
    met &= rendered(quick);
    return !met;
}
