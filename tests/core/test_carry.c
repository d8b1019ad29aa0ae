#include "core/snapshot.h"
#include "core/lattice/measure.h"
#include "core/scene/scene.h"
#include "core/step.h"
#include "tests/check.h"

typedef struct object {
    kn_scene *scene;
    kn_model *model;
    kn_state *state;
} object;

static object object_of(const char *scene, const char *set)
{
    object o = {.scene = load_scene(scene, &set, set ? 1 : 0)};
    o.model = build(&o.scene->model);
    o.state = kn_state_create(o.model);
    if (!o.state) fprintf(stderr, "no room for a state\n"), exit(1);
    return o;
}

static void object_free(object *o)
{
    kn_state_destroy(o->state);
    kn_model_destroy(o->model);
    kn_scene_destroy(o->scene);
}

// Press the last tool down by 5 mm within 100 ms, hold it, and return its force.
static double hold(object *o, int ms)
{
    kn_input in = {0};
    kn_output out = {0};
    double extent[3];
    int p = o->model->def.probe_count - 1;
    kn_model_def_extent(&o->model->def, extent);
    for (int i = 0; i < ms; i++) {
        double t = 1e-2 * (double)o->state->tick, way = t < 1 ? t : 1;
        double height = extent[2] + o->model->def.probe[p].radius_m - 5e-3 * way;
        in.probe[p] = (kn_probe_input){true, {0, 0, height}, {0, 0, t < 1 ? -0.05 : 0}, {1, 0, 0, 0}, false};
        CHECK(kn_step(o->model, o->state, &in, &out) == KN_OK);
    }
    return out.probe[p].force_n[2];
}

static double elastic(const object *o)
{
    kn_energy e;
    CHECK(kn_energy_of(o->model, o->state, &e));
    return e.elastic;
}

TEST("a state carried into a model of the same material continues to the same bits")
{
    static const char *const scenes[] = {"dough-small.yaml", "jelly.yaml", "bun.yaml", "pinch.yaml"};
    for (size_t s = 0; s < sizeof scenes / sizeof *scenes; s++) {
        AT_END(object_free) object a = object_of(scenes[s], NULL), b = object_of(scenes[s], NULL);
        hold(&a, 150);
        CHECK(kn_carry_misfit(a.model, b.model) == NULL);
        kn_carry(a.model, a.state, b.model, b.state);
        hold(&a, 100);
        hold(&b, 100);
        CHECK(kn_state_hash(a.model, a.state) == kn_state_hash(b.model, b.state));
    }
}

TEST("carrying a state into springs twice as stiff doubles the elastic energy and moves no node")
{
    AT_END(object_free) object a = object_of("dough-small.yaml", NULL);
    AT_END(object_free) object b = object_of("dough-small.yaml", "material.k1=940 gf/cm^3");
    hold(&a, 3000); // until the last steps change little
    kn_carry(a.model, a.state, b.model, b.state);
    for (int i = 0; i < a.model->node_count; i++) {
        double x[3], y[3];
        kn_state_position(a.model, a.state, i, x);
        kn_state_position(b.model, b.state, i, y);
        CHECK(memcmp(x, y, sizeof x) == 0);
    }
    printf("     %.4g mJ, then %.4g\n", 1e3 * elastic(&a), 1e3 * elastic(&b));
    CHECK_NEAR(elastic(&b) / elastic(&a), 2, 0.01);
}

TEST("after a change to a stiffer spring the force relaxes to that of an object stiff from the start")
{
    AT_END(object_free) object soft = object_of("jelly.yaml", NULL);
    AT_END(object_free) object hard = object_of("jelly.yaml", "material.k1=20 kPa");
    AT_END(object_free) object turned = object_of("jelly.yaml", "material.k1=20 kPa");
    double before = hold(&soft, 1000);
    kn_carry(soft.model, soft.state, turned.model, turned.state);
    hold(&hard, 3000);
    hold(&turned, 2000);
    double always = hold(&hard, 1), now = hold(&turned, 1);
    printf("     %.4f N soft, %.4f N turned, %.4f N hard from the start\n", before, now, always);
    CHECK(now > 1.2 * before);
    CHECK_NEAR(now / always, 1, 1e-3);
}

TEST("a change of the stress area keeps the length of every Voigt element, not its strain")
{
    AT_END(object_free) object a = object_of("dough-small.yaml", NULL);
    AT_END(object_free) object b = object_of("dough-small.yaml", "object.diagonal_stiffness=0.5");
    hold(&a, 500);
    CHECK(kn_carry_misfit(a.model, b.model) == NULL && a.model->grid.gamma != b.model->grid.gamma);
    kn_carry(a.model, a.state, b.model, b.state);
    const float *u = a.state->strain, *v = b.state->strain;
    double most = 0, off = 0;
    for (size_t e = 0; e < a.model->edge_reals; e++) {
        double p = u[e] * a.model->grid.gamma, q = v[e] * b.model->grid.gamma;
        most = fmax(most, fabs(p));
        off = fmax(off, fabs(p - q));
    }
    CHECK(most > 0.01 && off < 1e-7);
}

TEST("a model that cannot continue an object's state is refused with the reason")
{
    static const struct {
        const char *scene, *set, *why;
    } table[] = {
        {"dough-small.yaml", "object.spacing=5 mm", "another lattice"},
        {"dough-small.yaml", "object.structure=axis", "another lattice"},
        {"dough-small.yaml", "solver.precision=f64", "another method or precision"},
        {"dough-small.yaml", "support=frictionless", "another support or pressure"},
        {"dough-small.yaml", "material.damper=none", "a damper where there was none, or none where there was one"},
        {"dough-small.yaml", "material.stroke=[0.1, 0.9]", "other stops of the damper"},
        {"dough-small.yaml", "probes.finger.radius=2 cm", "another tool"},
        {"dough-small.yaml", "probes.plate.size=[2 cm, 1 cm]", "another tool"},
        {"dough-small.yaml", "probes.finger.friction=0.3", "contact that now sticks, or no longer sticks"},
        {"dough-small.yaml", "material.k1=1 kPa", NULL},
        {"dough-small.yaml", "material.c1=1 kPa*s", NULL},
        {"dough-small.yaml", "material.variant=plastic", NULL},
        {"dough-small.yaml", "density=900 kg/m^3", NULL},
        {"dough-small.yaml", "gravity=9.81 m/s^2", NULL},
        {"dough-small.yaml", "device.clamp=1 N", NULL},
        {"dough-small.yaml", "solver.iterations=9", NULL},
        {"dough-small.yaml", "probes.finger.foundation=2e7 N/m^3", NULL},
        {"rolling-pin.yaml", "material.k1=1 kPa", NULL},
        {"bun.yaml", "material.k1=1 kPa", NULL},
        {"pinch.yaml", "probes.thumb.friction=0.5", NULL},
    };
    for (size_t t = 0; t < sizeof table / sizeof *table; t++) {
        AT_END(object_free) object a = object_of(table[t].scene, NULL), b = object_of(table[t].scene, table[t].set);
        const char *why = kn_carry_misfit(a.model, b.model);
        if (table[t].why) CHECK_STR(why ? why : "nothing", table[t].why);
        else CHECK(why == NULL);
    }
}

TESTS_MAIN
