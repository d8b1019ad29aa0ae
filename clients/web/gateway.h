#ifndef KN_CLIENTS_GATEWAY_H
#define KN_CLIENTS_GATEWAY_H
// Gateway between kneadd's web client and browsers: HTTP for the files of the page and for downloads, and one WebSocket
// per page. A page is one open browser page that has shown the token. libwebsockets runs on the caller's libev loop.
// DEVELOPING.md of this folder describes the messages.
//
//     browser -- token -->  gateway  -- pointer, requests -->  on_message, on_request
//             <-- state and mesh or picture --  write(page, ...)    <--  caller has news: kn_gateway_news
//             -- GET, with the token in a header -->  fetch  -- a file, or bytes
//
// The gateway listens on one address only, 127.0.0.1 by default. It binds the socket itself and reads the address back,
// because libwebsockets 4.1 ignores an interface given as an address and listens on all interfaces. A client must send
// this address in its Origin and Host headers and must know the token. So no page of another site and no other user of
// this machine can reach the tool. A refused client receives the reason. If the address is not loopback, everything is
// encrypted with a certificate made for this run.
//
// There are KN_GATEWAY_PAGES places for pages. There are KN_GATEWAY_GUESTS more places for guests, which are
// connections that have not shown the token. A guest stays for 2 s at most. If all places are taken, a new guest
// replaces the oldest guest, and a new page replaces the oldest page for which `stays` returns false.
#include <ev.h>
#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// ---- requests
//
// Requests of a page, each a JSON object in a text message. The parser is pure: it takes bytes and returns a checked
// request, or the reason for refusing the request.
//
//     {"id": 7, "do": "undo"}                                  the answer has the same id
//     {"id": 8, "do": "set", "name": "k1", "value": 460000}    a verb needs all of its fields and accepts no other
//
//     do                                            fields
//     reset undo snapshot restore estop recover     none
//     record                                        none
//     draw                                          name: mesh (the page draws the object) or picture (knead web does)
//     quality material scene measure                name: 1..63 characters a-z A-Z 0-9 . _ -, a name sent to the page
//     set                                           name; value: a finite number
//     view                                          azimuth and elevation, degrees; zoom: 1..KN_PAGE_REQUEST_ZOOM
//     verify play stop                              value: the number of a recording, 1..999999

#define KN_PAGE_REQUEST_MAX 256 // largest size of a request message, bytes
// Largest zoom factor of the camera that a request may set.
#define KN_PAGE_REQUEST_ZOOM 4
#define KN_PAGE_REQUEST_NAME 64 // size of a name in a request, bytes including NUL

typedef enum kn_page_verb {
    KN_VERB_RESET,
    KN_VERB_UNDO,
    KN_VERB_SNAPSHOT,
    KN_VERB_RESTORE,
    KN_VERB_ESTOP,
    KN_VERB_RECOVER,
    KN_VERB_RECORD,
    KN_VERB_QUALITY,
    KN_VERB_MATERIAL,
    KN_VERB_SCENE,
    KN_VERB_DRAW,
    KN_VERB_MEASURE,
    KN_VERB_SET,
    KN_VERB_VIEW,
    KN_VERB_VERIFY,
    KN_VERB_PLAY,
    KN_VERB_STOP,
    KN_VERBS
} kn_page_verb;

typedef struct kn_page_request {
    uint32_t id; // number chosen by the page; the answer has the same number
    kn_page_verb verb;
    char name[KN_PAGE_REQUEST_NAME];
    double value;
    // camera: azimuth -180..180 and elevation 2..90 degrees, zoom factor 1..KN_PAGE_REQUEST_ZOOM
    double azimuth_deg, elevation_deg, zoom;
} kn_page_request;

// Return the word that stands for a verb in the field "do" of a request, such as "undo".
const char *kn_page_verb_word(kn_page_verb verb);
bool kn_page_request_is_name(const char *text); // returns true if a request may contain the name `text`

// Parse and check a request. `text` need not end in NUL. If the request is invalid, return false and write to `error`
// what is wrong and what was expected.
bool kn_page_request_parse(kn_page_request *request, const char *text, size_t size, char *error, size_t error_size);

// ---- gateway

#define KN_GATEWAY_PAGES 32  // largest number of pages connected at once
#define KN_GATEWAY_GUESTS 16 // largest number of connections that have not shown the token
#define KN_GATEWAY_TOKEN 32  // number of hex digits of the token
// Largest number of messages sent to a page and not acknowledged by the page. With more, outdated meshes and
// pictures would wait in a buffer.
#define KN_GATEWAY_IN_FLIGHT 2
#define KN_GATEWAY_ANSWERS 16 // largest number of answers that wait to be sent to a page

// POINTER: line of sight through the pointer, and state of its button. SEEN: the page has received a message of the
// gateway, or has drawn its picture. GRIP: lines of sight through two fingers that grip the object.
typedef enum kn_web_kind { KN_WEB_POINTER = 1, KN_WEB_SEEN, KN_WEB_GRIP } kn_web_kind;

// Checked message of a page. GRIP has all fields, POINTER all but the last, SEEN only the first two.
typedef struct kn_web_message {
    kn_web_kind kind;
    uint32_t number; // POINTER, GRIP: number of the event; SEEN: number of that message
    bool pressed;
    float depth_m; // 0..KN_WEB_DEPTH_MAX
    // Line of sight through the pointer, in the scene: eye point, m, and direction. Each component is at most
    // KN_WEB_SIGHT_MAX.
    float eye_m[3], sight[3];
    float second[3]; // direction of the line of sight through the second finger, from the same eye point
} kn_web_message;

#define KN_WEB_DEPTH_MAX 0.1f
#define KN_WEB_SIGHT_MAX 1e4f
// sizes of the messages, bytes
enum { KN_WEB_POINTER_SIZE = 36, KN_WEB_SEEN_SIZE = 8, KN_WEB_GRIP_SIZE = 48 };

// Answer to a request, waiting to be sent to the page that made the request.
typedef struct kn_web_answer {
    uint32_t id;
    bool ok;
    char words[200];
} kn_web_answer;

// The way in which a page gets the object. NOTHING: the page has not said yet how it draws. MESH: the page draws the
// object itself. PICTURE: the page shows pictures that knead web draws.
typedef enum kn_web_draws { KN_WEB_NOTHING, KN_WEB_MESH, KN_WEB_PICTURE } kn_web_draws;

typedef struct kn_web_page { // browser page that has shown the token
    uint32_t sent, seen;     // number of messages sent to the page, and of messages that the page has acknowledged
    bool news;               // true: a message waits to be written to the page
    int64_t came;            // sequence number of the page's admission; a newer page has a larger number
    // The fields from here to `about` are set by the caller. measure: measure that colours the mesh of this page, -1:
    // none. surface: number of the surface that the page has. shape: number of the newest mesh sent to the page.
    // picture: number of the last picture sent to the page. shown: number of the newest pointer event in that mesh.
    kn_web_draws draws;
    int measure;
    int64_t surface, shape;
    uint32_t picture;
    int32_t shown;
    uint32_t event;     // number of the last pointer event received from the page
    int64_t pointed_ms; // time (CLOCK_MONOTONIC) of the last pointer event received from the page
    uint64_t told;      // count of force samples sent to the page or dropped
    int about;          // version of kn_page_state.about that the page has; set by the caller
    kn_web_answer answer[KN_GATEWAY_ANSWERS];
    int answers;     // number of elements of `answer`; set to 0 by the caller when they are written
    struct lws *wsi; // connection to the page; NULL: this place for a page is free
} kn_web_page;

typedef struct kn_web_file { // contents of one download
    const char *type;        // MIME type of the download
    char path[128];          // file to send; "": send `bytes` instead
    char *bytes;             // contents if `path` is empty; allocated with malloc by `fetch`, freed by the gateway
    size_t size;
} kn_web_file;

typedef struct kn_gateway {
    char address[96];     // address of the page, http://HOST:PORT/#TOKEN; with https if HOST is not loopback
    char fingerprint[96]; // SHA-256 fingerprint of the certificate, as AB:CD:..; "" without encryption
    kn_web_page page[KN_GATEWAY_PAGES];
    int64_t refused; // number of connections and requests refused so far
    // Callbacks, set by the caller.
    void (*on_message)(void *arg, int page, const kn_web_message *message); // called for each POINTER message
    void (*on_request)(void *arg, int page, const kn_page_request *request);
    void (*on_gone)(void *arg, int page);
    // Return true if the page keeps its place when a newer page comes. At most KN_GATEWAY_PAGES - 1 pages may keep
    // their place.
    bool (*stays)(void *arg, int page);
    // Get the download of the path "/get/NAME". Return false if there is no download of this name.
    bool (*fetch)(void *arg, const char *name, kn_web_file *file);
    // Write the next message for a page to `bytes`, at most `size` bytes. Return the length of the message.
    size_t (*write)(void *arg, int page, uint8_t *bytes, size_t size);
    void *arg;
    // The fields below are used by gateway.c only.
    struct lws_context *context;
    struct ev_loop *ev;
    ev_io acceptable;
    ev_timer pause;                       // while this timer runs, no connection is accepted
    ev_timer expiry;                      // timer that closes connections which have stayed too long without the token
    struct lws *guest[KN_GATEWAY_GUESTS]; // connections that have not shown the token, the oldest first
    double guest_s[KN_GATEWAY_GUESTS];    // arrival times of the connections in `guest`
    int64_t admitted;                     // number of pages admitted so far
    int fd, connections, guests;
    int64_t told_ms; // time when a refusal was last reported
    // token: random secret of this run, hex digits; origin: the Origin that a page must send, http://HOST:PORT.
    char token[KN_GATEWAY_TOKEN + 1], origin[40];
    const char *site; // the part HOST:PORT of `origin`
    uint8_t *buffer;
    size_t buffer_size;
} kn_gateway;

// Start the gateway. host: an address that kn_gateway_host accepts. port: 0 for any free port. fd: a socket that
// already listens on `host`, in which case `port` is ignored; -1: none.
// The callbacks must be set. On failure return false and one line in `error`.
bool kn_gateway_open(kn_gateway *gateway, struct ev_loop *ev, const char *host, int port, int fd, char *error,
                     size_t error_size);
// Return a listening socket, or -1 and one line in `error`.
int kn_gateway_listen(const char *host, int port, char *error, size_t error_size);
// Return true if `text` is the IPv4 address of one machine.
bool kn_gateway_host(const char *text, struct in_addr *host);
// Return the number of pages that are connected.
int kn_gateway_pages(const kn_gateway *gateway);
// Return true if at least one page draws in this way and can take a message now.
bool kn_gateway_wants(const kn_gateway *gateway, kn_web_draws way);
// Make room for messages of up to `largest` bytes. Return false if memory is short.
bool kn_gateway_reserve(kn_gateway *gateway, size_t largest);
// Let the gateway call `write` for each page as soon as the page can take a message.
void kn_gateway_news(kn_gateway *gateway);
// Append an answer to the list of answers that wait for a page. The answer is dropped if page is -1, or if the page
// does not read its answers.
__attribute__((format(printf, 5, 6))) void kn_gateway_answer(kn_gateway *gateway, int page, uint32_t id, bool ok,
                                                             const char *format, ...);
void kn_gateway_close(kn_gateway *gateway);

#endif
