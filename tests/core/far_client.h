#ifndef KN_TESTS_CORE_FAR_CLIENT_H
#define KN_TESTS_CORE_FAR_CLIENT_H
// A lattice whose contact is identified, and two clients 30 ms away that render it: the units, and their resultant.
#include "core/algebra/algebra.h"
#include "core/contact_fit.h"
#include "tests/dice.h"
#include "tests/lattice.h"

#define LAG 30 // ms between a pose and the units that answer it
#define TOP_M 0.030
#define K_VC 800.0
#define B_VC 2.0

typedef struct pose {
    double x[3], v[3], turn[4];
} pose;
typedef pose (*gesture)(const double how[3], double t);

typedef struct rig {
    lattice near, far; // near: receives every pose at once, or is not there; far: receives the poses that are not lost
    kn_contact_fit *fit;
    kn_contact_model client[2];
    kn_contact_unit unit[2][LAG + 1][KN_CONTACT_UNITS]; // on their way to the clients
    int64_t tick, heard;                                // heard: newest pose that reached the server
    double loss; // loss rate of poses and of units; losses come in bursts of three on average
    bool lost[2];
    uint64_t random;
    double force_n[2][3]; // of the clients
} rig;

static inline rig *rig_make(kn_model_def def, bool near)
{
    rig *r = calloc(1, sizeof *r);
    bool coupled = def.probe[0].coupling_n_m > 0; // a rigid tool is rendered behind the device's own coupling
    kn_contact_model_def client = {.session = 7,
                                   .force_limit_n = 40,
                                   .stiffness_n_m = coupled ? def.probe[0].coupling_n_m : K_VC,
                                   .damping_n_s_m = coupled ? def.probe[0].coupling_n_s_m : B_VC};
    r->far = lattice_of(def);
    if (near) r->near = lattice_of(def);
    r->fit = kn_contact_fit_create(r->far.model, (kn_coupling){K_VC, B_VC});
    for (int i = 0; i < 2; i++) kn_contact_model_init(&r->client[i], &client);
    return r;
}

static inline void rig_free(rig *r)
{
    kn_contact_fit_destroy(r->fit);
    lattice_end(&r->near), lattice_end(&r->far);
    free(r);
}

OWNS(rig, rig_free)

static inline bool lose(rig *r, int way)
{
    return r->lost[way] = kn_dice(&r->random) < (r->lost[way] ? 2.0 / 3.0 : r->loss / (1 - r->loss) / 3.0);
}

static inline const kn_contact_unit *newest(const rig *r) { return r->unit[0][(r->tick - 1) % (LAG + 1)]; }

// Send the units to client i, which takes those of LAG ms before and renders the force of now.
static inline void rig_render(rig *r, int i, const pose *p, bool lost)
{
    kn_contact_unit *unit = r->unit[i][r->tick % (LAG + 1)];
    const kn_contact_unit *came = r->unit[i][(r->tick + 1) % (LAG + 1)];
    kn_contact_fit_units(r->fit, 0, i ? 1 : KN_CONTACT_UNITS, unit);
    for (int c = 0; c < KN_CONTACT_UNITS; c++) {
        unit[c].session = lost ? 0 : 7; // session 0 belongs to nobody, so the client refuses the unit
        unit[c].utime = r->tick;
        unit[c].pose_seq = r->heard;
        unit[c].flags = KN_CONTACT_ENGAGED;
    }
    kn_contact_model_turn(&r->client[i], p->turn);
    kn_contact_model_pose(&r->client[i], r->tick, p->x, p->v);
    for (int c = 0; c < KN_CONTACT_UNITS && r->tick >= LAG && (c == 0 || c < came->contact_count); c++)
        kn_contact_model_take(&r->client[i], &came[c]);
    kn_contact_model_render(&r->client[i], 1e-3, p->x, p->v, r->force_n[i]);
}

// Run one tick of the server and of the clients.
static inline void rig_step(rig *r, const pose *p)
{
    kn_probe_input in = {.attached = true};
    memcpy(in.position_m, p->x, sizeof p->x);
    memcpy(in.velocity_m_s, p->v, sizeof p->v);
    memcpy(in.orientation_wxyz, p->turn, sizeof p->turn);
    if (r->tick == 0 || !lose(r, 0)) r->far.in.probe[0] = in, r->heard = r->tick; // else the last pose stays in use
    r->near.in.probe[0] = in;
    if (r->near.model) step(&r->near);
    step(&r->far);
    kn_contact_fit_step(r->fit, r->far.state, r->far.scratch, &r->far.in, &r->far.out);
    bool lost = lose(r, 1);
    for (int i = 0; i < 2; i++) rig_render(r, i, p, lost);
    kn_contact_fit_iterate(r->fit, r->far.state, r->far.scratch);
    r->tick++;
}

// Errors of the units, of the resultant, and of the last message held, relative to the lattice's immediate answers, rms.
typedef struct played {
    double force[3], torque[3];
    double jump_n;                  // 99 % of the changes in 1 ms of the units' force are smaller
    int sets[KN_CONTACT_UNITS + 1]; // number of ticks with so many units
} played;

// Play a path, and compare from the tick `from` on.
static inline played play(rig *r, gesture follow, const double how[3], int from, int ticks)
{
    played all = {.jump_n = 0};
    double past[LAG][6] = {{0}}, size[2] = {0}, last[3] = {0}, jump[4000];
    for (int n = 0; n < ticks; n++) {
        pose p = follow(how, 1e-3 * n);
        rig_step(r, &p);
        const kn_probe_output *now = r->near.model ? &r->near.out.probe[0] : &r->far.out.probe[0];
        double *held = past[n % LAG], change = 0;
        all.sets[newest(r)->contact_count]++;
        for (int k = 0; k < 3 && n >= from; k++) {
            const double *force[3] = {r->force_n[0], r->force_n[1], held};
            const double *torque[3] = {r->client[0].torque_n_m, r->client[1].torque_n_m, held + 3};
            for (int i = 0; i < 3; i++) {
                all.force[i] += pow(force[i][k] - now->force_n[k], 2);
                all.torque[i] += pow(torque[i][k] - now->torque_n_m[k], 2);
            }
            size[0] += pow(now->force_n[k], 2), size[1] += pow(now->torque_n_m[k], 2);
            change += pow(r->force_n[0][k] - last[k], 2);
        }
        if (n >= from) jump[n - from] = n > from ? sqrt(change) : 0;
        memcpy(last, r->force_n[0], sizeof last);
        memcpy(held, now->force_n, sizeof now->force_n);
        memcpy(held + 3, now->torque_n_m, sizeof now->torque_n_m);
    }
    for (int i = 0; i < 3; i++)
        all.force[i] = sqrt(all.force[i] / size[0]), all.torque[i] = sqrt(all.torque[i] / size[1]);
    qsort(jump, (size_t)(ticks - from), sizeof *jump, kn_ascending);
    all.jump_n = jump[(ticks - from) * 99 / 100];
    printf("     %g %g %g, %.0f %% lost: force %.1f %% off, resultant %.1f, held %.1f; torque %.1f, %.1f, %.1f; 99 %% "
           "below %.3f N/ms\n",
           how[0], how[1], how[2], 100 * r->loss, 100 * all.force[0], 100 * all.force[1], 100 * all.force[2],
           100 * all.torque[0], 100 * all.torque[1], 100 * all.torque[2], all.jump_n);
    return all;
}

#endif
