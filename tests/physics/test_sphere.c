// A ball sliding over the block. With a contact at single nodes the force would jump by 60-76 % per millisecond.
#include "tests/check.h"
#include "tests/physics/press.h"

typedef struct slide {
    // relative to the mean: largest change in 1 ms, rms about the mean, rms above 10 Hz
    double mean_n, jump, ripple, buzz;
    int fewest; // smallest number of contacts
} slide;

// Return the rms of the force above about 10 Hz, by subtracting a centred mean over 100 ms.
static double rms_above_10hz(const double *f, int n)
{
    double sum = 0;
    int used = 0;
    for (int i = 50; i + 50 < n; i++, used++) {
        double mean = 0.5 * (f[i - 50] + f[i + 50]);
        for (int k = -49; k < 50; k++) mean += f[i + k];
        sum += (f[i] - mean / 100) * (f[i] - mean / 100);
    }
    return sqrt(sum / used);
}

// Slide 2 mm deep at 10 mm/s along x from -8 mm, off the line of nodes. Measure over the last three cells.
static slide slide_over(kn_model_def def, double radius_m)
{
    enum { DOWN = 300, WAIT = 200, ALONG = 2000, SKIP = 500 };
    static double force[ALONG - SKIP];
    def.probe[0].radius_m = radius_m;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    double top = (def.nodes[2] - 1) * def.spacing_m;
    slide s = {.fewest = 1000};
    for (int i = 1; i <= DOWN + WAIT + ALONG; i++) {
        double depth = 0.002 * fmin(1, (double)i / DOWN), along = fmax(0, i - DOWN - WAIT) * 1e-5;
        kn_input in = {0};
        kn_output out;
        in.probe[0] =
            (kn_probe_input){.attached = true, .position_m = {-0.008 + along, 0.0013, top + radius_m - depth}};
        in.probe[0].velocity_m_s[0] = along > 0 ? 0.01 : 0;
        in.probe[0].velocity_m_s[2] = i <= DOWN ? -0.002 / (DOWN * 1e-3) : 0;
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
        int at = i - 1 - DOWN - WAIT - SKIP;
        if (at < 0) continue;
        force[at] = out.probe[0].force_n[2];
        if (out.probe[0].contacts < s.fewest) s.fewest = out.probe[0].contacts;
    }
    int n = ALONG - SKIP;
    for (int i = 0; i < n; i++) s.mean_n += force[i] / n;
    for (int i = 0; i < n; i++) {
        if (i) s.jump = fmax(s.jump, fabs(force[i] - force[i - 1]) / s.mean_n);
        s.ripple += (force[i] - s.mean_n) * (force[i] - s.mean_n) / n;
    }
    s.ripple = sqrt(s.ripple) / s.mean_n;
    s.buzz = rms_above_10hz(force, n) / s.mean_n;
    return s;
}

static void check_slide(const char *name, kn_model_def def, double radius_m, double ripple)
{
    slide s = slide_over(def, radius_m);
    printf("     %s: mean %.3f N, jump %.2f %% per ms, ripple %.1f %%, above 10 Hz %.2f %%, at least %d samples\n",
           name, s.mean_n, 100 * s.jump, 100 * s.ripple, 100 * s.buzz, s.fewest);
    CHECK(s.mean_n > 0.05);
    CHECK(s.jump <= 0.005);
    CHECK(s.buzz <= 0.007);
    CHECK(s.ripple <= ripple);
    CHECK(s.fewest >= 4);
}

TEST("a ball of one cell's radius slides over dough with jumps below 0.5 % per ms, 0.7 % buzz above 10 Hz and 10 % "
     "ripple")
{
    check_slide("dough, r = h", ball_def(2), 0.005, 0.10);
}

TEST("a ball of two cells' radius slides over dough with less than 5 % ripple")
{
    check_slide("dough, r = 2h", ball_def(2), 0.01, 0.05);
}

TEST("on jelly a sliding ball of one cell's radius keeps the bounds of dough")
{
    kn_model_def def = ball_def(2);
    def.material = (kn_material){.k1_pa = 4.7e4, .c1_pa_s = 100, .damper = KN_DAMPER_NONE};
    check_slide("jelly, r = h", def, 0.005, 0.10);
}

static slide slide_on(kn_model_def def, kn_skin_form skin, const char *name)
{
    def.skin = skin;
    slide s = slide_over(def, def.probe[0].radius_m);
    printf("     %s, %s: jump %.3f %% per ms, ripple %.2f %%, above 10 Hz %.3f %%\n", name,
           skin == KN_SKIN_BILINEAR ? "bilinear" : "spline", 100 * s.jump, 100 * s.ripple, 100 * s.buzz);
    return s;
}

TEST("under a ball of one cell's radius a bilinear skin has at least a third more ripple and buzz than the spline")
{
    kn_model_def def = ball_def(2);
    def.probe[0].radius_m = 0.005;
    slide spline = slide_on(def, KN_SKIN_SPLINE, "dough, r = h");
    slide flat = slide_on(def, KN_SKIN_BILINEAR, "dough, r = h");
    CHECK(spline.ripple < 0.7 * flat.ripple && spline.buzz < 0.75 * flat.buzz && spline.jump < 0.9 * flat.jump);
}

TEST("under a ball of two cells' radius the bilinear skin is about as good on jelly and within the bounds on dough")
{
    kn_model_def def = ball_def(2), jelly = def;
    jelly.material = (kn_material){.k1_pa = 4.7e4, .c1_pa_s = 100, .damper = KN_DAMPER_NONE};
    slide spline = slide_on(jelly, KN_SKIN_SPLINE, "jelly, r = 2h");
    slide flat = slide_on(jelly, KN_SKIN_BILINEAR, "jelly, r = 2h");
    slide flowing = slide_on(def, KN_SKIN_BILINEAR, "dough, r = 2h");
    CHECK(flat.ripple < 1.1 * spline.ripple && flat.jump < 1.4 * spline.jump);
    CHECK(flowing.jump <= 0.005 && flowing.buzz <= 0.007 && flowing.ripple <= 0.05);
}

TEST("the force on a ball points away from the object, and is zero in free air")
{
    kn_model_def def = ball_def(2);
    press p = {.depth_m = 0.003, .hold_s = 0.1};
    AT_END(run_free) run r = press_run(&def, &p, press_up_s(&p) + 1.5, 1e-3);
    CHECK(peak_n(&r) > 0.2);
    for (int i = 0; i < r.samples; i++) CHECK(r.force_n[i][2] >= 0);
    for (int k = 0; k < 3; k++) CHECK_NEAR(r.force_n[r.samples - 1][k], 0, 0);
}

TESTS_MAIN
