// Cost of a time step. bench/README.md explains the tables.
#include "bench/bench.h"
#include "bench/throughput.h"

#include <getopt.h>
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

static const char usage[] = "usage: bench/throughput [options]\n"
                            "  --only TABLES  some of lattices,threads,nets,features,composite,integers,peer,errors\n"
                            "  --all          all tables: by default, errors is left out, because it takes minutes\n"
                            "  --nodes N      leave out lattices and nets of more than N nodes (default: 20000)\n"
                            "  --quick        fewer rounds, and no lattice or net of more than 2560 nodes\n"
                            "  --csv FILE     write every number of the tables as CSV, one per line\n";

typedef struct options {
    throughput_options tables;
    const char *only, *csv;
} options;

static const char *const table_name[] = {"lattices",  "threads",  "nets", "features",
                                         "composite", "integers", "peer", "errors"};
enum { TABLES = sizeof table_name / sizeof *table_name };

static int bad(const char *what, const char *value, const char *expected)
{
    fprintf(stderr, "bench_throughput: %s: '%s', expected %s\n", what, value, expected);
    return 2;
}

static bool wanted(const char *only, const char *table)
{
    size_t length = strlen(table);
    for (const char *p = only; p; p = strchr(p, ',') ? strchr(p, ',') + 1 : NULL)
        if (strncmp(p, table, length) == 0 && (p[length] == ',' || p[length] == 0)) return true;
    return false;
}

static int check_only(const char *only)
{
    int known = 0, asked = 1;
    for (int i = 0; i < TABLES; i++) known += wanted(only, table_name[i]);
    for (const char *p = only; *p; p++) asked += *p == ',';
    return known == asked
               ? 0
               : bad("--only", only, "some of lattices,threads,nets,features,composite,integers,peer,errors");
}

// Parse the options. Return 0, -1 after --help, or the exit code after a mistake.
static int parse(int argc, char **argv, options *o)
{
    static const struct option longs[] = {{"only", required_argument, 0, 'o'},
                                          {"nodes", required_argument, 0, 'n'},
                                          {"quick", no_argument, 0, 'q'},
                                          {"csv", required_argument, 0, 'c'},
                                          {"help", no_argument, 0, 'h'},
                                          {"all", no_argument, 0, 'a'},
                                          {0, 0, 0, 0}};
    char *end;
    *o = (options){.only = "lattices,threads,nets,features,composite,integers,peer", .tables.nodes_max = 20000};
    for (int c; (c = getopt_long(argc, argv, "", longs, NULL)) != -1;) switch (c) {
        case 'o': o->only = optarg; break;
        case 'n': {
            long n = strtol(optarg, &end, 10);
            if (*end || n < 1 || n > INT_MAX) return bad("--nodes", optarg, "a positive whole number");
            o->tables.nodes_max = (int)n;
            break;
        }
        case 'a': o->only = "lattices,threads,nets,features,composite,integers,peer,errors"; break;
        case 'q': o->tables.quick = true; break;
        case 'c': o->csv = optarg; break;
        case 'h': return -1;
        default: return 2;
        }
    if (optind < argc) return bad("argument", argv[optind], "options only");
    if (o->tables.quick && o->tables.nodes_max > 2560) o->tables.nodes_max = 2560;
    return check_only(o->only);
}

int main(int argc, char **argv)
{
    options o;
    int failed = parse(argc, argv, &o);
    if (failed == -1) return fputs(usage, stdout), 0;
    if (failed) return failed;
    setvbuf(stdout, NULL, _IOLBF, 0);
    puts("# What a step costs\n\n```");
    print_machine();
    puts("block     5 x 5 x 3 cm of dough, 1 cm x 5 cm plate, 1 cm/s to 1 cm, held 0.5 s, withdrawn; 1 ms steps\n"
         "time      processor time of the thread: for each tick, the smallest time in several rounds\n```\n");
    if (wanted(o.only, "lattices")) table_lattices(&o.tables);
    if (wanted(o.only, "threads")) table_threads(&o.tables);
    if (wanted(o.only, "nets")) table_nets(&o.tables);
    if (wanted(o.only, "features")) table_features(&o.tables);
    if (wanted(o.only, "composite")) table_composite(&o.tables);
    if (wanted(o.only, "integers")) table_integers(&o.tables);
    if (wanted(o.only, "peer")) table_peer(&o.tables);
    if (wanted(o.only, "errors")) table_errors(&o.tables);
    return write_csv(o.csv);
}
