// knead-simdev: a simulated circuit for users without a board. This file is its command line.
#include "clients/simdev/simdev.h"
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static volatile sig_atomic_t stop;

static void on_signal(int signal)
{
    (void)signal;
    stop = 1;
}

static void help(void)
{
    puts("usage: knead-simdev --uart [--baud N] [--link PATH] | --bar NAME [--engine golden|rtl] [--caps N,E,B]\n"
         "                    [--fault NAME[=RATE],...] [--seed N]\n\n"
         "Simulate a circuit that steps a lattice: serve its registers behind a serial line or in shared memory. Print "
         "the URI\n"
         "at which it can be reached, run until SIGTERM or SIGINT, then print the counters.\n\n"
         "  --uart            send frames over a pseudo-terminal\n"
         "  --baud N          limit the line to N bits per second, ten per byte (--uart; default: no limit)\n"
         "  --link PATH       symbolic link to the terminal, which stays when the device is unplugged or restarted\n"
         "  --bar NAME        act as the memory of a PCI card, in /dev/shm/NAME\n"
         "  --engine NAME     golden, the lattice in integers, in real time; rtl, the circuit of hdl/rtl (with --uart\n"
         "                    behind its link), simulated by Verilator in its own time (URI?miss=1000), if built with\n"
         "                    Verilator (default: golden)\n"
         "  --caps N,E,B      log2 of the most nodes, edges and nodes under tools for golden (default: 12,16,10); rtl "
         "has\n"
         "                    10,13,8\n"
         "  --seed N          seed of the random numbers (default: 1)\n"
         "  --fault ...       inject faults into this share of the requests (default: 0.01):");
#define KN_LINK_FAULT_HELP(name, word, frames, what)                                                                   \
    printf("      %-12s %s%s\n", #word, what, frames ? " (--uart)" : "");
    KN_LINK_FAULTS(KN_LINK_FAULT_HELP)
#undef KN_LINK_FAULT_HELP
    puts("  --help, --version\n\n"
         "Exit codes: 0 stopped, 2 bad input, 3 no pseudo-terminal, no memory, or the name is taken.");
}

static int bad(const char *what, const char *expected)
{
    fprintf(stderr, "knead-simdev: %s: expected %s\n", what, expected);
    return 2;
}

static bool parse_caps(const char *text, kn_engine_caps *caps)
{
    int end = 0;
    return sscanf(text, "%d,%d,%d%n", &caps->nodes, &caps->edges, &caps->bounds, &end) == 3 && !text[end] &&
           caps->nodes >= 0 && caps->nodes <= 16 && caps->edges >= 0 && caps->edges <= 20 && caps->bounds >= 1 &&
           caps->bounds <= 10;
}

static bool power_up(kn_engine *engine, bool rtl, kn_engine_caps caps)
{
#ifdef KN_SIMDEV_RTL
    if (rtl) return kn_engine_rtl(engine);
#endif
    return !rtl && kn_engine_golden(engine, caps);
}

// Serve until a signal, then print the requests and the faults that struck.
static int serve(kn_simdev *s, bool rtl, kn_engine_caps caps, const char *link, const char *bar)
{
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    s->stop = &stop;
    if (!power_up(&s->engine, rtl, caps)) {
        fputs("knead-simdev: out of memory\n", stderr);
        return 3;
    }
    bool good = bar ? kn_simdev_bar(s, bar) : kn_simdev_uart(s, link);
    if (!good) fprintf(stderr, "knead-simdev: %s: %s\n", bar ? bar : link ? link : "pseudo-terminal", strerror(errno));
    const char *before = !bar && s->engine.hear ? " behind knead_link" : "";
    printf("%s%s: %lld requests", s->engine.name, before, (long long)s->requests);
    for (int i = 0; i < KN_LINK_FAULT_COUNT; i++)
        if (s->faults.done[i]) printf(", %lld %s", (long long)s->faults.done[i], kn_link_fault_word((kn_link_fault)i));
    putchar('\n');
    s->engine.destroy(s->engine.bus.self);
    return good ? 0 : 3;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"uart", no_argument, NULL, 'u'},
                                            {"link", required_argument, NULL, 'l'},
                                            {"baud", required_argument, NULL, 'r'},
                                            {"bar", required_argument, NULL, 'b'},
                                            {"engine", required_argument, NULL, 'e'},
                                            {"caps", required_argument, NULL, 'c'},
                                            {"fault", required_argument, NULL, 'f'},
                                            {"seed", required_argument, NULL, 's'},
                                            {"help", no_argument, NULL, 'h'},
                                            {"version", no_argument, NULL, 'v'},
                                            {0}};
    static kn_simdev s;
    const char *link = NULL, *bar = NULL;
    char wrong[64], *end;
    bool uart = false, sized = false, rtl = false;
    kn_engine_caps caps = {12, 16, 10};
    unsigned long long seed = 1, baud = 0;
    for (int option; (option = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        switch (option) {
        case 'u': uart = true; break;
        case 'l': link = optarg; break;
        case 'r':
            baud = strtoull(optarg, &end, 10);
            if (end == optarg || *end || baud < 1200 || baud > 100000000)
                return bad(optarg, "--baud with a whole number from 1200 to 100000000");
            break;
        case 'b': bar = optarg; break;
        case 'e':
            rtl = strcmp(optarg, "rtl") == 0;
            if (!rtl && strcmp(optarg, "golden") != 0) return bad(optarg, "--engine golden or rtl");
            break;
        case 'c':
            sized = true;
            if (!parse_caps(optarg, &caps)) return bad(optarg, "--caps with 0..16,0..20,1..10");
            break;
        case 'f':
            if (!kn_link_faults_parse(&s.faults, optarg, wrong))
                return bad(wrong, "--fault NAME[=RATE] with a rate of 0 to 1; --help lists the names");
            break;
        case 's':
            seed = strtoull(optarg, &end, 10);
            if (end == optarg || *end) return bad(optarg, "--seed with a whole number");
            break;
        case 'h': help(); return 0;
        case 'v': puts("knead-simdev " KN_VERSION); return 0;
        default: return 2; // getopt has said which
        }
    }
    if (optind < argc) return bad(argv[optind], "options only");
    if (uart == (bar != NULL)) return bad(uart ? "--uart and --bar" : "no connection", "one of --uart and --bar NAME");
    if (link && !uart) return bad("--link", "--uart with it");
    if (baud && !uart) return bad("--baud", "--uart with it");
    if (baud) s.byte_ns = 10000000000 / (int64_t)baud;
    if (bar && (!*bar || *bar == '.' || strlen(bar) > 199 || strchr(bar, '/')))
        return bad(bar, "--bar with a name of 1 to 199 letters, without /");
    for (int i = 0; bar && i < KN_LINK_FAULT_COUNT; i++)
        if (s.faults.rate[i] > 0 && kn_link_fault_of_frames((kn_link_fault)i))
            return bad(kn_link_fault_word((kn_link_fault)i), "--uart, since memory has no frames");
    if (rtl && sized) return bad("--caps", "--engine golden, since the circuit is built for 10,13,8");
    if (rtl && s.faults.rate[KN_LINK_FAULT_TORN] > 0)
        return bad("torn", "--engine golden, since the circuit steps only on request");
#ifndef KN_SIMDEV_RTL
    if (rtl) return fputs("knead-simdev: --engine rtl: built without Verilator, expected --engine golden\n", stderr), 3;
#endif
    s.faults.seed = (seed + 1) * 0x9e3779b97f4a7c15u;
    return serve(&s, rtl, caps, link, bar);
}

int main(int argc, char **argv)
{
    int code = run(argc, argv);
    // Check both: the last flush does not report an earlier failure.
    if (!(fflush(stdout) | ferror(stdout))) return code;
    fputs("knead-simdev: standard output could not be written to its end\n", stderr);
    return code ? code : 3;
}
