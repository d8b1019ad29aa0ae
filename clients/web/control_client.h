#ifndef KN_CLIENTS_CONTROL_CLIENT_H
#define KN_CLIENTS_CONTROL_CLIENT_H
// Client of kneadd's control socket (server/control.h), for the libev thread. It sends the orders of the pages, and
// asks for kneadd's status. Each request uses its own connection, and the caller never waits for an answer. Every order
// gets one answer (kn_gateway_answer).
#include "clients/hand/live_server.h"
#include "clients/web/gateway.h"
#include <jansson.h>

// Largest number of requests that wait for answers at once. One place is reserved for an emergency stop. kneadd accepts
// 8 connections.
#define KN_CONTROL_CALLS 5
#define KN_CONTROL_SCENES 32 // largest number of scene files in the list that a page can load from

// Purpose of a request: an order of a page, or a request of the program itself for the status.
typedef enum kn_control_purpose { KN_CONTROL_ORDER, KN_CONTROL_STATUS } kn_control_purpose;

typedef struct kn_control_call { // a request that waits for its answer
    ev_io readable;
    ev_timer patience;
    struct kn_control_client *client;
    kn_control_purpose purpose;
    // Set only for an order. page: index of the page that gave the order, -1 once the page is gone; id: id of the
    // page's request; verb: what the page ordered.
    int page;
    uint32_t id;
    kn_page_verb verb;
    char *text; // part of the answer received so far; NULL: this place for a request is free
    size_t size;
} kn_control_call;

typedef struct kn_control_client {
    // Set by the caller. path: path of the socket; NULL: every request is refused. scenes: folder whose *.yaml may be
    // loaded; NULL: none. changed: function that is called when `status` or `error` has changed.
    const char *path, *scenes;
    struct ev_loop *ev;
    kn_gateway *gateway;
    kn_live_server *live;
    void (*changed)(void *arg);
    void *arg;
    // State, read by other modules.
    json_t *status;                                           // latest status; NULL: none
    char error[200];                                          // reason why there is no status
    int ordered_by;                                           // index of the page that gave the last order, -1: none
    char scene_file[KN_CONTROL_SCENES][KN_PAGE_REQUEST_NAME]; // file names in the folder `scenes`
    // Number of files in the list, and number of files that are left out, because the list is full (KN_CONTROL_SCENES)
    // or because a request may not contain the file's name.
    int scene_files, scenes_unlisted;
    // The fields below are used by control_client.c only. status_ms: time of the last status request. snapshot:
    // generation number of the last snapshot that a page requested, 0: none. snapshot_of: scene and directory of this
    // snapshot.
    int64_t status_ms, snapshot;
    char snapshot_of[400];
    kn_control_call call[KN_CONTROL_CALLS];
} kn_control_client;

void kn_control_client_list_scenes(kn_control_client *client); // reads the folder `scenes` again
void kn_control_client_order(kn_control_client *client, int page, const kn_page_request *request);
// Ask kneadd for its status, at most once a second and only while a page is open.
void kn_control_client_ask_status(kn_control_client *client);
// Return kneadd's snapshot directory, or NULL.
const char *kn_control_client_snapshots(const kn_control_client *client);
void kn_control_client_gone(kn_control_client *client, int page); // forgets a page
void kn_control_client_close(kn_control_client *client); // closes all connections without waiting for pending answers

#endif
