// pressed SCENE LOG [DEPTH_MM [KEY=VALUE]...]: write kneadd's log of a hand in virtual time. Tool 0 comes down to the
// top of SCENE within half a second. It goes 10 mm (DEPTH_MM) in and out again within 4 s, each along a cosine, and
// stays there for half a second.
#include "tests/recorder.h"
#include <math.h>

static void move(kn_pose *hand, double top_m, double depth_m, int ms)
{
    static const double clear_m = 2e-5, above_m = 0.0015; // a faster plate would hit a wall and trip the guard
    const double turn = 0.5e-3 * M_PI * fmin(fmax(ms - 500, 0), 4000), half = 0.5 * (clear_m + depth_m);
    const double come = M_PI * fmin(ms, 500) / 500;
    hand->position_m[2] = top_m + clear_m + above_m * (1 + cos(come)) - half * (1 - cos(turn));
    hand->velocity_m_s[2] = -0.5 * M_PI * half * sin(turn) - 2 * M_PI * above_m * sin(come);
}

int main(int argc, char **argv)
{
    static kn_recorder r;
    double extent_m[3];
    if (argc < 3) return fputs("usage: pressed SCENE LOG [DEPTH_MM [KEY=VALUE]...]\n", stderr), 2;
    const char *const *sets = (const char *const *)argv + 4;
    kn_recorder_open(
        &r, argv[2],
        &(kn_served_object_def){.scene_path = argv[1], .sets = sets, .set_count = argc > 4 ? argc - 4 : 0});
    kn_model_def_extent(&r.on.scene->model, extent_m);
    for (int ms = 0; ms < 5000; ms++) {
        move(&r.hand[0], extent_m[2], argc > 3 ? 1e-3 * atof(argv[3]) : 0.01, ms);
        kn_recorder_pose(&r, 0);
        kn_recorder_tick(&r);
    }
    kn_recorder_close(&r);
    return 0;
}
