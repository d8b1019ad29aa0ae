// The text requests that a page may make.
#include "clients/web/gateway.h"
#include "tests/check.h"

static char error[124];

// Parse a request, written with ' instead of ".
static bool taken(kn_page_request *r, const char *text)
{
    char line[200];
    snprintf(line, sizeof line, "%s", text);
    for (char *c = line; (c = strchr(c, '\''));) *c = '"';
    *error = 0;
    return kn_page_request_parse(r, line, strlen(line), error, sizeof error);
}

TEST("every verb without fields is parsed with its id")
{
    kn_page_request r;
    char text[64];
    for (kn_page_verb v = KN_VERB_RESET; v <= KN_VERB_RECORD; v++) {
        snprintf(text, sizeof text, "{'id': 4294967295, 'do': '%s'}", kn_page_verb_word(v));
        CHECK(taken(&r, text) && r.verb == v && r.id == 4294967295u);
    }
}

TEST("each field is parsed, and a value outside its range is refused")
{
    kn_page_request r;
    CHECK(taken(&r, "{'id':1,'do':'set','name':'k1','value':4.6e5}"));
    CHECK(!strcmp(r.name, "k1") && r.value == 4.6e5);
    CHECK(taken(&r, "{'id':1,'do':'scene','name':'dough-small.yaml'}"));
    CHECK(!strcmp(r.name, "dough-small.yaml"));
    CHECK(taken(&r, "{'id':1,'do':'view','azimuth':-180,'elevation':90,'zoom':1}"));
    CHECK(r.azimuth_deg == -180 && r.elevation_deg == 90 && r.zoom == 1);
    CHECK(taken(&r, "{'id':1,'do':'play','value':12}") && r.value == 12);
    CHECK(taken(&r, "{'id':1,'do':'stop','value':3}") && r.verb == KN_VERB_STOP && r.value == 3);
    CHECK(!taken(&r, "{'id':1,'do':'view','azimuth':181,'elevation':20,'zoom':1}"));
    CHECK(strstr(error, "azimuth"));
    CHECK(!taken(&r, "{'id':1,'do':'view','azimuth':0,'elevation':1,'zoom':1}"));
    CHECK(!taken(&r, "{'id':1,'do':'play','value':1.5}") && strstr(error, "recording"));
    CHECK(!taken(&r, "{'id':1,'do':'play','value':0}"));
}

TEST("any other text is refused with an error short enough for a close reason")
{
    static const char bad[] =
        "\nx\n[]\nnull\n{}\n{'id':1}\n{'do':'undo'}\n{'id':0,'do':'undo'}\n{'id':4294967296,'do':'undo'}\n"
        "{'id':1.0,'do':'undo'}\n{'id':'1','do':'undo'}\n{'id':1,'do':'Undo'}\n{'id':1,'do':7}\n"
        "{'id':1,'do':'undo','value':1}\n{'id':1,'id':1,'do':'undo'}\n{'id':1,'do':'undo'} x\n{'id':1,'do':'stop'}\n"
        "{'id':1,'do':'set','name':'k1'}\n{'id':1,'do':'set','name':'k1','value':'1'}\n"
        "{'id':1,'do':'scene','name':''}\n{'id':1,'do':'scene','name':'a/b'}\n"
        "{'id':1,'do':'scene','name':'a\\u0000b'}\n{'id':1,'do':'scene','name':'a b'}\n"
        "{'id':1,'do':'scene','name':'\xc3\xa4'}\n"
        "{'id':1,'do':'scene','name':'0123456789012345678901234567890123456789012345678901234567890123'}\n";
    kn_page_request r;
    char line[200];
    for (const char *at = bad, *end; (end = strchr(at, '\n')); at = end + 1) {
        snprintf(line, sizeof line, "%.*s", (int)(end - at), at);
        CHECK(!taken(&r, line));
        CHECK(strstr(error, "expected") && strlen(error) < 120);
    }
}

TEST("a message longer than KN_REQUEST_MAX is refused")
{
    kn_page_request r;
    char text[KN_PAGE_REQUEST_MAX + 2];
    memset(text, ' ', sizeof text);
    memcpy(text, "{\"id\":1,\"do\":\"undo\"}", 20);
    CHECK(kn_page_request_parse(&r, text, KN_PAGE_REQUEST_MAX, error, sizeof error));
    CHECK(!kn_page_request_parse(&r, text, KN_PAGE_REQUEST_MAX + 1, error, sizeof error));
}

TESTS_MAIN
