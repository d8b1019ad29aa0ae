#ifndef KN_CLIENTS_WEB_H
#define KN_CLIENTS_WEB_H
// State shared by the parts of `knead web`. All parts run on its main thread, a libev loop, except where a comment says
// otherwise. A page is a browser page that has shown the token (gateway.h). At most one page has the tool at a time.
//
//     web.c: options, start, pictures, stop      grip.c: the tool, its motion, and the page that has the tool
//     tell.c: messages to a page                 orders.c: requests of a page
#include "clients/knead/device.h"
#include "clients/knead/reach.h"
#include "clients/web/asker.h"
#include "clients/web/gateway.h"
#include "clients/web/painter.h"
#include "clients/web/takes.h"
#include "clients/web/vitals.h"
#include "server/mailbox.h"
#include "server/ring.h"

#define KN_WEB_TRACE 256  // number of force samples kept for the pages, one sample per ms
#define KN_WEB_EVENTS 64  // most pointer events that wait at once for an answer of kneadd
#define KN_WEB_ANSWERS 16 // most answers to requests that wait to be sent to one page
#define KN_WEB_SCENES 32  // most scene files listed for loading
// A page on which the user presses normally sends a message every 50 ms. If it sends none for KN_WEB_LET_GO_MS, the
// page counts as gone. The device's thread uses the same limit: if the main thread posts no wish for KN_WEB_LET_GO_MS,
// the device's thread lifts the tool.
#define KN_WEB_LET_GO_MS 400
#define KN_WEB_UNHEARD_MS 1000 // if no mesh message arrives for this time, kneadd counts as not running

// State of the pointer's button. BESIDE: pressed where no object is. BARRED: down, but without effect before the button
// is released.
typedef enum kn_button { KN_BUTTON_UP, KN_BUTTON_PRESSES, KN_BUTTON_BESIDE, KN_BUTTON_BARRED } kn_button;

typedef struct kn_web_sample { // state of the tool in one millisecond, from the device's thread
    kn_pointer_news news;
    // work_mj, round_trip_ms: of the newest force; NaN: no force arrived in this millisecond.
    float work_mj, round_trip_ms;
} kn_web_sample;

// Answer to a request, waiting to be sent to the page that made the request.
typedef struct kn_web_answer {
    uint32_t id;
    bool ok;
    char words[200];
} kn_web_answer;

typedef struct kn_web {
    const char *probe, *url, *mesh_url, *control, *scenes, *host;
    int port, width, height, listen_fd, rate_hz;
    bool bind, help;
    struct ev_loop *ev;
    ev_io bus_readable, mesh_readable;
    ev_timer due;
    ev_async painted;
    ev_signal stops[3];
    kn_gateway gateway;
    kn_painter painter;
    kn_live live;
    kn_vitals vitals;
    kn_asker asker;
    kn_takes takes;
    char error[512];
    char folder[64]; // folder for the files that this run of `knead web` writes; "": none

    // grip.c
    int64_t meshes, mesh_ms; // meshes: number of mesh messages received; mesh_ms: arrival time of the last one
    const kn_scene *scene;   // scene that `tool` and `reach` belong to; may have been freed already
    uint64_t scene_hash;     // hash of `scene`
    const kn_probe_def *tool;
    kn_probe_def held; // copy of *tool, to compare the tool with that of the next scene after this scene has been freed
    double held_spacing_m;
    kn_reach reach;
    kn_device device;
    bool moving;        // true: the device's thread is running
    kn_pointer pointer; // used by the device's thread only
    int stale_ms;       // time since the device's thread last received a wish; used by this thread only
    kn_mailbox wishes;  // wanted motions of the tool (kn_pointer_wish), from the main thread to the device's thread
    kn_pointer_wish wish, wish_slots[3];
    kn_ring samples;      // queue of kn_web_sample from the device's thread to the main thread
    kn_pointer_news news; // state of the hand in the newest sample
    kn_web_sample trace[KN_WEB_TRACE];
    uint64_t traced;
    int owner;        // index of the page that has the tool, -1: none
    int ordered_by;   // index of the page that gave the last order for kneadd, -1: none
    kn_button button; // state of the pointer's button on the page that has the tool
    // True: the view was turned during this press, so the pointer's place in the picture no longer stands for a place
    // on the object.
    bool turned;
    // Pointer events whose effect no picture has shown yet. tick: tick in which kneadd answered the event; INT64_MAX:
    // not answered yet.
    struct {
        uint32_t number;
        int page;
        int64_t tick;
    } event[KN_WEB_EVENTS];

    // pictures
    int64_t mesh_id;  // id of the mesh in the painter's still
    int64_t frame_ms; // time when the last drawing began
    double due_ms;    // time when the next drawing should begin
    uint8_t *jpeg;    // newest finished picture; the painter works on the next one
    size_t jpeg_size;
    double bar_m; // length of the scale bar on the table in the picture `jpeg`
    uint32_t pictures;
    // Number of the newest pointer event in the picture being drawn, and in the last finished picture.
    int32_t painting, shown;
    bool drawing;                 // the painter is drawing, or its picture has not been fetched yet
    kn_view_scene look;           // view and style of the next picture
    int measure;                  // measure that colours the object, -1: none
    double top;                   // value at the top of the colour scale, in the unit of the measure
    int png_page;                 // index of the page that waits for a PNG of the next picture, -1: none
    uint32_t png_id;              // id of the page's request for the PNG
    int64_t png_ms;               // time of the request for the PNG
    bool png_there;               // true: the requested PNG is ready
    double meshes_hz, mesh_bytes; // rate of mesh messages; mean size of one mesh message, bytes
    int64_t counted_ms, counted_meshes, counted_bytes;

    // orders.c
    struct {
        kn_web_answer answer[KN_WEB_ANSWERS];
        int count;
    } waiting[KN_GATEWAY_PAGES]; // answers that wait to be sent, one list per page
    // Requests that kneadd is working on, indexed by the tag of the request. id 0: the element is free.
    struct {
        int page;
        uint32_t id;
        kn_verb verb;
    } asked[KN_ASKER_CALLS + 1];
    json_t *status;          // latest status from kneadd's control socket; NULL: none
    int64_t status_ms;       // time of the last status request
    char control_error[200]; // reason why there is no status
    // Generation number of the last snapshot that a page requested, 0: none.
    int64_t snapshot;
    char snapshot_of[400];                           // scene and directory of the last snapshot that a page requested
    char scene_file[KN_WEB_SCENES][KN_REQUEST_NAME]; // file names in the folder `scenes`
    // Numbers of files listed and not listed; a file is not listed beyond KN_WEB_SCENES, or if a request may not have
    // its name.
    int scene_files, scenes_unlisted;

    int lent; // number of the recording that moves the tool (is played), 0: none
    // Time when the page stopped sending poses, so that a child process can start; 0: a child process sends the poses.
    int64_t lent_ms;
    struct {
        int page, number;
        uint32_t id;
    } replayed;       // page that is told when the replay of a recording ends; page -1: none
    int saved_of;     // last recording for which a snapshot was requested; 0: none, or kneadd refused
    int64_t saved_ms; // time when the snapshot of the recording `saved_of` was requested

    // tell.c
    // JSON description of the scene and the state (tool, control, quality, recordings), sent to each page that does not
    // have the present version yet.
    char *about;
    int abouts; // version number of `about`, increased by each change
    struct {
        int nodes, edges, cells;
    } counts; // numbers of nodes, edges and cells in the model of the scene
} kn_web;

// grip.c
void kn_web_take_scene(kn_web *w); // after a new scene: chooses the tool again and restarts the hand if needed
kn_camera_view kn_web_camera(const kn_web *w);
void kn_web_let_go(kn_web *w); // stops the hand of `knead web`, so that another hand can take the tool
void kn_web_take_up(kn_web *w);
void kn_web_post_wish(kn_web *w);
void kn_web_take_samples(kn_web *w);
bool kn_web_is_taken(const kn_web *w, int page); // returns true if another page than `page` has the tool and uses it
void kn_web_on_message(void *web, int page, const kn_web_message *message);
void kn_web_on_gone(void *web, int page);

// web.c
void kn_web_png_path(const kn_web *w, char path[128]);
// Returns true if the mesh messages contain this measure; true for the displacement.
bool kn_web_measured(const kn_web *w, int measure);

// orders.c
void kn_web_list_scenes(kn_web *w); // called once a second, because files may be added and removed at any time
void kn_web_on_request(void *web, int page, const kn_request *request);
void kn_web_on_replayed(void *web, int number, bool ok, const char *words);
void kn_web_turn(kn_web *w); // called ten times a second: continues waiting work on recordings and PNG pictures
void kn_web_on_answered(void *web, int tag, const json_t *answer);
void kn_web_ask_status(kn_web *w); // requests kneadd's status, at most once a second
__attribute__((format(printf, 5, 6))) void kn_web_answer_page(kn_web *w, int page, uint32_t id, bool ok,
                                                              const char *format, ...);

// downloads.c
bool kn_web_fetch(void *web, const char *name, kn_web_file *file);

// tell.c
size_t kn_web_write(void *web, int page, uint8_t *bytes, size_t size);
void kn_web_count(kn_web *w);   // counts nodes, edges and cells of the scene
void kn_web_refresh(kn_web *w); // updates `about` if its text has changed
#define KN_WEB_ABOUT 24576      // largest size of `about`, bytes

#endif
