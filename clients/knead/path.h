#ifndef KN_CLIENTS_PATH_H
#define KN_CLIENTS_PATH_H
// Path of a virtual hand: the pose of its tool at every time. A path is a sequence of pieces:
//
//     STAND    the tool stays at rest
//     LINE     straight line from rest to rest. The speed rises from 0 to v in 50 ms, stays at v, and falls to 0 in
//              50 ms. On a short line v is lower and the two ramps still take 50 ms each
//     CURVE    cubic Hermite curve between two points with given velocities
//     SINE     straight down and up again, depth ~ (1 - cos wt)/2, in whole periods: begins and ends at rest
//
// Position and velocity are continuous where two pieces meet, and the velocity is the exact derivative of the position.
// Both matter, because kneadd moves a plate with the velocity and only corrects the plate towards the position. All
// functions are pure, use SI units and the frame of the scene.
#include <stddef.h>

typedef struct kn_path_point {
    double position_m[3], velocity_m_s[3], orientation_wxyz[4];
} kn_path_point;

typedef enum kn_piece_kind { KN_PIECE_STAND, KN_PIECE_LINE, KN_PIECE_CURVE, KN_PIECE_SINE } kn_piece_kind;

typedef struct kn_piece {
    kn_piece_kind kind;
    const char *name; // action of the hand: "press"
    double start_s, duration_s;
    kn_path_point from; // velocity_m_s is used by CURVE only
    kn_path_point to;   // SINE: the lowest point
    double periods;     // SINE
} kn_piece;

typedef struct kn_path {
    int count;
    kn_piece *piece; // start times rise without gaps
    double duration_s;
    // End of the piece "hold", s. 0: the path has no hold.
    double hold_end_s;
} kn_path;

typedef struct kn_path_def { // 0 in a field selects its default, except hold_s
    double touch_z_m;        // z of the tool when it first touches the top of the object
    double uneven_m;         // >= 0: from touch_z_m down to the lowest place under a flat tool; sunk through slowly
    double clear_m;          // height above touch_z_m at the begin and end of the path; default 20 mm
    double depth_m;          // default: press 10 mm, poke 3 mm, sine KN_PATH_SWING_M
    // Speed inside the object. Default: press 10 mm/s, poke 50 mm/s. Through the air a path moves at KN_PATH_AIR_M_S,
    // 30 mm/s.
    double speed_m_s;
    // press: time at the lowest point; sine: time of swinging. A value < 0 selects the default of 4 s.
    double hold_s;
    double frequency_hz; // sine only; default KN_PATH_SWING_HZ
} kn_path_def;

// Longest path, one day. The limit is needed because every millisecond of a path is evaluated.
#define KN_PATH_LONGEST_S 86400.0
#define KN_PATH_RAMP_S 0.05   // time in which a LINE accelerates, and time in which it brakes
#define KN_PATH_SWING_M 0.001 // depth of a sine by default
#define KN_PATH_SWING_HZ 2.0  // frequency of a sine by default
#define KN_PATH_AIR_M_S 0.03  // speed through the air

// Allocate a path. The caller destroys it. Return NULL when memory is short.
// press: go down through the air, touch the object at rest, press, hold, withdraw, rest for 1 s.
// poke:  go fast from the air into the object and out again, rest for 1 s.
// sine:  touch the object at rest, swing between the surface and depth_m below the surface, withdraw, rest for 1 s.
kn_path *kn_path_press(const kn_path_def *def);
kn_path *kn_path_poke(const kn_path_def *def);
kn_path *kn_path_sine(const kn_path_def *def);

// Allocate a smooth path through `count` >= 2 points at rising times. The path is at rest at both ends. The function
// also writes the velocities of the points to point[].velocity_m_s.
kn_path *kn_path_through(int count, const double time_s[], kn_path_point point[]);

// Load a path from a CSV file and smooth it with kn_path_through. A header line names the columns, either
// `time_s,x_m,y_m,z_m` or `time_s,x_m,y_m,z_m,qw,qx,qy,qz`. Return NULL and one line `file:line:col: ...` in error.
kn_path *kn_path_load(const char *file, char *error, size_t error_size);
void kn_path_destroy(kn_path *path); // NULL is fine
// Return the distance between two points, m.
double kn_path_distance(const double a[3], const double b[3]);

// Write the point at t_s after the begin of the path. Before the begin and after the end, write the first or last
// point. Return the piece at t_s.
const kn_piece *kn_path_at(const kn_path *path, double t_s, kn_path_point *point);

// Make a path that takes a tool out of the object from any pose and speed: stop in 50 ms, lift straight up to `z_m`, go
// to `to`, rest there. The path uses the caller's array `piece`, which must outlive it. Nothing is allocated.
void kn_path_retreat(kn_path *path, kn_piece piece[4], const kn_path_point *from, double z_m, const kn_path_point *to);

#endif
