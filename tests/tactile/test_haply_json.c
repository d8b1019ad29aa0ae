#include "clients/tactile/haply.h"
#include "tests/check.h"
#include "tests/words.h"
#include <jansson.h>

static kn_haply_state state;
static char error[128];

static kn_haply_heard hear(const char *text, const char *device_id)
{
    *error = 0;
    return kn_haply_read(text, strlen(text), device_id, &state, error, sizeof error);
}

// An arm's entry as in Haply's documentation of version 3.5.
#define ARM(id, x, calibrated)                                                                                         \
    "{\"device_id\":\"" id "\",\"state\":{\"cursor_position\":{\"x\":" x ",\"y\":-0.12,\"z\":0.15},"                   \
    "\"cursor_velocity\":{\"x\":0.0,\"y\":0.5,\"z\":-1e-3},\"body_orientation\":{\"w\":0,\"x\":1,\"y\":0,\"z\":0},"    \
    "\"control_mode\":\"idle\"},\"status\":{\"calibrated\":" calibrated ",\"ready\":true}}"

TEST("by default the state of the first arm is read, in metres and m/s")
{
    CHECK(hear("{\"session_id\":7,\"inverse3\":[" ARM("049D", "0.03", "true") "," ARM("04BA", "0", "true") "]}", "") ==
          KN_HAPLY_STATE);
    CHECK_STR(state.device_id, "049D");
    CHECK(state.pose.position_m[0] == 0.03 && state.pose.position_m[1] == -0.12 && state.pose.position_m[2] == 0.15);
    CHECK(state.pose.velocity_m_s[1] == 0.5 && state.pose.velocity_m_s[2] == -1e-3);
    CHECK(state.calibrated && !state.grip && state.pose.buttons == 0);
    CHECK(state.pose.orientation_wxyz[0] == 1.0); // without a grip the arm's orientation is not the tool's
}

TEST("the state of the requested arm is read, and a missing arm is absent, not malformed")
{
    const char *two = "{\"inverse3\":[" ARM("049D", "0.03", "true") "," ARM("04BA", "1", "false") "]}";
    CHECK(hear(two, "04BA") == KN_HAPLY_STATE && state.pose.position_m[0] == 1.0 && !state.calibrated);
    CHECK(hear(two, "9999") == KN_HAPLY_ABSENT);
    CHECK(hear("{\"inverse3\":[]}", "") == KN_HAPLY_ABSENT && hear("{}", "") == KN_HAPLY_ABSENT);
}

TEST("a grip of either kind sets the orientation and the buttons of the tool")
{
    CHECK(hear("{\"inverse3\":[" ARM("A", "0",
                                     "true") "],\"wireless_verse_grip\":[{\"state\":{\"orientation\":"
                                             "{\"w\":0.7113037,\"x\":-0.01940918,\"y\":0.7026367,\"z\":0.00048828125},"
                                             "\"buttons\":{\"a\":true,\"b\":false,\"c\":true}}}]}",
               "") == KN_HAPLY_STATE);
    const double *q = state.pose.orientation_wxyz;
    CHECK(state.grip && state.pose.buttons == 5);
    CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-12);
    CHECK_NEAR(q[2], 0.7026, 1e-3);
    CHECK(hear("{\"inverse3\":[" ARM("A", "0",
                                     "true") "],\"wireless_verse_grip\":[],\"verse_grip\":[{\"state\":"
                                             "{\"orientation\":{\"w\":0,\"x\":0,\"y\":0,\"z\":1},\"button\":true}}]}",
               "") == KN_HAPLY_STATE);
    CHECK(state.grip && state.pose.buttons == 1 && state.pose.orientation_wxyz[3] == 1.0);
    CHECK(hear("{\"inverse3\":[" ARM("A", "0", "true") "],\"verse_grip\":[{\"state\":{\"orientation\":"
                                                       "{\"w\":0,\"x\":0,\"y\":0,\"z\":0}}}]}",
               "") == KN_HAPLY_STATE);
    CHECK(!state.grip && state.pose.orientation_wxyz[0] == 1.0);
}

TEST("a malformed state is refused with a message in printable ASCII")
{
    const char *wrong = "|[|{|null|[]|7|{\"inverse3\":7}|{\"inverse3\":[|{\"inverse3\":[]}}|\xff\xfe|"
                        "{\"inverse3\":[{\"device_id\":\"A\"}]}|{\"inverse3\":[{\"device_id\":\"A\",\"state\":"
                        "{\"cursor_position\":{\"x\":0,\"y\":0,\"z\":0},\"cursor_velocity\":"
                        "{\"x\":0,\"y\":0,\"z\":1e6}}}]}|{\"inverse3\":[" ARM("A", "0", "true") "],\"inverse3\":[]}";
    const char *arms[] = {ARM("A", "\"0\"", "true"), ARM("A", "1.5", "true"), ARM("A", "1e999", "true"),
                          ARM("A", "null", "true"), ARM("A", "NaN", "true")};
    for (int i = 0; i < 5 || word_of(wrong, i - 5); i++) {
        char text[1000];
        snprintf(text, sizeof text, i < 5 ? "{\"inverse3\":[%s]}" : "%s", i < 5 ? arms[i] : word_of(wrong, i - 5));
        if (hear(text, "") != KN_HAPLY_MALFORMED) KN_TEST_FAIL("taken: %s", text);
        CHECK(*error);
        for (const char *c = error; *c; c++) CHECK(*c >= ' ' && *c <= '~');
    }
}

TEST("an id with a quote, blank or backslash, or with 32 characters, is refused")
{
    CHECK(kn_haply_id_known("049D") && kn_haply_id_known("a_b-9"));
    CHECK(!kn_haply_id_known("") && !kn_haply_id_known("a\"") && !kn_haply_id_known("a b") && !kn_haply_id_known("\\"));
    CHECK(!kn_haply_id_known("0123456789012345678901234567890_"));
    CHECK(hear("{\"inverse3\":[" ARM("A\\\"}", "0", "true") "]}", "") == KN_HAPLY_ABSENT);
}

TEST("messages to the service are valid JSON, even with the longest id")
{
    char text[KN_HAPLY_MESSAGE];
    const char *longest = "0123456789012345678901234567890";
    double x, y, z;
    const char *id, *preset;
    CHECK(kn_haply_push(text, longest, (double[]){1.5, -40.0, 1e-6}) < KN_HAPLY_MESSAGE);
    json_t *root = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    CHECK(json_unpack(root, "{s:[{s:s,s:{s:{s:{s:F,s:F,s:F!}!}!}!}!]!}", "inverse3", "device_id", &id, "commands",
                      "set_cursor_force", "vector", "x", &x, "y", &y, "z", &z) == 0);
    CHECK(x == 1.5 && y == -40.0 && fabs(z) < 1e-5 && !strcmp(id, longest));
    json_decref(root);
    CHECK(kn_haply_greet(text, longest, longest) < KN_HAPLY_MESSAGE);
    root = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    CHECK(json_unpack(root, "{s:[{s:{s:{s:s!}!}}]}", "inverse3", "configure", "preset", "preset", &preset) == 0);
    CHECK_STR(preset, longest);
    CHECK(json_unpack(root, "{s:{s:{s:{s:s!}}}}", "session", "configure", "basis", "permutation", &id) == 0);
    CHECK_STR(id, "XYZ");
    json_decref(root);
    CHECK(kn_haply_ask(text) < KN_HAPLY_MESSAGE);
    root = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
    CHECK(json_is_object(json_object_get(json_object_get(root, "session"), "force_render_full_state")));
    json_decref(root);
}

TEST("only an address of the form ws://HOST:PORT is accepted")
{
    char host[KN_HAPLY_HOST];
    int port = 0;
    CHECK(kn_haply_url("ws://localhost:10001", host, &port) && !strcmp(host, "localhost") && port == 10001);
    CHECK(kn_haply_url("ws://127.0.0.1:10001/", host, &port) && !strcmp(host, "127.0.0.1"));
    const char *wrong = "|localhost:10001|http://localhost:10001|ws://localhost|ws://localhost:0|ws://:10001|"
                        "ws://localhost:65536|ws://localhost:10001/x|ws://localhost:10001x|wss://localhost:1";
    for (int i = 0; word_of(wrong, i); i++)
        if (kn_haply_url(word_of(wrong, i), host, &port)) KN_TEST_FAIL("taken: %s", word_of(wrong, i));
}

TESTS_MAIN
