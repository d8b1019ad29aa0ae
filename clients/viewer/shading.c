#include "clients/viewer/shading.h"
#include "clients/viewer/camera.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- normals and lines of a mesh

// Cosine of 40 degrees, the smallest angle between two triangles that meet in a crease. The angle is 90 degrees at the
// edges of a block, and 22 degrees between the facets of a cylinder with 16 sides.
#define CREASE_COS 0.766f
#define COPLANAR_COS 0.9999f // cosine of 0.8 degrees, the largest angle between two triangles that count as coplanar

typedef struct half_edge { // a side of a triangle
    // Vertices of the side in ascending order, so that the half edges of two neighbours compare equal.
    int low, high;
    int triangle, corner; // triangle: index of the triangle; corner: index of its corner opposite the side
} half_edge;

// Compare two half edges by their vertices, so that after sorting the half edges of neighbours are adjacent. If the
// vertices are equal, compare the indices of the triangles, so that the order is unique.
static int compare(const void *pa, const void *pb)
{
    const half_edge *a = pa, *b = pb;
    if (a->low != b->low) return a->low < b->low ? -1 : 1;
    if (a->high != b->high) return a->high < b->high ? -1 : 1;
    return a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static void subtract(float out[3], const float a[3], const float b[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

static void face_normal(const int t[3], const float (*xyz)[3], float normal[3])
{
    float u[3], v[3];
    subtract(u, xyz[t[1]], xyz[t[0]]);
    subtract(v, xyz[t[2]], xyz[t[0]]);
    kn_crossf(normal, u, v);
    kn_normalizef(normal);
}

// Return the squared length of the side opposite this corner.
static float side_squared(const int t[3], const float (*xyz)[3], int corner)
{
    float d[3];
    subtract(d, xyz[t[(corner + 1) % 3]], xyz[t[(corner + 2) % 3]]);
    return kn_dotf(d, d);
}

// Return whether the side opposite this corner is clearly the longest of the triangle.
static bool longest(const int t[3], const float (*xyz)[3], int corner)
{
    float own = 0.999f * side_squared(t, xyz, corner);
    return own > side_squared(t, xyz, (corner + 1) % 3) && own > side_squared(t, xyz, (corner + 2) % 3);
}

// Return the representative of the set that contains `i` (union-find with path halving).
static int root(int *parent, int i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

// Let two neighbouring triangles share normals: at both ends of their common side, join the corners of the two
// triangles into one group.
static void join_corners(kn_shaded_mesh *s, const half_edge *a, const half_edge *b)
{
    for (int i = 1; i < 3; i++) {
        for (int j = 1; j < 3; j++) {
            int corner_a = 3 * a->triangle + (a->corner + i) % 3, corner_b = 3 * b->triangle + (b->corner + j) % 3;
            if (s->triangle[corner_a] == s->triangle[corner_b])
                s->group[root(s->group, corner_a)] = root(s->group, corner_b);
        }
    }
}

// Compare two neighbouring triangles at rest. If their common side is smooth, let them share normals. If the side is
// the diagonal of a quad, do not draw it as a line.
static void meet(kn_shaded_mesh *s, const float (*rest)[3], const half_edge *a, const half_edge *b)
{
    const int *ta = s->triangle + 3 * a->triangle, *tb = s->triangle + 3 * b->triangle;
    float na[3], nb[3];
    face_normal(ta, rest, na);
    face_normal(tb, rest, nb);
    float cosine = kn_dotf(na, nb);
    if (cosine > CREASE_COS) join_corners(s, a, b);
    // The diagonal of a quad is the longest side of both of its triangles.
    if (cosine > COPLANAR_COS && longest(ta, rest, a->corner) && longest(tb, rest, b->corner))
        s->line[3 * a->triangle + a->corner] = s->line[3 * b->triangle + b->corner] = false;
}

// Number the groups of corners that share a normal 0, 1, 2 ..., in the order of their root corners.
static void number_groups(kn_shaded_mesh *s)
{
    int corners = 3 * s->triangle_count, *number = s->group;
    for (int i = 0; i < corners; i++) number[i] = root(number, i);
    // Every corner now refers to the root of its group. Each root gets the number n of its group, stored as ~n, which
    // is not a valid index. The other corners of the group then read n from the root.
    for (int i = 0; i < corners; i++)
        if (number[i] == i) number[i] = ~s->group_count++;
    for (int i = 0; i < corners; i++)
        if (number[i] >= 0) number[i] = ~number[number[i]];
    for (int i = 0; i < corners; i++)
        if (number[i] < 0) number[i] = ~number[i];
}

// Find the neighbours of all triangles, and determine groups and lines.
static bool find_neighbours(kn_shaded_mesh *s, const float (*rest)[3])
{
    int count = 3 * s->triangle_count;
    half_edge *edge = malloc((size_t)count * sizeof *edge);
    if (!edge) return false;
    // Each corner starts as a group of its own, and each side as a line.
    for (int i = 0; i < count; i++) {
        const int *t = s->triangle + i - i % 3;
        int p = t[(i + 1) % 3], q = t[(i + 2) % 3];
        edge[i] = (half_edge){p < q ? p : q, p < q ? q : p, i / 3, i % 3};
        s->group[i] = i;
        s->line[i] = true;
    }
    qsort(edge, (size_t)count, sizeof *edge, compare);
    // After sorting, the half edges of a shared side are adjacent.
    for (int i = 0; i + 1 < count; i++)
        if (edge[i].low == edge[i + 1].low && edge[i].high == edge[i + 1].high) meet(s, rest, &edge[i], &edge[i + 1]);
    free(edge);
    number_groups(s);
    return true;
}

static bool fill(kn_shaded_mesh *s, const float (*rest)[3], const int (*triangle)[3])
{
    size_t corners = 3 * (size_t)s->triangle_count;
    s->triangle = malloc(corners * sizeof *s->triangle);
    s->group = malloc(corners * sizeof *s->group);
    s->line = malloc(corners * sizeof *s->line);
    if (!s->triangle || !s->group || !s->line) return false;
    memcpy(s->triangle, triangle, corners * sizeof *s->triangle);
    if (!find_neighbours(s, rest)) return false;
    s->normal = malloc(3 * (size_t)s->group_count * sizeof *s->normal);
    for (int i = 0; i < 3; i++) {
        s->rest_low[i] = s->rest_high[i] = rest[0][i];
        for (int v = 1; v < s->vertex_count; v++) {
            s->rest_low[i] = fminf(s->rest_low[i], rest[v][i]);
            s->rest_high[i] = fmaxf(s->rest_high[i], rest[v][i]);
        }
    }
    return s->normal != NULL;
}

kn_shaded_mesh *kn_shaded_mesh_create(int vertex_count, const float (*rest)[3], int triangle_count,
                                      const int (*triangle)[3])
{
    if (vertex_count < 3 || vertex_count > KN_SHADED_VERTICES_MAX) return NULL;
    if (triangle_count < 1 || triangle_count > 2 * KN_SHADED_VERTICES_MAX) return NULL;
    // Triangles may come from the bus, so check the indices of their vertices.
    for (int i = 0; i < 3 * triangle_count; i++)
        if (triangle[i / 3][i % 3] < 0 || triangle[i / 3][i % 3] >= vertex_count) return NULL;
    kn_shaded_mesh *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->vertex_count = vertex_count;
    s->triangle_count = triangle_count;
    if (fill(s, rest, triangle)) return s;
    kn_shaded_mesh_destroy(s);
    return NULL;
}

void kn_shaded_mesh_destroy(kn_shaded_mesh *s)
{
    if (!s) return;
    free(s->triangle);
    free(s->group);
    free(s->line);
    free(s->normal);
    free(s);
}

// Return the angle of the triangle at this corner. atan2 is accurate for flat and for thin triangles.
static float corner_angle(const int t[3], const float (*xyz)[3], int corner)
{
    float u[3], v[3], c[3];
    subtract(u, xyz[t[(corner + 1) % 3]], xyz[t[corner]]);
    subtract(v, xyz[t[(corner + 2) % 3]], xyz[t[corner]]);
    kn_crossf(c, u, v);
    return atan2f(sqrtf(kn_dotf(c, c)), kn_dotf(u, v));
}

// Return whether all positions of the triangle are finite.
static bool whole(const int t[3], const float (*xyz)[3])
{
    float sum = 0;
    // A finite coordinate adds 0 to the sum. An infinite coordinate or a NaN makes the sum NaN.
    for (int i = 0; i < 9; i++) sum += 0 * xyz[t[i / 3]][i % 3];
    return sum == 0;
}

void kn_shaded_mesh_corners(kn_shaded_mesh *s, const float (*xyz)[3], float *out)
{
    // Sum the face normals of each group, weighted by the angle of the corner.
    memset(s->normal, 0, 3 * (size_t)s->group_count * sizeof *s->normal);
    for (int t = 0; t < s->triangle_count; t++) {
        const int *triangle = s->triangle + 3 * t;
        if (!whole(triangle, xyz)) continue;
        float n[3];
        face_normal(triangle, xyz, n);
        for (int corner = 0; corner < 3; corner++) {
            float angle = corner_angle(triangle, xyz, corner), *sum = s->normal + 3 * s->group[3 * t + corner];
            for (int i = 0; i < 3; i++) sum[i] += angle * n[i];
        }
    }
    for (int g = 0; g < s->group_count; g++) kn_normalizef(s->normal + 3 * g);
    // Move all corners of a triangle with a position that is not finite to one point, so that it is not visible.
    for (int i = 0; i < 3 * s->triangle_count; i++) {
        const float *at = whole(s->triangle + i - i % 3, xyz) ? xyz[s->triangle[i]] : s->rest_low;
        memcpy(out + 6 * i, at, 3 * sizeof *out);
        memcpy(out + 6 * i + 3, s->normal + 3 * s->group[i], 3 * sizeof *out);
    }
}

// ---- triangles in OpenGL's memory

kn_gl_mesh kn_gl_mesh_create(const kn_gl *gl)
{
    kn_gl_mesh s = {0};
    gl->GenVertexArrays(1, &s.array);
    gl->BindVertexArray(s.array);
    gl->GenBuffers(1, &s.buffer);
    gl->BindBuffer(GL_ARRAY_BUFFER, s.buffer);
    // Define vertex attributes 0 and 1: position and normal, interleaved in one buffer.
    for (GLuint i = 0; i < 2; i++) {
        gl->VertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, 6 * sizeof(float), (const void *)(i * 3 * sizeof(float)));
        gl->EnableVertexAttribArray(i);
    }
    gl->GenBuffers(1, &s.sides);
    gl->GenBuffers(1, &s.values);
    return s;
}

void kn_gl_mesh_upload(const kn_gl *gl, kn_gl_mesh *s, int corners, const float *data, GLenum usage)
{
    s->corners = corners;
    gl->BindBuffer(GL_ARRAY_BUFFER, s->buffer);
    gl->BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)((size_t)corners * 6 * sizeof *data), data, usage);
}

// Build rings of vertices along the profile, and join neighbouring rings by two triangles per segment.
kn_gl_mesh kn_gl_mesh_revolve(const kn_gl *gl, int count, const float (*profile)[2], int segments)
{
    enum { RINGS = 17, SEGMENTS = 32 };
    float xyz[RINGS * SEGMENTS][3], corners[2 * RINGS * SEGMENTS * 18];
    int triangle[2 * RINGS * SEGMENTS][3], triangles = 0;
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < segments; j++) {
            float angle = 6.2831853f * ((float)j + 0.5f) / (float)segments;
            int next = (j + 1) % segments, a = i * segments + j, b = i * segments + next;
            xyz[a][0] = profile[i][0] * cosf(angle);
            xyz[a][1] = profile[i][0] * sinf(angle);
            xyz[a][2] = profile[i][1];
            if (i + 1 == count) continue;
            // A ring of radius 0 is a single point. Leave out the triangle that would have no area at this ring.
            int c = b + segments, d = a + segments;
            if (profile[i][0] > 0) memcpy(triangle[triangles++], (int[]){a, b, c}, sizeof *triangle);
            if (profile[i + 1][0] > 0) memcpy(triangle[triangles++], (int[]){a, c, d}, sizeof *triangle);
        }
    }
    kn_gl_mesh s = kn_gl_mesh_create(gl);
    // Compute the normals as for the surface of an object: smooth, except at creases.
    kn_shaded_mesh *mesh =
        kn_shaded_mesh_create(count * segments, (const float(*)[3])xyz, triangles, (const int(*)[3])triangle);
    if (!mesh) return s; // memory is short, so return an empty mesh
    kn_shaded_mesh_corners(mesh, (const float(*)[3])xyz, corners);
    kn_shaded_mesh_destroy(mesh);
    kn_gl_mesh_upload(gl, &s, 3 * triangles, corners, GL_STATIC_DRAW);
    return s;
}

// ---- shaders

__asm__(".section .rodata\n.globl kn_shader_text\nkn_shader_text: .incbin \"" KN_VIEWER_DIR
        "/shaders.glsl\"\n.byte 0\n.previous\n");

// Compile and link a program. `vertex`, `fragment`: lines that select the main functions in shaders.glsl. On failure
// return 0 and put the compiler's message in error.
static GLuint create_program(const kn_gl *gl, const char *vertex, const char *fragment, char *error, size_t error_size)
{
    const char *source[2][3] = {{"#version 330 core\n", vertex, kn_shader_text},
                                {"#version 330 core\n", fragment, kn_shader_text}};
    const GLenum kind[2] = {GL_VERTEX_SHADER, GL_FRAGMENT_SHADER};
    GLuint program = gl->CreateProgram();
    for (int i = 0; i < 2; i++) {
        GLuint shader = gl->CreateShader(kind[i]);
        gl->ShaderSource(shader, 3, source[i], NULL);
        gl->CompileShader(shader);
        gl->AttachShader(program, shader);
        gl->DeleteShader(shader); // OpenGL keeps the shader until the program is deleted
    }
    gl->LinkProgram(program); // if a shader did not compile, linking fails and the log contains the shader's error
    GLint linked = 0;
    gl->GetProgramiv(program, GL_LINK_STATUS, &linked);
    if (linked) return program;
    char log[256] = "";
    gl->GetProgramInfoLog(program, sizeof log, NULL, log);
    snprintf(error, error_size, "the shaders do not compile on this OpenGL: %s", log);
    gl->DeleteProgram(program);
    return 0;
}

bool kn_shader_programs_create(const kn_gl *gl, kn_shader_programs *p, char *error, size_t error_size)
{
#define PROGRAM(name) create_program(gl, "#define " name "_VERTEX\n", "#define " name "_FRAGMENT\n", error, error_size)
    p->depth = PROGRAM("DEPTH");
    p->solid = PROGRAM("SOLID");
    p->table = PROGRAM("TABLE");
    p->edge = PROGRAM("EDGE");
#undef PROGRAM
    return p->depth && p->solid && p->table && p->edge;
}
