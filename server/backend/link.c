#include "server/backend/link.h"
#include "core/scene/keys.h"
#include "server/option_table.h"
#include <stdio.h>
#include <string.h>

enum { BAUD = 3000000 };

static const char expected[] = "uart:/dev/NAME?baud=N, pty:/dev/pts/N, pcie:DDDD:BB:DD.F or shm:NAME, and at will, "
                               "each once, ?miss=MS, shadow=full|checked|off, and with the latter two lost=stop|go-on";

const char *kn_link_words(kn_link_status status)
{
    static const char *const words[] = {[KN_LINK_OK] = "ok",
                                        [KN_LINK_LATE] = "late",
                                        [KN_LINK_CRC] = "wrong checksum",
                                        [KN_LINK_PROTOCOL] = "not the answer of a circuit",
                                        [KN_LINK_IO] = "no answer",
                                        [KN_LINK_GONE] = "gone"};
    return words[status];
}

typedef struct options {
    double baud, miss_ms; // 0: not given in the URI
    int shadow, lost;     // indices of their words, -1: not given
} options;

// Return false at an unknown or repeated key or a value out of range.
static bool take_option(const char *key, const char *value, options *o)
{
    if (strcmp(key, "baud") == 0 && o->baud == 0) return kn_number_take(value, 1, 1e8, &o->baud);
    if (strcmp(key, "miss") == 0 && o->miss_ms == 0) return kn_number_take(value, 0.1, 60000, &o->miss_ms);
    if (strcmp(key, "shadow") == 0 && o->shadow < 0) return (o->shadow = kn_choice_of("full|checked|off", value)) >= 0;
    if (strcmp(key, "lost") == 0 && o->lost < 0) return (o->lost = kn_choice_of("stop|go-on", value)) >= 0;
    return false;
}

// Parse "KEY=VALUE&...", the text behind a '?'.
static bool parse_options(char *text, options *o)
{
    for (char *next, *key = text; key && *key; key = next) {
        if ((next = strchr(key, '&'))) *next++ = 0;
        char *value = strchr(key, '=');
        if (!value) return false;
        *value++ = 0;
        if (!take_option(key, value, o)) return false;
    }
    return true;
}

bool kn_link_is_function(const char *s)
{
    for (const char *form = "xxxx:xx:xx.x"; *form; form++, s++) {
        if (*form == 'x' ? !*s || !strchr("0123456789abcdefABCDEF", *s) : *s != *form) return false;
    }
    return *s == 0;
}

// Return true for the name of a file in /dev/shm: no folder, not hidden.
static bool is_name(const char *s) { return *s && *s != '.' && strlen(s) < 200 && !strchr(s, '/'); }

// Open the transport of the scheme.
static bool open_parsed(kn_link *link, const char *scheme, const char *where, const options *o, const char *sysfs,
                        char why[KN_LINK_WHY])
{
    if (strcmp(scheme, "uart") == 0) return kn_link_uart(link, where, o->baud > 0 ? (int)o->baud : BAUD, sysfs, why);
    if (strcmp(scheme, "pty") == 0) return kn_link_uart(link, where, 0, sysfs, why);
    if (strcmp(scheme, "pcie") == 0) return kn_link_pcie(link, where, sysfs, why);
    return kn_link_shm(link, where, why);
}

// Return true if this scheme may have this place; only uart has a rate.
static bool good(const char *scheme, const char *where, const options *o)
{
    if (strcmp(scheme, "uart") == 0) return *where == '/';
    if (o->baud > 0) return false;
    if (strcmp(scheme, "pty") == 0) return *where == '/';
    if (strcmp(scheme, "pcie") == 0) return kn_link_is_function(where);
    return strcmp(scheme, "shm") == 0 && is_name(where);
}

// Split a URI. text becomes the scheme. Return what follows the scheme; NULL if the URI is wrong, with what was
// expected in why.
static const char *parse(const char *uri, char text[KN_LINK_URI], options *o, char why[KN_LINK_WHY])
{
    // A URI that is too long becomes empty, and is then refused as it has no scheme.
    *o = (options){.shadow = -1, .lost = -1};
    size_t length = strlen(uri);
    memset(text, 0, KN_LINK_URI);
    memcpy(text, uri, length < KN_LINK_URI ? length : 0);
    char *where = strchr(text, ':'), *query = strchr(text, '?');
    if (where) *where++ = 0;
    if (query) *query++ = 0;
    if (where && parse_options(query, o) && good(text, where, o) && (o->shadow > 0 || o->lost < 0))
        return o->baud == 0 || kn_link_is_baud((int)o->baud, why) ? where : NULL;
    snprintf(why, KN_LINK_WHY, "%.100s: expected %s", uri, expected);
    return NULL;
}

bool kn_link_is_uri(const char *uri, char why[KN_LINK_WHY])
{
    char text[KN_LINK_URI];
    options o;
    return parse(uri, text, &o, why);
}

bool kn_link_open(kn_link *link, const char *uri, const char *sysfs, char why[KN_LINK_WHY])
{
    char text[KN_LINK_URI];
    options o;
    const char *where = parse(uri, text, &o, why);
    if (!where || !open_parsed(link, text, where, &o, sysfs, why)) return false;
    link->miss_ns = (int64_t)(1e6 * (o.miss_ms > 0 ? o.miss_ms : 1.6));
    link->shadow = o.shadow > 0 ? (kn_shadow)o.shadow : KN_SHADOW_FULL;
    link->goes_on = o.lost > 0;
    return true;
}
