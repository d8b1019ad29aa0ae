#ifndef KN_CLIENTS_PAGE_TOOL_H
#define KN_CLIENTS_PAGE_TOOL_H
// The tool that the pages of `knead web` move. This module chooses the tool and the page that has it, and turns the
// pointer of this page into wishes to the device's thread, which makes poses at 1 kHz. At most one page has the tool at
// a time. All functions are called by the main thread.
//
//     kn_page_tool_point -> wish -> (device's thread: pose, force) -> sample -> kn_page_tool_listen
//
// In a scene with two round tools, two fingers on a touch screen grip the object. A second hand then moves the other
// tool. It has no owner, button or trace of its own: both tools are held, and let go, together.
//
//     approach    both tools move beside the object, lie down with their tips towards it, and come down
//     close       each tip follows its finger; the gap between the tips keeps half of the object's width
//     open        a finger left, a fault, or one tip lost the object: the tools open, rise, and wait for both fingers to
//                 leave
#include "clients/hand/virtual_hand.h"
#include "clients/hand/live_server.h"
#include "clients/hand/pointer_hand.h"
#include "clients/web/gateway.h"
#include "server/mailbox.h"
#include "server/ring.h"

#define KN_PAGE_TOOL_TRACE 1024  // number of force samples kept for the pages, one sample per ms
#define KN_PAGE_TOOL_LOST_MS 100 // a tip of a grip that feels nothing for this time has lost the object
#define KN_PAGE_TOOL_EVENTS 64   // largest number of pointer events that wait at once for an answer of kneadd

// State of the pointer's button. BESIDE: pressed beside the object. BARRED: still pressed, but ignored until it is
// released. GRIPS: two fingers grip with two tools. STEEP: two fingers want to grip, but the view is too steep.
typedef enum kn_button {
    KN_BUTTON_UP,
    KN_BUTTON_PRESSES,
    KN_BUTTON_BESIDE,
    KN_BUTTON_BARRED,
    KN_BUTTON_GRIPS,
    KN_BUTTON_STEEP
} kn_button;

typedef struct kn_page_tool_sample { // state of the tool in one millisecond, from the device's thread
    kn_pointer_hand_news news;
    // Values from the newest force message: work of the hand on the object, and round trip time. NaN: no force arrived
    // in this millisecond.
    float work_mj, round_trip_ms;
} kn_page_tool_sample;

typedef struct kn_page_hand { // a hand that moves one tool
    const kn_probe_def *def;  // the tool in the scene of `live`; NULL: none
    kn_pointer_hand_reach reach;
    bool moving;               // true: the device's thread is running
    char error[512];           // reason why the device's thread does not run
    kn_pointer_hand_wish wish; // newest wish
    kn_pointer_hand_news news; // state of the hand in the newest sample
    // The fields below are used by page_tool.c only. held: copy of *def; held_spacing_m: spacing of the nodes. When a
    // next scene comes, its tool and spacing are compared with these copies, because the old scene has been freed by
    // then.
    kn_probe_def held;
    double held_spacing_m;
    kn_virtual_device device;
    kn_pointer_hand pointer; // used by the device's thread only
    int stale_ms;            // time since the last new wanted motion; used by the device's thread only
    kn_mailbox wishes; // wanted motions of the tool (kn_pointer_hand_wish), from the main thread to the device's thread
    kn_pointer_hand_wish wish_slots[3];
    kn_ring samples; // queue of kn_page_tool_sample from the device's thread to the main thread
    int lost_ms;     // number of samples in a row without contact, at most KN_PAGE_TOOL_LOST_MS
} kn_page_hand;

typedef struct kn_page_tool {
    // Set by the caller. probe: name of the wanted probe, or NULL; url: bus of the poses.
    const char *probe, *url;
    kn_gateway *gateway;
    kn_live_server *live;
    // State, read by other modules. hand[1]: hand of the second tool of a grip; its def is NULL if the scene has none.
    kn_page_hand hand[2];
    kn_page_tool_sample trace[KN_PAGE_TOOL_TRACE];
    uint64_t traced;  // number of samples received so far; sample n is trace[n % KN_PAGE_TOOL_TRACE]
    int owner;        // index of the page that has the tool, -1: none
    kn_button button; // state of the pointer's button on the page that has the tool
    int lent;         // number of the recording that is being played and moves the tool, 0: none
    // The fields below are used by page_tool.c only. scene: scene to which the hands belong; it may have been freed
    // already, so only its address is compared. scene_hash: hash of the scene's text.
    const kn_scene *scene;
    uint64_t scene_hash;
    kn_pointer_hand_grip grip;
    bool met; // both tips of the grip have touched the object
    // Pointer events whose effect no picture has shown yet. tick: tick in which kneadd answered the event; INT64_MAX:
    // not answered yet.
    struct {
        uint32_t number;
        int page;
        int64_t tick;
    } event[KN_PAGE_TOOL_EVENTS];
} kn_page_tool;

// Prepare a tool, which must be zeroed except for the fields of the caller. Return false if memory is short.
bool kn_page_tool_open(kn_page_tool *tool);

// Adapt to the scene of `live`: choose the tool, and restart the hand unless it can continue. Return true if the scene
// is a new one.
bool kn_page_tool_scene(kn_page_tool *tool);
void kn_page_tool_mesh(kn_page_tool *tool);   // follows a new mesh of `live`
void kn_page_tool_listen(kn_page_tool *tool); // takes the samples of the device's thread
// Called ten times a second: takes samples, lifts the tool of a silent page, and sends the wanted tool position to the
// device's thread.
void kn_page_tool_turn(kn_page_tool *tool);

// Handle a pointer event of a page: take the tool if it is free, aim, press, grip or release.
void kn_page_tool_point(kn_page_tool *tool, int page, const kn_web_message *message);
void kn_page_tool_gone(kn_page_tool *tool, int page); // forgets a page, because its place may be given to another
// Return the time since the last pointer event of the page that has the tool; INT64_MAX if no page has it.
int64_t kn_page_tool_idle_ms(const kn_page_tool *tool);
bool kn_page_tool_is_taken(const kn_page_tool *tool, int page); // returns true if another page has the tool and uses it
// Return the hand whose state is to be told: the second hand while it moves its tool and only it has a fault or gets no
// answer from kneadd, else the first hand.
const kn_page_hand *kn_page_tool_told(const kn_page_tool *tool);
// Return the newest pointer event after `since` that kneadd had answered by the given tick, or `since` if there is no
// such event.
int32_t kn_page_tool_answered(const kn_page_tool *tool, int32_t since, int64_t tick);
// Return the page's own number of an event, or 0 if another page has sent the event.
uint32_t kn_page_tool_event(const kn_page_tool *tool, int32_t event, int page);

// lend: stop the hand of `knead web`, so that a child process can play a recording with the tool. take_back: start the
// hand again.
void kn_page_tool_lend(kn_page_tool *tool, int recording);
void kn_page_tool_take_back(kn_page_tool *tool);
void kn_page_tool_close(kn_page_tool *tool); // waits while the hand lifts the tool

#endif
