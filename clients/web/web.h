#ifndef KN_CLIENTS_WEB_H
#define KN_CLIENTS_WEB_H
// What the parts of knead web share, all on its libev thread but where it says otherwise.
//
//     web.c: options, start, pictures, stop      grip.c: the tool, who has it, what it does
//     tell.c: what a page is told                orders.c: what a page asks for in words
#include "clients/knead/device.h"
#include "clients/knead/reach.h"
#include "clients/web/asker.h"
#include "clients/web/gateway.h"
#include "clients/web/painter.h"
#include "clients/web/takes.h"
#include "clients/web/vitals.h"
#include "server/mailbox.h"
#include "server/ring.h"

#define KN_WEB_TRACE 256       // ms of force that wait for a page
#define KN_WEB_EVENTS 64       // of the pointer, on their way through kneadd
#define KN_WEB_ANSWERS 16      // to requests, that wait for a page
#define KN_WEB_SCENES 32       // that are listed
#define KN_WEB_LET_GO_MS 400   // a pressing page that is silent so long is gone: it speaks every 50 ms; so is a thread
#define KN_WEB_UNHEARD_MS 1000 // without a mesh: nobody serves

typedef enum kn_button { KN_BUTTON_UP, KN_BUTTON_PRESSES, KN_BUTTON_BESIDE, KN_BUTTON_BARRED } kn_button;
// BESIDE: where nothing is; BARRED: it must come up first

typedef struct kn_web_sample { // of a millisecond, from the device's thread
    kn_pointer_news news;
    float work_mj, round_trip_ms; // of the newest force; NaN: there was none in this ms
} kn_web_sample;

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
    char folder[64]; // for what is written, of this run alone; "": none

    // grip.c
    int64_t meshes, mesh_ms; // seen; when the last came
    const kn_scene *scene;   // that tool and reach are of; may be gone already
    uint64_t scene_hash;     // its
    const kn_probe_def *tool;
    kn_probe_def held; // that tool, for comparison once its scene is gone
    double held_spacing_m;
    kn_reach reach;
    kn_device device;
    bool moving;        // the device's thread runs
    kn_pointer pointer; // that thread's, as stale_ms: since the last wish
    int stale_ms;
    kn_mailbox wishes; // to it
    kn_pointer_wish wish, wish_slots[3];
    kn_ring samples;      // from it: kn_web_sample
    kn_pointer_news news; // the newest of them
    kn_web_sample trace[KN_WEB_TRACE];
    uint64_t traced;
    int owner;        // the page that has the tool, -1: none
    int ordered_by;   // the page that gave the last order, -1: none
    kn_button button; // of that page
    bool turned;      // the picture, since this press began: where the pointer is in it says nothing
    struct {
        uint32_t number;
        int page;
        int64_t tick;
    } event[KN_WEB_EVENTS]; // tick of kneadd's answer, INT64_MAX:
                            // not yet

    // pictures
    int64_t mesh_id;  // of the painter's still
    int64_t frame_ms; // when the last drawing began
    double due_ms;    // when the next one should
    uint8_t *jpeg;    // the newest picture: the painter is at the next one
    size_t jpeg_size;
    double bar_m; // on its table
    uint32_t pictures;
    int32_t painting, shown; // newest event in the picture that is being drawn, that was drawn
    bool drawing;            // from the painter's begin until its picture has been taken
    kn_view_scene look;      // from where and in which style the next one is drawn
    int measure;             // that it is coloured by, -1: none
    double top;              // of its scale
    int png_page;            // that waits for the next picture as a file, -1: none; the answer's id
    uint32_t png_id;
    int64_t png_ms;               // since when
    bool png_there;               // it has been made
    double meshes_hz, mesh_bytes; // per second; of one
    int64_t counted_ms, counted_meshes, counted_bytes;

    // orders.c
    struct {
        kn_web_answer answer[KN_WEB_ANSWERS];
        int count;
    } waiting[KN_GATEWAY_PAGES]; // each page's own
    struct {
        int page;
        uint32_t id;
        kn_verb verb;
    } asked[KN_ASKER_CALLS + 1];                     // by tag; id 0: free
    json_t *status;                                  // of kneadd, as its control socket told it last; NULL: it did not
    int64_t status_ms;                               // when it was asked for
    char control_error[200];                         // why there is none
    int64_t snapshot;                                // generation of the last that a page asked for, 0: none
    char snapshot_of[400];                           // its scene and directory
    char scene_file[KN_WEB_SCENES][KN_REQUEST_NAME]; // names in `scenes`
    int scene_files, scenes_unlisted;                // these: too many, or by names that no request may say

    int lent;        // the recording that has the tool, 0: none
    int64_t lent_ms; // since when nobody has sent poses; 0: a child does
    struct {
        int page, number;
        uint32_t id;
    } replayed;       // who is told how it ended; page -1: nobody
    int saved_of;     // the last recording that a snapshot was asked for, unless it was refused
    int64_t saved_ms; // when

    // tell.c
    char *about; // the JSON that every page gets when it is another one than it had
    int abouts;  // its number, rising
    struct {
        int nodes, edges, cells;
    } counts; // of the model
} kn_web;

// grip.c
void kn_web_take_scene(kn_web *w); // when another one was heard: another tool, a hand that begins anew
kn_camera_view kn_web_camera(const kn_web *w);
void kn_web_let_go(kn_web *w); // of the tool altogether: another hand may take it
void kn_web_take_up(kn_web *w);
void kn_web_post_wish(kn_web *w);
void kn_web_take_samples(kn_web *w);
bool kn_web_is_taken(const kn_web *w, int page); // the tool is another page's, which uses it
void kn_web_on_message(void *web, int page, const kn_web_message *message);
void kn_web_on_gone(void *web, int page);

// web.c
void kn_web_png_path(const kn_web *w, char path[128]);
bool kn_web_measured(const kn_web *w, int measure); // whether the meshes tell it

// orders.c
void kn_web_list_scenes(kn_web *w); // once a second: files come and go
void kn_web_on_request(void *web, int page, const kn_request *request);
void kn_web_on_replayed(void *web, int number, bool ok, const char *words);
void kn_web_turn(kn_web *w); // ten times a second: what recordings and pictures wait for
void kn_web_on_answered(void *web, int tag, const json_t *answer);
void kn_web_ask_status(kn_web *w); // once a second at most
__attribute__((format(printf, 5, 6))) void kn_web_answer_page(kn_web *w, int page, uint32_t id, bool ok,
                                                              const char *format, ...);

// downloads.c
bool kn_web_fetch(void *web, const char *name, kn_web_file *file);

// tell.c
size_t kn_web_write(void *web, int page, uint8_t *bytes, size_t size);
void kn_web_count(kn_web *w);   // nodes, edges and cells of the scene
void kn_web_refresh(kn_web *w); // about, when it has changed
#define KN_WEB_ABOUT 24576      // bytes of it at most

#endif
