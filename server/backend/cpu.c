#include "server/backend/backend.h"
#include <math.h>
#include <stdlib.h>

#define PERIOD_S 1e-3

typedef struct cpu {
    const kn_model *model;
    kn_state *state;
    kn_scratch *scratch;
    int steps;           // number of time steps of the model in one tick
    kn_contact_fit *fit; // identification of local contact models; NULL: none are identified
    kn_output output;
    kn_backend_status status;
} cpu;

const char *const kn_fixed_set[KN_FIXED_SETS] = {"solver.kind=fixed", "solver.precision=f64"};

// The quotient may differ from a whole number by a relative error of 1e-6.
int kn_backend_steps(double dt_s)
{
    double n = PERIOD_S / dt_s;
    if (!(n >= 0.999 && n < 1e6)) return 0;
    int steps = (int)lround(n);
    return fabs(n - steps) < 1e-6 * n ? steps : 0;
}

// Compute the time steps of one tick, all with the same input. A probe follows its velocity between poses, so shorter
// steps need no further poses. The output has the largest residual of the steps, and is capped if any step was capped.
static void cpu_submit(void *self, const kn_input *input)
{
    cpu *c = self;
    double residual = 0.0;
    bool capped = false;
    kn_status status = KN_OK;
    for (int i = 0; i < c->steps && status == KN_OK; i++) {
        status = kn_step(c->model, c->state, c->scratch, input, &c->output);
        if (c->fit) kn_contact_fit_step(c->fit, c->state, c->scratch, input, &c->output);
        residual = fmax(residual, c->output.residual);
        capped |= c->output.capped;
    }
    c->output.residual = residual;
    c->output.capped = capped;
    c->status = status == KN_OK ? KN_BACKEND_OK : KN_BACKEND_DIVERGED;
}

static kn_backend_status cpu_wait(void *self, int64_t deadline_ns, kn_output *output)
{
    (void)deadline_ns; // ignore the deadline, because submit has already done the work
    cpu *c = self;
    *output = c->output;
    return c->status;
}

static const kn_state *cpu_state(void *self) { return ((cpu *)self)->state; }
static const kn_scratch *cpu_scratch(void *self) { return ((cpu *)self)->scratch; }

static void cpu_reset(void *self)
{
    cpu *c = self;
    kn_state_reset(c->model, c->state);
    if (c->fit) kn_contact_fit_reset(c->fit);
}

static void cpu_restore(void *self, const kn_state *state)
{
    cpu *c = self;
    kn_state_copy(c->model, c->state, state);
    if (c->fit) kn_contact_fit_reset(c->fit);
}

// The backend's function `contact`, used after kn_backend_cpu_identify was called.
static void cpu_contact(void *self, int p, kn_contact_unit unit[])
{
    kn_contact_fit_units(((cpu *)self)->fit, p, KN_CONTACT_UNITS, unit);
}

// Improve the contact models after the forces have been sent, unless the state has diverged.
static void cpu_afterwards(void *self)
{
    cpu *c = self;
    if (c->status == KN_BACKEND_OK) kn_contact_fit_iterate(c->fit, c->state, c->scratch);
}

bool kn_backend_cpu_identify(kn_backend *backend, kn_coupling device)
{
    cpu *c = backend->self;
    if (!c->fit) c->fit = kn_contact_fit_create(c->model, device);
    if (!c->fit) return false;
    backend->contact = cpu_contact;
    backend->afterwards = cpu_afterwards;
    return true;
}

void kn_backend_cpu_watch(kn_backend *backend, kn_fixed_watch watch)
{
    kn_fixed_watch_by(((cpu *)backend->self)->scratch, watch);
}

const kn_state *kn_backend_shape(const kn_backend *b) { return (b->shape ? b->shape : b->state)(b->self); }

static void cpu_destroy(void *self)
{
    cpu *c = self;
    if (!c) return;
    kn_contact_fit_destroy(c->fit);
    kn_state_destroy(c->state);
    kn_scratch_destroy(c->scratch);
    free(c);
}

// The backend owns state and scratch; the model is borrowed.
bool kn_backend_cpu(kn_backend *backend, const kn_model *model)
{
    int steps = kn_backend_steps(model->def.solver.dt_s);
    cpu *c = steps > 0 ? calloc(1, sizeof *c) : NULL;
    if (c) *c = (cpu){model, kn_state_create(model), kn_scratch_create(model), .steps = steps};
    if (!c || !c->state || !c->scratch) {
        cpu_destroy(c);
        return false;
    }
    *backend = (kn_backend){.name = model->fixed ? "fixed" : "cpu",
                            .self = c,
                            .submit = cpu_submit,
                            .wait = cpu_wait,
                            .state = cpu_state,
                            .scratch = cpu_scratch,
                            .reset = cpu_reset,
                            .restore = cpu_restore,
                            .destroy = cpu_destroy};
    return true;
}
