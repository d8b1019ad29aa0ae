#include "clients/sweep/replay_trace.h"
#include "tests/check.h"

enum { TICKS = 3000 };

static kn_replay_trace empty(void)
{
    kn_replay_trace t = {.ticks = TICKS, .probes = 2, .nodes = 1, .spacing_m = 0.01};
    t.force_n = calloc((size_t)(t.ticks * t.probes), sizeof *t.force_n);
    t.shape_m = calloc(1, sizeof *t.shape_m);
    return t;
}

// Return a trace of a hand that presses and releases within half a second, delayed by late_s. Its tool is the second.
static kn_replay_trace press(double late_s, double peak_n)
{
    kn_replay_trace t = empty();
    for (int i = 0; i < TICKS; i++) {
        double x = (1e-3 * i - 1 - late_s) / 0.05;
        t.force_n[2 * i + 1][2] = peak_n * exp(-x * x);
    }
    return t;
}

static double stretched(const int64_t node[3], double spacing_m, int k) // a displacement that grows linearly
{
    const double *x =
        (const double[]){spacing_m * (double)node[0], spacing_m * (double)node[1], spacing_m * (double)node[2]};
    return 0.1 * x[k] + 0.03 * x[(k + 1) % 3] - (k == 2 ? 0.002 : 0);
}

static kn_replay_trace block(int cells)
{
    kn_replay_trace t = {.spacing_m = 0.06 / cells, .grid = {cells + 1, cells + 1, cells / 2 + 1}};
    t.nodes = t.grid[0] * t.grid[1] * t.grid[2];
    t.shape_m = calloc((size_t)t.nodes, sizeof *t.shape_m);
    int64_t at[3], n = 0;
    for (at[2] = 0; at[2] < t.grid[2]; at[2]++)
        for (at[1] = 0; at[1] < t.grid[1]; at[1]++)
            for (at[0] = 0; at[0] < t.grid[0]; at[0]++, n++)
                for (int k = 0; k < 3; k++) t.shape_m[n][k] = stretched(at, t.spacing_m, k);
    return t;
}

TEST("a force 3 ms late has a lag of 3 ms, an early force has a negative lag, and a force without content near 10 Hz "
     "has none")
{
    AT_END(kn_replay_trace_free) kn_replay_trace now = press(0, 10), late = press(0.003, 10), early = press(-0.0005, 8);
    CHECK_NEAR(kn_contact_force_lag(&late, &now), 0.003, 2e-5);
    CHECK_NEAR(kn_contact_force_lag(&early, &now), -0.0005, 2e-5);
    CHECK_NEAR(kn_contact_force_lag(&now, &now), 0, 1e-12);
    AT_END(kn_replay_trace_free) kn_replay_trace slow = empty(), none = empty();
    for (int i = 0; i < TICKS; i++) slow.force_n[2 * i][0] = pow(sin(M_PI * i / TICKS), 8); // one slow push
    CHECK(isnan(kn_contact_force_lag(&slow, &slow)));
    CHECK(isnan(kn_contact_force_lag(&none, &none)));
}

TEST(
    "a force that is 10 % larger has a relative error of 0.1, and the largest jump of a force is found beside its peak")
{
    AT_END(kn_replay_trace_free) kn_replay_trace a = press(0, 11), b = press(0, 10), none = empty();
    CHECK_NEAR(kn_contact_force_error(&a, &b), 0.1, 1e-12);
    CHECK_NEAR(kn_contact_force_peak(&a) / kn_contact_force_peak(&b), 1.1, 1e-12);
    CHECK_NEAR(kn_contact_force_variation(&b), 20, 1e-3);
    CHECK(isnan(kn_contact_force_error(&a, &none)));
    double left;
    CHECK_NEAR(kn_contact_force_factor(&a, &b, &left), 10.0 / 11, 1e-12);
    CHECK_NEAR(left, 0, 1e-7);
    CHECK(isnan(kn_contact_force_factor(&none, &b, &left)) && isnan(left));
    b.force_n[0][0] += 0.1 * sqrt(TICKS) * kn_contact_force_peak(&b);
    kn_contact_force_factor(&a, &b, &left);
    CHECK(left > 0.05);
    AT_END(kn_replay_trace_free) kn_replay_trace t = empty();
    for (int i = 0; i < TICKS; i++) t.force_n[2 * i][2] = 0.01 * i + (i >= 500 ? 2.5 : 0);
    CHECK_NEAR(kn_contact_force_jump(&t), 2.51, 1e-9);
}

TEST("lattices of different spacing with the same displacement field have the same shape, and the depth is the deepest "
     "node's")
{
    AT_END(kn_replay_trace_free) kn_replay_trace coarse = block(4), fine = block(6), finest = block(12);
    CHECK_NEAR(kn_contact_shape_error(&coarse, &fine), 0, 1e-12);
    CHECK_NEAR(kn_contact_shape_error(&coarse, &finest), 0, 1e-12);
    CHECK_NEAR(kn_contact_shape_error(&finest, &coarse), 0, 1e-12);
    coarse.shape_m[coarse.nodes - 1][2] += 0.01;
    CHECK(kn_contact_shape_error(&coarse, &fine) > 0.01);
    coarse.shape_m[7][2] = -0.0196;
    CHECK_NEAR(kn_contact_depth(&coarse), 0.0196, 1e-12);
}

TESTS_MAIN
