#ifndef KN_CLIENTS_PATH_H
#define KN_CLIENTS_PATH_H
// Where a virtual hand holds its tool, at every time. A path is a row of pieces:
//
//     STAND    at rest
//     LINE     from rest to rest: speed 0 -> v in 50 ms, v, v -> 0 in 50 ms; short ones keep the 50 ms and go slower
//     CURVE    cubic Hermite between two points with their velocities
//     SINE     down and up again, (1 - cos wt)/2, whole periods: begins and ends at rest
//
// Position and velocity are continuous over every joint, and the velocity is the exact derivative of the position: a
// plate in kneadd follows the velocity and is only corrected towards the position. Pure; SI; the scene's frame.
#include <stddef.h>

typedef struct kn_path_point {
    double position_m[3], velocity_m_s[3], orientation_wxyz[4];
} kn_path_point;

typedef enum kn_piece_kind { KN_PIECE_STAND, KN_PIECE_LINE, KN_PIECE_CURVE, KN_PIECE_SINE } kn_piece_kind;

typedef struct kn_piece {
    kn_piece_kind kind;
    const char *name; // what the hand is doing: "press"
    double start_s, duration_s;
    kn_path_point from; // velocity used by CURVE only
    kn_path_point to;   // SINE: the lowest point
    double periods;     // SINE
} kn_piece;

typedef struct kn_path {
    int count;
    kn_piece *piece; // start times rise, no gaps
    double duration_s;
    double hold_end_s; // of the piece "hold"; 0: the path has none
} kn_path;

typedef struct kn_path_def { // 0 in a field = its default
    double touch_z_m;        // the tool's z when it just touches the top of the object
    double uneven_m;         // >= 0: how much lower the lowest place under a flat tool is; it is reached slowly
    double clear_m;          // default 20 mm: height above touch_z_m where a path begins and ends
    double depth_m;          // default press 10 mm, poke 3 mm, sine KN_PATH_SWING_M
    double speed_m_s;    // default press 10 mm/s, poke 50 mm/s: in the object; through the air a path goes at 30 mm/s
    double hold_s;       // press: at the lowest point; sine: how long it swings. Here < 0 is the default, 4 s
    double frequency_hz; // sine: default KN_PATH_SWING_HZ
} kn_path_def;

#define KN_PATH_LONGEST_S 86400.0 // a day: whoever plays a path looks at every millisecond of it
#define KN_PATH_RAMP_S 0.05
#define KN_PATH_SWING_M 0.001
#define KN_PATH_SWING_HZ 2.0
#define KN_PATH_AIR_M_S 0.03

// Allocate; NULL when memory is short.
// press: down through the air, touch at rest, press, hold, withdraw, rest 1 s.  poke: fast from the air, out, rest 1 s.
// sine: touch at rest, swing between the surface and depth_m below it, withdraw, rest 1 s.
kn_path *kn_path_press(const kn_path_def *def);
kn_path *kn_path_poke(const kn_path_def *def);
kn_path *kn_path_sine(const kn_path_def *def);

// Smooth through count >= 2 points at rising times, at rest at both ends. Fills the points' velocities.
kn_path *kn_path_through(int count, const double time_s[], kn_path_point point[]);

// Rows `time_s,x_m,y_m,z_m` or `time_s,x_m,y_m,z_m,qw,qx,qy,qz` under a header line that says so, for
// kn_path_through. NULL and one line `file:line:col: ...` in error.
kn_path *kn_path_load(const char *file, char *error, size_t error_size);
void kn_path_destroy(kn_path *path); // NULL is fine
double kn_path_distance(const double a[3], const double b[3]);

// Point at t_s from the path's begin, held at both ends. The piece it lies in is returned.
const kn_piece *kn_path_at(const kn_path *path, double t_s, kn_path_point *point);

// Way out for a tool that is anywhere at any speed: stops in 50 ms, lifts to z_m straight up, goes to `to` at rest.
// Fills piece[4] of caller memory and makes *path of it; allocates nothing.
void kn_path_retreat(kn_path *path, kn_piece piece[4], const kn_path_point *from, double z_m, const kn_path_point *to);

#endif
