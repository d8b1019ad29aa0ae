#ifndef KN_TESTS_RECORDED_PRESS_H
#define KN_TESTS_RECORDED_PRESS_H
// A log of a press during which the server missed cycles. A plate is pressed 3 mm at 1 cm/s, held for 0.5 s and
// lifted. A candidate structure to repeat such a press.
#include "clients/hand/tool_path.h"
#include "clients/shape/structure_candidate.h"
#include "tests/recorder.h"

#define SMALL KN_SOURCE_DIR "/core/scenes/dough-small.yaml"

static void must(bool ok, const char *what)
{
    if (ok) return;
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static char error[600];

static void open_candidate(kn_candidate *c, const char *scene, const char *structure, const char *const *set)
{
    const kn_candidate_def def = {.scene_path = scene, .sets = set, .set_count = set && *set};
    must(kn_candidates_open(c, &def, structure, error, sizeof error) == 1, error);
}

enum { MISSED_MS = 21 };

// Write missed.lcmlog once. The server misses three times seven cycles on the way down, and as many while the plate
// is held. Return the time at which the hand begins to rise.
static double record_press(void)
{
    static kn_recorder r;
    static double rises_s;
    const kn_tool_path_def press = {
        .touch_z_m = 0.03, .clear_m = 0.005, .depth_m = 0.003, .speed_m_s = 0.01, .hold_s = 0.5};
    if (rises_s > 0) return rises_s;
    kn_tool_path *path = kn_tool_path_press(&press);
    must(path, "out of memory");
    kn_recorder_open(&r, "missed.lcmlog", &(kn_served_object_def){.scene_path = SMALL});
    const int64_t down = (int64_t)(1e3 * (path->hold_end_s - press.hold_s)) - 200, standing = down + 400;
    while (1e-3 * (double)r.in.tick < path->hold_end_s + 0.3) {
        kn_tool_path_point at;
        const int64_t next = r.in.tick + 1;
        for (int i = 0; i < 3; i++) // at 20 missed cycles in a row the servo would let go
            if (next == down + 30 * i || next == standing + 30 * i) r.in.missed = MISSED_MS / 3;
        kn_tool_path_at(path, 1e-3 * (double)(next + r.in.missed), &at);
        memcpy(r.hand[0].position_m, at.position_m, sizeof at.position_m);
        memcpy(r.hand[0].velocity_m_s, at.velocity_m_s, sizeof at.velocity_m_s);
        kn_recorder_pose(&r, 0);
        kn_recorder_tick(&r);
    }
    rises_s = path->hold_end_s;
    kn_tool_path_destroy(path);
    kn_recorder_close(&r);
    return rises_s;
}

#endif
