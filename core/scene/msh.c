#include "core/scene/mesh_file.h"
#include "core/hash.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct tagged { // number of a node in the file, and index of the node in memory
    long tag;
    int index;
} tagged;

typedef struct found { // an element that was read: a triangle (node[3] is -1) or a tetrahedron
    int node[4];
    long tag;
    size_t at; // position of the element in the file [bytes]
} found;

typedef struct reader {
    kn_words words;
    int version; // version of the format, 2 or 4; 0 until $MeshFormat has been read
    int node_count, found_count, left_out;
    double (*x)[3];
    tagged *tag;
    found *found;
} reader;

#define complain(r, ...) kn_words_complain(&(r)->words, __VA_ARGS__)
#define integer(r, ...) kn_words_integer(&(r)->words, __VA_ARGS__)
static const kn_width INT = KN_WIDTH_INT, LONG = KN_WIDTH_LONG; // widths of int and size_t in a Gmsh file

#define CONVERT "gmsh -0 IN.msh -save -format msh41 -o OUT.msh" // the command that writes version 4.1

// ---- sections

// Read the section $MeshFormat: the version, 0 for text or 1 for binary, and the bytes of a real. In a binary file the
// integer 1 follows, which shows the byte order.
static bool read_format(reader *r)
{
    char text[KN_WORD_MAX];
    long binary, bytes, one = 1;
    if (kn_words_next(&r->words, text) == 0)
        return complain(r, r->words.at, "the file ends here, expected the version");
    // versions 2.0 to 2.2 have one layout
    bool known = strcmp(text, "4.1") == 0 || strcmp(text, "2") == 0 ||
                 (strlen(text) == 3 && strncmp(text, "2.", 2) == 0 && text[2] >= '0' && text[2] <= '2');
    if (!known) {
        bool number = strspn(text, "0123456789.") == strlen(text) && strlen(text) < 8;
        return complain(r, r->words.begun, "MSH version %s, expected 2.2 or 4.1: " CONVERT, number ? text : "unknown");
    }
    int version = *text - '0';
    if (!integer(r, INT, 0, 1, &binary, "0 for text or 1 for binary") ||
        !integer(r, INT, LONG_MIN, LONG_MAX, &bytes, "the bytes of a number"))
        return false;
    if (bytes != 8) return complain(r, r->words.begun, "numbers of %ld bytes, expected 8", bytes);
    r->words.binary = binary == 1;
    if (r->words.binary &&
        (!kn_words_line_end(&r->words) || !integer(r, INT, LONG_MIN, LONG_MAX, &one, "the number 1")))
        return false;
    if (one != 1)
        return complain(r, r->words.begun,
                        "the bytes are in the order of another machine, expected little-endian: on that "
                        "machine, run " CONVERT);
    r->version = version;
    return kn_words_section_end(&r->words);
}

// Compare two nodes for qsort by their number in the file.
static int by_tag(const void *a, const void *b)
{
    const tagged *p = a, *q = b;
    return p->tag < q->tag ? -1 : p->tag > q->tag;
}

// Allocate memory for `count` nodes. `each`: fewest bytes that a node takes in the file. A count for which the file is
// too short is refused, so a wrong count cannot allocate much memory.
static bool make_nodes(reader *r, long count, size_t each)
{
    if (!kn_words_room(&r->words, count, each, "nodes")) return false;
    r->x = malloc(((size_t)count + 1) * sizeof *r->x);
    r->tag = malloc(((size_t)count + 1) * sizeof *r->tag);
    return (r->x && r->tag) || complain(r, r->words.begun, "not enough memory for %ld nodes", count);
}

// Read the coordinates of a node. Skip the parameters that follow the coordinates of a parametric node.
static bool take_place(reader *r, int node, int parameters)
{
    double ignored;
    for (int k = 0; k < 3 + parameters; k++)
        if (!kn_words_real(&r->words, k < 3 ? &r->x[node][k] : &ignored)) return false;
    return true;
}

// Read the number that a node has in the file.
static bool take_node_tag(reader *r, kn_width width, int node)
{
    r->tag[node].index = node;
    return integer(r, width, 0, LONG_MAX, &r->tag[node].tag, "a node's number");
}

// Read the nodes of a version 2.2 file: a count, then number and coordinates of each node.
static bool read_nodes_2(reader *r)
{
    long count;
    bool binary = r->words.binary;
    r->words.binary = false; // the count is a line of text, also in binary files
    bool counted = integer(r, INT, 1, KN_SIMPLICES_NODES_MAX, &count, "the number of nodes");
    r->words.binary = binary;
    if (!counted || !kn_words_line_end(&r->words) || !make_nodes(r, count, binary ? 28 : sizeof "1 0 0 0\n" - 1))
        return false;
    for (; r->node_count < count; r->node_count++)
        if (!take_node_tag(r, INT, r->node_count) || !take_place(r, r->node_count, 0)) return false;
    return true;
}

// Read the nodes of a version 4.1 file. The nodes come in blocks: first the numbers of all nodes of a block, then their
// coordinates.
static bool read_nodes_4(reader *r)
{
    long blocks, count, least, most, dimension, entity, parametric, here;
    if (!kn_words_line_end(&r->words) || !integer(r, LONG, 0, LONG_MAX, &blocks, "the number of blocks") ||
        !integer(r, LONG, 1, KN_SIMPLICES_NODES_MAX, &count, "the number of nodes") ||
        !make_nodes(r, count, r->words.binary ? 32 : sizeof "1\n0 0 0\n" - 1) ||
        !integer(r, LONG, 0, LONG_MAX, &least, "the smallest number of a node") ||
        !integer(r, LONG, 0, LONG_MAX, &most, "the largest number of a node"))
        return false;
    // a block may have at most as many nodes as the declared count still allows
    while (blocks-- > 0) {
        if (!integer(r, INT, 0, 3, &dimension, "a dimension") ||
            !integer(r, INT, LONG_MIN, LONG_MAX, &entity, "an entity's number") ||
            !integer(r, INT, 0, 1, &parametric, "0 or 1 for parameters") ||
            !integer(r, LONG, 0, count - r->node_count, &here, "the number of nodes in this block"))
            return false;
        for (int i = 0; i < here; i++)
            if (!take_node_tag(r, LONG, r->node_count + i)) return false;
        for (; here > 0; here--, r->node_count++)
            if (!take_place(r, r->node_count, parametric ? (int)dimension : 0)) return false;
    }
    return r->node_count == count ||
           complain(r, r->words.at, "the blocks have %d nodes, expected the %ld that were declared", r->node_count,
                    count);
}

// Read the section $Nodes and check that no two nodes have the same number.
static bool read_nodes(reader *r)
{
    if (r->x) return complain(r, r->words.begun, "a second $Nodes, expected one");
    if (!(r->version == 2 ? read_nodes_2 : read_nodes_4)(r)) return false;
    // sort the nodes by number: duplicates are then neighbours, and find_node can search
    qsort(r->tag, (size_t)r->node_count, sizeof *r->tag, by_tag);
    for (int i = 1; i < r->node_count; i++)
        if (r->tag[i - 1].tag == r->tag[i].tag)
            return complain(r, r->words.at, "two nodes have the number %ld, expected different ones", r->tag[i].tag);
    return kn_words_section_end(&r->words);
}

// Return the index of the node whose number in the file is `tag`, or -1 if there is none. Numbers mostly run from 1
// without a gap, so first try the index tag - 1.
static int find_node(const reader *r, long tag)
{
    if (tag >= 1 && tag <= r->node_count && r->tag[tag - 1].tag == tag) return r->tag[tag - 1].index;
    const tagged *t = bsearch(&(tagged){.tag = tag}, r->tag, (size_t)r->node_count, sizeof *r->tag, by_tag);
    return t ? t->index : -1;
}

enum { LINE = 1, TRIANGLE = 2, TETRAHEDRON = 4, POINT = 15 }; // element types of the format

// Report an element of a type that is not supported. The message has the name of the type if the name is known.
static bool refuse_type(reader *r, size_t at, long tag, long type)
{
    static const char *const solid[] = {[3] = "quadrangle", [5] = "hexahedron", [6] = "prism", [7] = "pyramid"};
    static const char *const curved[] = {
        [8] = "3-node line", [9] = "6-node triangle", [10] = "9-node quadrangle", [11] = "10-node tetrahedron"};
    if (type >= 3 && type <= 7)
        return complain(r, at, "element %ld is a %s, expected 4-node tetrahedra, or 3-node triangles alone", tag,
                        solid[type]);
    if (type >= 8 && type <= 11)
        return complain(r, at, "element %ld is a %s, expected elements of first order: gmsh -3 -order 1", tag,
                        curved[type]);
    return complain(r, at, "element %ld is of type %ld, expected 2, 3-node triangle, or 4, 4-node tetrahedron", tag,
                    type);
}

// Read the nodes of element `tag`, which begins at byte `at` of the file. Keep triangles and tetrahedra; count points
// and lines as left out.
static bool take_element(reader *r, kn_width width, size_t at, long tag, long type)
{
    static const int nodes[] = {[LINE] = 2, [TRIANGLE] = 3, [TETRAHEDRON] = 4, [POINT] = 1};
    found *f = &r->found[r->found_count];
    if (type != POINT && type != LINE && type != TRIANGLE && type != TETRAHEDRON) return refuse_type(r, at, tag, type);
    *f = (found){.node = {-1, -1, -1, -1}, .tag = tag, .at = at};
    for (int k = 0; k < nodes[type]; k++) {
        long node;
        if (!integer(r, width, 0, LONG_MAX, &node, "a node's number")) return false;
        f->node[k] = find_node(r, node);
        if (f->node[k] < 0)
            return complain(r, r->words.begun, "element %ld has node %ld, expected one of those in $Nodes", tag, node);
    }
    if (nodes[type] < 3) r->left_out++;
    else r->found_count++;
    return true;
}

// Allocate memory for `count` elements. `each`: fewest bytes that an element takes in the file.
static bool make_elements(reader *r, long count, size_t each)
{
    if (!kn_words_room(&r->words, count, each, "elements")) return false;
    r->found = malloc(((size_t)count + 1) * sizeof *r->found);
    return r->found || complain(r, r->words.begun, "not enough memory for %ld elements", count);
}

// Read the elements of a version 2.2 file. In a text file, each element is "number, type, number of tags, tags, nodes".
// In a binary file, the elements come in blocks: "type, number of elements, number of tags", then "number, tags, nodes"
// of each element.
static bool read_elements_2(reader *r)
{
    long total, tag = 0, type, tags, ignored;
    bool binary = r->words.binary;
    r->words.binary = false;
    bool counted = integer(r, INT, 1, KN_SIMPLICES_ELEMENTS_MAX, &total, "the number of elements");
    r->words.binary = binary;
    if (!counted || !kn_words_line_end(&r->words) || !make_elements(r, total, binary ? 8 : sizeof "1 15 0 1\n" - 1))
        return false;
    // each pass of the loop reads one element of a text file, or one block of a binary file
    for (long count = 1; total > 0; total -= count) {
        if (!binary && !integer(r, INT, 0, LONG_MAX, &tag, "an element's number")) return false;
        size_t at = r->words.begun;
        if (!integer(r, INT, 1, LONG_MAX, &type, "an element's type") ||
            (binary && !integer(r, INT, 1, total, &count, "the number of elements in this block")) ||
            !integer(r, INT, 0, LONG_MAX, &tags, "the number of tags"))
            return false;
        for (long i = 0; i < count; i++) {
            if (binary && !integer(r, INT, 0, LONG_MAX, &tag, "an element's number")) return false;
            if (binary) at = r->words.begun;
            for (long k = 0; k < tags; k++)
                if (!integer(r, INT, LONG_MIN, LONG_MAX, &ignored, "a tag")) return false;
            if (!take_element(r, INT, at, tag, type)) return false;
        }
    }
    return true;
}

// Read the elements of a version 4.1 file. They come in blocks; all elements of a block have the same type.
static bool read_elements_4(reader *r)
{
    long blocks, total, least, most, dimension, entity, type, here, tag, done = 0;
    if (!kn_words_line_end(&r->words) || !integer(r, LONG, 0, LONG_MAX, &blocks, "the number of blocks") ||
        !integer(r, LONG, 1, KN_SIMPLICES_ELEMENTS_MAX, &total, "the number of elements") ||
        !make_elements(r, total, r->words.binary ? 16 : sizeof "1 1\n" - 1) ||
        !integer(r, LONG, 0, LONG_MAX, &least, "the smallest number of an element") ||
        !integer(r, LONG, 0, LONG_MAX, &most, "the largest number of an element"))
        return false;
    while (blocks-- > 0) {
        if (!integer(r, INT, 0, 3, &dimension, "a dimension") ||
            !integer(r, INT, LONG_MIN, LONG_MAX, &entity, "an entity's number") ||
            !integer(r, INT, 1, LONG_MAX, &type, "an element's type") ||
            !integer(r, LONG, 0, total - done, &here, "the number of elements in this block"))
            return false;
        for (done += here; here > 0; here--) {
            if (!integer(r, LONG, 0, LONG_MAX, &tag, "an element's number") ||
                !take_element(r, LONG, r->words.begun, tag, type))
                return false;
        }
    }
    return done == total ||
           complain(r, r->words.at, "the blocks have %ld elements, expected the %ld that were declared", done, total);
}

// Read the section $Elements. The section must come after $Nodes, because elements refer to nodes.
static bool read_elements(reader *r)
{
    if (!r->x) return complain(r, r->words.begun, "$Elements before $Nodes, expected it after");
    if (r->found) return complain(r, r->words.begun, "a second $Elements, expected one");
    return (r->version == 2 ? read_elements_2 : read_elements_4)(r) && kn_words_section_end(&r->words);
}

// Skip a section that is not needed, such as $PhysicalNames, $Entities or $Periodic.
static bool skip_section(reader *r, const char *name)
{
    char end[KN_WORD_MAX + 4];
    size_t begin = r->words.begun, length = (size_t)snprintf(end, sizeof end, "$End%s", name + 1);
    for (; r->words.at + length <= r->words.size; r->words.at++)
        if (r->words.bytes[r->words.at] == '$' && memcmp(r->words.bytes + r->words.at, end, length) == 0) {
            r->words.at += length;
            return true;
        }
    return complain(r, begin, "a section without its end, expected $End... with the same name");
}

// Read all sections. $MeshFormat must be the first section; $Nodes and $Elements must exist.
static bool read_sections(reader *r)
{
    char name[KN_WORD_MAX];
    while (kn_words_next(&r->words, name) > 0) {
        bool format = strcmp(name, "$MeshFormat") == 0, good;
        if (r->version == 0 && strcmp(name, "$NOD") == 0)
            return complain(r, r->words.begun, "MSH version 1, expected 2.2 or 4.1: " CONVERT);
        if (r->version == 0 && !format)
            return complain(r, r->words.begun,
                            "not a Gmsh mesh, expected $MeshFormat (knead mesh makes one from a surface)");
        if (r->version != 0 && format) return complain(r, r->words.begun, "a second $MeshFormat, expected one");
        if (*name != '$') return complain(r, r->words.begun, "text between sections, expected $Nodes or $Elements");
        r->words.section = format ? "$MeshFormat" : strcmp(name, "$Nodes") == 0 ? "$Nodes" : "$Elements";
        if (format) good = read_format(r);
        else if (strcmp(name, "$Nodes") == 0) good = read_nodes(r);
        else if (strcmp(name, "$Elements") == 0) good = read_elements(r);
        else good = skip_section(r, name);
        if (!good) return false;
    }
    if (r->version == 0) return complain(r, 0, "nothing but white space, expected a Gmsh mesh");
    return (r->found != NULL) || complain(r, r->words.size, "the file has no %s", r->x ? "$Elements" : "$Nodes");
}

// ---- conversion to simplices

// Keep the tetrahedra and leave out the triangles, which then are only the surface of the tetrahedra. Without any
// tetrahedron, keep the triangles. Return the dimension of the kept elements, 3 or 2, or 0 if there are none.
static int choose_elements(reader *r)
{
    int kept = 0, solid = 0;
    for (int i = 0; i < r->found_count; i++) solid += r->found[i].node[3] >= 0;
    for (int i = 0; i < r->found_count; i++)
        if (solid == 0 || r->found[i].node[3] >= 0) r->found[kept++] = r->found[i];
    r->left_out += r->found_count - kept;
    r->found_count = kept;
    return kept == 0 ? 0 : solid > 0 ? 3 : 2;
}

// Give the nodes that belong to kept elements new numbers from 0, in the order of the file. All other nodes get -1.
// Return the count of numbered nodes.
static int number_nodes(const reader *r, int *number)
{
    int count = 0, corners = r->found[0].node[3] < 0 ? 3 : 4;
    for (int i = 0; i < r->node_count; i++) number[i] = -1;
    for (int e = 0; e < r->found_count; e++)
        for (int k = 0; k < corners; k++) number[r->found[e].node[k]] = 0;
    for (int i = 0; i < r->node_count; i++)
        if (number[i] == 0) number[i] = count++;
    return count;
}

// Return the extent of the nodes along an axis.
static double spread(const kn_simplices *s, int axis)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < s->node_count; i++) {
        low = fmin(low, s->x_m[i][axis]);
        high = fmax(high, s->x_m[i][axis]);
    }
    return high - low;
}

// Move a flat mesh into the plane y = 0. If most triangles have a negative area there, reverse all triangles.
static bool lay_flat(reader *r, kn_simplices *s)
{
    double wide[3] = {spread(s, 0), spread(s, 1), spread(s, 2)}, area = 0;
    double thin = 1e-9 * fmax(wide[0], fmax(wide[1], wide[2]));
    if (wide[2] > thin && wide[1] > thin)
        return complain(r, r->found[0].at,
                        "triangles alone, and not in one plane: expected tetrahedra (knead mesh fills a "
                        "closed surface with them), or a plane z = const or y = const");
    // if the mesh lies in a plane z = const, its y becomes the scene's z
    for (int i = 0; i < s->node_count; i++) {
        if (wide[2] <= thin) s->x_m[i][2] = s->x_m[i][1];
        s->x_m[i][1] = 0;
    }
    // count the triangles with a positive area, minus those with a negative area
    for (int e = 0; e < s->element_count; e++) {
        const double *a = s->x_m[s->element[e][0]], *b = s->x_m[s->element[e][1]], *c = s->x_m[s->element[e][2]];
        double twice = (b[0] - a[0]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[0] - a[0]);
        area += twice < 0 ? -1 : 1;
    }
    for (int e = 0; e < s->element_count && area < 0; e++) {
        int swap = s->element[e][1];
        s->element[e][1] = s->element[e][2];
        s->element[e][2] = swap;
    }
    return true;
}

// Copy nodes and elements into the simplices, in metres.
static void fill(const reader *r, kn_simplices *s, const int *number, double units_per_m)
{
    for (int i = 0; i < r->node_count; i++)
        for (int k = 0; k < 3 && number[i] >= 0; k++) s->x_m[number[i]][k] = r->x[i][k] / units_per_m;
    for (int e = 0; e < s->element_count; e++) {
        s->tag[e] = r->found[e].tag;
        for (int k = 0; k < 4; k++) s->element[e][k] = r->found[e].node[k] < 0 ? -1 : number[r->found[e].node[k]];
    }
}

// Check the simplices. The error points at the element with the problem, or at the start of the file.
static bool check(reader *r, const kn_simplices *s)
{
    char what[256];
    int blame;
    if (kn_simplices_blame(s, &blame, what, sizeof what)) return true;
    return complain(r, blame >= 0 ? r->found[blame].at : 0, "%s", what);
}

// Build the simplices from the read sections. Return NULL after an error.
static kn_simplices *build(reader *r, double units_per_m, kn_msh_facts *facts)
{
    int dimension = choose_elements(r), *number = malloc(((size_t)r->node_count + 1) * sizeof *number);
    kn_simplices *s = NULL;
    if (dimension == 0) complain(r, 0, "neither tetrahedra nor triangles, expected a mesh: gmsh -3");
    else if (number) s = kn_simplices_create(dimension, number_nodes(r, number), r->found_count);
    if (dimension > 0 && !s) complain(r, 0, "not enough memory for the mesh");
    if (s) fill(r, s, number, units_per_m);
    free(number);
    if (s && ((dimension == 2 && !lay_flat(r, s)) || !check(r, s))) {
        kn_simplices_destroy(s);
        return NULL;
    }
    static const char *const format[2][2] = {{"2.2 ASCII", "2.2 binary"}, {"4.1 ASCII", "4.1 binary"}};
    if (s && facts)
        *facts = (kn_msh_facts){.format = format[r->version == 4][r->words.binary],
                                .left_out = r->left_out,
                                .loose = r->node_count - s->node_count,
                                .hash = kn_hash_bytes(KN_HASH_SEED, r->words.bytes, r->words.size)};
    return s;
}

kn_simplices *kn_msh_read(const char *name, const void *bytes, size_t size, double units_per_m, kn_msh_facts *facts,
                          char *error, size_t error_size)
{
    reader r = {.words = {.name = name, .bytes = bytes, .size = size, .error = error, .error_size = error_size}};
    kn_simplices *s = NULL;
    if (size == 0) complain(&r, 0, "empty, expected a Gmsh mesh that begins with $MeshFormat");
    else if (read_sections(&r)) s = build(&r, units_per_m, facts);
    free(r.x);
    free(r.tag);
    free(r.found);
    return s;
}

kn_simplices *kn_msh_load(const char *path, double units_per_m, kn_msh_facts *facts, char *error, size_t error_size)
{
    size_t size;
    unsigned char *bytes = kn_words_load(path, &size, error, error_size);
    kn_simplices *s = bytes ? kn_msh_read(path, bytes, size, units_per_m, facts, error, error_size) : NULL;
    free(bytes);
    return s;
}
