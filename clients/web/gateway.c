#include "clients/web/gateway.h"
#include "clients/viewer/shading.h"
#include <arpa/inet.h>
#include <errno.h>
#include <libwebsockets.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/x509v3.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

// Longest time that a connection may stay without the token, s; a page shows its token within a few round trips.
#define GUEST_S 2
#define EXPIRY_S 0.2 // interval between two searches for connections that have stayed too long without the token, s
// If all 16 places for connections without the token are taken, a new connection closes the oldest one. Two such
// closings are at least this time apart, s. Each connection thus has at least 64 ms to show its token.
#define CLOSE_EVERY_S 0.004
// Largest number of connections with the token that are not pages (downloads). With more, the program could need more
// than 96 descriptors.
#define DOWNLOADS 8
// Timeout of libwebsockets for a request and for an idle connection, s.
#define PATIENCE_S 5
// Number of bytes passed to the kernel at once. By default, libwebsockets passes as many bytes as its receive buffer
// holds, and would send a picture in 500 pieces.
#define AT_ONCE (1 << 24)
// WebSocket close codes. Codes from 4000 on are free for the use of applications.
enum { PROTOCOL = 1002, TOO_BIG = 1009, UNKNOWN = 4401, OUSTED = 4429 };

// Files of the page, embedded in the program. So the program needs no files at run time, and a page cannot ask for any
// other file.
#define EMBED(name, file)                                                                                              \
    extern const char name[], name##_end[];                                                                            \
    __asm__(".section .rodata\n" #name ": .incbin \"" KN_CLIENTS_DIR "/web/" file "\"\n" #name                         \
            "_end: .byte 0\n.previous\n")
EMBED(page_html, "page.html");
EMBED(app_js, "app.js");
EMBED(panels_js, "panels.js");
EMBED(trace_js, "trace.js");
EMBED(scene_js, "scene.js");
EMBED(style_css, "style.css");

static const struct {
    const char *path, *type, *begin, *end;
} files[] = {{"/", "text/html; charset=utf-8", page_html, page_html_end},
             {"/app.js", "text/javascript; charset=utf-8", app_js, app_js_end},
             {"/panels.js", "text/javascript; charset=utf-8", panels_js, panels_js_end},
             {"/trace.js", "text/javascript; charset=utf-8", trace_js, trace_js_end},
             {"/scene.js", "text/javascript; charset=utf-8", scene_js, scene_js_end},
             {"/shaders.glsl", "text/plain; charset=utf-8", kn_shader_text, NULL},
             {"/style.css", "text/css; charset=utf-8", style_css, style_css_end}};

typedef struct session { // libwebsockets keeps one session per connection
    bool socket;         // true: the connection is a WebSocket
    bool admitted;       // true: the page has shown the token and got a place
    // Index of the page; -1: the page has not shown the token yet, or a newer page has taken its place.
    int page;
    size_t length;
    uint8_t message[KN_PAGE_REQUEST_MAX];
    // True: a reason for closing was set. Writing anything more would end the connection before the reason is sent.
    bool closing;
} session;

// Count a refusal. Report refusals at most once a second, so that many attempts to connect cannot fill the log.
static void tell_refusal(kn_gateway *g, const char *why)
{
    g->refused++;
    int64_t now_ms = (int64_t)(ev_now(g->ev) * 1e3);
    if (now_ms - g->told_ms < 1000) return;
    g->told_ms = now_ms;
    fprintf(stderr, "knead web: refused: %s (%lld so far)\n", why, (long long)g->refused);
}

// ---- guests: connections that have not shown the token or have lost their place, the oldest first

static bool is_guest(const kn_gateway *g, const struct lws *wsi)
{
    for (int i = 0; i < g->guests; i++)
        if (g->guest[i] == wsi) return true;
    return false;
}

// Remove a connection from the guests, because it has shown the token or has ended.
static void forget_guest(kn_gateway *g, const struct lws *wsi)
{
    int kept = 0;
    for (int i = 0; i < g->guests; i++)
        if (g->guest[i] != wsi) g->guest_s[kept] = g->guest_s[i], g->guest[kept++] = g->guest[i];
    g->guests = kept;
}

// Close the oldest guest (connection without the token) at once.
static void close_oldest(kn_gateway *g)
{
    struct lws *oldest = g->guest[0];
    forget_guest(g, oldest);
    // Shut the socket down, because libwebsockets would otherwise wait until the guest has read the answer.
    shutdown(lws_get_socket_fd(oldest), SHUT_RDWR);
    lws_set_timeout(oldest, PENDING_TIMEOUT_USER_REASON_BASE, LWS_TO_KILL_SYNC);
}

// Stop accepting connections until the timer `pause` ends. The kernel queues or refuses connections meanwhile.
static void pause_accepting(kn_gateway *g, double seconds, const char *why)
{
    tell_refusal(g, why);
    ev_io_stop(g->ev, &g->acceptable);
    g->pause.repeat = seconds;
    ev_timer_again(g->ev, &g->pause);
}

// Add a new connection to the guests (connections without the token). If all places of guests are taken, close the
// oldest guest. A real page is not closed in this way, because it shows its token at once.
static void add_guest(kn_gateway *g, struct lws *wsi)
{
    if (g->guests == KN_GATEWAY_GUESTS) {
        pause_accepting(g, CLOSE_EVERY_S, "too many connections without the token: the oldest is closed");
        close_oldest(g);
    }
    g->guest_s[g->guests] = ev_now(g->ev);
    g->guest[g->guests++] = wsi;
    lws_set_timer_usecs(wsi, GUEST_S * LWS_USEC_PER_SEC);
}

// Close guests (connections without the token) that have stayed too long. libwebsockets checks its timers only after
// its own events, so without this timer guests would stay until the next event.
static void on_expiry(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)events;
    kn_gateway *g = w->data;
    while (g->guests && ev_now(ev) - g->guest_s[0] > GUEST_S + EXPIRY_S) close_oldest(g);
}

// ---- HTTP

static bool header_is(struct lws *wsi, enum lws_token_indexes header, const char *expected)
{
    char value[128];
    return lws_hdr_copy(wsi, value, sizeof value, header) > 0 && strcmp(value, expected) == 0;
}

// Send a complete HTTP answer from memory. Return the value for the libwebsockets callback.
static int answer(struct lws *wsi, unsigned status, const char *type, const char *body, size_t size)
{
    uint8_t *buffer = malloc(LWS_PRE + 1024 + size), *head = buffer + LWS_PRE, *at = head;
    bool ok = buffer && !lws_add_http_common_headers(wsi, status, type, size, &at, head + 1024) &&
              !lws_finalize_write_http_header(wsi, head, &at, head + 1024);
    if (ok) memcpy(head, body, size);
    ok = ok && lws_write(wsi, head, size, LWS_WRITE_HTTP_FINAL) == (int)size;
    free(buffer);
    return ok && !lws_http_transaction_completed(wsi) ? 0 : -1;
}

static int refuse(kn_gateway *g, struct lws *wsi, unsigned status, const char *why)
{
    tell_refusal(g, why);
    return answer(wsi, status, "text/plain; charset=utf-8", why, strlen(why));
}

// Compare all characters, so that the time of the comparison reveals nothing about the token.
static bool is_token(const kn_gateway *g, const uint8_t *shown)
{
    unsigned differ = 0;
    for (size_t i = 0; i < KN_GATEWAY_TOKEN; i++) differ |= (unsigned)(shown[i] ^ (uint8_t)g->token[i]);
    return differ == 0;
}

// Serve a download. The token is in a header, which a page of another origin cannot send without permission.
static int hand_out(kn_gateway *g, struct lws *wsi, const char *name)
{
    static const char scheme[] = "Bearer ";
    char shown[sizeof scheme + KN_GATEWAY_TOKEN], type[] = "application/octet-stream";
    kn_web_file file = {.type = type};
    if (lws_hdr_total_length(wsi, WSI_TOKEN_ORIGIN) > 0 && !header_is(wsi, WSI_TOKEN_ORIGIN, g->origin))
        return refuse(g, wsi, 403, "wrong Origin: open the address that knead web printed");
    if (lws_hdr_copy(wsi, shown, sizeof shown, WSI_TOKEN_HTTP_AUTHORIZATION) != (int)sizeof shown - 1 ||
        strncmp(shown, scheme, sizeof scheme - 1) != 0 || !is_token(g, (const uint8_t *)shown + sizeof scheme - 1))
        return refuse(g, wsi, 401, "wrong token: expected Authorization: Bearer and the token of the address");
    // Limit the number of downloads separately, so that downloads never take the places of pages or guests.
    if (is_guest(g, wsi) && g->connections - g->guests - kn_gateway_pages(g) >= DOWNLOADS)
        return refuse(g, wsi, 503, "too many downloads at once, expected at most eight");
    forget_guest(g, wsi);
    if (!g->fetch(g->arg, name, &file)) return refuse(g, wsi, 404, "no such download");
    // This call is enough for the whole file: libwebsockets sends the file in pieces without calling this callback
    // again.
    if (file.path[0]) {
        int sent = lws_serve_http_file(wsi, file.path, file.type, NULL, 0);
        return sent < 0 || (sent > 0 && lws_http_transaction_completed(wsi)) ? -1 : 0;
    }
    int result = answer(wsi, 200, file.type, file.bytes, file.size);
    free(file.bytes);
    return result;
}

// Serve a file of the page or a download. The Host header must be this address, so that a foreign host name that
// resolves to this address (DNS rebinding) is refused.
static int serve(kn_gateway *g, struct lws *wsi, const char *path)
{
    if (!header_is(wsi, WSI_TOKEN_HOST, g->site))
        return refuse(g, wsi, 403, "wrong Host: open the address that knead web printed");
    if (lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) == 0) return refuse(g, wsi, 405, "expected GET");
    for (size_t i = 0; i < sizeof files / sizeof *files; i++)
        if (strcmp(path, files[i].path) == 0)
            return answer(wsi, 200, files[i].type, files[i].begin,
                          files[i].end ? (size_t)(files[i].end - files[i].begin) : strlen(files[i].begin));
    if (strncmp(path, "/get/", 5) == 0) return hand_out(g, wsi, path + 5);
    return refuse(g, wsi, 404, "no such file");
}

// Check the headers of a WebSocket before the upgrade. Return 0 to accept.
static int confirm(kn_gateway *g, struct lws *wsi)
{
    const char *why = NULL;
    if (!header_is(wsi, WSI_TOKEN_PROTOCOL, "knead")) why = "wrong subprotocol: expected knead";
    if (!header_is(wsi, WSI_TOKEN_ORIGIN, g->origin)) why = "wrong Origin: open the address that knead web printed";
    if (!header_is(wsi, WSI_TOKEN_HOST, g->site)) why = "wrong Host: open the address that knead web printed";
    // Refuse HTTP/2, because an HTTP/2 connection would carry many requests but use one place.
    if (!header_is(wsi, WSI_TOKEN_UPGRADE, "websocket")) why = "wrong upgrade: expected websocket";
    if (!why) return 0;
    return refuse(g, wsi, 403, why) ? -1 : 1;
}

// ---- WebSocket

// Close a WebSocket with a code and a reason that the page can show.
static int hang_up(kn_gateway *g, struct lws *wsi, int code, const char *why)
{
    ((session *)lws_wsi_user(wsi))->closing = true;
    tell_refusal(g, why);
    lws_close_reason(wsi, (enum lws_close_status)code, (unsigned char *)(uintptr_t)why, strlen(why));
    return -1;
}

// Free a place for a new page when the places of all pages are taken, and return the index of the place. The oldest
// page for which `stays` returns false loses its place and becomes a guest, which is closed after GUEST_S even if it
// does not read the close reason.
static int oust(kn_gateway *g)
{
    int first = -1;
    for (int i = 0; i < KN_GATEWAY_PAGES; i++)
        if (!g->stays(g->arg, i) && (first < 0 || g->page[i].came < g->page[first].came)) first = i;
    struct lws *wsi = g->page[first].wsi;
    ((session *)lws_wsi_user(wsi))->page = -1;
    g->page[first].wsi = NULL;
    g->on_gone(g->arg, first);
    add_guest(g, wsi);
    lws_callback_on_writable(wsi);
    return first;
}

// Handle the first message of a connection, which must be the token.
static int admit(kn_gateway *g, struct lws *wsi, session *s)
{
    // Ignore further messages of a page that has lost its place.
    if (s->admitted) return 0;
    if (s->length != KN_GATEWAY_TOKEN || lws_frame_is_binary(wsi) || !is_token(g, s->message))
        return hang_up(g, wsi, UNKNOWN, "wrong token: open the address that knead web printed");
    forget_guest(g, wsi);
    int i = 0;
    while (i < KN_GATEWAY_PAGES && g->page[i].wsi) i++;
    s->page = i < KN_GATEWAY_PAGES ? i : oust(g);
    s->admitted = true;
    g->page[s->page] = (kn_web_page){.wsi = wsi, .came = ++g->admitted, .news = true, .measure = -1};
    lws_callback_on_writable(wsi);
    return 0;
}

static uint32_t u32(const uint8_t *at)
{
    return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

// Read a float. Return false if the float is NaN or is not within least..most.
static bool f32(const uint8_t *at, float least, float most, float *value)
{
    uint32_t bits = u32(at);
    memcpy(value, &bits, sizeof bits);
    return *value >= least && *value <= most;
}

// Read the fields of a pointer event. Return false if one of them is out of range.
static bool take_pointer(const uint8_t *b, kn_web_message *m)
{
    bool good = b[5] <= 1 && b[6] == 0 && b[7] == 0 && f32(b + 8, 0, KN_WEB_DEPTH_MAX, &m->depth_m);
    for (int i = 0; i < 3; i++)
        good = good && f32(b + 12 + 4 * i, -KN_WEB_SIGHT_MAX, KN_WEB_SIGHT_MAX, &m->eye_m[i]) &&
               f32(b + 24 + 4 * i, -KN_WEB_SIGHT_MAX, KN_WEB_SIGHT_MAX, &m->sight[i]) &&
               (m->kind != KN_WEB_GRIP || f32(b + 36 + 4 * i, -KN_WEB_SIGHT_MAX, KN_WEB_SIGHT_MAX, &m->second[i]));
    m->pressed = b[5];
    return good && (m->pressed || m->kind != KN_WEB_GRIP);
}

// Handle a binary message: a pointer event, or the acknowledgement of a message.
static int take(kn_gateway *g, struct lws *wsi, session *s)
{
    const uint8_t *b = s->message;
    kn_web_page *page = &g->page[s->page];
    kn_web_message m = {0};
    static const size_t sizes[] = {0, KN_WEB_POINTER_SIZE, KN_WEB_SEEN_SIZE, KN_WEB_GRIP_SIZE};
    m.number = s->length > 4 ? u32(b) : 0, m.kind = s->length > 4 ? b[4] : 0;
    if (m.kind < KN_WEB_POINTER || m.kind > KN_WEB_GRIP || s->length != sizes[m.kind])
        return hang_up(g, wsi, PROTOCOL,
                       "malformed message: expected kind 1 in 36 bytes, 2 in 8, 3 in 48, or JSON as text");
    if (m.kind != KN_WEB_SEEN && !take_pointer(b, &m))
        return hang_up(g, wsi, PROTOCOL,
                       "malformed pointer: expected pressed 0..1, depth 0..0.1 m, a finite line of sight");
    if (m.kind != KN_WEB_SEEN) g->on_message(g->arg, s->page, &m);
    // Accept an acknowledgement only for a message that was sent and is not acknowledged yet. Unsigned differences are
    // right even after the counters have wrapped.
    else if (m.number - page->seen <= page->sent - page->seen) page->seen = m.number;
    if (page->news) lws_callback_on_writable(wsi);
    return 0;
}

// Handle a request in JSON.
static int take_words(kn_gateway *g, struct lws *wsi, const session *s)
{
    char why[120]; // reason for closing; a WebSocket close reason has at most 123 bytes
    kn_page_request request;
    if (!kn_page_request_parse(&request, (const char *)s->message, s->length, why, sizeof why))
        return hang_up(g, wsi, PROTOCOL, why);
    g->on_request(g->arg, s->page, &request);
    return 0;
}

// Collect the fragments of a message. A message longer than any valid one is refused without waiting for its end.
static int receive(kn_gateway *g, struct lws *wsi, session *s, const void *bytes, size_t size)
{
    if (lws_is_first_fragment(wsi)) s->length = 0;
    size_t most = s->page < 0 || lws_frame_is_binary(wsi) ? KN_WEB_GRIP_SIZE : KN_PAGE_REQUEST_MAX;
    // A page that has just lost its place may have received more than a guest may send.
    if (s->length > most || size > most - s->length)
        return hang_up(g, wsi, TOO_BIG, "message too large: expected at most 48 bytes, or 256 of JSON as text");
    memcpy(s->message + s->length, bytes, size);
    s->length += size;
    if (!lws_is_final_fragment(wsi)) return 0;
    if (s->page < 0) return admit(g, wsi, s);
    return lws_frame_is_binary(wsi) ? take(g, wsi, s) : take_words(g, wsi, s);
}

// Return true if another message may be sent to the page.
static bool room(const kn_web_page *p) { return p->wsi && p->sent - p->seen < KN_GATEWAY_IN_FLIGHT; }

// Write the next message of a page, or close a page that has lost its place.
static int write_page(kn_gateway *g, struct lws *wsi, const session *s)
{
    kn_web_page *page = &g->page[s->page < 0 ? 0 : s->page];
    if (s->page < 0 && s->admitted && !s->closing)
        return hang_up(g, wsi, OUSTED, "a newer page has taken the place of this page: reload to take it back");
    if (s->page < 0 || s->closing || !page->news || !room(page)) return 0;
    page->news = false;
    page->sent++;
    size_t size = g->write(g->arg, s->page, g->buffer + LWS_PRE, g->buffer_size);
    return lws_write(wsi, g->buffer + LWS_PRE, size, LWS_WRITE_BINARY) < (int)size ? -1 : 0;
}

// ---- encryption

// Make a certificate for this run and address. No authority signs it; the user compares its printed fingerprint. The
// serial number is random, because Firefox refuses two certificates with the same issuer and number.
static bool certify(kn_gateway *g, SSL_CTX *tls)
{
    char name[64];
    uint8_t digest[SHA256_DIGEST_LENGTH];
    uint64_t serial = 0;
    snprintf(name, sizeof name, "IP:%.*s", (int)strcspn(g->site, ":"), g->site);
    X509 *x = X509_new();
    EVP_PKEY *key = EVP_EC_gen("P-256");
    X509_EXTENSION *at = X509V3_EXT_conf_nid(NULL, NULL, NID_subject_alt_name, name);
    const bool ok =
        x && key && at && getrandom(&serial, sizeof serial, 0) == sizeof serial && X509_set_version(x, 2) &&
        ASN1_INTEGER_set_uint64(X509_get_serialNumber(x), serial >> 1) &&
        // The certificate is valid from one day ago, because a tablet's clock may be slow.
        X509_gmtime_adj(X509_getm_notBefore(x), -86400) &&
        // The certificate is valid for 397 days, the longest time that browsers accept.
        X509_gmtime_adj(X509_getm_notAfter(x), 397 * 86400) &&
        X509_NAME_add_entry_by_txt(X509_get_subject_name(x), "CN", MBSTRING_ASC, (uint8_t *)"knead web", -1, -1, 0) &&
        X509_set_issuer_name(x, X509_get_subject_name(x)) && X509_add_ext(x, at, -1) && X509_set_pubkey(x, key) &&
        X509_sign(x, key, EVP_sha256()) && X509_digest(x, EVP_sha256(), digest, NULL) &&
        SSL_CTX_use_certificate(tls, x) == 1 && SSL_CTX_use_PrivateKey(tls, key) == 1 &&
        SSL_CTX_set_min_proto_version(tls, TLS1_2_VERSION);
    for (int i = 0; ok && i < SHA256_DIGEST_LENGTH; i++)
        sprintf(g->fingerprint + 3 * i, i + 1 < SHA256_DIGEST_LENGTH ? "%02X:" : "%02X", digest[i]);
    X509_EXTENSION_free(at);
    EVP_PKEY_free(key);
    X509_free(x);
    return ok;
}

// ---- events of libwebsockets

// Close a guest (connection without the token) that has stayed for GUEST_S. `s` is NULL if the connection has made no
// request yet.
static int send_away(kn_gateway *g, struct lws *wsi, session *s)
{
    if (s && s->socket && !s->closing)
        return hang_up(g, wsi, UNKNOWN, "no token: open the address that knead web printed");
    shutdown(lws_get_socket_fd(wsi), SHUT_RDWR);
    return -1;
}

// The two protocols, HTTP and WebSocket, share this callback.
static int on_event(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t size)
{
    kn_gateway *g = lws_context_user(lws_get_context(wsi));
    session *s = user;
    switch ((int)reason) {
    case LWS_CALLBACK_WSI_CREATE: return g->connections++, 0;
    case LWS_CALLBACK_WSI_DESTROY: return g->connections--, forget_guest(g, wsi), 0;
    case LWS_CALLBACK_OPENSSL_LOAD_EXTRA_SERVER_VERIFY_CERTS: return certify(g, user) ? 0 : -1;
    case LWS_CALLBACK_HTTP: return serve(g, wsi, in);
    case LWS_CALLBACK_HTTP_FILE_COMPLETION: return lws_http_transaction_completed(wsi) ? -1 : 0;
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE: return confirm(g, wsi);
    case LWS_CALLBACK_ESTABLISHED:
        s->page = -1;
        s->socket = true;
        return 0;
    case LWS_CALLBACK_TIMER: return is_guest(g, wsi) ? send_away(g, wsi, s) : 0;
    case LWS_CALLBACK_RECEIVE: return receive(g, wsi, s, in, size);
    case LWS_CALLBACK_SERVER_WRITEABLE: return write_page(g, wsi, s);
    case LWS_CALLBACK_CLOSED:
        if (s->page < 0) return 0;
        g->page[s->page].wsi = NULL;
        g->on_gone(g->arg, s->page);
        return 0;
    default: return lws_callback_http_dummy(wsi, reason, user, in, size);
    }
}

// ---- listening

bool kn_gateway_host(const char *text, struct in_addr *host)
{
    if (inet_pton(AF_INET, text, host) != 1) return false;
    const uint32_t address = ntohl(host->s_addr);
    // Refuse the address "any", multicast and broadcast.
    return address >> 24 != 0 && !IN_MULTICAST(address) && !IN_BADCLASS(address);
}

int kn_gateway_listen(const char *host, int port, char *error, size_t error_size)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    kn_gateway_host(host, &at.sin_addr);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), on = 1;
    if (fd >= 0 && !setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) &&
        !bind(fd, (struct sockaddr *)&at, sizeof at) && !listen(fd, SOMAXCONN))
        return fd;
    snprintf(error, error_size, "%s:%d: %s%s", host, port, strerror(errno),
             errno == EADDRINUSE && port ? "; --port 0 chooses a free one"
             : errno == EADDRNOTAVAIL    ? "; expected an address of this machine"
                                         : "");
    if (fd >= 0) close(fd);
    return -1;
}

// Accept a connection. The gateway calls accept itself instead of libwebsockets, because the gateway limits the number
// of connections without the token and may delay new connections.
static void on_acceptable(struct ev_loop *ev, ev_io *w, int events)
{
    (void)ev, (void)events;
    kn_gateway *g = w->data;
    int fd = accept4(g->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC), on = 1;
    // If no descriptor is free, pause: otherwise the pending connection would trigger this callback again and again.
    if (fd < 0 && (errno == EMFILE || errno == ENFILE)) {
        pause_accepting(g, g->guests ? CLOSE_EVERY_S : 0.1, "too many descriptors are open");
        if (g->guests) close_oldest(g);
    }
    if (fd < 0) return;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    struct lws *wsi = lws_adopt_socket(g->context, fd); // on failure, this call closes the descriptor
    if (wsi) add_guest(g, wsi);
}

static void on_paused(struct ev_loop *ev, ev_timer *w, int events)
{
    (void)events;
    kn_gateway *g = w->data;
    ev_timer_stop(ev, w);
    ev_io_start(ev, &g->acceptable);
}

// Compose the page's address from the address that the kernel reports for the socket. If this is not the wanted
// address, refuse to start, so that nobody can connect at another address.
static bool make_address(kn_gateway *g, const char *host)
{
    struct sockaddr_in at = {0};
    struct in_addr expected;
    socklen_t size = sizeof at;
    uint8_t random[KN_GATEWAY_TOKEN / 2];
    if (getsockname(g->fd, (struct sockaddr *)&at, &size) != 0 || at.sin_family != AF_INET ||
        !kn_gateway_host(host, &expected) || at.sin_addr.s_addr != expected.s_addr ||
        getrandom(random, sizeof random, 0) != sizeof random)
        return false;
    // Make a new random token for each run of the program.
    for (size_t i = 0; i < sizeof random; i++) sprintf(g->token + 2 * i, "%02x", random[i]);
    const bool here = ntohl(at.sin_addr.s_addr) >> 24 == IN_LOOPBACKNET;
    int n = snprintf(g->origin, sizeof g->origin, "%s://%s", here ? "http" : "https", inet_ntoa(at.sin_addr));
    // Leave out the default port, as browsers do in the headers Origin and Host.
    if (ntohs(at.sin_port) != (here ? 80 : 443))
        snprintf(g->origin + n, sizeof g->origin - (size_t)n, ":%d", ntohs(at.sin_port));
    g->site = strchr(g->origin, '/') + 2;
    snprintf(g->address, sizeof g->address, "%s/#%s", g->origin, g->token);
    return true;
}

bool kn_gateway_open(kn_gateway *g, struct ev_loop *ev, const char *host, int port, int fd, char *error,
                     size_t error_size)
{
    static const struct lws_protocols protocols[] = {
        {"http", on_event, sizeof(session), KN_PAGE_REQUEST_MAX, 0, NULL, AT_ONCE},
        {"knead", on_event, sizeof(session), KN_PAGE_REQUEST_MAX, 0, NULL, AT_ONCE},
        {NULL, NULL, 0, 0, 0, NULL, 0}};
    void *loops[1] = {ev};
    struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN_SERVER,
        .protocols = protocols,
        .user = g,
        .foreign_loops = loops,
        .timeout_secs = PATIENCE_S,
        .keepalive_timeout = PATIENCE_S,
        // Allow only HTTP/1.1, which has one request at a time per connection; HTTP/2 streams would share one place.
        .alpn = "http/1.1",
        .options = LWS_SERVER_OPTION_LIBEV | LWS_SERVER_OPTION_DISABLE_IPV6 |
                   LWS_SERVER_OPTION_HTTP_HEADERS_SECURITY_BEST_PRACTICES_ENFORCE};
    g->ev = ev;
    g->fd = fd >= 0 ? fd : kn_gateway_listen(host, port, error, error_size);
    if (g->fd < 0) return false;
    // Write each error message before the step that may fail. If the step fails, `error` has the reason.
    snprintf(error, error_size, "--listen-fd %d: expected a socket that listens on %s", fd, host);
    if (!make_address(g, host)) return false;
    // Encrypt if the address is not loopback.
    if (strncmp(g->origin, "https", 5) == 0)
        info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT | LWS_SERVER_OPTION_CREATE_VHOST_SSL_CTX;
    lws_set_log_level(LLL_ERR, NULL);
    g->context = lws_create_context(&info);
    snprintf(error, error_size, "libwebsockets does not start on libev: install the package libwebsockets-evlib-ev");
    if (!g->context) return false;
    ev_io_init(&g->acceptable, on_acceptable, g->fd, EV_READ);
    ev_timer_init(&g->pause, on_paused, 0, 0);
    ev_timer_init(&g->expiry, on_expiry, EXPIRY_S, EXPIRY_S);
    g->acceptable.data = g->pause.data = g->expiry.data = g;
    ev_io_start(ev, &g->acceptable);
    ev_timer_start(ev, &g->expiry);
    return true;
}

int kn_gateway_pages(const kn_gateway *g)
{
    int pages = 0;
    for (int i = 0; i < KN_GATEWAY_PAGES; i++) pages += g->page[i].wsi != NULL;
    return pages;
}

bool kn_gateway_wants(const kn_gateway *g, kn_web_draws way)
{
    bool wants = false;
    for (int i = 0; i < KN_GATEWAY_PAGES; i++) wants |= g->page[i].draws == way && room(&g->page[i]);
    return wants;
}

bool kn_gateway_reserve(kn_gateway *g, size_t largest)
{
    uint8_t *buffer = largest > g->buffer_size ? realloc(g->buffer, LWS_PRE + largest) : g->buffer;
    if (buffer && largest > g->buffer_size) g->buffer_size = largest;
    if (buffer) g->buffer = buffer;
    return buffer;
}

void kn_gateway_news(kn_gateway *g)
{
    for (int i = 0; i < KN_GATEWAY_PAGES; i++) {
        g->page[i].news = true;
        if (g->page[i].wsi) lws_callback_on_writable(g->page[i].wsi);
    }
}

void kn_gateway_answer(kn_gateway *g, int page, uint32_t id, bool ok, const char *format, ...)
{
    if (page < 0 || g->page[page].answers == KN_GATEWAY_ANSWERS) return;
    kn_web_answer *a = &g->page[page].answer[g->page[page].answers++];
    va_list args;
    va_start(args, format);
    vsnprintf(a->words, sizeof a->words, format, args);
    va_end(args);
    a->id = id;
    a->ok = ok;
    kn_gateway_news(g);
}

void kn_gateway_close(kn_gateway *g)
{
    if (g->context)
        ev_io_stop(g->ev, &g->acceptable), ev_timer_stop(g->ev, &g->pause), ev_timer_stop(g->ev, &g->expiry);
    if (g->context) lws_context_destroy(g->context);
    if (g->fd >= 0) close(g->fd);
    free(g->buffer);
    *g = (kn_gateway){.fd = -1};
}
