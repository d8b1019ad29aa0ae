// pressed SCENE LOG: a recording of a hand's poses that no clock has spoilt: its tool 0 comes down to the top of SCENE within
// half a second, goes 1 cm into it and out again within 4 s, along a cosine each, and stays there for half a second.
#include "server/log.h"
#include "server/wire.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define START_US 1700000000000000

static bool put(lcm_eventlog_t *log, int64_t utime, const char *channel, void *bytes, int size)
{
    return size > 0 && kn_log_write(log, utime, channel, bytes, (size_t)size);
}

static bool put_scene(lcm_eventlog_t *log, const kn_scene *scene)
{
    static uint8_t bytes[1 << 16];
    knead_scene_t m;
    kn_wire_scene(&m, scene, 0, START_US);
    return put(log, START_US, "KNEAD_SCENE", bytes, knead_scene_t_encode(bytes, 0, sizeof bytes, &m));
}

static bool put_pose(lcm_eventlog_t *log, const kn_scene *scene, int ms)
{
    static const double clear_m = 2e-5, depth_m = 0.01; // a plate that arrives faster meets a wall, and the guard
    const double turn = 0.5e-3 * M_PI * fmin(fmax(ms - 500, 0), 4000), half = 0.5 * (clear_m + depth_m);
    const double come = M_PI * fmin(ms, 500) / 500, above_m = 0.0015;
    double extent_m[3];
    kn_model_def_extent(&scene->model, extent_m);
    const kn_pose pose = {.session = 1,
                          .seq = ms + 1,
                          .utime = START_US + 1000 * (ms + 1),
                          .position_m = {0, 0, extent_m[2] + clear_m + above_m * (1 + cos(come)) -
                                                half * (1 - cos(turn))},
                          .orientation_wxyz = {1},
                          .velocity_m_s = {0, 0, -0.5 * M_PI * half * sin(turn) - 2 * M_PI * above_m * sin(come)}};
    char channel[64];
    uint8_t bytes[512];
    knead_probe_pose_t m;
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", scene->model.probe[0].name);
    kn_wire_pose(&m, &pose);
    return put(log, pose.utime, channel, bytes, knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &m));
}

int main(int argc, char **argv)
{
    char error[400] = "usage: pressed SCENE LOG";
    kn_scene *scene = argc == 3 ? kn_scene_load(argv[1], NULL, 0, error, sizeof error) : NULL;
    lcm_eventlog_t *log = scene ? lcm_eventlog_create(argv[2], "w") : NULL;
    if (!log) return fprintf(stderr, "pressed: %s\n", scene ? argv[2] : error), 2;
    bool ok = put_scene(log, scene);
    for (int ms = 0; ok && ms < 5000; ms++) ok = put_pose(log, scene, ms);
    lcm_eventlog_destroy(log);
    kn_scene_destroy(scene);
    return ok ? 0 : 3;
}
