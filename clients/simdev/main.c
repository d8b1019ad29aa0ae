// knead-simdev: a simulated circuit for users without a board. This file is its command line.
#include "clients/simdev/simdev.h"
#include "server/console.h"
#include "server/option_table.h"
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static volatile sig_atomic_t stop;

static void on_signal(int signal)
{
    (void)signal;
    stop = 1;
}

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static void help(void)
{
    puts("usage: knead-simdev --uart [OPTION]...\n"
         "       knead-simdev --bar NAME [OPTION]...\n"
         "       knead-simdev --pci [OPTION]... QEMU ARGUMENT...\n\n"
         "Simulate a circuit that steps a lattice: serve its registers behind a serial line, in shared memory, or as a\n"
         "PCI card of a virtual machine.\n"
         "Print the address that kneadd --backend takes, such as shm:NAME (--pci prints none), run until SIGTERM or SIGINT,\n"
         "then print the counters.\n\n"
         "  --uart            send frames over a pseudo-terminal\n"
         "  --baud N          limit the line to N bits per second, ten per byte (--uart; default: no limit)\n"
         "  --link PATH       symbolic link to the terminal; PATH stays the same after an unplug or a restart\n"
         "  --bar NAME        act as the memory of a PCI card, in /dev/shm/NAME\n"
         "  --pci             run the command QEMU ARGUMENT... and act as its PCI card 1234:4b4e, until QEMU ends. The\n"
         "                    arguments must have the card and shared memory: -device x-pci-proxy-dev,fd=3 -m 1G\n"
         "                    -object memory-backend-memfd,id=ram,size=1G -machine q35,memory-backend=ram\n"
         "  --engine NAME     golden or rtl (default: golden)\n"
         "                    golden: a C model of the circuit, in real time.\n"
         "                    rtl: the Verilog of hdl/rtl itself, simulated by Verilator, if the program was built with\n"
         "                    it. It is slower than real time, so kneadd needs for example shm:NAME?miss=1000\n"
         "  --caps N,E,B      log2 of the largest number of nodes, edges and nodes under tools.\n"
         "                    golden: 0..16,0..20,1..10 (default: 12,16,10); rtl: always 10,14,10\n"
         "  --seed N          seed of the random numbers (default: 1)\n"
         "  --fault NAME[=RATE],...\n"
         "                    inject faults at random into the share RATE of the requests (not with --pci; RATE: 0.01\n"
         "                    if it is not given). Without --fault there are none:");
    for (const kn_link_fault_kind *f = kn_link_fault_kinds; f < kn_link_fault_kinds + KN_LINK_FAULT_COUNT; f++)
        printf("      %-12s %s%s\n", f->word, f->what, f->frames ? " (--uart)" : "");
    puts("\nExamples:\n"
         "    knead-simdev --uart --link board\n"
         "    knead-simdev --bar knead-card --fault delay=0.001,hang --seed 2\n\n"
         "Exit codes: 0 stopped, 2 bad input, 3 no pseudo-terminal, no memory, NAME is in use, or QEMU failed.");
}
// clang-format on

static int bad(const char *what, const char *expected)
{
    fprintf(stderr, "knead-simdev: %s: expected %s\n", what, expected);
    return 2;
}

static const char *take_caps(void *to, const char *text)
{
    kn_engine_caps *caps = to;
    int end = 0;
    const bool good = sscanf(text, "%d,%d,%d%n", &caps->nodes, &caps->edges, &caps->bounds, &end) == 3 && !text[end] &&
                      caps->nodes >= 0 && caps->nodes <= 16 && caps->edges >= 0 && caps->edges <= 20 &&
                      caps->bounds >= 1 && caps->bounds <= 10;
    return good ? NULL : "0..16,0..20,1..10";
}

static bool power_up(kn_engine *engine, bool rtl, kn_engine_caps caps)
{
#ifdef KN_SIMDEV_RTL
    if (rtl) return kn_engine_rtl(engine);
#endif
    return !rtl && kn_engine_golden(engine, caps);
}

typedef struct options {
    kn_link_faults *faults;
    const char *link, *bar;
    bool uart, pci, sized, rtl;
    kn_engine_caps caps;
    int seed, baud;
} options;

// Serve until a signal comes or QEMU ends, then print the number of requests and of injected faults.
static int serve(kn_simdev *s, const options *o, char **qemu)
{
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    s->stop = &stop;
    if (!power_up(&s->engine, o->rtl, o->caps)) {
        fputs("knead-simdev: out of memory\n", stderr);
        return 3;
    }
    const char *what = o->pci ? qemu[0] : o->bar ? o->bar : o->link ? o->link : "pseudo-terminal";
    bool good = o->pci ? kn_simdev_pci(s, qemu) : o->bar ? kn_simdev_bar(s, o->bar) : kn_simdev_uart(s, o->link);
    if (!good && errno) fprintf(stderr, "knead-simdev: %s: %s\n", what, strerror(errno));
    const char *before = o->uart && s->engine.hear ? " behind knead_link" : "";
    printf("%s%s: %lld requests", s->engine.name, before, (long long)s->requests);
    for (int i = 0; i < KN_LINK_FAULT_COUNT; i++)
        if (s->faults.done[i]) printf(", %lld %s", (long long)s->faults.done[i], kn_link_fault_kinds[i].word);
    putchar('\n');
    s->engine.destroy(s->engine.bus.self);
    return good ? 0 : 3;
}

static const char *take_faults(void *faults, const char *text)
{
    char wrong[64];
    if (kn_link_faults_parse(*(kn_link_faults **)faults, text, wrong)) return NULL;
    bad(wrong, "--fault NAME[=RATE] with a rate of 0 to 1; --help lists the names");
    return KN_OPTION_TOLD;
}

static int run(int argc, char **argv)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("uart", FLAG, AT(uart)),
        KN_OPTION("link", TEXT, AT(link)),
        KN_OPTION("baud", INTEGER, AT(baud), KN_RANGE(1200, 1e8), .expected = "a whole number from 1200 to 100000000"),
        KN_OPTION("bar", TEXT, AT(bar)),
        KN_OPTION("pci", FLAG, AT(pci)),
        KN_OPTION("engine", EITHER, AT(rtl), .unit = "golden|rtl"),
        KN_OPTION("caps", SPECIAL, AT(caps), .given = offsetof(options, sized), .take = take_caps),
        KN_OPTION("fault", SPECIAL, AT(faults), .take = take_faults),
        KN_OPTION("seed", INTEGER, AT(seed), KN_RANGE(0, INT_MAX), .expected = "a whole number from 0 to 2147483647"),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .program = "knead-simdev", .print_help = help,
                                          .version = "knead-simdev " KN_VERSION, .options_first = true};
    static kn_simdev s;
    options o = {.faults = &s.faults, .caps = {12, 16, 10}, .seed = 1};
    const int code = kn_options_read(&table, &o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (o.uart + o.pci + (o.bar != NULL) != 1) return bad("connection", "exactly one of --uart, --bar NAME and --pci");
    if (optind < argc && !o.pci) return bad(argv[optind], "options only");
    if (optind == argc && o.pci) return bad("--pci", "the command that runs QEMU behind the options");
    if (o.link && !o.uart) return bad("--link", "--uart with it");
    if (o.baud && !o.uart) return bad("--baud", "--uart with it");
    if (o.baud) s.byte_ns = 10000000000 / o.baud;
    if (o.bar && (!*o.bar || *o.bar == '.' || strlen(o.bar) > 199 || strchr(o.bar, '/')))
        return bad(o.bar, "--bar with a name of 1 to 199 letters, without /");
    for (int i = 0; !o.uart && i < KN_LINK_FAULT_COUNT; i++)
        if (s.faults.rate[i] > 0 && (o.pci || kn_link_fault_kinds[i].frames))
            return bad(kn_link_fault_kinds[i].word,
                       o.pci ? "--uart or --bar: --pci has no faults" : "--uart, because memory has no frames");
    if (o.rtl && o.sized) return bad("--caps", "--engine golden, because the circuit is built for 10,14,10");
    if (o.rtl && s.faults.rate[KN_LINK_FAULT_TORN] > 0)
        return bad("torn", "--engine golden, because the circuit steps only on request");
#ifndef KN_SIMDEV_RTL
    if (o.rtl)
        return fputs("knead-simdev: --engine rtl: built without Verilator, expected --engine golden\n", stderr), 3;
#endif
    s.faults.seed = ((uint64_t)o.seed + 1) * 0x9e3779b97f4a7c15u;
    return serve(&s, &o, argv + optind);
}

int main(int argc, char **argv) { return kn_console_end("knead-simdev", run(argc, argv)); }
