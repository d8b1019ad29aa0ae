// libFuzzer target: any bytes from a page give a request with all fields within bounds, or one line of error that
// fits into a WebSocket's close reason.
#include "clients/web/gateway.h"
#include "tests/fuzz/fuzz.h"
#include <math.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char error[124] = "";
    kn_page_request r;
    bool ok = kn_page_request_parse(&r, (const char *)data, size, error, sizeof error);
    require(ok == !*error && strlen(error) < 120);
    if (!ok) return 0;
    require(r.id >= 1 && r.verb < KN_VERBS && *kn_page_verb_word(r.verb) && strlen(r.name) < sizeof r.name);
    require(!strpbrk(r.name, "/\\ \n'\"") && isfinite(r.value));
    require(fabs(r.azimuth_deg) <= 180 && r.elevation_deg <= 90 && r.zoom <= KN_PAGE_REQUEST_ZOOM);
    if (r.verb == KN_VERB_VIEW) require(r.elevation_deg >= 2 && r.zoom >= 1);
    return 0;
}
