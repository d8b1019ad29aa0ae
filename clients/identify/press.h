#ifndef KN_CLIENTS_IDENTIFY_PRESS_H
#define KN_CLIENTS_IDENTIFY_PRESS_H
// A press: the recorded motion of the tools, tick by tick. It can be repeated on other models of the object. The
// results are the force on the tool in every tick and the surface of the object at a few times (moments).
//
// The default is the first paper's press: the tool comes down at 1 cm/s to 1 cm below the top, stays for 30 s, and
// leaves. At time 0 the tool touches the top and begins to come down. Alternatively the poses come from a log, as the
// server passed them to the lattice. The times are then those of `knead view --at` and `knead replay --csv`. These
// times advance while a server misses cycles, but the lattice is not stepped then. Successive ticks are thus not always
// 1 ms apart.
#include "core/scene/scene.h"
#include "core/step.h"
#include "core/surface.h"

#define KN_PRESS_MOMENTS 4

typedef struct kn_press {
    int probe; // index of the probe whose force is compared
    int probes;
    int64_t ticks;         // number of ticks, of 1 ms each
    double *time_s;        // [ticks] time at the end of each tick; rising
    kn_probe_input *input; // [ticks * probes]
    double *logged_n;      // [ticks] contact force from the log, upwards; NAN: not logged; NULL: no log
    double hold_end_s;     // time at which the tool begins to rise from its lowest position (found to within 0.1 mm)
    double end_s;
} kn_press;

typedef struct kn_press_def { // a field of 0 means the default
    const char *probe;        // name; NULL: the first plate, else the first probe; in a log the first one that touches
    double depth_m;           // 10 mm
    double speed_m_s;         // 10 mm/s
    double hold_s;            // 30 s; < 0: no hold
} kn_press_def;

// Make a press from the paper's path or from a log; free it with kn_press_free. Return false with one sentence in
// error.
bool kn_press_path(kn_press *press, const kn_scene *scene, const kn_press_def *def, char *error, size_t error_size);
bool kn_press_log(kn_press *press, const kn_scene *scene, const kn_press_def *def, const char *log, char *error,
                  size_t error_size);
void kn_press_free(kn_press *press); // a zeroed struct is fine

// Return the first tick that ends at `time_s` or later, with a tolerance of half a tick, as `knead view --at` does. If
// there is none, return the last tick.
int64_t kn_press_tick(const kn_press *press, double time_s);

typedef struct kn_pressed { // results of a press; owned
    double *force_n;        // [ticks] force on the probe, upwards
    int64_t ticks;          // number of ticks played
    int vertex_count;
    float (*shape_m[KN_PRESS_MOMENTS])[3]; // [vertex_count] positions of kn_surface at each moment
} kn_pressed;

// Play the press on a model, up to `until_s`. The callback `told` is called after every second of the press and may be
// NULL. Return false if the physics diverged, or if memory runs out.
typedef struct kn_press_play {
    const kn_model *model;
    const kn_surface *surface; // surface of the model
    int moments;
    const double *moment_s; // [moments]
    double until_s;
    void (*told)(void *of, int64_t ticks); // `ticks`: number of ticks since the last call
    void *of;
} kn_press_play;
bool kn_press_run(const kn_press *press, const kn_press_play *play, kn_pressed *pressed);
void kn_pressed_free(kn_pressed *pressed); // a zeroed struct is fine

#endif
