#ifndef KN_CLIENTS_WEB_H
#define KN_CLIENTS_WEB_H
// `knead web`: the modules of its main thread, which runs a libev loop, and the state that is sent to the pages. Each
// module owns its struct. web.c opens the modules, passes events on to them and closes them; page_state.c only reads
// them.
//
//     gateway: browsers        page_tool: the tool, its motion, and the page that has it     page_mesh: the mesh
//     control_client: kneadd   recording: recordings, verified and played again            picture: the pictures
//     page_state: the rest
#include "clients/web/page_mesh.h"
#include "clients/web/picture.h"
#include "clients/web/recording.h"
#include "proto/knead_health_t.h"
#include "proto/knead_status_t.h"
#include "proto/knead_touch_patch_t.h"

#define KN_PAGE_STATE_ABOUT 32768 // largest size of `about`, bytes
// Room for the JSON of a message, bytes: `about`, the traces (1024 samples of four numbers), 16 answers of 200
// characters, of which each may take 6 bytes, and the state.
#define KN_PAGE_STATE_JSON (KN_PAGE_STATE_ABOUT + 98304)

// State of kneadd as reported on the bus, and the description `about` that is sent to the pages. The newest message of
// each kind is kept. A message that cannot be decoded is ignored.
typedef struct kn_page_state {
    // Arrival times (CLOCK_MONOTONIC) of the newest message of each kind; 0: none yet.
    int64_t status_ms, health_ms, energy_ms, touch_ms, mesh_ms;
    knead_status_t status;
    knead_health_t health;
    // Result of kneadd's last energy audit: energy stored in the object, and work of all tools since the object was
    // undeformed.
    double stored_j, work_j;
    knead_touch_patch_t touch; // contact patch of the tool, if kneadd runs with --touch
    char touch_channel[80];    // channel of the contact patches of the tool
    int64_t meshes;            // number of mesh messages received
    double meshes_hz;          // rate of the mesh messages
    double mesh_bytes;         // mean size of a mesh message, bytes
    // all_mesh_bytes: total size of all mesh messages so far. counted_ms, counted_meshes, counted_bytes: time, number
    // of messages and total size when the rate was last computed.
    int64_t all_mesh_bytes, counted_ms, counted_meshes, counted_bytes;
    int nodes, edges, cells; // numbers of nodes, edges and cells of the scene's model
    // JSON description of the scene and the state (tool, control, quality, recordings), sent to each page that does not
    // have the present version yet.
    char *about;
    int abouts; // version number of `about`, increased by each change
} kn_page_state;

typedef struct kn_web {
    struct { // options
        const char *probe, *url, *mesh_url, *control, *scenes, *host;
        int port, listen_fd;
        bool bind;
    };
    struct ev_loop *ev;
    ev_io bus_readable, mesh_readable;
    ev_timer due, rest;
    ev_signal stops[3];
    char error[512];
    char folder[64]; // folder for the files that this run of `knead web` writes; "": none
    kn_live_server live;
    kn_gateway gateway;
    kn_control_client client;
    kn_page_tool tool;
    kn_page_mesh mesh;
    kn_picture picture;
    int64_t told_ms; // time when the pages last got news
    kn_recordings recordings;
    kn_page_state state;
} kn_web;

// Subscribe to the messages of the buses of `live`. Return false if a bus has too many subscriptions.
bool kn_page_state_open(kn_web *w);
void kn_page_state_scene(kn_web *w); // after a new scene: counts its nodes, listens to the patch of the tool
void kn_page_state_count(kn_web *w, int64_t now_ms); // called once a second: updates the rate of the mesh messages
void kn_page_state_refresh(void *web);               // updates `about` if its text has changed
// Write the next message for a page (kn_gateway.write).
size_t kn_page_state_write(void *web, int page, uint8_t *bytes, size_t size);

#endif
