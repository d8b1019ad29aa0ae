#include "clients/tactile/haply_json.h"
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// Plausibility limits. No arm of Haply's is larger than farthest_m.
static const double farthest_m = 1.0, fastest_m_s = 100.0;

bool kn_haply_id_known(const char *id)
{
    size_t n = strspn(id, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-");
    return n > 0 && n < KN_HAPLY_ID && !id[n];
}

// Read the numbers with one-letter names from a JSON object. Return false if a number is missing, or if its magnitude
// is above `most`.
static bool numbers(const json_t *object, const char *names, double most, double *value)
{
    for (; *names; names++, value++) {
        const json_t *n = json_object_get(object, (char[]){*names, 0});
        if (!json_is_number(n)) return false;
        *value = json_number_value(n);
        if (!(fabs(*value) <= most)) return false;
    }
    return true;
}

// Read a quaternion and normalise it. Return false if its length is not close to 1.
static bool orientation(const json_t *object, double wxyz[4])
{
    double q[4];
    if (!numbers(object, "wxyz", 1.1, q)) return false;
    double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(size - 1.0) < 0.1)) return false; // tolerate errors of rounding: the service sends four digits
    for (int i = 0; i < 4; i++) wxyz[i] = q[i] / size;
    return true;
}

// Read the grip. A wireless grip takes precedence over a wired one. A grip without a valid orientation is ignored.
static void read_grip(const json_t *root, kn_haply_state *s)
{
    const char *const kinds[] = {"wireless_verse_grip", "verse_grip"};
    for (int i = 0; i < 2 && !s->grip; i++) {
        const json_t *grip = json_object_get(json_array_get(json_object_get(root, kinds[i]), 0), "state");
        const json_t *buttons = json_object_get(grip, "buttons");
        s->grip = orientation(json_object_get(grip, "orientation"), s->pose.orientation_wxyz);
        for (int b = 0; s->grip && b < 3; b++)
            if (json_is_true(json_object_get(buttons, (const char *[]){"a", "b", "c"}[b]))) s->pose.buttons |= 1 << b;
        // Some grips have a single field "button" instead.
        if (s->grip && json_is_true(json_object_get(grip, "button"))) s->pose.buttons |= 1;
    }
}

// Return the wanted arm, or the first arm with a valid id if device_id is "".
static const json_t *find(const json_t *arms, const char *device_id)
{
    for (size_t i = 0; i < json_array_size(arms); i++) {
        const json_t *arm = json_array_get(arms, i);
        const char *id = json_string_value(json_object_get(arm, "device_id"));
        if (id && kn_haply_id_known(id) && (!*device_id || !strcmp(id, device_id))) return arm;
    }
    return NULL;
}

// Check and read the arm's part of a message. Position and velocity are required. All other fields have defaults.
static kn_haply_heard read_arm(const json_t *root, const char *device_id, kn_haply_state *s, char *error, size_t size)
{
    const json_t *arms = json_object_get(root, "inverse3"), *arm = find(arms, device_id);
    const json_t *state = json_object_get(arm, "state");
    *s = (kn_haply_state){.pose.orientation_wxyz = {1.0}};
    if (!json_is_object(root) || (arms && !json_is_array(arms))) {
        snprintf(error, size, "expected an object with an array inverse3");
        return KN_HAPLY_MALFORMED;
    }
    if (!arm) return KN_HAPLY_ABSENT;
    strcpy(s->device_id, json_string_value(json_object_get(arm, "device_id")));
    if (!numbers(json_object_get(state, "cursor_position"), "xyz", farthest_m, s->pose.position_m)) {
        snprintf(error, size, "expected cursor_position x, y, z within 1 m");
        return KN_HAPLY_MALFORMED;
    }
    if (!numbers(json_object_get(state, "cursor_velocity"), "xyz", fastest_m_s, s->pose.velocity_m_s)) {
        snprintf(error, size, "expected cursor_velocity x, y, z within 100 m/s");
        return KN_HAPLY_MALFORMED;
    }
    // A message without control_mode counts as not idle, so that the watchdog test cannot pass by accident.
    const char *mode = json_string_value(json_object_get(state, "control_mode"));
    s->idle = mode && !strcmp(mode, "idle");
    s->calibrated = !json_is_false(json_object_get(json_object_get(arm, "status"), "calibrated"));
    read_grip(root, s);
    return KN_HAPLY_STATE;
}

kn_haply_heard kn_haply_read(const char *text, size_t size, const char *device_id, kn_haply_state *state, char *error,
                             size_t error_size)
{
    json_error_t why;
    json_t *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why);
    if (!root) {
        // Do not use jansson's error text, because it quotes the received bytes.
        snprintf(error, error_size, "no JSON at byte %d", why.position);
        return KN_HAPLY_MALFORMED;
    }
    kn_haply_heard heard = read_arm(root, device_id, state, error, error_size);
    json_decref(root);
    return heard;
}

int kn_haply_greet(char text[KN_HAPLY_MESSAGE], const char *device_id, const char *preset)
{
    return snprintf(text, KN_HAPLY_MESSAGE,
                    "{\"session\":{\"configure\":{\"profile\":{\"name\":\"knead\"},"
                    "\"basis\":{\"permutation\":\"XYZ\"}}},"
                    "\"inverse3\":[{\"device_id\":\"%s\",\"configure\":{\"preset\":{\"preset\":\"%s\"}},"
                    "\"commands\":{\"set_cursor_force\":{\"vector\":{\"x\":0.0,\"y\":0.0,\"z\":0.0}}}}]}",
                    device_id, preset);
}

int kn_haply_push(char text[KN_HAPLY_MESSAGE], const char *device_id, const double force_n[3])
{
    return snprintf(text, KN_HAPLY_MESSAGE,
                    "{\"inverse3\":[{\"device_id\":\"%s\",\"commands\":{\"set_cursor_force\":{\"vector\":"
                    "{\"x\":%.5f,\"y\":%.5f,\"z\":%.5f}}}}]}",
                    device_id, force_n[0], force_n[1], force_n[2]);
}

int kn_haply_ask(char text[KN_HAPLY_MESSAGE])
{
    return snprintf(text, KN_HAPLY_MESSAGE, "{\"session\":{\"force_render_full_state\":{}}}");
}
