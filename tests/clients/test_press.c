// clients/shape/press_protocol.h: repeat a hand's press on a model, from a path and from a log whose server missed cycles.
#include "clients/shape/press_protocol.h"
#include "clients/shape/structure_candidate.h"
#include "server/log_replay.h"
#include "tests/check.h"
#include "tests/clients/recorded_press.h"

TEST("the hold ends when the tool begins to rise, at any speed, without a hold, and in a log")
{
    kn_candidate c[KN_CANDIDATES];
    kn_press press = {0};
    AT_END(kn_pressed_free) kn_pressed pressed = {0};
    open_candidate(c, SMALL, "diagonals", NULL);
    must(kn_press_path(&press, c->scene, &(kn_press_def){.hold_s = 1}, error, sizeof error), error);
    const kn_press_play play = {.model = c->first, .surface = c->surface.mesh, .until_s = press.hold_end_s};
    must(kn_press_run(&press, &play, &pressed), "the press diverges");
    const double end_n = pressed.force_n[pressed.ticks - 1], before_n = pressed.force_n[pressed.ticks - 51];
    CHECK(end_n > 0.3);
    CHECK_NEAR(end_n / before_n, 1, 0.02);        // the force still relaxes, by no more in 50 ms
    CHECK_NEAR(press.hold_end_s, 1.05 + 1, 0.01); // down in 1 s; the 50 ms at the beginning and at the end count half
    kn_press_free(&press);
    static const kn_press_def defs[] = {{.speed_m_s = 1e-4, .depth_m = 1e-3, .hold_s = 1}, {.hold_s = -1}};
    for (int i = 0; i < 2; i++) { // slow, without a hold
        must(kn_press_path(&press, c->scene, &defs[i], error, sizeof error), error);
        CHECK_NEAR(press.hold_end_s, i ? 1.05 : 10.05 + 1, 0.01);
        kn_press_free(&press);
    }
    const double rises_s = record_press();
    must(kn_press_log(&press, c->scene, &(kn_press_def){0}, "missed.lcmlog", error, sizeof error), error);
    CHECK_NEAR(press.hold_end_s, rises_s, 0.01);
    kn_press_free(&press);
    kn_candidate_free(c);
}

TEST("a press from a log keeps the log's clock across missed cycles and repeats the replay's forces and surfaces")
{
    kn_candidate c[KN_CANDIDATES];
    AT_END(kn_press_free) kn_press press = {0};
    AT_END(kn_pressed_free) kn_pressed pressed = {0};
    const double at_s = record_press() - 0.55; // on the way down, after 21 ms of missed cycles
    open_candidate(c, SMALL, "diagonals", NULL);
    must(kn_press_log(&press, c->scene, &(kn_press_def){0}, "missed.lcmlog", error, sizeof error), error);
    const kn_press_play play = {c->first, c->surface.mesh, 1, &at_s, press.end_s, NULL, NULL};
    must(kn_press_run(&press, &play, &pressed), "the press diverges");
    float(*seen)[3] = calloc((size_t)pressed.vertex_count, sizeof *seen);
    kn_replay *r = kn_replay_create(&(kn_replay_def){.log_path = "missed.lcmlog"}, error, sizeof error);
    must(r, error);
    int64_t t = 0;
    double apart = 0;
    for (bool taken = false; kn_replay_step(r) && t < press.ticks; t++) {
        CHECK_NEAR(press.time_s[t], r->tick.time_s, 1e-9);
        CHECK(kn_press_tick(&press, r->tick.time_s) == t);
        CHECK_NEAR(pressed.force_n[t], r->tick.out.force[0].contact_force_n[2], 1e-6);
        if (taken || r->tick.time_s < at_s - KN_REPLAY_HALF_TICK_S) continue;
        kn_surface_positions(c->surface.mesh, c->first, kn_replay_state(r), (float *)seen);
        taken = true;
    }
    CHECK(press.ticks == t);
    CHECK_NEAR(press.end_s - press.time_s[0], 1e-3 * (double)(t - 1 + 2 * MISSED_MS), 1e-9);
    for (int v = 0; v < pressed.vertex_count; v++)
        for (int k = 0; k < 3; k++) apart = fmax(apart, fabs(seen[v][k] - pressed.shape_m[0][v][k]));
    CHECK_NEAR(apart, 0, 1e-7);
    free(seen);
    kn_replay_destroy(r);
    kn_candidate_free(c);
}

TESTS_MAIN
