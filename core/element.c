#include "core/element.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *name, *expression;
    bool plain; // kn_element_name returns this name; false for a second name of the same element
} names[] = {
    {"s", "", false},
    {"spring", "", true},
    {"d", "", false},
    {"damper", "", true},
    {"dashpot", "", false},
    {"voigt", "s|d", true},
    {"kelvin", "s|d", false},
    {"kelvin-voigt", "s|d", false},
    {"maxwell", "s-d", true},
    {"zener", "s-d|s", true},
    {"sls", "s-d|s", false},
    {"jeffreys", "(s|d)-d", true},
    {"burgers", "s-d-(s|d)", true},
};

// ---- reading an expression

typedef struct parser {
    kn_element *e;
    const char *text, *at;
    char *error;
    size_t error_size;
} parser;

static int read_parallel(parser *p);

// Report an error at the column of `at`, unless an earlier error was reported. Return -1.
static int complain(parser *p, const char *at, const char *what, int length)
{
    if (p->error_size && !*p->error)
        snprintf(p->error, p->error_size, "EXPR:1:%d: %s%.*s%s", (int)(at - p->text) + 1, what, length, at,
                 length ? "', expected s, d, a name like voigt, or (" : "");
    return -1;
}

static void skip_spaces(parser *p) { p->at += strspn(p->at, " \t"); }

// Return the length of the name that begins at `at`. A hyphen belongs to a name only in known names, such as
// kelvin-voigt.
static size_t name_size(const char *at, const char *letters)
{
    size_t size = strspn(at, letters);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        size_t known = strlen(names[i].name);
        if (known > size && strncmp(at, names[i].name, known) == 0 && strspn(at + known, letters) == 0) size = known;
    }
    return size;
}

static int add_leaf(parser *p, kn_element_kind kind, const char *at)
{
    kn_element *e = p->e;
    if (e->leaves == KN_ELEMENT_MAX) return complain(p, at, "too many springs and dampers, expected at most 16", 0);
    e->node[e->nodes] = (kn_element_node){.kind = kind, .leaf = e->leaves++};
    return e->nodes++;
}

// Read the definition of a name as if the text contained the definition. An error is reported at the name, because a
// column within the definition would mean nothing to the user.
static int read_definition(parser *p, const char *definition, const char *at)
{
    char error[64] = "";
    parser inner = {.e = p->e, .text = definition, .at = definition, .error = error, .error_size = sizeof error};
    int node = read_parallel(&inner);
    return node >= 0 ? node : complain(p, at, "too many springs and dampers, expected at most 16", 0);
}

// Read a spring, a damper or a name.
static int read_name(parser *p)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.";
    const char *at = p->at;
    size_t size = name_size(at, letters);
    if (size == 0) return complain(p, at, *at ? "'" : "ends here, expected s, d, a name like voigt, or (", *at != 0);
    p->at += size;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (strlen(names[i].name) != size || strncmp(names[i].name, at, size) != 0) continue;
        if (*names[i].expression) return read_definition(p, names[i].expression, at);
        return add_leaf(p, *at == 's' ? KN_ELEMENT_SPRING : KN_ELEMENT_DAMPER, at);
    }
    return complain(p, at, "unknown element '", size > 24 ? 24 : (int)size);
}

// Read a name or an expression in parentheses.
static int read_unit(parser *p)
{
    skip_spaces(p);
    const char *open = p->at;
    if (*open != '(') return read_name(p);
    p->at++;
    int node = read_parallel(p);
    if (node < 0) return node;
    if (*p->at != ')') return complain(p, p->at, "not closed, expected -, | or )", 0);
    p->at++;
    return node;
}

// Add a child to a group. If the child is a group of the same kind, add the children of that group instead.
static void add_child(kn_element *e, int group, int child)
{
    kn_element_node *g = &e->node[group];
    const kn_element_node *c = &e->node[child];
    if (c->kind != g->kind) g->child[g->count++] = (unsigned char)child;
    else
        for (int i = 0; i < c->count; i++) g->child[g->count++] = c->child[i];
}

// Read one or more units with `mark` between them. A single unit makes no group, so a tree of n leaves has at most
// n - 1 groups.
static int read_group(parser *p, kn_element_kind kind, char mark, int (*read)(parser *))
{
    int first = read(p), group = -1;
    for (skip_spaces(p); first >= 0 && *p->at == mark; skip_spaces(p)) {
        p->at++;
        int next = read(p);
        if (next < 0) return next;
        if (group < 0) {
            group = p->e->nodes++;
            p->e->node[group] = (kn_element_node){.kind = kind};
            add_child(p->e, group, first);
        }
        add_child(p->e, group, next);
    }
    return group < 0 ? first : group;
}

static int read_series(parser *p) { return read_group(p, KN_ELEMENT_SERIES, '-', read_unit); }
static int read_parallel(parser *p) { return read_group(p, KN_ELEMENT_PARALLEL, '|', read_series); }

bool kn_element_parse(kn_element *e, const char *text, char *error, size_t error_size)
{
    memset(e, 0, sizeof *e);
    if (error_size) *error = '\0';
    parser p = {.e = e, .text = text, .at = text, .error = error, .error_size = error_size};
    if (strlen(text) >= KN_ELEMENT_TEXT) return complain(&p, text, "too long, expected at most 255 characters", 0) >= 0;
    e->root = read_parallel(&p);
    if (e->root >= 0 && *p.at)
        e->root = complain(&p, p.at,
                           *p.at == ')' ? "no ( is open here, expected -, | or the end"
                                        : "cannot continue here, expected -, | or the end",
                           0);
    return e->root >= 0;
}

// ---- normal form

// Compare two nodes for sorting: groups come first, then springs, then dampers; groups are compared by their text.
static int compare(const kn_element *e, int a, int b)
{
    static const int rank[] = {1, 2, 0, 0};
    int difference = rank[e->node[a].kind] - rank[e->node[b].kind];
    if (difference || rank[e->node[a].kind]) return difference;
    char one[KN_ELEMENT_TEXT], two[KN_ELEMENT_TEXT];
    kn_element_print(e, a, false, one);
    kn_element_print(e, b, false, two);
    return strcmp(one, two);
}

// Bring a group into normal form. Return the node that replaces the group: the group itself, or its only remaining
// member.
static int normalize(kn_element *e, int node)
{
    kn_element_node *g = &e->node[node];
    if (g->kind < KN_ELEMENT_SERIES) return node;
    // sort the children by insertion: there are at most 16
    for (int i = 0; i < g->count; i++) {
        unsigned char child = (unsigned char)normalize(e, g->child[i]);
        int at = i;
        for (; at > 0 && compare(e, g->child[at - 1], child) > 0; at--) g->child[at] = g->child[at - 1];
        g->child[at] = child;
    }
    // all springs of a group act as one spring, all dampers as one damper: keep the first of each
    int kept = 0;
    for (int i = 0; i < g->count; i++) {
        kn_element_kind kind = e->node[g->child[i]].kind;
        bool again = kept > 0 && kind < KN_ELEMENT_SERIES && e->node[g->child[kept - 1]].kind == kind;
        if (!again) g->child[kept++] = g->child[i];
    }
    g->count = kept;
    return kept == 1 ? g->child[0] : node;
}

// Number springs and dampers in order of appearance.
static void number_leaves(kn_element *e, int node)
{
    kn_element_node *g = &e->node[node];
    if (g->kind < KN_ELEMENT_SERIES) g->leaf = e->leaves++;
    for (int i = 0; i < g->count; i++) number_leaves(e, g->child[i]);
}

void kn_element_normalize(kn_element *e)
{
    e->root = normalize(e, e->root);
    e->leaves = 0;
    number_leaves(e, e->root);
}

// ---- printing an expression

// Find a leaf by its number. Store its kind, and in seen[] the number of springs and dampers up to the leaf.
static bool find_leaf(const kn_element *e, int node, int leaf, int *seen, kn_element_kind *kind)
{
    const kn_element_node *g = &e->node[node];
    if (g->kind < KN_ELEMENT_SERIES) {
        seen[g->kind]++;
        *kind = g->kind;
        return g->leaf == leaf;
    }
    for (int i = 0; i < g->count; i++)
        if (find_leaf(e, g->child[i], leaf, seen, kind)) return true;
    return false;
}

bool kn_element_leaf_name(const kn_element *e, int leaf, char name[8])
{
    int seen[2] = {0};
    kn_element_kind kind;
    if (!find_leaf(e, e->root, leaf, seen, &kind)) return false;
    snprintf(name, 8, "%c%d", kind == KN_ELEMENT_SPRING ? 's' : 'd', seen[kind]);
    return true;
}

static size_t print(const kn_element *e, int node, bool numbered, char *text, size_t at)
{
    const kn_element_node *g = &e->node[node];
    char name[8] = {g->kind == KN_ELEMENT_SPRING ? 's' : 'd', '\0'};
    if (g->kind < KN_ELEMENT_SERIES) {
        if (numbered) kn_element_leaf_name(e, g->leaf, name);
        return at + (size_t)snprintf(text + at, KN_ELEMENT_TEXT - at, "%s", name);
    }
    for (int i = 0; i < g->count; i++) {
        bool group = e->node[g->child[i]].kind >= KN_ELEMENT_SERIES;
        if (i) text[at++] = g->kind == KN_ELEMENT_SERIES ? '-' : '|';
        if (group) text[at++] = '(';
        at = print(e, g->child[i], numbered, text, at);
        if (group) text[at++] = ')';
    }
    text[at] = '\0';
    return at;
}

// KN_ELEMENT_TEXT is long enough: 16 primitives of at most 3 characters, 15 marks between them and 14 pairs of
// parentheses need less than 128.
void kn_element_print(const kn_element *e, int node, bool numbered, char text[KN_ELEMENT_TEXT])
{
    print(e, node, numbered, text, 0);
}

int kn_element_count(const kn_element *e, int node, kn_element_kind kind)
{
    const kn_element_node *g = &e->node[node];
    int count = g->kind == kind;
    for (int i = 0; i < g->count; i++) count += kn_element_count(e, g->child[i], kind);
    return count;
}

const char *kn_element_name(const kn_element *normal)
{
    char text[KN_ELEMENT_TEXT], known[KN_ELEMENT_TEXT], error[64];
    kn_element_print(normal, normal->root, false, text);
    // compare with the normal forms of all elements that have a name
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        kn_element e;
        if (!names[i].plain || !kn_element_parse(&e, names[i].name, error, sizeof error)) continue;
        kn_element_normalize(&e);
        kn_element_print(&e, e.root, false, known);
        if (!strcmp(text, known)) return names[i].name;
    }
    return NULL;
}

// ---- the paper's rules

// Table 1, residual: in series one member with residual deformation is enough; in parallel all members must have it.
bool kn_element_residual(const kn_element *e, int node)
{
    const kn_element_node *g = &e->node[node];
    if (g->kind < KN_ELEMENT_SERIES) return g->kind == KN_ELEMENT_DAMPER;
    int with = 0;
    for (int i = 0; i < g->count; i++) with += kn_element_residual(e, g->child[i]);
    return g->kind == KN_ELEMENT_SERIES ? with > 0 : with == g->count;
}

// Table 2, bouncing: one member that bounces is enough, in series and in parallel.
bool kn_element_bouncing(const kn_element *e, int node)
{
    const kn_element_node *g = &e->node[node];
    bool bounces = g->kind == KN_ELEMENT_SPRING;
    for (int i = 0; i < g->count; i++) bounces |= kn_element_bouncing(e, g->child[i]);
    return bounces;
}

// Vibration dies down if every part in series involves a damper.
bool kn_element_vibration_dies(const kn_element *e, int node)
{
    const kn_element_node *g = &e->node[node];
    if (g->kind != KN_ELEMENT_SERIES) return kn_element_count(e, node, KN_ELEMENT_DAMPER) > 0;
    for (int i = 0; i < g->count; i++)
        if (kn_element_count(e, g->child[i], KN_ELEMENT_DAMPER) == 0) return false;
    return true;
}

// ---- figure 2 of the first paper

const kn_catalogue_entry kn_catalogue[KN_CATALOGUE] = {
    {'a', "s|d", false, true, KN_PROVENANCE_FORCED, "the only other element of two parts is (b)"},
    {'b', "s-d", true, false, KN_PROVENANCE_FORCED, "the only other element of two parts is (a)"},
    {'c', "(s|d)-s", false, false, KN_PROVENANCE_FORCED,
     "the only element of three parts that is neither residual nor lets vibration die"},
    {'d', "(s|d)-d", true, true, KN_PROVENANCE_FORCED,
     "figure 3 shows this element; (f) too is residual and lets vibration die"},
    {'e', "(s-d)|s", false, true, KN_PROVENANCE_FORCED,
     "the only element of three parts that lets vibration die and is not residual"},
    {'f', "(s-d)|d", true, true, KN_PROVENANCE_FORCED,
     "besides (d), the only element of three parts that is residual and lets vibration die"},
    {'g', "(s-d)|(s-d)", true, true, KN_PROVENANCE_PAIR, "g and k are (s-d)|(s-d) and ((s-d)|s)-d, in unknown order"},
    {'h', "(s|d)-s-d", true, false, KN_PROVENANCE_PAIR, "h and j are (s|d)-s-d and ((s-d)|d)-s, in unknown order"},
    {'i', "(s|d)-(s|d)", false, true, KN_PROVENANCE_GUESS, "could also be (s-d)|s|d, ((s|d)-d)|s or ((s|d)-s)|d"},
    {'j', "((s-d)|d)-s", true, false, KN_PROVENANCE_PAIR, "h and j are (s|d)-s-d and ((s-d)|d)-s, in unknown order"},
    {'k', "((s-d)|s)-d", true, true, KN_PROVENANCE_PAIR, "g and k are (s-d)|(s-d) and ((s-d)|s)-d, in unknown order"},
};
