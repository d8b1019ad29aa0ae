#ifndef KN_CLIENTS_TRIAL_H
#define KN_CLIENTS_TRIAL_H
// A trial: one small scene, one thing that is done to it, and what a solver makes of it beside the answer it should
// have given. `knead stability` is some thousands of these.
//
// Reference. The same scene, path and time step in f64, linearised again until the law itself is met and solved by
// conjugate gradients, both to 1e-7 of the step's own residual (where that is small: 1e-10 of the largest of the last
// second): the step that design and equations ask for, with no solver's error left in it.
//
//     solver error        |x - R(dt)| / |R(dt)|      what iterations, linearisation and f32 cost: this is judged
//     time-step error     |R(dt) - R(dt/2)| / |R(dt/2)|   what the step itself costs, for any solver; reported apart
//
// in the Euclidean norm over the force of all steps (where no probe is: over the way of the top), and over all nodes'
// displacements at the end of the pressing and at the end of all, whichever is worse, against the larger of the two.
//
// Judgements.
//     right        both errors below 5 %: a hand tells forces apart from 7 % on (Pang, Tan, Durlach 1991). Where the
//                  step itself costs more than that, below what it costs, those 7 % at most: a node that bounces off
//                  the plate once more or less is nobody's error
//     chattering   total variation over peak more than 1.5 times that of the calmer of R(dt), R(dt/2)
//     wrong        finite, calm and somewhere else
//     diverged     a number that is none, or a force a hundred times the reference's
//     refused      the model cannot be built, and the reason is a sentence
// An explicit method does not share the step's own error: it may be off by that of R(dt) besides, twice the above.
// Forces are averaged over a millisecond where steps are shorter, as a device gets them. No path is symmetric: rounding
// alone would decide which way a soft block buckles.
#include "core/step.h"

typedef enum kn_trial_hand {
    KN_HAND_PRESS, // down from just above, stay, and up again; at most 3 cm/s fast
    KN_HAND_JUMP,  // the same, but on the way down the pose is somewhere else for three steps' time
    KN_HAND_LOAD,  // a dead load on the top for half of the time
    KN_HAND_NONE   // left alone
} kn_trial_hand;

typedef struct kn_trial {
    kn_model_def def;
    kn_trial_hand hand;
    int steps;          // of def.solver.dt_s
    double depth_m;     // PRESS, JUMP: how far; less where the time is too short for it
    double jump_m[3];   // JUMP
    double strain;      // LOAD: what a body at rest would give way in that time
    double squeezed;    // V/V0 that the object's topmost cells begin with, 1: at rest; negative: inside out
    kn_simplices *mesh; // owned; def.mesh points at it
} kn_trial;

typedef enum kn_judgement {
    KN_TRIAL_RIGHT,
    KN_TRIAL_REFUSED,
    KN_TRIAL_CHATTERING,
    KN_TRIAL_WRONG,
    KN_TRIAL_DIVERGED,
    KN_TRIAL_DIED, // the process that tried it, before it came to a judgement
    KN_JUDGEMENTS
} kn_judgement;

// How a trial is solved. The first is what a scene gets that says nothing.
typedef enum kn_way { KN_WAY_DEFAULT, KN_WAY_SECANT, KN_WAY_TANGENT, KN_WAY_F64, KN_WAY_RK4, KN_WAYS } kn_way;

typedef struct kn_score {
    kn_judgement verdict;
    double force, shape, variation; // errors; total variation of the trace over the reference's
    char reason[120];               // of a refusal, or a death
} kn_score;

typedef struct kn_outcome {
    kn_score score[KN_WAYS];
    double step_error; // time-step error of the reference, the worse of force and shape
    bool loose;        // a step of the reference did not reach 1e-7
} kn_outcome;

extern const char *const kn_way_name[KN_WAYS];
extern const char *const kn_judgement_name[KN_JUDGEMENTS];

// Solves a trial in the ways of a bit mask and judges each; until it is judged a way has died. False: memory is short.
bool kn_trial_run(const kn_trial *trial, unsigned ways, kn_outcome *outcome);

void kn_trial_free(kn_trial *trial);

#endif
