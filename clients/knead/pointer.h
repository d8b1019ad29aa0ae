#ifndef KN_CLIENTS_POINTER_H
#define KN_CLIENTS_POINTER_H
// The hand behind a pointer: it turns a few dozen wishes per second (there; press; this deep) into the pose of every
// millisecond, as a device's hand (device.h). Pure, so that a test can play kneadd.
//
//     wishes --> follow: hover above, come down, press, stroke, lift --> pose speed and acceleration bounded
//     force  --> watch:  own watchdog of 20 ms, kneadd's latch --> let go: lift; then wait for the button to come up;
//                        what lifting does not clear: it leaves, and a new session begins
//
// In the air the tool may be quick. It meets the object at touch speed and presses at press speed: dough at rest is a
// wall, and a tool that runs into a wall trips the impulse guard. A round one's contact begins with a point: it may
// come at press speed, a flat one must land.
#include "clients/knead/hand.h"
#include "core/model.h"

typedef struct kn_pointer_wish { // of the page; positions are the tool's
    bool held;                   // somebody uses it. Else the tool is lifted, and then it leaves
    bool pressed;
    int32_t press;    // number of the press: another one while pressed means that the button came up in between
    double at_m[2];   // x and y; another one while pressed, once news.depth_m > 0: a stroke at the depth that it has
    double hover_z_m; // clear of the object everywhere
    double touch_z_m; // where the tool touches the object at at_m as the press begins; looked at while pressed
    double flush_z_m; // <= touch_z_m: where a flat tool lies on all that is under it
    double depth_m;   // >= 0, below touch_z_m
    int32_t event;    // number of the wish, rising; 0: none yet
    bool stale;       // nobody has renewed it for long: a tool that presses lets go until the button has come up
} kn_pointer_wish;

typedef enum kn_pointer_mode {
    KN_POINTER_ABSENT, // it has left: no poses
    KN_POINTER_FOLLOW,
    KN_POINTER_LET_GO, // a fault: lifting, and waiting for it to clear
    KN_POINTER_SILENT  // before a new session
} kn_pointer_mode;

typedef struct kn_pointer_news { // of one millisecond
    kn_pointer_mode mode;
    double force_n, depth_m; // magnitude given to the hand; below touch_z_m, 0 while not pressing
    int32_t flags, fault;    // of the newest force, 0 when there is none or it is over
    bool contact;
    bool heard;    // kneadd answers
    bool released; // the fault has been met: false while the button must come up first
    int32_t event; // newest wish that kneadd has answered...
    int64_t tick;  // ...in this tick
} kn_pointer_news;

typedef struct kn_pointer {
    bool flat; // the tool's foot
    kn_pointer_wish wish;
    kn_pointer_mode mode;
    kn_watchdog watchdog;
    kn_hand_force force;
    kn_path_point point;
    int64_t session, seq;
    int mode_ms;
    double ground_m;     // where this press has met the object, or has pushed it to; INFINITY: no press
    bool placed, barred; // position is known; the button was down when a fault came
    int32_t asked_event; // wish of pose asked_seq, not answered yet; 0: none
    int64_t asked_seq;
    kn_pointer_news news;
} kn_pointer;

void kn_pointer_init(kn_pointer *pointer, kn_probe_shape shape, int64_t session);

// One ms. wish: the newest, may be the same again. force, elapsed_ms: as kn_device_hand. News are in pointer->news.
kn_hand_out kn_pointer_tick(kn_pointer *pointer, const kn_pointer_wish *wish, const kn_hand_force *force,
                            int elapsed_ms);

#endif
