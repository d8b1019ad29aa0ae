#ifndef KN_CLIENTS_TOOL_PATH_H
#define KN_CLIENTS_TOOL_PATH_H
// Path of a virtual hand: the pose of its tool at every time. A path is a sequence of pieces:
//
//     STAND    the tool stays at rest
//     LINE     straight line from rest to rest. The speed rises from 0 to v in 50 ms, stays at v, and falls to 0 in
//              50 ms. On a short line v is lower and the two ramps still take 50 ms each
//     CURVE    cubic Hermite curve between two points with given velocities
//     SINE     straight down and up again, depth ~ (1 - cos wt)/2, in whole periods: begins and ends at rest
//
// Position and velocity are continuous where two pieces meet, and the velocity is the exact derivative of the position.
// kneadd needs both properties, because it moves a plate with the velocity of the path and only corrects the plate
// towards the position. All functions are pure. They use SI units and the coordinates of the scene.
#include <stddef.h>

typedef struct kn_tool_path_point {
    double position_m[3], velocity_m_s[3], orientation_wxyz[4];
} kn_tool_path_point;

typedef enum kn_tool_path_piece_kind {
    KN_TOOL_PATH_PIECE_STAND,
    KN_TOOL_PATH_PIECE_LINE,
    KN_TOOL_PATH_PIECE_CURVE,
    KN_TOOL_PATH_PIECE_SINE
} kn_tool_path_piece_kind;

typedef struct kn_tool_path_piece {
    kn_tool_path_piece_kind kind;
    const char *name; // action of the hand during this piece of the path, such as "press"
    double start_s, duration_s;
    kn_tool_path_point from; // point where the piece begins; only a CURVE uses its velocity_m_s
    kn_tool_path_point to;   // point where the piece ends; for a SINE, its lowest point
    double periods;          // number of periods of a SINE
} kn_tool_path_piece;

typedef struct kn_tool_path {
    int count;
    kn_tool_path_piece *piece; // pieces of the path in order of time; each piece starts when the previous one ends
    double duration_s;
    // Time at which the piece named "hold" ends [s]. 0: the path has no such piece.
    double hold_end_s;
} kn_tool_path;

typedef struct kn_tool_path_def { // a field of 0 selects its default, except hold_s
    double touch_z_m;             // z of the tool when it first touches the top of the object
    // Vertical distance from touch_z_m down to the lowest place of the object's top under a flat tool, >= 0. The tool
    // sinks slowly through this distance.
    double uneven_m;
    double clear_m; // height of the tool above touch_z_m at both ends of the path; default 20 mm
    double depth_m; // depth of the tool below touch_z_m; default: press 10 mm, poke 3 mm, sine KN_TOOL_PATH_SWING_M
    // Speed of the tool inside the object. Default: press 10 mm/s, poke 50 mm/s. Through the air the tool moves at
    // KN_TOOL_PATH_AIR_M_S (30 mm/s).
    double speed_m_s;
    // For a press: time that the tool stays at the lowest point. For a sine: time that the tool swings. A value < 0
    // selects the default of 4 s.
    double hold_s;
    double frequency_hz; // frequency of a sine; default KN_TOOL_PATH_SWING_HZ
} kn_tool_path_def;

// Longest duration of a path: one day. A limit is needed, because the program evaluates every millisecond of a path.
#define KN_TOOL_PATH_LONGEST_S 86400.0
#define KN_TOOL_PATH_RAMP_S 0.05   // time in which a LINE accelerates, and time in which it brakes
#define KN_TOOL_PATH_SWING_M 0.001 // default depth of a sine path
#define KN_TOOL_PATH_SWING_HZ 2.0  // default frequency of a sine path
#define KN_TOOL_PATH_AIR_M_S 0.03  // speed of a virtual hand through the air

// The three functions below allocate a path, which the caller destroys. They return NULL when memory is short.
// press: go down through the air, touch the object at rest, press, hold, withdraw, rest for 1 s.
// poke:  go fast from the air into the object and out again, rest for 1 s.
// sine:  touch the object at rest, swing between the surface and depth_m below the surface, withdraw, rest for 1 s.
kn_tool_path *kn_tool_path_press(const kn_tool_path_def *def);
kn_tool_path *kn_tool_path_poke(const kn_tool_path_def *def);
kn_tool_path *kn_tool_path_sine(const kn_tool_path_def *def);

// Allocate a smooth path through `count` >= 2 points at rising times. The tool is at rest at both ends of the path. The
// function also writes the velocities of the points to point[].velocity_m_s.
kn_tool_path *kn_tool_path_through(int count, const double time_s[], kn_tool_path_point point[]);

// Load a path from a CSV file and smooth it with kn_tool_path_through. A header line names the columns, either
// `time_s,x_m,y_m,z_m` or `time_s,x_m,y_m,z_m,qw,qx,qy,qz`. Return NULL and one line `file:line:col: ...` in error.
kn_tool_path *kn_tool_path_load(const char *file, char *error, size_t error_size);
void kn_tool_path_destroy(kn_tool_path *path); // frees a path; NULL is allowed
// Return the distance between two points, m.
double kn_tool_path_distance(const double a[3], const double b[3]);

// Write to `point` the pose and velocity of the tool `t_s` after the beginning of the path. For a time before the path,
// write its first point; for a time after the path, its last point. Return the piece of the path at this time.
const kn_tool_path_piece *kn_tool_path_at(const kn_tool_path *path, double t_s, kn_tool_path_point *point);

// Make a path that takes a tool out of the object from any pose and speed: stop in 50 ms, lift straight up to `z_m`, go
// to `to`, rest there. The path uses the caller's array `piece`, which must outlive it. Nothing is allocated.
void kn_tool_path_retreat(kn_tool_path *path, kn_tool_path_piece piece[4], const kn_tool_path_point *from, double z_m,
                          const kn_tool_path_point *to);

#endif
