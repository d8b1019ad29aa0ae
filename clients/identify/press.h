#ifndef KN_CLIENTS_IDENTIFY_PRESS_H
#define KN_CLIENTS_IDENTIFY_PRESS_H
// What a hand did to an object, tick by tick, so that it can be done again to another model of it; and what came of it:
// the force on the tool in every tick, the surface at a few moments.
//
// By default the first paper's press: the tool comes down at 1 cm/s to 1 cm below the top, stays for 30 s, and leaves.
// Time 0 is when it begins to come down, touching. Or the poses of a log, as its server gave them to the lattice. Its
// times are those of `knead view --at` and `knead replay --csv`, which go on while a server misses cycles; the lattice
// stood still then, so that ticks of 1 ms each are not 1 ms apart everywhere.
#include "core/scene/scene.h"
#include "core/step.h"
#include "core/surface.h"

#define KN_PRESS_MOMENTS 4

typedef struct kn_press {
    int probe; // whose force counts
    int probes;
    int64_t ticks;         // of 1 ms
    double *time_s;        // [ticks] at the end of each; rising
    kn_probe_input *input; // [ticks * probes]
    double *logged_n;      // [ticks] contact force of a log, upwards; NAN: it has none; NULL: no log
    double hold_end_s;     // when the tool begins to rise from its lowest place, give or take 0.1 mm
    double end_s;
} kn_press;

typedef struct kn_press_def { // 0 in a field: its default
    const char *probe;        // name; NULL: the first plate, else the first probe; of a log the first that is held
    double depth_m;           // 10 mm
    double speed_m_s;         // 10 mm/s
    double hold_s;            // 30 s; < 0: none
} kn_press_def;

// Allocate. False and one sentence in error.
bool kn_press_path(kn_press *press, const kn_scene *scene, const kn_press_def *def, char *error, size_t error_size);
bool kn_press_log(kn_press *press, const kn_scene *scene, const kn_press_def *def, const char *log, char *error,
                  size_t error_size);
void kn_press_free(kn_press *press); // zeroed is fine

// The first tick that ends then or later, to half a tick, as `knead view --at` finds it; else the last.
int64_t kn_press_tick(const kn_press *press, double time_s);

typedef struct kn_pressed { // owned
    double *force_n;        // [ticks] on the probe, upwards
    int64_t ticks;          // that were played
    int vertex_count;
    float (*shape_m[KN_PRESS_MOMENTS])[3]; // [vertex_count] of kn_surface, at each moment
} kn_pressed;

// Plays the press on that model, until until_s at the most. told: after every second of it, may be NULL. False: the
// physics went bad, or memory is short.
typedef struct kn_press_play {
    const kn_model *model;
    const kn_surface *surface; // of that model
    int moments;
    const double *moment_s; // [moments]
    double until_s;
    void (*told)(void *of, int64_t ticks); // how many more
    void *of;
} kn_press_play;
bool kn_press_run(const kn_press *press, const kn_press_play *play, kn_pressed *pressed);
void kn_pressed_free(kn_pressed *pressed); // zeroed is fine

#endif
