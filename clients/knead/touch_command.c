// knead touch: shows the contact of a tool on a running kneadd --touch, as a picture in the terminal, as lines or as
// JSON.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/hand/bus_client.h"
#include "clients/hand/live_server.h"
#include "proto/knead_touch_patch_t.h"
#include "server/option_table.h"
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CHANNEL "KNEAD_TOUCH_"
#define CELLS 8     // number of cells along each side of the pressure map
#define FRAME_MS 40 // shortest time between two pictures: 25 pictures per second
// If no patch message arrives for this time, nobody holds the tool; kneadd sends one every 4 ms.
#define SILENCE_MS 300
#define PATIENCE_MS 4000 // longest wait for the first patch message

static const char help[] =
    "usage: knead touch [--probe NAME] [OPTION]...\n\n"
    "Show the contact of a tool, from a running `kneadd --touch` with a hand at the tool: a map of 8 by 8 pressures\n"
    "over the tool's face, seen from inside the tool, the contact area and the peak pressure. The centre of\n"
    "pressure, the mean normal (out of the object) and the slip velocity of the skin under the tool are in the\n"
    "tool's frame. On a terminal the picture is redrawn in place. Otherwise one line per message is printed, 250 per\n"
    "second.\n\n"
    "  --probe NAME     tool of the scene (default: the first tool whose messages arrive)\n"
    "  --json           print one JSON object per line, in SI units. proto/README.md explains the grid pressure_pa\n"
    "  --once           end with the first message that reports contact\n"
    "  --seconds TIME   end after this time, e.g. '4 s' or '500 ms' (default: run until Ctrl-C)\n"
    "  --lcm-url URL    bus of the touch patches (default: LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n\n"
    "Examples:\n"
    "    knead touch --once\n"
    "    knead touch --probe plate --json --seconds '500 ms'\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no message, or with --once no contact.\n";

typedef struct watch {
    const char *probe, *url;
    double seconds; // time to run; INFINITY: run until a signal
    bool json, once, draws;
    char name[64];             // name of the tool that is shown; "": not known yet
    knead_touch_patch_t patch; // newest contact patch of the tool
    // heard: number of patch messages received. drawn: value of `heard` when the last picture was drawn. touched:
    // number of patch messages that report contact.
    int64_t heard, drawn, touched;
    int64_t heard_ms, first_us;
    bool on_screen;
} watch;

// --- options --------------------------------------------------------------------------------------------------------

static int parse(watch *w, int argc, char **argv)
{
#define AT(member) .offset = offsetof(watch, member)
    static const kn_option rows[] = {
        KN_OPTION("probe", TEXT, AT(probe)),
        KN_OPTION("json", FLAG, AT(json)),
        KN_OPTION("once", FLAG, AT(once)),
        KN_OPTION("seconds", QUANTITY, AT(seconds), .unit = "s", KN_RANGE(0.1, 86400),
                  .expected = "a time from 0.1 to 86400 s"),
        KN_OPTION("lcm-url", TEXT, AT(url)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    char error[256];
    const int code = kn_options_read(&table, w, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) return kn_complain("touch", KN_EXIT_USAGE, "`%s`: expected options only", argv[optind]);
    if (w->probe && (!*w->probe || strspn(w->probe, "abcdefghijklmnopqrstuvwxyz0123456789_") != strlen(w->probe) ||
                     strlen(w->probe) >= KN_NAME_MAX))
        return kn_complain("touch", KN_EXIT_USAGE, "--probe %s: expected a tool's name, [a-z0-9_]+", w->probe);
    if (kn_bus_client_check(w->url, KN_FORCE_URL, error, sizeof error)) return code;
    return kn_complain("touch", KN_EXIT_USAGE, "%s", error);
}

// --- output ---------------------------------------------------------------------------------------------------------

// Print the contact patch as lines of text.
static void print_words(const watch *w)
{
    const knead_touch_patch_t *t = &w->patch;
    const double *c = t->centre_m, *n = t->normal, *s = t->slip_velocity_m_s;
    if (!(t->area_m2 > 0)) printf("touches nothing");
    else
        printf("area %.2f cm2, peak %.2f kPa, centre %+.2f %+.2f %+.2f mm, normal %+.3f %+.3f %+.3f, slip %+.2f %+.2f "
               "%+.2f mm/s",
               1e4 * t->area_m2, 1e-3 * t->peak_pressure_pa, 1e3 * c[0], 1e3 * c[1], 1e3 * c[2], n[0], n[1], n[2],
               1e3 * s[0], 1e3 * s[1], 1e3 * s[2]);
}

static void print_line(const watch *w)
{
    printf("%.3f s, %s: ", 1e-6 * (double)(w->patch.utime - w->first_us), w->name);
    print_words(w);
    putchar('\n');
}

static void print_vector(const char *name, const double *v, int count)
{
    printf(",\"%s\":[", name);
    for (int i = 0; i < count; i++) printf("%s%.9g", i ? "," : "", v[i]);
    putchar(']');
}

static void print_json(const watch *w)
{
    const knead_touch_patch_t *t = &w->patch;
    printf("{\"probe\":\"%s\",\"utime\":%" PRId64 ",\"session\":%" PRId64 ",\"pose_seq\":%" PRId64, w->name, t->utime,
           t->session, t->pose_seq);
    printf(",\"area_m2\":%.9g,\"peak_pressure_pa\":%.9g", t->area_m2, t->peak_pressure_pa);
    print_vector("centre_m", t->centre_m, 3);
    print_vector("normal", t->normal, 3);
    print_vector("slip_velocity_m_s", t->slip_velocity_m_s, 3);
    printf(",\"pressure_pa\":[");
    for (int i = 0; i < CELLS; i++)
        for (int j = 0; j < CELLS; j++)
            printf("%s%.9g%s", j ? "," : i ? ",[" : "[", t->pressure_pa[i][j], j == CELLS - 1 ? "]" : "");
    puts("]}");
}

// Draw the pressure map over the previous map. The top row has the largest v (second coordinate of the patch). The cell
// with the highest pressure is '@', and a cell with a pull is '~'.
static void draw(watch *w)
{
    static const char ramp[] = " .:-=+*#%@";
    const int steps = (int)sizeof ramp - 2;
    double most = 0;
    for (int i = 0; i < CELLS * CELLS; i++) most = fmax(most, w->patch.pressure_pa[i / CELLS][i % CELLS]);
    // Move the cursor back to the first line of the last picture.
    if (w->on_screen) printf("\033[%dA", CELLS + 3);
    printf("\r%s: ", w->name);
    if (kn_live_server_now_ms() - w->heard_ms > SILENCE_MS) printf("no hand holds the tool");
    else print_words(w);
    printf("\033[K\n  v +----------------+\033[K\n");
    for (int i = CELLS - 1; i >= 0; i--) {
        printf("    |");
        for (int j = 0; j < CELLS; j++) {
            double p = w->patch.pressure_pa[i][j];
            char c = p < 0 ? '~' : most > 0 ? ramp[(int)ceil(steps * p / most)] : ' ';
            printf("%c%c", c, c);
        }
        if (i == CELLS - 1 && most > 0) printf("|  @@ %.2f kPa\033[K\n", 1e-3 * most);
        else printf("|\033[K\n");
    }
    printf("    +----------------+ u\033[K\n");
    fflush(stdout);
    w->on_screen = true;
    w->drawn = w->heard;
}

// --- messages -------------------------------------------------------------------------------------------------------

// Return true if all numbers are finite.
static bool all_finite(const knead_touch_patch_t *t)
{
    double sum = t->area_m2 + t->peak_pressure_pa;
    for (int k = 0; k < 3; k++) sum += t->centre_m[k] + t->normal[k] + t->slip_velocity_m_s[k];
    for (int i = 0; i < CELLS * CELLS; i++) sum += t->pressure_pa[i / CELLS][i % CELLS];
    return isfinite(sum);
}

// Take the contact patch of a message. If the user named no tool, the tool of the first patch is shown from then on.
static void on_touch(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    watch *w = user;
    knead_touch_patch_t patch;
    const char *name = channel + strlen(CHANNEL);
    // With --once the first contact ends the program.
    if (w->once && w->touched > 0) return;
    if (knead_touch_patch_t_decode(buffer->data, 0, (int)buffer->data_size, &patch) < 0 || !all_finite(&patch)) return;
    if (!*w->name) snprintf(w->name, sizeof w->name, "%s", name);
    if (strcmp(w->name, name) != 0) return;
    if (w->heard++ == 0) w->first_us = patch.utime;
    w->patch = patch;
    w->heard_ms = kn_live_server_now_ms();
    w->touched += patch.area_m2 > 0;
    if (w->draws || (w->once && w->touched == 0)) return;
    if (w->json) print_json(w);
    else print_line(w);
    fflush(stdout);
}

// Return the time at which the program stops: after --seconds, or, without --seconds, after PATIENCE_MS if no patch has
// arrived.
static int64_t until_ms(const watch *w, int64_t start_ms)
{
    if (isfinite(w->seconds)) return start_ms + (int64_t)(1e3 * w->seconds);
    return w->heard ? INT64_MAX : start_ms + PATIENCE_MS;
}

// Receive patch messages and draw pictures until the program stops. Return the exit code.
static int look(watch *w, kn_bus_client *bus)
{
    int64_t start_ms = kn_live_server_now_ms(), drawn_ms = 0, now_ms = start_ms;
    for (; now_ms < until_ms(w, start_ms) && !(w->once && w->touched) && !ferror(stdout);
         now_ms = kn_live_server_now_ms()) {
        kn_bus_client_handle(bus, FRAME_MS);
        // When messages stop, draw once more to say that nobody holds the tool.
        bool stale = w->heard && now_ms - w->heard_ms > SILENCE_MS;
        if (!w->draws || now_ms - drawn_ms < FRAME_MS || (w->heard == w->drawn && !stale)) continue;
        draw(w);
        drawn_ms = now_ms;
    }
    if (w->draws && w->heard) draw(w);
    double waited_s = 1e-3 * (double)(now_ms - start_ms);
    if (w->heard == 0)
        return kn_complain("touch", KN_EXIT_DEVICE, "no " CHANNEL "%s for %.3g s: %s", w->probe ? w->probe : "*",
                           waited_s, kn_bus_client_why("is kneadd running with --touch, and a hand at the tool?"));
    if (w->once && w->touched == 0)
        return kn_complain("touch", KN_EXIT_DEVICE, "%s touched nothing for %.3g s", w->name, waited_s);
    return KN_EXIT_OK;
}

int kn_touch_main(int argc, char **argv)
{
    watch w = {.seconds = INFINITY};
    char error[256], channel[64];
    int code = parse(&w, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    w.draws = !w.json && isatty(STDOUT_FILENO);
    snprintf(channel, sizeof channel, CHANNEL "%s", w.probe ? w.probe : "*");
    kn_bus_client *bus = kn_bus_client_open(w.url, KN_FORCE_URL, error, sizeof error);
    if (!bus) return kn_complain("touch", KN_EXIT_DEVICE, "%s", error);
    kn_bus_client_hear(bus, channel, on_touch, &w);
    code = look(&w, bus);
    kn_bus_client_close(bus);
    return code;
}
