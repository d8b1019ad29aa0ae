// Cost of a time step. bench/README.md explains the tables.
#include "bench/bench.h"
#include "bench/throughput.h"
#include "server/option_table.h"

#include <limits.h>
#include <string.h>

// --- numbers for --csv ----------------------------------------------------------------------------------------------

typedef struct entry {
    char table[16], object[48], kernel[16], name[40];
    double value;
} entry;

static entry entries[2000];
static int entry_count;

void note(const char *table, const char *object, const char *kernel, const char *name, double value)
{
    if (entry_count == sizeof entries / sizeof *entries) abort();
    entry *e = &entries[entry_count++];
    snprintf(e->table, sizeof e->table, "%s", table);
    snprintf(e->object, sizeof e->object, "%s", object);
    snprintf(e->kernel, sizeof e->kernel, "%s", kernel);
    snprintf(e->name, sizeof e->name, "%s", name);
    e->value = value;
}

static void print_csv(FILE *f)
{
    fprintf(f, "table,object,kernel,name,value\n");
    for (int i = 0; i < entry_count; i++)
        fprintf(f, "%s,\"%s\",%s,%s,%.6g\n", entries[i].table, entries[i].object, entries[i].kernel, entries[i].name,
                entries[i].value);
}

static int write_csv(const char *path)
{
    FILE *f = path ? fopen(path, "w") : NULL;
    if (!path) return 0;
    if (f) print_csv(f);
    if (f && !fclose(f)) return 0;
    perror(path);
    return 3;
}

// --- the command ----------------------------------------------------------------------------------------------------

#define TABLES "lattices,threads,nets,features,composite,integers,peer"
static const char usage[] = "usage: bench/throughput [options]\n"
                            "  --only TABLES  all, or some of " TABLES ",errors\n"
                            "                 (default: all but errors, which takes minutes)\n"
                            "  --nodes N      leave out lattices and nets of more than N nodes (default: 20000)\n"
                            "  --quick        fewer rounds, and no lattice or net of more than 2560 nodes\n"
                            "  --csv FILE     write every number of the tables as CSV, one per line\n";

typedef struct options {
    throughput_options tables;
    const char *only, *csv;
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
        KN_OPTION("nodes", INTEGER, .offset = offsetof(options, tables.nodes_max), KN_RANGE(1, INT_MAX)),
        KN_OPTION("quick", FLAG, .offset = offsetof(options, tables.quick)),
        KN_OPTION("csv", TEXT, .offset = offsetof(options, csv)),
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
    return write_csv(o.csv);
}
