// knead ctl: sends a control command to a running kneadd over its control socket.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/hand/live_server.h"
#include "server/store.h"
#include "server/clock.h"
#include "server/option_table.h"
#include "server/scene_name.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PATIENCE_S 20 // longest wait for an answer, s: a server may build its object anew

static const char help[] =
    "usage: knead ctl [--control PATH] [--json] COMMAND [ARGUMENT]...\n\n"
    "Send a control command to a running kneadd, through the socket that kneadd's option --control names.\n\n"
    "  status           print mode, faults and their remedies, servo loop, connection of every tool, safety actions.\n"
    "                   Without --json, zeros are left out. server/README.md explains the names\n"
    "  reset            restore the initial object; forces fade out, and tools engage again once lifted clear\n"
    "  quality NAME     switch to the quality point fast, balanced, accurate or own; the force fades to zero and back\n"
    "  set KEY=VALUE...\n"
    "                   set keys of the scene; the object keeps its present shape. The force on a hand fades to zero\n"
    "                   and back. Limits of the device can be lowered, never raised\n"
    "  load [SCENE]     check the scene and start again with it; without SCENE, read the present scene's file again\n"
    "  snapshot         save the object to a file, and answer once the file is on disk; needs kneadd --state-dir\n"
    "  restore [N]      restore the object from your snapshot N, or from the newest of yours and the server's own\n"
    "  undo             undo the last kneading, reset or restore\n"
    "  estop            fade every force to 0 within 20 ms and keep it at 0, for new hands as well, until recover.\n"
    "                   The stop stays in force after load. After a restart it stays only with kneadd --state-dir\n"
    "  recover          clear latched faults; tools engage again once they are lifted clear of the object\n"
    "  stop             fade the forces to zero and end kneadd, as SIGTERM does\n\n"
    "  --control PATH   control socket (default: KNEAD_CONTROL of the environment, else " KN_LIVE_SERVER_CONTROL ")\n"
    "  --json           print the answer as received, one JSON object\n\n"
    "Examples:\n"
    "    knead ctl --control control status\n"
    "    knead ctl --control control set material.k1='300 gf/cm^3'\n"
    "    knead ctl --control control snapshot\n"
    "    knead ctl --control control load dough-small\n\n"
    "Exit codes: 0 done, 2 refused, 3 no server on the socket.\n";

typedef struct options {
    const char *path;
    bool json;
} options;

static int parse(options *o, int argc, char **argv)
{
    static const kn_option rows[] = {
        KN_OPTION("control", TEXT, .offset = offsetof(options, path)),
        KN_OPTION("json", FLAG, .offset = offsetof(options, json)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    *o = (options){.path = kn_live_server_control()};
    const int code = kn_options_read(&table, o, argc, argv);
    if (code != KN_OPTIONS_READ || optind < argc) return code;
    return kn_complain("ctl", KN_EXIT_USAGE,
                       "no command: expected status, reset, quality NAME, set KEY=VALUE, load, snapshot, restore, "
                       "undo, estop, recover or stop");
}

static bool is_zero(const json_t *value)
{
    return (json_is_number(value) && json_number_value(value) == 0) || json_is_null(value);
}

static bool ends_in(const char *name, const char *end)
{
    size_t size = strlen(name), tail = strlen(end);
    return size >= tail && strcmp(name + size - tail, end) == 0;
}

// Return true if a member of the answer is not printed: members that are for programs only, and nested members whose
// value is 0.
static bool is_quiet(bool inner, const char *name, const json_t *value)
{
    const char *key;
    json_t *member;
    bool all_zero = json_is_object(value);
    json_object_foreach((json_t *)(uintptr_t)value, key, member) all_zero &= is_zero(member);
    return ends_in(name, "_hist") || strcmp(name, "monotonic_us") == 0 || (inner && (all_zero || is_zero(value)));
}

// Print a wall-clock time, microseconds since 1970, as UTC.
static void print_time(double us)
{
    char text[32];
    time_t s = (time_t)(1e-6 * us);
    struct tm utc;
    strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S UTC", gmtime_r(&s, &utc));
    fputs(text, stdout);
}

// Print a JSON value. A JSON object is printed as "mean 999.8, max 1012"; its members that are 0 are left out.
static void print_value(const char *name, const json_t *value)
{
    const char *key, *between = "";
    json_t *member;
    size_t i;
    if (json_is_string(value)) fputs(json_string_value(value), stdout);
    else if (strncmp(name, "time_", 5) == 0) print_time(json_number_value(value));
    else if (strcmp(name, "snapshot_age_ms") == 0 && json_number_value(value) < 0) fputs("nothing saved", stdout);
    else if (json_is_integer(value)) printf("%" PRId64, (int64_t)json_integer_value(value));
    else if (json_is_real(value)) printf(json_real_value(value) < 1000 ? "%.4g" : "%.0f", json_real_value(value));
    else if (json_is_boolean(value)) fputs(json_is_true(value) ? "yes" : "no", stdout);
    else if (json_is_array(value) && json_array_size(value) == 0) fputs("none", stdout);
    // Print the elements of a JSON array. Numbers are separated by spaces only.
    json_array_foreach(value, i, member)
    {
        if (i > 0) fputs(json_is_number(member) ? " " : ", ", stdout);
        print_value("", member);
    }
    json_object_foreach((json_t *)(uintptr_t)value, key, member)
    {
        if (is_zero(member)) continue;
        printf("%s%s ", between, key);
        print_value(key, member);
        between = ", ";
    }
}

// Print a JSON value on one line, a JSON object with one line per member, and an array of objects one by one under
// their names.
static void show(const char *indent, const char *name, json_t *value)
{
    const char *key;
    json_t *member;
    size_t i;
    if (is_quiet(*indent, name, value)) return;
    if (json_is_object(value) && !*indent) {
        printf("%s\n", name);
        json_object_foreach(value, key, member) show("    ", key, member);
    } else if (json_is_object(json_array_get(value, 0))) {
        json_array_foreach(value, i, member)
        {
            // The member `name` becomes the heading, so remove it from the members that are printed.
            json_t *of = json_incref(json_object_get(member, "name"));
            json_object_del(member, "name");
            printf("probe ");
            show("", json_is_string(of) ? json_string_value(of) : name, member);
            json_decref(of);
        }
    } else {
        printf("%s%-*s ", indent, 34 - (int)strlen(indent), name);
        print_value(name, value);
        putchar('\n');
    }
}

// Print the answer of kneadd to a command. Return the exit code.
static int tell(const options *o, const char *command, json_t *answer)
{
    const char *error = json_string_value(json_object_get(answer, "error")), *key;
    const json_t *tick = json_object_get(answer, "tick"), *generation = json_object_get(answer, "generation"),
                 *stored = json_object_get(answer, "stored_after_j");
    json_t *value;
    if (o->json) {
        json_dumpf(answer, stdout, JSON_COMPACT);
        putchar('\n');
    } else if (error) {
        fprintf(stderr, "knead ctl: %s\n", error);
    } else if (strcmp(command, "status") == 0) {
        json_object_del(answer, "ok");
        json_object_foreach(answer, key, value) show("", key, value);
        // The answer to the commands snapshot and restore has a member `generation`, the number of the snapshot.
    } else if (json_integer_value(generation) > 0) {
        const int64_t number = json_integer_value(generation), later = number % KN_STORE_OWN;
        printf("%s: snapshot %" PRId64, command, number / KN_STORE_OWN);
        if (later) printf(" and the server's own %" PRId64 " later", later);
        printf(", tick %" PRId64 "\n", (int64_t)json_integer_value(tick));
        // The answer to a command that changes the object contains the stored energy before and after the change.
    } else if (stored) {
        printf("%s: tick %" PRId64 ", the object stores %.4g mJ, %.4g before\n", command,
               (int64_t)json_integer_value(tick), 1e3 * json_real_value(stored),
               1e3 * json_real_value(json_object_get(answer, "stored_before_j")));
    } else if (tick) {
        printf("%s: tick %" PRId64 "\n", command, (int64_t)json_integer_value(tick));
    } else {
        printf("%s: done\n", command);
    }
    return error ? KN_EXIT_USAGE : KN_EXIT_OK;
}

// Make a path absolute, because the working directory of the server may be different.
static json_t *absolute(const char *path)
{
    // realpath returns NULL if the file does not exist. In that case send the path unchanged, and the server reports
    // the error.
    char *whole = realpath(path, NULL);
    json_t *text = json_string(whole ? whole : path);
    free(whole);
    return text;
}

// Add the argument of the command load, restore or quality to the request. The server refuses an argument that the
// command does not accept.
static void add_argument(json_t *request, const char *command, const char *argument)
{
    long long number;
    char end;
    if (strcmp(command, "load") == 0) {
        // An unknown name is sent unchanged: the server may know it, and reports the error if not.
        kn_scene_take(&argument, argument);
        json_object_set_new(request, "scene", absolute(argument));
    } else if (strcmp(command, "restore") != 0) json_object_set_new(request, "name", json_string(argument));
    else if (sscanf(argument, "%18lld%c", &number, &end) == 1)
        json_object_set_new(request, "generation",
                            json_integer(number < KN_STORE_OWN ? number * KN_STORE_OWN : number));
    else json_object_set_new(request, "generation", json_string(argument));
}

// Add the arguments of the command set to the request.
static int add_values(json_t *request, char **values)
{
    json_t *list = json_array();
    for (; *values; values++)
        if (json_array_append_new(list, json_string(*values)) != 0)
            return kn_complain("ctl", KN_EXIT_USAGE, "%s: expected KEY=VALUE in UTF-8", *values);
    json_object_set_new(request, "values", list);
    return KN_EXIT_OK;
}

// Wait until kneadd serves the new scene. Otherwise the next command might still reach the run with the old scene.
static int await_next(const options *o, double since_us)
{
    char error[256];
    json_t *request = json_pack("{s:s}", "command", "status");
    bool next = false;
    for (int i = 0; i < PATIENCE_S * 20 && !next; i++) {
        nanosleep(&(struct timespec){.tv_nsec = 50000000}, NULL);
        json_t *status = kn_live_server_ask(o->path, request, error, sizeof error);
        // The answer comes from the new run of kneadd if that run started after the command was sent.
        double up_s = json_real_value(json_object_get(status, "uptime_s"));
        next = status && (double)json_integer_value(json_object_get(status, "time_us")) - 1e6 * up_s > since_us;
        json_decref(status);
    }
    json_decref(request);
    return next
               ? KN_EXIT_OK
               : kn_complain("ctl", KN_EXIT_DEVICE, "load: no server after %d s; see the stderr of kneadd", PATIENCE_S);
}

int kn_ctl_main(int argc, char **argv)
{
    options o;
    char error[256];
    int code = parse(&o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    code = KN_EXIT_OK;
    const char *command = argv[optind], *argument = argv[optind + 1];
    bool set = strcmp(command, "set") == 0, load = strcmp(command, "load") == 0;
    // Only the command `set` accepts more than one argument.
    if (argument && argv[optind + 2] && !set)
        return kn_complain("ctl", KN_EXIT_USAGE, "%s: expected one argument", argv[optind + 2]);
    json_t *request = json_pack("{s:s}", "command", command);
    if (request && set) code = add_values(request, argv + optind + 1);
    else if (request && argument) add_argument(request, command, argument);
    if (code != KN_EXIT_OK) return json_decref(request), code;
    double now_us = (double)kn_wall_us();
    json_t *answer = request ? kn_live_server_ask(o.path, request, error, sizeof error) : NULL;
    // The command `load` ends the run of kneadd and starts a new run in the same process, so wait for the new run.
    if (answer && load && json_is_true(json_object_get(answer, "ok"))) code = await_next(&o, now_us);
    if (answer && code == KN_EXIT_OK) code = tell(&o, command, answer);
    else if (request && !answer) code = kn_complain("ctl", KN_EXIT_DEVICE, "%s", error);
    else if (!request) code = kn_complain("ctl", KN_EXIT_USAGE, "%s: expected a command in UTF-8", command);
    json_decref(answer);
    json_decref(request);
    return code;
}
