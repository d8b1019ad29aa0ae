#ifndef KN_CLIENTS_GATEWAY_H
#define KN_CLIENTS_GATEWAY_H
// Gateway between kneadd's web client and browsers: HTTP for the files of the page and for downloads, and one WebSocket
// per page. A page is one open browser page that has shown the token. libwebsockets runs on the caller's libev loop.
// README.md of this folder describes the messages.
//
//     browser -- token -->  gateway  -- pointer, requests -->  on_message, on_request
//             <-- state and picture --  write(page, ...)    <--  caller has news: kn_gateway_news
//             -- GET, with the token in a header -->  fetch  -- a file, or bytes
//
// The gateway listens on one address only, 127.0.0.1 by default. It binds the socket itself and reads the address back,
// because libwebsockets 4.1 ignores an interface given as an address and listens on all interfaces. A client must send
// this address in its Origin and Host headers and must know the token. So no page of another site and no other user of
// this machine can reach the tool. A refused client is told the reason. If the address is not loopback, everything is
// encrypted with a certificate made for this run.
//
// There are KN_GATEWAY_PAGES places for pages. There are KN_GATEWAY_GUESTS more places for guests, which are
// connections that have not shown the token. A guest stays for 2 s at most. If all places are taken, a new guest
// replaces the oldest guest, and a new page replaces the oldest page for which `stays` returns false.
#include "clients/web/request.h"
#include <ev.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_GATEWAY_PAGES 4   // places for pages
#define KN_GATEWAY_GUESTS 16 // places for connections without the token
#define KN_GATEWAY_TOKEN 32  // hex digits of the token
// Most messages that a page may have not acknowledged. With more, old pictures would wait in a buffer.
#define KN_GATEWAY_IN_FLIGHT 2

// POINTER: place of the pointer and state of its button. SEEN: the page has drawn a message of the gateway.
typedef enum kn_web_kind { KN_WEB_POINTER = 1, KN_WEB_SEEN } kn_web_kind;

typedef struct kn_web_message { // checked: finite, u and v 0..1, depth_m 0..0.1
    kn_web_kind kind;
    uint32_t number; // POINTER: number of the event; SEEN: number of the message that was drawn
    bool pressed;
    float u, v, depth_m;
} kn_web_message;

typedef struct kn_web_page { // a page that has shown the token
    uint32_t sent, seen;     // messages sent and acknowledged; sent - seen are in flight
    bool news;               // something waits to be written
    int64_t came;            // sequence number of this page's admission
    uint32_t picture;        // number of the last picture that was sent; set by the caller
    uint32_t event;          // number of the last pointer event
    int64_t pointed_ms;      // time of the last pointer event; CLOCK_MONOTONIC
    uint64_t told;           // count of force samples sent to the page or dropped
    int about;               // version of kn_web.about that the page has; set by the caller
    struct lws *wsi;         // NULL: the place is free
} kn_web_page;

typedef struct kn_web_file { // a download
    const char *type;        // MIME type
    char path[128];          // file to send; "": send `bytes` instead
    char *bytes;             // from malloc; the gateway frees it after fetch
    size_t size;
} kn_web_file;

typedef struct kn_gateway {
    char address[96];     // http://HOST:PORT/#TOKEN; https if HOST is not loopback
    char fingerprint[96]; // SHA-256 of the certificate, AB:CD:..; "" without encryption
    kn_web_page page[KN_GATEWAY_PAGES];
    int64_t refused; // connections and requests refused so far
    // Callbacks, set by the caller.
    void (*on_message)(void *arg, int page, const kn_web_message *message); // for POINTER messages
    void (*on_request)(void *arg, int page, const kn_request *request);
    void (*on_gone)(void *arg, int page);
    // Return true if the page keeps its place when a newer page comes. At most KN_GATEWAY_PAGES - 1 pages may keep
    // their place.
    bool (*stays)(void *arg, int page);
    // Get the download of the path "/get/NAME". Return false if there is no download of this name.
    bool (*fetch)(void *arg, const char *name, kn_web_file *file);
    // Write the next message of a page, at most `size` bytes. Return the length of the message.
    size_t (*write)(void *arg, int page, uint8_t *bytes, size_t size);
    void *arg;
    // private
    struct lws_context *context;
    struct ev_loop *ev;
    ev_io acceptable;
    ev_timer pause;  // while it runs, no connection is accepted
    ev_timer expiry; // closes guests that have stayed too long
    struct lws *guest[KN_GATEWAY_GUESTS];
    double guest_s[KN_GATEWAY_GUESTS]; // time of each guest's arrival
    int64_t admitted;                  // pages admitted so far
    int fd, connections, guests;
    int64_t told_ms;                              // time of the last reported refusal
    char token[KN_GATEWAY_TOKEN + 1], origin[40]; // http://HOST:PORT
    const char *site;                             // HOST:PORT, a part of origin
    uint8_t *buffer;
    size_t buffer_size;
} kn_gateway;

// Start the gateway. host: an address that kn_gateway_host accepts. port: 0 for any free port. fd: a socket that
// already listens on `host`, in which case `port` is ignored; -1: none. largest: size of the largest message, bytes.
// The callbacks must be set. On failure return false and one line in `error`.
bool kn_gateway_open(kn_gateway *gateway, struct ev_loop *ev, const char *host, int port, int fd, size_t largest,
                     char *error, size_t error_size);
// Return a listening socket, or -1 and one line in `error`.
int kn_gateway_listen(const char *host, int port, char *error, size_t error_size);
bool kn_gateway_host(const char *text, struct in_addr *host); // return true if text is the IPv4 address of one machine
// Return the number of pages that are connected.
int kn_gateway_pages(const kn_gateway *gateway);
bool kn_gateway_wants(const kn_gateway *gateway); // return true if at least one page can take a picture now
void kn_gateway_news(kn_gateway *gateway);        // writes to each page as soon as the page can take a message
void kn_gateway_close(kn_gateway *gateway);

#endif
