// Cost of a time step. bench/FIGURES.md explains the tables.
#include "bench/bench.h"
#include "bench/throughput.h"
#include "server/option_table.h"

#include <limits.h>
#include <string.h>

#define TABLES "lattices,threads,nets,features,composite,integers,peer"
static const char usage[] = "usage: bench/throughput [options]\n"
                            "  --only TABLES  all, or some of " TABLES ",errors\n"
                            "                 (default: all but errors, which takes minutes)\n"
                            "  --nodes N      leave out lattices and nets of more than N nodes (default: 20000)\n"
                            "  --quick        fewer rounds, and no lattice or net of more than 2560 nodes\n";

typedef struct options {
    throughput_options tables;
    const char *only;
} options;

static const struct {
    const char *name;
    void (*print)(const throughput_options *o);
} table[] = {{"lattices", table_lattices}, {"threads", table_threads},     {"nets", table_nets},
             {"features", table_features}, {"composite", table_composite}, {"integers", table_integers},
             {"peer", table_peer},         {"errors", table_errors}};
enum { COUNT = sizeof table / sizeof *table };

static bool wanted(const char *only, const char *name)
{
    size_t length = strlen(name);
    for (const char *p = only; p; p = strchr(p, ',') ? strchr(p, ',') + 1 : NULL)
        if (strncmp(p, name, length) == 0 && (p[length] == ',' || p[length] == 0)) return true;
    return false;
}

// Take the value of --only.
static const char *take_only(void *to, const char *only)
{
    int known = 0, asked = 1;
    if (strcmp(only, "all") == 0) only = TABLES ",errors";
    for (int i = 0; i < COUNT; i++) known += wanted(only, table[i].name);
    for (const char *p = only; *p; p++) asked += *p == ',';
    *(const char **)to = only;
    return known == asked ? NULL : "all, or some of " TABLES ",errors";
}

int main(int argc, char **argv)
{
    static const kn_option rows[] = {
        KN_OPTION("only", SPECIAL, .offset = offsetof(options, only), .take = take_only),
        KN_OPTION("nodes", INTEGER, .offset = offsetof(options, tables.nodes_max), KN_RANGE(1, INT_MAX),
                  .expected = "a positive whole number"),
        KN_OPTION("quick", FLAG, .offset = offsetof(options, tables.quick)),
    };
    static const kn_option_table options_table = {KN_OPTION_ROWS(rows), .program = "bench_throughput", .help = usage};
    options o = {.only = TABLES, .tables.nodes_max = 20000};
    const int code = kn_options_read(&options_table, &o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) return fprintf(stderr, "bench_throughput: %s: expected options only\n", argv[optind]), 2;
    if (o.tables.quick && o.tables.nodes_max > 2560) o.tables.nodes_max = 2560;
    setvbuf(stdout, NULL, _IOLBF, 0);
    puts("# What a step costs\n\n```");
    print_machine();
    puts("block     5 x 5 x 3 cm of dough, 1 cm x 5 cm plate, 1 cm/s to 1 cm, held 0.5 s, withdrawn; 1 ms steps\n"
         "time      processor time of the thread: for each tick, the smallest time in several rounds\n```\n");
    for (int i = 0; i < COUNT; i++)
        if (wanted(o.only, table[i].name)) table[i].print(&o.tables);
    return 0;
}
