#include "core/scene/mesh_file.h"
#include <ctype.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct corner { // corner of a triangle in the file, before corners at the same position are merged
    double x[3];
    int number; // number of the corner: 3 times the index of the triangle, plus 0, 1 or 2
} corner;

typedef struct place { // place of a triangle in the file
    size_t at;
    int number; // number of the triangle in the order of the file, from 1
} place;

typedef struct reader {
    kn_words words;
    corner *corner;
    place *place; // [triangles] place of each triangle in the file
    int triangles, room;
} reader;

#define complain(r, ...) kn_words_complain(&(r)->words, __VA_ARGS__)

// Return true if the path ends in `end`, in upper or lower case.
static bool ends_in(const char *path, const char *end)
{
    size_t size = strlen(path), tail = strlen(end);
    for (size_t i = 0; size > tail && i < tail; i++)
        if (tolower((unsigned char)path[size - tail + i]) != end[i]) return false;
    return size > tail;
}

bool kn_shell_named(const char *path) { return ends_in(path, ".obj") || ends_in(path, ".stl"); }

// Add a triangle whose text begins at byte `at` of the file.
static bool add(reader *r, size_t at, const double x[3][3])
{
    if (r->triangles == KN_SHELL_TRIANGLES_MAX)
        return complain(r, at, "more than %d triangles, expected a coarser surface", KN_SHELL_TRIANGLES_MAX);
    // double the size of both arrays when they are full
    if (r->triangles == r->room) {
        int room = r->room ? 2 * r->room : 1024;
        corner *more = realloc(r->corner, 3 * (size_t)room * sizeof *more);
        if (more) r->corner = more;
        place *places = more ? realloc(r->place, (size_t)room * sizeof *places) : NULL;
        if (!places) return complain(r, at, "not enough memory for the surface");
        r->place = places;
        r->room = room;
    }
    for (int k = 0; k < 3; k++) {
        corner *c = &r->corner[3 * r->triangles + k];
        c->number = 3 * r->triangles + k;
        memcpy(c->x, x[k], sizeof c->x);
    }
    r->place[r->triangles] = (place){at, r->triangles + 1};
    r->triangles++;
    return true;
}

// ---- STL

// Bytes of a binary STL file: the head (80 free bytes and the count of triangles), and each triangle (normal, three
// corners and two unused bytes).
enum { STL_HEAD = 84, STL_EACH = 50 };

// Return true if an STL file is binary, i.e. if its head has a NUL byte. The first word "solid" of a text file does not
// tell, because the free bytes of a binary file may begin with "solid", too.
static bool is_binary_stl(const kn_words *w) { return memchr(w->bytes, 0, w->size < STL_HEAD ? w->size : STL_HEAD); }

// Read a binary STL file. The normals are ignored, and so is what some programs append after the last triangle: if the
// count left triangles out, the surface would have holes.
static bool read_binary_stl(reader *r)
{
    uint32_t count = 0;
    r->words.binary = true;
    if (r->words.size >= STL_HEAD) memcpy(&count, r->words.bytes + STL_HEAD - sizeof count, sizeof count);
    const size_t end = STL_HEAD + STL_EACH * (size_t)count;
    if (r->words.size < end)
        return complain(r, STL_HEAD - sizeof count, "%u triangles are declared, expected %zu bytes for them, not %zu",
                        count, end, r->words.size);
    for (size_t at = STL_HEAD; at < end; at += STL_EACH) {
        float corners[9];
        double x[3][3];
        memcpy(corners, r->words.bytes + at + 12, sizeof corners);
        for (int k = 0; k < 9; k++) {
            x[k / 3][k % 3] = corners[k];
            if (!isfinite(corners[k])) return complain(r, at + 12, "not a finite number, expected a coordinate");
        }
        if (!add(r, at, x)) return false;
    }
    return true;
}

// Read the next word in small letters. Return false at the end of the file.
static bool next_keyword(reader *r, char text[KN_WORD_MAX])
{
    const bool more = kn_words_next(&r->words, text) > 0;
    for (char *c = text; more && *c; c++) *c = (char)tolower((unsigned char)*c);
    return more;
}

static void skip_line(kn_words *w)
{
    while (w->at < w->size && w->bytes[w->at] != '\n' && w->bytes[w->at] != '\r') w->at++;
}

// Read a text STL file. Only the words facet, vertex and endfacet matter, in letters of any size; other words are
// skipped.
static bool read_text_stl(reader *r)
{
    char text[KN_WORD_MAX];
    double x[3][3];
    size_t at = 0;
    int corners = 0;
    r->words.section = "a facet";
    if (!next_keyword(r, text) || strcmp(text, "solid") != 0)
        return complain(r, r->words.begun, "not an STL file: neither binary nor text, expected 'solid'");
    skip_line(&r->words); // the solid's name
    while (next_keyword(r, text)) {
        if (strcmp(text, "solid") == 0 || strcmp(text, "endsolid") == 0) skip_line(&r->words);
        if (strcmp(text, "facet") == 0) at = r->words.begun, corners = 0;
        if (strcmp(text, "endfacet") == 0 && corners != 3)
            return complain(r, r->words.begun, "a facet of %d corners, expected 3", corners);
        if (strcmp(text, "vertex") != 0) continue;
        if (corners == 3) return complain(r, r->words.begun, "a fourth corner, expected 3 in a facet");
        for (int k = 0; k < 3; k++)
            if (!kn_words_real(&r->words, &x[corners][k])) return false;
        if (++corners == 3 && !add(r, at, x)) return false;
    }
    if (corners == 0 || corners == 3) return true;
    return complain(r, r->words.size, "the file ends within a facet, expected 3 corners");
}

// ---- OBJ

typedef struct points { // points of an OBJ file that have been read so far
    double (*x)[3];
    long count, room;
} points;

// Return true if another word follows on the same line. A backslash at its end joins the next line to it.
static bool more_on_line(kn_words *w)
{
    for (; w->at < w->size; w->at++) {
        const char c = (char)w->bytes[w->at];
        const size_t next = w->at + 1 + (w->at + 1 < w->size && w->bytes[w->at + 1] == '\r');
        if (c == '\\' && next < w->size && w->bytes[next] == '\n') w->at = next;
        else if (c != ' ' && c != '\t') return c != '\n' && c != '\r' && c != '#';
    }
    return false;
}

// Read the coordinates of a point of an OBJ file.
static bool add_point(reader *r, points *p)
{
    if (p->count == p->room) {
        p->room = p->room ? 2 * p->room : 1024;
        double(*more)[3] = realloc(p->x, (size_t)p->room * sizeof *more);
        if (!more) return complain(r, r->words.begun, "not enough memory for the surface");
        p->x = more;
    }
    double *x = p->x[p->count++];
    return kn_words_real(&r->words, &x[0]) && kn_words_real(&r->words, &x[1]) && kn_words_real(&r->words, &x[2]);
}

// Read a corner of a face in an OBJ file: "7" or "7/1/2" is point 7 of the file, "-1" is the point read last.
static bool take_corner(reader *r, const points *p, double x[3])
{
    char text[KN_WORD_MAX], *end;
    kn_words_next(&r->words, text);
    long number = strtol(text, &end, 10);
    if (number < 0) number += p->count + 1;
    if (end == text || (*end && *end != '/') || number < 1 || number > p->count)
        return complain(r, r->words.begun, "no vertex so far with this number, expected 1 to %ld", p->count);
    memcpy(x, p->x[number - 1], sizeof p->x[0]);
    return true;
}

// Read a face and split it into a fan of triangles about its first corner.
static bool take_face(reader *r, const points *p)
{
    size_t at = r->words.begun;
    double x[3][3];
    int corners = 0;
    // x[0] is the first corner of the face, x[1] the previous corner, x[2] the new corner
    for (; more_on_line(&r->words); corners++) {
        if (!take_corner(r, p, x[corners < 2 ? corners : 2])) return false;
        if (corners < 2) continue;
        if (!add(r, at, x)) return false;
        memcpy(x[1], x[2], sizeof x[1]);
    }
    return corners >= 3 || complain(r, at, "a face of %d corners, expected 3 or more", corners);
}

// Read the points and faces of an OBJ file; ignore all other lines.
static bool read_obj_lines(reader *r, points *p)
{
    char text[KN_WORD_MAX];
    while (kn_words_next(&r->words, text) > 0) {
        if (strcmp(text, "v") == 0 && !add_point(r, p)) return false;
        if (strcmp(text, "f") == 0 && !take_face(r, p)) return false;
        skip_line(&r->words);
    }
    return true;
}

static bool read_obj(reader *r)
{
    points p = {.count = 0};
    r->words.section = "a vertex";
    if (r->words.size >= 3 && memcmp(r->words.bytes, "\xef\xbb\xbf", 3) == 0) r->words.at = 3; // byte order mark
    bool good = read_obj_lines(r, &p);
    free(p.x);
    return good;
}

// ---- triangles to surface

// Corners that are closer together than this share of the surface's largest extent are one vertex: programs write
// numbers of six digits and more, and round a corner differently in each triangle.
#define WELD 5e-6

// Return a coordinate along a slanted axis: few corners of a surface with flat sides share it.
static double slant(const double x[3]) { return 0.61 * x[0] + 0.29 * x[1] + 0.1 * x[2]; }

static int by_slant(const void *a, const void *b)
{
    const corner *p = a, *q = b;
    const double u = slant(p->x), v = slant(q->x);
    return u != v ? (u < v ? -1 : 1) : p->number - q->number;
}

// Merge corners at the same place into one vertex, and count those that were apart. Then drop triangles of which two
// corners are the same vertex.
static kn_shell *weld(reader *r)
{
    size_t corners = 3 * (size_t)r->triangles;
    double most = 0, low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    kn_shell *s = calloc(1, sizeof *s);
    if (!s || corners == 0) return s;
    s->x = malloc((corners + 1) * sizeof *s->x);
    s->triangle = malloc((corners / 3 + 1) * sizeof *s->triangle);
    if (!s->x || !s->triangle) return kn_shell_destroy(s), NULL;
    for (size_t i = 0; i < corners; i++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], r->corner[i].x[k]);
            high[k] = fmax(high[k], r->corner[i].x[k]);
            most = fmax(most, high[k] - low[k]);
        }
    // after sorting, the vertices that may be the same as a corner are the last ones
    qsort(r->corner, corners, sizeof *r->corner, by_slant);
    for (size_t i = 0; i < corners; i++) {
        const corner *c = &r->corner[i];
        int v = s->vertex_count;
        double apart = INFINITY;
        while (v-- > 0 && slant(c->x) - slant(s->x[v]) <= WELD * most && apart > WELD * most)
            apart = fmax(fmax(fabs(c->x[0] - s->x[v][0]), fabs(c->x[1] - s->x[v][1])), fabs(c->x[2] - s->x[v][2]));
        v = apart > WELD * most ? s->vertex_count++ : v + 1;
        if (apart > WELD * most) memcpy(s->x[v], c->x, sizeof c->x);
        else if (apart > 0) s->welded++, s->gap = fmax(s->gap, apart);
        s->triangle[c->number / 3][c->number % 3] = v;
    }
    for (int t = 0; t < r->triangles; t++) {
        const int *v = s->triangle[t];
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
        r->place[s->triangle_count] = r->place[t];
        memmove(s->triangle[s->triangle_count++], v, sizeof *s->triangle);
    }
    return s;
}

typedef struct edge { // a side of a triangle
    int low, high;    // vertices at the two ends, low < high
    int triangle;
    bool forward; // the corners of the triangle follow the edge from `low` to `high`
} edge;

static int by_vertices(const void *a, const void *b)
{
    const edge *p = a, *q = b;
    if (p->low != q->low) return p->low < q->low ? -1 : 1;
    if (p->high != q->high) return p->high < q->high ? -1 : 1;
    return p->triangle - q->triangle;
}

static bool same_edge(const edge *p, const edge *q) { return p->low == q->low && p->high == q->high; }

// List the three sides of every triangle.
static void list_edges(const kn_shell *s, edge *e)
{
    for (int t = 0; t < s->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            int from = s->triangle[t][k], to = s->triangle[t][(k + 1) % 3];
            bool forward = from < to;
            *e++ = (edge){forward ? from : to, forward ? to : from, t, forward};
        }
}

// Return the triangle that represents the connected part to which triangle `t` belongs (union-find, path halving).
static int root_of(int *parent, int t)
{
    while (parent[t] != t) t = parent[t] = parent[parent[t]];
    return t;
}

// Check that every edge belongs to two triangles, which run along the edge in opposite directions. Join triangles that
// share an edge into connected parts.
static bool check_edges(reader *r, const kn_shell *s, const edge *e, int *parent)
{
    int count = 3 * s->triangle_count, open = 0, first = -1;
    for (int t = 0; t < s->triangle_count; t++) parent[t] = t;
    for (int i = 0, n; i < count; i += n) {
        // count the triangles that share the edge e[i]
        for (n = 1; i + n < count && same_edge(&e[i], &e[i + n]);) n++;
        int a = e[i].triangle, b = e[i + (n > 1)].triangle;
        const place *p = &r->place[a], *q = &r->place[b];
        if (n > 2)
            return complain(r, q->at, "triangles %d, %d and %d share one edge, expected two at every edge", p->number,
                            q->number, r->place[e[i + 2].triangle].number);
        if (n == 2 && e[i].forward == e[i + 1].forward)
            return complain(r, q->at, "triangles %d and %d face opposite ways, expected all to face outwards",
                            p->number, q->number);
        // count edges that belong to only one triangle, and keep the first triangle of the file with such an edge
        if (n == 1 && (open++ == 0 || a < first)) first = a;
        parent[root_of(parent, b)] = root_of(parent, a);
    }
    if (open == 0) return true;
    return complain(r, r->place[first].at,
                    "the surface has holes: %d edges belong to one triangle only, the first to "
                    "triangle %d; expected a closed surface",
                    open, r->place[first].number);
}

// Check that all triangles belong to one connected part.
static bool check_parts(reader *r, const kn_shell *s, int *parent)
{
    int parts = 0, other = 0;
    for (int t = 0; t < s->triangle_count; t++) {
        parts += parent[t] == t;
        if (other == 0 && root_of(parent, t) != root_of(parent, 0)) other = t;
    }
    return parts == 1 || complain(r, r->place[other].at,
                                  "%d closed surfaces, expected one: triangle %d does not belong to "
                                  "the first",
                                  parts, r->place[other].number);
}

// Check that the surface is closed, that all triangles face the same way, and that the surface is one connected part.
static bool check(reader *r, const kn_shell *s)
{
    if (s->triangle_count == 0) return complain(r, 0, "no triangles, expected a closed surface");
    size_t count = (size_t)s->triangle_count;
    edge *e = malloc(3 * count * sizeof *e);
    int *parent = malloc(count * sizeof *parent);
    bool room = e && parent;
    if (room) {
        list_edges(s, e);
        qsort(e, 3 * count, sizeof *e, by_vertices);
    }
    bool good = room ? check_edges(r, s, e, parent) && check_parts(r, s, parent)
                     : complain(r, 0, "not enough memory for the surface");
    free(e);
    free(parent);
    return good;
}

// Compute extent and volume of a closed surface. The volume is a sum over the triangles: each adds the signed volume of
// the tetrahedron between the triangle and the lowest corner of the bounding box.
static void measure(kn_shell *s)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < s->vertex_count; i++)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], s->x[i][k]);
            high[k] = fmax(high[k], s->x[i][k]);
        }
    s->extent = fmax(high[0] - low[0], fmax(high[1] - low[1], high[2] - low[2]));
    for (int t = 0; t < s->triangle_count; t++) {
        double a[3], b[3], c[3]; // corners of the triangle, relative to the lowest corner of the box
        for (int k = 0; k < 3; k++) {
            a[k] = s->x[s->triangle[t][0]][k] - low[k];
            b[k] = s->x[s->triangle[t][1]][k] - low[k];
            c[k] = s->x[s->triangle[t][2]][k] - low[k];
        }
        s->volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                      a[2] * (b[0] * c[1] - b[1] * c[0])) /
                     6;
    }
    s->volume = fabs(s->volume); // the sum is negative if all triangles face inwards, which is allowed
}

// Read the triangles of a file. The ending of the file's name tells the format.
static bool read_file(reader *r)
{
    if (ends_in(r->words.name, ".obj")) return read_obj(r);
    return is_binary_stl(&r->words) ? read_binary_stl(r) : read_text_stl(r);
}

kn_shell *kn_shell_read(const char *name, const void *bytes, size_t size, char *error, size_t error_size)
{
    reader r = {.words = {.name = name, .bytes = bytes, .size = size, .error = error, .error_size = error_size}};
    kn_shell *s = NULL;
    if (size == 0) complain(&r, 0, "empty, expected a closed surface");
    else if (read_file(&r) && !(s = weld(&r))) complain(&r, 0, "not enough memory for the surface");
    if (s && !check(&r, s)) {
        kn_shell_destroy(s);
        s = NULL;
    }
    // refuse a flat surface, which encloses no volume
    if (s) measure(s);
    if (s && !(s->volume > 1e-9 * s->extent * s->extent * s->extent)) {
        complain(&r, 0, "the surface encloses no volume, expected a body");
        kn_shell_destroy(s);
        s = NULL;
    }
    free(r.corner);
    free(r.place);
    return s;
}

kn_shell *kn_shell_load(const char *path, char *error, size_t error_size)
{
    size_t size;
    unsigned char *bytes = kn_words_load(path, &size, error, error_size);
    kn_shell *s = bytes ? kn_shell_read(path, bytes, size, error, error_size) : NULL;
    free(bytes);
    return s;
}

void kn_shell_destroy(kn_shell *shell)
{
    if (!shell) return;
    free(shell->x);
    free(shell->triangle);
    free(shell);
}

// ---- output for gmsh and tetgen

// Close a file after writing. Return true if all data were written without error.
static bool finish(FILE *f)
{
    bool good = f && !ferror(f);
    return f && fclose(f) == 0 && good;
}

bool kn_shell_write_stl(const kn_shell *s, const char *path)
{
    FILE *f = fopen(path, "w");
    if (f) fprintf(f, "solid shell\n");
    for (int t = 0; f && t < s->triangle_count; t++) {
        fprintf(f, "facet normal 0 0 0\nouter loop\n");
        for (int k = 0; k < 3; k++) {
            const double *x = s->x[s->triangle[t][k]];
            fprintf(f, "vertex %.17g %.17g %.17g\n", x[0], x[1], x[2]);
        }
        fprintf(f, "endloop\nendfacet\n");
    }
    if (f) fprintf(f, "endsolid shell\n");
    return finish(f);
}

bool kn_shell_write_off(const kn_shell *s, const char *path)
{
    FILE *f = fopen(path, "w");
    if (f) fprintf(f, "OFF\n%d %d 0\n", s->vertex_count, s->triangle_count);
    for (int i = 0; f && i < s->vertex_count; i++)
        fprintf(f, "%.17g %.17g %.17g\n", s->x[i][0], s->x[i][1], s->x[i][2]);
    for (int t = 0; f && t < s->triangle_count; t++)
        fprintf(f, "3 %d %d %d\n", s->triangle[t][0], s->triangle[t][1], s->triangle[t][2]);
    return finish(f);
}
