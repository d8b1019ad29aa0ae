#include "core/level_plate.h"

#include <math.h>

void kn_level_plate_lower(kn_level_plate *plate, const kn_model *model, const kn_state *state)
{
    const double top_m = model->rest_m[model->top[0]][2], upright[4] = {1, 0, 0, 0};
    const double above[3] = {plate->x_m, plate->y_m, 2 * top_m};
    const double clear_m = kn_clearance(model, state, plate->probe, above, upright);
    plate->height_m = isfinite(clear_m) ? above[2] - clear_m : top_m;
    plate->velocity_m_s = plate->slope_n_s_m = 0;
}

// A search for the velocity of the plate.
typedef struct search {
    const kn_level_plate *plate;
    const kn_model *model;
    const kn_state *state;
    kn_state *trial;
    kn_scratch *scratch;
    kn_input input;
    kn_output output;
} search;

// Take the step with this velocity on the copy. Return the force on the plate, N, or NaN if the copy diverges.
static double force_at(search *s, double velocity_m_s)
{
    kn_probe_input *in = &s->input.probe[s->plate->probe];
    *in = (kn_probe_input){.attached = true,
                           .position_m = {s->plate->x_m, s->plate->y_m, s->plate->height_m},
                           .velocity_m_s = {0, 0, velocity_m_s}};
    kn_state_copy(s->model, s->trial, s->state);
    if (kn_step(s->model, s->trial, s->scratch, &s->input, &s->output) != KN_OK) return NAN;
    return s->output.probe[s->plate->probe].force_n[2];
}

// Return a first estimate of -dF/dv: the dashpots of the object between two plates, and its inertia.
static double first_slope(const kn_model *m, double load_n)
{
    const double h = fmax(m->def.spacing_m, 1e-6), viscous = m->law.a_pa_s * m->top_area_m2 / fmax(m->size_m, h);
    return fmax(viscous + kn_model_mass(m) / m->def.solver.dt_s, 1e-3 * load_n);
}

// Largest number of trials of a step. The secant method needs two or three; bisection alone would need about 40.
enum { TRIALS = 80 };
// A bracket of the velocity is empty if it moves the plate by less than this share of the object's height.
#define EMPTY 1e-9

// Take over the step of the last trial.
static kn_plate_status accept(search *s, kn_level_plate *plate, kn_state *state, double velocity_m_s, double slope,
                              kn_output *output)
{
    kn_state_copy(s->model, state, s->trial);
    plate->height_m += velocity_m_s * s->model->def.solver.dt_s;
    plate->velocity_m_s = velocity_m_s;
    if (slope < 0) plate->slope_n_s_m = slope;
    *output = s->output;
    return KN_PLATE_CARRIED;
}

kn_plate_status kn_level_plate_step(kn_level_plate *plate, const kn_model *model, kn_state *state, kn_state *trial,
                                    kn_scratch *scratch, double load_n, const kn_input *input, kn_output *output)
{
    search s = {.plate = plate, .model = model, .state = state, .trial = trial, .scratch = scratch, .input = *input};
    const double top_m = model->rest_m[model->top[0]][2], dt_s = model->def.solver.dt_s;
    const double lowest = (KN_LEVEL_PLATE_FLAT * top_m - plate->height_m) / dt_s;
    // over: velocity with too much force; under: velocity above it with too little. over_n, under_n: excess of the force
    // there.
    double over = -INFINITY, under = INFINITY, over_n = 0, under_n = 0;
    double v = plate->velocity_m_s, slope = plate->slope_n_s_m < 0 ? plate->slope_n_s_m : -first_slope(model, load_n);
    double reach = 1; // length of a trial without a bound on the other side, relative to the estimate
    int last = 0;     // side of the last trial: 1 over, -1 under
    for (int i = 0; i < TRIALS; i++) {
        const double excess_n = force_at(&s, v) - load_n;
        const bool both = isfinite(over) && isfinite(under), empty = both && (under - over) * dt_s < EMPTY * top_m;
        if (fabs(excess_n) <= KN_LEVEL_PLATE_TOLERANCE * load_n || (empty && excess_n < 0))
            return accept(&s, plate, state, v, both ? slope : 0, output);
        if (isnan(excess_n)) { // the step is too fast: go back towards rest, or to the middle of the bracket
            v = both ? 0.5 * (over + under) + 0.25 * (under - over) * (i % 2 ? 1 : -1) : 0.5 * v;
            continue;
        }
        // Illinois: if the same bound moves twice in a row, halve the excess at the other bound
        const int side = excess_n > 0 ? 1 : -1;
        if (side == last && side > 0) under_n *= 0.5;
        if (side == last && side < 0) over_n *= 0.5;
        last = side;
        if (side < 0 && v <= lowest) return KN_PLATE_FLAT;
        if (side > 0) over = v, over_n = excess_n;
        else under = v, under_n = excess_n;
        if (!isfinite(over) || !isfinite(under)) {
            // there is no bound on the other side yet: follow the estimate, each time twice as far
            v -= reach * excess_n / slope;
            reach *= 2;
        } else if ((under - over) * dt_s < EMPTY * top_m) {
            v = under;
        } else {
            slope = (over_n - under_n) / (over - under);
            v = over - over_n / slope;
        }
        v = fmax(v, lowest);
    }
    return KN_PLATE_DIVERGED;
}
