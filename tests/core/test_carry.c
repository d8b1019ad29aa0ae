#include "core/snapshot.h"
#include "core/lattice/measure.h"
#include "tests/lattice.h"

// Press the last tool down by 5 mm within 100 ms, hold it, and return its force.
static double hold(lattice *l, int ms)
{
    double extent[3];
    int p = l->model->def.probe_count - 1;
    kn_model_def_extent(&l->model->def, extent);
    for (int i = 0; i < ms; i++) {
        double t = 1e-2 * (double)l->state->tick, way = t < 1 ? t : 1;
        put(l, p, 0, 0, extent[2] + l->model->def.probe[p].radius_m - 5e-3 * way);
        l->in.probe[p].velocity_m_s[2] = t < 1 ? -0.05 : 0;
        step(l);
    }
    return l->out.probe[p].force_n[2];
}

static void carry(const lattice *from, const lattice *to)
{
    CHECK(kn_carry_misfit(from->model, to->model) == NULL);
    kn_carry(from->model, from->state, to->model, to->state);
}

static double elastic(const lattice *l)
{
    kn_energy e;
    CHECK(kn_energy_of(l->model, l->state, &e));
    return e.elastic;
}

TEST("a state carried into a model of the same material continues to the same bits")
{
    static const char *const scenes[] = {"dough-small.yaml", "jelly.yaml", "bun.yaml", "pinch.yaml"};
    for (int s = 0; s < COUNT(scenes); s++) {
        LATTICE a = object_of(scenes[s], NULL), b = object_of(scenes[s], NULL);
        hold(&a, 150);
        carry(&a, &b);
        hold(&a, 100), hold(&b, 100);
        CHECK(hash_of(&a) == hash_of(&b));
    }
}

TEST("carrying a state into springs twice as stiff doubles the elastic energy and moves no node")
{
    LATTICE a = object_of("dough-small.yaml", NULL), b = object_of("dough-small.yaml", "material.k1=940 gf/cm^3");
    hold(&a, 3000); // until the last steps change little
    carry(&a, &b);
    CHECK(memcmp(a.state->displacement, b.state->displacement, kn_state_field(a.model, 3)) == 0);
    printf("     %.4g mJ, then %.4g\n", 1e3 * elastic(&a), 1e3 * elastic(&b));
    CHECK_NEAR(elastic(&b) / elastic(&a), 2, 0.01);
}

TEST("after a change to a stiffer spring the force relaxes to that of an object stiff from the start")
{
    LATTICE soft = object_of("jelly.yaml", NULL), hard = object_of("jelly.yaml", "material.k1=20 kPa");
    LATTICE turned = object_of("jelly.yaml", "material.k1=20 kPa");
    double before = hold(&soft, 1000);
    carry(&soft, &turned);
    double always = hold(&hard, 3001), now = hold(&turned, 2001);
    printf("     %.4f N soft, %.4f N turned, %.4f N hard from the start\n", before, now, always);
    CHECK(now > 1.2 * before);
    CHECK_NEAR(now / always, 1, 1e-3);
}

TEST("a change of the stress area keeps the length of every Voigt element, not its strain")
{
    LATTICE a = object_of("dough-small.yaml", NULL), b = object_of("dough-small.yaml", "object.diagonal_stiffness=0.5");
    hold(&a, 500);
    CHECK(a.model->grid.gamma != b.model->grid.gamma);
    carry(&a, &b);
    double most = 0, off = 0;
    for (size_t e = 0; e < a.model->edge_reals; e++) {
        double p = kn_real_get(a.model, a.state->strain, e) * a.model->grid.gamma;
        most = fmax(most, fabs(p));
        off = fmax(off, fabs(p - kn_real_get(b.model, b.state->strain, e) * b.model->grid.gamma));
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
        {"dough-small.yaml", "material.k1=1 kPa", "nothing"},
        {"dough-small.yaml", "material.c1=1 kPa*s", "nothing"},
        {"dough-small.yaml", "material.variant=plastic", "nothing"},
        {"dough-small.yaml", "density=900 kg/m^3", "nothing"},
        {"dough-small.yaml", "gravity=9.81 m/s^2", "nothing"},
        {"dough-small.yaml", "device.clamp=1 N", "nothing"},
        {"dough-small.yaml", "solver.iterations=9", "nothing"},
        {"dough-small.yaml", "probes.finger.foundation=2e7 N/m^3", "nothing"},
        {"rolling-pin.yaml", "material.k1=1 kPa", "nothing"},
        {"bun.yaml", "material.k1=1 kPa", "nothing"},
        {"pinch.yaml", "probes.thumb.friction=0.5", "nothing"},
    };
    for (int t = 0; t < COUNT(table); t++) {
        LATTICE a = object_of(table[t].scene, NULL), b = object_of(table[t].scene, table[t].set);
        const char *why = kn_carry_misfit(a.model, b.model);
        CHECK_STR(why ? why : "nothing", table[t].why);
    }
}
