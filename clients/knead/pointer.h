#ifndef KN_CLIENTS_POINTER_H
#define KN_CLIENTS_POINTER_H
// Simulated hand that a pointer (a mouse or a finger on a touch screen) steers. It is used as the hand of a device
// (device.h). A wish states the wanted place, the button and the wanted depth. The hand turns a few dozen wishes per
// second into one pose per millisecond. The functions are pure, so that a test can play the part of kneadd.
//
//     wishes --> follow: hover above, come down, press, stroke, lift --> pose with bounded speed and acceleration
//     force  --> watch:  own watchdog of 20 ms, kneadd's latch --> let go: lift, then wait for the button to come up
//                        a fault that lifting does not clear: leave, and begin a new session
//
// The tool moves fast in the air only. It touches the object at the touch speed and presses at the press speed. Dough
// at rest is as hard as a wall, and a tool that runs into a wall trips the impulse guard. The contact of a round tool
// begins at a single point, so a round tool may arrive at its press speed. A flat tool must brake before it touches.
#include "clients/knead/hand.h"
#include "core/model.h"

typedef struct kn_pointer_wish { // wish of the user; positions are positions of the tool
    bool held;                   // somebody uses the tool; otherwise the hand lifts the tool and leaves
    bool pressed;                // the button is down
    int32_t press;    // number of the press; a new number while pressed means that the button was released in between
    double at_m[2];   // x and y; if they change while news.depth_m > 0, the tool strokes at constant depth
    double hover_z_m; // height clear of the object everywhere
    double touch_z_m; // z at which the tool, above at_m, touches the object as the press begins; used while pressed
    double flush_z_m; // z at which a flat tool touches the object everywhere; <= touch_z_m
    double depth_m;   // wanted depth below touch_z_m, >= 0
    int32_t event;    // number of the wish, rising; 0: none yet
    bool stale;       // the wish is too old: the tool is lifted and does not press before the button is released
} kn_pointer_wish;

typedef enum kn_pointer_mode {
    KN_POINTER_ABSENT, // the hand has left the tool: no poses are sent
    KN_POINTER_FOLLOW, // the tool follows the wishes
    KN_POINTER_LET_GO, // after a fault: lifting, and waiting for the fault to clear
    KN_POINTER_SILENT  // no poses, before a new session begins
} kn_pointer_mode;

typedef struct kn_pointer_news { // after one millisecond
    kn_pointer_mode mode;
    double force_n, depth_m; // magnitude of the force on the hand; depth below touch_z_m, 0 while not pressing
    int32_t flags, fault;    // flags and fault of the newest force; 0 if there is no force or the newest is too old
    bool contact;
    bool heard;    // kneadd answers
    bool released; // false: the button must be released before the tool presses again, for example after a fault
    int32_t event; // newest wish that kneadd has answered
    int64_t tick;  // tick of kneadd's answer to `event`
} kn_pointer_news;

typedef struct kn_pointer {
    bool flat; // the tool has a flat foot, see foot.h
    kn_pointer_wish wish;
    kn_pointer_mode mode;
    kn_watchdog watchdog;
    kn_hand_force force;
    kn_path_point point;
    int64_t session, seq;
    int mode_ms;
    double ground_m;     // lowest height of the tool in this press, at most touch_z_m; INFINITY: no press
    bool placed, barred; // placed: the position is set; barred: no press before the button is released
    int32_t asked_event; // wish that was sent with pose asked_seq and is not answered yet; 0: none
    int64_t asked_seq;
    kn_pointer_news news;
} kn_pointer;

// Initialise a pointer in mode ABSENT. shape: shape of its tool. session: the first session has the number session + 1,
// and the number of every later session is larger by one.
void kn_pointer_init(kn_pointer *pointer, kn_probe_shape shape, int64_t session);

// Advance by one ms and update pointer->news. wish: the newest wish, which may be the wish of the last call. force,
// elapsed_ms: as for kn_device_hand.
kn_hand_out kn_pointer_tick(kn_pointer *pointer, const kn_pointer_wish *wish, const kn_hand_force *force,
                            int elapsed_ms);

#endif
