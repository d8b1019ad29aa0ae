#ifndef KN_CLIENTS_POINTER_HAND_H
#define KN_CLIENTS_POINTER_HAND_H
// Simulated hand that a pointer (a mouse or a finger on a touch screen) steers. It is used as the hand of a device
// (virtual_hand.h). A wish states the wanted place, the button and the wanted depth. The hand turns a few dozen wishes
// per second into one pose per millisecond. The functions are pure, so that a test can play the part of kneadd.
//
//     wishes --> follow: hover above, come down, press, stroke, lift --> pose with bounded speed and acceleration
//     force  --> watch:  own watchdog of 20 ms, kneadd's latch --> let go: lift, then wait for the button to come up
//                        a fault that lifting does not clear: leave, and begin a new session
//
// The tool moves fast in the air only. It touches the object at the touch speed and presses at the press speed. Dough
// at rest is as hard as a wall, and a tool that runs into a wall trips the impulse guard. The contact of a round tool
// begins at a single point, so a round tool may arrive at its press speed. A flat tool must brake before it touches.
#include "clients/hand/tool_height.h"
#include "clients/hand/virtual_hand.h"
#include "core/model.h"

typedef struct kn_pointer_hand_wish { // what the user wants the tool to do; all positions are positions of the tool
    bool held;     // true: somebody uses the tool. false: the hand lifts the tool and ends its session
    bool pressed;  // true: the button of the mouse is down, or the finger touches the screen
    int32_t press; // number of the press; a new number while pressed means that the button was released in between
    // Wanted x and y of the tool. If they change during a press that has reached the object, or while the tool lies,
    // the tool moves sideways through the object.
    double at_m[2];
    double hover_z_m; // z of the hovering tool, where the tool does not touch the object
    // Height z at which the tool touches the object if it comes down at the place at_m. The height is computed when a
    // press begins, and used only while `pressed` is true. For a lying tool it is hover_z_m, so that the tool moves at
    // the speed of a press all the way down.
    double touch_z_m;
    double flush_z_m; // z at which a flat tool touches the object everywhere; <= touch_z_m
    double depth_m;   // wanted depth of the tool below touch_z_m, >= 0
    // Horizontal unit vector along which the tool lies, from its tip to its other end; 0, 0: the tool stands upright.
    // Only a round tool may lie.
    double axis[2];
    int32_t event; // number of this wish, larger than that of every earlier wish; 0: no wish yet
    // True: the wish is too old, so the tool is lifted and does not press before the button is released.
    bool stale;
} kn_pointer_hand_wish;

typedef enum kn_pointer_hand_mode {
    KN_POINTER_HAND_ABSENT, // the hand has let go of the tool, so no poses are sent
    KN_POINTER_HAND_FOLLOW, // the tool follows the user's wishes
    KN_POINTER_HAND_LET_GO, // after a fault, the hand lifts the tool and waits until kneadd clears the fault
    KN_POINTER_HAND_SILENT  // the hand sends no poses, so that kneadd ends the session; then a new session begins
} kn_pointer_hand_mode;

typedef struct kn_pointer_hand_news { // state of the hand after one millisecond
    kn_pointer_hand_mode mode;
    // force_n: magnitude of the force on the hand. depth_m: depth of the tool below touch_z_m; 0 if the tool does not
    // press, or lies.
    double force_n, depth_m;
    // Flags and fault in the newest force message; 0 if no force message has come for 20 ms.
    int32_t flags, fault;
    bool contact;
    bool presses;  // true: the tool presses, or comes down to press. false: it hovers, or rises
    bool there;    // true: the tool presses and is at its wanted height
    bool heard;    // true: kneadd answers the poses of this hand
    bool released; // false: the button must be released before the tool presses again, for example after a fault
    int32_t press; // number of the press that this state belongs to
    int32_t event; // number of the newest wish that kneadd has answered
    int64_t tick;  // tick in which kneadd answered the wish `event`
} kn_pointer_hand_news;

typedef struct kn_pointer_hand {
    bool flat; // true: the tool has a flat underside, see tool_height.h
    kn_pointer_hand_wish wish;
    kn_pointer_hand_mode mode;
    kn_watchdog watchdog;
    kn_hand_force force;
    kn_tool_path_point point;
    int64_t session, seq;
    int mode_ms;
    // Lowest z that the tool has reached in this press; not above touch_z_m. INFINITY: the tool is not pressing.
    double ground_m;
    // tilt: angle between the tool's axis and the vertical, rad. axis: wish.axis to which the tool turns or has turned.
    // opened_m: distance that a lying tool has moved outwards since the press ended.
    double tilt, axis[2], opened_m;
    // placed: true once `point` holds a position. barred: the tool must not press before the button is released.
    bool placed, barred;
    int32_t asked_event; // number of the wish that was sent with pose asked_seq and is not answered yet; 0: none
    int64_t asked_seq;
    kn_pointer_hand_news news;
} kn_pointer_hand;

// Initialise a pointer in mode ABSENT. shape: shape of the tool that the pointer moves. session: the first session has
// the number session + 1, and the number of every later session is larger by one.
void kn_pointer_hand_init(kn_pointer_hand *pointer, kn_probe_shape shape, int64_t session);

// Advance the hand by one ms and update pointer->news. wish: the newest wish of the user; the same wish may be passed
// again. force, elapsed_ms: as for kn_virtual_device_hand.
kn_hand_out kn_pointer_hand_tick(kn_pointer_hand *pointer, const kn_pointer_hand_wish *wish, const kn_hand_force *force,
                                 int elapsed_ms);

// Reach: translates the line of sight through the pointer into a wish for a tool. The wish contains the place and the
// height at which the tool hovers, the height at which the tool would touch the object, and the largest depth of a
// press.

typedef struct kn_pointer_hand_reach {
    const kn_model_def *def; // model of the scene; def and tool must outlive this struct
    const kn_probe_def *tool;
    uint8_t *top;       // one flag per vertex; 1: the vertex belongs to the top face (kn_tool_height_top)
    int vertices;       // number of vertices of the scene's mesh
    double extent_m[3]; // size of the undeformed object along x, y, z
} kn_pointer_hand_reach;

// Prepare the translation for one tool. Return false when memory is short.
bool kn_pointer_hand_reach_open(kn_pointer_hand_reach *reach, const kn_model_def *def, const kn_probe_def *tool);
void kn_pointer_hand_reach_close(kn_pointer_hand_reach *reach);

// Return true if the mesh is complete and belongs to the scene of `reach`. The functions below accept only a mesh for
// which this function returns true.
bool kn_pointer_hand_reach_fits(const kn_pointer_hand_reach *reach, const kn_mesh *mesh);
// Set wish->hover_z_m above the highest point of the mesh.
void kn_pointer_hand_reach_hover(const kn_pointer_hand_reach *reach, const kn_mesh *mesh, kn_pointer_hand_wish *wish);
// Set wish->at_m to the place where a line of sight meets the plane of the object's top. eye_m: eye point; sight:
// direction of the line, of any length. If the line does not meet the plane in front of the eye, leave the wish
// unchanged.
void kn_pointer_hand_reach_aim(const kn_pointer_hand_reach *reach, const float eye_m[3], const float sight[3],
                               kn_pointer_hand_wish *wish);
// Set wish->touch_z_m and wish->flush_z_m at wish->at_m. Return false if no part of the object is under the tool.
bool kn_pointer_hand_reach_touch(const kn_pointer_hand_reach *reach, const kn_mesh *mesh, kn_pointer_hand_wish *wish);
// Return the largest depth of a press below wish->touch_z_m, m. While nothing is pressed, return the largest depth
// below the top of the undeformed object.
double kn_pointer_hand_reach_deepest(const kn_pointer_hand_reach *reach, const kn_pointer_hand_wish *wish);

// Grip: translates two lines of sight into wishes for two round tools that lie on both sides of the object. The tools
// move in a vertical plane that goes through the object and faces the eye.

typedef struct kn_pointer_hand_grip {
    double middle_m[2]; // x and y of the object's middle when the grip began
    double axis[2];     // horizontal unit vector from the first tool to the second, in the plane
    // Set by the caller after kn_pointer_hand_grip_begin. closes: false: the tools stay beside the object; true: they
    // follow the pointers. lowest_m: a tool that has touched the object goes no lower than this z.
    bool closes;
    double lowest_m[2];
} kn_pointer_hand_grip;

// Begin a grip of an object. sight: directions of the two lines of sight. Return false if they are too steep to see a
// side of the object.
bool kn_pointer_hand_grip_begin(kn_pointer_hand_grip *grip, const kn_mesh *mesh, const float sight[2][3]);
// Set the places, heights and axes of both wishes. reach: of both tools. The wanted gap between the tips is at least
// half of the object's width at rest. The tips stay above the table. They come down below the object's top, and rise
// with it. If a line does not meet the plane in front of the eye, leave the wishes unchanged.
void kn_pointer_hand_grip_aim(const kn_pointer_hand_grip *grip, const kn_pointer_hand_reach *const reach[2],
                              const kn_mesh *mesh, const float eye_m[3], const float sight[2][3],
                              kn_pointer_hand_wish *const wish[2]);

#endif
