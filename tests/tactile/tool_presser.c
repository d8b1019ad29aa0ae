// presser PROBE SECONDS [local] [x=0.01] [profile=touch]: run the device of presser.h on a running kneadd. At the
// end, or on a signal, print the judgement of rules.h. local: render KNEAD_CONTACT instead of KNEAD_FORCE.
// LCM_DEFAULT_URL and KNEAD_KEY apply as for all clients.
#include "tests/tactile/presser.h"
#include "clients/hand/haptic_loop.h"
#include "server/clock.h"
#include <signal.h>
#include <stdlib.h>

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

int main(int argc, char **argv)
{
    static kn_presser p;
    static kn_bridge bridge;
    char error[256] = "usage: presser PROBE SECONDS [local] [x=M] [profile=NAME]";
    const char *profile = "touch";
    double x_m = 0;
    kn_bridge_def def = {.session = kn_wall_us(), .render.radius_m = 0.015};
    if (argc < 3) return fprintf(stderr, "%s\n", error), 2;
    for (int i = 3; i < argc; i++) {
        if (!strcmp(argv[i], "local")) def.render.local = true;
        else if (!strncmp(argv[i], "x=", 2)) x_m = atof(argv[i] + 2);
        else if (!strncmp(argv[i], "profile=", 8)) profile = argv[i] + 8;
        else return fprintf(stderr, "%s\n", error), 2;
    }
    def.probe = argv[1];
    if (kn_device_profile_load(&def.render.device, "presser", profile, NULL, 0) != 0) return 2;
    signal(SIGTERM, on_signal);
    signal(SIGINT, on_signal);
    kn_presser_init(&p, x_m, &def.render);
    if (!kn_bridge_start(&bridge, &def, &p.base, error, sizeof error))
        return fprintf(stderr, "presser: %s\n", error), 3;
    for (int64_t end_ns = kn_now_ns() + (int64_t)(1e9 * atof(argv[2])); kn_now_ns() < end_ns && !interrupted;)
        kn_clock_sleep(kn_now_ns() + 50000000);
    kn_bridge_stop(&bridge);
    kn_rules_print(&p.rules);
    return 0;
}
