#ifndef KN_CLIENTS_GATEWAY_H
#define KN_CLIENTS_GATEWAY_H
// The page's way in and out: HTTP for the page and for downloads, one WebSocket per page, libwebsockets on the
// caller's libev loop.
//
//     browser -- token -->  gateway  -- where it points, what it asks -->  on_message, on_request     wire: README.md
//             <- state and picture --  write(page, ...)    <--  whoever has news: kn_gateway_news
//             -- GET, with the token in a header -->  fetch  -- a file, or bytes
//
// One address alone is listened on, 127.0.0.1 unless told, by a socket that is bound here and read back
// (libwebsockets 4.1 ignores an interface given as an address and listens on all of them). The page must come from
// there (Origin, Host) and must know the token, so that no other page and no other user of this machine gets at the
// tool. Whoever is refused is told why, in words. Off loopback all of it is encrypted, with a certificate of this run.
//
// Places: KN_GATEWAY_PAGES for pages, KN_GATEWAY_GUESTS for connections that have not shown the token, which stay for 2 s
// at most. The newest takes the place of the oldest; a page's place is never taken by a guest, nor while it `stays`.
#include "clients/web/request.h"
#include <ev.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_GATEWAY_PAGES 4
#define KN_GATEWAY_GUESTS 16   // connections without the token
#define KN_GATEWAY_TOKEN 32    // hex digits
#define KN_GATEWAY_IN_FLIGHT 2 // messages a page has not acknowledged: more would be an old picture waiting in a buffer

typedef enum kn_web_kind { KN_WEB_POINTER = 1, KN_WEB_SEEN } kn_web_kind;

typedef struct kn_web_message { // checked: finite, u v 0..1, depth_m 0..0.1
    kn_web_kind kind;
    uint32_t number; // of the pointer's event, of the message seen
    bool pressed;
    float u, v, depth_m;
} kn_web_message;

typedef struct kn_web_page { // one that has shown the token
    uint32_t sent, seen;     // messages; sent - seen are in flight
    bool news;               // there is something to write
    int64_t came;            // sequence number of the page
    uint32_t picture;        // the last one it was sent; the caller's
    uint32_t event;          // the last pointer event
    int64_t pointed_ms;      // when; CLOCK_MONOTONIC
    uint64_t told;           // samples of the force it has been told
    int about;               // what it has been told of the object, the caller's number of that
    struct lws *wsi;         // NULL: free
} kn_web_page;

typedef struct kn_web_file { // a download
    const char *type;        // MIME
    char path[128];          // of a file; "": bytes instead
    char *bytes;             // malloc'ed, the gateway's from then on
    size_t size;
} kn_web_file;

typedef struct kn_gateway {
    char address[96];     // http://HOST:PORT/#TOKEN; https, off loopback
    char fingerprint[96]; // SHA-256 of the certificate, AB:CD:..; "" without encryption
    kn_web_page page[KN_GATEWAY_PAGES];
    int64_t refused;
    // the caller's
    void (*on_message)(void *arg, int page, const kn_web_message *message); // of POINTER
    void (*on_request)(void *arg, int page, const kn_request *request);
    void (*on_gone)(void *arg, int page);
    bool (*stays)(void *arg, int page); // no newer page takes its place; at most KN_GATEWAY_PAGES - 1 of them
    // Of a path that begins with "/get/", without that. False: there is no such thing.
    bool (*fetch)(void *arg, const char *name, kn_web_file *file);
    // Fills the next message of a page: at most size bytes.
    size_t (*write)(void *arg, int page, uint8_t *bytes, size_t size);
    void *arg;
    // private
    struct lws_context *context;
    struct ev_loop *ev;
    ev_io acceptable;
    ev_timer pause;  // nobody is accepted for a moment
    ev_timer expiry; // of guests
    struct lws *guest[KN_GATEWAY_GUESTS];
    double guest_s[KN_GATEWAY_GUESTS]; // when each came
    int64_t admitted;                  // pages so far
    int fd, connections, guests;
    int64_t told_ms;                              // of the last refusal
    char token[KN_GATEWAY_TOKEN + 1], origin[40]; // http://HOST:PORT
    const char *site;                             // HOST:PORT, in origin
    uint8_t *buffer;
    size_t buffer_size;
} kn_gateway;

// host: an address as kn_gateway_host has it. port 0: a free one; fd >= 0: a socket that listens there already, port
// is not looked at. largest: bytes of a message. The callbacks must be set. False and one line in error.
bool kn_gateway_open(kn_gateway *gateway, struct ev_loop *ev, const char *host, int port, int fd, size_t largest,
                     char *error, size_t error_size);
int kn_gateway_listen(const char *host, int port, char *error, size_t error_size); // -1 and one line in error
bool kn_gateway_host(const char *text, struct in_addr *host); // whether it is an IPv4 address of one machine
int kn_gateway_pages(const kn_gateway *gateway);
bool kn_gateway_wants(const kn_gateway *gateway); // some page would take a picture now
void kn_gateway_news(kn_gateway *gateway);        // every page is written to as soon as it can take it
void kn_gateway_close(kn_gateway *gateway);

#endif
