#ifndef KN_CLIENTS_SHAPE_PRESS_PROTOCOL_H
#define KN_CLIENTS_SHAPE_PRESS_PROTOCOL_H
// A press: the motion of the tools while they press the object, recorded for every tick. The press can be simulated on
// different models of the object. The results are the force on the tool in every tick and the surface of the object at
// a few times (moments).
//
// The default is the first paper's press: the tool moves down at 1 cm/s to 1 cm below the top of the object, stays for
// 30 s, and leaves. At time 0 the tool touches the top and begins to move down. Alternatively the poses are read from a
// log, as the server passed the poses to the lattice. The times are then those of `knead view --at` and
// `knead replay --csv`. These times also advance during cycles that the server missed, in which the lattice was not
// stepped. Successive ticks of a press are thus not always 1 ms apart.
#include "core/scene/scene.h"
#include "core/step.h"
#include "core/surface.h"

#define KN_PRESS_MOMENTS 4

typedef struct kn_press {
    int probe; // index of the probe whose force is compared
    int probes;
    int64_t ticks;         // number of ticks; the lattice is stepped by 1 ms in each tick
    double *time_s;        // [ticks] time at the end of each tick; the times rise
    kn_probe_input *input; // [ticks * probes] poses and velocities of all probes, tick by tick
    double *logged_n;      // [ticks] contact force from the log, upwards; NAN: not in the log; NULL: there is no log
    // time at which the tool begins to rise from its lowest position; positions within 0.1 mm count as the lowest
    double hold_end_s;
    double end_s; // time of the last tick
} kn_press;

typedef struct kn_press_def { // definition of a press; a field of 0 means its default
    // name of the pressing probe. NULL: without a log, the scene's first plate, or its first probe if there is no
    // plate; with a log, the first probe that touches the object
    const char *probe;
    double depth_m;   // depth of the press below the top; default 10 mm
    double speed_m_s; // speed of the tool; default 10 mm/s
    double hold_s;    // duration of the hold at the lowest position; default 30 s; < 0: no hold
} kn_press_def;

// Make a press, from the path of the first paper's press or from a log. Free the press with kn_press_free. On failure
// return false with one sentence in `error`.
bool kn_press_path(kn_press *press, const kn_scene *scene, const kn_press_def *def, char *error, size_t error_size);
bool kn_press_log(kn_press *press, const kn_scene *scene, const kn_press_def *def, const char *log, char *error,
                  size_t error_size);
void kn_press_free(kn_press *press); // the struct may be all zeros

// Return the first tick that ends at `time_s` or later, with a tolerance of half a tick, as `knead view --at` does. If
// all ticks end earlier, return the last tick.
int64_t kn_press_tick(const kn_press *press, double time_s);

typedef struct kn_pressed { // results of a simulated press; the arrays are owned
    double *force_n;        // [ticks] force on the probe, upwards
    int64_t ticks;          // number of simulated ticks
    int vertex_count;
    float (*shape_m[KN_PRESS_MOMENTS])[3]; // [vertex_count] positions of the surface's vertices at each moment
} kn_pressed;

// Settings of kn_press_run, which simulates the press on a model up to the time play->until_s. kn_press_run calls
// `told` after every second of the press; `told` may be NULL. kn_press_run returns false if the physics diverged or if
// memory runs out.
typedef struct kn_press_play {
    const kn_model *model;
    const kn_surface *surface; // surface of the model
    int moments;
    const double *moment_s;                // [moments] times at which the surface is stored
    double until_s;                        // time at which the simulation ends
    void (*told)(void *of, int64_t ticks); // ticks: number of ticks simulated since the last call
    void *of;                              // passed to `told`
} kn_press_play;
bool kn_press_run(const kn_press *press, const kn_press_play *play, kn_pressed *pressed);
void kn_pressed_free(kn_pressed *pressed); // the struct may be all zeros

#endif
